"""Grains and walls of a frame drawn to scale."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from multicor_cli.model.model import Floats
from multicor_cli.model.shapes import Outline, Polygon
from multicor_cli.plots.style import COLUMN, PAGE
from multicor_cli.post.scene import GrainScene, images

WALL = "0.35"
"""Color of walls."""

SOLID = "0.7"
"""Color of glued grains and solid bodies."""

_MANY = 1500  # grains above which a figure takes the width of a page
_FEW = 600  # grains up to which each has an outline
_TALLEST, _NARROWEST = 8.0, 2.0  # height and width of a figure [inch]
_LEFT, _RIGHT, _BOTTOM, _TOP = 0.64, 0.15, 0.45, 0.12  # room beside the axes for their labels [inch]
_BAR, _BAR_GAP = 0.12, 0.1  # thickness of the color bar, and what lies between it and the axes [inch]
_BESIDE, _BELOW = 0.85, 0.62  # room for the color bar with its labels, beside or below the axes [inch]
_JOINED = 1e-9  # ends of sides that differ by less than this share of the coordinates are one corner
_TICK_X, _TICK_Y = 0.5, 0.3  # room that the label of a tick takes [inch]


class Place(NamedTuple):
    """Where a scene is drawn.

    Attributes:
        axes: Axes of matplotlib with the aspect of the scene.
        bar: Axes for the color bar; None without one.
    """

    axes: Any
    bar: Any


def place_scene(figure: Any, scene: GrainScene, *, has_bar: bool = True, top: float = _TOP, width: float = 0.0) -> Place:
    """Give a figure the size that a scene needs, and axes that fill it: nothing is left empty, no label is cut.

    Args:
        figure: The figure; whatever size it has.
        scene: The scene. A wide one has its color bar below it, a tall one beside it.
        has_bar: Whether there is a color bar.
        top: Room above the axes [inch].
        width: Width of the figure [inch]; 0: of a column, of a page if there are many grains. A tall scene takes less.
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


def draw_discs(axes: Any, scene: GrainScene, *, value: Floats | None = None, color: str = "none", **style: Any) -> Any:
    """Draw the grains: colored by ``value`` [shape ``(n,)``], or all in one color; returns the collection of matplotlib."""
    which, shift = images(scene.center[:, 0], scene.radius, scene.period)
    center = scene.center[which] + np.column_stack([shift, np.zeros_like(shift)])
    edge = {"edgecolors": "0.2", "linewidths": 0.3} if scene.radius.size <= _FEW else {"edgecolors": "none", "linewidths": 0.0}
    filling: dict[str, Any] = {"facecolors": color} if value is None else {"array": value[which]}
    return _add_discs(axes, center, scene.radius[which], **{**edge, **filling, **style})


def draw_walls(axes: Any, scene: GrainScene) -> None:
    """Draw walls and glued grains, and set limits, aspect and labels of the axes."""
    for outline in scene.walls:
        _draw_outline(axes, scene, outline)
    axes.set_xlim(*scene.box[:, 0])
    axes.set_ylim(*scene.box[:, 1])
    axes.set_aspect("equal")
    axes.tick_params(top=False, right=False, which="both", direction="out")
    axes.minorticks_off()
    axes.set_xlabel("$x$ [m]")
    axes.set_ylabel("$y$ [m]")


def _add_discs(axes: Any, center: Floats, radius: Floats, **style: Any) -> Any:
    from matplotlib.collections import EllipseCollection

    width = 2.0 * radius
    discs = EllipseCollection(
        width, width, np.zeros_like(width), units="xy", offsets=center, offset_transform=axes.transData, **style
    )
    axes.add_collection(discs)
    return discs


def _draw_outline(axes: Any, scene: GrainScene, outline: Outline) -> None:
    from matplotlib.collections import LineCollection, PolyCollection

    if outline.is_solid:
        axes.add_collection(PolyCollection(solid_polygons(outline.points), facecolors=SOLID, edgecolors="none", zorder=1.9))
    if outline.radius is None:
        lines = outline.points if outline.normal is None else _visible_part(outline.points[:, 0], outline.normal, scene.box)
        axes.add_collection(LineCollection(list(lines), colors=WALL, linewidths=1.0, zorder=2))
    elif outline.is_grain:
        center = outline.points[:, 0]
        which, shift = images(center[:, 0], outline.radius, scene.period)
        center = center[which] + np.column_stack([shift, np.zeros_like(shift)])
        _add_discs(axes, center, outline.radius[which], facecolors=SOLID, edgecolors=WALL, linewidths=0.3, zorder=2)
    else:
        _add_discs(axes, outline.points[:, 0], outline.radius, facecolors="none", edgecolors=WALL, linewidths=1.0, zorder=2)


def solid_polygons(sides: Floats) -> list[Floats]:
    """Corners of the polygons whose inside is solid, given the ends of sides that are solid on the left, shape ``(k, 2, 2)``.

    Each side begins where the one before ends, unless it begins another polygon.
    """
    jump = np.abs(sides[1:, 0] - sides[:-1, 1]).max(axis=1)
    first = np.flatnonzero(jump > _JOINED * np.abs(sides).max()) + 1
    polygons = np.split(sides[:, 0], first)
    return [corners for corners in polygons if Polygon(corners).signed_size > 0.0]


def _visible_part(point: Floats, normal: Floats, box: Floats) -> Floats:
    """Ends of what is to be seen of endless lines [m], shape ``(k, 2, 2)``."""
    along = np.column_stack([-normal[:, 1], normal[:, 0]]) * float(np.hypot(*(box[1] - box[0]))) * 2.0
    nearest = point + (((box.mean(axis=0) - point) * along).sum(axis=1) / (along**2).sum(axis=1))[:, np.newaxis] * along
    return np.stack([nearest - along, nearest + along], axis=1)
