"""The kinds of shapes that walls are made of: everything about them that is not compiled.

A new kind is one more `ShapeKind` with its row of `SHAPES`, and its gap in `engine/geometry/scene.py`. Everything else follows from
the row, but for two kinds: a disc is a grain that is glued to a wall, and a plane is the only shape without ends.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.columns import RADIUS
from multicor_cli.model.model import Floats, Ints


class ShapeKind(IntEnum):
    """Kind of a wall shape; the number is that of the files. `SHAPES` gives the meaning of the four numbers of each shape."""

    DISC = 0
    PLANE = 1
    SEGMENT = 2
    VERTEX = 3
    CIRCLE = 4
    SIDE = 5


class Tail(IntEnum):
    """What the last two numbers of a shape are. The first two are a point of it, which turns and moves with the wall."""

    NUMBERS = 0  # they stay as they are, and the shape with them: it looks the same from all sides
    DIRECTION = 1  # a vector, which turns with the wall; at least as long as the shape reaches from its point, unless a plane
    POINT = 2  # a point, which turns and moves with the wall
    SHAPES = 3  # numbers of other shapes of the wall, or -1


@dataclass(frozen=True)
class Outline:
    """What k shapes of one kind look like: polygonal lines, circles or endless lines.

    Attributes:
        points: Corners of each line, or the center of each circle, or a point of each endless line [m], shape ``(k, p, 2)``.
        radius: Radii of circles [m], shape ``(k,)``.
        normal: Unit normals of endless lines, shape ``(k, 2)``.
        is_grain: Whether the circles are grains.
        is_solid: Whether what lies on the left of the lines is solid.
    """

    points: Floats
    radius: Floats | None = None
    normal: Floats | None = None
    is_grain: bool = False
    is_solid: bool = False

    def corners(self) -> Floats:
        """Lower left and upper right corner around each shape [m], shape ``(2, k, 2)``; of an endless line its point."""
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
        "segment", "a straight line, both sides solid, without its ends", "x, y of one end; x, y of the other", Tail.POINT,
        lambda g: Outline(g.reshape(-1, 2, 2)), is_thin=True,
    ),
    ShapeKind.VERTEX: ShapeType(
        "vertex", "an end of segments or sides", "x, y; numbers of those that end and begin here (−1: none)", Tail.SHAPES,
        lambda g: Outline(g[:, np.newaxis, :2]), is_thin=True,
    ),
    ShapeKind.CIRCLE: ShapeType(
        "circle (inside)", "the inside of a circle", "x, y, radius, –", Tail.NUMBERS,
        lambda g: Outline(g[:, np.newaxis, :2], radius=g[:, RADIUS]),
    ),
    ShapeKind.SIDE: ShapeType(
        "side", "a side of a polygon, solid on its left, without its ends", "x, y of one end; x, y of the other", Tail.POINT,
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
    """What shapes look like, kind by kind: which of them, ascending, and their outlines.

    Args:
        kind: `ShapeKind` of each shape, shape ``(m,)``.
        geometry: Their four numbers [m], shape ``(m, 4)``.
    """
    for number, shape in SHAPES.items():
        which = np.flatnonzero(kind == number)
        if which.size:
            yield which, shape.outline(geometry[which])


def markdown() -> str:
    """The table of kinds of the format documents."""
    rows = [f"| {kind:d} | {shape.name} | {shape.meaning} | {shape.numbers} |" for kind, shape in SHAPES.items()]
    return "\n".join(["| kind | name | what it is | four numbers |", "|---|---|---|---|", *rows])


@dataclass(frozen=True)
class WallBody:
    """One wall on its own.

    Attributes:
        origin: Reference point in the world [m], shape ``(2,)``: origin of the frame of the wall.
        kind: `ShapeKind` of each shape, shape ``(k,)``.
        geometry: Four numbers of each in the frame of the wall [m], shape ``(k, 4)``; shapes count from the first of this wall.
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

    def with_shapes(self, kind: ShapeKind, geometry: Sequence[Sequence[float]] | Floats) -> WallBody:
        """The wall with more shapes of one kind: their four numbers [m], shape ``(k, 4)``."""
        kinds = np.append(self.kind, np.full(len(geometry), kind, np.int32))
        return WallBody(self.origin, kinds, np.concatenate([self.geometry, geometry]), self.length)

    def with_line(self, points: Floats, period: float, kind: ShapeKind = ShapeKind.SEGMENT, *, is_closed: bool = False) -> WallBody:
        """The wall with a line from point to point: its pieces, then a vertex at each point that knows the pieces it ends.

        A piece meets only the image of a grain that is nearest to its middle, so in a periodic domain pieces of half a period or
        more are cut into equal ones. A line that ends where it or an image of it began has no ends: it is joined there.

        Args:
            points: Points of the line in the frame of the wall [m], shape ``(p, 2)``.
            period: Period in x [m] or 0.
            kind: Kind of the pieces, `ShapeKind.SEGMENT` or `ShapeKind.SIDE`.
            is_closed: Whether the last point is joined to the first.
        """
        ends = np.concatenate([points[1:], points[:1]]) if is_closed else points[1:].copy()
        begun = points[0] + np.array([period * np.rint((points[-1, 0] - points[0, 0]) / period) if period > 0.0 else 0.0, 0.0])
        if not is_closed and (np.abs(points[-1] - begun) <= _SPANNED * period).all():
            is_closed, ends[-1] = True, begun
        way = ends - points[: len(ends)]
        length = np.sqrt(way[:, 0] * way[:, 0] + way[:, 1] * way[:, 1])
        parts = np.floor(2.0 * length / period).astype(np.int64) + 1 if period > 0.0 else np.ones(len(way), np.int64)
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
