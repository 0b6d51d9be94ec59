"""Whether what the program promises of every run holds in this one: books, overlaps, convergence."""

from __future__ import annotations

from collections.abc import Iterator

from multicor_cli.checks.check import Measured, Rule
from multicor_cli.checks.recorded import Recorded

CLOSURE_LIMIT = 1e-10
"""Books that close better than this hold rounding errors only."""

_OVERLAP = 1e-3


def _closure(run: Recorded) -> Iterator[Measured]:
    if run.has_steps:
        yield Measured(run.info["energy_closure"])


def _heat_closure(run: Recorded) -> Iterator[Measured]:
    if run.has_steps and run.info["heat_closure"] is not None:
        yield Measured(run.info["heat_closure"])


def _overlap(run: Recorded) -> Iterator[Measured]:
    if run.has_steps:
        yield Measured(run.info["max_overlap"])


def _correction(run: Recorded) -> Iterator[Measured]:
    if not run.has_steps:
        return
    given = run.book("kinetic_start") + sum(abs(run.book(name)) for name in ("gravity_work", "wall_work", "load_work"))
    if given > 0.0:
        yield Measured(abs(run.book("correction_work")) / given)


def _unconverged(run: Recorded) -> Iterator[Measured]:
    if run.has_steps:
        missed, steps = run.info["solver"]["unconverged_steps"], run.info["step"]
        yield Measured(missed / steps, f"{missed} of {steps}")


def _undelivered(run: Recorded) -> Iterator[Measured]:
    if run.has_steps and run.info["heat"] is not None:
        books = run.info["heat"]["books"]
        lost, given = abs(books["undelivered"]), abs(books["from_walls"])
        if lost + given > 0.0:
            yield Measured(lost / (lost + given), f"{lost:.3g} J")


RULES: tuple[Rule[Recorded], ...] = (
    Rule(
        "energy closure", _closure, warning=CLOSURE_LIMIT, bad=CLOSURE_LIMIT,
        meaning="Largest imbalance of the energy books over the sum of their terms. They close to round-off by construction.",
        remedy="Report it: this is a bug, or the files were changed.",
    ),
    Rule(
        "heat closure", _heat_closure, warning=CLOSURE_LIMIT, bad=CLOSURE_LIMIT,
        meaning="The same of the heat books.",
        remedy="Report it: this is a bug, or the files were changed.",
    ),
    Rule(
        "overlap", _overlap, unit="of the smaller radius", warning=_OVERLAP, bad=_OVERLAP,
        meaning="Largest overlap at the end of a step. Positions are corrected until none exceeds half of the limit.",
        remedy="Look at where the run began: a packing or a wall may have pressed grains into each other.",
    ),
    Rule(
        "work of corrections", _correction, unit="of the work put in", warning=0.01, bad=0.1,
        meaning="Work of gravity and loads on the displacements that remove overlaps, over all work that the grains were given: "
        "energy that the motion neither gained nor lost.",
        remedy="Use a shorter dt: overlaps grow with its square.",
    ),
    Rule(
        "steps not converged", _unconverged, unit="of the steps", warning=0.0, bad=0.05,
        meaning="Steps that missed a tolerance of the contact solver within max_sweeps; their forces are less exact.",
        remedy="Raise max_sweeps, or loosen the tolerances on purpose; see where with multicor post energy.",
    ),
    Rule(
        "heat not delivered", _undelivered, unit="of the heat of walls", warning=0.0,
        meaning="Heat of walls of prescribed flow that reached no grain, since nothing touched the wall.",
        remedy="Give the wall a temperature, let the flow begin later, or press the grains on it.",
    ),
)  # fmt: skip
"""What is checked of every run."""
