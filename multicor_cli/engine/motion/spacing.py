"""Distance of two walls along an axis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from multicor_cli.model.columns import Y
from multicor_cli.model.model import Floats, Model
from multicor_cli.model.shapes import TAIL, ShapeKind, Tail
from multicor_cli.model.state import State


@dataclass(frozen=True)
class Spacing:
    """The distance of two walls along an axis, positive if the second lies further along it.

    ``distance`` is what the places of their shapes add to the distance of their frames [m].
    """

    lower: int
    upper: int
    axis: int
    distance: float

    @classmethod
    def between(cls, model: Model, lower: str, upper: str, axis: int = Y) -> Spacing:
        """The spacing of two named walls; raises `ValueError` for an unknown one, or the same."""
        for name in (lower, upper):
            if name not in model.walls.names:
                message = f"there is no wall '{name}'"
                raise ValueError(message)
        if lower == upper:
            message = f"there is no strain between '{lower}' and itself"
            raise ValueError(message)
        first, second = model.walls.names.index(lower), model.walls.names.index(upper)
        places = wall_places(model, axis)
        return cls(first, second, axis, float(places[second] - places[first]))

    def of(self, state: State) -> float:
        return self.distance + float(
            state.wall_position[self.upper, self.axis] - state.wall_position[self.lower, self.axis]
        )


def wall_places(model: Model, axis: int) -> Floats:
    """Mean place of the shapes of each wall in its frame [m], shape ``(w,)``; 0 without any."""
    shapes = model.shapes
    place = shapes.geometry[:, axis].copy()
    has_end = TAIL[shapes.kind] == Tail.POINT
    place[has_end] = 0.5 * (shapes.geometry[has_end, axis] + shapes.geometry[has_end, axis + 2])
    counted = shapes.kind != ShapeKind.VERTEX
    total = np.bincount(shapes.wall[counted], weights=place[counted], minlength=model.wall_count)
    number = np.bincount(shapes.wall[counted], minlength=model.wall_count)
    return np.asarray(total / np.maximum(number, 1))
