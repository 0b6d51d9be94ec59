"""Figure of columns of the time series: a panel for each unit."""

from __future__ import annotations

from typing import Any

from multicor_cli.plots.dispatch import Ways
from multicor_cli.plots.style import COLORS, COLUMN, PlotError
from multicor_cli.plots.text_chart import TextLine, draw_text
from multicor_cli.plots.text_picture import Terminal
from multicor_cli.post.series import SeriesTable

_LOW = 8  # rows of a chart of letters


def _units(table: SeriesTable) -> list[str]:
    units = list(dict.fromkeys(column.unit for column in table.columns))
    crowded = [unit for unit in units if sum(column.unit == unit for column in table.columns) > len(COLORS)]
    if crowded:
        message = f"more than {len(COLORS)} lines in {crowded[0]} cannot be told apart: choose columns with --of"
        raise PlotError(message)
    return units


def draw_series(figure: Any, table: SeriesTable) -> None:
    """Draw the panels into a matplotlib figure."""
    units = _units(table)
    panels = figure.subplots(len(units), 1, sharex=True, squeeze=False)[:, 0]
    for panel, unit in zip(panels, units, strict=True):
        shown = [column for column in table.columns if column.unit == unit]
        for color, column in zip(COLORS, shown, strict=False):
            panel.plot(table.time, column.values, color=color, linewidth=0.9, label=column.name.replace("_", " "))
        name = shown[0].name.replace("_", " ") if len(shown) == 1 else ""
        panel.set_ylabel(f"{name} [{'–' if unit == '1' else unit}]".strip())
        panel.ticklabel_format(axis="y", scilimits=(-3, 4), useMathText=True)
        if len(shown) > 1:
            panel.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.1, columnspacing=1.0)
    panels[-1].set_xlabel("time $t$ [s]")
    figure.align_ylabels()


def series_text(table: SeriesTable, _terminal: Terminal) -> str:
    """The columns as charts of letters, one below the other."""
    charts = [
        draw_text([TextLine("", table.time, column.values)], "time [s]", f"{column.name} [{column.unit}]", rows=_LOW)  # type: ignore[arg-type]
        for column in table.columns
    ]
    return "\n\n".join(charts)


def _size(table: SeriesTable) -> tuple[float, float]:
    return 1.3 * COLUMN, COLUMN * (0.3 + 0.45 * len(_units(table)))


FIGURES = {SeriesTable: Ways(_size, draw_series, series_text)}
