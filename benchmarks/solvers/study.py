"""What is run: problems of each source, one by one and in sequence, with the methods asked for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from comparison import Curve, compare, tolerances
from methods import METHODS, Method
from problems import Problem, column, consecutive, is_run
from reference import Reference, separation, solve_closely
from sequences import Cost, measure_sequence
from starts import measure_starts

from multicor_cli.engine.contact.system import by_slot
from multicor_cli.model.columns import NORMAL

LEVELS = (1e-2, 1e-3, 1e-4)
"""Residuals for which tables give the cost: rms over u_ref, and maximum and energy in the
proportions of the default tolerances."""

HIGH = 1e-8
"""The same for high accuracy."""

DISTANCES = (1e-1, 3e-2, 1e-2, 3e-3)
"""Distances over u_ref for which tables give the time."""


@dataclass(frozen=True)
class Plan:
    """What is asked for.

    Attributes:
        sources: Names of sources of problems.
        grains: Sizes of the sources whose size can be chosen.
        methods: The methods.
        rounds: Timed runs of each method.
        steps: Consecutive steps of a sequence; 1: no sequences.
        cap: Largest number of iterations.
        is_accurate: Whether to go on to `HIGH` (engine and newton only).
        has_starts: Whether to compare warm starts.
        seed: Seed of the scenes.
        folder: Where problems are kept.
    """

    sources: Sequence[str]
    grains: Sequence[int]
    methods: Sequence[Method]
    rounds: int
    steps: int
    cap: int
    is_accurate: bool
    has_starts: bool
    seed: int
    folder: Path


@dataclass(frozen=True)
class Single:
    """All methods on one problem.

    Attributes:
        name: Name of the problem.
        contacts: Number of contacts.
        curves: One for each method.
        exact: Largest error of an impulse over the largest impulse by method, where the solution is
            known; else empty.
        reference: rms over u_ref of the solution that distances are measured to.
        apart: Distance over u_ref of the solution that was found from the other start; None if
            there is one start only.
    """

    name: str
    contacts: int
    curves: list[Curve]
    exact: dict[str, float]
    reference: float
    apart: float | None


@dataclass(frozen=True)
class Series:
    """All methods on the steps of one scene; ``reference`` is the worst of the references."""

    name: str
    contacts: float
    reference: float
    costs: list[Cost]
    starts: list[Cost]


@dataclass(frozen=True)
class Results:
    """Everything that was measured; ``high`` is as ``singles``, to high accuracy."""

    singles: list[Single]
    high: list[Single]
    sequences: list[Series]

    def as_dict(self) -> dict[str, Any]:
        """Everything as JSON types."""
        return {
            "single": [_single_as_dict(single, LEVELS) for single in self.singles],
            "high_accuracy": [_single_as_dict(single, (*LEVELS, HIGH)) for single in self.high],
            "sequences": [asdict(sequence) for sequence in self.sequences],
        }


def _single_as_dict(single: Single, levels: Sequence[float]) -> dict[str, Any]:
    methods = {}
    for curve in single.curves:
        reached = {f"{level:g}": curve.first(level) for level in levels}
        columns = ("rms", "maximum", "energy", "distance", "sweeps", "seconds")
        methods[curve.method] = {
            "reached": reached,
            **{name: curve.history[:, k].tolist() for k, name in enumerate(columns)},
        }
    return {
        "problem": single.name, "contacts": single.contacts, "reference_rms": single.reference,
        "apart": single.apart,
        "exact_error": single.exact, "methods": methods,
    }  # fmt: skip


def run_study(plan: Plan, say: Callable[[str], None]) -> Results:
    """Carry out a plan; ``say`` is told what is being done."""
    results = Results([], [], [])
    for source, grains in _tasks(plan):
        say(f"problems of {source}" + (f", {grains} grains" if grains else ""))
        steps = (
            [column()]
            if source == "column"
            else consecutive(source, grains, plan.seed, plan.steps, plan.folder)
        )
        _run_singles(_variants(source, steps), plan, results, say)
        if plan.steps > 1 and len(steps) > 1:
            say(f"  {len(steps)} steps in sequence")
            results.sequences.append(_run_sequence(steps, plan))
    return results


def _tasks(plan: Plan) -> list[tuple[str, int]]:
    tasks: list[tuple[str, int]] = []
    for source in plan.sources:
        tasks += (
            [(source, 0)]
            if source == "column" or is_run(source)
            else [(source, grains) for grains in plan.grains]
        )
    return tasks


def _variants(source: str, steps: list[Problem]) -> list[Problem]:
    """The problems that are looked at one by one: that in the middle of the steps, cold and
    warm.
    """
    one = steps[len(steps) // 2]
    if source == "column":
        return [one]
    if source == "deposited":
        return [one.named(f"{one.name}, cold")]
    return [one.cold(), one.named(f"{one.name}, warm")]


def _run_singles(
    problems: Sequence[Problem], plan: Plan, results: Results, say: Callable[[str], None]
) -> None:
    """Run one problem from its starts, and add what comes out to the results."""
    references = [solve_closely(problem) for problem in problems]
    apart = separation(problems[0], *references) if len(references) == 2 else None
    for problem, reference in zip(problems, references, strict=True):
        say(f"  {problem.name}: {problem.contacts} contacts, reference at rms {reference.rms:.1e}")
        results.singles.append(
            _run_single(problem, reference, apart, plan, LEVELS[-1], plan.methods)
        )
        if plan.is_accurate:
            accurate = [METHODS[name] for name in ("engine", "newton")]
            results.high.append(_run_single(problem, reference, apart, plan, HIGH, accurate))


def _run_single(
    problem: Problem,
    reference: Reference,
    apart: float | None,
    plan: Plan,
    target: float,
    methods: Sequence[Method],
) -> Single:
    curves = compare(problem, reference, methods, target=target, cap=plan.cap, rounds=plan.rounds)
    is_known = problem.name.startswith("column")
    exact = {
        method.name: exact_error(problem, reference, method, target, plan.cap)
        for method in methods
        if is_known
    }
    return Single(problem.name, problem.contacts, curves, exact, reference.rms, apart)


def exact_error(
    problem: Problem, reference: Reference, method: Method, target: float, cap: int
) -> float:
    """Largest error of p_n over p_n at the bottom of the column after a method has met the target:
    p_n is the weight above.
    """
    count = problem.contacts
    exact = problem.scale.velocity * np.arange(count, 0, -1)
    system = problem.copy()
    method(system, cap, reference.log(cap, tolerances(problem, target)))
    found = by_slot(system.slot, system.impulse, count)[:, NORMAL]
    return float(np.abs(found - exact).max() / exact[0])


def _run_sequence(steps: list[Problem], plan: Plan) -> Series:
    references = [solve_closely(problem) for problem in steps]
    costs = measure_sequence(steps, references, plan.methods, cap=plan.cap, rounds=plan.rounds)
    starts = (
        measure_starts(steps, references, cap=plan.cap, rounds=plan.rounds, method="engine")
        if plan.has_starts
        else []
    )
    worst = max(reference.rms for reference in references)
    return Series(
        steps[0].name, float(np.mean([problem.contacts for problem in steps])), worst, costs, starts
    )
