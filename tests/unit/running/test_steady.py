"""Stages that end when a mean no longer drifts."""

import math

import numpy as np
import pytest
from run_fakes import in_pieces
from scenarios import digests
from scenes import ONE, SMALL, changed

import multicor_cli as multicor
from multicor_cli.model import State
from multicor_cli.running.conditions import (
    BLOCKS,
    DONE,
    HALF,
    KINETIC,
    Aim,
    Steady,
    StepDone,
    drift_of,
)
from multicor_cli.store import run_info

BLOCK = 10


def steady(*, across=None, wall=0, tolerance=0.05, skipped=0):
    return Steady(Aim("the drift", "1", "at most", tolerance), wall, 1, across, BLOCK, skipped)


def ends_after(condition, forces, others=None):
    """Step after which the condition holds, given the force on a wall in each step; None if it
    never does."""
    state = State()
    state.stage_notes = condition.first_notes(state)
    for step, force in enumerate(forces, 1):
        state.stage_step = step
        state.books[KINETIC] = force
        impulse = 0.1 * np.array([[1.0 if others is None else others[step - 1], force, 0.0]])
        condition.note(state, StepDone(0.1, np.zeros((1, 3)), impulse))
        if condition.holds(state):
            return step
    return None


def noise(count, seed=1):
    return np.random.default_rng(seed).standard_normal(count)


def test_the_drift_of_a_window():
    """Halves of mean 1 and 1.2, each ± 0.1: e = √(2 s²/8) with s² = 0.01·8/7."""
    up_and_down = 0.1 * (-1.0) ** np.arange(HALF)
    blocks = np.concatenate([1.0 + up_and_down, 1.2 + up_and_down])
    error = math.sqrt(2.0 * 0.01 * 8.0 / 7.0 / 8.0)
    assert drift_of(blocks) == pytest.approx((0.2 + 2.0 * error) / 1.1)
    assert drift_of(-blocks) == drift_of(blocks)
    assert drift_of(1e3 * blocks) == pytest.approx(drift_of(blocks))
    assert drift_of(np.full(BLOCKS, 3.0)) == 0.0
    assert drift_of(np.zeros(BLOCKS)) is None


@pytest.mark.parametrize("seed", range(8))
def test_stationary_noise_ends_and_a_drift_does_not(seed):
    """Noise of 20 %: the mean of a half is known to 0.2/√80 = 2 %, the drift to 7 %. The other mean
    grows by 15 % in a window."""
    window, steps = BLOCK * BLOCKS, np.arange(2_000)
    stationary = 5.0 * (1.0 + 0.2 * noise(steps.size, seed))
    assert ends_after(steady(tolerance=0.15), stationary) is not None
    growing = stationary + 5.0 * np.exp(steps * 0.3 / window)
    assert ends_after(steady(tolerance=0.05), growing) is None


def test_a_transient_is_over_when_the_window_has_left_it():
    steps = np.arange(5_000)
    decaying = 1.0 + np.exp(-steps / 200.0)
    ended = ends_after(steady(tolerance=0.02), decaying)
    blocks = decaying[: steps.size].reshape(-1, BLOCK).mean(axis=1)
    first = next(k for k in range(BLOCKS, blocks.size) if drift_of(blocks[k - BLOCKS : k]) <= 0.02)
    assert ended == first * BLOCK
    forces = np.concatenate([np.zeros(500) + 3.0, np.full(1_000, 7.0)])
    assert ends_after(steady(), forces) == BLOCK * BLOCKS
    assert ends_after(steady(skipped=500), forces) == 500 + BLOCK * BLOCKS


def test_the_ratio_of_two_forces_and_the_kinetic_energy():
    """Both forces grow, their ratio stays. A block in which nothing presses on the wall begins the
    window anew."""
    growth = 1.0 + 0.01 * np.arange(1_000.0)
    assert ends_after(steady(), growth) is None
    assert ends_after(steady(across=0), 0.3 * growth, -growth) == BLOCK * BLOCKS
    loose = np.where(np.arange(1_000) // BLOCK == 4, 0.0, 1.0)
    assert ends_after(steady(across=0), 0.3 * loose, loose) == BLOCK * (5 + BLOCKS)
    assert ends_after(steady(wall=None), np.full(1_000, 2.0)) == BLOCK * BLOCKS


def test_notes_hold_what_files_can_hold_and_no_unsure_mean_is_steady():
    condition, state = steady(), State()
    notes = condition.first_notes(state)
    assert np.isfinite(notes).all()
    assert notes[DONE] == 0.0
    state.stage_notes = notes
    assert condition.value(state) is None
    assert not condition.holds(state)
    # However long one looks: chance alone ends nothing where noise is far above the tolerance
    assert ends_after(steady(tolerance=0.01), 1.0 + noise(20_000)) is None


WEIGHT = (
    'until = { steady = { of = "stress", wall = "floor", axis = "y", window = 0.08, tolerance = '
    "0.02, after = 0.1 } }"
)


def test_the_weight_on_a_floor_becomes_steady(tmp_path):
    """Gravity grows for 0.2 s. The window that has left this behind is over at 0.28 s; one with its
    last bit may be steady too."""
    path = tmp_path / "one.toml"
    heavier = "gravity = [0.0, { ramp = [-5.0, -10.0], duration = 0.2 }]"
    path.write_text(changed(ONE, ("STAGE", f"{WEIGHT}\n{heavier}")))
    first, _ = multicor.run(path, tmp_path / "run").stage_ends
    assert first.reason == "condition"
    assert 0.26 < first.time <= 0.28 + 1e-9
    assert 0.0 <= first.value <= 0.02
    assert first.quantity == "the drift of the stress in y on floor"


STEADY = (
    'steady = { of = "friction", wall = "top", axis = "x", window = 0.02, tolerance = 0.9, after '
    "= 0.01 }"
)
FLOW = changed(SMALL, (
    'until = { strain = { walls = ["bottom", "top"], value = 0.15 } }',
    f"duration = 0.06\nuntil = {{ {STEADY} }}",
))  # fmt: skip
"""Plane shear until friction drifts by less than it is itself."""


def test_a_stopped_run_ends_its_stage_likewise(tmp_path):
    path = tmp_path / "small.toml"
    path.write_text(FLOW)
    whole = multicor.run(path, tmp_path / "whole")
    _, shear, _ = whole.stage_ends
    assert in_pieces(path, tmp_path / "run", shear.step - 57) == digests(tmp_path / "whole")
    assert run_info(tmp_path / "run")["stage_ends"] == run_info(tmp_path / "whole")["stage_ends"]
