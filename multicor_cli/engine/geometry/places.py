"""Places: what a grain meets of the walls in one direction, of however many pieces it is made.

A grain that lies on a joint of two walls, on the corner of a tile or in the corner of a polygon
that stands for a circle has several contacts, but it touches in one place: there is one spot, one
film of gas, one view of the wall, one force of adhesion. A concave corner of a hopper or a box is
two places.

Let P and Q be the nearest points of two wall shapes, P not farther than Q from the center of the
grain, at the distance r_P in the direction −n_P. Q is of the place of P if it lies on the tangent
plane at P or below it, or above it by no more than a small part of the distance:

``(Q − P)·n_P = r_P − r_Q n_P·n_Q ≤ (1 − cos δ₀) r_P``

The rest of a flat floor lies in the tangent plane; what is behind a wall or around a convex corner
lies below. Two sides that a grain touches at once are one place if they meet at an angle below δ₀.
The points of contact are then less than 0.3 a apart, and at least half of what the film of gas
around a point conducts passes within this distance of it (with `gas.CORE` at its largest): the two
films are one for the greater part, and such a corner is that of a curve cut into pieces. Polygons
of 21 sides or more are round. (Derived. What is covered by a piece that another covers is of the
place of that: a place has one nearest point.)

Grains and discs are bodies of their own: each is a place.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.geometry.scene import Scene, known_geometry
from multicor_cli.engine.jit.compile import kernel
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.model.columns import X, Y
from multicor_cli.model.model import Floats, Ints
from multicor_cli.model.shapes import ShapeKind

_DISC = int(ShapeKind.DISC)

RISE = 0.5 * 0.3**2
"""``1 − cos δ₀``, δ₀ = 17.3°, the angle at which points of contact are 0.3 radii apart."""

EQUAL = 1e-9
"""Difference of two distances, over them, that rounded positions do not tell from none."""


@formula
def _is_piece(scene: Scene, j: int) -> bool:
    """Whether a shape is a piece of a wall, which may have a place in common with others."""
    return j >= scene.radius.size and scene.kind[j - scene.radius.size] != _DISC


@formula
def is_covered(near: float, far: float, cosine: float) -> bool:
    """Whether the farther of two points seen from a grain is of the place of the nearer."""
    return near - far * cosine <= RISE * near


@formula
def share_place(scene: Scene, i: int, j: int, k: int) -> bool:
    """Whether two shapes are one place for grain i; each with its ends."""
    if j == k:
        return True
    if not (_is_piece(scene, j) and _is_piece(scene, k)):
        return False
    gap_j, x_j, y_j = known_geometry(scene, i, j)
    gap_k, x_k, y_k = known_geometry(scene, i, k)
    return is_covered(
        scene.radius[i] + min(gap_j, gap_k),
        scene.radius[i] + max(gap_j, gap_k),
        x_j * x_k + y_j * y_k,
    )


@kernel
def find_places(scene: Scene, i: Ints, j: Ints) -> tuple[Ints, Floats]:
    """Place of each pair, and its share of what crosses the gap there.

    Grains ``i`` ascend, and ``j`` for each. Returns the pair with the nearest point of the place,
    and the share: 1 of the nearest point, divided equally where several are equally near, and 0 of
    others; both of shape ``(c,)``.
    """
    place, share = np.arange(i.size).astype(np.int32), np.ones(i.size)
    first = 0
    while first < i.size:
        last, pieces = first, 0
        while last < i.size and i[last] == i[first]:
            pieces += 1 if _is_piece(scene, j[last]) else 0
            last += 1
        if pieces > 1:
            _join(scene, i, j, first, last, place, share)
        first = last
    return place, share


@kernel
def _join(
    scene: Scene, i: Ints, j: Ints, first: int, last: int, place: Ints, share: Floats
) -> None:
    distance, normal = np.full(last - first, np.inf), np.zeros((last - first, 2))
    for c in range(first, last):
        if _is_piece(scene, j[c]):
            gap, normal[c - first, X], normal[c - first, Y] = known_geometry(scene, i[c], j[c])
            distance[c - first] = scene.radius[i[c]] + gap
    for far in range(last - first):
        best = far
        if not _is_piece(scene, j[first + far]):
            continue
        for near in range(last - first):
            if distance[near] < distance[best] or (
                distance[near] == distance[best] and near < best
            ):
                cosine = normal[near, X] * normal[far, X] + normal[near, Y] * normal[far, Y]
                if is_covered(distance[near], distance[far], cosine):
                    best = near
        place[first + far] = first + best
    for c in range(first, last):
        while place[place[c]] != place[c]:  # what is covered by a covered piece is of its place
            place[c] = place[place[c]]
    nearest = np.zeros(last - first)
    for c in range(first, last):
        head = place[c]
        share[c] = 1.0 if distance[c - first] <= (1.0 + EQUAL) * distance[head - first] else 0.0
        nearest[head - first] += share[c]
    for c in range(first, last):
        share[c] /= nearest[place[c] - first]


@kernel
def totals_of_places(place: Ints, values: Floats) -> Floats:
    """Sum of the values of all pairs of the place of each pair, shape ``(c,)``."""
    total, found = np.zeros(place.size), np.empty(place.size)
    for c in range(place.size):
        total[place[c]] += values[c]
    for c in range(place.size):
        found[c] = total[place[c]]
    return found


def rows_in_corners(scene: Scene, i: Ints, j: Ints) -> NDArray[np.int64]:
    """Pairs of grains that are near more than one piece of a wall: only they may share a place."""
    pieces = j >= scene.radius.size
    pieces[pieces] = scene.kind[j[pieces] - scene.radius.size] != _DISC
    near = np.bincount(i[pieces], minlength=scene.radius.size)
    return np.flatnonzero(pieces & (near[i] > 1))


@dataclass(frozen=True)
class Places:
    """Places of pairs: of those in ``rows`` as `find_places` has them, of every other its own."""

    rows: NDArray[np.int64]
    place: Ints

    @classmethod
    def of(cls, scene: Scene, i: Ints, j: Ints, rows: NDArray[np.int64]) -> Places:
        """Places of pairs at this moment; ``rows`` are those of `rows_in_corners`."""
        i, j = i[rows], j[rows]
        return cls(rows, find_places(scene, i, j)[0] if rows.size else i)

    def totals(self, values: Floats) -> Floats:
        """As `totals_of_places`, of all pairs."""
        if not self.rows.size:
            return values
        total = values.copy()
        total[self.rows] = totals_of_places(self.place, values[self.rows])
        return total


@kernel
def largest_of_places(place: Ints, values: Floats) -> Floats:
    """Largest of the values, or 0, of all pairs of the place of each pair, shape ``(c,)``."""
    largest, found = np.zeros(place.size), np.empty(place.size)
    for c in range(place.size):
        largest[place[c]] = max(largest[place[c]], values[c])
    for c in range(place.size):
        found[c] = largest[place[c]]
    return found


@kernel
def met_before(
    scene: Scene, row: NDArray[np.int64], known_j: Ints, i: Ints, j: Ints
) -> NDArray[np.bool_]:
    """Whether a grain has met the place of each pair before, on whatever piece of it."""
    found = np.zeros(i.size, np.bool_)
    for c in range(i.size):
        for k in range(row[i[c]], row[i[c] + 1]):
            found[c] = found[c] or share_place(scene, i[c], j[c], known_j[k])
    return found
