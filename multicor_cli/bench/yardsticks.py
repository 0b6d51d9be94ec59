"""What this machine can do in this minute: copying memory, the sweep in C, and a step's other work.

Times are given as ratios to these. None of the kernels here is part of the product.
"""

from __future__ import annotations

import ctypes
import functools
import math
import shutil
import statistics
import subprocess
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import numpy as np

from multicor_cli.engine.contact.ordering import rows_of_general
from multicor_cli.engine.contact.sweep import EXACT, Before, Relaxation, System, sweep
from multicor_cli.engine.contact.system import OneByOne, flatten
from multicor_cli.engine.jit.arrays import aligned_copy
from multicor_cli.engine.jit.compile import kernel, parallel_kernel, prange
from multicor_cli.engine.jit.threads import use_threads
from multicor_cli.model.model import Floats, Ints

_ROUNDS = 7

# ---- The bandwidth of copying

_COPIED = 1 << 25  # numbers: 256 MB, more than any cache
_BLOCK = 1 << 14


@parallel_kernel
def _copy_blocks(source: Floats, target: Floats) -> None:
    count = source.size
    for block in prange((count + _BLOCK - 1) // _BLOCK):
        for k in range(block * _BLOCK, min(count, (block + 1) * _BLOCK)):
            target[k] = source[k]


def copy_bandwidth(threads: int) -> float:
    """Bytes read and written per second when memory is copied by some threads, median [B/s]."""
    use_threads(threads)
    source, target = np.ones(_COPIED), np.zeros(_COPIED)
    _copy_blocks(source, target)
    times = [_wall_time(lambda: _copy_blocks(source, target)) for _ in range(_ROUNDS)]
    return 2.0 * source.nbytes / statistics.median(times)


# ---- The sweep in C

_ENOUGH = 2_000_000  # contact relaxations in one measurement

CSweep = Callable[[OneByOne, Floats, float, int], float]
"""Sweeps of contacts in C, given velocities, β and their number; returns Σ of corrections²."""


@dataclass(frozen=True)
class SweepTimes:
    """One sweep, ours and that in C, measured alternately.

    Attributes:
        bytes_moved: Bytes of the problem that a sweep reads or writes at least once [B].
        ours: Time per contact and sweep by number of threads, median [s].
        in_c: That in C on one thread, the fastest; nan without a compiler [s].
        ratio: Ours on one thread over C, median of neighboring measurements; nan without C.
    """

    contacts: int
    bytes_moved: int
    ours: dict[int, float]
    in_c: float
    ratio: float

    @property
    def bandwidth(self) -> dict[int, float]:
        """Bytes that a sweep must move over its time, by number of threads [B/s]."""
        return {
            threads: self.bytes_moved / (seconds * self.contacts)
            for threads, seconds in self.ours.items()
        }


def time_sweep(system: System, threads: tuple[int, ...]) -> SweepTimes:
    """Measure a sweep of a copy without general contacts; raises `RuntimeError` if C differs."""
    diagonal = _only_diagonal(system)
    rows, velocity, before = flatten(diagonal), aligned_copy(diagonal.velocity), _before(diagonal)
    count = len(rows.pair)
    repeats = max(1, _ENOUGH // max(1, count))
    c_sweep = compile_sweep()
    if c_sweep is not None:
        _compare(diagonal, c_sweep)
    ours: dict[int, list[float]] = {number: [] for number in threads}
    in_c: list[float] = []
    partial = np.zeros((diagonal.tile_start.size - 1, 2))
    for round_ in range(_ROUNDS + 1):
        for number in threads:
            use_threads(number)
            several = number > 1
            clock = _wall_time if several else _core_time
            ours_now = functools.partial(
                _sweep_repeatedly, diagonal, before, repeats, several, partial
            )
            ours[number].append(clock(ours_now) / (repeats * count))
        if c_sweep is not None:
            seconds = _core_time(lambda: c_sweep(rows, velocity, diagonal.spin_factor, repeats))
            in_c.append(seconds / (repeats * count))
        if round_ == 0:  # the first round only warms up
            ours, in_c = {number: [] for number in threads}, []
    ratios = [a / b for a, b in zip(ours[threads[0]], in_c, strict=False)]
    moved = diagonal.pair.nbytes + diagonal.frame.nbytes  # read; the rest is read and written
    moved += 4 * diagonal.impulse.nbytes  # now and before
    moved += 2 * np.unique(diagonal.pair).size * diagonal.velocity.itemsize * 4
    return SweepTimes(
        count, moved, {number: statistics.median(times) for number, times in ours.items()},
        min(in_c, default=math.nan), statistics.median(ratios) if ratios else math.nan,
    )  # fmt: skip


def compile_sweep() -> CSweep | None:
    """The sweep in C, compiled here and now; None where there is no C compiler."""
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if compiler is None:
        return None
    source = resources.files("multicor_cli.bench").joinpath("sweep.c").read_text(encoding="utf-8")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder)
        (path / "sweep.c").write_text(source, encoding="utf-8")
        options = ("-O3", "-march=native", "-shared", "-fPIC", "-o")
        command = [compiler, *options, str(path / "sweep.so"), str(path / "sweep.c")]
        if subprocess.run(command, capture_output=True, check=False).returncode:
            return None
        function = ctypes.CDLL(str(path / "sweep.so")).sweeps
    size, number = ctypes.c_ssize_t, ctypes.c_double
    function.restype = number
    function.argtypes = [size, size, number, *[ctypes.c_void_p] * 4]

    def run(rows: OneByOne, velocity: Floats, spin_factor: float, repeats: int) -> float:
        pointers = [array.ctypes.data for array in (velocity, rows.pair, rows.frame, rows.impulse)]
        return float(function(repeats, len(rows.pair), spin_factor, *pointers))

    return run


def _only_diagonal(system: System) -> System:
    pair, frame, lever, impulse = rows_of_general(0)
    return system._replace(
        velocity=aligned_copy(system.velocity), impulse=aligned_copy(system.impulse),
        contacts=int(np.count_nonzero(system.slot >= 0)), general_pair=pair, general_frame=frame,
        general_lever=lever, general_impulse=impulse,
    )  # fmt: skip


def _before(system: System) -> Before:
    return Before(
        aligned_copy(system.impulse), system.general_impulse.copy(), system.couples.impulse.copy()
    )


def _compare(system: System, c_sweep: CSweep) -> None:
    mine = system._replace(velocity=system.velocity.copy(), impulse=system.impulse.copy())
    rows, velocity = flatten(system), system.velocity.copy()
    _sweep_repeatedly(mine, _before(mine), 1, False, np.zeros((mine.tile_start.size - 1, 2)))
    c_sweep(rows, velocity, system.spin_factor, 1)
    scale = np.abs(rows.impulse).max(initial=0.0)
    if not np.allclose(flatten(mine).impulse, rows.impulse, rtol=0.0, atol=1e-9 * scale):
        raise RuntimeError("the sweep in C differs from that of the program")


@kernel
def _sweep_repeatedly(
    s: System, before: Before, repeats: int, parallel: bool, partial: Floats
) -> float:
    """Sweeps without anything around them, arguments as `sweep`; returns Σ of corrections²."""
    total = 0.0
    for _ in range(repeats):
        total += sweep(s, before, EXACT, Relaxation(1.0, 1.0, 0.0), parallel, partial)[0]
    return total


def _wall_time(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def _core_time(work: Callable[[], object]) -> float:
    """Time for which this thread had a core: what a neighbor takes is not counted."""
    start = time.thread_time()
    work()
    return time.thread_time() - start


# ---- A step's other work

_CALLS = 120  # in one step, whatever the number of grains
_FEW = 64  # grains of a call
_NEIGHBORS = 5  # cells whose grains are looked at: the own one and half of those around it


class ReferenceStep:
    """A step of ``n`` shaken grains of a square lattice: the yardstick for all but the solve.

    What a step does besides its sweeps is a hundred calls of short kernels and array functions from
    Python. How fast a machine does that has little to do with how fast it sweeps, so it has a
    yardstick of its own: grains are moved, sorted into cells, paired with their neighbors, and
    gather from their pairs; and small kernels are called. Never make this faster or slower: what is
    recorded is measured in it.
    """

    def __init__(self, grains: int) -> None:
        self._side = max(4, round(math.sqrt(grains)))
        count = self._side * self._side
        raw = np.random.Philox(1).random_raw(2 * count)
        shake = raw.astype(np.float64).reshape(count, 2) / 2.0**64
        corner = np.column_stack([np.arange(count) % self._side, np.arange(count) // self._side])
        self._position, self._velocity = corner + 0.1 + 0.8 * shake, shake - 0.5
        self._share = grains / count
        self.take()  # what has to be compiled is

    def take(self) -> float:
        """One step; returns what keeps it from being left out."""
        total = 0.0
        for number in range(_CALLS):
            total += float(self._move(number, _FEW)[0, 0])
        middle = self._move(_CALLS, len(self._position))
        first, order = np.zeros(self._side**2 + 1, np.int32), np.empty(len(middle), np.int32)
        _sort(middle, self._side, first, order)
        pair, gap = np.empty((6 * len(middle), 2), np.int32), np.empty(6 * len(middle))
        found = _measure(middle, self._side, first, order, pair, gap)
        near = np.flatnonzero(gap[:found] < 0.4)
        pull = np.zeros((len(middle), 2))
        _gather(middle, pair[near], gap[near], pull)
        return total + float((pull * pull).sum())

    def _move(self, number: int, count: int) -> Floats:
        middle, way = np.empty((count, 2)), 1e-3 * number
        _move(self._position[:count], self._velocity[:count], way, float(self._side), middle)
        if not np.isfinite(middle).all():
            raise FloatingPointError
        return middle

    def seconds(self) -> float:
        """Time of a step, as if there were exactly the wanted number of grains [s]."""
        started = time.thread_time()
        self.take()
        return self._share * (time.thread_time() - started)


@kernel
def _move(position: Floats, velocity: Floats, dt: float, side: float, middle: Floats) -> None:
    for i in range(len(position)):
        for axis in range(2):
            x = position[i, axis] + dt * velocity[i, axis]
            middle[i, axis] = min(max(x, 0.0), side - 1e-9)


@kernel
def _sort(position: Floats, side: int, first: Ints, order: Ints) -> None:
    for i in range(len(position)):
        first[int(position[i, 1]) * side + int(position[i, 0]) + 1] += 1
    for cell in range(side * side):
        first[cell + 1] += first[cell]
    fill = first[:-1].copy()
    for i in range(len(position)):
        cell = int(position[i, 1]) * side + int(position[i, 0])
        order[fill[cell]] = i
        fill[cell] += 1


@kernel
def _measure(position: Floats, side: int, first: Ints, order: Ints, pair: Ints, gap: Floats) -> int:
    found = 0
    for cell in range(side * side):
        column, row = cell % side, cell // side
        for k in range(_NEIGHBORS):
            across, up = (0, 0) if k == 0 else (1, 0) if k == 1 else (k - 3, 1)
            if not 0 <= column + across < side or row + up >= side:
                continue
            other = cell + across + side * up
            for a in range(first[cell], first[cell + 1]):
                for b in range(a + 1 if k == 0 else first[other], first[other + 1]):
                    i, j = order[a], order[b]
                    x, y = position[j, 0] - position[i, 0], position[j, 1] - position[i, 1]
                    if found < len(gap):
                        pair[found, 0], pair[found, 1] = i, j
                        gap[found] = np.sqrt(x * x + y * y) - 0.8
                        found += 1
    return found


@kernel
def _gather(position: Floats, pair: Ints, gap: Floats, pull: Floats) -> None:
    for k in range(len(gap)):
        i, j = pair[k]
        length = gap[k] + 0.8 + 1e-9
        for axis in range(2):
            unit = (position[j, axis] - position[i, axis]) / length
            pull[i, axis] += gap[k] * unit
            pull[j, axis] -= gap[k] * unit
