"""What the controller carries out: loading stages with everything counted in steps."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace

from multicor_cli.engine.contact.solve import Settings
from multicor_cli.model import ContactLaws, State
from multicor_cli.running.cadence import is_due
from multicor_cli.running.conditions import Condition
from multicor_cli.running.gravity_plan import StageGravity
from multicor_cli.running.heat_plan import StageWallHeat
from multicor_cli.scenario.drives import StageDrives
from multicor_cli.scenario.settings import Output
from multicor_cli.store.stage_ends import Reason, StageEnd


@dataclass(frozen=True)
class StageHeat:
    """What heat does in a stage.

    Attributes:
        conditions: Thermal conditions of the walls.
        is_on: Whether temperatures change.
        is_frozen: Whether grains and walls stand still.
    """

    conditions: StageWallHeat
    is_on: bool = True
    is_frozen: bool = False


@dataclass(frozen=True)
class StagePlan:
    """One loading stage.

    Attributes:
        name: Name of the stage.
        dt: Time step [s].
        step_limit: Number of steps after which the stage ends at the latest; None: only its condition ends it.
        until: Condition that ends it earlier, or None.
        frame_every: Steps between frames, at least 1 (see `is_due`); a frame is also written at the end of the stage.
        series_every: Steps between rows of the time series, at least 1; likewise.
        settings: Choices of the contact solver.
        drives: What happens to the walls.
        heat: What heat does, or None if the run has none.
        gravity: Gravity, or None: that of the model.
        laws: Contact laws, or None: those of the model.
        stops_late: Whether the run ends if ``step_limit`` comes before ``until`` holds.
        duration: Time since the start of the stage at which its last step ends [s], where that is no whole number of steps of
            ``dt``: the last one has another length; None: it has not.
    """

    name: str
    dt: float
    step_limit: int | None
    until: Condition | None
    frame_every: float
    series_every: float
    settings: Settings
    drives: StageDrives
    heat: StageHeat | None = None
    gravity: StageGravity | None = None
    laws: ContactLaws | None = None
    stops_late: bool = False
    duration: float | None = None

    def time_after(self, steps: int) -> float:
        """Time since the start of the stage after so many steps [s]."""
        return self.duration if self.duration is not None and steps == self.step_limit else steps * self.dt

    def step_after(self, steps: int) -> float:
        """Length of the step that comes after so many [s]."""
        is_last = self.duration is not None and steps + 1 == self.step_limit
        return self.time_after(steps + 1) - self.time_after(steps) if is_last else self.dt

    @property
    def length(self) -> float | None:
        """How long the stage lasts at most [s]; None: only its condition ends it."""
        return None if self.step_limit is None else self.time_after(self.step_limit)

    @property
    def is_frozen(self) -> bool:
        """Whether grains and walls stand still."""
        return self.heat is not None and self.heat.is_frozen

    def has_ended(self, state: State) -> bool:
        """Whether the stage is over after the step that led to ``state``."""
        return self._is_at_last(state) or self._holds(state)

    def has_timed_out(self, state: State) -> bool:
        """Whether the time of the stage is over, and its condition does not hold."""
        return self._is_at_last(state) and self.until is not None and not self._holds(state)

    def reason_to_end(self, state: State) -> Reason:
        """Why the stage is over after the step that led to ``state``."""
        if self.until is None:
            return "duration"
        return "condition" if self._holds(state) else "timeout"

    def _is_at_last(self, state: State) -> bool:
        return self.step_limit is not None and state.stage_step >= self.step_limit

    def _holds(self, state: State) -> bool:
        """Whether there is a condition, and it holds."""
        if self.until is None:
            return False
        return self.until.holds_at_last(state) if self._is_at_last(state) else self.until.holds(state)

    def end_of(self, state: State) -> StageEnd:
        """What is kept of the end of the stage, which came with the step that led to ``state``."""
        end = StageEnd(
            stage=state.stage,
            name=self.name,
            reason=self.reason_to_end(state),
            step=state.step,
            time=state.time,
            duration=state.time - state.stage_start,
        )
        if self.until is None:
            return end
        end = replace(end, value=self.until.value(state), **asdict(self.until.aim))
        return replace(end, quantity=f"{end.quantity} ({self.until.lack})") if end.value is None else end

    def is_frame_due(self, state: State) -> bool:
        """Whether ``state`` is to be written as a frame, the end of the stage left aside."""
        return is_due(state.stage_step, self.frame_every)

    def is_series_due(self, state: State) -> bool:
        """Whether ``state`` ends a window of the time series, the end of the stage left aside."""
        return is_due(state.stage_step, self.series_every)

    def progress(self, state: State) -> float:
        """Share of the stage that is done, 0 to 1, as far as one can tell."""
        by_steps = state.stage_step / self.step_limit if self.step_limit is not None else 0.0
        by_condition = self.until.progress(state) if self.until is not None else 0.0
        return min(max(by_steps, by_condition), 1.0)


@dataclass(frozen=True)
class RunPlan:
    """All stages of a run, and what is written.

    Attributes:
        name: Name of the scenario.
        stages: The stages in order of time, at least one.
        output: The table ``[output]``.
    """

    name: str
    stages: Sequence[StagePlan]
    output: Output

    def progress(self, state: State, steps: Sequence[int | None]) -> float:
        """Share of the run that is done, 0 to 1, with the ``steps`` foreseen of each stage; by stages if those of one are not."""
        if state.stage >= len(self.stages):
            return 1.0
        stage = self.stages[state.stage]
        weights = [1.0] * len(self.stages) if None in steps else [float(count or 0) for count in steps]
        done = math.fsum(weights[: state.stage]) + weights[state.stage] * stage.progress(state)
        return done / math.fsum(weights)
