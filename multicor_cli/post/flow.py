"""The mean flow as a function of height, and velocities relative to it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli.post.source import FrameSource, GrainFrame
from multicor_cli.post.sums import Bins, Values, average, sum_means
from multicor_cli.state.model import Floats


@dataclass(frozen=True)
class MeanFlow:
    """Mean velocity at each height: linear between the centers of the bins, constant beyond.

    Attributes:
        y: Centers of the bins in which there are grains, above the origin [m], shape ``(b,)``.
        velocity: Mean velocities [m/s], shape ``(b, 2)``.
    """

    y: Floats
    velocity: Floats

    def fluctuation(self, frame: GrainFrame, origin: float) -> Floats:
        """Velocities of the grains of a frame relative to the mean flow at their height [m/s], shape ``(n, 2)``."""
        heights = np.asarray(frame.position, np.float64)[:, 1] - origin
        mean = [np.interp(heights, self.y, column) for column in self.velocity.T]
        return np.asarray(np.asarray(frame.velocity, np.float64)[:, :2] - np.column_stack(mean))


@dataclass(frozen=True)
class RelativeFrame:
    """A frame as seen from the mean flow; only what profiles of fluctuations need.

    Attributes:
        velocity: Velocities relative to the mean flow [m/s], shape ``(n, 2)``.
    """

    frame: GrainFrame
    velocity: NDArray[Any]

    def __getattr__(self, name: str) -> Any:
        return getattr(self.frame, name)


def mean_flow(source: FrameSource, chosen: NDArray[np.int64], bins: Bins) -> MeanFlow:
    """The mean flow over the frames ``chosen``; grains count with the area that lies in a bin."""
    sums = sum_means(source, chosen, bins, (_component(0), _component(1)))
    velocity = np.column_stack([average(found)[0] for found in sums])
    known = np.isfinite(velocity).all(axis=1)
    return MeanFlow(bins.centers[known], velocity[known])


def _component(axis: int) -> Values:
    return lambda frame: np.asarray(frame.velocity[:, axis], np.float64)
