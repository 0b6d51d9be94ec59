"""Figures of contact forces: their network, and statistics over magnitudes and directions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from multicor_cli.model.model import Floats
from multicor_cli.plots.grain_map import clip_to_cell, draw_grains, draw_walls, place_scene
from multicor_cli.plots.style import (
    COLORS,
    COLUMN,
    PAGE,
    TITLE,
    Renderer,
    Terminal,
    TextLine,
    draw_picture,
    draw_text,
    in_axes,
    legend_above,
    name_frame,
    show_decades,
)
from multicor_cli.post.forces import AngularDistribution, ForceDistribution, ForceNetwork
from multicor_cli.post.grain_map import GrainScene
from multicor_cli.post.heat import HeatNetwork
from multicor_cli.post.mobilization import Mobilization
from multicor_cli.text import with_error

# ---- Force network: a line for every contact, its width proportional to the normal force

_POINTS = 72.0  # points per inch
_WIDTH = 0.15  # width of the line of a mean force over the mean diameter
SHOWN = (1.0, 3.0)
"""Forces, or heat flows, over the mean whose lines the legend shows."""
LEGEND = 0.62
"""Room for the legend [inch]."""
_WIDEST = 0.75  # width of the widest line over the mean diameter
_THICKEST = 8.0  # line of a legend [points]: rows are some 10 points apart
_TENSION = COLORS[2]


def draw_forces(axes: Any, network: ForceNetwork, *, unit: float | None = None) -> None:
    """Draw a force network into matplotlib axes, with a legend above the figure.

    The line of the mean normal force without sign, or of the force ``unit`` [N], is 0.15 mean
    diameters wide. Contacts in tension have a color of their own, whether they slide or not.
    """
    name_frame(axes, network.time, network.frame)
    if draw_network(axes, network, unit).size:
        names = {"sticking": COLORS[0], "sliding": COLORS[1]}
        if (network.force[:, 0] < 0.0).any():
            names["in tension"] = _TENSION
        explain_network(axes, network, names, unit)


def explain_network(
    axes: Any, network: ForceNetwork, names: Mapping[str, str], unit: float | None = None
) -> None:
    """A legend above the figure: colors by what they mean, and widths of lines."""
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], color=color, linewidth=2.0) for color in names.values()]
    labels = list(names)
    if len(names) % 2:  # columns of two
        handles.append(Line2D([], [], linestyle="none"))
        labels.append("")
    size = float(np.abs(network.force[:, 0]).mean()) if unit is None else unit
    widths = lines_shown(axes, network.scene, size, "N")
    axes.figure.legend(
        [*handles, *widths.values()], [*labels, *widths], loc="outside upper center",
        ncols=len(labels) // 2 + 1, title=f"width: normal force, mean {_mean(network):.3g} N",
        title_fontsize=7.0, columnspacing=1.0, handlelength=1.6, handletextpad=0.5,
    )  # fmt: skip


def draw_network(
    axes: Any, network: ForceNetwork, unit: float | None = None, colors: Any = None
) -> Floats:
    """Draw grains, walls and contacts; returns the widths of the lines of the contacts [points].

    ``colors`` are those of the contacts; default: by whether they are in tension, or slide.
    """
    from matplotlib.collections import LineCollection

    draw_grains(axes, network.scene, color="0.93", edgecolors="0.55", linewidths=0.3, zorder=1)
    draw_walls(axes, network.scene)
    if not network.i.size:
        return np.zeros(0)
    lines, which = segments(network)
    width = line_widths(axes, network.scene, network.force[:, 0], unit=unit)
    if colors is None:
        colors = np.where(network.sliding, COLORS[1], COLORS[0])
        colors = np.where(network.force[:, 0] < 0.0, _TENSION, colors)
    look: dict[str, Any] = {"linewidths": width[which], "colors": colors[which], "zorder": 3}
    drawn = LineCollection(list(lines), capstyle="round", **look)
    axes.add_collection(drawn)
    clip_to_cell(axes, network.scene, drawn)
    return width


def segments(network: ForceNetwork | HeatNetwork) -> tuple[Floats, Any]:
    """Lines of contacts, with images across sides, shape ``(k, 2, 2)``; and their contacts.

    They lead from center to center, through the point of contact where grains are no discs.
    """
    lines, contact = np.stack([network.start, network.end], axis=1), np.arange(network.i.size)
    if network.scene.rings is not None:
        halves = [(network.start, network.touch), (network.touch, network.end)]
        lines = np.concatenate([np.stack(half, axis=1) for half in halves])
        contact = np.tile(contact, 2)
    middle, reach = lines.mean(axis=1), 0.5 * (lines[:, 1] - lines[:, 0])
    which, shift = network.scene.lattice.images(middle, reach)
    return lines[which] + shift[:, np.newaxis], contact[which]


def line_widths(
    axes: Any, scene: GrainScene, size: Floats, widest: float = _WIDEST, unit: float | None = None
) -> Floats:
    """Widths of lines [points], proportional to sizes without sign, up to ``widest`` diameters.

    A line of the size ``unit``, or of the mean one, is 0.15 mean diameters wide.
    """
    width, size = _unit_width(axes, scene), np.abs(size)
    relative = size / (unit or size.mean() or 1.0)
    return np.asarray(np.minimum(width * relative, widest / _WIDTH * width))


def lines_shown(axes: Any, scene: GrainScene, size: float, unit: str) -> dict[str, Any]:
    """Lines for a legend by what they stand for: `SHOWN` times a size, whose line has unit width.

    Where grains are so large that these would lie over each other, less of it.
    """
    from matplotlib.lines import Line2D

    width = _unit_width(axes, scene)
    part = min(1.0, _THICKEST / (SHOWN[-1] * width))
    look: dict[str, Any] = {"color": "0.2", "solid_capstyle": "butt"}
    return {
        f"{float(f'{part * times * size:.2g}'):g} {unit}": Line2D(
            [], [], linewidth=part * times * width, **look
        )
        for times in SHOWN
    }


def _unit_width(axes: Any, scene: GrainScene) -> float:
    """Width of the line of the mean size, or of the one that is given [points]."""
    inches = axes.figure.get_size_inches()
    per_meter = float(min(inches / (scene.box[1] - scene.box[0]))) * _POINTS
    return _WIDTH * 2.0 * float(scene.radius.mean()) * per_meter


def _mean(network: ForceNetwork) -> float:
    """Mean normal force [N], tension negative, as the table has it."""
    return float(network.force[:, 0].mean()) if network.i.size else 0.0


def forces_text(network: ForceNetwork, terminal: Terminal, *, unit: float | None = None) -> str:
    """A force network as a picture; raises `MissingLibrary` without matplotlib."""
    picture = draw_picture(network.scene, lambda axes: draw_network(axes, network, unit), terminal)
    colors = "blue: sticking, red: sliding"
    if (network.force[:, 0] < 0.0).any():
        colors += ", green: in tension"
    return f"{picture}\nwidth: normal force, mean {_mean(network):.3g} N; {colors}"


# ---- Statistics of contact forces: over their magnitude, and over directions of contacts


def draw_distribution(axes: Any, table: ForceDistribution) -> None:
    """Draw a force distribution into matplotlib axes; empty bins are left out."""
    curves = (
        (table.normal, table.normal_scatter, "o", r"normal, $f = f_n$"),
        (table.tangential, table.tangential_scatter, "s", r"tangential, $f = |f_t|$"),
    )
    for color, (density, scatter, marker, label) in zip(COLORS, curves, strict=False):
        known = density > 0.0
        if known.any():
            center, shown = table.center[known], density[known]
            around = np.nan_to_num(scatter[known])
            line: dict[str, Any] = {"linestyle": "-", "linewidth": 0.7, "label": label}
            axes.loglog(center, shown, marker, color=color, **line)
            # a logarithmic axis has no zero
            lower = np.maximum(shown - around, 0.1 * shown)
            axes.fill_between(center, lower, shown + around, color=color, alpha=0.2, linewidth=0.0)
    if table.frames.size > 1:
        axes.fill_between([], [], color="0.3", alpha=0.2, linewidth=0.0, label="scatter of frames")
    shown = np.concatenate([table.normal, table.tangential])
    show_decades(axes.yaxis, shown[shown > 0.0])
    axes.xaxis.set_minor_formatter("")
    axes.set_xlabel(r"force $f/\langle f \rangle$ [–]")
    axes.set_ylabel(r"probability density $P(f/\langle f \rangle)$ [–]")
    axes.legend(loc="lower left")


def draw_angles(figure: Any, table: AngularDistribution) -> None:
    """Draw both polar histograms, and the tangential force below, with the second harmonics that
    the anisotropies mean.
    """
    grid = figure.add_gridspec(2, 2, height_ratios=(2.2, 1.0))
    contacts, forces = (figure.add_subplot(grid[0, k], projection="polar") for k in (0, 1))
    title = "contact directions $E(\\theta)$ [1/rad]"
    _draw_polar(contacts, table, "c", table.density, 0.5 / np.pi, COLORS[0], title)
    title = "normal force $\\langle f_n \\rangle(\\theta)/\\langle f_n \\rangle$ [–]"
    mean = float(np.nanmean(table.normal))
    _draw_polar(forces, table, "n", table.normal, mean, COLORS[1], title)
    scatter = _draw_tangential(figure.add_subplot(grid[1, :]), table, mean)
    text = r"$1 + a \cos 2(\theta - \theta_a)$, below $-a_t \sin 2(\theta - \theta_t)$"
    text += ", times the mean, with the $a$ and $\\theta_a$ above"
    names = {text: forces.lines[-1]} | ({"scatter of frames": scatter} if scatter else {})
    figure.legend([*names.values()], [*names], loc="outside lower center", ncols=2)


def _draw_tangential(axes: Any, table: AngularDistribution, level: float) -> Any:
    """The tangential force over half a circle, as the other half repeats it; returns what shows its
    scatter, or None.
    """
    half, color = table.angle.size // 2, COLORS[2]
    degrees, value = np.degrees(table.angle[:half]), table.tangential[:half]
    axes.axhline(0.0, color="0.6", linewidth=0.6, zorder=1)
    axes.bar(
        degrees, np.nan_to_num(value), width=180.0 / half, color=color, alpha=0.4, linewidth=0.0
    )
    bars: dict[str, Any] = {"ecolor": color, "elinewidth": 0.7, "capsize": 1.2}
    around = table.tangential_scatter[:half]
    is_known = bool(np.isfinite(around).any())
    scatter = axes.errorbar(degrees, value, yerr=around, fmt="none", **bars) if is_known else None
    theta = np.linspace(0.0, 180.0, 181)
    a, main = table.moments["a_t"], table.moments["theta_t"]
    wave = -level * a * np.sin(2.0 * np.radians(theta - main))
    axes.plot(theta, wave, color="0.15", linewidth=0.8)
    axes.set_title(
        "tangential force on the grain that the normal points to, positive along the normal turned "
        "by +90°\n"
        + _moment("t", table), fontsize=8.0,
    )  # fmt: skip
    axes.set(xlim=(0.0, 180.0), xticks=np.arange(0.0, 181.0, 30.0))
    axes.set_xlabel(r"direction of the normal $\theta$ [°]")
    axes.set_ylabel(r"$\langle f_t \rangle(\theta)/\langle f_n \rangle$ [–]")
    return scatter


def _moment(name: str, table: AngularDistribution) -> str:
    a, theta = f"a_{name}", f"theta_{name}"
    size, angle = f"{table.moments[a]:.3f}", f"{table.moments[theta]:.0f}"
    note = ""
    if not np.isnan(table.moments_scatter[a]):
        size += f" \\pm {table.moments_scatter[a]:.3f}"
        angle += f" \\pm {table.moments_scatter[theta]:.0f}"
        note = " ($\\pm$: frames)"
    return f"$a_{name} = {size}$, $\\theta_{name} = {angle}°${note}"


def _draw_polar(
    axes: Any,
    table: AngularDistribution,
    name: str,
    values: Any,
    level: float,
    color: str,
    title: str,
) -> None:
    """A histogram and the harmonic of the moments ``name`` about a level."""
    from matplotlib.ticker import MaxNLocator

    width = 2.0 * np.pi / table.angle.size
    axes.bar(table.angle, np.nan_to_num(values), width=width, color=color, alpha=0.4, linewidth=0.0)
    theta = np.linspace(0.0, 2.0 * np.pi, 361)
    a, degrees = table.moments[f"a_{name}"], table.moments[f"theta_{name}"]
    wave = level * (1.0 + a * np.cos(2.0 * (theta - np.radians(degrees))))
    axes.plot(theta, wave, color="0.15", linewidth=0.8)
    axes.set_title(f"{title}\n{_moment(name, table)}", fontsize=8.0, pad=10.0)
    axes.set_rlabel_position(22.5)
    axes.yaxis.set_major_locator(MaxNLocator(4))
    axes.minorticks_off()
    axes.grid(color="0.85", linewidth=0.4)
    axes.set_axisbelow(True)
    axes.tick_params(pad=0.5)


def distribution_text(table: ForceDistribution, _terminal: Terminal) -> str:
    """A force distribution on logarithmic scales."""
    lines = [TextLine(n, table.center, getattr(table, n)) for n in ("normal", "tangential")]
    return draw_text(
        lines, "force over mean force [–]", "probability density [–]", is_logarithmic=True
    )


def angles_text(table: AngularDistribution, _terminal: Terminal) -> str:
    """Contact directions and the forces along them, over what they would be if all were alike."""
    degrees = np.degrees(table.angle)
    density = TextLine("density of contacts", degrees, 2.0 * np.pi * table.density)
    normal = TextLine("normal force", degrees, table.normal)
    tangential = TextLine("tangential force, over mean normal", degrees, table.tangential)
    return draw_text([density, normal, tangential], "direction [°]", "over mean [–]")


def draw_mobilization(axes: Any, table: Mobilization) -> None:
    """Draw the distribution of mobilized friction into matplotlib axes."""
    width = table.edges[1] - table.edges[0]
    axes.bar(table.center, table.density, width=width, color=COLORS[0], alpha=0.4, linewidth=0.0)
    around = table.density_scatter
    if np.isfinite(around).any():
        bars: dict[str, Any] = {"ecolor": COLORS[0], "elinewidth": 0.7, "capsize": 1.2}
        axes.errorbar(
            table.center, table.density, yerr=around, fmt="none", label="scatter of frames", **bars
        )
    label = f"mean, {with_error(table.mean, table.mean_error)}"
    axes.axvline(table.mean, color="0.15", linewidth=0.8, linestyle="--", label=label)
    axes.set(xlim=(0.0, 1.0), ylim=(0.0, None))
    axes.set_xlabel(r"mobilization of friction $|f_t|/(\mu f_n)$ [–]")
    axes.set_ylabel("probability density [–]")
    legend_above(axes, 2)


def mobilization_text(table: Mobilization, _terminal: Terminal) -> str:
    """The distribution of mobilized friction as a chart of letters."""
    line = TextLine("", table.center, table.density)
    return draw_text([line], "mobilization [–]", "probability density [–]")


FIGURES = {
    ForceNetwork: Renderer(
        (COLUMN, COLUMN),
        lambda figure, network, **options: draw_forces(
            place_scene(figure, network.scene, has_bar=False, top=LEGEND + TITLE).axes,
            network,
            **options,
        ),
        forces_text,
    ),
    ForceDistribution: Renderer(
        (COLUMN, 0.85 * COLUMN), in_axes(draw_distribution), distribution_text
    ),
    AngularDistribution: Renderer((PAGE, 0.88 * PAGE), draw_angles, angles_text),
    Mobilization: Renderer((COLUMN, 0.8 * COLUMN), in_axes(draw_mobilization), mobilization_text),
}
