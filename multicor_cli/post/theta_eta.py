"""Dimensionless temperature θ of a bed against the dimensionless distance η from the wall that heats it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats
from multicor_cli.post.bins import BIN_LIMIT, wall_spans
from multicor_cli.post.source import (
    FrameSource,
    GrainFrame,
    PostError,
    Selection,
    Table,
    frame_index,
    model_of,
    need_grains,
    need_heat,
    rows_of,
)
from multicor_cli.post.sums import scatter
from multicor_cli.text import choices

_ROUNDING = 1e-12  # of a mean of equal temperatures, which is to be that temperature


@dataclass(frozen=True, repr=False)
class ThetaTable(Table):
    """θ = (T − T₀)/(T_wall − T₀) of every grain against η = y/H, and its statistics in bins of η; ``n`` grains, ``b`` bins.

    y is the distance of the center of a grain from the surface of the wall: from the point of a grain that is nearest to it.

    Attributes:
        eta: η of the grains, shape ``(n,)``.
        theta: θ of the grains, shape ``(n,)``.
        center: Centers of the bins, shape ``(b,)``.
        mean: Mean θ of the grains whose center lies in each bin; nan where there is none, shape ``(b,)``.
        spread: Standard deviation of θ among these grains, shape ``(b,)``.
        lowest: Smallest θ of a grain in each bin, shape ``(b,)``.
        highest: Largest θ of a grain in each bin, shape ``(b,)``.
        count: Number of grains in each bin, shape ``(b,)``.
        wall: Name of the wall.
        wall_temperature: T_wall [K].
        reference: T₀ [K].
        height: H [m].
        frame: Index of the frame; of several, of the last one.
        time: Its time [s].
        frames: Indices of all frames.
        scatter: Standard deviation of the mean of each bin from frame to frame; nan with one frame, shape ``(b,)``.
    """

    eta: Floats
    theta: Floats
    center: Floats
    mean: Floats
    spread: Floats
    lowest: Floats
    highest: Floats
    count: NDArray[np.int64]
    wall: str
    wall_temperature: float
    reference: float
    height: float
    frame: int
    time: float
    frames: NDArray[np.int64]
    scatter: Floats

    @property
    def headings(self) -> tuple[str, ...]:
        """Names of the columns of `rows` with their units; of a single frame there is no scatter."""
        scattered = ("scatter of frames [1]",) if self.frames.size > 1 else ()
        return "eta [1]", "theta [1]", "standard deviation [1]", *scattered, "min [1]", "max [1]", "count"

    @property
    def rows(self) -> list[tuple[float, ...]]:
        """One row per bin; nan where there is no grain."""
        scattered = (self.scatter,) if self.frames.size > 1 else ()
        return rows_of((self.center, self.mean, self.spread, *scattered, self.lowest, self.highest, self.count))

    @property
    def detail_headings(self) -> tuple[str, ...]:
        """Names of the columns of `detail_rows` with their units."""
        return "eta [1]", "theta [1]"

    @property
    def detail_rows(self) -> list[tuple[float, ...]]:
        """One row per grain and frame."""
        return list(zip(self.eta.tolist(), self.theta.tolist(), strict=True))

    def as_dict(self, *, has_grains: bool = False) -> dict[str, Any]:
        """Everything as JSON types, the single grains only if asked for; numbers may be nan."""
        data = {
            "wall": self.wall,
            "wall_temperature": self.wall_temperature,
            "reference": self.reference,
            "height": self.height,
            "frame": self.frame,
            "time": self.time,
            "frame_count": int(self.frames.size),
            "eta": self.center.tolist(),
            "theta": self.mean.tolist(),
            "standard_deviation": self.spread.tolist(),
            "scatter_of_frames": self.scatter.tolist(),
            "min": self.lowest.tolist(),
            "max": self.highest.tolist(),
            "count": self.count.tolist(),
        }
        return data | ({"grains": {"eta": self.eta.tolist(), "theta": self.theta.tolist()}} if has_grains else {})


def theta_eta(
    source: FrameSource,
    frame: int = -1,
    *,
    selection: Selection | None = None,
    bins: int | None = None,
    wall: str | None = None,
    height: float | None = None,
    reference: float | None = None,
) -> ThetaTable:
    """θ against η of one frame, or of the grains of several, each frame with its own T_wall.

    Args:
        source: The run.
        frame: Index of the frame; negative counts from the last one.
        selection: Several frames instead of one.
        bins: Number of bins between η = 0 and 1; default: as many as make a bin about one mean diameter wide.
        wall: Name of the wall; default: the only one with a prescribed temperature.
        height: H [m]; default: how far the grains reach from the surface of the wall in this frame, or in the last of several.
        reference: T₀ [K]; default: mean temperature of the first frame of the run, weighted by heat capacity.

    Raises:
        PostError: If the run has no heat, there is no such frame or wall, or the wall has no temperature of its own or
            stands beside the grains.
        StoreError: If the run cannot be read.
    """
    chosen = np.array([frame_index(source.frames, frame)]) if selection is None else selection.indices(source.frames)
    need_grains(source, chosen)
    start = _first_temperature(source) if reference is None else reference
    if height is not None and not height > 0.0:
        raise PostError(f"the height {height:g} m must be positive")
    found = [_of_frame(source, source.frames[int(k)], wall, start) for k in chosen]
    number, hot, reach = found[-1].wall, found[-1].hot, found[-1].reach
    full = reach if height is None else height
    count = bins if bins is not None else max(round(full / source.model.mean_diameter), 1)
    if not 1 <= count <= BIN_LIMIT:
        raise PostError(f"{count} bins: choose between 1 and {BIN_LIMIT}")
    eta, theta = np.concatenate([one.distance for one in found]) / full, np.concatenate([one.theta for one in found])
    return ThetaTable(
        eta,
        theta,
        (np.arange(count) + 0.5) / count,
        *_statistics(eta, theta, count),
        wall=source.model.walls.names[number],
        wall_temperature=hot,
        reference=start,
        height=full,
        frame=int(chosen[-1]),
        time=float(np.asarray(source.frames.time)[chosen[-1]]),
        frames=chosen,
        scatter=scatter(np.array([_statistics(one.distance / full, one.theta, count)[0] for one in found])),
    )


class _FrameTheta(NamedTuple):
    """Distances from the wall [m] and θ of the grains, index of the wall, its temperature [K], how far the grains reach [m]."""

    distance: Floats
    theta: Floats
    wall: int
    hot: float
    reach: float


def _of_frame(source: FrameSource, frame: GrainFrame, name: str | None, start: float) -> _FrameTheta:
    temperature = need_heat(frame.temperature)
    number = _find_wall(source, frame, name)
    hot = float(need_heat(frame.wall_temperature)[number])
    if abs(hot - start) <= _ROUNDING * abs(start):
        raise PostError(f"θ needs a wall that is not at the reference temperature {start:g} K; choose another with --reference")
    distance, reach = _distances(source, frame, number)
    return _FrameTheta(distance, (temperature - start) / (hot - start), number, hot, reach)


def _first_temperature(source: FrameSource) -> float:
    need_grains(source, np.array([0]))
    thermal = model_of(source, source.frames[0]).thermal
    weights = None if thermal is None else thermal.capacity
    return float(np.average(need_heat(source.frames[0].temperature), weights=weights))


def _find_wall(source: FrameSource, frame: GrainFrame, name: str | None) -> int:
    names = source.model.walls.names
    prescribed = np.flatnonzero(np.isfinite(need_heat(frame.wall_temperature)))
    known = ", ".join(names[w] for w in prescribed) or "none"
    if name is None:
        if prescribed.size != 1:
            raise PostError(f"choose the wall with --wall: those with a prescribed temperature in this frame are: {known}")
        return int(prescribed[0])
    if name not in names:
        raise PostError(f"there is no wall '{name}'; {choices(name, names)}")
    if names.index(name) not in prescribed:
        raise PostError(f"the wall '{name}' has no prescribed temperature in this frame; those that have one: {known}")
    return names.index(name)


def _distances(source: FrameSource, frame: GrainFrame, wall: int) -> tuple[Floats, float]:
    """Distances of the grains from the surface of a wall below or above them, and how far the grains reach from it [m]."""
    y = np.asarray(frame.position, np.float64)[:, 1]
    radius = model_of(source, frame).grains.radius
    bottom, top = float((y - radius).min()), float((y + radius).max())
    lows, highs = wall_spans(source.model)
    offset, middle = float(frame.wall_position[wall, 1]), float(np.median(y))
    if highs[wall] + offset < middle:
        return np.asarray(y - bottom), top - bottom
    if lows[wall] + offset > middle:
        return np.asarray(top - y), top - bottom
    raise PostError(f"η is a height: the wall '{source.model.walls.names[wall]}' is neither below nor above the grains")


def _statistics(eta: Floats, theta: Floats, count: int) -> tuple[Floats, Floats, Floats, Floats, NDArray[np.int64]]:
    """Mean, standard deviation, smallest, largest and number of θ in each bin of η."""
    inside = np.flatnonzero((eta >= 0.0) & (eta <= 1.0))
    bin_ = np.minimum((eta[inside] * count).astype(np.int64), count - 1)
    number = np.bincount(bin_, minlength=count)
    lowest, highest = np.full(count, np.inf), np.full(count, -np.inf)
    np.minimum.at(lowest, bin_, theta[inside])
    np.maximum.at(highest, bin_, theta[inside])
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.bincount(bin_, weights=theta[inside], minlength=count) / number
        variance = np.bincount(bin_, weights=(theta[inside] - mean[bin_]) ** 2, minlength=count) / number
    empty = number == 0
    lowest[empty] = highest[empty] = np.nan
    return mean, np.sqrt(variance), lowest, highest, number
