"""Pushes the grains around an overlap apart, with all others and the walls held where they are."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from multicor_cli.kernels.contacts import Scene, pair_geometry
from multicor_cli.kernels.jit import kernel, scalar
from multicor_cli.state.model import Floats, Ints


@kernel
def near_pairs(row: NDArray[np.int64], partner: Ints, gap: Floats, near: float) -> tuple[Ints, Ints]:
    """Pairs of the neighbour list with a ``gap`` up to ``near`` [m]: grains i, and grains or wall shapes j."""
    found = 0
    for p in range(partner.size):
        if gap[p] <= near:
            found += 1
    first, second = np.empty(found, np.int32), np.empty(found, np.int32)
    found = 0
    for i in range(row.size - 1):
        for p in range(row[i], row[i + 1]):
            if gap[p] <= near:
                first[found], second[found] = i, partner[p]
                found += 1
    return first, second


@kernel
def surround(i: Ints, j: Ints, rings: int, marked: NDArray[np.bool_]) -> int:
    """Mark the neighbors of the marked grains too, ring by ring.

    Args:
        i: Grain of each pair of neighbors.
        j: The other grain, or a wall shape (a number beyond those of the grains), which is never marked.
        rings: Number of rings, fewer than 100.
        marked: Shape ``(n,)``. **Modified.**

    Returns:
        Number of marked grains.
    """
    ring_of = np.full(marked.size, -1, np.int8)
    found = 0
    for k in range(marked.size):
        if marked[k]:
            ring_of[k] = 0
            found += 1
    for ring in range(rings):
        for c in range(i.size):
            a, b = i[c], j[c]
            if b < marked.size and ring_of[a] != ring_of[b]:
                if ring_of[a] == ring and ring_of[b] < 0:
                    ring_of[b] = ring + 1
                    found += 1
                elif ring_of[b] == ring and ring_of[a] < 0:
                    ring_of[a] = ring + 1
                    found += 1
    for k in range(marked.size):
        marked[k] = ring_of[k] >= 0
    return found


@kernel
def _pairs_of_marked(i: Ints, j: Ints, marked: NDArray[np.bool_]) -> tuple[Ints, Ints]:
    """The pairs with a marked grain."""
    keep = np.zeros(i.size, np.bool_)
    for c in range(i.size):
        keep[c] = marked[i[c]] or (j[c] < marked.size and marked[j[c]])
    return i[keep], j[keep]


@kernel
def _measure(scene: Scene, i: Ints, j: Ints, target: float) -> tuple[Floats, Floats]:
    """Normals of pairs, and how far each may still close [m]: its gap and ``target`` times the smaller radius."""
    normal, room = np.empty((i.size, 2)), np.empty(i.size)
    for c in range(i.size):
        gap, normal[c, 0], normal[c, 1] = pair_geometry(scene, i[c], j[c])
        smaller = scene.radius[i[c]]
        if j[c] < scene.radius.size:
            smaller = min(smaller, scene.radius[j[c]])
        room[c] = gap + target * smaller
    return normal, room


@scalar
def _push_apart(c: int, a: int, b: int, normal: Floats, room: Floats, push: Floats, mobility: Floats, shift: Floats) -> float:
    """Relax the pair of bodies a and b; returns by how much it opens or closes [m]."""
    nx, ny = normal[c, 0], normal[c, 1]
    gap = room[c] + nx * (shift[a, 0] - shift[b, 0]) + ny * (shift[a, 1] - shift[b, 1])
    give = mobility[a] + mobility[b]
    change = max(-gap / give, -push[c])
    if change != 0.0:
        push[c] += change
        shift[a, 0] += mobility[a] * change * nx
        shift[a, 1] += mobility[a] * change * ny
        shift[b, 0] -= mobility[b] * change * nx
        shift[b, 1] -= mobility[b] * change * ny
    return abs(change) * give


@kernel
def separate(
    scene: Scene, i: Ints, j: Ints, marked: NDArray[np.bool_], mass: Floats, target: float, enough: float, sweeps: int
) -> None:
    """Move the marked grains by the smallest mass-weighted displacements that leave no more than a target of overlap.

    Projected Gauss–Seidel on min ½ Σ m δq² with gap + n·δq ≥ −target for all pairs with a marked grain, linearized at the present
    positions.

    Args:
        scene: Shapes. **Positions modified.**
        i: Grain of each near pair.
        j: Grain or wall shape of each near pair.
        marked: Grains that may be moved, shape ``(n,)``.
        mass: Masses of the grains [kg], shape ``(n,)``.
        target: Overlap over the smaller radius that is left.
        enough: Largest displacement of a sweep with which it ends [m].
        sweeps: Cap on the number of sweeps.
    """
    i, j = _pairs_of_marked(i, j, marked)
    normal, room = _measure(scene, i, j, target)
    n = marked.size
    shift, mobility = np.zeros((n + 1, 2)), np.zeros(n + 1)  # the last row stands for all walls
    for k in range(n):
        if marked[k]:
            mobility[k] = 1.0 / mass[k]
    push = np.zeros(i.size)
    for _ in range(sweeps):
        largest = 0.0
        for c in range(i.size):
            largest = max(largest, _push_apart(c, i[c], min(j[c], n), normal, room, push, mobility, shift))
        if largest <= enough:
            break
    for k in range(n):
        if marked[k]:
            scene.position[k, 0] += shift[k, 0]
            scene.position[k, 1] += shift[k, 1]
