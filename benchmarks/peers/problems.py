"""Contact problems of the benchmark's scenes, solved by Siconos and by the program to the same
error.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from ours import loosened
from process import PeerError, run_program
from residual import Floats, MatrixProblem, natural_error, save_problem
from scipy import sparse
from table import draw, median, spread

from multicor_cli.bench.driving import prepare
from multicor_cli.bench.scenes import SCENES
from multicor_cli.engine import ContactProblem, solve_contacts
from multicor_cli.engine.contact.problem import free_velocity

TARGETS = (1e-1, 1e-2, 1e-3)
"""Errors, over the closing velocity, at which solvers are compared."""

_TOLERANCES = [0.5 * 2.0**-k for k in range(24)]
_MOST_SWEEPS = 30_000
_REPEATED = 3.0  # all our solves of a problem together may take this many times the limit of one


@dataclass(frozen=True)
class Snapshot:
    """Where a solver was: time spent [s], sweeps done, error."""

    seconds: float
    sweeps: float
    error: float


@dataclass
class Race:
    """One problem and one start.

    Attributes:
        scene: Scene it comes from.
        is_warm: Whether solvers start from the impulses of the step before, or from none.
        contacts: Number of contacts.
        ours: Moments of the program, by round.
        theirs: Moments of Siconos, by round.
        failure: What Siconos said when it failed; it is then left out of this problem.
    """

    scene: str
    is_warm: bool
    contacts: int
    ours: list[list[Snapshot]]
    theirs: list[list[Snapshot]]
    failure: str = ""


@dataclass(frozen=True)
class SceneProblem:
    """A contact problem with the impulses of the step before [N s], shape ``(c, 2)``."""

    scene: str
    problem: ContactProblem
    start: Floats


def take_problem(scene: str, grains: int) -> SceneProblem:
    """The contact problem of the next step of a scene."""
    prepared = prepare(SCENES[scene], grains)
    prepared.take(max(1, prepared.scene.warm_steps))
    step = prepared.state.stage_step * prepared.stage.dt
    problem, start = prepared.engine.next_start(prepared.stage.dt, step)
    return SceneProblem(scene, problem, start.copy())


def as_matrix(problem: ContactProblem) -> MatrixProblem:
    """The problem with its matrix W = H M⁻¹ Hᵀ; the scale is the rms closing velocity of the
    contacts that close.
    """
    count, bodies = len(problem.pair), len(problem.velocity)
    (nx, ny), lever = problem.normal.T, problem.levers()
    one = np.ones(count)
    normal_row = np.stack([nx, ny, lever[:, 0, 0], -nx, -ny, -lever[:, 1, 0]], axis=1)
    tangent_row = np.stack([-ny, nx, lever[:, 0, 1], ny, -nx, -lever[:, 1, 1]], axis=1)
    values = np.stack([normal_row, tangent_row], axis=1)
    column = 3 * np.repeat(problem.pair.astype(np.int64), 3, axis=1) + np.tile([0, 1, 2], 2)
    columns = np.broadcast_to(column[:, None, :], values.shape)
    pointers = np.arange(0, 12 * count + 1, 6)
    rows = sparse.csr_matrix(
        (values.ravel(), columns.ravel(), pointers), shape=(2 * count, 3 * bodies)
    )
    matrix = sparse.csr_matrix(rows @ sparse.diags(problem.inverse_mass.ravel()) @ rows.T)
    free = free_velocity(problem) + np.stack([problem.bias, 0.0 * one], axis=1)
    closing = free[free[:, 0] < 0.0, 0]
    return MatrixProblem(
        matrix, free.ravel(), problem.friction, float(np.sqrt((closing**2).mean()))
    )


def race(
    scenes: list[tuple[str, int]],
    python: str | None,
    rounds: int,
    limit: float,
    folder: Path,
    say: Callable[[str], None],
) -> list[Race]:
    """Solve the problems of scenes, cold and warm, in rounds that alternate between the solvers.

    Args:
        scenes: Names and numbers of grains.
        python: Interpreter that has Siconos; None leaves it out.
        rounds: Number of rounds.
        limit: Time that a solver gets for one problem [s].
        folder: Where Siconos works.
        say: Is told what is being done.
    """
    races = []
    for name, grains in scenes:
        say(f"preparing {name} of {grains} grains")
        found = take_problem(name, grains)
        matrix = as_matrix(found.problem)
        for is_warm in (False, True):
            start = found.start if is_warm else np.zeros_like(found.start)
            one = Race(name, is_warm, len(found.problem.pair), [], [])
            for round_ in range(rounds):
                say(
                    f"{name}, {one.contacts} contacts, {'warm' if is_warm else 'cold'}, round "
                    f"{round_ + 1}"
                )
                one.ours.append(solve_ours(found.problem, matrix, start, limit))
                if python is not None and not one.failure:
                    try:
                        one.theirs.append(solve_theirs(matrix, start, python, limit, folder))
                    # it is killed for memory, or crashes, where problems are large
                    except PeerError as error:
                        one.failure = str(error).splitlines()[0]
                        say(one.failure)
            races.append(one)
    return races


def solve_ours(
    problem: ContactProblem, matrix: MatrixProblem, start: Floats, limit: float
) -> list[Snapshot]:
    """Solve it again and again with ever smaller tolerances, from the start each time; the time is
    that of the whole call.
    """
    moments = [Snapshot(0.0, 0.0, natural_error(matrix, start))]
    solve_contacts(problem, loosened(1e3), start=start)  # compiles
    spent = 0.0
    for tolerance in _TOLERANCES:
        settings = replace(loosened(tolerance), max_sweeps=_MOST_SWEEPS)
        begin = time.perf_counter()
        solution = solve_contacts(problem, settings, reference_velocity=matrix.scale, start=start)
        seconds = time.perf_counter() - begin
        moments.append(Snapshot(seconds, solution.sweeps, natural_error(matrix, solution.impulse)))
        spent += seconds
        if (
            moments[-1].error <= TARGETS[-1]
            or max(seconds, spent / _REPEATED) > limit
            or not solution.converged
        ):
            break
    return moments


def solve_theirs(
    matrix: MatrixProblem, start: Floats, python: str, limit: float, folder: Path
) -> list[Snapshot]:
    """Solve it with Siconos; the time is that of its driver, without making its matrix."""
    save_problem(
        str(folder / "problem.npz"), matrix, start=start.ravel(), target=TARGETS[-1], limit=limit
    )
    worker = Path(__file__).resolve().parent / "siconos_worker.py"
    run_program(
        [python, str(worker), "problem.npz", "solution.npz"],
        folder,
        environment={"PYTHONPATH": str(worker.parent)},
    )
    with np.load(folder / "solution.npz") as stored:
        rows = zip(stored["seconds"], stored["iterations"], stored["errors"], strict=True)
        return [Snapshot(float(s), float(i), float(e)) for s, i, e in rows]


def first_below(moments: list[Snapshot], target: float) -> Snapshot | None:
    """The cheapest moment whose error is at most the target; None if it was not reached."""
    return min((m for m in moments if m.error <= target), key=lambda m: m.seconds, default=None)


def per_contact(moments: list[Snapshot], contacts: int) -> float:
    """Time per contact and sweep of the longest run [s]; nan if there was none."""
    last = max(moments, key=lambda m: m.sweeps)
    return last.seconds / (last.sweeps * contacts) if last.sweeps > 0.0 else math.nan


def as_text(races: list[Race]) -> str:
    """The result as a table."""
    headings = (
        "problem",
        "contacts",
        "start",
        "error",
        "ours [s]",
        "sweeps",
        "siconos [s]",
        "sweeps",
        "ratio",
    )
    rows = [_row(one, target) for one in races for target in TARGETS]
    return "\n".join([draw(headings, rows), "", *_notes(races)])


def _row(one: Race, target: float) -> list[str]:
    ours, theirs = _reached(one.ours, target), _reached(one.theirs, target)
    return [
        one.scene, f"{one.contacts}", "warm" if one.is_warm else "cold", f"{target:.0e}",
        *_cells(one.ours, ours),
        *(["failed", ""] if one.failure else _cells(one.theirs, theirs)), _ratio(one, ours, theirs),
    ]  # fmt: skip


def _ratio(one: Race, ours: list[Snapshot], theirs: list[Snapshot]) -> str:
    """Siconos over ours; a lower bound where it has not arrived within its time."""
    if theirs:
        ratios = [
            b.seconds / a.seconds for a, b in zip(ours, theirs, strict=False) if a.seconds > 0.0
        ]
        return spread(ratios) if ratios else ""
    bounds = [
        max(m.seconds for m in b) / a.seconds
        for a, b in zip(ours, one.theirs, strict=False)
        if a.seconds > 0.0
    ]
    return f"> {min(bounds):.3g}" if bounds else ""


def _reached(rounds: list[list[Snapshot]], target: float) -> list[Snapshot]:
    """Where a solver reached the target, if it did in every round."""
    moments = [first_below(moments, target) for moments in rounds]
    return [moment for moment in moments if moment is not None] if all(moments) else []


def _cells(rounds: list[list[Snapshot]], reached: list[Snapshot]) -> list[str]:
    if not rounds:
        return ["", ""]
    if not reached:
        best = min(moment.error for moment in rounds[0])
        return [f"> {max(m.seconds for m in rounds[0]):.2g}", f"(best {best:.0e})"]
    return [spread([m.seconds for m in reached]), f"{median([m.sweeps for m in reached]):.0f}"]


def _notes(races: list[Race]) -> list[str]:
    lines = [
        (
            "error: rms over the contacts of the natural map, over the rms closing velocity; the "
            "same function for both answers"
        )
    ]
    for one in races:
        if one.failure:
            lines.append(f"{one.scene}, {one.contacts} contacts: siconos: {one.failure}")
        if not one.is_warm:
            mine, other = (
                [1e9 * per_contact(moments, one.contacts) for moments in r]
                for r in (one.ours, one.theirs)
            )
            siconos = f", siconos {spread(other)}" if other else ""
            lines.append(
                f"{one.scene}, {one.contacts} contacts: ns per contact and sweep: ours "
                f"{spread(mine)}{siconos}"
            )
    return lines


def as_json(races: list[Race]) -> dict[str, Any]:
    """The result as JSON types."""
    return {"races": [asdict(one) for one in races]}
