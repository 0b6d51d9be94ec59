"""Figures of how groups of grains mix over time, and of where they lie."""

from __future__ import annotations

from typing import Any

import numpy as np

from multicor_cli.plots.style import (
    COLORS,
    COLUMN,
    Renderer,
    Terminal,
    TextLine,
    axis_label,
    color_map,
    draw_text,
    legend_above,
)
from multicor_cli.post.mixing import Mixing, Segregation
from multicor_cli.text import unit_sign

_INDEX = "mixing index $M$ [–]"


def draw_mixing(figure: Any, table: Mixing) -> None:
    """Draw the index and what chance makes of it, and the mean heights of the groups below."""
    heights = [name for name in table.values if name.startswith("height_")]
    panels = figure.subplots(2 if heights else 1, 1, sharex=True, squeeze=False)[:, 0]
    style: dict[str, Any] = {"linewidth": 0.9, "marker": "o" if table.time.size < 60 else ""}
    style |= {"markersize": 2.5, "markeredgewidth": 0.0}
    index, scatter = panels[0], np.nan_to_num(table.random_scatter)
    index.axhline(0.0, color="0.6", linewidth=0.6)
    index.axhline(1.0, color="0.4", linewidth=0.7, linestyle="--")
    index.axhspan(
        1.0 - scatter, 1.0 + scatter, color="0.3", alpha=0.2, linewidth=0.0, label="by chance"
    )
    index.plot(table.time, table.values["mixing_index"], color=COLORS[0], **style)
    index.set_ylabel(_INDEX)
    index.margins(y=0.08)
    legend_above(index, 1)
    if heights:
        for k, name in enumerate(heights):
            color, text = COLORS[k % len(COLORS)], name.removeprefix("height_")
            panels[1].plot(table.time, table.values[name], color=color, label=text, **style)
        panels[1].set_ylabel("mean height $y$ [m]")
        panels[1].ticklabel_format(axis="y", scilimits=(-3, 4), useMathText=True)
        legend_above(panels[1], min(len(heights), 3))
    panels[-1].set_xlabel("time $t$ [s]")
    figure.align_ylabels()


def mixing_text(table: Mixing, _terminal: Terminal) -> str:
    """The index over time."""
    return draw_text(
        [TextLine("", table.time, table.values["mixing_index"])], "time [s]", "mixing index M [–]"
    )


def draw_segregation(figure: Any, table: Segregation) -> None:
    """Draw a share from 0 to 1, or a mean diameter, in colors: time across, height upwards."""
    axes, quantity, known = figure.subplots(), table.quantity, np.isfinite(table.value)
    time, y = table.time_edges, table.y_edges
    if time[0] == time[-1]:  # one frame has a column of some width
        time = time[0] + np.linspace(-0.5, 0.5, time.size)
        axes.set_xticks([time.mean()], [f"{table.times[0]:.4g}"])
    style: dict[str, Any] = {"vmin": 0.0, "vmax": 1.0}
    if not table.group and known.any():
        style = {"vmin": np.nanmin(table.value), "vmax": np.nanmax(table.value)}
    mesh = axes.pcolormesh(
        time, y, np.ma.masked_invalid(table.value.T), rasterized=True,
        cmap=color_map("viridis"), **style,
    )  # fmt: skip
    bar = figure.colorbar(mesh, ax=axes)
    bar.set_label(axis_label(table.label, quantity.symbol, quantity.unit))
    axes.set_xlabel("time $t$ [s]")
    axes.set_ylabel("height $y$ [m]")
    for axis in (axes, bar.ax):
        axis.ticklabel_format(axis="y", scilimits=(-3, 4), useMathText=True)


def segregation_text(table: Segregation, _terminal: Terminal) -> str:
    """The profiles of the first and of the last time."""
    ends = {"first": table.value[0], "last": table.value[-1]}
    lines = [TextLine(name, table.y, values) for name, values in ends.items()]
    label = f"{table.label} [{unit_sign(table.quantity.unit)}]"
    return draw_text(lines[: table.time.size], "height y [m]", label)


FIGURES = {
    Mixing: Renderer(
        lambda table: (COLUMN, COLUMN * (1.2 if len(table.values) > 1 else 0.75)),
        draw_mixing,
        mixing_text,
    ),
    Segregation: Renderer(lambda _: (1.3 * COLUMN, COLUMN), draw_segregation, segregation_text),
}
