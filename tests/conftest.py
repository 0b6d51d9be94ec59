"""Runs that tests look at, and the order of the tests."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from command_line import call
from scenes import write_small

import multicor_cli as multicor

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


@pytest.fixture
def run(tmp_path: Path) -> Iterator[Callable[..., multicor.Run]]:
    """``run(scenario, name)`` carries a scenario out in this process, and opens its directory until the test is over."""
    with ExitStack() as opened:

        def run_and_open(scenario: multicor.Scenario, name: str = "run", **options: Any) -> multicor.Run:
            multicor.run(scenario, tmp_path / name, **{"threads": 1, **options})
            return opened.enter_context(multicor.open_run(tmp_path / name))

        yield run_and_open
