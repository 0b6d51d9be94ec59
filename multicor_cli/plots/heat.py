"""Figures of the heat of contacts: what flows through them, and hot spots of sliding ones."""

from __future__ import annotations

from typing import Any

import numpy as np

from multicor_cli.model.model import Floats
from multicor_cli.plots.forces import line_widths, lines_shown, segments
from multicor_cli.plots.grain_map import (
    add_color_bar,
    clip_to_cell,
    draw_grains,
    draw_walls,
    place_scene,
)
from multicor_cli.plots.style import (
    COLORS,
    COLUMN,
    PAGE,
    TITLE,
    Renderer,
    Terminal,
    TextLine,
    beyond,
    color_map,
    draw_picture,
    draw_text,
    label_sparsely,
    name_frame,
    show_decades,
)
from multicor_cli.post.heat import HeatNetwork, HotSpots
from multicor_cli.post.quantities import MAPPED, color_range

# ---- Heat that contacts conduct: a line for each, over grains in temperatures

_LEGEND = 0.45  # room for the legend [inch]
_FIELD = MAPPED["temperature"]
_LINE = "0.1"
_WIDEST = 0.45  # line over the mean diameter: at hot walls flows are many times the mean
_RIM = "white"  # around lines, which else are lost on dark grains


def draw_heat(figure: Any, network: HeatNetwork) -> None:
    """Draw a network into a matplotlib figure, with a legend above and a color bar."""
    place = place_scene(figure, network.scene, top=_LEGEND + TITLE)
    name_frame(place.axes, network.time, network.frame)
    discs = draw_network(place.axes, network)
    extend = beyond(network.temperature, discs.norm.vmin, discs.norm.vmax)
    add_color_bar(place.bar, discs, network.scene, _FIELD, extend)
    if not network.i.size:
        return
    mean = float(np.abs(network.flow).mean())
    lines = lines_shown(place.axes, network.scene, mean, "W")
    figure.legend(
        list(lines.values()), list(lines), loc="outside upper center", ncols=2,
        title=f"width: heat flow, mean {mean:.3g} W", title_fontsize=7.0,
        columnspacing=1.0, handlelength=1.6, handletextpad=0.5,
    )  # fmt: skip


def draw_network(axes: Any, network: HeatNetwork) -> Any:
    """Draw grains, walls and contacts; returns the collection of the grains."""
    from matplotlib.collections import LineCollection
    from matplotlib.colors import Normalize

    scene, values = network.scene, network.temperature
    norm = Normalize(*color_range(_FIELD, values, values.size))
    look: dict[str, Any] = {"cmap": color_map(_FIELD.colors), "norm": norm, "zorder": 1}
    discs = draw_grains(axes, scene, value=values, edgecolors="0.55", linewidths=0.3, **look)
    draw_walls(axes, scene)
    if network.i.size:
        lines, which = segments(network)
        width = line_widths(axes, scene, network.flow, _WIDEST)[which]
        under: dict[str, Any] = {"linewidths": width + 0.8, "colors": _RIM, "zorder": 3}
        over: dict[str, Any] = {"linewidths": width, "colors": _LINE, "zorder": 3.1}
        for style in (under, over):
            drawn = LineCollection(list(lines), capstyle="round", **style)
            axes.add_collection(drawn)
            clip_to_cell(axes, scene, drawn)
    return discs


def heat_text(network: HeatNetwork, terminal: Terminal) -> str:
    """A network as a picture; raises `MissingLibrary` without matplotlib."""
    picture = draw_picture(network.scene, lambda axes: draw_network(axes, network), terminal)
    mean = float(np.abs(network.flow).mean()) if network.i.size else 0.0
    low, high = color_range(_FIELD, network.temperature, network.temperature.size)
    return (
        f"{picture}\nwidth: heat flow, mean {mean:.3g} W; temperature [K] from {low:.6g} to "
        f"{high:.6g}"
    )


# ---- Hot spots: how likely which flash and which temperature of a sliding contact is


def draw_hot_spots(figure: Any, table: HotSpots) -> None:
    """Draw both densities into a matplotlib figure; lines break at empty bins."""
    flash, spot = figure.subplots(1, 2)
    center = np.sqrt(table.rise_edges[1:] * table.rise_edges[:-1])
    _draw(flash, center, table.rise_density, COLORS[0])
    flash.set_xscale("log")
    label_sparsely(flash.xaxis)
    mean = table.mean["rise_mean"]
    flash.axvline(mean, color="0.4", linestyle="--", linewidth=0.7, label=f"mean {mean:.3g} K")
    flash.set(xlabel=r"flash $\Delta T$ [K]", ylabel=r"probability density $P(\Delta T)$ [1/K]")
    center = 0.5 * (table.spot_edges[1:] + table.spot_edges[:-1])
    _draw(spot, center, table.spot_density, COLORS[1])
    mean = table.mean["spot_mean"]
    spot.axvline(mean, color="0.4", linestyle="--", linewidth=0.7, label=f"mean {mean:.5g} K")
    if table.spot_edges[0] < table.limit < table.spot_edges[-1]:
        label = f"limit {table.limit:g} K"
        spot.axvline(table.limit, color="0.2", linestyle=":", linewidth=0.9, label=label)
    spot.set(
        xlabel=r"temperature of a spot $T_\mathrm{spot}$ [K]",
        ylabel=r"probability density $P(T_\mathrm{spot})$ [1/K]",
    )
    spot.set_xlim(table.spot_edges[0], table.spot_edges[-1])
    spot.locator_params(axis="x", nbins=5)
    for panel in (flash, spot):
        panel.legend(loc="best")


def _draw(panel: Any, center: Floats, density: Floats, color: str) -> None:
    known = density > 0.0
    style: dict[str, Any] = {"color": color, "linewidth": 0.8, "markersize": 2.5}
    panel.semilogy(center, np.where(known, density, np.nan), "o-", **style)
    show_decades(panel.yaxis, density[known])


def hot_spots_text(table: HotSpots, _terminal: Terminal) -> str:
    """The density of flashes on logarithmic scales."""
    center = np.sqrt(table.rise_edges[1:] * table.rise_edges[:-1])
    line = TextLine("", center, table.rise_density)
    return draw_text([line], "flash [K]", "probability density [1/K]", is_logarithmic=True)


FIGURES = {
    HeatNetwork: Renderer((COLUMN, COLUMN), draw_heat, heat_text),
    HotSpots: Renderer((PAGE, 0.42 * PAGE), draw_hot_spots, hot_spots_text),
}
