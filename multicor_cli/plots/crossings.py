"""Figure of a flow through a line: what has crossed it, summed over time."""

from __future__ import annotations

from typing import Any

import numpy as np

from multicor_cli.plots.style import COLORS, COLUMN, Renderer, Terminal, TextLine, draw_text
from multicor_cli.post.crossings import FlowTable
from multicor_cli.text import with_error


def draw_flow(figure: Any, table: FlowTable) -> None:
    """Draw the mass that has crossed, and the line of the mean rate, into a matplotlib figure."""
    axes = figure.add_subplot()
    start = table.time[0] - table.duration[0]
    time, mass = np.append(start, table.time), np.append(0.0, np.cumsum(table.crossed["mass"]))
    axes.plot(time, mass, color=COLORS[0], label="crossed")
    mean, error = table.mean["mass"], float(table.spread["mass"].error)
    rate = with_error(mean, error)
    text = f"mean, ({rate}) kg/s" if "±" in rate and not rate.startswith("(") else f"mean, {rate} kg/s"
    axes.plot(time, mean * (time - start), color="0.3", linewidth=0.8, linestyle="--", label=text)
    axes.set_xlabel("time $t$ [s]")
    axes.set_ylabel("mass through the line [kg]")
    axes.ticklabel_format(axis="y", scilimits=(-3, 4), useMathText=True)
    figure.legend(loc="outside upper center", ncols=2)


def flow_text(table: FlowTable, _terminal: Terminal) -> str:
    """The mass that has crossed as a chart of letters."""
    return draw_text([TextLine("", table.time, np.cumsum(table.crossed["mass"]))], "time [s]", "mass through the line [kg]")


FIGURES = {FlowTable: Renderer(lambda _: (COLUMN, 0.75 * COLUMN), draw_flow, flow_text)}
