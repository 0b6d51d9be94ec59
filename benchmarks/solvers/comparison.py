"""Runs methods on one problem: the errors after each iteration (not timed), and the time of an
iteration (nothing else done).
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from methods import Method
from methods.operators import DISTANCE, ENERGY, MAXIMUM, RMS, TIME, WORK, record
from problems import Problem
from reference import Reference

from multicor_cli.engine.orders import Settings
from multicor_cli.model.model import Floats

_ENOUGH = 0.5
"""Seconds that one timed run takes at most: beyond, fewer iterations are timed."""

DEFAULT = Settings()
"""Of the program."""


@dataclass(frozen=True)
class Curve:
    """Errors of a method against what it cost.

    Attributes:
        method: Name of the method.
        history: Row 0 is the start, the others the iterates: rms and maximum over u_ref, energy
            over its scale, distance over u_ref, sweep-equivalents, time [s], shape ``(n + 1, 6)``.
    """

    method: str
    history: Floats

    def first(self, rms: float) -> tuple[float, float, float] | None:
        """Sweep-equivalents, time [s] and distance where rms, and the other two residuals in
        proportion, are first reached.
        """
        h, factor = self.history, rms / DEFAULT.tolerance_rms
        bounds = (
            np.array([DEFAULT.tolerance_rms, DEFAULT.tolerance_max, DEFAULT.tolerance_energy])
            * factor
        )
        reached = (h[:, [RMS, MAXIMUM, ENERGY]] <= bounds).all(axis=1)
        if not reached.any():
            return None
        row = int(np.argmax(reached))
        return float(h[row, WORK]), float(h[row, TIME]), float(h[row, DISTANCE])

    def near(self, distance: float) -> float | None:
        """Time [s] from which the distance stays below a bound, to the end of the run; None if it
        does not.
        """
        beyond = np.flatnonzero(self.history[:, DISTANCE] > distance)
        row = int(beyond[-1]) + 1 if beyond.size else 0
        return float(self.history[row, TIME]) if row < len(self.history) else None


def compare(
    problem: Problem,
    reference: Reference,
    methods: Sequence[Method],
    *,
    target: float,
    cap: int,
    rounds: int,
) -> list[Curve]:
    """Curves of some methods on a problem; timed runs of the methods alternate.

    Args:
        problem: The problem.
        reference: Its solution.
        methods: The methods.
        target: rms over u_ref at which a method may stop.
        cap: Largest number of iterations.
        rounds: Number of timed runs of each method; the median counts.
    """
    traces = {method.name: trace(problem, reference, method, target, cap) for method in methods}
    seconds: dict[str, list[Floats]] = {method.name: [] for method in methods}
    for _ in range(rounds):
        for method in methods:
            seconds[method.name].append(
                _times(problem, reference, method, target, cap, len(traces[method.name]) - 1)
            )
    curves = []
    for method in methods:
        history = traces[method.name]
        history[1:, TIME] = np.median(_same_length(seconds[method.name], len(history) - 1), axis=0)
        curves.append(Curve(method.name, history))
    return curves


def tolerances(problem: Problem, rms: float) -> Floats:
    """Tolerances of rms and maximum [m/s] and energy [J] in the proportions of the default
    settings.
    """
    default = np.array([DEFAULT.tolerance_rms, DEFAULT.tolerance_max, DEFAULT.tolerance_energy])
    return np.asarray(default * (rms / DEFAULT.tolerance_rms) * problem.units()[:3])


def trace(
    problem: Problem, reference: Reference, method: Method, target: float, cap: int
) -> Floats:
    """History of a method on a problem, without times unless it takes them itself."""
    start, log = (reference.log(rows, tolerances(problem, target)) for rows in (1, cap))
    record(problem.system, start, 0, 0.0)
    count = method(problem.copy(), cap, log)
    history = np.concatenate([start.rows, log.rows[:count]])
    history[:, :WORK] /= problem.units()
    return history


def _times(
    problem: Problem, reference: Reference, method: Method, target: float, cap: int, count: int
) -> Floats:
    """Times after each of ``count`` iterations in one run [s], shape ``(count,)`` (fewer if
    roundings differ).
    """
    if method.times_itself:
        log = reference.log(max(1, count), tolerances(problem, target))
        return log.rows[: method(problem.copy(), cap, log), TIME]
    return iteration_time(problem, reference, method, count) * np.arange(1.0, count + 1.0)


def iteration_time(problem: Problem, reference: Reference, method: Method, count: int) -> float:
    """Time of an iteration in one run of ``count``, of fewer where that would take long [s]."""
    few = max(1, min(count, 20))
    first = _time(problem, reference, method, few) / few
    enough = min(count, max(few, int(_ENOUGH / first)))
    return first if enough == few else _time(problem, reference, method, enough) / enough


def _time(problem: Problem, reference: Reference, method: Method, count: int) -> float:
    system, nobody = problem.copy(), reference.log(0, np.zeros(3))
    started = time.perf_counter()
    method(system, count, nobody)
    return time.perf_counter() - started


def _same_length(rows: list[Floats], length: int) -> Floats:
    """Times of rounds, the last time repeated where a round took fewer iterations (its roundings
    differed).
    """
    return np.array(
        [np.pad(row[:length], (0, max(0, length - len(row))), mode="edge") for row in rows]
    )


def middle(values: Sequence[float]) -> float:
    """Median; nan of nothing."""
    return statistics.median(values) if values else float("nan")
