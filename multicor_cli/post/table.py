"""Tables: columns and facts written once; shown as text, CSV, JSON, DataFrames and figures."""

from __future__ import annotations

import copy
import html
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats
from multicor_cli.optional import library
from multicor_cli.post.source import Run, frames_told, times_of
from multicor_cli.post.sums import Spread, pseudo_values, spread
from multicor_cli.text import with_unit_signs

_SHOWN = 60  # rows in a notebook


@dataclass(frozen=True)
class Quantity:
    """What is measured.

    Attributes:
        name: Name in data, and on the command line.
        label: Name for people.
        symbol: Symbol in figures (TeX).
        unit: SI unit; ``1`` if it has none.
    """

    name: str
    label: str
    symbol: str = ""
    unit: str = "1"

    def over_time(self, values: Floats) -> Column:
        """A column of its values."""
        return Column(self.name, self.unit, values, self.label)


class Column(NamedTuple):
    """A column of a table.

    Attributes:
        name: The attribute of the table that its values are.
        unit: SI unit; ``1`` if it has none, empty if none is to be shown.
        values: One value per row.
        label: What it is called in tables; default: its name.
        key: Its name in JSON; default: its name; empty: JSON does not have it.
        is_shown: Whether people see it; JSON may have more.
    """

    name: str
    unit: str
    values: Any
    label: str = ""
    key: str | None = None
    is_shown: bool = True

    @property
    def heading(self) -> str:
        """Label, and unit in brackets."""
        return with_unit(self.label or self.name, self.unit)


def with_unit(label: str, unit: str) -> str:
    """Heading of a column: ``label [unit]``."""
    return f"{label} [{unit}]" if unit else label


class Table:
    """Columns, and facts that belong to all of them; both are attributes of the table by name.

    A table of several frames has ``frames``, their indices, and ``times``, the time of the first
    and of the last one [s].

    Attributes:
        columns: What people see; one value per row.
        facts: What JSON has besides the columns, by name.
        details: What ``--csv`` has where that is more than the columns.
        parts: What only Python has, by name: what figures are drawn of.
    """

    def __init__(
        self,
        columns: Sequence[Column],
        facts: Mapping[str, Any],
        details: Sequence[Column] = (),
        **parts: Any,
    ) -> None:
        self.columns, self.details = tuple(columns), tuple(details)
        self.facts, self.parts = dict(facts), parts

    @cached_property
    def _by_name(self) -> dict[str, Any]:
        columns = {column.name: column.values for column in (*self.details, *self.columns)}
        return {**self.facts, **columns, **self.parts}

    def __getattr__(self, name: str) -> Any:
        if (
            not name.startswith("_")
            and name not in ("columns", "facts", "details", "parts")
            and name in self._by_name
        ):
            return self._by_name[name]
        raise AttributeError(f"'{type(self).__name__}' has no '{name}'", name=name, obj=self)

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *self._by_name})

    def with_(self, **changes: Any) -> Self:
        """The same table with other values of some columns, facts or parts."""
        if unknown := changes.keys() - self._by_name:
            message = f"{type(self).__name__} has no {', '.join(sorted(unknown))}"
            raise TypeError(message)
        changed = copy.copy(self)
        changed.__dict__.pop("_by_name", None)
        changed.columns, changed.details = (
            tuple(c._replace(values=changes.get(c.name, c.values)) for c in columns)
            for columns in (self.columns, self.details)
        )
        changed.facts, changed.parts = (
            {key: changes.get(key, value) for key, value in values.items()}
            for values in (self.facts, self.parts)
        )
        return changed

    @property
    def headings(self) -> tuple[str, ...]:
        """Names of the columns of `rows`, with their units in brackets."""
        return tuple(column.heading for column in self.columns if column.is_shown)

    @property
    def rows(self) -> list[tuple[Any, ...]]:
        """The rows, as plain numbers; nan where there is none."""
        return _rows(self.columns)

    @property
    def detail_headings(self) -> tuple[str, ...]:
        """Names of the columns of `detail_rows`, with their units in brackets."""
        return tuple(column.heading for column in self.details)

    @property
    def detail_rows(self) -> list[tuple[Any, ...]]:
        """The rows of ``--csv`` where that is more than the table."""
        return _rows(self.details)

    def as_dict(self) -> dict[str, Any]:
        """Everything as JSON types; numbers may be nan."""
        keys = {c.name if c.key is None else c.key: c.values for c in self.columns if c.key != ""}
        found: dict[str, Any] = plain({**self.facts, **keys})
        return found

    def to_pandas(self, *, is_detailed: bool = False) -> Any:
        """The table as a DataFrame; units of the columns are in its ``attrs["units"]``, those of
        quantities in a column ``unit``.

        Args:
            is_detailed: Whether to take what the table was made of, as ``--csv`` does.

        Raises:
            MissingLibrary: If pandas is not installed.
            ValueError: If there are no details.
        """
        pd = library("pandas")
        if is_detailed and not self.details:
            message = f"{type(self).__name__} has no details: leave out is_detailed"
            raise ValueError(message)
        headings, rows = (
            (self.detail_headings, self.detail_rows) if is_detailed else (self.headings, self.rows)
        )
        names, units = zip(*map(split_unit, headings), strict=True)
        frame = pd.DataFrame(rows, columns=list(names))
        if names[0] == "quantity":
            labels = [split_unit(label) for label in frame["quantity"]]
            frame["quantity"] = [name.strip() for name, _ in labels]
            frame.insert(1, "unit", [unit for _, unit in labels])
        frame.attrs["units"] = {name: unit for name, unit in zip(names, units, strict=True) if unit}
        return frame

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {len(self.rows)} rows of {', '.join(self.headings)}>"

    def _repr_html_(self) -> str:
        """The table for a notebook, five digits of each number; of long tables the beginning."""
        head = "".join(
            f"<th>{html.escape(with_unit_signs(heading))}</th>" for heading in self.headings
        )
        rows = self.rows
        body = "".join(
            f"<tr>{''.join(f'<td>{_cell(v)}</td>' for v in row)}</tr>" for row in rows[:_SHOWN]
        )
        more = len(rows) - _SHOWN
        rest = f"<p>… and {more} more rows</p>" if more > 0 else ""
        return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{rest}"


def values_of_quantities(
    lines: Sequence[tuple[str, float]], heading: str = "value"
) -> tuple[Column, Column]:
    """Columns of a table with a quantity in each row."""
    labels, values = zip(*lines, strict=True)
    return Column("quantity", "", labels, key=""), Column(
        "at_quantity", "", values, heading, key=""
    )


class TimeTable(Table):
    """Quantities over time: their means, the errors and drifts of these, and all values.

    Attributes:
        quantities: The quantities, each with its values.
        time: Times of the rows: of frames, or of the ends of intervals between them [s], ``(r,)``.
    """

    KEYS: tuple[str, ...] = ()
    """What JSON has, in this order; empty: the facts, then all about the quantities."""

    def __init__(
        self,
        time: Floats,
        quantities: Sequence[Column],
        facts: Mapping[str, Any] | None = None,
        details: Sequence[Column] | None = None,
        **parts: Any,
    ) -> None:
        """``details`` replace the quantities in CSV, ``mean`` and ``spread`` those of the rows."""
        self.time, self.quantities = time, tuple(quantities)
        self.__dict__ |= {name: parts.pop(name) for name in ("mean", "spread") if name in parts}
        if details is None:
            details = [column._replace(label="") for column in quantities]
        super().__init__((), facts or {}, (Column("time", "s", time), *details), **parts)

    @classmethod
    def of_frames(
        cls,
        source: Run,
        chosen: NDArray[np.int64],
        quantities: Sequence[Quantity],
        found: Mapping[str, Floats] | Averages,
        **facts: Any,
    ) -> Self:
        """Some quantities by name, found in frames, or averages over intervals between them."""
        parts: dict[str, Any] = {}
        if isinstance(found, Averages):
            for of in ("mean", "spread"):
                parts[of] = {q.name: getattr(found, of)[q.name] for q in quantities}
            found = found.values
        columns = [q.over_time(found[q.name]) for q in quantities]
        time = times_of(source, chosen)[-len(columns[0].values) :]
        return cls(time, columns, {**facts, **frames_told(source, chosen)}, frames=chosen, **parts)

    def with_(self, **changes: Any) -> Self:
        """The same table with other values of some quantities, facts or parts."""
        changed = super().with_(**changes)
        changed.time = changes.get("time", self.time)
        changed.quantities = tuple(
            c._replace(values=changes.get(c.name, c.values)) for c in self.quantities
        )
        if any(column.name in changes for column in self.quantities):
            for name in ("values", "mean", "spread"):  # which are worked out anew
                changed.__dict__.pop(name, None)
        return changed

    @cached_property
    def values(self) -> dict[str, Floats]:
        """Values by name, nan where there is none, shape ``(r,)``."""
        return {column.name: np.asarray(column.values) for column in self.quantities}

    @cached_property
    def mean(self) -> dict[str, float]:
        """Means by name; nan where no row has a value."""
        return {
            name: float(np.nanmean(v)) if np.isfinite(v).any() else np.nan
            for name, v in self.values.items()
        }

    @cached_property
    def spread(self) -> dict[str, Spread]:
        """Standard errors and drifts of the means by name; see `multicor_cli.post.sums.spread`."""
        return {
            name: spread(np.asarray(values, np.float64), self.time)
            for name, values in self.values.items()
        }

    @property
    def error(self) -> dict[str, float]:
        """Standard errors of the means by name; nan where the rows are too few to tell."""
        return {name: float(one.error) for name, one in self.spread.items()}

    @property
    def drift(self) -> dict[str, float]:
        """What each quantity drifts by from the first to the last time, by name."""
        return {name: float(one.drift) for name, one in self.spread.items()}

    @property
    def headings(self) -> tuple[str, ...]:
        """Names of the columns of `rows`."""
        return "quantity", "mean", "standard error", "drift", "note"

    @property
    def rows(self) -> list[tuple[Any, ...]]:
        """One row for each quantity."""
        return [line_of(c.heading, self.mean[c.name], self.spread[c.name]) for c in self.quantities]

    def as_dict(self) -> dict[str, Any]:
        """Everything as JSON types; numbers may be nan."""
        data = {
            **self.facts,
            "units": {column.name: column.unit for column in self.quantities},
            "mean": self.mean,
            "standard_error": self.error,
            "drift": self.drift,
            "drift_error": {name: float(one.drift_error) for name, one in self.spread.items()},
            "note": {name: one.note() for name, one in self.spread.items()},
            "time": self.time,
            "values": self.values,
        }
        found: dict[str, Any] = plain({key: data[key] for key in self.KEYS or data})
        return found


def line_of(label: str, mean: float, one: Spread) -> tuple[str, float, float, float, str]:
    """Row of a mean over time."""
    return label, mean, float(one.error), float(one.drift), one.note()


def plain(value: Any) -> Any:
    """Python's own types of arrays, tuples and what holds them."""
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value


def split_unit(text: str) -> tuple[str, str]:
    """Name and unit of a heading ``name [unit]``; without brackets there is no unit."""
    name, bracket, unit = text.rpartition(" [")
    return (name, unit[:-1]) if bracket and unit.endswith("]") else (text, "")


def _rows(columns: Sequence[Column]) -> list[tuple[Any, ...]]:
    return list(zip(*(plain(column.values) for column in columns if column.is_shown), strict=True))


def _cell(value: Any) -> str:
    if isinstance(value, float):
        return "–" if math.isnan(value) else f"{value:.5g}"
    return html.escape(with_unit_signs(str(value)))


# ---- Sums over intervals between frames, and averages that are ratios of them


def sums_between(series: Floats, times: Floats, rows: Floats) -> Floats:
    """Sums of the ``rows`` of a time series that end between two frames, shape ``(r, …)``.

    ``series`` are the times of the rows, ``times`` those of the frames, in ``r`` intervals [s].
    """
    interval = np.searchsorted(times, series, side="left") - 1
    inside = (interval >= 0) & (interval < times.size - 1)
    return np.column_stack(
        [np.bincount(interval[inside], row[inside], minlength=times.size - 1) for row in rows.T]
    )


class Averages(NamedTuple):
    """Quantities by name: in each interval, of all of them, and the errors of these."""

    values: dict[str, Floats]
    mean: dict[str, float]
    spread: dict[str, Spread]


def average_ratios(
    derive: Callable[[Floats], dict[str, Floats]], sums: Floats, times: Floats
) -> Averages:
    """Quantities that ``derive`` makes of rows of sums, from ratios of the sums of all rows.

    Args:
        derive: Makes them; of what is not finite there is no value.
        sums: A row for each interval between two of the ``times`` [s].
        times: Times of the frames.
    """
    return average_rows(derive, sums, 0.5 * (times[1:] + times[:-1]))


def average_rows(
    derive: Callable[[Floats], dict[str, Floats]], sums: Floats, times: Floats
) -> Averages:
    """As `average_ratios`, of rows that each have a time [s]."""

    def known(rows: Floats) -> dict[str, Floats]:
        # Where nothing presses a ratio has no value, whether it is 0/0 or 1/0.
        with np.errstate(invalid="ignore", divide="ignore"):
            return {n: np.where(np.isfinite(v), v, np.nan) for n, v in derive(rows).items()}

    whole = sums.sum(axis=0)
    mean = {name: float(value[0]) for name, value in known(whole[np.newaxis]).items()}
    without = known(whole - sums)
    for name in mean:
        if name.endswith("direction"):  # these repeat every 180°
            turned = (without[name] - mean[name] + 90.0) % 180.0 - 90.0
            without[name] = mean[name] + turned
    spreads = {
        name: spread(pseudo_values(np.asarray(mean[name]), rows), times)
        for name, rows in without.items()
    }
    return Averages(known(sums), mean, spreads)
