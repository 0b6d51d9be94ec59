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
    TITLE,
    Renderer,
    Terminal,
    axis_label,
    beyond,
    color_map,
    count_small_rises,
    draw_picture,
    house_style,
    name_frame,
)
from multicor_cli.plots.vectors import KEY, draw_arrows, draw_streamlines
from multicor_cli.post.grain_map import GrainMap, GrainScene, grain_map
from multicor_cli.post.lattice import Lattice
from multicor_cli.post.quantities import color_range
from multicor_cli.post.rings import Rings
from multicor_cli.post.table import Quantity
from multicor_cli.text import unit_sign

# ---- Grains and walls of a frame drawn to scale

WALL = "0.35"
"""Color of walls."""

SOLID = "0.7"
"""Color of glued grains and solid bodies."""

_MANY = 1500  # grains above which a figure takes the width of a page
_FEW = 600  # grains up to which each has an outline
_FLUSH = 0.1  # width of outlines of more grains that may lie side on side without a gap [points]
_TALLEST, _NARROWEST = 8.0, 2.0  # height and width of a figure [inch]
# Room beside the axes for their labels, above them for the time [inch]
_LEFT, _RIGHT, _BOTTOM = 0.64, 0.15, 0.45
# Thickness of the color bar, and what lies between it and the axes [inch]
_BAR, _BAR_GAP = 0.12, 0.1
# Room for the color bar with its labels, beside or below the axes [inch]
_BESIDE, _BELOW = 0.85, 0.62
# Ends of sides that differ by less than this share of the coordinates are one corner
_JOINED = 1e-9
_TICK_X, _TICK_Y = 0.5, 0.3  # room that the label of a tick takes [inch]
_ROWS = 3  # of a legend in letters of the usual size in the room for a bar
_SWATCH = 0.35  # room for a color of a legend and what lies around it [inch]
_LETTER, _SYMBOL = 0.062, 8  # width of a letter [inch]; letters that a symbol and its unit take


class Place(NamedTuple):
    """Axes of matplotlib with the aspect of a scene, and for its color bar, None without one."""

    axes: Any
    bar: Any


def place_scene(
    figure: Any, scene: GrainScene, *, has_bar: bool = True, top: float = TITLE, width: float = 0.0
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


def draw_grains(
    axes: Any, scene: GrainScene, *, value: Floats | None = None, color: str = "none", **style: Any
) -> Any:
    """Draw the grains, colored by ``value`` or in one color; returns matplotlib's collection."""
    width = 0.3 if scene.radius.size <= _FEW else 0.0 if scene.rings is None else _FLUSH
    edge: dict[str, Any] = {"edgecolors": "0.2" if width else "none", "linewidths": width}
    filling = {"facecolors": color} if value is None else {"array": value}
    look = {**edge, **filling, **style}
    if scene.rings is None:
        drawn = _add_discs(axes, scene.center, scene.radius, scene.lattice, **look)
    else:
        drawn = _add_rings(axes, scene, scene.rings, **look)
    clip_to_cell(axes, scene, drawn)
    return drawn


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


def _add_rings(axes: Any, scene: GrainScene, rings: Rings, **style: Any) -> Any:
    """Grains of any shape and their images, each with a value if ``array`` gives some."""
    from matplotlib.collections import PathCollection
    from matplotlib.path import Path

    which, shift = scene.lattice.images(scene.center, scene.radius)
    if "array" in style:
        style["array"] = style["array"][which]
    shown = rings.of_grains(which).placed(shift, np.zeros(which.size))
    parts: list[list[Any]] = [[] for _ in which]
    for grain, ring in zip(shown.grain.tolist(), shown, strict=True):
        parts[grain].append(Path(np.concatenate([ring, ring[:1]]), closed=True))
    paths = [Path.make_compound_path(*part) if len(part) > 1 else part[0] for part in parts]
    drawn = PathCollection(paths, **style)
    axes.add_collection(drawn)
    return drawn


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


# ---- Map of a quantity: every grain to scale, colored

Ends = tuple[float, float]


def draw_map(
    place: Place, table: GrainMap, *, has_streamlines: bool = True, ends: Ends | None = None
) -> None:
    """Draw a map with its time and color bar where `place_scene` has made room; vectors as
    streamlines of their local mean, or else as arrows. Colors span the ``ends``, if given.
    """
    norm, extend = color_scale(table, ends)
    discs = draw_values(place.axes, table, norm, has_streamlines=has_streamlines)
    draw_bar(place.bar, table, discs, extend, count_beyond(table, norm))
    name_frame(place.axes, table.time, table.frame)


def draw_values(axes: Any, table: GrainMap, norm: Any, *, has_streamlines: bool = True) -> Any:
    """Draw grains, walls and vectors in colors of ``norm``; returns the collection of grains."""
    # Where a color is the background's own, an outline keeps the grain visible.
    look: dict[str, Any] = {"cmap": _colors(table), "norm": norm}
    is_pale = table.field.scale in ("centered", "logarithmic", "half turn")
    if is_pale or not np.isfinite(table.value).all():
        look |= {"edgecolors": "0.45", "linewidths": 0.2}
    discs = draw_grains(axes, table.scene, value=table.value, **look)
    discs.set_array(table.values_of_images())
    draw_walls(axes, table.scene)
    if table.vector is not None:
        (draw_streamlines if has_streamlines else draw_arrows)(axes, table)
    return discs


def _colors(table: GrainMap) -> Any:
    """Color map; white is what has no value, and what is not positive on a logarithmic scale."""
    import matplotlib as mpl

    if table.names:
        from matplotlib.colors import ListedColormap

        count = len(table.names)
        if count <= len(COLORS):
            return ListedColormap(COLORS[:count])
        return mpl.colormaps["turbo"].resampled(count)
    colors = mpl.colormaps[color_map(table.field.colors)].with_extremes(bad="white")
    is_logarithmic = table.field.scale == "logarithmic"
    return colors.with_extremes(under="white") if is_logarithmic else colors


def count_beyond(table: GrainMap, norm: Any) -> str:
    """How many grains have values beyond the ends of the colors; empty if none has."""
    if table.names:
        return ""
    low, high = int((table.value < norm.vmin).sum()), int((table.value > norm.vmax).sum())
    told = [f"{count} {side}" for count, side in ((low, "below"), (high, "above")) if count]
    if not told:
        return ""
    white = "white: " if low and table.field.scale == "logarithmic" else ""
    return white + ", ".join(told).replace(" ", " grain " if low == 1 else " grains ", 1)


def draw_bar(axes: Any, table: GrainMap, discs: Any, extend: str, note: str = "") -> None:
    """Draw the color bar of a map into axes beside or below it, with a note behind its label."""
    if len(table.names) == 1:  # nothing to tell apart
        axes.set_axis_off()
        axes.set_title(f"{table.field.label}:\n{table.names[0]}", loc="left", fontsize=8.0, y=0.5)
    elif table.names:
        room = axes.get_position().width * axes.figure.get_figwidth() / len(table.names)
        if is_wide(table.scene) and _LETTER * max(map(len, table.names)) > room:
            _draw_names(axes, table, discs)
            return
        direction = "horizontal" if is_wide(table.scene) else "vertical"
        bar = axes.figure.colorbar(discs, cax=axes, orientation=direction)
        bar.set_ticks(range(len(table.names)), labels=table.names)
        bar.ax.minorticks_off()
        bar.set_label(table.field.label)
    else:
        if table.field.scale == "logarithmic" or not np.isfinite(table.value).all():
            note = note or "white: none"
        add_color_bar(axes, discs, table.scene, table.field, extend, note)


def _draw_names(axes: Any, table: GrainMap, discs: Any) -> None:
    """A legend at the place of a bar, where names would lie over each other below it."""
    from matplotlib.patches import Patch

    axes.set_axis_off()
    count, wide = len(table.names), _LETTER * max(map(len, table.names)) + _SWATCH
    columns = max(1, int(axes.figure.get_figwidth() / wide))
    handles = [Patch(color=discs.cmap(k)) for k in range(count)]
    axes.legend(
        handles, table.names, loc="upper center", bbox_to_anchor=(0.5, 1.0), borderaxespad=0.0,
        ncols=columns, columnspacing=1.0, handlelength=1.0, handletextpad=0.5, labelspacing=0.3,
        fontsize=7.0 * min(1.0, _ROWS / -(-count // columns)),
    )  # fmt: skip


def add_color_bar(
    axes: Any, drawn: Any, scene: GrainScene, field: Quantity, extend: str, note: str = ""
) -> None:
    """A color bar with its label, and a note behind it, below a wide scene or beside a tall one."""
    from matplotlib.colors import LogNorm
    from matplotlib.ticker import MaxNLocator

    direction = "horizontal" if is_wide(scene) else "vertical"
    bar = axes.figure.colorbar(
        drawn, cax=axes, extend=extend, extendfrac=0.03, orientation=direction
    )
    if direction == "horizontal" and not isinstance(drawn.norm, LogNorm):
        bar.locator = MaxNLocator(5)  # long labels lie side by side
    ends = np.array([drawn.norm.vmin, drawn.norm.vmax])
    if not count_small_rises(bar.long_axis, field.label, field.symbol, field.unit, ends):
        bar.set_label(axis_label(field.label, field.symbol, field.unit))
    label, note = bar.long_axis.label, f"; {note}" if note else ""
    text, place = label.get_text(), axes.get_position()
    room = place.width * axes.figure.get_figwidth() + _RIGHT
    if direction == "vertical":
        room = place.height * axes.figure.get_figheight()
        if len(field.label + note) > room / _LETTER - _SYMBOL:
            text = text.replace(" $", "\n$", 1)  # in two lines
    longest = max((text + note).split("\n"), key=len)
    if len(longest) > room / _LETTER:
        label.set_fontsize(7.0)
    label.set_text(text + note)


def color_scale(table: GrainMap, ends: Ends | None = None) -> tuple[Any, str]:
    """Norm of matplotlib, and which ends of the color bar stand for more than their value.

    ``ends`` are the smallest and largest value with a color of its own, of what is no name, and
    positive on a logarithmic scale; default: see `color_range`.
    """
    colors, is_logarithmic = library("matplotlib.colors"), table.field.scale == "logarithmic"
    if count := len(table.names):
        return colors.BoundaryNorm([k - 0.5 for k in range(count + 1)], count), "neither"
    known = table.value[np.isfinite(table.value)]
    low, high = ends or color_range(table.field, known, table.scene.radius.size)
    norm = colors.LogNorm if is_logarithmic else colors.Normalize
    return norm(low, high), beyond(known, low, high) if known.size else "neither"


def map_text(
    table: GrainMap, terminal: Terminal, *, has_streamlines: bool = True, ends: Ends | None = None
) -> str:
    """A map as a picture, with its range of values; raises `MissingLibrary` without matplotlib."""
    norm, _ = color_scale(table, ends)
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
    if run is not shown:
        table = table.with_(frame=getattr(shown, "index", None))
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


def _draw_placed(
    figure: Any, table: GrainMap, *, has_streamlines: bool = True, ends: Ends | None = None
) -> None:
    has_arrows = table.vector is not None and not has_streamlines
    place = place_scene(figure, table.scene, top=TITLE + (KEY if has_arrows else 0.0))
    draw_map(place, table, has_streamlines=has_streamlines, ends=ends)


FIGURES = {GrainMap: Renderer((COLUMN, COLUMN), _draw_placed, map_text)}
