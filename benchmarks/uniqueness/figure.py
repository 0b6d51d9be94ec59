"""Four panels: what solutions of one problem differ by, what that does to flows, and the forces of
bed and pile.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from flows import CONTRASTS
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from study import Results

_COLORS = {"method": "#d1495b", "nudge": "#1f5fa8"}
_LABELS = {"method": "plain − accelerated", "nudge": "nudged by an ulp − not"}


def draw(results: Results, path: Path) -> Path:
    """Write the figure; returns its path."""
    figure = Figure(figsize=(13.0, 9.0), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(2, 2)
    _draw_problems(axes[0, 0], results)
    _draw_flows(axes[0, 1], results)
    for axis, one in zip(axes[1], results.rests, strict=False):
        _draw_forces(axis, one)
    for axis, is_there in zip(
        axes.flat,
        (results.problems, results.flows, results.rests[:1], results.rests[1:]),
        strict=True,
    ):
        axis.set_visible(bool(is_there))
    figure.savefig(path, dpi=100)
    return path


def _draw_problems(axis: Any, results: Results) -> None:
    several = [
        problem
        for problem in results.problems
        if problem.row.pair is not None and problem.row.distinct > 1
    ]
    for problem in several:
        one, other = problem.row.pair
        apart = np.sort(np.linalg.norm(one.contact - other.contact, axis=1))[::-1]
        axis.plot(
            np.arange(1, apart.size + 1),
            apart,
            linewidth=1.0,
            color="#1f5fa8" if problem.grains > 100 else "#e69f00",
        )
    axis.axhline(1e-2, color="0.5", linewidth=0.8)
    axis.set(xscale="log", yscale="log", xlim=(0.8, 2e3), ylim=(1e-6, 2.0))
    axis.set_xlabel("rank of the contact")
    axis.set_ylabel("difference / largest approach velocity")
    axis.set_title("Two solutions of one problem (orange: small beds)", fontsize=10)


def _draw_flows(axis: Any, results: Results) -> None:
    names, place = [], 0
    for one in results.flows:
        for quantity in one.values:
            unit = 0.01 * abs(one.sample(quantity, "accelerated").mean)
            for k, name in enumerate(CONTRASTS):
                shift, label = one.shift(quantity, name), _LABELS[name] if place == 0 else None
                style = {"fmt": "o", "color": _COLORS[name], "markersize": 4.0, "linewidth": 1.0}
                axis.errorbar(
                    shift.mean / unit,
                    place + 0.2 * k,
                    xerr=shift.error / unit,
                    label=label,
                    **style,
                )
            names.append(f"{one.flow}: {quantity}")
            place += 1
    axis.axvline(0.0, color="0.7", linewidth=0.8)
    axis.set_yticks(range(len(names)), names, fontsize=8)
    axis.invert_yaxis()
    axis.set_xlabel("mean difference and its standard error [% of the mean]")
    axis.set_title("Flows: the choice of the method beside a nudge by an ulp", fontsize=10)
    if names:
        axis.legend(fontsize=8)


def _draw_forces(axis: Any, one: Any) -> None:
    ways = list(one.forces)
    first = one.forces[ways[0]]
    unit = np.mean([p for p, _ in first.values()])
    for way, color in zip(ways[1:5], ("#444444", "#d1495b", "#1f5fa8", "#2a9d6f"), strict=True):
        keys = list(first.keys() | one.forces[way].keys())
        x, y = (
            [forces.get(key, (0.0, 0.0))[0] / unit for key in keys]
            for forces in (first, one.forces[way])
        )
        axis.plot(x, y, ".", markersize=4.0, color=color, label=way)
    axis.axline((0.0, 0.0), slope=1.0, color="0.7", linewidth=0.8)
    axis.set_xlabel("normal force / mean: accelerated, from the last step")
    axis.set_ylabel("the other ways")
    axis.set_title(f"{one.scene} at rest: forces of the same contacts", fontsize=10)
    axis.legend(fontsize=8)
