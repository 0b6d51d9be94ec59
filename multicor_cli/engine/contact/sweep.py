"""Gauss–Seidel sweeps over contacts, in the matrix-free form: velocities are updated in place after each contact.

Two kinds of contact, and couples of rolling resistance (`multicor_cli.engine.contact.couples`), relaxed after them:

* *light* ones between bodies with one inverse mass (grains, anchors): the Delassus matrix is diagonal,
  W_nn = 1/m_i + 1/m_j and W_tt = (1 + β) W_nn with β = m a²/I. They lie in batches of four that share no body
  (`multicor_cli.engine.contact.batches`) and are relaxed as vectors (`multicor_cli.engine.contact.vector_sweep`); `relax_scalar`
  here says what that computes;
* *general* ones (`multicor_cli.engine.contact.general`), relaxed serially after the others.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.contact.couples import NO_COUPLES, Couples, push_couple, relax_couples
from multicor_cli.engine.contact.general import push_general, relax_general
from multicor_cli.engine.contact.lanes import (
    BIAS_,
    INVERSE_MASS_,
    MASS_,
    MU_,
    NY_,
    SECOND_,
    SURFACE_,
    TANGENTIAL_,
    Y_,
    frame_place,
    impulse_place,
    pair_place,
)
from multicor_cli.engine.contact.law import solve_bipotential, solve_exact
from multicor_cli.engine.contact.vector_sweep import relax_batches
from multicor_cli.engine.jit.compile import kernel, loop_body, prange, threaded_loop
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.engine.jit.vectors import HAS_VECTORS, LANES
from multicor_cli.model.columns import NORMAL, TANGENTIAL
from multicor_cli.model.model import Floats, Ints

EXACT, BIPOTENTIAL = 0, 1


class Relaxation(NamedTuple):
    """How contacts are relaxed.

    Attributes:
        normal: Factor on the normal correction of the exact local solve of light contacts: 1 solves the contact, less goes part of
            the way.
        tangential: The same for the tangential correction.
        extrapolation: ω; impulses of all contacts are moved on by ω times their last change before they are relaxed.
    """

    normal: float
    tangential: float
    extrapolation: float


class System(NamedTuple):
    """A contact problem in the order of the sweep: ``q`` batches of four light contacts, ``g`` general contacts, ``b`` bodies.

    A lane of a batch without contact joins two bodies of its tile that nothing moves. Arrays begin at cache lines.

    Attributes:
        velocity: Bodies: v_x, v_y [m/s], s (a ω for grains [m/s], Ω for walls [rad/s]), 1/m [1/kg]; then anchors, then bodies of
            empty lanes. **Modified by sweeps.**
        inverse: Bodies: inverse mass per degree of freedom, for general contacts, shape ``(b, 3)``.
        slot: Contact in each lane, -1 if there is none, shape ``(q, 4)``.
        pair: Bodies of the light contacts: four times the row of the first, four times the row of the second, shape ``(q, 2, 4)``.
        frame: Light: n_x, n_y, 1/W_nn [kg], bias b [m/s], μ, shape ``(q, 5, 4)``.
        impulse: Light: p_n, p_t [N s], shape ``(q, 2, 4)``. **Modified by sweeps.**
        tile_start: First batch of each tile, shape ``(tiles + 1,)``; no tile has a single batch.
        color_start: First tile of each color, shape ``(colors + 1,)``; the last tile may be of no color and is relaxed serially.
        general_pair: Bodies of the general contacts, shape ``(g, 2)``.
        general_frame: n_x, n_y, W_nn, b, μ, W_nt, W_tt, and the surface speed of j that is taken from u_t, shape ``(g, 8)``.
        general_lever: What the third velocity of body i adds to u_n and u_t, and what that of j takes from them, shape
            ``(g, 2, 2)``.
        general_impulse: p_n, p_t [N s], shape ``(g, 2)``. **Modified by sweeps.**
        spin_factor: β = m a²/I of the light contacts.
        contacts: Number of contacts of both kinds.
        couples: Couples of rolling resistance.
    """

    velocity: Floats
    inverse: Floats
    slot: Ints
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
    contacts: int
    couples: Couples = NO_COUPLES


class Before(NamedTuple):
    """Impulses before the last sweep [N s]: of light contacts, ``(q, 2, 4)``, general ones, ``(g, 2)``, and couples, ``(k,)``."""

    impulse: Floats
    general_impulse: Floats
    couple: Floats


@formula
def relax_lane(
    lane: np.uint64, velocity: Floats, pair: Ints, frame: Floats, impulse: Floats, before: Floats, beta: float, local: int,
    way: Relaxation,
) -> float:  # fmt: skip
    """Relax one light contact; returns the square of the velocity correction [m²/s²].

    The arrays are those of `System`, flat; ``lane`` counts the lanes of all batches. Velocities are read once.
    """
    q, f, p = pair_place(lane), frame_place(lane), impulse_place(lane)
    i, j = np.uint64(pair[q]), np.uint64(pair[q + SECOND_])
    nx, ny, w_inverse, mu = frame[f], frame[f + NY_], frame[f + MASS_], frame[f + MU_]
    xi, yi, si, mi = velocity[i], velocity[i + Y_], velocity[i + SURFACE_], velocity[i + INVERSE_MASS_]
    xj, yj, sj, mj = velocity[j], velocity[j + Y_], velocity[j + SURFACE_], velocity[j + INVERSE_MASS_]
    dx, dy = xi - xj, yi - yj
    u_n = dx * nx + dy * ny + frame[f + BIAS_]
    u_t = dy * nx - dx * ny - (si + sj)
    now_n, now_t = impulse[p], impulse[p + TANGENTIAL_]
    p_n = now_n + way.extrapolation * (now_n - before[p])
    p_t = now_t + way.extrapolation * (now_t - before[p + TANGENTIAL_])
    less = 1.0 / (1.0 + beta)
    if local == EXACT:
        w_n, w_t = way.normal * w_inverse, way.tangential * less * w_inverse
        new_n, new_t = solve_exact(p_n, p_t, u_n, u_t, w_n, w_t, mu)
    else:
        new_n, new_t = solve_bipotential(p_n, p_t, u_n, u_t, w_inverse, w_inverse * less, mu)
    impulse[p], impulse[p + TANGENTIAL_] = new_n, new_t
    before[p], before[p + TANGENTIAL_] = now_n, now_t
    d_n, d_t = new_n - p_n, new_t - p_t
    px = d_n * nx - d_t * ny
    py = d_n * ny + d_t * nx
    spin = beta * d_t
    velocity[i], velocity[i + Y_], velocity[i + SURFACE_] = xi + mi * px, yi + mi * py, si - mi * spin
    velocity[j], velocity[j + Y_], velocity[j + SURFACE_] = xj - mj * px, yj - mj * py, sj - mj * spin
    w = mi + mj
    c_n, c_t = w * d_n, w * (1.0 + beta) * d_t
    return c_n * c_n + c_t * c_t


@loop_body
def relax_scalar(
    first: int, last: int, velocity: Floats, pair: Ints, frame: Floats, impulse: Floats, before: Floats, beta: float, local: int,
    way: Relaxation,
) -> float:  # fmt: skip
    """Relax the light contacts of batches ``first … last-1`` one by one; arrays as in `relax_lane`.

    Returns the sum of the squares of the velocity corrections [m²/s²]: lane by lane, then over the lanes.
    """
    a, b, c, d = 0.0, 0.0, 0.0, 0.0
    for batch in range(first, last):
        lane = np.uint64(LANES * batch)
        a += relax_lane(lane, velocity, pair, frame, impulse, before, beta, local, way)
        b += relax_lane(lane + np.uint64(1), velocity, pair, frame, impulse, before, beta, local, way)
        c += relax_lane(lane + np.uint64(2), velocity, pair, frame, impulse, before, beta, local, way)
        d += relax_lane(lane + np.uint64(3), velocity, pair, frame, impulse, before, beta, local, way)
    return a + b + c + d


@loop_body
def _relax_exact_scalar(
    first: int, last: int, velocity: Floats, pair: Ints, frame: Floats, impulse: Floats, before: Floats, beta: float,
    normal: float, tangential: float, extrapolation: float,
) -> float:  # fmt: skip
    way = Relaxation(normal, tangential, extrapolation)
    return relax_scalar(first, last, velocity, pair, frame, impulse, before, beta, EXACT, way)


_relax_exact = relax_batches if HAS_VECTORS else _relax_exact_scalar


@loop_body
def _relax_range(
    first: int, last: int, velocity: Floats, pair: Ints, frame: Floats, impulse: Floats, before: Floats, beta: float, local: int,
    way: Relaxation,
) -> float:  # fmt: skip
    if local == EXACT:
        return _relax_exact(
            first, last, velocity, pair, frame, impulse, before, beta, way.normal, way.tangential, way.extrapolation
        )  # fmt: skip
    return relax_scalar(first, last, velocity, pair, frame, impulse, before, beta, BIPOTENTIAL, way)


@threaded_loop
def _relax_tiles_on_threads(
    color_start: NDArray[np.int64], tile_start: NDArray[np.int64], velocity: Floats, pair: Ints, frame: Floats, impulse: Floats,
    before: Floats, beta: float, local: int, way: Relaxation, partial: Floats,
) -> None:  # fmt: skip
    for color in range(color_start.size - 1):
        for t in prange(color_start[color], color_start[color + 1]):
            partial[t] = _relax_range(tile_start[t], tile_start[t + 1], velocity, pair, frame, impulse, before, beta, local, way)


@kernel
def sweep(s: System, before: Before, local: int, way: Relaxation, parallel: bool, partial: Floats) -> float:
    """One Gauss–Seidel sweep over all contacts and couples.

    Args:
        s: The problem. **Impulses and velocities modified.**
        before: Impulses before the last sweep; before this one on return. **Modified.**
        local: `EXACT` or `BIPOTENTIAL`.
        way: Factors of the exact local solve, and of the extrapolation of impulses (velocities are extrapolated already).
        parallel: Relax the tiles of one color on several threads; the result is the same.
        partial: Work space, shape ``(tiles,)``.

    Returns:
        Sum of the squares of the velocity corrections [m²/s²].
    """
    velocity, pair, frame, impulse = s.velocity.reshape(-1), s.pair.reshape(-1), s.frame.reshape(-1), s.impulse.reshape(-1)
    last, start, beta = before.impulse.reshape(-1), s.tile_start, s.spin_factor
    first = 0
    if parallel:
        _relax_tiles_on_threads(s.color_start, start, velocity, pair, frame, impulse, last, beta, local, way, partial)
        first = s.color_start[-1]
    for t in range(first, start.size - 1):
        partial[t] = _relax_range(start[t], start[t + 1], velocity, pair, frame, impulse, last, beta, local, way)
    total = 0.0
    for t in range(partial.size):
        total += partial[t]
    total += relax_general(
        s.velocity, s.inverse, s.general_pair, s.general_frame, s.general_lever, s.general_impulse, before.general_impulse,
        local == EXACT, way.extrapolation,
    )  # fmt: skip
    return total + relax_couples(s.velocity, s.inverse, s.couples, impulse, s.general_impulse, before.couple, way.extrapolation)


@formula
def push_lane(lane: np.uint64, d_n: float, d_t: float, velocity: Floats, pair: Ints, frame: Floats, beta: float) -> None:
    """Change the velocities of the two bodies of a light contact by an impulse; arrays flat."""
    q, f = pair_place(lane), frame_place(lane)
    i, j = np.uint64(pair[q]), np.uint64(pair[q + SECOND_])
    px = d_n * frame[f] - d_t * frame[f + NY_]
    py = d_n * frame[f + NY_] + d_t * frame[f]
    spin = beta * d_t
    mi, mj = velocity[i + INVERSE_MASS_], velocity[j + INVERSE_MASS_]
    velocity[i] += mi * px
    velocity[i + Y_] += mi * py
    velocity[i + SURFACE_] -= mi * spin
    velocity[j] -= mj * px
    velocity[j + Y_] -= mj * py
    velocity[j + SURFACE_] -= mj * spin


@kernel
def add_impulses(s: System) -> None:
    """Add the effect of the impulses to the velocities: free velocities become v_free + M⁻¹ H p. In the order of the sweep."""
    velocity, pair, frame, impulse = s.velocity.reshape(-1), s.pair.reshape(-1), s.frame.reshape(-1), s.impulse.reshape(-1)
    for k in range(s.slot.size):
        p = impulse_place(np.uint64(k))
        if impulse[p] != 0.0 or impulse[p + TANGENTIAL_] != 0.0:
            push_lane(np.uint64(k), impulse[p], impulse[p + TANGENTIAL_], velocity, pair, frame, s.spin_factor)
    for g in range(s.general_pair.shape[0]):
        d_n, d_t = s.general_impulse[g, NORMAL], s.general_impulse[g, TANGENTIAL]
        push_general(g, d_n, d_t, s.velocity, s.inverse, s.general_pair, s.general_frame, s.general_lever)
    for c in range(s.couples.impulse.size):
        push_couple(c, s.couples.impulse[c], s.couples, s.velocity, s.inverse)
