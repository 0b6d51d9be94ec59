"""The table of a study: a row for each case, and means over its seeds."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from multicor_cli.optional import library
from multicor_cli.studies.axes import Values
from multicor_cli.studies.cases import SEED, Case, short_names, shown
from multicor_cli.studies.directory import CaseStatus, StudyDirectory
from multicor_cli.studies.observing import observe
from multicor_cli.studies.schema import Observable


@dataclass(frozen=True)
class Row:
    """A case, or several seeds of one.

    Attributes:
        values: Values of the keys, that of the seed only in a row of one case.
        status: Of the case; of several: ``3 of 5 finished``.
        numbers: By observable: value, standard error, and number of seeds.
        between: By observable: standard error from the scatter between the seeds; nan with fewer than two.
        verdict: The worst.
        hours: Wall-clock time [h].
        case: Name of the case; empty for several.
        digest: Of the end of the run; likewise.
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
    """Rows of a study.

    Attributes:
        keys: Keys that vary, in their order.
        observables: Names of the observables.
        rows: The rows.
        is_mean: Whether rows are means over seeds.
        directory: That of the study.
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
        """Names of the columns."""
        names = [short_names(self.keys)[key] for key in self.keys]
        if self.is_mean:
            numbers = [text for name in self.observables for text in (name, f"{name}_error", f"{name}_between", f"{name}_seeds")]
            return [*names, "status", *numbers, "verdict", "hours"]
        numbers = [text for name in self.observables for text in (name, f"{name}_error")]
        return [*names, "status", *numbers, "verdict", "hours", "digest", "directory"]

    @property
    def records(self) -> list[list[Any]]:
        """Rows as lists, in the order of `headings`; what is not known is None."""
        return [self._record(row) for row in self.rows]

    def _record(self, row: Row) -> list[Any]:
        found: list[Any] = [row.values.get(key) for key in self.keys]
        found.append(row.status)
        for name in self.observables:
            value, error, count = row.numbers.get(name, (math.nan, math.nan, 0))
            found += [_known(value), _known(error)]
            if self.is_mean:
                found += [_known(row.between.get(name, math.nan)), count]
        found += [row.verdict, _known(row.hours)]
        return found if self.is_mean else [*found, row.digest, str(self.directory.case(row.case))]

    @property
    def lines(self) -> tuple[list[str], list[list[str]]]:
        """Headings and rows for people: numbers with their errors, the larger one where there are two, in one column."""
        names = short_names(self.keys)
        headings = [*(names[key] for key in self.keys), "status", *self.observables, "verdict", "hours"]
        return headings, [self._line(row) for row in self.rows]

    def _line(self, row: Row) -> list[str]:
        values = [shown(row.values[key]) if key in row.values else "" for key in self.keys]
        numbers = []
        for name in self.observables:
            value, error, _ = row.numbers.get(name, (math.nan, math.nan, 0))
            numbers.append(
                with_error(value, max(error, row.between.get(name, math.nan), key=lambda e: e if math.isfinite(e) else -1.0))
            )
        return [*values, row.status, *numbers, row.verdict, "–" if math.isnan(row.hours) else f"{row.hours:.3g}"]

    def csv(self) -> str:
        """As CSV."""
        out = io.StringIO()
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(self.headings)
        writer.writerows([["" if value is None else value for value in record] for record in self.records])
        return out.getvalue()

    def frame(self) -> Any:
        """As a pandas DataFrame; raises `MissingLibrary` where pandas is not installed."""
        return library("pandas").DataFrame(self.records, columns=self.headings)


def make_table(directory: StudyDirectory, observables: Sequence[Observable], cases: Sequence[Case]) -> StudyTable:
    """The table of a study, finished or not: a row for each case."""
    rows = []
    for case in cases:
        state = directory.state(case)
        if state.status is not CaseStatus.FINISHED:
            rows.append(Row(case.values, state.status.value, {}, {}, "", math.nan, case.name, problems={"": state.reason}))
            continue
        found = observe(directory, case, observables)
        numbers = {name: (_number(pair[0]), _number(pair[1]), 1) for name, pair in found["values"].items()}
        rows.append(
            Row(
                case.values, state.status.value, numbers, {}, found["verdict"], _number(found["hours"]), case.name,
                found["digest"] or "", found["problems"],
            )
        )  # fmt: skip
    keys = tuple(dict.fromkeys(key for case in cases for key in case.values))
    labels = {row.name: row.label for row in observables if row.label}
    return StudyTable(keys, tuple(row.name for row in observables), tuple(rows), is_mean=False, directory=directory, labels=labels)


def over_seeds(table: StudyTable) -> StudyTable:
    """Means over the seeds: a row for each combination of the other values.

    The error of a mean is that of the runs, √Σε²/n; beside it stands the one from the scatter between the seeds, s/√n.
    """
    keys = tuple(key for key in table.keys if key != SEED)
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for row in table.rows:
        groups.setdefault(tuple(row.values.get(key) for key in keys), []).append(row)
    rows = [_mean(dict(zip(keys, values, strict=True)), group, table.observables) for values, group in groups.items()]
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
    order = ("", "ok", "warning", "bad")
    verdict = max((row.verdict for row in group), key=lambda text: order.index(text) if text in order else 0)
    hours = math.fsum(row.hours for row in group if math.isfinite(row.hours))
    return Row(values, f"{done} of {len(group)} finished", numbers, between, verdict, hours)


def with_error(value: float, error: float) -> str:
    """A number with its error, to two digits of the error, as 0.2592 ± 0.0018; with five digits if the error is not known."""
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
