"""Solve a contact problem with Siconos (fc2d, non-smooth Gauss–Seidel) and numpy.

Usage: siconos_worker.py IN.npz OUT.npz; IN holds W (2c, 2c), q (2c,), mu (c,), tolerance; OUT the
reactions and velocities.
"""

import sys

import numpy as np
import siconos.numerics as sn

with np.load(sys.argv[1]) as data:
    w, q, mu, tolerance = data["W"], data["q"], data["mu"], float(data["tolerance"])
problem = sn.FrictionContactProblem(2, mu.size, w, q, mu)
options = sn.SolverOptions(sn.SICONOS_FRICTION_2D_NSGS)
options.iparam[sn.SICONOS_IPARAM_MAX_ITER] = 1_000_000
options.dparam[sn.SICONOS_DPARAM_TOL] = tolerance
reaction, velocity = np.zeros(2 * mu.size), np.zeros(2 * mu.size)
status = sn.fc2d_driver(problem, reaction, velocity, options)
np.savez(sys.argv[2], reaction=reaction, velocity=velocity, status=status)
