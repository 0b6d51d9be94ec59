"""Flow through a line: which grains have crossed it from frame to frame."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats, Model
from multicor_cli.post.source import (
    Frame,
    PostError,
    Run,
    Selection,
    bounds_of_intervals,
    model_of,
    refuse_cell,
)
from multicor_cli.post.table import Column, TimeTable
from multicor_cli.text import count_noun

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
    chosen = bounds_of_intervals(source, (selection or Selection()).indices(source.frames)).tolist()
    if len(chosen) < 2:
        raise PostError(
            "a flow needs two frames; only one is selected: choose more with --from or --frames"
        )
    times = np.asarray(source.frames.time, np.float64)[chosen]
    rows: list[tuple[Any, ...]] = []
    forth, back, lost, before = 0, 0, 0, source.frames[chosen[0]]
    for _, last in pairwise(chosen):
        after, lapse = source.frames[last], float(times[len(rows) + 1] - times[len(rows)])
        sign, mass, radius, count = _crossings(source, before, after, line, lapse)
        rows.append((sign.sum(), (sign * mass).sum(), np.pi * (sign * radius**2).sum()))
        forth, back = forth + int((sign > 0).sum()), back + int((sign < 0).sum())
        before, lost = after, lost + count
    duration, crossed = np.diff(times), dict(zip(_UNITS, np.array(rows, float).T, strict=True))
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
    first: Any
    second: Any
    first, second = (getattr(frame, "number", None) for frame in (before, after))
    are_known = first is not None and second is not None and getattr(before, "is_open", True)
    one = two = np.arange(len(before.position))
    if are_known:
        _, one, two = np.intersect1d(first, second, assume_unique=True, return_indices=True)
        lost = len(first) + len(second) - 2 * one.size
    start, end = (
        np.asarray(f.unwrapped, np.float64)[rows, :2] for f, rows in ((before, one), (after, two))
    )
    if are_known:
        jumped = have_jumped(model, before, after, duration)
        is_near = ~np.isin(np.asarray(first)[one], jumped)
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
    there = model_of(source, before)
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
