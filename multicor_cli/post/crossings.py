"""Flow through a line: which grains have crossed it from frame to frame."""

from __future__ import annotations

from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats
from multicor_cli.post.source import FrameSource, GrainFrame, PostError, Selection, model_of
from multicor_cli.post.table import Column, TimeTable
from multicor_cli.text import count_noun

Line = tuple[tuple[float, float], tuple[float, float]]
Rows = NDArray[np.int64]
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
    """

    KEYS = (
        "line",
        "units",
        "mean",
        "standard_error",
        "to_the_left",
        "to_the_right",
        "not_counted",
        "time",
        "rate",
    )

    def __init__(
        self,
        line: Line,
        time: Floats,
        duration: Floats,
        crossed: Floats,
        counts: tuple[int, int, int],
    ) -> None:
        by_name = dict(zip(_UNITS, crossed, strict=True))
        rates = [
            Column(name, _UNITS[name], values / duration, f"{name} per time")
            for name, values in by_name.items()
        ]
        forth, back, lost = counts
        facts = {"line": line, "to_the_left": forth, "to_the_right": back, "not_counted": lost}
        parts = {
            "duration": duration,
            "crossed": by_name,
            "forth": forth,
            "back": back,
            "lost": lost,
        }
        super().__init__(time, rates, facts, **parts)
        self.details = (self.details[0], *rates)
        self.facts["rate"] = self.values

    @property
    def note(self) -> str:
        """A word on grains whose way is not known; empty if there are none."""
        if not self.lost:
            return ""
        times = count_noun(self.lost, "time")
        return (
            f"{times} a grain came or went between two frames; what it crossed then is not "
            "counted: use more frames"
        )

    @property
    def rate(self) -> dict[str, Floats]:
        """What crossed per time in each interval, by name, shape ``(r,)``."""
        return self.values

    @cached_property
    def mean(self) -> dict[str, float]:
        """Mean rates over the time, by name."""
        return {
            name: float(values.sum() / self.duration.sum()) for name, values in self.crossed.items()
        }

    @property
    def rows(self) -> list[tuple[Any, ...]]:
        """The rates, and how many grains crossed."""
        counts = [
            ("grains to the left [1]", float(self.forth)),
            ("grains to the right [1]", float(self.back)),
        ]
        return [*super().rows, *((name, count, np.nan, np.nan, "") for name, count in counts)]


def flow_through(source: FrameSource, line: Line, selection: Selection | None = None) -> FlowTable:
    """Which grains have crossed a line with their centers, from frame to frame.

    Paths between two frames are taken for straight. Grains that come or go between them are left
    out, and so are those that an outlet takes and gives back: they are farther from where they were
    than any grain could have moved. With a period, the images of the line are crossed too.

    Args:
        source: The run.
        line: The ends of the line [m]; what crosses to its left, seen along it, is positive.
        selection: Which frames; default: the later half of the last stage.

    Raises:
        PostError: If the line has no length, or fewer than two frames are selected.
        StoreError: If the run cannot be read.
    """
    if line[0] == line[1]:
        raise PostError("the line has no length: its ends are the same point")
    chosen = (selection or Selection()).indices(source.frames).tolist()
    if len(chosen) < 2:
        raise PostError(
            "a flow needs two frames; only one is selected: choose more with --from or --frames"
        )
    times = np.asarray(source.frames.time, np.float64)[chosen]
    rows: list[tuple[Any, ...]] = []
    forth, back, lost, before = 0, 0, 0, source.frames[chosen[0]]
    for _, last in pairwise(chosen):
        after = source.frames[last]
        one, two, count = _shared(
            source, before, after, float(times[len(rows) + 1] - times[len(rows)])
        )
        lost += count
        sign, mass, radius = _crossings(source, before, after, line, (one, two))
        rows.append((sign.sum(), (sign * mass).sum(), np.pi * (sign * radius**2).sum()))
        forth, back, before = forth + int((sign > 0).sum()), back + int((sign < 0).sum()), after
    return FlowTable(
        line, times[1:], np.diff(times), np.array(rows, np.float64).T, (forth, back, lost)
    )


def _crossings(
    source: FrameSource,
    before: GrainFrame,
    after: GrainFrame,
    line: Line,
    shared: tuple[Rows, Rows],
) -> tuple[NDArray[np.int64], Floats, Floats]:
    """+1, −1 or 0 for each grain that has gone from one frame to the other, its mass and radius."""
    one, two = shared
    start, end = (
        np.asarray(f.unwrapped, np.float64)[rows, :2] for f, rows in ((before, one), (after, two))
    )
    grains, period = model_of(source, before).grains, source.model.period
    sign = np.zeros(one.size, np.int64)
    shifts = _shifts(start, end, line, period) if one.size else []
    for shift in shifts:
        sign += _crossed(start, end, np.array(line) + np.array([shift, 0.0]))
    return sign, grains.mass[one], grains.radius[one]


def _shared(
    source: FrameSource, before: GrainFrame, after: GrainFrame, duration: float
) -> tuple[Rows, Rows, int]:
    """Rows of grains that went from frame to frame, and how many others are in one of the two."""
    first, second = (getattr(frame, "number", None) for frame in (before, after))
    if first is None or second is None or not getattr(before, "is_open", True):
        everything = np.arange(len(before.position))
        return everything, everything, 0
    _, one, two = np.intersect1d(first, second, assume_unique=True, return_indices=True)
    start, end = (
        np.asarray(frame.unwrapped, np.float64)[rows, :2]
        for frame, rows in ((before, one), (after, two))
    )
    moved = np.hypot(*(end - start).T) <= _farthest(source, before, after, duration)
    return one[moved], two[moved], len(first) + len(second) - 2 * one.size + int((~moved).sum())


def _farthest(source: FrameSource, before: GrainFrame, after: GrainFrame, duration: float) -> float:
    """How far a grain can have come between two frames [m]: at their largest speed, and falling."""
    speeds = (
        float(np.hypot(*np.asarray(frame.velocity, np.float64).T[:2]).max(initial=0.0))
        for frame in (before, after)
    )
    return (
        max(speeds) + float(np.hypot(*source.model.gravity)) * duration
    ) * duration + source.model.mean_diameter


def _shifts(start: Floats, end: Floats, line: Line, period: float) -> list[float]:
    """Where images of the line may be crossed."""
    if period <= 0.0:
        return [0.0]
    x = np.concatenate([start[:, 0], end[:, 0]])
    ends = (line[0][0], line[1][0])
    first, last = np.floor((x.min() - max(ends)) / period), np.ceil((x.max() - min(ends)) / period)
    return [float(k) * period for k in np.arange(first, last + 1.0)]


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
