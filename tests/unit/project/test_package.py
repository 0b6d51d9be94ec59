"""The package as users get it: the source distribution is the repository, whole, and an index shows
nothing of it that leads nowhere; the conda recipe says the same; from Python, what it offers is
found, explained, and costs nothing before it is used."""

import email
import inspect
import re
import subprocess
import sys
import tarfile
import tomllib

import pytest
from places import ROOT

import multicor_cli
from multicor_cli import engine, post

TABLES = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
PROJECT = TABLES["project"]
FOLDERS = (".ci", "benchmarks", "configs", "docs", "multicor_cli", "recipe", "schema", "tests")
MADE = {"PKG-INFO", "setup.cfg"}


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    """Contents of the source distribution by name."""
    folder = tmp_path_factory.mktemp("dist")
    command = [sys.executable, "-m", "build", "--sdist", "--outdir", str(folder), str(ROOT)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    (path,) = folder.iterdir()
    found = {}
    with tarfile.open(path) as file:
        for member in filter(tarfile.TarInfo.isfile, file):
            found[member.name.partition("/")[2]] = file.extractfile(member).read()
    return found


def belongs(path):
    """Whether a file is of the repository, not made by what works in it."""
    made = any(
        part == "__pycache__" or part.endswith((".egg-info", "_cache")) for part in path.parts
    )
    return not made and path.suffix != ".pyc"


def test_it_holds_every_file(archive):
    files = [path for path in ROOT.iterdir() if path.is_file() and path.name != ".git"]
    files += [path for folder in FOLDERS for path in (ROOT / folder).rglob("*") if path.is_file()]
    inside = {path.relative_to(ROOT): path for path in files}
    expected = {name.as_posix(): path for name, path in inside.items() if belongs(name)}
    held = {name for name in archive if not name.startswith("multicor_cli.egg-info/")}
    assert held - MADE == expected.keys() - MADE
    named = {"README.md", "CHANGELOG.md", "configs/shear.toml", ".ci/run", "tests/conftest.py"}
    assert named <= held
    assert all(archive[name] == expected[name].read_bytes() for name in expected.keys() - MADE)


def test_an_index_shows_no_dead_link(archive):
    shown = email.message_from_bytes(archive["PKG-INFO"])
    text = archive["PKG-INFO"].decode().partition("\n\n")[2]
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert shown["Description-Content-Type"] == "text/markdown"
    assert re.findall(r"!\[|\]\((?!https?://)|<img|docs/pictures|this picture", text) == []
    assert "- **Tutorial**: shear, look, change" in text
    kept = [line for line in readme.splitlines() if "](" not in line and "this picture" not in line]
    assert len(kept) > 60
    assert set(kept) <= set(text.splitlines())  # all else is there


def test_every_python_that_it_runs_with_is_named(archive):
    shown = email.message_from_bytes(archive["PKG-INFO"])
    classifiers = shown.get_all("Classifier")
    named = {text.rpartition(" ")[2] for text in classifiers if re.search(r"Python :: 3\.", text)}
    assert named == {"3.11", "3.12", "3.13", "3.14"}
    assert shown["Requires-Python"] == PROJECT["requires-python"]


@pytest.fixture(scope="module")
def recipe():
    """Of conda."""
    yaml = pytest.importorskip("yaml")
    return yaml.safe_load((ROOT / "recipe" / "recipe.yaml").read_text(encoding="utf-8"))


def test_the_recipe_is_of_the_same_package(recipe):
    assert recipe["package"]["name"] == PROJECT["name"]
    assert recipe["context"]["version"] == PROJECT["version"]
    assert recipe["about"]["license"] == PROJECT["license"]
    assert recipe["about"]["summary"] == PROJECT["description"]
    assert (ROOT / recipe["about"]["license_file"]).is_file()
    wanted = {
        f"python {PROJECT['requires-python']}",
        *(need.replace(">=", " >=") for need in PROJECT["dependencies"]),
    }
    assert set(recipe["requirements"]["run"]) == wanted
    build = {need.replace(">=", " >=") for need in TABLES["build-system"]["requires"]}
    assert build < set(recipe["requirements"]["host"])
    commands = [f"{name} = {place}" for name, place in PROJECT["scripts"].items()]
    assert recipe["build"]["python"]["entry_points"] == commands


FUNCTIONS = [
    name for name in multicor_cli.__all__ if inspect.isfunction(getattr(multicor_cli, name))
]


def test_names_are_completed():
    checks = {"check_run", "check_scenario"}
    assert {"run", "open_run", "load_scenario", *checks, "study", "picture"} == set(FUNCTIONS)
    assert set(multicor_cli.__all__) <= set(dir(multicor_cli))


EXPLAINED = [getattr(multicor_cli, name) for name in FUNCTIONS] + [engine.solve_contacts]
EXPLAINED += filter(inspect.isfunction, (getattr(post, name) for name in post.__all__))


@pytest.mark.parametrize("function", EXPLAINED, ids=lambda function: function.__name__)
def test_every_function_says_how_it_is_called(function):
    name = function.__name__
    text = inspect.getdoc(function) or ""
    for parameter in inspect.signature(function).parameters.values():
        what = f"{name}: {parameter.name}"
        assert parameter.annotation is not inspect.Parameter.empty, f"{what} has no type"
        assert f"    {parameter.name}: " in text, f"{what} is not explained"
    assert "Raises:" in text or name == "picture"  # it raises nothing


@pytest.mark.parametrize("name", sorted(set(multicor_cli.__all__) - set(FUNCTIONS)))
def test_every_class_is_explained(name):
    found = getattr(multicor_cli, name)
    assert inspect.isclass(found)
    assert vars(found).get("__doc__")
