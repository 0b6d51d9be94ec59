"""Distances to a solution: the residual is what a method can see, the error of the velocities is
what it leaves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from methods.operators import COLUMNS, Log, distance, masses
from problems import Problem

from multicor_cli.engine.contact.solve import ThreadChoice, solve_system
from multicor_cli.engine.contact.sweep import System
from multicor_cli.engine.orders import Settings
from multicor_cli.model.model import Floats

RMS = 1e-6
"""rms over u_ref to which references are solved."""

_STAGES = (1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 3e-6, RMS)
_RELAXATIONS = 1e9
_FEWEST, _MOST = 2_000, 200_000


@dataclass(frozen=True)
class Reference:
    """A solution of a problem by the program's solver, from the start of the problem.

    Attributes:
        velocity: Its velocities, bodies only, as in `System`, shape ``(b, 4)``.
        weight: Mass of each velocity over the mass of all bodies that can move, shape ``(b, 4)``.
        rms: Residual that it was solved to, over u_ref.
    """

    velocity: Floats
    weight: Floats
    rms: float

    def log(self, rows: int, stop: Floats) -> Log:
        """A log with room for so many iterations."""
        return Log(np.zeros((rows, COLUMNS)), stop, self.velocity, self.weight)


def solve_closely(problem: Problem) -> Reference:
    """Solve a problem to `RMS` in stages, or as far as 10⁹ relaxed contacts lead (2,000 sweeps at
    least, 200,000 at most).
    """
    system, reached = problem.copy(), np.inf
    left = int(min(max(_RELAXATIONS / problem.contacts, _FEWEST), _MOST))
    best = system.velocity.copy()
    for rms in _STAGES:
        settings = Settings(
            tolerance_rms=rms, tolerance_max=np.inf, tolerance_energy=np.inf, max_sweeps=left
        )
        outcome = solve_system(system, problem.scale, settings, ThreadChoice())
        left -= int(outcome.sweeps)
        if outcome.rms < reached:
            best, reached = system.velocity.copy(), outcome.rms
        if not outcome.converged or left < 1:
            break
    return Reference(best[: len(system.inverse)], mass_shares(system), reached)


def mass_shares(system: System) -> Floats:
    """Mass of each velocity over the mass of all bodies that can move, shape ``(b, 4)``; walls
    count where they can move.
    """
    weight = masses(system)
    return np.asarray(weight / max(float(weight[:, :2].max(axis=1).sum()), np.finfo(float).tiny))


def separation(problem: Problem, one: Reference, other: Reference) -> float:
    """Distance between two solutions of a problem, over u_ref."""
    return float(distance(one.velocity, other.velocity, one.weight)) / problem.scale.velocity
