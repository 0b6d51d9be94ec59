"""Random packings: random sequential addition, then a relaxation of what is too dense for it.

Up to an area fraction of 0.42 of the free part of the region, grains are put at random free places
and stay there. Denser ones are first put there with radii shrunk to that fraction, then brought to
full size and moved apart. Fractions of 0.80 and a little more are reached (frictionless discs jam
near 0.84; in narrow regions, whose sides waste space, below that).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.arithmetic.sums import mean, total
from multicor_cli.engine.geometry.scene import gap_to_shape, minimum_image
from multicor_cli.engine.jit.compile import kernel
from multicor_cli.model.columns import X, Y
from multicor_cli.model.model import Floats, Ints
from multicor_cli.model.shapes import IS_THIN
from multicor_cli.packing.initial_grains import PackingRegion
from multicor_cli.packing.overlap import DiscPairs, find_pairs, wrap
from multicor_cli.packing.placing import insert_at_random, make_field
from multicor_cli.packing.sizes import Stream
from multicor_cli.packing.walls import Obstacles
from multicor_cli.scenario.problems import Refused

# ---- The relaxation: grains repel each other and obstacles as they overlap, until none does
#
# The sum of squared overlaps is minimized with the fast inertial relaxation engine (Bitzek et al.,
# Phys. Rev. Lett. 97, 170201, 2006): damped dynamics of unit masses that speeds up while it runs
# downhill and stops when it runs uphill. Below the density at which frictionless discs jam (about
# 0.84 in the plane) states without overlap exist and are reached.

INFLATION = 5e-4
"""Share by which radii are enlarged while relaxing: what is left over is a gap, no overlap."""

# Unit mass and stiffness: six contacts per disc give a highest frequency of √12, stable below 0.57
_LARGEST_STEP = 0.4
FIRST_STEP = 0.1
FIRST_MIXING = 0.1
STEP, MIXING, COUNT = range(3)  # of a clock: time step, mixing, steps since the last uphill one
SKIN = 0.3  # of the mean radius
_ITERATIONS = 20_000
JAMMED = 1e-3  # net force over the largest overlap at which a minimum of the energy is reached


class Ghosts(NamedTuple):
    """Images of grains across the lower and upper side of a region that is periodic in y too.

    The obstacle ``shape`` stands for the grain ``source``, moved by ``shift`` in y [m].
    """

    shape: Ints
    source: Ints
    shift: Floats


@kernel
def _repel(
    position: Floats,
    radius: Floats,
    pairs: DiscPairs,
    kind: Ints,
    world: Floats,
    period: float,
    force: Floats,
) -> float:
    """Fill ``force`` [m] (unit stiffness); return the largest overlap over the smaller radius."""
    count = radius.size
    worst = 0.0
    force[:] = 0.0
    for i in range(count):
        x, y, r = position[i, X], position[i, Y], radius[i]
        for p in range(pairs.row[i], pairs.row[i + 1]):
            j = pairs.partner[p]
            if j >= count:
                gap, nx, ny = gap_to_shape(x, y, r, j - count, kind, world, period)
                if gap < 0.0:
                    force[i, X] -= gap * nx
                    force[i, Y] -= gap * ny
                    # Only one of the two is enlarged, so only half as much may be left over.
                    worst = max(worst, -2.0 * gap / r)
                continue
            dx, dy = minimum_image(x - position[j, X], period), y - position[j, Y]
            near = r + radius[j]
            square = dx * dx + dy * dy
            if square >= near * near or square == 0.0:
                continue
            distance = np.sqrt(square)
            share = (near - distance) / distance
            force[i, X] += share * dx
            force[i, Y] += share * dy
            force[j, X] -= share * dx
            force[j, Y] -= share * dy
            worst = max(worst, (near - distance) / min(r, radius[j]))
    return worst


@kernel
def follow(position: Floats, ghosts: Ghosts, world: Floats) -> None:
    """Bring images to where their grains are; **modifies** ``world``."""
    for g in range(ghosts.shape.size):
        world[ghosts.shape[g], X] = position[ghosts.source[g], X]
        world[ghosts.shape[g], Y] = position[ghosts.source[g], Y] + ghosts.shift[g]


@kernel
def steer(velocity: Floats, force: Floats, clock: Floats) -> None:
    """Adapt time step, mixing and velocities (Bitzek et al.)."""
    power, speed, strength = 0.0, 0.0, 0.0
    for i in range(force.shape[0]):
        for c in range(force.shape[1]):
            power += velocity[i, c] * force[i, c]
            speed += velocity[i, c] * velocity[i, c]
            strength += force[i, c] * force[i, c]
    if power < 0.0:
        clock[STEP], clock[MIXING], clock[COUNT] = 0.5 * clock[STEP], FIRST_MIXING, 0.0
        velocity[:] = 0.0
        return
    clock[COUNT] += 1.0
    share = clock[MIXING] * np.sqrt(speed / strength) if strength > 0.0 else 0.0
    for i in range(force.shape[0]):
        for c in range(force.shape[1]):
            velocity[i, c] = (1.0 - clock[MIXING]) * velocity[i, c] + share * force[i, c]
    if clock[COUNT] > 5.0:
        clock[STEP] = min(1.1 * clock[STEP], _LARGEST_STEP)
        clock[MIXING] *= 0.99


@kernel
def _descend(
    position: Floats,
    velocity: Floats,
    radius: Floats,
    pairs: DiscPairs,
    kind: Ints,
    world: Floats,
    ghosts: Ghosts,
    period: float,
    clock: Floats,
    target: float,
    travel: float,
    steps: int,
) -> tuple[int, float, bool]:
    """Relax until overlaps fall to ``target``, a grain moves by ``travel``, or ``steps`` are done.

    The neighbor list ``pairs`` allows a ``travel`` [m]; ``world`` [m] holds the obstacles
    and images of grains, ``clock`` time step, mixing and steps since the last uphill one.
    **Modifies** ``position`` and ``velocity`` [m], shape ``(n, 2)``, ``world`` and ``clock``.

    Returns:
        Steps done, largest overlap over the smaller radius, whether a minimum with overlaps is met.
    """
    before = position.copy()
    force = np.zeros_like(position)
    smallest = radius.min()
    worst = 0.0
    for step in range(steps):
        follow(position, ghosts, world)
        worst = _repel(position, radius, pairs, kind, world, period, force)
        if worst <= target:
            return step, worst, False
        if np.abs(force).max() < JAMMED * worst * smallest:
            return step, worst, True
        steer(velocity, force, clock)
        moved = 0.0
        for i in range(position.shape[0]):
            for c in range(2):
                velocity[i, c] += clock[STEP] * force[i, c]
                position[i, c] += clock[STEP] * velocity[i, c]
            dx, dy = position[i, X] - before[i, X], position[i, Y] - before[i, Y]
            moved = max(moved, dx * dx + dy * dy)
        if moved > travel * travel:
            return step + 1, worst, False
    return steps, worst, False


def images_of(
    position: Floats, radius: Floats, region: PackingRegion, obstacles: Obstacles, skin: float
) -> tuple[Ghosts, Obstacles]:
    """Images of the grains near the lower and upper side, and the obstacles with them."""
    cutoff = 2.0 * radius.max() + skin
    low = np.flatnonzero(position[:, Y] < region.bottom + cutoff)
    high = np.flatnonzero(position[:, Y] > region.top - cutoff)
    source = np.concatenate([low, high]).astype(np.int32)
    shift = np.concatenate([np.full(low.size, region.height), np.full(high.size, -region.height)])
    shape = (obstacles.kind.size + np.arange(source.size)).astype(np.int32)
    discs = np.column_stack([position[source, X], position[source, Y] + shift, radius[source]])
    return Ghosts(shape, source, shift), obstacles.with_discs(discs)


def relax(
    position: Floats, radius: Floats, region: PackingRegion, obstacles: Obstacles
) -> tuple[Floats, float, int]:
    """Move grains apart until none overlap, they are jammed, or `_ITERATIONS` are spent.

    Closed sides of the region have to be among the obstacles; centers [m] have shape ``(n, 2)``.
    Returns new centers, the largest overlap over the smaller radius, and steps.
    """
    enlarged = radius * (1.0 + INFLATION)
    skin = SKIN * mean(radius)
    now, velocity = np.array(position[:, :2]), np.zeros((radius.size, 2))
    clock = np.array([FIRST_STEP, FIRST_MIXING, 0.0])
    done, worst, is_jammed = 0, np.inf, False
    nothing = Ghosts(np.zeros(0, np.int32), np.zeros(0, np.int32), np.zeros(0))
    while done < _ITERATIONS and not is_jammed and worst > 2.0 * INFLATION:
        if region.is_periodic:
            now[:, X] = wrap(now[:, X], region.width)
        ghosts, solid = nothing, obstacles
        if region.is_periodic_in_y:
            now[:, Y] = region.bottom + wrap(now[:, Y] - region.bottom, region.height)
            ghosts, solid = images_of(now, enlarged, region, obstacles, skin)
        pairs = find_pairs(now, enlarged, solid, skin, region.period)
        steps, worst, is_jammed = _descend(
            now, velocity, enlarged, pairs, solid.kind, solid.world.copy(), ghosts, region.period,
            clock, 2.0 * INFLATION, 0.5 * skin, _ITERATIONS - done,
        )  # fmt: skip
        done += steps
    return now, max(0.0, worst - 2.0 * INFLATION), done


# ---- Random packings

DEFAULT_ATTEMPTS = 1000

EASY_FRACTION = 0.42
_USUAL_FRACTION = 0.80
_DENSEST_FRACTION = math.pi / math.sqrt(12.0)
ACCEPTED_OVERLAP = 5e-4
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
) -> Floats:
    """Random centers of discs inside ``region`` without overlaps [m], shape ``(n, 2)``.

    ``separation`` is the smallest gap over the mean diameter; ``attempts`` places are tried for
    each grain before the relaxation has to make room for it. `Refused` if no arrangement without
    overlaps was found; that says how many grains would fit.
    """
    enlarged = radius + separation * mean(radius)
    solid = obstacles.with_sides(region)
    free = free_area(enlarged, region, solid)
    fraction = np.pi * total(enlarged * enlarged) / free if free > 0.0 else math.inf
    if fraction > _DENSEST_FRACTION:
        raise refusal(radius.size, fraction, "more than any packing can reach")
    shrink = min(1.0, math.sqrt(EASY_FRACTION / fraction))
    inserted = insert(shrink * enlarged, region, solid, attempts, rng)
    if inserted is None:
        raise refusal(radius.size, fraction, "and hardly any of its points is free")
    position, is_complete = inserted
    if shrink == 1.0 and is_complete and not region.is_periodic_in_y:
        return position
    position, overlap, steps = relax(position, enlarged, region, solid)
    if overlap > ACCEPTED_OVERLAP or not is_inside(position, region, solid).all():
        left = f"an overlap of {overlap:.1e} of the smaller radius is left after "
        left += f"{steps} relaxation steps"
        raise refusal(radius.size, fraction, left)
    return position


def is_inside(position: Floats, region: PackingRegion, obstacles: Obstacles) -> NDArray[np.bool_]:
    """Whether centers are in the region and out of solid matter."""
    x, y = position[:, X], position[:, Y]
    found = region.is_periodic | ((x >= region.left) & (x <= region.right))
    found &= region.is_periodic_in_y | ((y >= region.bottom) & (y <= region.top))
    if not obstacles.room.is_open:
        found &= obstacles.room.clearance(position[:, :2]) > 0.0
    return np.asarray(found)


def insert(
    radius: Floats, region: PackingRegion, obstacles: Obstacles, attempts: int, rng: Stream
) -> tuple[Floats, bool] | None:
    """Random sequential addition, largest first: centers [m], and whether all found a free place.

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
        # Only centers that are not in solid matter count as attempts
        if not obstacles.room.is_open:
            uniform = uniform[obstacles.room.clearance(uniform * box[2:] + box[:2]) > 0.0]
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
    larger = "enlarge the region, in which sides and corners leave less room, or ask for fewer"
    return Refused((), text, f"{larger} grains, {int(0.9 * count)} say")


def free_area(radius: Floats, region: PackingRegion, obstacles: Obstacles) -> float:
    """Area of the region without obstacles [m²], told on a grid of points."""
    x = region.left + (np.arange(_PROBES) + 0.5) / _PROBES * region.width
    y = region.bottom + (np.arange(_PROBES) + 0.5) / _PROBES * region.height
    points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    # A point is never inside a thin shape
    thick, size = ~IS_THIN[obstacles.kind], np.full(len(points), 1e-9 * radius.min())
    solid = Obstacles(obstacles.kind[thick], obstacles.world[thick])
    pairs = find_pairs(points, size, solid, 0.0, region.period)
    covered = np.zeros(len(points), bool)
    owner = np.repeat(np.arange(len(points)), np.diff(pairs.row))
    covered[owner[pairs.partner >= len(points)]] = True
    if not obstacles.room.is_open:
        covered |= obstacles.room.clearance(points) <= 0.0
    return region.area * (1.0 - np.count_nonzero(covered) / covered.size)
