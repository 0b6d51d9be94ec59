"""Series of points out of the table of a study: an observable against a value or another observable, in panels."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from multicor_cli.model.model import Floats
from multicor_cli.plots.style import PlotError
from multicor_cli.studies.axes import Value
from multicor_cli.studies.cases import short_names, shown
from multicor_cli.studies.table import Row, StudyTable


@dataclass(frozen=True)
class Series:
    """Points of one line, ascending in x.

    Attributes:
        label: What it is.
        x: Values of the key across, or of an observable, shape ``(k,)``.
        y: The observable, shape ``(k,)``.
        error: The larger of both standard errors, from within the runs and between the seeds; nan if neither is known.
        x_error: The same of ``x``; nan if that is a key.
    """

    label: str
    x: Floats
    y: Floats
    error: Floats
    x_error: Floats


@dataclass(frozen=True)
class Panel:
    """Series that share a pair of axes.

    Attributes:
        title: What they have in common; empty if there is one panel only.
        series: The series.
    """

    title: str
    series: list[Series]


@dataclass(frozen=True)
class Question:
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
    """The key with this name, whole or short.

    Raises:
        PlotError: No key of the study has it.
    """
    short = short_names(table.keys)
    for key in table.keys:
        if name in (key, short[key]):
            return key
    raise PlotError(f"the study varies no {name}; it varies {', '.join(short.values()) or 'nothing'}")


def make_panels(table: StudyTable, question: Question) -> list[Panel]:
    """The points of a figure.

    Args:
        table: Means over seeds.
        question: What is to be drawn.

    Raises:
        PlotError: There is no such key or observable, values across are no numbers, several points of a series have the same
            place, or nothing has been computed.
    """
    rows = _chosen(table, question)
    across = None if question.against in table.observables else find_key(table, question.against)
    facets = [] if question.facet is None else [find_key(table, question.facet)]
    left = [key for key in table.keys if key not in (across, *facets) and len(_values(rows, key)) > 1]
    if question.by is not None:
        by = [find_key(table, question.by)]
    else:
        along = max(left, key=lambda key: len(_values(rows, key)), default=None) if across is None else None
        by = [key for key in left if key != along]
    lines: dict[tuple[Value | None, ...], dict[tuple[Value | None, ...], list[Row]]] = {}
    for row in rows:
        panel = tuple(row.values.get(key) for key in facets)
        lines.setdefault(panel, {}).setdefault(tuple(row.values.get(key) for key in by), []).append(row)
    names = short_names(table.keys)
    found = []
    for panel, groups in lines.items():
        series = []
        for values, group in groups.items():
            label = _label(names, by, values)
            if across is not None:
                _refuse_same_places(names, group, across, label)
            series.append(_series(label, group, question, across))
        found.append(Panel(_label(names, facets, panel), series))
    return found


def _chosen(table: StudyTable, question: Question) -> list[Row]:
    """Rows with the observables that are asked for, and the values."""
    if question.of not in table.observables:
        raise PlotError(f"the study observes no {question.of}; it observes {', '.join(table.observables) or 'nothing'}")
    needed = {question.of, question.against} & {*table.observables}
    wanted = [(find_key(table, name), text) for name, text in question.where]
    for key, text in wanted:
        known = list(dict.fromkeys(shown(value) for value in _values(table.rows, key)))
        if text not in known:
            raise PlotError(f"{key} has no value {text}; it has {', '.join(known)}")
    rows = [row for row in table.rows if needed <= row.numbers.keys()]
    rows = [row for row in rows if all(shown(row.values[key]) == text for key, text in wanted)]
    if not rows:
        raise PlotError(f"no case with {' and '.join(sorted(needed))} has finished yet")
    return rows


def _values(rows: Iterable[Row], key: str) -> list[Value]:
    return list(dict.fromkeys(row.values[key] for row in rows if key in row.values))


def _label(names: dict[str, str], keys: Sequence[str], values: Sequence[Value | None]) -> str:
    return ", ".join(f"{names[key]} = {shown(value)}" for key, value in zip(keys, values, strict=True) if value is not None)


def _refuse_same_places(names: dict[str, str], group: Sequence[Row], across: str, label: str) -> None:
    """Points of one series at the same place: keys that nobody has asked about differ."""
    first: dict[Value, Row] = {}
    for row in group:
        other = first.setdefault(row.values[across], row)
        if other is not row:
            key = next(key for key in row.values if key != across and row.values[key] != other.values.get(key))
            which = f" of {label}" if label else ""
            raise PlotError(
                f"points{which} differ by {names[key]} as well: choose with --by, --facet or --where {names[key]}=VALUE"
            )


def _series(label: str, group: Sequence[Row], question: Question, across: str | None) -> Series:
    points = []
    for row in group:
        if across is None:
            place, spread = _number(row, question.against)
        else:
            where = row.values[across]
            if isinstance(where, str | bool):
                raise PlotError(f"{question.against} has values that are no numbers")
            place, spread = float(where), math.nan
        points.append((place, *_number(row, question.of), spread))
    return Series(label, *np.array(sorted(points)).T)


def _number(row: Row, name: str) -> tuple[float, float]:
    """An observable with the larger of its errors."""
    value, within, _ = row.numbers[name]
    return value, float(np.fmax(within, row.between.get(name, math.nan)))
