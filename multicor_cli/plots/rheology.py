"""Figure of a rheology: what was measured over time, with averages and their errors as bands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from multicor_cli.model.model import Floats
from multicor_cli.plots.style import COLORS, PAGE, Renderer, Terminal, TextLine, draw_text
from multicor_cli.post.rheology import Rheology

_PANELS: tuple[tuple[str, tuple[tuple[str, str], ...]], ...] = (
    ("inertial number $I$ [–]", (("inertial_number", ""),)),
    ("pressure [N/m]", (("pressure", "walls, $P$"), ("bulk_stress_yy", r"bulk, $\sigma_{yy}$"))),
    (r"friction $\mu^*$ [–]", (("friction_walls", "walls"), ("friction_bulk", "bulk"))),
    (r"solid fraction $\nu$ [–]", (("solid_fraction", ""),)),
    ("contacts per grain [–]", (("coordination", "$Z$, all"), ("coordination_loaded", "Z′, no rattlers"))),
    ("anisotropy $a_c$ [–]", (("fabric_anisotropy", ""),)),
    (r"spin $\langle\omega\rangle/\dot\gamma$ [–]", (("spin_ratio", ""),)),
    (r"granular temp. $T_g$ [m²/s²]", (("granular_temperature", ""),)),
)
"""Label of the axis, and the quantities of each panel with their names."""


_KNOWN: Any = "--"  # line of a mean with a standard error
_UNKNOWN: Any = ":"  # line of one without
_LOW = 8  # rows of a chart of letters, of which several are shown
_CHARTS = (
    ("inertial number I [–]", (("inertial_number", ""),)),
    ("friction mu* [–]", (("friction_walls", "walls"), ("friction_bulk", "bulk"))),
    ("solid fraction nu [–]", (("solid_fraction", ""),)),
    ("contacts per grain [–]", (("coordination", "all"), ("coordination_loaded", "without rattlers"))),
)
"""The same for charts of letters."""


class OverTime(Protocol):
    """A table of quantities over time, by their names."""

    @property
    def time(self) -> Floats:
        """Times [s], shape ``(t,)``."""

    @property
    def values(self) -> Mapping[str, Floats]:
        """Values, nan where there is none, shape ``(t,)``."""

    @property
    def mean(self) -> Mapping[str, float]:
        """Their means."""

    @property
    def error(self) -> Mapping[str, float]:
        """Standard errors of these."""


def draw_rheology(figure: Any, table: Rheology) -> None:
    """Draw the panels of a rheology into a matplotlib figure."""
    grid = figure.subplots(4, 2, sharex=True)
    for panel, (label, quantities) in zip(grid.flat, _PANELS, strict=True):
        draw_panel(panel, table, label, quantities)
    explain(figure, table, _PANELS)
    for panel in grid[-1]:
        panel.set_xlabel("time $t$ [s]")


def draw_panel(panel: Any, table: OverTime, label: str, quantities: Sequence[tuple[str, str]]) -> None:
    """Draw quantities over time, with their means and the errors of these; each has a name and a text of the legend."""
    for color, (name, text) in zip(COLORS, quantities, strict=False):
        _draw_quantity(panel, table, name, text, color)
    panel.set_ylabel(label)
    panel.margins(y=0.12)
    _widen(panel, [table.mean[name] for name, _ in quantities])
    panel.ticklabel_format(axis="y", scilimits=(-3, 4), useMathText=True)
    if len(quantities) > 1:  # above the panel, where no line runs
        panel.legend(
            loc="lower right",
            bbox_to_anchor=(1.0, 1.0),
            ncols=len(quantities),
            borderaxespad=0.1,
            columnspacing=1.0,
            handlelength=1.4,
        )


def explain(figure: Any, table: OverTime, panels: Sequence[tuple[str, Sequence[tuple[str, str]]]]) -> None:
    """Say below the panels what lines and bands are."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    names = [name for _, quantities in panels for name, _ in quantities]
    known = [bool(np.isfinite(table.error[name])) for name in names if np.isfinite(table.mean[name])]
    line: dict[str, Any] = {"color": "0.3", "linewidth": 0.7}
    entries = [
        (any(known), Line2D([], [], linestyle=_KNOWN, **line), "mean"),
        (any(known), Patch(color="0.3", alpha=0.2, linewidth=0.0), "± standard error"),
        (not all(known), Line2D([], [], linestyle=_UNKNOWN, **line), "mean, error not known"),
    ]
    shown = [(handle, text) for is_shown, handle, text in entries if is_shown]
    figure.legend(*zip(*shown, strict=True), loc="outside lower center", ncols=len(shown))


def _widen(panel: Any, means: list[float]) -> None:
    """Show at least a thousandth of the largest mean: what is constant must not look as if it varied."""
    low, high = panel.get_ylim()
    room = 5e-4 * float(np.nanmax(np.abs(means), initial=0.0))
    if high - low < 2.0 * room:
        panel.set_ylim(0.5 * (low + high) - room, 0.5 * (low + high) + room)


def _draw_quantity(panel: Any, table: OverTime, name: str, text: str, color: str) -> None:
    known = np.isfinite(table.values[name])
    style = {"marker": "o", "markersize": 2.0, "markeredgewidth": 0.0} if known.sum() < 60 else {}
    panel.plot(table.time[known], table.values[name][known], color=color, linewidth=0.8, label=text or None, **style)
    mean, error = table.mean[name], table.error[name]
    if not np.isfinite(mean):
        return
    panel.axhline(mean, color=color, linewidth=0.7, linestyle=_KNOWN if np.isfinite(error) else _UNKNOWN)
    if np.isfinite(error):
        panel.axhspan(mean - error, mean + error, color=color, alpha=0.2, linewidth=0.0)


def rheology_text(table: Rheology, _terminal: Terminal) -> str:
    """A rheology over time, one low chart for each kind of quantity."""
    charts = [
        draw_text([TextLine(text, table.time, table.values[name]) for name, text in lines], "time [s]", label, rows=_LOW)
        for label, lines in _CHARTS
    ]
    return "\n\n".join(charts)


FIGURES = {Rheology: Renderer(lambda _: (PAGE, 0.9 * PAGE), draw_rheology, rheology_text)}
