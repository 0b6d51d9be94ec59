"""new, validate, schema, in this process; what a process of its own would add is tested with
`run`."""

import json
import math

import pytest
from scenarios import plane, write
from scenes import SMALL, changed, write_small

from multicor_cli.scenario import load_scenario
from multicor_cli.scenario.templates import TEMPLATES


@pytest.mark.parametrize("template", TEMPLATES)
def test_new_scenarios_are_valid(template, typed, tmp_path):
    typed(f"new mine --template {template}")
    assert load_scenario(tmp_path / "mine.toml").name == "mine"
    assert "mine.toml exists" in typed(f"new mine --template {template}", 6).stderr
    typed("new mine --overwrite")


def test_a_template_with_a_table_writes_it_beside(typed, tmp_path):
    (tmp_path / "mine.csv").write_text("mine")
    assert "mine.csv exists" in typed("new mine --template sieve-curve", 6).stderr
    assert [path.name for path in tmp_path.iterdir()] == ["mine.csv"]
    assert (tmp_path / "mine.csv").read_text() == "mine"
    assert (
        "wrote mine.toml and mine.csv"
        in typed("new mine --template sieve-curve --overwrite").stderr
    )
    typed("validate mine.toml")


def test_a_name_may_end_as_the_file_does(typed, tmp_path):
    typed("new whole.toml")
    assert [path.name for path in tmp_path.iterdir()] == ["whole.toml"]


def test_validate_says_what_a_run_will_cost(typed, tmp_path):
    write_small(tmp_path)
    done = typed("validate small.toml --threads 2")
    for words in (
        "60, mean diameter", "memory", "disk", "wall time", "deflection", "0.0002 s", "time step",
        "grains without a floor",
    ):  # fmt: skip
        assert words in done.stdout
    assert "rough" in done.stderr
    data = json.loads(typed("validate small.toml --json").stdout)
    assert (data["grain_count"], data["wall_count"]) == (60, 2)
    assert [stage["name"] for stage in data["stages"]] == ["settle", "shear", "on"]
    assert data["stages"][0]["step_limit"] == 150
    assert data["estimate"]["steps"] > 170
    assert data["estimate"]["disk_bytes"] > 0
    assert [entry.name for entry in tmp_path.iterdir()] == ["small.toml"]


def test_validate_says_what_walls_weigh_that_forces_push(typed, tmp_path):
    """Mass π r² h ρ of a solid disc, a given one, and none of walls that only move as
    prescribed."""
    geometry = {"kind": "disc", "center": [0.01, 0.005], "radius": 1e-3}
    walls = {"floor": plane(), "top": {"geometry": plane(0.05, -1), "mass": 0.25}, "body": geometry}
    drives = {"top": {"y": {"force": -0.1}}, "body": {"spin": {"force": 0.0}, "y": {"force": 0.0}}}
    write(tmp_path / "body.toml", walls=walls, drives=drives)
    top, body = (
        json.loads(typed("validate body.toml --json").stdout)["wall_masses"][name]
        for name in ("top", "body")
    )
    assert (top["mass"], top["given"], body["given"]) == (0.25, True, False)
    assert body["mass"] == pytest.approx(2500.0 * math.pi * 1e-6 * 1e-3)
    shown = typed("validate body.toml").stdout
    assert "'body' 7.854e-06 kg (default), 3.927e-12 kg m²" in shown
    assert "'top' 0.25 kg (given)" in shown
    assert "'floor'" not in shown


def test_validate_applies_overrides(typed):
    data = json.loads(
        typed(
            "validate SMALL --json --set particles.0.count=50 --set loading.0.duration=0.02"
        ).stdout
    )
    assert (data["grain_count"], data["stages"][0]["step_limit"]) == (50, 100)


def test_all_problems_at_once_with_positions(typed, tmp_path):
    mistakes = (
        ("friction = 0.4", "friction = -0.4"),
        ("thickness = 1e-3", "thicknes = 1e-3"),
        ("dt = 2e-4", "dt = 0.0"),
    )
    write_small(tmp_path, changed(SMALL, *mistakes))
    done = typed("validate small.toml", 3)
    assert done.stdout == ""
    lines = [line for line in done.stderr.splitlines() if line.startswith("small.toml")]
    assert len(lines) == 3
    assert all(line.split(":")[1].isdigit() for line in lines)
    assert "did you mean 'thickness'" in done.stderr
    assert done.stderr.count("^") == 3


def test_overlapping_grains_are_a_problem_of_the_scenario(typed, tmp_path):
    write(tmp_path / "two.toml", grains=[[0.005, 0.005, 0.0005], [0.0053, 0.005, 0.0005]])
    done = typed("validate two.toml", 3)
    assert "overlap" in done.stderr
    assert "internal error" not in done.stderr


def test_schema_is_json_on_stdout(typed):
    done = typed("schema")
    assert json.loads(done.stdout)["title"] == "multicor scenario"
    assert done.stderr == ""
