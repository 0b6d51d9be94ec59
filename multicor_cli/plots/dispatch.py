"""The figure of a table: which one belongs to which."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from multicor_cli.plots import terminal
from multicor_cli.plots.compare import plot_comparison
from multicor_cli.plots.energy import plot_energy
from multicor_cli.plots.force_statistics import plot_angles, plot_distribution
from multicor_cli.plots.forces import plot_forces
from multicor_cli.plots.grain_map import plot_map
from multicor_cli.plots.profile import plot_profiles
from multicor_cli.plots.rheology import plot_rheology
from multicor_cli.plots.text_picture import Terminal
from multicor_cli.plots.theta_eta import plot_theta_eta
from multicor_cli.post import (
    AngularDistribution,
    Comparison,
    EnergyTable,
    ForceDistribution,
    ForceNetwork,
    GrainMap,
    ProfileSet,
    Rheology,
    ThetaTable,
)


class _Ways(NamedTuple):
    """How a table is drawn: into a file, and as text for a terminal."""

    file: Callable[..., None]
    text: Callable[..., str]


_WAYS: dict[type, _Ways] = {
    AngularDistribution: _Ways(plot_angles, terminal.angles_text),
    Comparison: _Ways(plot_comparison, terminal.comparison_text),
    EnergyTable: _Ways(plot_energy, terminal.energy_text),
    ForceDistribution: _Ways(plot_distribution, terminal.distribution_text),
    ForceNetwork: _Ways(plot_forces, terminal.forces_text),
    GrainMap: _Ways(plot_map, terminal.map_text),
    ProfileSet: _Ways(plot_profiles, terminal.profiles_text),
    Rheology: _Ways(plot_rheology, terminal.rheology_text),
    ThetaTable: _Ways(plot_theta_eta, terminal.theta_eta_text),
}


def plot(table: Any, path: Path, **options: Any) -> None:
    """Draw the figure of a table that `post` made.

    Args:
        table: The table.
        path: File to write; its ending (.png, .svg, .pdf) chooses the format.
        options: Further options of the figure of this kind of table.

    Raises:
        PlotError: If matplotlib is not installed or the ending is not known.
        StorageError: If the file cannot be written.
    """
    _WAYS[type(table)].file(table, path, **options)


def show(table: Any, terminal: Terminal, **options: Any) -> str:
    """The figure of a table as text for a terminal; raises `PlotError` if it needs matplotlib and that is not installed."""
    return _WAYS[type(table)].text(table, terminal, **options)
