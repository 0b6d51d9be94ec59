"""A whole benchmark: calibration, scenes one after the other, each in a process of its own: this module as a program."""

from __future__ import annotations

import os
import pickle
import platform
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any, TypeVar

from multicor_cli.bench.calibration import copy_bandwidth
from multicor_cli.bench.compilation import CompileTimes, time_compilation
from multicor_cli.bench.measuring import Result, Task, measure
from multicor_cli.running.compiling import end_with_parent, python_child

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

    Ctrl-C reaches this process only, which ends the other: machine code knows no exceptions.
    """
    command, environment = python_child("-m", __name__)
    pipe = subprocess.PIPE
    with subprocess.Popen(command, env=environment, stdin=pipe, stdout=pipe, start_new_session=True) as other:
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
    found: T = result
    return found


def main() -> None:
    """Call what standard input asks for, and write the result, or the error, to standard output."""
    with os.fdopen(os.dup(1), "wb") as said:
        os.dup2(2, 1)  # nothing else is written there
        function, arguments = pickle.load(sys.stdin.buffer)
        end_with_parent()
        try:
            pickle.dump((function(*arguments), None), said)
        except Exception as error:
            pickle.dump((None, error), said)


if __name__ == "__main__":
    main()
