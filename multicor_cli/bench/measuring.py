"""Measures one scene: what a step costs, in seconds and in sweeps of the C yardstick. Runs in a process of its own."""

from __future__ import annotations

import resource
import statistics
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from multicor_cli.bench.calibration import SweepTimes, time_sweep
from multicor_cli.bench.checks import find_faults
from multicor_cli.bench.driving import Prepared, Round, prepare
from multicor_cli.bench.scenes import SCENES

BUDGET_SWEEPS = 30
"""Sweeps of the step of which everything else may take a quarter (design, budgets)."""


@dataclass(frozen=True)
class Task:
    """What is to be measured.

    Attributes:
        scene: Name of the scene.
        grains: Wanted number of grains.
        threads: Number of threads.
        rounds: How often the measured steps are repeated.
        seed: Seed of the scene.
    """

    scene: str
    grains: int
    threads: int
    rounds: int
    seed: int = 1


@dataclass(frozen=True)
class Result:
    """What a scene costs; times are medians over the rounds.

    Attributes:
        scene: Name of the scene.
        grains: Number of grains n.
        threads: Number of threads.
        steps: Steps of a round.
        rounds: Number of rounds.
        candidates: Contacts of a step, loaded or not, on average.
        loaded: Contacts that carry an impulse, on average.
        sweeps: Sweep-equivalents of a step, on average.
        residual: Largest rms residual of a step over its scale.
        step: Time of a step [s].
        stages: Time in each stage of a step [s].
        grain_steps: n × steps per second [1/s].
        per_contact: Time of the solve per contact and sweep-equivalent, residual checks and momentum included; None where nothing
            moves [s].
        sweep: A single sweep beside that in C; None where nothing moves.
        memory: Peak memory of the process over n, interpreter and libraries left out [B].
        faults: What is wrong with the physics; times mean nothing if there is anything.
    """

    scene: str
    grains: int
    threads: int
    steps: int
    rounds: int
    candidates: float
    loaded: float
    sweeps: float
    residual: float
    step: float
    stages: dict[str, float]
    grain_steps: float
    per_contact: float | None
    sweep: SweepTimes | None
    memory: float
    faults: list[str]

    @property
    def other(self) -> float:
        """Time of a step in everything but the solve [s]."""
        return sum(seconds for name, seconds in self.stages.items() if name != "solve")

    @property
    def other_share(self) -> float | None:
        """Part of everything but the solve in a step with `BUDGET_SWEEPS` sweeps; None where nothing moves."""
        if self.per_contact is None:
            return None
        solve = BUDGET_SWEEPS * self.candidates * self.per_contact
        return self.other / (self.other + solve)

    def as_dict(self) -> dict[str, Any]:
        """Everything as JSON types."""
        data = asdict(self)
        if self.sweep is not None:
            data["sweep"]["bandwidth"] = self.sweep.bandwidth
        return {**data, "other": self.other, "other_share": self.other_share}


def measure(task: Task) -> Result:
    """Prepare a scene and measure it."""
    idle = _peak_memory()
    scene = SCENES[task.scene]
    prepared = prepare(scene, task.grains, seed=task.seed, threads=task.threads)
    rounds = [prepared.take(scene.warm_steps)]
    rounds += [prepared.take(scene.steps) for _ in range(task.rounds)]
    memory = (_peak_memory() - idle) / prepared.model.grain_count
    faults = find_faults(prepared, rounds)
    sweep = None if scene.is_frozen else _measure_sweep(prepared, task.threads)
    return _summarize(prepared, task, rounds[1:], sweep, memory, faults)


def _measure_sweep(prepared: Prepared, threads: int) -> SweepTimes:
    stage, state = prepared.stage, prepared.state
    ordered = prepared.engine.mechanics.next_system(stage.dt, state.stage_step * stage.dt)
    return time_sweep(ordered.system, (1, threads) if threads > 1 else (1,))


def _summarize(
    prepared: Prepared, task: Task, rounds: list[Round], sweep: SweepTimes | None, memory: float, faults: list[str]
) -> Result:
    reports = [report for round_ in rounds for report in round_.reports]
    steps = prepared.scene.steps
    step = statistics.median(seconds for round_ in rounds for seconds in round_.seconds)
    stages = {name: statistics.median(round_.stages[name] for round_ in rounds) / steps for name in rounds[0].stages}
    relaxed = [sum(report.sweeps * report.candidates for report in round_.reports) for round_ in rounds]
    moving = not prepared.scene.is_frozen and min(relaxed) > 0.0
    return Result(
        scene=task.scene,
        grains=prepared.model.grain_count,
        threads=task.threads,
        steps=steps,
        rounds=task.rounds,
        candidates=float(np.mean([report.candidates for report in reports])),
        loaded=float(np.mean([report.contacts for report in reports])),
        sweeps=float(np.mean([report.sweeps for report in reports])),
        residual=max(report.rms for report in reports),
        step=step,
        stages=stages,
        grain_steps=prepared.model.grain_count / step,
        per_contact=statistics.median(r.stages["solve"] / n for r, n in zip(rounds, relaxed, strict=True)) if moving else None,
        sweep=sweep,
        memory=memory,
        faults=faults,
    )


def _peak_memory() -> float:
    """Peak resident memory of this process so far [B]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024.0
