"""θ against η, the paper's figure 7: the deposited bed and the lattice, in vacuum and in air."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from comparison import Beds

from multicor_cli.plots.style import COLORS, COLUMN, figure_file
from multicor_cli.post import ThetaTable

_SHOWN = 0.3


def draw_figure(beds: Beds, folder: Path) -> Path:
    """Write ``theta_eta.png`` into a folder, which is made if it is missing; returns its path.

    Raises:
        PlotError: If matplotlib is not installed.
        OSError: If the file cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "theta_eta.png"
    with figure_file(path, COLUMN, 0.85 * COLUMN) as figure:
        draw_beds(figure.subplots(), beds)
    return path


def draw_beds(axes: Any, beds: Beds) -> None:
    """Draw the deposited bed and the lattice, in vacuum and in air, into matplotlib axes."""
    pairs = (("vacuum", beds.vacuum, beds.lattice_vacuum), ("air", beds.air, beds.lattice_air))
    for (name, table, lattice), color in zip(pairs, COLORS, strict=False):
        _draw_bed(axes, table, color, f"deposited, {name}")
        axes.plot(
            lattice.eta, lattice.theta, "--", color=color, linewidth=1.0, label=f"lattice, {name}"
        )
    axes.set_xlim(0.0, _SHOWN)
    axes.set_ylim(0.0, 1.0)
    axes.set_xlabel(r"distance from the floor $\eta = y/H$ [–]")
    axes.set_ylabel(r"temperature $\theta = (T - T_0)/(T_\mathrm{wall} - T_0)$ [–]")
    axes.legend(loc="upper right", title="bar: standard deviation", title_fontsize=7.0)


def _draw_bed(axes: Any, table: ThetaTable, color: str, label: str) -> None:
    """Grains as faint points, and the means of the bins with their spread."""
    near = np.isfinite(table.mean) & (table.center < _SHOWN)
    axes.plot(
        table.eta,
        table.theta,
        ".",
        color=color,
        markersize=1.2,
        markeredgewidth=0.0,
        alpha=0.25,
        rasterized=True,
    )
    axes.errorbar(
        table.center[near],
        table.mean[near],
        yerr=table.spread[near],
        fmt="o",
        color=color,
        markersize=2.2,
        elinewidth=0.6,
        label=label,
    )
