"""Commands about scenario files: ``new``, ``validate``, ``schema``."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from multicor_cli.cli.console import (
    Strict,
    checks_as_json,
    emit,
    emit_json,
    emit_pairs,
    format_seconds,
    refuse_bad,
    say,
    show_all,
)
from multicor_cli.cli.options import Overrides, ScenarioFile, listed
from multicor_cli.running.outcome import ExitCode
from multicor_cli.text import count_noun, format_bytes

if TYPE_CHECKING:
    from multicor_cli.checks import Prepared
    from multicor_cli.model import Model
    from multicor_cli.running.plan import RunPlan
    from multicor_cli.running.time_step import StepReview
    from multicor_cli.scenario.scenario import Scenario
    from multicor_cli.store.documents import Origin

NAME_HELP = "Name of the scenario; the file is NAME.toml."
TEMPLATE_HELP = "What to start from: {templates}."


def new(
    name: Annotated[str, typer.Argument(help=NAME_HELP)],
    template: Annotated[
        str,
        typer.Option("--template", "-t", help=TEMPLATE_HELP, autocompletion=listed("templates")),
    ] = "shear",
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace an existing file.")
    ] = False,
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
            say(f"multicor: {file} exists; choose another name, or give --overwrite")
            raise typer.Exit(ExitCode.OCCUPIED)
    for file, text in reversed(texts.items()):
        commit_result(file, "scenario", text.encode())
    say(f"wrote {' and '.join(map(str, texts))}; check it with:  multicor validate {path}")


def validate(
    scenario: ScenarioFile,
    overrides: Overrides = None,
    threads: Annotated[
        int,
        typer.Option(
            "--threads", min=0, max=1024, help="Number of threads to assume; 0: all cores."
        ),
    ] = 0,
    is_strict: Strict = False,
    is_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
) -> None:
    """Check a scenario, place its grains, and estimate what a run will cost. Nothing is written."""
    from multicor_cli.running.compiling import reserve_threads
    from multicor_cli.scenario.scenario import load_scenario

    loaded = load_scenario(scenario, overrides or ())
    cores = reserve_threads(threads or loaded.solver.threads)

    from multicor_cli.checks import Prepared, check_prepared
    from multicor_cli.packing import place
    from multicor_cli.running.planning import make_plan

    placed = place(loaded)
    plan = make_plan(loaded, placed.model)
    prepared = Prepared(loaded, plan, placed.model, placed.state, cores, origin=placed.origin)
    checks = check_prepared(prepared)
    if is_json:
        emit_json({**_summary(prepared), **checks_as_json(checks)})
    else:
        emit_pairs(_lines(prepared))
        emit("")
        show_all(checks, emit)
        say(f"({prepared.cost.basis})")
    refuse_bad(checks, is_strict=is_strict)


def schema() -> None:
    """Print the JSON Schema of scenario files, for editors that complete and check TOML."""
    from multicor_cli.scenario.tables import scenario_schema

    emit_json(scenario_schema())


def _summary(run: Prepared) -> dict[str, Any]:
    scenario, plan, model, cost = run.scenario, run.plan, run.model, run.cost
    return {
        "valid": True,
        "scenario": str(scenario.path),
        "name": scenario.name,
        "seed": scenario.seed,
        "grain_count": model.grain_count,
        "wall_count": model.wall_count,
        "wall_masses": {
            wall.name: {"mass": wall.mass, "inertia": wall.inertia, "given": wall.is_given}
            for wall in _pushed_walls(run.scenario, plan, model)
        },
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


class _PushedWall(NamedTuple):
    """A wall pushed in some stage: mass [kg], inertia [kg m²], whether the file gives the mass."""

    name: str
    mass: float | None
    inertia: float | None
    is_given: bool

    def text(self) -> str:
        """For people."""
        inertia = "" if self.inertia is None else f", {self.inertia:.4g} kg m²"
        mass = (
            ""
            if self.mass is None
            else f" {self.mass:.4g} kg ({'given' if self.is_given else 'default'})"
        )
        return f"'{self.name}'{mass}{inertia}"


def _pushed_walls(scenario: Scenario, plan: RunPlan, model: Model) -> list[_PushedWall]:
    drives = [stage.drives.started([0.0] * (k + 1)) for k, stage in enumerate(plan.stages)]
    numbers = [
        w
        for w in range(model.wall_count)
        if any(dof.is_driven for stage in drives for dof in stage[w].dofs())
    ]
    values = [
        [None if math.isnan(value) else value for value in array.tolist()]
        for array in (model.walls.mass, model.walls.inertia)
    ]
    return [
        _PushedWall(
            model.walls.names[w], values[0][w], values[1][w], scenario.walls[w].mass is not None
        )
        for w in numbers
    ]


def _lines_of_origin(origin: Origin | None) -> list[tuple[str, str]]:
    if origin is None:
        return []
    return [("goes on from", origin.text), *(("  walls", text) for text in origin.wall_texts)]


def _time_steps(plan: RunPlan, reviews: Sequence[StepReview | None]) -> str:
    """Each different time step, with what it resolves and the stages that have it."""
    names: dict[str, list[str]] = {}
    for stage, review in zip(plan.stages, reviews, strict=True):
        text = f"{stage.dt:.4g} s" + ("" if review is None else f": {review.text()}")
        if stage.duration is not None and stage.step_limit is not None:
            text += (
                f"; the last one is {stage.step_after(stage.step_limit - 1):.4g} s, to end at "
                f"{stage.duration:g} s"
            )
        names.setdefault(text, []).append(stage.name)
    if len(names) == 1:
        return next(iter(names))
    return "; ".join(f"{text} ({', '.join(stages)})" for text, stages in names.items())


def _frictions(scenario: Scenario, plan: RunPlan) -> list[str]:
    """What stages change about friction."""
    from multicor_cli.scenario.problems import show

    texts = []
    for stage, table in zip(plan.stages, scenario.loading, strict=True):
        changes = [
            f"{' – '.join(entry.pair)}: {show(entry.model_dump(exclude_none=True)['friction'])}"
            for entry in table.contacts
        ]
        if changes:
            texts.append(f"from stage {stage.name} on, {', '.join(changes)}")
    return texts


def _lines(run: Prepared) -> list[tuple[str, str]]:
    scenario, plan, model, cost = run.scenario, run.plan, run.model, run.cost
    steps = (
        "not known in advance"
        if cost.steps is None
        else f"{cost.steps} at most, in {count_noun(len(plan.stages), 'stage')}"
    )
    frames = (
        "not known in advance"
        if cost.frames is None
        else f"{cost.frames} of {format_bytes(cost.frame_bytes)}"
    )
    lines = [
        ("scenario", f"{scenario.path} is valid"),
        *_lines_of_origin(run.origin),
        ("grains", f"{model.grain_count}, mean diameter {model.mean_diameter:.4g} m"),
        ("walls", f"{model.wall_count} of {model.shape_count} shapes"),
        *[("wall mass", wall.text()) for wall in _pushed_walls(scenario, plan, model)],
        ("time step", _time_steps(plan, run.reviews)),
        *[("friction", text) for text in _frictions(scenario, plan)],
        ("steps", steps),
        ("frames", frames),
        ("memory", f"about {format_bytes(cost.memory)}"),
    ]
    if cost.disk is not None and cost.disk_peak is not None and cost.seconds is not None:
        lines.append(
            (
                "disk",
                (
                    f"about {format_bytes(cost.disk)}, {format_bytes(cost.disk_peak)} while "
                    "results.h5 is made"
                ),
            )
        )
        lines.append(
            (
                "wall time",
                (
                    f"about {format_seconds(cost.seconds)}, and half a minute of compilation the "
                    "first time"
                ),
            )
        )
    else:
        lines.append(
            (
                "disk, time",
                "not known in advance: a stage ends by a condition that cannot be foreseen",
            )
        )
    return lines


COMMANDS = {"new": new, "validate": validate, "schema": schema}
"""Commands by name."""
