"""Errors of the package go from process to process: pools hang where one cannot be loaded again."""

import inspect
import pickle
import pkgutil
from importlib import import_module
from pathlib import Path

import pytest

import multicor_cli
from multicor_cli.checks import Check, ChecksFailed, Verdict
from multicor_cli.engine.heat.integration import CannotIntegrate
from multicor_cli.engine.orders import PhysicsError
from multicor_cli.running.outcome import StageTimeout
from multicor_cli.scenario.problems import Problem, Refused, ScenarioError
from multicor_cli.store.documents import StageEnd
from multicor_cli.store.errors import NothingStored, RunLocked, StorageFull

CHECK = Check("overlap", 0.1, "0.1 of it", "bad above 0.01", Verdict.BAD, "", "")
END = StageEnd(
    stage=1, name="shear", reason="timeout", step=7, time=1.0, duration=0.5, quantity="the strain",
    value=0.1, relation="at least", goal=0.2, unit="1",
)  # fmt: skip
ERRORS = (
    CannotIntegrate(3, "is too cold"),
    ChecksFailed([CHECK]),
    NothingStored(Path("run")),
    PhysicsError(7, "a velocity is not finite"),
    Refused(("domain", "size"), "too small", "widen it", ("= 1", 2)),
    RunLocked("held by process 3", 3, "here"),
    ScenarioError([Problem("a.toml", 1, 2, "domain", "wrong"), Problem("a.toml", 3, 1, "x", "no")]),
    StageTimeout(END),
    StorageFull(Path("a.h5"), 2_000_000, 1_000),
)


@pytest.mark.parametrize("error", ERRORS, ids=lambda error: type(error).__name__)
def test_an_error_is_the_same_in_another_process(error):
    loaded = pickle.loads(pickle.dumps(error))
    assert (type(loaded), str(loaded), vars(loaded)) == (type(error), str(error), vars(error))
    assert str(error)


def test_these_are_all_errors_with_parts():
    found = set()
    for module in pkgutil.walk_packages(multicor_cli.__path__, "multicor_cli."):
        if module.name.endswith("__main__"):
            continue
        for kind in vars(import_module(module.name)).values():
            is_ours = inspect.isclass(kind) and kind.__module__ == module.name
            if is_ours and issubclass(kind, BaseException) and "__init__" in vars(kind):
                found.add(kind)
    assert found == {type(error) for error in ERRORS}
