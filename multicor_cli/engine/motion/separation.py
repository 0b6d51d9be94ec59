"""Position correction after a step: overlaps that it leaves, and how they are pushed apart.

The correction is the smallest one in the metric of the masses, min ½ Σ m δq² with gap + n·δq ≥
−target for all near pairs. That is a convex problem, a contact problem without friction whose
velocities are displacements; it is solved by accelerated sweeps, with the walls that a force drives
taking part. (Pushing pairs apart one by one never ends under a heavy lid.)

In a flow a few contacts overlap a little in nearly every step. Every loaded contact around them can
take a part of the correction up to the target, so that it is enough to move the grains nearby, with
all others and the walls held: the first rounds do that, and the following ones move everything if
need be.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.arithmetic.sums import total
from multicor_cli.engine.contact.acceleration import choose_factor, extrapolate, restart, start_loop
from multicor_cli.engine.geometry.neighbors import Around, NeighborList, pairs_within
from multicor_cli.engine.geometry.radii import smaller_of
from multicor_cli.engine.geometry.scene import Scene, pair_geometry, place_shapes
from multicor_cli.engine.jit.chunks import CHUNK, chunks_for, copy_into
from multicor_cli.engine.jit.compile import kernel, parallel_kernel, prange
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.engine.motion.walls import WallMotion
from multicor_cli.engine.orders import PhysicsError
from multicor_cli.model.columns import FIRST, GAP, NX, NY, SECOND, X, Y
from multicor_cli.model.model import Floats, Ints, Model

# ---- Overlaps that the velocity scheme leaves behind at the end of a step (they grow as Δt²)


@parallel_kernel
def measure_overlaps(
    scene: Scene,
    row: NDArray[np.int64],
    partner: Ints,
    tolerance: float,
    gap: Floats,
    flagged: NDArray[np.bool_],
    found: Floats,
) -> None:
    """Overlaps of the listed pairs at the end of a step.

    **Modifies** ``gap``, gaps at q⁺ [m]; ``flagged``, grains with a pair in their row that overlaps
    by more than ``tolerance`` of the smaller radius; and ``found``: in each chunk of grains the
    largest overlap over the smaller radius (or 0) and the number of flagged grains, shape
    ``(chunks, 2)``.
    """
    count = row.size - 1
    for chunk in prange(found.shape[0]):
        flags, best = 0.0, 0.0
        for i in range(chunk * CHUNK, min(count, (chunk + 1) * CHUNK)):
            flagged[i] = False
            for p in range(row[i], row[i + 1]):
                j = partner[p]
                gap[p] = pair_geometry(scene, i, j)[0]
                if gap[p] < 0.0:
                    overlap = -gap[p] / smaller_of(scene, i, j)
                    best = max(best, overlap)
                    if overlap > tolerance:
                        flagged[i] = True
            if flagged[i]:
                flags += 1.0
        found[chunk, 0], found[chunk, 1] = best, flags


# ---- Pushing apart: the grains around overlaps with all others held, or all grains

_MASS = 3  # column of the frames of pairs: 1/W
RESTART_GROWTH = 1.5  # of the change per sweep, at which the momentum restarts


@kernel
def surround(
    around: Around, gap: Floats, near: float, rings: int, marked: NDArray[np.bool_]
) -> tuple[int, NDArray[np.int64]]:
    """Mark the grains around marked ones too, over gaps up to ``near`` [m], in some rings.

    Returns how many are marked, and the pairs up to that gap with a marked grain, in any order.
    """
    count = marked.size
    grains, begin, found = np.empty(count, np.int32), 0, 0
    for k in range(count):
        if marked[k]:
            grains[found] = k
            found += 1
    for _ in range(rings):
        end = found
        for k in range(begin, end):
            for e in range(around.start[grains[k]], around.start[grains[k] + 1]):
                other = around.other[e]
                if other < count and not marked[other] and gap[around.pair[e]] <= near:
                    marked[other] = True
                    grains[found] = other
                    found += 1
        begin = end
    room = 0
    for k in range(found):
        room += around.start[grains[k] + 1] - around.start[grains[k]]
    pairs, kept = np.empty(room, np.int64), 0
    for k in range(found):
        for e in range(around.start[grains[k]], around.start[grains[k] + 1]):
            other = around.other[e]
            is_twice = other < grains[k] and marked[other]
            if gap[around.pair[e]] <= near and not is_twice:
                pairs[kept] = around.pair[e]
                kept += 1
    return found, pairs[:kept]


@kernel
def measure_moved(
    scene: Scene,
    around: Around,
    partner: Ints,
    tolerance: float,
    gap: Floats,
    flagged: NDArray[np.bool_],
) -> tuple[float, int]:
    """As `measure_overlaps`, where only the ``flagged`` grains have moved since then.

    Returns the largest overlap and the number of flagged grains.
    """
    count, deepest, found = flagged.size, 0.0, 0
    for i in range(count):
        if flagged[i]:
            for e in range(around.start[i], around.start[i + 1]):
                p = around.pair[e]
                gap[p] = pair_geometry(scene, around.owner[p], partner[p])[0]
            flagged[i] = False
    for p in range(partner.size):
        if gap[p] < 0.0:
            i = around.owner[p]
            overlap = -gap[p] / smaller_of(scene, i, partner[p])
            deepest = max(deepest, overlap)
            if overlap > tolerance and not flagged[i]:
                flagged[i] = True
                found += 1
    return deepest, found


class _Bodies(NamedTuple):
    """Movable bodies, numbered anew; the last row stands for all that are held.

    Attributes:
        number: Row of each grain and wall, shape ``(n + w,)``.
        mobility: Inverse masses in x and y [1/kg], two unused columns, shape ``(b + 1, 4)``.
        weight: Their reciprocals, 0 where held [kg], shape ``(b + 1, 4)``.
    """

    number: Ints
    mobility: Floats
    weight: Floats


@kernel
def _bodies(marked: NDArray[np.bool_], mass: Floats, wall_inverse: Floats) -> _Bodies:
    n, w = marked.size, wall_inverse.shape[0]
    count = 0
    number = np.full(n + w, -1, np.int32)
    for k in range(n + w):
        if marked[k] if k < n else wall_inverse[k - n, X] > 0.0 or wall_inverse[k - n, Y] > 0.0:
            number[k] = count
            count += 1
    mobility, weight = np.zeros((count + 1, 4)), np.zeros((count + 1, 4))
    for k in range(n + w):
        if number[k] < 0:
            number[k] = count
            continue
        for d in range(2):
            inverse = 1.0 / mass[k] if k < n else wall_inverse[k - n, d]
            mobility[number[k], d] = inverse
            weight[number[k], d] = 1.0 / inverse if inverse > 0.0 else 0.0
    return _Bodies(number, mobility, weight)


@kernel
def _measure(
    scene: Scene, bodies: _Bodies, i: Ints, j: Ints, target: float, allowed: float
) -> tuple[Ints, Floats]:
    """Pairs that can be moved: bodies; normal, how far they may still close [m] and 1/W [kg].

    A pair with a held body keeps an overlap between ``target`` and ``allowed``: a grain between two
    held ones could not be freed of both.
    """
    n, held = scene.radius.size, bodies.mobility.shape[0] - 1
    pair, frame = np.empty((i.size, 2), np.int32), np.empty((i.size, 4))
    found = 0
    for c in range(i.size):
        a = bodies.number[i[c]]
        b = bodies.number[j[c] if j[c] < n else n + scene.wall[j[c] - n]]
        if a == held and b == held:
            continue
        gap, nx, ny = pair_geometry(scene, i[c], j[c])
        give = (bodies.mobility[a, X] + bodies.mobility[b, X]) * nx * nx + (
            bodies.mobility[a, Y] + bodies.mobility[b, Y]
        ) * ny * ny
        if give > 0.0:
            smaller = smaller_of(scene, i[c], j[c])
            left = target * smaller
            if (a == held or b == held) and left < -gap <= allowed * smaller:
                left = -gap
            pair[found, FIRST], pair[found, SECOND] = a, b
            frame[found, NX], frame[found, NY], frame[found, GAP], frame[found, _MASS] = (
                nx,
                ny,
                gap + left,
                1.0 / give,
            )
            found += 1
    return pair[:found], frame[:found]


@formula
def _push_apart(
    c: int, pair: Ints, frame: Floats, push: Floats, mobility: Floats, shift: Floats
) -> float:
    """Relax a pair; returns by how much it opens or closes [m]."""
    a, b = pair[c, FIRST], pair[c, SECOND]
    nx, ny = frame[c, NX], frame[c, NY]
    gap = frame[c, GAP] + nx * (shift[a, X] - shift[b, X]) + ny * (shift[a, Y] - shift[b, Y])
    change = max(-gap * frame[c, _MASS], -push[c])
    if change == 0.0:
        return 0.0
    push[c] += change
    shift[a, X] += mobility[a, X] * change * nx
    shift[a, Y] += mobility[a, Y] * change * ny
    shift[b, X] -= mobility[b, X] * change * nx
    shift[b, Y] -= mobility[b, Y] * change * ny
    return abs(change) / frame[c, _MASS]


@kernel
def _solve(
    pair: Ints, frame: Floats, bodies: _Bodies, enough: float, sweeps: int, memory: NDArray[np.void]
) -> Floats:
    """Displacements of the bodies [m], shape ``(b + 1, 4)``, by accelerated sweeps.

    ``memory`` is that of `start_loop`. It belongs to the caller: Numba frees an array after its
    last use, while a record of it is still in use.
    """
    shift, push = np.zeros_like(bodies.mobility), np.zeros(frame.shape[0])
    before, change, last_push = np.zeros_like(shift), np.zeros_like(shift), np.zeros_like(push)
    now, then, last, weight = (
        shift.reshape(-1),
        before.reshape(-1),
        change.reshape(-1),
        bodies.weight.reshape(-1),
    )
    loop = memory[0]
    for _ in range(sweeps):
        largest, squares = 0.0, 0.0
        for c in range(push.size):
            moved = _push_apart(c, pair, frame, push, bodies.mobility, shift)
            largest = max(largest, moved)
            squares += moved * moved
        if largest <= enough:
            break
        moved = np.sqrt(squares)
        factor = choose_factor(moved, RESTART_GROWTH, loop)
        cross, square = extrapolate(0, shift.shape[0], now, then, last, weight, factor)
        if loop["factor"] * cross > square:
            factor = restart(moved, loop)
            copy_into(now, then)
        loop["factor"] = factor
        for c in range(push.size):
            new = push[c]
            push[c] = new + factor * (new - last_push[c])
            last_push[c] = new
    return shift


@kernel
def separate(
    scene: Scene,
    i: Ints,
    j: Ints,
    marked: NDArray[np.bool_],
    mass: Floats,
    wall_inverse: Floats,
    target: float,
    allowed: float,
    enough: float,
    sweeps: int,
) -> Floats:
    """Move the marked grains as little as leaves no more than a target of overlap.

    Solves min ½ Σ m δq² with gap + n·δq ≥ −target for all near pairs that can be moved, linearized
    at the present positions, which are **modified**. Inverse masses of walls in x and y are of
    shape ``(w, 2)``, 0 if held [1/kg]. Overlaps are over the smaller radius: ``target`` is left,
    and up to ``allowed`` a pair with a held body is left alone. Sweeps end with one whose largest
    displacement is ``enough`` [m] or less. Returns the displacements of the walls [m], shape
    ``(w, 2)``: theirs is to follow.
    """
    bodies = _bodies(marked, mass, wall_inverse)
    pair, frame = _measure(scene, bodies, i, j, target, allowed)
    memory = start_loop(pair.shape[0])
    shift = _solve(pair, frame, bodies, enough, sweeps, memory)
    n = marked.size
    for k in range(n):
        if marked[k]:
            scene.position[k, X] += shift[bodies.number[k], X]
            scene.position[k, Y] += shift[bodies.number[k], Y]
    return shift[bodies.number[n:], :2]


# ---- No overlap may exceed 5·10⁻⁴ of the smaller radius

ALLOWED = 5e-4  # overlap over the smaller radius that is left alone
# What the correction leaves, so that a loaded contact stays closed and the next correction is far
TARGET = 2.5e-4
NEAR = 0.1  # of the mean diameter: the largest gap of pairs that take part
FORBIDDEN = 1e-3  # a run that cannot get below this stops
ROUNDS = 20  # of linearized corrections
LOCAL_ROUNDS = 3  # of them with only the grains nearby
RINGS = 4  # of neighbors that make up "nearby"
LOCAL_SHARE = 0.5  # of all grains; if more are nearby, all are moved at once
# Largest displacement of a sweep, over the smallest radius, with which a round ends
ENOUGH = 0.3 * ALLOWED
ROUND_SWEEPS = 2_000  # cap of a round
# Cap of a round with the grains nearby: some twenty do, unless what is held leaves no room
LOCAL_SWEEPS = 200


class Correction(NamedTuple):
    """What the correction of a step did; no ``rounds`` if nothing had to be moved.

    ``overlap`` is the largest over the smaller radius that is left; works of gravity and of loads
    on walls are ΣF·δq over the displacements [J].
    """

    overlap: float
    gravity_work: float
    load_work: float
    rounds: int


def correct_positions(
    scene: Scene,
    model: Model,
    gravity: Floats,
    motion: WallMotion,
    lists: NeighborList,
    flagged: NDArray[np.bool_],
    step: int,
) -> Correction:
    """Project positions, mass-weighted, until no overlap exceeds `ALLOWED`.

    **Modifies** positions, wall frames and wall shapes of ``scene``, at q⁺. Walls that a force
    drives move according to their mass. ``lists`` has all pairs up to a gap of `NEAR`;
    ``flagged`` is work space, shape ``(n,)``. Raises `PhysicsError` if overlaps above `FORBIDDEN`
    cannot be removed.
    """
    overlap, count = _overlaps(scene, lists, flagged)
    before, wall_before = scene.position[:, :2].copy(), scene.wall_position.copy()
    # Walls are not turned; kernels are compiled anew for another layout
    inverse = np.ascontiguousarray(motion.mobility[:, :2])
    rounds = 0
    while count and rounds < ROUNDS:
        # Pairs that a chain of corrections may close: a few of the largest overlaps away.
        near = min(20.0 * overlap * float(model.grains.radius.max()), NEAR * model.mean_diameter)
        if _correct_once(scene, model, lists, near, flagged, inverse, rounds < LOCAL_ROUNDS):
            overlap, count = _overlaps(scene, lists, flagged)
        else:
            overlap, count = measure_moved(
                scene, lists.around, lists.partner, ALLOWED, lists.gap, flagged
            )
        rounds += 1
    if overlap > FORBIDDEN:
        raise PhysicsError(step, _name_overlap(scene, model, lists, flagged, overlap))
    moved = scene.position[:, :2] - before
    gravity_work = total(model.grains.mass * (moved[:, X] * gravity[X] + moved[:, Y] * gravity[Y]))
    shift = scene.wall_position - wall_before
    gravity_work += total(motion.weight * shift)
    return Correction(overlap, gravity_work, motion.shift_work(wall_before, shift), rounds)


def _correct_once(
    scene: Scene,
    model: Model,
    lists: NeighborList,
    near: float,
    flagged: NDArray[np.bool_],
    inverse: Floats,
    is_local: bool,
) -> bool:
    """One linearized correction: of the grains around the ``flagged`` (**modified**), or of all.

    Walls, with inverse masses in x and y of shape ``(w, 2)``, move with everything only. Returns
    whether they did.
    """
    enough = ENOUGH * float(model.grains.radius.min())
    if is_local:
        around = lists.around
        count, pairs = surround(around, lists.gap, near, RINGS, flagged)
        if count <= LOCAL_SHARE * model.grain_count:
            pairs = np.sort(pairs)
            i, j = around.owner[pairs], lists.partner[pairs]
            held = np.zeros_like(inverse)
            separate(
                scene, i, j, flagged, model.grains.mass, held, TARGET, ALLOWED, enough,
                LOCAL_SWEEPS,
            )  # fmt: skip
            return False
    flagged[:] = True
    i, j = pairs_within(lists.row, lists.partner, lists.gap, near)
    shift = separate(
        scene, i, j, flagged, model.grains.mass, inverse, TARGET, ALLOWED, enough, ROUND_SWEEPS
    )
    scene.wall_position[:, :2] += shift
    place_shapes(scene.kind, scene.wall, model.shapes.geometry, scene.wall_position, scene.world)
    return True


def _overlaps(scene: Scene, lists: NeighborList, flagged: NDArray[np.bool_]) -> tuple[float, int]:
    """Largest overlap over the smaller radius, and number of grains flagged; fills in gaps."""
    found = chunks_for(flagged.size, 2)
    measure_overlaps(scene, lists.row, lists.partner, ALLOWED, lists.gap, flagged, found)
    return float(found[:, 0].max()), round(total(found[:, 1]))


def _name_overlap(
    scene: Scene, model: Model, lists: NeighborList, flagged: NDArray[np.bool_], overlap: float
) -> str:
    worst, pair = -1.0, (0, 0)
    for i in np.flatnonzero(flagged).tolist():
        for j in lists.partner[lists.row[i] : lists.row[i + 1]].tolist():
            depth = -pair_geometry(scene, i, j)[0] / smaller_of(scene, i, j)
            if depth > worst:
                worst, pair = depth, (i, j)
    i, j = pair
    n = model.grain_count
    other = model.name_of(j) if j < n else f"wall '{model.walls.names[model.shapes.wall[j - n]]}'"
    return (
        f"{model.name_of(i)} and {other} overlap by {overlap:.2e} of the smaller radius and no "
        "admissible positions were found (too many grains between prescribed walls?)"
    )
