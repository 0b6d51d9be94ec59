"""What is measured between two walls: shear strain, and distance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from multicor_cli.model import Model, ShapeKind, State
from multicor_cli.model.columns import X, Y
from multicor_cli.model.model import Floats
from multicor_cli.model.shapes import TAIL, Tail


@dataclass(frozen=True)
class Spacing:
    """Measures the distance between two walls along an axis, positive if the second one lies further along it.

    Attributes:
        lower: Index of the first wall.
        upper: Index of the second wall.
        axis: Column of the axis in positions, x or y.
        distance: What the places of their shapes add to the distance of their frames [m].
    """

    lower: int
    upper: int
    axis: int
    distance: float

    @classmethod
    def between(cls, model: Model, lower: str, upper: str, axis: int = Y) -> Spacing:
        """The spacing of the two walls of these names.

        Raises:
            ValueError: If a wall does not exist, or both are the same.
        """
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
        """The distance [m]."""
        return self.distance + float(state.wall_position[self.upper, self.axis] - state.wall_position[self.lower, self.axis])


@dataclass(frozen=True)
class ShearGauge:
    """Measures shear strain between two walls: relative displacement in x over the distance in y, summed over the steps.

    Increments count by their absolute value, so that the strain of a stage that shears back and forth keeps growing.

    Attributes:
        height: Distance in y of the second wall from the first.
    """

    height: Spacing

    @classmethod
    def between(cls, model: Model, lower: str, upper: str) -> ShearGauge:
        """The gauge of the two walls of these names; raises as `Spacing.between`."""
        return cls(Spacing.between(model, lower, upper))

    def offset(self, wall_position: Floats) -> float:
        """How far the second wall is displaced in x relative to the first [m], given the positions of the walls."""
        return float(wall_position[self.height.upper, X] - wall_position[self.height.lower, X])

    def increment(self, state: State, wall_before: Floats) -> float:
        """Strain of the last step; ``wall_before`` are the positions before it. Walls at the same height have no strain."""
        height = self.height.of(state)
        return abs((self.offset(state.wall_position) - self.offset(wall_before)) / height) if height else 0.0


def wall_places(model: Model, axis: int) -> Floats:
    """Place of each wall along an axis in its frame: the mean over its shapes [m], shape ``(w,)``; 0 without shapes."""
    shapes = model.shapes
    place = shapes.geometry[:, axis].copy()
    has_end = TAIL[shapes.kind] == Tail.POINT
    place[has_end] = 0.5 * (shapes.geometry[has_end, axis] + shapes.geometry[has_end, axis + 2])
    counted = shapes.kind != ShapeKind.VERTEX
    total = np.bincount(shapes.wall[counted], weights=place[counted], minlength=model.wall_count)
    number = np.bincount(shapes.wall[counted], minlength=model.wall_count)
    return np.asarray(total / np.maximum(number, 1))
