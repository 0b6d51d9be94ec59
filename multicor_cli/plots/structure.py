"""Figures of how grains are arranged: pair correlation function, structure factor."""

from __future__ import annotations

from typing import Any

import numpy as np

from multicor_cli.model.model import Floats
from multicor_cli.plots.style import COLORS, COLUMN, Renderer, Terminal, TextLine, draw_text
from multicor_cli.post import PairCorrelation, StructureFactor

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
    axes.legend(loc="upper right")


def structure_text(table: PairCorrelation, terminal: Terminal) -> str:
    """Charts of g, and of S if it is known."""
    chart = draw_text([TextLine("", table.distance, table.g)], "r/d [–]", "pair correlation g [–]")
    return chart if table.factor is None else f"{chart}\n\n{factor_text(table.factor, terminal)}"


def factor_text(table: StructureFactor, _terminal: Terminal) -> str:
    """A chart of S."""
    return draw_text(
        [TextLine("", table.wave_number, table.S)], "k d [–]", "structure factor S [–]"
    )


FIGURES = {
    PairCorrelation: Renderer(
        lambda table: (COLUMN, (0.8 if table.factor is None else 1.5) * COLUMN),
        draw_structure,
        structure_text,
    ),
    StructureFactor: Renderer(
        lambda _: (COLUMN, 0.8 * COLUMN),
        lambda figure, table: _draw_factor(figure.add_subplot(), table),
        factor_text,
    ),
}
