"""Shapes of grains in the plane that are no discs, and how these grains are turned at the start."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Iterator, Sequence
from typing import Annotated, Literal

import numpy as np
from pydantic import Discriminator, Field, Tag, field_validator

from multicor_cli.arithmetic import cos, sin
from multicor_cli.model.decomposition import STRAIGHT, turns
from multicor_cli.model.measures import Measures, measure, measure_polygons
from multicor_cli.model.model import Floats
from multicor_cli.model.outlines import Outlines, Piece
from multicor_cli.model.shapes import Polygon, fault_of_polygon
from multicor_cli.scenario.base import (
    COORDINATE_BOUNDS,
    Array,
    Column,
    Number,
    Pair,
    Table,
    columns_of_file,
    exactly_one,
    optional,
    required,
    tag_table,
)
from multicor_cli.scenario.outline_files import (
    MOST_CORNERS,
    Drawn,
    drawn,
    faults_of_columns,
    read_geojson,
    read_wkt,
    rings_of_grains,
)
from multicor_cli.scenario.problems import Refused

Coordinates = Pair[Number]


def convex(points: Floats) -> Floats:
    """Corners of a convex polygon counter-clockwise, without those on straight sides.

    Raises:
        Refused: They are no corners of a convex polygon; the key is the number of the first that
            cannot be one.
    """
    fault = (
        fault_of_polygon(points) if len(points) > 2 else (0, "there are less than three corners")
    )
    if fault is not None:
        remedy = "give each corner once, in their order along the outline"
        raise Refused((fault[0],), fault[1], remedy)
    is_left = Polygon(points).signed_size > 0.0
    turn = turns(points) if is_left else -turns(points)
    k = int(np.argmin(turn))
    if turn[k] < -STRAIGHT:
        what = f"the outline is not convex at {points[k].tolist()}"
        remedy = 'use kind = "clump" with convex pieces, or kind = "file"'
        raise Refused((k,), what, remedy)
    kept = points[turn > STRAIGHT]
    if len(kept) < 3:
        raise Refused((), "the corners lie on a line", "give an outline that covers an area")
    return kept if is_left else kept[::-1].copy()


def _check_convex(
    points: tuple[tuple[float, float], ...] | None,
) -> tuple[tuple[float, float], ...] | None:
    if points is not None:
        convex(np.array(points))
    return points


# ---- Kinds of shapes


class GrainShape(Table):
    """What the outline of a grain is, in any unit: grains are scaled to their sizes."""

    kind: str
    size: Literal["reach", "area"] = optional(
        'what the radii of sizes are: "reach": the distance of the farthest point of a grain from '
        'its center of mass; "area": the radius of a disc of the same area',
        "reach",
    )

    solid: float = optional(
        "mass of a grain over that of its true area, thickness and density: below 1 of porous or "
        "hollow grains, or of those that are thinner at their sides",
        1.0,
        gt=0.0,
        le=100.0,
    )
    gyration: float | None = optional(
        "radius of gyration about the center of mass over the reach, by which the moment of "
        "inertia is m (gyration reach)²; default: that of the true area",
        gt=0.0,
        le=1.0,
    )

    @property
    def is_disc(self) -> bool:
        """Whether it is one after all."""
        return False

    @property
    def draws(self) -> int:
        """How many random numbers make the outline of one grain; 0: they come in turn."""
        return 0

    @abstractmethod
    def forms(self, uniform: Floats) -> list[list[Piece]]:
        """The pieces of some grains, of any size and place; other grains take them in turn.

        ``uniform`` are ``draws`` numbers between 0 and 1 for each grain, shape ``(n, draws)``.
        """

    def measures(self, forms: Sequence[Sequence[Piece]]) -> Measures:
        """Area and perimeter of `forms`, their center of mass and gyration as given if they are."""
        found = self._of_area(forms)
        center = getattr(self, "center", None)
        if center is not None:
            found = found._replace(center=np.tile(center, (len(forms), 1)))
        if self.gyration is not None:
            places = zip(forms, found.center, strict=True)
            radius = self.gyration * np.array([_reach(list(form), at) for form, at in places])
            found = found._replace(gyration=radius * radius)
        return found

    def _of_area(self, forms: Sequence[Sequence[Piece]]) -> Measures:
        """Measures of the true area."""
        return measure(forms)

    @property
    def filled(self) -> float:
        """Least area of a grain over that of a disc of its size; 0 where it is not known."""
        if self.size == "area":
            return 1.0
        if self.draws:
            return 0.0
        forms = self.forms(np.zeros((1, 0)))
        found = self.measures(forms)
        reach = np.array([_reach(*form) for form in zip(forms, found.center, strict=True)])
        return float((found.area / (math.pi * (reach * reach))).min())


def _reach(pieces: list[Piece], center: Floats) -> float:
    """How far pieces reach from a point."""
    one = Outlines.of([[(corners - center, rounding) for corners, rounding in pieces]], _ONE, _ONE)
    return float(one.radius[0])


_ONE = np.ones(1)

_CENTER = "center of mass in the unit of the corners, with gyration; default: that of the true area"


THINNEST = 0.01
"""Least area of a grain, over the square of its reach from the center of that area: what is thinner
falls through others."""

_DIRECTIONS = 720
"""In which a center of mass is looked for beyond all that a grain has: every half degree."""


def _faults_of_form(shape: GrainShape, center: Coordinates | None) -> Iterator[Refused]:
    """What is wrong with outlines that are thin, and a center of mass that is given."""
    forms = shape.forms(np.zeros((1, 0)))
    found = shape._of_area(forms)
    for k, form in enumerate(forms):
        reach = _reach(form, found.center[k])
        share = float(found.area[k]) / (reach * reach)
        if share < THINNEST:
            which = f"grain {k + 1} of the outlines" if len(forms) > 1 else "the outline"
            what = f"{which} has an area of {share:.1e} times the square of its reach"
            yield Refused((), what, f"make it wider or shorter: at least {THINNEST}")
    if center is None:
        return
    if shape.gyration is None:  # mass is not as the area
        what = "with a center of mass by hand the moment of inertia is not that of the area"
        yield Refused(("center",), what, "give gyration too")
    around = Outlines.of(forms, _ONE, _ONE)
    r = np.repeat(around.rounding, np.diff(around.start))
    angles = [2.0 * math.pi * k / _DIRECTIONS for k in range(_DIRECTIONS)]
    c, s = (np.array([of(angle) for angle in angles]) for of in (cos, sin))
    x, y = around.corner.T[..., np.newaxis]
    highest = (x * c + y * s + r[:, np.newaxis]).max(axis=0)
    if (center[0] * c + center[1] * s > highest).any():
        what = f"no mass within the outline has its center at {list(center)}"
        remedy = "give a point of its convex hull, in the unit of the corners"
        yield Refused(("center",), what, remedy)


class DiscShape(Table):
    """A disc: the same as ``shape = "disc"``."""

    kind: Literal["disc"]


class RodShape(GrainShape):
    """A rectangle with half a disc at either end, along x: a rounded-cap rectangle."""

    kind: Literal["rod"]
    aspect: float = required(
        "length over width; 1/(1 − η) of an elongation η = (length − width)/length",
        ge=1.0,
        le=100.0,
    )

    @property
    def is_disc(self) -> bool:
        return self.aspect == 1.0

    def forms(self, uniform: Floats) -> list[list[Piece]]:
        half = self.aspect - 1.0
        return [[(np.array([[-half, 0.0], [half, 0.0]]), 1.0)]]


class PolygonShape(GrainShape):
    """A convex polygon: regular, with corners that are moved at random, or by its corners."""

    kind: Literal["polygon"]
    sides: int | None = optional(
        "number of sides of a regular polygon, which stands on one of them (or give vertices)",
        ge=3,
        le=MOST_CORNERS,
    )
    vertices: Array[Coordinates] | None = optional(
        "corners of a convex polygon in any unit, as [[0, 0], [2, 0], [1, 1]] (or give sides)",
        min_length=3,
        max_length=MOST_CORNERS,
    )
    elongation: float = optional(
        "how many times as long the regular polygon is drawn along the side on which it stands",
        1.0,
        ge=0.01,
        le=100.0,
    )
    rounding: float = optional(
        "radius of the corners over the distance of the farthest one from the center of mass",
        0.0,
        ge=0.0,
        le=0.99,
    )
    irregular: float = optional(
        "each corner of the regular polygon is moved at random along the circle around it, by up "
        "to this share of half the distance to the next one",
        0.0,
        ge=0.0,
        le=0.9,
    )

    center: Coordinates | None = optional(_CENTER)

    _convex = field_validator("vertices")(_check_convex)

    def faults(self) -> Iterator[Refused]:
        yield from exactly_one(self, "sides", "vertices", "give one of them")
        if self.vertices is None and self.center is not None:
            what = "a center of mass by hand is a point among vertices"
            yield Refused(("center",), what, "give vertices in place of sides")
        if self.vertices is not None:
            yield from _faults_of_form(self, self.center)
        for key, none in (("elongation", 1.0), ("irregular", 0.0)):
            if self.vertices is not None and getattr(self, key) != none:
                yield Refused((key,), f"{key} is of regular polygons", "remove it, or give sides")

    @property
    def draws(self) -> int:
        return (self.sides or 0) if self.irregular else 0

    def forms(self, uniform: Floats) -> list[list[Piece]]:
        if self.vertices is not None:
            return [self._rounded(convex(np.array(self.vertices)))]
        assert self.sides is not None  # one of the two is given
        step = 2.0 * math.pi / self.sides
        moves = self.irregular * (uniform - 0.5) if self.draws else np.zeros((1, self.sides))
        found = []
        for row in moves.tolist():
            angles = [-0.5 * math.pi + step * (k + 0.5 + by) for k, by in enumerate(row)]
            corners = [[self.elongation * cos(angle), sin(angle)] for angle in angles]
            found.append(self._rounded(np.array(corners)))
        return found

    def _rounded(self, corners: Floats) -> list[Piece]:
        """The polygon, shrunk by as much as it is then widened at the farthest corner."""
        if self.rounding == 0.0:
            return [(corners, 0.0)]
        center = measure([[(corners, 0.0)]]).center[0]
        rounding = self.rounding * _reach([(corners, 0.0)], center)
        return [(center + (1.0 - self.rounding) * (corners - center), rounding)]


class EllipseShape(GrainShape):
    """An ellipse by sides that touch it: rounded by the smallest radius of its curvature."""

    kind: Literal["ellipse"]
    aspect: float = required("length along x over width", ge=1.0, le=100.0)
    sides: int = optional(
        "number of corners, whose normals are equally far apart", 16, ge=4, le=MOST_CORNERS
    )

    @property
    def is_disc(self) -> bool:
        return self.aspect == 1.0

    def forms(self, uniform: Floats) -> list[list[Piece]]:
        """Corners on the curve that runs within the ellipse at its smallest radius of curvature."""
        length, rounding = self.aspect, 1.0 / self.aspect
        corners = []
        for k in range(self.sides):
            angle = 2.0 * math.pi * k / self.sides
            c, s = cos(angle), sin(angle)
            support = math.sqrt(length * length * c * c + s * s)
            corners.append(
                [(length * length / support - rounding) * c, (1.0 / support - rounding) * s]
            )
        return [[(np.array(corners), rounding)]]


class ClumpPiece(Table):
    """A piece of a clump, in any unit: a disc, or what lies within a radius of a polygon."""

    center: Coordinates | None = optional("center of a disc (or give vertices)")
    vertices: Array[Coordinates] | None = optional(
        "corners of a convex polygon, or the two ends of a rod (or give center)",
        min_length=2,
        max_length=MOST_CORNERS,
    )
    radius: float = optional(
        "radius of the disc, or of the corners around the vertices", 0.0, ge=0.0, le=1e12
    )

    @field_validator("vertices")
    @classmethod
    def _convex(
        cls, points: tuple[tuple[float, float], ...] | None
    ) -> tuple[tuple[float, float], ...] | None:
        if points is None or len(points) > 2:
            return _check_convex(points)
        if points[0] == points[1]:
            raise Refused((1,), f"the point {list(points[1])} is given twice", "give center")
        return points

    def faults(self) -> Iterator[Refused]:
        yield from exactly_one(self, "center", "vertices", "give one of them")
        if self.radius == 0.0 and len(self.vertices or ()) < 3:
            yield Refused((), "the piece covers no area", "give it a radius")

    @property
    def piece(self) -> Piece:
        """What it is to other packages."""
        if self.vertices is None:
            return np.array([self.center], float), self.radius
        points = np.array(self.vertices, float)
        return points if len(points) == 2 else convex(points), self.radius


class ClumpShape(GrainShape):
    """Pieces on one body, which may overlap: grains that are not convex."""

    kind: Literal["clump"]
    pieces: Array[ClumpPiece] = required(
        "pieces in any unit, as [{ center = [0, 0], radius = 1.0 }, { vertices = [[0, 0], [2, 0], "
        "[1, 1]], radius = 0.1 }]",
        min_length=1,
        max_length=MOST_CORNERS,
    )
    center: Coordinates | None = optional(_CENTER)

    def faults(self) -> Iterator[Refused]:
        yield from _faults_of_form(self, self.center)

    @property
    def is_disc(self) -> bool:
        return len(self.pieces) == 1 and self.pieces[0].center is not None

    def forms(self, uniform: Floats) -> list[list[Piece]]:
        return [[part.piece for part in self.pieces]]


class FileShape(GrainShape):
    """Outlines of digitized grains: polygons, which the grains of the group take in turn.

    Those that are not convex, or have holes, are clumps of convex pieces.
    """

    kind: Literal["file"]
    file: str | None = optional(
        "CSV file with the columns grain, x, y (and ring, for holes) in place of the arrays: a row "
        "for each corner; or polygons in WKT (.wkt) or GeoJSON (.geojson, .json)"
    )
    grain: Array[Number] = optional(
        "number of the grain to which each corner belongs, ascending", (), max_length=100_000
    )
    ring: Array[Number] = optional(
        "number of the ring to which each corner belongs, ascending in each grain: the first is "
        "the outline, others are holes; default: there are no holes",
        (),
        max_length=100_000,
    )
    x: Array[Number] = optional("x of each corner, in any unit", (), max_length=100_000)
    y: Array[Number] = optional("y of each corner", (), max_length=100_000)

    _read = columns_of_file(
        {".wkt": read_wkt, ".geojson": read_geojson, ".json": read_geojson},
        faults_of_columns,
        grain=Column({"grain": 1.0}, (0.0, 1e9)),
        ring=Column({"ring": 1.0}, (0.0, 1e9), is_optional=True),
        x=Column({"x": 1.0}, COORDINATE_BOUNDS),
        y=Column({"y": 1.0}, COORDINATE_BOUNDS),
    )

    def faults(self) -> Iterator[Refused]:
        faults = list(faults_of_columns((self.grain, self.ring, self.x, self.y)))
        yield from faults or _faults_of_form(self, None)

    def _outlines(self) -> list[Drawn]:
        columns = (self.grain, self.ring, self.x, self.y)
        return [drawn(rings) for _, rings in rings_of_grains(*columns)]

    def forms(self, uniform: Floats) -> list[list[Piece]]:
        return [[(piece, 0.0) for piece in grain.pieces] for grain in self._outlines()]

    def _of_area(self, forms: Sequence[Sequence[Piece]]) -> Measures:
        """Of the polygons themselves: no side between pieces has to be found again."""
        return measure_polygons([grain.rings for grain in self._outlines()])


ShapeTable = Annotated[
    DiscShape | RodShape | PolygonShape | EllipseShape | ClumpShape | FileShape,
    Field(discriminator="kind"),
]

Shape = Annotated[
    Annotated[Literal["disc", "sphere"], Tag("<plain>")] | Annotated[ShapeTable, Tag("<table>")],
    Discriminator(tag_table),
]


# ---- How they are turned


class UniformOrientation(Table):
    """Grains are turned at random."""

    kind: Literal["uniform"]


class FixedOrientation(Table):
    """All grains are turned alike."""

    kind: Literal["fixed"]
    angle: Number = required("angle by which they are turned, counter-clockwise [degrees]")


class ListOrientation(Table):
    """One angle for each grain of the group."""

    kind: Literal["list"]
    angles: Array[Number] = required(
        "angle of each grain of the group [degrees], in their order",
        min_length=1,
        max_length=100_000,
    )


Orientation = Annotated[
    UniformOrientation | FixedOrientation | ListOrientation, Field(discriminator="kind")
]
