"""How long grains stay between where they come in and an outlet."""

from __future__ import annotations

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats
from multicor_cli.model.state import Presence
from multicor_cli.optional import library
from multicor_cli.post.crossings import have_jumped
from multicor_cli.post.source import PostError, Run, Selection, frames_told
from multicor_cli.post.table import Column, Table

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
        frames: Indices of the frames.
        times: Times of the first and last frame [s].
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
    if not getattr(source.frames[int(chosen[0])], "is_open", False):
        raise PostError(
            "no grain comes or goes in this run: residence times need [[outlets]] and groups that "
            "are released"
        )
    if chosen.size < 3:
        raise PostError(
            f"residence times need three frames, not {chosen.size}: choose more with --from or "
            "--frames"
        )
    times = np.asarray(source.frames.time, np.float64)[chosen]
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
