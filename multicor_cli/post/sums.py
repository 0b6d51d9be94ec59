"""Sums over grains, bins and frames, of which every profile is a ratio."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.post.binning import Shares, share_discs
from multicor_cli.post.extent import Extent
from multicor_cli.post.source import FrameSource, GrainFrame
from multicor_cli.state.model import Floats

BLOCKS = 10
"""Number of blocks of consecutive rows whose scatter gives the standard error (fewer if there are fewer rows)."""

Values = Callable[[GrainFrame], Floats]
"""Values of the grains of a frame, shape ``(n,)``."""


@dataclass(frozen=True)
class Bins:
    """Horizontal bins of equal width.

    Attributes:
        extent: Where heights are measured from.
        width: Width of a bin [m].
        count: Number of bins b.
    """

    extent: Extent
    width: float
    count: int

    @property
    def centers(self) -> Floats:
        """Centers above the origin [m], shape ``(b,)``."""
        return np.asarray((np.arange(self.count) + 0.5) * self.width)

    def share(self, y: Floats, radius: Floats, origin: float) -> Shares:
        """Which grain lies in which bin with which area."""
        return share_discs(y, radius, origin, self.width, self.count)

    def total(self, shares: Shares, values: Floats) -> Floats:
        """Sum of values of the shares in each bin, shape ``(b,)``."""
        return np.asarray(np.bincount(shares.bin, weights=values, minlength=self.count), np.float64)


class Sums(NamedTuple):
    """The value of a bin is the sum of ``value`` over that of ``weight``; shape ``(rows, b)``, one row per frame or interval.

    Attributes:
        value: Numerators.
        weight: Denominators.
        area: Areas of the grains [m²].
    """

    value: Floats
    weight: Floats
    area: Floats


def sum_means(source: FrameSource, chosen: NDArray[np.int64], bins: Bins, values: Values) -> Sums:
    """For averages over grains, weighted by their area; one row per frame."""
    area, weighted = np.zeros((chosen.size, bins.count)), np.zeros((chosen.size, bins.count))
    for row, k in enumerate(chosen):
        frame = source.frames[int(k)]
        shares = bins.share(_heights(frame), source.model.grains.radius, bins.extent.origin(frame))
        area[row] = bins.total(shares, shares.area)
        weighted[row] = bins.total(shares, shares.area * values(frame)[shares.grain])
    return Sums(weighted, area, area)


def sum_shares(source: FrameSource, chosen: NDArray[np.int64], bins: Bins, values: Values) -> Sums:
    """For values per area of the plane; one row per frame."""
    sums = sum_means(source, chosen, bins, values)
    widths = np.array([plane_width(source, source.frames[int(k)]) for k in chosen])
    return sums._replace(weight=np.repeat(bins.width * widths[:, np.newaxis], bins.count, axis=1))


def sum_rates(source: FrameSource, chosen: NDArray[np.int64], bins: Bins, values: Values) -> Sums:
    """For increases per time and area of the plane; one row per interval between consecutive frames.

    What a grain has gained in the interval lies where the grain is halfway between its two positions.
    """
    times = np.asarray(source.frames.time)
    shape = (chosen.size - 1, bins.count)
    value, weight, area = np.zeros(shape), np.zeros(shape), np.zeros(shape)
    radius = source.model.grains.radius
    before = source.frames[int(chosen[0])]
    for row, (first, last) in enumerate(pairwise(chosen)):
        after = source.frames[int(last)]
        origin = 0.5 * (bins.extent.origin(before) + bins.extent.origin(after))
        shares = bins.share(0.5 * (_heights(before) + _heights(after)), radius, origin)
        gain = (values(after) - values(before)) / (np.pi * radius**2)
        value[row] = bins.total(shares, shares.area * gain[shares.grain])
        area[row] = bins.total(shares, shares.area)
        width = 0.5 * (plane_width(source, before) + plane_width(source, after))
        weight[row] = bins.width * width * float(times[last] - times[first])
        before = after
    return Sums(value, weight, area)


def plane_width(source: FrameSource, frame: GrainFrame) -> float:
    """Width of the plane that the grains fill [m]: the period, or how far they reach in x where there is none."""
    if source.model.period > 0.0:
        return source.model.period
    x, radius = np.asarray(frame.position, np.float64)[:, 0], source.model.grains.radius
    return float((x + radius).max() - (x - radius).min())


def average(sums: Sums) -> tuple[Floats, Floats]:
    """Means over the rows and their standard errors from block averages; nan where there is nothing, or only one block."""
    rows = sums.weight.shape[0]
    blocks = np.array_split(np.arange(rows), min(BLOCKS, rows))
    with np.errstate(invalid="ignore", divide="ignore"):
        value = sums.value.sum(axis=0) / sums.weight.sum(axis=0)
        means = np.array([sums.value[block].sum(axis=0) / sums.weight[block].sum(axis=0) for block in blocks])
        known = np.isfinite(means)
        number = known.sum(axis=0)
        deviation = np.where(known, means, 0.0) - np.where(known, means, 0.0).sum(axis=0) / number
        variance = (np.where(known, deviation, 0.0) ** 2).sum(axis=0) / (number - 1)
        error = np.sqrt(variance / number)
    error[number < 2] = np.nan
    return value, error


def _heights(frame: GrainFrame) -> Floats:
    return np.asarray(frame.position, np.float64)[:, 1]
