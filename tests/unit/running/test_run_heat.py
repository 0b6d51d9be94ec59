"""Runs with heat: stages that move, stand still and move again; stopped and continued; drums;
threads."""

import numpy as np
import pytest
from places import ROOT
from run_fakes import in_pieces
from scenarios import digests
from scenes import WARM

import multicor_cli as multicor
from multicor_cli.packing import build
from multicor_cli.running.session import try_step
from multicor_cli.store import run_info

CONFIGS = ROOT / "configs"


@pytest.fixture(scope="module")
def scenario(tmp_path_factory):
    path = tmp_path_factory.mktemp("warm") / "warm.toml"
    path.write_text(WARM)
    return path


@pytest.fixture(scope="module")
def reference(scenario):
    outcome = multicor.run(scenario, scenario.parent / "reference")
    return outcome.directory


def test_stages_move_stand_and_move_again(reference):
    info = run_info(reference)
    assert info["status"] == "finished"
    assert info["heat_closure"] < 1e-12
    assert info["energy_closure"] < 1e-12
    with multicor.open_run(reference) as run:
        frames = list(run.frames)
        times, stages = run.frames.time, run.frames.stage
        assert times[-1] == pytest.approx(100.017)
        assert frames[0].wall_temperature[0] == 310.0  # what its signal begins with
        still = [frame for frame in frames if frame.stage == 1]
        assert len(still) == 5
        assert all(np.array_equal(frame.position, still[0].position) for frame in still)
        high = still[0].position[:, 1] > np.median(still[0].position[:, 1])
        # it is cold outside
        assert still[-1].temperature[high].mean() < still[0].temperature[high].mean() - 5.0
        assert still[-1].wall_temperature[0] == 330.0
        loaded = still[0].contacts.conductance
        assert (loaded > 0.0).sum() > 50
        # The signal of the wall's own condition ended where the stage named the wall; what a stage
        # says is kept.
        assert frames[-1].wall_temperature[0] == 330.0
        moved = [frame for frame in frames if frame.stage == 2]
        assert not np.array_equal(moved[-1].position, still[0].position)
        cold = [
            frame.temperature for frame, stage in zip(frames, stages, strict=True) if stage == 3
        ]
        assert np.array_equal(cold[0], moved[-1].temperature)
        assert frames[-1].wear.sum() > 0.0


@pytest.mark.parametrize("step", [5, 20, 22, 27])
def test_a_stopped_run_goes_on_to_the_same_bits(step, scenario, reference, tmp_path):
    """In the moving stage, at the end of it, in the frozen stage and after it; the averages of
    forces go on too."""
    assert in_pieces(scenario, tmp_path / "run", step) == digests(reference)


def test_drum_power_becomes_heat(tmp_path):
    """Drum work − Δ(kinetic + potential) − correction = losses = heat (insulated); work = ∫
    torque·ω (theory §15.2)."""
    changes = ["loading.0.duration=0.1", "loading.1.duration=0.3", "output.frame_interval=0.05"]
    multicor.run(
        multicor.load_scenario(CONFIGS / "drum.toml", overrides=changes), tmp_path / "drum"
    )
    with multicor.open_run(tmp_path / "drum") as run:
        series, mass = run.series, run.model.grains.mass
        heights = [(mass * frame.position[:, 1]).sum() for frame in (run.frames[0], run.frames[-1])]
        potential = 9.81 * (heights[1] - heights[0])
        kinetic = series["kinetic"][-1] - series["kinetic_start"][-1]
        losses = series["friction_loss"][-1] + series["impact_loss"][-1]
        work, correction = series["wall_work"][-1], series["correction_work"][-1]
        assert losses > 0.0
        assert work > 0.0
        scale = abs(potential) + abs(kinetic) + losses + work
        assert work - kinetic - potential - correction == pytest.approx(losses, abs=1e-10 * scale)
        stored = sum(
            (frame.temperature - 293.15) @ run.model.thermal.capacity for frame in [run.frames[-1]]
        )
        generated = losses + series["heat_ahead"][-1]
        assert 0.0 <= generated - losses < 1e-3 * losses
        assert series["heat_stored"][-1] == pytest.approx(generated, rel=1e-10)
        assert stored == pytest.approx(generated, rel=1e-6)
        steady = series["wall_velocity"][:, 0, 2] == 3.0
        rows = np.flatnonzero(steady)[1:]  # rows whose whole window turned at full speed
        power = -series["wall_force"][rows, 0, 2] * 3.0 * series["window_duration"][rows]
        assert power.sum() == pytest.approx(np.diff(series["wall_work"])[rows - 1].sum(), rel=1e-10)


def test_a_dry_run_that_begins_frozen_moves_nothing():
    scenario = multicor.load_scenario(CONFIGS / "lattice14.toml")
    model, state = build(scenario)
    position = state.position.copy()
    try_step(scenario, model, state, threads=1)
    assert state.frozen_steps == 1
    assert (state.position == position).all()
    assert np.abs(state.heat).max() > 0.0
