"""`configs/biaxial.toml`: platens bear what is asked for, and the critical state is that of plane
shear.

Where the volume no longer changes, the axes of stress are those of the rate of strain, at 45° to
the planes of shear, so that τ/P there is comparable with sin φ = (σ1 − σ3)/(σ1 + σ3); and the
inertial number is that of the rate of shear ε̇1 − ε̇3 = 2 ε̇1.
"""

from dataclasses import dataclass

import numpy as np
import pytest
from bulk import measure_bulk
from numpy.typing import NDArray
from recorded import keep
from scenarios import run_config

import multicor_cli as multicor

pytestmark = [pytest.mark.validation, pytest.mark.timeout(1800)]

BOTTOM, LEFT, TOP, RIGHT = range(4)
STRESS = 100.0
STEADY = 0.1
"""Logarithmic strain from which on the state is critical."""
MARGIN = 4e-3
"""What is left out next to the platens, along which grains lie in rows, in the solid fraction
[m]."""

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Rows:
    """Rows of a stage: times, width and height of the box, and the stresses of the four platens, of
    shape ``(4, r)``."""

    time: Floats
    width: Floats
    height: Floats
    stress: Floats

    @property
    def strain(self):
        """Logarithmic strain of the height, positive in compression."""
        return np.log(self.height[0] / self.height)


def rows_of(run, stage):
    series = run.series
    is_moving = np.asarray(series["window_duration"]) > 0.0
    in_stage = np.asarray(series["stage"]) == run.stages.index(stage)
    rows = np.flatnonzero(in_stage & is_moving)
    place, force = (np.asarray(series[name])[rows] for name in ("wall_position", "wall_force"))
    width, height = place[:, RIGHT, 0] - place[:, LEFT, 0], place[:, TOP, 1] - place[:, BOTTOM, 1]
    stress = np.array(
        [-force[:, BOTTOM, 1], -force[:, LEFT, 0], force[:, TOP, 1], force[:, RIGHT, 0]]
    )
    stress /= np.stack([width, height, width, height])
    return Rows(np.asarray(series["time"])[rows], width, height, stress)


def covered(position, radius, low, high):
    """Share of a rectangle with the corners (low, low) and ``high`` that discs cover, from 800
    points in each disc."""
    grid = (np.arange(32) + 0.5) / 16.0 - 1.0
    points = np.stack(np.meshgrid(grid, grid), axis=-1).reshape(-1, 2)
    points = points[np.hypot(points[:, 0], points[:, 1]) < 1.0]
    at = position[:, None, :2] + radius[:, None, None] * points
    inside = ((at > low) & (at < high)).all(axis=2).mean(axis=1)
    return float((np.pi * radius**2 * inside).sum() / np.prod(high - low))


def critical_state(run):
    """sin φ, solid fraction, change of volume with strain, and inertial number."""
    rows, model = rows_of(run, "compress"), run.model
    steady = rows.strain > STEADY
    major, minor = (
        rows.stress[list(pair)][:, steady].mean() for pair in ((BOTTOM, TOP), (LEFT, RIGHT))
    )
    began, fractions = rows.time[steady][0], []
    for frame in run.frames:
        if frame.time >= began:
            row = int(np.argmin(np.abs(rows.time - frame.time)))
            high = np.array([rows.width[row], rows.height[row]]) - MARGIN
            fractions.append(covered(frame.position, model.grains.radius, MARGIN, high))
    rate = np.ptp(rows.strain[steady]) / np.ptp(rows.time[steady])
    swelling = np.polyfit(rows.strain[steady], np.log(rows.width * rows.height)[steady], 1)[0]
    number = 2.0 * rate * np.sqrt(model.grains.mass.mean() / (0.5 * (major + minor)))
    sine = (major - minor) / (major + minor)
    return sine, float(np.mean(fractions)), float(swelling), float(number)


def plane_shear(directory, seed):
    """The state of plane shear at an inertial number of about 0.0025, at which a run takes half as
    long as at that of the box."""
    speed = 0.147
    changes = [
        f"scenario.seed={seed}", f"loading.0.drives.top.x.velocity={speed}", "solver.dt=auto",
        f"particles.0.velocity=[{0.5 * speed},0.0]", f"particles.0.shear_rate={speed / 0.045}",
        "output.frame_interval=0.02", "solver.tolerance_rms=3e-4", "loading.0.until.strain.value=6.0",
    ]  # fmt: skip
    run_config("shear-gravity-free", directory, *changes)
    return measure_bulk(directory, load=0.3, strain=2.0)


def test_stresses_and_the_critical_state(tmp_path, record_property):
    found = []
    for seed in (3, 4, 5, 6):
        path = run_config("biaxial", tmp_path / f"run-{seed}", f"scenario.seed={seed}")
        with multicor.open_run(path) as run:
            isotropic, compress = rows_of(run, "isotropic"), rows_of(run, "compress")
            found.append(critical_state(run))
        settled = isotropic.stress[:, isotropic.time > isotropic.time[-1] - 0.02].mean(axis=1)
        means = compress.stress.mean(axis=1)
        print(f"seed {seed}: {settled}, then {means} N/m; sin φ, ν, d ln V/dε, I: {found[-1]}")
        assert settled == pytest.approx(np.full(4, STRESS), rel=0.01)
        assert compress.stress[RIGHT].mean() == pytest.approx(STRESS, rel=0.01)
    sine, fraction, swelling, number = np.mean(found, axis=0)
    error = np.std(found, axis=0, ddof=1) / np.sqrt(len(found))
    sheared = [plane_shear(tmp_path / f"shear-{seed}", seed) for seed in (1, 2)]
    fractions = f"sin φ = {sine:.4f} ± {error[0]:.4f}, ν = {fraction:.4f} ± {error[1]:.4f}"
    print(f"biaxial: {fractions}, I = {number:.4f}")
    print("\n".join(f"shear: {bulk}" for bulk in sheared))
    errors = {"friction_error": error[0], "solid_fraction_error": error[1]}
    numbers = {"inertial_number": number, "friction": sine, "solid_fraction": fraction}
    keep(record_property, **numbers, **errors)
    assert sine == pytest.approx(np.mean([bulk.friction for bulk in sheared]), abs=0.03)
    assert fraction == pytest.approx(np.mean([bulk.solid_fraction for bulk in sheared]), abs=0.01)
    assert abs(swelling) < 0.05
