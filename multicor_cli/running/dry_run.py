"""One step of a run, to see whether it would start."""

from __future__ import annotations

from multicor_cli.engine.contact.report import StepReport
from multicor_cli.model import Model, State
from multicor_cli.running.planning import make_plan
from multicor_cli.running.session import make_stepper
from multicor_cli.running.stage import begin_stage
from multicor_cli.scenario.scenario import Scenario


def try_step(scenario: Scenario, model: Model, state: State, threads: int) -> StepReport:
    """Do the first step of a run; nothing is written.

    Args:
        scenario: The scenario.
        model: Its grains and walls.
        state: Its initial state. **Modified.**
        threads: Number of threads.

    Raises:
        ScenarioError: If the domain is too small.
        PhysicsError: If the step fails.
    """
    stage = make_plan(scenario, model).stages[0]
    engine = make_stepper(scenario, model, state, threads)
    engine.exchange()
    begin_stage(engine, stage, [0.0])
    return engine.step(stage.step_after(0), 0.0)
