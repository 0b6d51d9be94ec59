"""Figures of how grains are arranged and move together: functions of distances, and cells."""

from __future__ import annotations

from typing import Any

import numpy as np

from multicor_cli.model.model import Floats
from multicor_cli.plots.style import (
    COLORS,
    COLUMN,
    Renderer,
    Terminal,
    TextLine,
    draw_text,
    in_axes,
    legend_above,
)
from multicor_cli.post import PairCorrelation, StructureFactor, VelocityCorrelation, VoronoiTable

_DISTANCE = "distance $r/d$ [–]"
_PAIRS = "pair correlation $g(r)$ [–]"
_WAVES = "wave number $k d$ [–]"
_FACTOR = "structure factor $S(k)$ [–]"


def draw_structure(figure: Any, table: PairCorrelation) -> None:
    """Draw g into a matplotlib figure, and S below if it is known."""
    if table.factor is None:
        _draw_line(figure.add_subplot(), table.distance, table.g, table.error, _DISTANCE, _PAIRS)
        return
    upper, lower = figure.subplots(2, 1)
    _draw_line(upper, table.distance, table.g, table.error, _DISTANCE, _PAIRS)
    _draw_factor(lower, table.factor)
    figure.align_ylabels()


def _draw_factor(axes: Any, table: StructureFactor) -> None:
    _draw_line(axes, table.wave_number, table.S, table.error, _WAVES, _FACTOR)


def _draw_line(
    axes: Any, at: Floats, value: Floats, error: Floats, across: str, upwards: str
) -> None:
    """Means with a band of standard errors, above 0 and about the 1 of an ideal gas."""
    axes.axhline(1.0, color="0.6", linewidth=0.6, zorder=1)
    band: dict[str, Any] = {"color": COLORS[0], "alpha": 0.25, "linewidth": 0.0}
    is_known = bool((error > 0.0).any())  # what is constantly 0 has the error 0
    label = "mean" if is_known else "mean, errors not known"
    axes.plot(at, value, color=COLORS[0], linewidth=0.9, label=label)
    about = "± standard error" if is_known else None
    axes.fill_between(at, value - error, value + error, label=about, **band)
    axes.set_xlabel(across)
    axes.set_ylabel(upwards)
    axes.set_xlim(0.0, float(at[-1]))
    axes.set_ylim(0.0, 1.05 * max(float(np.nanmax(value + np.nan_to_num(error))), 1.0))
    legend_above(axes, 2)


def structure_text(table: PairCorrelation, terminal: Terminal) -> str:
    """Charts of g, and of S if it is known."""
    chart = draw_text([TextLine("", table.distance, table.g)], "r/d [–]", "pair correlation g [–]")
    return chart if table.factor is None else f"{chart}\n\n{factor_text(table.factor, terminal)}"


def factor_text(table: StructureFactor, _terminal: Terminal) -> str:
    """A chart of S."""
    return draw_text(
        [TextLine("", table.wave_number, table.S)], "k d [–]", "structure factor S [–]"
    )


# ---- Radical cells: local solid fractions and numbers of neighbors


def draw_voronoi(figure: Any, table: VoronoiTable) -> None:
    """Draw P(ν) of the local solid fraction, and below how many grains have how many neighbors."""
    upper, lower = figure.subplots(2, 1)
    at, value, error = table.fraction, table.density, np.nan_to_num(table.density_error)
    half = 0.5 * (at[1] - at[0]) if at.size > 1 else 0.5
    has_errors = bool((error > 0.0).any())
    upper.plot(at, value, "o-", color=COLORS[0], linewidth=0.9, markersize=2.5, label="mean")
    if has_errors:
        band: dict[str, Any] = {"color": COLORS[0], "alpha": 0.25, "linewidth": 0.0}
        upper.fill_between(at, value - error, value + error, label="± standard error", **band)
    mean = table.mean["local_solid_fraction"]
    upper.axvline(mean, color="0.5", linewidth=0.7, linestyle="--", label=f"mean {mean:.4g}")
    upper.set_xlim(max(float(at[0]) - 2.0 * half, 0.0), min(float(at[-1]) + 2.0 * half, 1.0))
    upper.set_ylim(0.0, None)
    upper.set_xlabel(r"local solid fraction $\nu_i$ [–]")
    upper.set_ylabel(r"probability density $P(\nu_i)$ [–]")
    legend_above(upper, 3)
    bars: dict[str, Any] = {"color": COLORS[0], "alpha": 0.6, "ecolor": "0.2", "capsize": 2.0}
    spread = np.nan_to_num(table.share_error) if has_errors else None
    lower.bar(table.sides, table.share, yerr=spread, error_kw={"linewidth": 0.7}, **bars)
    lower.set_xticks(table.sides)
    lower.tick_params(axis="x", which="minor", bottom=False, top=False)
    lower.set_ylim(0.0, None)
    lower.set_xlabel("neighbors of a grain [–]")
    lower.set_ylabel("share of the grains [–]")
    figure.align_ylabels()


def voronoi_text(table: VoronoiTable, _terminal: Terminal) -> str:
    """A chart of P(ν)."""
    labels = "local solid fraction [–]", "probability density [–]"
    return draw_text([TextLine("", table.fraction, table.density)], *labels)


# ---- Correlation of velocities

_CURVES = {
    "both": r"$\mathbf{v}'$",
    "along": "along $x$",
    "across": "along $y$",
    "spin": "spin",
}
_CORRELATION = "correlation $C(r)$ [–]"


def draw_correlation(axes: Any, table: VelocityCorrelation) -> None:
    """Draw C of velocities, components and spins with bands of standard errors, and 1/e."""
    at = np.concatenate([[0.0], table.distance])
    for level, style in ((0.0, "-"), (float(np.exp(-1.0)), ":")):
        axes.axhline(level, color="0.6", linewidth=0.6, linestyle=style, zorder=1)
    for color, (kind, label) in zip(COLORS, _CURVES.items(), strict=False):
        value = np.concatenate([[1.0], getattr(table, kind)])
        error = np.concatenate([[0.0], getattr(table, f"error_{kind}")])
        width = 1.3 if kind == "both" else 0.8
        axes.plot(at, value, color=color, linewidth=width, label=label)
        axes.fill_between(at, value - error, value + error, color=color, alpha=0.2, linewidth=0.0)
    if np.isfinite(table.error_both).any():
        axes.fill_between([], [], color="0.3", alpha=0.2, linewidth=0.0, label="± standard error")
    axes.set_xlim(0.0, float(at[-1]))
    axes.text(0.99 * at[-1], np.exp(-1.0), "1/e", ha="right", va="bottom", fontsize=7.0)
    axes.set_xlabel(_DISTANCE)
    axes.set_ylabel(_CORRELATION)
    legend_above(axes, 3)


def correlation_text(table: VelocityCorrelation, _terminal: Terminal) -> str:
    """A chart of C of velocities, components and spins."""
    names = {"both": "velocity", "along": "along x", "across": "along y", "spin": "spin"}
    lines = [TextLine(name, table.distance, getattr(table, kind)) for kind, name in names.items()]
    return draw_text(lines, "r/d [–]", "correlation C [–]")


FIGURES = {
    PairCorrelation: Renderer(
        lambda table: (COLUMN, (0.8 if table.factor is None else 1.5) * COLUMN),
        draw_structure,
        structure_text,
    ),
    StructureFactor: Renderer((COLUMN, 0.8 * COLUMN), in_axes(_draw_factor), factor_text),
    VoronoiTable: Renderer((COLUMN, 1.4 * COLUMN), draw_voronoi, voronoi_text),
    VelocityCorrelation: Renderer(
        (COLUMN, 0.8 * COLUMN), in_axes(draw_correlation), correlation_text
    ),
}
