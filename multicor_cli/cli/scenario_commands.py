"""Commands about scenario files: ``new``, ``validate``, ``schema``, and ``run``."""

from __future__ import annotations

import math
import os
import shlex
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from multicor_cli.cli import console
from multicor_cli.cli.guard import set_crash_directory
from multicor_cli.cli.options import (
    AsJson,
    Overrides,
    Quiet,
    ScenarioFile,
    listed,
    option,
    output_option,
)
from multicor_cli.running.outcome import ExitCode
from multicor_cli.text import count_noun, format_bytes

if TYPE_CHECKING:
    from multicor_cli.checks import Prepared
    from multicor_cli.model import Model, State
    from multicor_cli.running.outcome import RunOutcome
    from multicor_cli.running.plan import RunPlan
    from multicor_cli.running.time_step import StepReview
    from multicor_cli.scenario.scenario import Scenario

NAME_HELP = "Name of the scenario; the file is NAME.toml."
TEMPLATE_HELP = "What to start from: {templates}."


def new(
    name: Annotated[str, typer.Argument(help=NAME_HELP)],
    template: Annotated[
        str, option("--template -t", TEMPLATE_HELP, autocompletion=listed("templates"))
    ] = "shear",
    overwrite: Annotated[bool, option("--overwrite", "Replace an existing file.")] = False,
) -> None:
    """Write a commented scenario file to start from."""
    from multicor_cli.scenario.templates import new_scenario, template_table
    from multicor_cli.store.atomic import commit_result

    path = Path(f"{name.removesuffix('.toml')}.toml")
    try:
        texts = {path: new_scenario(path.stem, template)}
    except ValueError as error:
        raise typer.BadParameter(str(error)) from None
    table = template_table(template)
    if table is not None:
        texts[path.with_suffix(".csv")] = table
    for file in texts:
        if os.path.lexists(file) and not overwrite:
            console.say(f"multicor: {file} exists; choose another name, or give --overwrite")
            raise typer.Exit(ExitCode.OCCUPIED)
    for file, text in reversed(texts.items()):
        commit_result(file, "scenario", text.encode())
    console.say(f"wrote {' and '.join(map(str, texts))}; check it with:  multicor validate {path}")


def validate(
    scenario: ScenarioFile,
    overrides: Overrides = None,
    threads: Annotated[
        int, option("--threads", "Number of threads to assume; 0: all cores.", min=0, max=1024)
    ] = 0,
    is_strict: console.Strict = False,
    is_json: AsJson = False,
) -> None:
    """Check a scenario, place its grains, and estimate what a run will cost. Nothing is written."""
    from multicor_cli.running.machine import reserve_threads
    from multicor_cli.scenario.scenario import load_scenario

    loaded = load_scenario(scenario, overrides or ())
    cores = reserve_threads(threads or loaded.solver.threads)

    from multicor_cli.checks import Prepared, check_prepared
    from multicor_cli.packing import place
    from multicor_cli.running.from_scenario import make_plan

    placed = place(loaded)
    plan = make_plan(loaded, placed.model)
    prepared = Prepared(loaded, plan, placed.model, placed.state, cores, origin=placed.origin)
    checks = check_prepared(prepared)
    if is_json:
        console.emit_json({**_summary(prepared), **console.checks_as_json(checks)})
    else:
        console.emit_pairs(_lines(prepared))
        console.emit("")
        console.show_all(checks, console.emit)
        console.say(f"({prepared.cost.basis})")
    console.refuse_bad(checks, is_strict=is_strict)


def schema() -> None:
    """Print the JSON Schema of scenario files, for editors that complete and check TOML."""
    from multicor_cli.scenario.tables import scenario_schema

    console.emit_json(scenario_schema())


def _summary(run: Prepared) -> dict[str, Any]:
    scenario, plan, model, cost = run.scenario, run.plan, run.model, run.cost
    return {
        "valid": True,
        "scenario": str(scenario.path),
        "name": scenario.name,
        "seed": scenario.seed,
        "grain_count": model.grain_count,
        "wall_count": model.wall_count,
        "cell": _cell(run) if model.is_cell else None,
        "wall_masses": _pushed_walls(run.scenario, plan, model),
        "origin": None if run.origin is None else asdict(run.origin),
        "stages": [
            {
                "name": stage.name,
                "dt": stage.dt,
                "dt_review": None if review is None else asdict(review),
                "step_limit": stage.step_limit,
                "length": stage.length,
                "frame_every": stage.frame_every,
                "friction": [entry.model_dump(exclude_none=True) for entry in table.contacts],
            }
            for stage, table, review in zip(plan.stages, scenario.loading, run.reviews, strict=True)
        ],
        "estimate": {
            "steps": cost.steps,
            "frames": cost.frames,
            "memory_bytes": cost.memory,
            "disk_bytes": cost.disk,
            "disk_peak_bytes": cost.disk_peak,
            "wall_seconds": cost.seconds,
            "hertz_deflection": cost.deflection,
            "basis": cost.basis,
        },
    }


def _cell(run: Prepared) -> dict[str, float]:
    """Width, height and tilt of the cell at the start [m], and its inertia [kg m²]."""
    width, height, tilt = run.state.wall_position[0].tolist()
    inertia = float(run.model.walls.inertia[0])
    return {"width": width, "height": height, "tilt": tilt, "inertia": inertia}


def _pushed_walls(scenario: Scenario, plan: RunPlan, model: Model) -> dict[str, dict[str, Any]]:
    """Walls pushed in some stage: mass [kg], inertia [kg m²], whether the file gives the mass."""
    if model.is_cell:
        return {}
    drives = [stage.drives.started([0.0] * (k + 1)) for k, stage in enumerate(plan.stages)]
    masses, inertias = (
        [None if math.isnan(value) else value for value in array.tolist()]
        for array in (model.walls.mass, model.walls.inertia)
    )
    return {
        name: {
            "mass": masses[w], "inertia": inertias[w],
            "given": scenario.walls[w].mass is not None,
        }
        for w, name in enumerate(model.walls.names)
        if any(dof.is_driven for stage in drives for dof in stage[w].dofs())
    }  # fmt: skip


def _time_steps(plan: RunPlan, reviews: Sequence[StepReview | None]) -> str:
    """Each different time step, with what it resolves and the stages that have it."""
    names: dict[str, list[str]] = {}
    for stage, review in zip(plan.stages, reviews, strict=True):
        text = f"{stage.dt:.4g} s" + ("" if review is None else f": {review.text()}")
        if stage.duration is not None and stage.step_limit is not None:
            last = stage.step_after(stage.step_limit - 1)
            text += f"; the last one is {last:.4g} s, to end at {stage.duration:g} s"
        names.setdefault(text, []).append(stage.name)
    if len(names) == 1:
        return next(iter(names))
    return "; ".join(f"{text} ({', '.join(stages)})" for text, stages in names.items())


def _lines(run: Prepared) -> Iterator[tuple[str, str]]:
    from multicor_cli.running.estimate import compilation
    from multicor_cli.scenario.problems import show

    scenario, plan, model, cost = run.scenario, run.plan, run.model, run.cost
    yield "scenario", f"{scenario.path} is valid"
    if run.origin is not None:
        yield "goes on from", run.origin.text
        for text in run.origin.wall_texts:
            yield "  walls", text
    yield "grains", f"{model.grain_count}, mean diameter {model.mean_diameter:.4g} m"
    if model.is_cell:
        cell = _cell(run)
        size = f"{cell['width']:.4g} × {cell['height']:.4g} m"
        tilt = f", tilted by {cell['tilt']:.4g} m" if cell["tilt"] else ""
        yield "cell", f"{size}{tilt}, inertia {cell['inertia']:.4g} kg m²"
    else:
        yield "walls", f"{model.wall_count} of {model.shape_count} shapes"
    for name, wall in _pushed_walls(scenario, plan, model).items():
        given = "given" if wall["given"] else "default"
        mass = "" if wall["mass"] is None else f" {wall['mass']:.4g} kg ({given})"
        inertia = "" if wall["inertia"] is None else f", {wall['inertia']:.4g} kg m²"
        yield "wall mass", f"'{name}'{mass}{inertia}"
    yield "time step", _time_steps(plan, run.reviews)
    for stage, table in zip(plan.stages, scenario.loading, strict=True):
        changes = [
            f"{' – '.join(entry.pair)}: {show(entry.model_dump(exclude_none=True)['friction'])}"
            for entry in table.contacts
        ]
        if changes:
            yield "friction", f"from stage {stage.name} on, {', '.join(changes)}"
    unknown, stages = "not known in advance", count_noun(len(plan.stages), "stage")
    frame = format_bytes(cost.frame_bytes)
    yield "steps", unknown if cost.steps is None else f"{cost.steps} at most, in {stages}"
    yield "frames", unknown if cost.frames is None else f"{cost.frames} of {frame}"
    yield "memory", f"about {format_bytes(cost.memory)}"
    if cost.disk is None or cost.disk_peak is None or cost.seconds is None:
        yield "disk, time", f"{unknown}: a stage ends by a condition that cannot be foreseen"
        return
    peak = f"{format_bytes(cost.disk_peak)} while results.h5 is made"
    yield "disk", f"about {format_bytes(cost.disk)}, {peak}"
    first = f"{compilation(model)} of compilation the first time"
    yield "wall time", f"about {console.format_seconds(cost.seconds)}, and {first}"


# ---- Command `run`

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


COMMANDS = {"new": new, "validate": validate, "schema": schema, "run": run}
"""Commands by name."""
