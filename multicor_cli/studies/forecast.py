"""What a study will cost: cases of it are placed and estimated as `multicor validate` does."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from multicor_cli.scenario.problems import Problem, ScenarioError
from multicor_cli.scenario.scenario import Scenario
from multicor_cli.studies.cases import SEED, Case, check_case
from multicor_cli.studies.computing import Needs
from multicor_cli.studies.load import Study

if TYPE_CHECKING:
    from multicor_cli.running.estimate import Estimate

SAMPLES = 12
"""Cases that are placed: others cost what these do on average."""


@dataclass(frozen=True)
class Forecast:
    """What a study will cost.

    Attributes:
        cases: Number of cases.
        hours: Time of all of them on one core [h]; None if the steps of one are not known.
        disk: Size of all runs [bytes]; None likewise.
        memory: Of the largest case that was placed [bytes].
        grains: Of that with the most grains.
        placed: Number of cases that were placed.
    """

    cases: int
    hours: float | None
    disk: float | None
    memory: float
    grains: int
    placed: int

    @property
    def needs(self) -> Needs:
        """What a case takes: one thread below the number of grains from which several pay."""
        from multicor_cli.engine.step import PARALLEL_GRAINS

        return Needs(threads=1 if self.grains < PARALLEL_GRAINS else 1024, memory=self.memory)


def check_cases(study: Study, cases: Sequence[Case]) -> None:
    """Look at every case before the first one starts.

    Raises:
        ScenarioError: Cases are wrong; the problems of up to ten different kinds are told.
    """
    problems: dict[tuple[str, str], Problem] = {}
    for case in cases:
        try:
            check_case(study, case)
        except ScenarioError as error:
            for problem in error.problems:
                problems.setdefault((problem.key, problem.message.split(" (case ")[0]), problem)
            if len(problems) >= 10:
                break
    if problems:
        raise ScenarioError(list(problems.values()))


def forecast(study: Study, cases: Sequence[Case]) -> Forecast:
    """Estimate a study from some of its cases, evenly spread; those that differ by the seed alone cost the same.

    Raises:
        ScenarioError: Grains of a case cannot be placed.
    """
    different = list({str({key: value for key, value in case.values.items() if key != SEED}): case for case in cases}.values())
    step = max(1, math.ceil(len(different) / SAMPLES))
    chosen = different[::step]
    costs = [_cost(check_case(study, case)) for case in chosen]
    seconds = [cost.seconds for cost, _ in costs]
    disks = [cost.disk for cost, _ in costs]
    share = len(cases) / len(chosen) if chosen else 0.0
    return Forecast(
        cases=len(cases),
        hours=None if None in seconds else math.fsum(value for value in seconds if value is not None) * share / 3600.0,
        disk=None if None in disks else math.fsum(value for value in disks if value is not None) * share,
        memory=max((cost.memory for cost, _ in costs), default=0.0),
        grains=max((grains for _, grains in costs), default=0),
        placed=len(chosen),
    )


def _cost(scenario: Scenario) -> tuple[Estimate, int]:
    from multicor_cli.packing.build import place
    from multicor_cli.running.estimate import estimate
    from multicor_cli.running.planning import make_plan

    placed = place(scenario)
    plan = make_plan(scenario, placed.model, placed.state)
    return estimate(scenario, plan, placed.model, placed.state, 1), placed.model.grain_count
