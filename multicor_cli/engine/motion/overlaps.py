"""Overlaps that the velocity scheme leaves behind at the end of a step (they grow as Δt²)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.geometry.scene import Scene, pair_geometry
from multicor_cli.engine.jit.chunks import CHUNK
from multicor_cli.engine.jit.compile import parallel_kernel, prange
from multicor_cli.model.model import Floats, Ints


@parallel_kernel
def measure_overlaps(
    scene: Scene,
    row: NDArray[np.int64],
    partner: Ints,
    gap: Floats,
    reach: float,
    tolerance: float,
    gap_after: Floats,
    flagged: NDArray[np.bool_],
    found: Floats,
) -> None:
    """Overlaps at the end of a step among the pairs whose gap at mid-step was below ``reach``.

    Args:
        scene: Shapes at q⁺.
        row: Rows of the neighbor list, shape ``(n + 1,)``.
        partner: Partners.
        gap: Gaps at q_m [m].
        reach: Pairs farther apart at q_m cannot overlap now [m].
        tolerance: Allowed overlap over the smaller radius.
        gap_after: Gaps at q⁺ [m], infinite for pairs that are farther apart at q_m, shape ``(pairs,)``. **Modified.**
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
                gap_after[p] = np.inf
                if gap[p] < reach:
                    j = partner[p]
                    gap_after[p] = pair_geometry(scene, i, j)[0]
                    if gap_after[p] < 0.0:
                        smaller = min(scene.radius[i], scene.radius[j]) if j < count else scene.radius[i]
                        overlap = -gap_after[p] / smaller
                        best = max(best, overlap)
                        if overlap > tolerance:
                            flagged[i] = True
            if flagged[i]:
                flags += 1.0
        found[chunk, 0], found[chunk, 1] = best, flags
