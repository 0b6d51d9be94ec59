"""The threading layer: OpenMP where there is one, whatever else is installed; the user's choice comes first."""

import subprocess
import sys

import pytest
from command_line import call, environment
from places import ROOT

from multicor_cli.engine.jit.layer import PRIORITY

SHOW = """
import numba
{first}
from multicor_cli.engine.jit import compile as jit
print(numba.config.THREADING_LAYER_PRIORITY, numba.config.THREADING_LAYER)
"""


def shown(first: str = "", **extra: str) -> str:
    env = {key: value for key, value in environment().items() if not key.startswith("NUMBA_THREADING")}
    done = subprocess.run(
        [sys.executable, "-c", SHOW.format(first=first)], env={**env, **extra}, cwd=ROOT, capture_output=True, text=True, check=True
    )
    return done.stdout.strip()


def test_openmp_comes_first_even_if_numba_was_imported_before() -> None:
    assert shown() == f"{PRIORITY.split()} default"


@pytest.mark.parametrize("name", ["NUMBA_THREADING_LAYER_PRIORITY", "NUMBA_THREADING_LAYER"])
def test_the_users_choice_is_kept(name: str) -> None:
    value = "workqueue omp tbb" if name.endswith("PRIORITY") else "workqueue"
    assert "workqueue" in shown(**{name: value})
    assert shown(**{name: value}) != shown()


def test_a_layer_that_is_not_there_is_named() -> None:
    """Numba complains of it in the midst of a kernel."""
    arguments = ("run", ROOT / "configs" / "lattice14.toml", "--dry-run")
    done = call(*arguments, cwd=ROOT, NUMBA_THREADING_LAYER="abacus")
    assert done.returncode == 5
    assert done.stderr.startswith("multicor: NUMBA_THREADING_LAYER=abacus: ")
