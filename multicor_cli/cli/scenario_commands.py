"""Commands about scenario files: ``new``, ``validate``, ``schema``."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from multicor_cli.cli.console import emit_json, emit_pairs, format_seconds, say
from multicor_cli.cli.listing import ListingCommand
from multicor_cli.cli.options import Overrides, ScenarioFile, count_noun
from multicor_cli.running.outcome import ExitCode
from multicor_cli.text import format_bytes

if TYPE_CHECKING:
    from multicor_cli.model import Model
    from multicor_cli.running.estimate import Estimate
    from multicor_cli.running.plan import RunPlan
    from multicor_cli.running.time_step import StepReview
    from multicor_cli.scenario.scenario import Scenario
    from multicor_cli.store.origin import Origin

NAME_HELP = "Name of the scenario; the file is NAME.toml."
TEMPLATE_HELP = "What to start from: {templates}."


def new(
    name: Annotated[str, typer.Argument(help=NAME_HELP)],
    template: Annotated[str, typer.Option("--template", "-t", help=TEMPLATE_HELP)] = "shear",
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace an existing file.")] = False,
) -> None:
    """Write a commented scenario file to start from."""
    from multicor_cli.scenario.templates import new_scenario
    from multicor_cli.store.atomic import commit_result

    path = Path(f"{name}.toml")
    try:
        text = new_scenario(path.stem, template)
    except ValueError as error:
        raise typer.BadParameter(str(error)) from None
    if os.path.lexists(path) and not overwrite:
        say(f"multicor: {path} exists; choose another name, or give --overwrite")
        raise typer.Exit(ExitCode.OCCUPIED)
    commit_result(path, "scenario", text.encode())
    say(f"wrote {path}; check it with:  multicor validate {path}")


def validate(
    scenario: ScenarioFile,
    overrides: Overrides = None,
    threads: Annotated[int, typer.Option("--threads", min=0, max=1024, help="Number of threads to assume; 0: all cores.")] = 0,
    is_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
) -> None:
    """Check a scenario, place its grains, and estimate what a run will cost. Nothing is written."""
    from multicor_cli.running.threads import reserve_threads
    from multicor_cli.scenario.load import load_scenario

    loaded = load_scenario(scenario, overrides or ())
    cores = reserve_threads(threads or loaded.solver.threads)

    from multicor_cli.packing.build import place
    from multicor_cli.running.estimate import estimate
    from multicor_cli.running.planning import make_plan
    from multicor_cli.running.time_step import review_steps

    placed = place(loaded)
    model, origin = placed.model, placed.origin
    plan = make_plan(loaded, model)
    cost = estimate(loaded, plan, model, placed.state, cores)
    reviews = review_steps(loaded, model, plan)
    if is_json:
        emit_json({**_summary(loaded, plan, model, cost, reviews), "origin": None if origin is None else origin.as_document()})
        return
    emit_pairs(_lines(loaded, plan, model, cost, reviews) + _lines_of_origin(origin))
    say(f"({cost.basis})")


def schema() -> None:
    """Print the JSON Schema of scenario files, for editors that complete and check TOML."""
    from multicor_cli.scenario.schema import scenario_schema

    emit_json(scenario_schema())


def _summary(
    scenario: Scenario, plan: RunPlan, model: Model, cost: Estimate, reviews: Sequence[StepReview | None]
) -> dict[str, Any]:
    return {
        "valid": True,
        "scenario": str(scenario.path),
        "name": scenario.name,
        "seed": scenario.seed,
        "grain_count": model.grain_count,
        "wall_count": model.wall_count,
        "stages": [
            {
                "name": stage.name,
                "dt": stage.dt,
                "dt_review": None if review is None else asdict(review),
                "step_limit": stage.step_limit,
                "frame_every": stage.frame_every,
            }
            for stage, review in zip(plan.stages, reviews, strict=True)
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


def _lines_of_origin(origin: Origin | None) -> list[tuple[str, str]]:
    if origin is None:
        return []
    return [("goes on from", origin.text), *(("  walls", text) for text in origin.wall_texts)]


def _time_steps(plan: RunPlan, reviews: Sequence[StepReview | None]) -> str:
    """Each different time step, with what it resolves and the stages that have it."""
    names: dict[str, list[str]] = {}
    for stage, review in zip(plan.stages, reviews, strict=True):
        text = f"{stage.dt:.4g} s" + ("" if review is None else f": {review.text()}")
        names.setdefault(text, []).append(stage.name)
    if len(names) == 1:
        return next(iter(names))
    return "; ".join(f"{text} ({', '.join(stages)})" for text, stages in names.items())


def _lines(
    scenario: Scenario, plan: RunPlan, model: Model, cost: Estimate, reviews: Sequence[StepReview | None]
) -> list[tuple[str, str]]:
    steps = "not known in advance" if cost.steps is None else f"{cost.steps} at most, in {count_noun(len(plan.stages), 'stage')}"
    frames = "not known in advance" if cost.frames is None else f"{cost.frames} of {format_bytes(cost.frame_bytes)}"
    lines = [
        ("scenario", f"{scenario.path} is valid"),
        ("grains", f"{model.grain_count}, mean diameter {model.mean_diameter:.4g} m"),
        ("walls", f"{model.wall_count} of {model.shape_count} shapes"),
        ("time step", _time_steps(plan, reviews)),
        ("steps", steps),
        ("frames", frames),
        ("memory", f"about {format_bytes(cost.memory)}"),
    ]
    if cost.disk is not None and cost.disk_peak is not None and cost.seconds is not None:
        lines.append(("disk", f"about {format_bytes(cost.disk)}, {format_bytes(cost.disk_peak)} while results.h5 is made"))
        lines.append(("wall time", f"about {format_seconds(cost.seconds)}, and half a minute of compilation the first time"))
    else:
        lines.append(("disk, time", "not known in advance: a stage ends by a condition that cannot be foreseen"))
    if cost.deflection is not None:
        text = f"{cost.deflection:.2g} of a diameter is the elastic deflection that rigid grains neglect (Hertz)"
        lines.append(("deflection", text))
    return lines


def register(app: typer.Typer, wrap: Any) -> None:
    """Add the commands."""
    app.command("new", cls=ListingCommand)(wrap(new))
    app.command("validate")(wrap(validate))
    app.command("schema")(wrap(schema))
