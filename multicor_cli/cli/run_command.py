"""The command ``run``."""

from __future__ import annotations

import shlex
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from multicor_cli.cli import console
from multicor_cli.cli.guard import set_crash_directory
from multicor_cli.cli.options import Overrides, Quiet, ScenarioFile, option, output_option
from multicor_cli.text import count_noun

if TYPE_CHECKING:
    from multicor_cli.model import Model, State
    from multicor_cli.running.outcome import RunOutcome
    from multicor_cli.running.plan import RunPlan
    from multicor_cli.scenario.scenario import Scenario

Directory = Annotated[
    Path | None, output_option(metavar="DIR", help="Run directory.", show_default="runs/NAME")
]
Threads = Annotated[
    int,
    option(
        "--threads",
        "Threads; 0: what the scenario says, or all cores. Results do not depend on it.",
        min=0,
        max=1024,
    ),
]
MaxHours = Annotated[
    float | None,
    option(
        "--max-hours H", "Stop after this time with a checkpoint and exit code 75.", False, min=0.0
    ),
]


def run(
    scenario: ScenarioFile,
    output: Directory = None,
    overrides: Overrides = None,
    threads: Threads = 0,
    max_hours: MaxHours = None,
    overwrite: Annotated[
        bool, option("--overwrite", "Remove the run that is in the directory.")
    ] = False,
    extend: Annotated[
        bool,
        option(
            "--extend",
            "Add the stages that the scenario has more at its end to the run in the directory.",
        ),
    ] = False,
    is_strict: console.Strict = False,
    is_dry: Annotated[
        bool, option("--dry-run", "Place the grains and do one step; write nothing.")
    ] = False,
    is_quiet: Quiet = False,
) -> None:
    """Run a scenario, or continue a run that was stopped: the same command does both.

    Ctrl-C, SIGTERM and SIGHUP stop after a checkpoint (a second one at once), SIGUSR1 writes a
    checkpoint and goes on.
    """
    from multicor_cli.running.signals import StopSignals

    if overwrite and extend:
        raise typer.BadParameter("a run is either extended or overwritten", param_hint="--extend")
    with StopSignals(may_exit=True).installed() as stop_signals:
        stop_signals.on_exit = lambda _number: console.complain(
            "interrupted before anything was done"
        )
        with stop_signals.exit_at_once():
            from multicor_cli.running.machine import reserve_threads
            from multicor_cli.scenario.scenario import load_scenario

            # the engine takes the most time to load, with room for the threads
            loaded = load_scenario(scenario, overrides or [])
            count = reserve_threads(threads or loaded.solver.threads)
            from multicor_cli.checks import Prepared, check_prepared
            from multicor_cli.running.session import Session
        if is_dry:
            with stop_signals.exit_at_once():
                _dry_run(loaded, count)
            return
        path = output if output is not None else Path("runs") / loaded.name
        set_crash_directory(path)
        observer = console.make_observer(is_quiet=is_quiet)

        def review(scenario: Scenario, plan: RunPlan, model: Model, state: State) -> None:
            checks = check_prepared(Prepared(scenario, plan, model, state, count, path))
            console.show_doubtful(checks, observer.message)
            console.refuse_bad(checks, is_strict=is_strict)

        session = Session(
            loaded,
            path,
            threads=count,
            max_seconds=None if max_hours is None else 3600.0 * max_hours,
            overwrite=overwrite,
            extend=extend,
            observer=observer,
            stop_signals=stop_signals,
            review=review,
        )
        outcome = session.run()
    _conclude(outcome, is_quiet=is_quiet, is_strict=is_strict)
    raise typer.Exit(outcome.reason.exit_code)


def _conclude(outcome: RunOutcome, *, is_quiet: bool, is_strict: bool) -> None:
    """Say what is doubtful and how the run ended; a stopped run keeps its own exit code."""
    from multicor_cli.checks import check_run
    from multicor_cli.store import open_run

    checks, place = check_run(outcome.directory), shlex.quote(str(outcome.directory))
    console.show_doubtful(checks, console.say)
    if not is_quiet:
        for end in outcome.stage_ends:
            console.say(f"stage {end.name}: {end.text}")
        console.say(f"{console.count_verdicts(checks)}; see multicor info {place}")
        console.say(str(outcome))
        if outcome.is_finished:
            with open_run(outcome.directory) as run:
                of = "speed" if run.model.thermal is None else "temperature"
            console.say(f"next:  multicor post map {place} --of {of} --plot map.png")
            console.say(f"       multicor report {place}")
    console.refuse_bad(checks, is_strict=is_strict and outcome.is_finished)


def _dry_run(scenario: Scenario, threads: int) -> None:
    from multicor_cli.packing import build
    from multicor_cli.running.session import try_step

    console.say("placing the grains")
    model, state = build(scenario)
    walls = "1 cell" if model.is_cell else count_noun(model.wall_count, "wall")
    counts = f"{count_noun(model.grain_count, 'grain')}, {walls}"
    console.say(f"{counts}; compiling and doing one step")
    started = time.monotonic()
    report = try_step(scenario, model, state, threads)
    took = console.format_seconds(time.monotonic() - started)
    state_of = "converged" if report.converged else "not converged"
    console.say(
        f"one step with compilation: {took}; {report.contacts} loaded contacts, "
        f"{report.sweeps:.0f} sweeps, {state_of}"
    )
