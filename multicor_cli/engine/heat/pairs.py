"""Pairs of bodies between which heat may flow: their radii, which are near, and values kept for them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.geometry.places import share_place
from multicor_cli.engine.geometry.radii import smaller_radius
from multicor_cli.engine.geometry.scene import Scene, known_geometry, pair_geometry
from multicor_cli.engine.jit.compile import kernel
from multicor_cli.model.columns import X, Y
from multicor_cli.model.model import Floats, Ints


@kernel
def near_pairs(scene: Scene, row: NDArray[np.int64], partner: Ints, reach: float) -> tuple[Ints, Ints, Floats]:
    """Pairs whose gap does not exceed ``reach`` times the smaller radius: i, j and gap [m], sorted by (i, j).

    Args:
        scene: Shapes.
        row: Rows of a neighbor list, shape ``(n + 1,)``.
        partner: Partners in the list, ascending within a row.
        reach: Largest gap over the smaller radius.
    """
    room = partner.size
    i_of, j_of, gap_of = np.empty(room, np.int32), np.empty(room, np.int32), np.empty(room)
    found = 0
    for i in range(row.size - 1):
        for p in range(row[i], row[i + 1]):
            gap = pair_geometry(scene, i, partner[p])[0]
            if gap <= reach * smaller_radius(scene, i, partner[p]):
                i_of[found], j_of[found], gap_of[found] = i, partner[p], gap
                found += 1
    return i_of[:found].copy(), j_of[:found].copy(), gap_of[:found].copy()


@kernel
def resting_contacts(scene: Scene, i: Ints, j: Ints, gap: Floats, normal: Floats) -> None:
    """Gaps [m] and normals of pairs in a state at rest, shapes ``(c,)`` and ``(c, 2)``; the last two are **modified**."""
    for k in range(i.size):
        gap[k], normal[k, X], normal[k, Y] = known_geometry(scene, i[k], j[k])


@kernel
def look_up(row: NDArray[np.int64], known_j: Ints, values: Floats, i: Ints, j: Ints, found: Floats) -> None:
    """Values of pairs in a table sorted by (i, j); 0 for pairs that are not in it.

    Args:
        row: First row of each grain in the table, shape ``(n + 1,)``.
        known_j: Second shapes in the table.
        values: Values in the table.
        i: First shapes of the pairs asked for, shape ``(c,)``.
        j: Second shapes, shape ``(c,)``.
        found: Values, shape ``(c,)``. **Modified.**
    """
    for c in range(i.size):
        found[c] = 0.0
        for k in range(row[i[c]], row[i[c] + 1]):
            if known_j[k] == j[c]:
                found[c] = values[k]


@kernel
def hand_on(scene: Scene, row: NDArray[np.int64], j: Ints, known_i: Ints, known_j: Ints, values: Floats) -> Floats:
    """Values known of some pairs, for others; what a pair had that is gone goes to another pair of its place, if there is one.

    A grain that rolls over a wall of many pieces leaves one behind and meets the next: in the same place.

    Args:
        scene: Shapes.
        row: First row of each grain among the pairs asked for, shape ``(n + 1,)``.
        j: Second shapes of the pairs asked for, shape ``(c,)``.
        known_i: First shapes of the pairs known.
        known_j: Their second shapes.
        values: Their values.

    Returns:
        Values, shape ``(c,)``; 0 where nothing is known.
    """
    found = np.zeros(j.size)
    for k in range(known_i.size):
        heir = -1
        for c in range(row[known_i[k]], row[known_i[k] + 1]):
            if j[c] == known_j[k]:
                heir = c
                break
            if heir < 0 and share_place(scene, known_i[k], j[c], known_j[k]):
                heir = c
        if heir >= 0:
            found[heir] += values[k]
    return found
