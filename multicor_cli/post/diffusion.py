"""How far grains stray from the mean flow: mean square displacements, and self-diffusion."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats
from multicor_cli.post.bins import Between, find_extent, heights
from multicor_cli.post.bulk import find_band, refuse_walls_of_cell, strain_and_spin
from multicor_cli.post.conductivity import intervals_to_forget
from multicor_cli.post.flow import fit_flow
from multicor_cli.post.lattice import sheared_between
from multicor_cli.post.source import (
    Frame,
    PostError,
    Run,
    Selection,
    chosen_frames,
    frames_of,
    frames_told,
    need_grains,
    need_same_grains,
    times_of,
)
from multicor_cli.post.sums import spread
from multicor_cli.post.table import Column, Table, average_ratios

_LAGS = 40  # of a table, at most


def lags_of(frames: int) -> NDArray[np.int64]:
    """Lags between frames, up to half of them, evenly spaced on a logarithmic scale, ``(l,)``."""
    lags = np.geomspace(1, max(1, (frames - 1) // 2), _LAGS)
    return np.unique(lags.round().astype(np.int64))


class Diffusion(Table):
    """Mean square displacements beside the mean flow against the time lag; ``l`` lags.

    In a cell displacements beside the mean flow are those of all steps, ∫ c dt. Between walls they
    are displacements between frames less those of the mean flow at the height half-way between both
    (`multicor_cli.post.flow.MeanFlow`, of all these frames): frames should be so close that a layer
    is sheared by much less than 1 between two. Grains count that lie in the bulk when a lag begins.

    The self-diffusion D is half of what a mean square grows by from one frame to the next, counted
    from some frames before, in which the flow is strained by 1 (``counted_from`` of them): grains
    first have to forget how they moved. So it holds where the mean square has become a straight
    line, which the figure shows; a wall ends it at about a sixth of the squared height.

    Attributes:
        lag: Time lags [s], shape ``(l,)``.
        strain: Strain of the mean flow in them, on average.
        msd_x, msd_y: Mean square displacements [m²].
        error_x, error_y: Their standard errors, nan where the lags that begin at different frames
            are too few.
        origins: How many lags begin at a frame.
        diffusion: D along x and y [m²/s]; ``diffusion_error``, standard errors.
        shear_rate: Of the mean flow [1/s].
        diameter: Mean diameter [m].
        counted_from: See above.
    """


def diffusion(
    source: Run,
    selection: Selection | None = None,
    *,
    margin: float | None = None,
    between: Between | None = None,
) -> Diffusion:
    """Mean square displacements and self-diffusion in a cell, or in the bulk of a layer.

    Args:
        source: The run.
        selection: Which frames; default: the later half of the last stage.
        margin: As `multicor_cli.post.rheology.rheology`.
        between: Names of the walls below and above; default: those that bound the grains.

    Raises:
        PostError: If fewer than three frames are selected, grains come or go, or the run is neither
            one of a cell nor of a layer between two walls that is periodic in x; or if a cell is
            given a margin or walls.
        StoreError: If the run cannot be read.
    """
    chosen = chosen_frames(source, selection)
    need_grains(source, chosen)
    if chosen.size < 3:
        raise PostError(
            f"diffusion needs three frames, not {chosen.size}: choose more with --from or --frames"
        )
    times = times_of(source, chosen)
    if source.model.is_cell:
        refuse_walls_of_cell(margin, between)
        way = np.array([np.asarray(f.nonaffine, np.float64) for f in frames_of(source, chosen)])
        everyone = np.ones(way.shape[:2], np.bool_)
        ways = _Ways(way - way[0], everyone, sheared_between(source, times))
    else:
        ways = _between_walls(source, chosen, times, margin, between)
    rate, back = float(ways.strain.sum() / (times[-1] - times[0])), intervals_to_forget(ways.strain)
    found = average_ratios(
        lambda sums: {axis: sums[:, k] / sums[:, 2] for k, axis in enumerate("xy")},
        _growth(ways, np.diff(times), back),
        times,
    )
    rows = np.array([_mean_squares(ways, times, lag) for lag in lags_of(chosen.size).tolist()])
    lag, strain, x, error_x, y, error_y, origins = rows.T
    facts = {
        "diffusion": [found.mean[axis] for axis in "xy"],
        "diffusion_error": [float(found.spread[axis].error) for axis in "xy"],
        "shear_rate": rate, "diameter": source.model.mean_diameter, "counted_from": back,
        **frames_told(source, chosen),
    }  # fmt: skip
    columns = [
        Column("lag", "s", lag),
        Column("strain", "1", strain),
        Column("msd_x", "m2", x, "mean square x"),
        Column("error_x", "m2", error_x, "standard error"),
        Column("msd_y", "m2", y, "mean square y"),
        Column("error_y", "m2", error_y, "standard error"),
        Column("origins", "", origins.astype(np.int64)),
    ]
    return Diffusion(columns, facts, frames=chosen)


class _Ways(NamedTuple):
    """Ways of the grains beside the mean flow, since the first frame.

    Attributes:
        way: At each of ``f`` frames [m], shape ``(f, n, 2)``.
        counts: Which grains are in the bulk, shape ``(f, n)``.
        strain: Of the mean flow between two frames, shape ``(f − 1,)``.
    """

    way: Floats
    counts: NDArray[np.bool_]
    strain: Floats


@dataclass(frozen=True)
class _HalfWay:
    """Two frames as one half-way: where grains and walls are, and how fast they have moved."""

    position: Floats
    velocity: Floats
    wall_position: Floats

    @classmethod
    def between(cls, first: Frame, second: Frame, lapse: float) -> _HalfWay:
        start, end = (np.asarray(f.unwrapped, np.float64)[:, :2] for f in (first, second))
        walls = 0.5 * (np.asarray(first.wall_position) + np.asarray(second.wall_position))
        return cls(0.5 * (start + end), (end - start) / lapse, walls)


def _between_walls(
    source: Run,
    chosen: NDArray[np.int64],
    times: Floats,
    margin: float | None,
    between: Between | None,
) -> _Ways:
    extent, model = find_extent(source, chosen, between), source.model
    if extent.lower is None or extent.upper is None or not model.period > 0.0:
        raise PostError(
            "diffusion needs a mean flow that depends on the height alone: a cell, or a layer "
            "between two walls in a domain that is periodic in x"
        )
    band = find_band(model, extent, margin)
    frames, lapses = list(frames_of(source, chosen)), np.diff(times).tolist()
    is_in_bulk = []
    for frame in frames:
        (low, high), y = band.edges(frame), heights(frame)
        is_in_bulk.append((y > low) & (y < high))
    weight = frames[0].model.disc_radius ** 2
    halves: list[Any] = []
    strain = []
    for (first, second), lapse, bulk in zip(pairwise(frames), lapses, is_in_bulk, strict=False):
        need_same_grains(first, second)
        half = _HalfWay.between(first, second, lapse)
        rest = _without_line(half.position[:, 1], half.velocity, weight * bulk)
        halves.append(replace(half, velocity=rest))
        strain.append(abs(strain_and_spin(band, second.model, first, second)[0]))
    flow = fit_flow(extent, model.mean_diameter, ((half, weight) for half in halves))
    steps = [flow.fluctuation(half) * dt for half, dt in zip(halves, lapses, strict=True)]
    way = np.concatenate([np.zeros((1, weight.size, 2)), np.cumsum(steps, axis=0)])
    return _Ways(way, np.array(is_in_bulk), np.array(strain))


def _without_line(y: Floats, velocity: Floats, weight: Floats) -> Floats:
    """Velocities [m/s] without what is linear in the height y [m], both of shape ``(n, …)``.

    An interval shears the layer a little faster or more slowly than the mean of all, as a cell does
    whose rate has been taken out of its displacements: that is no diffusion. Squares become smaller
    by two parts in the number of grains that have a ``weight``.
    """
    if np.count_nonzero(weight) < 3:
        return velocity
    share = weight / weight.sum()
    away = (y - (share * y).sum())[:, np.newaxis]
    share = share[:, np.newaxis]
    mean, moment = (share * velocity).sum(axis=0), float((share * away * away).sum())
    if moment > 0.0:
        slope = (share * away * velocity).sum(axis=0) / moment
        mean = mean + slope * away
    return np.asarray(velocity - mean)


def _squares(ways: _Ways, start: int, end: int) -> Floats:
    """Mean squares along x and y from one frame to another [m²], shape ``(2,)``."""
    moved = (ways.way[end] - ways.way[start])[ways.counts[start]]
    if not len(moved):
        raise PostError("there is no grain in the bulk: lower --margin")
    return np.asarray((moved * moved).mean(axis=0))


def _growth(ways: _Ways, lapse: Floats, back: int) -> Floats:
    """Half of what mean squares grow by in each interval, and its length where it counts."""
    rows = np.zeros((lapse.size, 3))
    for k in range(back - 1, lapse.size):
        start = k + 1 - back
        rows[k, :2] = 0.5 * (_squares(ways, start, k + 1) - _squares(ways, start, k))
        rows[k, 2] = lapse[k]
    return rows


def _mean_squares(ways: _Ways, times: Floats, lag: int) -> tuple[float, ...]:
    """A row of the table."""
    starts = np.arange(times.size - lag)
    squares = np.array([_squares(ways, k, k + lag) for k in starts.tolist()])
    strain = np.concatenate([[0.0], np.cumsum(ways.strain)])
    error = spread(squares, times[starts]).error
    x, y = squares.mean(axis=0).tolist()
    return (
        float((times[lag:] - times[:-lag]).mean()), float((strain[lag:] - strain[:-lag]).mean()),
        x, float(error[0]), y, float(error[1]), float(starts.size),
    )  # fmt: skip
