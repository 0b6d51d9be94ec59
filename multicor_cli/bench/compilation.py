"""How long a new user waits for the kernels to compile, and how long everybody waits for them to be loaded."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from dataclasses import dataclass

_CODE = """
import time
from multicor_cli.bench.driving import prepare
from multicor_cli.bench.scenes import START
start = time.perf_counter()
prepare(START, 100, threads=2).take(START.steps)
print(time.perf_counter() - start)
"""


@dataclass(frozen=True)
class CompileTimes:
    """Time from a scenario of 100 grains to the end of its first steps, in a process of its own.

    Attributes:
        cold: With an empty cache: everything is compiled [s].
        cached: With the cache that this has left: everything is loaded [s].
    """

    cold: float
    cached: float


def time_compilation() -> CompileTimes:
    """Measure the first steps of a small sheared scene with an empty cache, and once more.

    Raises:
        RuntimeError: If the scene does not run.
    """
    with tempfile.TemporaryDirectory() as folder:
        return CompileTimes(_first_step(folder), _first_step(folder))


def _first_step(folder: str) -> float:
    environment = {**os.environ, "NUMBA_CACHE_DIR": folder}
    done = subprocess.run([sys.executable, "-c", _CODE], env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(done.stderr.strip().splitlines()[-1])
    return float(done.stdout)
