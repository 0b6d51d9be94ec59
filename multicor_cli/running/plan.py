"""What the controller carries out: stages counted in steps, and what an engine is told of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from multicor_cli.engine.heat.walls import WallHeat
from multicor_cli.engine.motion.drives import AnyGravity, DofDrive, Gravity
from multicor_cli.engine.orders import Orders, Settings
from multicor_cli.model import ContactLaws, State
from multicor_cli.running.conditions import KINETIC, CellStrainReached, Condition, StrainReached
from multicor_cli.scenario.settings import Output
from multicor_cli.scenario.stage_drives import StageDrives, kept_signal
from multicor_cli.store.documents import Reason, StageEnd

if TYPE_CHECKING:  # a plan is read without Numba, which this loads
    from multicor_cli.engine import Engine


@dataclass(frozen=True)
class StageGravity:
    """Gravity of a stage over the time since the start of the one that named it, or of itself."""

    stage: int
    gravity: AnyGravity
    named_by: int

    def started(self, stage_starts: Sequence[float]) -> AnyGravity:
        """Gravity over the time since this stage began; stages up to it began at these times [s].

        A stage that says nothing keeps what there was at the end of the stage that named gravity
        last: a tilted chute stays tilted.
        """
        if self.named_by == self.stage:
            return self.gravity
        lasted = stage_starts[self.named_by + 1] - stage_starts[self.named_by]
        return Gravity.constant(self.gravity.value(lasted))


@dataclass(frozen=True)
class StageHeat:
    """Thermal conditions of the walls in a stage, and what heat does in it.

    Attributes:
        walls: The conditions; their signals count from the stages by which they are ``named_by``.
        is_on: Whether temperatures change.
        is_frozen: Whether grains and walls stand still.
    """

    stage: int = 0
    walls: tuple[WallHeat, ...] = ()
    named_by: tuple[int, ...] = ()
    is_on: bool = True
    is_frozen: bool = False

    def started(self, stage_starts: Sequence[float]) -> list[WallHeat]:
        """The conditions as functions of the time since this stage began; see `StageGravity`."""
        return [
            replace(wall, signal=kept_signal(wall.signal, named_by, self.stage, stage_starts))
            for wall, named_by in zip(self.walls, self.named_by, strict=True)
        ]


@dataclass(frozen=True)
class StagePlan:
    """One loading stage.

    Attributes:
        dt: Time step [s].
        step_limit: Number of steps after which it ends at the latest; None: only ``until`` ends it.
        frame_every: Steps between frames, at least 1 (see `is_due`); its end is also a frame.
        series_every: Steps between rows of the time series, at least 1; likewise.
        heat: What heat does, or None if the run has none.
        gravity: Gravity, or None: that of the model.
        laws: Contact laws, or None: those of the model.
        stops_late: Whether the run ends if ``step_limit`` comes before ``until`` holds.
        duration: Its length [s], where its last step is not as long as ``dt``; else None.
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

    def orders(self, starts: Sequence[float]) -> Orders:
        """What an engine is told; ``starts``: when the stages up to this one have begun [s]."""
        gravity = None if self.gravity is None else self.gravity.started(starts)
        orders = Orders(self.drives.started(starts), self.settings, gravity, self.laws)
        heat = self.heat
        if heat is None:
            return orders
        return replace(
            orders,
            conditions=heat.started(starts),
            is_new=np.array([named_by == heat.stage for named_by in heat.named_by], np.bool_),
            is_heat_on=heat.is_on,
            is_frozen=heat.is_frozen,
        )

    def time_after(self, steps: int) -> float:
        """Time since the start of the stage after so many steps [s]."""
        if self.duration is not None and steps == self.step_limit:
            return self.duration
        return steps * self.dt

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
        return self.heat is not None and self.heat.is_frozen

    def reason_to_end(self, state: State) -> Reason | None:
        """Why the stage is over with the step that led to ``state``; None if it goes on."""
        is_last = self.step_limit is not None and state.stage_step >= self.step_limit
        if self.until is None:
            return "duration" if is_last else None
        holds = self.until.holds_at_last if is_last else self.until.holds
        return "condition" if holds(state) else "timeout" if is_last else None

    def end_of(self, state: State, reason: Reason) -> StageEnd:
        """What is kept of the end of the stage, which came with the step that led to ``state``."""
        end = StageEnd(
            stage=state.stage,
            name=self.name,
            reason=reason,
            step=state.step,
            time=state.time,
            duration=state.time - state.stage_start,
        )
        if self.until is None:
            return end
        end = replace(end, value=self.until.value(state), **asdict(self.until.aim))
        if end.value is None:
            return replace(end, quantity=f"{end.quantity} ({self.until.lack})")
        return end

    def progress(self, state: State) -> float:
        by_steps = state.stage_step / self.step_limit if self.step_limit is not None else 0.0
        by_condition = self.until.progress(state) if self.until is not None else 0.0
        return min(max(by_steps, by_condition), 1.0)


@dataclass(frozen=True)
class RunPlan:
    """All stages of a run, at least one, and what is written of it."""

    name: str
    stages: Sequence[StagePlan]
    output: Output

    def progress(self, state: State, steps: Sequence[int | None]) -> float:
        """Share of the run that is done, by the ``steps`` foreseen; by stages if some are not."""
        if state.stage >= len(self.stages):
            return 1.0
        weights = [1.0 if None in steps else float(count or 0) for count in steps]
        share = self.stages[state.stage].progress(state)
        done = math.fsum(weights[: state.stage]) + weights[state.stage] * share
        return done / math.fsum(weights)


def begin_stage(engine: Engine, stage: StagePlan, starts: Sequence[float]) -> None:
    """Tell an engine what a stage orders, before its first step; ``starts`` as in `orders` [s]."""
    engine.begin(stage.orders(starts))
    state = engine.state
    state.stage_peak = float(state.books[KINETIC]) if state.step > 0 else 0.0
    if stage.until is not None:
        state.stage_notes = stage.until.first_notes(state)


# ---- How many steps the stages of a run will take, as far as their conditions can be foreseen

_SHORTEST_MARCH = 20_000  # evaluations of a signal before the interval is doubled
_DOUBLINGS = 30


def foresee_steps(plan: RunPlan, state: State) -> list[int | None]:
    """Steps of each stage at most; None where only a condition ends it, at an unforeseen time."""
    starts, counts = [0.0], []
    for stage in plan.stages:
        needed = _steps_to_strain(stage, starts, state)
        bounds = [count for count in (stage.step_limit, needed) if count is not None]
        counts.append(min(bounds, default=None))
        starts.append(starts[-1] + stage.time_after(counts[-1] or 0))
    return counts


def _steps_to_strain(stage: StagePlan, starts: Sequence[float], state: State) -> int | None:
    """Steps until walls or a cell, moved as prescribed, have reached the strain of the stage."""
    until, drives = stage.until, stage.drives.started(starts)
    if isinstance(until, CellStrainReached):
        moved, height = [DofDrive(), drives[0].dofs()[until.component]], 1.0
    elif isinstance(until, StrainReached):
        moved = [drives[wall].x for wall in (until.height.lower, until.height.upper)]
        height = until.height.of(state)
    else:
        return None
    if any(dof.is_driven for dof in moved) or not height:
        return None
    t, interval, left = 0.0, stage.dt, until.aim.goal
    for _ in range(_DOUBLINGS):
        for _ in range(_SHORTEST_MARCH):
            lower, upper = (_velocity(dof, t, interval) for dof in moved)
            rate = abs((upper - lower) / height)
            if rate * interval >= left:
                return max(1, round((t + left / rate) / stage.dt))
            left -= rate * interval
            t += interval
        interval *= 2.0
    return None


def _velocity(dof: DofDrive, t: float, interval: float) -> float:
    """Prescribed velocity [m/s] or rate [1/s] between ``t`` and ``t + interval``."""
    if dof.position is not None:
        return (dof.position.value(t + interval) - dof.position.value(t)) / interval
    return dof.velocity.value(t + 0.5 * interval) if dof.velocity is not None else 0.0
