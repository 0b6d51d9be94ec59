"""Between which heights a profile extends: the walls below and above the grains, or the grains themselves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from multicor_cli.post.source import FrameSource, GrainFrame
from multicor_cli.state import Model, ShapeKind
from multicor_cli.state.model import Floats

_LEVEL = 0.7  # a plane bounds the grains in y if its normal points within 45 degrees up or down


@dataclass(frozen=True)
class Extent:
    """Where the heights of a profile are measured from, and how far they go.

    Heights count from the lower wall where there is one, wherever it has moved to: from the line through the centers of its
    glued grains, or from its surface if it is smooth. Otherwise they count from the lowest point that a grain reaches.

    Attributes:
        lower: Index of the wall below the grains, or None.
        upper: Index of the wall above the grains, or None.
        line: Height of each wall in its own frame [m], shape ``(w,)``.
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


def find_extent(source: FrameSource, indices: NDArray[np.int64]) -> Extent:
    """The extent over the selected frames."""
    model = source.model
    radius = model.grains.radius
    lows, highs = wall_spans(model)
    first = source.frames[int(indices[0])]
    middle = float(np.median(first.position[:, 1]))
    wall_y = np.asarray(first.wall_position)[:, 1]
    lower = _nearest(highs + wall_y, below=middle)
    upper = _nearest(-(lows + wall_y), below=-middle)
    is_bounded = np.isfinite(lows) & np.isfinite(highs)
    line = 0.5 * (np.where(is_bounded, lows, 0.0) + np.where(is_bounded, highs, 0.0))
    floor, ceiling, gap = np.inf, -np.inf, 0.0
    for k in indices:
        frame = source.frames[int(k)]
        at = line + np.asarray(frame.wall_position)[:, 1]
        if lower is not None and upper is not None:
            gap += float(at[upper] - at[lower]) / len(indices)
            continue
        y = np.asarray(frame.position)[:, 1]
        start = float(at[lower]) if lower is not None else 0.0
        floor = min(floor, float((y - radius).min()))
        ceiling = max(ceiling, (float(at[upper]) if upper is not None else float((y + radius).max())) - start)
    if lower is not None:
        floor = 0.0
    return Extent(lower, upper, line, floor, gap or ceiling - floor)


def _nearest(reach: Floats, below: float) -> int | None:
    """The wall that reaches highest among those that end below a height."""
    candidates = np.where(reach < below, reach, -np.inf)
    if not candidates.size or not np.isfinite(candidates.max()):
        return None
    return int(candidates.argmax())


def wall_spans(model: Model) -> tuple[Floats, Floats]:
    """Lowest and highest reference point of each wall in its frame [m]; infinite where a wall goes on upwards or downwards."""
    low, high = np.full(model.wall_count, np.inf), np.full(model.wall_count, -np.inf)
    shapes = model.shapes
    for kind, wall, g in zip(shapes.kind, shapes.wall, shapes.geometry, strict=True):
        heights = [g[1]]
        if kind == ShapeKind.SEGMENT:
            heights.append(g[3])
        elif kind == ShapeKind.CIRCLE:
            heights = [g[1] - g[2], g[1] + g[2]]
        elif kind == ShapeKind.PLANE and abs(g[3]) < _LEVEL:
            heights = [-np.inf, np.inf]
        low[wall], high[wall] = min(low[wall], *heights), max(high[wall], *heights)
    return low, high
