"""Figure of a region: what was measured in it over time, with averages and their errors as bands."""

from __future__ import annotations

from typing import Any

import numpy as np

from multicor_cli.plots.rheology import draw_panel, explain
from multicor_cli.plots.style import PAGE, Renderer, Terminal, TextLine, draw_text, rise_formatter, rise_label, rise_reference
from multicor_cli.post.region import RegionTable

_PANELS: tuple[tuple[str, tuple[tuple[str, str], ...]], ...] = (
    (r"solid fraction $\nu$ [–]", (("solid_fraction", ""),)),
    ("contacts per grain $Z$ [–]", (("coordination", ""),)),
    ("velocity [m/s]", (("velocity_x", "$v_x$"), ("velocity_y", "$v_y$"))),
    ("stress of contacts [N/m]", (("stress_xx", "$xx$"), ("stress_yy", "$yy$"), ("stress_xy", "$xy$"))),
    ("stress of fluctuations [N/m]", (("kinetic_stress_xx", "$xx$"), ("kinetic_stress_yy", "$yy$"), ("kinetic_stress_xy", "$xy$"))),
    ("temperature $T$ [K]", (("temperature", ""),)),
)
"""Label of the axis, and the quantities of each panel with their names; without heat spin takes the place of the last."""

_SPIN = (r"spin $\omega$ [rad/s]", (("spin", ""),))
_LOW = 8  # rows of a chart of letters, of which several are shown


def draw_region(figure: Any, table: RegionTable) -> None:
    """Draw the panels into a matplotlib figure."""
    grid = figure.subplots(2, 3, sharex=True)
    panels = _PANELS if "temperature" in table.values else (*_PANELS[:-1], _SPIN)
    for panel, (label, quantities) in zip(grid.flat, panels, strict=True):
        draw_panel(panel, table, label, quantities)
        if quantities[0][0] == "temperature":
            _count_small_rises(panel, table.values["temperature"])
    explain(figure, table, panels)
    for panel in grid[-1]:
        panel.set_xlabel("time $t$ [s]")


def _count_small_rises(panel: Any, values: Any) -> None:
    """Let an axis of temperatures that hardly differ count from a round one."""
    known = values[np.isfinite(values)]
    low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 0.0)
    reference = rise_reference("K", low, high)
    if reference is not None:
        panel.set_ylim(low - 0.12 * (high - low), high + 0.12 * (high - low))
        panel.yaxis.set_major_formatter(rise_formatter(reference))
        panel.set_ylabel(rise_label("temp.", "T", reference))


def region_text(table: RegionTable, _terminal: Terminal) -> str:
    """Solid fraction and stresses over time, in low charts."""
    charts = (("solid fraction nu [–]", ("solid_fraction",)), ("stress of contacts [N/m]", ("stress_xx", "stress_yy", "stress_xy")))
    return "\n\n".join(
        draw_text(
            [TextLine(name[-2:] if len(names) > 1 else "", table.time, table.values[name]) for name in names],
            "time [s]",
            label,
            rows=_LOW,
        )
        for label, names in charts
        if any(np.isfinite(table.values[name]).any() for name in names)
    )


FIGURES = {RegionTable: Renderer(lambda _: (PAGE, 0.62 * PAGE), draw_region, region_text)}
