"""Figure of θ against η: the grains as faint points, the means of the bins with their spread."""

from __future__ import annotations

from typing import Any

import numpy as np

from multicor_cli.plots.style import COLORS, COLUMN, Renderer, Terminal, TextLine, draw_text
from multicor_cli.post.theta_eta import ThetaTable

_NOTHING = 0.005
"""Mean θ that cannot be told from 0 in a figure."""

_WARM = 0.5
"""θ of the coldest grain above which the axis does not begin at 0."""


def draw_theta_eta(axes: Any, table: ThetaTable) -> None:
    """Draw θ against η into matplotlib axes."""
    size = 4.0 if table.eta.size < 1000 else 1.5
    axes.plot(table.eta, table.theta, ".", color="0.65", markersize=size, markeredgewidth=0.0, rasterized=True)
    axes.plot([], [], ".", color="0.65", markersize=4.0, markeredgewidth=0.0, label="grains")
    known = np.isfinite(table.mean)
    axes.errorbar(
        table.center[known],
        table.mean[known],
        yerr=table.spread[known],
        fmt="o-",
        color=COLORS[0],
        markeredgewidth=0.0,
        markersize=2.5,
        linewidth=0.8,
        elinewidth=0.6,
        capsize=1.2,
        capthick=0.6,
        label="mean and standard deviation",
    )
    axes.set_xlabel(r"distance from the wall $\eta = y/H$ [–]")
    axes.set_ylabel(r"temperature $\theta = (T - T_0)/(T_\mathrm{wall} - T_0)$ [–]")
    axes.set_xlim(0.0, _shown(table))
    low, high = float(table.theta.min()), float(table.theta.max())
    # From 0 to 1, unless all grains are so warm that there would be nothing to see below them.
    axes.set_ylim(min(0.0, low) if low < _WARM else low - 0.1 * (max(1.0, high) - low), max(1.0, high))
    axes.legend(loc="best")


def _shown(table: ThetaTable) -> float:
    """η up to which there is something to see: a quarter beyond the last bin that differs from the reference."""
    changed = np.flatnonzero(np.abs(np.nan_to_num(table.mean)) > _NOTHING)
    return min(1.0, 1.25 * float(table.center[changed[-1]]) + 0.02) if changed.size else 1.0


def theta_eta_text(table: ThetaTable, _terminal: Terminal) -> str:
    """Mean θ of the bins against η."""
    return draw_text([TextLine("", table.center, table.mean)], "eta [–]", "theta [–]")


FIGURES = {
    ThetaTable: Renderer(
        lambda _: (COLUMN, 0.8 * COLUMN), lambda figure, table: draw_theta_eta(figure.add_subplot(), table), theta_eta_text
    )
}
