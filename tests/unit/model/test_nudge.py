"""The switch for tests that moves initial positions by an ulp: what it moves, how far, and that
run.json tells of it."""

import json

import numpy as np
import pytest
from command_line import call
from scenes import SMALL, write_small

from multicor_cli import run
from multicor_cli.model.state import VARIABLE, NudgeError, nudge, nudge_seed
from multicor_cli.packing import build
from multicor_cli.scenario import parse_scenario


def test_coordinates_move_by_one_number_at_most():
    position = np.random.default_rng(1).random((3000, 3))
    position[0, :2] = 0.0
    position[1, 0] = np.nextafter(1.0, 0.0)
    moved = nudge(position, 1.0, 7)
    steps = np.round(
        (moved[:, :2] - position[:, :2]) / np.spacing(np.minimum(moved, position)[:, :2])
    ).astype(int)
    assert set(steps.ravel().tolist()) == {-1, 0, 1}
    assert (np.abs(steps) == 1).mean() > 0.6
    assert moved[0, :2].tolist() == [0.0, 0.0]
    assert moved[:, 0].max() < 1.0
    assert (moved[:, 2] == position[:, 2]).all()
    assert (nudge(position, 1.0, 7) == moved).all()
    assert (nudge(position, 1.0, 8) != moved).any()


def test_the_variable_moves_what_is_built_and_is_recorded(tmp_path, monkeypatch):
    monkeypatch.delenv(VARIABLE, raising=False)
    _, still = build(parse_scenario(SMALL, tmp_path / "small.toml"))
    monkeypatch.setenv(VARIABLE, "3")
    _, moved = build(parse_scenario(SMALL, tmp_path / "small.toml"))
    assert (still.position != moved.position).any()
    assert np.allclose(still.position, moved.position, rtol=1e-15, atol=0.0)
    write_small(tmp_path)
    run(tmp_path / "small.toml", tmp_path / "out")
    assert json.loads((tmp_path / "out" / "run.json").read_text())["provenance"]["nudge"] == 3


@pytest.mark.parametrize("value", ["yes", "-1", "1.0", "²", " 3", "9" * 19])
def test_what_is_no_seed_is_refused(monkeypatch, value):
    monkeypatch.setenv(VARIABLE, value)
    with pytest.raises(NudgeError, match="not a valid seed"):
        nudge_seed()


def test_the_command_says_so(tmp_path, monkeypatch):
    monkeypatch.setenv(VARIABLE, "yes")
    write_small(tmp_path)
    done = call("run", "small.toml", cwd=tmp_path)
    assert done.returncode == 5
    assert "multicor: MULTICOR_NUDGE=yes is not a valid seed" in done.stderr
    assert not (tmp_path / "runs").exists()
