"""The rectangle that a packing fills."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class PackingRegion:
    """A rectangle [m]; ``is_periodic``: its left and right sides are one and the same (it spans the period exactly)."""

    left: float
    bottom: float
    right: float
    top: float
    is_periodic: bool = False

    @property
    def width(self) -> float:
        """Extent in x [m]."""
        return self.right - self.left

    @property
    def height(self) -> float:
        """Extent in y [m]."""
        return self.top - self.bottom

    @property
    def area(self) -> float:
        """Area [m²]."""
        return self.width * self.height

    @property
    def period(self) -> float:
        """Period in x [m]; 0 if the region is not periodic."""
        return self.width if self.is_periodic else 0.0
