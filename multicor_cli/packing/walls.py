"""From wall geometries to bodies and shapes.

Every wall has a frame whose origin is its reference point: the center of a circle or box, the mean of the points of a polyline,
the middle of a row of glued grains, the given point of a plane. Shapes are stored in this frame; torques and spins refer to it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from multicor_cli.arithmetic import hypot
from multicor_cli.arithmetic.sums import column_totals, mean, total
from multicor_cli.engine.jit import elementwise
from multicor_cli.model.model import Floats, Ints, ShapeKind, Walls, WallShapes
from multicor_cli.packing.bodies import Shape, inertias, masses


@dataclass(frozen=True)
class Front:
    """The side of a row of glued grains on which the flow is.

    Attributes:
        start: Where the line begins [m], shape ``(2,)``.
        along: Unit vector along it, shape ``(2,)``.
        normal: Unit vector towards the flow, shape ``(2,)``.
        length: Length of the line [m].
        depth: Grains whose center lies up to this far behind the line are refused [m]; infinite if it spans the period.
    """

    start: Floats
    along: Floats
    normal: Floats
    length: float
    depth: float


@dataclass(frozen=True)
class WallBody:
    """One wall, in its own frame.

    Attributes:
        origin: Reference point in the world [m], shape ``(2,)``.
        kind: `ShapeKind` of each shape, shape ``(k,)``.
        geometry: In the frame of the wall [m], shape ``(k, 4)``; numbers of shapes count within this wall.
        length: Length over which a load spreads [m].
        front: For a row of glued grains: where the flow is.
    """

    origin: Floats
    kind: Ints
    geometry: Floats
    length: float
    front: Front | None = None

    @property
    def glued(self) -> Floats:
        """x, y and radius of the glued grains [m], shape ``(g, 3)``."""
        return self.geometry[self.kind == ShapeKind.DISC, :3]


def plane(point: Floats, normal: Floats, extent: tuple[float, float]) -> WallBody:
    """A half-plane; ``normal`` points to the grains, of any length; ``extent`` is the size of the domain [m]."""
    nx, ny = normal / hypot(*normal.tolist())
    length = abs(ny) * extent[0] + abs(nx) * extent[1]
    return _body(point, ShapeKind.PLANE, np.array([[0.0, 0.0, nx, ny]]), length)


def box(low: Floats, high: Floats, is_open: tuple[str, ...]) -> WallBody:
    """A rectangle from ``low`` to ``high`` [m] without the sides named in ``is_open``."""
    half_width, half_height = 0.5 * (high - low)
    sides = {
        "left": (-half_width, 0.0, 1.0, 0.0),
        "right": (half_width, 0.0, -1.0, 0.0),
        "bottom": (0.0, -half_height, 0.0, 1.0),
        "top": (0.0, half_height, 0.0, -1.0),
    }
    closed = [name for name in sides if name not in is_open]
    length = math.fsum(2.0 * (half_height if name in ("left", "right") else half_width) for name in closed)
    return _body(0.5 * (low + high), ShapeKind.PLANE, np.array([sides[name] for name in closed]), length)


def circle(center: Floats, radius: float) -> WallBody:
    """The smooth inside of a circle [m]."""
    return _body(center, ShapeKind.CIRCLE, np.array([[0.0, 0.0, radius, 0.0]]), 2.0 * math.pi * radius)


def rough_circle(center: Floats, radius: float, glued: Floats) -> WallBody:
    """The inside of a circle with ``glued`` grains on it: x and y relative to the center, radius [m], shape ``(k, 3)``."""
    smooth = circle(center, radius)
    kind = np.append(smooth.kind, np.full(len(glued), int(ShapeKind.DISC), np.int32))
    return WallBody(smooth.origin, kind, np.concatenate([smooth.geometry, _four(glued)]), smooth.length)


def rough_line(start: Floats, end: Floats, is_left: bool, glued: Floats, spans_period: bool) -> WallBody:
    """A row of ``glued`` grains (x, y, radius in the world [m], shape ``(k, 3)``) from ``start`` to ``end``.

    Args:
        start: Where the line begins [m].
        end: Where it ends [m].
        is_left: Whether the flow is on the left, looking from start to end.
        glued: The grains.
        spans_period: Whether the line closes on itself over the period.
    """
    length = hypot(*(end - start).tolist())
    along = (end - start) / length
    normal = np.array([-along[1], along[0]]) * (1.0 if is_left else -1.0)
    front = Front(start, along, normal, length, math.inf if spans_period else mean(glued[:, 2]))
    middle = 0.5 * (start + end)
    body = _body(middle, ShapeKind.DISC, _four(glued - np.append(middle, 0.0)), length)
    return WallBody(body.origin, body.kind, body.geometry, length, front)


def polyline(points: Floats, is_closed: bool) -> WallBody:
    """Segments from point to point [m], shape ``(k, 2)``, and a vertex at every point that knows the segments it ends."""
    origin = column_totals(points) / len(points)
    local = points - origin
    ends = np.roll(local, -1, axis=0) if is_closed else local[1:]
    segments = np.column_stack([local[: len(ends)], ends])
    number = np.arange(len(points), dtype=float)
    before, after = number - 1.0, np.where(number < len(segments), number, -1.0)
    if is_closed:
        before[0] = len(segments) - 1.0
    vertices = np.column_stack([local, before, after])
    kind = np.repeat([int(ShapeKind.SEGMENT), int(ShapeKind.VERTEX)], [len(segments), len(points)]).astype(np.int32)
    length = total(elementwise.hypot(*(segments[:, 2:] - segments[:, :2]).T))
    return WallBody(origin, kind, np.concatenate([segments, vertices]), length)


def _body(origin: Floats, kind: ShapeKind, geometry: Floats, length: float) -> WallBody:
    return WallBody(np.array(origin, float), np.full(len(geometry), int(kind), np.int32), geometry, length)


def _four(discs: Floats) -> Floats:
    return np.column_stack([discs, np.zeros(len(discs))])


def glued_inertia(body: WallBody, density: float, shape: Shape, thickness: float | None) -> tuple[float, float]:
    """Mass [kg] and moment of inertia about the reference point [kg m²] of the glued grains of a wall; nan if it has none."""
    glued = body.glued
    if not len(glued):
        return math.nan, math.nan
    mass = masses(glued[:, 2], density, shape, thickness)
    about = inertias(glued[:, 2], mass, shape) + mass * (glued[:, 0] * glued[:, 0] + glued[:, 1] * glued[:, 1])
    return total(mass), total(about)


def join_shapes(bodies: list[WallBody], materials: list[int]) -> WallShapes:
    """All shapes of all walls in one table; vertices then refer to rows of this table.

    Args:
        bodies: The walls in their order.
        materials: Index of the material of each wall.
    """
    counts = [len(body.kind) for body in bodies]
    geometry = [body.geometry.copy() for body in bodies]
    first = 0
    for body, rows in zip(bodies, geometry, strict=True):
        is_vertex = body.kind == ShapeKind.VERTEX
        refers = rows[:, 2:] >= 0.0
        rows[:, 2:] += np.where(is_vertex[:, None] & refers, first, 0)
        first += len(rows)
    return WallShapes(
        kind=np.concatenate([np.zeros(0, np.int32), *(body.kind for body in bodies)]),
        wall=np.repeat(np.arange(len(bodies), dtype=np.int32), counts),
        geometry=np.concatenate([np.zeros((0, 4)), *geometry]),
        material=np.repeat(np.array(materials, np.int32), counts),
    )


def join_walls(names: list[str], bodies: list[WallBody], inertia: list[tuple[float, float]], has_gravity: list[bool]) -> Walls:
    """The bodies of all walls; ``inertia`` holds mass [kg] and moment of inertia [kg m²] of each, nan where unknown."""
    table = np.array(inertia, float).reshape(-1, 2)
    return Walls(
        names=tuple(names),
        mass=table[:, 0].copy(),
        inertia=table[:, 1].copy(),
        has_gravity=np.array(has_gravity, bool),
        length=np.array([body.length for body in bodies], float),
    )


def in_world(shapes: WallShapes, origins: Floats) -> Floats:
    """Shapes in the world before anything has turned [m], shape ``(m, 4)``; ``origins`` has shape ``(w, 2)``."""
    world = shapes.geometry.copy()
    shift = origins[shapes.wall]
    world[:, :2] += shift
    is_segment = shapes.kind == ShapeKind.SEGMENT
    world[is_segment, 2:] += shift[is_segment]
    return world
