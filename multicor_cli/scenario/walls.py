"""Walls: their geometry and their inertia."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Discriminator, Field, Strict, Tag, ValidationInfo, field_validator, model_validator

from multicor_cli.arithmetic import hypot
from multicor_cli.scenario.base import Length, Name, Point, Table, Vector, refuse, tag_table
from multicor_cli.scenario.sizes import Sizes
from multicor_cli.scenario.wall_heat import WallCondition

Side = Literal["left", "right", "bottom", "top"]
SizesOrGroup = Annotated[Annotated[Name, Tag("<plain>")] | Annotated[Sizes, Tag("<table>")], Discriminator(tag_table)]


class PlaneGeometry(Table):
    """An infinite straight line."""

    kind: Literal["plane"]
    point: Point = Field(description="a point of the plane [m]")
    normal: Vector = Field(description="direction from the wall towards the grains; any length but zero")

    @field_validator("normal")
    @classmethod
    def _not_zero(cls, normal: tuple[float, float]) -> tuple[float, float]:
        if hypot(*normal) < 1e-9:
            raise refuse(f"the normal {list(normal)} has no direction", "give a direction towards the grains, as [0, 1]")
        return normal


class RoughGeometry(Table):
    """A row of touching glued grains with their centers on a line."""

    kind: Literal["rough"]
    start: Point = Field(alias="from", description="where the line of glued grains begins [m]")
    end: Point = Field(alias="to", description="where it ends [m]")
    side: Literal["left", "right"] = Field(description="side of the line, looking along from → to, on which the grains flow")
    sizes: SizesOrGroup | None = Field(
        None, description="sizes of the glued grains: name of a group of particles, or a table; default: as the first group"
    )

    @field_validator("end")
    @classmethod
    def _has_length(cls, end: tuple[float, float], info: ValidationInfo) -> tuple[float, float]:
        if end == info.data.get("start"):
            raise refuse(f"the line begins and ends at {list(end)}", "give two different points")
        return end

    @property
    def length(self) -> float:
        """Length of the line of centers [m]."""
        return hypot(self.end[0] - self.start[0], self.end[1] - self.start[1])


class BoxGeometry(Table):
    """A rectangular container around the grains: one body with up to four sides."""

    kind: Literal["box"]
    min: Point = Field(description="lower left corner [m]")
    max: Point = Field(description="upper right corner [m]")
    open: Annotated[tuple[Side, ...], Strict(False)] = Field(
        (), max_length=4, description='sides left out: any of "left", "right", "bottom", "top"'
    )

    @field_validator("max")
    @classmethod
    def _above_min(cls, corner: tuple[float, float], info: ValidationInfo) -> tuple[float, float]:
        low = info.data.get("min")
        if low is not None and not (corner[0] > low[0] and corner[1] > low[1]):
            raise refuse(f"max = {list(corner)} is not above and to the right of min = {list(low)}", "exchange the corners")
        return corner

    @field_validator("open")
    @classmethod
    def _some_side(cls, sides: tuple[Side, ...]) -> tuple[Side, ...]:
        if len(set(sides)) != len(sides):
            raise refuse(f"a side is named twice in {list(sides)}", "name each open side once")
        if len(sides) == 4:
            raise refuse("all four sides are open: nothing is left of the box", "remove the wall or close a side")
        return sides


class CircleGeometry(Table):
    """The inside of a circle: a drum."""

    kind: Literal["circle"]
    center: Point = Field(description="center [m]")
    radius: Length = Field(description="radius [m]")
    rough: SizesOrGroup | None = Field(
        None, description="sizes of grains glued to the inside: name of a group of particles, or a table; default: smooth"
    )


class PolylineGeometry(Table):
    """Straight segments from point to point, solid on both sides: hoppers, chutes, obstacles."""

    kind: Literal["polyline"]
    points: Annotated[tuple[Point, ...], Strict(False)] = Field(
        min_length=2, max_length=100_000, description="corners [m], as [[0, 1], [1, 0]]"
    )
    closed: bool = Field(False, description="whether the last point is joined to the first")

    @field_validator("points")
    @classmethod
    def _distinct(cls, points: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
        for k in range(1, len(points)):
            if points[k] == points[k - 1]:
                raise refuse(f"the point {list(points[k])} follows itself", "remove one of the two", k)
        return points

    @model_validator(mode="after")
    def _closable(self) -> Self:
        if self.closed and (len(self.points) < 3 or self.points[0] == self.points[-1]):
            raise refuse(
                "a closed line needs three corners, and the first is not repeated at the end",
                "remove the last point or closed = true",
                "points",
            )
        return self


Geometry = Annotated[
    PlaneGeometry | RoughGeometry | BoxGeometry | CircleGeometry | PolylineGeometry,
    Field(discriminator="kind"),
]


class Wall(Table):
    """One entry of ``[[walls]]``: one rigid body."""

    name: Name = Field(description="name of the wall, used by drives")
    material: Name = Field(description="name of a [materials.NAME] table")
    geometry: Geometry = Field(description='shape of the wall, as { kind = "plane", point = [0, 0], normal = [0, 1] }')
    mass: Annotated[float, Field(ge=1e-18, le=1e15)] | None = Field(
        None, description="mass [kg]; default: that of its glued grains; required for other walls that a force drives"
    )
    inertia: Annotated[float, Field(ge=1e-27, le=1e18)] | None = Field(
        None,
        description="moment of inertia [kg m²]; default: that of its glued grains; required for others that a torque drives",
    )
    gravity: bool = Field(False, description="whether gravity acts on the degrees of freedom that a force drives")

    thermal: WallCondition | None = Field(
        None,
        description="thermal condition from the start of the run: { temperature = 323.15 }, { flow = 5.0 } or { insulated = true } "
        "(the default)",
    )

    @property
    def has_glued_grains(self) -> bool:
        """Whether the wall carries glued grains, whose mass is its default mass."""
        return isinstance(self.geometry, RoughGeometry) or (
            isinstance(self.geometry, CircleGeometry) and self.geometry.rough is not None
        )

    @property
    def glued_sizes(self) -> SizesOrGroup | None:
        """What the scenario says about the sizes of the glued grains; ``None``: as the first group (or no glued grains)."""
        if isinstance(self.geometry, RoughGeometry):
            return self.geometry.sizes
        return self.geometry.rough if isinstance(self.geometry, CircleGeometry) else None
