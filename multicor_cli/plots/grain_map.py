"""Grains and walls of a frame to scale, colored by a quantity, with streamlines; for notebooks."""

from __future__ import annotations

import io
from importlib.util import find_spec
from typing import Any, NamedTuple

import numpy as np

from multicor_cli.model.model import Floats
from multicor_cli.model.shapes import Outline, Polygon
from multicor_cli.optional import library
from multicor_cli.plots.style import (
    COLORS,
    COLUMN,
    PAGE,
    Renderer,
    Terminal,
    axis_label,
    beyond,
    color_map,
    count_small_rises,
    draw_picture,
    house_style,
)
from multicor_cli.post.grain_map import GrainMap, GrainScene, grain_map
from multicor_cli.post.lattice import Lattice
from multicor_cli.post.quantities import color_range
from multicor_cli.post.table import Quantity
from multicor_cli.text import unit_sign

# ---- Grains and walls of a frame drawn to scale

WALL = "0.35"
"""Color of walls."""

SOLID = "0.7"
"""Color of glued grains and solid bodies."""

_MANY = 1500  # grains above which a figure takes the width of a page
_FEW = 600  # grains up to which each has an outline
_TALLEST, _NARROWEST = 8.0, 2.0  # height and width of a figure [inch]
# Room beside the axes for their labels [inch]
_LEFT, _RIGHT, _BOTTOM, _TOP = 0.64, 0.15, 0.45, 0.12
# Thickness of the color bar, and what lies between it and the axes [inch]
_BAR, _BAR_GAP = 0.12, 0.1
# Room for the color bar with its labels, beside or below the axes [inch]
_BESIDE, _BELOW = 0.85, 0.62
# Ends of sides that differ by less than this share of the coordinates are one corner
_JOINED = 1e-9
_TICK_X, _TICK_Y = 0.5, 0.3  # room that the label of a tick takes [inch]
_LETTER, _SYMBOL = 0.062, 8  # width of a letter [inch]; letters that a symbol and its unit take


class Place(NamedTuple):
    """Axes of matplotlib with the aspect of a scene, and for its color bar, None without one."""

    axes: Any
    bar: Any


def place_scene(
    figure: Any, scene: GrainScene, *, has_bar: bool = True, top: float = _TOP, width: float = 0.0
) -> Place:
    """Give a figure the size of a scene, and axes that fill it: nothing is empty, no label is cut.

    Args:
        figure: The figure; whatever size it has.
        scene: The scene. A wide one has its color bar below it, a tall one beside it.
        has_bar: Whether there is a color bar.
        top: Room above the axes [inch].
        width: Width [inch]; 0: of a column, or a page for many grains. A tall scene takes less.
    """
    across, upwards = (scene.box[1] - scene.box[0]).tolist()
    beside = _BESIDE if has_bar and not is_wide(scene) else 0.0
    below = _BELOW if has_bar and is_wide(scene) else 0.0
    aside, above = _LEFT + _RIGHT + beside, _BOTTOM + top + below
    width = width or (PAGE if scene.radius.size > _MANY else COLUMN)
    scale = min((width - aside) / across, (_TALLEST - above) / upwards)
    wide, high = scale * across, scale * upwards
    figure.set_layout_engine("none")  # everything has its place
    spare = max(0.0, _NARROWEST - wide - aside)
    left = _LEFT + 0.5 * spare
    figure.set_size_inches(wide + aside + spare, high + above)
    axes = _add_axes(figure, left, _BOTTOM + below, wide, high)
    axes.locator_params(axis="x", nbins=int(np.clip(wide / _TICK_X, 1, 5)))
    axes.locator_params(axis="y", nbins=int(np.clip(high / _TICK_Y, 1, 5)))
    if not has_bar:
        return Place(axes, None)
    if below:
        return Place(axes, _add_axes(figure, left, _BELOW - _BAR - _BAR_GAP, wide, _BAR))
    return Place(axes, _add_axes(figure, left + wide + _BAR_GAP, _BOTTOM, _BAR, high))


def _add_axes(figure: Any, left: float, bottom: float, width: float, height: float) -> Any:
    """Axes at a place [inch]."""
    across, upwards = figure.get_size_inches()
    return figure.add_axes((left / across, bottom / upwards, width / across, height / upwards))


def is_wide(scene: GrainScene) -> bool:
    """Whether the scene is wider than high."""
    across, upwards = (scene.box[1] - scene.box[0]).tolist()
    return bool(across > 1.3 * upwards)


def draw_discs(
    axes: Any, scene: GrainScene, *, value: Floats | None = None, color: str = "none", **style: Any
) -> Any:
    """Draw the grains, colored by ``value`` or in one color; returns matplotlib's collection."""
    has_edge = scene.radius.size <= _FEW
    edge: dict[str, Any] = {"edgecolors": "0.2" if has_edge else "none"}
    edge["linewidths"] = 0.3 if has_edge else 0.0
    filling = {"facecolors": color} if value is None else {"array": value}
    look = {**edge, **filling, **style}
    discs = _add_discs(axes, scene.center, scene.radius, scene.lattice, **look)
    clip_to_cell(axes, scene, discs)
    return discs


def clip_to_cell(axes: Any, scene: GrainScene, drawn: Any) -> None:
    """Cut what was drawn off at the sides of the cell, if there is one."""
    if scene.lattice.height > 0.0:
        from matplotlib.path import Path

        drawn.set_clip_path(Path(scene.lattice.corners), axes.transData)


def draw_walls(axes: Any, scene: GrainScene) -> None:
    """Draw walls, glued grains or sides of a cell; set limits, aspect and labels of the axes."""
    for outline in scene.walls:
        _draw_outline(axes, scene, outline)
    if scene.lattice.height > 0.0:
        from matplotlib.collections import PolyCollection

        look: dict[str, Any] = {"facecolors": "none", "edgecolors": WALL, "linewidths": 0.5}
        axes.add_collection(PolyCollection([scene.lattice.corners], zorder=2, **look))
    axes.set_xlim(*scene.box[:, 0])
    axes.set_ylim(*scene.box[:, 1])
    axes.set_aspect("equal")
    axes.tick_params(top=False, right=False, which="both", direction="out")
    axes.minorticks_off()
    axes.set_xlabel("$x$ [m]")
    axes.set_ylabel("$y$ [m]")


def _add_discs(axes: Any, center: Floats, radius: Floats, lattice: Lattice, **style: Any) -> Any:
    """Discs and their images, each with a value if ``array`` gives some."""
    from matplotlib.collections import EllipseCollection

    which, shift = lattice.images(center, radius)
    width = 2.0 * radius[which]
    if "array" in style:
        style["array"] = style["array"][which]
    style["offsets"] = center[which] + shift
    style["offset_transform"] = axes.transData
    discs = EllipseCollection(width, width, np.zeros_like(width), units="xy", **style)
    axes.add_collection(discs)
    return discs


def _draw_outline(axes: Any, scene: GrainScene, outline: Outline) -> None:
    from matplotlib.collections import LineCollection, PolyCollection

    if outline.is_solid:
        polygons = solid_polygons(outline.points)
        axes.add_collection(
            PolyCollection(polygons, facecolors=SOLID, edgecolors="none", zorder=1.9)
        )
    if outline.radius is not None:
        glued, circle = (scene.lattice, SOLID, 0.3), (Lattice(), "none", 1.0)
        lattice, color, width = glued if outline.is_grain else circle
        look: dict[str, Any] = {"facecolors": color, "edgecolors": WALL, "linewidths": width}
        _add_discs(axes, outline.points[:, 0], outline.radius, lattice, zorder=2, **look)
        return
    lines = outline.points
    if outline.normal is not None:  # endless: what is to be seen
        normal, reach = outline.normal, 2.0 * float(np.hypot(*(scene.box[1] - scene.box[0])))
        along = np.column_stack([-normal[:, 1], normal[:, 0]]) * reach
        point = lines[:, 0]
        away = ((scene.box.mean(axis=0) - point) * along).sum(axis=1) / (along**2).sum(axis=1)
        nearest = point + away[:, np.newaxis] * along
        lines = np.stack([nearest - along, nearest + along], axis=1)
    axes.add_collection(LineCollection(list(lines), colors=WALL, linewidths=1.0, zorder=2))


def solid_polygons(sides: Floats) -> list[Floats]:
    """Corners of solid polygons, given the ends of sides that are solid on the left ``(k, 2, 2)``.

    Each side begins where the one before ends, unless it begins another polygon.
    """
    jump = np.abs(sides[1:, 0] - sides[:-1, 1]).max(axis=1)
    first = np.flatnonzero(jump > _JOINED * np.abs(sides).max()) + 1
    polygons = np.split(sides[:, 0], first)
    return [corners for corners in polygons if Polygon(corners).signed_size > 0.0]


# ---- Streamlines of the vectors of grains, averaged over a few diameters so that vortices are seen

_CELL = 1.0  # cell of the grid over the mean diameter, for few grains
_FINEST = 250  # cells along the longer side at most
_SMOOTH = 2.0  # standard deviation of the average over the mean diameter
# an average spans at least this part of the longer side, or lines cannot be told apart
_COARSE = 60.0
_DENSITY = 1.3  # of the lines along the longer side, as matplotlib counts
_EMPTY = 0.5  # share of the plane that grains must fill for lines to pass, over its mean


def draw_streamlines(axes: Any, table: GrainMap) -> None:
    """Draw streamlines of the local mean of the vectors over the grains of a map."""
    from matplotlib.patheffects import Normal, Stroke

    x, y, field = smooth_field(table)
    if not np.isfinite(field).any() or not np.nanmax(np.abs(field)) > 0.0:
        return
    across, upwards = (table.scene.box[1] - table.scene.box[0]).tolist()
    longest = max(across, upwards)
    density = (across / longest, upwards / longest)
    look: dict[str, Any] = {"color": "white", "linewidth": 0.8, "arrowsize": 0.8, "zorder": 3}
    u, v = (np.ma.masked_invalid(field[..., axis]) for axis in (0, 1))
    spacing = tuple(max(_DENSITY * part, 0.3) for part in density)
    drawn = axes.streamplot(x, y, u, v, density=spacing, arrowstyle="-|>", **look)
    # Readable on light grains and between them
    outline = [Stroke(linewidth=1.8, foreground="0.1"), Normal()]
    drawn.lines.set_path_effects(outline)
    for patch in axes.patches:
        patch.set_path_effects(outline)


def smooth_field(table: GrainMap) -> tuple[Floats, Floats, Floats]:
    """Means of vectors on a grid, weighted by area and a Gaussian; nan where there are no grains.

    Returns:
        x ``(p,)`` and y ``(q,)`` of the points [m], and the field, shape ``(q, p, 2)``.
    """
    scene, vector = table.scene, table.vector
    assert vector is not None
    low, size = scene.box[0], scene.box[1] - scene.box[0]
    diameter = 2.0 * float(scene.radius.mean())
    cell = max(_CELL * diameter, float(size.max()) / _FINEST)
    sigma = max(_SMOOTH * diameter, float(size.max()) / _COARSE)
    number = np.maximum(np.ceil(size / cell).astype(np.int64), 4)
    step = size / number
    at, which, is_cell = scene.center, np.arange(scene.radius.size), scene.lattice.height > 0.0
    if is_cell:  # the whole box is filled with images
        which, shift = scene.lattice.images(at, np.full(at.shape[0], scene.lattice.span))
        at = at[which] + shift
        is_near = ((at >= low) & (at <= scene.box[1])).all(axis=1)
        at, which = at[is_near], which[is_near]
    column, row = np.clip(((at - low) / step).astype(np.int64), 0, number - 1).T
    place, area = row * number[0] + column, scene.radius[which] ** 2
    sums = [
        np.bincount(place, area * weight, minlength=int(number.prod()))
        for weight in (1.0, *vector[which].T)
    ]
    is_periodic = scene.lattice.width > 0.0 and not is_cell
    grids = [
        _blur(found.reshape(number[::-1]), sigma / step, is_periodic=is_periodic) for found in sums
    ]
    filled = grids[0] > _EMPTY * float(area.sum() / number.prod())
    mean = [np.where(filled, grid / np.where(filled, grids[0], 1.0), np.nan) for grid in grids[1:]]
    x, y = (low[k] + (np.arange(number[k]) + 0.5) * step[k] for k in (0, 1))
    field = np.stack(mean, axis=-1)
    if is_cell:
        right, up = np.meshgrid(x, y)
        along = right - scene.lattice.slant * up
        is_out = (along < 0.0) | (along > scene.lattice.width)
        field[is_out | (up < 0.0) | (up > scene.lattice.height)] = np.nan
    return x, y, field


def _blur(grid: Floats, sigma: Floats, *, is_periodic: bool) -> Floats:
    """Convolve with a Gaussian of ``sigma`` (x, y) cells; around the ends in x if periodic."""
    rows, columns = grid.shape
    pad = (int(4 * sigma[1]) + 1, 0 if is_periodic else int(4 * sigma[0]) + 1)
    wide = np.pad(grid, ((0, pad[0]), (0, pad[1])))
    frequency = [np.fft.fftfreq(wide.shape[0]), np.fft.rfftfreq(wide.shape[1])]
    decay = [
        np.exp(-2.0 * (np.pi * s * f) ** 2) for s, f in zip(sigma[::-1], frequency, strict=True)
    ]
    found = np.fft.irfft2(np.fft.rfft2(wide) * np.outer(*decay), wide.shape)
    return np.asarray(np.maximum(found, 0.0) if grid.min() >= 0.0 else found)[:rows, :columns]


# ---- Map of a quantity: every grain to scale, colored

_ARROWS = 1500  # at most this many arrows, or they cannot be told apart
# This part of the arrows are as long as their velocity says; longer ones are cut to this length
_LONG = 0.95
_LENGTH = 2.0  # length of the longest arrow over the mean distance of arrows


def draw_map(place: Place, table: GrainMap, *, has_streamlines: bool = True) -> None:
    """Draw a map with its color bar where `place_scene` has made room; vectors as streamlines of
    their local mean, or else as arrows.
    """
    scale = color_scale(table)
    discs = draw_values(place.axes, table, scale[0], has_streamlines=has_streamlines)
    draw_bar(place.bar, table, discs, scale[1])


def draw_values(axes: Any, table: GrainMap, norm: Any, *, has_streamlines: bool = True) -> Any:
    """Draw grains, walls and vectors in colors of ``norm``; returns the collection of grains."""
    # Where a color is the background's own, an outline keeps the grain visible.
    look: dict[str, Any] = {"cmap": _colors(table), "norm": norm}
    if table.field.scale in ("centered", "logarithmic") or not np.isfinite(table.value).all():
        look |= {"edgecolors": "0.45", "linewidths": 0.2}
    discs = draw_discs(axes, table.scene, value=table.value, **look)
    discs.set_array(table.values_of_images())
    draw_walls(axes, table.scene)
    if table.vector is not None:
        (draw_streamlines if has_streamlines else _draw_arrows)(axes, table)
    return discs


def _colors(table: GrainMap) -> Any:
    """Color map; white is what has no value, and what is not positive on a logarithmic scale."""
    import matplotlib as mpl

    if table.names:
        from matplotlib.colors import ListedColormap

        return ListedColormap([COLORS[k % len(COLORS)] for k in range(len(table.names))])
    colors = mpl.colormaps[color_map(table.field.colors)].with_extremes(bad="white")
    is_logarithmic = table.field.scale == "logarithmic"
    return colors.with_extremes(under="white") if is_logarithmic else colors


def draw_bar(axes: Any, table: GrainMap, discs: Any, extend: str) -> None:
    """Draw the color bar of a map into axes beside or below it."""
    if len(table.names) == 1:  # nothing to tell apart
        axes.set_axis_off()
        axes.set_title(f"{table.field.label}:\n{table.names[0]}", loc="left", fontsize=8.0, y=0.5)
    elif table.names:
        direction = "horizontal" if is_wide(table.scene) else "vertical"
        bar = axes.figure.colorbar(discs, cax=axes, orientation=direction)
        bar.set_ticks(range(len(table.names)), labels=table.names)
        bar.ax.minorticks_off()
        bar.set_label(table.field.label)
    else:
        has_white = table.field.scale == "logarithmic" or not np.isfinite(table.value).all()
        note = "; white: none" if has_white else ""
        add_color_bar(axes, discs, table.scene, table.field, extend, note)


def add_color_bar(
    axes: Any, drawn: Any, scene: GrainScene, field: Quantity, extend: str, note: str = ""
) -> None:
    """A color bar with its label below a wide scene, or beside a tall one."""
    direction = "horizontal" if is_wide(scene) else "vertical"
    bar = axes.figure.colorbar(
        drawn, cax=axes, extend=extend, extendfrac=0.03, orientation=direction
    )
    ends = np.array([drawn.norm.vmin, drawn.norm.vmax])
    if not count_small_rises(bar.long_axis, field.label, field.symbol, field.unit, ends):
        text = axis_label(field.label, field.symbol, field.unit) + note
        high = axes.get_position().height * axes.figure.get_figheight()
        if direction == "vertical" and len(field.label + note) > high / _LETTER - _SYMBOL:
            text = text.replace(" $", "\n$", 1)  # in two lines
        bar.set_label(text)


def color_scale(table: GrainMap) -> tuple[Any, str]:
    """Norm of matplotlib, and which ends of the color bar stand for more than their value."""
    colors = library("matplotlib.colors")
    if count := len(table.names):
        return colors.BoundaryNorm([k - 0.5 for k in range(count + 1)], count), "neither"
    known = table.value[np.isfinite(table.value)]
    low, high = color_range(table.field, known, table.scene.radius.size)
    norm = colors.LogNorm if table.field.scale == "logarithmic" else colors.Normalize
    return norm(low, high), beyond(known, low, high) if known.size else "neither"


def _draw_arrows(axes: Any, table: GrainMap) -> None:
    """Arrows on grains, or on some; the few longest are cut, the colors tell how long they are."""
    scene, vector = table.scene, table.vector
    assert vector is not None
    step = max(1, -(-scene.radius.size // _ARROWS))
    # The numbering may go row by row: arrows in its order would line up with the grains.
    order = np.random.default_rng(0).permutation(scene.radius.size)[::step]
    spacing = float(np.sqrt(np.prod(scene.box[1] - scene.box[0]) / order.size))
    longest = float(np.quantile(table.value, _LONG)) or 1.0
    cut = np.minimum(1.0, longest / np.maximum(table.value, longest))
    arrows = (*scene.center[order].T, *(vector * cut[:, np.newaxis])[order].T)
    size = {"scale": longest / (_LENGTH * spacing), "width": 0.09 * spacing}
    kind = {"angles": "xy", "scale_units": "xy", "units": "xy", "pivot": "middle"}
    axes.quiver(*arrows, **size, **kind, color="white", edgecolor="0.1", linewidth=0.2, zorder=3)


def map_text(table: GrainMap, terminal: Terminal, *, has_streamlines: bool = True) -> str:
    """A map as a picture, with its range of values; raises `MissingLibrary` without matplotlib."""
    norm, _ = color_scale(table)
    values = ", ".join(table.names) if table.names else f"from {norm.vmin:.6g} to {norm.vmax:.6g}"

    def draw(axes: Any) -> None:
        draw_values(axes, table, norm, has_streamlines=has_streamlines)

    picture = draw_picture(table.scene, draw, terminal)
    unit = "" if table.names else f" [{unit_sign(table.field.unit)}]"
    return f"{picture}\n{table.field.label}{unit} {values}"


# ---- Runs and frames in a notebook: a map of their grains, where matplotlib is installed

_DPI = 150  # of a notebook


def picture(shown: Any) -> bytes | None:
    """A map of a frame, or of the last one of a run, as PNG; None without grains or matplotlib.

    Temperatures where there is heat, else speeds.

    Args:
        shown: `Run` or `Frame`.
    """
    run: Any = shown if hasattr(shown, "frames") else _Single(shown)
    has_grains = len(run.frames.time) and len(run.frames[-1].position)
    if not has_grains or find_spec("matplotlib") is None:
        return None
    table = grain_map(run, "temperature" if run.frames[-1].has_heat else "speed")
    with house_style():
        from matplotlib.figure import Figure

        figure, buffer = Figure(), io.BytesIO()
        draw_map(place_scene(figure, table.scene), table)
        figure.savefig(buffer, dpi=_DPI, format="png", bbox_inches="tight", pad_inches=0.05)
    return buffer.getvalue()


class _Single:
    """A frame as a run of one frame."""

    def __init__(self, frame: Any) -> None:
        self.model, self.frames = frame.model, self
        self.time, self.stage, self._frame = np.array([frame.time]), np.array([frame.stage]), frame

    def __getitem__(self, index: int) -> Any:
        return self._frame


FIGURES = {
    GrainMap: Renderer(
        lambda _: (COLUMN, COLUMN),
        lambda figure, table, **options: draw_map(
            place_scene(figure, table.scene), table, **options
        ),
        map_text,
    )
}
