"""Figure of columns of the time series: a panel for each unit."""

from __future__ import annotations

from typing import Any

from multicor_cli.plots.dispatch import Ways
from multicor_cli.plots.style import COLORS, COLUMN, PlotError
from multicor_cli.plots.text_chart import TextLine, draw_text
from multicor_cli.plots.text_picture import Terminal
from multicor_cli.post.series import SeriesTable
from multicor_cli.text import unit_sign

_LOW = 8  # rows of a chart of letters


def _units(table: SeriesTable) -> list[str]:
    units = list(dict.fromkeys(column.unit for column in table.columns))
    crowded = [unit for unit in units if sum(column.unit == unit for column in table.columns) > len(COLORS)]
    if crowded:
        unit = "without unit" if crowded[0] == "1" else f"in {crowded[0]}"
        count = sum(column.unit == crowded[0] for column in table.columns)
        message = f"{count} lines {unit} cannot be told apart in one panel: choose columns, as --of kinetic or --of force_x"
        raise PlotError(message)
    return units


def draw_series(figure: Any, table: SeriesTable) -> None:
    """Draw the panels into a matplotlib figure."""
    units = _units(table)
    panels = figure.subplots(len(units), 1, sharex=True, squeeze=False)[:, 0]
    for panel, unit in zip(panels, units, strict=True):
        shown = [column for column in table.columns if column.unit == unit]
        for color, column in zip(COLORS, shown, strict=False):
            style = {"color": color, "linewidth": 0.9, "marker": "o" if table.time.size == 1 else ""}
            panel.plot(table.time, column.values, label=column.name.replace("_", " "), **style)
        names = list(dict.fromkeys(column.name.rpartition(": ")[2].replace("_", " ") for column in shown))
        name = names[0] if len(names) == 1 else _common_words(names)
        panel.set_ylabel(f"{name} [{unit_sign(unit)}]".strip())
        panel.ticklabel_format(axis="y", scilimits=(-3, 4), useMathText=True)
        if len(shown) > 1:
            panel.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.1, columnspacing=1.0)
    panels[-1].set_xlabel("time $t$ [s]")
    figure.align_ylabels()


def _common_words(names: list[str]) -> str:
    """The words with which all names begin."""
    words = [name.split() for name in names]
    shared = [column[0] for column in zip(*words, strict=False) if len(set(column)) == 1]
    return " ".join(shared)


def series_text(table: SeriesTable, _terminal: Terminal) -> str:
    """The columns as charts of letters, one below the other."""
    charts = [
        draw_text([TextLine("", table.time, column.values)], "time [s]", f"{column.name} [{unit_sign(column.unit)}]", rows=_LOW)  # type: ignore[arg-type]
        for column in table.columns
    ]
    return "\n\n".join(charts)


def _size(table: SeriesTable) -> tuple[float, float]:
    return 1.3 * COLUMN, COLUMN * (0.3 + 0.45 * len(_units(table)))


FIGURES = {SeriesTable: Ways(_size, draw_series, series_text)}
