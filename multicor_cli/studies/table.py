"""The table of a study, a row for each case and means over seeds, and series of points of it."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from multicor_cli.model.model import Floats
from multicor_cli.optional import library
from multicor_cli.plots.style import PlotError
from multicor_cli.studies.axes import SEED, Case, Value, Values, digits_of, short_names, shown
from multicor_cli.studies.directory import CaseStatus, StudyDirectory
from multicor_cli.studies.observing import observe
from multicor_cli.studies.study_file import Observable

# ---- The table


@dataclass(frozen=True)
class Row:
    """A case, or several seeds of one.

    Attributes:
        values: Values of the keys, that of the seed only in a row of one case.
        status: Of the case; of several: ``3 of 5 finished``.
        numbers: By observable: value, standard error, and number of seeds.
        between: By observable: standard error from the scatter between seeds; nan below two.
        verdict: The worst.
        hours: Wall-clock time [h].
        case, digest: Name of the case, and digest of the end of its run; empty for several.
        problems: Why observables could not be taken.
    """

    values: Values
    status: str
    numbers: dict[str, tuple[float, float, int]]
    between: dict[str, float]
    verdict: str
    hours: float
    case: str = ""
    digest: str = ""
    problems: dict[str, str] | None = None


@dataclass(frozen=True)
class StudyTable:
    """Rows of a study, with the keys that vary and the names of the observables.

    Attributes:
        is_mean: Whether rows are means over seeds.
        labels: What observables are called in figures, where that is not their name.
    """

    keys: tuple[str, ...]
    observables: tuple[str, ...]
    rows: tuple[Row, ...]
    is_mean: bool
    directory: StudyDirectory
    labels: Mapping[str, str] = field(default_factory=dict)

    @property
    def headings(self) -> list[str]:
        endings = ("", "_error", "_between", "_seeds") if self.is_mean else ("", "_error")
        numbers = [f"{name}{ending}" for name in self.observables for ending in endings]
        last = [] if self.is_mean else ["digest", "directory"]
        others = ["status", *numbers, "verdict", "hours", *last]
        return [*self._names(others), *others]

    def _names(self, others: Sequence[str]) -> list[str]:
        """Short names of the keys, or whole ones where other columns are called so."""
        return [key if name in others else name for key, name in short_names(self.keys).items()]

    @property
    def records(self) -> list[list[Any]]:
        """Rows as lists, in the order of `headings`; what is not known is None."""
        records = []
        for row in self.rows:
            found: list[Any] = [*(row.values.get(key) for key in self.keys), row.status]
            for name in self.observables:
                value, error, count = row.numbers.get(name, (math.nan, math.nan, 0))
                found += [_known(value), _known(error)]
                if self.is_mean:
                    found += [_known(row.between.get(name, math.nan)), count]
            found += [row.verdict, _known(row.hours)]
            if not self.is_mean:
                found += [row.digest, str(self.directory.case(row.case))]
            records.append(found)
        return records

    @property
    def lines(self) -> tuple[list[str], list[list[str]]]:
        """Headings and rows for people: numbers with their errors (the larger) in one column."""
        lines = []
        digits = _digits(self)
        for row in self.rows:
            values = [
                shown(row.values[key], digits[key]) if key in row.values else ""
                for key in self.keys
            ]
            numbers = [
                with_error(*_with_error(row, name)) if name in row.numbers else "–"
                for name in self.observables
            ]
            hours = "–" if math.isnan(row.hours) else f"{row.hours:.3g}"
            lines.append([*values, row.status, *numbers, row.verdict, hours])
        others = ["status", *self.observables, "verdict", "hours"]
        return [*self._names(others), *others], lines

    def csv(self) -> str:
        out = io.StringIO()
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(self.headings)
        writer.writerows(
            [["" if value is None else value for value in record] for record in self.records]
        )
        return out.getvalue()

    def frame(self) -> Any:
        """As a pandas DataFrame; raises `MissingLibrary` where pandas is not installed."""
        return library("pandas").DataFrame(self.records, columns=self.headings)


def make_table(
    directory: StudyDirectory,
    observables: Sequence[Observable],
    cases: Sequence[Case],
    values: Sequence[Values],
) -> StudyTable:
    """The table of a study, finished or not: a row for each case, with its values in numbers."""
    rows = []
    for case, of_case in zip(cases, values, strict=True):
        state = directory.state(case)
        row = Row(
            of_case, state.status.value, {}, {}, "", math.nan, case.name,
            problems={"": state.reason},
        )  # fmt: skip
        if state.status is CaseStatus.FINISHED:
            found = observe(directory, case, observables)
            row = replace(
                row,
                numbers={
                    name: (_number(value), _number(error), 1)
                    for name, (value, error) in found["values"].items()
                },
                verdict=found["verdict"],
                hours=_number(found["hours"]),
                digest=found["digest"] or "",
                problems=found["problems"],
            )
        rows.append(row)
    keys = tuple(dict.fromkeys(key for case in cases for key in case.values))
    labels = {row.name: row.label for row in observables if row.label}
    names = tuple(row.name for row in observables)
    return StudyTable(keys, names, tuple(rows), is_mean=False, directory=directory, labels=labels)


def over_seeds(table: StudyTable) -> StudyTable:
    """Means over the seeds: a row for each combination of the other values.

    Errors are those of the runs, √Σε²/n, and from the scatter between the seeds, s/√n.
    """
    keys = tuple(key for key in table.keys if key != SEED)
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for row in table.rows:
        groups.setdefault(tuple(row.values.get(key) for key in keys), []).append(row)
    rows = [
        _mean(dict(zip(keys, values, strict=True)), group, table.observables)
        for values, group in groups.items()
    ]
    return replace(table, keys=keys, rows=tuple(rows), is_mean=True)


def _mean(values: Values, group: Sequence[Row], observables: Sequence[str]) -> Row:
    numbers, between = {}, {}
    for name in observables:
        found = [row.numbers[name] for row in group if name in row.numbers]
        if not found:
            continue
        count = len(found)
        mean = math.fsum(value for value, _, _ in found) / count
        within = math.sqrt(math.fsum(error * error for _, error, _ in found)) / count
        scatter = math.fsum((value - mean) ** 2 for value, _, _ in found)
        numbers[name] = (mean, within, count)
        between[name] = math.sqrt(scatter / (count * (count - 1))) if count > 1 else math.nan
    done = sum(row.status == CaseStatus.FINISHED.value for row in group)
    order = {text: rank for rank, text in enumerate(("", "ok", "warning", "bad"))}
    verdict = max((row.verdict for row in group), key=lambda text: order.get(text, 0))
    hours = math.fsum(row.hours for row in group if math.isfinite(row.hours))
    return Row(values, f"{done} of {len(group)} finished", numbers, between, verdict, hours)


def with_error(value: float, error: float) -> str:
    """A number with its error to two digits, as 0.2592 ± 0.0018; without error, to five."""
    if not math.isfinite(value):
        return "–"
    if not math.isfinite(error) or error <= 0.0:
        return f"{value:.5g}"
    digits = 1 - math.floor(math.log10(error))
    if digits < 0 or (digits > 6 and abs(value) < 1e-4):
        power = math.floor(math.log10(max(abs(value), error)))
        digits = max(0, digits + power)
        return f"({value / 10.0**power:.{digits}f} ± {error / 10.0**power:.{digits}f})e{power:+d}"
    return f"{value:.{digits}f} ± {error:.{digits}f}"


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _number(value: Any) -> float:
    return math.nan if value is None else float(value)


# ---- Series of points out of a study: an observable against a value or an observable, in panels


@dataclass(frozen=True)
class Series:
    """Points of one line, ascending in x, all of shape ``(k,)``.

    Attributes:
        error: The larger of the standard errors of y, within runs or between seeds; nan if unknown.
        x_error: The same of x; nan if that is a key and no observable.
    """

    label: str
    x: Floats
    y: Floats
    error: Floats
    x_error: Floats


Names = tuple[Value | None, ...]
"""Values of the keys by which panels or series are told apart."""


@dataclass(frozen=True)
class Panel:
    """Series that share axes; the title says what they have in common, if there are panels."""

    title: str
    series: list[Series]


@dataclass(frozen=True)
class PlotRequest:
    """What is to be drawn; keys may be given by their short names.

    Attributes:
        of: The observable.
        against: Key or observable across.
        by: Key that tells series apart; None: all that are left.
        facet: Key that tells panels apart; None: one panel.
        where: Values that keys must have, as texts.
    """

    of: str
    against: str
    by: str | None = None
    facet: str | None = None
    where: tuple[tuple[str, str], ...] = ()


def find_key(table: StudyTable, name: str) -> str:
    """The key with this name, whole or short; raises `PlotError` if no key of the study has it."""
    short = short_names(table.keys)
    for key in table.keys:
        if name in (key, short[key]):
            return key
    raise PlotError(
        f"the study varies no {name}; it varies {', '.join(short.values()) or 'nothing'}"
    )


def make_panels(table: StudyTable, request: PlotRequest) -> list[Panel]:
    """The points of a figure, from means over seeds.

    Raises:
        PlotError: There is no such key or observable, values across are no numbers, several points
            of a series have the same place, or nothing has been computed.
    """
    rows = _chosen(table, request)
    across = None if request.against in table.observables else find_key(table, request.against)
    facets = [] if request.facet is None else [find_key(table, request.facet)]
    left = {key: len(values_of(rows, key)) for key in table.keys if key not in (across, *facets)}
    left = {key: count for key, count in left.items() if count > 1}
    if request.by is not None:
        by = [find_key(table, request.by)]
    else:
        along = max(left, key=lambda key: left[key], default=None) if across is None else None
        by = [key for key in left if key != along]
    lines: dict[Names, dict[Names, list[Row]]] = {}
    for row in rows:
        panel, line = (tuple(row.values.get(key) for key in keys) for keys in (facets, by))
        lines.setdefault(panel, {}).setdefault(line, []).append(row)
    names, digits = short_names(table.keys), _digits(table)

    def label_of(keys: Sequence[str], values: Sequence[Value | None]) -> str:
        return ", ".join(
            f"{names[key]} = {shown(value, digits[key])}"
            for key, value in zip(keys, values, strict=True)
            if value is not None
        )

    found = []
    for panel, groups in lines.items():
        series = []
        for values, group in groups.items():
            label = label_of(by, values)
            if across is not None:
                _refuse_same_places(names, group, across, label)
            series.append(_series(label, group, request, across))
        found.append(Panel(label_of(facets, panel), series))
    return found


def _chosen(table: StudyTable, request: PlotRequest) -> list[Row]:
    """Rows with the observables that are asked for, and the values."""
    if request.of not in table.observables:
        observed = ", ".join(table.observables) or "nothing"
        raise PlotError(f"the study observes no {request.of}; it observes {observed}")
    needed = {request.of, request.against} & {*table.observables}
    wanted = [(find_key(table, name), text) for name, text in request.where]
    digits = _digits(table)
    for key, text in wanted:
        known = [shown(value, digits[key]) for value in values_of(table.rows, key)]
        if text not in known:
            raise PlotError(f"{key} has no value {text}; it has {', '.join(known)}")
    rows = [
        row
        for row in table.rows
        if needed <= row.numbers.keys()
        and all(shown(row.values[key], digits[key]) == text for key, text in wanted)
    ]
    if not rows:
        what = " and ".join(sorted(needed))
        if any(row.hours > 0.0 for row in table.rows):
            raise PlotError(
                f"no case that has finished has {what}: the table of the study says why"
            )
        raise PlotError(f"no case with {what} has finished yet")
    return rows


def _digits(table: StudyTable) -> dict[str, int]:
    """With how many digits the values of each key are told apart."""
    return {key: digits_of(values_of(table.rows, key)) for key in table.keys}


def values_of(rows: Iterable[Row], key: str) -> list[Value]:
    """The values that a key takes, each once."""
    return list(dict.fromkeys(row.values[key] for row in rows if key in row.values))


def _refuse_same_places(
    names: dict[str, str], group: Sequence[Row], across: str, label: str
) -> None:
    """Refuse points of one series at the same place: keys that nobody asked about differ."""
    first: dict[Value, Row] = {}
    for row in group:
        other = first.setdefault(row.values[across], row)
        if other is not row:
            differing = (key for key in row.values if row.values[key] != other.values.get(key))
            name = names[next(key for key in differing if key != across)]
            which = f" of {label}" if label else ""
            raise PlotError(
                f"points{which} differ by {name} as well: choose with --by, --facet or "
                f"--where {name}=VALUE"
            )


def _series(label: str, group: Sequence[Row], request: PlotRequest, across: str | None) -> Series:
    points = []
    for row in group:
        if across is None:
            place, spread = _with_error(row, request.against)
        else:
            where = row.values[across]
            if isinstance(where, str | bool):
                raise PlotError(f"{request.against} has values that are no numbers")
            place, spread = float(where), math.nan
        points.append((place, *_with_error(row, request.of), spread))
    return Series(label, *np.array(sorted(points)).T)


def _with_error(row: Row, name: str) -> tuple[float, float]:
    """An observable with the larger of its errors."""
    value, within, _ = row.numbers[name]
    return value, float(np.fmax(within, row.between.get(name, math.nan)))
