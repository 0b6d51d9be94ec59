"""Over time: the energy books of a run, mechanical and of heat, and columns of its time series."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from multicor_cli.model.model import Floats
from multicor_cli.post.source import PostError, Run, within
from multicor_cli.post.table import Column, Quantity, Table, TimeTable, values_of_quantities
from multicor_cli.text import choices

# ---- The energy books


@dataclass(frozen=True)
class BookLine(Quantity):
    """A line of the books; ``sign``: +1 for what comes in, −1 for what goes out, 0 for neither."""

    sign: int = 0


def _books(*lines: tuple[str, str, int]) -> tuple[BookLine, ...]:
    return tuple(BookLine(name, label, unit="J", sign=sign) for name, label, sign in lines)


MECHANICAL = _books(
    ("gravity_work", "work of gravity", 1),
    ("wall_work", "work of the walls", 1),
    ("load_work", "work of the loads", 1),
    ("adhesion_work", "work of adhesion", 1),
    ("expansion_work", "work of expanding grains", 1),
    ("worn_energy", "taken along by what is worn off", -1),
    ("friction_loss", "lost to friction", -1),
    ("impact_loss", "lost to impacts", -1),
    ("damping_loss", "lost in the damping of loads", -1),
    ("correction_work", "taken up by the projection of positions", -1),
    ("kinetic_in", "brought by grains that came", 1),
    ("kinetic_out", "taken along by grains that went", -1),
    ("kinetic_gain", "gain of kinetic energy", 0),
    ("imbalance", "imbalance", 0),
)
"""The mechanical books: gain = in − out + imbalance; works include the projection of positions.
What grains bring and take along is there in runs in which they come and go."""

HEAT = _books(
    ("heat_friction", "heat of friction", 1),
    ("heat_impact", "heat of impacts", 1),
    ("heat_from_walls", "heat from walls", 1),
    ("heat_from_ambient", "heat from the ambient fluid", 1),
    ("heat_from_surroundings", "heat from the surroundings", 1),
    ("heat_along_gradient", "heat gained along the mean gradient", 1),
    ("heat_to_walls", "heat of friction and impacts into walls", -1),
    ("heat_ahead", "heat received ahead of losses", 1),
    ("heat_out", "heat taken along by grains that went", -1),
    ("heat_stored", "heat stored in the grains", 0),
    ("heat_imbalance", "imbalance of heat", 0),
)
"""The books of heat: stored = what came in − what went into walls or with grains + imbalance."""


class EnergyTable(Table):
    """Energy books since the start of the run; ``s`` rows of the time series.

    Attributes:
        time: Times [s], shape ``(s,)``.
        books: The lines of `MECHANICAL` and `HEAT` that the run has, by name [J], shape ``(s,)``.
        closure: Largest mechanical imbalance so far over the sum of all terms, shape ``(s,)``.
        heat_closure: The same of heat, or None in a run without.
        entries: The lines that the run has.
    """


def energy(source: Run, start: float | None = None, end: float | None = None) -> EnergyTable:
    """The energy books over time; they count from the start of the run whatever part is asked for.

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
        message = "the time series has no row in this time"
        raise PostError(message if time.size else "the run has no time series yet")

    def values(name: str) -> Floats:
        if name == "kinetic_gain":
            return values("kinetic") - values("kinetic_start")
        return np.asarray(series[name], np.float64)[rows]

    has_heat = "heat_stored" in series
    mechanical, heat = (
        [e.over_time(values(e.name)) for e in lines if e.name == "kinetic_gain" or e.name in series]
        for lines in (MECHANICAL, HEAT if has_heat else ())
    )
    closures = [Column("closure", "1", values("closure"))]
    if has_heat:
        closures.append(Column("heat_closure", "1", values("heat_closure"), "closure of heat"))
    shown = [*mechanical, closures[0], *heat, *closures[1:]]
    books = {column.name: column.values for column in (*mechanical, *heat)}
    facts = {
        "end": {name: book[-1] for name, book in books.items()},
        "energy_closure": closures[0].values[-1],
        "heat_closure": closures[1].values[-1] if has_heat else None,
        "time": time[rows],
        "books": books,
        "closure_over_time": closures[0].values,
        "heat_closure_over_time": closures[1].values if has_heat else None,
    }
    over_time = (column._replace(label="") for column in (*mechanical, *heat, *closures))
    return EnergyTable(
        values_of_quantities([(c.heading, float(c.values[-1])) for c in shown], "at the end"),
        facts,
        [Column("time", "s", time[rows]), *over_time],
        entries=tuple(entry for entry in (*MECHANICAL, *HEAT) if entry.name in books),
    )


# ---- Columns of the time series: their means, drifts, and values over time

_OWN = ("time", "step", "stage", "window_duration")
"""Columns that say when a row is, and not what."""


_ZERO_IS_NONE = (
    "temperature_mean", "temperature_min", "temperature_max", "hottest_spot", "solid_gas_min",
    "solid_gas_max",
)  # fmt: skip
"""Columns that are 0 in rows in which no grain is there, none slides, or none is near another."""

OVERVIEW = (
    "kinetic", "force_x", "force_y", "stress_xx", "stress_yy", "stress_xy", "contacts_mean",
)  # fmt: skip
"""Columns of a figure for which none were chosen, where a run has them."""

MOST_LINES = 6
"""Lines of one unit that a figure can tell apart."""


class SeriesTable(TimeTable):
    """Columns of a time series; forces and powers are means over the time since the row before."""

    KEYS = ("time", "units", "mean", "standard_error", "drift", "values")

    def overview(self) -> SeriesTable:
        """The columns of a figure by default, no more of one unit than it can tell apart."""
        chosen: list[Column] = []
        for word in OVERVIEW:
            called = [c for c in self.quantities if word in (c.name, *c.name.split(": "))]
            alike = sum(bool(called) and column.unit == called[0].unit for column in chosen)
            chosen += called if alike + len(called) <= MOST_LINES else []
        return SeriesTable(self.time, chosen or self.quantities[:1])

    @property
    def headings(self) -> tuple[str, ...]:
        """Names of the columns of `rows`."""
        return "quantity", "mean", "standard error", "drift", "smallest", "largest", "last", "note"

    @property
    def rows(self) -> list[tuple[Any, ...]]:
        """One row for each column of the series."""
        rows = []
        for c, line in zip(self.quantities, super().rows, strict=True):
            values = np.asarray(c.values)
            known = values[~np.isnan(values)] if np.isfinite(values).any() else values[:1]
            rows.append((*line[:4], *map(float, (known.min(), known.max(), values[-1])), line[4]))
        return rows


def series(
    source: Run, of: Sequence[str] = (), start: float | None = None, end: float | None = None
) -> SeriesTable:
    """Columns of the time series.

    Args:
        source: The run.
        of: Names of the columns, as ``kinetic`` or ``top: force_x``, or what is before or after the
            colon: ``force_x`` of all walls, or all that ``top`` has. Default: all of them.
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
    wanted: list[str] = []
    for word in of:
        called = [name for name in names if word in (name, *name.split(": "))]
        if not called:
            raise PostError(f"the time series has no '{word}'; {choices(word, names)}")
        wanted += called
    kept = []
    for name in dict.fromkeys(wanted if of else names):
        values = np.asarray(columns[name].values, np.float64)[chosen]
        if name in _ZERO_IS_NONE:
            values[values == 0.0] = np.nan
        kept.append(Column(name, columns[name].unit, values))
    return SeriesTable(time[chosen], kept)
