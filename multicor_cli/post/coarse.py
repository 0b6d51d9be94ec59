"""Coarse graining: smooth fields of what grains and contacts carry, at any points of the plane.

A quantity A of the grains has the density Σ A_i φ(x − x_i), with a kernel φ whose integral is 1;
what contacts carry is spread along their branches. Mass, momentum and stress made so obey the
balances of continua exactly (Goldhirsch, Granular Matter 12, 239, 2010).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats
from multicor_cli.post import kernel
from multicor_cli.post.lattice import Lattice

_AT_ONCE = 8192  # pairs of a point and a source that stay in the cache
_POINTS = 2048  # whose sources are looked for together
_SQUARES = 6  # in which sources are sorted, per reach
_MOST_SQUARES = 1000  # along x and along y, however short the kernel is
_NONE = slice(0)


class _Near(NamedTuple):
    """Some points ``(p,)``, and the sources near them, point after point ``(k,)``.

    Attributes:
        point: Numbers of the points, each of which has a source, shape ``(p,)``.
        first: Number of the first source of each, shape ``(p,)``.
        source: Numbers of the sources in the order of the squares, shape ``(k,)``.
        away: From the source to the point [m], shape ``(2, k)``.
    """

    point: NDArray[np.int64]
    first: NDArray[np.int64]
    source: NDArray[np.int64]
    away: Floats

    def add(self, total: Floats, weight: Floats, values: Floats) -> None:
        """Add values ``(q, n)`` of the sources to ``total`` ``(q, m)``, each with its weight."""
        for sums, value in zip(total, values, strict=True):
            sums[self.point] += np.add.reduceat(weight * value[self.source], self.first)


class _Squares:
    """Sources sorted into squares, row by row; those that are far from all points are left out.

    Attributes:
        order: Numbers of the sources in this order.
    """

    def __init__(self, points: Floats, at: Floats, reach: float) -> None:
        """Sources ``at`` some places [m] that count up to a distance above 0 [m] from points."""
        most = float(np.ptp(points, axis=0).max()) / _MOST_SQUARES
        self._width = width = max(reach / _SQUARES, most)
        self._reach, self._rim = reach / width, int(np.ceil(reach / width))
        low = points.min(axis=0) - (self._rim + 1) * width
        self._points, self._low = points, low
        self._size = ((points.max(axis=0) - low) / width).astype(np.int64) + self._rim + 2
        square = np.floor((at - low) / width).astype(np.int64)
        near = np.flatnonzero(((square >= 0) & (square < self._size)).all(axis=1))
        key = square[near, 1] * self._size[0] + square[near, 0]
        self.order = near[np.argsort(key, kind="stable")]
        self._at = at[self.order].T.copy()
        self._before = np.append(0, np.cumsum(np.bincount(key, minlength=self._size.prod())))

    def near(self) -> Iterator[_Near]:
        """All sources within reach of the points, and some beyond, for some points at a time.

        Of each row near a point those squares count that the circle about the point reaches there.
        """
        rows, count = np.arange(-self._rim, self._rim + 1), len(self._points)
        for begin in range(0, count, _POINTS):
            block = np.arange(begin, min(begin + _POINTS, count))
            x, y = ((self._points[block] - self._low) / self._width).T[:, :, np.newaxis]
            row = np.floor(y) + rows
            beside = np.maximum(np.maximum(row - y, y - row - 1.0), 0.0)
            chord = np.sqrt(np.maximum(self._reach**2 - beside**2, 0.0))
            left = row.astype(np.int64) * self._size[0]
            first = self._before[left + (x - chord).astype(np.int64)]
            number = self._before[left + (x + chord).astype(np.int64) + 1] - first
            own = number.sum(axis=1)
            known = np.flatnonzero(own)
            ends = np.cumsum(own[known])
            cuts = np.searchsorted(ends, np.arange(_AT_ONCE, ends[-1:].sum(), _AT_ONCE))
            for part in np.split(known, cuts):
                if part.size:
                    yield self._pairs(block[part], own[part], first[part], number[part])

    def _pairs(
        self,
        point: NDArray[np.int64],
        own: NDArray[np.int64],
        first: NDArray[np.int64],
        number: NDArray[np.int64],
    ) -> _Near:
        """Points with ``own`` sources: in each row ``number``, from ``first`` on, ``(p, rows)``."""
        n = number.ravel()
        source = np.repeat(first.ravel() - (np.cumsum(n) - n), n)
        source += np.arange(source.size)
        away = np.repeat(self._points[point].T, own, axis=1)
        for way, at in zip(away, self._at, strict=True):
            way -= at[source]
        return _Near(point, np.cumsum(own) - own, source, away)


class CoarseGrid:
    """Points at which densities are wanted, and how far the kernel reaches."""

    def __init__(self, points: Floats, reach: float, lattice: Lattice | None = None) -> None:
        """The ``reach`` c is at most the span of the lattice [m]."""
        self.reach, self.lattice = reach, lattice or Lattice()
        self.points = self.lattice.wrapped(points)

    def of_grains(
        self, position: Floats, values: Floats, sloped: slice = _NONE
    ) -> tuple[Floats, Floats]:
        """Densities of what sources carry, ``(m, q)``, and gradients of some, ``(m, s, 2)``.

        Args:
            position: Of the sources [m], shape ``(n, 2)``.
            values: What they carry, shape ``(n, q)``.
            sloped: Which s of the q gradients are wanted [per m³]; densities are per m².
        """
        at, which = self._images(position, self.reach)
        squares = _Squares(self.points, at, self.reach)
        carried = values[which[squares.order]].T.copy()
        density = np.zeros((len(carried), len(self.points)))
        gradient = np.zeros((2, *density[sloped].shape))
        for near in squares.near():
            away = near.away / self.reach
            depth = kernel.depth((away**2).sum(axis=0))
            near.add(density, kernel.value(depth), carried)
            slope = kernel.slope(depth)
            for total, way in zip(gradient, away, strict=True):
                near.add(total, slope * way, carried[sloped])
        height = kernel.height(self.reach)
        return height * density.T, height / self.reach * gradient.T

    def densities_along(self, start: Floats, branch: Floats, values: Floats) -> Floats:
        """Densities ``(m, q)`` [per m²] of what is spread evenly along branches, ``(b, q)``."""
        half = 0.5 * branch
        reach = self.reach + float(np.hypot(*half.T).max(initial=0.0))
        at, which = self._images(start + half, reach)
        squares = _Squares(self.points, at, reach)
        which = which[squares.order]
        total, carried = np.zeros((values.shape[1], len(self.points))), values[which].T.copy()
        ahead, length = kernel.directions(half[which] / self.reach)
        c, s = ahead.T.copy()
        for near in squares.near():
            (x, y), cos, sin = near.away / self.reach, c[near.source], s[near.source]
            mean = kernel.mean_along(x * cos + y * sin, y * cos - x * sin, length[near.source])
            near.add(total, mean, carried)
        return kernel.height(self.reach) * total.T

    def _images(self, position: Floats, reach: float) -> tuple[Floats, NDArray[np.int64]]:
        """Positions of sources, of those images of them that reach inside; which these are."""
        position = self.lattice.wrapped(position)
        which, shift = self.lattice.images(position, np.full(len(position), reach))
        return position[which] + shift, which
