"""new, validate, schema, in this process; what a process of its own would add is tested with `run`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from scenes import SMALL, changed, write_small
from typer.testing import CliRunner

from multicor_cli.cli.app import app
from multicor_cli.scenario.templates import TEMPLATES

runner = CliRunner()


@pytest.mark.parametrize("template", TEMPLATES)
def test_new_scenarios_are_valid(template: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from multicor_cli.scenario import load_scenario

    monkeypatch.chdir(tmp_path)
    done = runner.invoke(app, ["new", "mine", "--template", template])
    assert done.exit_code == 0, done.output
    assert load_scenario(tmp_path / "mine.toml").name == "mine"
    again = runner.invoke(app, ["new", "mine", "--template", template])
    assert again.exit_code == 6
    assert "mine.toml exists" in again.stderr
    assert runner.invoke(app, ["new", "mine", "--overwrite"]).exit_code == 0


def test_a_template_with_a_table_writes_it_beside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.csv").write_text("mine")
    refused = runner.invoke(app, ["new", "mine", "--template", "sieve-curve"])
    assert refused.exit_code == 6
    assert "mine.csv exists" in refused.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["mine.csv"]
    assert (tmp_path / "mine.csv").read_text() == "mine"
    done = runner.invoke(app, ["new", "mine", "--template", "sieve-curve", "--overwrite"])
    assert done.exit_code == 0
    assert "wrote mine.toml and mine.csv" in done.stderr
    assert runner.invoke(app, ["validate", "mine.toml"]).exit_code == 0


def test_a_name_may_end_as_the_file_does(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert runner.invoke(app, ["new", "whole.toml"]).exit_code == 0
    assert [path.name for path in tmp_path.iterdir()] == ["whole.toml"]


def test_new_refuses_bad_names_and_templates(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert runner.invoke(app, ["new", "a b"]).exit_code == 2
    assert runner.invoke(app, ["new", "a", "--template", "nosuch"]).exit_code == 2
    assert list(tmp_path.iterdir()) == []


def test_validate_says_what_a_run_will_cost(tmp_path: Path) -> None:
    path = write_small(tmp_path)
    done = runner.invoke(app, ["validate", str(path), "--threads", "2"])
    assert done.exit_code == 0, done.output
    for word in (
        "60, mean diameter",
        "memory",
        "disk",
        "wall time",
        "deflection",
        "0.0002 s",
        "time step",
        "grains without a floor",
    ):
        assert word in done.stdout
    assert "rough" in done.stderr
    data = json.loads(runner.invoke(app, ["validate", str(path), "--json"]).stdout)
    assert data["grain_count"] == 60
    assert data["wall_count"] == 2
    assert [stage["name"] for stage in data["stages"]] == ["settle", "shear", "on"]
    assert data["stages"][0]["step_limit"] == 150
    assert data["estimate"]["steps"] > 170
    assert data["estimate"]["disk_bytes"] > 0
    assert [entry.name for entry in tmp_path.iterdir()] == ["small.toml"]


def test_validate_says_what_walls_weigh_that_forces_push(tmp_path: Path) -> None:
    """Mass π r² h ρ of a solid disc, a given one, and none of walls that only move as prescribed."""
    body = (
        '\n[[walls]]\nname = "body"\nmaterial = "glass"\n'
        'geometry = { kind = "disc", center = [0.01, 0.005], radius = 1e-3 }\n\n[[loading]]\nname = "settle"'
    )
    text = changed(
        SMALL,
        ('\n[[loading]]\nname = "settle"', body),
        ("drives.top = { y = { force", "drives.body = { spin = { force = 0.0 }, y = { force = 0.0 } }\ndrives.top = { y = { force"),
        ('side = "right" }', 'side = "right" }\nmass = 0.25'),
    )
    (tmp_path / "body.toml").write_text(text)
    data = json.loads(runner.invoke(app, ["validate", str(tmp_path / "body.toml"), "--json"]).stdout)
    assert list(data["wall_masses"]) == ["top", "body"]
    assert data["wall_masses"]["top"]["mass"] == 0.25
    assert data["wall_masses"]["top"]["given"]
    assert data["wall_masses"]["body"]["mass"] == pytest.approx(2500.0 * 3.141592653589793e-6 * 1e-3)
    assert not data["wall_masses"]["body"]["given"]
    shown = runner.invoke(app, ["validate", str(tmp_path / "body.toml")]).stdout
    assert "'body' 7.854e-06 kg (default), 3.927e-12 kg m²" in shown
    assert "'top' 0.25 kg (given)" in shown


def test_validate_applies_overrides(tmp_path: Path) -> None:
    path = write_small(tmp_path)
    done = runner.invoke(
        app, ["validate", str(path), "--json", "--set", "particles.0.count=50", "--set", "loading.0.duration=0.02"]
    )
    data = json.loads(done.stdout)
    assert data["grain_count"] == 50
    assert data["stages"][0]["step_limit"] == 100


def test_all_problems_at_once_with_positions(tmp_path: Path) -> None:
    mistakes = (("friction = 0.4", "friction = -0.4"), ("thickness = 1e-3", "thicknes = 1e-3"), ("dt = 2e-4", "dt = 0.0"))
    path = write_small(tmp_path, changed(SMALL, *mistakes))
    done = runner.invoke(app, ["validate", str(path)])
    assert done.exit_code == 3
    assert done.stdout == ""
    lines = [line for line in done.stderr.splitlines() if line.startswith(str(path))]
    assert len(lines) == 3
    assert all(line.split(":")[1].isdigit() for line in lines)
    assert "did you mean 'thickness'" in done.stderr
    assert done.stderr.count("^") == 3


def test_overlapping_grains_are_a_problem_of_the_scenario(tmp_path: Path) -> None:
    (tmp_path / "grains.csv").write_text("x,y,radius\n0.005,0.005,0.0005\n0.0053,0.005,0.0005\n")
    text = changed(
        SMALL,
        ('packing = { kind = "random" }', 'packing = { kind = "file", path = "grains.csv" }'),
        ("count = 60\n", ""),
        ('{ kind = "uniform", min = 0.4e-3, max = 0.6e-3 }', '{ kind = "list", radii = [0.5e-3] }'),
    )
    done = runner.invoke(app, ["validate", str(write_small(tmp_path, text))])
    assert done.exit_code == 3
    assert "overlap" in done.stderr
    assert "internal error" not in done.stderr


@pytest.mark.parametrize("name", ["nosuch.toml", "."])
def test_files_that_are_no_scenarios(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    done = runner.invoke(app, ["validate", name])
    assert done.exit_code == 3
    assert len(done.stderr.strip().splitlines()) == 1


def test_schema_is_json_on_stdout() -> None:
    done = runner.invoke(app, ["schema"])
    assert done.exit_code == 0
    assert json.loads(done.stdout)["title"] == "multicor scenario"
    assert done.stderr == ""
