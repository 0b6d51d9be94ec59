"""Between which heights a profile extends: the walls below and above the grains, or the grains themselves."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model import Model, ShapeKind
from multicor_cli.model.columns import RADIUS
from multicor_cli.model.model import Floats
from multicor_cli.model.shapes import outlines
from multicor_cli.post.source import FrameSource, GrainFrame, PostError, model_of, need_grains
from multicor_cli.text import choices

Between = tuple[str, str]
"""Names of a lower and an upper wall."""

_LEVEL = 0.7  # a plane bounds the grains in y if its normal points within 45 degrees up or down
_WIDE = 0.5  # a wall bounds a layer if it is at least this part as wide as nearly all grains
_FAR = 10.0  # a wall bounds the grains if it is at most so many times farther away than they reach
_TOUCHING = 1e-6  # relative gap of discs that touch, after the rounding of files
_STRAY = 0.1  # a wall still bounds the grains if no more than this part of them has got through it


@dataclass(frozen=True)
class Extent:
    """Where the heights of a profile are measured from, and how far they go.

    Heights count from the lower wall where there is one, wherever it has moved to: from the line through the centers of its
    glued grains (between the lowest and the highest of them), or from its surface if it is smooth: from the mean height of what
    faces the grains, such as the top of a polygon or the bottom of a tray. Otherwise they count from the
    lowest point that a grain reaches. A wall is below the grains if it lies below the middle of them and the centers of nine grains
    in ten lie above its line, in the first frame and in the last; and it must be wider than it is high, half as wide as the grains
    spread, and no farther from them than ten times their height: a gate that closed an opening, or has dropped away, bounds
    nothing. A solid disc is no such wall, nor with grains glued to it.

    Attributes:
        lower: Index of the wall below the grains, or None.
        upper: Index of the wall above the grains, or None.
        line: Height of each wall in its own frame, of the upper one as seen from below [m], shape ``(w,)``.
        floor: Lowest point of the grains over the frames [m]; used without a lower wall.
        height: Distance of the walls, averaged over the frames; where one is missing, how far the grains reach [m].
    """

    lower: int | None
    upper: int | None
    line: Floats
    floor: float
    height: float

    def origin(self, frame: GrainFrame) -> float:
        """Height y from which this frame is measured [m]."""
        if self.lower is None:
            return self.floor
        return float(self.line[self.lower] + frame.wall_position[self.lower, 1])

    def span(self, frame: GrainFrame) -> float:
        """Distance of the walls in this frame [m]; where one is missing, `height`."""
        if self.lower is None or self.upper is None:
            return self.height
        return float(self.line[self.upper] + frame.wall_position[self.upper, 1]) - self.origin(frame)


def find_extent(source: FrameSource, indices: NDArray[np.int64], between: Between | None = None) -> Extent:
    """The extent over the selected frames.

    Args:
        source: The run.
        indices: The frames.
        between: Names of the walls below and above the grains; default: those that bound them, see `Extent`.

    Raises:
        PostError: If no grain is there, or ``between`` names no two walls that lie one above the other.
    """
    model = source.model
    spans = wall_spans(model)
    levels = _levels(model, spans)
    ends = [source.frames[int(indices[k])] for k in (0, -1)]
    need_grains(source, indices)
    lower: int | None
    upper: int | None
    if between is not None:
        lower, upper = _named_walls(model.walls.names, between, ends, spans, levels)
    else:
        lower, upper = _bounding_walls(ends, spans, levels, _widths(model), model.mean_diameter)
    line = levels[0].copy()
    if upper is not None:
        line[upper] = levels[1, upper]
    floor, ceiling, gap = np.inf, -np.inf, 0.0
    for k in indices:
        frame = source.frames[int(k)]
        at = line + np.asarray(frame.wall_position)[:, 1]
        if lower is not None and upper is not None:
            gap += float(at[upper] - at[lower]) / len(indices)
            continue
        y, radius = np.asarray(frame.position)[:, 1], model_of(source, frame).grains.radius
        start = float(at[lower]) if lower is not None else 0.0
        floor = min(floor, float((y - radius).min()))
        ceiling = max(ceiling, (float(at[upper]) if upper is not None else float((y + radius).max())) - start)
    if lower is not None:
        floor = 0.0
    return Extent(lower, upper, line, floor, gap or ceiling - floor)


def _named_walls(
    names: tuple[str, ...], between: Between, frames: list[GrainFrame], spans: tuple[Floats, Floats], levels: Floats
) -> tuple[int, int]:
    for name in between:
        if name not in names:
            raise PostError(f"there is no wall '{name}'; {choices(name, names)}")
        if not np.isfinite(spans[0][names.index(name)]):
            raise PostError(f"the wall '{name}' is upright, or none that grains lie on: no height can be measured from it")
    lower, upper = (names.index(name) for name in between)
    for frame in frames:
        at = levels + np.asarray(frame.wall_position)[:, 1]
        if not at[0, lower] < at[1, upper]:
            raise PostError(f"the wall '{between[0]}' is not below '{between[1]}'")
    return lower, upper


def _bounding_walls(
    frames: list[GrainFrame], spans: tuple[Floats, Floats], levels: Floats, width: Floats, diameter: float
) -> tuple[int | None, int | None]:
    """The highest of the walls that are below the grains in all of some frames, and the lowest of those above them."""
    is_below, is_above = np.ones(width.size, np.bool_), np.ones(width.size, np.bool_)
    for frame in frames:
        first, last = np.quantile(np.asarray(frame.position)[:, 0], (_STRAY, 1.0 - _STRAY))
        is_wide = width >= _WIDE * (last - first)
        is_below, is_above = is_below & is_wide, is_above & is_wide
        low, middle, high = np.quantile(np.asarray(frame.position)[:, 1], (_STRAY, 0.5, 1.0 - _STRAY))
        wall_y = np.asarray(frame.wall_position)[:, 1]
        reach = high - low + diameter
        floor, lid = levels + wall_y
        is_below &= (spans[1] + wall_y < middle) & (floor <= low) & (floor >= low - _FAR * reach)
        is_above &= (spans[0] + wall_y > middle) & (lid >= high) & (lid <= high + _FAR * reach)
    wall_y = np.asarray(frames[0].wall_position)[:, 1]
    return _largest(spans[1] + wall_y, is_below), _largest(-(spans[0] + wall_y), is_above)


def _largest(values: Floats, candidate: NDArray[np.bool_]) -> int | None:
    """Index of the largest value among candidates; None without one."""
    values = np.where(candidate, values, -np.inf)
    return int(values.argmax()) if values.size and np.isfinite(values.max()) else None


def _levels(model: Model, spans: tuple[Floats, Floats]) -> Floats:
    """Height of each wall in its frame, as a floor and as a lid [m], shape ``(2, w)``.

    Of lines the mean over x, of polygons that of the sides that face up or down; of anything else the middle between its lowest
    and its highest reference point.
    """
    shapes, count = model.shapes, model.wall_count
    width, moment = np.zeros((2, count)), np.zeros((2, count))
    for which, outline in outlines(shapes.kind, shapes.geometry):
        run = outline.points[:, -1, 0] - outline.points[:, 0, 0]
        for k, sign in enumerate((-1.0, 1.0)):  # what is solid on its left faces up where it leads to the left
            across = np.maximum(sign * run, 0.0) if outline.is_solid else np.abs(run)
            width[k] += np.bincount(shapes.wall[which], across, count)
            moment[k] += np.bincount(shapes.wall[which], across * outline.points[:, :, 1].mean(axis=1), count)
    middle = 0.5 * np.where(np.isfinite(spans), spans, 0.0).sum(axis=0)
    return np.where(width > 0.0, moment / np.where(width > 0.0, width, 1.0), middle)


def _widths(model: Model) -> Floats:
    """Extent of each wall in x in its frame [m]; that of planes is infinite."""
    low, high = np.full(model.wall_count, np.inf), np.full(model.wall_count, -np.inf)
    shapes = model.shapes
    for which, outline in outlines(shapes.kind, shapes.geometry):
        ends = np.full((2, which.size), [[-np.inf], [np.inf]]) if outline.normal is not None else outline.corners()[:, :, 0]
        np.minimum.at(low, shapes.wall[which], ends[0])
        np.maximum.at(high, shapes.wall[which], ends[1])
    return np.asarray(high - low)


def wall_spans(model: Model) -> tuple[Floats, Floats]:
    """Lowest and highest reference point of each wall in its frame [m]; infinite where a wall is upright.

    Upright are planes more than 45° from the level, other walls that are higher than wide, and discs, smooth or rough.
    """
    low, high = np.full((model.wall_count, 2), np.inf), np.full((model.wall_count, 2), -np.inf)
    is_upright = np.zeros(model.wall_count, np.bool_)
    shapes = model.shapes
    for which, outline in outlines(shapes.kind, shapes.geometry):
        corners = (replace(outline, radius=None) if outline.is_grain else outline).corners()  # of glued grains the centers count
        np.minimum.at(low, shapes.wall[which], corners[0])
        np.maximum.at(high, shapes.wall[which], corners[1])
        if outline.normal is not None:
            np.logical_or.at(is_upright, shapes.wall[which], np.abs(outline.normal[:, 1]) < _LEVEL)
    # Walls without shapes keep their infinities: they bound no grains.
    size = np.where(np.isfinite(low), high, 0.0) - np.where(np.isfinite(low), low, 0.0)
    is_upright |= (size[:, 1] > size[:, 0]) | _are_round(model)
    return np.where(is_upright, -np.inf, low[:, 1]), np.where(is_upright, np.inf, high[:, 1])


def _are_round(model: Model) -> NDArray[np.bool_]:
    """Which walls are one disc, alone or with others glued around it."""
    shapes = model.shapes
    found = np.zeros(model.wall_count, np.bool_)
    for wall in np.unique(shapes.wall).tolist():
        own = shapes.wall == wall
        found[wall] = bool((shapes.kind[own] == ShapeKind.DISC).all()) and _surround_one(shapes.geometry[own])
    return found


def _surround_one(discs: Floats) -> bool:
    """Whether all discs but the largest touch it, and leave no half of its rim free: x, y and radius come first [m]."""
    largest = int(discs[:, RADIUS].argmax())
    others = np.delete(discs, largest, axis=0)
    if not len(others):
        return True
    way = others[:, :2] - discs[largest, :2]
    touch = np.hypot(*way.T) <= (1.0 + _TOUCHING) * (others[:, RADIUS] + discs[largest, RADIUS])
    bearing = np.sort(np.arctan2(way[:, 1], way[:, 0]))
    widest = np.diff(bearing, append=bearing[0] + 2.0 * np.pi).max()
    return bool(touch.all() and widest < (1.0 - _TOUCHING) * np.pi)
