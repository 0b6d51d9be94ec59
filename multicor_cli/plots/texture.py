"""Figures of the texture of packings: force chains, clusters, lifetimes of contacts."""

from __future__ import annotations

from typing import Any

import numpy as np

from multicor_cli.model.model import Floats
from multicor_cli.plots.forces import LEGEND, draw_network, explain_network
from multicor_cli.plots.grain_map import place_scene
from multicor_cli.plots.over_time import Panels, by_name, over_time
from multicor_cli.plots.style import (
    COLORS,
    COLUMN,
    HOLLOW,
    TITLE,
    PlotError,
    Renderer,
    Terminal,
    TextLine,
    draw_picture,
    draw_text,
    explain_errors,
    in_axes,
    name_frame,
)
from multicor_cli.post.chains import LEAST, ChainLengths, ChainMap, Chains, Clusters
from multicor_cli.post.lifetimes import Lifetimes

# ---- Chains and clusters over time

_OF_CHAINS: Panels = (
    ("chains/1000 grains [–]", (("chains", ""),)),
    ("share of grains [–]", (("share", ""),)),
    ("length [grains]", (("mean_length", "mean"), ("decay_length", "decay"))),
    ("longest [grains]", (("longest", ""),)),
    ("direction [°]", (("direction", ""),)),
    ("nematic order [–]", (("order", ""),)),
)
_OF_CLUSTERS: Panels = (
    ("share of sliding [–]", (("sliding", ""),)),
    ("clusters/1000 grains [–]", (("clusters", ""),)),
    ("mean size [contacts]", (("mean_size", "by number"), ("weight_size", "by weight"))),
    ("share of largest [–]", (("largest_share", ""),)),
)


# ---- Lengths of chains, and the chains of a frame


def draw_lengths(axes: Any, table: ChainLengths) -> None:
    """Draw shares of lengths with errors and the exponential of greatest likelihood."""
    seen = table.P > 0.0
    length, share, error = table.length[seen], table.P[seen], table.error[seen]
    known = np.isfinite(error)
    lower = np.minimum(error, 0.9 * share)  # a logarithmic axis has no zero
    style: dict[str, Any] = {"color": COLORS[0], "markersize": 3.0}
    axes.errorbar(
        length[known], share[known], yerr=[lower[known], error[known]], fmt="o", elinewidth=0.7,
        capsize=1.2, label="± standard error" if known.any() else None, **style,
    )  # fmt: skip
    if not known.all():
        axes.plot(length[~known], share[~known], "o", label="error not known", **style | HOLLOW)
    if table.decay_length > 0.0:
        part = np.exp(-1.0 / table.decay_length)
        at = np.array([LEAST, table.length[-1]])
        label = rf"$\propto e^{{-l/l_0}}$, $l_0 = {table.decay_length:.2f}$"
        axes.plot(at, (1.0 - part) * part ** (at - LEAST), color="0.15", linewidth=0.8, label=label)
    axes.set_yscale("log")
    axes.set_ylim(0.5 * float(share.min()), 2.0 * float(share.max()))
    axes.xaxis.get_major_locator().set_params(integer=True)
    axes.set_xlabel("length of the chain $l$ [grains]")
    axes.set_ylabel("share of the chains $P(l)$ [–]")
    axes.legend(loc="upper right")


def lengths_text(table: ChainLengths, _terminal: Terminal) -> str:
    """Shares of lengths as a chart of letters."""
    line = TextLine("", table.length, table.P)
    return draw_text([line], "length [grains]", "share of the chains [–]")


_CHAIN, _OTHER = COLORS[1], "0.55"


def _colors(table: ChainMap) -> Any:
    colors = np.full(table.network.i.size, _OTHER, dtype="<U7")
    colors[table.link] = _CHAIN
    return colors


def draw_chains(axes: Any, table: ChainMap) -> None:
    """Draw the force network of a frame with its chains into matplotlib axes."""
    name_frame(axes, table.time, table.frame)
    if draw_network(axes, table.network, colors=_colors(table)).size:
        names = {"in a chain": _CHAIN, "other contact": _OTHER}
        explain_network(axes, table.network, names)


def chains_text(table: ChainMap, terminal: Terminal) -> str:
    """The chains as a picture; raises `MissingLibrary` without matplotlib."""
    network, colors = table.network, _colors(table)
    picture = draw_picture(
        network.scene, lambda axes: draw_network(axes, network, colors=colors), terminal
    )
    return f"{picture}\nwidth: normal force; red: in a chain, gray: other contact"


# ---- Survival of contacts

_CURVES = (
    ("contacts", "all", "o"), ("again", "all, there again", "^"), ("strong", "strong", "s"),
    ("sliding", "sliding", "D"),
)  # fmt: skip
_LEAST_SHARE = 1e-3


def draw_lifetimes(axes: Any, table: Lifetimes) -> None:
    """Draw shares of surviving contacts over the lag, or the strain in it, with errors."""
    is_sheared = bool(table.shear_rate > 0.0)
    lag: Floats = table.strain if is_sheared else table.lag
    errors, lowest = [], 1.0
    for color, (name, label, marker) in zip(COLORS, _CURVES, strict=False):
        share, error = getattr(table, name), getattr(table, f"error_{name}")
        shown = share > 0.0
        if not shown.any():
            continue
        at, share, error = lag[shown], share[shown], error[shown]
        errors.append(error)
        lowest = min(lowest, float(share.min()))
        style: dict[str, Any] = {"color": color, "markersize": 2.5, "linewidth": 0.9}
        axes.plot(at, share, marker + "-", markeredgewidth=0.0, label=label, **style)
        known = np.isfinite(error)
        axes.plot(at[~known], share[~known], marker, **style | HOLLOW)
        band: dict[str, Any] = {"color": color, "alpha": 0.25, "linewidth": 0.0}
        axes.fill_between(at, np.maximum(share - error, 0.1 * share), share + error, **band)
    if not errors:
        raise PlotError(
            "no contact lives from one frame to the next: choose frames closer together"
        )
    explain_errors(axes, errors)
    axes.set_yscale("log")
    axes.locator_params(axis="x", nbins=5)
    axes.set(xlim=(0.0, None), ylim=(0.7 * max(lowest, _LEAST_SHARE), 1.2))
    axes.set_xlabel(r"strain $\dot\gamma \tau$ in the lag [–]" if is_sheared else r"lag $\tau$ [s]")
    axes.set_ylabel(r"share of contacts $C(\tau)$ [–]")
    axes.legend(loc="best")


def lifetimes_text(table: Lifetimes, _terminal: Terminal) -> str:
    """Shares of surviving contacts as a chart of letters."""
    lines = [TextLine(label, table.lag, getattr(table, name)) for name, label, _ in _CURVES]
    return draw_text(lines, "lag [s]", "share of contacts [–]")


FIGURES = {
    Chains: over_time(_OF_CHAINS, by_name(_OF_CHAINS[:3])),
    Clusters: over_time(_OF_CLUSTERS, by_name(_OF_CLUSTERS[:3])),
    ChainLengths: Renderer((COLUMN, 0.85 * COLUMN), in_axes(draw_lengths), lengths_text),
    ChainMap: Renderer(
        (COLUMN, COLUMN),
        lambda figure, table: draw_chains(
            place_scene(figure, table.network.scene, has_bar=False, top=LEGEND + TITLE).axes, table
        ),
        chains_text,
    ),
    Lifetimes: Renderer((COLUMN, 0.85 * COLUMN), in_axes(draw_lifetimes), lifetimes_text),
}
