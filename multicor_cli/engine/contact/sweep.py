"""Gauss–Seidel sweeps over contacts, matrix-free: each contact updates velocities in place.

Two kinds of contact, and couples of rolling resistance, relaxed after them
(`multicor_cli.engine.contact.rolling`):

* *diagonal* ones between bodies with one inverse mass (grains, wall proxies): the Delassus matrix
  is diagonal, W_nn = 1/m_i + 1/m_j and W_tt = (1 + β) W_nn with β = m a²/I. They lie in batches of
  four that share no body (`multicor_cli.engine.contact.ordering`) and are relaxed as vectors
  (`multicor_cli.engine.contact.vector_sweep`); `relax_scalar` here says what that computes;
* *general* ones, relaxed serially after the others; but for points of grains that are no discs,
  which lie in batches, too (`multicor_cli.engine.contact.face_sweep`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.contact.face_sweep import (
    FaceBatches,
    begin_gradient,
    end_gradient,
    first_of_batches,
    relax_faces,
    sum_lanes,
    sum_tiles,
    take_turns,
)
from multicor_cli.engine.contact.law import (
    predict_and_correct,
    solve_bipotential,
    solve_exact,
    solve_full,
)
from multicor_cli.engine.contact.rolling import NO_COUPLES, Couples, push_couple, relax_couples
from multicor_cli.engine.contact.vector_sweep import (
    BIAS_,
    BRANCH_Y_,
    INVERSE_MASS_,
    MASS_,
    MU_,
    NY_,
    SECOND_,
    SURFACE_,
    TANGENTIAL_,
    Y_,
    branch_place,
    frame_place,
    impulse_place,
    pair_place,
    pull_batches,
    push_batches,
    relax_batches,
    relax_stretched_batches,
)
from multicor_cli.engine.jit.compile import kernel, loop_body, prange, subroutine, threaded_loop
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.engine.jit.vectors import HAS_VECTORS, LANES
from multicor_cli.model.columns import (
    BIAS,
    FIRST,
    MU,
    NORMAL,
    NX,
    NY,
    SECOND,
    SLIDE,
    SPIN,
    SURFACE,
    TANGENTIAL,
    W_NN,
    W_NT,
    W_TT,
    XX,
    XY,
    YY,
    X,
    Y,
)
from multicor_cli.model.model import Floats, Ints

# ---- General contacts: with walls that have free degrees of freedom, or of arbitrary problems.
#
# Their Delassus matrix is full and every degree of freedom has its inverse mass; they are relaxed
# one after the other. A flow has few of them, but those of a loaded lid are in every sweep: the
# loops take single numbers out of arrays, never rows.


class CellTerms(NamedTuple):
    """The velocity gradient of a cell in a `System`: the last body that has inverse masses.

    All contacts share it: u = c_i − c_j + L ℓ, and an impulse p changes L by p ⊗ ℓ over its inertia
    (theory §2.1). Its row of the velocities is L_xx, L_yy, L_xy, 0 [1/s].

    Attributes:
        branch: ℓ of the diagonal contacts [m], shape ``(q, 2, 4)``; no batches where there is no
            cell.
        general: That of the general contacts, shape ``(g, 2)``; no rows where there is no cell.
        row: Row of the gradient.
        own: Work space of each tile, ``own`` of `relax_stretched_scalar`, shape ``(tiles, 12)``.
    """

    branch: Floats
    general: Floats
    row: int
    own: Floats


NO_CELL = CellTerms(np.empty((0, 2, LANES)), np.empty((0, 2)), 0, np.empty((0, 3 * LANES)))


@loop_body
def push_general(
    g: int, d_n: float, d_t: float, velocity: Floats, inverse: Floats, pair: Ints, frame: Floats,
    lever: Floats, cell: CellTerms,
) -> None:  # fmt: skip
    """Change the velocities of the two bodies of a contact by an impulse. Arrays as in `System`."""
    nx, ny = frame[g, NX], frame[g, NY]
    px, py = d_n * nx - d_t * ny, d_n * ny + d_t * nx
    i, j = pair[g, FIRST], pair[g, SECOND]
    velocity[i, X] += inverse[i, X] * px
    velocity[i, Y] += inverse[i, Y] * py
    velocity[i, SURFACE] += inverse[i, SPIN] * (
        d_n * lever[g, FIRST, NORMAL] + d_t * lever[g, FIRST, TANGENTIAL]
    )
    velocity[j, X] -= inverse[j, X] * px
    velocity[j, Y] -= inverse[j, Y] * py
    velocity[j, SURFACE] -= inverse[j, SPIN] * (
        d_n * lever[g, SECOND, NORMAL] + d_t * lever[g, SECOND, TANGENTIAL]
    )
    if cell.general.size:
        lx, ly, row = cell.general[g, X], cell.general[g, Y], cell.row
        velocity[row, XX] += inverse[row, XX] * (px * lx)
        velocity[row, YY] += inverse[row, YY] * (py * ly)
        velocity[row, XY] += inverse[row, XY] * (px * ly)


@loop_body
def general_velocity(
    g: int, velocity: Floats, pair: Ints, frame: Floats, lever: Floats, cell: CellTerms
) -> tuple[float, float]:
    """u_n + b and u_t of a contact [m/s]. Arrays as in `System`."""
    i, j = pair[g, FIRST], pair[g, SECOND]
    nx, ny = frame[g, NX], frame[g, NY]
    dx, dy = velocity[i, X] - velocity[j, X], velocity[i, Y] - velocity[j, Y]
    if cell.general.size:
        lx, ly, row = cell.general[g, X], cell.general[g, Y], cell.row
        dx += velocity[row, XX] * lx + velocity[row, XY] * ly
        dy += velocity[row, YY] * ly
    a, b = velocity[i, SURFACE], velocity[j, SURFACE]
    u_n = dx * nx + dy * ny + a * lever[g, FIRST, NORMAL] - b * lever[g, SECOND, NORMAL]
    u_t = dy * nx - dx * ny + a * lever[g, FIRST, TANGENTIAL] - b * lever[g, SECOND, TANGENTIAL]
    return u_n + frame[g, BIAS], u_t - frame[g, SLIDE]


@loop_body
def general_solution(
    g: int, frame: Floats, p_n: float, p_t: float, u_n: float, u_t: float, is_exact: bool
) -> tuple[float, float]:
    """Impulses of a contact after a local solve with the others held."""
    w_nn, w_nt, w_tt, mu = frame[g, W_NN], frame[g, W_NT], frame[g, W_TT], frame[g, MU]
    if is_exact:
        return solve_full(p_n, p_t, u_n, u_t, w_nn, w_nt, w_tt, mu)
    # The predictor-corrector needs ρ < 2 over the largest eigenvalue; the trace bounds that.
    rho = min(
        1.0 / np.sqrt(w_nn * w_tt), 1.5 / (w_nn + w_tt) if w_nt != 0.0 else 1.9 / max(w_nn, w_tt)
    )
    return predict_and_correct(p_n, p_t, u_n, u_t, rho, mu)


@loop_body
def correction(g: int, frame: Floats, d_n: float, d_t: float) -> tuple[float, float]:
    """The velocity that goes with a change of the impulses, W d [m/s]."""
    return frame[g, W_NN] * d_n + frame[g, W_NT] * d_t, frame[g, W_NT] * d_n + frame[g, W_TT] * d_t


@loop_body
def relax_general(
    velocity: Floats, inverse: Floats, pair: Ints, frame: Floats, lever: Floats, impulse: Floats,
    before: Floats, is_exact: bool, extrapolation: float, cell: CellTerms,
) -> tuple[float, float]:  # fmt: skip
    """Relax all general contacts, extrapolated first; returns what `sweep` does, of these."""
    squares, onward = 0.0, 0.0
    for g in range(pair.shape[0]):
        now_n, now_t = impulse[g, NORMAL], impulse[g, TANGENTIAL]
        p_n = now_n + extrapolation * (now_n - before[g, NORMAL])
        p_t = now_t + extrapolation * (now_t - before[g, TANGENTIAL])
        u_n, u_t = general_velocity(g, velocity, pair, frame, lever, cell)
        new_n, new_t = general_solution(g, frame, p_n, p_t, u_n, u_t, is_exact)
        impulse[g, NORMAL], impulse[g, TANGENTIAL] = new_n, new_t
        before[g, NORMAL], before[g, TANGENTIAL] = now_n, now_t
        d_n, d_t = new_n - p_n, new_t - p_t
        if d_n != 0.0 or d_t != 0.0:
            push_general(g, d_n, d_t, velocity, inverse, pair, frame, lever, cell)
            c_n, c_t = correction(g, frame, d_n, d_t)
            squares += c_n * c_n + c_t * c_t
            onward += c_n * (new_n - now_n) + c_t * (new_t - now_t)
    return squares, onward


# ---- The sweep

EXACT, BIPOTENTIAL = 0, 1


class Relaxation(NamedTuple):
    """How contacts are relaxed.

    ``normal`` and ``tangential`` are factors on corrections of the exact local solve of diagonal
    contacts: 1 solves the contact, less goes part of the way. ``extrapolation`` is ω: impulses of
    all contacts move on by ω times their last change before they are relaxed.
    """

    normal: float
    tangential: float
    extrapolation: float


class System(NamedTuple):
    """A contact problem in the order of the sweep.

    ``q`` batches of four diagonal contacts, ``g`` general contacts, ``b`` bodies. A lane without
    contact joins two bodies of its tile that nothing moves. Arrays begin at cache lines.

    Attributes:
        velocity: Bodies: v_x, v_y [m/s], s (a ω for grains [m/s], Ω for walls [rad/s]), 1/m [1/kg];
            then wall proxies, then bodies of empty lanes. **Modified by sweeps.**
        inverse: Bodies: inverse mass per degree of freedom, for general contacts, shape ``(b, 3)``.
        slot: Contact in each lane, -1 if there is none, shape ``(q, 4)``.
        pair: Bodies of the diagonal contacts: four times their rows, shape ``(q, 2, 4)``.
        frame: Diagonal: n_x, n_y, 1/W_nn [kg], bias b [m/s], μ, shape ``(q, 5, 4)``.
        impulse: Diagonal: p_n, p_t [N s], shape ``(q, 2, 4)``. **Modified by sweeps.**
        tile_start: First batch of each tile, shape ``(tiles + 1,)``; no tile has a single batch.
        color_start: First tile of each color, shape ``(colors + 1,)``; the last tile may be of no
            color and is relaxed serially.
        general_pair: Bodies of the general contacts, shape ``(g, 2)``.
        general_frame: n_x, n_y, W_nn, b, μ, W_nt, W_tt, and the surface speed of j that is taken
            from u_t, shape ``(g, 8)``.
        general_lever: What the third velocity of body i adds to u_n and u_t, and what that of j
            takes from them, shape ``(g, 2, 2)``.
        general_impulse: p_n, p_t [N s], shape ``(g, 2)``. **Modified by sweeps.**
        spin_factor: β = m a²/I of the diagonal contacts.
        contacts: Number of contacts of both kinds.
        couples: Couples of rolling resistance.
        cell: What a cell that is periodic in both directions adds.
        faces: The last of the general contacts, in batches: points of grains that are no discs.
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
    cell: CellTerms = NO_CELL
    faces: FaceBatches | None = None


class Before(NamedTuple):
    """Impulses before the last sweep [N s]; shapes ``(q, 2, 4)``, ``(g, 2)`` and ``(k,)``."""

    impulse: Floats
    general_impulse: Floats
    couple: Floats


@formula
def relax_lane(
    lane: np.uint64, velocity: Floats, pair: Ints, frame: Floats, impulse: Floats, before: Floats,
    beta: float, local: int,
    way: Relaxation,
) -> tuple[float, float]:  # fmt: skip
    """Relax a lane; returns what `sweep` sums over the contacts."""
    # −0: adding it changes no bit
    return relax_moving_lane(
        lane, velocity, pair, frame, impulse, before, beta, local, way, -0.0, -0.0
    )[:2]


@formula
def relax_moving_lane(
    lane: np.uint64, velocity: Floats, pair: Ints, frame: Floats, impulse: Floats, before: Floats,
    beta: float, local: int, way: Relaxation, more_x: float, more_y: float,
) -> tuple[float, float, float, float]:  # fmt: skip
    """As `relax_lane` where something else adds to the velocity between the bodies [m/s].

    Velocities are read once. Also returns the change of the impulse in x and y [N s].
    """
    q, f, p = pair_place(lane), frame_place(lane), impulse_place(lane)
    i, j = np.uint64(pair[q]), np.uint64(pair[q + SECOND_])
    nx, ny, w_inverse, mu = frame[f], frame[f + NY_], frame[f + MASS_], frame[f + MU_]
    xi, yi = velocity[i], velocity[i + Y_]
    si, mi = velocity[i + SURFACE_], velocity[i + INVERSE_MASS_]
    xj, yj = velocity[j], velocity[j + Y_]
    sj, mj = velocity[j + SURFACE_], velocity[j + INVERSE_MASS_]
    dx, dy = xi - xj + more_x, yi - yj + more_y
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
    velocity[i], velocity[i + Y_] = xi + mi * px, yi + mi * py
    velocity[i + SURFACE_] = si - mi * spin
    velocity[j], velocity[j + Y_] = xj - mj * px, yj - mj * py
    velocity[j + SURFACE_] = sj - mj * spin
    w = mi + mj
    c_n, c_t = w * d_n, w * (1.0 + beta) * d_t
    onward = c_n * (new_n - now_n) + c_t * (new_t - now_t)
    return c_n * c_n + c_t * c_t, onward, px, py


@loop_body
def relax_scalar(
    first: int, last: int, velocity: Floats, pair: Ints, frame: Floats, impulse: Floats,
    before: Floats, beta: float, local: int,
    way: Relaxation,
) -> tuple[float, float]:  # fmt: skip
    """Relax batches ``first … last-1``.

    Returns what `sweep` does, of these: over each lane first.
    """
    squares, onward = (0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0)
    for lane in range(LANES * first, LANES * last):
        square, on = relax_lane(
            np.uint64(lane), velocity, pair, frame, impulse, before, beta, local, way
        )
        # Each lane for itself: the sums take turns
        squares, onward = take_turns(squares, square), take_turns(onward, on)
    return sum_lanes(squares), sum_lanes(onward)


@formula
def stretch_of(
    branch: Floats, lane: np.uint64, xx: float, yy: float, xy: float
) -> tuple[float, float]:
    """L ℓ of a contact [m/s]; ``branch`` flat."""
    b = branch_place(lane)
    lx, ly = branch[b], branch[b + BRANCH_Y_]
    return xx * lx + xy * ly, yy * ly


@loop_body
def relax_stretched_scalar(
    first: int, last: int, velocity: Floats, pair: Ints, frame: Floats, impulse: Floats,
    before: Floats, beta: float, local: int, way: Relaxation, branch: Floats, own: Floats,
) -> tuple[float, float]:  # fmt: skip
    """As `relax_scalar` in a cell; ``branch`` is flat.

    ``own`` has three rows of four, flat: the gradient L with which it begins, what p ⊗ ℓ changes it
    by, and what is **modified**: Σ p ⊗ ℓ over the changes of impulses, xx, yy and xy [N s m]. Each
    batch moves L on for those that come `LATE` batches after the next.
    """
    squares, onward = (0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0)
    now = own[XX], own[YY], own[XY]
    late = later = whole = (0.0, 0.0, 0.0)
    for batch in range(first, last):
        pulled = (0.0, 0.0, 0.0)
        for column in range(LANES):
            lane = np.uint64(LANES * batch + column)
            place = branch_place(lane)
            lx, ly = branch[place], branch[place + BRANCH_Y_]
            square, on, px, py = relax_moving_lane(
                lane, velocity, pair, frame, impulse, before, beta, local, way,
                now[XX] * lx + now[XY] * ly, now[YY] * ly,
            )  # fmt: skip
            # Each lane for itself: the sums take turns
            squares, onward = take_turns(squares, square), take_turns(onward, on)
            pulled = pulled[XX] + px * lx, pulled[YY] + py * ly, pulled[XY] + px * ly
        now = (
            now[XX] + own[LANES + XX] * late[XX], now[YY] + own[LANES + YY] * late[YY],
            now[XY] + own[LANES + XY] * late[XY],
        )  # fmt: skip
        late, later = later, pulled
        whole = whole[XX] + pulled[XX], whole[YY] + pulled[YY], whole[XY] + pulled[XY]
    own[2 * LANES + XX], own[2 * LANES + YY], own[2 * LANES + XY] = whole
    return sum_lanes(squares), sum_lanes(onward)


@kernel
def _relax_stretched(
    first: int, last: int, velocity: Floats, pair: Ints, frame: Floats, impulse: Floats,
    before: Floats, beta: float, local: int, way: Relaxation, branch: Floats, gradient: Floats,
    inverse: Floats, tiles: int, own: Floats,
) -> tuple[float, float]:  # fmt: skip
    """Relax a tile of a cell; arguments as `begin_gradient` and `relax_stretched_scalar`."""
    begin_gradient(gradient, inverse, tiles, own)
    if HAS_VECTORS and local == EXACT:
        return relax_stretched_batches(  # type: ignore[no-any-return]
            first, last, velocity, pair, frame, impulse, before, beta, way.normal, way.tangential,
            way.extrapolation, branch, own,
        )  # fmt: skip
    return relax_stretched_scalar(
        first, last, velocity, pair, frame, impulse, before, beta, local, way, branch, own
    )


@loop_body
def _relax_range(
    first: int, last: int, velocity: Floats, pair: Ints, frame: Floats, impulse: Floats,
    before: Floats, beta: float, local: int,
    way: Relaxation,
) -> tuple[float, float]:  # fmt: skip
    if HAS_VECTORS and local == EXACT:
        return relax_batches(  # type: ignore[no-any-return]
            first, last, velocity, pair, frame, impulse, before, beta, way.normal, way.tangential,
            way.extrapolation
        )  # fmt: skip
    return relax_scalar(first, last, velocity, pair, frame, impulse, before, beta, local, way)


@threaded_loop
def _relax_tiles_on_threads(
    color_start: NDArray[np.int64], tile_start: NDArray[np.int64], velocity: Floats, pair: Ints,
    frame: Floats, impulse: Floats, before: Floats, beta: float, local: int, way: Relaxation,
    partial: Floats, branch: Floats, gradient: Floats, inverse: Floats, own: Floats,
) -> None:  # fmt: skip
    for color in range(color_start.size - 1):
        for t in prange(color_start[color], color_start[color + 1]):
            if branch.size:
                partial[t, 0], partial[t, 1] = _relax_stretched(
                    tile_start[t], tile_start[t + 1], velocity, pair, frame, impulse, before, beta,
                    local, way, branch, gradient, inverse,
                    color_start[color + 1] - color_start[color], own[t],
                )  # fmt: skip
            else:
                partial[t, 0], partial[t, 1] = _relax_range(
                    tile_start[t], tile_start[t + 1], velocity, pair, frame, impulse, before, beta,
                    local, way,
                )  # fmt: skip
        if branch.size:
            end_gradient(color_start[color], color_start[color + 1], gradient, inverse, own)


@subroutine
def _relax_cell(
    first: int, color_start: NDArray[np.int64], tile_start: NDArray[np.int64], velocity: Floats,
    pair: Ints, frame: Floats, impulse: Floats, before: Floats, beta: float, local: int,
    way: Relaxation, partial: Floats, branch: Floats, gradient: Floats, inverse: Floats,
    own: Floats,
) -> None:  # fmt: skip
    """Relax the colors of a cell from ``first`` on, and the tile after the last, one by one."""
    for color in range(first, color_start.size):
        begin = color_start[color]
        end = color_start[color + 1] if color + 1 < color_start.size else tile_start.size - 1
        for t in range(begin, end):
            partial[t, 0], partial[t, 1] = _relax_stretched(
                tile_start[t], tile_start[t + 1], velocity, pair, frame, impulse, before, beta,
                local, way, branch, gradient, inverse, end - begin, own[t],
            )  # fmt: skip
        end_gradient(begin, end, gradient, inverse, own)


@kernel
def sweep(
    s: System, before: Before, local: int, way: Relaxation, parallel: bool, partial: Floats
) -> tuple[float, float]:
    """One Gauss–Seidel sweep over all contacts and couples.

    Returns Σ c² [m²/s²] over the corrections c = W d of velocities, with d what an impulse has
    changed by since it was extrapolated, and Σ c (p − p_before) [J]: below 0 where the corrections
    point against what has changed since the sweep before.

    ``before`` are the impulses before the last sweep, on return those before this one. ``way`` has
    the factors of the exact local solve and of the extrapolation of impulses (velocities have had
    theirs). Results on several threads (``parallel``), which relax the tiles of one color, are the
    same. ``partial`` is work space, shape ``(tiles, 2)``.
    """
    velocity, pair = s.velocity.reshape(-1), s.pair.reshape(-1)
    frame, impulse = s.frame.reshape(-1), s.impulse.reshape(-1)
    last, start, beta = before.impulse.reshape(-1), s.tile_start, s.spin_factor
    branch = s.cell.branch.reshape(-1)
    gradient, inverse = s.velocity[s.cell.row], s.inverse[s.cell.row]
    first = 0
    if parallel:
        _relax_tiles_on_threads(
            s.color_start, start, velocity, pair, frame, impulse, last, beta, local, way, partial,
            branch, gradient, inverse, s.cell.own,
        )  # fmt: skip
        first = s.color_start[-1]
    if branch.size:
        _relax_cell(
            s.color_start.size - 1 if parallel else 0, s.color_start, start, velocity, pair, frame,
            impulse, last, beta, local, way, partial, branch, gradient, inverse, s.cell.own,
        )  # fmt: skip
        first = start.size - 1
    for t in range(first, start.size - 1):
        partial[t, 0], partial[t, 1] = _relax_range(
            start[t], start[t + 1], velocity, pair, frame, impulse, last, beta, local, way
        )
    sums = sum_tiles(partial)
    alone = s.general_pair.shape[0]
    if local == EXACT:
        alone = first_of_batches(s.faces, alone)
    of_general = relax_general(
        s.velocity, s.inverse, s.general_pair[:alone], s.general_frame, s.general_lever,
        s.general_impulse, before.general_impulse, local == EXACT, way.extrapolation, s.cell,
    )  # fmt: skip
    of_faces = 0.0, 0.0
    if local == EXACT:
        of_faces = relax_faces(
            s.faces, s.color_start, velocity, s.general_impulse, before.general_impulse, beta,
            way.extrapolation, parallel, partial, gradient, inverse, s.cell.own,
        )  # fmt: skip
    of_couples = relax_couples(
        s.velocity, s.inverse, s.couples, impulse, s.general_impulse, before.couple,
        way.extrapolation,
    )  # fmt: skip
    return (
        sums[0] + of_general[0] + of_faces[0] + of_couples[0],
        sums[1] + of_general[1] + of_faces[1] + of_couples[1],
    )


@formula
def push_lane(
    lane: np.uint64, d_n: float, d_t: float, velocity: Floats, pair: Ints, frame: Floats,
    beta: float,
) -> None:  # fmt: skip
    """Change the velocities of the two bodies of a diagonal contact by an impulse; arrays flat."""
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


@loop_body
def push_scalar(
    first: int, last: int, velocity: Floats, pair: Ints, frame: Floats, impulse: Floats, beta: float
) -> None:
    """Change velocities by the impulses of the contacts of batches ``first … last-1``."""
    for k in range(LANES * first, LANES * last):
        p = impulse_place(np.uint64(k))
        push_lane(np.uint64(k), impulse[p], impulse[p + TANGENTIAL_], velocity, pair, frame, beta)


_push = push_batches if HAS_VECTORS else push_scalar


@loop_body
def pull_scalar(
    first: int, last: int, frame: Floats, impulse: Floats, branch: Floats
) -> tuple[float, float, float]:
    """Σ p ⊗ ℓ of the contacts of batches ``first … last-1``: xx, yy, xy [N s m], lane by lane."""
    xx, yy, xy = 0.0, 0.0, 0.0
    for column in range(LANES):
        own_xx, own_yy, own_xy = 0.0, 0.0, 0.0
        for batch in range(first, last):
            lane = np.uint64(LANES * batch + column)
            f, p, b = frame_place(lane), impulse_place(lane), branch_place(lane)
            nx, ny, p_n, p_t = frame[f], frame[f + NY_], impulse[p], impulse[p + TANGENTIAL_]
            px, py = p_n * nx - p_t * ny, p_n * ny + p_t * nx
            own_xx += px * branch[b]
            own_yy += py * branch[b + BRANCH_Y_]
            own_xy += px * branch[b + BRANCH_Y_]
        xx += own_xx
        yy += own_yy
        xy += own_xy
    return xx, yy, xy


_pull = pull_batches if HAS_VECTORS else pull_scalar


@formula
def pull_gradient(s: System, xx: float, yy: float, xy: float) -> None:
    """Change the gradient of a cell by impulses with this Σ p ⊗ ℓ [N s m]."""
    row = s.cell.row
    s.velocity[row, XX] += s.inverse[row, XX] * xx
    s.velocity[row, YY] += s.inverse[row, YY] * yy
    s.velocity[row, XY] += s.inverse[row, XY] * xy


@kernel
def add_impulses(s: System) -> None:
    """Free velocities become v_free + M⁻¹ H p, in the order of the sweep."""
    if s.cell.branch.size:
        xx, yy, xy = _pull(
            0, s.slot.shape[0], s.frame.reshape(-1), s.impulse.reshape(-1),
            s.cell.branch.reshape(-1),
        )  # fmt: skip
        pull_gradient(s, xx, yy, xy)
    _push(
        0, s.slot.shape[0], s.velocity.reshape(-1), s.pair.reshape(-1), s.frame.reshape(-1),
        s.impulse.reshape(-1), s.spin_factor,
    )  # fmt: skip
    for g in range(s.general_pair.shape[0]):
        d_n, d_t = s.general_impulse[g, NORMAL], s.general_impulse[g, TANGENTIAL]
        push_general(
            g, d_n, d_t, s.velocity, s.inverse, s.general_pair, s.general_frame, s.general_lever,
            s.cell,
        )  # fmt: skip
    for c in range(s.couples.impulse.size):
        push_couple(c, s.couples.impulse[c], s.couples, s.velocity, s.inverse)
