"""The conda recipe says what pyproject.toml says."""

import tomllib
from pathlib import Path

import pytest

yaml = pytest.importorskip("yaml")

ROOT = Path(__file__).resolve().parents[3]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
RECIPE = yaml.safe_load((ROOT / "recipe" / "recipe.yaml").read_text(encoding="utf-8"))


def test_it_is_the_same_package():
    project = PROJECT["project"]
    assert RECIPE["package"]["name"] == project["name"]
    assert RECIPE["context"]["version"] == project["version"]
    assert RECIPE["about"]["license"] == project["license"]
    assert RECIPE["about"]["summary"] == project["description"]
    assert (ROOT / RECIPE["about"]["license_file"]).is_file()


def test_it_needs_the_same():
    wanted = {
        f"python {PROJECT['project']['requires-python']}",
        *(need.replace(">=", " >=") for need in PROJECT["project"]["dependencies"]),
    }
    assert set(RECIPE["requirements"]["run"]) == wanted
    build = {need.replace(">=", " >=") for need in PROJECT["build-system"]["requires"]}
    assert build < set(RECIPE["requirements"]["host"])


def test_it_installs_the_same_commands():
    commands = [f"{name} = {place}" for name, place in PROJECT["project"]["scripts"].items()]
    assert RECIPE["build"]["python"]["entry_points"] == commands
