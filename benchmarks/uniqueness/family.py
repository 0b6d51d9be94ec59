"""Where a solution is one of a whole family: changes of the impulses that keep every contact in its
state.

Sticking contacts must not move, sliding ones must not part. Where these conditions are more than
the motions they exclude, a combination of impulses is left undetermined. Without friction it would
be a stress of the network in itself, which moves nothing. But a sliding contact passes on μ times
what its normal impulse changes by, and that moves grains.
"""

from __future__ import annotations

import numpy as np
from law import approach_velocity, contact_velocity, pushed
from theirs import matrix_of

from multicor_cli.engine import ContactProblem
from multicor_cli.model.model import Floats

_LOADED = 1e-8  # of the largest approach velocity, or of the largest impulse
_SINGULAR = 1e-12  # of the largest singular value


def undetermined(problem: ContactProblem, impulse: Floats) -> list[Floats]:
    """Changes of the impulses ``(c, 2)`` under which, while small, a solution remains one.

    Each is scaled so that the velocity at some contact changes by the largest approach velocity,
    and left out if it moves nothing.
    """
    allowed, forbidden = _moves(problem, impulse)
    matrix = matrix_of(problem)
    _, values, rows = np.linalg.svd(matrix[forbidden] @ allowed)
    changes = [(allowed @ row).reshape(-1, 2) for row in rows[values <= _SINGULAR * values[0]]]
    scale = approach_velocity(problem)
    found = []
    for change in changes:
        moved = contact_velocity(problem, pushed(problem, change)) - contact_velocity(
            problem, problem.velocity
        )
        size = float(np.abs(moved).max())
        if size > 1e-6 * float(np.abs(matrix).max() * np.abs(change).max()):
            found.append(change * (scale / size))
    return found


def _moves(problem: ContactProblem, impulse: Floats) -> tuple[Floats, list[int]]:
    """Impulses that may change, by column, and components n, t of the velocities that must not, by
    index.
    """
    unit = problem.inverse_mass[problem.pair, 0].sum(axis=1) / approach_velocity(problem)
    normal, tangential = impulse.T
    is_loaded = normal * unit > _LOADED
    is_sliding = problem.friction * normal - np.abs(tangential) <= _LOADED * float(normal.max())
    columns, forbidden = [], []
    for k in np.flatnonzero(is_loaded):
        column = np.zeros(impulse.size)
        column[2 * k] = 1.0
        forbidden.append(2 * int(k))
        if is_sliding[k]:
            column[2 * k + 1] = np.sign(tangential[k]) * problem.friction[k]
        else:
            other = np.zeros(impulse.size)
            other[2 * k + 1] = 1.0
            columns.append(other)
            forbidden.append(2 * int(k) + 1)
        columns.append(column)
    return np.array(columns).T, forbidden
