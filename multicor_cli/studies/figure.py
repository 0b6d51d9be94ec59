"""Figure of a study: an observable against a value, a series for each value of another key, error bars, and a fit if asked."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from multicor_cli.model.model import Floats
from multicor_cli.plots.style import COLORS, COLUMN, PlotError, figure_file
from multicor_cli.plots.text_chart import TextLine, draw_text
from multicor_cli.studies.axes import Value
from multicor_cli.studies.cases import short_names, shown
from multicor_cli.studies.table import StudyTable

_MARKERS = "os^Dv<>ph*"


@dataclass(frozen=True)
class Series:
    """Points of one line, ascending in x.

    Attributes:
        label: What it is.
        x: Values of the key across, shape ``(k,)``.
        y: The observable, shape ``(k,)``.
        error: The larger of both standard errors, from within the runs and between the seeds; nan if neither is known.
    """

    label: str
    x: Floats
    y: Floats
    error: Floats


@dataclass(frozen=True)
class Fit:
    """A curve through a series.

    Attributes:
        text: The curve with its parameters and their errors.
        curve: The curve.
    """

    text: str
    curve: Callable[[Floats], Floats]


FITS = ("line", "power", "mu-of-I")
"""Kinds of fits: y = a + b x; y = a x^b; μ(I) = μ_s + (μ_2 − μ_s)/(1 + I_0/I) (P. Jop et al., Nature 441, 727, 2006)."""


def find_key(table: StudyTable, name: str) -> str:
    """The key with this name, whole or short.

    Raises:
        PlotError: No key of the study has it.
    """
    short = short_names(table.keys)
    for key in table.keys:
        if name in (key, short[key]):
            return key
    raise PlotError(f"the study varies no {name}; it varies {', '.join(short.values())}")


def make_series(table: StudyTable, observable: str, x: str, by: str | None) -> list[Series]:
    """Points of an observable against a key, a series for each combination of the others, or for each value of ``by``.

    Raises:
        PlotError: There is no such key or observable, values of ``x`` are no numbers, or nothing has been computed.
    """
    if observable not in table.observables:
        raise PlotError(f"the study observes no {observable}; it observes {', '.join(table.observables) or 'nothing'}")
    across, rest = find_key(table, x), [key for key in table.keys if key != find_key(table, x)]
    if by is not None:
        rest = [find_key(table, by)]
    groups: dict[tuple[Value | None, ...], list[tuple[float, float, float]]] = {}
    for row in table.rows:
        if observable not in row.numbers:
            continue
        where = row.values[across]
        if isinstance(where, str | bool):
            raise PlotError(f"{x} has values that are no numbers")
        value, within, _ = row.numbers[observable]
        error = np.fmax(within, row.between.get(observable, math.nan))
        groups.setdefault(tuple(row.values.get(key) for key in rest), []).append((float(where), value, float(error)))
    if not groups:
        raise PlotError(f"no case with {observable} has finished yet")
    short = short_names(table.keys)
    series = []
    for values, points in groups.items():
        label = ", ".join(f"{short[key]} = {shown(value)}" for key, value in zip(rest, values, strict=True) if value is not None)
        columns = np.array(sorted(points)).T
        series.append(Series(label, *columns))
    return series


def fit(kind: str, series: Series) -> Fit:
    """A curve through a series, weighted by the errors where all are known.

    Raises:
        PlotError: There are too few points, or no curve of this kind goes through them.
    """
    from scipy.optimize import curve_fit

    names, model, start = _model(kind, series)
    if series.x.size < len(names) + 1:
        raise PlotError(f"a fit of kind {kind} needs {len(names) + 1} points, {series.label or 'the series'} has {series.x.size}")
    is_known = bool((np.isfinite(series.error) & (series.error > 0.0)).all())
    try:
        found, covariance = curve_fit(
            model, series.x, series.y, start, sigma=series.error if is_known else None, absolute_sigma=is_known, maxfev=20_000
        )
    except (RuntimeError, ValueError) as error:
        raise PlotError(f"no curve of kind {kind} goes through {series.label or 'the points'}: {error}") from None
    errors = np.sqrt(np.diag(covariance))
    text = ", ".join(f"{name} = {value:.4g} ± {error:.2g}" for name, value, error in zip(names, found, errors, strict=True))
    return Fit(text, lambda x: np.asarray(model(x, *found)))


def _model(kind: str, series: Series) -> tuple[tuple[str, ...], Callable[..., Floats], list[float]]:
    """Names of the parameters, the curve, and where the search begins."""
    x, y = series.x, series.y
    if kind == "line":
        return ("a", "b"), lambda x, a, b: a + b * x, [float(y.mean()), 0.0]
    if kind == "power":
        if (x <= 0.0).any() or (y <= 0.0).any():
            raise PlotError("a power law needs positive numbers")
        slope, start = np.polyfit(np.log(x), np.log(y), 1)
        return ("a", "b"), lambda x, a, b: a * x**b, [math.exp(start), float(slope)]
    if kind == "mu-of-I":
        return ("μ_s", "μ_2", "I_0"), lambda x, s, m, i: s + (m - s) / (1.0 + i / x), [float(y.min()), 2.0 * float(y.max()), 0.3]
    raise PlotError(f"no fit is called {kind}; there are {', '.join(FITS)}")


def draw(path: Path, table: StudyTable, series: list[Series], observable: str, x: str, fits: list[Fit], *, log: str = "") -> None:
    """Write the figure.

    Args:
        path: File to write; its ending chooses the format.
        table: The table.
        series: Its series.
        observable: What is shown.
        x: Against which key.
        fits: One for each series, or none.
        log: Axes with a logarithmic scale: "x", "y" or "xy".

    Raises:
        PlotError: If matplotlib is not installed or the ending is not known.
    """
    with figure_file(path, COLUMN, 0.8 * COLUMN) as figure:
        axes = figure.subplots()
        for number, line in enumerate(series):
            color = COLORS[number % len(COLORS)]
            axes.errorbar(
                line.x, line.y, yerr=np.where(np.isfinite(line.error), line.error, 0.0), label=line.label or None, color=color,
                marker=_MARKERS[number % len(_MARKERS)], linestyle="none" if fits else "-", capsize=1.5, linewidth=0.8,
            )  # fmt: skip
            if fits:
                grid = _between(line.x, is_log="x" in log)
                axes.plot(grid, fits[number].curve(grid), color=color, linewidth=0.8)
        axes.set_xlabel(short_names(table.keys)[find_key(table, x)])
        axes.set_ylabel(observable)
        for axis in log:
            getattr(axes, f"set_{axis}scale")("log")
        if any(line.label for line in series):
            axes.legend()


def _between(x: Floats, *, is_log: bool) -> Floats:
    low, high = float(x.min()), float(x.max())
    return np.geomspace(low, high, 200) if is_log and low > 0.0 else np.linspace(low, high, 200)


def draw_letters(table: StudyTable, series: list[Series], observable: str, x: str) -> str:
    """The figure as text for a terminal."""
    name: Any = short_names(table.keys)[find_key(table, x)]
    return draw_text([TextLine(line.label, line.x, line.y) for line in series], name, observable)
