"""Sudden drops of a column of the time series: stick and slip, avalanches."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats
from multicor_cli.post.energy import series
from multicor_cli.post.power_law import fit_power_law
from multicor_cli.post.source import PostError, Run
from multicor_cli.post.sums import spread
from multicor_cli.post.table import Column, Quantity, Table, with_unit
from multicor_cli.text import choices

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
    events are compatible with a power law (`multicor_cli.post.power_law.fit_power_law`).

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
    """Drops of a column of the time series.

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
    known = np.isfinite(column.values) & _is_moving(source, found.time)
    time, value = found.time[known], np.asarray(column.values, np.float64)[known]
    if value.size < 3:
        raise PostError(f"'{of}' has {value.size} values at these times: three are needed")
    value = -value if value.mean() < 0.0 else value
    least = _SIZE * float(value.std()) if threshold is None else threshold
    if threshold is not None and not 0.0 < threshold < np.inf:
        raise PostError(f"the threshold {threshold:g} must be positive")
    events = find_events(time, value, least)
    if not events.size.size:
        raise PostError(
            f"'{of}' never drops by {least:.4g} {column.unit} or more at these times: lower "
            "--threshold"
        )
    span = float(time[-1] - time[0])
    mean = {"count": float(events.size.size), "rate": events.size.size / span}
    error = {"rate": _error_of_rate(events.wait)}
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
    parts = {"events": events, "error": errors, "time": time, "value": value, "law": law}
    return Avalanches(columns, facts, details, **parts)


def _is_moving(source: Run, time: Floats) -> NDArray[np.bool_]:
    """Whether steps of the mechanics were made before each of these rows."""
    columns = {column.name: np.asarray(column.values) for column in source.series_columns}
    if "window_duration" not in columns:
        return np.ones(time.size, np.bool_)
    return np.isin(time, columns["time"][columns["window_duration"] > 0.0])


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


def _error_of_rate(wait: Floats) -> float:
    """Standard error of the number of drops per time, of that of the time from one to the next."""
    known = wait[1:]
    if known.size < 2:
        return np.nan
    return float(spread(known).error) / float(known.mean()) ** 2
