"""Solve a contact problem with Siconos (fc2d, non-smooth Gauss–Seidel); runs under an interpreter
that has Siconos and numpy.

Usage: siconos_worker.py IN.npz OUT.npz; IN holds W (2c, 2c), q (2c,), mu (c,) and sweeps; OUT the
impulses (2c,).
"""

from __future__ import annotations

import sys

import numpy as np
import siconos.numerics as sn


def main(source: str, target: str) -> None:
    """Solve it."""
    with np.load(source) as data:
        w, q, mu, sweeps = data["W"], data["q"], data["mu"], int(data["sweeps"])
    problem = sn.FrictionContactProblem(2, mu.size, w, q, mu)
    options = sn.SolverOptions(sn.SICONOS_FRICTION_2D_NSGS)
    options.iparam[sn.SICONOS_IPARAM_MAX_ITER] = sweeps
    options.dparam[sn.SICONOS_DPARAM_TOL] = 1e-15
    impulse, velocity = np.zeros(2 * mu.size), np.zeros(2 * mu.size)
    sn.fc2d_driver(problem, impulse, velocity, options)
    np.savez(target, impulse=impulse)


if __name__ == "__main__":
    main(*sys.argv[1:])
