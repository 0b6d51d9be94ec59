"""Regions: rectangles, circles, annuli and polygons."""

from __future__ import annotations

from abc import abstractmethod
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, Discriminator, Field, Strict, Tag, ValidationInfo, field_validator

from multicor_cli.model.shapes import Annulus, Area, Polygon, Rectangle, fault_of_polygon
from multicor_cli.scenario.base import Length, Point, Table, required
from multicor_cli.scenario.problems import Refused

MAX_CORNERS = 2000
"""Most corners of a polygon."""


def above_min(corner: tuple[float, float], info: ValidationInfo) -> tuple[float, float]:
    """The corner ``max`` of a rectangle if it is above and to the right of ``min``."""
    low = info.data.get("min")
    if low is not None and not (corner[0] > low[0] and corner[1] > low[1]):
        what = f"max = {list(corner)} is not above and to the right of min = {list(low)}"
        raise Refused((), what, "swap the corners")
    return corner


def simple_polygon(points: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
    """The corners of a polygon whose sides meet only at its corners."""
    fault = fault_of_polygon(np.array(points))
    if fault is not None:
        remedy = (
            "give each corner once, in their order along the outline; the last is joined to the "
            "first by itself"
        )
        raise Refused((fault[0],), fault[1], remedy)
    return points


Corners = Annotated[tuple[Point, ...], Strict(False), Field(min_length=3, max_length=MAX_CORNERS)]


class Region(Table):
    """A part of the plane."""

    @abstractmethod
    def area(self) -> Area:
        """What it is to other packages."""

    @property
    def width(self) -> float:
        """Extent in x [m]."""
        low, high = self.area().corners()[:, 0].tolist()
        return float(high - low)

    @property
    def height(self) -> float:
        """Extent in y [m]."""
        low, high = self.area().corners()[:, 1].tolist()
        return float(high - low)

    @property
    def room(self) -> float:
        """Diameter of the largest grain that may fit into it [m]; of polygons a bound."""
        return min(self.width, self.height)

    def __str__(self) -> str:
        return f"region of {self.width:g} × {self.height:g} m"


class RectangleRegion(Region):
    """A rectangle."""

    kind: Literal["rectangle"] = "rectangle"
    min: Point = required("lower left corner [m]")
    max: Point = required("upper right corner [m]")

    _above_min = field_validator("max")(above_min)

    def area(self) -> Rectangle:
        return Rectangle(self.min, self.max)


class CircleRegion(Region):
    """The inside of a circle."""

    kind: Literal["circle"]
    center: Point = required("center [m]")
    radius: Length = required("radius [m]")

    def area(self) -> Annulus:
        return Annulus(self.center, self.radius)

    def __str__(self) -> str:
        return f"circle of radius {self.radius:g} m"


class AnnulusRegion(Region):
    """What lies between two circles around one center."""

    kind: Literal["annulus"]
    center: Point = required("center [m]")
    inner: Length = required("radius of the inner circle [m]")
    outer: Length = required("radius of the outer circle [m]")

    @field_validator("outer")
    @classmethod
    def _above_inner(cls, outer: float, info: ValidationInfo) -> float:
        inner = info.data.get("inner")
        if inner is not None and outer <= inner:
            what = f"outer = {outer:g} is not larger than inner = {inner:g}"
            raise Refused((), what, "swap the two radii")
        return outer

    def area(self) -> Annulus:
        return Annulus(self.center, self.outer, self.inner)

    @property
    def room(self) -> float:
        """Its width [m]."""
        return self.outer - self.inner

    def __str__(self) -> str:
        return f"annulus from radius {self.inner:g} to {self.outer:g} m"


class PolygonRegion(Region):
    """A simple polygon."""

    kind: Literal["polygon"]
    points: Corners = required(
        "corners [m] in their order along the outline, as [[0, 0], [1, 0], [0, 1]]"
    )

    _simple = field_validator("points")(simple_polygon)

    def area(self) -> Polygon:
        return Polygon(np.array(self.points))

    def __str__(self) -> str:
        return f"polygon of {len(self.points)} corners, {self.width:g} × {self.height:g} m"


def tag_kind(value: Any) -> str | None:
    """Discriminator of a union of regions: their ``kind``, "rectangle" if there is none."""
    if isinstance(value, BaseModel):
        return str(getattr(value, "kind", ""))
    return str(value.get("kind", "rectangle")) if isinstance(value, dict) else None


AnyRegion = Annotated[
    Annotated[RectangleRegion, Tag("rectangle")]
    | Annotated[CircleRegion, Tag("circle")]
    | Annotated[AnnulusRegion, Tag("annulus")]
    | Annotated[PolygonRegion, Tag("polygon")],
    Discriminator(tag_kind),
]
