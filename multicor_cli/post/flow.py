"""The mean flow as a function of height, and velocities relative to it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats
from multicor_cli.post.bins import Bins, Extent, heights, make_bins
from multicor_cli.post.lattice import relative_velocity
from multicor_cli.post.source import Frame, Run, frames_of, model_of

_CELL_LIMIT = 1000
# Weight of the slopes beside that of the grains: it decides only what no grain does
_SMOOTHING = 1e-12


@dataclass(frozen=True)
class MeanFlow:
    """Mean velocity over the height: straight lines between knots a fixed part of it apart.

    The lines have the smallest squares of the fluctuations of the grains about them, each weighted
    by its area and placed at its center. So a velocity that is linear in the height is found
    exactly, up to the walls; an average over bins would leave part of the shear in the
    fluctuations. The outermost lines go on for one cell beyond the walls.

    Attributes:
        extent: Where heights are measured from; the knots move with the walls.
        velocity: Velocities at the knots from the origin to the full height [m/s], ``(k, 2)``.
    """

    extent: Extent
    velocity: Floats

    def fluctuation(self, frame: Frame) -> Floats:
        """Velocities of grains relative to the mean flow at their centers [m/s], ``(n, 2)``."""
        cell, part = _locate(frame, self.extent, len(self.velocity) - 1)
        part = part[:, np.newaxis]
        mean = (1.0 - part) * self.velocity[cell] + part * self.velocity[cell + 1]
        return np.asarray(_velocities(frame) - mean)


class CellFlow:
    """The mean flow of a cell, whose gradient every frame has."""

    def fluctuation(self, frame: Frame) -> Floats:
        """Velocities of grains relative to the mean flow at their centers [m/s], ``(n, 2)``."""
        return relative_velocity(frame)


@dataclass(frozen=True)
class RelativeFrame:
    """A frame for profiles of fluctuations: velocity relative to the mean flow [m/s] ``(n, 2)``."""

    frame: Frame
    velocity: NDArray[Any]

    def __getattr__(self, name: str) -> Any:
        return getattr(self.frame, name)


def mean_flow(source: Run, chosen: NDArray[np.int64], bins: Bins) -> MeanFlow | CellFlow:
    """The mean flow over the frames ``chosen``, from wall to wall whatever the bins leave out.

    That of a cell is the one that strains it, in each frame.

    Its knots are as far apart as the bins, but not farther than a mean diameter: coarse bins would
    count the shear as fluctuation. Squares of fluctuations come out too small by about the number
    of knots over that of the grains, times that of the frames with independent velocities; so a
    single frame of a layer that is 20 grains long lacks one part in 20.
    """
    extent = bins.extent
    if extent.is_cell:
        return CellFlow()
    spacing = min(bins.width, source.model.mean_diameter)
    weighted = ((f, model_of(source, f).grains.radius ** 2) for f in frames_of(source, chosen))
    return fit_flow(extent, spacing, weighted)


def fit_flow(extent: Extent, spacing: float, weighted: Iterable[tuple[Frame, Floats]]) -> MeanFlow:
    """The mean flow of frames whose grains have weights, by knots about ``spacing`` apart [m]."""
    count = max(round(min(extent.height / spacing, _CELL_LIMIT)), 1)
    below, above, across, everything = np.zeros(count), np.zeros(count), np.zeros(count), 0.0
    right = np.zeros((count + 1, 2))
    for frame, weight in weighted:
        cell, part = _locate(frame, extent, count)
        everything += weight.sum()
        factors = ((1.0 - part) ** 2, part**2, part * (1.0 - part))
        for total, factor in zip((below, above, across), factors, strict=True):
            total += np.bincount(cell, weight * factor, minlength=count)
        for axis, speed in enumerate(_velocities(frame).T):
            right[:-1, axis] += np.bincount(cell, weight * (1.0 - part) * speed, minlength=count)
            right[1:, axis] += np.bincount(cell, weight * part * speed, minlength=count)
    smoothing = _SMOOTHING * everything / count
    # each cell adds to its lower knot, to its upper knot, and between the two
    beside = across - smoothing
    matrix = np.diag(beside, 1) + np.diag(beside, -1)
    own = np.append(below + smoothing, 0.0) + np.append(0.0, above + smoothing)
    matrix[np.diag_indices_from(matrix)] += own
    return MeanFlow(extent, np.asarray(np.linalg.solve(matrix, right), np.float64))


def fluctuations(source: Run, frame: int) -> Floats:
    """Velocities relative to the mean horizontal flow of the same frame [m/s], shape ``(n, 2)``.

    In a cell they are those relative to its mean flow.
    """
    chosen = np.array([frame])
    flow = mean_flow(source, chosen, make_bins(source, chosen))
    if isinstance(flow, MeanFlow):
        flow.velocity[:, 1] = 0.0
    return flow.fluctuation(source.frames[frame])


def _locate(frame: Frame, extent: Extent, count: int) -> tuple[NDArray[np.int64], Floats]:
    """Cell of each grain between two knots, and where in it the center is: 0 … 1, or −1 … 2."""
    place = (heights(frame) - extent.origin(frame)) * (count / extent.span(frame))
    cell = np.clip(np.floor(place).astype(np.int64), 0, count - 1)
    return cell, np.clip(place - cell, -1.0, 2.0)  # or one grain far away would outweigh all others


def _velocities(frame: Frame) -> Floats:
    return np.asarray(frame.velocity, np.float64)[:, :2]
