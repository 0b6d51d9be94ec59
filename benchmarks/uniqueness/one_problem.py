"""One contact problem, solved from several starts, in several orders of the contacts, by plain and
by accelerated sweeps.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from driving import begin
from law import approach_velocity, contact_velocity, violations
from scenes import bed

from multicor_cli.engine import ContactProblem, Settings, solve_contacts
from multicor_cli.engine.orders import Method
from multicor_cli.model.model import Floats, Ints

METHODS: tuple[Method, ...] = ("gauss-seidel", "accelerated")
WORST = 1e-8
"""Largest violation of the laws, over the largest approach velocity, of what is called a
solution."""

DISTINCT = 1e-4
"""Velocities at a contact that differ by more, over the largest approach velocity, are of different
solutions."""

CHANGED = 1e-2
"""The same, of what is counted as a contact that differs."""


@dataclass(frozen=True)
class Taken:
    """A problem with the impulses of the step before, shape ``(c, 2)``."""

    seed: int
    time: float
    problem: ContactProblem
    warm: Floats


@dataclass(frozen=True)
class Solve:
    """What one solve has found.

    Attributes:
        label: Method, start and order.
        converged: Whether the solver's own tolerances were met.
        impulse: Impulses in the order of the problem, shape ``(c, 2)``.
        velocity: Velocities of the bodies, shape ``(b, 3)``.
        contact: Velocities at the contacts over the largest approach velocity, shape ``(c, 2)``.
        worst: Largest violation of the laws, over the same.
    """

    label: str
    converged: bool
    impulse: Floats
    velocity: Floats
    contact: Floats
    worst: float

    @property
    def is_solution(self) -> bool:
        """By the independent check, whatever the solver says."""
        return self.worst <= WORST


@dataclass(frozen=True)
class Difference:
    """Two solutions: contacts that differ, and by how much over the largest approach velocity;
    contacts loaded in one only.
    """

    contacts: int
    largest: float
    let_go: int


@dataclass
class Row:
    """A problem and its solutions.

    Attributes:
        seed: Seed of the bed.
        time: When the problem was taken [s].
        contacts: Number of contacts.
        solves: Number of solves.
        solved: Of these, how many found a solution.
        distinct: Number of different velocities among these.
        methods: Plain against accelerated from zero, in the order of the problem; None if one of
            them found none.
        widest: The two solutions that differ most; None if fewer than two were found.
        worst: Largest violation of the laws in all solutions.
        forces: Largest rms difference of the impulses of two solutions, over their rms.
        straight: Largest violation of the laws half-way between the widest two: if none, all
            between them are solutions.
        plain: The solution by plain sweeps from zero, if there is one.
        pair: The widest two, to be recorded.
    """

    seed: int
    time: float
    contacts: int
    solves: int
    solved: int
    distinct: int
    methods: Difference | None
    widest: Difference | None
    worst: float
    forces: float
    straight: float
    plain: Solve | None = field(default=None, repr=False)
    pair: tuple[Solve, Solve] | None = field(default=None, repr=False)


def take(count: int, seed: int, times: list[float]) -> Iterator[Taken]:
    """Problems of a bed that settles, at some times [s]."""
    driven = begin(bed(count, seed, times[-1]))
    steps = [round(time / driven.plan.stages[0].dt) for time in times]
    taken: list[Taken] = []

    def look(now: object) -> None:
        if driven.steps in steps:
            problem, warm = driven.engine.next_start(driven.dt, driven.steps * driven.dt)
            taken.append(Taken(seed, driven.steps * driven.dt, problem, warm.copy()))

    driven.run(look)
    yield from taken


def settings_for(method: Method, cap: int) -> Settings:
    """Tight tolerances: the program's own residuals over its own scales."""
    return Settings(
        method=method,
        tolerance_rms=1e-12,
        tolerance_max=1e-10,
        tolerance_energy=1e-9,
        max_sweeps=cap,
    )


def starts_of(problem: ContactProblem, warm: Floats, count: int) -> dict[str, Floats]:
    """Impulses to start from: none, those of the last step, and some by lot inside the cones."""
    starts = {"zero": np.zeros_like(warm), "last step": warm}
    size = 2.0 * float(warm[:, 0].mean()) or 1.0
    for number in range(1, count + 1):
        lot = np.random.Generator(np.random.Philox(number))
        normal = size * lot.random(len(warm))
        starts[f"lot {number}"] = np.column_stack(
            [normal, problem.friction * normal * lot.uniform(-1.0, 1.0, len(warm))]
        )
    return starts


def solve_all(problem: ContactProblem, warm: Floats, cap: int, lots: int) -> list[Solve]:
    """Both methods from all starts, and from zero in other orders of the contacts."""
    solves = []
    for method in METHODS:
        settings = settings_for(method, cap)
        for name, start in starts_of(problem, warm, lots).items():
            solves.append(
                _solve(problem, settings, f"{method}, {name}", start, np.arange(len(warm)))
            )
        for number in range(1, lots + 1):
            order = np.random.Generator(np.random.Philox(100 + number)).permutation(len(warm))
            solves.append(
                _solve(problem, settings, f"{method}, order {number}", np.zeros_like(warm), order)
            )
    return solves


def _solve(
    problem: ContactProblem, settings: Settings, label: str, start: Floats, order: Ints
) -> Solve:
    names = ("pair", "normal", "lever", "bias", "friction")
    ordered = replace(
        problem, **{name: np.ascontiguousarray(getattr(problem, name)[order]) for name in names}
    )
    found = solve_contacts(ordered, settings, start=start[order])
    impulse = np.empty_like(start)
    impulse[order] = found.impulse
    return as_solve(problem, impulse, found.velocity, label, converged=found.converged)


def as_solve(
    problem: ContactProblem, impulse: Floats, velocity: Floats, label: str, *, converged: bool
) -> Solve:
    """Check impulses and velocities, wherever they come from."""
    contact = contact_velocity(problem, velocity) / approach_velocity(problem)
    return Solve(
        label, converged, impulse, velocity, contact, violations(problem, impulse, velocity).worst
    )


def difference(one: Solve, other: Solve) -> Difference:
    """How two solutions differ; a contact is let go if its impulse, and not only its last digits,
    is there in one only.
    """
    apart = np.linalg.norm(one.contact - other.contact, axis=1)
    least = 1e-6 * max(float(one.impulse[:, 0].max()), float(other.impulse[:, 0].max()))
    loaded = one.impulse[:, 0] > least, other.impulse[:, 0] > least
    return Difference(
        int((apart > CHANGED).sum()), float(apart.max()), int((loaded[0] != loaded[1]).sum())
    )


def distinct(solutions: list[Solve]) -> list[Solve]:
    """One of each kind: velocities that are nowhere apart by more than `DISTINCT` are the same."""
    kinds: list[Solve] = []
    for solution in solutions:
        if all(difference(solution, kind).largest > DISTINCT for kind in kinds):
            kinds.append(solution)
    return kinds


def study(taken: Taken, cap: int, lots: int) -> Row:
    """Solve a problem in all ways and compare.

    Args:
        taken: The problem.
        cap: Largest number of sweeps of a solve.
        lots: Number of random starts, and of other orders.
    """
    solves = solve_all(taken.problem, taken.warm, cap, lots)
    solutions = [solve for solve in solves if solve.is_solution]
    kinds = distinct(solutions)
    by_name = {solve.label: solve for solve in solutions}
    plain, fast = (by_name.get(f"{method}, zero") for method in METHODS)
    pairs = [(a, b) for k, a in enumerate(kinds) for b in kinds[:k]] or [
        (a, b) for a in solutions[:1] for b in solutions[1:2]
    ]
    widest = max(pairs, key=lambda pair: difference(*pair).largest, default=None)
    return Row(
        taken.seed,
        taken.time,
        len(taken.problem.pair),
        len(solves),
        len(solutions),
        len(kinds),
        difference(plain, fast) if plain is not None and fast is not None else None,
        difference(*widest) if widest is not None else None,
        max((solve.worst for solve in solutions), default=float("nan")),
        max((_forces_apart(a, solutions[0]) for a in solutions[1:]), default=float("nan")),
        _half_way(taken.problem, *widest) if widest is not None else float("nan"),
        plain,
        widest,
    )


def _half_way(problem: ContactProblem, one: Solve, other: Solve) -> float:
    impulse, velocity = 0.5 * (one.impulse + other.impulse), 0.5 * (one.velocity + other.velocity)
    return violations(problem, impulse, velocity).worst


def _forces_apart(one: Solve, other: Solve) -> float:
    size = np.sqrt(0.5 * ((one.impulse**2).sum() + (other.impulse**2).sum()))
    return float(np.sqrt(((one.impulse - other.impulse) ** 2).sum()) / size)


def without_friction(taken: Taken) -> Taken:
    """The same problem with μ = 0: the control, in which velocities are unique."""
    problem = replace(taken.problem, friction=np.zeros_like(taken.problem.friction))
    return replace(taken, problem=problem, warm=taken.warm * [1.0, 0.0])


def record(row: Row, taken: Taken, path: Path) -> None:
    """Keep a problem with its two solutions that differ most, as ``.npz``."""
    if row.pair is None:
        message = f"{path}: there are no two solutions to record"
        raise ValueError(message)
    taken.problem.save(path)
    with np.load(path) as stored:
        arrays = dict(stored)
    for number, solve in enumerate(row.pair):
        arrays |= {f"impulse{number}": solve.impulse, f"velocity{number}": solve.velocity}
    np.savez_compressed(path, **arrays)
