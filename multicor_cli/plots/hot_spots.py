"""Figure of hot spots: how likely which flash and which temperature of a sliding contact is."""

from __future__ import annotations

from typing import Any

import numpy as np

from multicor_cli.model.model import Floats
from multicor_cli.plots.style import (
    COLORS,
    PAGE,
    Renderer,
    Terminal,
    TextLine,
    draw_text,
    show_decades,
)
from multicor_cli.post.hot_spots import HotSpots


def draw_hot_spots(figure: Any, table: HotSpots) -> None:
    """Draw both densities into a matplotlib figure; empty bins are left out."""
    flash, spot = figure.subplots(1, 2)
    center = np.sqrt(table.rise_edges[1:] * table.rise_edges[:-1])
    _draw(flash, center, table.rise_density, COLORS[0])
    flash.set_xscale("log")
    flash.xaxis.set_minor_formatter("")
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
    panel.semilogy(center[known], density[known], "o-", **style)
    show_decades(panel.yaxis, density[known])


def hot_spots_text(table: HotSpots, _terminal: Terminal) -> str:
    """The density of flashes on logarithmic scales."""
    center = np.sqrt(table.rise_edges[1:] * table.rise_edges[:-1])
    line = TextLine("", center, table.rise_density)
    return draw_text([line], "flash [K]", "probability density [1/K]", is_logarithmic=True)


FIGURES = {HotSpots: Renderer(lambda _: (PAGE, 0.42 * PAGE), draw_hot_spots, hot_spots_text)}
