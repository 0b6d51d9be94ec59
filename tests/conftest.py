"""One finished run that all tests of the command line, and those of its reliability, look at."""

from __future__ import annotations

from pathlib import Path

import pytest
from small_run import call, write_small

FIRST = ("test_digests", "test_types", "test_store", "test_vtkhdf")
"""Beginnings of the names of files to begin with: one process compiles the kernels with the first, for all, while another does
without kernels what comes next."""

LAST = ("unit", "verification")
"""Directories of many short tests: long ones come before, so that no process is left with one at the end."""


def _place(item: pytest.Item) -> int:
    for place, beginning in enumerate(FIRST):
        if item.path.name.startswith(beginning):
            return place
    folder = item.path.parent.name
    return len(FIRST) + (LAST.index(folder) + 1 if folder in LAST else 0)


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
