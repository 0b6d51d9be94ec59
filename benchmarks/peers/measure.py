"""The same estimators for all codes: friction of the wall, solid fraction of the bulk, overlaps,
shear rate of the bulk.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from case import Floats, Frames, Ints, Layer
from scipy.spatial import cKDTree

SKIPPED = 5.0
"""Diameters at each wall that do not count as bulk."""

BLOCKS = 10
"""Blocks of neighboring frames whose means give the standard error."""


@dataclass(frozen=True)
class Estimate:
    """A mean and its standard error."""

    mean: float
    error: float


@dataclass(frozen=True)
class Accuracy:
    """What a flow was like.

    Attributes:
        friction: μ*, shear force over normal force on the upper wall.
        solid: ν, area of the grains over area of the bulk.
        inertial: Inertial number of the shear rate of the bulk.
        max_overlap: Largest overlap over the smaller radius in any frame.
        mean_overlap: Mean of that over touching pairs.
    """

    friction: Estimate
    solid: Estimate
    inertial: Estimate
    max_overlap: float
    mean_overlap: float


def measure_flow(layer: Layer, rounds: Sequence[Frames]) -> Accuracy:
    """Measure flows of one layer, begun from different states, together."""
    force = np.concatenate([frames.wall_force for frames in rounds])
    solid = np.concatenate(
        [[bulk_fraction(layer, p) for p in frames.position] for frames in rounds]
    )
    slopes = [
        bulk_rate(layer, p, v)
        for frames in rounds
        for p, v in zip(frames.position, frames.velocity, strict=True)
    ]
    overlaps = [
        overlaps_of(p, layer.all_radius, layer.period, len(layer.radius))
        for f in rounds
        for p in f.position
    ]
    touching = np.concatenate(overlaps)
    return Accuracy(
        ratio_of_blocks(-force[:, 0], force[:, 1]),
        mean_of_blocks(solid),
        mean_of_blocks(np.array(slopes) * layer.tau),
        float(touching.max(initial=0.0)),
        float(touching.mean()) if touching.size else 0.0,
    )


def mean_of_blocks(values: Floats) -> Estimate:
    """Mean, and its standard error from the means of blocks; nan where there are too few values."""
    return ratio_of_blocks(values, np.ones_like(values))


def ratio_of_blocks(above: Floats, below: Floats) -> Estimate:
    """Ratio of two sums, and its standard error from blocks; nan where there are too few values."""
    mean = float(above.sum() / below.sum())
    count = min(BLOCKS, len(above) // 2)
    if count < 2:
        return Estimate(mean, math.nan)
    parts = zip(np.array_split(above, count), np.array_split(below, count), strict=True)
    blocks = np.array([a.sum() / b.sum() for a, b in parts])
    return Estimate(mean, float(blocks.std(ddof=1) / math.sqrt(count)))


def bulk_fraction(layer: Layer, position: Floats) -> float:
    """Area of the grains over the area of the bulk."""
    low, high = _bulk(layer, position)
    return fraction_between(position[: len(layer.radius), 1], layer.radius, low, high, layer.period)


def fraction_between(y: Floats, radius: Floats, low: float, high: float, period: float) -> float:
    """Area of discs over the area between two heights [m]; discs at the edges count with the part
    inside.
    """
    inside = _area_below(high - y, radius) - _area_below(low - y, radius)
    return float(inside.sum() / (period * (high - low)))


def bulk_rate(layer: Layer, position: Floats, velocity: Floats) -> float:
    """Slope of the velocities along x of the grains in the bulk [1/s]."""
    low, high = _bulk(layer, position)
    y = position[: len(layer.radius), 1]
    inside = (y > low) & (y < high)
    return float(np.polyfit(y[inside], velocity[inside], 1)[0])


def overlaps_of(position: Floats, radius: Floats, period: float, movable: int) -> Floats:
    """Overlaps over the smaller radius of the pairs that overlap; pairs of two glued grains do not
    count.
    """
    pair, gap = near_pairs(position, radius, period, 0.0)
    counts = (pair[:, 0] < movable) | (pair[:, 1] < movable)
    smaller = np.minimum(radius[pair[:, 0]], radius[pair[:, 1]])
    overlap = -gap / smaller
    return np.asarray(overlap[counts & (overlap > 0.0)])


def near_pairs(
    position: Floats, radius: Floats, period: float, reach: float
) -> tuple[Ints, Floats]:
    """Pairs of discs whose gap is at most ``reach`` [m], in a domain periodic in x, and their gaps
    [m].
    """
    place = np.column_stack([np.mod(position[:, 0], period), position[:, 1]])
    place[place[:, 0] >= period, 0] = 0.0
    place[:, 1] -= place[:, 1].min()
    tree = cKDTree(place, boxsize=(period, 4.0 * place[:, 1].max() + 4.0 * period))
    pair = (
        tree.query_pairs(2.0 * float(radius.max()) + reach, output_type="ndarray")
        .astype(np.int64)
        .reshape(-1, 2)
    )
    delta = place[pair[:, 0]] - place[pair[:, 1]]
    delta[:, 0] -= period * np.rint(delta[:, 0] / period)
    gap = np.hypot(delta[:, 0], delta[:, 1]) - radius[pair[:, 0]] - radius[pair[:, 1]]
    near = gap <= reach
    return pair[near], gap[near]


def _bulk(layer: Layer, position: Floats) -> tuple[float, float]:
    """Lower and upper edge of what counts as bulk [m]."""
    n, k = len(layer.radius), len(layer.bottom.radius)
    skipped = SKIPPED * 2.0 * float(layer.radius.mean())
    return float(position[n : n + k, 1].mean()) + skipped, float(
        position[n + k :, 1].mean()
    ) - skipped


def _area_below(level: Floats, radius: Floats) -> Floats:
    """Area of discs below a level that is ``level`` above their centers [m²]."""
    h = np.clip(level / radius, -1.0, 1.0)
    return np.asarray(radius**2 * (0.5 * math.pi + np.arcsin(h) + h * np.sqrt(1.0 - h * h)))
