"""Walls: their geometry and their inertia.

Each geometry says of what shapes it consists, in a frame whose origin is the reference point of the
wall, which torques and spins refer to: the center of a circle, disc or box, the mean of the points
of a polyline, the middle of a row of glued grains, the given point of a plane, the center of mass
of a cluster or polygon.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Iterator
from typing import Annotated, Literal, NamedTuple

import numpy as np
from pydantic import Discriminator, Field, Strict, Tag, ValidationInfo, field_validator

from multicor_cli.arithmetic import hypot
from multicor_cli.arithmetic.sums import column_totals, total
from multicor_cli.model import ShapeKind, WallBody
from multicor_cli.model.model import Floats
from multicor_cli.model.shapes import Discs, Polygon, Room, outlines
from multicor_cli.scenario.base import (
    Array,
    Coordinate,
    Length,
    Name,
    Point,
    Radius,
    Table,
    Vector,
    optional,
    required,
    tag_table,
)
from multicor_cli.scenario.drives import WallCondition
from multicor_cli.scenario.particles import ParticleGroup
from multicor_cli.scenario.problems import Refused
from multicor_cli.scenario.region import MAX_CORNERS, Corners, above_min, simple_polygon
from multicor_cli.scenario.settings import Domain
from multicor_cli.scenario.sizes import Sizes

# ---- Where grains are glued: in a row on a line, in a ring along a circle, or along a polygon

Pair = tuple[float, float]
SizesOrGroup = Annotated[
    Annotated[Name, Tag("<plain>")] | Annotated[Sizes, Tag("<table>")], Discriminator(tag_table)
]


class Row(NamedTuple):
    """Touching grains with their centers on a line.

    Attributes:
        start: Where the line begins [m].
        end: Where it ends [m].
        is_left: Whether the flow is on the left, looking from start to end.
        is_closed: Whether the line spans the period, so that the last grain touches the first.
    """

    start: Pair
    end: Pair
    is_left: bool
    is_closed: bool

    @property
    def length(self) -> float:
        """Length of the line [m]."""
        return hypot(self.end[0] - self.start[0], self.end[1] - self.start[1])

    @property
    def middle(self) -> Pair:
        """Middle of the line [m]."""
        return 0.5 * (self.start[0] + self.end[0]), 0.5 * (self.start[1] + self.end[1])

    @property
    def least(self) -> float:
        """Smallest length, over the diameter of the largest grain."""
        return 1.0

    def __str__(self) -> str:
        return f"the line is {self.length:g} m long"


class Ring(NamedTuple):
    """Touching grains in a circle, or around it; its center is the wall's reference point [m]."""

    center: Pair
    radius: float
    is_outside: bool = False

    @property
    def length(self) -> float:
        """Circumference of the circle [m]."""
        return 2.0 * math.pi * self.radius

    @property
    def least(self) -> float:
        """Smallest circumference, over the diameter of the largest grain."""
        return 2.0 * math.pi if self.is_outside else 4.0 * math.pi

    def __str__(self) -> str:
        return f"the circle has a radius of {self.radius:g} m"


class Sides(NamedTuple):
    """Touching grains along each side of a polygon, with their centers on it."""

    polygon: Polygon

    @property
    def length(self) -> float:
        """Length of all sides [m]."""
        return self.polygon.perimeter

    @property
    def least(self) -> float:
        """Smallest length of all sides over the largest diameter: the shortest side takes one."""
        return self.length / float(self.polygon.side_lengths().min())

    def __str__(self) -> str:
        return f"the shortest side is {float(self.polygon.side_lengths().min()):g} m long"


class Glued(NamedTuple):
    """The grains glued to a wall.

    Attributes:
        place: Where they are.
        sizes: Name of a group of particles, or a table; None: as the first group.
        key: Under which key of the geometry it says so.
    """

    place: Row | Ring | Sides
    sizes: SizesOrGroup | None
    key: str


# ---- What the rest of the program asks of the geometry of a wall, whatever its kind

Substance = Literal["discs", "prism"]
"""What a wall weighs: its discs, glued or solid, or the polygon that it fills times a thickness."""


class WallGeometry(Table):
    """What the rest of the program asks of every geometry."""

    @abstractmethod
    def body(self, domain: Domain) -> WallBody:
        """Its shapes without glued grains."""

    def glued(self, domain: Domain | None = None) -> Glued | None:
        """Its glued grains, if any. Without a domain, nothing is fitted to the period."""
        return None

    def misfits(self, domain: Domain) -> Iterator[Refused]:
        """What does not fit to the domain; keys count from the table of the geometry."""
        yield from ()

    def room(self, discs: Floats) -> Room:
        """The room that solid matter leaves; ``discs``: x, y, radius [m], shape ``(k, 3)``."""
        return Room()

    @property
    def substance(self) -> Substance | None:
        """What its mass follows from if none is given; None if it has to be given."""
        return None if self.glued() is None else "discs"

    def spans_period(self, domain: Domain) -> bool:
        """Whether it cannot turn, as it reaches over half a period from its reference point."""
        half = 0.5 * domain.period
        # A line of one period is joined to its image; a circle of that width is not.
        return domain.is_periodic and any(
            extent > half * (1.0 + 1e-9) if is_round else extent >= half * (1.0 - 1e-9)
            for extent, is_round in _extents(self.body(domain))
        )

    @property
    def height(self) -> float | None:
        """Height y at which it bounds a layer [m]; None if it has no definite one."""
        return None


def _extents(body: WallBody) -> Iterator[tuple[float, bool]]:
    """How far shapes of each kind reach from the reference point [m]; whether they are round."""
    for _, outline in outlines(body.kind, body.geometry):
        extent = max(hypot(*point) for point in outline.points.reshape(-1, 2).tolist())
        if outline.radius is None:
            yield extent, False
        else:
            yield extent + float(outline.radius.max()), True


def _too_wide(
    domain: Domain, width: float, key: str, what: str, remedy: str = ""
) -> Iterator[Refused]:
    """What does not fit into the period, as ``what`` says."""
    if domain.is_periodic and width > domain.size[0]:
        remedy = remedy or "make it smaller, or use periodic = false"
        yield Refused((key,), f"{what} the period of {domain.size[0]:g} m", remedy)


class _Round(WallGeometry):
    """A circle that is solid inside, a disc, or outside."""

    kind: str
    center: Point = required("center [m]")
    radius: Length = required("radius [m]")
    rough: SizesOrGroup | None = None  # each says where they are glued

    @property
    def _is_disc(self) -> bool:
        return self.kind == "disc"

    def body(self, domain: Domain) -> WallBody:
        smooth = WallBody.empty(self.center, 2.0 * math.pi * self.radius)
        shape = ShapeKind.DISC if self._is_disc else ShapeKind.CIRCLE
        return smooth.with_shapes(shape, [(0.0, 0.0, self.radius, 0.0)])

    def glued(self, domain: Domain | None = None) -> Glued | None:
        ring = Ring(self.center, self.radius, self._is_disc)
        return None if self.rough is None else Glued(ring, self.rough, "rough")

    def misfits(self, domain: Domain) -> Iterator[Refused]:
        what = f"the {self.kind} of radius {self.radius:g} m is wider than"
        remedy = "" if self._is_disc else "use periodic = false"
        yield from _too_wide(domain, 2.0 * self.radius, "radius", what, remedy)


# ---- Solid bodies among the grains, and containers around them

_TOUCHING = 1e-6  # overlap over the smaller radius that rounded numbers give discs that touch


class _Discs(WallGeometry):
    """Discs with the grains outside."""

    def room(self, discs: Floats) -> Room:
        return Room(outside=(Discs(discs),))

    @property
    def substance(self) -> Substance | None:
        return "discs"


class DiscGeometry(_Round, _Discs):
    """A solid disc with the grains outside: an intruder, an inner cylinder."""

    kind: Literal["disc"]
    rough: SizesOrGroup | None = optional(
        "sizes of grains glued around it: name of a group of particles, or a table; default: smooth"
    )


class ClusterGeometry(_Discs):
    """Grains glued to each other, anywhere: one grain to be driven, a tracer, a rigid cluster."""

    kind: Literal["cluster"]
    discs: Array[Annotated[tuple[Coordinate, Coordinate, Radius], Strict(False)]] = required(
        "x, y and radius of each grain [m], as [[0, 0, 1e-3], [2e-3, 0, 1e-3]]",
        min_length=1,
        max_length=MAX_CORNERS,
    )

    @field_validator("discs")
    @classmethod
    def _distinct(
        cls, discs: tuple[tuple[float, float, float], ...]
    ) -> tuple[tuple[float, float, float], ...]:
        seen: set[tuple[float, float]] = set()
        for k, (x, y, _) in enumerate(discs):
            if (x, y) in seen:
                what = f"two grains have their centers at {[x, y]}"
                raise Refused((k,), what, "remove one of them")
            seen.add((x, y))
        return discs

    def body(self, domain: Domain) -> WallBody:
        """The discs around their center of area; a load spreads over their circumferences."""
        discs = np.array(self.discs)
        area = discs[:, 2] * discs[:, 2]
        center = column_totals(discs[:, :2] * area[:, np.newaxis]) / total(area)
        local = np.column_stack([discs[:, :2] - center, discs[:, 2], np.zeros(len(discs))])
        return WallBody.empty(center.tolist(), 2.0 * math.pi * total(discs[:, 2])).with_shapes(
            ShapeKind.DISC, local
        )

    def misfits(self, domain: Domain) -> Iterator[Refused]:
        low, high = Discs(np.array(self.discs)).corners()[:, 0].tolist()
        what = f"the cluster is {high - low:g} m wide, more than"
        yield from _too_wide(domain, high - low, "discs", what)

    @property
    def substance(self) -> Substance | None:
        """Its grains; unless they overlap, so that their sum counts parts twice."""
        x, y, radius = np.array(self.discs).T
        for k in range(len(radius) - 1):
            dx, dy, near = x[k + 1 :] - x[k], y[k + 1 :] - y[k], radius[k + 1 :] + radius[k]
            slack = _TOUCHING * np.minimum(radius[k + 1 :], radius[k])
            if (dx * dx + dy * dy < (near - slack) * (near - slack)).any():
                return None
        return "discs"


class PolygonGeometry(WallGeometry):
    """A simple polygon: a solid body with the grains outside, or a container with the grains
    inside.
    """

    kind: Literal["polygon"]
    points: Corners = required(
        "corners [m] in their order along the outline, as [[0, 0], [1, 0], [0, 1]]"
    )
    grains: Literal["outside", "inside"] = required(
        'where the grains are: "outside" of a solid body, "inside" a container'
    )
    rough: SizesOrGroup | None = optional(
        "sizes of grains glued to its sides, with their centers on them: name of a group of "
        "particles, or a table; default: smooth"
    )

    _simple = field_validator("points")(simple_polygon)

    def area(self) -> Polygon:
        """The polygon, solid on the left of each side: clockwise if grains are inside."""
        polygon = Polygon(np.array(self.points))
        is_left = polygon.signed_size > 0.0
        is_right = is_left == (self.grains == "outside")
        return polygon if is_right else Polygon(polygon.points[::-1].copy())

    def body(self, domain: Domain) -> WallBody:
        """A side between corners and a vertex at each, around the center of area."""
        polygon = self.area()
        body = WallBody.empty(polygon.centroid.tolist(), polygon.perimeter)
        return body.with_line(
            polygon.points - polygon.centroid, domain.period, ShapeKind.SIDE, is_closed=True
        )

    def glued(self, domain: Domain | None = None) -> Glued | None:
        return None if self.rough is None else Glued(Sides(self.area()), self.rough, "rough")

    def misfits(self, domain: Domain) -> Iterator[Refused]:
        width = 2.0 * max(extent for extent, _ in _extents(self.body(domain)))
        what = f"the polygon is {width:g} m wide when it is turned, more than"
        yield from _too_wide(domain, width, "points", what)

    def room(self, discs: Floats) -> Room:
        room = Room().without(Discs(discs)) if len(discs) else Room()
        return room.without(self.area()) if self.grains == "outside" else room.within(self.area())

    @property
    def substance(self) -> Substance | None:
        """The solid polygon; of a container, its glued grains."""
        return "prism" if self.grains == "outside" else super().substance


def prism_height(group: ParticleGroup) -> float | None:
    """Thickness of a solid polygon among grains of a group [m]; of spheres the largest diameter.

    None if the group brings spheres from elsewhere, so that their sizes are not known.
    """
    if group.body == "disc":
        return group.thickness
    return None if group.sizes is None else 2.0 * group.sizes.largest


# ---- Walls around the grains, and all of them

Side = Literal["left", "right", "bottom", "top"]
_LEVEL = 1e-9  # slope that counts as none


class PlaneGeometry(WallGeometry):
    """An infinite straight line."""

    kind: Literal["plane"]
    point: Point = required("a point of the plane [m]")
    normal: Vector = required("direction from the wall towards the grains; any length but zero")

    @field_validator("normal")
    @classmethod
    def _not_zero(cls, normal: tuple[float, float]) -> tuple[float, float]:
        if hypot(*normal) < 1e-9:
            what = f"the normal {list(normal)} has no direction"
            raise Refused((), what, "give a direction towards the grains, as [0, 1]")
        return normal

    def body(self, domain: Domain) -> WallBody:
        """A half-plane; a load spreads over its part in the domain."""
        nx, ny = (value / hypot(*self.normal) for value in self.normal)
        length = abs(ny) * domain.size[0] + abs(nx) * domain.size[1]
        return WallBody.empty(self.point, length).with_shapes(ShapeKind.PLANE, [(0.0, 0.0, nx, ny)])

    def misfits(self, domain: Domain) -> Iterator[Refused]:
        """In a periodic domain planes are level."""
        if domain.is_periodic and abs(self.normal[0]) > _LEVEL * abs(self.normal[1]):
            what = f"a plane with normal {list(self.normal)} crosses the periodic domain"
            yield Refused(("normal",), what, "use [0, 1] or [0, -1], or periodic = false")

    def spans_period(self, domain: Domain) -> bool:
        return domain.is_periodic

    @property
    def height(self) -> float:
        return self.point[1]


class RoughGeometry(WallGeometry):
    """A row of touching glued grains with their centers on a line."""

    kind: Literal["rough"]
    start: Point = required("where the line of glued grains begins [m]", alias="from")
    end: Point = required("where it ends [m]", alias="to")
    side: Literal["left", "right"] = required(
        "side of the line, looking along from → to, on which the grains flow"
    )
    sizes: SizesOrGroup | None = optional(
        "sizes of the glued grains: name of a group of particles, or a table; default: as the "
        "first group"
    )

    @field_validator("end")
    @classmethod
    def _has_length(cls, end: tuple[float, float], info: ValidationInfo) -> tuple[float, float]:
        if end == info.data.get("start"):
            what = f"the line begins and ends at {list(end)}"
            raise Refused((), what, "give two different points")
        return end

    def body(self, domain: Domain) -> WallBody:
        row = self._row(domain)
        return WallBody.empty(row.middle, row.length)

    def glued(self, domain: Domain | None = None) -> Glued:
        return Glued(self._row(domain), self.sizes, "sizes")

    def _row(self, domain: Domain | None) -> Row:
        start, end, is_left = self.start, self.end, self.side == "left"
        way = end[0] - start[0]
        is_level = abs(end[1] - start[1]) <= _LEVEL * abs(way)
        left, right = min(start[0], end[0]), max(start[0], end[0])
        if domain is None or not is_level or not domain.is_spanned(left, right):
            return Row(start, end, is_left, is_closed=False)
        # Exactly, so that the last glued grain touches the first.
        end = start[0] + math.copysign(domain.period, way), start[1]
        return Row(start, end, is_left, is_closed=True)

    def spans_period(self, domain: Domain) -> bool:
        return domain.is_periodic  # as a rule

    @property
    def height(self) -> float:
        """Height of its middle [m]."""
        return 0.5 * (self.start[1] + self.end[1])


class BoxGeometry(WallGeometry):
    """A rectangular container: one body with up to four thin sides, which end at its corners and
    are solid inside and outside.
    """

    kind: Literal["box"]
    min: Point = required("lower left corner [m]")
    max: Point = required("upper right corner [m]")
    open: Array[Side] = optional(
        'sides left out: any of "left", "right", "bottom", "top"', (), max_length=4
    )

    _above_min = field_validator("max")(above_min)

    @field_validator("open")
    @classmethod
    def _some_side(cls, sides: tuple[Side, ...]) -> tuple[Side, ...]:
        if len(set(sides)) != len(sides):
            raise Refused((), f"a side is named twice in {list(sides)}", "name each open side once")
        if len(sides) == 4:
            what = "all four sides are open: nothing is left of the box"
            raise Refused((), what, "remove the wall or close a side")
        return sides

    def body(self, domain: Domain) -> WallBody:
        """A line along each run of closed sides, counterclockwise."""
        (left, bottom), (right, top) = self.min, self.max
        x, y = 0.5 * (right - left), 0.5 * (top - bottom)
        sides: tuple[Side, ...] = ("bottom", "right", "top", "left")
        corners = np.array([(-x, -y), (x, -y), (x, y), (-x, y)])  # where each of them begins
        is_closed = [side not in self.open for side in sides]
        lengths = [
            2.0 * (x if side in {"bottom", "top"} else y) for side in sides if side not in self.open
        ]
        body = WallBody.empty((0.5 * (left + right), 0.5 * (bottom + top)), math.fsum(lengths))
        if all(is_closed):
            return body.with_line(corners, domain.period, is_closed=True)
        for first in range(4):
            if is_closed[first] and not is_closed[first - 1]:
                count = next(k for k in range(1, 4) if not is_closed[(first + k) % 4])
                body = body.with_line(
                    corners[[(first + k) % 4 for k in range(count + 1)]], domain.period
                )
        return body

    def misfits(self, domain: Domain) -> Iterator[Refused]:
        """In a periodic domain a box has no sides at left and right."""
        if domain.is_periodic and not {"left", "right"} <= set(self.open):
            what = (
                f"the box has sides at left or right of a periodic domain: open = {list(self.open)}"
            )
            yield Refused(("open",), what, 'add "left" and "right", or use periodic = false')


class CircleGeometry(_Round):
    """The inside of a circle: a drum."""

    kind: Literal["circle"]
    rough: SizesOrGroup | None = optional(
        "sizes of grains glued to the inside: name of a group of particles, or a table; "
        "default: smooth"
    )


class PolylineGeometry(WallGeometry):
    """Straight segments from point to point, solid on both sides: hoppers, chutes, obstacles."""

    kind: Literal["polyline"]
    points: Array[Point] = required(
        "corners [m], as [[0, 1], [1, 0]]", min_length=2, max_length=100_000
    )
    closed: bool = optional("whether the last point is joined to the first", False)

    @field_validator("points")
    @classmethod
    def _distinct(cls, points: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
        for k in range(1, len(points)):
            if points[k] == points[k - 1]:
                what = f"the point {list(points[k])} follows itself"
                raise Refused((k,), what, "remove one of the two")
        return points

    def faults(self) -> Iterator[Refused]:
        if self.closed and (len(self.points) < 3 or self.points[0] == self.points[-1]):
            what = "a closed line needs three corners, and the first is not repeated at the end"
            yield Refused(("points",), what, "remove the last point or closed = true")

    def body(self, domain: Domain) -> WallBody:
        """A line around the mean of its points; a load spreads over its length."""
        points = np.array(self.points)
        origin = column_totals(points) / len(points)
        local = points - origin
        ends = np.roll(local, -1, axis=0) if self.closed else local[1:]
        length = total(np.array([hypot(*way) for way in (ends - local[: len(ends)]).tolist()]))
        return WallBody.empty(origin.tolist(), length).with_line(
            local, domain.period, is_closed=self.closed
        )


Geometry = Annotated[
    PlaneGeometry
    | RoughGeometry
    | BoxGeometry
    | CircleGeometry
    | PolylineGeometry
    | DiscGeometry
    | PolygonGeometry
    | ClusterGeometry,
    Field(discriminator="kind"),
]


class Wall(Table):
    """One entry of ``[[walls]]``: one rigid body."""

    name: Name = required("name of the wall, used by drives")
    material: Name = required("name of a [materials.NAME] table")
    geometry: Geometry = required(
        'shape of the wall, as { kind = "plane", point = [0, 0], normal = [0, 1] }'
    )
    mass: Annotated[float, Field(ge=1e-18, le=1e15)] | None = optional(
        "mass [kg]; default: that of its glued grains, of a solid disc, cluster or polygon "
        "that of its material; required for other walls that a force drives"
    )
    inertia: Annotated[float, Field(ge=1e-27, le=1e18)] | None = optional(
        "moment of inertia [kg m²]; default: as for the mass; required for other walls that a "
        "torque drives"
    )
    gravity: bool = optional(
        "whether gravity acts on the degrees of freedom that a force drives", False
    )
    groups: Array[Name] | None = optional(
        'names of the groups of grains that meet the wall, as ["coarse"]; the others pass '
        "through it and exchange no heat with it; default: all groups",
        min_length=1,
        max_length=1000,
    )
    thermal: WallCondition | None = optional(
        "thermal condition from the start of the run: { temperature = 323.15 }, { flow = 5.0 "
        "}, { capacity = 0.05, initial = 400.0 } or { insulated = true } (the default)"
    )

    @field_validator("groups")
    @classmethod
    def _named_once(cls, names: tuple[str, ...] | None) -> tuple[str, ...] | None:
        for k, name in enumerate(names or ()):
            if name in (names or ())[:k]:
                raise Refused((k,), f"the group '{name}' is named twice", "name each group once")
        return names
