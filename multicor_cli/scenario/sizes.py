"""Distributions of the radii of grains."""

from __future__ import annotations

import math
from typing import Annotated, Literal, Self

from pydantic import Field, Strict, ValidationInfo, field_validator, model_validator

from multicor_cli.scenario.base import Fraction, Radius, Table, refuse

MAX_SIZE_RATIO = 1000.0


class _Sizes(Table):
    by: Literal["number", "mass"] = Field(
        "number", description='whether the distribution is one of the number or of the mass of grains: "number" or "mass"'
    )


class ListSizes(_Sizes):
    """A list of radii, each with its fraction."""

    kind: Literal["list"]
    radii: Annotated[tuple[Radius, ...], Strict(False)] = Field(min_length=1, max_length=1000, description="radii [m]")
    fractions: Annotated[tuple[Fraction, ...], Strict(False)] | None = Field(
        None, max_length=1000, description="fraction of each radius, adding up to 1; default: equal fractions"
    )

    @model_validator(mode="after")
    def _check_fractions(self) -> Self:
        if self.fractions is None:
            return self
        if len(self.fractions) != len(self.radii):
            raise refuse(f"{len(self.fractions)} fractions for {len(self.radii)} radii", "give one per radius", "fractions")
        total = math.fsum(self.fractions)
        if abs(total - 1.0) > 1e-6:
            raise refuse(f"the fractions add up to {total:g}", "make them add up to 1", "fractions")
        return self

    @property
    def smallest(self) -> float:
        """Smallest radius [m]."""
        return min(self.radii)

    @property
    def largest(self) -> float:
        """Largest radius [m]."""
        return max(self.radii)


class _Range(_Sizes):
    min: Radius = Field(description="smallest radius [m]")
    max: Radius = Field(description="largest radius [m]")

    @field_validator("max")
    @classmethod
    def _above_min(cls, largest: float, info: ValidationInfo) -> float:
        smallest = info.data.get("min", largest)
        if largest < smallest:
            raise refuse(f"max = {largest:g} is below min = {smallest:g}", "swap the two")
        if largest > MAX_SIZE_RATIO * smallest:
            raise refuse(
                f"max = {largest:g} is more than {MAX_SIZE_RATIO:g} times min = {smallest:g}",
                "narrow the range; radii are in meters",
            )
        return largest

    @property
    def smallest(self) -> float:
        """Smallest radius [m]."""
        return self.min

    @property
    def largest(self) -> float:
        """Largest radius [m]."""
        return self.max


class UniformSizes(_Range):
    """All radii between ``min`` and ``max`` are equally likely."""

    kind: Literal["uniform"]


class LognormalSizes(_Range):
    """The logarithm of the radius is normally distributed; cut at ``min`` and ``max``."""

    kind: Literal["lognormal"]
    median: Radius = Field(description="median radius before the cut [m], between min and max")
    sigma: float = Field(ge=1e-6, le=3.0, description="standard deviation of the logarithm of the radius")

    @field_validator("median")
    @classmethod
    def _inside(cls, median: float, info: ValidationInfo) -> float:
        low, high = info.data.get("min", median), info.data.get("max", median)
        if not low <= median <= high:
            raise refuse(f"the median {median:g} is outside min = {low:g} to max = {high:g}", "put it between the two")
        return median


class PowerSizes(_Range):
    """Probability density proportional to radius to the power ``-exponent`` between ``min`` and ``max``."""

    kind: Literal["power"]
    exponent: float = Field(ge=-20.0, le=20.0, description="exponent p of the density r^-p")


Sizes = Annotated[ListSizes | UniformSizes | LognormalSizes | PowerSizes, Field(discriminator="kind")]
AnySizes = ListSizes | UniformSizes | LognormalSizes | PowerSizes
