"""The same problem by Siconos, where it is installed."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from law import contact_velocity, pushed
from one_problem import Solve, as_solve

from multicor_cli.engine import ContactProblem
from multicor_cli.model.model import Floats


def find_python() -> str | None:
    """An interpreter that can import Siconos, or None."""
    for name in (os.environ.get("SICONOS_PYTHON"), "/usr/bin/python3", shutil.which("python3")):
        if (
            name
            and subprocess.run(
                [name, "-c", "import siconos.numerics"], capture_output=True, check=False
            ).returncode
            == 0
        ):
            return name
    return None


def matrix_of(problem: ContactProblem) -> Floats:
    """W (2c, 2c): velocities at the contacts, n and t in turn, for unit impulses."""
    count = 2 * len(problem.pair)
    still = replace(problem, velocity=np.zeros_like(problem.velocity))
    columns = np.empty((count, count))
    for k in range(count):
        impulse = np.zeros(count)
        impulse[k] = 1.0
        columns[:, k] = contact_velocity(problem, pushed(still, impulse.reshape(-1, 2))).ravel()
    return columns


def solve_theirs(
    problem: ContactProblem, python: str, sweeps: int, seconds: float = 300.0
) -> Solve | None:
    """Plain sweeps of Siconos from zero, so many of them or to 10⁻¹⁵; None if they take longer than
    some seconds.
    """
    free = contact_velocity(problem, problem.velocity)
    free[:, 0] += problem.bias
    with tempfile.TemporaryDirectory() as folder:
        source, target = Path(folder) / "in.npz", Path(folder) / "out.npz"
        np.savez(source, W=matrix_of(problem), q=free.ravel(), mu=problem.friction, sweeps=sweeps)
        worker = Path(__file__).parent / "siconos_worker.py"
        try:
            command = [python, str(worker), str(source), str(target)]
            subprocess.run(
                command,
                check=True,
                timeout=seconds,
                capture_output=True,
                env={**os.environ, "PYTHONPATH": ""},
            )
        except subprocess.TimeoutExpired:
            return None
        with np.load(target) as stored:
            impulse = stored["impulse"].reshape(-1, 2)
    return as_solve(problem, impulse, pushed(problem, impulse), "siconos, zero", converged=True)
