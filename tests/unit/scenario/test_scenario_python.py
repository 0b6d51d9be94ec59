"""Scenarios made and changed in Python are those of files and of ``--set``."""

import tomllib
from pathlib import Path

import numpy as np
import pytest
from places import ROOT
from scenes import SHEAR

from multicor_cli.scenario import ScenarioError, load_scenario, parse_scenario
from multicor_cli.scenario.scenario import Scenario

CONFIGS = sorted((ROOT / "configs").glob("*.toml"))


@pytest.mark.parametrize("path", CONFIGS, ids=[path.stem for path in CONFIGS])
def test_tables_make_the_scenario_of_their_file(path: Path) -> None:
    loaded = load_scenario(path)
    made = Scenario.from_dict(tomllib.loads(path.read_text(encoding="utf-8")), path.parent)
    assert made == loaded
    assert made.resolved_toml() == loaded.resolved_toml()


@pytest.mark.parametrize("path", CONFIGS, ids=[path.stem for path in CONFIGS])
def test_changes_are_those_of_the_command_line(path: Path) -> None:
    changes = {"scenario.seed": 77, "output.frame_interval": 0.125, "scenario.description": 'a "b" [c]', "solver.dt": "auto"}
    overrides = ["scenario.seed=77", "output.frame_interval=0.125", "scenario.description='a \"b\" [c]'", "solver.dt=auto"]
    assert load_scenario(path).with_(changes).resolved_toml() == load_scenario(path, overrides).resolved_toml()


def test_changes_add_up_and_change_what_is_made_of_them() -> None:
    chute = load_scenario(ROOT / "configs" / "chute.toml", ["variables.angle=22"])
    steeper = chute.with_({"variables.angle": np.float64(26.0)}).with_({"scenario.name": "steep"})
    assert steeper.name == "steep"
    assert steeper.domain.gravity == load_scenario(ROOT / "configs" / "chute.toml", ["variables.angle=26.0"]).domain.gravity
    assert steeper.with_({}) == steeper


def test_what_is_set_again_is_set_last():
    table, other = {"speed": [0, 1], "values": [0.5, 0.4]}, {"speed": [0, 2], "values": [0.3, 0.1]}
    scenario = parse_scenario(SHEAR, "shear.toml").with_({"contacts.1.friction": table})
    scenario = scenario.with_({"contacts.1.friction.values": [0.9, 0.8]}).with_({"contacts.1.friction": other})
    assert scenario.with_({}).contacts[1].friction.values == (0.3, 0.1)


def test_a_drawn_seed_stays() -> None:
    drawn = parse_scenario(SHEAR.replace("seed = 7", 'seed = "random"'), "shear.toml")
    assert drawn.with_({"solver.dt": 1e-4}).seed == drawn.seed


def test_tables_and_arrays_are_values_too() -> None:
    scenario = parse_scenario(SHEAR, "shear.toml")
    changed = scenario.with_(
        {"domain.size": np.array([0.04, 0.05]), "contacts.1.friction": {"speed": [0, 1], "values": [0.5, 0.2]}}
    )
    assert changed.domain.size == (0.04, 0.05)
    assert changed.contacts[1].friction.values == (0.5, 0.2)


def test_what_is_wrong_names_the_key() -> None:
    data = tomllib.loads(SHEAR)
    data["contacts"][0]["friction"] = -1.0
    with pytest.raises(ScenarioError, match=r"contacts\.0\.friction"):
        Scenario.from_dict(data)
    with pytest.raises(ScenarioError, match=r"contacts\.0\.frction"):
        parse_scenario(SHEAR, "shear.toml").with_({"contacts.0.frction": 1.0})
    with pytest.raises(TypeError):
        Scenario.from_dict({"scenario": {"name": None}})
