"""Force network: a line for every contact, its width proportional to the normal force."""

from __future__ import annotations

from typing import Any

import numpy as np

from multicor_cli.model.model import Floats
from multicor_cli.plots.dispatch import Ways
from multicor_cli.plots.scene import draw_discs, draw_walls, place_scene
from multicor_cli.plots.style import COLORS, COLUMN
from multicor_cli.plots.text_picture import Terminal, draw_picture
from multicor_cli.post.forces import ForceNetwork
from multicor_cli.post.scene import images

_POINTS = 72.0  # points per inch
_WIDTH = 0.15  # width of the line of a mean force over the mean diameter
_SHOWN = (1.0, 3.0)  # forces over the mean whose lines the legend shows
_LEGEND = 0.62  # room for the legend [inch]
_WIDEST = 0.75  # width of the widest line over the mean diameter


def _fill(figure: Any, network: ForceNetwork) -> None:
    draw_forces(place_scene(figure, network.scene, has_bar=False, top=_LEGEND).axes, network)


def draw_forces(axes: Any, network: ForceNetwork) -> None:
    """Draw a force network into matplotlib axes, with a legend above the figure."""
    from matplotlib.lines import Line2D

    if not draw_network(axes, network).size:
        return
    mean, unit = _mean_size(network), _mean_width(axes, network)
    handles = [Line2D([], [], color=COLORS[k], linewidth=2.0) for k in (0, 1)]
    handles += [Line2D([], [], color="0.2", linewidth=times * unit, solid_capstyle="butt") for times in _SHOWN]
    labels = ["sticking", "sliding", *(f"{times * mean:.2g} N" for times in _SHOWN)]
    title = f"width: normal force, mean {mean:.3g} N"
    axes.figure.legend(
        handles, labels, loc="outside upper center", ncols=2, title=title, title_fontsize=7.0,
        columnspacing=1.0, handlelength=1.6, handletextpad=0.5,
    )  # fmt: skip


def draw_network(axes: Any, network: ForceNetwork) -> Floats:
    """Draw grains, walls and contacts into matplotlib axes; returns the widths of the lines of the contacts [points]."""
    from matplotlib.collections import LineCollection

    draw_discs(axes, network.scene, color="0.93", edgecolors="0.55", linewidths=0.3, zorder=1)
    draw_walls(axes, network.scene)
    if not network.i.size:
        return np.zeros(0)
    lines, which = segments(network)
    width = line_widths(axes, network)
    color = np.where(network.sliding, COLORS[1], COLORS[0])
    axes.add_collection(LineCollection(list(lines), linewidths=width[which], colors=color[which], capstyle="round", zorder=3))
    return width


def segments(network: ForceNetwork) -> tuple[Floats, Any]:
    """Lines of the contacts, with images of those that cross the ends of the period, shape ``(k, 2, 2)``; and their contacts."""
    middle = 0.5 * (network.start + network.end)
    reach = 0.5 * np.abs(network.end - network.start)[:, 0]
    which, shift = images(middle[:, 0], reach, network.scene.period)
    lines = np.stack([network.start, network.end], axis=1)[which]
    lines[:, :, 0] += shift[:, np.newaxis]
    return lines, which


def line_widths(axes: Any, network: ForceNetwork) -> Floats:
    """Widths of the lines [points], proportional to the normal forces without sign; the largest are cut off at a wide line."""
    unit = _mean_width(axes, network)
    relative = np.abs(network.force[:, 0]) / _mean_size(network)
    return np.asarray(np.minimum(unit * relative, _WIDEST / _WIDTH * unit))


def _mean_width(axes: Any, network: ForceNetwork) -> float:
    """Width of the line of a mean force [points]."""
    scene = network.scene
    inches = axes.figure.get_size_inches()
    per_meter = float(min(inches / (scene.box[1] - scene.box[0]))) * _POINTS
    return _WIDTH * 2.0 * float(scene.radius.mean()) * per_meter


def _mean_size(network: ForceNetwork) -> float:
    """Mean normal force without sign [N]."""
    return float(np.abs(network.force[:, 0]).mean())


def forces_text(network: ForceNetwork, terminal: Terminal) -> str:
    """A force network as a picture.

    Raises:
        MissingLibrary: If matplotlib is not installed.
    """
    picture = draw_picture(network.scene, lambda axes: draw_network(axes, network), terminal)
    mean = _mean_size(network) if network.i.size else 0.0
    return f"{picture}\nwidth: normal force, mean {mean:.3g} N; blue: sticking, red: sliding"


FIGURES = {ForceNetwork: Ways(lambda _: (COLUMN, COLUMN), _fill, forces_text)}
