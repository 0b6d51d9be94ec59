"""Overlaps that the velocity scheme leaves behind at the end of a step (they grow as Δt²)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from multicor_cli.kernels.contacts import Scene, pair_geometry
from multicor_cli.kernels.jit import CHUNK, kernel, parallel_kernel, prange, scalar
from multicor_cli.state.model import Floats, Ints


@scalar
def _overlap(scene: Scene, i: int, j: int) -> float:
    """Overlap over the smaller radius (of the grain, against a wall shape); 0 if there is a gap."""
    gap = pair_geometry(scene, i, j)[0]
    if gap >= 0.0:
        return 0.0
    smaller = scene.radius[i]
    if j < scene.radius.size:
        smaller = min(smaller, scene.radius[j])
    return -gap / smaller


@parallel_kernel
def measure_overlaps(
    scene: Scene,
    row: NDArray[np.int64],
    partner: Ints,
    gap: Floats,
    reach: float,
    tolerance: float,
    flagged: NDArray[np.bool_],
    found: Floats,
) -> None:
    """Overlaps at the end of a step among the pairs whose gap at mid-step was below ``reach``.

    Args:
        scene: Shapes at q⁺.
        row: Rows of the neighbour list, shape ``(n + 1,)``.
        partner: Partners.
        gap: Gaps at q_m [m].
        reach: Pairs farther apart at q_m cannot overlap now [m].
        tolerance: Allowed overlap over the smaller radius.
        flagged: Whether grain i has a pair in its row that overlaps more, shape ``(n,)``. **Modified.**
        found: For each chunk of grains the largest overlap over the smaller radius (0 if there is none) and the number of flagged
            grains, shape ``(chunks, 2)``. **Modified.**
    """
    count = row.size - 1
    for chunk in prange(found.shape[0]):
        flags = 0.0
        best = 0.0
        for i in range(chunk * CHUNK, min(count, (chunk + 1) * CHUNK)):
            flagged[i] = False
            for p in range(row[i], row[i + 1]):
                if gap[p] < reach:
                    overlap = _overlap(scene, i, partner[p])
                    best = max(best, overlap)
                    if overlap > tolerance:
                        flagged[i] = True
            if flagged[i]:
                flags += 1.0
        found[chunk, 0], found[chunk, 1] = best, flags


@kernel
def surround(row: NDArray[np.int64], partner: Ints, gap: Floats, near: float, rings: int, marked: NDArray[np.bool_]) -> int:
    """Mark the neighbors of the marked grains too, ring by ring; pairs farther apart than ``near`` [m] are no neighbors.

    Args:
        row: Rows of the neighbour list, shape ``(n + 1,)``.
        partner: Partners.
        gap: Gaps [m].
        near: Largest gap between neighbors [m].
        rings: Number of rings.
        marked: Shape ``(n,)``. **Modified.**

    Returns:
        Number of marked grains.
    """
    count = row.size - 1
    ring_of = np.where(marked, 0, -1)
    for ring in range(rings):
        for i in range(count):
            for p in range(row[i], row[i + 1]):
                j = partner[p]
                if j < count and gap[p] <= near:
                    if ring_of[i] == ring and ring_of[j] < 0:
                        ring_of[j] = ring + 1
                    elif ring_of[j] == ring and ring_of[i] < 0:
                        ring_of[i] = ring + 1
    found = 0
    for i in range(count):
        marked[i] = ring_of[i] >= 0
        if marked[i]:
            found += 1
    return found


@kernel
def hide_pairs(row: NDArray[np.int64], partner: Ints, marked: NDArray[np.bool_], gap: Floats) -> None:
    """Set the gaps of all pairs without a marked grain to infinity; ``gap`` is **modified**, the others as in `surround`."""
    count = row.size - 1
    for i in range(count):
        if not marked[i]:
            for p in range(row[i], row[i + 1]):
                j = partner[p]
                if j >= count or not marked[j]:
                    gap[p] = np.inf
