"""Position correction: overlaps that the velocity scheme leaves behind (they grow as Δt²) are projected out after each step."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from multicor_cli.kernels.contacts import Scene, pair_geometry
from multicor_cli.kernels.jit import CHUNK, kernel, parallel_kernel, prange
from multicor_cli.kernels.neighbours import place_shapes
from multicor_cli.state.model import Floats, Ints


@kernel
def _overlap(scene: Scene, i: int, j: int) -> float:
    """Overlap over the smaller radius (of the grain, against a wall shape); negative if there is a gap."""
    gap = pair_geometry(scene, i, j)[0]
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
def _push_apart(scene: Scene, i: int, j: int, target: float, inverse: Floats, wall_inverse: Floats) -> bool:
    """Move a pair apart along its normal, in proportion to the inverse masses, until its overlap is ``target`` [m].

    Returns whether a wall moved.
    """
    gap, nx, ny = pair_geometry(scene, i, j)
    count = scene.radius.size
    if j < count:
        total = inverse[i] + inverse[j]
        share = (-gap - target) / total
        scene.position[j, 0] -= share * inverse[j] * nx
        scene.position[j, 1] -= share * inverse[j] * ny
        scene.position[i, 0] += share * inverse[i] * nx
        scene.position[i, 1] += share * inverse[i] * ny
        return False
    wall = scene.wall[j - count]
    wx, wy = wall_inverse[wall, 0], wall_inverse[wall, 1]
    total = inverse[i] + wx * nx * nx + wy * ny * ny
    share = (-gap - target) / total
    scene.position[i, 0] += share * inverse[i] * nx
    scene.position[i, 1] += share * inverse[i] * ny
    scene.wall_position[wall, 0] -= share * wx * nx
    scene.wall_position[wall, 1] -= share * wy * ny
    return wx > 0.0 or wy > 0.0


@kernel
def project_flagged(
    scene: Scene,
    row: NDArray[np.int64],
    partner: Ints,
    gap: Floats,
    reach: float,
    flagged: NDArray[np.bool_],
    tolerance: float,
    target: float,
    inverse: Floats,
    wall_inverse: Floats,
    local: Floats,
) -> None:
    """Push apart, in key order, the pairs of flagged grains that overlap by more than ``tolerance``.

    Args:
        scene: Shapes at q⁺. **Grain positions, wall frames and wall shapes modified.**
        row: Rows of the neighbour list.
        partner: Partners.
        gap: Gaps at q_m [m].
        reach: As in `measure_overlaps` [m].
        flagged: Grains whose rows are looked at.
        tolerance: Allowed overlap over the smaller radius.
        target: Overlap to leave, over the smaller radius.
        inverse: 1/m of the grains, shape ``(n,)``.
        wall_inverse: 1/M of the walls in x, y, rotation; 0 where not driven by a force, shape ``(w, 3)``.
        local: Wall shapes in the frames of the walls, shape ``(m, 4)``.
    """
    count = scene.radius.size
    for i in range(row.size - 1):
        if not flagged[i]:
            continue
        for p in range(row[i], row[i + 1]):
            if gap[p] >= reach:
                continue
            j = partner[p]
            if _overlap(scene, i, j) > tolerance:
                smaller = min(scene.radius[i], scene.radius[j]) if j < count else scene.radius[i]
                if _push_apart(scene, i, j, target * smaller, inverse, wall_inverse):
                    place_shapes(scene.kind, scene.wall, local, scene.wall_position, scene.world)
