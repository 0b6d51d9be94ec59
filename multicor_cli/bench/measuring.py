"""Measures what a step of a scene costs, also beside the yardsticks, in a process of its own."""

from __future__ import annotations

import resource
import statistics
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from multicor_cli.bench.driving import NoRestError, PreparedScene, Round, prepare
from multicor_cli.bench.scenes import SCENES
from multicor_cli.bench.yardsticks import ReferenceStep, SweepTimes, time_sweep
from multicor_cli.engine.orders import PhysicsError
from multicor_cli.model import BOOK_NAMES, HEAT_BOOK_NAMES, TALLY_NAMES

BUDGET_SWEEPS = 30
"""Sweeps of the step of which everything else may take a quarter (benchmarks/README.md)."""

_COLD = 2  # steps without a warm start after each round, where the grains rest


@dataclass(frozen=True)
class Task:
    """What is to be measured: a scene of about so many grains, its steps in so many rounds."""

    scene: str
    grains: int
    threads: int
    rounds: int
    seed: int = 1


@dataclass(frozen=True)
class Result:
    """What a scene costs; times, also those of phases, are medians over the rounds [s].

    Attributes:
        grains: Number of grains n.
        steps: Steps of a round.
        candidates: Contacts of a step, loaded or not, on average.
        loaded: Contacts that carry an impulse, on average.
        sweeps: Sweep-equivalents of a step, on average.
        median_sweeps: Their median over the steps, which single hard steps do not change.
        cold_sweeps: Median without a warm start; None where the grains do not rest.
        residual: Largest rms residual of a step over its scale.
        step: Time of a step [s].
        grain_steps: n × steps per second [1/s].
        per_contact: Time of the solve per contact and sweep-equivalent, residual checks and
            momentum included: lower quartile over the steps; where the grains rest, of those
            without a warm start. None where nothing moves [s].
        reference: Time of a step of the yardstick for everything but the solve, lower quartile [s].
        other_ratio: Everything but the solve of a step over that, lower quartiles over steps taken
            by turns.
        sweep: A single sweep beside that in C; None where nothing moves.
        memory: Peak memory of the process over n before the yardsticks, interpreter and libraries
            left out [B].
        faults: What is wrong with the physics; times mean nothing if there is anything.
    """

    scene: str
    grains: int
    threads: int
    steps: int
    rounds: int
    candidates: float = 0.0
    loaded: float = 0.0
    sweeps: float = 0.0
    median_sweeps: float = 0.0
    cold_sweeps: float | None = None
    missed: int = 0
    residual: float = 0.0
    step: float = 0.0
    phases: dict[str, float] = field(default_factory=dict)
    grain_steps: float = 0.0
    per_contact: float | None = None
    reference: float = 0.0
    other_ratio: float = 0.0
    sweep: SweepTimes | None = None
    memory: float = 0.0
    faults: list[str] = field(default_factory=list)

    @property
    def other(self) -> float:
        """Time of a step in everything but the solve [s]."""
        return sum(seconds for name, seconds in self.phases.items() if name != "solve")

    @property
    def other_share(self) -> float | None:
        """Of everything but the solve, in a step of `BUDGET_SWEEPS`; None where nothing moves."""
        if self.per_contact is None:
            return None
        solve = BUDGET_SWEEPS * self.candidates * self.per_contact
        return self.other / (self.other + solve)

    def as_dict(self) -> dict[str, Any]:
        data = asdict(self)
        if self.sweep is not None:
            data["sweep"]["bandwidth"] = self.sweep.bandwidth
        return {**data, "other": self.other, "other_share": self.other_share}


def measure(task: Task) -> Result:
    """Prepare a scene and measure it. If its physics fails on the way, that is the only fault."""
    idle = _peak_memory()
    scene = SCENES[task.scene]
    references: list[float] = []  # times of the yardstick among the steps of the rounds [s]
    try:
        prepared = prepare(scene, task.grains, seed=task.seed, threads=task.threads)
        warm = prepared.take(scene.warm_steps)
        memory = (_peak_memory() - idle) / prepared.model.grain_count
        yardstick = ReferenceStep(prepared.model.grain_count)
        rounds = [
            prepared.take(scene.steps, lambda: references.append(yardstick.seconds()))
            for _ in range(task.rounds)
        ]
        is_cold = scene.rests and not scene.is_frozen
        cold_rounds = [prepared.take_cold() for _ in range(_COLD * task.rounds if is_cold else 0)]
    except (NoRestError, PhysicsError) as error:
        faults = [str(error)]
        about = (task.scene, task.grains, task.threads, scene.steps, task.rounds)
        return Result(*about, faults=faults)
    faults = find_faults(prepared, [warm, *rounds, *cold_rounds])
    sweep = None
    if not scene.is_frozen:
        stage, state = prepared.stage, prepared.state
        ordered = prepared.engine.next_system(stage.dt, state.stage_step * stage.dt)
        sweep = time_sweep(ordered.system, (1, task.threads) if task.threads > 1 else (1,))

    reports = [report for round_ in rounds for report in round_.reports]
    sweeps = [report.sweeps for report in reports]
    cold_sweeps = [report.sweeps for round_ in cold_rounds for report in round_.reports]
    step = statistics.median(seconds for round_ in rounds for seconds in round_.seconds)
    phases = {name: [round_.phases[name] for round_ in rounds] for name in rounds[0].phases}
    return Result(
        scene=task.scene, grains=prepared.model.grain_count, threads=task.threads,
        steps=scene.steps, rounds=task.rounds,
        candidates=statistics.fmean(report.candidates for report in reports),
        loaded=statistics.fmean(report.contacts for report in reports),
        sweeps=statistics.fmean(sweeps), median_sweeps=statistics.median(sweeps),
        cold_sweeps=statistics.median(cold_sweeps) if cold_sweeps else None,
        missed=sum(not report.converged for report in reports),
        residual=max(report.rms for report in reports), step=step,
        phases={name: statistics.median(each) / scene.steps for name, each in phases.items()},
        grain_steps=prepared.model.grain_count / step,
        per_contact=None if scene.is_frozen else _per_contact(cold_rounds or rounds),
        reference=_quartile(references), other_ratio=other_time(rounds) / _quartile(references),
        sweep=sweep, memory=memory, faults=faults,
    )  # fmt: skip


def other_time(rounds: list[Round]) -> float:
    """Time per step outside the solve, corrected for time lost to other programs [s].

    The loss is known only per step, not where in the step it occurred. If the solve takes less than
    half of a step, the time outside it is scaled by the share of CPU that the step had; otherwise
    only the quarter of the steps with the least loss is used, or all steps with hardly any.
    """
    each = [(round_.seconds, round_.solves, round_.shares) for round_ in rounds]
    seconds, solves, shares = np.concatenate([np.array(columns) for columns in each], axis=1)
    if 2.0 * float(np.median(solves / seconds)) < 1.0:
        return _quartile(list((seconds - solves) * shares))
    return _quartile(list((seconds - solves)[shares >= np.percentile(shares, 75.0) - 0.01]))


def _per_contact(rounds: list[Round]) -> float | None:
    """The solve per contact and sweep-equivalent [s], without waiting; None where nothing moves."""
    each = [
        solve * share / (report.sweeps * report.candidates)
        for round_ in rounds
        for solve, share, report in zip(round_.solves, round_.shares, round_.reports, strict=True)
        if report.sweeps * report.candidates > 0.0
    ]
    return _quartile(each) if each else None


def _quartile(seconds: list[float]) -> float:
    """What the work itself takes: half of the steps may have waited for other programs."""
    return float(np.percentile(seconds, 25.0))


def _peak_memory() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024.0


# ---- Physics that must hold in a scene before any time of it is reported

CLOSURE, OVERLAP, WEIGHT, MISSED = 1e-10, 1e-3, 0.01, 0.01


def find_faults(prepared: PreparedScene, rounds: list[Round]) -> list[str]:
    """What is wrong after the measured steps; empty if nothing is.

    Energy books closed to `CLOSURE`, heat books too; overlaps below `OVERLAP` of the smaller
    radius; at most `MISSED` of the steps not converged (one in a thousand is not in the fast shear
    flow: whether it is among those measured is chance); the floor of a bed carries its weight to
    `WEIGHT`; temperatures between those that walls and grains had at the start.
    """
    state, model, faults = prepared.state, prepared.model, []
    closure = state.books[BOOK_NAMES.index("closure")]
    if not closure <= CLOSURE:
        faults.append(f"the energy books are open by {closure:.1e}")
    overlap = state.tallies[TALLY_NAMES.index("max_overlap")]
    if not overlap <= OVERLAP:
        faults.append(f"grains overlap by {overlap:.1e} of their radius")
    missed = sum(not report.converged for round_ in rounds for report in round_.reports)
    if missed > MISSED * sum(len(round_.reports) for round_ in rounds):
        faults.append(f"{missed} steps did not converge")
    if prepared.scene.is_weighed:
        # the window sums the impulse on the floor since the scene began
        weight = float(model.grains.mass.sum()) * float(np.hypot(*model.gravity))
        force = -float(state.window_wall_impulse[0, 1]) / (state.stage_step * prepared.stage.dt)
        if not abs(force / weight - 1.0) <= WEIGHT:
            faults.append(f"the floor carries {force / weight:.4f} of the weight")
    if model.thermal is not None:
        closure = state.heat_books[HEAT_BOOK_NAMES.index("closure")]
        if not closure <= CLOSURE:
            faults.append(f"the heat books are open by {closure:.1e}")
        temperature = state.temperature(model.thermal)
        of_walls = state.wall_temperature[np.isfinite(state.wall_temperature)]
        known = np.concatenate([model.thermal.initial_temperature, of_walls])
        if not known.min() - 1e-6 <= temperature.min() <= temperature.max() <= known.max() + 1e-6:
            faults.append(f"temperatures from {temperature.min():g} to {temperature.max():g} K")
        if not state.heat_books[HEAT_BOOK_NAMES.index("stored")] > 0.0:
            faults.append("no heat has come in")
    return faults
