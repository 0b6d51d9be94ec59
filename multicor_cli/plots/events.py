"""Figures of single events: stays between inflow and outlet, and drops of a column over time."""

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
    label_sparsely,
)
from multicor_cli.post.avalanches import Avalanches
from multicor_cli.post.residence import Residence
from multicor_cli.text import unit_sign

# ---- How long grains stay


def draw_residence(axes: Any, table: Residence) -> None:
    """Draw the share of stays that last longer, of all and of each group, into matplotlib axes."""
    # a single group is all of them
    shown = list(zip(table.group, table.survival, strict=True))[: None if table.group[2:] else 1]
    for k, (name, each) in enumerate(shown):
        color = "0.25" if k == 0 else COLORS[(k - 1) % len(COLORS)]
        time = np.concatenate([[0.0], each.time])
        share, low, high = (np.concatenate([[1.0], v]) for v in (each.share, each.low, each.high))
        axes.step(time, share, where="post", color=color, linewidth=0.9, label=name)
        band: dict[str, Any] = {"color": color, "alpha": 0.2, "linewidth": 0.0, "step": "post"}
        axes.fill_between(time, low, high, **band)
    axes.fill_between([], [], color="0.3", alpha=0.2, linewidth=0.0, label="± standard error")
    axes.set(xlim=(0.0, 1.05 * float(table.longest[0])), ylim=(0.0, 1.02))
    axes.set_xlabel("time since the entry $t$ [s]")
    axes.set_ylabel("share still inside $S(t)$ [–]")
    axes.legend(loc="best")


def residence_text(table: Residence, _terminal: Terminal) -> str:
    """The survival of all stays and of each group."""
    shown = list(zip(table.group, table.survival, strict=True))[: None if table.group[2:] else 1]
    lines = [TextLine(name if shown[1:] else "", each.time, each.share) for name, each in shown]
    return draw_text(lines, "time since the entry [s]", "share still inside [–]")


# ---- Drops of a column


def draw_avalanches(figure: Any, table: Avalanches) -> None:
    """Draw the column with its drops, and below the share of drops that are larger."""
    above, below = figure.subplots(2, 1)
    events = table.events
    above.plot(table.time, table.value, color="0.55", linewidth=0.7)
    times = np.array([events.start, events.start + events.duration])
    ends = np.interp(times, table.time, table.value)
    gap = np.full((1, events.start.size), np.nan)  # no line from one drop to the next
    drops = [np.concatenate([each, gap]).T.ravel() for each in (times, ends)]
    above.plot(*drops, color=COLORS[1], linewidth=1.1, label="drops")
    above.set_xlabel("time $t$ [s]")
    name = table.of.replace("_", " ")
    above.set_ylabel(f"{name} [{unit_sign(table.unit)}]")
    above.ticklabel_format(axis="y", scilimits=(-3, 4), useMathText=True)
    above.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.1)
    size = np.sort(events.size)
    share = 1.0 - np.arange(size.size) / size.size
    below.loglog(size, share, "o", color=COLORS[1], markersize=2.0, markeredgewidth=0.0)
    if (law := table.law) is not None:
        tail = size[size >= law.start]
        line = share[size.size - tail.size] * (tail / law.start) ** (1.0 - law.exponent)
        text = rf"$\tau$ = {law.exponent:.2f} ± {law.error:.2f}"
        below.plot(tail, line, "--", color="0.2", linewidth=0.9, label=text)
        below.legend(loc="lower left")
    below.set_xlabel(f"drop $s$ [{unit_sign(table.unit)}]")
    below.set_ylabel("share of drops ≥ $s$ [–]")
    if size[0] == size[-1]:
        below.set_xlim(0.5 * size[0], 2.0 * size[0])
    for axis in (below.xaxis, below.yaxis):
        label_sparsely(axis)
    figure.align_ylabels()


def avalanches_text(table: Avalanches, _terminal: Terminal) -> str:
    """The column over time."""
    label = f"{table.of} [{unit_sign(table.unit)}]"
    return draw_text([TextLine("", table.time, table.value)], "time [s]", label)


FIGURES = {
    Residence: Renderer(
        lambda _: (COLUMN, 0.85 * COLUMN),
        lambda figure, table: draw_residence(figure.add_subplot(), table),
        residence_text,
    ),
    Avalanches: Renderer(lambda _: (1.2 * COLUMN, 1.4 * COLUMN), draw_avalanches, avalanches_text),
}
