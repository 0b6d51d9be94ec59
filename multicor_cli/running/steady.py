"""A stage that ends when a mean no longer drifts."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from multicor_cli.arithmetic.sums import mean, total
from multicor_cli.model import State
from multicor_cli.model.model import Floats
from multicor_cli.running.cadence import is_due
from multicor_cli.running.conditions import KINETIC, StepDone
from multicor_cli.running.wall_conditions import Bounded

HALF = 8
"""Blocks in each half of a window."""

BLOCKS = 2 * HALF
SURE = 2.0
"""Standard errors by which a drift may be larger than it looks."""

OVER, UNDER, STEPS, DONE, FIRST = range(5)
"""Notes: sums of numerator and denominator and steps of the block under way; number of blocks that are over; then the means of the
last `BLOCKS` blocks, the latest last."""


def drift_of(blocks: Floats) -> float | None:
    """By how much the mean of a quantity may have drifted between the halves of a window, over its mean (derived).

    (|m₂ − m₁| + 2 e)/|m|: m₁ and m₂ are the means of the halves, m that of both, and e = √(s₁²/b + s₂²/b) is the standard error of
    their difference, with the variances s² of the b blocks of each half about its mean. Blocks longer than the memory of the
    quantity are independent, and |m₂ − m₁| + 2 e is then an upper bound of the drift with a confidence of 95 %. So noise delays the
    end of a stage, and hardly ever brings it about.

    Args:
        blocks: Means over equal blocks of time that follow each other, shape ``(BLOCKS,)``.

    Returns:
        The drift; None if the mean is zero.
    """
    halves = blocks[:HALF], blocks[HALF:]
    first, second = (mean(half) for half in halves)
    middle = 0.5 * (first + second)
    if middle == 0.0:
        return None
    squares = math.fsum(total((half - at) * (half - at)) for half, at in zip(halves, (first, second), strict=True))
    error = math.sqrt(squares / (HALF - 1) / HALF)
    return (abs(second - first) + SURE * error) / abs(middle)


@dataclass(frozen=True)
class Steady(Bounded):
    """The stage ends when the mean of a quantity drifts no longer; see `drift_of`. Windows move on by one block.

    Attributes:
        wall: Index of the wall; None: the kinetic energy of all.
        axis: Column of the force: x, y or torque.
        across: Column of the force by which it is divided; None: by nothing.
        steps: Steps of a block, not always whole ones: it ends with the step nearest to its end.
        skipped: Steps of the stage that are left out.
    """

    lack = "no window was over in which there was a force"
    wall: int | None
    axis: int
    across: int | None
    steps: float
    skipped: int

    def first_notes(self, state: State) -> Floats:
        """No block yet."""
        return np.zeros(FIRST + BLOCKS)

    def note(self, state: State, done: StepDone) -> None:
        """Add the step to its block, and close the block if it is over. One without any force across the wall begins anew."""
        notes = state.stage_notes
        if state.stage_step <= self.skipped:
            return
        over, under = self._values(state, done)
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
        """Drift in the last window that is over; None before the end of the first, and if its mean is zero.

        A kinetic energy that has been zero for the whole stage does not drift.
        """
        if self._is_still(state):
            return 0.0
        notes = state.stage_notes
        return drift_of(notes[FIRST:]) if notes[DONE] >= BLOCKS else None

    def holds(self, state: State) -> bool:
        """Whether a window has just ended in which the drift is small enough."""
        return state.stage_notes[STEPS] == 0.0 and not self._is_still(state) and super().holds(state)

    def holds_at_last(self, state: State) -> bool:
        """Whether it holds, or the kinetic energy is watched and nothing ever moved. Until then a wall or a grain may come."""
        return self._is_still(state) or self.holds(state)

    def _is_still(self, state: State) -> bool:
        return self.wall is None and state.stage_peak == 0.0 == state.books[KINETIC]

    def _values(self, state: State, done: StepDone) -> tuple[float, float]:
        """What the step adds to numerator and denominator of its block."""
        if self.wall is None:
            return float(state.books[KINETIC]), 1.0
        along = float(done.wall_impulse[self.wall, self.axis]) / done.dt
        if self.across is None:
            return along, 1.0
        return along, float(done.wall_impulse[self.wall, self.across]) / done.dt
