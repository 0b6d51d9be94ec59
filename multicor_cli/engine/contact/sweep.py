"""Gauss–Seidel sweeps over contacts, in the matrix-free form: velocities are updated in place after each contact.

Two kinds of contact:

* *light* ones between bodies with one inverse mass (grains, anchors): the Delassus matrix is diagonal,
  W_nn = 1/m_i + 1/m_j and W_tt = (1 + β) W_nn with β = m a²/I;
* *general* ones (walls with free degrees of freedom, arbitrary problems): full 2×2 matrix and inverse mass per degree of
  freedom, relaxed serially after the others.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.contact.law import predict_and_correct, solve_bipotential, solve_exact, solve_full
from multicor_cli.engine.jit.compile import kernel, parallel_kernel, prange
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.model.model import Floats, Ints

EXACT, BIPOTENTIAL = 0, 1
ONE, TWO, THREE = np.uint64(1), np.uint64(2), np.uint64(3)  # unsigned: no wrapping of negative indices in the innermost loop


class Relaxation(NamedTuple):
    """Factors on the corrections of the exact local solve of light contacts: 1 solves the contact, less goes part of the way."""

    normal: float
    tangential: float


class System(NamedTuple):
    """A contact problem in the order of the sweep; ``k`` light contacts, ``g`` general ones, ``b`` bodies.

    Attributes:
        velocity: Bodies: v_x, v_y [m/s], s (a ω for grains [m/s], Ω for walls [rad/s]), 1/m [1/kg]. **Modified by sweeps.**
        inverse: Bodies: inverse mass per degree of freedom, for general contacts, shape ``(b, 3)``.
        pair: Bodies of the light contacts, shape ``(k, 2)``.
        frame: Light: n_x, n_y, 1/W_nn [kg], bias b [m/s], μ, shape ``(k, 5)``.
        impulse: Light: p_n, p_t [N s], shape ``(k, 2)``. **Modified by sweeps.**
        tile_start: Start of each tile, shape ``(tiles + 1,)``; light contacts beyond the last tile are relaxed serially.
        color_start: First tile of each color, shape ``(colors + 1,)``.
        general_pair: Bodies of the general contacts, shape ``(g, 2)``.
        general_frame: n_x, n_y, b, μ, W_nn, W_nt, W_tt, shape ``(g, 7)``.
        general_lever: What the third velocity of body i adds to u_n and u_t, and likewise that of j, shape ``(g, 4)``.
        general_impulse: p_n, p_t [N s], shape ``(g, 2)``. **Modified by sweeps.**
        spin_factor: β = m a²/I of the light contacts.
    """

    velocity: Floats
    inverse: Floats
    pair: Ints
    frame: Floats
    impulse: Floats
    tile_start: NDArray[np.int64]
    color_start: NDArray[np.int64]
    general_pair: Ints
    general_frame: Floats
    general_lever: Floats
    general_impulse: Floats
    spin_factor: float


@formula
def _push(k: int, d_n: float, d_t: float, velocity: Floats, pair: Ints, frame: Floats, beta: float) -> None:
    """Change the velocities of the two bodies of a light contact by an impulse."""
    i, j = np.uint32(pair[k, 0]), np.uint32(pair[k, 1])
    px = d_n * frame[k, 0] - d_t * frame[k, 1]
    py = d_n * frame[k, 1] + d_t * frame[k, 0]
    mi, mj = velocity[i, 3], velocity[j, 3]
    velocity[i, 0] += mi * px
    velocity[i, 1] += mi * py
    spin = beta * d_t
    velocity[i, 2] -= mi * spin
    velocity[j, 0] -= mj * px
    velocity[j, 1] -= mj * py
    velocity[j, 2] -= mj * spin


@kernel
def _push_general(g: int, d_n: float, d_t: float, s: System) -> None:
    """As `_push`, for a general contact."""
    f, lever = s.general_frame[g], s.general_lever[g]
    px, py = d_n * f[0] - d_t * f[1], d_n * f[1] + d_t * f[0]
    a, b = s.general_pair[g, 0], s.general_pair[g, 1]
    s.velocity[a, 0] += s.inverse[a, 0] * px
    s.velocity[a, 1] += s.inverse[a, 1] * py
    s.velocity[a, 2] += s.inverse[a, 2] * (d_n * lever[0] + d_t * lever[1])
    s.velocity[b, 0] -= s.inverse[b, 0] * px
    s.velocity[b, 1] -= s.inverse[b, 1] * py
    s.velocity[b, 2] -= s.inverse[b, 2] * (d_n * lever[2] + d_t * lever[3])


@formula
def relax_light(
    k: np.uint64, velocity: Floats, pair: Ints, frame: Floats, impulse: Floats, beta: float, local: int, relaxation: Relaxation
) -> float:
    """Relax one light contact; returns the square of the velocity correction [m²/s²].

    The arrays are those of `System`, flat: the factors of their rows are then known at compile time. Velocities are read once.
    """
    i, j = np.uint64(4) * np.uint64(pair[TWO * k]), np.uint64(4) * np.uint64(pair[TWO * k + ONE])
    f, p = np.uint64(5) * k, TWO * k
    nx, ny, w_inverse, mu = frame[f], frame[f + ONE], frame[f + TWO], frame[f + np.uint64(4)]
    xi, yi, si, mi = velocity[i], velocity[i + ONE], velocity[i + TWO], velocity[i + THREE]
    xj, yj, sj, mj = velocity[j], velocity[j + ONE], velocity[j + TWO], velocity[j + THREE]
    dx, dy = xi - xj, yi - yj
    u_n = dx * nx + dy * ny + frame[f + THREE]
    u_t = dy * nx - dx * ny - si - sj
    p_n, p_t = impulse[p], impulse[p + ONE]
    if local == EXACT:
        w_n, w_t = relaxation.normal * w_inverse, relaxation.tangential * (w_inverse * (1.0 / (1.0 + beta)))
        new_n, new_t = solve_exact(p_n, p_t, u_n, u_t, w_n, w_t, mu)
    else:
        new_n, new_t = solve_bipotential(p_n, p_t, u_n, u_t, w_inverse, w_inverse * (1.0 / (1.0 + beta)), mu)
    d_n, d_t = new_n - p_n, new_t - p_t
    if d_n == 0.0 and d_t == 0.0:
        return 0.0
    impulse[p], impulse[p + ONE] = new_n, new_t
    px = d_n * nx - d_t * ny
    py = d_n * ny + d_t * nx
    spin = beta * d_t
    velocity[i], velocity[i + ONE], velocity[i + TWO] = xi + mi * px, yi + mi * py, si - mi * spin
    velocity[j], velocity[j + ONE], velocity[j + TWO] = xj - mj * px, yj - mj * py, sj - mj * spin
    w = mi + mj
    c_n, c_t = w * d_n, w * (1.0 + beta) * d_t
    return c_n * c_n + c_t * c_t


@formula
def _add_impulse(k: int, velocity: Floats, pair: Ints, frame: Floats, impulse: Floats, beta: float) -> None:
    d_n, d_t = impulse[k, 0], impulse[k, 1]
    if d_n != 0.0 or d_t != 0.0:
        _push(k, d_n, d_t, velocity, pair, frame, beta)


@parallel_kernel
def add_impulses(s: System) -> None:
    """Add the effect of the impulses to the velocities: free velocities become v_free + M⁻¹ H p. In the order of the sweep."""
    for color in range(s.color_start.size - 1):
        for t in prange(s.color_start[color], s.color_start[color + 1]):
            for k in range(s.tile_start[t], s.tile_start[t + 1]):
                _add_impulse(k, s.velocity, s.pair, s.frame, s.impulse, s.spin_factor)
    for k in range(s.tile_start[-1], s.pair.shape[0]):
        _add_impulse(k, s.velocity, s.pair, s.frame, s.impulse, s.spin_factor)
    for g in range(s.general_pair.shape[0]):
        _push_general(g, s.general_impulse[g, 0], s.general_impulse[g, 1], s)


@kernel
def general_velocity(g: int, s: System) -> tuple[float, float]:
    """u_n + b and u_t of a general contact [m/s]."""
    a, b = s.velocity[s.general_pair[g, 0]], s.velocity[s.general_pair[g, 1]]
    nx, ny = s.general_frame[g, 0], s.general_frame[g, 1]
    lever = s.general_lever[g]
    dx, dy = a[0] - b[0], a[1] - b[1]
    u_n = dx * nx + dy * ny + a[2] * lever[0] - b[2] * lever[2]
    u_t = dy * nx - dx * ny + a[2] * lever[1] - b[2] * lever[3]
    return u_n + s.general_frame[g, 2], u_t


@kernel
def general_solution(g: int, s: System, u_n: float, u_t: float, local: int) -> tuple[float, float]:
    """Impulses of a general contact after a local solve with the others held."""
    f = s.general_frame[g]
    p_n, p_t = s.general_impulse[g, 0], s.general_impulse[g, 1]
    if local == EXACT:
        return solve_full(p_n, p_t, u_n, u_t, f[4], f[5], f[6], f[3])
    # The predictor-corrector needs ρ < 2 over the largest eigenvalue; the trace bounds that.
    rho = min(1.0 / np.sqrt(f[4] * f[6]), 1.5 / (f[4] + f[6]) if f[5] != 0.0 else 1.9 / max(f[4], f[6]))
    return predict_and_correct(p_n, p_t, u_n, u_t, rho, f[3])


@kernel
def relax_general(g: int, s: System, local: int) -> float:
    """Relax one general contact; returns the square of the velocity correction [m²/s²]."""
    u_n, u_t = general_velocity(g, s)
    new_n, new_t = general_solution(g, s, u_n, u_t, local)
    d_n, d_t = new_n - s.general_impulse[g, 0], new_t - s.general_impulse[g, 1]
    if d_n == 0.0 and d_t == 0.0:
        return 0.0
    s.general_impulse[g, 0], s.general_impulse[g, 1] = new_n, new_t
    _push_general(g, d_n, d_t, s)
    f = s.general_frame[g]
    c_n, c_t = f[4] * d_n + f[5] * d_t, f[5] * d_n + f[6] * d_t
    return c_n * c_n + c_t * c_t


@formula
def _relax_range(
    first: int, last: int, velocity: Floats, pair: Ints, frame: Floats, impulse: Floats, beta: float, local: int, way: Relaxation
) -> float:
    """Relax light contacts ``first … last-1``; returns the sum of the squares of the velocity corrections [m²/s²]."""
    total = 0.0
    if local == EXACT:  # a loop for each law, without the question inside
        for k in range(first, last):
            total += relax_light(np.uint64(k), velocity, pair, frame, impulse, beta, EXACT, way)
    else:
        for k in range(first, last):
            total += relax_light(np.uint64(k), velocity, pair, frame, impulse, beta, BIPOTENTIAL, way)
    return total


@kernel
def _relax_tiles(
    tile_start: NDArray[np.int64], velocity: Floats, pair: Ints, frame: Floats, impulse: Floats, beta: float, local: int,
    way: Relaxation, partial: Floats,
) -> None:  # fmt: skip
    for t in range(tile_start.size - 1):
        partial[t] = _relax_range(tile_start[t], tile_start[t + 1], velocity, pair, frame, impulse, beta, local, way)


@parallel_kernel
def _relax_tiles_on_threads(
    color_start: NDArray[np.int64], tile_start: NDArray[np.int64], velocity: Floats, pair: Ints, frame: Floats, impulse: Floats,
    beta: float, local: int, way: Relaxation, partial: Floats,
) -> None:  # fmt: skip
    for color in range(color_start.size - 1):
        for t in prange(color_start[color], color_start[color + 1]):
            partial[t] = _relax_range(tile_start[t], tile_start[t + 1], velocity, pair, frame, impulse, beta, local, way)


@kernel
def sweep(s: System, local: int, relaxation: Relaxation, parallel: bool, partial: Floats) -> float:
    """One Gauss–Seidel sweep over all contacts.

    Args:
        s: The problem. **Impulses and velocities modified.**
        local: `EXACT` or `BIPOTENTIAL`.
        relaxation: Factors of the exact local solve.
        parallel: Relax the tiles of one color on several threads; the result is the same.
        partial: Work space, shape ``(tiles,)``.

    Returns:
        Sum of the squares of the velocity corrections [m²/s²].
    """
    velocity, pair, frame, impulse = s.velocity.reshape(-1), s.pair.reshape(-1), s.frame.reshape(-1), s.impulse.reshape(-1)
    beta = s.spin_factor
    if parallel:
        _relax_tiles_on_threads(
            s.color_start, s.tile_start, velocity, pair, frame, impulse, beta, local, relaxation, partial
        )  # fmt: skip
    else:
        _relax_tiles(s.tile_start, velocity, pair, frame, impulse, beta, local, relaxation, partial)
    total = 0.0
    for t in range(partial.size):
        total += partial[t]
    total += _relax_range(s.tile_start[-1], s.pair.shape[0], velocity, pair, frame, impulse, beta, local, relaxation)
    for g in range(s.general_pair.shape[0]):
        total += relax_general(g, s, local)
    return total
