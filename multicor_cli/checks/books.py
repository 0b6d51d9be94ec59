"""Whether a run keeps what all runs must, its averages are steady, and how its stages ended."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from multicor_cli.checks.check import Measured, Recorded, Rule
from multicor_cli.model.cell import COMPONENTS
from multicor_cli.model.model import Floats
from multicor_cli.store.documents import StageEnd, record_of

# ---- What holds in every run: books, overlaps, convergence

CLOSURE_LIMIT = 1e-10
"""Books that close better than this hold rounding errors only."""

_OVERLAP = 1e-3


def _correction(run: Recorded) -> Iterator[Measured]:
    if not run.has_steps:
        return
    given = run.book("kinetic_start") + sum(
        abs(run.book(name)) for name in ("gravity_work", "wall_work", "load_work")
    )
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


def _ahead(run: Recorded) -> Iterator[Measured]:
    if run.has_steps and run.info["heat"] is not None:
        books = run.info["heat"]["books"]
        generated = abs(books["friction"]) + abs(books["impact"])
        if generated > 0.0:
            ahead = books.get("ahead", 0.0)  # unknown to older files
            yield Measured(ahead / generated, f"{ahead:.3g} J")


RULES: tuple[Rule[Recorded], ...] = (
    Rule(
        "energy closure", lambda run: run.summary("energy_closure"),
        warning=CLOSURE_LIMIT, bad=CLOSURE_LIMIT,
        meaning="Largest imbalance of the energy books over the sum of their terms. They close "
            "to round-off by construction.",
        remedy="Where steps did not converge, as walls jam grains between them, see to that: round-"
            "off grows with their impulses. Else report it: this is a bug, or the files were "
            "changed.",
    ),
    Rule(
        "heat closure", lambda run: run.summary("heat_closure"),
        warning=CLOSURE_LIMIT, bad=CLOSURE_LIMIT,
        meaning="The same of the heat books.",
        remedy="Report it: this is a bug, or the files were changed.",
    ),
    Rule(
        "overlap", lambda run: run.summary("max_overlap"), unit="of the smaller radius",
        warning=_OVERLAP, bad=_OVERLAP,
        meaning="Largest overlap at the end of a step. Positions are corrected until none "
            "exceeds half of the limit.",
        remedy="Look at where the run began: a packing or a wall may have pressed grains into "
            "each other.",
    ),
    Rule(
        "work of corrections", _correction, unit="of the work put in", warning=0.01, bad=0.1,
        meaning="Work of gravity and loads on the displacements that remove overlaps, over all "
            "work that the grains were given: energy that the motion neither gained nor lost.",
        remedy="Use a shorter dt: overlaps grow with its square.",
    ),
    Rule(
        "steps not converged", _unconverged, unit="of the steps", warning=0.0, bad=0.05,
        meaning="Steps that missed a tolerance of the contact solver within max_sweeps; their "
            "forces are less exact.",
        remedy="Raise max_sweeps, or loosen the tolerances on purpose; see where with multicor "
            "post series DIR --of unconverged --plot FILE.",
    ),
    Rule(
        "heat ahead of losses", _ahead, unit="of the heat generated", warning=0.01, bad=0.1,
        meaning="Heat that grains and walls have received beyond what their contacts have lost so "
            "far, over the heat of friction and impacts. Losses are exact together, not one by "
            "one: negative ones are made up for by the next positive ones of the grain or wall.",
        remedy="As for negative losses: use a shorter dt, or lower tolerance_rms.",
    ),
    Rule(
        "heat not delivered", _undelivered, unit="of the heat of walls", warning=0.0,
        meaning="Heat of walls of prescribed flow that reached no grain, since nothing touched "
            "the wall.",
        remedy="Give the wall a temperature, let the flow begin later, or press the grains on it.",
    ),
)  # fmt: skip


# ---- Whether what is averaged over the last stage is steady

_BLOCKS = 5
"""Blocks of a quarter, whose means tell how much its mean scatters."""

_SURE = 3.0
"""A drift counts from this many standard errors on."""

_SMALL = 1e-6
"""Kinetic energy over the sum of the works up to which the grains rest."""


def relative_drift(values: Floats) -> float | None:
    """Change of the mean from the third to the fourth quarter of a series, over the larger one.

    0 if it is within three standard errors (of the means of five blocks of a quarter); None for
    fewer than 40 values.
    """
    length = len(values) // (4 * _BLOCKS)
    if length < 2:
        return None
    blocks = values[len(values) - 2 * _BLOCKS * length :].reshape(2, _BLOCKS, length).mean(axis=2)
    third, fourth = blocks.mean(axis=1)
    error = math.sqrt(float(blocks.var(axis=1, ddof=1).sum()) / _BLOCKS)
    change, size = abs(float(fourth - third)), max(abs(float(third)), abs(float(fourth)))
    return 0.0 if size == 0.0 or change <= _SURE * error else change / size


def _drifts(run: Recorded) -> Iterator[Measured]:
    stage = run.info["stage"]
    if stage is None or not run.run.stages:
        return
    rows = run.rows(min(int(stage), len(run.run.stages) - 1))
    if not rows.size:
        return
    for name, values in _averaged(run, rows):
        change = relative_drift(values)
        if change is not None:
            yield Measured(change, name)


def _averaged(
    run: Recorded, rows: np.ndarray[tuple[int], np.dtype[np.int64]]
) -> Iterator[tuple[str, Floats]]:
    kinetic = run.series("kinetic")[rows]
    if kinetic[-1] > _SMALL * run.book("terms"):
        yield "kinetic energy", kinetic
    force, at = run.series("wall_force")[rows], run.series("wall_position")[rows]
    scale = float(np.abs(force[..., :2]).mean(axis=0).max(initial=0.0)) if force.size else 0.0
    of = ["the cell"] if run.run.model.is_cell else [f"wall {n}" for n in run.run.wall_names]
    for w, name in enumerate(of):
        named = [f"force in {letter} on {name}" for letter in "xy"]
        if run.run.model.is_cell:
            named = [f"stress {component} times the area of the cell" for component in COMPONENTS]
        for axis, what in enumerate(named):
            if np.abs(force[:, w, axis]).mean() > 0.1 * scale:
                yield what, force[:, w, axis]
    heights = at[:, :, 1]
    rests = np.ptp(heights, axis=0) == 0.0
    base = float(heights[0, rests].min()) if rests.any() else 0.0
    for w in run.lifted_walls:
        if not rests[w]:
            yield f"height of {of[w]}", heights[:, w] - base


DRIFT: tuple[Rule[Recorded], ...] = (
    Rule(
        "drift", _drifts, warning=0.1,
        meaning="Change of the mean from the third to the fourth quarter of the last stage, over "
            "the larger of them: of the kinetic energy, of forces on walls, of heights of walls; "
            "0 where it is within three standard errors. Means over the later half of a stage, "
            "the default of multicor post, are those of a steady state only if nothing drifts.",
        remedy="Let the stage go on for longer, or choose frames with --from and --to; in a "
            "transient flow (a collapse), nothing.",
    ),
)  # fmt: skip


# ---- Whether the stages of a run ended as they were meant to


def _timed_out(run: Recorded) -> Iterator[Measured]:
    ends = [record_of(StageEnd, end) for end in run.info["stage_ends"]]
    late = [f"{end.name}: {end.why}" for end in ends if end.reason == "timeout"]
    if ends:
        yield Measured(len(late), "; ".join(late))


STAGES: tuple[Rule[Recorded], ...] = (
    Rule(
        "stages timed out", _timed_out, warning=0.0,
        meaning="Stages whose duration was over before the condition of their until held: what "
            "they waited for did not happen.",
        remedy='Give them a longer duration or another goal; with on_timeout = "stop" the run '
            'ends there.',
    ),
)  # fmt: skip
