"""Sharing discs out among horizontal bins by exact area."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.state.model import Floats


class Shares(NamedTuple):
    """Which grain lies in which bin with which area; one row per overlap.

    Attributes:
        grain: Index of the grain, shape ``(k,)``.
        bin: Index of the bin, shape ``(k,)``.
        area: Area of the grain inside the bin [m²], shape ``(k,)``.
    """

    grain: NDArray[np.int64]
    bin: NDArray[np.int64]
    area: Floats


def area_below(height: Floats, radius: Floats) -> Floats:
    """Area of a disc below a horizontal line.

    Args:
        height: Height of the line above the center of the disc [m].
        radius: Radius of the disc [m].

    Returns:
        a²(π − arccos s + s√(1−s²)) with s = height/a cut to −1 … 1 [m²].
    """
    s = np.clip(height / radius, -1.0, 1.0)
    return np.asarray(radius * radius * (np.pi - np.arccos(s) + s * np.sqrt(1.0 - s * s)))


def share_discs(y: Floats, radius: Floats, bottom: float, width: float, count: int) -> Shares:
    """Share discs out among ``count`` bins of equal width; parts outside all bins are left out.

    Args:
        y: Heights of the centers [m], shape ``(n,)``.
        radius: Radii [m], shape ``(n,)``.
        bottom: Lower edge of the first bin [m].
        width: Width of a bin [m].
        count: Number of bins.
    """
    first = np.floor((y - radius - bottom) / width).astype(np.int64)
    last = np.floor((y + radius - bottom) / width).astype(np.int64)
    pieces = []
    for step in range(int((last - first).max(initial=-1)) + 1):
        grain = np.flatnonzero((first + step <= last) & (first + step >= 0) & (first + step < count))
        if grain.size:
            pieces.append(_overlap(grain, first[grain] + step, y, radius, bottom, width))
    if not pieces:
        none = np.zeros(0, np.int64)
        return Shares(none, none, np.zeros(0))
    return Shares(*(np.concatenate(column) for column in zip(*pieces, strict=True)))


def _overlap(grain: NDArray[np.int64], bin_: NDArray[np.int64], y: Floats, radius: Floats, bottom: float, width: float) -> Shares:
    edge = bottom + bin_ * width - y[grain]
    area = area_below(edge + width, radius[grain]) - area_below(edge, radius[grain])
    return Shares(grain, bin_, np.maximum(area, 0.0))
