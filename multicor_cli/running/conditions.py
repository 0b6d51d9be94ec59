"""What ends a loading stage before its duration is over: functions of the state alone, so that a resumed run ends likewise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from multicor_cli.model import BOOK_NAMES, Model, ShapeKind, State
from multicor_cli.model.model import Floats
from multicor_cli.model.shapes import TAIL, Tail
from multicor_cli.scenario.loading import Stage, UntilStrain

ROUNDING = 1e-9
"""Relative amount by which an accumulated strain may miss its goal: the sum of 10⁶ rounded increments."""

KINETIC = BOOK_NAMES.index("kinetic")
_KINETIC_START = BOOK_NAMES.index("kinetic_start")


@dataclass(frozen=True)
class ShearGauge:
    """Measures shear strain between two walls: relative displacement in x over the distance in y, summed over the steps.

    Increments count by their absolute value, so that the strain of a stage that shears back and forth keeps growing.

    Attributes:
        lower: Index of the first wall.
        upper: Index of the second wall.
        distance: What the heights of their shapes add to the distance of their frames in y [m].
    """

    lower: int
    upper: int
    distance: float

    @classmethod
    def between(cls, model: Model, lower: str, upper: str) -> ShearGauge:
        """The gauge of the two walls of these names.

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
        heights = wall_heights(model)
        return cls(first, second, float(heights[second] - heights[first]))

    def height(self, state: State) -> float:
        """Distance of the second wall above the first [m]."""
        return self.distance + float(state.wall_position[self.upper, 1] - state.wall_position[self.lower, 1])

    def offset(self, state: State) -> float:
        """How far the second wall is displaced in x relative to the first [m]."""
        return float(state.wall_position[self.upper, 0] - state.wall_position[self.lower, 0])

    def increment(self, state: State, offset_before: float) -> float:
        """Strain of the last step; ``offset_before`` is `offset` before it. Walls at the same height have no strain."""
        height = self.height(state)
        return abs((self.offset(state) - offset_before) / height) if height else 0.0


@dataclass(frozen=True)
class StrainReached:
    """The stage ends at a shear strain of ``value``."""

    gauge: ShearGauge
    value: float

    def holds(self, state: State) -> bool:
        """Whether the strain of the stage has reached the value."""
        return state.stage_strain >= self.value * (1.0 - ROUNDING)

    def progress(self, state: State) -> float:
        """Share of the stage that is done, 0 to 1."""
        return min(state.stage_strain / self.value, 1.0)


@dataclass(frozen=True)
class RestReached:
    """The stage ends when the kinetic energy has fallen to ``ratio`` times its largest value in the stage."""

    ratio: float

    def holds(self, state: State) -> bool:
        """Whether the grains have moved and come to rest."""
        return state.stage_peak > 0.0 and state.books[KINETIC] <= self.ratio * state.stage_peak

    def progress(self, state: State) -> float:
        """Always 0: when grains come to rest cannot be foreseen; the duration of the stage tells more."""
        return 0.0


Condition = StrainReached | RestReached


def condition_of(stage: Stage, model: Model) -> Condition | None:
    """What ends a stage before its duration is over, if anything does."""
    if stage.until is None:
        return None
    if isinstance(stage.until, UntilStrain):
        strain = stage.until.strain
        return StrainReached(ShearGauge.between(model, *strain.walls), strain.value)
    return RestReached(stage.until.kinetic_energy_ratio)


def update_peak(state: State) -> None:
    """Keep the largest kinetic energy of the stage after a step, its initial value included."""
    if state.step == 1:
        state.stage_peak = max(state.stage_peak, float(state.books[_KINETIC_START]))
    state.stage_peak = max(state.stage_peak, float(state.books[KINETIC]))


def wall_heights(model: Model) -> Floats:
    """Height y of each wall in its frame: the mean over its shapes [m], shape ``(w,)``; 0 without shapes."""
    shapes = model.shapes
    height = shapes.geometry[:, 1].copy()
    has_end = TAIL[shapes.kind] == Tail.POINT
    height[has_end] = 0.5 * (shapes.geometry[has_end, 1] + shapes.geometry[has_end, 3])
    counted = shapes.kind != ShapeKind.VERTEX
    total = np.bincount(shapes.wall[counted], weights=height[counted], minlength=model.wall_count)
    number = np.bincount(shapes.wall[counted], minlength=model.wall_count)
    return np.asarray(total / np.maximum(number, 1))
