"""Carries scenarios out in memory, with one solver or another."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from multicor_cli.engine import Engine
from multicor_cli.engine.orders import Method
from multicor_cli.model import Model, State
from multicor_cli.model.state import VARIABLE
from multicor_cli.packing import build
from multicor_cli.running.from_scenario import make_plan
from multicor_cli.running.plan import RunPlan, begin_stage
from multicor_cli.running.session import make_engine
from multicor_cli.scenario import Scenario, parse_scenario


@contextmanager
def nudging(seed: int | None) -> Iterator[None]:
    """While this lasts, packings are nudged with this seed; None leaves the environment as it
    is.
    """
    before = os.environ.get(VARIABLE)
    if seed is not None:
        os.environ[VARIABLE] = str(seed)
    try:
        yield
    finally:
        if before is None:
            os.environ.pop(VARIABLE, None)
        else:
            os.environ[VARIABLE] = before


@dataclass
class Driven:
    """A scenario on its way.

    Attributes:
        scenario: What the user would have written.
        model: Its grains and walls.
        engine: Advances it.
        plan: Its stages.
        method: Method of the contact solver.
        steps: Steps taken.
        unconverged: Steps that were not solved to the tolerances.
        sweeps: Sweep-equivalents of all steps.
    """

    scenario: Scenario
    model: Model
    engine: Engine
    plan: RunPlan
    method: Method
    steps: int = 0
    unconverged: int = 0
    sweeps: float = 0.0

    @property
    def state(self) -> State:
        """The state."""
        return self.engine.state

    def run(self, after_step: Callable[[Driven], None] = lambda _: None) -> Driven:
        """Carry out all stages; returns itself."""
        starts: list[float] = []
        for number, stage in enumerate(self.plan.stages):
            state = self.state
            state.stage, state.stage_step, state.stage_start = number, 0, state.time
            starts.append(state.time)
            begin_stage(self.engine, stage, starts)
            self.engine.resume(
                replace(self.engine.orders, settings=replace(stage.settings, method=self.method))
            )
            for _ in range(stage.step_limit or 0):
                self.step()
                after_step(self)
        return self

    def step(self) -> None:
        """One step of the present stage."""
        dt = self.dt
        report = self.engine.step(dt, self.state.stage_step * dt)
        self.steps += 1
        self.unconverged += not report.converged
        self.sweeps += report.sweeps

    @property
    def dt(self) -> float:
        """Time step of the present stage [s]."""
        return self.plan.stages[self.state.stage].dt

    def branch(self, method: Method, factor: float = 1.0) -> Driven:
        """The same state, to be continued in the present stage by another method, with tolerances
        times a factor.
        """
        state = State.from_dict(
            {name: np.array(value) for name, value in self.state.as_dict().items()}
        )
        stage = self.plan.stages[state.stage]
        engine = make_engine(self.scenario, self.model, state, 1)
        names = ("tolerance_rms", "tolerance_max", "tolerance_energy")
        tolerances = {name: factor * getattr(stage.settings, name) for name in names}
        orders = stage.orders([0.0] * state.stage + [state.stage_start])
        engine.resume(
            replace(orders, settings=replace(stage.settings, method=method, **tolerances))
        )
        return Driven(self.scenario, self.model, engine, self.plan, method)


def begin(text: str, method: Method = "accelerated", nudge: int | None = None) -> Driven:
    """A scenario before its first step."""
    scenario = parse_scenario(text, Path("uniqueness.toml"), [])
    with nudging(nudge):
        model, state = build(scenario)
    return Driven(
        scenario, model, make_engine(scenario, model, state, 1), make_plan(scenario, model), method
    )
