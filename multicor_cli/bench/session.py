"""A whole benchmark, its table, and ratios recorded before; each part in a process of its own."""

from __future__ import annotations

import json
import math
import os
import pickle
import platform
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from multicor_cli.bench.measuring import Result, Task, measure
from multicor_cli.bench.yardsticks import copy_bandwidth
from multicor_cli.files import read_regular
from multicor_cli.running.machine import end_with_parent, python_child
from multicor_cli.store.atomic import commit_result

T = TypeVar("T")


class CompileTimes(NamedTuple):
    """Times from a scenario of 100 grains on, in a process of its own, or two on two cores.

    Attributes:
        cold: To the end of its first steps, with an empty cache: everything is compiled [s].
        hard: To the last kernel that only steps need whose sweeps are stuck; the cache empty [s].
        cached: As ``cold``, with the cache that this has left: everything is loaded [s].
    """

    cold: float
    hard: float
    cached: float


@dataclass(frozen=True)
class Benchmark:
    """What was measured: machine, copy bandwidth by number of threads [B/s], results of scenes."""

    machine: str
    bandwidth: dict[int, float]
    results: list[Result]
    compilation: CompileTimes | None

    def as_dict(self) -> dict[str, Any]:
        return {
            "machine": self.machine,
            "copy_bandwidth": {str(threads): value for threads, value in self.bandwidth.items()},
            "compilation": None if self.compilation is None else self.compilation._asdict(),
            "scenes": [result.as_dict() for result in self.results],
        }


def run_benchmark(
    tasks: Sequence[Task], *, has_compilation: bool, say: Callable[[str], None]
) -> Benchmark:
    """Measure tasks, at least one, and compilation if asked for; ``say`` is told what goes on."""
    say("calibrating: copy bandwidth")
    counts = sorted({1, *(task.threads for task in tasks)})
    bandwidth = {count: _apart(copy_bandwidth, count) for count in counts}
    compilation, results = None, []
    if has_compilation:
        say("compiling all kernels anew")
        with tempfile.TemporaryDirectory() as folder:
            cold, hard = _first_steps(folder)
            compilation = CompileTimes(cold, hard, _first_steps(folder)[0])
    for task in tasks:
        say(f"{task.scene}, about {task.grains} grains, {task.threads} threads")
        results.append(_apart(measure, task))
    machine = f"{platform.machine()}, {platform.platform()}"
    return Benchmark(machine, bandwidth, results, compilation)


_CODE = """
import os, time
from multicor_cli.bench.driving import prepare
from multicor_cli.bench.scenes import START
from multicor_cli.engine.precompile import precompile
from multicor_cli.running.machine import shared_compilation
start = time.perf_counter()
with shared_compilation(os.cpu_count() or 1) as other:
    prepare(START, 100, threads=1).take(START.steps)
    print(time.perf_counter() - start)
    if other is not None:
        other.wait()
    precompile()
    print(time.perf_counter() - start)
"""


def _first_steps(folder: str) -> tuple[float, float]:
    """Times `_CODE` with a folder as the cache [s]; raises `RuntimeError` if it does not run."""
    command, environment = python_child("-c", _CODE, NUMBA_CACHE_DIR=folder)
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(done.stderr.strip().splitlines()[-1])
    first, last = done.stdout.split()
    return float(first), float(last)


def _apart(function: Callable[..., T], *arguments: Any) -> T:
    """Call a function in a process of its own, which shares neither memory nor threads.

    Ctrl-C reaches this process only, which ends the other: machine code knows no exceptions.
    """
    command, environment = python_child("-m", __name__)
    pipe = subprocess.PIPE
    with subprocess.Popen(
        command, env=environment, stdin=pipe, stdout=pipe, start_new_session=True
    ) as other:
        assert other.stdin is not None
        assert other.stdout is not None
        try:
            pickle.dump((function, arguments), other.stdin)
            other.stdin.flush()
            answer = other.stdout.read()
        except BaseException:
            other.kill()
            raise
    if not answer:
        raise RuntimeError(f"the process that measures ended with exit code {other.returncode}")
    result, error = pickle.loads(answer)
    if error is not None:
        raise error
    return result  # type: ignore[no-any-return]


def main() -> None:
    """Call what standard input asks for, and write the result, or the error, to standard output."""
    with os.fdopen(os.dup(1), "wb") as said:
        os.dup2(2, 1)  # nothing else is written there
        try:
            function, arguments = pickle.load(sys.stdin.buffer)
        except EOFError:
            return  # Ctrl-C came before it could be said what is asked for
        end_with_parent()
        try:
            pickle.dump((function(*arguments), None), said)
        except Exception as error:
            pickle.dump((None, error), said)


# ---- The table for people

HEADINGS = (
    "scene", "grains", "threads", "contacts", "sweeps", "step [ms]", "solve", "other at 30 sweeps",
    "ns/contact/sweep", "sweep : C", "threads gain", "grain-steps/s", "B/grain",
)  # fmt: skip

_MANY = 50_000  # grains whose memory can be told from that of the kernels


def row(result: Result) -> list[str]:
    """The row of a scene; one with wrong physics has no times."""
    counts = (result.grains, result.threads, result.candidates, result.sweeps)
    head = [result.scene, *(f"{count:.0f}" for count in counts)]
    if result.faults:
        return [*head, "refused", *[""] * (len(HEADINGS) - len(head) - 1)]
    solve = result.phases.get("solve", 0.0) / max(sum(result.phases.values()), 1e-300)
    sweep, share, each = result.sweep, result.other_share, result.per_contact
    gain = ""
    if sweep is not None and len(sweep.ours) > 1:
        gain = f"{sweep.ours[1] / sweep.ours[result.threads]:.2f}"
    return [
        *head, f"{1e3 * result.step:.3g}", f"{100.0 * solve:.0f} %",
        "" if share is None else f"{100.0 * share:.0f} %",
        "" if each is None else f"{1e9 * each:.1f}",
        "" if sweep is None or sweep.ratio != sweep.ratio else f"{sweep.ratio:.2f}",
        gain, f"{result.grain_steps:.3g}", f"{result.memory:.0f}" if result.grains >= _MANY else "",
    ]  # fmt: skip


def notes(benchmark: Benchmark) -> list[str]:
    """What the table rests on."""
    lines = [
        f"copying memory: {bandwidth / 1e9:.1f} GB/s with {n} threads"
        for n, bandwidth in benchmark.bandwidth.items()
    ]
    named = [(f"{result.scene}, {result.grains} grains", result) for result in benchmark.results]
    for name, result in named:
        if result.sweep is not None and not result.faults:
            parts = {n: v / benchmark.bandwidth[n] for n, v in result.sweep.bandwidth.items()}
            used = ", ".join(f"{100.0 * part:.0f} % with {n}" for n, part in parts.items())
            size = f"{result.sweep.bytes_moved / 1e6:.1f} MB"
            lines.append(f"{name}: a sweep moves {size}; of copying: {used}")
    if benchmark.compilation is not None:
        cold, hard, cached = benchmark.compilation
        lines.append(
            f"first steps: {cold:.1f} s cold, {cached:.2f} s cached; kernels of hard steps after "
            f"{hard:.1f} s"
        )
    lines += [
        f"{name}: {result.missed} of {result.steps * result.rounds} steps did not converge"
        for name, result in named
        if result.missed and not result.faults
    ]
    return lines + [f"{name}: {fault}" for name, result in named for fault in result.faults]


# ---- Ratios beside recorded ones: what has become slower by more than the noise

MARGINS = {
    "sweeps": 1.25,
    "cold_sweeps": 1.9,
    "sweep_over_c": 1.8,
    "solve_over_c": 1.8,
    "other_over_reference": 2.5,
}
"""By how much a number may exceed the recorded one. For sweeps that is three times the scatter
between seeds (cold ones: what is left below a factor of two), for times what processors may differ
by; `benchmarks/README.md` has all."""

LOOK = 3.0
"""Sweep-equivalents between two looks at the residual: counts no farther apart are the same."""

_ENOUGH = 30.0
"""Sweeps of a step from which on the solve is mostly sweeps, and its time comparable with them."""

RECORD_LIMIT = 1 << 20
"""Larger files are not read as records [bytes]."""


class RecordError(Exception):
    """A file of recorded ratios cannot be used: one message for the user."""

    exit_code = 2


def ratios(result: Result) -> dict[str, float]:
    """What of a result depends neither on the machine's speed nor on one trajectory's bits.

    Median ``sweeps`` of a step, and ``cold_sweeps`` without a warm start; a sweep over that in C;
    the solve per contact and sweep-equivalent over the sweep in C; everything but the solve over
    its yardstick. Only what could be measured.
    """
    measured = {"other_over_reference": result.other_ratio}
    sweep, each, cold = result.sweep, result.per_contact, result.cold_sweeps
    if each is not None:
        measured["sweeps"] = result.median_sweeps
    if cold is not None:
        measured["cold_sweeps"] = cold
    if sweep is not None and math.isfinite(sweep.in_c):
        measured["sweep_over_c"] = sweep.ratio
        if each is not None and (cold or result.median_sweeps) >= _ENOUGH:
            measured["solve_over_c"] = each / sweep.in_c
    return measured


def _name_of(result: Result) -> str:
    return f"{result.scene}-{result.grains}-threads-{result.threads}"


def write_record(path: Path, results: Iterable[Result]) -> None:
    """Record ratios, medians over seeds of a scene; those of others in the file are kept.

    Raises `RecordError` if it holds something else, `StorageError` if it cannot be written.
    """
    known = read_record(path) if path.exists() else {}
    by_seed: dict[str, list[dict[str, float]]] = {}
    for result in results:
        if not result.faults:
            by_seed.setdefault(_name_of(result), []).append(ratios(result))
    for name, several in by_seed.items():
        values = {key: [each[key] for each in several if key in each] for key in several[0]}
        known[name] = {key: statistics.median(each) for key, each in values.items()}
    text = json.dumps(dict(sorted(known.items())), indent=2) + "\n"
    commit_result(path, "record", text.encode())


def read_record(path: Path) -> dict[str, dict[str, float]]:
    """Recorded ratios by name; raises `RecordError` if it is no record, `OSError` if unreadable."""
    try:
        data: Any = json.loads(read_regular(path, RECORD_LIMIT))
        return {
            str(name): {str(key): float(value) for key, value in known.items()}
            for name, known in data.items()
        }
    except (ValueError, AttributeError, TypeError) as error:
        raise RecordError(
            f"{path} is not a record of a benchmark ({error}); write one with --record"
        ) from error


def find_slower(results: Iterable[Result], record: dict[str, dict[str, float]]) -> list[str]:
    """What exceeds the recorded ratios by more than its margin."""
    return [line for result in results for line in _exceeding(result, record).values()]


def slower_twice(
    results: Iterable[Result], again: Iterable[Result], record: dict[str, dict[str, float]]
) -> list[str]:
    """What exceeds recorded ratios in both of two measurements; the second says by how much."""
    first = {_name_of(result): _exceeding(result, record) for result in results}
    return [
        line
        for result in again
        for key, line in _exceeding(result, record).items()
        if key in first.get(_name_of(result), {})
    ]


def _exceeding(result: Result, record: dict[str, dict[str, float]]) -> dict[str, str]:
    name, found = _name_of(result), {}
    before = record.get(name, {})
    for key, value in ratios(result).items():
        look = LOOK if key.endswith("sweeps") else 0.0
        if key in before and value > max(MARGINS[key] * before[key], before[key] + look):
            text = f"{key.replace('_', ' ')} {value:.3g}, recorded {before[key]:.3g}"
            found[key] = f"{name}: {text}"
    return found


if __name__ == "__main__":
    main()
