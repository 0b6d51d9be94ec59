"""Residual and distance against time, two panels above each other for each problem."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from methods.operators import DISTANCE, RMS, TIME
from study import LEVELS, Results, Single

_COLUMNS = 4
_HIGHEST = 5.0  # what diverges leaves the panel
_COLORS = {
    "gs": "#444444", "sor-1.5": "#e69f00", "engine": "#d1495b", "restart-2": "#1f5fa8",
    "tiles-2": "#2a9d6f",
    "cpg": "#17a2b8", "apgd": "#8a5a2b", "newton": "#7a4fa3",
}  # fmt: skip
"""Methods that are drawn; all would be too many."""


def draw(results: Results, path: Path) -> Path:
    """Write the figure; returns its path."""
    singles = results.singles
    blocks = -(-len(singles) // _COLUMNS)
    columns = min(_COLUMNS, len(singles))
    figure = Figure(figsize=(1.0 + 4.2 * columns, 5.4 * blocks + 0.8), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(2 * blocks, columns, squeeze=False)
    handles: dict[str, Any] = {}
    for number, single in enumerate(singles):
        block, column = divmod(number, columns)
        upper, lower = axes[2 * block][column], axes[2 * block + 1][column]
        handles |= _panel(upper, single, RMS, LEVELS[-1])
        _panel(lower, single, DISTANCE, max(LEVELS[-1], single.reference))
        upper.sharex(lower)
        upper.tick_params(labelbottom=False)
        upper.set_title(f"{single.name} ({single.contacts} contacts)", fontsize=10)
        lower.set_xlabel("time [ms]")
        if column == 0:
            upper.set_ylabel("rms residual / $u_{ref}$")
            lower.set_ylabel("distance / $u_{ref}$")
        upper.axhline(1e-3, color="0.5", linewidth=0.8)
    for axis in (
        axes.reshape(blocks, 2, columns).transpose(0, 2, 1).reshape(-1, 2)[len(singles) :].flat
    ):
        axis.set_axis_off()
    figure.legend(
        handles.values(), handles.keys(), loc="outside lower center", ncols=8, frameon=False
    )
    figure.savefig(path, dpi=100)
    return path


def _panel(axis: Any, single: Single, column: int, lowest: float) -> dict[str, Any]:
    handles = {}
    for curve in single.curves:
        if curve.method not in _COLORS:
            continue
        time, error = curve.history[1:, TIME], np.maximum(curve.history[1:, column], 0.5 * lowest)
        style = {"linewidth": 2.8, "zorder": 3} if curve.method == "engine" else {"linewidth": 1.3}
        handles[curve.method] = axis.loglog(
            1e3 * time, error, color=_COLORS[curve.method], **style
        )[0]
    axis.set_ylim(0.4 * lowest, _HIGHEST)
    axis.grid(visible=True, which="major", color="0.9")
    return handles
