"""The source distribution is the repository, whole; what an index shows of it leads nowhere that is
not there.
"""

from __future__ import annotations

import email
import re
import subprocess
import sys
import tarfile
import tomllib
from pathlib import Path

import pytest
from places import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
FOLDERS = (".ci", "benchmarks", "configs", "docs", "multicor_cli", "recipe", "schema", "tests")
MADE = {"PKG-INFO", "setup.cfg"}


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
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


def belongs(path: Path) -> bool:
    """Whether a file is of the repository, not made by what works in it."""
    made = any(
        part == "__pycache__" or part.endswith((".egg-info", "_cache")) for part in path.parts
    )
    return not made and path.suffix != ".pyc"


def test_it_holds_every_file(archive: dict[str, bytes]) -> None:
    files = [path for path in ROOT.iterdir() if path.is_file() and path.name != ".git"]
    files += [path for folder in FOLDERS for path in (ROOT / folder).rglob("*") if path.is_file()]
    inside = {path.relative_to(ROOT): path for path in files}
    expected = {name.as_posix(): path for name, path in inside.items() if belongs(name)}
    held = {name for name in archive if not name.startswith("multicor_cli.egg-info/")}
    assert held - MADE == expected.keys() - MADE
    named = {"README.md", "CHANGELOG.md", "configs/shear.toml", ".ci/run", "tests/conftest.py"}
    assert named <= held
    assert all(archive[name] == expected[name].read_bytes() for name in expected.keys() - MADE)


def test_an_index_shows_no_dead_link(archive: dict[str, bytes]) -> None:
    shown = email.message_from_bytes(archive["PKG-INFO"])
    text = archive["PKG-INFO"].decode().partition("\n\n")[2]
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert shown["Description-Content-Type"] == "text/markdown"
    assert re.findall(r"!\[|\]\((?!https?://)|<img|docs/pictures|this picture", text) == []
    assert "- **Tutorial**: shear, look, change" in text
    kept = [line for line in readme.splitlines() if "](" not in line and "this picture" not in line]
    assert len(kept) > 60
    assert set(kept) <= set(text.splitlines())  # all else is there


def test_every_python_that_it_runs_with_is_named(archive: dict[str, bytes]) -> None:
    shown = email.message_from_bytes(archive["PKG-INFO"])
    classifiers = shown.get_all("Classifier")
    named = {text.rpartition(" ")[2] for text in classifiers if re.search(r"Python :: 3\.", text)}
    assert named == {"3.11", "3.12", "3.13", "3.14"}
    assert shown["Requires-Python"] == PROJECT["requires-python"]
