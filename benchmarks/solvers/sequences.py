"""Runs methods over consecutive steps of a scene: the mean cost of a step at the default
tolerances, and how often they fail.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from comparison import DEFAULT, Curve, iteration_time, middle, trace
from methods import Method
from methods.operators import DISTANCE, TIME, WORK, distance
from problems import Problem
from reference import Reference

from multicor_cli.engine.contact.solve import Outcome, ThreadChoice, solve_system
from multicor_cli.engine.orders import Settings
from multicor_cli.model.model import Floats

_TIMED = 5
"""Problems of a sequence on which iterations are timed, evenly spread."""

_FURTHER = 0.1
"""Methods go on to this times the default tolerances, to see when they come and stay near the
reference."""

NEAR = (3e-2, 1e-2)
"""Distances over u_ref whose times are looked for."""


@dataclass(frozen=True)
class Cost:
    """What steps cost at the default tolerances.

    Attributes:
        method: Name of the method.
        steps: Number of problems.
        mean: Mean sweep-equivalents of a step, those that failed at the cap.
        median: Their median.
        ninety: Their 90th percentile.
        seconds: Mean time of a step [s].
        distance: Mean distance to the reference at the end of a step, over u_ref.
        failures: Steps that did not reach the tolerances.
        near: Median times from which the distance stays below each of `NEAR` [s], where that is
            measured; infinite if most steps never come near.
    """

    method: str
    steps: int
    mean: float
    median: float
    ninety: float
    seconds: float
    distance: float
    failures: int
    near: tuple[float, ...]


def measure_sequence(
    problems: Sequence[Problem],
    references: Sequence[Reference],
    methods: Sequence[Method],
    *,
    cap: int,
    rounds: int,
) -> list[Cost]:
    """Costs of methods on the same problems, which were recorded with the warm starts of the
    program's own solver.

    A step ends with the first iterate that meets the default tolerances; looking for it is left out
    of the time. What that costs the program is in the row "program", its own solver with its own
    checks.

    Args:
        problems: Problems of consecutive steps.
        references: Solutions of these.
        methods: The methods.
        cap: Largest number of iterations.
        rounds: Timed runs on each of a few problems; the median counts, and methods alternate.
    """
    costs = [_measure_program(problems, references, cap, rounds)]
    timed = list(zip(problems, references, strict=True))[:: max(1, len(problems) // _TIMED)]
    compiled = [method for method in methods if not method.times_itself]
    speeds: dict[str, list[float]] = {method.name: [] for method in compiled}
    for problem, reference in timed:
        for _ in range(rounds):
            for method in compiled:
                speeds[method.name].append(
                    iteration_time(problem, reference, method, 100) / problem.contacts
                )
    return costs + [
        _measure(problems, references, method, cap, middle(speeds.get(method.name, [])))
        for method in methods
    ]


def _measure(
    problems: Sequence[Problem],
    references: Sequence[Reference],
    method: Method,
    cap: int,
    speed: float,
) -> Cost:
    """Cost of one method; ``speed`` is the time of an iteration per contact [s]."""
    ends, near, failures = [], [], 0
    for problem, reference in zip(problems, references, strict=True):
        history = trace(problem, reference, method, _FURTHER * DEFAULT.tolerance_rms, cap)
        if not method.times_itself:
            history[:, TIME] = speed * problem.contacts * np.arange(len(history))
        curve = Curve(method.name, history)
        end = curve.first(DEFAULT.tolerance_rms)
        failures += end is None
        ends.append(end or (history[-1, WORK], history[-1, TIME], history[-1, DISTANCE]))
        near.append([np.inf if (moment := curve.near(bound)) is None else moment for bound in NEAR])
    work, seconds, distances = np.array(ends).T
    return _summary(
        method.name,
        work,
        float(seconds.mean()),
        distances,
        failures,
        np.median(near, axis=0).tolist(),
    )


def _measure_program(
    problems: Sequence[Problem], references: Sequence[Reference], cap: int, rounds: int
) -> Cost:
    """The solver as the program calls it, with its checks of the residual, on one thread."""
    settings = Settings(max_sweeps=cap)
    seconds = np.empty((rounds, len(problems)))
    distances = np.empty(len(problems))
    for turn in range(rounds):
        outcomes: list[Outcome] = []
        for number, (problem, reference) in enumerate(zip(problems, references, strict=True)):
            system = problem.copy()
            started = time.perf_counter()
            outcomes.append(solve_system(system, problem.scale, settings, ThreadChoice()))
            seconds[turn, number] = time.perf_counter() - started
            distances[number] = (
                distance(system.velocity, reference.velocity, reference.weight)
                / problem.scale.velocity
            )
    work = np.array([outcome.sweeps for outcome in outcomes])
    failures = sum(not outcome.converged for outcome in outcomes)
    return _summary(
        "program", work, float(np.median(seconds, axis=0).mean()), distances, failures, []
    )


def _summary(
    name: str, work: Floats, seconds: float, distances: Floats, failures: int, near: Sequence[float]
) -> Cost:
    spread = float(work.mean()), float(np.median(work)), float(np.percentile(work, 90.0))
    return Cost(name, len(work), *spread, seconds, float(distances.mean()), failures, tuple(near))
