"""Over time: the energy books of a run, mechanical and of heat if it has any, and columns of its time series."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats
from multicor_cli.post.source import PostError, Table, rows_of, within
from multicor_cli.post.sums import Spread, spread
from multicor_cli.text import choices

if TYPE_CHECKING:
    from multicor_cli.store.frame_view import NamedColumn

# ---- The energy books


class SeriesHolder(Protocol):
    """What has a time series; `multicor_cli.open_run` gives it."""

    @property
    def series(self) -> Mapping[str, NDArray[Any]]:
        """The time series by name."""


@dataclass(frozen=True)
class BookLine:
    """A line of the books.

    Attributes:
        name: Name in the time series and in data.
        label: Name for people.
        sign: +1 for what comes in, −1 for what goes out, 0 for what is neither.
    """

    name: str
    label: str
    sign: int


MECHANICAL = (
    BookLine("gravity_work", "work of gravity", 1),
    BookLine("wall_work", "work of the walls", 1),
    BookLine("load_work", "work of the loads", 1),
    BookLine("friction_loss", "lost to friction", -1),
    BookLine("impact_loss", "lost to impacts", -1),
    BookLine("damping_loss", "lost in the damping of loads", -1),
    BookLine("correction_work", "taken up by the projection of positions", -1),
    BookLine("kinetic_in", "brought by grains that came", 1),
    BookLine("kinetic_out", "taken along by grains that went", -1),
    BookLine("kinetic_gain", "gain of kinetic energy", 0),
    BookLine("imbalance", "imbalance", 0),
)
"""The mechanical books: gain = what came in − what went out + imbalance. The works include those of the projection of positions.
What grains bring and take along is there in runs in which they come and go."""

HEAT = (
    BookLine("heat_friction", "heat of friction", 1),
    BookLine("heat_impact", "heat of impacts", 1),
    BookLine("heat_from_walls", "heat from walls", 1),
    BookLine("heat_from_ambient", "heat from the ambient fluid", 1),
    BookLine("heat_from_surroundings", "heat from the surroundings", 1),
    BookLine("heat_to_walls", "heat of friction and impacts into walls", -1),
    BookLine("heat_out", "heat taken along by grains that went", -1),
    BookLine("heat_stored", "heat stored in the grains", 0),
    BookLine("heat_imbalance", "imbalance of heat", 0),
)
"""The books of heat: stored = what came in − what went into walls or with grains + imbalance."""


@dataclass(frozen=True, repr=False)
class EnergyTable(Table):
    """Energy books since the start of the run; ``s`` rows of the time series.

    Attributes:
        time: Times [s], shape ``(s,)``.
        books: The lines of `MECHANICAL`, and of `HEAT` in a run with heat, that the run has, by name [J], shape ``(s,)``.
        closure: Largest mechanical imbalance so far over the sum of all terms, shape ``(s,)``.
        heat_closure: The same of heat, or None in a run without.
    """

    time: Floats
    books: dict[str, Floats]
    closure: Floats
    heat_closure: Floats | None

    @property
    def entries(self) -> tuple[BookLine, ...]:
        """The lines that the run has."""
        return tuple(entry for entry in (*MECHANICAL, *HEAT) if entry.name in self.books)

    @property
    def headings(self) -> tuple[str, str]:
        """Names of the columns of `rows`."""
        return "quantity", "at the end"

    @property
    def rows(self) -> list[tuple[str, float]]:
        """The books at the end."""
        lines = [(f"{entry.label} [J]", float(self.books[entry.name][-1])) for entry in MECHANICAL if entry.name in self.books]
        lines.append(("closure [1]", float(self.closure[-1])))
        if self.heat_closure is not None:
            lines += [(f"{entry.label} [J]", float(self.books[entry.name][-1])) for entry in HEAT if entry.name in self.books]
            lines.append(("closure of heat [1]", float(self.heat_closure[-1])))
        return lines

    @property
    def detail_headings(self) -> tuple[str, ...]:
        """Names of the columns of `detail_rows` with their units."""
        closures = ("closure [1]",) if self.heat_closure is None else ("closure [1]", "heat_closure [1]")
        return "time [s]", *(f"{name} [J]" for name in self.books), *closures

    @property
    def detail_rows(self) -> list[tuple[float, ...]]:
        """One row per row of the time series."""
        closures = (self.closure,) if self.heat_closure is None else (self.closure, self.heat_closure)
        return rows_of((self.time, *self.books.values(), *closures))

    def as_dict(self) -> dict[str, Any]:
        """Everything as JSON types, in joules and seconds."""
        return {
            "end": {name: float(column[-1]) for name, column in self.books.items()},
            "energy_closure": float(self.closure[-1]),
            "heat_closure": None if self.heat_closure is None else float(self.heat_closure[-1]),
            "time": self.time.tolist(),
            "books": {name: column.tolist() for name, column in self.books.items()},
            "closure_over_time": self.closure.tolist(),
            "heat_closure_over_time": None if self.heat_closure is None else self.heat_closure.tolist(),
        }


def energy(source: SeriesHolder, start: float | None = None, end: float | None = None) -> EnergyTable:
    """The energy books over time; they count from the start of the run whatever part of it is looked at.

    Args:
        source: The run.
        start: Earliest time [s]; default: the start.
        end: Latest time [s]; default: the end.

    Raises:
        PostError: If the time series has no row in this time.
        StoreError: If the run cannot be read.
    """
    series = source.series
    time = np.asarray(series["time"], np.float64)
    rows = within(time, start, end)
    if not rows.size:
        raise PostError("the time series has no row in this time" if time.size else "the run has no time series yet")
    has_heat = "heat_stored" in series
    gain = np.asarray(series["kinetic"]) - np.asarray(series["kinetic_start"])
    names = [entry.name for entry in (*MECHANICAL, *(HEAT if has_heat else ()))]
    columns = {name: np.asarray(series[name]) for name in names if name in series} | {"kinetic_gain": gain}
    columns = {name: columns[name] for name in names if name in columns}
    return EnergyTable(
        time[rows],
        {name: np.asarray(column[rows], np.float64) for name, column in columns.items()},
        np.asarray(series["closure"], np.float64)[rows],
        np.asarray(series["heat_closure"], np.float64)[rows] if has_heat else None,
    )


# ---- Columns of the time series: their means, drifts, and values over time

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
        """Errors and drifts of the means; see `multicor_cli.post.sums.spread`."""
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
