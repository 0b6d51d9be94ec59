"""From a scenario to the plan of its run."""

from __future__ import annotations

from multicor_cli.engine.contact.solve import Settings
from multicor_cli.engine.motion.drives import Shifted, Sine
from multicor_cli.model import Model
from multicor_cli.model.state import State
from multicor_cli.packing.laws import stage_laws
from multicor_cli.running.cadence import count_steps, fit_steps
from multicor_cli.running.cycles import Acting
from multicor_cli.running.gravity_plan import stage_gravity
from multicor_cli.running.heat_plan import wall_heat
from multicor_cli.running.plan import RunPlan, StageHeat, StagePlan
from multicor_cli.running.time_step import OSCILLATIONS, automatic_step, scales_of_stage
from multicor_cli.running.until import condition_of
from multicor_cli.scenario.checks.timing import MAX_STEPS
from multicor_cli.scenario.loading import Stage
from multicor_cli.scenario.problems import ScenarioError
from multicor_cli.scenario.scenario import Scenario


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
        raise ScenarioError([scenario.problem(path, what, "give the time step [s]")])
    if stage.duration is None:
        return dt
    if stage.duration > MAX_STEPS * dt:
        what = f"{stage.duration:g} s are {stage.duration / dt:.2g} steps of the automatic time step {dt:g} s"
        what += f", which is set by {scales.set_by}"
        raise ScenarioError([scenario.problem(("loading", number, "duration"), what, f"stay below {MAX_STEPS:g} steps")])
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
            raise ScenarioError([scenario.problem(("loading", number), what, remedy)])


def stage_name(stage: Stage, number: int) -> str:
    """Name of a stage; ``stage-0``, ``stage-1`` … where none was given."""
    return stage.name or f"stage-{number}"
