"""Running a scenario: stages, cadences, checkpoints, signals. Importing it loads nothing heavy."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from multicor_cli.running.outcome import Observer, RunOutcome
    from multicor_cli.running.steering import Steer
    from multicor_cli.scenario.scenario import Scenario


def run(
    scenario: Scenario | str | PathLike[str],
    directory: str | PathLike[str] | None = None,
    *,
    overrides: Sequence[str] = (),
    threads: int = 0,
    max_hours: float | None = None,
    overwrite: bool = False,
    extend: bool = False,
    observer: Observer | None = None,
    steer: Steer | None = None,
    steer_every: int = 1,
) -> RunOutcome:
    """Run a scenario, or continue a run that was stopped: the same call does both.

    SIGINT (Ctrl-C, in a notebook *interrupt*), SIGTERM and SIGHUP stop the run after a checkpoint;
    the outcome then says so. Kernels that compile, and a step, come to their end before. In a
    thread other than the main one Python hears of no signal: end it by ``max_hours`` or ``steer``.

    Args:
        scenario: A scenario, or the path of a scenario file.
        directory: Run directory; default: ``runs/NAME``.
        overrides: Values that replace those of the file, each ``key=value``; only with a path.
        threads: Number of threads; 0 takes what the scenario says, or all cores. Results do not
            depend on it.
        max_hours: Wall-clock time after which to stop with a checkpoint [h].
        overwrite: Whether a run that is in the directory may be removed.
        extend: Whether stages that the scenario has more at its end than the run in the directory
            are added to that run.
        observer: An `Observer`, whose methods are told of every step, of messages and warnings, and
            of the end; it cannot change the run. Default: none; warnings are those of Python.
        steer: A function that is called with a `LiveRun` after steps of stages that are not frozen.
            It reads what there is, and may end the stage, name the next one, or end the run. It
            must decide by what it reads and by ``now.notes`` alone: then the same scenario and
            function give the same bits, also if the run is stopped in between and goes on with the
            same call.
        steer_every: Number of steps of a stage from call to call.

    Raises:
        ScenarioError: If the scenario is wrong, or not the one with which the run in the directory
            began; if a stage that ``steer`` names is wrong.
        PhysicsError: If the run cannot go on; its last checkpoint is kept.
        StageTimeout: If the condition of a stage was not reached in time, and that is to stop the
            run (``on_timeout = "stop"``).
        StoreError: If the directory cannot be used, or a file cannot be written or is damaged.
        Exception: What ``steer`` or ``observer`` raises, after a checkpoint: the same call goes on,
            before the step after which ``steer`` failed, or after that of which the observer was
            told.
        TypeError: If ``scenario`` is neither a scenario nor a path, if ``observer`` lacks a method
            of an `Observer`, or ``steer`` cannot be called.
        ValueError: If the name of the directory is empty, there cannot be so many threads,
            ``overrides`` come with a loaded scenario, or ``overwrite`` with ``extend``; if
            ``max_hours`` is negative, or ``steer_every`` less than 1.
    """
    if overwrite and extend:
        raise ValueError("a run is either extended or overwritten")
    if directory == "":
        raise ValueError("the name of the run directory is empty")
    methods = () if observer is None else ("message", "warning", "stepped", "closed")
    if missing := [name for name in methods if not callable(getattr(observer, name, None))]:
        raise TypeError(
            "an observer has the methods of multicor_cli.Observer; this one lacks "
            f"{', '.join(missing)}"
        )
    if isinstance(observer, type):
        raise TypeError(f"an observer is an object: give {observer.__name__}(), not the class")
    if steer is not None and not callable(steer):
        raise TypeError(f"steer is a function of a LiveRun, is {steer!r}")
    if max_hours is not None and not max_hours >= 0.0:
        raise ValueError(f"max_hours must not be negative, is {max_hours}")
    if steer_every < 1:
        raise ValueError(f"steer_every counts steps and must be at least 1, is {steer_every}")
    from multicor_cli.running.machine import reserve_threads
    from multicor_cli.scenario.scenario import Scenario, load_scenario

    if isinstance(scenario, str | PathLike):
        scenario = load_scenario(Path(scenario), overrides)
    elif not isinstance(scenario, Scenario):
        raise TypeError(
            "scenario is a Scenario, as of load_scenario or Scenario.from_dict, or the path of a "
            f"file; is {type(scenario).__name__}"
        )
    elif overrides:
        raise ValueError("overrides need the path of a scenario file: give them to load_scenario")
    count = reserve_threads(threads or scenario.solver.threads)
    from multicor_cli.running.outcome import QuietObserver
    from multicor_cli.running.session import Session

    return Session(
        scenario,
        Path(directory) if directory is not None else Path("runs") / scenario.name,
        threads=count,
        max_seconds=None if max_hours is None else 3600.0 * max_hours,
        overwrite=overwrite,
        extend=extend,
        observer=observer or QuietObserver(),
        steer=steer,
        steer_every=steer_every,
    ).run()
