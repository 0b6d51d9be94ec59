"""What this machine can do in this minute: the bandwidth of copying, and the sweep in C. Times are given as ratios to these."""

from __future__ import annotations

import ctypes
import shutil
import statistics
import subprocess
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import numba
import numpy as np

from multicor_cli.bench.yardsticks import copy_blocks, sweep_repeatedly
from multicor_cli.engine.contact.sweep import Before, System
from multicor_cli.engine.contact.system import OneByOne, flatten
from multicor_cli.engine.jit.chunks import aligned_copy
from multicor_cli.model.model import Floats

_COPIED = 1 << 25  # numbers: 256 MB, more than any cache
_ROUNDS = 7
_ENOUGH = 2_000_000  # contact relaxations in one measurement

CSweep = Callable[[OneByOne, Floats, float, int], float]
"""Some sweeps of contacts in C, with the velocities of their bodies and β; returns the sum of the squares of the corrections."""


@dataclass(frozen=True)
class SweepTimes:
    """One sweep, ours and that in C, measured alternately.

    Attributes:
        contacts: Diagonal contacts of the problem.
        bytes_moved: Bytes of the problem that a sweep reads or writes at least once [B].
        ours: Time per contact and sweep by number of threads, median [s].
        in_c: That in C on one thread, the fastest; nan without a compiler [s].
        ratio: Ours on one thread over C: median of the ratios of neighboring measurements; nan without a compiler.
    """

    contacts: int
    bytes_moved: int
    ours: dict[int, float]
    in_c: float
    ratio: float

    @property
    def bandwidth(self) -> dict[int, float]:
        """Bytes that a sweep must move over its time, by number of threads [B/s]."""
        return {threads: self.bytes_moved / (seconds * self.contacts) for threads, seconds in self.ours.items()}


def copy_bandwidth(threads: int) -> float:
    """Bytes read and written per second when memory is copied by some threads, median [B/s]."""
    numba.set_num_threads(threads)
    source, target = np.ones(_COPIED), np.zeros(_COPIED)
    copy_blocks(source, target)
    times = [_time(lambda: copy_blocks(source, target)) for _ in range(_ROUNDS)]
    return 2.0 * source.nbytes / statistics.median(times)


def time_sweep(system: System, threads: tuple[int, ...]) -> SweepTimes:
    """Measure one sweep of a problem. The problem is copied; general contacts are left out.

    Raises:
        RuntimeError: If the sweep in C does not do what ours does.
    """
    diagonal = _only_diagonal(system)
    rows, velocity, before = flatten(diagonal), aligned_copy(diagonal.velocity), _before(diagonal)
    count = len(rows.pair)
    repeats = max(1, _ENOUGH // max(1, count))
    c_sweep = compile_sweep()
    if c_sweep is not None:
        _compare(diagonal, c_sweep)
    ours: dict[int, list[float]] = {number: [] for number in threads}
    in_c: list[float] = []
    partial = np.zeros(diagonal.tile_start.size - 1)
    for round_ in range(_ROUNDS + 1):
        for number in threads:
            numba.set_num_threads(number)
            clock = _time if number > 1 else _busy
            seconds = clock(lambda: sweep_repeatedly(diagonal, before, repeats, number > 1, partial))  # noqa: B023
            ours[number].append(seconds / (repeats * count))
        if c_sweep is not None:
            in_c.append(_busy(lambda: c_sweep(rows, velocity, diagonal.spin_factor, repeats)) / (repeats * count))
        if round_ == 0:  # the first round only warms up
            ours, in_c = {number: [] for number in threads}, []
    ratio = statistics.median(a / b for a, b in zip(ours[threads[0]], in_c, strict=True)) if in_c else float("nan")
    return SweepTimes(
        count,
        _bytes_moved(diagonal),
        {number: statistics.median(times) for number, times in ours.items()},
        min(in_c, default=float("nan")),
        ratio,
    )


def compile_sweep() -> CSweep | None:
    """The sweep in C, compiled here and now; None where there is no C compiler."""
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if compiler is None:
        return None
    source = resources.files("multicor_cli.bench").joinpath("sweep.c").read_text(encoding="utf-8")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder)
        (path / "sweep.c").write_text(source, encoding="utf-8")
        command = [compiler, "-O3", "-march=native", "-shared", "-fPIC", "-o", str(path / "sweep.so"), str(path / "sweep.c")]
        if subprocess.run(command, capture_output=True, check=False).returncode:
            return None
        function = ctypes.CDLL(str(path / "sweep.so")).sweeps
    function.restype = ctypes.c_double
    function.argtypes = [ctypes.c_ssize_t, ctypes.c_ssize_t, ctypes.c_double, *[ctypes.c_void_p] * 4]

    def run(rows: OneByOne, velocity: Floats, spin_factor: float, repeats: int) -> float:
        pointers = [array.ctypes.data for array in (velocity, rows.pair, rows.frame, rows.impulse)]
        return float(function(repeats, len(rows.pair), spin_factor, *pointers))

    return run


def _only_diagonal(system: System) -> System:
    """A copy without general contacts."""
    none = slice(0, 0)
    return system._replace(
        velocity=aligned_copy(system.velocity),
        impulse=aligned_copy(system.impulse),
        contacts=int(np.count_nonzero(system.slot >= 0)),
        general_pair=system.general_pair[none],
        general_frame=system.general_frame[none],
        general_lever=system.general_lever[none],
        general_impulse=system.general_impulse[none],
    )


def _before(system: System) -> Before:
    """Impulses before the first sweep: those that there are."""
    return Before(aligned_copy(system.impulse), system.general_impulse.copy(), system.couples.impulse.copy())


def _compare(system: System, c_sweep: CSweep) -> None:
    """Both sweeps give the same but for the order of roundings."""
    mine = system._replace(velocity=system.velocity.copy(), impulse=system.impulse.copy())
    rows, velocity = flatten(system), system.velocity.copy()
    sweep_repeatedly(mine, _before(mine), 1, False, np.zeros(mine.tile_start.size - 1))
    c_sweep(rows, velocity, system.spin_factor, 1)
    scale = np.abs(rows.impulse).max(initial=0.0)
    if not np.allclose(flatten(mine).impulse, rows.impulse, rtol=0.0, atol=1e-9 * scale):
        raise RuntimeError("the sweep in C differs from that of the program")


def _time(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def _busy(work: Callable[[], object]) -> float:
    """Time for which this thread had a core: what a neighbor takes is not counted."""
    start = time.thread_time()
    work()
    return time.thread_time() - start


def _bytes_moved(system: System) -> int:
    """Pairs and frames are read, impulses and the velocities of the bodies in contact read and written."""
    bodies = np.unique(system.pair).size
    impulses = 4 * system.impulse.nbytes  # now and before
    return int(system.pair.nbytes + system.frame.nbytes + impulses + 2 * bodies * system.velocity.itemsize * 4)
