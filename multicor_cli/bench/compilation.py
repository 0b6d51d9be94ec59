"""How long a new user waits for the kernels to compile, and how long everybody waits for them to be loaded."""

from __future__ import annotations

import subprocess
import tempfile
from dataclasses import dataclass

from multicor_cli.running.compiling import python_child

_CODE = """
import os, time
from multicor_cli.bench.driving import prepare
from multicor_cli.bench.scenes import START
from multicor_cli.engine.precompile import precompile
from multicor_cli.running.compiling import shared_compilation
start = time.perf_counter()
with shared_compilation(os.cpu_count() or 1) as other:
    prepare(START, 100, threads=1).take(START.steps)
    print(time.perf_counter() - start)
    if other is not None:
        other.wait()
    precompile()
    print(time.perf_counter() - start)
"""


@dataclass(frozen=True)
class CompileTimes:
    """Times from a scenario of 100 grains on, in a process of its own and, where there is a second core, a second one.

    Attributes:
        cold: To the end of its first steps, with an empty cache: everything is compiled [s].
        hard: Likewise, to the last kernel of those that only steps need in which the sweeps are stuck [s].
        cached: As ``cold``, with the cache that this has left: everything is loaded [s].
    """

    cold: float
    hard: float
    cached: float


def time_compilation() -> CompileTimes:
    """Measure the first steps of a small bed with an empty cache, and once more.

    Raises:
        RuntimeError: If the scene does not run.
    """
    with tempfile.TemporaryDirectory() as folder:
        cold, hard = _first_steps(folder)
        return CompileTimes(cold, hard, _first_steps(folder)[0])


def _first_steps(folder: str) -> tuple[float, float]:
    command, environment = python_child("-c", _CODE, NUMBA_CACHE_DIR=folder)
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(done.stderr.strip().splitlines()[-1])
    first, last = done.stdout.split()
    return float(first), float(last)
