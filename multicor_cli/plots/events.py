"""Figures of grains that pass, stay and mix, and of drops of a column over time."""

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
    in_axes,
    label_sparsely,
    legend_above,
    use_powers,
)
from multicor_cli.post.avalanches import Avalanches
from multicor_cli.post.crossings import FlowTable, Residence, Survival
from multicor_cli.post.mixing import Mixing, Segregation
from multicor_cli.text import unit_sign, with_error

# ---- What has flowed through a line, summed over time


def draw_flow(axes: Any, table: FlowTable) -> None:
    """Draw the mass that has crossed, and the line of the mean rate, into matplotlib axes."""
    start = table.time[0] - table.duration[0]
    time, mass = np.append(start, table.time), np.append(0.0, np.cumsum(table.crossed["mass"]))
    axes.plot(time, mass, color=COLORS[0], label="crossed")
    mean, error = table.mean["mass"], float(table.spread["mass"].error)
    rate = with_error(mean, error)
    if "±" in rate and not rate.startswith("("):
        rate = f"({rate})"
    text = f"mean, {rate} kg/s"
    axes.plot(time, mean * (time - start), color="0.3", linewidth=0.8, linestyle="--", label=text)
    axes.set_xlabel("time $t$ [s]")
    axes.set_ylabel("mass through the line [kg]")
    use_powers(axes)
    axes.figure.legend(loc="outside upper center", ncols=2)


def flow_text(table: FlowTable, _terminal: Terminal) -> str:
    """The mass that has crossed as a chart of letters."""
    line = TextLine("", table.time, np.cumsum(table.crossed["mass"]))
    return draw_text([line], "time [s]", "mass through the line [kg]")


# ---- How long grains stay


def draw_residence(axes: Any, table: Residence) -> None:
    """Draw the share of stays that last longer, of all and of each group, into matplotlib axes."""
    for k, (name, each) in enumerate(_curves(table)):
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


def _curves(table: Residence) -> list[tuple[str, Survival]]:
    """All, and each group, of which a single one is all."""
    return list(zip(table.group, table.survival, strict=True))[: None if table.group[2:] else 1]


def residence_text(table: Residence, _terminal: Terminal) -> str:
    """The survival of all stays and of each group."""
    shown = _curves(table)
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
    use_powers(above)
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


# ---- How groups of grains mix over time, and where they lie


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
    index.set_ylabel("mixing index $M$ [–]")
    index.margins(y=0.08)
    legend_above(index, 1)
    if heights:
        for k, name in enumerate(heights):
            color, text = COLORS[k % len(COLORS)], name.removeprefix("height_")
            panels[1].plot(table.time, table.values[name], color=color, label=text, **style)
        panels[1].set_ylabel("mean height $y$ [m]")
        use_powers(panels[1])
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
        use_powers(axis)


def segregation_text(table: Segregation, _terminal: Terminal) -> str:
    """The profiles of the first and of the last time."""
    ends = {"first": table.value[0], "last": table.value[-1]}
    lines = [TextLine(name, table.y, values) for name, values in ends.items()]
    label = f"{table.label} [{unit_sign(table.quantity.unit)}]"
    return draw_text(lines[: table.time.size], "height y [m]", label)


FIGURES = {
    FlowTable: Renderer((COLUMN, 0.75 * COLUMN), in_axes(draw_flow), flow_text),
    Residence: Renderer((COLUMN, 0.85 * COLUMN), in_axes(draw_residence), residence_text),
    Avalanches: Renderer((1.2 * COLUMN, 1.4 * COLUMN), draw_avalanches, avalanches_text),
    Mixing: Renderer(
        lambda table: (COLUMN, COLUMN * (1.2 if len(table.values) > 1 else 0.75)),
        draw_mixing,
        mixing_text,
    ),
    Segregation: Renderer((1.3 * COLUMN, COLUMN), draw_segregation, segregation_text),
}
