"""Solve a contact problem with Siconos (fc2d, Gauss–Seidel); runs under an interpreter that has
siconos, numpy and scipy.

Usage: siconos_worker.py IN.npz OUT.npz. IN is written by `residual.save_problem`, with ``start`` (2
c,), ``target`` (the error at which it may stop) and ``limit`` (seconds). OUT holds ``seconds``,
``iterations``, ``errors`` and ``impulse`` of ever later moments. Sweeps are begun anew from the
last impulses: Gauss–Seidel has no other memory.
"""

from __future__ import annotations

import sys
import time
import warnings

import numpy as np
import siconos.numerics as sn
from residual import load_problem, natural_error
from scipy import sparse

_GROWTH = 1.25  # of the number of sweeps from one moment to the next


def main(source: str, target_file: str) -> None:
    """Solve it."""
    problem = load_problem(source)
    with np.load(source) as stored:
        impulse, target, limit = (
            stored["start"].copy(),
            float(stored["target"]),
            float(stored["limit"]),
        )
    # The matrix is kept alive here: Siconos does not copy all of it.
    coordinates = sparse.coo_matrix(problem.matrix)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        _, blocks = sn.SBM_from_csparse(2, coordinates)
    task = sn.FrictionContactProblem(
        2, problem.friction.size, blocks, problem.free, problem.friction
    )
    options = sn.SolverOptions(sn.SICONOS_FRICTION_2D_NSGS)
    # The number of sweeps ends it, not its own error
    options.dparam[sn.SICONOS_DPARAM_TOL] = 1e-300
    velocity = np.zeros(impulse.size)
    spent, done, wanted = 0.0, 0, 4
    found: list[tuple[float, int, float]] = [(0.0, 0, natural_error(problem, impulse))]
    while found[-1][2] > target and spent < limit:
        options.iparam[sn.SICONOS_IPARAM_MAX_ITER] = wanted - done
        begin = time.perf_counter()
        sn.fc2d_driver(task, impulse, velocity, options)
        spent += time.perf_counter() - begin
        done += int(options.iparam[sn.SICONOS_IPARAM_ITER_DONE])
        found.append((spent, done, natural_error(problem, impulse)))
        wanted = max(done + 1, round(_GROWTH * done))
    seconds, iterations, errors = (np.array(column) for column in zip(*found, strict=True))
    np.savez(target_file, seconds=seconds, iterations=iterations, errors=errors, impulse=impulse)


if __name__ == "__main__":
    main(*sys.argv[1:])
