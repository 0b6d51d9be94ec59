"""Position correction after a step: which pairs overlap too much, and how they are pushed apart.

In a flow a few contacts overlap a little in nearly every step. They are pushed apart one by one,
and so are those that are pushed too deep by that; nearly always that ends after some pushes each.
Where it does not, every loaded contact around the overlaps can take a part of the correction up to
the target, so that it is enough to move the grains nearby, with all others and the walls held: the
first rounds do that, and the following ones move everything if need be (`separation.py` beside
this). Pushing pairs apart one by one alone never ends under a heavy lid.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.arithmetic.sums import total
from multicor_cli.engine.contact.law import GRAZE
from multicor_cli.engine.geometry.neighbors import Around, NeighborList
from multicor_cli.engine.geometry.outlines import circle_gap, gap_at_least, nearest_point, true_gap
from multicor_cli.engine.geometry.pieces import Pieces, are_convex, are_faces, place_walls
from multicor_cli.engine.geometry.radii import smaller_of
from multicor_cli.engine.geometry.scene import Scene, are_apart, pair_geometry, place_shapes
from multicor_cli.engine.jit.arrays import copy_into
from multicor_cli.engine.jit.compile import inlined, kernel, subroutine
from multicor_cli.engine.motion.cell import strain_between
from multicor_cli.engine.motion.separation import displace, levers_of, separate
from multicor_cli.engine.motion.walls import WallMotion
from multicor_cli.engine.orders import PhysicsError
from multicor_cli.model.columns import FIRST, SECOND, XX, XY, YY, X, Y
from multicor_cli.model.model import Floats, Ints, Model

# ---- No overlap may exceed 5·10⁻⁴ of the smaller radius

ALLOWED = GRAZE  # overlap over the smaller radius that is left alone
# What the correction leaves, so that a loaded contact stays closed and the next correction is far
TARGET = 2.5e-4
# Gap of pairs that take part, which a chain of corrections may close: over the largest overlap, and
# at most over the mean diameter
CHAIN, NEAR = 20.0, 0.1
FORBIDDEN = 1e-3  # a run that cannot get below this stops
FEW = 0.1  # pairs per grain that are pushed apart one by one: more push each other
PUSHES = 20  # for each of them
ROUNDS = 20  # of linearized corrections
LOCAL_ROUNDS = 3  # of them with only the grains nearby
RINGS = 4  # of neighbors that make up "nearby"
LOCAL_SHARE = 0.5  # of all grains; if more are nearby, all are moved at once
# Largest displacement of a sweep, over the smallest radius, with which a round ends
ENOUGH = 0.3 * ALLOWED
ROUND_SWEEPS = 2_000  # cap of a round
# Cap of a round with the grains nearby: some twenty do, unless what is held leaves no room
LOCAL_SWEEPS = 200


# ---- Overlaps, and the grains around them


@inlined
def _overlap(scene: Scene, pieces: Pieces | None, i: int, j: int, known: float) -> float:
    """Overlap of a pair over its smaller radius; negative where they are apart.

    Any number up to ``known`` where it is no larger than that.
    """
    smaller = smaller_of(scene, i, j)
    if pieces is not None:  # a look at all of their edges takes five times as long
        apart = circle_gap(scene, i, j)
        if apart < 0.0 and are_convex(pieces, i, j):
            apart = gap_at_least(scene, pieces, i, j)
        if apart >= -known * smaller:
            return min(-apart / smaller, known)
    elif are_apart(scene, i, j, -known * smaller):
        return known
    return -true_gap(scene, pieces, i, j)[0] / smaller


@kernel
def mark_overlaps(
    scene: Scene, pieces: Pieces | None, i: Ints, j: Ints, tolerance: float,
    marked: NDArray[np.bool_],
) -> tuple[float, float]:  # fmt: skip
    """Mark grains of pairs that overlap by more than ``tolerance``, over the smaller radius.

    Returns the largest overlap of these, and of all others (or 0).
    """
    above, below = 0.0, 0.0
    marked[:] = False
    for c in range(i.size):
        overlap = _overlap(scene, pieces, i[c], j[c], below)
        if overlap > tolerance:
            marked[i[c]] = True
            above = max(above, overlap)
        else:
            below = max(below, overlap)
    return above, below


@kernel
def mark_again(
    scene: Scene, pieces: Pieces | None, around: Around, tolerance: float, marked: NDArray[np.bool_]
) -> tuple[float, float]:
    """As `mark_overlaps`, of all listed pairs of grains that are ``marked``: they have moved."""
    above, below = 0.0, 0.0
    again = np.zeros(marked.size, np.bool_)
    for k in range(marked.size):
        if not marked[k]:
            continue
        for e in range(around.start[k], around.start[k + 1]):
            other = around.other[e]
            is_other = other < marked.size and marked[other]
            if is_other and other < k:
                continue
            overlap = _overlap(scene, pieces, min(k, other), max(k, other), below)
            if overlap > tolerance:
                again[k] = True
                if is_other:
                    again[other] = True
                above = max(above, overlap)
            else:
                below = max(below, overlap)
    copy_into(marked, again)
    return above, below


@kernel
def surround(
    scene: Scene, pieces: Pieces | None, around: Around, near: float, rings: int,
    marked: NDArray[np.bool_],
) -> int:  # fmt: skip
    """Mark the grains around marked ones too, over gaps up to ``near`` [m], in some rings.

    Returns how many are marked.
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
                if other >= count or marked[other]:
                    continue
                i, j = min(grains[k], other), max(grains[k], other)
                if true_gap(scene, pieces, i, j)[0] <= near:
                    marked[other] = True
                    grains[found] = other
                    found += 1
        begin = end
    return found


@kernel
def pairs_of(around: Around, marked: NDArray[np.bool_]) -> tuple[Ints, Ints]:
    """The listed pairs (i, j) of marked grains, each once."""
    room = 0
    for k in range(marked.size):
        if marked[k]:
            room += around.start[k + 1] - around.start[k]
    first, second, found = np.empty(room, np.int32), np.empty(room, np.int32), 0
    for k in range(marked.size):
        if not marked[k]:
            continue
        for e in range(around.start[k], around.start[k + 1]):
            other = around.other[e]
            if other < k and marked[other]:
                continue
            first[found], second[found] = min(k, other), max(k, other)
            found += 1
    return first[:found], second[:found]


# ---- Pushing apart, pair by pair


@subroutine
def _opening(
    scene: Scene, pieces: Pieces | None, a: int, b: int, mass: Floats, inertia: Floats
) -> tuple[float, float, float, float, float, float, float]:
    """Gap [m] and normal of a pair, and what opens it by a unit of length with the least work.

    These are the ways of a and b along the normal, away from each other, and by how much each turns
    [1/m], as its lever says.
    """
    count = mass.size
    if pieces is not None and are_faces(pieces, a, b):
        point = nearest_point(scene, pieces, a, b)
        of_a, of_b = levers_of(point)
        way_a, turn_a, way_b, turn_b = 1.0 / mass[a], of_a / inertia[a], 0.0, 0.0
        if b < count:
            way_b, turn_b = 1.0 / mass[b], of_b / inertia[b]
        give = way_a + way_b + of_a * turn_a + of_b * turn_b
        return (
            point.gap, point.nx, point.ny, way_a / give, way_b / give, turn_a / give,
            -turn_b / give,
        )  # fmt: skip
    gap, nx, ny = pair_geometry(scene, a, b)
    way_a = mass[b] / (mass[a] + mass[b]) if b < count else 1.0
    return gap, nx, ny, way_a, 1.0 - way_a, 0.0, 0.0


@kernel
def push_pairs(
    scene: Scene, pieces: Pieces | None, i: Ints, j: Ints, around: Around, mass: Floats,
    inertia: Floats, marked: NDArray[np.bool_],
) -> tuple[float, float]:  # fmt: skip
    """Push pairs that overlap by more than `ALLOWED` back to `TARGET`, and whom that pushes.

    One after the other, as masses and moments of inertia say, walls held, until none is left or too
    many have been; not at all where these are not few. Positions of ``scene`` and ``pieces`` are
    **modified**; grains that move are marked. Returns Σ m δx and Σ m δy [kg m].
    """
    count, pull_x, pull_y, found = marked.size, 0.0, 0.0, 0
    most = int(FEW * count)
    queue = np.empty((PUSHES * most, 2), np.int32)
    for c in range(i.size):
        if marked[i[c]] and _overlap(scene, pieces, i[c], j[c], ALLOWED) > ALLOWED:
            if found == most:
                return 0.0, 0.0
            queue[found, FIRST], queue[found, SECOND] = i[c], j[c]
            found += 1
    done = 0
    while done < found:
        a, b = queue[done, FIRST], queue[done, SECOND]
        done += 1
        gap, nx, ny, way_a, way_b, turn_a, turn_b = _opening(scene, pieces, a, b, mass, inertia)
        smaller = smaller_of(scene, a, b)
        if -gap <= ALLOWED * smaller:
            continue
        opened = -gap - TARGET * smaller
        displace(scene, pieces, a, way_a * opened * nx, way_a * opened * ny, turn_a * opened)
        pull_x += mass[a] * way_a * opened * nx
        pull_y += mass[a] * way_a * opened * ny
        marked[a] = True
        if b < count:
            displace(scene, pieces, b, -way_b * opened * nx, -way_b * opened * ny, turn_b * opened)
            pull_x -= mass[b] * way_b * opened * nx
            pull_y -= mass[b] * way_b * opened * ny
            marked[b] = True
        for k in (a, b):
            if k >= count:
                continue
            for e in range(around.start[k], around.start[k + 1]):
                first, second = min(k, around.other[e]), max(k, around.other[e])
                if found < queue.shape[0] and (
                    _overlap(scene, pieces, first, second, ALLOWED) > ALLOWED
                ):
                    queue[found, FIRST], queue[found, SECOND] = first, second
                    found += 1
    return pull_x, pull_y


# ---- All that a step needs


class Correction(NamedTuple):
    """What the correction of a step did; no ``rounds`` if nothing had to be moved.

    ``overlap`` is the largest over the smaller radius that is left; works of gravity and of loads
    on walls are ΣF·δq over the displacements [J].
    """

    overlap: float
    gravity_work: float
    load_work: float
    rounds: int


@kernel
def push_apart(
    scene: Scene, pieces: Pieces | None, local: Floats, i: Ints, j: Ints, around: Around,
    mass: Floats, inertia: Floats, wall_inverse: Floats, near: float, below: float,
    marked: NDArray[np.bool_],
) -> tuple[float, float, float, int]:  # fmt: skip
    """Pairs one by one, then rounds of linearized corrections, until no overlap exceeds `ALLOWED`.

    The pairs (i, j) are those that may at first, all others overlap by ``below`` at most;
    ``around`` lists all with a gap up to ``near`` [m], which take part. ``local`` are the wall
    shapes in the frames of their walls, ``wall_inverse`` inverse masses of walls, shape ``(w, 3)``:
    they move with everything only. **Modifies** what `correct_positions` does; ``marked`` is work
    space, shape ``(n,)``. Returns the largest overlap, Σ m δx and Σ m δy [kg m], and the rounds.
    """
    above, others = mark_overlaps(scene, pieces, i, j, ALLOWED, marked)
    below = max(below, others)
    held, pull_x, pull_y, rounds = np.zeros_like(wall_inverse), 0.0, 0.0, 0
    if above > 0.0:
        pull_x, pull_y = push_pairs(scene, pieces, i, j, around, mass, inertia, marked)
        above, others = mark_again(scene, pieces, around, ALLOWED, marked)
        below = max(below, others)
        rounds = 1
    while above > 0.0 and rounds < ROUNDS:
        largest, least = 0.0, np.inf
        for radius in scene.radius:
            largest, least = max(largest, radius), min(least, radius)
        near = min(near, CHAIN * above * largest)
        is_local = rounds <= LOCAL_ROUNDS
        if is_local:
            count = surround(scene, pieces, around, near, RINGS, marked)
            is_local = count <= LOCAL_SHARE * marked.size
        if not is_local:
            marked[:] = True
        first, second = pairs_of(around, marked)
        shift, dx, dy = separate(
            scene, pieces, first, second, marked, mass, inertia, held if is_local else wall_inverse,
            near, TARGET, ALLOWED, ENOUGH * least, LOCAL_SWEEPS if is_local else ROUND_SWEEPS,
        )  # fmt: skip
        pull_x += dx
        pull_y += dy
        if not is_local and scene.height > 0.0:
            xx, yy, xy = shift[0, XX], shift[0, YY], shift[0, XY]
            sides = scene.wall_position[0]
            sides[XY] += xx * sides[XY] + xy * sides[YY]
            sides[XX] += xx * sides[XX]
            sides[YY] += yy * sides[YY]
            scene = Scene(
                scene.position, scene.radius, scene.material, scene.kind, scene.wall, scene.world,
                scene.wall_position, sides[XX], scene.temperature, sides[YY], sides[XY],
            )  # fmt: skip
        elif not is_local:
            for k in range(shift.shape[0]):
                scene.wall_position[k, X] += shift[k, X]
                scene.wall_position[k, Y] += shift[k, Y]
            place_shapes(scene.kind, scene.wall, local, scene.wall_position, scene.world)
            if pieces is not None:
                place_walls(pieces, scene, pieces.corner)
        above, others = mark_again(scene, pieces, around, ALLOWED, marked)
        below = max(below, others) if is_local else others
        rounds += 1
    return max(above, below), pull_x, pull_y, rounds


def reach_of(overlap: float, model: Model) -> float:
    """Gap of pairs that take part in a correction of the largest ``overlap`` [m]."""
    chain = CHAIN * overlap * float(model.grains.radius.max())
    return min(chain, NEAR * model.mean_diameter)


def correct_positions(
    scene: Scene, pieces: Pieces | None, model: Model, gravity: Floats, motion: WallMotion,
    lists: NeighborList, i: Ints, j: Ints, near: float, below: float, marked: NDArray[np.bool_],
    step: int,
) -> Correction:  # fmt: skip
    """Project positions, mass-weighted, until no overlap exceeds `ALLOWED`.

    **Modifies** positions, wall frames and wall shapes of ``scene``, at q⁺. Walls that a force
    drives move according to their mass. Pairs that overlap by more than ``below``, over the smaller
    radius, are among (i, j); ``lists`` has all up to a gap of `NEAR`; ``marked`` is work space,
    shape ``(n,)``. Raises `PhysicsError` if overlaps above `FORBIDDEN` cannot be removed.
    """
    before = scene.wall_position.copy()
    mobility = motion.mobility
    if model.is_cell:  # what it costs to move all grains with it, about their center
        side = scene.wall_position[0, [XX, YY, YY]]
        mobility = (mobility > 0.0) * 12.0 / (total(model.grains.mass) * side * side)
    mass, inertia = model.grains.mass, model.grains.mass
    if pieces is not None:  # discs do not turn
        spin = model.spin_radius  # which follows grains that grow or wear
        inertia = mass * spin * spin / model.shape_factor
    overlap, pull_x, pull_y, rounds = push_apart(
        scene, pieces, model.shapes.geometry, i, j, lists.around, mass,
        inertia, mobility, near, below, marked,
    )  # fmt: skip
    if overlap > FORBIDDEN:
        raise PhysicsError(step, _name_overlap(scene, pieces, model, lists, marked, overlap))
    shift = scene.wall_position - before
    if model.is_cell:
        shift = strain_between(before[0], scene.wall_position[0])[np.newaxis]
    work = pull_x * float(gravity[X]) + pull_y * float(gravity[Y])
    if not shift.any():
        return Correction(overlap, work, 0.0, rounds)
    work += total(motion.weight * shift)
    return Correction(overlap, work, motion.shift_work(before, shift), rounds)


@kernel
def _worst_pair(
    scene: Scene, pieces: Pieces | None, row: NDArray[np.int64], partner: Ints,
    marked: NDArray[np.bool_],
) -> tuple[int, int]:  # fmt: skip
    """The pair that overlaps most, of those that are listed with marked grains."""
    worst, first, second = -np.inf, 0, 0
    for i in range(marked.size):
        for p in range(row[i], row[i + 1] if marked[i] else row[i]):
            depth = _overlap(scene, pieces, i, partner[p], worst)
            if depth > worst:
                worst, first, second = depth, i, partner[p]
    return first, second


def _name_overlap(
    scene: Scene, pieces: Pieces | None, model: Model, lists: NeighborList,
    marked: NDArray[np.bool_], overlap: float,
) -> str:  # fmt: skip
    i, j = _worst_pair(scene, pieces, lists.row, lists.partner, marked)
    n = model.grain_count
    why = "too many grains between prescribed walls?"
    if model.is_cell:
        why = "does the cell shrink too fast, or below the room that its grains need?"
    if model.expansion.size:
        why = "grains that expand need walls that give way: give one a load, or a spring"
    other = model.name_of(j) if j < n else f"wall '{model.walls.names[model.shapes.wall[j - n]]}'"
    return (
        f"{model.name_of(i)} and {other} overlap by {overlap:.2e} of the smaller radius and no "
        f"admissible positions were found ({why})"
    )
