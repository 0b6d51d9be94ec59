"""multicor: thermomechanics of two-dimensional granular flows. Importing this package loads nothing heavy.

For Python users::

    import multicor_cli as multicor

    scenario = multicor.load_scenario("shear.toml", overrides=["loading.1.duration=2.0"])
    multicor.run(scenario, "runs/shear")
    with multicor.open_run("runs/shear") as run:
        print(run.frames[-1].velocity.mean(axis=0))
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from multicor_cli.run import run_scenario as run
    from multicor_cli.scenario.load import load_scenario
    from multicor_cli.store.reader import open_run

__version__ = "0.1.0"

_HOMES = {
    "load_scenario": "multicor_cli.scenario.load",
    "open_run": "multicor_cli.store.reader",
}

__all__ = ["__version__", "load_scenario", "open_run", "run"]


def __getattr__(name: str) -> Any:
    if name == "run":
        return importlib.import_module("multicor_cli.run")
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(_HOMES[name]), name)
