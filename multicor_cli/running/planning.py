"""From a scenario to the plan of its run, and from keys ``until`` to conditions that end stages."""

from __future__ import annotations

import math

from multicor_cli.engine.motion.drives import Shifted, Sine
from multicor_cli.engine.motion.spacing import Spacing
from multicor_cli.engine.orders import Settings
from multicor_cli.model import Model
from multicor_cli.model.columns import SPIN, X, Y
from multicor_cli.model.state import State
from multicor_cli.packing.materials import stage_laws
from multicor_cli.running.conditions import (
    BLOCKS,
    Aim,
    Condition,
    DisplacementReached,
    DistanceReached,
    ForceReached,
    RestReached,
    Steady,
    StrainReached,
)
from multicor_cli.running.plan import RunPlan, StageHeat, StagePlan, stage_gravity, wall_heat
from multicor_cli.running.time_step import OSCILLATIONS, Acting, automatic_step, scales_of_stage
from multicor_cli.scenario.checks.stages import MAX_STEPS
from multicor_cli.scenario.problems import Refused
from multicor_cli.scenario.scenario import Scenario
from multicor_cli.scenario.stages import (
    BoundEnd,
    Stage,
    SteadyEnd,
    UntilAxialStrain,
    UntilDisplacement,
    UntilForce,
    UntilRest,
    UntilSteady,
    UntilStrain,
    UntilStress,
)

# ---- Times in steps: how many make up a stage, and how many lie between outputs

_ROUNDING = 1e-9
"""Relative amount by which a time may miss a whole number of steps."""

_LEAST = 0.1
"""Shortest last step of a stage, over the others; with less left, that is added to the last one.
Forces are impulses over the length of a step, and in a very short one what the solver leaves of
velocities would be all that there is to see of them."""


def fit_steps(duration: float, dt: float) -> tuple[int, float | None]:
    """Steps in a duration, at least one; and the duration [s] if the last is not ``dt`` long."""
    count = duration / dt
    if _is_whole(count):
        return round(count), None
    return max(1, math.floor(count) + (count % 1.0 >= _LEAST)), duration


def count_steps(interval: float, dt: float) -> float:
    """Number of steps of ``dt`` in an interval, at least one; whole if it is but for rounding."""
    count = interval / dt
    return max(1, round(count)) if count < 1.0 or _is_whole(count) else count


def _is_whole(count: float) -> bool:
    return round(count) >= 1 and abs(count - round(count)) <= _ROUNDING * count


# ---- From the key `until` of a stage to the condition that ends it

_COLUMN = {"x": X, "y": Y, "spin": SPIN}


def condition_of(stage: Stage, model: Model, dt: float) -> Condition | None:
    """What ends a stage before its duration is over; windows are counted in steps of ``dt`` [s].

    Raises:
        ValueError: If a wall does not exist, or is named twice; loading a scenario excludes it.
    """
    match stage.until:
        case None:
            return None
        case UntilStrain(strain=end):
            return StrainReached(
                Aim("the shear strain", "1", "at least", end.value),
                Spacing.between(model, *end.walls),
            )
        case UntilRest(kinetic_energy_ratio=ratio):
            return RestReached(
                Aim("the kinetic energy over its largest value", "1", "at most", ratio)
            )
        case UntilAxialStrain(axial_strain=end):
            what = f"the axial strain in {end.axis} between {end.walls[0]} and {end.walls[1]}"
            return DistanceReached(
                _aim(what, "1", end), Spacing.between(model, *end.walls, _COLUMN[end.axis])
            )
        case UntilDisplacement(displacement=end):
            of_what, unit = (
                ("the angle turned", "rad")
                if end.axis == "spin"
                else (f"the displacement in {end.axis}", "m")
            )
            aim = _aim(f"{of_what} of {end.wall}", unit, end)
            return DisplacementReached(aim, model.walls.names.index(end.wall), _COLUMN[end.axis])
        case UntilForce(force=end):
            of_what, unit = (
                ("torque", "N m") if end.axis == "spin" else (f"force in {end.axis}", "N")
            )
            aim = _aim(f"the mean {of_what} on {end.wall}", unit, end)
            wall = model.walls.names.index(end.wall)
            return ForceReached(aim, wall, _COLUMN[end.axis], count_steps(end.window, dt), 1.0)
        case UntilStress(stress=end):
            aim = _aim(f"the mean stress in {end.axis} on {end.wall}", "N/m", end)
            wall = model.walls.names.index(end.wall)
            return ForceReached(
                aim,
                wall,
                _COLUMN[end.axis],
                count_steps(end.window, dt),
                float(model.walls.length[wall]),
            )
        case UntilSteady(steady=end):
            return _steady(end, model, dt)


def _aim(quantity: str, unit: str, end: BoundEnd) -> Aim:
    return Aim(quantity, unit, end.relation, end.goal)


def _steady(end: SteadyEnd, model: Model, dt: float) -> Condition:
    axis = X if end.axis is None else _COLUMN[end.axis]
    across = (Y if axis == X else X) if end.of == "friction" else None
    if end.of == "kinetic_energy":
        what = "the kinetic energy"
    elif end.of == "friction":
        what = f"the ratio of the force in {end.axis} to that across on {end.wall}"
    else:
        what = f"the {'torque' if end.axis == 'spin' else f'{end.of} in {end.axis}'} on {end.wall}"
    aim = Aim(f"the drift of {what}", "1", "at most", end.tolerance)
    wall = None if end.wall is None else model.walls.names.index(end.wall)
    return Steady(
        aim, wall, axis, across, count_steps(end.window / BLOCKS, dt), round(end.after / dt)
    )


# ---- The plan


def make_plan(scenario: Scenario, model: Model, state: State | None = None) -> RunPlan:
    """The plan of a run that begins, or that goes on from ``state``.

    The stage under way keeps its time step, even if an earlier version has chosen it.

    Raises:
        ScenarioError: If nothing sets the scale of an automatic time step, it is too short for the
            duration of its stage, or what a wall does to the heat oscillates too often in a step.
        ValueError: If the strain of a stage is not defined; loading a scenario excludes it.
    """
    drives = scenario.drives(model.walls.names)
    heat, gravity, laws = (
        _stage_heat(scenario, model),
        stage_gravity(scenario),
        stage_laws(scenario, model),
    )
    output = scenario.output
    stages = []
    for number, stage in enumerate(scenario.loading):
        solver = scenario.stage_solver(number)
        dt = solver.dt
        if dt == "auto":
            dt = _automatic_step(
                scenario,
                model,
                number,
                Acting(drives[number], gravity[number], heat[number], laws[number]),
            )
        if (
            solver.dt == "auto"
            and state is not None
            and state.stage == number
            and state.stage_step > 0
        ):
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
        what = (
            f"cannot choose a time step for stage {number}: there is no gravity and no load, and "
            "nothing moves"
        )
        raise scenario.refuse(Refused(path, what, "give the time step [s]"))
    if stage.duration is None:
        return dt
    if stage.duration > MAX_STEPS * dt:
        what = (
            f"{stage.duration:g} s are {stage.duration / dt:.2g} steps of the automatic time step "
            f"{dt:g} s"
        )
        what += f", which is set by {scales.set_by}"
        raise scenario.refuse(
            Refused(("loading", number, "duration"), what, f"stay below {MAX_STEPS:g} steps")
        )
    return min(dt, stage.duration)


def _step_so_far(dt: float, duration: float | None, state: State) -> float:
    """Time step of a stage under way: its last one, unless cut from ``dt`` at the end."""
    if duration is None:
        return state.last_dt
    steps, end = fit_steps(duration, dt)
    is_cut = (
        end is not None and state.stage_step == steps and state.last_dt == end - (steps - 1) * dt
    )
    return dt if is_cut else state.last_dt


def _stage_heat(scenario: Scenario, model: Model) -> list[StageHeat | None]:
    if scenario.heat is None:
        return [None] * len(scenario.loading)
    conditions = wall_heat(scenario, model.walls.names)
    return [
        StageHeat(condition, is_on=stage.heat is not False, is_frozen=stage.frozen)
        for condition, stage in zip(conditions, scenario.loading, strict=True)
    ]


def _refuse_fast_heat(
    scenario: Scenario, model: Model, number: int, heat: StageHeat | None, dt: float
) -> None:
    """Refuse signals with too many periods in one step: heat follows each in 16 pieces."""
    if heat is None:
        return
    for name, wall in zip(
        model.walls.names, heat.conditions.started([0.0] * (number + 1)), strict=True
    ):
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
