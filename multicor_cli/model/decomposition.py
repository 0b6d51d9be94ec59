"""Convex pieces of polygons that are not convex or have holes.

Holes are joined to the outline by cuts of no width. Diagonals from the sharpest inward corner that
is left then part the polygon until no corner turns inward: each piece has corners of the polygon
alone, and there are hardly more pieces than inward corners. A diagonal is taken that straightens
its corner, best both of its corners, and of those the shortest.

Source: that such diagonals exist follows from the existence of triangulations (Meisters, Am. Math.
Monthly 82, 648, 1975); cuts to holes from their rightmost corners as in D. Eberly, *Triangulation
by Ear Clipping* (2002).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.outlines import Floats
from multicor_cli.model.shapes import are_apart, cross, dot

STRAIGHT = 1e-9
"""Sine of the largest turn of an outline that is no corner."""


def turns(ring: Floats) -> Floats:
    """Sine of the turn to the left at each corner of a ring, shape ``(n,)``."""
    return _sine(ring - np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0) - ring)


def without_idle(ring: Floats) -> Floats:
    """A ring without corners given twice in a row, its end too, and those on straight sides."""
    ring = ring[(ring != np.roll(ring, -1, axis=0)).any(axis=1)]
    ahead = dot(ring - np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0) - ring) > 0.0
    return ring[~ahead | (np.abs(turns(ring)) > STRAIGHT)]


def convex_pieces(rings: Sequence[Floats]) -> list[Floats] | None:
    """Convex polygons, counter-clockwise, which make up what an outline leaves of its holes.

    Args:
        rings: Corners ``(n, 2)`` of the outline, counter-clockwise, and of the holes, clockwise;
            no two sides have more in common than a corner that they share.

    Returns:
        Corners of each; None if corners are so close to each other that no cut is found.
    """
    ring, *holes = rings
    holes.sort(key=lambda hole: float(hole[:, 0].max()), reverse=True)
    while holes:
        joined = _joined(ring, holes)
        if joined is None:
            return None
        ring, holes = joined, holes[1:]
    left, found = [ring], []
    while left:
        ring = left.pop()
        turn = turns(ring)
        k = int(np.argmin(turn))
        if turn[k] >= -STRAIGHT:
            found.append(ring[turn > STRAIGHT])
            continue
        ring, turn = np.roll(ring, -k, axis=0), np.roll(turn, -k)
        m = _best_diagonal(ring, turn)
        if m is None:
            return None
        left += [np.concatenate([ring[m:], ring[:1]]), ring[: m + 1]]
    return found


def _joined(ring: Floats, holes: list[Floats]) -> Floats | None:
    """The ring with the first of the holes, which reaches farthest to the right."""
    hole = np.roll(holes[0], -int(np.argmax(holes[0][:, 0])), axis=0)
    rings = [hole, ring, *holes[1:]]
    before, after = (np.concatenate([np.roll(r, by, axis=0) for r in rings]) for by in (1, -1))
    corner = np.concatenate(rings)
    seen = _seen_from_first(corner, before, after)[len(hole) : len(hole) + len(ring)]
    if not seen.any():
        return None
    away = ring - hole[0]
    k = int(np.argmin(np.where(seen, dot(away, away), np.inf)))
    return np.concatenate([ring[: k + 1], hole, hole[:1], ring[k:]])


def _best_diagonal(ring: Floats, turn: Floats) -> int | None:
    """Where the diagonal from the first corner of a ring ends, which turns inward."""
    before, after = np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0)
    seen = np.flatnonzero(_seen_from_first(ring, before, after))
    if not seen.size:
        return None
    way = ring[seen] - ring[0]
    gain = _straightens(before[0] - ring[0], after[0] - ring[0], way).astype(int)
    of_end = _straightens((before - ring)[seen], (after - ring)[seen], -way)
    gain += of_end & (turn[seen] < -STRAIGHT)
    return int(seen[np.lexsort((dot(way, way), -gain))[0]])


def _straightens(to_before: Floats, to_after: Floats, way: Floats) -> NDArray[np.bool_]:
    """Whether a cut along ``way`` leaves no turn inward at a corner with these two sides."""
    return (_sine(to_after, way) >= -STRAIGHT) & (_sine(way, to_before) >= -STRAIGHT)


def _seen_from_first(corner: Floats, before: Floats, after: Floats) -> NDArray[np.bool_]:
    """To which corners of rings a diagonal leads from the first one, inside of the polygon.

    ``before`` and ``after`` are the neighbors of each corner, all of shape ``(n, 2)``.
    """
    way = corner - corner[0]
    found = _is_within(before[0] - corner[0], after[0] - corner[0], way)
    found &= _is_within(before - corner, after - corner, -way)
    for k in np.flatnonzero(found):
        found[k] = _is_clear(corner[0], corner[k], corner, after)
    return found


def _is_within(to_before: Floats, to_after: Floats, way: Floats) -> NDArray[np.bool_]:
    """Whether ways begin between the two sides of a corner, on the left of the ring."""
    past, short = _sine(to_after, way) > STRAIGHT, _sine(way, to_before) > STRAIGHT
    return np.where(cross(to_after, to_before) >= 0.0, past & short, past | short)


def _is_clear(start: Floats, end: Floats, corner: Floats, after: Floats) -> bool:
    """Whether a diagonal meets no side and no corner but those at its ends."""
    at_end = (corner == start).all(axis=1) | (corner == end).all(axis=1)
    of_end = at_end | (after == start).all(axis=1) | (after == end).all(axis=1)
    if not (of_end | are_apart(start, end, corner, after)).all():
        return False
    way, square = corner - start, dot(end - start, end - start)
    along, off = dot(end - start, way), np.abs(cross(end - start, way))
    near = (along > 0.0) & (along < square) & (off <= STRAIGHT * square)
    return not bool((near & ~at_end).any())


def _sine(a: Floats, b: Floats) -> Floats:
    """Sine of the angle from a to b; 0 where one of them has no length."""
    lengths = np.sqrt(dot(a, a) * dot(b, b))
    return np.asarray(cross(a, b) / np.where(lengths > 0.0, lengths, 1.0))
