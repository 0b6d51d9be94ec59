"""Coarse graining: smooth fields of what grains and contacts carry, at any points of the plane.

A quantity A of the grains has the density Σ A_i φ(x − x_i), with a kernel φ whose integral is 1;
what contacts carry is spread along their branches. Mass, momentum and stress made so obey the
balances of continua exactly (Goldhirsch, Granular Matter 12, 239, 2010).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from importlib.util import find_spec
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats
from multicor_cli.optional import library
from multicor_cli.post.lattice import Lattice

# ---- The kernel, and its means along lines in closed form
#
# It is that of Lucy (Astron. J. 82, 1013, 1977) in the plane, φ = h (1 + 3q)(1 − q)³ with
# q = r/c < 1 and the height h = 5/(π c²): it reaches to the distance c and has two continuous
# derivatives. All lengths are in units of c, and φ in units of h.

_SHORTEST = 1e-6  # half of a line: shorter ones are as good as points, and a quotient of roundings


def kernel_height(reach: float) -> float:
    """Height of a kernel whose integral is 1 [per m²], which reaches so far [m]."""
    return 5.0 / (np.pi * reach**2)


def kernel_depth(square: Floats) -> Floats:
    """How far 1 − q points lie inside the circle, 0 outside it, from q²; φ is made of it."""
    q = np.sqrt(square)
    np.subtract(1.0, q, out=q)
    return np.asarray(np.maximum(q, 0.0, out=q))


def kernel_value(depth: Floats) -> Floats:
    """φ, with p = 1 − q: (1 + 3q)(1 − q)³ = p³ (4 − 3p)."""
    found = 4.0 - 3.0 * depth
    for _ in range(3):
        found *= depth
    return np.asarray(found)


def kernel_slope(depth: Floats) -> Floats:
    """What the way from the source is multiplied with to have ∇φ: −12 (1 − q)²."""
    return np.asarray(-12.0 * depth * depth)


def directions(half: Floats) -> tuple[Floats, Floats]:
    """Unit vectors of half lines ``(n, 2)`` and their lengths ``(n,)``; points get a short one."""
    length = np.hypot(*half.T)
    is_point = length < _SHORTEST
    length = np.where(is_point, _SHORTEST, length)
    ahead = np.where(is_point[:, np.newaxis], [1.0, 0.0], half / length[:, np.newaxis])
    return ahead, length


def mean_along(along: Floats, across: Floats, half: Floats) -> Floats:
    """Means of φ over lines, of where a point is along and across them, from their middles.

    Of half their length, too; shapes are those that broadcast. At the distance s along a line from
    the foot of the point, φ = 1 − 6q² + 8q³ − 3q⁴ with q² = s² + w and the square w of the distance
    across has the primitive s (1 − 6w − 3w² − 2s² (1 + w + 0.3 s²) + q (2s² + 5w)) + 3w² ln(s + q);
    lines are cut off at the circle.
    """
    w = across * across
    rim = np.sqrt(np.maximum(1.0 - w, 0.0))
    s = np.empty((2, *rim.shape))  # of both ends
    np.subtract(along, half, out=s[0])
    np.add(along, half, out=s[1])
    np.minimum(s, rim, out=s)
    np.maximum(s, np.negative(rim, out=rim), out=s)
    square = s * s
    q = square + w
    np.sqrt(q, out=q)
    log = q + s
    log += np.finfo(float).tiny  # only where w² vanishes
    first, last = log
    last /= first
    ln = np.log(last)
    ln *= 3.0 * w * w
    term = np.multiply(2.0, square, out=log)
    term += 5.0 * w
    q *= term
    np.multiply(0.6, square, out=term)
    term += 2.0 + 2.0 * w
    term *= square
    q -= term
    q += 1.0 - 3.0 * w * (2.0 + w)
    q *= s
    first, last = q
    last -= first
    last += ln
    last *= 0.5 / half
    return np.asarray(last)


# ---- Densities at points
#
# The points that a source reaches are found strip by strip, those of a strip next to each other,
# and a sparse matrix of its weights there adds up what it carries.

_FINE = np.array([24.0, 6.0])  # cells of a strip, and strips, per reach
_MOST = np.array([4000.0, 1000.0])  # however short the kernel is
_SOURCES = 2048  # whose points are looked for together
_TOGETHER = 1 << 18  # pairs of a point and a source whose weights are a matrix
_AT_ONCE = 1 << 14  # pairs that stay in the cache
_FLAT = 1e-100  # that stands for the rise of a line along x
_NONE = slice(0)


class _Strips:
    """Points sorted into strips along x and these into cells; strips without points are left out.

    All lengths are in reaches.

    Attributes:
        rank: Where each point stands in this order.
        at: Where they are in this order, shape ``(2, m)``.
    """

    def __init__(self, points: Floats) -> None:
        low, across = points.min(axis=0), np.ptp(points, axis=0)
        size = np.maximum(1.0 / _FINE, across.max() / _MOST)
        cell, strip = ((points - low) / size).astype(np.int64).T
        (self._left, self._low), self._width = low.tolist(), float(size[0])
        order = np.lexsort((cell, strip))
        self.rank, self.at = np.argsort(order), points[order].T.copy()
        is_first = np.diff(strip[order], prepend=-1) > 0
        first = np.flatnonzero(is_first)
        self._bottom = np.minimum.reduceat(self.at[1], first)
        self._top = np.maximum.reduceat(self.at[1], first)
        self._cells = int(cell.max()) + 1
        key = (np.cumsum(is_first) - 1) * self._cells + cell[order]
        number = np.bincount(key, minlength=first.size * self._cells)
        self._before = np.append(0, np.cumsum(number))

    def are_near(self, places: Floats, far: float) -> NDArray[np.bool_]:
        """Whether places ``(n, 2)`` may be so near to a point, by the ends of bands so high."""
        x, band = self.at[0], ((self.at[1] - self._low) / far).astype(np.int64) + 2
        ends = np.full((2, band.max() + 3), np.inf)
        for end, ahead in zip(ends, (x, -x), strict=True):
            np.minimum.at(end, band, ahead)
        ends = np.minimum(np.minimum(ends[:, :-2], ends[:, 2:]), ends[:, 1:-1])  # of three bands
        own = np.floor((places[:, 1] - self._low) / far) + 1.0
        left, right = ends[:, np.clip(own, 0.0, ends.shape[1] - 1).astype(np.int64)]
        return np.asarray((places[:, 0] > left - far) & (-places[:, 0] > right - far), np.bool_)

    def reached(self, sources: Floats) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """The first point that sources reach in a strip, and how many there, ``(n, strips)``.

        A source reaches to the distance 1 from a line. Where its rim is at some height is told by
        the circle about a point t of the line: that straight across from the rim, or an end. Of a
        strip, the height counts at which the rim is farthest on the side that is looked at.

        Args:
            sources: Where the middle of the line is, its direction (upwards) and half its length,
                shape ``(5, n)``.
        """
        x, y, c, s, half = sources[:, :, np.newaxis]
        lowest = np.searchsorted(self._top, y - (half * s + 1.0))
        highest = np.searchsorted(self._bottom, y + (half * s + 1.0), "right")
        strip = lowest + np.arange((highest - lowest).max(initial=0))
        is_met = strip < highest
        strip[~is_met] = 0
        bottom, top = self._bottom[strip] - y, self._top[strip] - y
        ends = []
        for side in (-1.0, 1.0):
            height = np.clip(side * np.copysign(half * s, c), bottom, top)
            t = np.clip((height + side * c) / (s + _FLAT), -half, half)
            chord = np.sqrt(np.maximum(1.0 - (height - t * s) ** 2, 0.0))
            cell = np.floor((x + t * c + side * chord - self._left) / self._width) + (side > 0.0)
            cell = np.clip(cell, 0.0, self._cells).astype(np.int64)
            ends.append(self._before[strip * self._cells + cell])
        number = np.where(is_met, ends[1] - ends[0], 0)
        return ends[0], number


class CoarseGrid:
    """Points at which densities are wanted, and how far the kernel reaches."""

    def __init__(self, points: Floats, reach: float, lattice: Lattice | None = None) -> None:
        """The ``reach`` c is at most the span of the lattice [m]."""
        self.reach, self.lattice = reach, lattice or Lattice()
        self._strips = _Strips(self.lattice.wrapped(points) / reach)

    def of_grains(
        self, position: Floats, values: Floats, sloped: slice = _NONE
    ) -> tuple[Floats, Floats]:
        """Densities of what sources carry, ``(m, q)``, and gradients of some, ``(m, s, 2)``.

        Args:
            position: Of the sources [m], shape ``(n, 2)``.
            values: What they carry, shape ``(n, q)``.
            sloped: Which s of the q gradients are wanted [per m³]; densities are per m².
        """

        def weigh(x: Floats, y: Floats, *_: Floats) -> list[Floats]:
            depth = kernel_depth(x * x + y * y)
            slope = kernel_slope(depth)
            return [kernel_value(depth), slope * x, slope * y]

        point = np.zeros_like(position)
        density, *gradient = self._sums(position, point, [values, *[values[:, sloped]] * 2], weigh)
        height = kernel_height(self.reach)
        return height * density, height / self.reach * np.stack(gradient, axis=-1)

    def densities_along(self, start: Floats, branch: Floats, values: Floats) -> Floats:
        """Densities ``(m, q)`` [per m²] of what is spread evenly along branches, ``(b, q)``."""

        def weigh(x: Floats, y: Floats, c: Floats, s: Floats, half: Floats) -> list[Floats]:
            return [mean_along(x * c + y * s, y * c - x * s, half)]

        half = 0.5 * branch
        (density,) = self._sums(start + half, half, [values], weigh)
        return kernel_height(self.reach) * density

    def _sums(
        self,
        middle: Floats,
        half: Floats,
        values: Sequence[Floats],
        weigh: Callable[..., list[Floats]],
    ) -> list[Floats]:
        """Sums at the points of each of some values of lines times their own weights, ``(m, q)``.

        Weights ``(k,)`` are made of where points lie from the middles of lines, and of the
        directions and half lengths of these.
        """
        sources, which = self._sources(middle, half)
        values = [value[which] for value in values]
        rank = self._strips.rank
        total = [np.zeros((rank.size, value.shape[1])) for value in values]
        for begin in range(0, which.size, _SOURCES):
            some = slice(begin, begin + _SOURCES)
            lines = sources[:, some]
            first, number = self._strips.reached(lines)
            for part, _ in _parts(number.sum(axis=1), _TOGETHER):
                found = self._weights(lines[:, part], first[part], number[part], weigh)
                _add_up(total, *found, [value[some][part] for value in values])
        return [sums[rank] for sums in total]

    def _weights(
        self,
        lines: Floats,
        first: NDArray[np.int64],
        number: NDArray[np.int64],
        weigh: Callable[..., list[Floats]],
    ) -> tuple[list[Floats], NDArray[np.int32], NDArray[np.int64]]:
        """Weights of lines at the points that they reach ``(k,)``, these, and how many of each."""
        n, own = number.ravel(), number.sum(axis=1)
        point = np.repeat((first.ravel() - (np.cumsum(n) - n)).astype(np.int32), n)
        point += np.arange(point.size, dtype=np.int32)
        blocks = []
        for part, pairs in _parts(own, _AT_ONCE):
            x, y, *line = (np.repeat(row[part], own[part]) for row in lines)
            reached = point[pairs].astype(np.intp)
            for way, at in zip((x, y), self._strips.at, strict=True):
                np.subtract(at.take(reached), way, out=way)
            blocks.append(weigh(x, y, *line))
        return [np.concatenate(block) for block in zip(*blocks, strict=True)], point, own

    def _sources(self, middle: Floats, half: Floats) -> tuple[Floats, NDArray[np.int64]]:
        """Lines and their images near points, the lowest first, as `_Strips.reached`; which."""
        middle = self.lattice.wrapped(middle)
        far = self.reach + float(np.hypot(*half.T).max(initial=0.0))
        which, shift = self.lattice.images(middle, np.full(len(middle), far))
        at = (middle[which] + shift) / self.reach
        near = np.flatnonzero(self._strips.are_near(at, far / self.reach))
        order = near[np.argsort(at[near, 1])]
        which = which[order]
        ahead, length = directions(half[which] / self.reach)
        ahead[ahead[:, 1] < 0.0] *= -1.0
        return np.column_stack([at[order], ahead, length]).T.copy(), which


def _parts(own: NDArray[np.int64], most: int) -> Iterator[tuple[slice, slice]]:
    """Some sources with ``own`` points each, and their pairs with these: about ``most`` pairs."""
    ends = np.cumsum(own)
    cuts = np.flatnonzero(np.diff(np.maximum(ends - 1, 0) // most)) + 1
    for begin, end in pairwise([0, *cuts.tolist(), own.size]):
        yield slice(begin, end), slice(int(ends[begin] - own[begin]), int(ends[end - 1]))


def _add_up(
    total: Sequence[Floats],
    weights: Sequence[Floats],
    point: NDArray[np.int32],
    own: NDArray[np.int64],
    values: Sequence[Floats],
) -> None:
    """Add to sums at points ``(m, q)`` values of sources ``(n, q)`` times their weights there.

    Without SciPy sums differ by rounding alone.
    """
    if not point.size:
        return
    low, count = point.min(), int(np.ptp(point)) + 1
    point -= low
    if find_spec("scipy") is None:
        for sums, weight, value in zip(total, weights, values, strict=True):
            for k, column in enumerate(value.T):
                found = np.bincount(point, weight * np.repeat(column, own), count)
                sums[low : low + count, k] += found
        return
    before = np.append(0, np.cumsum(own)).astype(np.int32)
    columns = (weights[0], point, before)
    matrix = library("scipy.sparse").csc_array(columns, shape=(count, own.size))
    for sums, weight, value in zip(total, weights, values, strict=True):
        matrix.data = weight
        sums[low : low + count] += matrix @ value
