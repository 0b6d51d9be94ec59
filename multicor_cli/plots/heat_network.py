"""Figure of the heat that contacts conduct: a line for each, over grains in temperatures."""

from __future__ import annotations

from typing import Any

import numpy as np

from multicor_cli.plots.forces import SHOWN, line_widths, lines_shown, segments
from multicor_cli.plots.grain_map import (
    add_color_bar,
    clip_to_cell,
    draw_discs,
    draw_walls,
    place_scene,
)
from multicor_cli.plots.style import (
    COLUMN,
    TITLE,
    Renderer,
    Terminal,
    beyond,
    color_map,
    draw_picture,
    name_frame,
)
from multicor_cli.post.heat_network import HeatNetwork
from multicor_cli.post.quantities import MAPPED, color_range

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
    labels = [f"{times * mean:.2g} W" for times in SHOWN]
    figure.legend(
        lines_shown(place.axes, network.scene), labels, loc="outside upper center", ncols=2,
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
    discs = draw_discs(axes, scene, value=values, edgecolors="0.55", linewidths=0.3, **look)
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


FIGURES = {HeatNetwork: Renderer(lambda _: (COLUMN, COLUMN), draw_heat, heat_text)}
