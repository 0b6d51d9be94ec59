"""Distributions of the radii of grains; each knows its ``smallest`` and ``largest`` radius [m]."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import Annotated, Literal

from pydantic import Field, ValidationInfo, field_validator

from multicor_cli.scenario.base import (
    FRACTION_BOUNDS,
    RADIUS_BOUNDS,
    Array,
    Column,
    Fraction,
    Radius,
    Table,
    ascending,
    columns_of_file,
    optional,
    required,
)
from multicor_cli.scenario.problems import Refused

MAX_SIZE_RATIO = 1000.0


class _Sizes(Table):
    by: Literal["number", "mass"] = optional(
        'whether the distribution is one of the number or of the mass of grains: "number" or '
        '"mass"',
        "number",
    )


class ListSizes(_Sizes):
    """A list of radii, each with its fraction."""

    kind: Literal["list"]
    radii: Array[Radius] = required("radii [m]", min_length=1, max_length=1000)
    fractions: Array[Fraction] | None = optional(
        "fraction of each radius, adding up to 1; default: equal fractions", max_length=1000
    )

    def faults(self) -> Iterator[Refused]:
        if self.fractions is None:
            return
        if len(self.fractions) != len(self.radii):
            what = f"{len(self.fractions)} fractions for {len(self.radii)} radii"
            yield Refused(("fractions",), what, "give one per radius")
        total = math.fsum(self.fractions)
        if abs(total - 1.0) > 1e-6:
            what = f"the fractions add up to {total:g}"
            yield Refused(("fractions",), what, "make them add up to 1")

    @property
    def smallest(self) -> float:
        return min(self.radii)

    @property
    def largest(self) -> float:
        return max(self.radii)


class _Range(_Sizes):
    min: Radius = required("smallest radius [m]")
    max: Radius = required("largest radius [m]")

    @field_validator("max")
    @classmethod
    def _above_min(cls, largest: float, info: ValidationInfo) -> float:
        smallest = info.data.get("min", largest)
        if largest < smallest:
            raise Refused((), f"max = {largest:g} is below min = {smallest:g}", "swap the two")
        if largest > MAX_SIZE_RATIO * smallest:
            what = f"max = {largest:g} is more than {MAX_SIZE_RATIO:g} times min = {smallest:g}"
            raise Refused((), what, "narrow the range; radii are in meters")
        return largest

    @property
    def smallest(self) -> float:
        return self.min

    @property
    def largest(self) -> float:
        return self.max


def _between(middle: float, info: ValidationInfo) -> float:
    low, high = info.data.get("min", middle), info.data.get("max", middle)
    if not low <= middle <= high:
        what = f"the {info.field_name} {middle:g} is outside min = {low:g} to max = {high:g}"
        raise Refused((), what, "put it between the two")
    return middle


class UniformSizes(_Range):
    """All radii between ``min`` and ``max`` are equally likely."""

    kind: Literal["uniform"]


class LognormalSizes(_Range):
    """The logarithm of the radius is normally distributed; cut at ``min`` and ``max``."""

    kind: Literal["lognormal"]
    median: Radius = required("median radius before the cut [m], between min and max")
    sigma: float = required("standard deviation of the logarithm of the radius", ge=1e-6, le=3.0)

    _inside = field_validator("median")(_between)


class NormalSizes(_Range):
    """The radius is normally distributed; cut at ``min`` and ``max``."""

    kind: Literal["normal"]
    mean: Radius = required("mean radius before the cut [m], between min and max")
    sigma: float = required("standard deviation of the radius before the cut [m]", ge=1e-12, le=1e4)

    _inside = field_validator("mean")(_between)


class PowerSizes(_Range):
    """Probability density proportional to radius to the power ``-exponent`` between ``min`` and
    ``max``.
    """

    kind: Literal["power"]
    exponent: float = required("exponent p of the density r^-p", ge=-20.0, le=20.0)


class TableSizes(Table):
    """What passes at each radius, as a sieve curve: the density is constant between two rows."""

    kind: Literal["table"]
    by: Literal["number", "mass"] = optional(
        "whether passing is a share of the mass (a sieve curve) or of the number of grains: "
        '"mass" or "number"',
        "mass",
    )
    file: str | None = optional(
        "CSV file with the columns radius or diameter [m], and passing, in place of the two arrays"
    )
    radii: Array[Radius] = optional("radii [m], ascending", (), max_length=100_000)
    passing: Array[Fraction] = optional(
        "share of the grains that is smaller than each of the radii, from 0 to 1",
        (),
        max_length=100_000,
    )

    _read = columns_of_file(
        radii=Column({"radius": 1.0, "diameter": 0.5}, RADIUS_BOUNDS),
        passing=Column({"passing": 1.0}, FRACTION_BOUNDS),
    )

    @field_validator("radii")
    @classmethod
    def _ascending(cls, radii: tuple[float, ...]) -> tuple[float, ...]:
        ascending("radii")(radii)
        if radii and radii[-1] > MAX_SIZE_RATIO * radii[0]:
            wide = f"the last radius is more than {MAX_SIZE_RATIO:g} times the first"
            raise Refused((), wide, "narrow the range; radii are in meters")
        return radii

    def faults(self) -> Iterator[Refused]:
        radii, passing = self.radii, self.passing
        if len(radii) < 2:
            what = "a table of sizes needs two rows at least"
            yield Refused((), what, "give radii and passing, or file")
        if len(passing) != len(radii):
            what = f"{len(passing)} shares for {len(radii)} radii"
            yield Refused(("passing",), what, "give one per radius")
        if passing[0] != 0.0 or passing[-1] != 1.0:
            remedy = (
                "begin with the radius that nothing passes, 0, and end with the one that all "
                "pass, 1"
            )
            what = f"passing goes from {passing[0]:g} to {passing[-1]:g}"
            yield Refused(("passing",), what, remedy)
        for before, after in pairwise(passing):
            if after < before:
                what = f"passing falls from {before:g} to {after:g}"
                remedy = "give the cumulated share that is smaller than each radius"
                yield Refused(("passing",), what, remedy)

    @property
    def smallest(self) -> float:
        return self.radii[0]

    @property
    def largest(self) -> float:
        return self.radii[-1]


Sizes = Annotated[
    ListSizes | UniformSizes | LognormalSizes | NormalSizes | PowerSizes | TableSizes,
    Field(discriminator="kind"),
]
