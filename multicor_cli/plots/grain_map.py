"""Map of a quantity: every grain to scale, colored."""

from __future__ import annotations

from typing import Any

import numpy as np

from multicor_cli.optional import library
from multicor_cli.plots.dispatch import Ways
from multicor_cli.plots.scene import Place, draw_discs, draw_walls, is_wide, place_scene
from multicor_cli.plots.small_rises import rise_formatter, rise_label, rise_reference
from multicor_cli.plots.streamlines import draw_streamlines
from multicor_cli.plots.style import COLORS, COLUMN, axis_label, color_map
from multicor_cli.plots.text_picture import Terminal, draw_picture
from multicor_cli.post.grain_map import GrainMap
from multicor_cli.post.quantities import color_range
from multicor_cli.text import unit_sign

_ARROWS = 1500  # at most this many arrows, or they cannot be told apart
_LONG = 0.95  # this part of the arrows are as long as their velocity says; longer ones are cut to this length
_LENGTH = 2.0  # length of the longest arrow over the mean distance of arrows


def _fill(figure: Any, table: GrainMap, *, has_streamlines: bool = True) -> None:
    draw_map(place_scene(figure, table.scene), table, has_streamlines=has_streamlines)


def draw_map(place: Place, table: GrainMap, *, has_streamlines: bool = True) -> None:
    """Draw a map with its color bar where `place_scene` has made room.

    Args:
        place: The room.
        table: The map.
        has_streamlines: Whether vectors are shown as streamlines of their local mean, in which vortices are seen, or as arrows.
    """
    scale = color_scale(table)
    draw_bar(place.bar, table, draw_values(place.axes, table, scale[0], has_streamlines=has_streamlines), scale)


def draw_values(axes: Any, table: GrainMap, norm: Any, *, has_streamlines: bool = True) -> Any:
    """Draw the grains, walls and vectors of a map in the colors of ``norm``; returns the collection of the grains."""
    # Where a color is the background's own, an outline keeps the grain visible.
    outline: dict[str, Any] = {"edgecolors": "0.45", "linewidths": 0.2} if table.field.scale in ("centered", "logarithmic") else {}
    discs = draw_discs(axes, table.scene, value=table.value, cmap=_colors(table), norm=norm, **outline)
    draw_walls(axes, table.scene)
    if table.vector is not None:
        (draw_streamlines if has_streamlines else _draw_arrows)(axes, table)
    return discs


def _colors(table: GrainMap) -> Any:
    """The color map of a map; on a logarithmic scale what is zero or negative is white, and not the darkest color."""
    import matplotlib as mpl

    if table.names:
        from matplotlib.colors import ListedColormap

        return ListedColormap([COLORS[k % len(COLORS)] for k in range(len(table.names))])
    colors = mpl.colormaps[color_map(table.field.colors)]
    return colors.with_extremes(bad="white", under="white") if table.field.scale == "logarithmic" else colors


def draw_bar(axes: Any, table: GrainMap, discs: Any, scale: tuple[Any, str]) -> None:
    """Draw the color bar of a map into axes beside or below it."""
    norm, extend = scale
    if len(table.names) == 1:  # nothing to tell apart
        axes.set_axis_off()
        axes.set_title(f"{table.field.label}:\n{table.names[0]}", loc="left", fontsize=8.0, y=0.5)
        return
    if table.names:
        bar = axes.figure.colorbar(discs, cax=axes, orientation="horizontal" if is_wide(table.scene) else "vertical")
        bar.set_ticks(range(len(table.names)), labels=table.names)
        bar.ax.minorticks_off()
        bar.set_label(table.field.label)
        return
    direction = "horizontal" if is_wide(table.scene) else "vertical"
    bar = axes.figure.colorbar(discs, cax=axes, extend=extend, extendfrac=0.03, orientation=direction)
    field = table.field
    reference = rise_reference(field.unit, norm.vmin, norm.vmax)
    if reference is None:
        none = "; white: none" if field.scale == "logarithmic" else ""
        bar.set_label(axis_label(field.label, field.symbol, field.unit) + none)
    else:
        bar.formatter = rise_formatter(reference)
        bar.set_label(rise_label(field.label, field.symbol, reference))


def color_scale(table: GrainMap) -> tuple[Any, str]:
    """Norm of matplotlib for the values, and which ends of the color bar stand for more than their value."""
    colors = library("matplotlib.colors")
    if table.names:
        return colors.BoundaryNorm([k - 0.5 for k in range(len(table.names) + 1)], len(table.names)), "neither"
    value, is_logarithmic = table.value, table.field.scale == "logarithmic"
    low, high = color_range(table.field, value, table.scene.radius.size)
    ends = (bool(value.min() < low), bool(value.max() > high))
    extend = {(False, False): "neither", (True, False): "min", (False, True): "max"}.get(ends, "both")
    return colors.LogNorm(low, high) if is_logarithmic else colors.Normalize(low, high), extend


def _draw_arrows(axes: Any, table: GrainMap) -> None:
    """Arrows on the grains, or on some of them; the few longest are cut, the colors tell how long they are."""
    scene, vector = table.scene, table.vector
    assert vector is not None
    step = max(1, -(-scene.radius.size // _ARROWS))
    # An order that does not follow the numbering, which may go row by row: arrows must not line up with the grains.
    order = np.random.default_rng(0).permutation(scene.radius.size)[::step]
    spacing = float(np.sqrt(np.prod(scene.box[1] - scene.box[0]) / order.size))
    longest = float(np.quantile(table.value, _LONG)) or 1.0
    cut = np.minimum(1.0, longest / np.maximum(table.value, longest))
    axes.quiver(
        *scene.center[order].T,
        *(vector * cut[:, np.newaxis])[order].T,
        angles="xy",
        scale_units="xy",
        scale=longest / (_LENGTH * spacing),
        units="xy",
        width=0.09 * spacing,
        pivot="middle",
        color="white",
        edgecolor="0.1",
        linewidth=0.2,
        zorder=3,
    )


def map_text(table: GrainMap, terminal: Terminal, *, has_streamlines: bool = True) -> str:
    """A map as a picture, with the values of its darkest and lightest color below.

    Raises:
        MissingLibrary: If matplotlib is not installed.
    """
    norm, _ = color_scale(table)
    values = ", ".join(table.names) if table.names else f"from {norm.vmin:.6g} to {norm.vmax:.6g}"
    picture = draw_picture(table.scene, lambda axes: draw_values(axes, table, norm, has_streamlines=has_streamlines), terminal)
    unit = "" if table.names else f" [{unit_sign(table.field.unit)}]"
    return f"{picture}\n{table.field.label}{unit} {values}"


FIGURES = {GrainMap: Ways(lambda _: (COLUMN, COLUMN), _fill, map_text)}
