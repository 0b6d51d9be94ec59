"""Time per grain and step, and memory per grain, against the number of grains."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

_COLORS = ("#1f5fa8", "#d1495b", "#2a9d6f", "#e69f00")


def draw(data: dict[str, Any], path: Path) -> None:
    """Write the figure."""
    figure = Figure(figsize=(10.5, 4.2), layout="constrained")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2)
    scenes = list(dict.fromkeys(scene["scene"] for scene in data["scenes"]))
    threads = sorted({scene["threads"] for scene in data["scenes"]})
    for color, name in zip(_COLORS, scenes, strict=False):
        for count in threads:
            rows = [
                r
                for r in data["scenes"]
                if (r["scene"], r["threads"]) == (name, count)
                and not r["faults"]
                and r["per_contact"]
            ]
            line = "-" if count == threads[0] else "--"
            sizes = [row["grains"] for row in rows]
            label = f"{name}, {count} thread{'s' if count > 1 else ''}"
            left.semilogx(
                sizes,
                [1e9 * row["per_contact"] for row in rows],
                line,
                marker="o",
                color=color,
                label=label,
            )
            if count == threads[0]:
                # below, the kernels take more than the grains
                large = [row for row in rows if row["grains"] > 50_000]
                right.semilogx(
                    [r["grains"] for r in large],
                    [r["memory"] for r in large],
                    line,
                    marker="o",
                    color=color,
                    label=name,
                )
    left.set_ylabel("time per contact and sweep [ns]")
    right.set_ylabel("memory per grain [B]")
    right.axhline(1_500.0, color="0.6", linewidth=0.8)  # the budget
    right.set_xlim(left.get_xlim())
    for axis in (left, right):
        axis.set_ylim(0.0, 1.35 * axis.get_ylim()[1])  # room for the legend
    for axis in (left, right):
        axis.set_xlabel("grains")
        axis.grid(visible=True, which="major", color="0.9")
        axis.legend(frameon=False, fontsize=9)
    figure.savefig(path, dpi=130)
