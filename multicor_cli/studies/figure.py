"""Figure of a study: an observable against a value, with errors, in panels; fits, formulas."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from multicor_cli.model.model import Floats
from multicor_cli.optional import library
from multicor_cli.plots.style import (
    COLORS,
    COLUMN,
    PAGE,
    PlotError,
    TextLine,
    draw_text,
    figure_file,
    label_sparsely,
)
from multicor_cli.scenario.expressions import Expression
from multicor_cli.scenario.problems import Refused
from multicor_cli.studies.axes import short_names
from multicor_cli.studies.table import Panel, PlotRequest, Series, StudyTable, find_key

# ---- Curves through the points of a study, and curves given as formulas beside them

FITS = ("line", "power", "mu-of-I")
"""y = a + b x; y = a x^b; μ = μ_s + (μ_2 − μ_s)/(1 + I_0/I) (Jop et al., Nature 441, 727, 2006)."""


@dataclass(frozen=True)
class Curve:
    """A curve in a figure: ``text`` is a fit with parameters and errors, or a formula's name."""

    text: str
    value: Callable[[Floats], Floats]


def fit(kind: str, series: Series) -> Curve:
    """A curve through a series, weighted by the errors where all are known.

    Raises:
        PlotError: There are too few points, or no curve of this kind goes through them.
        MissingLibrary: scipy is not installed.
    """
    curve_fit = library("scipy.optimize").curve_fit
    names, model, start = _model(kind, series)
    label = series.label or "the series"
    if series.x.size < len(names) + 1:
        needed = f"a fit of kind {kind} needs {len(names) + 1} points"
        raise PlotError(f"{needed}, {label} has {series.x.size}")
    is_known = bool((np.isfinite(series.error) & (series.error > 0.0)).all())
    sigma = series.error if is_known else None
    try:
        found, covariance = curve_fit(
            model, series.x, series.y, start, sigma=sigma, absolute_sigma=is_known, maxfev=20_000
        )
    except (RuntimeError, ValueError) as error:
        label = series.label or "the points"
        raise PlotError(f"no curve of kind {kind} goes through {label}: {error}") from None
    errors = np.sqrt(np.diag(covariance))
    text = ", ".join(
        f"{name} = {value:.4g} ± {error:.2g}"
        for name, value, error in zip(names, found, errors, strict=True)
    )
    return Curve(text, lambda x: np.asarray(model(x, *found)))


def _model(kind: str, series: Series) -> tuple[tuple[str, ...], Callable[..., Floats], list[float]]:
    """Names of the parameters, the curve, and where the search begins."""
    x, y = series.x, series.y
    if kind == "line":
        return ("a", "b"), lambda x, a, b: a + b * x, [float(y.mean()), 0.0]
    if kind == "power":
        if (x <= 0.0).any() or (y <= 0.0).any():
            raise PlotError("a power law needs positive numbers")
        slope, height = np.polyfit(np.log(x), np.log(y), 1)
        return ("a", "b"), lambda x, a, b: a * x**b, [math.exp(height), float(slope)]
    if kind == "mu-of-I":
        start = [float(y.min()), 2.0 * float(y.max()), 0.3]
        return ("μ_s", "μ_2", "I_0"), lambda x, s, m, i: s + (m - s) / (1.0 + i / x), start
    raise PlotError(f"no fit is called {kind}; there are {', '.join(FITS)}")


def formula(text: str) -> Curve:
    """A curve in x, as ``da Cruz 2005: 0.25 + 1.1*x`` or nameless; raises `PlotError` if none."""
    name, _, body = text.rpartition(":")
    try:
        found = Expression(f"= {body.strip()}")
        found.check_names({"x": 1.0})
    except Refused as error:
        remedy = "write it as 'da Cruz 2005: 0.25 + 1.1*x'"
        raise PlotError(f"--curve {text!r}: {error.what}; {remedy}") from None

    def value(x: Floats) -> Floats:
        heights = []
        for where in x.tolist():
            try:
                heights.append(float(found.value({"x": where})))
            except Refused:
                heights.append(math.nan)
        return np.array(heights)

    return Curve(name.strip() or body.strip(), value)


# ---- The figure

_MARKERS = "os^Dv<>ph*"
_ACROSS = 3
"""Panels side by side."""


def label_of(table: StudyTable, name: str) -> str:
    """What an axis is called."""
    if name in table.observables:
        return table.labels.get(name, name)
    return short_names(table.keys)[find_key(table, name)]


def _italic(label: str) -> str:
    """A symbol as such: an upright I reads as a bar."""
    return f"${label}$" if len(label) == 1 else label


def draw(
    path: Path, table: StudyTable, panels: list[Panel], request: PlotRequest,
    fits: list[list[Curve]], curves: Sequence[Curve] = (),
    *, log: str = "",
) -> None:  # fmt: skip
    """Write the figure; the ending of the path chooses the format.

    There is one fit for each series of each panel, or none at all; formulas are drawn as curves in
    every panel; ``log`` says which axes have a logarithmic scale: "x", "y" or "xy".

    Raises:
        MissingLibrary: If matplotlib is not installed.
        PlotError: If the ending is not known.
    """
    columns = min(len(panels), _ACROSS)
    rows = -(-len(panels) // columns)
    width = COLUMN if columns == 1 else PAGE
    height = 0.8 * COLUMN if columns == 1 else 0.9 * PAGE / columns
    with figure_file(path, width, rows * height) as figure:
        draw_into(figure, table, panels, request, fits, curves, log=log)


def draw_into(
    figure: Any,
    table: StudyTable,
    panels: list[Panel],
    request: PlotRequest,
    fits: list[list[Curve]],
    curves: Sequence[Curve] = (),
    *,
    log: str = "",
) -> None:
    """Draw into a figure of matplotlib; arguments as of `draw`."""
    columns = min(len(panels), _ACROSS)
    rows = -(-len(panels) // columns)
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    for axes in grid[len(panels) :]:
        axes.set_visible(False)
    for number, panel in enumerate(panels):
        axes = grid[number]
        for axis in log:
            getattr(axes, f"set_{axis}scale")("log")
        _draw_series(axes, panel, fits[number] if fits else [], is_log="x" in log)
        axes.set_title(panel.title, fontsize="medium")
        if number + columns >= len(panels):
            axes.set_xlabel(_italic(label_of(table, request.against)))
            axes.tick_params(labelbottom=True)
        if number % columns == 0:
            axes.set_ylabel(_italic(label_of(table, request.of)))
    _draw_curves(grid[: len(panels)], panels, curves, is_log="x" in log)
    for axes in grid[: len(panels)]:
        for axis in log:
            label_sparsely(getattr(axes, f"{axis}axis"))
    first = [line.label for line in panels[0].series]
    for number, panel in enumerate(panels):
        labels = [line.label for line in panel.series]
        if (number == 0 or labels != first) and (curves or any(labels)):
            handles, labels = grid[number].get_legend_handles_labels()
            # Points come first
            texts = {curve.text for curve in curves}
            order = sorted(range(len(labels)), key=lambda k: labels[k] in texts)
            grid[number].legend([handles[k] for k in order], [labels[k] for k in order])


def _draw_series(axes: Any, panel: Panel, fits: Sequence[Curve], *, is_log: bool) -> None:
    for number, line in enumerate(panel.series):
        color = COLORS[number % len(COLORS)]
        axes.errorbar(
            line.x, line.y, xerr=_bars(line.x_error), yerr=_bars(line.error),
            label=line.label or None, color=color,
            marker=_MARKERS[number % len(_MARKERS)], linestyle="none" if fits else "-", capsize=1.5,
            linewidth=0.8,
        )  # fmt: skip
        if fits:
            x = _between(line.x, is_log=is_log)
            axes.plot(x, fits[number].value(x), color=color, linewidth=0.8)


def _draw_curves(
    grid: Sequence[Any], panels: Sequence[Panel], curves: Sequence[Curve], *, is_log: bool
) -> None:
    """Formulas in all panels, cut where they leave the range of the points far behind."""
    if not curves:
        return
    low, high = grid[0].get_ylim()
    for axes, panel in zip(grid, panels, strict=True):
        x = _between(np.concatenate([line.x for line in panel.series]), is_log=is_log)
        for number, curve in enumerate(curves):
            style = {"linewidth": 0.9, "linestyle": ("--", ":", "-.")[number % 3]}
            axes.plot(x, curve.value(x), color="0.45", label=curve.text, **style)
    now = grid[0].get_ylim()
    grid[0].set_ylim(max(now[0], low - (high - low)), min(now[1], high + (high - low)))


def _bars(error: Floats) -> Floats | None:
    return np.where(np.isfinite(error), error, 0.0) if np.isfinite(error).any() else None


def _between(x: Floats, *, is_log: bool) -> Floats:
    low, high = float(x.min()), float(x.max())
    return np.geomspace(low, high, 200) if is_log and low > 0.0 else np.linspace(low, high, 200)


def draw_letters(table: StudyTable, panels: list[Panel], request: PlotRequest) -> str:
    """The figure as text for a terminal, one panel after the other."""
    across, up = label_of(table, request.against), label_of(table, request.of)
    charts = []
    for panel in panels:
        chart = draw_text(
            [TextLine(line.label, line.x, line.y) for line in panel.series], across, up
        )
        charts.append(f"{panel.title}\n{chart}" if panel.title else chart)
    return "\n\n".join(charts)
