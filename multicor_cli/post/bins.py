"""Horizontal bins between the walls, and where they are in each frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats
from multicor_cli.post.binning import Shares, share_discs, share_lines
from multicor_cli.post.contacts import LoadedContacts
from multicor_cli.post.extent import Between, Extent, find_extent
from multicor_cli.post.source import FrameSource, GrainFrame, PostError

BIN_LIMIT = 100_000
"""Largest number of bins; more is taken for a mistake."""

WALL_LAYER = 1.0
"""The layer at a wall that profiles leave out unless told otherwise, in mean diameters: walls order the grains there."""

_NEAR = 0.125  # of the distance of the walls: no more than that is left out at each unless told otherwise
_NOTHING = 1e-9  # of the distance of the walls: a height below that is zero but for rounding


class BinPlace(NamedTuple):
    """Where the bins are in a frame.

    Attributes:
        bottom: Lower edge of the first bin [m].
        width: Width of a bin [m].
    """

    bottom: float
    width: float


@dataclass(frozen=True)
class Bins:
    """Horizontal bins of equal width.

    Between two walls that approach each other or move apart they become narrower or wider with the distance, so that they end at
    the walls in every frame; what is left out next to the walls keeps its width.

    Attributes:
        extent: Where heights are measured from.
        width: Width of a bin, averaged over the frames [m].
        count: Number of bins b.
        bottom: Lower edge of the first bin above the origin [m].
        left_out: What is left out at each wall [m].
    """

    extent: Extent
    width: float
    count: int
    bottom: float = 0.0
    left_out: float = 0.0

    @property
    def centers(self) -> Floats:
        """Centers above the origin, averaged over the frames [m], shape ``(b,)``."""
        return np.asarray(self.bottom + (np.arange(self.count) + 0.5) * self.width)

    def place(self, frame: GrainFrame) -> BinPlace:
        """Where the bins are in a frame; raises `PostError` if the walls come too near to each other."""
        width = self.width + (self.extent.span(frame) - self.extent.height) / self.count
        if not width * self.count > _NOTHING * self.extent.height:
            raise PostError(
                f"nothing is left between the walls where they come nearest, {self.extent.span(frame):.4g} m: "
                "leave out less at the walls, or choose other frames"
            )
        return BinPlace(self.extent.origin(frame) + self.bottom, width)

    def share(self, y: Floats, radius: Floats, place: BinPlace) -> Shares:
        """Which grain lies in which bin with which area."""
        return share_discs(y, radius, *place, self.count)

    def share_branches(self, contacts: LoadedContacts, y: Floats, place: BinPlace) -> Shares:
        """Which branch of a contact lies in which bin with which part of its length; ``y`` are the heights of the grains [m]."""
        start = y[contacts.i]
        return share_lines(start, start - contacts.branch[:, 1], *place, self.count)

    def total(self, shares: Shares, values: Floats) -> Floats:
        """Sum of values of the shares in each bin, shape ``(b,)``."""
        return np.asarray(np.bincount(shares.bin, weights=values, minlength=self.count), np.float64)


def make_bins(
    source: FrameSource,
    chosen: NDArray[np.int64],
    bins: int | None = None,
    *,
    bin_width: float | None = None,
    exclude_walls: float | None = 0.0,
    between: Between | None = None,
) -> Bins:
    """Bins over the extent of the frames ``chosen``, each about ``bin_width`` mean diameters wide unless their number is given.

    What is left out at the walls is `WALL_LAYER`, or less between walls that are near, if ``exclude_walls`` is None.

    Raises:
        PostError: If there are too few or too many, nothing is left between the walls, or ``between`` names no such walls.
    """
    extent = find_extent(source, chosen, between)
    diameter = source.model.mean_diameter
    if exclude_walls is None:
        edge = min(WALL_LAYER * diameter, _NEAR * extent.height)
    elif exclude_walls >= 0.0:
        edge = exclude_walls * diameter
    else:
        raise PostError(f"{exclude_walls:g} mean diameters cannot be left out at the walls: choose 0 or more")
    bottom = edge if extent.lower is not None else 0.0
    height = extent.height - bottom - (edge if extent.upper is not None else 0.0)
    if not height > _NOTHING * extent.height:
        raise PostError(
            f"nothing is left between the walls: they are {extent.height / diameter:.3g} mean diameters apart and "
            f"{edge / diameter:g} are to be left out at each"
        )
    if bin_width is not None and not bin_width > 0.0:
        raise PostError(f"bins cannot be {bin_width:g} mean diameters wide: choose more than 0")
    count = bins if bins is not None else max(round(min(height / ((bin_width or 1.0) * diameter), 2.0 * BIN_LIMIT)), 1)
    if not 1 <= count <= BIN_LIMIT:
        raise PostError(f"{count} bins: choose between 1 and {BIN_LIMIT}")
    return Bins(extent, height / count, count, bottom, edge)


def heights(frame: GrainFrame) -> Floats:
    """Heights y of the grains [m], shape ``(n,)``."""
    return np.asarray(frame.position, np.float64)[:, 1]
