"""Horizontal bins between the walls: where they lie, and what share of a grain is in each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model import Model, ShapeKind
from multicor_cli.model.columns import RADIUS, YY
from multicor_cli.model.model import Floats
from multicor_cli.model.shapes import outlines
from multicor_cli.post.rings import Cut, reach_of
from multicor_cli.post.source import (
    BIN_LIMIT,
    Frame,
    PostError,
    Run,
    bin_count,
    frames_of,
    need_grains,
)
from multicor_cli.text import choices

# ---- Sharing grains and lines out among horizontal bins by exact area and length


class Shares(NamedTuple):
    """Overlaps ``(k,)``: indices of grain (or line) and bin, area inside [m²] (or part of line).

    In a cell ``turn`` is by how many heights the bin lies below the image that is in it.
    """

    grain: NDArray[np.int64]
    bin: NDArray[np.int64]
    area: Floats
    turn: NDArray[np.int64]


def share_grains(
    y: Floats, cut: Cut, bottom: float, width: float, count: int, *, is_around: bool = False
) -> Shares:
    """Share grains at heights y [m] out among ``count`` equal bins above ``bottom`` [m].

    The rest is left out, or goes on at the other end if ``is_around``.
    """
    first = np.floor((y + cut.low - bottom) / width).astype(np.int64)
    last = np.floor((y + cut.high - bottom) / width).astype(np.int64)

    def area(grain: NDArray[np.int64], bin_: NDArray[np.int64]) -> Floats:
        edge = bottom + bin_ * width - y[grain]
        return np.maximum(cut.below(grain, edge + width) - cut.below(grain, edge), 0.0)

    return _share(first, last, count, area, is_around=is_around)


def _share(
    first: NDArray[np.int64],
    last: NDArray[np.int64],
    count: int,
    part: Callable[[NDArray[np.int64], NDArray[np.int64]], Floats],
    *,
    is_around: bool,
) -> Shares:
    """Shares of what lies in bins ``first`` to ``last``; ``part`` gives the areas of overlaps."""
    none = np.zeros(0, np.int64)
    pieces = [Shares(none, none, np.zeros(0), none)]
    for step in range(int((last - first).max(initial=-1)) + 1):
        is_inside = (first + step >= 0) & (first + step < count)
        which = np.flatnonzero((first + step <= last) & (is_inside | is_around))
        bin_ = first[which] + step
        turn, place = np.divmod(bin_, count)
        pieces.append(Shares(which, place, part(which, bin_), turn))
    return Shares(*(np.concatenate(column) for column in zip(*pieces, strict=True)))


def share_lines(
    start: Floats, end: Floats, bottom: float, width: float, count: int, *, is_around: bool = False
) -> Shares:
    """Share straight lines out among bins by the heights of their ends [m]; see `share_grains`.

    ``area`` is the part of a line's length that lies in the bin [1]. A level line lies in one bin.
    """
    low, high = (np.minimum(start, end) - bottom) / width, (np.maximum(start, end) - bottom) / width
    first, last = np.floor(low).astype(np.int64), np.floor(high).astype(np.int64)

    def part(line: NDArray[np.int64], bin_: NDArray[np.int64]) -> Floats:
        length = np.minimum(high[line], bin_ + 1.0) - np.maximum(low[line], bin_)
        rise = high[line] - low[line]
        return np.where(rise > 0.0, length / np.where(rise > 0.0, rise, 1.0), 1.0)

    return _share(first, last, count, part, is_around=is_around)


def part_between(start: Floats, end: Floats, low: float, high: float) -> Floats:
    """Part of straight lines between two heights, 0 … 1, ``(n,)``; level lines lie there or not."""
    bottom, top = np.minimum(start, end), np.maximum(start, end)
    rise = top - bottom
    part = (np.minimum(top, high) - np.maximum(bottom, low)) / np.where(rise > 0.0, rise, 1.0)
    level = ((bottom >= low) & (bottom < high)).astype(np.float64)
    return np.asarray(np.where(rise > 0.0, np.maximum(part, 0.0), level))


# ---- Between which heights a profile extends: walls that bound the grains, or the grains

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

    Heights count from the lower wall, wherever it has moved to: from the line through the centers
    of its glued grains (between the lowest and the highest of them), or from the mean height of
    what faces the grains of a smooth one, such as the top of a polygon or the bottom of a tray;
    without a lower wall, from the lowest point that a grain reaches. A wall is below the grains if
    it lies below their middle and nine in ten of their centers lie above its line, in the first
    frame and the last. It must be wider than high, half as wide as the grains spread, and no
    farther from them than ten times their height: a gate that closed an opening, or dropped away,
    bounds nothing, nor does a solid disc, bare or rough.

    Attributes:
        lower: Index of the wall below the grains, or None.
        upper: Index of the wall above the grains, or None.
        line: Height of walls in their frames, of the upper one seen from below [m], shape ``(w,)``.
        floor: Lowest point of the grains over the frames [m]; used without a lower wall.
        height: Mean distance of the walls [m]; where one is missing, how far the grains reach.
        is_cell: Whether the heights are those of a cell, from its lower side, and go around.
    """

    lower: int | None
    upper: int | None
    line: Floats
    floor: float
    height: float
    is_cell: bool = False

    def origin(self, frame: Frame) -> float:
        """Height y from which this frame is measured [m]."""
        if self.lower is None:
            return self.floor
        return float(self.line[self.lower] + frame.wall_position[self.lower, 1])

    def span(self, frame: Frame) -> float:
        """Distance of the walls, or sides, in this frame [m]; where one is missing, `height`."""
        if self.is_cell:
            return float(frame.wall_position[0, YY])
        if self.lower is None or self.upper is None:
            return self.height
        top = float(self.line[self.upper] + frame.wall_position[self.upper, 1])
        return top - self.origin(frame)


def find_extent(source: Run, indices: NDArray[np.int64], between: Between | None = None) -> Extent:
    """The extent over frames, between the walls named or else those that bound the grains.

    Raises:
        PostError: If no grain is there, or ``between`` names no two walls one above the other.
    """
    model = source.model
    if model.is_cell:
        if between is not None:
            raise PostError("a cell that is periodic in x and y has no walls: leave out --between")
        mean = np.mean([frame.wall_position[0, YY] for frame in frames_of(source, indices)])
        return Extent(None, None, np.zeros(1), 0.0, float(mean), is_cell=True)
    spans = wall_spans(model)
    levels = _levels(model, spans)
    ends = list(frames_of(source, indices[[0, -1]]))
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
    for frame in frames_of(source, indices):
        at = line + np.asarray(frame.wall_position)[:, 1]
        if lower is not None and upper is not None:
            gap += float(at[upper] - at[lower]) / len(indices)
            continue
        y, (down, up) = np.asarray(frame.position)[:, 1], reach_of(frame.model, frame)
        floor = min(floor, float((y + down[:, 1]).min()))
        top = float(at[upper]) if upper is not None else float((y + up[:, 1]).max())
        ceiling = max(ceiling, top - (float(at[lower]) if lower is not None else 0.0))
    if lower is not None:
        floor = 0.0
    return Extent(lower, upper, line, floor, gap or ceiling - floor)


def _named_walls(
    names: tuple[str, ...],
    between: Between,
    frames: list[Frame],
    spans: tuple[Floats, Floats],
    levels: Floats,
) -> tuple[int, int]:
    for name in between:
        if name not in names:
            raise PostError(f"there is no wall '{name}'; {choices(name, names)}")
        if not np.isfinite(spans[0][names.index(name)]):
            raise PostError(
                f"the wall '{name}' is upright, or none that grains lie on: no height can be "
                "measured from it"
            )
    lower, upper = (names.index(name) for name in between)
    for frame in frames:
        at = levels + np.asarray(frame.wall_position)[:, 1]
        if not at[0, lower] < at[1, upper]:
            raise PostError(
                f"the wall '{between[0]}' is not below '{between[1]}' (or left of it, where they "
                "stand upright): name them the other way"
            )
    return lower, upper


def _bounding_walls(
    frames: list[Frame],
    spans: tuple[Floats, Floats],
    levels: Floats,
    width: Floats,
    diameter: float,
) -> tuple[int | None, int | None]:
    """The highest wall below the grains in all of some frames, and the lowest above them."""
    is_below, is_above = np.ones(width.size, np.bool_), np.ones(width.size, np.bool_)
    for frame in frames:
        x, y = np.asarray(frame.position)[:, :2].T
        first, last = np.quantile(x, (_STRAY, 1.0 - _STRAY))
        is_wide = width >= _WIDE * (last - first)
        is_below, is_above = is_below & is_wide, is_above & is_wide
        low, middle, high = np.quantile(y, (_STRAY, 0.5, 1.0 - _STRAY))
        wall_y = np.asarray(frame.wall_position)[:, 1]
        reach, (floor, lid) = high - low + diameter, levels + wall_y
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

    Of lines the mean over x, of polygons that of the sides that face up or down; of anything else
    the middle between its lowest and its highest reference point.
    """
    shapes, count = model.shapes, model.wall_count
    width, moment = np.zeros((2, count)), np.zeros((2, count))
    for which, outline in outlines(shapes.kind, shapes.geometry):
        run = outline.points[:, -1, 0] - outline.points[:, 0, 0]
        # What is solid on its left faces up where it leads to the left
        for k, sign in enumerate((-1.0, 1.0)):
            across = np.maximum(sign * run, 0.0) if outline.is_solid else np.abs(run)
            width[k] += np.bincount(shapes.wall[which], across, count)
            moment[k] += np.bincount(
                shapes.wall[which], across * outline.points[:, :, 1].mean(axis=1), count
            )
    middle = 0.5 * np.where(np.isfinite(spans), spans, 0.0).sum(axis=0)
    return np.where(width > 0.0, moment / np.where(width > 0.0, width, 1.0), middle)


def _widths(model: Model) -> Floats:
    """Extent of each wall in x in its frame [m]; that of planes is infinite."""
    low, high = np.full(model.wall_count, np.inf), np.full(model.wall_count, -np.inf)
    shapes = model.shapes
    for which, outline in outlines(shapes.kind, shapes.geometry):
        ends = outline.corners()[:, :, 0]
        if outline.normal is not None:  # endless
            ends = np.full((2, which.size), [[-np.inf], [np.inf]])
        np.minimum.at(low, shapes.wall[which], ends[0])
        np.maximum.at(high, shapes.wall[which], ends[1])
    return np.asarray(high - low)


def wall_spans(model: Model) -> tuple[Floats, Floats]:
    """Lowest and highest reference point of each wall in its frame [m]; infinite if it is upright.

    Upright are planes over 45° from the level, walls higher than wide, discs, smooth or rough.
    """
    low, high = np.full((model.wall_count, 2), np.inf), np.full((model.wall_count, 2), -np.inf)
    is_upright = np.zeros(model.wall_count, np.bool_)
    shapes = model.shapes
    for which, outline in outlines(shapes.kind, shapes.geometry):
        # of glued grains the centers count
        corners = (replace(outline, radius=None) if outline.is_grain else outline).corners()
        np.minimum.at(low, shapes.wall[which], corners[0])
        np.maximum.at(high, shapes.wall[which], corners[1])
        if outline.normal is not None:
            np.logical_or.at(is_upright, shapes.wall[which], np.abs(outline.normal[:, 1]) < _LEVEL)
    # Walls without shapes keep their infinities: they bound no grains.
    size = np.where(np.isfinite(low), high, 0.0) - np.where(np.isfinite(low), low, 0.0)
    is_upright |= (size[:, 1] > size[:, 0]) | _are_round(model)
    return np.where(is_upright, -np.inf, low[:, 1]), np.where(is_upright, np.inf, high[:, 1])


def _are_round(model: Model) -> NDArray[np.bool_]:
    """Which walls are one disc, alone or with others that touch it and leave no half rim free."""
    shapes, found = model.shapes, np.zeros(model.wall_count, np.bool_)
    for wall in np.unique(shapes.wall).tolist():
        own = shapes.wall == wall
        discs = shapes.geometry[own]
        largest = int(discs[:, RADIUS].argmax())
        others = np.delete(discs, largest, axis=0)
        found[wall] = (shapes.kind[own] == ShapeKind.DISC).all()
        if found[wall] and len(others):
            way = others[:, :2] - discs[largest, :2]
            reach = others[:, RADIUS] + discs[largest, RADIUS]
            touch = np.hypot(*way.T) <= (1.0 + _TOUCHING) * reach
            bearing = np.sort(np.arctan2(way[:, 1], way[:, 0]))
            widest = np.diff(bearing, append=bearing[0] + 2.0 * np.pi).max()
            found[wall] = touch.all() and widest < (1.0 - _TOUCHING) * np.pi
    return found


# ---- Bins, frame by frame

WALL_LAYER = 1.0
"""Mean diameters at a wall that profiles leave out by default: walls order the grains there."""

_NEAR = 0.125
"""Share of the distance of the walls: no more is left out at each unless told otherwise."""
_NOTHING = 1e-9  # of the distance of the walls: a height below that is zero but for rounding


class BinPlace(NamedTuple):
    """Where the bins are in a frame: lower edge of the first, and width of each [m]."""

    bottom: float
    width: float


@dataclass(frozen=True)
class Bins:
    """Horizontal bins of equal width.

    They stretch with the distance of two walls, so that they end at the walls in every frame; what
    is left out at the walls keeps its width.

    Attributes:
        extent: Where heights are measured from.
        width: Width of a bin, averaged over the frames [m].
        count: Number of bins b.
        bottom: Lower edge of the first bin above the origin [m].
        left_out: What is left out at each wall [m].
    """

    extent: Extent
    width: float
    count: int
    bottom: float = 0.0
    left_out: float = 0.0

    @property
    def centers(self) -> Floats:
        """Centers above the origin, averaged over the frames [m], shape ``(b,)``."""
        return np.asarray(self.bottom + (np.arange(self.count) + 0.5) * self.width)

    def place(self, frame: Frame) -> BinPlace:
        """Where the bins are in a frame; raises `PostError` if the walls come too near."""
        width = self.width + (self.extent.span(frame) - self.extent.height) / self.count
        if not width * self.count > _NOTHING * self.extent.height:
            raise PostError(
                "nothing is left between the walls where they come nearest, "
                f"{self.extent.span(frame):.4g} m: leave out less at the walls, or choose other "
                "frames"
            )
        return BinPlace(self.extent.origin(frame) + self.bottom, width)

    def share(self, y: Floats, cut: Cut, place: BinPlace) -> Shares:
        """Which grain lies in which bin with which area."""
        return share_grains(y, cut, *place, self.count, is_around=self.extent.is_cell)

    def total(self, shares: Shares, values: Floats) -> Floats:
        """Sum of values of the shares in each bin, shape ``(b,)``."""
        if np.iscomplexobj(values):
            return self.total(shares, values.real) + 1j * self.total(shares, values.imag)
        return np.asarray(np.bincount(shares.bin, weights=values, minlength=self.count), np.float64)


def make_bins(
    source: Run,
    chosen: NDArray[np.int64],
    bins: int | None = None,
    *,
    bin_width: float | None = None,
    exclude_walls: float | None = 0.0,
    between: Between | None = None,
) -> Bins:
    """Bins over the extent of frames: so many, or about ``bin_width`` mean diameters wide.

    If ``exclude_walls`` is None, `WALL_LAYER` is left out at walls, or less if they are near.

    Raises:
        PostError: If both number and width are given, they are too few or many, no room is left, or
            ``between`` is no such walls.
    """
    if bins is not None and bin_width is not None:
        raise PostError("the number of bins and their width exclude each other")
    extent = find_extent(source, chosen, between)
    diameter = source.model.mean_diameter
    if exclude_walls is None:
        edge = min(WALL_LAYER * diameter, _NEAR * extent.height)
    elif exclude_walls >= 0.0:
        edge = exclude_walls * diameter
    else:
        raise PostError(
            f"{exclude_walls:g} mean diameters cannot be left out at the walls: choose 0 or more"
        )
    bottom = edge if extent.lower is not None else 0.0
    height = extent.height - bottom - (edge if extent.upper is not None else 0.0)
    if not height > _NOTHING * extent.height:
        raise PostError(
            f"nothing is left between the walls: they are {extent.height / diameter:.3g} mean "
            f"diameters apart and {edge / diameter:g} are to be left out at each"
        )
    least = height / diameter / BIN_LIMIT
    if bin_width is not None and not bin_width >= least:
        raise PostError(
            f"bins cannot be {bin_width:g} mean diameters wide: choose at least {least:.2g}"
        )
    wide = (bin_width or 1.0) * diameter
    if bins is None:
        bins = max(round(min(height / wide, 2.0 * BIN_LIMIT)), 1)
    count = bin_count(bins)
    return Bins(extent, height / count, count, bottom, edge)


def heights(frame: Frame) -> Floats:
    """Heights y of the grains [m], shape ``(n,)``."""
    return np.asarray(frame.position, np.float64)[:, 1]
