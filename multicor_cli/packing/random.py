"""Random packings: random sequential addition, followed by a relaxation where the grains are too dense for it.

Up to an area fraction of 0.42 of the free part of the region, grains are put at random free places and stay there. Denser ones
are first put there with radii shrunk to that fraction, then brought to full size and moved apart. Fractions of 0.80 and a
little more are reached (frictionless discs jam near 0.84; in narrow regions, whose sides waste space, below that).
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from multicor_cli.arithmetic.sums import mean, total
from multicor_cli.model.columns import X, Y
from multicor_cli.model.model import Floats
from multicor_cli.model.shapes import IS_THIN, Room
from multicor_cli.packing.initial_grains import PackingRegion
from multicor_cli.packing.overlap import find_pairs
from multicor_cli.packing.placing import insert_at_random, make_field
from multicor_cli.packing.relaxation import relax
from multicor_cli.packing.sizes import Stream
from multicor_cli.packing.walls import Obstacles
from multicor_cli.scenario.problems import Refused

DEFAULT_ATTEMPTS = 1000

_EASY_FRACTION = 0.42
_USUAL_FRACTION = 0.80
_DENSEST_FRACTION = math.pi / math.sqrt(12.0)
_ACCEPTED_OVERLAP = 5e-4
_PROBES = 96
_BATCH = 1024
_MOST_MISSES = 200  # batches without a single point outside solid matter


def random_packing(
    radius: Floats,
    region: PackingRegion,
    obstacles: Obstacles,
    separation: float,
    attempts: int,
    rng: Stream,
    *,
    is_periodic_in_y: bool = False,
) -> Floats:
    """Random centers without overlaps inside ``region`` [m], shape ``(n, 2)``.

    Args:
        radius: Radii [m], shape ``(n,)``.
        region: Where the grains go; discs stay inside it.
        obstacles: Walls and earlier grains to stay clear of.
        separation: Smallest gap, over the mean diameter.
        attempts: Places tried for each grain before the relaxation has to make room for it.
        rng: Source of the places.
        is_periodic_in_y: Whether the lower and the upper side of the region are one and the same.

    Raises:
        Refused: No arrangement without overlaps was found; says how many grains would fit.
    """
    enlarged = radius + separation * mean(radius)
    solid = obstacles.with_sides(region, bottom=not is_periodic_in_y, top=not is_periodic_in_y)
    fraction = _fraction(enlarged, region, solid)
    if fraction > _DENSEST_FRACTION:
        raise _refusal(radius.size, fraction, "more than any packing can reach")
    shrink = min(1.0, math.sqrt(_EASY_FRACTION / fraction))
    inserted = _insert(shrink * enlarged, region, solid, attempts, rng)
    if inserted is None:
        raise _refusal(radius.size, fraction, "and hardly any of its points is free")
    position, is_complete = inserted
    if shrink == 1.0 and is_complete and not is_periodic_in_y:
        return position
    relaxed = relax(position, enlarged, region, solid, is_periodic_in_y=is_periodic_in_y)
    is_inside = _is_inside(relaxed.position, region, is_periodic_in_y) and _is_clear(relaxed.position, solid.room)
    if relaxed.overlap > _ACCEPTED_OVERLAP or not is_inside:
        left = f"an overlap of {relaxed.overlap:.1e} of the smaller radius is left after {relaxed.iterations} relaxation steps"
        raise _refusal(radius.size, fraction, left)
    return relaxed.position


def _insert(radius: Floats, region: PackingRegion, obstacles: Obstacles, attempts: int, rng: Stream) -> tuple[Floats, bool] | None:
    """Random sequential addition, largest first: centers [m], and whether every grain found a free place.

    None if almost all of the region is solid matter or lies beyond its boundary.
    """
    order = np.argsort(-radius, kind="stable")
    field, fixed = make_field(radius[order], region, obstacles)
    left = 0.0 if region.is_periodic else region.left
    box = (left, region.bottom, region.width, region.height)
    blocked = np.zeros(radius.size, np.int32)
    done, tried, misses = 0, 0, 0
    while done < radius.size:
        uniform = rng.random((max(_BATCH, 2 * (radius.size - done)), 2))
        if not obstacles.room.is_open:  # only centers that are not in solid matter count as attempts
            uniform = uniform[obstacles.room.clearance(uniform * box[2:] + box[:2]) > 0.0]
            misses = 0 if len(uniform) else misses + 1
            if misses > _MOST_MISSES:
                return None
        done, tried = insert_at_random(field, fixed, done, tried, attempts, uniform, box, blocked)
    position = np.empty((radius.size, 2))
    position[order] = field.disc[fixed:, :2]
    return position, not blocked.any()


def _refusal(count: int, fraction: float, why: str) -> Refused:
    text = f"{count} grains do not fit: they would fill {fraction:.3f} of the free area of the region, {why}"
    if fraction > _USUAL_FRACTION:
        fits = int(count * _USUAL_FRACTION / fraction)
        remedy = f"about {fits} would fit (fraction {_USUAL_FRACTION:.2f}): enlarge the region or ask for fewer grains"
    else:  # what usually fits does not where sides and corners are near
        remedy = f"enlarge the region, in which sides and corners leave less room, or ask for fewer grains, {int(0.9 * count)} say"
    return Refused((), text, remedy)


def _is_inside(position: Floats, region: PackingRegion, is_periodic_in_y: bool) -> bool:
    """Whether no center was pushed through a side."""
    x, y = position[:, X], position[:, Y]
    across = region.is_periodic or bool(np.all((x >= region.left) & (x <= region.right)))
    return across and (is_periodic_in_y or bool(np.all((y >= region.bottom) & (y <= region.top))))


def _is_clear(position: Floats, room: Room) -> bool:
    """Whether no center was pushed into solid matter."""
    return room.is_open or bool((room.clearance(position) > 0.0).all())


def _fraction(radius: Floats, region: PackingRegion, obstacles: Obstacles) -> float:
    """Area of the grains over the area of the region that no obstacle covers (estimated on a grid of points)."""
    x = region.left + (np.arange(_PROBES) + 0.5) / _PROBES * region.width
    y = region.bottom + (np.arange(_PROBES) + 0.5) / _PROBES * region.height
    points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    # A point is never inside a thin shape.
    pairs = find_pairs(points, np.full(len(points), 1e-9 * radius.min()), _solid(obstacles), 0.0, region.period)
    covered = np.zeros(len(points), bool)
    owner = np.repeat(np.arange(len(points)), np.diff(pairs.row))
    covered[owner[pairs.partner >= len(points)]] = True
    if not obstacles.room.is_open:
        covered |= obstacles.room.clearance(points) <= 0.0
    free = region.area * (1.0 - np.count_nonzero(covered) / covered.size)
    return np.pi * total(radius * radius) / free if free > 0.0 else math.inf


def _solid(obstacles: Obstacles) -> Obstacles:
    keep = ~IS_THIN[obstacles.kind]
    return replace(obstacles, kind=obstacles.kind[keep], world=obstacles.world[keep])
