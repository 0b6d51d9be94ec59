"""Warm starts: what to begin a step with, given the impulses of the last one or two steps."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from methods import METHODS
from numpy.typing import NDArray
from problems import Problem
from reference import Reference
from sequences import Cost, measure_sequence

from multicor_cli.engine.contact.sweep import System, add_impulses
from multicor_cli.engine.jit.vectors import LANES
from multicor_cli.model.columns import INVERSE_MASS, MU, NORMAL, TANGENTIAL
from multicor_cli.model.model import Floats

Start = Callable[[Problem, Problem | None], Floats]
"""Impulses of the diagonal contacts to start from, as in `System`: of a problem with its warm
start, and of the step before."""


def measure_starts(
    problems: Sequence[Problem],
    references: Sequence[Reference],
    *,
    cap: int,
    rounds: int,
    method: str,
) -> list[Cost]:
    """Costs of a method on the same problems from different starts; the general contacts start from
    the last step throughout.
    """
    costs = []
    for name, start in STARTS.items():
        changed = [
            _started(problem, start(problem, problems[number - 1] if number else None))
            for number, problem in enumerate(problems)
        ]
        cost = measure_sequence(changed, references, [METHODS[method]], cap=cap, rounds=rounds)[1]
        costs.append(replace(cost, method=name))
    return costs


def _started(problem: Problem, impulse: Floats) -> Problem:
    """The problem with other impulses of the diagonal contacts, and the velocities that go with
    them.
    """
    system = problem.copy()
    none = np.zeros_like(system.general_impulse)
    add_impulses(system._replace(impulse=impulse - system.impulse, general_impulse=none))
    system.impulse[:] = impulse
    return Problem(problem.name, system, problem.scale)


def _keys(system: System) -> NDArray[np.int64]:
    """The same number for the same two bodies, shape ``(4 q,)``."""
    return (system.pair.min(axis=1).astype(np.int64) << 32 | system.pair.max(axis=1)).ravel()


def _matched(now: System, before: System) -> Floats:
    """Warm start of the step before for the present contacts, which are those between the same
    grains; nan where there is none.
    """
    keys, old_keys = _keys(now), _keys(before)
    order = np.argsort(old_keys)
    place = np.minimum(np.searchsorted(old_keys[order], keys), max(0, len(order) - 1))
    found = order[place]
    # Walls are numbered anew in each step
    is_grain = (now.velocity[now.pair // 4, INVERSE_MASS] > 0.0).all(axis=1)
    is_same = is_grain & (old_keys[found] == keys).reshape(-1, LANES)
    last = before.impulse[found // LANES, :, found % LANES].reshape(-1, LANES, 2).transpose(0, 2, 1)
    return np.where(is_same[:, None], last, np.nan)


def _extrapolate(factor: float) -> Start:
    def start(problem: Problem, before: Problem | None) -> Floats:
        impulse = problem.system.impulse
        if before is None:
            return impulse
        last = _matched(problem.system, before.system)
        moved = np.where(
            np.isnan(last) | (impulse <= 0.0), impulse, impulse + factor * (impulse - last)
        )
        normal = np.maximum(moved[:, NORMAL], 0.0)
        bound = problem.system.frame[:, MU] * normal
        return np.stack([normal, np.clip(moved[:, TANGENTIAL], -bound, bound)], axis=1)

    return start


def _scaled(normal: float, tangential: float) -> Start:
    def start(problem: Problem, _before: Problem | None) -> Floats:
        return np.asarray(problem.system.impulse * np.array([[normal], [tangential]]))

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
