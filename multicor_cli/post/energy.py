"""The energy books of a run over time: mechanical, and of heat if it has any."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats
from multicor_cli.post.source import PostError, rows_of, within
from multicor_cli.post.table import Table


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
