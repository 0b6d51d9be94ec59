"""What the command measures, and how much of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import flows
import rest
import theirs
from one_problem import (
    Difference,
    Row,
    Solve,
    Taken,
    difference,
    record,
    study,
    take,
    without_friction,
)
from recorded import Recorded, examine
from scenes import bed, collapse

Say = Callable[[str], None]

SICONOS_CONTACTS = 400
"""Siconos gets the full matrix: a sweep of it costs the square of the contacts."""


@dataclass(frozen=True)
class Plan:
    """How much is done.

    Attributes:
        seeds: Number of packings of each scene; some flows take more (`flows.Flow.packings`).
        beds: Numbers of grains of the beds whose problems are solved.
        times: When they are taken from a bed of so many grains [s].
        cap: Largest number of sweeps of a tight solve.
        lots: Number of random starts, and of other orders.
        flows: The flows.
        bed: Grains of the bed at rest, and time that it gets [s].
        pile: Grains of the pile at rest, and the times of its column and its collapse [s].
        steps: Steps at rest.
        siconos: Whether small problems are solved by Siconos too.
    """

    seeds: int
    beds: list[int]
    times: dict[int, list[float]]
    cap: int
    lots: int
    flows: list[flows.Flow]
    bed: tuple[int, float]
    pile: tuple[int, float, float]
    steps: int
    siconos: bool


def full(seeds: int, siconos: bool) -> Plan:
    """What the figures in the README were made with."""
    kinds = [
        flows.shear_flow(160, 0.1, 2.0, 8.0, 1e-3),
        flows.shear_flow(160, 0.1, 2.0, 8.0, 1e-4),
        flows.shear_flow(160, 0.01, 0.7, 2.3, 1e-3),
        flows.collapse_flow(120, 0.12, 0.35, 1e-3, packings=4),
    ]
    times = {60: [0.03, 0.035, 0.04, 0.045, 0.05], 500: [0.05]}
    return Plan(
        seeds, [60, 500], times, 40_000, 2, kinds, (500, 0.8), (200, 0.15, 0.7), 200, siconos
    )


def quick(seeds: int, siconos: bool) -> Plan:
    """A small check of every part."""
    kinds = [flows.shear_flow(80, 0.1, 1.0, 2.0, 1e-3), flows.collapse_flow(40, 0.08, 0.15, 1e-3)]
    return Plan(
        seeds,
        [100],
        {100: [0.035, 0.04]},
        5_000,
        1,
        kinds,
        (60, 0.25),
        (40, 0.08, 0.3),
        20,
        siconos,
    )


@dataclass(frozen=True)
class Control:
    """The same problem without friction: solutions, kinds of velocities, and how far velocities and
    forces are apart.
    """

    solved: int
    distinct: int
    velocities: float
    forces: float


@dataclass(frozen=True)
class Problem:
    """One problem with and without friction; Siconos against plain sweeps from zero, if both have
    it.
    """

    grains: int
    row: Row
    control: Control
    siconos: Difference | None


@dataclass
class Results:
    """Everything that was measured."""

    plan: Plan
    recorded: Recorded | None = None
    problems: list[Problem] = field(default_factory=list)
    flows: list[flows.Comparison] = field(default_factory=list)
    rests: list[rest.AtRest] = field(default_factory=list)

    def as_dict(self) -> dict[str, Any]:
        """For JSON: without arrays and functions."""
        problems = []
        for problem in self.problems:
            row = {
                name: value
                for name, value in vars(problem.row).items()
                if name not in ("pair", "plain")
            }
            row |= {
                name: asdict(row[name]) if row[name] is not None else None
                for name in ("methods", "widest")
            }
            siconos = None if problem.siconos is None else asdict(problem.siconos)
            problems.append(
                {
                    "grains": problem.grains,
                    **row,
                    "control": asdict(problem.control),
                    "siconos": siconos,
                }
            )
        rests = [
            {"scene": one.scene, "grains": one.grains, "rows": [asdict(kept) for kept in one.rows]}
            for one in self.rests
        ]
        recorded = None if self.recorded is None else asdict(self.recorded)
        return {
            "seeds": self.plan.seeds,
            "recorded": recorded,
            "problems": problems,
            "flows": [asdict(one) for one in self.flows],
            "rests": rests,
        }


def solve_problems(plan: Plan, say: Say, kept: Path | None = None) -> list[Problem]:
    """Problems of settling beds; that of the widest difference among the smallest beds is recorded
    if a file is named.
    """
    python = theirs.find_python() if plan.siconos else None
    if plan.siconos and python is None:
        say("Siconos is not installed: left out (SICONOS_PYTHON names an interpreter that has it)")
    problems: list[Problem] = []
    widest: tuple[float, Row, Taken] | None = None
    for grains in plan.beds:
        for seed in range(1, plan.seeds + 1):
            for taken in take(grains, seed, plan.times[grains]):
                say(
                    f"bed of {grains}, seed {seed}, {taken.time:.3f} s: {len(taken.problem.pair)} "
                    "contacts"
                )
                problems.append(_solve_problem(grains, taken, plan, python))
                row = problems[-1].row
                size = row.widest.largest if row.widest is not None else 0.0
                if grains == plan.beds[0] and (widest is None or size > widest[0]):
                    widest = size, row, taken
    if kept is not None and widest is not None:
        record(widest[1], widest[2], kept)
    return problems


def _solve_problem(grains: int, taken: Taken, plan: Plan, python: str | None) -> Problem:
    other: Solve | None = None
    if python is not None and len(taken.problem.pair) <= SICONOS_CONTACTS:
        other = theirs.solve_theirs(taken.problem, python, plan.cap)
    row = study(taken, plan.cap, plan.lots)
    free = study(without_friction(taken), plan.cap, plan.lots)
    control = Control(
        free.solved,
        free.distinct,
        free.widest.largest if free.widest is not None else float("nan"),
        free.forces,
    )
    has_both = other is not None and other.is_solution and row.plain is not None
    return Problem(grains, row, control, difference(other, row.plain) if has_both else None)


def run_study(
    plan: Plan, parts: list[str], say: Say, kept: Path | None = None, first: int = 1
) -> Results:
    """Measure what is asked for, of "problems", "flows" and "rest"; ``first`` is the first seed of
    the flows.
    """
    results = Results(plan)
    if "problems" in parts:
        results.recorded = examine()
        results.problems = solve_problems(plan, say, kept)
    if "flows" in parts:
        results.flows = [
            flows.compare(flow, flow.packings * plan.seeds, say, first) for flow in plan.flows
        ]
    if "rest" in parts:
        count, duration = plan.bed
        results.rests.append(
            rest.compare(
                "bed in a box", rest.come_to_rest(bed(count, 1, duration)), plan.steps, say
            )
        )
        count, settle, spread = plan.pile
        results.rests.append(
            rest.compare(
                "pile", rest.come_to_rest(collapse(count, 1, settle, spread)), plan.steps, say
            )
        )
    return results
