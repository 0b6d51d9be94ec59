"""Sudden drops of a column of the time series: stick and slip, avalanches, their power laws."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats
from multicor_cli.post.energy import series
from multicor_cli.post.source import PostError, Run
from multicor_cli.post.sums import spread
from multicor_cli.post.table import Column, Quantity, Table, with_unit
from multicor_cli.text import choices, count_noun

_SIZE = 1.0  # smallest drop over the standard deviation of the column


EVENTS = (
    Quantity("count", "drops"),
    Quantity("rate", "drops per time", unit="1/s"),
    Quantity("size", "mean drop", r"\langle s\rangle", "column"),
    Quantity("largest", "largest drop", r"s_\mathrm{max}", "column"),
    Quantity("duration", "mean duration of a drop", unit="s"),
    Quantity("wait", "mean time from one drop to the next", unit="s"),
    Quantity("exponent", "exponent of the density of drops", r"\tau"),
    Quantity("exponent_from", "smallest drop that follows it", r"s_\mathrm{min}", "column"),
)
"""What `avalanches` measures; sizes have the unit of the column."""


class Events(NamedTuple):
    """Drops, in the order of time; ``e`` of them.

    Attributes:
        start: When the column is at its maximum [s], shape ``(e,)``.
        duration: How long it falls [s], shape ``(e,)``.
        size: By how much, shape ``(e,)``.
        wait: Time from the beginning of the drop before [s], nan of the first, shape ``(e,)``.
    """

    start: Floats
    duration: Floats
    size: Floats
    wait: Floats


class Avalanches(Table):
    """Drops of a column from a local maximum to the local minimum that follows.

    Values that stay the same belong to the maximum or minimum; where the mean of the column is
    negative its sign is changed, so that a resistance drops whichever way it points. A drop counts
    from the threshold on, in the unit of the column; one that a small rise interrupts is two. Rows
    of forces and powers are means since the row before: what rises and falls between two rows is
    not seen. Rows of frozen stages, which have no forces, are left out.

    Means of sizes, durations and waiting times have standard errors of what may remember each other
    (`multicor_cli.post.sums.spread`). The exponent of sizes, P(s) ~ s^(−τ), is there only where the
    events are compatible with a power law (`fit_power_law`).

    Attributes:
        quantity: What each row of the table is.
        mean: Values by name: ``count``, ``rate`` [1/s], ``size``, ``largest``, ``duration`` and
            ``wait`` [s], ``exponent``, ``exponent_from`` (the smallest size of the tail).
        error: Standard errors by the same names; nan where there is none.
        of: Name of the column; ``unit``, its unit.
        threshold: Smallest drop that counts.
        time, value: The column, with the sign that it was looked at with, shape ``(r,)``.
        events: The drops (`Events`).
        note: Why there is no exponent, or an empty text.
        times: First and last time [s].
    """


def avalanches(
    source: Run,
    of: str,
    start: float | None = None,
    end: float | None = None,
    *,
    threshold: float | None = None,
) -> Avalanches:
    """Drops of a column of the time series; the time of frozen stages does not count.

    Args:
        source: The run.
        of: The column, as ``kinetic`` or ``top: force_x``.
        start: Earliest time [s]; default: the start.
        end: Latest time [s]; default: the end.
        threshold: Smallest drop, in the unit of the column; default: its standard deviation.

    Raises:
        PostError: If there is no such column, several fit, it has fewer than three values at these
            times, the threshold is not positive, or nothing drops by so much.
        StoreError: If the run cannot be read.
    """
    found = series(source, [of], start, end)
    names = [column.name for column in found.quantities]
    if len(names) > 1:
        raise PostError(f"'{of}' are several columns; {choices(of, names)}")
    column = found.quantities[0]
    clock, pause = _clock(source, found.time)
    known = np.isfinite(column.values) & ~np.isnan(clock)
    time, value = found.time[known], np.asarray(column.values, np.float64)[known]
    clock, pause = clock[known], pause[known]
    if value.size < 3:
        few = count_noun(value.size, "value")
        raise PostError(f"'{of}' has {few} at these times: three are needed")
    value = -value if value.mean() < 0.0 else value
    least = _SIZE * float(value.std()) if threshold is None else threshold
    if threshold is not None and not 0.0 < threshold < np.inf:
        raise PostError(f"the threshold {threshold:g} must be positive")
    pieces = np.split(np.arange(time.size), np.flatnonzero(np.diff(pause)) + 1)
    parts = [find_events(time[rows], value[rows], least) for rows in pieces]
    events = Events(*(np.concatenate(each) for each in zip(*parts, strict=True)))
    begun = clock[np.searchsorted(time, events.start)]
    events = events._replace(wait=np.diff(begun, prepend=np.nan))
    if not events.size.size:
        raise PostError(
            f"'{of}' never drops by {least:.4g} {column.unit} or more at these times: lower "
            "--threshold"
        )
    span = float(clock[-1] - clock[0])
    mean = {"count": float(events.size.size), "rate": events.size.size / span}
    error, wait = {"rate": np.nan}, events.wait[1:]
    if wait.size > 1:  # that of the time from one drop to the next
        error["rate"] = float(spread(wait).error) / float(wait.mean()) ** 2
    for name in ("size", "duration", "wait"):
        values = getattr(events, name)
        rows = values[np.isfinite(values)]
        mean[name] = float(rows.mean()) if rows.size else np.nan
        error[name] = float(spread(rows, events.start[np.isfinite(values)]).error)
    law, note = fit_power_law(events.size)
    mean |= {
        "largest": float(events.size.max()),
        "exponent": np.nan if law is None else law.exponent,
        "exponent_from": np.nan if law is None else law.start,
    }
    error["exponent"] = np.nan if law is None else law.error
    unit, labels = column.unit, [(q.name, with_unit(q.label, q.unit)) for q in EVENTS]
    labels = [(name, text.replace("[column]", f"[{unit}]")) for name, text in labels]
    errors = {q.name: error.get(q.name, np.nan) for q in EVENTS}
    facts = {
        "of": column.name, "unit": unit, "threshold": least,
        "times": (float(time[0]), float(time[-1])), "mean": mean, "standard_error": errors,
        "chance_of_power_law": np.nan if law is None else law.chance, "note": note,
        "events": events._asdict(),
    }  # fmt: skip
    columns = [
        Column("quantity", "", [text for _, text in labels], key=""),
        Column("values", "", np.array([mean[q.name] for q in EVENTS]), "value", ""),
        Column("errors", "", np.array([*errors.values()]), "standard error", ""),
    ]  # fmt: skip
    details = [
        Column("start", "s", events.start), Column("duration", "s", events.duration),
        Column("size", unit, events.size), Column("wait", "s", events.wait, "waiting time"),
    ]  # fmt: skip
    more = {"events": events, "error": errors, "time": time, "value": value, "law": law}
    return Avalanches(columns, facts, details, **more)


def _clock(source: Run, time: Floats) -> tuple[Floats, NDArray[np.int64]]:
    """For how long grains have moved at each of these rows [s], nan where they do not; and how many
    rows before did not.
    """
    columns = {column.name: np.asarray(column.values) for column in source.series_columns}
    if "window_duration" not in columns:
        return time, np.zeros(time.size, np.int64)
    moved = columns["window_duration"]
    rows = np.searchsorted(columns["time"], time)
    clock: Floats = np.where(moved > 0.0, np.cumsum(moved), np.nan)
    return clock[rows], np.cumsum(moved <= 0.0, dtype=np.int64)[rows]


def find_events(time: Floats, value: Floats, threshold: float) -> Events:
    """Drops by ``threshold`` or more, from a local maximum to the minimum that follows."""
    rise = np.diff(value)
    moving = np.flatnonzero(rise != 0.0)
    falls = rise[moving] < 0.0
    # Runs of falling steps, with the rows at which they begin and end
    begins = moving[falls & ~np.concatenate([[False], falls[:-1]])]
    ends = moving[falls & ~np.concatenate([falls[1:], [False]])] + 1
    size = value[begins] - value[ends]
    kept: NDArray[np.bool_] = size >= threshold * (1.0 - 1e-12)
    start, end = time[begins[kept]], time[ends[kept]]
    return Events(start, end - start, size[kept], np.diff(start, prepend=np.nan))


# ---- Exponents of power laws by maximum likelihood, where the data are compatible with one

LEAST = 50
"""Values in the tail from which on an exponent is worth something (Clauset et al. 2009)."""

PLAUSIBLE = 0.1
"""Chance of a worse fit to a true power law below which there is none."""

_SAMPLES = 200  # drawn from the law to see how well it fits
_STARTS = 60  # where the tail may begin


class PowerLaw(NamedTuple):
    """A density that falls as x^(−exponent) from ``start`` on, with its standard error.

    Attributes:
        number: Values in the tail.
        chance: Chance that data from this law fit worse.
        distance: Kolmogorov–Smirnov distance of tail and law.
    """

    exponent: float
    error: float
    start: float
    number: int
    chance: float
    distance: float


def fit_power_law(values: Floats) -> tuple[PowerLaw | None, str]:
    """The power law of the tail of positive values; None, and why, where it is not justified.

    After Clauset, Shalizi & Newman, SIAM Review 51, 661 (2009): α = 1 + n/Σ ln(x/x_min), with the
    standard error (α − 1)/√n; x_min is where the distance of Kolmogorov and Smirnov is least. The
    chance is that of samples with as many values as there are, of the law in the tail and of the
    values themselves below it, each fitted in the same way, whose distance is larger. An
    exponential tail must be less likely (Vuong's test: the logarithm of the ratio of likelihoods,
    over √n times its standard deviation, is more than 1.64).
    """
    x = np.sort(np.asarray(values, np.float64))
    x = x[x > 0.0]
    if x.size < LEAST:
        return None, f"no exponent: {LEAST} events are needed, there are {x.size}"
    alpha, start, distance = _fit(x)
    tail = x[x >= start]
    if tail.size < LEAST or not 1.0 < alpha < math.inf:
        return None, f"no exponent: only {tail.size} events would follow a power law"
    if not _is_above_exponential(tail, alpha):
        return None, "no exponent: an exponential tail is as likely as a power law"
    random, below = np.random.default_rng(0), x[x < start]
    worse = 0
    for _ in range(_SAMPLES):
        count = random.binomial(x.size, tail.size / x.size)
        law = start * random.random(count) ** (-1.0 / (alpha - 1.0))
        rest = random.choice(below, x.size - count) if below.size else law[:0]
        worse += _fit(np.sort(np.concatenate([rest, law])))[2] > distance
    chance = worse / _SAMPLES
    if chance < PLAUSIBLE:
        return None, f"no exponent: data of a power law fit worse in only {100.0 * chance:.0f} %"
    error = (alpha - 1.0) / math.sqrt(tail.size)
    return PowerLaw(alpha, error, start, int(tail.size), chance, distance), ""


def _fit(x: Floats) -> tuple[float, float, float]:
    """Exponent, beginning of the tail, and distance, of ascending values."""
    first = np.unique(np.searchsorted(x, x[:: max(1, x.size // _STARTS)]))
    first = first[x.size - first >= min(10, x.size)]
    best = (math.nan, float(x[0]), math.inf)
    for k in first.tolist():
        tail, n = x[k:], x.size - k
        total = float(np.log(tail / tail[0]).sum())
        if not total > 0.0:
            continue
        alpha = 1.0 + n / total
        law = 1.0 - (tail / tail[0]) ** (1.0 - alpha)
        below = np.arange(n) / n
        distance = float(max(np.abs(law - below).max(), np.abs(law - below - 1.0 / n).max()))
        if distance < best[2]:
            best = (alpha, float(tail[0]), distance)
    return best


def _is_above_exponential(tail: Floats, alpha: float) -> bool:
    start = float(tail[0])
    rate = 1.0 / float((tail - start).mean())
    law = math.log((alpha - 1.0) / start) - alpha * np.log(tail / start)
    ratio = law - (math.log(rate) - rate * (tail - start))
    scatter = float(ratio.std())
    return scatter > 0.0 and float(ratio.sum()) > 1.64 * scatter * math.sqrt(tail.size)
