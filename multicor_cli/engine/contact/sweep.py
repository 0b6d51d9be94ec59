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

from multicor_cli.engine.contact.flat import (
    BIAS_,
    BODY,
    FRAME,
    IMPULSE,
    INVERSE_MASS_,
    MASS_,
    MU_,
    NY_,
    PAIR,
    SECOND_,
    SURFACE_,
    TANGENTIAL_,
    Y_,
)
from multicor_cli.engine.contact.law import predict_and_correct, solve_bipotential, solve_exact, solve_full
from multicor_cli.engine.jit.compile import kernel, parallel_kernel, prange
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.model.columns import (
    BIAS,
    FIRST,
    INVERSE_MASS,
    MU,
    NORMAL,
    NX,
    NY,
    SECOND,
    SPIN,
    SURFACE,
    TANGENTIAL,
    W_NN,
    W_NT,
    W_TT,
    X,
    Y,
)
from multicor_cli.model.model import Floats, Ints

EXACT, BIPOTENTIAL = 0, 1


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
        general_frame: n_x, n_y, W_nn, b, μ, W_nt, W_tt, shape ``(g, 7)``.
        general_lever: What the third velocity of body i adds to u_n and u_t, and what that of j takes from them, shape
            ``(g, 2, 2)``.
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
    i, j = np.uint32(pair[k, FIRST]), np.uint32(pair[k, SECOND])
    px = d_n * frame[k, NX] - d_t * frame[k, NY]
    py = d_n * frame[k, NY] + d_t * frame[k, NX]
    mi, mj = velocity[i, INVERSE_MASS], velocity[j, INVERSE_MASS]
    velocity[i, X] += mi * px
    velocity[i, Y] += mi * py
    spin = beta * d_t
    velocity[i, SURFACE] -= mi * spin
    velocity[j, X] -= mj * px
    velocity[j, Y] -= mj * py
    velocity[j, SURFACE] -= mj * spin


@kernel
def _push_general(g: int, d_n: float, d_t: float, s: System) -> None:
    """As `_push`, for a general contact."""
    f, lever = s.general_frame[g], s.general_lever[g]
    px, py = d_n * f[NX] - d_t * f[NY], d_n * f[NY] + d_t * f[NX]
    a, b = s.general_pair[g, FIRST], s.general_pair[g, SECOND]
    s.velocity[a, X] += s.inverse[a, X] * px
    s.velocity[a, Y] += s.inverse[a, Y] * py
    s.velocity[a, SURFACE] += s.inverse[a, SPIN] * (d_n * lever[FIRST, NORMAL] + d_t * lever[FIRST, TANGENTIAL])
    s.velocity[b, X] -= s.inverse[b, X] * px
    s.velocity[b, Y] -= s.inverse[b, Y] * py
    s.velocity[b, SURFACE] -= s.inverse[b, SPIN] * (d_n * lever[SECOND, NORMAL] + d_t * lever[SECOND, TANGENTIAL])


@formula
def relax_light(
    k: np.uint64, velocity: Floats, pair: Ints, frame: Floats, impulse: Floats, beta: float, local: int, relaxation: Relaxation
) -> float:
    """Relax one light contact; returns the square of the velocity correction [m²/s²].

    The arrays are those of `System`, flat: the factors of their rows are then known at compile time. Velocities are read once.
    """
    i, j = BODY * np.uint64(pair[PAIR * k]), BODY * np.uint64(pair[PAIR * k + SECOND_])
    f, p = FRAME * k, IMPULSE * k
    nx, ny, w_inverse, mu = frame[f], frame[f + NY_], frame[f + MASS_], frame[f + MU_]
    xi, yi, si, mi = velocity[i], velocity[i + Y_], velocity[i + SURFACE_], velocity[i + INVERSE_MASS_]
    xj, yj, sj, mj = velocity[j], velocity[j + Y_], velocity[j + SURFACE_], velocity[j + INVERSE_MASS_]
    dx, dy = xi - xj, yi - yj
    u_n = dx * nx + dy * ny + frame[f + BIAS_]
    u_t = dy * nx - dx * ny - si - sj
    p_n, p_t = impulse[p], impulse[p + TANGENTIAL_]
    if local == EXACT:
        w_n, w_t = relaxation.normal * w_inverse, relaxation.tangential * (w_inverse * (1.0 / (1.0 + beta)))
        new_n, new_t = solve_exact(p_n, p_t, u_n, u_t, w_n, w_t, mu)
    else:
        new_n, new_t = solve_bipotential(p_n, p_t, u_n, u_t, w_inverse, w_inverse * (1.0 / (1.0 + beta)), mu)
    d_n, d_t = new_n - p_n, new_t - p_t
    if d_n == 0.0 and d_t == 0.0:
        return 0.0
    impulse[p], impulse[p + TANGENTIAL_] = new_n, new_t
    px = d_n * nx - d_t * ny
    py = d_n * ny + d_t * nx
    spin = beta * d_t
    velocity[i], velocity[i + Y_], velocity[i + SURFACE_] = xi + mi * px, yi + mi * py, si - mi * spin
    velocity[j], velocity[j + Y_], velocity[j + SURFACE_] = xj - mj * px, yj - mj * py, sj - mj * spin
    w = mi + mj
    c_n, c_t = w * d_n, w * (1.0 + beta) * d_t
    return c_n * c_n + c_t * c_t


@formula
def _add_impulse(k: int, velocity: Floats, pair: Ints, frame: Floats, impulse: Floats, beta: float) -> None:
    d_n, d_t = impulse[k, NORMAL], impulse[k, TANGENTIAL]
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
        _push_general(g, s.general_impulse[g, NORMAL], s.general_impulse[g, TANGENTIAL], s)


@kernel
def general_velocity(g: int, s: System) -> tuple[float, float]:
    """u_n + b and u_t of a general contact [m/s]."""
    a, b = s.velocity[s.general_pair[g, FIRST]], s.velocity[s.general_pair[g, SECOND]]
    nx, ny = s.general_frame[g, NX], s.general_frame[g, NY]
    lever = s.general_lever[g]
    dx, dy = a[X] - b[X], a[Y] - b[Y]
    u_n = dx * nx + dy * ny + a[SURFACE] * lever[FIRST, NORMAL] - b[SURFACE] * lever[SECOND, NORMAL]
    u_t = dy * nx - dx * ny + a[SURFACE] * lever[FIRST, TANGENTIAL] - b[SURFACE] * lever[SECOND, TANGENTIAL]
    return u_n + s.general_frame[g, BIAS], u_t


@kernel
def general_solution(g: int, s: System, u_n: float, u_t: float, local: int) -> tuple[float, float]:
    """Impulses of a general contact after a local solve with the others held."""
    f = s.general_frame[g]
    p_n, p_t = s.general_impulse[g, NORMAL], s.general_impulse[g, TANGENTIAL]
    if local == EXACT:
        return solve_full(p_n, p_t, u_n, u_t, f[W_NN], f[W_NT], f[W_TT], f[MU])
    # The predictor-corrector needs ρ < 2 over the largest eigenvalue; the trace bounds that.
    w_nn, w_tt = f[W_NN], f[W_TT]
    rho = min(1.0 / np.sqrt(w_nn * w_tt), 1.5 / (w_nn + w_tt) if f[W_NT] != 0.0 else 1.9 / max(w_nn, w_tt))
    return predict_and_correct(p_n, p_t, u_n, u_t, rho, f[MU])


@kernel
def relax_general(g: int, s: System, local: int) -> float:
    """Relax one general contact; returns the square of the velocity correction [m²/s²]."""
    u_n, u_t = general_velocity(g, s)
    new_n, new_t = general_solution(g, s, u_n, u_t, local)
    d_n, d_t = new_n - s.general_impulse[g, NORMAL], new_t - s.general_impulse[g, TANGENTIAL]
    if d_n == 0.0 and d_t == 0.0:
        return 0.0
    s.general_impulse[g, NORMAL], s.general_impulse[g, TANGENTIAL] = new_n, new_t
    _push_general(g, d_n, d_t, s)
    f = s.general_frame[g]
    c_n, c_t = f[W_NN] * d_n + f[W_NT] * d_t, f[W_NT] * d_n + f[W_TT] * d_t
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
