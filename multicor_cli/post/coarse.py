"""Coarse graining: smooth fields of what grains and contacts carry, at any points of the plane.

A quantity A of the grains has the density Σ A_i φ(x − x_i), with a kernel φ whose integral is 1; what contacts carry is spread
along their branches. Mass, momentum and stress made so obey the balances of continua exactly (Goldhirsch, Granular Matter 12, 239,
2010).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats
from multicor_cli.post.scene import images

_PAIRS = 2_000_000  # pairs of a source and a point that are looked at together
_MOST_CELLS = 1000  # along x and along y, however short the kernel is
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(6)


class _Pairs(NamedTuple):
    """Sources and points that are near: their numbers, and the vector from the one to the other [m], shape ``(k, 2)``."""

    source: NDArray[np.int64]
    point: NDArray[np.int64]
    away: Floats


class CoarseGrid:
    """Points at which densities are wanted, and the kernel.

    The kernel is that of Lucy (Astron. J. 82, 1013, 1977) in the plane, φ = 5/(π c²) (1 + 3q)(1 − q)³ with q = r/c < 1: it reaches
    to the distance c and has two continuous derivatives.
    """

    def __init__(self, points: Floats, reach: float, period: float = 0.0) -> None:
        """Sort the points into cells.

        Args:
            points: The points, x within the period [m], shape ``(m, 2)``.
            reach: Distance c to which the kernel reaches [m]; at most the period.
            period: Period in x [m]; 0 if there is none.
        """
        self.points, self.reach, self._period = points, reach, period
        self._width = max(reach, float(np.ptp(points, axis=0).max()) / _MOST_CELLS)
        cell = self._cell(points)
        self._low = cell.min(axis=0)
        self._size = cell.max(axis=0) - self._low + 1
        key = self._key(cell)
        self._order = np.argsort(key, kind="stable")
        self._first = np.searchsorted(key[self._order], np.arange(self._size.prod() + 1))

    def densities(self, position: Floats, values: Floats) -> Floats:
        """Densities of what sources at points carry.

        Args:
            position: Where they are, x within the period [m], shape ``(n, 2)``.
            values: What they carry, shape ``(n, q)``.

        Returns:
            Shape ``(m, q)``, per m².
        """
        total = np.zeros((len(self.points), values.shape[1]))
        for source, point, away in self._pairs(position):
            q = np.hypot(*away.T) / self.reach
            kernel = (5.0 / (np.pi * self.reach**2)) * (1.0 + 3.0 * q) * (1.0 - q) ** 3
            self._add(total, point, kernel[:, np.newaxis] * values[source])
        return total

    def gradients(self, position: Floats, values: Floats) -> Floats:
        """Gradients of the densities, as `densities`; shape ``(m, q, 2)``, per m³."""
        total = np.zeros((len(self.points), values.shape[1], 2))
        for source, point, away in self._pairs(position):
            slope = (-60.0 / (np.pi * self.reach**4)) * (1.0 - np.hypot(*away.T) / self.reach) ** 2
            for axis in (0, 1):
                self._add(total[:, :, axis], point, (slope * away[:, axis])[:, np.newaxis] * values[source])
        return total

    def densities_along(self, start: Floats, branch: Floats, values: Floats) -> Floats:
        """Densities of what is spread evenly along lines, by Gauss's quadrature of six points.

        Args:
            start: Where the lines start [m], shape ``(n, 2)``.
            branch: From there to where they end [m], shape ``(n, 2)``.
            values: What each carries in all, shape ``(n, q)``.
        """
        total = np.zeros((len(self.points), values.shape[1]))
        for node, weight in zip(0.5 * (1.0 + _NODES), 0.5 * _WEIGHTS, strict=True):
            at = start + node * branch
            if self._period > 0.0:
                at[:, 0] %= self._period
            total += self.densities(at, weight * values)
        return total

    @staticmethod
    def _add(total: Floats, point: NDArray[np.int64], values: Floats) -> None:
        for column in range(values.shape[1]):
            total[:, column] += np.bincount(point, values[:, column], minlength=len(total))

    def _cell(self, points: Floats) -> NDArray[np.int64]:
        return np.asarray(np.floor(points / self._width).astype(np.int64))

    def _key(self, cell: NDArray[np.int64]) -> NDArray[np.int64]:
        at = cell - self._low
        return np.asarray(at[..., 0] * self._size[1] + at[..., 1])

    def _pairs(self, position: Floats) -> Iterator[_Pairs]:
        """All pairs within reach, some at a time."""
        which, shift = images(position[:, 0], np.full(len(position), self.reach), self._period)
        at = position[which] + np.column_stack([shift, np.zeros_like(shift)])
        cell = self._cell(at)
        for across in (-1, 0, 1):
            column = cell[:, 0] + across - self._low[0]
            low, high = (np.clip(cell[:, 1] + up - self._low[1], 0, self._size[1] - 1) for up in (-1, 1))
            is_near = (column >= 0) & (column < self._size[0]) & (cell[:, 1] + 1 >= self._low[1])
            is_near &= cell[:, 1] - 1 < self._low[1] + self._size[1]
            near = np.flatnonzero(is_near)
            base = column[near] * self._size[1]
            first, last = self._first[base + low[near]], self._first[base + high[near] + 1]
            yield from self._expanded(at, which, near, first, last - first)

    def _expanded(
        self, at: Floats, which: NDArray[np.int64], near: NDArray[np.int64], first: NDArray[np.int64], count: NDArray[np.int64]
    ) -> Iterator[_Pairs]:
        """Pairs of sources ``near`` with ``count`` points each, from the number ``first`` on in the order of the cells."""
        ends = np.cumsum(count)
        begin, done = 0, 0
        while begin < near.size:
            end = max(int(np.searchsorted(ends, done + _PAIRS, side="right")), begin + 1)
            n = count[begin:end]
            source = np.repeat(near[begin:end], n)
            offset = np.arange(n.sum()) - np.repeat(np.cumsum(n) - n, n)
            point = self._order[np.repeat(first[begin:end], n) + offset]
            away = self.points[point] - at[source]
            kept = (away**2).sum(axis=1) < self.reach**2
            yield _Pairs(which[source[kept]], point[kept], away[kept])
            begin, done = end, int(ends[end - 1])
