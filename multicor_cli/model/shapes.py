"""Areas of the plane, and the kinds of shapes that walls are made of: all that is not compiled.

A new kind is one more `ShapeKind` with its row of `SHAPES`, and its gap in
`engine/geometry/scene.py`. Everything else follows from the row, but for two kinds: a disc is a
grain that is glued to a wall, and a plane is the only shape without ends.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.arithmetic import hypot
from multicor_cli.arithmetic.sums import column_totals, total
from multicor_cli.model.columns import RADIUS
from multicor_cli.model.model import Floats, Ints

# ---- Areas of the plane: which points lie in them, how deep, and how large the areas are.
#
# A disc of radius a lies wholly inside an area exactly if the depth of its center is at least a,
# and wholly outside if it is at most −a: that is all that packings, walls and measurements ask.

_AT_ONCE = 1 << 18  # pairs of a point and a side that are compared at once


class Area(ABC):
    """A part of the plane."""

    @property
    @abstractmethod
    def size(self) -> float:
        """Its area [m²]."""

    @abstractmethod
    def corners(self) -> Floats:
        """Lower left and upper right corner of the rectangle around it [m], shape ``(2, 2)``."""

    @abstractmethod
    def depth(self, points: Floats) -> Floats:
        """Distance of points ``(n, 2)`` to the boundary [m], negative outside, shape ``(n,)``."""

    def contains(self, points: Floats) -> NDArray[np.bool_]:
        """Whether points lie in it; its boundary belongs to it."""
        return np.asarray(self.depth(points) >= 0.0)


@dataclass(frozen=True)
class Rectangle(Area):
    """The rectangle between two corners [m]."""

    low: tuple[float, float]
    high: tuple[float, float]

    def contains(self, points: Floats) -> NDArray[np.bool_]:
        """As of any area, at once; sides may be infinite."""
        x, y = points[:, 0], points[:, 1]
        (left, bottom), (right, top) = self.low, self.high
        return np.asarray((x >= left) & (x <= right) & (y >= bottom) & (y <= top))

    @property
    def size(self) -> float:
        """Width times height [m²]."""
        return (self.high[0] - self.low[0]) * (self.high[1] - self.low[1])

    def corners(self) -> Floats:
        """Its corners."""
        return np.array([self.low, self.high])

    def depth(self, points: Floats) -> Floats:
        """Distance to the nearest side, or to the nearest corner of points beyond one."""
        beyond = np.maximum(np.array(self.low) - points, points - np.array(self.high))
        outside = np.maximum(beyond, 0.0)
        return np.asarray(
            -(_length(outside[:, 0], outside[:, 1]) + np.minimum(beyond.max(axis=1), 0.0))
        )


@dataclass(frozen=True)
class Annulus(Area):
    """What lies between two circles around one center [m]; a disc if the inner radius is 0."""

    center: tuple[float, float]
    outer: float
    inner: float = 0.0

    @property
    def size(self) -> float:
        """π (outer² − inner²) [m²]."""
        return math.pi * (self.outer * self.outer - self.inner * self.inner)

    def corners(self) -> Floats:
        """Around the outer circle."""
        return np.asarray(np.array(self.center) + np.array([[-self.outer], [self.outer]]))

    def depth(self, points: Floats) -> Floats:
        """Distance to the nearer circle."""
        away = points - np.array(self.center)
        distance = _length(away[:, 0], away[:, 1])
        depth = self.outer - distance
        return np.minimum(depth, distance - self.inner) if self.inner > 0.0 else depth


@dataclass(frozen=True, eq=False)
class Discs(Area):
    """What some discs cover together: x, y and radius of each [m], shape ``(k, 3)``."""

    discs: Floats

    @property
    def size(self) -> float:
        """Sum of their areas [m²]; what two of them cover counts twice."""
        return math.pi * total(self.discs[:, 2] * self.discs[:, 2])

    def corners(self) -> Floats:
        """Around all of them."""
        center, radius = self.discs[:, :2], self.discs[:, 2:]
        return np.array([(center - radius).min(axis=0), (center + radius).max(axis=0)])

    def depth(self, points: Floats) -> Floats:
        """Distance to the nearest circle from outside; inside, the depth in one of the discs."""
        depth = np.full(len(points), -np.inf)
        for x, y, radius in self.discs.tolist():
            np.maximum(depth, radius - _length(points[:, 0] - x, points[:, 1] - y), out=depth)
        return depth


@dataclass(frozen=True, eq=False)
class Polygon(Area):
    """A simple polygon: its corners [m], in either direction, shape ``(p, 2)``."""

    points: Floats

    @property
    def signed_size(self) -> float:
        """Its area, negative if its corners run clockwise [m²] (Gauss's shoelace formula)."""
        return 0.5 * total(self._products()[2])

    @property
    def size(self) -> float:
        """Its area [m²]."""
        return abs(self.signed_size)

    @property
    def centroid(self) -> Floats:
        """Its center of area [m], shape ``(2,)``."""
        here, after, product = self._products()
        moment = column_totals((here + after) * product[:, np.newaxis])
        return np.asarray(self.points[0] + moment / (6.0 * self.signed_size))

    @property
    def polar_moment(self) -> float:
        """Polar second moment of area about the centroid, ∫ r² dA [m⁴] (by Green's theorem)."""
        here, after, product = self._products()
        square = dot(here, here) + dot(here, after) + dot(after, after)
        about_first = total(product * square) / 12.0
        away = self.centroid - self.points[0]
        return abs(about_first) - self.size * float(away[0] * away[0] + away[1] * away[1])

    @property
    def perimeter(self) -> float:
        """Length of its outline [m]."""
        return total(self.side_lengths())

    def side_lengths(self) -> Floats:
        """Length of each side, from its corner to the next [m], shape ``(p,)``."""
        ways = np.roll(self.points, -1, axis=0) - self.points
        return np.array([hypot(*way) for way in ways.tolist()])

    def corners(self) -> Floats:
        """Around its corners."""
        return np.array([self.points.min(axis=0), self.points.max(axis=0)])

    def depth(self, points: Floats) -> Floats:
        """Distance to the nearest side; a ray from inside crosses an odd number of sides."""
        count = max(1, _AT_ONCE // len(self.points))
        parts = [self._depth(points[k : k + count]) for k in range(0, len(points), count)]
        return np.concatenate([np.zeros(0), *parts])

    def _depth(self, points: Floats) -> Floats:
        start = self.points
        way = np.roll(start, -1, axis=0) - start
        px, py = points[:, :1] - start[:, 0], points[:, 1:2] - start[:, 1]
        foot = np.clip((px * way[:, 0] + py * way[:, 1]) / dot(way, way), 0.0, 1.0)
        distance = _length(px - foot * way[:, 0], py - foot * way[:, 1]).min(axis=1)
        # A side that spans the height of the point lies to the right of it if the point is on its
        # left, or right for a falling one.
        spans = (py >= 0.0) != (py >= way[:, 1])
        crossed = spans & ((way[:, 0] * py - way[:, 1] * px > 0.0) == (way[:, 1] > 0.0))
        return np.asarray(np.where(np.count_nonzero(crossed, axis=1) % 2 == 1, distance, -distance))

    def _products(self) -> tuple[Floats, Floats, Floats]:
        """Corners from the first one, those after them, and the cross products of both [m²]."""
        here = self.points - self.points[0]
        after = np.roll(here, -1, axis=0)
        return here, after, here[:, 0] * after[:, 1] - here[:, 1] * after[:, 0]


@dataclass(frozen=True)
class Room:
    """Where grains may be: inside all of some areas, and outside all of others.

    With a period in x [m] (0: none) an area stands for its images too.
    """

    inside: tuple[Area, ...] = ()
    outside: tuple[Area, ...] = ()
    period: float = 0.0

    @property
    def is_open(self) -> bool:
        """Whether nothing bounds it."""
        return not (self.inside or self.outside)

    def within(self, *areas: Area) -> Room:
        """What of it lies inside further areas."""
        return replace(self, inside=(*self.inside, *areas))

    def without(self, *areas: Area) -> Room:
        """What of it lies outside further areas."""
        return replace(self, outside=(*self.outside, *areas))

    def clearance(self, points: Floats) -> Floats:
        """Distance of points ``(n, 2)`` to what bounds it [m], negative outside, shape ``(n,)``.

        A disc lies wholly in the room exactly if the clearance of its center is at least its
        radius.
        """
        nearest = np.full(len(points), np.inf)
        for area in self.inside:
            np.minimum(nearest, self._depth(area, points), out=nearest)
        for area in self.outside:
            np.minimum(nearest, -self._depth(area, points), out=nearest)
        return nearest

    def _depth(self, area: Area, points: Floats) -> Floats:
        """Depth in an area or that of its images in which it is largest."""
        if self.period <= 0.0:
            return area.depth(points)
        low, high = area.corners()[:, 0]
        moved = points.copy()
        moved[:, 0] -= self.period * np.floor(
            (points[:, 0] - 0.5 * (low + high)) / self.period + 0.5
        )
        depth = area.depth(moved)
        for shift in (-self.period, self.period):
            np.maximum(depth, area.depth(moved + np.array([shift, 0.0])), out=depth)
        return depth


def fault_of_polygon(points: Floats) -> tuple[int, str] | None:
    """Where corners ``(p, 2)``, p ≥ 3, fail to make a simple polygon: number of one, and why."""
    _, first, number = np.unique(points, axis=0, return_index=True, return_inverse=True)
    again = np.flatnonzero(first[number.reshape(-1)] != np.arange(len(points)))
    if again.size:
        k = int(again[0])
        return k, f"the point {points[k].tolist()} is given twice"
    ends = np.roll(points, -1, axis=0)
    before, after = points - np.roll(points, 1, axis=0), ends - points
    turn, along = cross(before, after), dot(before, after)
    back = np.flatnonzero((turn == 0.0) & (along < 0.0))
    if back.size:
        k = int(back[0])
        return k, f"the outline runs back on itself at {points[k].tolist()}"
    for k in range(len(points) - 2):
        others = slice(k + 2, len(points) - (1 if k == 0 else 0))  # without the neighbors
        crossed = np.flatnonzero(~are_apart(points[k], ends[k], points[others], ends[others]))
        if crossed.size:
            one, two = points[k].tolist(), points[others][crossed[0]].tolist()
            return k, f"the side from {one} crosses or touches that from {two}"
    return None


def are_apart(a: Floats, b: Floats, c: Floats, d: Floats) -> NDArray[np.bool_]:
    """Whether the line from a to b shares no point with those from c to d, shape ``(s, 2)``."""
    parted = cross(b - a, c - a) * cross(b - a, d - a) > 0.0
    parted |= cross(d - c, a - c) * cross(d - c, b - c) > 0.0
    # On one line: they share a point if their extents do.
    beyond = (np.minimum(a, b) > np.maximum(c, d)) | (np.maximum(a, b) < np.minimum(c, d))
    return np.asarray(parted | beyond.any(axis=1))


def cross(a: Floats, b: Floats) -> Floats:
    """Cross products a × b of vectors, shape ``(…, 2)``."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def dot(a: Floats, b: Floats) -> Floats:
    """Dot products a · b of vectors, shape ``(…, 2)``."""
    return np.asarray(a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1])


def _length(x: Floats, y: Floats) -> Floats:
    return np.asarray(np.sqrt(x * x + y * y))


# ---- The kinds of shapes that walls are made of


class ShapeKind(IntEnum):
    """Kind of a wall shape, its number in files; `SHAPES` says what its four numbers mean."""

    DISC = 0
    PLANE = 1
    SEGMENT = 2
    VERTEX = 3
    CIRCLE = 4
    SIDE = 5


class Tail(IntEnum):
    """What the last two numbers of a shape are; the first two are a point that its wall carries."""

    NUMBERS = 0  # they stay as they are, and the shape with them: it looks the same from all sides
    # a vector, which turns with the wall; at least as long as the shape reaches from its point,
    # unless a plane
    DIRECTION = 1
    POINT = 2  # a point, which turns and moves with the wall
    SHAPES = 3  # numbers of other shapes of the wall, or -1


@dataclass(frozen=True)
class Outline:
    """What k shapes of one kind look like: polygonal lines, circles or endless lines.

    ``points`` are corners of each line, the center of each circle, or a point of each endless line
    [m], shape ``(k, p, 2)``; ``normal`` are unit normals of endless lines, shape ``(k, 2)``.
    Circles may be grains; ``is_solid``: what lies on the left of the lines is solid.
    """

    points: Floats
    radius: Floats | None = None
    normal: Floats | None = None
    is_grain: bool = False
    is_solid: bool = False

    def corners(self) -> Floats:
        """Lower left, upper right corners [m], shape ``(2, k, 2)``; points of endless lines."""
        reach = 0.0 if self.radius is None else self.radius[:, np.newaxis]
        return np.array([self.points.min(axis=1) - reach, self.points.max(axis=1) + reach])


class ShapeType(NamedTuple):
    """What is known about a kind of shape.

    Attributes:
        name: Name in the description of the files.
        meaning: What it is.
        numbers: What its four numbers are, in the frame of its wall [m].
        tail: How the last two of them move.
        outline: What shapes with these numbers, shape ``(k, 4)``, look like.
        is_thin: Whether it has no inside that it keeps grains out of.
    """

    name: str
    meaning: str
    numbers: str
    tail: Tail
    outline: Callable[[Floats], Outline]
    is_thin: bool = False


SHAPES = {
    ShapeKind.DISC: ShapeType(
        "disc", "a glued grain, or a solid disc", "x, y, radius, –", Tail.NUMBERS,
        lambda g: Outline(g[:, np.newaxis, :2], radius=g[:, RADIUS], is_grain=True),
    ),
    ShapeKind.PLANE: ShapeType(
        "plane", "a half-plane", "x, y of a point; unit normal towards the grains", Tail.DIRECTION,
        lambda g: Outline(g[:, np.newaxis, :2], normal=g[:, 2:]),
    ),
    ShapeKind.SEGMENT: ShapeType(
        "segment", "a straight line, both sides solid, without its ends",
        "x, y of one end; x, y of the other", Tail.POINT,
        lambda g: Outline(g.reshape(-1, 2, 2)), is_thin=True,
    ),
    ShapeKind.VERTEX: ShapeType(
        "vertex", "an end of segments or sides",
        "x, y; numbers of those that end and begin here (−1: none)", Tail.SHAPES,
        lambda g: Outline(g[:, np.newaxis, :2]), is_thin=True,
    ),
    ShapeKind.CIRCLE: ShapeType(
        "circle (inside)", "the inside of a circle", "x, y, radius, –", Tail.NUMBERS,
        lambda g: Outline(g[:, np.newaxis, :2], radius=g[:, RADIUS]),
    ),
    ShapeKind.SIDE: ShapeType(
        "side", "a side of a polygon, solid on its left, without its ends",
        "x, y of one end; x, y of the other", Tail.POINT,
        lambda g: Outline(g.reshape(-1, 2, 2), is_solid=True), is_thin=True,
    ),
}  # fmt: skip
"""All kinds, in the order of their numbers."""

_SPANNED = 1e-9  # of the period, to which points of a line tell that it spans it

TAIL = np.array([shape.tail for shape in SHAPES.values()])
"""`Tail` of each kind."""

IS_THIN = np.array([shape.is_thin for shape in SHAPES.values()])
"""`ShapeType.is_thin` of each kind."""


def outlines(kind: Ints, geometry: Floats) -> Iterator[tuple[NDArray[np.int64], Outline]]:
    """What shapes look like, kind by kind: which, ascending, and their outlines."""
    for number, shape in SHAPES.items():
        which = np.flatnonzero(kind == number)
        if which.size:
            yield which, shape.outline(geometry[which])


@dataclass(frozen=True)
class WallBody:
    """One wall on its own.

    Attributes:
        origin: Reference point in the world [m], shape ``(2,)``: origin of the frame of the wall.
        kind: `ShapeKind` of each shape, shape ``(k,)``.
        geometry: Four numbers of each in the frame of the wall [m], shape ``(k, 4)``; shapes count
            from the first of this wall.
        length: Length over which a load spreads [m].
    """

    origin: Floats
    kind: Ints
    geometry: Floats
    length: float

    @classmethod
    def empty(cls, origin: Sequence[float], length: float) -> WallBody:
        """A wall without shapes."""
        return cls(np.array(origin, float), np.zeros(0, np.int32), np.zeros((0, 4)), length)

    def with_shapes(
        self, kind: ShapeKind, geometry: Sequence[Sequence[float]] | Floats
    ) -> WallBody:
        """The wall with more shapes of one kind: their four numbers [m], shape ``(k, 4)``."""
        kinds = np.append(self.kind, np.full(len(geometry), kind, np.int32))
        return WallBody(self.origin, kinds, np.concatenate([self.geometry, geometry]), self.length)

    def with_line(
        self,
        points: Floats,
        period: float,
        kind: ShapeKind = ShapeKind.SEGMENT,
        *,
        is_closed: bool = False,
    ) -> WallBody:
        """The wall with a line from point to point: pieces, then vertices that know what they end.

        A piece meets only the image of a grain that is nearest to its middle, so in a periodic
        domain pieces of half a period or more are cut into equal ones. A line that ends where it or
        an image of it began has no ends: it is joined there.

        Args:
            points: Points of the line in the frame of the wall [m], shape ``(p, 2)``.
            period: Period in x [m] or 0.
            kind: Kind of the pieces, `ShapeKind.SEGMENT` or `ShapeKind.SIDE`.
            is_closed: Whether the last point is joined to the first.
        """
        ends = np.concatenate([points[1:], points[:1]]) if is_closed else points[1:].copy()
        across = points[-1, 0] - points[0, 0]
        periods = period * np.rint(across / period) if period > 0.0 else 0.0
        begun = points[0] + np.array([periods, 0.0])
        if not is_closed and (np.abs(points[-1] - begun) <= _SPANNED * period).all():
            is_closed, ends[-1] = True, begun
        way = ends - points[: len(ends)]
        length = np.sqrt(way[:, 0] * way[:, 0] + way[:, 1] * way[:, 1])
        parts = np.ones(len(way), np.int64)
        if period > 0.0:
            parts += np.floor(2.0 * length / period).astype(np.int64)
        piece = np.repeat(np.arange(len(way)), parts)
        share = (np.arange(len(piece)) - np.repeat(np.cumsum(parts) - parts, parts)) / parts[piece]
        start = points[piece] + way[piece] * share[:, np.newaxis]
        end = np.concatenate([start[1:], ends[-1:]])
        first, last = len(self.kind), len(self.kind) + len(piece) - 1
        vertices = start if is_closed else np.concatenate([start, end[-1:]])
        after = first + np.arange(len(vertices))
        before = np.where(after > first, after - 1, last if is_closed else -1)
        after = np.where(after > last, -1, after)
        line = self.with_shapes(kind, np.column_stack([start, end]))
        return line.with_shapes(ShapeKind.VERTEX, np.column_stack([vertices, before, after]))

    @property
    def glued(self) -> Floats:
        """x, y and radius of the glued grains and solid discs [m], shape ``(g, 3)``."""
        return self.geometry[self.kind == ShapeKind.DISC, :3]
