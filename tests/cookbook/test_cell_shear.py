"""`configs/cell-shear.toml` and `configs/cell-compression.toml`: friction and solid fraction of a
flow without walls, and a packing that bears a hundred times as much at the same density."""

import numpy as np
import pytest
from recorded import keep
from scenarios import run_config

import multicor_cli as multicor
from multicor_cli.post.rheology import rheology
from multicor_cli.post.source import Selection

pytestmark = [pytest.mark.validation, pytest.mark.timeout(1800)]

SOFT = {0.1: (0.389, 0.7836), 0.01: (0.279, 0.8101)}
"""μ* and ν of soft discs by inertial number (theory §15.4)."""

NAMES = "friction", "solid_fraction", "stress_yy", "inertial_number"


@pytest.mark.parametrize("inertial_number", SOFT)
def test_a_flow_without_walls(tmp_path, record_property, inertial_number):
    found = []
    for seed in (1, 2):
        directory = run_config(
            "cell-shear", tmp_path / f"run-{seed}", f"scenario.seed={seed}",
            f"variables.I={inertial_number}",
        )  # fmt: skip
        with multicor.open_run(directory) as run:
            table = rheology(run, Selection(start=0.35 * run.frames[-1].time))
        found.append([table.mean[name] for name in NAMES])
        errors = [table.error[name] for name in NAMES]
        print(
            f"seed {seed}:", ", ".join(map("{} = {:.4f} ± {:.4f}".format, NAMES, found[-1], errors))
        )
    keep(record_property, found=found)
    friction, solid, pressure, number = np.mean(found, axis=0)
    assert pressure == pytest.approx(100.0, rel=0.05)
    assert number == pytest.approx(inertial_number, rel=0.05)
    assert abs(friction - SOFT[inertial_number][0]) < 0.015
    assert abs(solid - SOFT[inertial_number][1]) < 0.006


def test_a_packing_does_not_mind_a_hundred_times_the_pressure(tmp_path, record_property):
    """At rest under 10 and 1,000 N/m: the same solid fraction and number of contacts."""
    directory = run_config("cell-compression", tmp_path / "run")
    with multicor.open_run(directory) as run:
        last = list(run.stages).index("load")
        series = run.series
        stage, place = np.asarray(series["stage"]), np.asarray(series["wall_position"])[:, 0]
        area, force = place[:, 0] * place[:, 1], np.asarray(series["wall_force"])[:, 0]
        before, after = np.flatnonzero(stage < last)[-1], -1
        stress = (force / area[:, None])[[before, after]]
        covered = np.pi * (run.model.grains.radius**2).sum()
        solid = covered / area[[before, after]]
        contacts = np.asarray(series["contacts_mean"])[[before, after]]
    print(f"σ = {np.round(stress, 4).tolist()}, ν = {solid}, contacts {contacts}")
    keep(record_property, stress=stress, solid_fraction=solid, contacts=contacts)
    np.testing.assert_allclose(stress[0, :2], 10.0, rtol=1e-6)
    np.testing.assert_allclose(stress[1, :2], 1000.0, rtol=1e-6)
    assert solid[1] == pytest.approx(solid[0], rel=1e-4)
    assert contacts[1] == pytest.approx(contacts[0], rel=0.02)
