"""Distributions of the radii of grains."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal, Self

from pydantic import Field, Strict, ValidationInfo, field_validator, model_validator

from multicor_cli.scenario.base import FRACTION_BOUNDS, RADIUS_BOUNDS, Fraction, Radius, Table, require_ascending
from multicor_cli.scenario.csv_columns import Column, read_columns, refuse_both
from multicor_cli.scenario.problems import Refused

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
            raise Refused(("fractions",), f"{len(self.fractions)} fractions for {len(self.radii)} radii", "give one per radius")
        total = math.fsum(self.fractions)
        if abs(total - 1.0) > 1e-6:
            raise Refused(("fractions",), f"the fractions add up to {total:g}", "make them add up to 1")
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
            raise Refused((), f"max = {largest:g} is below min = {smallest:g}", "swap the two")
        if largest > MAX_SIZE_RATIO * smallest:
            raise Refused(
                (),
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
            raise Refused((), f"the median {median:g} is outside min = {low:g} to max = {high:g}", "put it between the two")
        return median


class NormalSizes(_Range):
    """The radius is normally distributed; cut at ``min`` and ``max``."""

    kind: Literal["normal"]
    mean: Radius = Field(description="mean radius before the cut [m], between min and max")
    sigma: float = Field(ge=1e-12, le=1e4, description="standard deviation of the radius before the cut [m]")

    @field_validator("mean")
    @classmethod
    def _inside(cls, mean: float, info: ValidationInfo) -> float:
        low, high = info.data.get("min", mean), info.data.get("max", mean)
        if not low <= mean <= high:
            raise Refused((), f"the mean {mean:g} is outside min = {low:g} to max = {high:g}", "put it between the two")
        return mean


class PowerSizes(_Range):
    """Probability density proportional to radius to the power ``-exponent`` between ``min`` and ``max``."""

    kind: Literal["power"]
    exponent: float = Field(ge=-20.0, le=20.0, description="exponent p of the density r^-p")


class TableSizes(Table):
    """What passes at each radius, as a sieve curve: the density is constant between two rows."""

    kind: Literal["table"]
    by: Literal["number", "mass"] = Field(
        "mass", description='whether passing is a share of the mass (a sieve curve) or of the number of grains: "mass" or "number"'
    )
    file: str | None = Field(
        None, description="CSV file with the columns radius or diameter [m], and passing, in place of the two arrays"
    )
    radii: Annotated[tuple[Radius, ...], Strict(False)] = Field((), max_length=100_000, description="radii [m], ascending")
    passing: Annotated[tuple[Fraction, ...], Strict(False)] = Field(
        (), max_length=100_000, description="share of the grains that is smaller than each of the radii, from 0 to 1"
    )

    @model_validator(mode="before")
    @classmethod
    def _read(cls, data: Any, info: ValidationInfo) -> Any:
        if not (isinstance(data, dict) and isinstance(data.get("file"), str)):
            return data
        refuse_both(data, "radii", "passing")
        radius, passing = Column({"radius": 1.0, "diameter": 0.5}, RADIUS_BOUNDS), Column({"passing": 1.0}, FRACTION_BOUNDS)
        columns = read_columns(data["file"], info, radius, passing)
        return {**data, "file": None, "radii": columns[0], "passing": columns[1]}

    @field_validator("radii")
    @classmethod
    def _ascending(cls, radii: tuple[float, ...]) -> tuple[float, ...]:
        require_ascending(radii, "radii")
        if radii and radii[-1] > MAX_SIZE_RATIO * radii[0]:
            wide = f"the last radius is more than {MAX_SIZE_RATIO:g} times the first"
            raise Refused((), wide, "narrow the range; radii are in meters")
        return radii

    @model_validator(mode="after")
    def _check_passing(self) -> Self:
        if len(self.radii) < 2:
            raise Refused((), "a table of sizes needs two rows at least", "give radii and passing, or file")
        if len(self.passing) != len(self.radii):
            raise Refused(("passing",), f"{len(self.passing)} shares for {len(self.radii)} radii", "give one per radius")
        if self.passing[0] != 0.0 or self.passing[-1] != 1.0:
            ends = f"passing goes from {self.passing[0]:g} to {self.passing[-1]:g}"
            raise Refused(("passing",), ends, "begin with the radius that nothing passes, 0, and end with the one that all pass, 1")
        for k in range(1, len(self.passing)):
            if self.passing[k] < self.passing[k - 1]:
                falls = f"passing falls from {self.passing[k - 1]:g} to {self.passing[k]:g}"
                raise Refused(("passing",), falls, "give the cumulated share that is smaller than each radius")
        return self

    @property
    def smallest(self) -> float:
        """Smallest radius [m]."""
        return self.radii[0]

    @property
    def largest(self) -> float:
        """Largest radius [m]."""
        return self.radii[-1]


AnySizes = ListSizes | UniformSizes | LognormalSizes | NormalSizes | PowerSizes | TableSizes
Sizes = Annotated[AnySizes, Field(discriminator="kind")]
