"""Where the images of grains are, across a period or around a cell, and which pairs are near."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model import cell
from multicor_cli.model.cell import over_windows
from multicor_cli.model.columns import XX, XY, YY, X, Y
from multicor_cli.model.model import Floats, Model
from multicor_cli.post.source import Frame, Run

Complexes = NDArray[np.complex128]
"""Points of the plane, or ways in it, as x + iy."""


class Lattice(NamedTuple):
    """Images lie (width, 0) and (tilt, height) from each other [m]; 0: there are none that way."""

    width: float = 0.0
    height: float = 0.0
    tilt: float = 0.0

    @property
    def slant(self) -> float:
        """How far the sides of a cell lean to the right per height; 0 if there is no cell."""
        return self.tilt / self.height if self.height > 0.0 else 0.0

    @property
    def area(self) -> float:
        """Area of a cell [m²]."""
        return self.width * self.height

    @property
    def corners(self) -> Floats:
        """Corners of a cell, counter-clockwise from the origin [m], shape ``(4, 2)``."""
        right, up = np.array([self.width, 0.0]), np.array([self.tilt, self.height])
        return np.array([0.0 * right, right, right + up, up])

    @property
    def span(self) -> float:
        """Least distance of opposite sides [m]; infinite if there is no period."""
        across = self.width / np.hypot(1.0, self.slant) if self.width > 0.0 else np.inf
        return float(min(across, self.height or np.inf))

    @property
    def reduced(self) -> Lattice:
        """The same lattice with the least tilt, which has opposite sides as far apart as can be."""
        if self.height <= 0.0:
            return self
        return self._replace(tilt=self.tilt - float(np.round(self.tilt / self.width)) * self.width)

    @property
    def vectors(self) -> Floats:
        """From an image to those to the right and above [m], shape ``(2, 2)``."""
        return np.array([[self.width, 0.0], [self.tilt, self.height]])

    def nearest(self, ways: Floats) -> NDArray[np.int64]:
        """By how many of the `vectors` ways [m] are longer than those to the nearest image."""
        found = np.zeros(ways.shape, np.int64)
        if self.height > 0.0:
            found[:, Y] = np.round(ways[:, Y] / self.height)
        if self.width > 0.0:
            found[:, X] = np.round((ways[:, X] - found[:, Y] * self.tilt) / self.width)
        return found

    def wrapped(self, points: Floats) -> Floats:
        """The images of points [m], shape ``(n, 2)``, that lie between the sides."""
        at = np.array(points)
        if self.height > 0.0:
            up = np.floor(at[:, Y] / self.height)
            at[:, X] -= up * self.tilt
            at[:, Y] -= up * self.height
        if self.width > 0.0:
            lean = self.slant * at[:, Y]
            at[:, X] = (at[:, X] - lean) % self.width + lean
        return at

    def images(self, points: Floats, reach: Floats) -> tuple[NDArray[np.int64], Floats]:
        """Numbers and shifts [m] of what to draw: all things, then images that reach inside.

        Args:
            points: Middles of the things between the sides [m], shape ``(n, 2)``.
            reach: How far they reach [m]: discs, shape ``(n,)``, or lines, shape ``(n, 2)``: from
                the middle to one end.
        """
        which, shift = [np.arange(len(points))], [np.zeros((len(points), 2))]
        if self.width <= 0.0:
            return which[0], shift[0]
        if reach.ndim == 1:
            across, upwards = np.hypot(1.0, self.slant) * reach, reach
        else:
            across, upwards = np.abs(reach[:, X] - self.slant * reach[:, Y]), np.abs(reach[:, Y])
        x, y = points[:, X] - self.slant * points[:, Y], points[:, Y]
        beside = _reaching(x, across, self.width)
        above = _reaching(y, upwards, self.height)
        for up, is_above in above.items():
            for right, is_beside in beside.items():
                if right or up:
                    found = np.flatnonzero(is_above & is_beside)
                    way = (right * self.width + up * self.tilt, up * self.height)
                    which.append(found)
                    shift.append(np.tile(way, (found.size, 1)))
        return np.concatenate(which), np.concatenate(shift)


def _reaching(at: Floats, reach: Floats, period: float) -> dict[int, NDArray[np.bool_]]:
    """Which things at 0 … ``period`` reach inside by images so many periods away, the thing first.

    With the period 0 there are no images.
    """
    found = {0: np.ones(len(at), np.bool_)}
    farthest = float(np.max(reach, initial=0.0)) / period if period > 0.0 else 0.0
    for step in range(1, int(np.ceil(farthest)) + 1):
        found[-step] = at + reach > step * period
        found[step] = at - reach < (1 - step) * period
    return found


def in_plane(points: Floats) -> Complexes:
    """Points of the shape ``(n, 2)`` as x + iy, shape ``(n,)``."""
    return np.ascontiguousarray(points).view(np.complex128)[:, 0]


def lattice_of(model: Model, frame: Frame) -> Lattice:
    """The lattice of a frame."""
    if model.is_cell:
        width, height, tilt = frame.wall_position[0]
        return Lattice(float(width), float(height), float(tilt))
    return Lattice(model.period)


def gradient_of(frame: Frame) -> Floats:
    """Gradient of the mean flow of the frame of a cell [1/s]: xx, yy, xy."""
    return np.asarray(frame.wall_velocity[0], np.float64)


class Strains(NamedTuple):
    """What a cell has been strained by since the first row of its time series.

    Attributes:
        time: Times of the ``s`` rows [s].
        strain: ∫L dt of xx, yy and xy, shape ``(s, 3)``.
        stretch: The tensor that takes the cell there from the first row: xx, yy and xy, likewise.
    """

    time: Floats
    strain: Floats
    stretch: Floats

    def at(self, times: Floats) -> tuple[Floats, Floats]:
        """Strain and stretch at other times, straight between rows."""
        columns = (*self.strain.T, *self.stretch.T)
        found = np.column_stack([np.interp(times, self.time, column) for column in columns])
        return found[:, :3], found[:, 3:]


def strains_of(source: Run) -> Strains:
    """How the cell of a run is strained, from its sides: nothing moves in frozen stages.

    The tilt is known but for a multiple of the width: that is taken which the rates of shear at the
    ends of each window come nearest to. In a window L is taken for constant, so that ∫L_xy dt is
    (tilt − tilt before · w)/(height before · l), with the ratio w of the widths and the logarithmic
    mean l of this and the ratio of the heights.
    """
    series = source.series
    sides, rates = (np.asarray(series[f"wall_{of}"])[:, 0] for of in ("position", "velocity"))
    sheared = over_windows(rates)[1:, XY] * np.asarray(series["window_duration"])[1:]
    before, after = sides[:-1], sides[1:]
    wide, high = after[:, XX] / before[:, XX], after[:, YY] / before[:, YY]
    xx, yy = np.log(wide), np.log(high)
    is_alike = np.abs(yy - xx) < 1e-6
    mean = np.where(
        is_alike, np.sqrt(wide * high), (high - wide) / np.where(is_alike, 1.0, yy - xx)
    )
    reach = before[:, YY] * mean
    tilt = wide * before[:, XY] + sheared * reach
    tilt = after[:, XY] + after[:, XX] * np.round((tilt - after[:, XY]) / after[:, XX])
    leant = tilt - wide * before[:, XY]
    strain = np.vstack([np.zeros(3), np.cumsum(np.column_stack([xx, yy, leant / reach]), axis=0)])
    a, b = np.exp(strain[:, XX]), np.exp(strain[:, YY])
    c = a * np.concatenate([[0.0], np.cumsum(leant / before[:, YY] * b[:-1] / a[1:])])
    return Strains(np.asarray(series["time"]), strain, np.column_stack([a, b, c]))


def sheared_between(source: Run, times: Floats) -> Floats:
    """√((ε_xx − ε_yy)² + (2ε_xy)²) of a cell from each time to the next, shape ``(f − 1,)``."""
    xx, yy, xy = np.diff(strains_of(source).at(times)[0], axis=0).T
    return np.asarray(np.hypot(xx - yy, xy))


def leant_between(source: Run, first: Frame, second: Frame) -> float | None:
    """The stretch xy of a cell from one frame to another, about; None where there is no cell."""
    if not source.model.is_cell:
        return None
    before, after = strains_of(source).at(np.array([first.time, second.time]))[1]
    return float((after[XY] - after[XX] / before[XX] * before[XY]) / before[YY])


def relative_velocity(frame: Frame) -> Floats:
    """Velocities of the grains of a cell relative to its mean flow [m/s], shape ``(n, 2)``."""
    velocity = np.asarray(frame.velocity, np.float64)[:, :2]
    place = np.asarray(frame.position, np.float64)
    return np.asarray(velocity - cell.mean_flow(place, gradient_of(frame)))


def velocity_at(frame: Frame, places: Floats, which: NDArray[np.int64] | None = None) -> Floats:
    """Velocities of images of the grains of a cell at ``places`` [m], as ``which`` [m/s]."""
    relative = relative_velocity(frame)
    moving = relative if which is None else relative[which]
    return np.asarray(moving + cell.mean_flow(places, gradient_of(frame)))


# ---- Pairs of grains that are near each other

_STRIPS = 8  # in which grains are sorted, per reach
_CHUNK = 16384  # pairs at a time that stay in the cache
_FARTHEST = 1.2  # in reaches: nothing that is looked at is farther away
_LANES = 8  # histograms side by side, into which pairs go in turn


class Pairs(NamedTuple):
    """Some pairs: each grain with ``k`` images that may be near.

    Attributes:
        i: Numbers of the grains, shape ``(g,)``.
        image: Numbers of the images, shape ``(k, g)``.
        way: The ways from the grains to the images, x + iy [m], shape ``(k, g)``; those between the
            reach and `_FARTHEST` times as much may be of no pair.
    """

    i: NDArray[np.int64]
    image: NDArray[np.int64]
    way: Complexes


def near_pairs(
    points: Floats, lattice: Lattice, reach: float
) -> tuple[NDArray[np.int64], Iterator[Pairs]]:
    """To which grain each image belongs, and all pairs up to a distance [m], each once, with some
    beyond it; so many at a time.

    Images are sorted along x in strips: of each strip near a grain, those are looked at whose x is
    near enough. A pair is found from its lower grain; of two at one height from the left one.

    Args:
        points: Grains between the sides of the lattice [m], shape ``(n, 2)``.
        lattice: Where their images are. If more than half of its span is within reach, a pair is
            found once for each image that is near, and a grain with its own.
        reach: The distance.
    """
    if not len(points):
        return np.zeros(0, np.int64), iter(())
    which, shift = lattice.images(points, np.full(len(points), reach))
    at, tall = in_plane(points[which] + shift), reach / _STRIPS
    upwards = (at.imag - at.imag.min()) / tall
    strip, apart = np.floor(upwards), float(np.ptp(at.real)) + 3.0 * reach
    key = strip * apart + (at.real - at.real.min())
    order = np.argsort(key)
    at, key, part = at[order], key[order], (upwards - strip)[order]
    own = np.flatnonzero(order < len(points))  # the grains themselves come first among the images
    i, here, middle, part = order[own], at[own], key[own], part[own]

    def found() -> Iterator[Pairs]:
        for step in range(_STRIPS + 1):
            above = np.maximum(step - part, 0.0) * tall  # how far the strip is, at least
            near = np.sqrt(np.maximum(reach**2 - above**2, 0.0))
            first = np.searchsorted(key, middle + step * apart - near)
            number = np.searchsorted(key, middle + step * apart + near) - first
            # Together with those that have as many; numbers of 16 bits are sorted in linear time
            alike = np.argsort(np.minimum(number, 0xFFFF).astype(np.uint16), kind="stable")
            for some in np.array_split(alike, number.sum() // _CHUNK + 1):
                numbers = number[some]
                fewest, turn = numbers.min(initial=0), np.arange(numbers.max(initial=0))[:, None]
                image = first[some] + turn
                is_none = turn[fewest:] >= numbers
                image[fewest:][is_none] = 0
                way = at.take(image)
                way -= here[some]
                way[fewest:][is_none] = _FARTHEST * reach
                if step == 0:
                    is_below = (way.imag < 0.0) | ((way.imag == 0.0) & (way.real <= 0.0))
                    way[is_below] = _FARTHEST * reach
                yield Pairs(i[some], image, way)

    return which[order], found()


def pair_sums(
    points: Floats, lattice: Lattice, width: float, count: int, values: Floats | None = None
) -> Floats:
    """Sums over pairs in bins of the distances around ``width`` [m], twice as much, … ``count``
    times: their number, and the products of each of some values.

    Args:
        points: As of `near_pairs`.
        lattice: The same.
        width: Width of the bins.
        count: How many there are.
        values: Values of the grains, shape ``(q, n)``.

    Returns:
        Shape ``(1 + q, count)``.
    """
    which, pairs = near_pairs(points, lattice, (count + 0.5) * width)
    of_both = [] if values is None else [(own, own[which]) for own in values]
    bins = int(_FARTHEST * (count + 0.5)) + 3
    totals = np.zeros((1 + len(of_both), _LANES * bins))
    for near in pairs:
        distance = np.abs(near.way)
        distance *= 1.0 / width
        distance += 0.5
        bin_ = distance.astype(np.int64)
        # Neighbors in the arrays, often alike, would wait for each other in the same histogram
        bin_ += np.arange(near.i.size) % _LANES * bins
        place = bin_.ravel()
        totals[0] += np.bincount(place, minlength=_LANES * bins)
        for total, (own, others) in zip(totals[1:], of_both, strict=True):
            product = others.take(near.image)
            product *= own[near.i]
            total += np.bincount(place, product.ravel(), minlength=_LANES * bins)
    return np.asarray(totals.reshape(-1, _LANES, bins).sum(axis=1)[:, 1 : count + 1])
