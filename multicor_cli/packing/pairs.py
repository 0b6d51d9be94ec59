"""Pairs of grains, and of grains and obstacles, that are close: the engine's neighbor list on an initial configuration."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.geometry.neighbors import bin_discs, list_pairs
from multicor_cli.model.model import Floats, Ints
from multicor_cli.packing.obstacles import Obstacles

MAX_LEVELS = 10


class DiscPairs(NamedTuple):
    """Partners of each grain: ``partner[row[i]:row[i+1]]``; below n a grain with a higher number, else obstacle − n.

    Attributes:
        row: Start of each grain's partners, shape ``(n + 1,)``.
        partner: The partners, ascending within a row.
    """

    row: NDArray[np.int64]
    partner: Ints


class Grids(NamedTuple):
    """Cell grids, one for each class of radii (factor two).

    Attributes:
        level: Grid of each disc, shape ``(d,)``.
        cells: Width and height of the cells of each level [m], shape ``(levels, 2)``.
        radius: Largest radius of each level [m], shape ``(levels,)``.
        origin: Lower left corner [m], shape ``(2,)``.
        start: Number of the first cell of each level, shape ``(levels + 1,)``.
        shape: Cells in x and y of each level, shape ``(levels, 2)``.
    """

    level: Ints
    cells: Floats
    radius: Floats
    origin: Floats
    start: Ints
    shape: Ints


def size_class(radius: Floats) -> Ints:
    """Class of each radius: k if the largest one is 2^k to 2^(k+1) times as large."""
    return np.frexp(float(radius.max()) / radius)[1] - np.int32(1)


def make_grids(radius: Floats, low: Floats, high: Floats, period: float, margin: float) -> Grids:
    """Grids for discs of these radii with centers between the corners ``low`` and ``high`` [m].

    The number of cells is bounded by a few times the number of discs, however large the rectangle is.

    Args:
        radius: Radii of all discs [m].
        low: Lower left corner [m], shape ``(2,)``.
        high: Upper right corner [m], shape ``(2,)``.
        period: Period in x [m]; then the grids begin at ``low[0]`` and span it exactly.
        margin: Gap up to which pairs will be looked for [m].
    """
    largest = float(radius.max())
    level = np.minimum(size_class(radius), MAX_LEVELS - 1)
    levels = int(level.max()) + 1
    extent = np.maximum(np.asarray(high) - low, 1e-300)
    if period > 0.0:
        extent[0] = period
    reach: Floats = np.ldexp(largest, -np.arange(levels, dtype=np.int32))
    shape = np.ones((levels, 2), np.int32)
    for k in range(levels):
        discs = max(1, int(np.count_nonzero(level == k)))
        cell = max(2.0 * reach[k] + margin, math.sqrt(extent[0] * extent[1] / (2.0 * discs)), extent.max() / (4.0 * discs + 16.0))
        shape[k] = np.maximum(1, np.floor(extent / cell))
    start = np.concatenate([[0], np.cumsum(shape.prod(axis=1))]).astype(np.int32)
    return Grids(level, extent / shape, reach, np.array(low, float), start, shape)


def find_pairs(position: Floats, radius: Floats, obstacles: Obstacles, cutoff: float, period: float) -> DiscPairs:
    """All pairs with a gap below ``cutoff`` [m], which may be negative (then pairs that overlap by more).

    Args:
        position: Centers of the grains [m], wrapped if periodic, shape ``(n, 2)``.
        radius: Their radii [m], shape ``(n,)``.
        obstacles: Fixed shapes.
        cutoff: Largest gap of interest [m].
        period: Period in x [m] or 0.
    """
    discs = obstacles.discs()
    center = np.concatenate([position[:, :2], discs[:, :2]])
    if period > 0.0:
        center[:, 0] = wrap(center[:, 0], period)
    radii = np.concatenate([radius, discs[:, 2]])
    low, high = center.min(axis=0), center.max(axis=0)
    if period > 0.0:
        low[0] = 0.0
    grids = make_grids(radii, low, high, period, max(cutoff, 0.0))
    start, order = bin_discs(center, grids.level, grids.cells, grids.origin, grids.start, grids.shape)
    shape_of = (radius.size + np.flatnonzero(obstacles.is_disc)).astype(np.int32)
    others = np.flatnonzero(~obstacles.is_disc).astype(np.int32)
    row, partner = list_pairs(
        radius.size, center, radii, shape_of, others, obstacles.kind, obstacles.world, cutoff, period,
        grids.cells, grids.radius, grids.origin, grids.start, grids.shape, start, order,
    )  # fmt: skip
    return DiscPairs(np.asarray(row, np.int64), partner)


def wrap(x: Floats, period: float) -> Floats:
    """Bring x into [0, period)."""
    inside = x - period * np.floor(x / period)
    # A tiny negative x gives exactly the period.
    return np.where(inside >= period, 0.0, inside)
