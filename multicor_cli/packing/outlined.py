"""Random packings of grains that are no discs.

A random packing begins as one of discs: the circles around the grains, shrunk until they are easily
placed. Grains then grow in small steps, and after each they are moved apart and turned as the
overlaps of their true outlines demand. They keep clear of straight walls and of the sides of the
region by their outlines, of all else by the circles around them.
"""

from __future__ import annotations

import math

import numpy as np

from multicor_cli.arithmetic.sums import mean, total
from multicor_cli.engine.geometry.outlines import Pieces, touch, turn_grains, with_normals
from multicor_cli.engine.geometry.scene import gap_to_shape, minimum_image
from multicor_cli.engine.jit.compile import kernel
from multicor_cli.model.columns import ANGLE, TAIL_X, TAIL_Y, X, Y
from multicor_cli.model.model import Floats, Ints
from multicor_cli.model.outlines import Outlines
from multicor_cli.model.shapes import ShapeKind
from multicor_cli.packing.initial_grains import PackingRegion
from multicor_cli.packing.overlap import DiscPairs, find_pairs, wrap
from multicor_cli.packing.random import (
    ACCEPTED_OVERLAP,
    EASY_FRACTION,
    FIRST_MIXING,
    FIRST_STEP,
    INFLATION,
    JAMMED,
    SKIN,
    STEP,
    Ghosts,
    follow,
    free_area,
    images_of,
    insert,
    is_inside,
    refusal,
    steer,
)
from multicor_cli.packing.sizes import Stream
from multicor_cli.packing.walls import Obstacles

# ---- Relaxation: as that of discs, with the turns of the grains as further coordinates

_GROWTH = 1.05
"""Grains grow by this factor at a time."""

_LOOSE = 0.01
"""Overlap over the smaller reach that is left until grains are as large as they are to be."""

_PATIENCE, _HOPE = 2_000, 0.9
"""The largest overlap has to fall to this share in so many steps: sharp corners rattle when jammed,
so that forces do not vanish."""

_PLANE = int(ShapeKind.PLANE)


@kernel
def _push(force: Floats, i: int, fx: float, fy: float, ox: float, oy: float, reach: float) -> None:
    """Add a force at (ox, oy) from the center of a grain."""
    force[i, X] += fx
    force[i, Y] += fy
    force[i, ANGLE] += (ox * fy - oy * fx) / reach


@kernel
def _repel_pair(
    pieces: Pieces, reach: Floats, i: int, j: int, dx: float, dy: float, is_image: bool,
    force: Floats,
) -> float:  # fmt: skip
    """Add the forces of two grains; (dx, dy) leads from j to i. Of an image only i's."""
    least = 0.0
    for a in range(pieces.piece[i], pieces.piece[i + 1]):
        for b in range(pieces.piece[j], pieces.piece[j + 1]):
            for point in touch(pieces, a, b, dx, dy):
                if point.gap >= 0.0:
                    continue
                fx, fy = -point.gap * point.nx, -point.gap * point.ny
                _push(force, i, fx, fy, point.i_x, point.i_y, reach[i])
                if not is_image:
                    _push(force, j, -fx, -fy, point.j_x, point.j_y, reach[j])
                least = min(least, point.gap)
    return float(-least / min(reach[i], reach[j]))


@kernel
def _repel_plane(
    position: Floats, pieces: Pieces, reach: Floats, i: int, plane: Floats, force: Floats
) -> float:
    """Add the forces of a plane: a point of it, and its normal."""
    nx, ny = plane[TAIL_X], plane[TAIL_Y]
    height = (position[i, X] - plane[X]) * nx + (position[i, Y] - plane[Y]) * ny
    least = 0.0
    for a in range(pieces.piece[i], pieces.piece[i + 1]):
        for v in range(pieces.start[a], pieces.start[a + 1]):
            x, y = pieces.corner[v, X], pieces.corner[v, Y]
            gap = height + x * nx + y * ny - pieces.rounding[a]
            if gap < 0.0:
                _push(force, i, -gap * nx, -gap * ny, x, y, reach[i])
                least = min(least, gap)
    return float(-2.0 * least / reach[i])  # as of discs: only one of the two is enlarged


@kernel
def _repel(
    position: Floats, pieces: Pieces, reach: Floats, pairs: DiscPairs, kind: Ints, world: Floats,
    ghosts: Ghosts, period: float, force: Floats,
) -> float:  # fmt: skip
    """Fill ``force`` [m]; return the largest overlap over the smaller reach."""
    count = reach.size
    first = kind.size - ghosts.shape.size
    worst = 0.0
    force[:] = 0.0
    for i in range(count):
        x, y = position[i, X], position[i, Y]
        for p in range(pairs.row[i], pairs.row[i + 1]):
            j = pairs.partner[p]
            shape = j - count
            if shape >= 0 and kind[shape] == _PLANE:
                worst = max(worst, _repel_plane(position, pieces, reach, i, world[shape], force))
                continue
            if 0 <= shape < first:
                gap, nx, ny = gap_to_shape(x, y, reach[i], shape, kind, world, period)
                if gap < 0.0:
                    _push(force, i, -gap * nx, -gap * ny, 0.0, 0.0, 1.0)
                    worst = max(worst, -2.0 * gap / reach[i])
                continue
            source, up = j, 0.0
            if shape >= 0:
                source, up = ghosts.source[shape - first], ghosts.shift[shape - first]
            dx, dy = minimum_image(x - position[source, X], period), y - position[source, Y] - up
            near = reach[i] + reach[source]
            if dx * dx + dy * dy < near * near:
                worst = max(worst, _repel_pair(
                    pieces, reach, i, source, dx, dy, shape >= 0, force
                ))  # fmt: skip
    return worst


@kernel
def _descend(
    position: Floats, velocity: Floats, local: Pieces, pieces: Pieces, reach: Floats,
    pairs: DiscPairs, kind: Ints, world: Floats, ghosts: Ghosts, period: float, turns: bool,
    clock: Floats, target: float, travel: float, steps: int,
) -> tuple[int, float, bool]:  # fmt: skip
    """As that of discs, with angles; grains keep theirs unless they may turn.

    **Modifies** also the corners of ``pieces``, which are at angle 0 in ``local``.
    """
    before = position.copy()
    force = np.zeros_like(position)
    smallest = reach.min()
    worst = 0.0
    for step in range(steps):
        follow(position, ghosts, world)
        turn_grains(local, position, pieces.corner)
        worst = _repel(position, pieces, reach, pairs, kind, world, ghosts, period, force)
        if worst <= target:
            return step, worst, False
        if not turns:
            force[:, ANGLE] = 0.0
        if np.abs(force).max() < JAMMED * worst * smallest:
            return step, worst, True
        steer(velocity, force, clock)
        moved = 0.0
        for i in range(position.shape[0]):
            for c in range(3):
                velocity[i, c] += clock[STEP] * force[i, c]
            position[i, X] += clock[STEP] * velocity[i, X]
            position[i, Y] += clock[STEP] * velocity[i, Y]
            position[i, ANGLE] += clock[STEP] * velocity[i, ANGLE] / reach[i]
            dx, dy = position[i, X] - before[i, X], position[i, Y] - before[i, Y]
            moved = max(moved, dx * dx + dy * dy)
        if moved > travel * travel:
            return step + 1, worst, False
    return steps, worst, False


_NO_GHOSTS = Ghosts(np.zeros(0, np.int32), np.zeros(0, np.int32), np.zeros(0))


def _relax(
    position: Floats, outlines: Outlines, region: PackingRegion, obstacles: Obstacles,
    target: float, *, turns: bool,
) -> tuple[Floats, float, int]:  # fmt: skip
    """Move grains apart until overlaps fall to ``target``, or hardly any more.

    Returns new centers and angles, the largest overlap over the smaller reach, and steps.
    """
    reach = outlines.radius
    skin = SKIN * mean(reach)
    now, velocity = position.copy(), np.zeros((reach.size, 3))
    local = Pieces(
        outlines.piece, outlines.start, with_normals(outlines), outlines.rounding, reach,
        ~outlines.is_disc,
    )  # fmt: skip
    pieces = local._replace(corner=local.corner.copy())
    clock = np.array([FIRST_STEP, FIRST_MIXING, 0.0])
    done, checked, before = 0, 0, np.inf
    worst, is_jammed = np.inf, False
    while not is_jammed and worst > target:
        if region.is_periodic:
            now[:, X] = wrap(now[:, X], region.width)
        ghosts, solid = _NO_GHOSTS, obstacles
        if region.is_periodic_in_y:
            now[:, Y] = region.bottom + wrap(now[:, Y] - region.bottom, region.height)
            ghosts, solid = images_of(now, reach, region, obstacles, skin)
        pairs = find_pairs(now, reach, solid, skin, region.period)
        steps, worst, is_jammed = _descend(
            now, velocity, local, pieces, reach, pairs, solid.kind, solid.world.copy(),
            ghosts, region.period, turns, clock, target, 0.5 * skin, checked + _PATIENCE - done,
        )  # fmt: skip
        done += steps
        if done >= checked + _PATIENCE:
            is_jammed = is_jammed or worst > _HOPE * before
            checked, before = done, worst
    return now, worst, done


def pack_outlines(
    outlines: Outlines, angle: Floats, region: PackingRegion, obstacles: Obstacles,
    separation: float, attempts: int, rng: Stream, *, turns: bool,
) -> Floats:  # fmt: skip
    """Random centers [m] and angles [rad] of grains without overlaps, shape ``(n, 3)``.

    Angles are at first those given, and remain so unless grains may turn; other arguments and
    `Refused` as of `random_packing`, with the least gap over the mean of twice the reach.
    """
    reach, gap = outlines.radius, separation * mean(outlines.radius)
    wide = outlines._replace(rounding=outlines.rounding + np.repeat(gap, outlines.rounding.size))
    solid = obstacles.with_sides(region)
    free, circles = free_area(reach + gap, region, solid), wide.radius
    fraction = total(outlines.area) / free if free > 0.0 else math.inf
    if fraction > 1.0:
        raise refusal(reach.size, fraction, "more than any packing can reach")
    shrink = min(1.0, math.sqrt(EASY_FRACTION * free / (math.pi * total(circles * circles))))
    inserted = insert(shrink * circles, region, solid, attempts, rng)
    if inserted is None:
        raise refusal(reach.size, fraction, "and hardly any of its points is free")
    center, is_complete = inserted
    position = np.column_stack([center, angle])
    if shrink == 1.0 and is_complete and not region.is_periodic_in_y:
        return position
    overlap, steps = math.inf, 0
    while overlap == math.inf:
        is_last = shrink >= 1.0
        grown = wide.scaled(np.full(reach.size, min(shrink, 1.0)))
        if is_last:  # what is left over is a gap, no overlap
            more = np.repeat(INFLATION * reach, np.diff(grown.piece))
            grown = grown._replace(rounding=grown.rounding + more)
        target = 2.0 * INFLATION if is_last else _LOOSE
        position, worst, done = _relax(position, grown, region, solid, target, turns=turns)
        steps += done
        if is_last:
            overlap = max(0.0, worst - 2.0 * INFLATION)
        shrink *= _GROWTH
    if overlap > ACCEPTED_OVERLAP or not is_inside(position, region, solid).all():
        left = f"an overlap of {overlap:.1e} of the smaller reach is left after "
        raise refusal(reach.size, fraction, f"{left}{steps} relaxation steps")
    return position
