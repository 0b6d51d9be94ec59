"""Is it a solution? Signorini's and Coulomb's laws and the balance of momentum, from the arrays of
a problem alone.

Plain numpy, and nothing of the program's own residuals: what the solver thinks of its result does
not enter.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from multicor_cli.engine import ContactProblem
from multicor_cli.model.model import Floats


@dataclass(frozen=True)
class Violations:
    """Largest violation of each condition over all contacts (bodies), over the largest approach
    velocity.

    Impulses are turned into velocities by the inverse masses of the two bodies.

    Attributes:
        momentum: Velocity that the impulses do not explain; spins times the longest lever.
        approach: Normal velocity below what the gap allows.
        pull: Negative normal impulse.
        both: Smaller of normal impulse and normal velocity: one of them has to be 0.
        cone: Tangential impulse beyond μ p_n.
        slip: Smaller of slip and what the tangential impulse lacks to the cone: one of them has to
            be 0.
        driving: Smaller of slip and tangential impulse where both have the same direction: friction
            has to oppose slip.
    """

    momentum: float
    approach: float
    pull: float
    both: float
    cone: float
    slip: float
    driving: float

    @property
    def worst(self) -> float:
        """The largest of all."""
        return max(asdict(self).values())


def contact_velocity(problem: ContactProblem, velocity: Floats) -> Floats:
    """u_n and u_t of body i relative to the surface of body j at the contacts [m/s], shape
    ``(c, 2)``.
    """
    at_contact = [_velocity_of_side(problem, velocity, side) for side in (0, 1)]
    relative = at_contact[0] - at_contact[1]
    nx, ny = problem.normal.T
    return np.column_stack(
        [
            relative[:, 0] * nx + relative[:, 1] * ny,
            relative[:, 1] * nx - relative[:, 0] * ny - problem.slide,
        ]
    )


def _velocity_of_side(problem: ContactProblem, velocity: Floats, side: int) -> Floats:
    v, lever = velocity[problem.pair[:, side]], problem.lever[:, side]
    return np.column_stack([v[:, 0] - v[:, 2] * lever[:, 1], v[:, 1] + v[:, 2] * lever[:, 0]])


def approach_velocity(problem: ContactProblem) -> float:
    """Largest velocity at which the free motion would break a contact's law [m/s]: the scale of all
    differences.
    """
    return float(-(contact_velocity(problem, problem.velocity)[:, 0] + problem.bias).min())


def pushed(problem: ContactProblem, impulse: Floats) -> Floats:
    """Velocities of the bodies after impulses ``(c, 2)``: v_free + M⁻¹ Hᵀ p, shape ``(b, 3)``."""
    nx, ny = problem.normal.T
    x, y = impulse[:, 0] * nx - impulse[:, 1] * ny, impulse[:, 0] * ny + impulse[:, 1] * nx
    momentum = np.zeros_like(problem.velocity)
    for side, sign in ((0, 1.0), (1, -1.0)):
        lever = problem.lever[:, side]
        turn = lever[:, 0] * y - lever[:, 1] * x
        np.add.at(momentum, problem.pair[:, side], sign * np.column_stack([x, y, turn]))
    return problem.velocity + problem.inverse_mass * momentum


def violations(problem: ContactProblem, impulse: Floats, velocity: Floats) -> Violations:
    """How far impulses ``(c, 2)`` and velocities ``(b, 3)`` are from solving a problem."""
    scale = approach_velocity(problem)
    unexplained = np.abs(velocity - pushed(problem, impulse)) * [
        1.0,
        1.0,
        float(np.abs(problem.lever).max()),
    ]
    u = contact_velocity(problem, velocity)
    u_n, u_t = u[:, 0] + problem.bias, u[:, 1]
    unit = problem.inverse_mass[problem.pair, 0].sum(axis=1)
    p_n, p_t = impulse[:, 0] * unit, impulse[:, 1] * unit
    room = problem.friction * p_n - np.abs(p_t)
    largest = [
        unexplained, np.maximum(-u_n, 0.0), np.maximum(-p_n, 0.0),
        np.minimum(np.abs(p_n), np.abs(u_n)),
        np.maximum(-room, 0.0), np.minimum(np.abs(u_t), np.maximum(room, 0.0)),
        np.where(p_t * u_t > 0.0, np.minimum(np.abs(u_t), np.abs(p_t)), 0.0),
    ]  # fmt: skip
    return Violations(*(float(values.max()) / scale for values in largest))
