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
from multicor_cli.post.lattice import Lattice

_AT_ONCE = 8192  # pairs of a point and a source that stay in the cache
_POINTS = 2048  # whose sources are looked for together
_SQUARES = 6  # in which sources are sorted, per reach
_MOST_SQUARES = 1000  # along x and along y, however short the kernel is
_NODES = 6  # of Gauss's quadrature along a line


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
    """Points at which densities are wanted, and the kernel.

    The kernel is that of Lucy (Astron. J. 82, 1013, 1977) in the plane, φ = 5/(π c²) (1 + 3q)(1 −
    q)³ with q = r/c < 1: it reaches to the distance c and has two continuous derivatives.
    """

    def __init__(self, points: Floats, reach: float, lattice: Lattice | None = None) -> None:
        """The ``reach`` c is at most the span of the lattice [m]."""
        self.reach, self.lattice = reach, lattice or Lattice()
        self.points = self.lattice.wrapped(points)

    def densities(self, position: Floats, values: Floats) -> Floats:
        """Densities ``(m, q)`` [per m²] of what sources between the sides carry, ``(n, q)``."""
        total = np.zeros((values.shape[1], len(self.points)))
        squares, which = self._sources(position, self.reach)
        carried = values[which].T.copy()
        for near in squares.near():
            square = (near.away**2).sum(axis=0, keepdims=True) / self.reach**2
            near.add(total, self._kernel(square, np.ones(1)), carried)
        return total.T

    def gradients(self, position: Floats, values: Floats) -> Floats:
        """Gradients of the densities, as `densities`; shape ``(m, q, 2)``, per m³."""
        total = np.zeros((2, values.shape[1], len(self.points)))
        squares, which = self._sources(position, self.reach)
        carried = values[which].T.copy()
        for near in squares.near():
            q = np.sqrt(np.minimum((near.away**2).sum(axis=0) / self.reach**2, 1.0))
            slope = (-60.0 / (np.pi * self.reach**4)) * (1.0 - q) ** 2
            for sums, way in zip(total, near.away, strict=True):
                near.add(sums, slope * way, carried)
        return total.T

    def densities_along(self, start: Floats, branch: Floats, values: Floats) -> Floats:
        """Densities of what is spread evenly along branches, by Gauss's quadrature (six points)."""
        total = np.zeros((values.shape[1], len(self.points)))
        half = 0.5 * branch
        reach = self.reach + float(np.hypot(*half.T).max(initial=0.0))
        squares, which = self._sources(start + half, reach)
        carried, half = values[which].T.copy(), half[which].T / self.reach
        length = (half**2).sum(axis=0)
        node, weight = np.polynomial.legendre.leggauss(_NODES)
        powers = np.column_stack([np.ones(_NODES), -2.0 * node, node**2])
        for near in squares.near():
            x, y = near.away / self.reach
            along = x * half[0][near.source] + y * half[1][near.source]
            square = powers @ np.stack([x**2 + y**2, along, length[near.source]])
            near.add(total, self._kernel(square, 0.5 * weight), carried)
        return total.T

    def _kernel(self, square: Floats, weight: Floats) -> Floats:
        """Sums over φ with weights ``(w,)``, of squares of q, ``(w, k)``, which are overwritten."""
        q = np.sqrt(np.clip(square, 0.0, 1.0, out=square), out=square)
        p = np.subtract(1.0, q, out=q)
        power = p * p
        p *= power
        power *= power  # (1 + 3q)(1 − q)³ = 4p³ − 3p⁴
        scale = 5.0 / (np.pi * self.reach**2)
        return np.asarray(4.0 * scale * weight @ p - 3.0 * scale * weight @ power)

    def _sources(self, position: Floats, reach: float) -> tuple[_Squares, NDArray[np.int64]]:
        """Sources and those images of them that reach inside, and which they are, in this order."""
        position = self.lattice.wrapped(position)
        which, shift = self.lattice.images(position, np.full(len(position), reach))
        squares = _Squares(self.points, position[which] + shift, reach)
        return squares, which[squares.order]
