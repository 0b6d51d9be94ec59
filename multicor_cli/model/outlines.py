"""Grains that are no discs: cores of one or more corners, widened by a radius.

A *piece* is what lies within the rounding r of its core: a corner (a disc), two (a rod), or the
corners of a convex polygon, counter-clockwise. A grain is one piece, or several that may overlap (a
clump). Corners are in the frame of the grain: from its center of mass, at angle 0.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

Piece = tuple[Floats, float]
"""Corners [m], shape ``(k, 2)``, and the rounding [m]."""


class Outlines(NamedTuple):
    """Outlines of ``n`` grains with ``p`` pieces of ``v`` corners in all.

    Attributes:
        piece: First piece of each grain, shape ``(n + 1,)``.
        start: First corner of each piece, shape ``(p + 1,)``.
        corner: Corners [m], shape ``(v, 2)``.
        rounding: Radius of the corners of each piece r [m], shape ``(p,)``.
        area: True area of each grain [m²], what pieces share once, shape ``(n,)``.
        perimeter: Length of the outline of each grain [m], likewise.
    """

    piece: Ints
    start: Ints
    corner: Floats
    rounding: Floats
    area: Floats
    perimeter: Floats

    @classmethod
    def of(cls, grains: Sequence[Sequence[Piece]], area: Floats, perimeter: Floats) -> Outlines:
        """Outlines of grains with these pieces, areas [m²] and perimeters [m]."""
        pieces = [piece for grain in grains for piece in grain]
        return cls(
            _starts([len(grain) for grain in grains]),
            _starts([len(corners) for corners, _ in pieces]),
            np.concatenate([corners for corners, _ in pieces] or [np.empty((0, 2))]),
            np.array([rounding for _, rounding in pieces], float),
            np.asarray(area, float),
            np.asarray(perimeter, float),
        )

    def pieces(self, grain: int) -> list[Piece]:
        """The pieces of a grain."""
        return [
            (self.corner[self.start[p] : self.start[p + 1]], float(self.rounding[p]))
            for p in range(self.piece[grain], self.piece[grain + 1])
        ]

    @classmethod
    def of_discs(cls, radius: Floats) -> Outlines:
        """Outlines of discs with these radii [m]."""
        each = np.arange(radius.size + 1, dtype=np.int32)
        area = math.pi * (radius * radius)
        corner = np.zeros((radius.size, 2))
        return cls(each, each, corner, radius.copy(), area, 2.0 * math.pi * radius)

    @classmethod
    def joined(cls, parts: Sequence[Outlines]) -> Outlines:
        """Those of several groups of grains, one after the other."""
        piece, start = (
            _joined([getattr(part, name) for part in parts]) for name in cls._fields[:2]
        )
        columns = zip(*(part[2:] for part in parts), strict=True)
        return cls(piece, start, *(np.concatenate(column) for column in columns))

    def of_grains(self, which: NDArray[np.int64]) -> Outlines:
        """Those of some grains, in this order."""
        pieces, of_piece = _rows(self.piece, which)
        corners, of_corner = _rows(self.start, pieces)
        return Outlines(
            of_piece, of_corner, self.corner[corners], self.rounding[pieces], self.area[which],
            self.perimeter[which],
        )  # fmt: skip

    def scaled(self, factor: Floats) -> Outlines:
        """The same shapes, each so many times as large; shape ``(n,)``."""
        of_piece = np.repeat(factor, np.diff(self.piece))
        return self._replace(
            corner=self.corner * np.repeat(of_piece, np.diff(self.start))[:, np.newaxis],
            rounding=self.rounding * of_piece,
            area=self.area * (factor * factor),
            perimeter=self.perimeter * factor,
        )

    def fit(self, count: int) -> bool:
        """Whether they are outlines of so many grains: what is read from files may not be."""
        ends = ((self.piece, self.start.size - 1), (self.start, self.corner.shape[0]))
        are_rows = all(
            rows.size > 0 and rows[0] == 0 and rows[-1] == end and bool((np.diff(rows) > 0).all())
            for rows, end in ends
        )
        sizes = (self.piece.size - 1, self.area.size, self.perimeter.size)
        are_lengths = bool((self.rounding >= 0.0).all() and (self.area > 0.0).all())
        return are_rows and are_lengths and sizes == (count, count, count)

    @property
    def is_disc(self) -> NDArray[np.bool_]:
        """Which grains are discs around their centers, shape ``(n,)``."""
        found = np.diff(self.piece) == 1
        first = self.start[self.piece[:-1]]
        found &= self.start[self.piece[:-1] + 1] == first + 1
        return np.asarray(found & (self.corner[first] == 0.0).all(axis=1))

    @property
    def radius(self) -> Floats:
        """How far each grain reaches from its center [m], shape ``(n,)``."""
        owner = np.repeat(np.arange(self.rounding.size), np.diff(self.start))
        x, y = self.corner.T
        reach = np.sqrt(x * x + y * y) + self.rounding[owner]
        grain = np.repeat(np.arange(self.piece.size - 1), np.diff(self.piece))[owner]
        radius = np.zeros(self.piece.size - 1)
        np.maximum.at(radius, grain, reach)
        return radius


def _joined(starts: Sequence[Ints]) -> Ints:
    """Where lists begin, of several tables that follow each other."""
    return _starts(np.concatenate([np.diff(start) for start in starts]))


def _starts(counts: Sequence[int] | NDArray[Any]) -> Ints:
    return np.concatenate([[0], np.cumsum(np.array(counts, np.int64))]).astype(np.int32)


def _rows(start: Ints, which: NDArray[np.int64]) -> tuple[NDArray[np.int64], Ints]:
    """Rows ``start[k]:start[k+1]`` of some k, one after the other, and where each begins then."""
    counts = np.diff(start)[which]
    begin = _starts(counts)
    return np.arange(begin[-1]) + np.repeat(start[which] - begin[:-1], counts), begin
