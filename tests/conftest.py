"""One finished run that all tests of the command line, and those of its reliability, look at."""

from __future__ import annotations

from pathlib import Path

import pytest
from command_line import call
from scenes import write_small

PLACES = {"digests": -3, "unit/project/test_types.py": -2, "unit/store": -1, "unit": 1, "verification": 2}
"""Folders that come before others, or after: one process compiles the kernels with the first, for all, while another does without
kernels what comes next. Folders of many short tests are last, so that no process is left with a long one at the end."""


def _place(item: pytest.Item) -> int:
    path = item.path.relative_to(Path(__file__).parent)
    return next((PLACES[folder] for folder in map(Path.as_posix, (path, *path.parents)) if folder in PLACES), 0)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    items.sort(key=_place)


@pytest.fixture(scope="session")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Directory of an uninterrupted run of the small scenario."""
    directory = tmp_path_factory.mktemp("finished")
    write_small(directory)
    done = call("run", "small.toml", "-o", "full", cwd=directory)
    assert done.returncode == 0, done.stderr
    assert done.stdout == ""
    assert "finished: step" in done.stderr
    return directory / "full"
