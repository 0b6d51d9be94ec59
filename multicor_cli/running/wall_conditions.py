"""Conditions about walls: how far they have come, and how hard the grains push them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from multicor_cli.engine.motion.spacing import Spacing
from multicor_cli.model import State
from multicor_cli.model.model import Floats
from multicor_cli.running.cadence import is_due
from multicor_cli.running.conditions import Aim, Condition, StepDone

SUM, STEPS, WINDOWS, LAST, BEFORE = range(5)
"""Notes of means over windows: sum and steps of the window under way, number of those that are over, means of the last two."""


@dataclass(frozen=True)
class Bounded(Condition):
    """A condition whose bound the scenario gives."""

    sought: Aim

    @property
    def aim(self) -> Aim:
        """What it waits for."""
        return self.sought


@dataclass(frozen=True)
class DistanceReached(Bounded):
    """The stage ends at a relative change of the distance of two walls; its note is the distance at the start of the stage [m]."""

    lack = "they were at the same place when the stage began"
    spacing: Spacing

    def first_notes(self, state: State) -> Floats:
        """The distance at the start."""
        return np.array([self.spacing.of(state)])

    def value(self, state: State) -> float | None:
        """Distance over that at the start of the stage, less 1; None if they were at the same place."""
        first = float(state.stage_notes[0])
        return self.spacing.of(state) / first - 1.0 if first else None


@dataclass(frozen=True)
class DisplacementReached(Bounded):
    """The stage ends at a displacement of a wall; its note is the coordinate at the start of the stage.

    Attributes:
        wall: Index of the wall.
        axis: Column of the coordinate: x or y [m], or angle [rad].
    """

    wall: int
    axis: int

    def first_notes(self, state: State) -> Floats:
        """The coordinate at the start."""
        return np.array([state.wall_position[self.wall, self.axis]])

    def value(self, state: State) -> float:
        """Displacement since the start of the stage."""
        return float(state.wall_position[self.wall, self.axis] - state.stage_notes[0])


@dataclass(frozen=True)
class ForceReached(Bounded):
    """The stage ends at a mean force of the grains on a wall, over a window of time: that of a single step fluctuates.

    Attributes:
        wall: Index of the wall.
        axis: Column of the force: x, y or torque.
        steps: Steps of a window, not always whole ones: it ends with the step nearest to its end.
        length: What the force is divided by: 1, or the length of the wall [m].
    """

    wall: int
    axis: int
    lack = "no window of it was over"
    steps: float
    length: float

    def first_notes(self, state: State) -> Floats:
        """No window yet."""
        return np.zeros(BEFORE + 1)

    def note(self, state: State, done: StepDone) -> None:
        """Add the force of the step to the window."""
        force = done.wall_impulse[self.wall, self.axis] / done.dt / self.length
        add_to_window(state.stage_notes, force, is_over=is_due(state.stage_step, self.steps))

    def value(self, state: State) -> float | None:
        """Mean of the last window that is over; None before the end of the first."""
        return last_mean(state.stage_notes)

    def holds(self, state: State) -> bool:
        """Whether a window has just ended whose mean is what is waited for."""
        return state.stage_notes[STEPS] == 0.0 and super().holds(state)


def add_to_window(notes: Floats, value: float, *, is_over: bool) -> None:
    """Add the value of a step to the window under way, and close it if it is over. **Modifies** ``notes``."""
    notes[SUM] += value
    notes[STEPS] += 1.0
    if is_over:
        notes[BEFORE], notes[LAST] = notes[LAST], notes[SUM] / notes[STEPS]
        notes[WINDOWS] += 1.0
        notes[SUM] = notes[STEPS] = 0.0


def last_mean(notes: Floats) -> float | None:
    """Mean of the last window that is over; None before the end of the first."""
    return float(notes[LAST]) if notes[WINDOWS] else None
