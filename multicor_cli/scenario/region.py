"""Rectangles."""

from __future__ import annotations

from pydantic import Field, ValidationInfo, field_validator

from multicor_cli.scenario.base import Point, Table, refuse


def above_min(corner: tuple[float, float], info: ValidationInfo) -> tuple[float, float]:
    """The corner ``max`` of a rectangle if it is above and to the right of ``min``."""
    low = info.data.get("min")
    if low is not None and not (corner[0] > low[0] and corner[1] > low[1]):
        raise refuse(f"max = {list(corner)} is not above and to the right of min = {list(low)}", "swap the corners")
    return corner


class Region(Table):
    """A rectangle."""

    min: Point = Field(description="lower left corner [m]")
    max: Point = Field(description="upper right corner [m]")

    _above_min = field_validator("max")(above_min)

    @property
    def width(self) -> float:
        """Extent in x [m]."""
        return self.max[0] - self.min[0]

    @property
    def height(self) -> float:
        """Extent in y [m]."""
        return self.max[1] - self.min[1]
