"""Warm starts: what to begin a step with, given the impulses of the last one or two steps."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from methods import METHODS
from problems import Problem
from reference import Reference
from sequences import Cost, measure_sequence

from multicor_cli.engine.contact.sweep import System, add_impulses
from multicor_cli.model.model import Floats

Start = Callable[[Problem, Problem | None], Floats]
"""Impulses of the light contacts to start from, given a problem with its warm start, and that of the step before."""


def measure_starts(
    problems: Sequence[Problem], references: Sequence[Reference], *, cap: int, rounds: int, method: str
) -> list[Cost]:
    """Costs of a method on the same problems from different starts; the general contacts start from the last step throughout."""
    costs = []
    for name, start in STARTS.items():
        changed = [
            _started(problem, start(problem, problems[number - 1] if number else None)) for number, problem in enumerate(problems)
        ]
        cost = measure_sequence(changed, references, [METHODS[method]], cap=cap, rounds=rounds)[1]
        costs.append(replace(cost, method=name))
    return costs


def _started(problem: Problem, impulse: Floats) -> Problem:
    """The problem with other impulses of the light contacts, and the velocities that go with them."""
    system = problem.copy()
    none = np.zeros_like(system.general_impulse)
    add_impulses(system._replace(impulse=impulse - system.impulse, general_impulse=none))
    system.impulse[:] = impulse
    return Problem(problem.name, system, problem.scale)


def _matched(now: System, before: System) -> Floats:
    """Warm start of the step before for the present contacts, which are those between the same grains; nan where there is none."""
    keys = [np.minimum(*pair.T).astype(np.int64) << 32 | np.maximum(*pair.T) for pair in (now.pair, before.pair)]
    order = np.argsort(keys[1])
    place = np.minimum(np.searchsorted(keys[1][order], keys[0]), max(0, len(order) - 1))
    found = order[place]
    grains = (now.velocity[now.pair, 3] > 0.0).all(axis=1)  # walls are numbered anew in each step
    return np.where((grains & (keys[1][found] == keys[0]))[:, None], before.impulse[found], np.nan)


def _extrapolate(factor: float) -> Start:
    def start(problem: Problem, before: Problem | None) -> Floats:
        impulse = problem.system.impulse
        if before is None:
            return impulse
        last = _matched(problem.system, before.system)
        moved = np.where(np.isnan(last) | (impulse <= 0.0), impulse, impulse + factor * (impulse - last))
        normal = np.maximum(moved[:, 0], 0.0)
        bound = problem.system.frame[:, 4] * normal
        return np.column_stack([normal, np.clip(np.where(np.isnan(last[:, 1]), impulse[:, 1], moved[:, 1]), -bound, bound)])

    return start


def _scaled(normal: float, tangential: float) -> Start:
    def start(problem: Problem, _before: Problem | None) -> Floats:
        return np.asarray(problem.system.impulse * np.array([normal, tangential]))

    return start


STARTS: dict[str, Start] = {
    "last step": _scaled(1.0, 1.0),
    "zero": _scaled(0.0, 0.0),
    "0.5 × last": _scaled(0.5, 0.5),
    "0.9 × last": _scaled(0.9, 0.9),
    "normal only": _scaled(1.0, 0.0),
    "last + 0.5 change": _extrapolate(0.5),
    "mean of last two": _extrapolate(-0.5),
}
"""The starts, by name."""
