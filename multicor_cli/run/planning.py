"""From a scenario to the plan of its run."""

from __future__ import annotations

from multicor_cli.run.conditions import Condition, RestReached, ShearGauge, StrainReached
from multicor_cli.run.heat_plan import wall_heat
from multicor_cli.run.plan import RunPlan, StageHeat, StagePlan, count_steps
from multicor_cli.scenario.loading import Stage, UntilStrain
from multicor_cli.scenario.scenario import Scenario
from multicor_cli.scenario.settings import Solver
from multicor_cli.solver.settings import Settings
from multicor_cli.state import Model


def make_plan(scenario: Scenario, model: Model) -> RunPlan:
    """The plan of a run.

    Args:
        scenario: What to do.
        model: Grains and walls of the run.

    Raises:
        ValueError: If the strain of a stage is not defined; loading a scenario excludes it.
    """
    drives = scenario.drives(model.walls.names)
    heat = _stage_heat(scenario, model)
    output = scenario.output
    stages = []
    for number, stage in enumerate(scenario.loading):
        solver = scenario.stage_solver(number)
        stages.append(
            StagePlan(
                name=stage_name(stage, number),
                dt=solver.dt,
                step_limit=None if stage.duration is None else count_steps(stage.duration, solver.dt),
                until=_condition(stage, model),
                frame_every=count_steps(output.frame_interval, solver.dt),
                series_every=count_steps(output.series_interval, solver.dt),
                settings=_settings(solver),
                drives=drives[number],
                heat=heat[number],
            )
        )
    return RunPlan(scenario.name, tuple(stages), output.checkpoint_interval, output.contacts)


def _stage_heat(scenario: Scenario, model: Model) -> list[StageHeat | None]:
    if scenario.heat is None:
        return [None] * len(scenario.loading)
    conditions = wall_heat(scenario, model.walls.names)
    return [
        StageHeat(condition, is_on=stage.heat is not False, is_frozen=stage.frozen)
        for condition, stage in zip(conditions, scenario.loading, strict=True)
    ]


def stage_name(stage: Stage, number: int) -> str:
    """Name of a stage; ``stage-0``, ``stage-1`` … where none was given."""
    return stage.name or f"stage-{number}"


def _condition(stage: Stage, model: Model) -> Condition | None:
    if stage.until is None:
        return None
    if isinstance(stage.until, UntilStrain):
        strain = stage.until.strain
        return StrainReached(ShearGauge.between(model, *strain.walls), strain.value)
    return RestReached(stage.until.kinetic_energy_ratio)


def _settings(solver: Solver) -> Settings:
    return Settings(
        method=solver.method,
        local=solver.local,
        tolerance_rms=solver.tolerance_rms,
        tolerance_max=solver.tolerance_max,
        tolerance_energy=solver.tolerance_energy,
        max_sweeps=solver.max_sweeps,
        on_failure=solver.on_failure,
    )
