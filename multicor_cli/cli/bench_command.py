"""Command ``bench``: what named scenes cost on this machine."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from multicor_cli.cli.console import emit_json, emit_table, say
from multicor_cli.cli.options import listed, option
from multicor_cli.running.outcome import ExitCode

if TYPE_CHECKING:
    from multicor_cli.bench.measuring import Result, Task

SceneNames = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="[SCENE]...",
        help="Scenes: {scenes}; all if none is named.",
        autocompletion=listed("scenes"),
    ),
]
Grains = Annotated[
    list[int] | None,
    option("--grains N", "Number of grains; may be given several times.", min=100, max=10_000_000),
]
Threads = Annotated[
    int, option("--threads", "Number of threads; 0 takes all cores.", min=0, max=1024)
]
Rounds = Annotated[
    int, option("--rounds", "Number of rounds; the medians over them are printed.", min=1, max=1000)
]
Seed = Annotated[int, option("--seed", "Seed of the scenes.", min=0)]
Quick = Annotated[bool, option("--quick", "The few scenes that CI measures, on one thread.")]
Compilation = Annotated[
    bool, option("--compilation", "Measure compilation too, with an empty cache.")
]
AsJson = Annotated[bool, option("--json", "Print everything as JSON.")]
RecordFile = Annotated[
    Path | None, option("--record FILE", "Measure three seeds, write the medians into FILE.", False)
]
CompareFile = Annotated[
    Path | None,
    option("--compare FILE", "Fail if worse than in FILE by more than the margins.", False),
]

QUICK = (
    *((name, 1008) for name in ("bed", "shear", "shear-dynamic", "heated-bed")),
    ("bed", 10_080),
)
_SEEDS = 3  # that are recorded: their median is near what any seed gives
_TIME = 110.0  # by when everything that is measured again should be done [s]


def bench(
    scenes: SceneNames = None,
    grains: Grains = None,
    threads: Threads = 0,
    rounds: Rounds = 5,
    seed: Seed = 1,
    is_quick: Quick = False,
    has_compilation: Compilation = False,
    is_json: AsJson = False,
    record: RecordFile = None,
    compare: CompareFile = None,
) -> None:
    """Measure what a time step costs in named scenes, in seconds and as ratios to what this machine
    can do.

    A scene is prepared until it rests or flows steadily, then measured, in a process of its own;
    its physics is checked, and no time is given if that is wrong. The yardsticks are the bandwidth
    of copying memory, the same Gauss–Seidel sweep in C, compiled here if there is a compiler, and
    for everything else in a step a piece of work of the same kind.
    """
    from multicor_cli.bench.measuring import Task
    from multicor_cli.bench.scenes import SCENES
    from multicor_cli.bench.session import (
        HEADINGS,
        notes,
        read_record,
        row,
        run_benchmark,
        write_record,
    )
    from multicor_cli.running.machine import available_cores

    unknown = [name for name in scenes or [] if name not in SCENES]
    if unknown:
        known_scenes = ", ".join(SCENES)
        raise typer.BadParameter(f"there is no scene '{unknown[0]}'; choose from: {known_scenes}")
    if is_quick and (scenes or grains):
        raise typer.BadParameter("--quick chooses scenes and numbers of grains itself")
    known = None if compare is None else read_record(compare)
    pairs = [(name, count) for name in scenes or SCENES for count in grains or [10_000]]
    if is_quick:
        pairs = [*QUICK]
    count = 1 if is_quick else threads or available_cores()
    seeds = range(seed, seed + (1 if record is None else _SEEDS))
    tasks = [Task(name, n, count, rounds, each) for name, n in pairs for each in seeds]
    started = time.monotonic()
    benchmark = run_benchmark(tasks, has_compilation=has_compilation, say=say)
    if is_json:
        emit_json(benchmark.as_dict())
    else:
        emit_table(HEADINGS, [row(result) for result in benchmark.results])
        for line in notes(benchmark):
            say(line)
    if record is not None:
        write_record(record, benchmark.results)
        say(f"wrote {record}")
    faults = [fault for result in benchmark.results for fault in result.faults]
    took = time.monotonic() - started
    slower = [] if known is None else _slower(tasks, benchmark.results, known, took)
    for line in slower:
        say(f"slower: {line}")
    if faults or slower:
        raise typer.Exit(ExitCode.PHYSICS if faults else ExitCode.BUG)


def _slower(
    tasks: list[Task], results: list[Result], known: dict[str, dict[str, float]], took: float
) -> list[str]:
    """What is slower than recorded and, given time, again with another seed in another minute."""
    from multicor_cli.bench.session import find_slower, run_benchmark, slower_twice

    lines = find_slower(results, known)
    again = [
        task for task, result in zip(tasks, results, strict=True) if find_slower([result], known)
    ]
    if not again or took * (1.0 + len(again) / len(tasks)) > _TIME:
        return lines
    for line in lines:
        say(f"looks slower, measuring again with another seed: {line}")
    others = run_benchmark(
        [replace(task, seed=task.seed + 1) for task in again], has_compilation=False, say=say
    ).results
    return slower_twice(results, others, known)
