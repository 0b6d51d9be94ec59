"""Carries a scene, in memory, to where it is measured, and measures it there."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from multicor_cli.bench.rest import Rest, Settling
from multicor_cli.bench.scenes import BenchScene
from multicor_cli.bench.tiling import repeat_scene
from multicor_cli.engine.contact.step_report import StepReport
from multicor_cli.engine.coupled import CoupledEngine
from multicor_cli.model import Model, State
from multicor_cli.packing import build
from multicor_cli.running.controller import Controller
from multicor_cli.running.plan import RunPlan, StagePlan, begin_stage
from multicor_cli.running.planning import make_plan
from multicor_cli.running.session import make_engine
from multicor_cli.scenario import Scenario, parse_scenario


class _NoRecorder:
    """Writes nothing."""

    def frame(self, state: State, contacts: Any) -> None:
        """Ignored."""

    def series(self, state: State) -> None:
        """Ignored."""

    def checkpoint(self, state: State) -> None:
        """Ignored."""

    def stage_ended(self, end: Any) -> None:
        """Ignored."""

    def heartbeat(self, data: dict[str, Any]) -> None:
        """Ignored."""


@dataclass(frozen=True)
class Round:
    """Steps that were measured together.

    Attributes:
        seconds: Time of each step [s].
        solves: That of the solve alone [s].
        shares: Share of each step in which this program had a core; the rest it waited for others.
        phases: Seconds in each phase of the time step.
        reports: What the steps said.
    """

    seconds: list[float]
    solves: list[float]
    shares: list[float]
    phases: dict[str, float]
    reports: list[StepReport]


@dataclass
class PreparedScene:
    """A prepared scene, ready to be timed.

    Attributes:
        scene: The scene.
        model: Its grains and walls.
        engine: Advances it.
        stage: The stage that is measured.
    """

    scene: BenchScene
    model: Model
    engine: CoupledEngine
    stage: StagePlan

    @property
    def state(self) -> State:
        """The state of the scene."""
        return self.engine.state

    def take(self, steps: int, between: Callable[[], None] | None = None) -> Round:
        """Take some steps; ``between`` is called after every fourth, and its time not counted."""
        before = dict(self.engine.timers)
        seconds, solves, shares, reports = [], [], [], []
        for number in range(steps):
            solved, busy, start = self._solve_time(), time.thread_time(), time.perf_counter()
            reports.append(self.engine.step(self.stage.dt, self.state.stage_step * self.stage.dt))
            seconds.append(time.perf_counter() - start)
            shares.append(min(1.0, (time.thread_time() - busy) / seconds[-1]))
            solves.append(self._solve_time() - solved)
            if between is not None and number % 4 == 0:
                between()
        after = self.engine.timers
        return Round(seconds, solves, shares, {name: after[name] - before[name] for name in after}, reports)

    def _solve_time(self) -> float:
        return dict(self.engine.timers).get("solve", 0.0)

    def take_cold(self) -> Round:
        """Take one step whose solve knows nothing of the impulses of the last."""
        self.state.contact_impulse[:] = 0.0
        return self.take(1)


def prepare(scene: BenchScene, grains: int, *, seed: int = 1, threads: int = 1) -> PreparedScene:
    """Bring a scene to where it is measured.

    Args:
        scene: The scene.
        grains: Number of grains; of a tiled scene the nearest multiple of its tile is taken.
        seed: Seed of its sizes and places.
        threads: Number of threads of the part that is measured; preparation takes all.

    Raises:
        NoRestError: If the scene is measured at rest and does not come to rest.
        PhysicsError: From a step.
    """
    count, copies = (scene.tile, max(1, round(grains / scene.tile))) if scene.tile else (grains, 1)
    model, state, plan = _begin(scene, count, seed, copies)
    starts = [0.0]
    if len(plan.stages) > 1:
        starts = _run_to_last(scene, count, seed, model, state)
    if copies > 1 or len(plan.stages) > 1:
        model, state = repeat_scene(model, state, copies) if scene.tile else (model, _fresh(model, state))
    stage = plan.stages[-1]
    engine = make_engine(_scenario(scene, count, seed, copies), model, state, threads)
    begin_stage(engine, stage, starts)
    return PreparedScene(scene, model, engine, stage)


def _scenario(scene: BenchScene, count: int, seed: int, copies: int) -> Scenario:
    return parse_scenario(scene.text(count, seed, copies), Path(f"{scene.name}.toml"))


def _begin(scene: BenchScene, count: int, seed: int, copies: int) -> tuple[Model, State, RunPlan]:
    """The narrow scene, and the plan of the wide one."""
    model, state = build(_scenario(scene, count, seed, 1))
    return model, state, make_plan(_scenario(scene, count, seed, copies), model)


def _run_to_last(scene: BenchScene, count: int, seed: int, model: Model, state: State) -> list[float]:
    """Carry out all stages but the last; returns the times at which the stages began [s]."""
    scenario = _scenario(scene, count, seed, 1)
    own = make_plan(scenario, model)
    engine = make_engine(scenario, model, state, threads=0)
    first, *others = own.stages[:-1]
    rest = Rest.of(model, first.dt) if scene.rests else None
    if rest is not None:
        first = Settling(**vars(first), rest=rest)
    Controller(replace(own, stages=[first, *others]), engine, _NoRecorder()).run(is_new=True)
    if rest is not None:
        rest.check(scene.name, state)
    return [0.0] * (len(own.stages) - 1) + [state.time]


def _fresh(model: Model, state: State) -> State:
    """The same places, velocities and contacts at step 0, with new books."""
    result = State.at_rest(model, state.position)
    for name in ("velocity", "wall_position", "wall_velocity", "contact_i", "contact_j", "contact_impulse", "heat"):
        setattr(result, name, np.array(getattr(state, name)))
    result.last_dt = state.last_dt
    return result
