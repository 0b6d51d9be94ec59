"""Where the walls of a frame are."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model import Model
from multicor_cli.model.model import Floats
from multicor_cli.model.shapes import Outline, outlines


def placed_walls(
    model: Model, pose: Floats, is_asked: NDArray[np.bool_] | None = None
) -> Iterator[tuple[NDArray[np.int64], Outline]]:
    """Which shapes of the walls asked for, with outlines at ``pose`` [m, rad], kind by kind."""
    shapes, asked = model.shapes, np.arange(model.shape_count)
    if is_asked is not None:
        asked = np.flatnonzero(is_asked[shapes.wall])
    for which, outline in outlines(shapes.kind[asked], shapes.geometry[asked]):
        own = pose[shapes.wall[asked[which]]]
        points = _turned(outline.points, own[:, np.newaxis, 2]) + own[:, np.newaxis, :2]
        normal = None if outline.normal is None else _turned(outline.normal, own[:, 2])
        yield asked[which], replace(outline, points=points, normal=normal)


def _turned(vectors: Floats, angle: Floats) -> Floats:
    c, s = np.cos(angle), np.sin(angle)
    x, y = vectors[..., 0], vectors[..., 1]
    return np.stack([c * x - s * y, s * x + c * y], axis=-1)
