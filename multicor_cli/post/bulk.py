"""Which contacts of a run count as those of its bulk, and how far the bulk is strained."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.columns import Y
from multicor_cli.model.model import Floats
from multicor_cli.post.bins import Between, find_extent, heights
from multicor_cli.post.contacts import LoadedContacts
from multicor_cli.post.lattice import shear_rate_of
from multicor_cli.post.rheology import Band, find_band, strain_and_spin
from multicor_cli.post.source import (
    Frame,
    PostError,
    Run,
    frames_of,
    model_of,
    need_grains,
    need_same_grains,
    refuse_cell,
)


class Bulk(NamedTuple):
    """Where contacts count: between two heights of a layer, or everywhere.

    Attributes:
        band: The heights, as in `multicor_cli.post.rheology`; None: everywhere.
    """

    band: Band | None = None

    @property
    def margin(self) -> float:
        """What is left out next to the surface of each wall [m]; 0 if nothing is."""
        return self.band.margin if self.band else 0.0

    def holds(self, frame: Frame, contacts: LoadedContacts) -> NDArray[np.bool_]:
        """Which contacts of a frame have the middle of their branch inside, shape ``(c,)``."""
        if self.band is None:
            return np.ones(contacts.i.size, np.bool_)
        low, high = self.band.edges(frame)
        middle = heights(frame)[contacts.i] - 0.5 * contacts.branch[:, Y]
        return np.asarray((middle > low) & (middle < high))

    def strains(self, source: Run, chosen: NDArray[np.int64]) -> Floats:
        """Strain of the mean flow between consecutive frames, ``(f − 1,)``; nan where not known.

        In a cell ∫ √((ε_xx − ε_yy)² + (2ε_xy)²) dt, in a layer that of the slope of displacements,
        if the same grains are there in both frames; elsewhere there is no one strain.
        """
        frames, times = frames_of(source, chosen), np.asarray(source.frames.time)[chosen]
        if source.model.is_cell:
            rate = np.array([shear_rate_of(frame) for frame in frames])
            return np.asarray(0.5 * (rate[1:] + rate[:-1]) * np.diff(times))
        return np.array([self._strain(source, *pair) for pair in pairwise(frames)])

    def _strain(self, source: Run, first: Frame, second: Frame) -> float:
        if self.band is None:
            return np.nan
        try:
            need_same_grains(first, second)
            return abs(strain_and_spin(self.band, model_of(source, second), first, second)[0])
        except PostError:
            return np.nan


def find_bulk(
    source: Run, chosen: NDArray[np.int64], margin: float | None, between: Between | None
) -> Bulk:
    """A cell as a whole; the bulk of a layer between two walls that is periodic in x; else all.

    Args:
        source: The run.
        chosen: The frames.
        margin: As `multicor_cli.post.rheology.rheology`.
        between: Names of the walls below and above; default: those that bound the grains.

    Raises:
        PostError: If a frame has no grain, nothing is left between the margins, or one of the two
            is given and there is no such layer.
    """
    need_grains(source, chosen)
    is_told = margin is not None or between is not None
    if source.model.is_cell:
        if is_told:
            refuse_cell(source.model, "there are no walls", "leave out --margin and --between")
        return Bulk()
    extent = find_extent(source, chosen, between)
    if extent.lower is not None and extent.upper is not None and source.model.period > 0.0:
        return Bulk(find_band(source.model, extent, margin))
    if is_told:
        raise PostError(
            "--margin and --between are about a layer between two walls in a domain that is "
            "periodic in x, which this is not: leave them out, so that all contacts count"
        )
    return Bulk()
