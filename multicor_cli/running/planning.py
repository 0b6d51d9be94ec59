"""From a scenario to the plan of its run, and from the keys ``until`` of its stages to the conditions that end them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from multicor_cli.engine.contact.solve import Settings
from multicor_cli.engine.motion.drives import Shifted, Sine
from multicor_cli.engine.motion.spacing import Spacing
from multicor_cli.model import Model
from multicor_cli.model.columns import SPIN, X, Y
from multicor_cli.model.state import State
from multicor_cli.packing.laws import stage_laws
from multicor_cli.running.cadence import count_steps, fit_steps
from multicor_cli.running.conditions import (
    BLOCKS,
    Aim,
    Condition,
    DisplacementReached,
    DistanceReached,
    ForceReached,
    RestReached,
    ShearGauge,
    Steady,
    StrainReached,
)
from multicor_cli.running.cycles import Acting
from multicor_cli.running.plan import RunPlan, StageHeat, StagePlan, stage_gravity, wall_heat
from multicor_cli.running.time_step import OSCILLATIONS, automatic_step, scales_of_stage
from multicor_cli.scenario.checks.stages import MAX_STEPS
from multicor_cli.scenario.loading import (
    BoundEnd,
    Stage,
    UntilAxialStrain,
    UntilDisplacement,
    UntilForce,
    UntilRest,
    UntilSteady,
    UntilStrain,
    UntilStress,
)
from multicor_cli.scenario.problems import Refused
from multicor_cli.scenario.scenario import Scenario

# ---- From the key `until` of a stage to the condition that ends it

_COLUMN = {"x": X, "y": Y, "spin": SPIN}


def condition_of(stage: Stage, model: Model, dt: float) -> Condition | None:
    """What ends a stage before its duration is over, if anything does.

    Args:
        stage: The stage.
        model: Grains and walls.
        dt: Time step of the stage [s], in which windows of time are counted.

    Raises:
        ValueError: If a wall does not exist, or is named twice; loading a scenario excludes it.
    """
    if stage.until is None:
        return None
    return _MAKERS[type(stage.until)](stage.until, model, dt)


def _strain(until: UntilStrain, model: Model, dt: float) -> Condition:
    return StrainReached(ShearGauge.between(model, *until.strain.walls), until.strain.value)


def _rest(until: UntilRest, model: Model, dt: float) -> Condition:
    return RestReached(until.kinetic_energy_ratio)


def _axial_strain(until: UntilAxialStrain, model: Model, dt: float) -> Condition:
    end = until.axial_strain
    spacing = Spacing.between(model, *end.walls, _COLUMN[end.axis])
    return DistanceReached(_aim(f"the axial strain in {end.axis} between {end.walls[0]} and {end.walls[1]}", "1", end), spacing)


def _displacement(until: UntilDisplacement, model: Model, dt: float) -> Condition:
    end = until.displacement
    of_what, unit = ("the angle turned", "rad") if end.axis == "spin" else (f"the displacement in {end.axis}", "m")
    return DisplacementReached(_aim(f"{of_what} of {end.wall}", unit, end), _wall(model, end.wall), _COLUMN[end.axis])


def _force(until: UntilForce, model: Model, dt: float) -> Condition:
    end = until.force
    of_what, unit = ("torque", "N m") if end.axis == "spin" else (f"force in {end.axis}", "N")
    sought = _aim(f"the mean {of_what} on {end.wall}", unit, end)
    return ForceReached(sought, _wall(model, end.wall), _COLUMN[end.axis], count_steps(end.window, dt), 1.0)


def _stress(until: UntilStress, model: Model, dt: float) -> Condition:
    end = until.stress
    wall = _wall(model, end.wall)
    sought = _aim(f"the mean stress in {end.axis} on {end.wall}", "N/m", end)
    return ForceReached(sought, wall, _COLUMN[end.axis], count_steps(end.window, dt), float(model.walls.length[wall]))


def _steady(until: UntilSteady, model: Model, dt: float) -> Condition:
    end = until.steady
    wall = None if end.wall is None else _wall(model, end.wall)
    axis = X if end.axis is None else _COLUMN[end.axis]
    across = (Y if axis == X else X) if end.of == "friction" else None
    what = {
        "kinetic_energy": "the kinetic energy",
        "friction": f"the ratio of the force in {end.axis} to that across on {end.wall}",
    }
    if end.axis is not None:
        component = "torque" if end.axis == "spin" else f"{end.of} in {end.axis}"
        what |= dict.fromkeys(("force", "stress"), f"the {component} on {end.wall}")
    sought = Aim(f"the drift of {what[end.of]}", "1", "at most", end.tolerance)
    return Steady(sought, wall, axis, across, count_steps(end.window / BLOCKS, dt), round(end.after / dt))


def _aim(quantity: str, unit: str, end: BoundEnd) -> Aim:
    return Aim(quantity, unit, end.relation, end.goal)


def _wall(model: Model, name: str) -> int:
    return model.walls.names.index(name)


_MAKERS: dict[type, Callable[[Any, Model, float], Condition]] = {
    UntilStrain: _strain,
    UntilRest: _rest,
    UntilAxialStrain: _axial_strain,
    UntilDisplacement: _displacement,
    UntilForce: _force,
    UntilStress: _stress,
    UntilSteady: _steady,
}


# ---- The plan


def make_plan(scenario: Scenario, model: Model, state: State | None = None) -> RunPlan:
    """The plan of a run.

    Args:
        scenario: What to do.
        model: Grains and walls of the run.
        state: Where a run stands that goes on. The stage under way keeps its time step, even if an earlier version has chosen it.

    Raises:
        ScenarioError: If nothing sets the scale of an automatic time step, or it is too short for the duration of its stage; if the
            temperature or heat flow of a wall oscillates too often within a step.
        ValueError: If the strain of a stage is not defined; loading a scenario excludes it.
    """
    drives = scenario.drives(model.walls.names)
    heat, gravity, laws = _stage_heat(scenario, model), stage_gravity(scenario), stage_laws(scenario, model)
    output = scenario.output
    stages = []
    for number, stage in enumerate(scenario.loading):
        solver = scenario.stage_solver(number)
        dt = solver.dt
        if dt == "auto":
            dt = _automatic_step(scenario, model, number, Acting(drives[number], gravity[number], heat[number], laws[number]))
        if solver.dt == "auto" and state is not None and state.stage == number and state.stage_step > 0:
            dt = _step_so_far(dt, stage.duration, state)
        _refuse_fast_heat(scenario, model, number, heat[number], dt)
        rows = count_steps(output.series_interval, dt)
        limit, duration = (None, None) if stage.duration is None else fit_steps(stage.duration, dt)
        stages.append(
            StagePlan(
                name=stage_name(stage, number),
                dt=dt,
                step_limit=limit,
                until=condition_of(stage, model, dt),
                frame_every=count_steps(output.frame_interval, dt),
                series_every=max(1, round(rows)) if output.has_default_series else rows,
                settings=solver.as_record(Settings),
                drives=drives[number],
                heat=heat[number],
                gravity=gravity[number],
                laws=laws[number],
                stops_late=stage.on_timeout == "stop",
                duration=duration,
            )
        )
    return RunPlan(scenario.name, tuple(stages), output)


def _automatic_step(scenario: Scenario, model: Model, number: int, acting: Acting) -> float:
    stage = scenario.loading[number]
    path = ("loading", number, "dt") if stage.dt is not None else ("solver", "dt")
    scales = scales_of_stage(scenario, model, number, acting)
    dt = automatic_step(scales, scenario.output)
    if dt is None:
        what = f"cannot choose a time step for stage {number}: there is no gravity and no load, and nothing moves"
        raise scenario.refuse(Refused(path, what, "give the time step [s]"))
    if stage.duration is None:
        return dt
    if stage.duration > MAX_STEPS * dt:
        what = f"{stage.duration:g} s are {stage.duration / dt:.2g} steps of the automatic time step {dt:g} s"
        what += f", which is set by {scales.set_by}"
        raise scenario.refuse(Refused(("loading", number, "duration"), what, f"stay below {MAX_STEPS:g} steps"))
    return min(dt, stage.duration)


def _step_so_far(dt: float, duration: float | None, state: State) -> float:
    """Time step with which a stage under way has begun: its last one, unless that has been cut from ``dt`` to fit the duration."""
    if duration is None:
        return state.last_dt
    steps, end = fit_steps(duration, dt)
    is_cut = end is not None and state.stage_step == steps and state.last_dt == end - (steps - 1) * dt
    return dt if is_cut else state.last_dt


def _stage_heat(scenario: Scenario, model: Model) -> list[StageHeat | None]:
    if scenario.heat is None:
        return [None] * len(scenario.loading)
    conditions = wall_heat(scenario, model.walls.names)
    return [
        StageHeat(condition, is_on=stage.heat is not False, is_frozen=stage.frozen)
        for condition, stage in zip(conditions, scenario.loading, strict=True)
    ]


def _refuse_fast_heat(scenario: Scenario, model: Model, number: int, heat: StageHeat | None, dt: float) -> None:
    """Heat follows each period of a wall's signal in 16 pieces, so signals with too many periods in one step are refused."""
    if heat is None:
        return
    for name, wall in zip(model.walls.names, heat.conditions.started([0.0] * (number + 1)), strict=True):
        signal = wall.signal.signal if isinstance(wall.signal, Shifted) else wall.signal
        if isinstance(signal, Sine) and dt > OSCILLATIONS * signal.period * (1.0 + 1e-9):
            quantity = "heat flow" if wall.kind == "flow" else "temperature"
            times = f"{dt / signal.period:.3g} times within one step of {dt:g} s"
            what = f"the {quantity} of the wall '{name}' oscillates {times}"
            remedy = "use a shorter dt in this stage, or give the mean of the signal"
            raise scenario.refuse(Refused(("loading", number), what, remedy))


def stage_name(stage: Stage, number: int) -> str:
    """Name of a stage; ``stage-0``, ``stage-1`` … where none was given."""
    return stage.name or f"stage-{number}"
