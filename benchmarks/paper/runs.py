"""The runs of the studies: taken if they are finished, made if not."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

from multicor_cli import load_scenario, open_run
from multicor_cli import run as run_scenario
from multicor_cli.running.differences import find_differences

CONFIGS = Path(__file__).parents[2] / "configs"


@dataclass(frozen=True)
class Study:
    """A finished run of a study.

    Attributes:
        name: Name of its scenario, and of its folder.
        path: The run.
        is_shipped: Whether its scenario, with all defaults filled in, gives the same as the one
            shipped now.
    """

    name: str
    path: Path
    is_shipped: bool


def finish_study(name: str, runs: Path) -> Study:
    """The run ``runs/NAME`` of ``configs/NAME.toml``; begun or continued if it is not finished.

    Raises:
        ScenarioError: If an unfinished run there has another scenario.
        StoreError: If the folder cannot be used.
        RuntimeError: If the run was stopped before its end.
    """
    path, config = runs / name, CONFIGS / f"{name}.toml"
    if not _is_finished(path):
        print(f"running {config.name} in {path}", file=sys.stderr, flush=True)
        run_scenario(config, path)
        if not _is_finished(path):
            message = f"{path}: the run was stopped; the same command continues it"
            raise RuntimeError(message)
    with open_run(path) as run:
        return Study(
            name,
            path,
            not find_differences(run.scenario_resolved, load_scenario(config).resolved_toml()),
        )


def _is_finished(path: Path) -> bool:
    if not (path / "run.json").is_file():
        return False
    with open_run(path) as run:
        return run.status == "finished"
