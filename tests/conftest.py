"""One finished run that all tests of the command line, and those of its reliability, look at."""

from __future__ import annotations

from pathlib import Path

import pytest
from small_run import call, write_small

LATER = ("unit", "verification")
"""Directories of many short tests: long ones come first, so that no process is left with one at the end."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    items.sort(key=lambda item: LATER.index(item.path.parent.name) + 1 if item.path.parent.name in LATER else 0)


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
