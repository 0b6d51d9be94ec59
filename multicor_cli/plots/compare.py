"""Figure of a comparison: the profiles of both runs, and beside each the difference over its standard error."""

from __future__ import annotations

from typing import Any

import numpy as np

from multicor_cli.plots.profile import axis_labels
from multicor_cli.plots.style import (
    COLORS,
    COLUMN,
    PAGE,
    Renderer,
    Terminal,
    TextLine,
    draw_text,
    draw_with_errors,
    rise_formatter,
    rise_label,
    rise_reference,
)
from multicor_cli.post.compare import Comparison, ProfilePair
from multicor_cli.text import unit_sign


def draw_comparison(figure: Any, comparison: Comparison) -> None:
    """Draw two panels for each profile into a matplotlib figure."""
    grid = figure.subplots(len(comparison.profiles), 2, squeeze=False, sharey=True, width_ratios=(2.0, 1.0))
    for (left, right), pair in zip(grid, comparison.profiles.values(), strict=True):
        _draw_profiles(left, pair, comparison.names)
        _draw_ratio(right, pair)


def _draw_profiles(axes: Any, pair: ProfilePair, names: tuple[str, str]) -> None:
    for color, marker, table, name in zip(COLORS, "os", (pair.first, pair.second), names, strict=False):
        y = table.y / table.height
        draw_with_errors(axes, table.value, y, table.error, marker, names=(name, "", ""), color=color)
    across = axis_labels(pair.first)[0]
    tables = (pair.first, pair.second)
    values = np.concatenate([table.value for table in tables])
    low, high = float(np.nanmin(values, initial=np.inf)), float(np.nanmax(values, initial=-np.inf))
    reference = rise_reference(pair.first.units[1], low, high)
    if reference is not None:
        across = rise_label(pair.first.field.label, pair.first.field.symbol, reference)
        axes.xaxis.set_major_formatter(rise_formatter(reference))
    axes.locator_params(axis="x", nbins=5)
    axes.set_xlabel(across)
    axes.set_ylabel("height $y/H$ [–]")
    axes.set_ylim(0.0, 1.0)
    if reference is None:
        axes.ticklabel_format(axis="x", scilimits=(-3, 4), useMathText=True)
    axes.legend(loc="best")


def _draw_ratio(axes: Any, pair: ProfilePair) -> None:
    known = np.isfinite(pair.ratio)
    axes.axvspan(-2.0, 2.0, color="0.9", linewidth=0.0, zorder=0)
    axes.axvline(0.0, color="0.4", linewidth=0.6)
    axes.plot(pair.ratio[known], pair.y[known], "o-", color="0.15", markeredgewidth=0.0, linewidth=0.7)
    axes.set_xlabel("difference / standard error [–]")
    if not known.any():
        axes.text(0.5, 0.9, "no standard errors:\ntoo few frames", ha="center", va="center", fontsize=7.0, transform=axes.transAxes)
    elif not known.all():
        axes.set_title(f"known in {pair.note}", fontsize=7.0)
    limit = max(3.0, 1.1 * float(np.abs(pair.ratio[known]).max(initial=0.0)))
    axes.set_xlim(-limit, limit)


def comparison_text(comparison: Comparison, _terminal: Terminal) -> str:
    """The profiles of two runs, one chart for each field."""
    charts = []
    for pair in comparison.profiles.values():
        tables = zip((pair.first, pair.second), comparison.names, strict=True)
        lines = [TextLine(name, table.value, table.y / table.height) for table, name in tables]
        charts.append(draw_text(lines, f"{pair.first.field.label} [{unit_sign(pair.first.field.unit)}]", "height y/H [–]"))
    return "\n\n".join(charts)


FIGURES = {Comparison: Renderer(lambda table: (PAGE, 0.85 * COLUMN * len(table.profiles)), draw_comparison, comparison_text)}
