"""Figures of coarse-grained fields: a map of one of them with the walls, or lines of several."""

from __future__ import annotations

from typing import Any

import numpy as np

from multicor_cli.plots.grain_map import add_color_bar, draw_walls, place_scene
from multicor_cli.plots.style import (
    COLORS,
    COLUMN,
    Renderer,
    Terminal,
    TextLine,
    axis_label,
    beyond,
    color_map,
    draw_picture,
    draw_text,
    draw_with_errors,
    explain_errors,
    legend_above,
    name_frame,
    use_powers,
)
from multicor_cli.post.field_sums import Field
from multicor_cli.post.fields import FieldTable
from multicor_cli.text import unit_sign

# Quantiles between which values have a color of their own: corners that hold little scatter widely
_INNER = (0.01, 0.99)


def _fill(figure: Any, table: FieldTable) -> None:
    if not table.points.is_grid:
        _draw_lines(figure, table)
        return
    place, field = place_scene(figure, table.scene), table.of[0]
    mesh, extend = _draw_mesh(place.axes, table, field)
    draw_walls(place.axes, table.scene)
    add_color_bar(place.bar, mesh, table.scene, field, extend)
    first, last = table.times
    if table.frames.size == 1:
        name_frame(place.axes, first, int(table.frames[0]))
    else:
        text = f"{table.frames.size} frames, $t$ = {first:.4g} to {last:.4g} s"
        place.axes.set_title(text, loc="left", fontsize=8.0, pad=4.0)


def _draw_mesh(axes: Any, table: FieldTable, field: Field) -> tuple[Any, str]:
    """Draw cells of a grid; returns them, and which ends of the color bar stand for more."""
    values = table.values[field.name]
    low, high, extend = _color_range(values, field)
    x, y = (np.asarray(edges) for edges in np.meshgrid(*table.points.edges))
    if table.points.axes == "rt":
        x, y = table.points.center[0] + x * np.cos(y), table.points.center[1] + x * np.sin(y)
        cells = np.where(_is_beyond(table), np.nan, values).reshape(table.points.shape).T
    else:
        x = x + table.points.slant * y
        cells = values.reshape(table.points.shape)
    name = "balance" if field.is_signed else "plasma" if field.name == "temperature" else "viridis"
    colors: dict[str, Any] = {"cmap": color_map(name), "vmin": low, "vmax": high}
    return axes.pcolormesh(x, y, np.ma.masked_invalid(cells), rasterized=True, **colors), extend


def _is_beyond(table: FieldTable) -> Any:
    """Which points lie outside the box around the grains, but for directions with a period."""
    scene, at = table.scene, table.points.at
    reach = scene.radius[:, np.newaxis]
    low, high = (scene.center - reach).min(axis=0), (scene.center + reach).max(axis=0)
    is_free = np.array(scene.lattice[:2]) <= 0.0
    return (((at < low) | (at > high)) & is_free).any(axis=1)


def _color_range(values: Any, field: Field) -> tuple[float, float, str]:
    known = values[np.isfinite(values)]
    if not known.size:
        return 0.0, 1.0, "neither"
    low, high = np.quantile(known, _INNER).tolist()
    if field.is_signed:
        high = max(abs(low), abs(high)) or 1.0
        low = -high
    elif low == high:
        low, high = low - 1e-3 * (abs(low) or 1.0), high + 1e-3 * (abs(high) or 1.0)
    return low, high, beyond(known, low, high)


def _draw_lines(figure: Any, table: FieldTable) -> None:
    """A panel for each unit, below each other."""
    units = list(dict.fromkeys(field.unit for field in table.of))
    panels = figure.subplots(len(units), 1, sharex=True, squeeze=False)[:, 0]
    at = table.points.coordinates[:, 0]
    style: Any = {"markersize": 2.5, "linewidth": 0.9, "is_upright": False}
    for panel, unit in zip(panels, units, strict=True):
        shown = [field for field in table.of if field.unit == unit]
        for color, field in zip(COLORS, shown, strict=False):
            style |= {"names": (f"${field.symbol}$", "", ""), "color": color}
            value, error = table.values[field.name], table.error[field.name]
            draw_with_errors(panel, value, at, error, "o", **style)
        panel.set_ylabel(_label(shown))
        use_powers(panel, "both")
        if panel is panels[0]:
            explain_errors(panel, [table.error[field.name] for field in table.of])
        handles, labels = panel.get_legend_handles_labels()
        if len(handles) > 1:
            legend_above(panel, 3, handles, labels)
    is_radial = table.points.axes == "rt"
    panels[-1].set_xlabel(
        "distance from the center $r$ [m]" if is_radial else "distance along the line [m]"
    )
    figure.align_ylabels()


def _label(shown: list[Field]) -> str:
    """The words that labels have in common, or symbols, and their unit; of one field both."""
    first = shown[0]
    if len(shown) == 1:
        return axis_label(first.label, first.symbol, first.unit)
    words = " ".join(
        word for word in first.label.split() if all(word in field.label.split() for field in shown)
    )
    symbols = ", ".join(f"${field.symbol}$" for field in shown)
    return f"{words or symbols} [{unit_sign(first.unit)}]"


def fields_text(table: FieldTable, terminal: Terminal) -> str:
    """A field as a picture, or charts along a line; a picture may raise `MissingLibrary`."""
    names = {field.name: f"{field.label} [{unit_sign(field.unit)}]" for field in table.of}
    if not table.points.is_grid:
        at, label = table.points.coordinates[:, 0], table.points.names[0]
        return "\n\n".join(
            draw_text([TextLine("", at, table.values[name])], label, text)
            for name, text in names.items()
        )
    field = table.of[0]
    low, high, _ = _color_range(table.values[field.name], field)

    def draw(axes: Any) -> None:
        _draw_mesh(axes, table, field)
        draw_walls(axes, table.scene)

    picture = draw_picture(table.scene, draw, terminal)
    return f"{picture}\n{names[field.name]} from {low:.6g} to {high:.6g}"


def _size(table: FieldTable) -> tuple[float, float]:
    panels = 1 if table.points.is_grid else len({field.unit for field in table.of})
    return COLUMN, COLUMN * (0.35 + 0.5 * panels)


FIGURES = {FieldTable: Renderer(_size, _fill, fields_text)}
