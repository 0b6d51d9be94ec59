"""What ends a loading stage before its duration is over.

A condition is a function of the state alone, what it has noted in it included (`State.stage_notes`), so that a resumed run ends
likewise.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from multicor_cli.model import BOOK_NAMES, State
from multicor_cli.model.model import Floats
from multicor_cli.running.gauges import ShearGauge

ROUNDING = 1e-9
"""Relative amount by which an accumulated strain may miss its goal: the sum of 10⁶ rounded increments."""

Relation = Literal["at least", "at most"]

KINETIC = BOOK_NAMES.index("kinetic")
_KINETIC_START = BOOK_NAMES.index("kinetic_start")


@dataclass(frozen=True)
class Aim:
    """What a condition waits for.

    Attributes:
        quantity: What it looks at, in words.
        unit: SI unit of the quantity; ``1`` if dimensionless.
        relation: How the quantity has to be.
        goal: To what it is compared.
    """

    quantity: str
    unit: str
    relation: Relation
    goal: float

    def is_met(self, value: float) -> bool:
        """Whether a value of the quantity is what is waited for, but for rounding."""
        slack = ROUNDING * abs(self.goal)
        return value >= self.goal - slack if self.relation == "at least" else value <= self.goal + slack


@dataclass(frozen=True)
class StepDone:
    """What a condition is told after a step, besides the state.

    Attributes:
        dt: Time step [s].
        wall_before: Positions of the walls before the step [m, m, rad], shape ``(w, 3)``.
        wall_impulse: Impulse of the grains on the walls in the step [N s, N s, N m s], shape ``(w, 3)``.
    """

    dt: float
    wall_before: Floats
    wall_impulse: Floats


class Condition(ABC):
    """What ends a stage.

    Attributes:
        lack: What may keep its quantity from having a value.
    """

    lack: ClassVar[str] = ""

    @property
    @abstractmethod
    def aim(self) -> Aim:
        """What it waits for."""

    @abstractmethod
    def value(self, state: State) -> float | None:
        """The quantity after a step; None if it has no value yet."""

    def holds(self, state: State) -> bool:
        """Whether the stage is over."""
        value = self.value(state)
        return value is not None and self.aim.is_met(value)

    def holds_at_last(self, state: State) -> bool:
        """Whether it holds after the last step of the duration, by which time what never came is known not to have come."""
        return self.holds(state)

    def progress(self, state: State) -> float:
        """Share of the stage that is done, 0 to 1; 0 where it cannot be foreseen, and the duration tells more."""
        return 0.0

    def first_notes(self, state: State) -> Floats:
        """What it has to remember of the state at the start of the stage, and a place for what follows."""
        return np.empty(0)

    def note(self, state: State, done: StepDone) -> None:  # noqa: B027  (most have nothing to remember)
        """Remember what it needs of a step, in ``state.stage_notes`` of this length or in a number of the state."""


@dataclass(frozen=True)
class StrainReached(Condition):
    """The stage ends at a shear strain of ``goal``."""

    gauge: ShearGauge
    goal: float

    @property
    def aim(self) -> Aim:
        """What it waits for."""
        return Aim("the shear strain", "1", "at least", self.goal)

    def value(self, state: State) -> float:
        """The strain of the stage."""
        return state.stage_strain

    def progress(self, state: State) -> float:
        """Share of the stage that is done, 0 to 1."""
        return min(state.stage_strain / self.goal, 1.0)

    def note(self, state: State, done: StepDone) -> None:
        """Add the strain of the step."""
        state.stage_strain += self.gauge.increment(state, done.wall_before)


@dataclass(frozen=True)
class RestReached(Condition):
    """The stage ends when the kinetic energy has fallen to ``ratio`` times its largest value in the stage."""

    ratio: float

    @property
    def aim(self) -> Aim:
        """What it waits for."""
        return Aim("the kinetic energy over its largest value", "1", "at most", self.ratio)

    def value(self, state: State) -> float:
        """Kinetic energy over its largest value in the stage; 0 where nothing has moved."""
        return float(state.books[KINETIC]) / state.stage_peak if state.stage_peak > 0.0 else 0.0

    def holds(self, state: State) -> bool:
        """Whether the grains have moved and come to rest. What has not moved yet may do so later, when a wall or a grain comes."""
        return state.stage_peak > 0.0 and bool(state.books[KINETIC] <= self.ratio * state.stage_peak)

    def holds_at_last(self, state: State) -> bool:
        """Whether the grains have come to rest, or never moved."""
        return state.stage_peak == 0.0 or self.holds(state)


def update_peak(state: State) -> None:
    """Keep the largest kinetic energy of the stage after a step, its initial value included."""
    if state.step == 1:
        state.stage_peak = max(state.stage_peak, float(state.books[_KINETIC_START]))
    state.stage_peak = max(state.stage_peak, float(state.books[KINETIC]))
