"""Rectangles."""

from __future__ import annotations

from pydantic import Field, ValidationInfo, field_validator

from multicor_cli.scenario.base import Point, Table, refuse


class Region(Table):
    """A rectangle."""

    min: Point = Field(description="lower left corner [m]")
    max: Point = Field(description="upper right corner [m]")

    @field_validator("max")
    @classmethod
    def _above_min(cls, corner: tuple[float, float], info: ValidationInfo) -> tuple[float, float]:
        low = info.data.get("min")
        if low is not None and not (corner[0] > low[0] and corner[1] > low[1]):
            raise refuse(f"max = {list(corner)} is not above and to the right of min = {list(low)}", "swap the corners")
        return corner

    @property
    def width(self) -> float:
        """Extent in x [m]."""
        return self.max[0] - self.min[0]

    @property
    def height(self) -> float:
        """Extent in y [m]."""
        return self.max[1] - self.min[1]
