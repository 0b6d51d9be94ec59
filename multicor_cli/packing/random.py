"""Random packings: random sequential addition, then a relaxation of what is too dense for it.

Up to an area fraction of 0.42 of the free part of the region, grains are put at random free places
and stay there. Denser ones are first put there with radii shrunk to that fraction, then brought to
full size and moved apart. Fractions of 0.80 and a little more are reached (frictionless discs jam
near 0.84; in narrow regions, whose sides waste space, below that), and as much of what is no disc.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from multicor_cli.arithmetic.sums import mean, total
from multicor_cli.engine.jit.threads import threads_for
from multicor_cli.model.columns import X, Y
from multicor_cli.model.model import Floats
from multicor_cli.model.outlines import Outlines
from multicor_cli.model.shapes import IS_THIN
from multicor_cli.packing.initial_grains import PackingRegion
from multicor_cli.packing.overlap import find_pairs
from multicor_cli.packing.placing import insert_at_random, make_field
from multicor_cli.packing.relaxation import INFLATION, are_hit, outlined, relax
from multicor_cli.packing.sizes import Stream
from multicor_cli.packing.walls import GRAIN, Obstacles
from multicor_cli.scenario.problems import Refused

DEFAULT_ATTEMPTS = 1000

_EASY_FRACTION = 0.42
_USUAL_FRACTION = 0.80
_DENSEST_FRACTION = math.pi / math.sqrt(12.0)
_ACCEPTED_OVERLAP = 5e-4
_ITERATIONS = 20_000
_PATIENCE, _ENDLESS = 2_000, 10**9  # of grains that are no discs
_SEED = 0.25  # of the size at which they are free where these are known to be
_GROWTH = 1.05  # they grow by this factor at a time,
_LOOSE = 0.01  # and this overlap over the smaller reach is left until they have their size
_WEIGHT = 1e-3  # of grains that settle, over the smallest reach: how far it sinks into its support
_SKIN = 0.3  # of the mean radius
_PROBES = 96
_BATCH = 1024
_MOST_MISSES = 200  # batches without a single point that counts as an attempt


def random_packing(
    radius: Floats,
    region: PackingRegion,
    obstacles: Obstacles,
    separation: float,
    attempts: int,
    rng: Stream,
) -> Floats:
    """Random centers of discs inside ``region`` without overlaps [m], shape ``(n, 2)``.

    ``separation`` is the smallest gap over the mean diameter; ``attempts`` places are tried for
    each grain before the relaxation has to make room for it. `Refused` if no arrangement without
    overlaps was found; that says how many grains would fit.
    """
    enlarged = radius + separation * mean(radius)
    solid = obstacles.with_sides(region)
    free = _free_area(enlarged, region, solid)
    fraction = np.pi * total(enlarged * enlarged) / free if free > 0.0 else math.inf
    if fraction > _DENSEST_FRACTION:
        raise refusal(radius.size, fraction, "more than any packing can reach")
    shrink = min(1.0, math.sqrt(_EASY_FRACTION / fraction))
    inserted = _insert(shrink * enlarged, region, solid, attempts, rng)
    if inserted is None:
        raise refusal(radius.size, fraction, "and hardly any of its points has room for the next")
    position, is_complete = inserted
    if shrink == 1.0 and is_complete and not region.is_periodic_in_y:
        return position
    worst, steps = relax(
        position, enlarged * (1.0 + INFLATION), region, solid, 2.0 * INFLATION,
        skin=_SKIN * mean(enlarged), patience=_ITERATIONS, most=_ITERATIONS,
    )  # fmt: skip
    _refuse_overlap(worst, steps, fraction, position, region, solid)
    return position


def pack_outlines(
    outlines: Outlines, angle: Floats, region: PackingRegion, obstacles: Obstacles,
    separation: float, attempts: int, rng: Stream, *, turns: bool, settles: bool = False,
) -> Floats:  # fmt: skip
    """Random centers [m] and angles [rad] of grains without overlaps, shape ``(n, 3)``.

    They begin as discs: the circles around the grains, shrunk until they are easily placed. Grains
    then grow in small steps, and after each they are moved apart and turned as the overlaps of
    their true outlines with each other, with grains that are there and with walls demand. In the
    end they may settle on the bottom of the region.

    Angles are at first those given, and remain so unless grains may turn; other arguments and
    `Refused` as of `random_packing`, with the least gap over the mean of twice the reach.
    """
    reach, gap = outlines.radius, separation * mean(outlines.radius)
    wide = outlines._replace(rounding=outlines.rounding + np.repeat(gap, outlines.rounding.size))
    solid = obstacles.with_sides(region)
    free, circles = _free_area(reach + gap, region, solid), wide.radius
    fraction = total(outlines.area) / free if free > 0.0 else math.inf
    if fraction > 1.0:
        raise refusal(reach.size, fraction, "more than any packing can reach")
    shrink = min(1.0, math.sqrt(_EASY_FRACTION * free / (math.pi * total(circles * circles))))
    inserted = _insert(shrink * circles, region, solid, attempts, rng)
    if inserted is None:
        raise refusal(reach.size, fraction, "and hardly any of its points has room for the next")
    center, is_complete = inserted
    position = np.column_stack([center, angle])
    is_free = is_complete and not region.is_periodic_in_y and solid.grains is None
    if shrink < 1.0 or not is_free:
        steps = 0
        if not is_free:  # outlines that are not convex would hook into each other
            shrink *= _SEED
        while shrink < 1.0:
            grown = wide.scaled(np.full(reach.size, shrink))
            steps += _relax_outlines(position, grown, region, solid, _LOOSE, turns=turns)[1]
            shrink *= _GROWTH
        _make_room(position, wide, region, solid, fraction, steps, turns=turns)
    if settles:
        weight = _WEIGHT * float(reach.min())
        _relax_outlines(position, wide, region, solid, -1.0, turns=turns, weight=weight)
        _make_room(position, wide, region, solid, fraction, 0, turns=turns)
    return position


def _make_room(
    position: Floats, wide: Outlines, region: PackingRegion, solid: Obstacles, fraction: float,
    steps: int, *, turns: bool,
) -> None:  # fmt: skip
    """Move grains apart until none overlap; `Refused` if that cannot be."""
    # What is left over is a gap, no overlap
    more = np.repeat(INFLATION * wide.radius, np.diff(wide.piece))
    grown = wide._replace(rounding=wide.rounding + more)
    worst, done = _relax_outlines(position, grown, region, solid, 2.0 * INFLATION, turns=turns)
    _refuse_overlap(worst, steps + done, fraction, position, region, solid)


def _relax_outlines(
    position: Floats, outlines: Outlines, region: PackingRegion, solid: Obstacles, target: float,
    *, turns: bool, weight: float = 0.0,
) -> tuple[float, int]:  # fmt: skip
    grains = outlined(outlines, position, region, solid, turns=turns, weight=weight)
    # Sharp corners rattle when jammed, so that forces do not vanish
    patience, most = (_ITERATIONS, _ITERATIONS) if weight > 0.0 else (_PATIENCE, _ENDLESS)
    reach = outlines.radius
    return relax(
        position, reach, region, solid, target, grains, skin=_SKIN * mean(reach),
        patience=patience, most=most,
    )  # fmt: skip


def _refuse_overlap(
    worst: float, steps: int, fraction: float, position: Floats, region: PackingRegion,
    solid: Obstacles,
) -> None:  # fmt: skip
    """Raise `Refused` if grains overlap after a relaxation, or are where they must not be."""
    overlap = max(0.0, worst - 2.0 * INFLATION)
    if overlap > _ACCEPTED_OVERLAP or not _is_inside(position, region, solid).all():
        left = f"an overlap of {overlap:.1e} of the smaller radius is left after "
        left += f"{steps} relaxation steps"
        raise refusal(len(position), fraction, left)


def _is_inside(position: Floats, region: PackingRegion, obstacles: Obstacles) -> NDArray[np.bool_]:
    """Whether centers are in the region and out of solid matter."""
    x, y = position[:, X], position[:, Y]
    found = region.is_periodic | ((x >= region.left) & (x <= region.right))
    found &= region.is_periodic_in_y | ((y >= region.bottom) & (y <= region.top))
    if not obstacles.room.is_open:
        found &= obstacles.room.clearance(position[:, :2]) > 0.0
    return np.asarray(found)


def _insert(
    radius: Floats, region: PackingRegion, obstacles: Obstacles, attempts: int, rng: Stream
) -> tuple[Floats, bool] | None:
    """Random sequential addition, largest first: centers [m], and whether all found a free place.

    None if almost all of the region is solid matter or lies beyond its boundary, or if outlines
    leave hardly any room for the next grain.
    """
    order, grains = np.argsort(-radius, kind="stable"), obstacles
    if obstacles.grains is not None:
        obstacles, grains = obstacles.parted()
    field, fixed = make_field(radius[order], region, obstacles)
    left = 0.0 if region.is_periodic else region.left
    box = (left, region.bottom, region.width, region.height)
    blocked = np.zeros(radius.size, np.int32)
    done, tried, misses = 0, 0, 0
    while done < radius.size:
        uniform = rng.random((max(_BATCH, 2 * (radius.size - done)), 2))
        # Only centers that are not in solid matter count as attempts, nor where outlines leave no
        # room for the next grain: it would be caught between them
        if not obstacles.room.is_open:
            uniform = uniform[obstacles.room.clearance(uniform * box[2:] + box[:2]) > 0.0]
        if grains.grains is not None:
            uniform = uniform[
                ~are_hit(uniform * box[2:] + box[:2], float(radius[order[done]]), region, grains)
            ]
        if grains.grains is not None or not obstacles.room.is_open:
            misses = 0 if len(uniform) else misses + 1
            if misses > _MOST_MISSES:
                return None
        done, tried = insert_at_random(field, fixed, done, tried, attempts, uniform, box, blocked)
    position = np.empty((radius.size, 2))
    position[order] = field.disc[fixed:, :2]
    return position, not blocked.any()


def refusal(count: int, fraction: float, why: str) -> Refused:
    """That grains do not fit, and how many would."""
    text = (
        f"{count} grains do not fit: they would fill {fraction:.3f} of the free area of the "
        f"region, {why}"
    )
    if fraction > _USUAL_FRACTION:
        fits, share = int(count * _USUAL_FRACTION / fraction), f"{_USUAL_FRACTION:.2f}"
        larger = f"about {fits} would fit (fraction {share}): enlarge the region or ask for"
        return Refused((), text, f"{larger} fewer grains")
    # What usually fits does not where sides and corners are near
    larger = "enlarge the region, in which sides and corners leave less room, or ask for"
    fewer = f"fewer grains, {int(0.9 * count)} say" if count > 1 else "a smaller grain"
    return Refused((), text, f"{larger} {fewer}")


def _free_area(radius: Floats, region: PackingRegion, obstacles: Obstacles) -> float:
    """Area of the region without obstacles [m²], told on a grid of points."""
    x = region.left + (np.arange(_PROBES) + 0.5) / _PROBES * region.width
    y = region.bottom + (np.arange(_PROBES) + 0.5) / _PROBES * region.height
    points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    # A point is never inside a thin shape; grains that are no discs have areas of their own
    thick = ~IS_THIN[obstacles.kind] & ~obstacles.is_grain
    size = np.full(len(points), 1e-9 * radius.min())
    solid = Obstacles(obstacles.kind[thick], obstacles.world[thick])
    with threads_for(radius.size):  # few grains, too, have many points
        pairs = find_pairs(points, size, solid, 0.0, region.period)
    covered = np.zeros(len(points), bool)
    owner = np.repeat(np.arange(len(points)), np.diff(pairs.row))
    covered[owner[pairs.partner >= len(points)]] = True
    if not obstacles.room.is_open:
        covered |= obstacles.room.clearance(points) <= 0.0
    free = region.area * (1.0 - np.count_nonzero(covered) / covered.size)
    if obstacles.grains is None:
        return free
    there = obstacles.world[obstacles.is_grain]
    x, y = there[:, X], there[:, Y]
    here = region.is_periodic | ((x > region.left) & (x < region.right))
    here &= (y > region.bottom) & (y < region.top)
    areas = obstacles.grains.area[there[here, GRAIN].astype(np.int64) - 1]
    return free - total(areas)
