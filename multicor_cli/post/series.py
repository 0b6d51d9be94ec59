"""Columns of the time series: their means, drifts, and values over time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from multicor_cli.model.model import Floats
from multicor_cli.post.averages import Spread, spread
from multicor_cli.post.source import PostError, rows_of, within
from multicor_cli.post.table import Table
from multicor_cli.text import choices

if TYPE_CHECKING:
    from multicor_cli.store.data_frames import NamedColumn

_OWN = ("time", "step", "stage", "window_duration")
"""Columns that say when a row is, and not what."""


OVERVIEW = ("kinetic", "force_x", "force_y", "contacts_mean")
"""Columns of a figure for which none were chosen, where a run has them."""

MOST_LINES = 6
"""Lines of one unit that a figure can tell apart."""


class ColumnHolder(Protocol):
    """What has a time series with named columns; `multicor_cli.open_run` gives it."""

    @property
    def series_columns(self) -> list[NamedColumn]:
        """The columns."""


@dataclass(frozen=True, repr=False)
class SeriesTable(Table):
    """Columns of a time series; ``r`` rows. What a row has of forces and powers is a mean over the time since the row before.

    Attributes:
        columns: The columns, each of shape ``(r,)``.
        time: Times of the rows [s], shape ``(r,)``.
    """

    columns: tuple[NamedColumn, ...]
    time: Floats

    def overview(self) -> SeriesTable:
        """The columns that a figure shows unless others are asked for, no more of one unit than it can tell apart."""
        found: list[NamedColumn] = []
        for word in OVERVIEW:
            called = [column for column in self.columns if word in (column.name, *column.name.split(": "))]
            alike = sum(bool(called) and column.unit == called[0].unit for column in found)
            found += called if alike + len(called) <= MOST_LINES else []
        return replace(self, columns=tuple(found) or self.columns[:1])

    @cached_property
    def spread(self) -> list[Spread]:
        """Errors and drifts of the means; see `multicor_cli.post.averages.spread`."""
        return [spread(np.asarray(column.values, np.float64), self.time) for column in self.columns]

    @property
    def headings(self) -> tuple[str, ...]:
        """Names of the columns of `rows`."""
        return "quantity", "mean", "standard error", "drift", "smallest", "largest", "last", "note"

    @property
    def rows(self) -> list[tuple[Any, ...]]:
        """One row for each column of the series."""
        lines = []
        for column, found in zip(self.columns, self.spread, strict=True):
            values = np.asarray(column.values, np.float64)
            numbers = values.mean(), found.error, found.drift, values.min(), values.max(), values[-1]
            lines.append((f"{column.name} [{column.unit}]", *map(float, numbers), found.note()))
        return lines

    @property
    def detail_headings(self) -> tuple[str, ...]:
        """Names of the columns of `detail_rows` with their units."""
        return ("time [s]", *(f"{column.name} [{column.unit}]" for column in self.columns))

    @property
    def detail_rows(self) -> list[tuple[float, ...]]:
        """The rows of the series."""
        return rows_of((self.time, *(np.asarray(column.values) for column in self.columns)))

    def as_dict(self) -> dict[str, Any]:
        """Everything as JSON types; numbers may be nan."""
        return {
            "time": self.time.tolist(),
            "units": {column.name: column.unit for column in self.columns},
            "mean": {column.name: float(np.mean(column.values)) for column in self.columns},
            "standard_error": {c.name: float(found.error) for c, found in zip(self.columns, self.spread, strict=True)},
            "drift": {c.name: float(found.drift) for c, found in zip(self.columns, self.spread, strict=True)},
            "values": {column.name: np.asarray(column.values).tolist() for column in self.columns},
        }


def series(source: ColumnHolder, of: Sequence[str] = (), start: float | None = None, end: float | None = None) -> SeriesTable:
    """Columns of the time series.

    Args:
        source: The run.
        of: Names of the columns, as ``kinetic`` or ``top: force_x``, or what is before or after the colon: ``force_x`` of
            all walls, or all that ``top`` has. Default: all of them.
        start: Earliest time [s].
        end: Latest time [s].

    Raises:
        PostError: If there is no such column, or no row at these times.
        StoreError: If the run cannot be read.
    """
    columns = {column.name: column for column in source.series_columns}
    time = np.asarray(columns["time"].values, np.float64)
    chosen = within(time, start, end)
    if not chosen.size:
        at = f"from t = {time[0]:g} s to {time[-1]:g} s" if time.size else "no rows yet"
        raise PostError(f"the time series has no row at these times: it has rows {at}")
    names = [name for name in columns if name not in _OWN]
    wanted = list(dict.fromkeys(name for word in of for name in _called(word, names))) if of else names
    kept = [columns[name]._replace(values=np.asarray(columns[name].values, np.float64)[chosen]) for name in wanted]
    return SeriesTable(tuple(kept), time[chosen])


def _called(word: str, names: Sequence[str]) -> list[str]:
    found = [name for name in names if word in (name, *name.split(": "))]
    if not found:
        raise PostError(f"the time series has no '{word}'; {choices(word, names)}")
    return found
