"""What all methods are made of: sweeps in any order, the product with the Delassus operator, and the record of errors.

A method is a function ``run(system, iterations, parameters, log)``. It changes impulses and velocities of the system, and returns
the number of iterations done. If the log has rows, iteration k leaves its errors and its sweep-equivalents in row k, and the
method ends once its residual is below ``log.stop``; without rows nothing but the method itself is done, which is what is timed.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np

from multicor_cli.engine.contact.residual import measure_residual
from multicor_cli.engine.contact.sweep import EXACT, Relaxation, System, general_velocity, relax_general, relax_light
from multicor_cli.engine.jit.formulas import F, formula
from multicor_cli.model.columns import BIAS, FIRST, MU, NORMAL, NX, NY, SECOND, TANGENTIAL, W_NN, W_TT
from multicor_cli.model.model import Floats


def kernel(function: F) -> F:
    """As that of the program, but compiled anew in each run: its cache would not notice changes in these files."""
    return numba.njit(error_model="numpy")(function)  # type: ignore[return-value]


RMS, MAXIMUM, ENERGY, DISTANCE, WORK, TIME = range(6)
"""Columns of a history; methods that time themselves fill the last one [s]."""
COLUMNS = 6


class Log(NamedTuple):
    """What a method is watched with.

    Attributes:
        rows: One for each iteration, see `RMS` and following; none if it is not recorded. **Modified.**
        stop: rms and maximum [m/s] and energy [J] at which a method may stop.
        reference: Velocities of a solution, as those of `System`, bodies only.
        weight: Mass of each velocity over the mass of all bodies, shape ``(b, 4)``, 0 where nothing can be moved.
    """

    rows: Floats
    stop: Floats
    reference: Floats
    weight: Floats


@kernel
def distance(velocity: Floats, reference: Floats, weight: Floats) -> float:
    """Root of the weighted sum of the squares of the differences between velocities [m/s]."""
    total = 0.0
    for b in range(reference.shape[0]):
        for d in range(3):
            total += weight[b, d] * (velocity[b, d] - reference[b, d]) ** 2
    return float(np.sqrt(total))


@kernel
def record(s: System, log: Log, row: int, work: float) -> bool:
    """Write the errors of the present iterate into a row of the log; whether all three residuals are below ``log.stop``."""
    if row >= log.rows.shape[0]:
        return False
    rms, largest, energy, _ = measure_residual(s, False)
    out = log.rows[row]
    out[RMS], out[MAXIMUM], out[ENERGY], out[WORK] = rms, largest, energy, work
    out[DISTANCE] = distance(s.velocity, log.reference, log.weight)
    return bool(rms <= log.stop[0] and largest <= log.stop[1] and energy <= log.stop[2])


@kernel
def sweep_backward(s: System) -> float:
    """As `engine.contact.sweep.sweep`, in the opposite order; returns the sum of the squared velocity corrections [m²/s²]."""
    velocity, pair, frame, impulse = s.velocity.reshape(-1), s.pair.reshape(-1), s.frame.reshape(-1), s.impulse.reshape(-1)
    total, count, generals = 0.0, s.pair.shape[0], s.general_pair.shape[0]
    way = Relaxation(1.0, 1.0)
    for g in range(generals):
        total += relax_general(generals - 1 - g, s, EXACT)
    for k in range(count):
        total += relax_light(np.uint64(count - 1 - k), velocity, pair, frame, impulse, s.spin_factor, EXACT, way)
    return total


@formula
def _push(body: np.uint32, px: float, py: float, spin: float, bodies: Floats, velocity: Floats) -> None:
    """Change the velocity of a body of a light contact by an impulse [N s]; ``bodies`` has the inverse mass."""
    inverse = bodies[body, 3]
    velocity[body, 0] += inverse * px
    velocity[body, 1] += inverse * py
    velocity[body, 2] -= inverse * spin


@kernel
def _push_general(g: int, d_n: float, d_t: float, s: System, velocity: Floats) -> None:
    """Change the velocities of the bodies of general contact ``g`` by an impulse [N s]."""
    f, lever = s.general_frame[g], s.general_lever[g]
    px, py = d_n * f[NX] - d_t * f[NY], d_n * f[NY] + d_t * f[NX]
    a, b = s.general_pair[g, 0], s.general_pair[g, 1]
    velocity[a, 0] += s.inverse[a, 0] * px
    velocity[a, 1] += s.inverse[a, 1] * py
    velocity[a, 2] += s.inverse[a, 2] * (d_n * lever[FIRST, NORMAL] + d_t * lever[FIRST, TANGENTIAL])
    velocity[b, 0] -= s.inverse[b, 0] * px
    velocity[b, 1] -= s.inverse[b, 1] * py
    velocity[b, 2] -= s.inverse[b, 2] * (d_n * lever[SECOND, NORMAL] + d_t * lever[SECOND, TANGENTIAL])


@kernel
def spread_impulses(s: System, impulse: Floats, velocity: Floats) -> None:
    """Add M⁻¹ H p to velocities; light contacts first in ``impulse``, then general ones."""
    pair, frame, bodies, beta = s.pair, s.frame, s.velocity, s.spin_factor
    lights = pair.shape[0]
    for k in range(lights):
        d_n, d_t = impulse[k, 0], impulse[k, 1]
        if d_n != 0.0 or d_t != 0.0:
            px, py = d_n * frame[k, 0] - d_t * frame[k, 1], d_n * frame[k, 1] + d_t * frame[k, 0]
            _push(np.uint32(pair[k, 0]), px, py, beta * d_t, bodies, velocity)
            _push(np.uint32(pair[k, 1]), -px, -py, beta * d_t, bodies, velocity)
    for g in range(s.general_pair.shape[0]):
        _push_general(g, impulse[lights + g, 0], impulse[lights + g, 1], s, velocity)


@kernel
def gather_velocities(s: System, velocity: Floats, with_bias: bool, relative: Floats) -> None:
    """Relative velocities Hᵀ v of all contacts (and the bias, if asked for), shape as the impulses."""
    pair, frame = s.pair, s.frame
    lights = pair.shape[0]
    for k in range(lights):
        i, j = np.uint32(pair[k, 0]), np.uint32(pair[k, 1])
        nx, ny = frame[k, 0], frame[k, 1]
        dx, dy = velocity[i, 0] - velocity[j, 0], velocity[i, 1] - velocity[j, 1]
        relative[k, 0] = dx * nx + dy * ny + (frame[k, 3] if with_bias else 0.0)
        relative[k, 1] = dy * nx - dx * ny - velocity[i, 2] - velocity[j, 2]
    moved = System(
        velocity, s.inverse, s.pair, s.frame, s.impulse, s.tile_start, s.color_start, s.general_pair, s.general_frame,
        s.general_lever, s.general_impulse, s.spin_factor,
    )  # fmt: skip
    for g in range(s.general_pair.shape[0]):
        u_n, u_t = general_velocity(g, moved)
        relative[lights + g, 0] = u_n - (0.0 if with_bias else s.general_frame[g, BIAS])
        relative[lights + g, 1] = u_t


@kernel
def contact_scales(s: System) -> Floats:
    """1/W_nn, 1/W_tt [kg] and μ of all contacts, light ones first, shape ``(k + g, 3)``."""
    lights, generals = s.pair.shape[0], s.general_pair.shape[0]
    scales = np.empty((lights + generals, 3))
    for k in range(lights):
        scales[k, 0], scales[k, 1] = s.frame[k, 2], s.frame[k, 2] / (1.0 + s.spin_factor)
        scales[k, 2] = s.frame[k, 4]
    for g in range(generals):
        f = s.general_frame[g]
        scales[lights + g, 0], scales[lights + g, 1], scales[lights + g, 2] = 1.0 / f[W_NN], 1.0 / f[W_TT], f[MU]
    return scales


@kernel
def all_impulses(s: System) -> Floats:
    """A copy of all impulses [N s], light contacts first, shape ``(k + g, 2)``."""
    lights = s.pair.shape[0]
    impulse = np.empty((lights + s.general_pair.shape[0], 2))
    impulse[:lights] = s.impulse
    impulse[lights:] = s.general_impulse
    return impulse


@kernel
def set_impulses(s: System, impulse: Floats) -> None:
    """Give the system other impulses, and the velocities that go with them."""
    lights = s.pair.shape[0]
    spread_impulses(s, impulse - all_impulses(s), s.velocity)
    s.impulse[:] = impulse[:lights]
    s.general_impulse[:] = impulse[lights:]


@formula
def cut_to_cone(p_n: float, p_t: float, mu: float) -> tuple[float, float]:
    """The nearest impulses along the tangent that Coulomb's law allows: p_n ≥ 0, then \\|p_t\\| ≤ μ p_n."""
    new_n = p_n if p_n > 0.0 else 0.0
    bound = mu * new_n
    return new_n, min(max(p_t, -bound), bound)
