"""The command ``run``."""

from __future__ import annotations

import importlib
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, Optional

import typer

from multicor_cli.cli.console import format_seconds, say
from multicor_cli.cli.guard import set_crash_directory
from multicor_cli.cli.options import Overrides, ScenarioFile, count_noun

if TYPE_CHECKING:
    from multicor_cli.running.outcome import RunOutcome
    from multicor_cli.running.signals import Switchboard
    from multicor_cli.scenario.scenario import Scenario

Directory = Annotated[
    Optional[Path],  # noqa: UP045  (evaluated by typer)
    typer.Option("--output", "-o", metavar="DIR", help="Run directory.", show_default="runs/NAME"),
]
Threads = Annotated[
    int,
    typer.Option(
        "--threads", min=0, max=1024, help="Threads; 0: what the scenario says, or all cores. Results do not depend on it."
    ),
]
MaxHours = Annotated[
    Optional[float],  # noqa: UP045  (evaluated by typer)
    typer.Option(
        "--max-hours", min=0.0, metavar="H", help="Stop after this time with a checkpoint and exit code 75.", show_default=False
    ),
]


def run(
    scenario: ScenarioFile,
    output: Directory = None,
    overrides: Overrides = None,
    threads: Threads = 0,
    max_hours: MaxHours = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Remove the run that is in the directory.")] = False,
    extend: Annotated[
        bool, typer.Option("--extend", help="Add the stages that the scenario has more at its end to the run in the directory.")
    ] = False,
    is_dry: Annotated[bool, typer.Option("--dry-run", help="Place the grains and do one step; write nothing.")] = False,
    is_quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Show warnings and errors only.")] = False,
) -> None:
    """Run a scenario, or continue a run that was stopped: the same command does both.

    Ctrl-C, SIGTERM and SIGHUP stop after a checkpoint (a second one at once), SIGUSR1 writes a checkpoint and goes on.
    """
    from multicor_cli.running.signals import Switchboard

    if overwrite and extend:
        raise typer.BadParameter("a run is either extended or overwritten", param_hint="--extend")
    with Switchboard(may_exit=True).installed() as switchboard:
        with switchboard.impatient():
            job = _prepare(scenario, overrides or [], threads)
        if is_dry:
            with switchboard.impatient():
                _dry_run(job)
            return
        outcome = _run(job, output, max_hours, switchboard, overwrite=overwrite, extend=extend, is_quiet=is_quiet)
    _conclude(outcome, is_quiet=is_quiet)
    raise typer.Exit(outcome.reason.exit_code)


class _Job(NamedTuple):
    scenario: Scenario
    threads: int


def _prepare(path: Path, overrides: Sequence[str], threads: int) -> _Job:
    """Load the scenario, and the engine with room for the threads: most of the time before a run can begin."""
    from multicor_cli.running.threads import reserve_threads
    from multicor_cli.scenario.load import load_scenario

    scenario = load_scenario(path, overrides)
    count = reserve_threads(threads or scenario.solver.threads)
    importlib.import_module("multicor_cli.running.session")
    return _Job(scenario, count)


def _run(
    job: _Job,
    output: Path | None,
    max_hours: float | None,
    switchboard: Switchboard,
    *,
    overwrite: bool,
    extend: bool,
    is_quiet: bool,
) -> RunOutcome:
    from multicor_cli.cli.progress import make_observer
    from multicor_cli.running.session import Session

    path = output if output is not None else Path("runs") / job.scenario.name
    set_crash_directory(path)
    session = Session(
        job.scenario,
        path,
        threads=job.threads,
        max_seconds=None if max_hours is None else 3600.0 * max_hours,
        overwrite=overwrite,
        extend=extend,
        observer=make_observer(is_quiet=is_quiet),
        switchboard=switchboard,
    )
    return session.run()


def _conclude(outcome: RunOutcome, *, is_quiet: bool) -> None:
    if outcome.unconverged_steps:
        steps = count_noun(outcome.unconverged_steps, "step")
        say(f"warning: {steps} did not converge; see multicor info {outcome.directory}")
    for end in outcome.stage_ends:
        if end.has_timed_out:
            remedy = f"give loading.{end.stage} a longer duration or another goal"
            say(f"warning: stage {end.name}: {end.text}; {remedy}")
        elif not is_quiet:
            say(f"stage {end.name}: {end.text}")
    if not is_quiet:
        say(str(outcome))


def _dry_run(job: _Job) -> None:
    from multicor_cli.packing import build
    from multicor_cli.running.dry_run import try_step

    say("placing the grains")
    model, state = build(job.scenario)
    say(f"{model.grain_count} grains, {model.wall_count} walls; compiling and doing one step")
    started = time.monotonic()
    report = try_step(job.scenario, model, state, job.threads)
    took = format_seconds(time.monotonic() - started)
    state_of = "converged" if report.converged else "not converged"
    say(f"one step with compilation: {took}; {report.contacts} loaded contacts, {report.sweeps:.0f} sweeps, {state_of}")


def register(app: typer.Typer, wrap: Any) -> None:
    """Add the command."""
    app.command("run")(wrap(run))
