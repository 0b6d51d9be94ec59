"""Solves the contacts around the worst one exactly and at once, with all other impulses held.

Where friction and unilaterality chase each other around a small cluster of contacts, sweeps may go
on for ever: the solution of the cluster is an unstable fixed point of the sweep. In two dimensions
Coulomb's law is a linear complementarity problem without any approximation (Pfeiffer & Glocker
1996). With σ = p_t + μ p_n and τ = μ p_n − p_t, what is left to either edge of the cone, and u_t =
u₊ − u₋,

    u_n = q_n + W_nn p_n + W_nt (σ − μ p_n)              0 ≤ u_n ⟂ p_n ≥ 0
    u₊  = q_t + W_tn p_n + W_tt (σ − μ p_n) + u₋         0 ≤ u₊ ⟂ σ ≥ 0
    τ   = 2 μ p_n − σ                                    0 ≤ τ ⟂ u₋ ≥ 0

where W is the Delassus matrix of the cluster and q its velocities without its impulses. A finite
number of pivots solves it. Couples of rolling resistance are further rows with friction: u_r and
p_r in place of u_t and p_t, and μ_r of μ.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.contact.complementarity import find_solution
from multicor_cli.engine.contact.face_sweep import FaceBatches, fill_inverse
from multicor_cli.engine.contact.residual import lane_velocity, measure_general, measure_lane
from multicor_cli.engine.contact.rolling import couple_correction, couple_velocity, push_couple
from multicor_cli.engine.contact.sweep import (
    System,
    general_velocity,
    pull_gradient,
    push_general,
    push_lane,
)
from multicor_cli.engine.contact.vector_sweep import (
    MASS_,
    MU_,
    NY_,
    TANGENTIAL_,
    frame_place,
    impulse_place,
    lane_of_impulse,
)
from multicor_cli.engine.jit.compile import kernel, loop_body, subroutine
from multicor_cli.engine.jit.vectors import LANES
from multicor_cli.model.columns import (
    FIRST,
    INVERSE_MASS,
    MU,
    NORMAL,
    NX,
    NY,
    SECOND,
    SPIN,
    TANGENTIAL,
    XX,
    YY,
    X,
    Y,
)
from multicor_cli.model.model import Floats, Ints

# ---- The contacts around the worst one

SIZES = (50, 50, 70, 70, 100)
"""Contacts of the first patch of a solve, of the second, …; work grows with the third power."""

BLOCKS = (50, 70, 100, 50, 100, 200, 150, 200, 300)
"""The same of later ones, again and again: they take turns with sweeps over the rest. (One of 200
takes ten times as long as one of 100, as long as 10,000 sweeps over 1,000 contacts. With nothing
above 200, and that every tenth time, 2 of 130 hard steps of `configs/biaxial.toml` did not end.)"""

SMALL = 100
"""A system with no more contacts than that is one cluster."""

PEAK, SHARE = 5.0, 0.5
"""Peaks have an e_c so many times the rms; errors are clustered if these hold a share of Σ e_c²."""

MINOR = 1e-3
"""Share of the worst e_c below which a contact begins no cluster of its own."""


@loop_body
def _body(contact: int, side: int, s: System) -> int:
    """Row of a body of a contact; contacts are the lanes of all batches, then the general ones."""
    if contact < s.slot.size:
        return s.pair[contact // 4, side, contact % 4] // 4
    return s.general_pair[contact - s.slot.size, side]


@loop_body
def _mobility(body: int, d: int, s: System) -> float:
    m = s.velocity[body, INVERSE_MASS]
    if m > 0.0:
        return m * s.spin_factor if d == SPIN else m
    return s.inverse[body, d] if body < s.inverse.shape[0] else 0.0


@loop_body
def _contact_of(couple: int, s: System) -> int:
    """Number of the contact of a couple: a lane, or that of a general one."""
    place = s.couples.place[couple]
    return lane_of_impulse(place) if place >= 0 else s.slot.size - 1 - place


@kernel
def _measure(s: System) -> tuple[NDArray[np.bool_], Floats]:
    """Contacts that carry an impulse or would; e_c² of all, with e_r² of their couples [m²/s²]."""
    lanes = s.slot.size
    velocity, pair = s.velocity.reshape(-1), s.pair.reshape(-1)
    frame, impulse = s.frame.reshape(-1), s.impulse.reshape(-1)
    active = np.empty(lanes + s.general_pair.shape[0], np.bool_)
    square = np.empty(active.size)
    for k in range(active.size):
        if k < lanes:
            square[k], _, _, active[k] = measure_lane(
                np.uint64(k), velocity, pair, frame, impulse, s.spin_factor, s.cell
            )
        else:
            square[k], _, _, active[k] = measure_general(k - lanes, s)
    for r in range(s.couples.impulse.size):
        off = couple_correction(r, s.couples, s.velocity, impulse, s.general_impulse)
        square[_contact_of(r, s)] += off * off
    return active, square


@kernel
def has_clusters(s: System) -> bool:
    """Whether errors are those of small clusters, where patches help; a small system is one.

    So it is always taken to be where grains have corners: what cycles among them need not peak.
    """
    if s.faces is not None:
        return True
    active, square = _measure(s)
    whole, count = 0.0, 0
    for k in range(square.size):
        whole += square[k]
        count += active[k]
    if count <= SMALL:
        return True
    peaks = 0.0
    for k in range(square.size):
        if square[k] * count >= PEAK * PEAK * whole:
            peaks += square[k]
    return peaks >= SHARE * whole


@kernel
def _contacts_by_body(
    active: NDArray[np.bool_], s: System
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Active contacts of each body: those of body b are ``contact[start[b]:start[b+1]]``."""
    start = np.zeros(s.velocity.shape[0] + 1, np.int64)
    for k in range(active.size):
        if active[k]:
            for side in range(2):
                start[_body(k, side, s) + 1] += 1
    for b in range(start.size - 1):
        start[b + 1] += start[b]
    contact, place = np.empty(start[-1], np.int64), start[:-1].copy()
    for k in range(active.size):
        if active[k]:
            for side in range(2):
                b = _body(k, side, s)
                contact[place[b]] = k
                place[b] += 1
    return start, contact


@kernel
def _around(
    worst: int, size: int, active: NDArray[np.bool_], square: Floats, s: System
) -> NDArray[np.int64]:
    """Up to ``size`` active contacts: the worst, then those that share a movable body with one.

    Where these are all, and there are grains with corners, the worst of those that are left
    follows with its neighbors, and so on: two such clusters are solved together or not at all.
    """
    start, contact = _contacts_by_body(active, s)
    chosen, is_left = np.empty(size, np.int64), active.copy()
    chosen[0], is_left[worst] = worst, False
    found, at = 1, 0
    while found < size:
        if at == found:
            other = -1 if s.faces is None else _worst_of(is_left, square)
            if other < 0 or square[other] < MINOR * MINOR * square[worst]:
                break
            chosen[found], is_left[other] = other, False
            found += 1
        for side in range(2):
            b = _body(chosen[at], side, s)
            mobility = max(_mobility(b, X, s), _mobility(b, Y, s), _mobility(b, SPIN, s))
            first, last = (start[b], start[b + 1]) if mobility > 0.0 else (0, 0)
            for place in range(first, last):
                if is_left[contact[place]] and found < size:
                    chosen[found] = contact[place]
                    is_left[contact[place]] = False
                    found += 1
        at += 1
    return chosen[:found]


@subroutine
def _worst_of(chosen: NDArray[np.bool_], square: Floats) -> int:
    worst = -1
    for k in range(square.size):
        if chosen[k] and (worst < 0 or square[k] > square[worst]):
            worst = k
    return worst


class _Patch(NamedTuple):
    """Contacts of a patch, ``k`` of them, and their couples of rolling resistance, ``r``.

    Its rows are u_n of all contacts, u_t of all contacts, then u_r of all couples: k + f of them, f
    = k + r with friction. What counts rows has the shape ``(k + f,)``.

    Attributes:
        contact: Numbers of the contacts, shape ``(k,)``.
        couple: Rows of the couples in `Couples`, shape ``(r,)``.
        owner: Contact of the patch to which a row belongs.
        body: Rows of the bodies of each contact, shape ``(k, 2)``.
        normal: n_x, n_y, shape ``(k, 2)``.
        branch: Branch vectors in a cell [m], else 0, shape ``(k, 2)``.
        lever: What the third velocities of both bodies add to a row, shape ``(k + f, 2)``.
        friction: μ, or μ_r, of each row with friction, shape ``(f,)``.
        impulse: p_n, p_t, p_r [N s].
        velocity: u_n + b, u_t, u_r [m/s].
    """

    contact: NDArray[np.int64]
    couple: NDArray[np.int64]
    owner: NDArray[np.int64]
    body: NDArray[np.int64]
    normal: Floats
    branch: Floats
    lever: Floats
    friction: Floats
    impulse: Floats
    velocity: Floats


@kernel
def _gather(contact: NDArray[np.int64], s: System) -> _Patch:
    count, lanes, couples = contact.size, s.slot.size, s.couples
    velocity, pair = s.velocity.reshape(-1), s.pair.reshape(-1)
    frame, impulse = s.frame.reshape(-1), s.impulse.reshape(-1)
    place = np.full(lanes + s.general_pair.shape[0] if couples.impulse.size else 0, -1, np.int64)
    for k in range(count if place.size else 0):
        place[contact[k]] = k
    couple = _couples_within(place, s)
    with_friction = count + couple.size
    rows = count + with_friction
    patch = _Patch(
        contact, couple, np.empty(rows, np.int64), np.empty((count, 2), np.int64),
        np.empty((count, 2)), np.zeros((count, 2)), np.empty((rows, 2)),
        np.empty(with_friction), np.empty(rows), np.empty(rows),
    )  # fmt: skip
    for k in range(count):
        c, t = contact[k], count + k
        patch.owner[k] = patch.owner[t] = k
        for side in range(2):
            patch.body[k, side] = _body(c, side, s)
        if c < lanes:
            lane = np.uint64(c)
            f, p = frame_place(lane), impulse_place(lane)
            u_n, u_t = lane_velocity(lane, velocity, pair, frame, s.cell)
            if s.cell.branch.size:
                for d in range(2):
                    patch.branch[k, d] = s.cell.branch[c // 4, d, c % 4]
            patch.normal[k, X], patch.normal[k, Y] = frame[f], frame[f + NY_]
            patch.friction[k] = frame[f + MU_]
            patch.lever[k], patch.lever[t] = 0.0, -1.0
            patch.impulse[k], patch.impulse[t] = impulse[p], impulse[p + TANGENTIAL_]
        else:
            g = c - lanes
            u_n, u_t = general_velocity(
                g, s.velocity, s.general_pair, s.general_frame, s.general_lever, s.cell
            )
            if s.cell.general.size:
                patch.branch[k] = s.cell.general[g]
            patch.normal[k, X], patch.normal[k, Y] = s.general_frame[g, NX], s.general_frame[g, NY]
            patch.friction[k] = s.general_frame[g, MU]
            for row, direction in ((k, NORMAL), (t, TANGENTIAL)):
                patch.lever[row, FIRST] = s.general_lever[g, FIRST, direction]
                patch.lever[row, SECOND] = -s.general_lever[g, SECOND, direction]
            patch.impulse[k] = s.general_impulse[g, NORMAL]
            patch.impulse[t] = s.general_impulse[g, TANGENTIAL]
        patch.velocity[k], patch.velocity[t] = u_n, u_t
    for r in range(couple.size):
        row = 2 * count + r
        patch.owner[row] = place[_contact_of(couple[r], s)]
        patch.lever[row, FIRST] = couples.arm[couple[r], FIRST]
        patch.lever[row, SECOND] = -couples.arm[couple[r], SECOND]
        patch.friction[count + r] = couples.limit[couple[r]]
        patch.impulse[row] = couples.impulse[couple[r]]
        patch.velocity[row] = couple_velocity(couple[r], couples, s.velocity)
    return patch


@kernel
def _couples_within(place: Ints, s: System) -> NDArray[np.int64]:
    found = np.empty(s.couples.impulse.size, np.int64)
    count = 0
    for r in range(found.size):
        if place[_contact_of(r, s)] >= 0:
            found[count] = r
            count += 1
    return found[:count]


@loop_body
def _row(row: int, side: int, d: int, patch: _Patch) -> float:
    """What degree of freedom ``d`` of a body adds to the velocity of a row."""
    count = patch.contact.size
    if d == SPIN:
        return patch.lever[row, side]
    if row >= 2 * count:
        return 0.0
    sign = 1.0 if side == FIRST else -1.0
    if row < count:
        return sign * patch.normal[row, d]
    return sign * (patch.normal[row - count, X] if d == Y else -patch.normal[row - count, Y])


@loop_body
def _pulled(row: int, d: int, patch: _Patch) -> float:
    """What component ``d`` of the gradient of a cell adds to the velocity of a row."""
    if row >= 2 * patch.contact.size:
        return 0.0
    contact = patch.owner[row]
    return _row(row, FIRST, Y if d == YY else X, patch) * patch.branch[contact, X if d == XX else Y]


@kernel
def _delassus(patch: _Patch, s: System) -> Floats:
    """W [1/kg], shape ``(k + f, k + f)``."""
    matrix = np.zeros((patch.owner.size, patch.owner.size))
    for row in range(patch.owner.size):
        for column in range(patch.owner.size):
            a, b = patch.owner[row], patch.owner[column]
            for side in range(2):
                for other in range(2):
                    body = patch.body[a, side]
                    if body == patch.body[b, other]:
                        for d in range(3):
                            m = _mobility(body, d, s)
                            matrix[row, column] += (
                                _row(row, side, d, patch) * m * _row(column, other, d, patch)
                            )
            for d in range(3 if s.cell.own.size else 0):
                m = s.inverse[s.cell.row, d]
                matrix[row, column] += _pulled(row, d, patch) * m * _pulled(column, d, patch)
    return matrix


@kernel
def _solve(patch: _Patch, s: System) -> tuple[bool, Floats]:
    """Whether impulses with all others held were found, and they, shape ``(k + f,)``."""
    count, rows, with_friction = patch.contact.size, patch.owner.size, patch.friction.size
    w = _delassus(patch, s)
    mean = 0.0
    for k in range(count):
        mean += w[k, k] / count
    # Impulses are found in units of this mass times a velocity: numbers are of order 1
    mass = 1.0 / mean
    q, scale = np.empty(rows), 0.0
    for k in range(rows):
        q[k] = patch.velocity[k]
        for c in range(rows):
            q[k] -= w[k, c] * patch.impulse[c]
        scale = max(scale, abs(q[k]))
    new = np.zeros(rows)
    if scale == 0.0:
        return True, new
    matrix = np.zeros((rows + with_friction, rows + with_friction))
    vector = np.zeros(rows + with_friction)
    for k in range(rows):
        vector[k] = q[k] / scale
        for c in range(count):
            matrix[k, c] = mass * w[k, c]
        for f in range(with_friction):
            along = mass * w[k, count + f]
            matrix[k, patch.owner[count + f]] -= patch.friction[f] * along
            matrix[k, count + f] = along
    for f in range(with_friction):
        matrix[count + f, rows + f] = 1.0
        matrix[rows + f, patch.owner[count + f]] = 2.0 * patch.friction[f]
        matrix[rows + f, count + f] = -1.0
    z = np.empty(rows + with_friction)
    if not find_solution(matrix, vector, s.faces is not None, z):
        return False, new
    for k in range(count):
        new[k] = mass * scale * max(z[k], 0.0)
    for row in range(count, rows):
        bound = patch.friction[row - count] * new[patch.owner[row]]
        new[row] = min(max(mass * scale * z[row] - bound, -bound), bound)
    return True, new


def nothing_met(s: System) -> NDArray[np.bool_]:
    """What `choose_patch` keeps in mind, of no contact yet."""
    return np.zeros(s.slot.size + s.general_pair.shape[0], np.bool_)


@kernel
def choose_patch(s: System, size: int, met: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Up to ``size`` contacts around the worst one.

    Points of grains with corners are among them if they have been active before: `keep_in_mind`.
    """
    keep_in_mind(s, met)
    active, square = _measure(s)
    if s.faces is not None:
        active |= met
    return _around(int(np.argmax(square)), size, active, square, s)


@kernel
def keep_in_mind(s: System, met: NDArray[np.bool_]) -> None:
    """Note which contacts are active among points of grains with corners, into ``met``.

    The solution of a patch may need a contact that another one opens, and the other way round.
    """
    if s.faces is not None:
        active, _ = _measure(s)
        met |= active


@kernel
def solve_patch(s: System, contact: NDArray[np.int64]) -> bool:
    """Whether some contacts were solved; impulses and velocities are **modified** only if so."""
    patch = _gather(contact, s)
    is_solved, new = _solve(patch, s)
    if not is_solved:
        return False
    lanes = s.slot.size
    velocity, pair = s.velocity.reshape(-1), s.pair.reshape(-1)
    frame, impulse = s.frame.reshape(-1), s.impulse.reshape(-1)
    count = patch.contact.size
    for k in range(count):
        c = patch.contact[k]
        p_n, p_t = new[k], new[count + k]
        d_n, d_t = p_n - patch.impulse[k], p_t - patch.impulse[count + k]
        if c < lanes:
            p = impulse_place(np.uint64(c))
            impulse[p], impulse[p + TANGENTIAL_] = p_n, p_t
            push_lane(np.uint64(c), d_n, d_t, velocity, pair, frame, s.spin_factor)
            if s.cell.branch.size:
                nx, ny, lx, ly = (
                    patch.normal[k, X], patch.normal[k, Y], patch.branch[k, X], patch.branch[k, Y],
                )  # fmt: skip
                px, py = d_n * nx - d_t * ny, d_n * ny + d_t * nx
                pull_gradient(s, px * lx, py * ly, px * ly)
        else:
            g = c - lanes
            s.general_impulse[g, NORMAL], s.general_impulse[g, TANGENTIAL] = p_n, p_t
            push_general(
                g, d_n, d_t, s.velocity, s.inverse, s.general_pair, s.general_frame,
                s.general_lever, s.cell,
            )  # fmt: skip
    for r in range(patch.couple.size):
        row, couple = 2 * count + r, patch.couple[r]
        s.couples.impulse[couple] = new[row]
        push_couple(couple, new[row] - patch.impulse[row], s.couples, s.velocity, s.inverse)
    return True


@kernel
def _hold_points(
    faces: FaceBatches | None, frame: Floats, rows: NDArray[np.int64], is_held: bool
) -> None:
    """Take W⁻¹ from the batches of points of grains with corners, or give it back.

    ``rows`` are those of general contacts, some of which are such points, ``frame`` their frames.
    """
    if faces is None:
        return
    for g in rows:
        if g < faces.first:
            continue
        q, lane = (g - faces.first) // LANES, (g - faces.first) % LANES
        fill_inverse(q, lane, g, frame, not is_held, faces.block)


@kernel
def hold(s: System, contact: NDArray[np.int64]) -> Floats:
    """Keep sweeps off contacts in batches by taking their mass; returns it for `release` [kg]."""
    frame, mass = s.frame.reshape(-1), np.zeros(contact.size)
    _hold_points(s.faces, s.general_frame, contact - s.slot.size, True)
    for k in range(contact.size):
        if contact[k] < s.slot.size:
            place = frame_place(np.uint64(contact[k])) + MASS_
            mass[k], frame[place] = frame[place], 0.0
    return mass


@kernel
def release(s: System, contact: NDArray[np.int64], mass: Floats) -> None:
    """Undo `hold`."""
    frame = s.frame.reshape(-1)
    _hold_points(s.faces, s.general_frame, contact - s.slot.size, False)
    for k in range(contact.size):
        if contact[k] < s.slot.size:
            frame[frame_place(np.uint64(contact[k])) + MASS_] = mass[k]
