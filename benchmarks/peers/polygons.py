"""Sharp polygons with rigid contacts: a block on a slope, an arch, and pentagons poured into a bin;
and what is measured of them, by the same functions for all codes.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from case import Floats
from scipy.spatial import cKDTree

GRAVITY, FRICTION = 9.81, 0.5
RADIUS, VOUSSOIRS, LEAST = 10.0, 11, 0.10459
"""Mean radius of the arch [m], its blocks, and by limit analysis the least thickness over the
radius at which it stands (computed in ``tests/verification/test_shapes.py``)."""

FALLEN = 0.02
"""A block of an arch that has turned by more says that it falls [rad]."""

_NEAR_SLOPE = 0.02  # of tan θ on both sides of μ
_SLIDES = 2.0  # time on the slope [s]
_STANDS = 10.0  # time in which an arch falls, or stands [s]: 10 √(R/g)
_FACTORS, _HALVINGS = (0.9, 1.3), 9  # of the least thickness: to 0.04 %
_LEAN, _RESTS = 0.1, 4.0  # tan of the angle by which gravity leans on masonry, and its time [s]


class Bodies(NamedTuple):
    """Polygons on a floor at y = 0, perhaps between two sides.

    Attributes:
        outlines: Corners of each, counter-clockwise, where it begins at rest [m].
        friction: μ of all contacts.
        slope: tan θ, by which gravity leans towards +x.
        width: Where the sides are: x = 0 and this [m]; 0 if there are none.
    """

    outlines: list[Floats]
    friction: float
    slope: float = 0.0
    width: float = 0.0

    @property
    def gravity(self) -> Floats:
        """Along x and y [m/s²]."""
        return GRAVITY * np.array([self.slope, -1.0]) / math.hypot(self.slope, 1.0)


class Seen(NamedTuple):
    """What a run was like, frame by frame.

    Attributes:
        position: Centers, and angles from the start [m, m, rad], shape ``(f, n, 3)``.
        velocity: Their rates [m/s, m/s, rad/s], likewise.
        seconds: Time of the processor for the steps before each frame [s], shape ``(f,)``.
    """

    position: Floats
    velocity: Floats
    seconds: Floats


Run = Callable[[Bodies, float, int], Seen]
"""Takes bodies, the time between frames [s] and their number."""


@dataclass(frozen=True)
class Pour:
    """What a pour was like.

    Attributes:
        largest: Largest overlap over the smaller radius in any frame.
        mean: Mean overlap of the pairs that overlap, in the last frame.
        kinetic: Kinetic energy left over that of a fall by a radius, of all.
        made: Largest rise of the energy above what it was before, likewise.
        height: Mean height of the centers in the last frame [m].
    """

    largest: float
    mean: float
    kinetic: float
    made: float
    height: float


# ---- Scenes


def block_on_slope(factor: float) -> Bodies:
    """A block of 2 m by 1 m where tan θ is so many times μ."""
    return Bodies([_box(10.0, 0.0, 12.0, 1.0)], FRICTION, factor * FRICTION)


def arch(factor: float) -> Bodies:
    """A semicircular arch of so many times the least thickness, with rough joints."""
    angle = math.pi * np.arange(VOUSSOIRS + 1) / VOUSSOIRS
    ray = RADIUS * np.column_stack([np.cos(angle), np.sin(angle)])
    ray[[0, -1], 1] = 0.0
    half, middle = 0.5 * factor * LEAST, np.array([2.0 * RADIUS, 0.0])
    inner, outer = middle + (1.0 - half) * ray, middle + (1.0 + half) * ray
    blocks = [np.array([inner[k], outer[k], outer[k + 1], inner[k + 1]]) for k in range(VOUSSOIRS)]
    return Bodies(blocks, 1.0)


def masonry(courses: int) -> Bodies:
    """Bricks of 2 m by 1 m in running bond, as long as twice the height; gravity leans a little."""
    bricks = []
    for row in range(courses):
        ends = 10.0 + np.arange(0.0, 2.0 * courses + 0.5, 2.0)
        if row % 2:
            ends = np.concatenate([ends[:1], ends[:-1] + 1.0, ends[-1:]])
        bricks += [_box(left, row, right, row + 1.0) for left, right in pairwise(ends)]
    return Bodies(bricks, FRICTION, _LEAN)


def _box(left: float, low: float, right: float, high: float) -> Floats:
    return np.array([[left, low], [right, low], [right, high], [left, high]])


def loose_pentagons(count: int, seed: int) -> Bodies:
    """Pentagons of radii 0.4 to 0.6 m, at any angle, on a loose lattice in a bin."""
    random, pitch = np.random.default_rng(seed), 1.25
    columns = max(4, round(math.sqrt(0.5 * count)))
    radius = random.uniform(0.4, 0.6, count)
    turn = random.uniform(0.0, 2.0 * math.pi, count)
    angle = turn[:, np.newaxis] + 2.0 * math.pi * np.arange(5) / 5.0
    row, column = np.divmod(np.arange(count), columns)
    middle = pitch * np.column_stack([column + 0.5, row + 0.5])
    corners = middle[:, np.newaxis] + radius[:, np.newaxis, np.newaxis] * np.stack(
        [np.cos(angle), np.sin(angle)], axis=-1
    )
    return Bodies(list(corners), FRICTION, width=pitch * columns)


# ---- Measures


def center_and_gyration(corners: Floats) -> tuple[Floats, float, float]:
    """Center of a polygon [m], its area [m²], and its radius of gyration squared [m²]."""
    origin = corners[0]
    x, y = (corners - origin).T
    after_x, after_y = np.roll(x, -1), np.roll(y, -1)
    cross = x * after_y - y * after_x
    area = 0.5 * float(cross.sum())
    center = np.array([((x + after_x) * cross).sum(), ((y + after_y) * cross).sum()]) / (6.0 * area)
    squares = x * x + x * after_x + after_x**2 + y * y + y * after_y + after_y**2
    second = float((squares * cross).sum()) / (12.0 * area)
    return origin + center, area, second - float(center @ center)


def overlaps(corners: Floats, radius: Floats, bodies: Bodies) -> Floats:
    """Overlaps of polygons with each other, the floor and the sides, over the smaller radius.

    Args:
        corners: Of polygons with as many corners each [m], shape ``(n, k, 2)``.
        radius: How far they reach from their centers [m], shape ``(n,)``.
        bodies: What they are.

    By separating axes: the way along which two convex polygons come apart soonest is the normal of
    an edge.
    """
    middle = corners.mean(axis=1)
    pairs = cKDTree(middle).query_pairs(2.0 * float(radius.max()), output_type="ndarray")
    i, j = pairs.T if len(pairs) else np.empty((2, 0), np.int64)
    apart = np.maximum(_apart(corners[i], corners[j]), _apart(corners[j], corners[i]))
    found = [-apart / np.minimum(radius[i], radius[j]), -corners[..., 1].min(axis=1) / radius]
    if bodies.width > 0.0:
        x = corners[..., 0]
        found += [-x.min(axis=1) / radius, (x.max(axis=1) - bodies.width) / radius]
    together = np.concatenate(found)
    return together[together > 0.0]


def _apart(ours: Floats, theirs: Floats) -> Floats:
    """How far the edges of polygons separate them from others [m]; below 0 if they do not."""
    edge = np.roll(ours, -1, axis=1) - ours
    normal = np.stack([edge[..., 1], -edge[..., 0]], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    lever = theirs[:, np.newaxis] - ours[:, :, np.newaxis]
    return np.asarray((lever * normal[:, :, np.newaxis]).sum(axis=-1).min(axis=2).max(axis=1))


def moved(bodies: Bodies, position: Floats) -> Floats:
    """Corners of polygons with as many corners each, in a frame [m], shape ``(n, k, 2)``."""
    center = np.array([center_and_gyration(corners)[0] for corners in bodies.outlines])
    local = np.array(bodies.outlines) - center[:, np.newaxis]
    c, s = np.cos(position[:, 2, np.newaxis]), np.sin(position[:, 2, np.newaxis])
    x, y = local[..., 0], local[..., 1]
    return position[:, np.newaxis, :2] + np.stack([c * x - s * y, s * x + c * y], axis=-1)


def describe_pour(bodies: Bodies, seen: Seen) -> Pour:
    """What a pour was like."""
    measured = [center_and_gyration(corners) for corners in bodies.outlines]
    mass, second = np.array([m[1] for m in measured]), np.array([m[2] for m in measured])
    radius = np.array([
        np.linalg.norm(corners - m[0], axis=1).max()
        for corners, m in zip(bodies.outlines, measured, strict=True)
    ])  # fmt: skip
    of_fall = float((mass * radius).sum()) * GRAVITY
    speed = (seen.velocity[..., :2] ** 2).sum(axis=-1) + second * seen.velocity[..., 2] ** 2
    kinetic = 0.5 * (mass * speed).sum(axis=1)
    energy = kinetic + GRAVITY * (mass * seen.position[..., 1]).sum(axis=1)
    lowest = np.minimum.accumulate(energy)
    found = [overlaps(moved(bodies, frame), radius, bodies) for frame in seen.position]
    return Pour(
        max(float(each.max(initial=0.0)) for each in found),
        float(found[-1].mean()) if found[-1].size else 0.0,
        float(kinetic[-1]) / of_fall,
        float((energy - lowest).max()) / of_fall,
        float(seen.position[-1, :, 1].mean()),
    )


def slope_errors(run: Run) -> tuple[float, float]:
    """Error of the acceleration of what slides, over its own; way of what rests [m].

    Both after the first frame, in which the block settles.
    """
    slides, rests = block_on_slope(1.0 + _NEAR_SLOPE), block_on_slope(1.0 - _NEAR_SLOPE)
    seen = run(slides, 0.25 * _SLIDES, 4)
    gained = float(seen.velocity[-1, 0, 0] - seen.velocity[1, 0, 0]) / (0.5 * _SLIDES)
    right = float(slides.gravity[0] + slides.friction * slides.gravity[1])
    resting = run(rests, 0.25 * _SLIDES, 4)
    way = float(resting.position[-1, 0, 0] - resting.position[0, 0, 0])
    return abs(gained / right - 1.0), abs(way)


def least_thickness(run: Run) -> float:
    """Thickness at which an arch no longer falls, over that of limit analysis; by halving."""
    low, high = _FACTORS
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        seen = run(arch(middle), 0.25 * _STANDS, 4)
        stands = float(np.abs(seen.position[..., 2]).max()) < FALLEN
        low, high = (low, middle) if stands else (middle, high)
    return 0.5 * (low + high)


def drift(run: Run, courses: int) -> tuple[float, float]:
    """Way of the brick of leaning masonry that has moved most, over the height of one, and the time
    of the processor for a brick and second."""
    bodies = masonry(courses)
    seen = run(bodies, 0.25 * _RESTS, 4)
    center = np.array([center_and_gyration(corners)[0] for corners in bodies.outlines])
    ways = np.linalg.norm(seen.position[-1, :, :2] - center, axis=1)
    return float(ways.max()), float(seen.seconds.sum()) / (_RESTS * len(center))
