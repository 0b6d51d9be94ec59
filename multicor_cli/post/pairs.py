"""Pairs of grains that are near each other, and sums over them by distance."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats
from multicor_cli.post.lattice import Complexes, Lattice, in_plane

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
