"""Sharing discs and lines out among horizontal bins by exact area and length."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats


class Shares(NamedTuple):
    """Which grain (or line) lies in which bin with which area (or part of its length); one row per overlap.

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
    return _join(pieces)


def _join(pieces: list[Shares]) -> Shares:
    if not pieces:
        none = np.zeros(0, np.int64)
        return Shares(none, none, np.zeros(0))
    return Shares(*(np.concatenate(column) for column in zip(*pieces, strict=True)))


def _overlap(grain: NDArray[np.int64], bin_: NDArray[np.int64], y: Floats, radius: Floats, bottom: float, width: float) -> Shares:
    edge = bottom + bin_ * width - y[grain]
    area = area_below(edge + width, radius[grain]) - area_below(edge, radius[grain])
    return Shares(grain, bin_, np.maximum(area, 0.0))


def share_lines(start: Floats, end: Floats, bottom: float, width: float, count: int) -> Shares:
    """Share straight lines out among ``count`` bins of equal width; parts outside all bins are left out.

    Args:
        start: Heights of one end [m], shape ``(n,)``.
        end: Heights of the other end [m], shape ``(n,)``.
        bottom: Lower edge of the first bin [m].
        width: Width of a bin [m].
        count: Number of bins.

    Returns:
        The shares; ``grain`` is the number of the line, ``area`` the part of its length that lies in the bin [1]. A level line
        lies in one bin.
    """
    low, high = (np.minimum(start, end) - bottom) / width, (np.maximum(start, end) - bottom) / width
    first, last = np.floor(low).astype(np.int64), np.floor(high).astype(np.int64)
    pieces = []
    for step in range(int((last - first).max(initial=-1)) + 1):
        line = np.flatnonzero((first + step <= last) & (first + step >= 0) & (first + step < count))
        if line.size:
            bin_ = first[line] + step
            length = np.minimum(high[line], bin_ + 1.0) - np.maximum(low[line], bin_)
            rise = high[line] - low[line]
            pieces.append(Shares(line, bin_, np.where(rise > 0.0, length / np.where(rise > 0.0, rise, 1.0), 1.0)))
    return _join(pieces)


def part_between(start: Floats, end: Floats, low: float, high: float) -> Floats:
    """Part of the length of straight lines that lies between two heights [1].

    Args:
        start: Heights of one end [m], shape ``(n,)``.
        end: Heights of the other end [m], shape ``(n,)``.
        low: Lower height [m].
        high: Upper height [m].

    Returns:
        0 … 1, shape ``(n,)``; a level line lies between them or not.
    """
    bottom, top = np.minimum(start, end), np.maximum(start, end)
    rise = top - bottom
    part = (np.minimum(top, high) - np.maximum(bottom, low)) / np.where(rise > 0.0, rise, 1.0)
    level = ((bottom >= low) & (bottom < high)).astype(np.float64)
    return np.asarray(np.where(rise > 0.0, np.maximum(part, 0.0), level))
