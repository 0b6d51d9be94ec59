"""Figures of the statistics of contact forces: over their magnitude, and over the directions of the contacts."""

from __future__ import annotations

from typing import Any

import numpy as np

from multicor_cli.plots.dispatch import Ways
from multicor_cli.plots.style import COLORS, COLUMN, PAGE, show_decades
from multicor_cli.plots.text_chart import TextLine, draw_text
from multicor_cli.plots.text_picture import Terminal
from multicor_cli.post.force_statistics import AngularDistribution, ForceDistribution


def draw_distribution(axes: Any, table: ForceDistribution) -> None:
    """Draw a force distribution into matplotlib axes; empty bins are left out."""
    curves = (
        (table.normal, table.normal_scatter, "o", r"normal, $f = f_n$"),
        (table.tangential, table.tangential_scatter, "s", r"tangential, $f = |f_t|$"),
    )
    for color, (density, scatter, marker, label) in zip(COLORS, curves, strict=False):
        known = density > 0.0
        if known.any():
            axes.loglog(table.center[known], density[known], marker, linestyle="-", color=color, label=label, linewidth=0.7)
            around = np.nan_to_num(scatter[known])
            lower = np.maximum(density[known] - around, 0.1 * density[known])  # a logarithmic axis has no zero
            axes.fill_between(table.center[known], lower, density[known] + around, color=color, alpha=0.2, linewidth=0.0)
    if table.frames.size > 1:
        axes.fill_between([], [], color="0.3", alpha=0.2, linewidth=0.0, label="scatter of frames")
    shown = np.concatenate([table.normal, table.tangential])
    show_decades(axes.yaxis, shown[shown > 0.0])
    axes.xaxis.set_minor_formatter("")
    axes.set_xlabel(r"force $f/\langle f \rangle$ [–]")
    axes.set_ylabel(r"probability density $P(f/\langle f \rangle)$ [–]")
    axes.legend(loc="lower left")


def draw_angles(figure: Any, table: AngularDistribution) -> None:
    """Draw both polar histograms into a matplotlib figure, with the second harmonics that the anisotropies mean."""
    contacts, forces = figure.subplots(1, 2, subplot_kw={"projection": "polar"})
    moments = table.moments
    level = 0.5 / np.pi
    _draw_polar(contacts, table, table.density, level, moments["a_c"], moments["theta_c"], COLORS[0])
    contacts.set_title("contact directions $E(\\theta)$ [1/rad]\n" + _moment("c", table), fontsize=8.0, pad=10.0)
    mean = float(np.nanmean(table.normal))
    _draw_polar(forces, table, table.normal, mean, moments["a_n"], moments["theta_n"], COLORS[1])
    title = "normal force $\\langle f_n \\rangle(\\theta)/\\langle f_n \\rangle$ [–]\n"
    forces.set_title(title + _moment("n", table), fontsize=8.0, pad=10.0)
    line = forces.lines[-1]
    figure.legend(
        [line], [r"$1 + a \cos 2(\theta - \theta_a)$ times the mean, with the $a$ and $\theta_a$ above"], loc="outside lower center"
    )


def _moment(name: str, table: AngularDistribution) -> str:
    a, theta = f"a_{name}", f"theta_{name}"
    if np.isnan(table.moments_scatter[a]):
        return f"$a_{name} = {table.moments[a]:.3f}$, $\\theta_{name} = {table.moments[theta]:.0f}°$"
    return (
        f"$a_{name} = {table.moments[a]:.3f} \\pm {table.moments_scatter[a]:.3f}$, "
        f"$\\theta_{name} = {table.moments[theta]:.0f} \\pm {table.moments_scatter[theta]:.0f}°$ ($\\pm$: frames)"
    )


def _draw_polar(axes: Any, table: AngularDistribution, values: Any, level: float, a: float, degrees: float, color: str) -> None:
    from matplotlib.ticker import MaxNLocator

    width = 2.0 * np.pi / table.angle.size
    axes.bar(table.angle, np.nan_to_num(values), width=width, color=color, alpha=0.4, linewidth=0.0)
    theta = np.linspace(0.0, 2.0 * np.pi, 361)
    axes.plot(theta, level * (1.0 + a * np.cos(2.0 * (theta - np.radians(degrees)))), color="0.15", linewidth=0.8)
    axes.set_rlabel_position(22.5)
    axes.yaxis.set_major_locator(MaxNLocator(4))
    axes.minorticks_off()
    axes.grid(color="0.85", linewidth=0.4)
    axes.set_axisbelow(True)
    axes.tick_params(pad=0.5)


def distribution_text(table: ForceDistribution, _terminal: Terminal) -> str:
    """A force distribution on logarithmic scales."""
    lines = [TextLine("normal", table.center, table.normal), TextLine("tangential", table.center, table.tangential)]
    return draw_text(lines, "force over mean force [–]", "probability density [–]", is_logarithmic=True)


def angles_text(table: AngularDistribution, _terminal: Terminal) -> str:
    """Directions of the contacts and the forces along them, each over what it would be if all directions were alike."""
    degrees = np.degrees(table.angle)
    density = TextLine("density of contacts", degrees, 2.0 * np.pi * table.density)
    return draw_text([density, TextLine("normal force", degrees, table.normal)], "direction [°]", "over mean [–]")


FIGURES = {
    ForceDistribution: Ways(
        lambda _: (COLUMN, 0.85 * COLUMN), lambda figure, table: draw_distribution(figure.add_subplot(), table), distribution_text
    ),
    AngularDistribution: Ways(lambda _: (PAGE, 0.58 * PAGE), draw_angles, angles_text),
}
