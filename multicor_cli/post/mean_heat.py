"""Mean heat flux in a cell under a mean gradient of temperature: what conducts, and what mixes."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model import Model
from multicor_cli.model.books import GRADIENT_BOOKS
from multicor_cli.model.cell import over_windows
from multicor_cli.model.columns import XX, YY
from multicor_cli.model.model import Floats
from multicor_cli.post.conductivity import thickness_of
from multicor_cli.post.lattice import strains_of
from multicor_cli.post.source import (
    PostError,
    Run,
    Selection,
    bounds_of_intervals,
    frames_of,
    frames_told,
    need_grains,
)
from multicor_cli.post.table import Quantity, TimeTable, average_ratios, sums_between

WAYS = ("contacts", "gas", "radiation", "motion")
"""What carries heat."""

SHARES = tuple(Quantity(f"share_{way}", f"share of {way}") for way in WAYS)
"""What each has of the flux."""

_MEASURED = (
    Quantity("along", "heat flow along the gradient, over it", r"K_\parallel", "W/K"),
    Quantity("across", "heat flow across it, over the gradient", r"K_\perp", "W/K"),
)
_OF_DISCS = (Quantity("conductivity", "effective conductivity", "k", "W/(m K)"),)
_MORE = (
    *SHARES,
    Quantity("diffusivity", "thermal diffusivity without motion", r"\alpha", "m2/s"),
    Quantity("mixing", "diffusivity by motion", r"D_T", "m2/s"),
    Quantity("self_diffusion", "self-diffusion of grains along the gradient", "D", "m2/s"),
    Quantity("peclet", "Péclet number (rate × d²/diffusivity)", r"\mathrm{Pe}"),
    Quantity("fluctuation", "temperature fluctuation over that of a diameter", r"T'/(|G|d)"),
)
FLUX_QUANTITIES = (*_MEASURED, *_OF_DISCS, *_MORE)
"""What `mean_heat` measures, in the order of the table; the conductivity of discs of one thickness
only."""

FORGOTTEN = 1.0
"""Strain in which grains forget how they moved: over less they do not diffuse yet."""

_SUMS = (
    "window", "area", *(f"strain_{k}" for k in ("xx", "yy", "xy")),
    *(entry.name for entry in GRADIENT_BOOKS),
    "spreading", "lapse", "square", "grains",
)  # fmt: skip


class MeanHeat(TimeTable):
    """Mean heat flux of a cell with a mean gradient G; ``r`` intervals between frames.

    The flux is that of all steps, from the time series. K is the heat flow per length of the plane
    over |G|: positive along the gradient if heat flows down it, and across it if it flows to the
    right of that (under a gradient along x: K_xx and K_yx; along y: K_yy and −K_xy). Discs of one
    thickness h have the conductivity k = K/h along it. What grains carry is C (T − ⟨T⟩) times their
    velocity beside the mean flow.

    Diffusivities are K A/ΣC, α of all but motion. The Péclet number is the shear rate
    √((L_xx − L_yy)² + L_xy²) times d̄²/α. The self-diffusion D is half of what the mean square of
    the displacements beside the mean flow along G grows by in an interval, counted from some
    intervals before, in which the cell is strained by 1 (``counted_from`` of them): grains first
    have to forget how they moved. The fluctuation is the root mean square of T − ⟨T⟩ at the ends
    of the intervals.

    Attributes:
        time: Ends of the intervals [s], shape ``(r,)``.
        values: Each of `FLUX_QUANTITIES` by name, nan where not known, shape ``(r,)``.
        mean: Averages over the intervals: ratios of sums, not means of ratios.
        spread: Their standard errors and drifts; see `multicor_cli.post.sums.spread`.
        gradient: G (x, y) [K/m].
        thickness: That of the discs [m]; nan of spheres, and of discs of several thicknesses.
        counted_from: How many intervals before each one displacements begin.
        frames: Indices of the frames.
        times: Times of the first and last frame [s].
    """

    KEYS = (
        "gradient", "thickness", "counted_from", "frame_count", "times",
        "units", "mean", "standard_error", "drift", "drift_error", "note", "time", "values",
    )  # fmt: skip


def mean_heat(source: Run, selection: Selection | None = None) -> MeanHeat:
    """The mean heat flux under the mean gradient of a run, over time and on average.

    Args:
        source: The run, of a cell with ``heat.gradient``.
        selection: Which frames bound the intervals; default: the later half of the last stage.

    Raises:
        PostError: If the run has no mean gradient, or fewer than two frames are selected.
        StoreError: If the run cannot be read.
    """
    model = source.model
    if not any(model.heat_gradient):
        raise PostError(
            "the run has no mean gradient of temperature: give the [heat] of a cell a gradient, "
            "as [0.0, 1000.0], and run it again"
        )
    chosen = bounds_of_intervals(source, (selection or Selection()).indices(source.frames))
    need_grains(source, chosen)
    if chosen.size < 2:
        raise PostError(
            "a mean flux needs two frames; only one is selected: choose more with --from or "
            "--frames"
        )
    times = np.asarray(source.frames.time)[chosen]
    of_series = _of_series(source, times)
    back = intervals_to_forget(_shear_rate(*of_series[:, 2:5].T))
    sums = np.column_stack([of_series, _of_frames(source, chosen, times, back)])
    found = average_ratios(lambda rows: _derive(model, rows), sums, times)
    thickness = thickness_of(model)
    facts = {
        "gradient": model.heat_gradient, "thickness": thickness, "counted_from": back,
        **frames_told(source, chosen),
    }  # fmt: skip
    shown = FLUX_QUANTITIES if np.isfinite(thickness) else (*_MEASURED, *_MORE)
    quantities = [q.over_time(found.values[q.name]) for q in shown]
    parts: dict[str, Any] = {
        of: {q.name: getattr(found, of)[q.name] for q in shown} for of in ("mean", "spread")
    }
    return MeanHeat(times[1:], quantities, facts, frames=chosen, **parts)


def intervals_to_forget(strain: Floats) -> int:
    """How many intervals a flow has to be strained in for `FORGOTTEN`, at most half of them all.

    ``strain`` is that in each interval, shape ``(r,)``; of what is at rest 1.
    """
    mean, most = float(strain.mean()), max(1, (strain.size + 1) // 2)
    return int(np.clip(np.ceil(FORGOTTEN / mean), 1, most)) if mean > 0.0 else 1


def _of_series(source: Run, times: Floats) -> Floats:
    """The sums `_SUMS` that the time series knows, in each interval, shape ``(r, …)``."""
    series = source.series
    time = np.asarray(series["time"])
    duration, sides = np.diff(time, prepend=0.0), np.asarray(series["wall_position"])[:, 0]
    area = over_windows(sides[:, XX] * sides[:, YY])
    books = np.column_stack([np.asarray(series[str(entry.series)]) for entry in GRADIENT_BOOKS])
    gained = np.diff(books, axis=0, prepend=np.zeros((1, books.shape[1])))
    strain = np.diff(strains_of(source).strain, axis=0, prepend=0.0)
    rows = np.column_stack([duration, duration * area, strain, gained])
    return sums_between(time, times, rows)


def _of_frames(source: Run, chosen: NDArray[np.int64], times: Floats, back: int) -> Floats:
    """The others: what displacements spread by and the time of it, and squares of temperatures.

    Displacements begin ``back`` intervals before each interval; those without are left out.
    """
    gradient = np.array(source.model.heat_gradient)
    way, squares = [], []
    for frame in frames_of(source, chosen):
        way.append(frame.nonaffine @ gradient / np.hypot(*gradient))
        temperature = np.asarray(frame.temperature, np.float64)
        squares.append(((temperature - temperature.mean()) ** 2).sum())
    rows = []
    for k, (start, end) in enumerate(pairwise(times)):
        spreading = lapse = 0.0
        if k + 1 >= back:
            first, second = (((w - way[k + 1 - back]) ** 2).mean() for w in way[k : k + 2])
            spreading, lapse = 0.5 * (second - first), end - start
        rows.append((spreading, lapse, squares[k + 1], way[0].size))
    return np.array(rows)


def _shear_rate(xx: Floats, yy: Floats, xy: Floats) -> Floats:
    return np.asarray(np.hypot(xx - yy, xy))


def _derive(model: Model, sums: Floats) -> dict[str, Floats]:
    """Each of `FLUX_QUANTITIES` from rows of sums."""
    s = dict(zip(_SUMS, sums.T, strict=True))
    gx, gy = model.heat_gradient
    size = float(np.hypot(gx, gy))
    assert model.thermal is not None
    # Down the gradient, and to the right of that
    by = {
        way: 0.0 - (gx * s[f"{way}_x"] + gy * s[f"{way}_y"]) / (size**2 * s["window"])
        for way in WAYS
    }
    to_the_right = sum(-gy * s[f"{way}_x"] + gx * s[f"{way}_y"] for way in WAYS)
    along = np.sum([*by.values()], axis=0)
    to_diffusivity = s["area"] / s["window"] / model.thermal.capacity.sum()
    diffusivity = (along - by["motion"]) * to_diffusivity
    rate = _shear_rate(s["strain_xx"], s["strain_yy"], s["strain_xy"]) / s["window"]
    return {
        "along": along,
        "across": -to_the_right / (size**2 * s["window"]),
        "conductivity": along / thickness_of(model),
        **{f"share_{way}": by[way] / along for way in WAYS},
        "diffusivity": diffusivity,
        "mixing": by["motion"] * to_diffusivity,
        "self_diffusion": s["spreading"] / s["lapse"],
        "peclet": rate * model.mean_diameter**2 / diffusivity,
        "fluctuation": np.sqrt(s["square"] / s["grains"]) / (size * model.mean_diameter),
    }
