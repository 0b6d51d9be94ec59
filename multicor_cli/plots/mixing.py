"""Figures of how groups of grains mix over time."""

from __future__ import annotations

from typing import Any

import numpy as np

from multicor_cli.plots.style import (
    COLORS,
    COLUMN,
    Renderer,
    Terminal,
    TextLine,
    draw_text,
    legend_above,
)
from multicor_cli.post.mixing import Mixing

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


FIGURES = {
    Mixing: Renderer(
        lambda table: (COLUMN, COLUMN * (1.2 if len(table.values) > 1 else 0.75)),
        draw_mixing,
        mixing_text,
    )
}
