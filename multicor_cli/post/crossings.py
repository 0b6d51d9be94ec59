"""Grains that pass: flow through a line, and how long they stay between inflow and outlet."""

from __future__ import annotations

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats, Model
from multicor_cli.model.state import Presence
from multicor_cli.optional import library
from multicor_cli.post.source import (
    Frame,
    PostError,
    Run,
    Selection,
    bounds_of_intervals,
    chosen_frames,
    frames_of,
    frames_told,
    need_two,
    refuse_cell,
    times_of,
)
from multicor_cli.post.table import Column, Table, TimeTable
from multicor_cli.text import count_noun

# ---- Flow through a line: which grains have crossed it from frame to frame

Line = tuple[tuple[float, float], tuple[float, float]]
_ROUNDING = 1e-9  # of a line that is as wide as the period
_FARTHEST = 1e9  # end of a line [m]: products of what is farther may overflow
_UNITS = {"grains": "1/s", "mass": "kg/s", "area": "m2/s"}


class FlowTable(TimeTable):
    """Flow through a line per time, positive to its left; ``r`` intervals between frames.

    Attributes:
        line: Its ends [m].
        time: Ends of the intervals [s], shape ``(r,)``.
        duration: Their lengths [s], shape ``(r,)``.
        crossed: Grains, mass [kg] and area [m²] that crossed in each interval, by name, ``(r,)``.
        forth: Grains that crossed to the left in all.
        back: Grains that crossed to the right in all.
        lost: Grains that came, went, or did both between two frames: what they crossed is unknown.
        note: A word on these; empty if there are none.
        rate: What crossed per time in each interval, by name, shape ``(r,)``.
    """

    KEYS = (
        "line", "units", "mean", "standard_error", "to_the_left", "to_the_right", "not_counted",
        "time", "rate",
    )  # fmt: skip

    @property
    def rows(self) -> list[tuple[Any, ...]]:
        """The rates, and how many grains crossed."""
        counts = [
            ("grains to the left [1]", float(self.forth)),
            ("grains to the right [1]", float(self.back)),
        ]
        return [*super().rows, *((name, count, np.nan, np.nan, "") for name, count in counts)]


def flow_through(source: Run, line: Line, selection: Selection | None = None) -> FlowTable:
    """Which grains have crossed a line with their centers, from frame to frame.

    Paths between two frames are taken for straight. Grains that come or go between them are left
    out, and so are those that an outlet takes and gives back: they are farther from where they were
    than any grain could have moved. With a period, the images of the line are crossed too.

    Args:
        source: The run.
        line: The ends of the line [m]; what crosses to its left, seen along it, is positive.
        selection: Which frames; default: the later half of the last stage.

    Raises:
        PostError: If the line has no length or is wider than the period, fewer than two frames are
            selected, or the run is one of a cell.
        StoreError: If the run cannot be read.
    """
    if line[0] == line[1]:
        raise PostError("the line has no length: its ends are the same point")
    for place in (*line[0], *line[1]):
        if not abs(place) <= _FARTHEST:
            raise PostError(f"the line ends at {place:g} m: give ends up to {_FARTHEST:g} m away")
    width, period = abs(line[1][0] - line[0][0]), source.model.period
    if 0.0 < period * (1.0 + _ROUNDING) < width:
        raise PostError(
            f"the line is {width:g} m wide, more than the period of {period:g} m, and "
            "grains would cross it several times: choose a shorter one"
        )
    remedy = "take the velocities along the line, with post fields --line"
    refuse_cell(
        source.model,
        "nobody counts how often grains cross its sides, so no flow is measured",
        remedy,
    )
    chosen = bounds_of_intervals(source, chosen_frames(source, selection))
    need_two(chosen, "a flow needs two frames")
    times = times_of(source, chosen)
    duration, forth, back, lost = np.diff(times), 0, 0, 0
    rows: list[tuple[Any, ...]] = []
    pairs = pairwise(frames_of(source, chosen))
    for (before, after), lapse in zip(pairs, duration.tolist(), strict=True):
        sign, mass, radius, count = _crossings(source, before, after, line, lapse)
        rows.append((sign.sum(), (sign * mass).sum(), np.pi * (sign * radius**2).sum()))
        forth, back = forth + int((sign > 0).sum()), back + int((sign < 0).sum())
        lost += count
    crossed = dict(zip(_UNITS, np.array(rows, float).T, strict=True))
    rates = [
        Column(name, _UNITS[name], values / duration, f"{name} per time")
        for name, values in crossed.items()
    ]
    mean = {name: float(values.sum() / duration.sum()) for name, values in crossed.items()}
    facts = {"line": line, "to_the_left": forth, "to_the_right": back, "not_counted": lost}
    facts["rate"] = {rate.name: rate.values for rate in rates}
    note = ""
    if lost:
        note = (
            f"{count_noun(lost, 'time')} a grain came or went between two frames; what it crossed "
            "then is not counted: use more frames"
        )
    parts: dict[str, Any] = {"duration": duration, "crossed": crossed, "note": note, "mean": mean}
    return FlowTable(times[1:], rates, facts, rates, forth=forth, back=back, lost=lost, **parts)


def _crossings(
    source: Run, before: Frame, after: Frame, line: Line, duration: float
) -> tuple[NDArray[np.int64], Floats, Floats, int]:
    """+1, −1 or 0 for each grain that went from one frame to the other, its mass and the radius of
    a disc of its area; and how many are in one of the two only, or farther away than they can have
    come.
    """
    model, lost = source.model, 0
    one = two = np.arange(len(before.position))
    if before.is_open:
        first, second = before.number, after.number
        _, one, two = np.intersect1d(first, second, assume_unique=True, return_indices=True)
        lost = len(first) + len(second) - 2 * one.size
    start, end = (
        np.asarray(f.unwrapped, np.float64)[rows, :2] for f, rows in ((before, one), (after, two))
    )
    if before.is_open:
        jumped = have_jumped(model, before, after, duration)
        is_near = ~np.isin(before.number[one], jumped)
        lost += jumped.size
        one, start, end = one[is_near], start[is_near], end[is_near]
    sign, shifts = np.zeros(one.size, np.int64), np.zeros(1)
    if model.period > 0.0 and one.size:  # the images of the line that may be crossed
        x, ends = np.concatenate([start[:, 0], end[:, 0]]), (line[0][0], line[1][0])
        low = np.floor((x.min() - max(ends)) / model.period)
        high = np.ceil((x.max() - min(ends)) / model.period)
        shifts = np.arange(low, high + 1.0) * model.period
    for shift in shifts:
        sign += _crossed(start, end, np.array(line) + np.array([shift, 0.0]))
    there = before.model
    return sign, there.grains.mass[one], there.disc_radius[one], lost


def have_jumped(model: Model, before: Frame, after: Frame, duration: float) -> NDArray[np.int64]:
    """Numbers of the grains of two frames that are farther apart than any can have moved.

    They have been taken by an outlet and released again in the time between [s].
    """
    first, second = np.asarray(before.number), np.asarray(after.number)
    both, one, two = np.intersect1d(first, second, assume_unique=True, return_indices=True)
    way = np.asarray(after.unwrapped, np.float64)[two, :2]
    way = way - np.asarray(before.unwrapped, np.float64)[one, :2]
    speeds = (np.hypot(*np.asarray(f.velocity, np.float64).T[:2]) for f in (before, after))
    # falling, a grain gets faster than in either frame
    fall = float(np.hypot(*model.gravity)) * duration
    speed = max(float(each.max(initial=0.0)) for each in speeds) + fall
    return np.asarray(both[np.hypot(*way.T) > speed * duration + model.mean_diameter])


def _crossed(start: Floats, end: Floats, line: Floats) -> NDArray[np.int64]:
    """+1 where a path crosses a line from right to left between its ends, −1 back, else 0."""
    along = line[1] - line[0]
    first, last = (
        along[0] * (at[:, 1] - line[0, 1]) - along[1] * (at[:, 0] - line[0, 0])
        for at in (start, end)
    )
    sign = (first < 0.0).astype(np.int64) - (last < 0.0).astype(np.int64)
    with np.errstate(invalid="ignore", divide="ignore"):
        part = first / (first - last)
        at = ((start + part[:, np.newaxis] * (end - start) - line[0]) @ along) / (along @ along)
    return np.where((sign != 0) & (at >= 0.0) & (at < 1.0), sign, 0)


# ---- How long grains stay between where they come in and an outlet

_ALL = "all"


class Residence(Table):
    """Residence times of grains that came in during the frames; a row for all, and one per group.

    A stay begins and ends half-way between the frames between which a grain came or left. It is
    censored, known to be longer, of grains that are still there in the last frame or were lost
    beside the outlets. Grains that are there in the first frame are left out: nobody saw them come.

    The survival S(t) is the share of stays longer than t: the estimate of Kaplan & Meier (J. Am.
    Stat. Assoc. 53, 457, 1958), which uses censored stays as long as they are known. The mean is
    ∫ S dt up to the longest stay, a lower bound where that is censored; its variance is
    Σ_j (∫_{t_j} S dt)² d_j/(r_j (r_j − d_j)) over times t_j at which d_j of r_j stays end (Klein &
    Moeschberger, Survival Analysis, 2nd ed. 2003, equation 4.5.2). Stays count as independent.

    Attributes:
        group: ``"all"``, then the groups.
        stays: Stays whose beginning was seen.
        ended: How many of them ended in an outlet.
        mean: Mean residence times [s]; ``error``, their standard errors, nan with too few.
        median: Times at which half of the stays have ended [s]; nan where S stays above.
        longest: Longest stays, censored or not [s].
        first: Grains that are there in the first frame.
        lost: Stays that ended beside the outlets.
        interval: Largest time between two frames [s]: shorter stays are not seen.
        stay: The stays (`Stays`).
        survival: `Survival` of each row.
    """


class Stays(NamedTuple):
    """Stays whose beginning was seen, in the order of their ends; ``s`` of them.

    Attributes:
        grain: Numbers of the grains, shape ``(s,)``.
        group: Indices of their groups, shape ``(s,)``.
        start: When they came [s], shape ``(s,)``.
        duration: How long they stayed, as far as it is known [s], shape ``(s,)``.
        is_censored: Whether they stayed for longer, shape ``(s,)``.
    """

    grain: NDArray[np.int64]
    group: NDArray[np.int64]
    start: Floats
    duration: Floats
    is_censored: NDArray[np.bool_]


class Survival(NamedTuple):
    """Share of stays that last longer than ``time`` [s], ± its standard error; ``t`` times.

    The error is Greenwood's, S √(Σ d_j/(r_j (r_j − d_j))) up to the time.
    """

    time: Floats
    share: Floats
    low: Floats
    high: Floats


def residence(source: Run, selection: Selection | None = None) -> Residence:
    """How long grains stay, from frames in which they come and go.

    Args:
        source: The run, with grains that are released and with outlets.
        selection: Which frames; default: all.

    Raises:
        PostError: If no grain comes or goes in the run, fewer than three frames are selected, or no
            grain comes in during them.
        MissingLibrary: If SciPy is not installed.
        StoreError: If the run cannot be read.
    """
    chosen = (selection or Selection(frames=slice(None))).indices(source.frames)
    if not source.frames[int(chosen[0])].is_open:
        raise PostError(
            "no grain comes or goes in this run: residence times need [[outlets]] and groups that "
            "are released"
        )
    if chosen.size < 3:
        raise PostError(
            f"residence times need three frames, not {chosen.size}: choose more with --from or "
            "--frames"
        )
    times = times_of(source, chosen)
    stay, lost, first = _find_stays(source, chosen, times)
    if not stay.grain.size:
        raise PostError(
            f"no grain comes in between t = {times[0]:g} s and {times[-1]:g} s: choose other frames"
        )
    names = source.model.groups
    kinds = [k for k in range(len(names)) if (stay.group == k).any()]
    parts = [np.ones(stay.grain.size, np.bool_), *(stay.group == k for k in kinds)]
    found = [_estimate(stay.duration[part], stay.is_censored[part]) for part in parts]
    survival, mean, error, median = zip(*found, strict=True)
    columns = [
        Column("group", "", [_ALL, *(names[k] for k in kinds)]),
        Column("stays", "", np.array([int(part.sum()) for part in parts])),
        Column("ended", "", np.array([int((part & ~stay.is_censored).sum()) for part in parts])),
        Column("mean", "s", np.array(mean)),
        Column("error", "s", np.array(error), "standard error", "standard_error"),
        Column("median", "s", np.array(median)),
        Column("longest", "s", np.array([float(stay.duration[part].max()) for part in parts])),
    ]
    details = [
        Column("grain", "", stay.grain), Column("of", "", [names[k] for k in stay.group], "group"),
        Column("start", "s", stay.start), Column("duration", "s", stay.duration),
        Column("is_censored", "", stay.is_censored.astype(np.int64), "censored"),
    ]  # fmt: skip
    curves = {name: each._asdict() for name, each in zip(columns[0].values, survival, strict=True)}
    facts = {
        "there_at_first": first, "lost": lost, "interval": float(np.diff(times).max()),
        **frames_told(source, chosen), "survival_over_time": curves,
    }  # fmt: skip
    parts_of: dict[str, Any] = {"stay": stay, "survival": survival, "frames": chosen}
    return Residence(columns, facts, details, first=first, **parts_of)


def _find_stays(source: Run, chosen: NDArray[np.int64], times: Floats) -> tuple[Stays, int, int]:
    """The stays that begin between two frames, how many were lost, grains in the first frame."""
    count = source.model.grain_count
    came = np.full(count, np.nan)  # of a grain that is there, unless nobody saw it come
    rows: list[tuple[NDArray[np.int64], Floats, float, bool]] = []
    lost, before = 0, source.frames[int(chosen[0])]
    first = len(before.number)
    for k, (_, last) in enumerate(pairwise(chosen.tolist())):
        after, now = source.frames[last], 0.5 * (times[k] + times[k + 1])
        back = have_jumped(source.model, before, after, float(times[k + 1] - times[k]))
        was, is_there = np.zeros((2, count), np.bool_)
        was[before.number] = is_there[after.number] = True
        again = np.zeros(count, np.bool_)
        again[back] = True  # taken and released between the frames
        gone = was & (~is_there | again)
        is_lost = gone & (np.asarray(after.presence) == Presence.LOST)
        for which, is_cut in ((gone & ~is_lost, False), (is_lost, True)):
            seen = np.flatnonzero(which & np.isfinite(came))
            rows.append((seen, came[seen], now, is_cut))
            lost += seen.size if is_cut else 0
        came[gone] = np.nan
        came[is_there & (~was | again)] = now
        before = after
    still = np.flatnonzero(np.isfinite(came))
    rows.append((still, came[still], float(times[-1]), True))
    grain = np.concatenate([which for which, *_ in rows])
    start = np.concatenate([start for _, start, *_ in rows])
    end = np.concatenate([np.full(which.size, at) for which, _, at, _ in rows])
    is_censored = np.concatenate([np.full(which.size, is_it) for which, *_, is_it in rows])
    group = np.asarray(source.model.grains.group, np.int64)[grain]
    return Stays(grain, group, start, end - start, is_censored), lost, first


def _estimate(
    duration: Floats, is_censored: NDArray[np.bool_]
) -> tuple[Survival, float, float, float]:
    """Survival, mean with its standard error, and median of stays; see `Residence`."""
    stats = library("scipy.stats")
    data = stats.CensoredData(duration[~is_censored], right=duration[is_censored])
    estimate = stats.ecdf(data).sf
    time, share = estimate.quantiles, estimate.probabilities
    # S is 1 up to the first time, and what it is after each up to the next
    area = np.concatenate([[1.0], share[:-1]]) * np.diff(time, prepend=0.0)
    mean, after = float(area.sum()), np.append(np.cumsum(area[:0:-1])[::-1], 0.0)
    ended = np.sort(duration[~is_censored])
    ends = np.searchsorted(ended, time, "right") - np.searchsorted(ended, time)
    at_risk = duration.size - np.searchsorted(np.sort(duration), time)
    # Greenwood's terms; after the last stay nothing is left to vary
    terms = np.where(ends < at_risk, ends / (at_risk * np.maximum(at_risk - ends, 1)), 0.0)
    scatter = share * np.sqrt(np.cumsum(terms))
    curve = Survival(
        time, share, np.maximum(share - scatter, 0.0), np.minimum(share + scatter, 1.0)
    )
    error = float(np.sqrt((after**2 * terms).sum())) if ends.sum() > 1 else np.nan
    below = np.flatnonzero(share <= 0.5)
    return curve, mean, error, float(time[below[0]]) if below.size else np.nan
