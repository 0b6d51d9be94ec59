"""What all methods are made of: sweeps in any order, the product with the Delassus operator, and
the record of errors.

A method is a function ``run(system, iterations, parameters, log)``. It changes impulses and
velocities of the system, and returns the number of iterations done. If the log has rows, iteration
k leaves its errors and its sweep-equivalents in row k, and the method ends once its residual is
below ``log.stop``; without rows nothing but the method itself is done, which is what is timed.

Sweeps work on the batches of a system. Where a method has a row for each contact, these are the
diagonal ones in the order of the sweep, as `multicor_cli.engine.contact.system.flatten` gives them,
then the general ones.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np

from multicor_cli.engine.contact.residual import measure_residual
from multicor_cli.engine.contact.sweep import (
    EXACT,
    Before,
    Relaxation,
    System,
    general_velocity,
    push_general,
    push_lane,
    relax_general,
    relax_lane,
)
from multicor_cli.engine.contact.vector_sweep import (
    BIAS_,
    NY_,
    SECOND_,
    SURFACE_,
    Y_,
    frame_place,
    pair_place,
)
from multicor_cli.engine.jit.formulas import F, formula
from multicor_cli.engine.jit.vectors import LANES
from multicor_cli.model.columns import (
    BIAS,
    INVERSE_MASS,
    MASS,
    MU,
    NORMAL,
    SPIN,
    TANGENTIAL,
    W_NN,
    W_TT,
)
from multicor_cli.model.model import Floats


def kernel(function: F) -> F:
    """As that of the program, but compiled anew in each run: its cache would not notice changes in
    these files.
    """
    return numba.njit(error_model="numpy")(function)  # type: ignore[return-value]


RMS, MAXIMUM, ENERGY, DISTANCE, WORK, TIME = range(6)
"""Columns of a history; methods that time themselves fill the last one [s]."""
COLUMNS = 6


class Log(NamedTuple):
    """What a method is watched with.

    Attributes:
        rows: One for each iteration, see `RMS` and following; none if it is not recorded.
            **Modified.**
        stop: rms and maximum [m/s] and energy [J] at which a method may stop.
        reference: Velocities of a solution, as those of `System`, bodies only.
        weight: Mass of each velocity over the mass of all bodies, shape ``(b, 4)``, 0 where nothing
            can be moved.
    """

    rows: Floats
    stop: Floats
    reference: Floats
    weight: Floats


@kernel
def masses(s: System) -> Floats:
    """Mass of each velocity [kg]: m, m, m/β and 0; of walls M, M, J; 0 where it is held."""
    bodies = s.inverse.shape[0]
    mass = np.zeros((bodies, 4))
    for b in range(bodies):
        for d in range(3):
            inverse = s.velocity[b, INVERSE_MASS]
            if inverse > 0.0:
                mass[b, d] = 1.0 / inverse if d < SPIN else 1.0 / (inverse * s.spin_factor)
            elif s.inverse[b, d] > 0.0:
                mass[b, d] = 1.0 / s.inverse[b, d]
    return mass


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
    """Write the errors of the present iterate into a row of the log; whether all three residuals
    are below ``log.stop``.
    """
    if row >= log.rows.shape[0]:
        return False
    rms, largest, energy, _ = measure_residual(s, False)
    out = log.rows[row]
    out[RMS], out[MAXIMUM], out[ENERGY], out[WORK] = rms, largest, energy, work
    out[DISTANCE] = distance(s.velocity, log.reference, log.weight)
    return bool(rms <= log.stop[0] and largest <= log.stop[1] and energy <= log.stop[2])


@kernel
def copy_impulses(s: System) -> Before:
    """The impulses of now: what sweeps without extrapolation may take for the last ones, and write
    over.
    """
    return Before(s.impulse.copy(), s.general_impulse.copy(), s.couples.impulse.copy())


@kernel
def sweep_backward(s: System, before: Before) -> float:
    """As `engine.contact.sweep.sweep` without extrapolation, in the opposite order.

    Args:
        s: The problem. **Impulses and velocities modified.**
        before: Impulses before this sweep on return. **Modified.**

    Returns:
        Sum of the squares of the velocity corrections [m²/s²].
    """
    velocity, pair, frame, impulse = (
        s.velocity.reshape(-1),
        s.pair.reshape(-1),
        s.frame.reshape(-1),
        s.impulse.reshape(-1),
    )
    last, way, lanes = before.impulse.reshape(-1), Relaxation(1.0, 1.0, 0.0), s.slot.size
    total = relax_general(
        s.velocity, s.inverse, s.general_pair[::-1], s.general_frame[::-1], s.general_lever[::-1],
        s.general_impulse[::-1],
        before.general_impulse[::-1], True, 0.0, s.cell,
    )[0]  # fmt: skip
    for lane in range(lanes):
        total += relax_lane(
            np.uint64(lanes - 1 - lane),
            velocity,
            pair,
            frame,
            impulse,
            last,
            s.spin_factor,
            EXACT,
            way,
        )[0]
    return total


@kernel
def spread_impulses(s: System, impulse: Floats, velocity: Floats) -> None:
    """Add M⁻¹ H p to velocities (**modified**), whose last column holds inverse masses as that of
    the system does.
    """
    slot, pair, frame, flat = (
        s.slot.reshape(-1),
        s.pair.reshape(-1),
        s.frame.reshape(-1),
        velocity.reshape(-1),
    )
    k = 0
    for lane in range(slot.size):
        if slot[lane] >= 0:
            d_n, d_t = impulse[k, NORMAL], impulse[k, TANGENTIAL]
            if d_n != 0.0 or d_t != 0.0:
                push_lane(np.uint64(lane), d_n, d_t, flat, pair, frame, s.spin_factor)
            k += 1
    for g in range(s.general_pair.shape[0]):
        d_n, d_t = impulse[k + g, NORMAL], impulse[k + g, TANGENTIAL]
        push_general(
            g,
            d_n,
            d_t,
            velocity,
            s.inverse,
            s.general_pair,
            s.general_frame,
            s.general_lever,
            s.cell,
        )


@kernel
def gather_velocities(s: System, velocity: Floats, with_bias: bool, relative: Floats) -> None:
    """Relative velocities Hᵀ v of all contacts (and the bias, if asked for), shape as the
    impulses.
    """
    slot, pair, frame, flat = (
        s.slot.reshape(-1),
        s.pair.reshape(-1),
        s.frame.reshape(-1),
        velocity.reshape(-1),
    )
    k = 0
    for lane in range(slot.size):
        if slot[lane] >= 0:
            q, f = pair_place(np.uint64(lane)), frame_place(np.uint64(lane))
            i, j = np.uint64(pair[q]), np.uint64(pair[q + SECOND_])
            nx, ny = frame[f], frame[f + NY_]
            dx, dy = flat[i] - flat[j], flat[i + Y_] - flat[j + Y_]
            relative[k, NORMAL] = dx * nx + dy * ny + (frame[f + BIAS_] if with_bias else 0.0)
            relative[k, TANGENTIAL] = dy * nx - dx * ny - flat[i + SURFACE_] - flat[j + SURFACE_]
            k += 1
    for g in range(s.general_pair.shape[0]):
        u_n, u_t = general_velocity(
            g, velocity, s.general_pair, s.general_frame, s.general_lever, s.cell
        )
        relative[k + g, NORMAL] = u_n - (0.0 if with_bias else s.general_frame[g, BIAS])
        relative[k + g, TANGENTIAL] = u_t


@kernel
def contact_scales(s: System) -> Floats:
    """1/W_nn, 1/W_tt [kg] and μ of all contacts, shape ``(k + g, 3)``."""
    scales = np.empty((s.contacts, 3))
    k = 0
    for q in range(s.slot.shape[0]):
        for lane in range(LANES):
            if s.slot[q, lane] >= 0:
                w_inverse = s.frame[q, MASS, lane]
                scales[k, 0], scales[k, 1], scales[k, 2] = (
                    w_inverse,
                    w_inverse / (1.0 + s.spin_factor),
                    s.frame[q, MU, lane],
                )
                k += 1
    for g in range(s.general_pair.shape[0]):
        f = s.general_frame[g]
        scales[k + g, 0], scales[k + g, 1], scales[k + g, 2] = 1.0 / f[W_NN], 1.0 / f[W_TT], f[MU]
    return scales


@kernel
def all_impulses(s: System) -> Floats:
    """A copy of all impulses [N s], shape ``(k + g, 2)``."""
    impulse = np.empty((s.contacts, 2))
    k = 0
    for q in range(s.slot.shape[0]):
        for lane in range(LANES):
            if s.slot[q, lane] >= 0:
                impulse[k, NORMAL], impulse[k, TANGENTIAL] = (
                    s.impulse[q, NORMAL, lane],
                    s.impulse[q, TANGENTIAL, lane],
                )
                k += 1
    impulse[k:] = s.general_impulse
    return impulse


@kernel
def set_impulses(s: System, impulse: Floats) -> None:
    """Give the system other impulses, and the velocities that go with them."""
    spread_impulses(s, impulse - all_impulses(s), s.velocity)
    k = 0
    for q in range(s.slot.shape[0]):
        for lane in range(LANES):
            if s.slot[q, lane] >= 0:
                s.impulse[q, NORMAL, lane], s.impulse[q, TANGENTIAL, lane] = (
                    impulse[k, NORMAL],
                    impulse[k, TANGENTIAL],
                )
                k += 1
    s.general_impulse[:] = impulse[k:]


@formula
def cut_to_cone(p_n: float, p_t: float, mu: float) -> tuple[float, float]:
    """The nearest impulses along the tangent that Coulomb's law allows: p_n ≥ 0, then \\|p_t\\| ≤ μ
    p_n.
    """
    new_n = p_n if p_n > 0.0 else 0.0
    bound = mu * new_n
    return new_n, min(max(p_t, -bound), bound)
