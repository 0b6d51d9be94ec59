"""`configs/vibrated-bed.toml`: a layer takes off where the floor falls faster than it can, and the
floor's work is what is lost."""

import math

import numpy as np
import pytest
from scenarios import run_config
from scipy.optimize import brentq

import multicor_cli as multicor
from multicor_cli.store import run_info

pytestmark = [pytest.mark.validation, pytest.mark.timeout(1800)]

F, STEPS = 20.0, 500


def floor_force(directory, gamma, layers, cycles, *, per_layer=19):
    """Force on the floor in every step, shape ``(cycles, steps of a cycle)``."""
    said = {"Gamma": gamma, "layers": layers, "cycles": cycles, "per_layer": per_layer}
    run_config("vibrated-bed", directory, *(f"variables.{name}={said[name]}" for name in said))
    with multicor.open_run(directory) as run:
        force = np.asarray(run.series["wall_force"])[1:, 0, 1]
    return force.reshape(cycles, STEPS)


@pytest.mark.parametrize(("gamma", "flies"), [(0.99, False), (1.01, True)])
def test_one_layer_takes_off_at_gamma_one(gamma, flies, tmp_path):
    lowest = np.abs(floor_force(tmp_path / "run", gamma, layers=1, cycles=4)[1:]).min(axis=1)
    print(f"Γ = {gamma}: smallest force on the floor {lowest} N")
    assert (lowest == 0.0).all() if flies else (lowest > 0.0).all()


def time_of_flight(gamma):
    """Cycles that a body flies that leaves at sin φ = 1/Γ and does not bounce (Mehta & Luck, Phys.
    Rev. Lett. 65, 393, 1990)."""
    phase = math.asin(1.0 / gamma)

    def height(angle):
        """Height above the floor, in units of its amplitude, after so much of a cycle [rad]."""
        flight = math.sin(phase) + math.cos(phase) * angle - angle * angle / (2.0 * gamma)
        return flight - math.sin(phase + angle)

    return float(brentq(height, 0.5, 2.0 * math.pi)) / (2.0 * math.pi)


def test_time_of_flight_of_discs_that_do_not_touch(tmp_path):
    gamma = 2.5
    force = floor_force(tmp_path / "run", gamma, layers=1, cycles=6, per_layer=5)[2:]
    flight = (np.abs(force) == 0.0).mean(axis=1)
    print(f"Γ = {gamma}: flies for {flight} of a cycle, {time_of_flight(gamma):.4f} expected")
    assert flight == pytest.approx(np.full(4, time_of_flight(gamma)), abs=2.0 / STEPS)


def test_the_work_of_the_floor_is_lost(tmp_path):
    """Its work is summed from what is recorded of its motion and its forces, not taken from the
    books."""
    floor_force(tmp_path / "run", 3.0, layers=6, cycles=10)
    info = run_info(tmp_path / "run")
    with multicor.open_run(tmp_path / "run") as run:
        y = np.asarray(run.series["wall_position"])[:, 0, 1]
        force = np.asarray(run.series["wall_force"])[1:, 0, 1]
        kinetic, mass = np.asarray(run.series["kinetic"]), run.model.grains.mass
        height = [frame.position[:, 1] for frame in (run.frames[0], run.frames[-1])]
    work = -float((force * np.diff(y)).sum())
    books = info["books"]
    lost = books["friction_loss"] + books["impact_loss"]
    stored = float(kinetic[-1] - kinetic[0]) + 9.81 * float((mass * (height[1] - height[0])).sum())
    print(
        f"work {work:.6g} J, lost {lost:.6g} J, stored {stored:.6g} J, {books['correction_work']}"
    )
    assert work == pytest.approx(lost + stored, rel=0.01)
