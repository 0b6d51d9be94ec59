"""Grains and walls of a frame drawn to scale."""

from __future__ import annotations

from typing import Any

import numpy as np

from multicor_cli.plots.style import COLUMN, PAGE
from multicor_cli.post.scene import Scene, images
from multicor_cli.state.model import Floats

WALL = "0.35"
"""Color of walls."""

_MANY = 1500  # grains above which a figure takes the width of a page
_FEW = 600  # grains up to which each has an outline
_ASIDE = 0.75  # room for labels of the axes and the color bar [inch]
_TALLEST = 8.0  # height of a figure [inch]


def figure_size(scene: Scene, *, has_bar: bool = True) -> tuple[float, float]:
    """Width and height [inch] that fit the scene; the bar of a wide one lies below it, of a tall one beside it."""
    width = PAGE if scene.radius.size > _MANY else COLUMN
    across, upwards = (scene.box[1] - scene.box[0]).tolist()
    beside = _ASIDE if has_bar and not is_wide(scene) else 0.0
    below = _ASIDE if has_bar and is_wide(scene) else 0.0
    height = (width - 0.6 - beside) * upwards / across + 0.5 + below
    return width, float(np.clip(height, 0.5 * COLUMN, _TALLEST))


def fit_height(figure: Any, axes: Any) -> None:
    """Take away the height that axes of equal aspect leave empty."""
    for _ in range(2):
        figure.draw_without_rendering()
        offered, used = axes.get_position(original=True), axes.get_position()
        width, height = figure.get_size_inches()
        figure.set_size_inches(width, height * (1.0 - (offered.height - used.height)))


def is_wide(scene: Scene) -> bool:
    """Whether the scene is wider than high."""
    across, upwards = (scene.box[1] - scene.box[0]).tolist()
    return bool(across > 1.3 * upwards)


def draw_discs(axes: Any, scene: Scene, *, value: Floats | None = None, color: str = "none", **style: Any) -> Any:
    """Draw the grains: colored by ``value`` [shape ``(n,)``], or all in one color; returns the collection of matplotlib."""
    which, shift = images(scene.center[:, 0], scene.radius, scene.period)
    center = scene.center[which] + np.column_stack([shift, np.zeros_like(shift)])
    edge = {"edgecolors": "0.2", "linewidths": 0.3} if scene.radius.size <= _FEW else {"edgecolors": "none", "linewidths": 0.0}
    filling: dict[str, Any] = {"facecolors": color} if value is None else {"array": value[which]}
    return _add_discs(axes, center, scene.radius[which], **{**edge, **filling, **style})


def draw_walls(axes: Any, scene: Scene) -> None:
    """Draw walls and glued grains, and set limits, aspect and labels of the axes."""
    from matplotlib.collections import LineCollection

    which, shift = images(scene.glued[:, 0], scene.glued[:, 2], scene.period)
    center = scene.glued[which, :2] + np.column_stack([shift, np.zeros_like(shift)])
    _add_discs(axes, center, scene.glued[which, 2], facecolors="0.7", edgecolors=WALL, linewidths=0.3, zorder=2)
    axes.add_collection(LineCollection(list(_lines(scene)), colors=WALL, linewidths=1.0, zorder=2))
    _add_discs(axes, scene.circles[:, :2], scene.circles[:, 2], facecolors="none", edgecolors=WALL, linewidths=1.0, zorder=2)
    axes.set_xlim(*scene.box[:, 0])
    axes.set_ylim(*scene.box[:, 1])
    axes.set_aspect("equal")
    axes.tick_params(top=False, right=False, which="both", direction="out")
    axes.minorticks_off()
    axes.locator_params(nbins=5)
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


def _lines(scene: Scene) -> Floats:
    """Straight walls and the visible part of endless ones, shape ``(k, 2, 2)``."""
    point, normal = scene.planes[:, :2], scene.planes[:, 2:]
    along = np.column_stack([-normal[:, 1], normal[:, 0]]) * float(np.hypot(*(scene.box[1] - scene.box[0]))) * 2.0
    nearest = point + (((scene.box.mean(axis=0) - point) * along).sum(axis=1) / (along**2).sum(axis=1))[:, np.newaxis] * along
    return np.concatenate([scene.segments, np.stack([nearest - along, nearest + along], axis=1)])
