"""Dimensionless temperature θ of a bed against the dimensionless distance η from the wall that heats it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats
from multicor_cli.post.bins import BIN_LIMIT
from multicor_cli.post.extent import wall_spans
from multicor_cli.post.source import FrameSource, GrainFrame, PostError, frame_index, model_of, need_grains, need_heat, rows_of

_ROUNDING = 1e-12  # of a mean of equal temperatures, which is to be that temperature


@dataclass(frozen=True)
class ThetaTable:
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
        frame: Index of the frame.
        time: Time of the frame [s].
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

    @property
    def headings(self) -> tuple[str, ...]:
        """Names of the columns of `rows` with their units."""
        return "eta [1]", "theta [1]", "standard deviation [1]", "min [1]", "max [1]", "count"

    @property
    def rows(self) -> list[tuple[float, ...]]:
        """One row per bin; nan where there is no grain."""
        return rows_of((self.center, self.mean, self.spread, self.lowest, self.highest, self.count))

    @property
    def detail_headings(self) -> tuple[str, ...]:
        """Names of the columns of `detail_rows` with their units."""
        return "eta [1]", "theta [1]"

    @property
    def detail_rows(self) -> list[tuple[float, ...]]:
        """One row per grain."""
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
            "eta": self.center.tolist(),
            "theta": self.mean.tolist(),
            "standard_deviation": self.spread.tolist(),
            "min": self.lowest.tolist(),
            "max": self.highest.tolist(),
            "count": self.count.tolist(),
        }
        return data | ({"grains": {"eta": self.eta.tolist(), "theta": self.theta.tolist()}} if has_grains else {})


def theta_eta(
    source: FrameSource,
    frame: int = -1,
    *,
    bins: int | None = None,
    wall: str | None = None,
    height: float | None = None,
    reference: float | None = None,
) -> ThetaTable:
    """θ against η of one frame.

    Args:
        source: The run.
        frame: Index of the frame; negative counts from the last one.
        bins: Number of bins between η = 0 and 1; default: as many as make a bin about one mean diameter wide.
        wall: Name of the wall; default: the only one with a prescribed temperature.
        height: H [m]; default: how far the grains reach from the surface of the wall in this frame.
        reference: T₀ [K]; default: mean temperature of the first frame of the run, weighted by heat capacity.

    Raises:
        PostError: If the run has no heat, there is no such frame or wall, or the wall has no temperature of its own or
            stands beside the grains.
        StoreError: If the run cannot be read.
    """
    index = frame_index(source.frames, frame)
    chosen = source.frames[index]
    temperature = need_heat(chosen.temperature)
    number = _find_wall(source, chosen, wall)
    hot = float(need_heat(chosen.wall_temperature)[number])
    start = _first_temperature(source) if reference is None else reference
    if abs(hot - start) <= _ROUNDING * abs(start):
        raise PostError(f"θ needs a wall that is not at the reference temperature {start:g} K; choose another with --reference")
    distance, reach = _distances(source, chosen, number)
    if height is not None and not height > 0.0:
        raise PostError(f"the height {height:g} m must be positive")
    full = reach if height is None else height
    eta, theta = distance / full, (temperature - start) / (hot - start)
    count = bins if bins is not None else max(round(full / source.model.mean_diameter), 1)
    if not 1 <= count <= BIN_LIMIT:
        raise PostError(f"{count} bins: choose between 1 and {BIN_LIMIT}")
    return ThetaTable(
        eta,
        theta,
        (np.arange(count) + 0.5) / count,
        *_statistics(eta, theta, count),
        wall=source.model.walls.names[number],
        wall_temperature=hot,
        reference=start,
        height=full,
        frame=index,
        time=float(np.asarray(source.frames.time)[index]),
    )


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
        raise PostError(f"there is no wall '{name}'; choose from: {', '.join(names)}")
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
