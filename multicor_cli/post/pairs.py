"""Pairs of grains that are near each other."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.columns import X, Y
from multicor_cli.model.model import Floats
from multicor_cli.post.lattice import Lattice

_STRIPS = 6  # in which grains are sorted, per reach
_CHUNK = 8192  # pairs at a time that stay in the cache


class Pairs(NamedTuple):
    """Some pairs: a grain, the number of another one, and the way to the image of it that is near.

    Attributes:
        i, j: Numbers of the grains, shape ``(k,)``.
        across, upwards: The way from i to j [m], shape ``(k,)``.
    """

    i: NDArray[np.int64]
    j: NDArray[np.int64]
    across: Floats
    upwards: Floats

    def bins(self, width: float) -> NDArray[np.int64]:
        """Numbers of the bins of the distances, whose centers are multiples of ``width`` [m]."""
        distance = self.across**2
        distance += self.upwards**2
        np.sqrt(distance, out=distance)
        distance /= width
        distance += 0.5
        return distance.astype(np.int64)


def near_pairs(points: Floats, lattice: Lattice, reach: float) -> Iterator[Pairs]:
    """All pairs up to a distance [m], each once, and some beyond it; so many at a time.

    Images are sorted along x in strips: of each strip near a grain, those are looked at whose x is
    near enough. A pair is found from its lower grain; of two at one height from the left one.

    Args:
        points: Grains between the sides of the lattice [m], shape ``(n, 2)``.
        lattice: Where their images are. If more than half of its span is within reach, a pair is
            found once for each image that is near, and a grain with its own.
        reach: The distance.
    """
    which, shift = lattice.images(points, np.full(len(points), reach))
    images, tall = points[which] + shift, reach / _STRIPS
    low, apart = images.min(axis=0), float(np.ptp(images[:, X])) + 3.0 * reach
    row, along = np.floor((points[:, Y] - low[Y]) / tall), points[:, X] - low[X]
    key = np.floor((images[:, Y] - low[Y]) / tall) * apart + images[:, X] - low[X]
    order = np.argsort(key)
    key, (x, y), (x_image, y_image) = key[order], points.T.copy(), images[order].T.copy()
    which = which[order]
    for step in range(_STRIPS + 1):
        near = np.sqrt(reach**2 - (max(step - 1, 0) * tall) ** 2)
        middle = (row + step) * apart + along
        first = np.searchsorted(key, middle - near)
        number = np.searchsorted(key, middle + near) - first
        for part in np.array_split(np.arange(len(points)), number.sum() // _CHUNK + 1):
            own = number[part]
            i = np.repeat(part, own)
            j = np.repeat(first[part] - (np.cumsum(own) - own), own)
            j += np.arange(j.size)
            across, upwards = x_image[j], y_image[j]
            across -= x[i]
            upwards -= y[i]
            if step == 0:
                is_above = (upwards > 0.0) | ((upwards == 0.0) & (across > 0.0))
                i, j = i[is_above], j[is_above]
                across, upwards = across[is_above], upwards[is_above]
            yield Pairs(i, which[j], across, upwards)
