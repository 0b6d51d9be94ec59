"""Anderson acceleration of sweeps: the combination of the last few sweeps whose change is smallest
in the metric of the masses.
"""

from __future__ import annotations

import numpy as np

from methods.operators import Log, all_impulses, copy_impulses, kernel, masses, record, set_impulses
from multicor_cli.engine.contact.sweep import EXACT, Relaxation, System, sweep
from multicor_cli.model.model import Floats

_REGULARIZATION = 1e-8
_GROWTH = 2.0


@kernel
def _coefficients(changes: Floats, count: int) -> Floats:
    """Weights, of sum 1, of the stored sweeps (the newest last)."""
    differences = changes[1:count] - changes[: count - 1]
    matrix = differences @ differences.T
    trace = 0.0
    for row in range(count - 1):
        trace += matrix[row, row]
    for row in range(count - 1):
        matrix[row, row] += _REGULARIZATION * trace + 1e-300
    gamma = np.linalg.solve(matrix, differences @ changes[count - 1])
    weights = np.zeros(count)
    weights[count - 1] = 1.0
    for row in range(count - 1):
        weights[row + 1] -= gamma[row]
        weights[row] += gamma[row]
    return weights


@kernel
def run_anderson(s: System, iterations: int, parameters: Floats, log: Log) -> int:
    """The iteration; parameter: how many earlier sweeps are combined. It starts anew when the
    change has doubled.
    """
    depth, bodies = int(parameters[0]) + 1, s.inverse.shape[0]
    impulse, partial, root = (
        all_impulses(s),
        np.empty((s.tile_start.size - 1, 2)),
        np.sqrt(masses(s)),
    )
    changes, images = np.empty((depth, 4 * bodies)), np.empty((depth, impulse.shape[0], 2))
    last, count, lowest = copy_impulses(s), 0, np.inf
    for number in range(iterations):
        before = s.velocity[:bodies].copy()
        sweep(s, last, EXACT, Relaxation(1.0, 1.0, 0.0), False, partial)
        if record(s, log, number, number + 1.0):
            return number + 1
        change = ((s.velocity[:bodies] - before) * root).reshape(-1)
        size = np.sqrt(np.dot(change, change))
        if size > _GROWTH * lowest:
            count, lowest = 0, size
        lowest = min(lowest, size)
        if count == depth:
            changes[:-1] = changes[1:].copy()
            images[:-1] = images[1:].copy()
            count -= 1
        changes[count], images[count] = change, all_impulses(s)
        count += 1
        if count > 1 and number < iterations - 1:
            weights = _coefficients(changes, count)
            impulse[:] = 0.0
            for row in range(count):
                impulse += weights[row] * images[row]
            set_impulses(s, impulse)
    return iterations
