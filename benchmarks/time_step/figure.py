"""Friction and solid fraction against the time step, and against what a tolerance costs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from cases import STEP, STEPS, TOLERANCE
from report import FRICTION, SOLID, Row, reference_of

from multicor_cli.plots.style import COLORS, COLUMN, figure_file


def draw_figure(rows: Sequence[Row], folder: Path) -> Path:
    """Write ``time_step.png`` into a folder, which is made if it is missing; returns its path."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "time_step.png"
    with figure_file(path, 2.0 * COLUMN, 1.5 * COLUMN) as figure:
        panels = figure.subplots(2, 2, sharex="col")
        for color, inertial in zip(
            COLORS, sorted({row.inertial for row in rows}, reverse=True), strict=False
        ):
            of_flow = [row for row in rows if row.inertial == inertial]
            steps = sorted((r for r in of_flow if r.tolerance == TOLERANCE), key=lambda r: r.step)
            tolerances = sorted((r for r in of_flow if r.step == STEP), key=lambda r: r.tolerance)
            for column, (name, chosen) in enumerate((("step", steps), ("tolerance", tolerances))):
                x = [getattr(row, name) for row in chosen]
                reference = reference_of(chosen[0], rows)
                _draw(panels[0, column], x, chosen, reference, "friction", color)
                _draw(panels[1, column], x, chosen, reference, "solid", color)
        _label(panels)
    return path


def _draw(
    axes: Any, x: Sequence[float], rows: Sequence[Row], reference: Row, name: str, color: str
) -> None:
    changes = [getattr(row, name) - getattr(reference, name) for row in rows]
    errors = [getattr(row, f"{name}_error") for row in rows]
    label = f"I = {reference.inertial:g}"
    axes.errorbar(
        x, changes, errors, fmt="o-", color=color, markersize=3.0, linewidth=1.0, label=label
    )


def _label(panels: Any) -> None:
    for row, (what, bound) in enumerate(
        ((r"change of $\mu^*$ [–]", FRICTION), (r"change of $\nu$ [–]", SOLID))
    ):
        panels[row, 0].set_ylabel(what)
        for axes in panels[row]:
            axes.axhspan(-bound, bound, color="0.9", zorder=0)
            axes.set_xscale("log")
    panels[1, 0].set_xticks(STEPS, [f"{step:g}" for step in STEPS])
    panels[1, 0].minorticks_off()
    panels[1, 0].set_xlabel(r"time step $\Delta t/\tau$ [–]")
    panels[1, 1].set_xlabel("tolerance of the rms residual [–]")
    panels[0, 0].legend()
