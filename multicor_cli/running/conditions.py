"""What ends a loading stage before its duration is over.

A condition is a function of the state alone, what it has noted in it included
(`State.stage_notes`), so that a resumed run ends likewise.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from multicor_cli.arithmetic.sums import mean, total
from multicor_cli.engine.motion.drives import Spacing
from multicor_cli.model import BOOK_NAMES, State
from multicor_cli.model.cell import cell_area
from multicor_cli.model.columns import XX, YY, X
from multicor_cli.model.model import Floats

ROUNDING = 1e-9
"""Relative amount by which a strain may miss its goal: the sum of 10⁶ rounded increments."""

Relation = Literal["at least", "at most"]

KINETIC = BOOK_NAMES.index("kinetic")
_KINETIC_START = BOOK_NAMES.index("kinetic_start")


@dataclass(frozen=True)
class Aim:
    """What a condition waits for: a quantity, in words, and its relation to a goal of its unit."""

    quantity: str
    unit: str
    relation: Relation
    goal: float

    def is_met(self, value: float) -> bool:
        """Whether a value of the quantity is what is waited for, but for rounding."""
        slack = ROUNDING * abs(self.goal)
        if self.relation == "at least":
            return value >= self.goal - slack
        return value <= self.goal + slack


@dataclass(frozen=True)
class StepDone:
    """What a condition is told after a step besides the state; arrays have the shape ``(w, 3)``.

    Attributes:
        wall_before: Positions of the walls before the step [m, m, rad].
        wall_impulse: Impulse of the grains on the walls in the step [N s, N s, N m s].
    """

    dt: float
    wall_before: Floats
    wall_impulse: Floats


@dataclass(frozen=True)
class Condition(ABC):
    """What ends a stage: its aim, and in words what may keep its quantity from having a value."""

    aim: Aim
    lack: ClassVar[str] = ""

    @abstractmethod
    def value(self, state: State) -> float | None:
        """The quantity after a step; None if it has no value yet."""

    def holds(self, state: State) -> bool:
        value = self.value(state)
        return value is not None and self.aim.is_met(value)

    def holds_at_last(self, state: State) -> bool:
        """Whether it holds after the last step: what never came is then known not to come."""
        return self.holds(state)

    def progress(self, state: State) -> float:
        """Share of the stage that is done, 0 to 1; 0 where it cannot be foreseen."""
        return 0.0

    def first_notes(self, state: State) -> Floats:
        """What it remembers of the start of the stage, and places for what follows."""
        return np.empty(0)

    def note(self, state: State, done: StepDone) -> None:  # noqa: B027  (most have nothing to remember)
        """Remember what it needs of a step, in ``state.stage_notes`` or a number of the state."""


@dataclass(frozen=True)
class _AnyStrainReached(Condition):
    """The stage ends at a strain.

    Increments count by their absolute value, so that the strain of a stage that shears back and
    forth keeps growing.
    """

    def value(self, state: State) -> float:
        return state.stage_strain

    def progress(self, state: State) -> float:
        return min(state.stage_strain / self.aim.goal, 1.0)


@dataclass(frozen=True)
class StrainReached(_AnyStrainReached):
    """The stage ends at a shear strain: of two walls, displacement in x over distance in y."""

    height: Spacing

    def note(self, state: State, done: StepDone) -> None:
        """Add the strain of the step; walls at the same height have none."""
        height = self.height.of(state)
        before, after = (
            float(places[self.height.upper, X] - places[self.height.lower, X])
            for places in (done.wall_before, state.wall_position)
        )
        state.stage_strain += abs((after - before) / height) if height else 0.0


@dataclass(frozen=True)
class CellStrainReached(_AnyStrainReached):
    """The stage ends at a strain of a cell, of the component in a column of its rates."""

    component: int

    def note(self, state: State, done: StepDone) -> None:
        """Add the strain of the step, with the rate at its end."""
        state.stage_strain += abs(float(state.wall_velocity[0, self.component])) * done.dt


@dataclass(frozen=True)
class RestReached(Condition):
    """The stage ends when the kinetic energy has fallen to ``aim.goal`` of its largest in it."""

    def value(self, state: State) -> float:
        """Kinetic energy over its largest value in the stage; 0 where nothing has moved."""
        return float(state.books[KINETIC]) / state.stage_peak if state.stage_peak > 0.0 else 0.0

    def holds(self, state: State) -> bool:
        """Whether grains have moved and come to rest; those that have not may still be moved."""
        return state.stage_peak > 0.0 and bool(
            state.books[KINETIC] <= self.aim.goal * state.stage_peak
        )

    def holds_at_last(self, state: State) -> bool:
        return state.stage_peak == 0.0 or self.holds(state)


def update_peak(state: State) -> None:
    """Keep the largest kinetic energy of the stage after a step, its initial value included."""
    if state.step == 1:
        state.stage_peak = max(state.stage_peak, float(state.books[_KINETIC_START]))
    state.stage_peak = max(state.stage_peak, float(state.books[KINETIC]))


def is_due(step: int, every: float) -> bool:
    """Whether this step is the one nearest to a multiple of ``every``, which may not be whole."""
    return step == math.floor(round(step / every) * every + 0.5)


# ---- Conditions about walls: how far they have come, and how hard the grains push them

SUM, SUMMED, WINDOWS, LAST, BEFORE = range(5)
"""Notes: sum and steps of the window under way, number of those over, means of the last two."""


@dataclass(frozen=True)
class DistanceReached(Condition):
    """The stage ends at a relative change of the distance of two walls, noted at its start [m]."""

    lack = "they were at the same place when the stage began"
    spacing: Spacing

    def first_notes(self, state: State) -> Floats:
        return np.array([self.spacing.of(state)])

    def value(self, state: State) -> float | None:
        """Distance over that at the start of the stage, less 1; None if that was zero."""
        first = float(state.stage_notes[0])
        return self.spacing.of(state) / first - 1.0 if first else None


@dataclass(frozen=True)
class DisplacementReached(Condition):
    """The stage ends at a displacement [m] or angle [rad] of a wall; its note is where it began."""

    wall: int
    axis: int

    def first_notes(self, state: State) -> Floats:
        return np.array([state.wall_position[self.wall, self.axis]])

    def value(self, state: State) -> float:
        return float(state.wall_position[self.wall, self.axis] - state.stage_notes[0])


@dataclass(frozen=True)
class ForceReached(Condition):
    """The stage ends at a mean force on a wall over a window: that of a single step fluctuates.

    Attributes:
        axis: Column of the force: x, y or torque.
        steps: Steps of a window, not always whole ones: it ends with the step nearest to its end.
        length: What the force is divided by: 1, or the length of the wall [m].
    """

    lack = "no window of it was over"
    wall: int
    axis: int
    steps: float
    length: float

    def first_notes(self, state: State) -> Floats:
        return np.zeros(BEFORE + 1)

    def _now(self, state: State, done: StepDone) -> float:
        """The quantity in the step."""
        return float(done.wall_impulse[self.wall, self.axis] / done.dt / self.length)

    def note(self, state: State, done: StepDone) -> None:
        notes = state.stage_notes
        notes[SUM] += self._now(state, done)
        notes[SUMMED] += 1.0
        if is_due(state.stage_step, self.steps):
            notes[BEFORE], notes[LAST] = notes[LAST], notes[SUM] / notes[SUMMED]
            notes[WINDOWS] += 1.0
            notes[SUM] = notes[SUMMED] = 0.0

    def value(self, state: State) -> float | None:
        """Mean of the last window that is over; None before the end of the first."""
        notes = state.stage_notes
        return float(notes[LAST]) if notes[WINDOWS] else None

    def holds(self, state: State) -> bool:
        """Whether a window has just ended whose mean is what is waited for."""
        return state.stage_notes[SUMMED] == 0.0 and super().holds(state)


def _stresses(state: State, done: StepDone) -> list[float]:
    """Mean stress of the grains of a cell in a step [N/m], by component, signs as for its drives.

    The impulse in shear is that of the grains on the cell: against what shears it.
    """
    xx, yy, xy = (done.wall_impulse[0] / done.dt / cell_area(state)).tolist()
    return [xx, yy, -xy]


@dataclass(frozen=True)
class CellStressReached(ForceReached):
    """As `ForceReached`, for the stress of the grains in a cell; ``axis`` is its component."""

    def _now(self, state: State, done: StepDone) -> float:
        return _stresses(state, done)[self.axis]


# ---- A stage that ends when a mean no longer drifts

HALF = 8
"""Blocks in each half of a window."""

BLOCKS = 2 * HALF
SURE = 2.0
"""Standard errors by which a drift may be larger than it looks."""

OVER, UNDER, STEPS, DONE, FIRST = range(5)
"""Notes: sums over and under and steps of the block under way; blocks done; means, latest last."""


def drift_of(blocks: Floats) -> float | None:
    """Bound of the drift of a mean between the halves of a window, over the mean (derived).

    (|m₂ − m₁| + 2 e)/|m|: m₁ and m₂ are the means of the halves, m that of both, and e = √(s₁²/b +
    s₂²/b) is the standard error of their difference, with the variances s² of the b blocks of each
    half about its mean. Blocks longer than the memory of the quantity are independent, and |m₂ −
    m₁| + 2 e is then an upper bound of the drift with a confidence of 95 %. So noise delays the end
    of a stage, and hardly ever brings it about.

    ``blocks`` are means over equal blocks of time that follow each other, shape ``(BLOCKS,)``; None
    if the mean is zero.
    """
    halves = blocks[:HALF], blocks[HALF:]
    first, second = (mean(half) for half in halves)
    middle = 0.5 * (first + second)
    if middle == 0.0:
        return None
    squares = math.fsum(
        total((half - at) * (half - at)) for half, at in zip(halves, (first, second), strict=True)
    )
    error = math.sqrt(squares / (HALF - 1) / HALF)
    return (abs(second - first) + SURE * error) / abs(middle)


@dataclass(frozen=True)
class Steady(Condition):
    """The stage ends when a mean no longer drifts, see `drift_of`. Windows move on by one block.

    Attributes:
        wall: Index of the wall; None: the kinetic energy of all.
        axis: Column of the force: x, y or torque.
        across: Column of the force by which it is divided; None: by nothing.
        steps: Steps of a block, counted as those of a window of `ForceReached`.
        skipped: Steps of the stage that are left out.
    """

    lack = "no window was over in which there was a force"
    wall: int | None
    axis: int
    across: int | None
    steps: float
    skipped: int

    def first_notes(self, state: State) -> Floats:
        return np.zeros(FIRST + BLOCKS)

    def _now(self, state: State, done: StepDone) -> tuple[float, float]:
        """The quantity in the step, and what its mean is divided by."""
        if self.wall is None:
            return float(state.books[KINETIC]), 1.0
        force = (done.wall_impulse[self.wall] / done.dt).tolist()
        return force[self.axis], 1.0 if self.across is None else force[self.across]

    def note(self, state: State, done: StepDone) -> None:
        """Add the step to its block, closed when over; without force across, all start anew."""
        notes = state.stage_notes
        if state.stage_step <= self.skipped:
            return
        over, under = self._now(state, done)
        notes[OVER] += over
        notes[UNDER] += under
        notes[STEPS] += 1.0
        if not is_due(state.stage_step - self.skipped, self.steps):
            return
        if notes[UNDER] != 0.0:
            notes[FIRST:-1] = notes[FIRST + 1 :].copy()
            notes[-1] = notes[OVER] / notes[UNDER]
            notes[DONE] += 1.0
        else:
            notes[DONE] = 0.0
        notes[OVER] = notes[UNDER] = notes[STEPS] = 0.0

    def value(self, state: State) -> float | None:
        """Drift in the last window; None before the end of the first, and if its mean is zero.

        A kinetic energy that has been zero for the whole stage does not drift.
        """
        if self._is_still(state):
            return 0.0
        notes = state.stage_notes
        return drift_of(notes[FIRST:]) if notes[DONE] >= BLOCKS else None

    def holds(self, state: State) -> bool:
        """Whether a window has just ended in which the drift is small enough."""
        is_over = state.stage_notes[STEPS] == 0.0
        return is_over and not self._is_still(state) and super().holds(state)

    def holds_at_last(self, state: State) -> bool:
        """Whether it holds, or nothing ever moved: until then a wall or a grain might have come."""
        return self._is_still(state) or self.holds(state)

    def _is_still(self, state: State) -> bool:
        return self.wall is None and state.stage_peak == 0.0 == state.books[KINETIC]


@dataclass(frozen=True)
class CellSteady(Steady):
    """As `Steady`, for the stress of the grains in a cell, whose component ``axis`` is.

    With ``across`` it is divided by the mean pressure.
    """

    def _now(self, state: State, done: StepDone) -> tuple[float, float]:
        stresses = _stresses(state, done)
        pressure = 0.5 * (stresses[XX] + stresses[YY])
        return stresses[self.axis], 1.0 if self.across is None else pressure
