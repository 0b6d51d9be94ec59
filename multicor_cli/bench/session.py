"""A whole benchmark: calibration, scenes one after the other, each in a process of its own."""

from __future__ import annotations

import multiprocessing
import platform
import signal
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from typing import Any, TypeVar

from multicor_cli.bench.calibration import copy_bandwidth
from multicor_cli.bench.compilation import CompileTimes, time_compilation
from multicor_cli.bench.measuring import Result, Task, measure

T = TypeVar("T")


@dataclass(frozen=True)
class Benchmark:
    """What was measured.

    Attributes:
        machine: Processor and operating system.
        bandwidth: Copy bandwidth by number of threads [B/s].
        results: One for each scene and size.
        compilation: Compile times, if asked for.
    """

    machine: str
    bandwidth: dict[int, float]
    results: list[Result]
    compilation: CompileTimes | None

    def as_dict(self) -> dict[str, Any]:
        """Everything as JSON types."""
        return {
            "machine": self.machine,
            "copy_bandwidth": {str(threads): value for threads, value in self.bandwidth.items()},
            "compilation": None if self.compilation is None else asdict(self.compilation),
            "scenes": [result.as_dict() for result in self.results],
        }


def run_benchmark(tasks: Sequence[Task], *, has_compilation: bool, say: Callable[[str], None]) -> Benchmark:
    """Measure tasks one after the other.

    Args:
        tasks: What to measure; at least one.
        has_compilation: Whether to measure compilation too.
        say: Is told what is being done.
    """
    say("calibrating: copy bandwidth")
    counts = sorted({1, *(task.threads for task in tasks)})
    bandwidth = {count: _apart(copy_bandwidth, count) for count in counts}
    compilation = None
    if has_compilation:
        say("compiling all kernels anew")
        compilation = time_compilation()
    results = []
    for task in tasks:
        say(f"{task.scene}, about {task.grains} grains, {task.threads} threads")
        results.append(_apart(measure, task))
    return Benchmark(f"{platform.machine()}, {platform.platform()}", bandwidth, results, compilation)


def _apart(function: Callable[..., T], *arguments: Any) -> T:
    """Call a function in a process of its own, which shares neither memory nor threads with anything else.

    Ctrl-C reaches both processes. Machine code knows no exceptions, so this one answers, and ends the other.
    """
    others = set(multiprocessing.active_children())
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn"), signal.signal, (signal.SIGINT, signal.SIG_IGN)) as pool:
        try:
            return pool.submit(function, *arguments).result()
        except BaseException:
            for process in set(multiprocessing.active_children()) - others:
                process.terminate()
            raise
