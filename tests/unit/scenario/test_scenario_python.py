"""Scenarios in Python: made of dicts, and changed copies."""

import datetime as dt
import tomllib

import numpy as np
import pytest
from places import ROOT
from scenes import SMALL

from multicor_cli import Scenario, ScenarioError, load_scenario
from multicor_cli.scenario import parse_scenario
from multicor_cli.scenario.documents import to_override

CONFIGS = sorted((ROOT / "configs").glob("*.toml"))


def small(**tables):
    return tomllib.loads(SMALL) | tables


def problems_of(data):
    with pytest.raises(ScenarioError) as caught:
        Scenario.from_dict(data)
    return [str(problem) for problem in caught.value.problems]


def outcome(make):
    """The scenario, or what is wrong with it."""
    try:
        return make().resolved_toml()
    except ScenarioError as error:
        return str(error)


@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.stem)
def test_a_changed_copy_is_what_the_command_line_makes(path):
    plain = load_scenario(path)
    changes = {
        "scenario.seed": 987,
        "output.frame_interval": 0.1 + 0.2,
        "scenario.description": 'a "b"\n\x7f\\',
    }
    overrides = [
        "scenario.seed=987",
        "output.frame_interval=0.30000000000000004",
        r'scenario.description="a \"b\"\n\u007f\\"',
    ]
    copy, loaded = plain.with_(changes), load_scenario(path, overrides)
    assert copy.resolved_toml() == loaded.resolved_toml()
    assert copy == loaded != plain
    assert Scenario.from_dict(copy.as_dict(), directory=path.parent) == loaded
    for name, value in plain.variables.items():  # some are counts, which must stay whole
        again, overrides = (
            {f"variables.{name}": 1.25 * value},
            [f"variables.{name}={1.25 * value!r}"],
        )
        assert outcome(lambda again=again: plain.with_(again)) == outcome(
            lambda o=overrides: load_scenario(path, o)
        )


def test_expressions_follow_the_variables_and_a_drawn_seed_stays():
    chute = load_scenario(ROOT / "configs" / "chute.toml")
    steeper = chute.with_({"variables.angle": 26})
    assert steeper.domain.gravity == pytest.approx(
        (9.81 * np.sin(np.radians(26)), -9.81 * np.cos(np.radians(26)))
    )
    assert steeper.with_({"variables.angle": chute.variables["angle"]}) == chute
    drawn = parse_scenario(SMALL.replace("seed = 3", 'seed = "random"'), "small.toml")
    assert drawn.with_({"solver.dt": 1e-4}).seed == drawn.seed


def test_changes_come_after_those_of_before():
    scenario = parse_scenario(SMALL, "small.toml", ["loading.1.drives.top.x.velocity.duration=0.5"])
    replaced = scenario.with_({"loading.1.drives.top.x.velocity": 0.3})
    assert replaced.loading[1].drives["top"].x.velocity == 0.3
    ramped = replaced.with_(
        {"loading.1.drives.top.x.velocity": {"ramp": (0.0, 0.2), "duration": 0.1}}
    )
    assert (
        ramped.with_({"loading.1.drives.top.x.velocity.duration": 0.7})
        .loading[1]
        .drives["top"]
        .x.velocity.duration
        == 0.7
    )


def test_a_dict_is_the_scenario_of_its_file():
    assert Scenario.from_dict(tomllib.loads(SMALL)) == parse_scenario(SMALL, "small.toml")
    arrays = small(domain={"size": np.array([0.02, 0.02]), "periodic": np.bool_(True)})
    assert Scenario.from_dict(arrays) == parse_scenario(SMALL, "small.toml")


def test_messages_name_the_key_and_no_file():
    assert problems_of(small(domain={"size": [0.02, -0.02], "periodic": True}))[0].startswith(
        "domain.size.1: must be positive"
    )
    assert problems_of(small(domain={"size": [0.02, None]})) == [
        "domain.size.1: None is no value; leave the key out"
    ]
    assert problems_of(small(domain={"size": "= 2 * d"}))[0].startswith("domain.size:")
    assert problems_of({"scenario": {3: {1, 2}}}) == [
        "scenario.3: a key of type int; give text",
        (
            "scenario.3: a value of type set; give a number, text, true or false, a date, a list "
            "or a dict"
        ),
    ]
    assert problems_of([1]) == ["the scenario is of type list; give a dict of its tables"]
    endless = []
    endless.append(endless)
    assert "nested more than 32 deep" in problems_of({"scenario": endless})[0]


def test_wrong_changes_are_refused():
    scenario = parse_scenario(SMALL, "small.toml")
    with pytest.raises(
        ScenarioError, match=r"--set: loading\.9\.duration: loading is an array of 3"
    ):
        scenario.with_({"loading.9.duration": 1.0})
    with pytest.raises(ScenarioError, match=r"--set: solver\.dt: must be positive, is -1\.0"):
        scenario.with_({"solver.dt": -1.0})
    with pytest.raises(ScenarioError, match=r"--set: solver\.dt: a value of type object"):
        scenario.with_({"solver.dt": object()})


@pytest.mark.parametrize(
    "value",
    [True, 3, -1.5e-300, float("inf"), 'quotes " and \\ and \x7f and \u2603', [1, [2.0, "a"]],
        {"a b": {"c": False}, "d": []},
     dt.date(2009, 4, 2), dt.datetime(2009, 4, 2, 1, 2, 3, tzinfo=dt.UTC)],
)  # fmt: skip
def test_values_come_back_from_an_override(value):
    assert tomllib.loads(to_override("key", value))["key"] == value


def test_it_says_what_it_is_in_a_line():
    assert (
        repr(parse_scenario(SMALL, "small.toml"))
        == "<Scenario small: 1 group, 2 walls, 3 stages, seed 3>"
    )
