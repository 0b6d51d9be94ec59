"""What a run of the study shows: friction, solid fraction, profiles, overlap, and what it has
cost.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from cases import LOAD, SPEEDS, TAU, TRANSIENT, Case

from multicor_cli import open_run
from multicor_cli.model.model import Floats
from multicor_cli.post import Selection, profile, rheology
from multicor_cli.store import Run
from multicor_cli.store.reader import run_info

BINS = 20
MARGIN = 8.0  # mean diameters left out at either wall


@dataclass(frozen=True)
class Measured:
    """Averages over the steady part of one run, or of several; errors are standard errors.

    Attributes:
        inertial: Inertial number of the bulk.
        friction: Shear force over load at the walls, and its error.
        solid: Solid fraction of the bulk, and its error.
        velocity: Profile of v_x over the wall's speed, shape ``(BINS,)``.
        density: Profile of the solid fraction, shape ``(BINS,)``.
        early: Mean gap of the contacts, weighted with their impulses, over the mean diameter: how
            far from each other grains are that act on each other, because a contact that closes
            within a step takes part in all of it.
        overlap: Largest overlap over the smaller radius.
        slide: Distance per step at the speed of shear across one grain, γ̇ Δt.
        sweeps: Sweep-equivalents per step.
        work: Sweep-equivalents per unit of strain.
        unconverged: Steps that were not solved to the tolerance.
    """

    inertial: float
    friction: tuple[float, float]
    solid: tuple[float, float]
    velocity: Floats
    density: Floats
    early: float
    overlap: float
    slide: float
    sweeps: float
    work: float
    unconverged: int


def measure(path: Path, case: Case) -> Measured:
    """Measure a finished run."""
    with open_run(path) as run:
        series = run.series
        began = series["time"][np.argmax(series["strain"] > TRANSIENT)]
        steady = Selection(start=began)
        table = rheology(run, steady, margin=MARGIN)
        mean, error = table.mean, table.error
        velocity = (
            profile(run, "velocity", steady, BINS, exclude_walls=0.0).value / SPEEDS[case.inertial]
        )
        density = profile(run, "solid-fraction", steady, BINS, exclude_walls=0.0).value
        early = _early(run, began)
        info = run_info(path)
        number = mean["inertial_number"] * np.sqrt(mean["pressure"] * run.period / LOAD)
        rate = number / TAU
        steps_per_strain = info["step"] / case.strain
    return Measured(
        number,
        (mean["friction_walls"], error["friction_walls"]),
        (mean["solid_fraction"], error["solid_fraction"]),
        velocity,
        density,
        early,
        info["max_overlap"],
        rate * case.step * TAU,
        info["solver"]["sweeps_mean"],
        info["solver"]["sweeps_mean"] * steps_per_strain,
        info["solver"]["unconverged_steps"],
    )


def _early(run: Run, began: float) -> float:
    impulse = moment = 0.0
    for frame in run.frames:
        if frame.time >= began and frame.contacts is not None:
            normal = np.asarray(frame.contacts.impulse)[:, 0]
            impulse += float(normal.sum())
            moment += float((normal * np.maximum(frame.contacts.gap, 0.0)).sum())
    return moment / impulse / run.model.mean_diameter
