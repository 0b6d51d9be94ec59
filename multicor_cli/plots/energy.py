"""Figures over time: the energy books, and columns of the time series."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from multicor_cli.model.model import Floats
from multicor_cli.plots.style import COLORS, COLUMN, PAGE, PlotError, Renderer, Terminal, TextLine, draw_text, show_decades
from multicor_cli.post.energy import HEAT, MECHANICAL, BookLine, EnergyTable, SeriesTable
from multicor_cli.text import unit_sign

# ---- The energy books: what came in and where it went, stacked, and how well the books close

_VISIBLE = 0.02  # lines that stay below this part of the largest one are left out of charts of letters
_GAIN = BookLine("kinetic_gain", "kinetic energy", sign=-1)
_STORED = BookLine("heat_stored", "stored in the grains", sign=-1)
_SHORT = {
    "gravity_work": "gravity", "wall_work": "walls", "load_work": "loads", "friction_loss": "friction", "impact_loss": "impacts",
    "damping_loss": "damping", "correction_work": "projection", "kinetic_gain": "kinetic", "heat_friction": "friction",
    "heat_impact": "impacts", "heat_from_walls": "from walls", "heat_from_ambient": "from fluid",
    "heat_from_surroundings": "surroundings", "heat_to_walls": "into walls", "heat_stored": "stored",
    "kinetic_in": "grains in", "kinetic_out": "grains out", "heat_out": "grains out",
}  # fmt: skip
COLOR_OF = {
    "gravity_work": "0.5", "wall_work": COLORS[2], "load_work": COLORS[0], "friction_loss": COLORS[1], "impact_loss": COLORS[5],
    "damping_loss": COLORS[3], "correction_work": "#f0e442", "kinetic_gain": COLORS[4], "heat_friction": COLORS[1],
    "heat_impact": COLORS[5], "heat_from_walls": COLORS[2], "heat_from_ambient": "#332288",
    "heat_from_surroundings": "#882255", "heat_to_walls": "0.5", "heat_stored": COLORS[4],
    "kinetic_in": "#117733", "kinetic_out": "#999933", "heat_out": "#999933",
}  # fmt: skip
"""One color for one thing: friction and impacts, as a loss and as heat; walls, as work and as heat; what
is kept, as motion and as heat."""


def draw_energy(figure: Any, table: EnergyTable) -> None:
    """Draw the books into a matplotlib figure: mechanics, beside it heat if there is any, the closures below."""
    books = [("energy since the start [J]", [*_flows(table, MECHANICAL), _GAIN], table.closure)]
    if table.heat_closure is not None:
        books.append(("heat since the start [J]", [*_flows(table, HEAT), _STORED], table.heat_closure))
    grid = figure.subplots(2, len(books), sharex=True, squeeze=False, height_ratios=(3.0, 1.0))
    for (above, below), (label, entries, closure) in zip(grid.T, books, strict=True):
        _draw_stack(above, table, entries)
        above.set_ylabel(label)
        _draw_closure(below, table.time, closure)


def _flows(table: EnergyTable, entries: Sequence[BookLine]) -> list[BookLine]:
    """The lines of what comes in and goes out that the run has."""
    return [entry for entry in entries if entry.sign and entry.name in table.books]


def _draw_stack(panel: Any, table: EnergyTable, entries: Sequence[BookLine]) -> None:
    """What came in upwards from zero, what went out downwards; entries that never matter are left out."""
    values = {e: table.books[e.name] * (1.0 if e.sign > 0 else -1.0) for e in entries}
    largest = max(float(np.abs(v).max()) for v in values.values())
    shown = [e for e in entries if float(np.abs(values[e]).max()) > 1e-3 * largest]
    up, down = np.zeros_like(table.time), np.zeros_like(table.time)
    for entry in shown:
        high, low = up + np.maximum(values[entry], 0.0), down + np.minimum(values[entry], 0.0)
        style = {"color": COLOR_OF[entry.name], "linewidth": 0.0}
        panel.fill_between(table.time, up, high, label=_SHORT[entry.name], **style)
        panel.fill_between(table.time, low, down, **style)
        up, down = high, low
    panel.axhline(0.0, color="0.2", linewidth=0.6)
    panel.ticklabel_format(axis="y", scilimits=(-3, 4), useMathText=True)
    panel.margins(x=0.0)
    if shown:
        panel.legend(loc="lower center", bbox_to_anchor=(0.5, 1.03), ncols=3, columnspacing=1.0, handlelength=1.0)


def _draw_closure(panel: Any, time: Floats, closure: Floats) -> None:
    known = closure > 0.0
    panel.semilogy(time[known], closure[known], color=COLORS[0])
    panel.set_xlabel("time $t$ [s]")
    panel.set_ylabel("closure [–]")
    show_decades(panel.yaxis, closure[known])


def energy_text(table: EnergyTable, _terminal: Terminal) -> str:
    """The energy books over time, mechanical ones and those of heat in one chart."""
    lines = [TextLine(f"{entry.label} [J]", table.time, table.books[entry.name]) for entry in table.entries]
    largest = max((float(np.abs(line.y).max()) for line in lines), default=0.0)
    return draw_text([line for line in lines if np.abs(line.y).max() > _VISIBLE * largest], "time [s]", "energy [J]")


# ---- Figure of columns of the time series: a panel for each unit

_LOW = 8  # rows of a chart of letters


def _units(table: SeriesTable) -> list[str]:
    units = list(dict.fromkeys(column.unit for column in table.quantities))
    crowded = [unit for unit in units if sum(column.unit == unit for column in table.quantities) > len(COLORS)]
    if crowded:
        unit = "without unit" if crowded[0] == "1" else f"in {crowded[0]}"
        count = sum(column.unit == crowded[0] for column in table.quantities)
        message = f"{count} lines {unit} cannot be told apart in one panel: choose columns, as --of kinetic or --of force_x"
        raise PlotError(message)
    return units


def draw_series(figure: Any, table: SeriesTable) -> None:
    """Draw the panels into a matplotlib figure."""
    units = _units(table)
    panels = figure.subplots(len(units), 1, sharex=True, squeeze=False)[:, 0]
    for panel, unit in zip(panels, units, strict=True):
        shown = [column for column in table.quantities if column.unit == unit]
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
        draw_text([TextLine("", table.time, column.values)], "time [s]", f"{column.name} [{unit_sign(column.unit)}]", rows=_LOW)
        for column in table.quantities
    ]
    return "\n\n".join(charts)


def _size(table: SeriesTable) -> tuple[float, float]:
    return 1.3 * COLUMN, COLUMN * (0.3 + 0.45 * len(_units(table)))


FIGURES = {
    EnergyTable: Renderer(lambda table: (COLUMN if table.heat_closure is None else PAGE, 1.15 * COLUMN), draw_energy, energy_text),
    SeriesTable: Renderer(_size, draw_series, series_text),
}
