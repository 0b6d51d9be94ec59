"""Dimensionless temperature θ of a bed against the distance η from the wall that heats it."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats
from multicor_cli.post.bins import heights, wall_spans
from multicor_cli.post.rings import reach_of
from multicor_cli.post.source import (
    Frame,
    PostError,
    Run,
    Selection,
    bin_count,
    frame_index,
    frames_of,
    need_grains,
    need_heat,
    refuse_cell,
)
from multicor_cli.post.sums import scatter
from multicor_cli.post.table import Column, Table
from multicor_cli.text import choices

_ROUNDING = 1e-12  # of a mean of equal temperatures, which is to be that temperature


class ThetaTable(Table):
    """θ = (T − T₀)/(T_wall − T₀) of ``n`` grains against η = y/H, and statistics in ``b`` bins.

    y is the distance of a center from the surface of the wall, taken where a grain comes nearest.

    Attributes:
        eta, theta: η and θ of the grains, shape ``(n,)``.
        center: Centers of the bins, shape ``(b,)``.
        mean, spread, lowest, highest: Mean, standard deviation, smallest and largest θ of the
            grains whose center lies in each bin; nan where there is none, shape ``(b,)``.
        count: Number of grains in each bin, shape ``(b,)``.
        scatter: Standard deviation of ``mean`` from frame to frame; nan with one, shape ``(b,)``.
        wall: Name of the wall.
        wall_temperature: T_wall [K].
        reference: T₀ [K].
        height: H [m].
        frame: Index of the frame; of several, of the last one.
        time: Its time [s].
        frames: Indices of all frames.
    """

    def as_dict(self, *, has_grains: bool = False) -> dict[str, Any]:
        """Everything as JSON types, the single grains only if asked for; numbers may be nan."""
        grains = {"eta": self.eta.tolist(), "theta": self.theta.tolist()}
        return super().as_dict() | ({"grains": grains} if has_grains else {})


def theta_eta(
    source: Run,
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
        bins: Number of bins between η = 0 and 1; default: each about one mean diameter wide.
        wall: Name of the wall; default: the only one with a prescribed temperature.
        height: H [m]; default: how far grains reach from the wall in this frame, or the last one.
        reference: T₀ [K]; default: mean of the first frame of the run, weighted by heat capacity.

    Raises:
        PostError: If the run has no heat, there is no such frame or wall, or the wall has no
            temperature of its own or stands beside the grains; or if the run is one of a cell.
        StoreError: If the run cannot be read.
    """
    remedy = "use post profile --of temperature"
    refuse_cell(source.model, "there is no wall from which η could be measured", remedy)
    if selection is None:
        chosen = np.array([frame_index(source.frames, frame)])
    else:
        chosen = selection.indices(source.frames)
    need_grains(source, chosen)
    start = reference
    if start is None:
        need_grains(source, np.array([0]))
        first = source.frames[0]
        thermal = first.model.thermal
        weights = None if thermal is None else thermal.capacity
        start = float(np.average(need_heat(first.temperature), weights=weights))
    if height is not None and not 0.0 < height < np.inf:
        raise PostError(f"the height {height:g} m must be positive and finite")
    if not np.isfinite(start):
        raise PostError(f"the reference temperature {start:g} K must be finite")
    single = [_of_frame(source, each, wall, start) for each in frames_of(source, chosen)]
    number, hot, reach = single[-1].wall, single[-1].hot, single[-1].reach
    full = reach if height is None else height
    count = bin_count(max(round(full / source.model.mean_diameter), 1) if bins is None else bins)
    eta = np.concatenate([one.distance for one in single]) / full
    theta = np.concatenate([one.theta for one in single])
    mean, deviation, lowest, highest, number_of_grains = _statistics(eta, theta, count)
    means = [_statistics(one.distance / full, one.theta, count)[0] for one in single]
    scatters = scatter(np.array(means))
    is_many = chosen.size > 1
    columns = [
        Column("center", "1", (np.arange(count) + 0.5) / count, "eta", "eta"),
        Column("mean", "1", mean, "theta", "theta"),
        Column("spread", "1", deviation, "standard deviation", "standard_deviation"),
        Column("scatter", "1", scatters, "scatter of frames", "scatter_of_frames", is_many),
        Column("lowest", "1", lowest, "min", "min"),
        Column("highest", "1", highest, "max", "max"),
        Column("count", "", number_of_grains),
    ]
    facts = {
        "wall": source.model.walls.names[number], "wall_temperature": hot, "reference": start,
        "height": full, "frame": int(chosen[-1]),
        "time": float(np.asarray(source.frames.time)[chosen[-1]]),
        "frame_count": int(chosen.size),
    }  # fmt: skip
    return ThetaTable(
        columns, facts, [Column("eta", "1", eta), Column("theta", "1", theta)], frames=chosen
    )


class _FrameTheta(NamedTuple):
    """Distances from the wall [m], θ, number and temperature [K] of the wall, grains' reach [m]."""

    distance: Floats
    theta: Floats
    wall: int
    hot: float
    reach: float


def _of_frame(source: Run, frame: Frame, name: str | None, start: float) -> _FrameTheta:
    temperature = need_heat(frame.temperature)
    number = _find_wall(source, frame, name)
    hot = float(need_heat(frame.wall_temperature)[number])
    if abs(hot - start) <= _ROUNDING * abs(start):
        raise PostError(
            f"θ needs a wall that is not at the reference temperature {start:g} K; choose another "
            "with --reference"
        )
    distance, reach = _distances(source, frame, number)
    return _FrameTheta(distance, (temperature - start) / (hot - start), number, hot, reach)


def _find_wall(source: Run, frame: Frame, name: str | None) -> int:
    names = source.model.walls.names
    prescribed = np.flatnonzero(np.isfinite(need_heat(frame.wall_temperature)))
    known = ", ".join(names[w] for w in prescribed) or "none"
    if name is None:
        if not prescribed.size:
            raise PostError("no wall has a temperature in this frame: θ needs one; choose another")
        if prescribed.size != 1:
            raise PostError(
                "choose the wall with --wall: those with a prescribed temperature in this frame "
                f"are: {known}"
            )
        return int(prescribed[0])
    if name not in names:
        raise PostError(f"there is no wall '{name}'; {choices(name, names)}")
    if names.index(name) not in prescribed:
        raise PostError(
            f"the wall '{name}' has no prescribed temperature in this frame; those that have one: "
            f"{known}"
        )
    return names.index(name)


def _distances(source: Run, frame: Frame, wall: int) -> tuple[Floats, float]:
    """Distances of grains from the surface of a wall below or above, and how far they reach [m]."""
    y = heights(frame)
    down, up = reach_of(frame.model, frame)[..., 1]
    bottom, top = float((y + down).min()), float((y + up).max())
    lows, highs = wall_spans(source.model)
    offset, middle = float(frame.wall_position[wall, 1]), float(np.median(y))
    if highs[wall] + offset < middle:
        return np.asarray(y - bottom), top - bottom
    if lows[wall] + offset > middle:
        return np.asarray(top - y), top - bottom
    raise PostError(
        f"η is a height: the wall '{source.model.walls.names[wall]}' is neither below nor above "
        "the grains"
    )


def _statistics(
    eta: Floats, theta: Floats, count: int
) -> tuple[Floats, Floats, Floats, Floats, NDArray[np.int64]]:
    """Mean, standard deviation, smallest, largest and number of θ in each bin of η."""
    inside = np.flatnonzero((eta >= 0.0) & (eta <= 1.0))
    bin_ = np.minimum((eta[inside] * count).astype(np.int64), count - 1)
    number = np.bincount(bin_, minlength=count)
    lowest, highest = np.full(count, np.inf), np.full(count, -np.inf)
    np.minimum.at(lowest, bin_, theta[inside])
    np.maximum.at(highest, bin_, theta[inside])
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.bincount(bin_, weights=theta[inside], minlength=count) / number
        squares = (theta[inside] - mean[bin_]) ** 2
        variance = np.bincount(bin_, weights=squares, minlength=count) / number
    empty = number == 0
    lowest[empty] = highest[empty] = np.nan
    return mean, np.sqrt(variance), lowest, highest, number
