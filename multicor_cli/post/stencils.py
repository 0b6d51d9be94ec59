"""Coarse graining at the points of a regular grid, of many sources: what each gives to which.

What a source gives to the points around it depends on where it lies in its cell of the grid, and on
its branch. Sources that are alike in both are of a kind: they reach the same points about their
cells, and what a branch gives there is a polynomial of both, fitted once to the closed form. A
sparse matrix adds up what they carry.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats
from multicor_cli.optional import library
from multicor_cli.post import kernel

_PARTS = 16  # of a reach, at least, along x and y: sources in one are alike
_BRANCHES = 16  # of a reach along x and y: half branches that end in one are alike
_DEGREE = 4  # of the polynomials
_SAMPLES = 240  # that each is fitted to
_LEAST = 1e-7  # weight that counts, of the height of the kernel
_WORTH = 200  # sources of a kind that pay for its polynomials
_FARTHEST = 64  # steps that a reach may have
_ACROSS = 2 * _BRANCHES + 1
_SQUARES = _ACROSS * (_BRANCHES + 1)
_WIDE = np.sqrt(0.5) / _BRANCHES  # from the middle of a square to its corners, in reaches
_MOST = 1 << 21  # pairs of a point and a source that are in memory together, or
_PER_POINT = 4  # for each point
_AT_ONCE = 1 << 14  # that stay in the cache
_ONE_THREAD = 1 << 18  # multiplications of a matrix product for which BLAS starts no threads


class Mesh(NamedTuple):
    """Points of a grid, row by row from below; slanted rows are shifted to the right.

    Attributes:
        low: The first point [m].
        step: Their distance along x and y [m].
        slant: How far rows are shifted per height.
        shape: Numbers of rows and of columns.
    """

    low: Floats
    step: Floats
    slant: float
    shape: tuple[int, ...]

    def ways(self, steps: Floats | NDArray[np.int64]) -> Floats:
        """So many steps along and across the rows in x and y [m], shape ``(…, 2)``."""
        x, y = steps[..., 0] * self.step[0], steps[..., 1] * self.step[1]
        return np.stack([x + self.slant * y, y], axis=-1)

    def steps(self, position: Floats) -> Floats:
        """How many steps positions [m] are from the first point, shape ``(n, 2)``."""
        x, y = (position - self.low).T
        return np.column_stack([(x - self.slant * y) / self.step[0], y / self.step[1]])


class _Kind(NamedTuple):
    """The points that sources of a kind reach: ``m`` of them.

    Attributes:
        steps: To them from the lower left corner of the cell, shape ``(m, 2)``.
        fit: Coefficients of the polynomials, shape ``(k, m)``; without branches there are none.
    """

    steps: NDArray[np.int64]
    fit: Floats


class _Pairs:
    """Sources, those of a kind after another, and the points that each reaches.

    Attributes:
        order: Numbers of the sources in this order; those that reach no point are left out.
        count: Number of pairs of a source and a point.
    """

    def __init__(
        self,
        mesh: Mesh,
        rim: int,
        cell: NDArray[np.int64],
        key: NDArray[np.int64],
        kind_of: Callable[[int], _Kind],
    ) -> None:
        """Sources in ``cell`` ``(n, 2)`` of kinds ``key`` reach no more than ``rim`` steps."""
        self._inner = tuple(slice(2 * rim, 2 * rim + size) for size in mesh.shape)
        self._size = np.array(mesh.shape)[::-1] + 4 * rim  # with all that they reach beyond it
        x, y = (
            (at >= -rim) & (at < size)
            for at, size in zip(cell.T, self._size - 3 * rim, strict=True)
        )
        near = np.flatnonzero(x & y)
        key = key.astype(np.min_scalar_type(int(key.max(initial=0))))  # 16 bits are sorted fastest
        self.order = near[np.argsort(key[near], kind="stable")]
        begin = np.flatnonzero(np.diff(key[self.order].astype(np.int64), prepend=-1))
        self._begin = [*begin.tolist(), self.order.size]
        self._kinds = [kind_of(number) for number in key[self.order[begin]].tolist()]
        reached = [len(kind.steps) for kind in self._kinds]
        first = np.append(0, np.cumsum(np.repeat(reached, np.diff(self._begin))))
        self._first = first.astype(np.int32)
        self.count = int(first[-1])
        across = np.array([1, self._size[0]])
        start = ((cell[self.order] + 2 * rim) @ across).astype(np.int32)
        self._point = np.empty(self.count, np.int32)
        for kind, rows, pairs in self.pieces():
            way = (kind.steps @ across).astype(np.int32)
            np.add.outer(start[rows], way, out=self._point[pairs].reshape(-1, way.size))

    def pieces(self, most: int | None = None) -> Iterator[tuple[_Kind, slice, slice]]:
        """A kind, and which of the sources and of the pairs are of it; not many pairs at a time."""
        for kind, begin, end in zip(self._kinds, self._begin, self._begin[1:], strict=False):
            size, start = len(kind.steps), int(self._first[begin])
            step = max(most // max(size, 1), 1) if most else end - begin
            for first in range(begin, end, step):
                last = min(first + step, end)
                yield kind, slice(first, last), slice(start, start + (last - first) * size)
                start += (last - first) * size

    def sums(self, weight: Floats, values: Floats) -> Floats:
        """Sums at the points ``(p, q)`` of values of all sources ``(n, q)`` times their weights."""
        shape = (self.order.size, int(self._size.prod()))
        matrix = library("scipy.sparse").csr_array((weight, self._point, self._first), shape=shape)
        total = (matrix.T @ values[self.order]).reshape(*self._size[::-1], -1)
        return np.asarray(total[self._inner].reshape(-1, values.shape[1]))


class Stencils:
    """Sums at the points of a mesh of what sources carry; see the module.

    Weights of branches are right to 2·10⁻⁵ of the height of the kernel, sums of many to 10⁻⁵ of the
    largest; those of grains, which single precision limits, to 10⁻⁶.
    """

    def __init__(self, mesh: Mesh, reach: float, uses: int) -> None:
        """The kernel reaches so far [m]; there will be so many sets of branches."""
        self._mesh, self._reach, self._uses = mesh, reach, uses
        self._parts = np.maximum(np.ceil(mesh.step * _PARTS / reach), 1.0).astype(np.int64)
        corners = self._ways(0.5 / self._parts * np.array([[1.0, 1.0], [1.0, -1.0]]))
        self._wide = float(np.hypot(*corners.T).max())  # from the middle of a part to its corners
        self._grains: dict[int, _Kind] = {}
        self._branches: dict[int, _Kind] = {}

    @staticmethod
    def suits(mesh: Mesh, reach: float) -> bool:
        """Whether sources reach some of the points, but not so many that little is alike."""
        return bool(mesh.step.max() <= reach <= _FARTHEST * mesh.step.min())

    def of_grains(self, position: Floats, values: Floats, sloped: slice) -> tuple[Floats, Floats]:
        """Densities and gradients, as `CoarseGrid.of_grains`, with images among the sources."""
        count, steep = self._mesh.shape[0] * self._mesh.shape[1], values[:, sloped]
        density, gradient = np.zeros((count, values.shape[1])), np.zeros((2, count, steep.shape[1]))
        for some in self._groups(len(position), 0.0):
            cell, part, inside = self._spots(position[some])
            pairs = _Pairs(self._mesh, self._rim(0.0), cell, self._number(part), self._grains_of)
            weight = np.empty((3, pairs.count))
            at_x, at_y = self._ways((part + inside) / self._parts)[pairs.order].T.astype(np.float32)
            for kind, rows, which in pairs.pieces(_AT_ONCE):
                way_x, way_y = self._ways(kind.steps).T.astype(np.float32)
                x, y = way_x - at_x[rows, np.newaxis], way_y - at_y[rows, np.newaxis]
                depth = kernel.depth(x * x + y * y)
                slope = kernel.slope(depth)
                found = (kernel.value(depth), slope * x, slope * y)
                for column, each in zip(weight, found, strict=True):
                    column[which] = each.ravel()
            density += pairs.sums(weight[0], values[some])
            for total, column in zip(gradient, weight[1:], strict=True):
                total += pairs.sums(column, steep[some])
        height = kernel.height(self._reach)
        return height * density, height / self._reach * np.moveaxis(gradient, 0, -1)

    def is_worth(self, half: Floats) -> bool:
        """Whether enough branches are of a kind; never if they are long beside the reach."""
        if not np.abs(half).max(initial=0.0) <= self._reach:
            return False
        kinds = np.count_nonzero(np.bincount(self._squares(half)[0])) * int(self._parts.prod())
        return bool(kinds * _WORTH <= self._uses * len(half))

    def along(self, middle: Floats, half: Floats, values: Floats) -> Floats:
        """Densities, as `CoarseGrid.densities_along`, with images among the branches."""
        density = np.zeros((self._mesh.shape[0] * self._mesh.shape[1], values.shape[1]))
        longest = float(np.hypot(*half.T).max(initial=0.0)) / self._reach
        for some in self._groups(len(middle), longest):
            cell, part, inside = self._spots(middle[some])
            square, beside = self._squares(half[some])
            rim, key = self._rim(longest + 2.0 * _WIDE), self._number(part) * _SQUARES + square
            pairs = _Pairs(self._mesh, rim, cell, key, self._branches_of)
            at = 2.0 * np.column_stack([inside, beside])[pairs.order] - 1.0
            terms, weight = _terms(at.astype(np.float32)), np.empty(pairs.count)
            for kind, rows, which in pairs.pieces(_ONE_THREAD // len(terms)):
                weight[which] = (terms[:, rows].T @ kind.fit).ravel()
            density += pairs.sums(weight, values[some])
        return kernel.height(self._reach) * density

    def _groups(self, count: int, longest: float) -> Iterator[slice]:
        """Sources as many as there may be together."""
        pairs = np.pi * (self._reach * (1.0 + longest)) ** 2 / np.prod(self._mesh.step)
        together = max(_MOST, _PER_POINT * int(np.prod(self._mesh.shape)))
        size = max(int(together / pairs), 1)
        for first in range(0, count, size):
            yield slice(first, first + size)

    def _ways(self, steps: Floats | NDArray[np.int64]) -> Floats:
        """Ways in reaches."""
        return self._mesh.ways(steps) / self._reach

    def _rim(self, longest: float) -> int:
        """Steps that are surely farther than sources reach with branches half so long."""
        far = (1.0 + longest) * self._reach * np.hypot(1.0, self._mesh.slant)
        return int(np.ceil(far / self._mesh.step.min())) + 1

    def _spots(self, position: Floats) -> tuple[NDArray[np.int64], NDArray[np.int64], Floats]:
        """Cells of positions, parts of these, and where in the part, 0 to 1, all ``(n, 2)``."""
        at = self._mesh.steps(position) * self._parts
        part = np.floor(at)
        cell = np.floor(part / self._parts)
        return cell.astype(np.int64), (part - cell * self._parts).astype(np.int64), at - part

    def _number(self, part: NDArray[np.int64]) -> NDArray[np.int64]:
        """Numbers of parts."""
        return np.asarray(part[:, 1] * self._parts[0] + part[:, 0])

    def _squares(self, half: Floats) -> tuple[NDArray[np.int64], Floats]:
        """Squares of the upper half plane in which half branches lie, and where there, 0 to 1."""
        upwards = np.where(half[:, 1:] < 0.0, -half, half) * (_BRANCHES / self._reach)
        square = np.floor(upwards)
        x, y = square.astype(np.int64).T
        return y * _ACROSS + x + _BRANCHES, upwards - square

    def _part_of(self, number: int) -> NDArray[np.int64]:
        """The part with a number, from the left and from below."""
        return np.array(divmod(number, int(self._parts[0])))[::-1]

    def _steps(self, longest: float) -> NDArray[np.int64]:
        """To all points that sources may reach, shape ``(m, 2)``; see `_rim`."""
        beside = np.arange(-self._rim(longest), self._rim(longest) + 1)
        return np.stack(np.meshgrid(beside, beside), axis=-1).reshape(-1, 2)

    def _grains_of(self, number: int) -> _Kind:
        """The kind of sources without branches in a part of a cell."""
        if number not in self._grains:
            steps = self._steps(0.0)
            away = self._ways(steps) - self._ways((self._part_of(number) + 0.5) / self._parts)
            is_near = np.hypot(*away.T) < 1.0 + self._wide
            self._grains[number] = _Kind(steps[is_near], np.empty((0, 0)))
        return self._grains[number]

    def _branches_of(self, number: int) -> _Kind:
        """The kind of branches whose middle is in a part of a cell, and whose half in a square."""
        if number not in self._branches:
            part, square = divmod(number, _SQUARES)
            y, x = divmod(square, _ACROSS)
            samples, inverse = _samples()
            samples = np.concatenate([samples, np.full((1, 4), 0.5)])  # and the middle
            middle = self._ways((self._part_of(part) + samples[:, :2]) / self._parts)
            half = (np.array([x - _BRANCHES, y]) + samples[:, 2:]) / _BRANCHES
            steps = self._steps(float(np.hypot(*half[-1])) + _WIDE)
            # Whatever is near one of them is near the middle one if the kernel reaches farther.
            far = 1.0 + self._wide + _WIDE
            weight = _weights(self._ways(steps) / far, middle[-1:] / far, half[-1:] / far)
            steps = steps[weight[0] > 0.0]
            kept, fits = [], []
            for some in np.array_split(steps, len(steps) * inverse.size // _ONE_THREAD + 1):
                weight = _weights(self._ways(some), middle[:-1], half[:-1])
                counts = weight.max(axis=0) > _LEAST
                kept.append(some[counts])
                fits.append((inverse @ weight[:, counts]).astype(np.float32))
            self._branches[number] = _Kind(np.concatenate(kept), np.concatenate(fits, axis=1))
        return self._branches[number]


def _weights(points: Floats, middle: Floats, half: Floats) -> Floats:
    """Weights of branches ``(n, 2)`` at points ``(m, 2)``, shape ``(n, m)``, in reaches."""
    ahead, length = kernel.directions(half)
    (x, y), (c, s) = (points - middle[:, np.newaxis]).transpose(2, 0, 1), ahead.T[:, :, np.newaxis]
    return kernel.mean_along(x * c + y * s, y * c - x * s, length[:, np.newaxis])


def _terms(at: Floats) -> Floats:
    """Products of Chebyshev polynomials up to `_DEGREE` together at ``(n, 4)``, ``(k, n)``."""
    one = [np.ones_like(at.T), at.T]
    for _ in range(_DEGREE - 1):
        one.append(2.0 * one[1] * one[-1] - one[-2])
    power = range(_DEGREE + 1)
    first, second = (
        {(i, j): one[i][k] * one[j][k + 1] for i in power for j in power if i + j <= _DEGREE}
        for k in (0, 2)
    )
    chosen = [(i, j) for i in first for j in second if sum(i + j) <= _DEGREE]
    found = np.empty((len(chosen), len(at)), at.dtype)
    for row, (i, j) in zip(found, chosen, strict=True):
        np.multiply(first[i], second[j], out=row)
    return found


@cache
def _samples() -> tuple[Floats, Floats]:
    """Samples of a box, 0 to 1, dense at its sides, ``(n, 4)``; what makes coefficients of them.

    They are those of an additive recurrence with powers of the root of x⁵ = x + 1 (Roberts 2018).
    """
    even = np.arange(1, _SAMPLES + 1)[:, np.newaxis] * 1.1673039782614187 ** -np.arange(1.0, 5.0)
    at = np.cos(np.pi * (even % 1.0))
    terms = _terms(at)
    return 0.5 + 0.5 * at, np.asarray(np.linalg.solve(terms @ terms.T, terms), np.float64)
