"""Lists of checks before a run and of a run, each with value, limit, verdict, meaning and remedy.

A new check is a `Rule` in the table of its module, which is in one of the two lists below;
docs/reference/checks.md is made of them (``python tests/support/page_tables.py``).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from multicor_cli.checks import books, floor, outlines, resolution
from multicor_cli.checks.check import (
    Check,
    Prepared,
    Recorded,
    Rule,
    Verdict,
    judge_all,
    worst_verdict,
)
from multicor_cli.scenario.scenario import Scenario
from multicor_cli.store import open_run, run_info
from multicor_cli.store.errors import NothingStored

BEFORE_RUN: tuple[Rule[Prepared], ...] = (
    *resolution.BEFORE_RUN,
    *resolution.RIGIDITY_BEFORE_RUN,
    *resolution.PLAUSIBLE_BEFORE_RUN,
    *outlines.CLUMPS,
    *outlines.IMPACTS,
    *floor.LIDS,
    *resolution.ROUNDING,
    *floor.RULES,
    *resolution.COST,
)
"""What is checked before a run."""

OF_RUN: tuple[Rule[Recorded], ...] = (
    *books.STAGES,
    *resolution.OF_RUN,
    *books.RULES,
    *resolution.RIGIDITY_OF_RUN,
    *resolution.PLAUSIBLE_OF_RUN,
    *floor.LOST,
    *books.DRIFT,
)
"""What is checked of a run, from its first checkpoint on."""


class ChecksFailed(Exception):
    """A check came out bad where that was not to be."""

    exit_code = 4

    def __init__(self, checks: list[Check]) -> None:
        super().__init__(checks)
        self.checks = checks

    def __str__(self) -> str:
        return "; ".join(
            f"{check.name}: {check.text}, {check.limit}"
            for check in self.checks
            if check.verdict is Verdict.BAD
        )


def check_prepared(prepared: Prepared) -> list[Check]:
    """The checks of a scenario whose grains are placed."""
    return judge_all(BEFORE_RUN, prepared)


def check_scenario(scenario: Scenario | str | Path, threads: int = 1) -> list[Check]:
    """The checks of a scenario before it is run, as ``multicor validate`` shows them.

    Its grains are placed, nothing is written.

    Args:
        scenario: A scenario, or the path of a scenario file.
        threads: Number of threads to assume.

    Raises:
        ScenarioError: If the scenario is wrong, or its grains cannot be placed.
    """
    from multicor_cli.packing import build
    from multicor_cli.running.from_scenario import make_plan
    from multicor_cli.scenario.scenario import load_scenario

    loaded = scenario if isinstance(scenario, Scenario) else load_scenario(scenario)
    model, state = build(loaded)
    return check_prepared(Prepared(loaded, make_plan(loaded, model), model, state, threads))


def check_run(directory: Path | str, info: dict[str, Any] | None = None) -> list[Check]:
    """The checks of a run at its newest checkpoint, as ``multicor info`` shows them.

    Args:
        directory: Run directory, or a ``results.h5`` on its own.
        info: What `run_info` says of it, where that is known.

    Raises:
        StoreError: If there is no run, or a file that is needed is damaged.
    """
    with open_run(directory) as run:
        try:
            return judge_all(OF_RUN, Recorded(run, run_info(directory) if info is None else info))
        except NothingStored:
            return []


__all__ = [
    "BEFORE_RUN",
    "OF_RUN",
    "Check",
    "ChecksFailed",
    "Prepared",
    "Recorded",
    "Rule",
    "Verdict",
    "check_prepared",
    "check_run",
    "check_scenario",
    "worst_verdict",
]
