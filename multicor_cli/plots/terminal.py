"""What `--plot term` shows of each table: charts of letters, and grains as a picture of colored cells."""

from __future__ import annotations

import numpy as np

from multicor_cli.plots.text_chart import TextLine, draw_text
from multicor_cli.plots.text_picture import Terminal, draw_picture
from multicor_cli.post.compare import Comparison
from multicor_cli.post.energy import EnergyTable
from multicor_cli.post.force_statistics import AngularDistribution, ForceDistribution
from multicor_cli.post.forces import ForceNetwork
from multicor_cli.post.grain_map import GrainMap
from multicor_cli.post.profile import ProfileSet
from multicor_cli.post.rheology import Rheology
from multicor_cli.post.theta_eta import ThetaTable

_VISIBLE = 0.02  # lines that stay below this part of the largest one are left out of charts of many lines
_LOW = 8  # rows of a chart of which several are shown
_RHEOLOGY = (
    ("inertial number I [1]", (("inertial_number", ""),)),
    ("friction mu* [1]", (("friction_walls", "walls"), ("friction_bulk", "bulk"))),
    ("solid fraction nu [1]", (("solid_fraction", ""),)),
    ("contacts per grain [1]", (("coordination", "all"), ("coordination_loaded", "without rattlers"))),
)
"""Label of the axis, and the quantities of each chart with their names."""


def profiles_text(profiles: ProfileSet, _terminal: Terminal) -> str:
    """Profiles: the fields across, the height upwards."""
    first, has_many = profiles.first, len(profiles.tables) > 1
    lines = [TextLine(t.field.name if has_many else "", t.value, t.y) for t in profiles.tables]
    label = profiles.name.replace("-", " ") if has_many else first.field.label
    return draw_text(lines, f"{label} [{first.units[1]}]", f"height y [{first.units[0]}]")


def theta_eta_text(table: ThetaTable, _terminal: Terminal) -> str:
    """Mean θ of the bins against η."""
    return draw_text([TextLine("", table.center, table.mean)], "eta [1]", "theta [1]")


def energy_text(table: EnergyTable, _terminal: Terminal) -> str:
    """The energy books over time, mechanical ones and those of heat in one chart."""
    lines = [TextLine(f"{entry.label} [J]", table.time, table.books[entry.name]) for entry in table.entries]
    largest = max((float(np.abs(line.y).max()) for line in lines), default=0.0)
    return draw_text([line for line in lines if np.abs(line.y).max() > _VISIBLE * largest], "time [s]", "energy [J]")


def rheology_text(table: Rheology, _terminal: Terminal) -> str:
    """A rheology over time, one low chart for each kind of quantity."""
    charts = [
        draw_text([TextLine(text, table.time, table.values[name]) for name, text in lines], "time [s]", label, rows=_LOW)
        for label, lines in _RHEOLOGY
    ]
    return "\n\n".join(charts)


def distribution_text(table: ForceDistribution, _terminal: Terminal) -> str:
    """A force distribution on logarithmic scales."""
    lines = [TextLine("normal", table.center, table.normal), TextLine("tangential", table.center, table.tangential)]
    return draw_text(lines, "force over mean force [1]", "probability density [1]", is_logarithmic=True)


def angles_text(table: AngularDistribution, _terminal: Terminal) -> str:
    """Directions of the contacts and the forces along them, each over what it would be if all directions were alike."""
    degrees = np.degrees(table.angle)
    density = TextLine("density of contacts", degrees, 2.0 * np.pi * table.density)
    return draw_text([density, TextLine("normal force", degrees, table.normal)], "direction [deg]", "over mean [1]")


def comparison_text(comparison: Comparison, _terminal: Terminal) -> str:
    """The profiles of two runs, one chart for each field."""
    charts = []
    for pair in comparison.profiles.values():
        tables = zip((pair.first, pair.second), comparison.names, strict=True)
        lines = [TextLine(name, table.value, table.y / table.height) for table, name in tables]
        charts.append(draw_text(lines, f"{pair.first.field.label} [{pair.first.field.unit}]", "height y/H [1]"))
    return "\n\n".join(charts)


def map_text(table: GrainMap, terminal: Terminal, *, has_streamlines: bool = True) -> str:
    """A map as a picture, with the values of its darkest and lightest color below.

    Raises:
        PlotError: If matplotlib is not installed.
    """
    from multicor_cli.plots.grain_map import color_scale, draw_values

    norm, _ = color_scale(table)
    picture = draw_picture(table.scene, lambda axes: draw_values(axes, table, norm, has_streamlines=has_streamlines), terminal)
    return f"{picture}\n{table.field.label} [{table.field.unit}] from {norm.vmin:.6g} to {norm.vmax:.6g}"


def forces_text(network: ForceNetwork, terminal: Terminal) -> str:
    """A force network as a picture.

    Raises:
        PlotError: If matplotlib is not installed.
    """
    from multicor_cli.plots.forces import draw_network

    picture = draw_picture(network.scene, lambda axes: draw_network(axes, network), terminal)
    mean = float(network.force[:, 0].mean()) if network.i.size else 0.0
    return f"{picture}\nwidth: normal force, mean {mean:.3g} N; blue: sticking, red: sliding"
