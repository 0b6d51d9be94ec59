"""The package from Python: what it offers is found, explained, and costs nothing before it is
used.
"""

from __future__ import annotations

import inspect
import subprocess
import sys
from collections.abc import Callable

import pytest

import multicor_cli
from multicor_cli import engine, post

FUNCTIONS = [
    name for name in multicor_cli.__all__ if inspect.isfunction(getattr(multicor_cli, name))
]


def test_names_are_completed() -> None:
    checks = {"check_run", "check_scenario"}
    assert {"run", "open_run", "load_scenario", *checks, "study", "picture"} == set(FUNCTIONS)
    assert set(multicor_cli.__all__) <= set(dir(multicor_cli))


EXPLAINED = [getattr(multicor_cli, name) for name in FUNCTIONS] + [engine.solve_contacts]
EXPLAINED += [
    getattr(post, name) for name in post.__all__ if inspect.isfunction(getattr(post, name))
]


@pytest.mark.parametrize("function", EXPLAINED, ids=lambda function: function.__name__)
def test_every_function_says_how_it_is_called(function: Callable[..., object]) -> None:
    name = function.__name__
    text = inspect.getdoc(function) or ""
    for parameter in inspect.signature(function).parameters.values():
        what = f"{name}: {parameter.name}"
        assert parameter.annotation is not inspect.Parameter.empty, f"{what} has no type"
        assert f"    {parameter.name}: " in text, f"{what} is not explained"
    assert "Raises:" in text or name == "picture"  # it raises nothing


@pytest.mark.parametrize("name", sorted(set(multicor_cli.__all__) - set(FUNCTIONS)))
def test_every_class_is_explained(name: str) -> None:
    found = getattr(multicor_cli, name)
    assert inspect.isclass(found)
    assert vars(found).get("__doc__")


def test_importing_loads_nothing() -> None:
    heavy = "{'numba', 'numpy', 'h5py', 'pydantic', 'pandas', 'matplotlib'}"
    program = f"import sys, multicor_cli; print({heavy} & sys.modules.keys())"
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"
