"""Pairs of grains, and of grains and obstacles, that are close: the engine's neighbor list on an initial configuration."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.geometry.neighbors import classify, find_near, make_grids
from multicor_cli.engine.jit.threads import threads_for
from multicor_cli.model.columns import RADIUS, X
from multicor_cli.model.model import Floats, Ints
from multicor_cli.packing.obstacles import Obstacles


class DiscPairs(NamedTuple):
    """Partners of each grain: ``partner[row[i]:row[i+1]]``; below n a grain with a higher number, else obstacle − n.

    Attributes:
        row: Start of each grain's partners, shape ``(n + 1,)``.
        partner: The partners, ascending within a row.
    """

    row: NDArray[np.int64]
    partner: Ints


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
        center[:, X] = wrap(center[:, X], period)
    radii = np.concatenate([radius, discs[:, RADIUS]])
    grids = make_grids(classify(radii), center.min(axis=0), center.max(axis=0), period, cutoff)
    shape_of = (radius.size + np.flatnonzero(obstacles.is_disc)).astype(np.int32)
    others = np.flatnonzero(~obstacles.is_disc).astype(np.int32)
    with threads_for(radius.size):
        return DiscPairs(
            *find_near(grids, radius.size, center, radii, shape_of, others, obstacles.kind, obstacles.world, cutoff, period)
        )


def wrap(x: Floats, period: float) -> Floats:
    """Bring x into [0, period)."""
    inside = x - period * np.floor(x / period)
    # A tiny negative x gives exactly the period.
    return np.where(inside >= period, 0.0, inside)
