"""From the tables of a scenario to what its run carries out: stages, their ends, heat, releases."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from multicor_cli.arithmetic import hypot
from multicor_cli.engine.heat.walls import WallHeat
from multicor_cli.engine.motion.drives import (
    AnyGravity,
    Constant,
    Gravity,
    Shifted,
    Sine,
    Spacing,
    TiltedGravity,
)
from multicor_cli.engine.orders import InflowRules, Outlet, Release, Settings
from multicor_cli.model import Model
from multicor_cli.model.cell import COMPONENTS
from multicor_cli.model.columns import SPIN, YY, X, Y
from multicor_cli.model.model import Floats
from multicor_cli.model.shapes import Rectangle
from multicor_cli.model.state import State
from multicor_cli.packing.materials import stage_laws
from multicor_cli.running.conditions import (
    BLOCKS,
    Aim,
    CellSteady,
    CellStrainReached,
    CellStressReached,
    Condition,
    DisplacementReached,
    DistanceReached,
    ForceReached,
    RestReached,
    Steady,
    StrainReached,
)
from multicor_cli.running.plan import RunPlan, StageGravity, StageHeat, StagePlan
from multicor_cli.running.time_step import OSCILLATIONS, Acting, automatic_step, scales_of_stage
from multicor_cli.scenario.checks.stages import MAX_STEPS
from multicor_cli.scenario.drives import (
    CapacityCondition,
    FlowCondition,
    TemperatureCondition,
    TiltedGravityTable,
    WallCondition,
)
from multicor_cli.scenario.heat import AverageForce
from multicor_cli.scenario.particles import ParticleGroup
from multicor_cli.scenario.problems import Refused
from multicor_cli.scenario.scenario import Scenario
from multicor_cli.scenario.stage_drives import engine_signal
from multicor_cli.scenario.stages import (
    BoundEnd,
    CellSteadyEnd,
    CellStrainEnd,
    CellStressEnd,
    Stage,
    SteadyEnd,
    StrainEnd,
    StressEnd,
    UntilAxialStrain,
    UntilDisplacement,
    UntilForce,
    UntilRest,
    UntilSteady,
    UntilStrain,
    UntilStress,
)

if TYPE_CHECKING:  # a plan is made without Numba, which these load
    from multicor_cli.engine.heat.mechanism import HeatLaws
    from multicor_cli.engine.heat.settings import HeatSettings

# ---- Gravity, and the walls' thermal conditions: each holds until a stage names another


def stage_gravity(scenario: Scenario) -> list[StageGravity]:
    """Gravity of all stages; that of ``[domain]`` until a stage names another."""
    x, y = scenario.domain.gravity
    current: AnyGravity = Gravity(Constant(x), Constant(y))
    named_by, found = None, []
    for number, stage in enumerate(scenario.loading):
        if isinstance(table := stage.gravity, TiltedGravityTable):
            magnitude = hypot(x, y) if table.magnitude is None else table.magnitude
            current = TiltedGravity(engine_signal(table.angle), engine_signal(magnitude))
        elif table is not None:
            current = Gravity(engine_signal(table[0]), engine_signal(table[1]))
        named_by = number if table is not None else named_by
        found.append(StageGravity(number, current, number if named_by is None else named_by))
    return found


def wall_heat(scenario: Scenario, wall_names: Sequence[str]) -> list[StageHeat]:
    """What heat does in all stages, with the conditions of all walls in the order of the engine."""
    initial = math.nan if scenario.heat is None else scenario.heat.temperature
    kept = scenario.wall_conditions(tuple(wall_names))
    return [
        StageHeat(
            number,
            tuple(_engine_condition(wall.condition, initial) for wall in walls),
            tuple(wall.stage for wall in walls),
            is_on=stage.heat is not False,
            is_frozen=stage.frozen,
        )
        for number, (stage, walls) in enumerate(zip(scenario.loading, kept, strict=True))
    ]


def _engine_condition(condition: WallCondition, fallback: float) -> WallHeat:
    if isinstance(condition, CapacityCondition):
        initial = math.nan if condition.initial is None else condition.initial
        return WallHeat("capacity", capacity=condition.capacity, initial=initial, fallback=fallback)
    if isinstance(condition, TemperatureCondition):
        return WallHeat("temperature", engine_signal(condition.temperature))
    if isinstance(condition, FlowCondition):
        return WallHeat("flow", engine_signal(condition.flow))
    return WallHeat()


# ---- What the heat engine is told of the whole run


def heat_settings(scenario: Scenario, model: Model) -> HeatSettings | None:
    """The choices about heat, materials ordered as in the model; None without ``[heat]``."""
    from multicor_cli.engine.heat.settings import MECHANISMS, ContactForce, HeatSettings

    heat = scenario.heat
    if heat is None:
        return None
    force = ContactForce()
    if isinstance(heat.force, AverageForce):
        force = ContactForce("average", heat.force.average)
    elif heat.force is not None:
        force = ContactForce("prescribed", heat.force.prescribed)
    return heat.as_record(
        HeatSettings,
        laws=heat_laws_of(scenario, model.materials),
        force=force,
        mechanisms=tuple(
            table.as_record(MECHANISMS[key]) for key, table in heat.mechanisms.items()
        ),
    )


def heat_laws_of(scenario: Scenario, materials: Sequence[str]) -> HeatLaws:
    """Thermal properties of materials, in the model's order, and of their pairs: `heat_laws`."""
    from multicor_cli.engine.heat.settings import heat_laws

    if scenario.heat is None:
        raise ValueError("a scenario without [heat] has no heat laws")

    def wear(a: str, b: str) -> float:
        """Archard's coefficient; 0 without wear, or if they cannot touch."""
        is_covered = any(entry.covers(a, b) for entry in scenario.contacts)
        return (scenario.law(a, b).wear if is_covered else None) or 0.0

    tables = [scenario.materials[name].model_dump() for name in materials]
    wears = np.array([[wear(a, b) for b in materials] for a in materials], float)
    return heat_laws(tables, scenario.heat.partition, wears)


# ---- The rules by which grains come and go

TRIES = 100
"""Places tried for each release."""


def inflow_rules(scenario: Scenario, model: Model) -> InflowRules:
    """The rules of a run with all its grains, as in ``model``."""
    groups = enumerate(scenario.particles)
    releases = (_release(scenario, model, number, group) for number, group in groups)
    outlets = (
        Outlet(outlet.region.area(), outlet.then == "release") for outlet in scenario.outlets
    )
    limits = None
    if scenario.domain.lost != "ignore":
        limits = Rectangle(*scenario.domain.around(2.0 * float(model.grains.radius.max())))
    return InflowRules(
        tuple(release for release in releases if release is not None),
        tuple(outlets),
        limits,
        scenario.domain.lost == "stop",
    )


def _release(scenario: Scenario, model: Model, number: int, group: ParticleGroup) -> Release | None:
    from multicor_cli.packing.sizes import Purpose, TableKind, stream

    table = group.release
    if table is None:
        return None

    def draw(release: int) -> Floats:
        drawn = stream(scenario.seed, TableKind.PARTICLES, number, Purpose.RELEASE, release)
        return drawn.random((TRIES, 2))

    angles = np.empty(0)
    if group.outline is not None:  # those that `packing` has drawn, or the group says
        from multicor_cli.packing.groups import angles_of

        count = int(np.count_nonzero(model.grains.group == number))
        angles = angles_of(
            group, count, partial(stream, scenario.seed, TableKind.PARTICLES, number)
        )
    rate = table.rate if table.rate is not None else table.mass_rate
    assert rate is not None  # the scenario has been checked
    return Release(
        group=number,
        rate=rate,
        is_mass=table.mass_rate is not None,
        start=table.start,
        region=table.region.area(),
        spans_period=scenario.domain.is_spanned(table.region.min[0], table.region.max[0]),
        velocity=(*group.velocity, group.spin),
        angles=angles,
        draw=draw,
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

    def aim(quantity: str, unit: str, end: BoundEnd) -> Aim:
        return Aim(quantity, unit, end.relation, end.goal)

    if model.is_cell and (condition := _condition_of_cell(stage, dt)) is not None:
        return condition
    match stage.until:
        case None:
            return None
        case UntilStrain(strain=StrainEnd() as end):
            goal = Aim("the shear strain", "1", "at least", end.value)
            return StrainReached(goal, Spacing.between(model, *end.walls))
        case UntilRest(kinetic_energy_ratio=ratio):
            what = "the kinetic energy over its largest value"
            return RestReached(Aim(what, "1", "at most", ratio))
        case UntilAxialStrain(axial_strain=end):
            what = f"the axial strain in {end.axis} between {end.walls[0]} and {end.walls[1]}"
            spacing = Spacing.between(model, *end.walls, _COLUMN[end.axis])
            return DistanceReached(aim(what, "1", end), spacing)
        case UntilDisplacement(displacement=end):
            is_spin = end.axis == "spin"
            what = "the angle turned" if is_spin else f"the displacement in {end.axis}"
            goal = aim(f"{what} of {end.wall}", "rad" if is_spin else "m", end)
            return DisplacementReached(goal, model.walls.names.index(end.wall), _COLUMN[end.axis])
        case UntilForce(force=end) | UntilStress(stress=StressEnd() as end):
            wall, length = model.walls.names.index(end.wall), 1.0
            what, unit = f"force in {end.axis}", "N"
            if isinstance(stage.until, UntilStress):
                what, unit = f"stress in {end.axis}", "N/m"
                length = float(model.walls.length[wall])
            elif end.axis == "spin":
                what, unit = "torque", "N m"
            goal = aim(f"the mean {what} on {end.wall}", unit, end)
            return ForceReached(goal, wall, _COLUMN[end.axis], count_steps(end.window, dt), length)
        case UntilSteady(steady=SteadyEnd() as end):
            return _steady(end, model, dt)
    raise TypeError(f"no condition for {type(stage.until).__name__}")


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
    return Steady(aim, wall, axis, across, *_blocks(end, dt))


def _condition_of_cell(stage: Stage, dt: float) -> Condition | None:
    """As `condition_of`, if it is about the strain or stress of a cell."""
    match stage.until:
        case UntilStrain(strain=CellStrainEnd() as end):
            aim = Aim(f"the strain {end.cell} of the cell", "1", "at least", end.value)
            return CellStrainReached(aim, COMPONENTS.index(end.cell))
        case UntilStress(stress=CellStressEnd() as end):
            what = f"the mean stress {end.cell} of the grains"
            aim, steps = Aim(what, "N/m", end.relation, end.goal), count_steps(end.window, dt)
            return CellStressReached(aim, 0, COMPONENTS.index(end.cell), steps, 1.0)
        case UntilSteady(steady=CellSteadyEnd() as end):
            is_friction = end.of == "friction"
            what = f"the stress {end.cell} of the grains"
            what += " over the pressure" if is_friction else ""
            aim = Aim(f"the drift of {what}", "1", "at most", end.tolerance)
            across = YY if is_friction else None
            return CellSteady(aim, 0, COMPONENTS.index(end.cell), across, *_blocks(end, dt))
    return None


def _blocks(end: SteadyEnd | CellSteadyEnd, dt: float) -> tuple[float, int]:
    """Steps of a block, and those that are left out at first."""
    return count_steps(end.window / BLOCKS, dt), round(end.after / dt)


# ---- The plan


def make_plan(scenario: Scenario, model: Model, state: State | None = None) -> RunPlan:
    """The plan of a run that begins, or that goes on from ``state``.

    The stage under way keeps its time step, even if an earlier version has chosen it.

    Raises:
        ScenarioError: If nothing sets the scale of an automatic time step, it is too short for the
            duration of its stage, or what a wall does to the heat oscillates too often in a step.
        ValueError: If the strain of a stage is not defined; loading a scenario excludes it.
    """
    names = model.walls.names
    drives, output, stages = scenario.drives(names), scenario.output, []
    gravity, laws = stage_gravity(scenario), stage_laws(scenario, model)
    heat: Sequence[StageHeat | None] = (
        [None] * len(drives) if scenario.heat is None else wall_heat(scenario, names)
    )
    for number, stage in enumerate(scenario.loading):
        solver = scenario.stage_solver(number)
        dt = solver.dt
        if dt == "auto":
            acting = Acting(drives[number], gravity[number], heat[number], laws[number])
            dt = _automatic_step(scenario, model, number, acting)
            if state is not None and state.stage == number and state.stage_step > 0:
                dt = _step_so_far(dt, stage.duration, state)
        _refuse_fast_heat(scenario, model, number, heat[number], dt)
        rows = count_steps(output.series_interval, dt)
        limit, duration = (None, None) if stage.duration is None else fit_steps(stage.duration, dt)
        stages.append(
            StagePlan(
                name=stage_names(scenario)[number],
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
            f"{dt:g} s, which is set by {scales.set_by}"
        )
        path = ("loading", number, "duration")
        raise scenario.refuse(Refused(path, what, f"stay below {MAX_STEPS:g} steps"))
    return min(dt, stage.duration)


def _step_so_far(dt: float, duration: float | None, state: State) -> float:
    """Time step of a stage under way: its last one, unless cut from ``dt`` at the end."""
    if duration is None:
        return state.last_dt
    steps, end = fit_steps(duration, dt)
    is_cut = end is not None and state.last_dt == end - (steps - 1) * dt
    return dt if is_cut and state.stage_step == steps else state.last_dt


def _refuse_fast_heat(
    scenario: Scenario, model: Model, number: int, heat: StageHeat | None, dt: float
) -> None:
    """Refuse signals with too many periods in one step: heat follows each in 16 pieces."""
    if heat is None:
        return
    walls = heat.started([0.0] * (number + 1))
    for name, wall in zip(model.walls.names, walls, strict=True):
        signal = wall.signal.signal if isinstance(wall.signal, Shifted) else wall.signal
        if isinstance(signal, Sine) and dt > OSCILLATIONS * signal.period * (1.0 + 1e-9):
            quantity = "heat flow" if wall.kind == "flow" else "temperature"
            times = f"{dt / signal.period:.3g} times within one step of {dt:g} s"
            what = f"the {quantity} of the wall '{name}' oscillates {times}"
            remedy = "use a shorter dt in this stage, or give the mean of the signal"
            raise scenario.refuse(Refused(("loading", number), what, remedy))


def stage_names(scenario: Scenario) -> list[str]:
    """Names of all stages; ``stage-0``, ``stage-1`` … where none was given."""
    return [stage.name or f"stage-{number}" for number, stage in enumerate(scenario.loading)]
