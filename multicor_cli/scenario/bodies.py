"""Solid bodies among the grains, and containers around them: discs, polygons and rigid clusters of glued grains."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, Strict, field_validator

from multicor_cli.arithmetic import hypot
from multicor_cli.arithmetic.sums import column_totals, total
from multicor_cli.model import ShapeKind, WallBody
from multicor_cli.model.model import Floats
from multicor_cli.model.shapes import Discs, Polygon, Room
from multicor_cli.scenario.base import Coordinate, Length, Point, Radius, refuse
from multicor_cli.scenario.gluing import Glued, Ring, Sides, SizesOrGroup
from multicor_cli.scenario.particles import ParticleGroup
from multicor_cli.scenario.problems import Finding
from multicor_cli.scenario.region import MAX_CORNERS, Corners, simple_polygon
from multicor_cli.scenario.settings import Domain
from multicor_cli.scenario.wall_geometry import Substance, WallGeometry

_TOUCHING = 1e-6  # overlap over the smaller radius that rounded numbers give discs that touch
_ELSEWHERE = "make it smaller, or use periodic = false"


class DiscGeometry(WallGeometry):
    """A solid disc with the grains outside: an intruder, an inner cylinder."""

    kind: Literal["disc"]
    center: Point = Field(description="center [m]")
    radius: Length = Field(description="radius [m]")
    rough: SizesOrGroup | None = Field(
        None, description="sizes of grains glued around it: name of a group of particles, or a table; default: smooth"
    )

    def body(self, domain: Domain) -> WallBody:
        """The disc; a load spreads over its circumference."""
        smooth = WallBody.empty(self.center, 2.0 * math.pi * self.radius)
        return smooth.with_shapes(ShapeKind.DISC, [(0.0, 0.0, self.radius, 0.0)])

    def glued(self, domain: Domain | None = None) -> Glued | None:
        """A ring of them, if it is rough."""
        return None if self.rough is None else Glued(Ring(self.center, self.radius, is_outside=True), self.rough, "rough")

    def misfits(self, domain: Domain) -> Iterator[Finding]:
        """It fits into the period."""
        if domain.periodic and 2.0 * self.radius > domain.size[0]:
            what = f"the disc of radius {self.radius:g} m is wider than the period of {domain.size[0]:g} m"
            yield Finding(("radius",), what, _ELSEWHERE)

    def room(self, discs: Floats) -> Room:
        """All that lies outside."""
        return Room(outside=(Discs(discs),))

    @property
    def substance(self) -> Substance:
        """The disc, and what is glued to it."""
        return "discs"


class ClusterGeometry(WallGeometry):
    """Grains glued to each other, anywhere: one grain to be driven, a tracer, a rigid cluster."""

    kind: Literal["cluster"]
    discs: Annotated[tuple[Annotated[tuple[Coordinate, Coordinate, Radius], Strict(False)], ...], Strict(False)] = Field(
        min_length=1, max_length=MAX_CORNERS, description="x, y and radius of each grain [m], as [[0, 0, 1e-3], [2e-3, 0, 1e-3]]"
    )

    @field_validator("discs")
    @classmethod
    def _distinct(cls, discs: tuple[tuple[float, float, float], ...]) -> tuple[tuple[float, float, float], ...]:
        seen: set[tuple[float, float]] = set()
        for k, (x, y, _) in enumerate(discs):
            if (x, y) in seen:
                raise refuse(f"two grains have their centers at {[x, y]}", "remove one of them", k)
            seen.add((x, y))
        return discs

    def body(self, domain: Domain) -> WallBody:
        """The discs around their center of area; a load spreads over their circumferences."""
        discs = np.array(self.discs)
        area = discs[:, 2] * discs[:, 2]
        center = column_totals(discs[:, :2] * area[:, np.newaxis]) / total(area)
        local = np.column_stack([discs[:, :2] - center, discs[:, 2], np.zeros(len(discs))])
        return WallBody.empty(center.tolist(), 2.0 * math.pi * total(discs[:, 2])).with_shapes(ShapeKind.DISC, local)

    def misfits(self, domain: Domain) -> Iterator[Finding]:
        """It fits into the period."""
        low, high = Discs(np.array(self.discs)).corners()[:, 0].tolist()
        if domain.periodic and high - low > domain.size[0]:
            what = f"the cluster is {high - low:g} m wide, more than the period of {domain.size[0]:g} m"
            yield Finding(("discs",), what, _ELSEWHERE)

    def room(self, discs: Floats) -> Room:
        """All that lies outside."""
        return Room(outside=(Discs(discs),))

    @property
    def substance(self) -> Substance | None:
        """Its grains; unless they overlap, so that their sum counts parts twice."""
        return None if self._overlaps() else "discs"

    def _overlaps(self) -> bool:
        x, y, radius = np.array(self.discs).T
        for k in range(len(radius) - 1):
            dx, dy, near = x[k + 1 :] - x[k], y[k + 1 :] - y[k], radius[k + 1 :] + radius[k]
            slack = _TOUCHING * np.minimum(radius[k + 1 :], radius[k])
            if (dx * dx + dy * dy < (near - slack) * (near - slack)).any():
                return True
        return False


class PolygonGeometry(WallGeometry):
    """A simple polygon: a solid body with the grains outside, or a container with the grains inside."""

    kind: Literal["polygon"]
    points: Corners = Field(description="corners [m] in their order along the outline, as [[0, 0], [1, 0], [0, 1]]")
    grains: Literal["outside", "inside"] = Field(
        description='where the grains are: "outside" of a solid body, "inside" a container'
    )
    rough: SizesOrGroup | None = Field(
        None,
        description="sizes of grains glued to its sides, with their centers on them: name of a group of particles, or a table; "
        "default: smooth",
    )

    _simple = field_validator("points")(simple_polygon)

    def area(self) -> Polygon:
        """The polygon; counterclockwise if grains are outside, clockwise if they are inside: solid on the left of each side."""
        polygon = Polygon(np.array(self.points))
        is_left = polygon.signed_size > 0.0
        return polygon if is_left == (self.grains == "outside") else Polygon(polygon.points[::-1].copy())

    def body(self, domain: Domain) -> WallBody:
        """A side from each corner to the next, and a vertex at each corner, around the center of area."""
        polygon = self.area()
        body = WallBody.empty(polygon.centroid.tolist(), polygon.perimeter)
        return body.with_line(polygon.points - polygon.centroid, domain.period, ShapeKind.SIDE, is_closed=True)

    def glued(self, domain: Domain | None = None) -> Glued | None:
        """A row along each side, if it is rough."""
        return None if self.rough is None else Glued(Sides(self.area()), self.rough, "rough")

    def misfits(self, domain: Domain) -> Iterator[Finding]:
        """It fits into the period however it is turned."""
        polygon = self.area()
        width = 2.0 * max(hypot(*away) for away in (polygon.points - polygon.centroid).tolist())
        if domain.periodic and width > domain.size[0]:
            what = f"the polygon is {width:g} m wide when it is turned, more than the period of {domain.size[0]:g} m"
            yield Finding(("points",), what, _ELSEWHERE)

    def room(self, discs: Floats) -> Room:
        """All that lies outside, or inside."""
        room = Room().without(Discs(discs)) if len(discs) else Room()
        return room.without(self.area()) if self.grains == "outside" else room.within(self.area())

    @property
    def substance(self) -> Substance | None:
        """The solid polygon; of a container, its glued grains."""
        return "prism" if self.grains == "outside" else super().substance


def prism_height(group: ParticleGroup) -> float | None:
    """Thickness of a solid polygon among grains like those of a group [m]: that of discs, the largest diameter of spheres.

    None if the group brings spheres from elsewhere, so that their sizes are not known.
    """
    if group.shape == "disc":
        return group.thickness
    return None if group.sizes is None else 2.0 * group.sizes.largest
