"""Cell grids for discs of any mixture of sizes: one grid for each class of radii, with no more cells than a few per disc."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from multicor_cli.model.columns import X
from multicor_cli.model.model import Floats, Ints


class SizeClasses(NamedTuple):
    """Classes of radii, each a factor of two wide.

    Attributes:
        level: Class of each disc, shape ``(d,)``.
        radius: Largest radius of each class [m], shape ``(levels,)``.
    """

    level: Ints
    radius: Floats


class Grids(NamedTuple):
    """Cell grids, one for each class of radii.

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


def classify(radius: Floats) -> SizeClasses:
    """Classes of the radii [m]; only those that occur count."""
    exponent = np.frexp(radius / (radius.min() * (1.0 - 1e-9)))[1]
    _, level = np.unique(exponent, return_inverse=True)
    largest = np.array([radius[level == k].max() for k in range(level.max() + 1)])
    return SizeClasses(level.astype(np.int32), largest)


def make_grids(classes: SizeClasses, low: Floats, high: Floats, period: float, cutoff: float) -> Grids:
    """Grids for discs with centers between the corners ``low`` and ``high``; cells grow where these are far apart.

    Args:
        classes: Classes of the discs.
        low: Lower left corner [m], shape ``(2,)``.
        high: Upper right corner [m], shape ``(2,)``.
        period: Period in x [m] or 0; with one the grids span 0 to it exactly.
        cutoff: Gap up to which pairs will be looked for [m].
    """
    cutoff = max(cutoff, 0.0)
    origin, size = np.array(low, np.float64), np.maximum(high - low, 2.0 * classes.radius.max() + cutoff)
    if period > 0.0:
        origin[X], size[X] = 0.0, period
    cells, shape = np.empty((classes.radius.size, 2)), np.empty((classes.radius.size, 2), np.int32)
    for k, radius in enumerate(classes.radius):
        width = 2.0 * radius + cutoff
        allowed = cells_for(int(np.count_nonzero(classes.level == k)))
        while cell_count(size, width) > allowed:
            width *= 1.5
        shape[k] = np.maximum(1, np.floor(size / width))
        cells[k] = size / shape[k]
    start = np.concatenate([[0], np.cumsum(shape.prod(axis=1))]).astype(np.int32)
    return Grids(classes.level, cells, classes.radius, origin, start, shape)


def cells_for(discs: int) -> int:
    """Most cells of a grid."""
    return 64 + 4 * discs


def cell_count(size: Floats, width: float) -> float:
    """About how many cells of this width [m] cover a rectangle of this size [m]."""
    across, up = (np.floor(size / width) + 1.0).tolist()
    return float(across * up)
