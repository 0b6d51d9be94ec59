"""What the controller carries out: stages counted in steps, with gravity, heat and exchange."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from multicor_cli.arithmetic import hypot
from multicor_cli.engine.heat.walls import WallHeat
from multicor_cli.engine.inflow.rules import InflowRules, Outlet, Rectangle, Release
from multicor_cli.engine.motion.drives import (
    AnyGravity,
    Constant,
    Gravity,
    TiltedGravity,
    WallDrive,
)
from multicor_cli.engine.orders import Orders, Settings
from multicor_cli.model import ContactLaws, Model, State
from multicor_cli.model.model import Floats
from multicor_cli.running.conditions import KINETIC, Condition, StrainReached, is_due
from multicor_cli.scenario.drives import (
    CapacityCondition,
    FlowCondition,
    StageGravityTable,
    TemperatureCondition,
    TiltedGravityTable,
    WallCondition,
)
from multicor_cli.scenario.heat import AverageForce, Heat
from multicor_cli.scenario.particles import ParticleGroup
from multicor_cli.scenario.region import RectangleRegion
from multicor_cli.scenario.scenario import Scenario
from multicor_cli.scenario.settings import Output
from multicor_cli.scenario.stage_drives import StageDrives, engine_signal, kept_signal
from multicor_cli.store.documents import Reason, StageEnd

if TYPE_CHECKING:  # a plan is read without Numba, which these load
    from multicor_cli.engine import Engine
    from multicor_cli.engine.heat.conduction import ContactForce
    from multicor_cli.engine.heat.mechanism import HeatLaws
    from multicor_cli.engine.heat.settings import HeatSettings

# ---- Gravity in each stage: what the stage says, or what the stage before had at its end


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
        return Gravity.constant(
            self.gravity.value(stage_starts[self.named_by + 1] - stage_starts[self.named_by])
        )


def stage_gravity(scenario: Scenario) -> list[StageGravity]:
    """Gravity of all stages; that of ``[domain]`` until a stage names another."""
    x, y = scenario.domain.gravity
    current: AnyGravity = Gravity(Constant(x), Constant(y))
    named_by, found = None, []
    for number, stage in enumerate(scenario.loading):
        if stage.gravity is not None:
            current, named_by = _engine_gravity(stage.gravity, hypot(x, y)), number
        found.append(StageGravity(number, current, number if named_by is None else named_by))
    return found


def _engine_gravity(gravity: StageGravityTable, magnitude: float) -> AnyGravity:
    """The engine's form of what a stage says; ``magnitude`` is that of the domain [m/s²]."""
    if isinstance(gravity, TiltedGravityTable):
        given = magnitude if gravity.magnitude is None else gravity.magnitude
        return TiltedGravity(engine_signal(gravity.angle), engine_signal(given))
    return Gravity(engine_signal(gravity[0]), engine_signal(gravity[1]))


# ---- From the thermal keys of a scenario to the heat engine and the walls' thermal conditions


def heat_settings(scenario: Scenario, model: Model) -> HeatSettings | None:
    """The choices about heat, materials ordered as in the model; None without ``[heat]``."""
    from multicor_cli.engine.heat.settings import MECHANISMS, HeatSettings

    heat = scenario.heat
    if heat is None:
        return None
    mechanisms = tuple(table.as_record(MECHANISMS[key]) for key, table in heat.mechanisms.items())
    return heat.as_record(
        HeatSettings,
        laws=laws_of_scenario(scenario, model.materials),
        force=_force(heat),
        mechanisms=mechanisms,
    )


def _force(heat: Heat) -> ContactForce:
    from multicor_cli.engine.heat.conduction import ContactForce

    if heat.force is None:
        return ContactForce()
    if isinstance(heat.force, AverageForce):
        return ContactForce("average", heat.force.average)
    return ContactForce("prescribed", heat.force.prescribed)


def laws_of_scenario(scenario: Scenario, materials: Sequence[str]) -> HeatLaws:
    """Thermal properties of materials, in the model's order, and of their pairs: `heat_laws`."""
    from multicor_cli.engine.heat.settings import heat_laws

    if scenario.heat is None:
        message = "a scenario without [heat] has no heat laws"
        raise ValueError(message)
    tables = [scenario.materials[name].model_dump() for name in materials]
    wear = np.array([[_wear(scenario, a, b) for b in materials] for a in materials], float)
    return heat_laws(tables, scenario.heat.partition, wear)


def _wear(scenario: Scenario, a: str, b: str) -> float:
    """Archard's coefficient of two materials; 0 without wear, or if they cannot touch."""
    is_covered = any(entry.covers(a, b) for entry in scenario.contacts)
    return (scenario.law(a, b).wear if is_covered else None) or 0.0


@dataclass(frozen=True)
class StageWallHeat:
    """Thermal conditions of the walls in a stage; signals count from the stage that named them."""

    stage: int
    walls: tuple[WallHeat, ...]
    named_by: tuple[int, ...]

    def beginning(self) -> NDArray[np.bool_]:
        """Which walls have a condition that begins with this stage, shape ``(w,)``."""
        return np.array([named_by == self.stage for named_by in self.named_by], np.bool_)

    def started(self, stage_starts: Sequence[float]) -> list[WallHeat]:
        """The conditions as functions of the time since this stage began; see `StageGravity`."""
        return [
            replace(wall, signal=kept_signal(wall.signal, named_by, self.stage, stage_starts))
            for wall, named_by in zip(self.walls, self.named_by, strict=True)
        ]


def wall_heat(scenario: Scenario, wall_names: Sequence[str]) -> list[StageWallHeat]:
    """The thermal conditions of all walls, named in the order of the engine, in all stages."""
    fallback = math.nan if scenario.heat is None else scenario.heat.temperature
    found = []
    for number, walls in enumerate(scenario.wall_conditions(tuple(wall_names))):
        conditions = (_engine_condition(kept.condition, fallback) for kept in walls)
        found.append(StageWallHeat(number, tuple(conditions), tuple(kept.stage for kept in walls)))
    return found


def _engine_condition(condition: WallCondition, fallback: float) -> WallHeat:
    if isinstance(condition, CapacityCondition):
        initial = math.nan if condition.initial is None else condition.initial
        return WallHeat("capacity", capacity=condition.capacity, initial=initial, fallback=fallback)
    if isinstance(condition, TemperatureCondition):
        return WallHeat("temperature", engine_signal(condition.temperature))
    if isinstance(condition, FlowCondition):
        return WallHeat("flow", engine_signal(condition.flow))
    return WallHeat()


# ---- From the tables of a scenario to the rules by which grains come and go

TRIES = 100
"""Places tried for each release."""


def inflow_rules(scenario: Scenario, model: Model) -> InflowRules:
    """The rules of a run with all its grains, as in ``model``."""
    releases = (
        _release(scenario, number, group) for number, group in enumerate(scenario.particles)
    )
    return InflowRules(
        tuple(release for release in releases if release is not None),
        tuple(
            Outlet(_rectangle(outlet.region), outlet.then == "release")
            for outlet in scenario.outlets
        ),
        None
        if scenario.domain.lost == "ignore"
        else _limits(scenario, 2.0 * float(model.grains.radius.max())),
        scenario.domain.lost == "stop",
    )


def _rectangle(region: RectangleRegion) -> Rectangle:
    return Rectangle(region.min, region.max)


def _limits(scenario: Scenario, margin: float) -> Rectangle:
    """The domain and a margin around it [m]; without limits in the direction of a period."""
    width, height = scenario.domain.size
    left, right = (-math.inf, math.inf) if scenario.domain.periodic else (-margin, width + margin)
    return Rectangle((left, -margin), (right, height + margin))


def _release(scenario: Scenario, number: int, group: ParticleGroup) -> Release | None:
    from multicor_cli.packing.sizes import Purpose, TableKind, stream

    table = group.release
    if table is None:
        return None

    def draw(release: int) -> Floats:
        return stream(scenario.seed, TableKind.PARTICLES, number, Purpose.RELEASE, release).random(
            (TRIES, 2)
        )

    rate = table.rate if table.rate is not None else table.mass_rate
    assert rate is not None  # the scenario has been checked
    return Release(
        group=number,
        rate=rate,
        is_mass=table.mass_rate is not None,
        start=table.start,
        region=_rectangle(table.region),
        spans_period=scenario.domain.is_spanned(table.region.min[0], table.region.max[0]),
        velocity=(*group.velocity, group.spin),
        draw=draw,
    )


# ---- Loading stages with everything counted in steps


@dataclass(frozen=True)
class StageHeat:
    """Whether temperatures change in a stage, and whether grains and walls stand still."""

    conditions: StageWallHeat
    is_on: bool = True
    is_frozen: bool = False


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
        if self.heat is None:
            return orders
        conditions, is_new = self.heat.conditions.started(starts), self.heat.conditions.beginning()
        return replace(
            orders,
            conditions=conditions,
            is_new=is_new,
            is_heat_on=self.heat.is_on,
            is_frozen=self.heat.is_frozen,
        )

    def time_after(self, steps: int) -> float:
        """Time since the start of the stage after so many steps [s]."""
        return (
            self.duration
            if self.duration is not None and steps == self.step_limit
            else steps * self.dt
        )

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

    def has_ended(self, state: State) -> bool:
        return self._is_at_last(state) or self._holds(state)

    def has_timed_out(self, state: State) -> bool:
        return self._is_at_last(state) and self.until is not None and not self._holds(state)

    def reason_to_end(self, state: State) -> Reason:
        if self.until is None:
            return "duration"
        return "condition" if self._holds(state) else "timeout"

    def _is_at_last(self, state: State) -> bool:
        return self.step_limit is not None and state.stage_step >= self.step_limit

    def _holds(self, state: State) -> bool:
        if self.until is None:
            return False
        return (
            self.until.holds_at_last(state) if self._is_at_last(state) else self.until.holds(state)
        )

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
        return (
            replace(end, quantity=f"{end.quantity} ({self.until.lack})")
            if end.value is None
            else end
        )

    def is_frame_due(self, state: State) -> bool:
        """Whether ``state`` is to be written as a frame, the end of the stage left aside."""
        return is_due(state.stage_step, self.frame_every)

    def is_series_due(self, state: State) -> bool:
        """Whether ``state`` ends a window of the time series, the end of the stage left aside."""
        return is_due(state.stage_step, self.series_every)

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
        stage = self.stages[state.stage]
        weights = (
            [1.0] * len(self.stages) if None in steps else [float(count or 0) for count in steps]
        )
        done = math.fsum(weights[: state.stage]) + weights[state.stage] * stage.progress(state)
        return done / math.fsum(weights)


# ---- Beginning a loading stage, or going on with one: what an engine is told


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
        needed = (
            _steps_to_strain(stage, starts, state)
            if isinstance(stage.until, StrainReached)
            else None
        )
        bounds = [count for count in (stage.step_limit, needed) if count is not None]
        count = min(bounds, default=None)
        counts.append(count)
        starts.append(starts[-1] + stage.time_after(count or 0))
    return counts


def _steps_to_strain(stage: StagePlan, starts: Sequence[float], state: State) -> int | None:
    """Steps until two walls whose motion is prescribed have reached the strain of the stage."""
    assert isinstance(stage.until, StrainReached)
    spacing = stage.until.height
    walls = spacing.lower, spacing.upper
    drives = stage.drives.started(starts)
    if any(drives[w].x.is_driven for w in walls):
        return None
    height = spacing.of(state)
    if not height:
        return None
    t, interval, left = 0.0, stage.dt, stage.until.aim.goal
    for _ in range(_DOUBLINGS):
        for _ in range(_SHORTEST_MARCH):
            lower, upper = (_velocity(drives[w], t, interval) for w in walls)
            rate = abs((upper - lower) / height)
            if rate * interval >= left:
                return max(1, round((t + left / rate) / stage.dt))
            left -= rate * interval
            t += interval
        interval *= 2.0
    return None


def _velocity(drive: WallDrive, t: float, interval: float) -> float:
    """Prescribed velocity in x between ``t`` and ``t + interval`` [m/s]."""
    if drive.x.position is not None:
        return (drive.x.position.value(t + interval) - drive.x.position.value(t)) / interval
    return drive.x.velocity.value(t + 0.5 * interval) if drive.x.velocity is not None else 0.0
