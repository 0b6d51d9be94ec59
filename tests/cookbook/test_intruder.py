"""`configs/intruder.toml`: the work of the drive, and the temperature of the intruder as an
ordinary differential equation."""

from itertools import pairwise

import numpy as np
import pytest
from places import ROOT
from scenarios import run_config

import multicor_cli as multicor
from multicor_cli.store import run_info

pytestmark = [pytest.mark.validation, pytest.mark.timeout(1800)]

INTRUDER = 1


def test_the_work_of_the_drive_is_lost_or_stored(tmp_path):
    """Its work is summed from the recorded forces on the intruder; what is stored, from the
    frames."""
    run_config("intruder", tmp_path / "run")
    info, books = run_info(tmp_path / "run"), run_info(tmp_path / "run")["books"]
    with multicor.open_run(tmp_path / "run") as run:
        x = np.asarray(run.series["wall_position"])[:, INTRUDER, 0]
        force = np.asarray(run.series["wall_force"])[:, INTRUDER, 0]
        work = -float((force[1:] * np.diff(x)).sum())
        mass, first, last = run.model.grains.mass, run.frames[0], run.frames[-1]
        lifted = 9.81 * float((mass * (last.position[:, 1] - first.position[:, 1])).sum())
        kinetic = float(run.series["kinetic"][-1])
        cooled = 400.0 - float(last.wall_temperature[INTRUDER])
    lost = books["friction_loss"] + books["impact_loss"]
    stored = f"lifted {lifted:.6g} J, kinetic {kinetic:.3g} J"
    print(f"work {work:.6g} J, lost {lost:.6g} J, {stored}, cooled by {cooled:.3f} K")
    assert work == pytest.approx(lost + lifted + kinetic, rel=0.02)
    assert cooled > 0.1
    assert info["heat_closure"] < 1e-12


def test_its_temperature_follows_from_the_measured_conductances(tmp_path):
    """C dT/dt = Σ H (T_i − T) + half the heat of friction, with H, T_i and the heat of the frames,
    which are of every step here."""
    step = 1e-4
    changes = ("loading.1.duration=0.03", "loading.0.duration=0.05")
    every = (f"solver.dt={step}", f"output.frame_interval={step}")
    scenario = multicor.load_scenario(
        ROOT / "configs" / "intruder.toml", overrides=[*every, *changes]
    )
    multicor.run(scenario, tmp_path / "run")
    capacity = scenario.walls[INTRUDER].thermal.capacity
    with multicor.open_run(tmp_path / "run") as run:
        wall = np.concatenate([np.full(run.model.grain_count, -1), run.model.shapes.wall])
        frames = [frame for frame in run.frames if run.stages[frame.stage] == "pull"]
        temperature, found, expected = float(frames[0].wall_temperature[INTRUDER]), [], []
        for before, frame in pairwise(frames):
            contacts = frame.contacts
            mine = wall[contacts.j] == INTRUDER
            grains = before.temperature[contacts.i[mine]]
            flow = float((contacts.conductance[mine] * (grains - temperature)).sum())
            temperature += (step * flow + 0.5 * float(contacts.heat[mine].sum())) / capacity
            expected.append(temperature)
            found.append(float(frame.wall_temperature[INTRUDER]))
    change = np.array(found) - found[0]
    print(f"changes by {change[-1]:.6g} K, off by {np.abs(np.array(found) - expected).max():.3g} K")
    assert np.abs(np.array(found) - expected).max() < 1e-3 * np.abs(change).max()
