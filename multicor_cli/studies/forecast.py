"""What a study will cost, and what is doubtful about it: cases of it are placed and looked at as `multicor validate` does."""

from __future__ import annotations

import math
import shutil
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from multicor_cli.scenario.problems import Problem, Refused, ScenarioError
from multicor_cli.studies.axes import SEED, Case, check_case
from multicor_cli.studies.load import Study
from multicor_cli.studies.observing import missing
from multicor_cli.text import format_bytes

if TYPE_CHECKING:
    from multicor_cli.checks import Check, Prepared

SAMPLES = 12
"""Cases that are placed: others cost what these do on average."""

_OF_THE_STUDY = ("disk", "memory")
"""Checks of a run that are made for all runs together."""


@dataclass(frozen=True)
class Needs:
    """What a case takes.

    Attributes:
        threads: Threads that it can use.
        memory: Memory [bytes].
    """

    threads: int = 1
    memory: float = 0.0


@dataclass(frozen=True)
class Forecast:
    """What a study will cost.

    Attributes:
        cases: Number of cases that are looked at: all, or those that are left.
        hours: Time of all of them on one core [h]; None if the steps of one are not known.
        disk: Size of all runs [bytes]; None likewise.
        memory: Of the largest case that was placed [bytes].
        grains: Of that with the most grains.
        placed: Number of cases that were placed.
        doubtful: What `multicor validate` doubts of them, each check once, with the name of the first such case.
    """

    cases: int
    hours: float | None
    disk: float | None
    memory: float
    grains: int
    placed: int
    doubtful: list[tuple[str, Check]] = field(default_factory=list)

    @property
    def needs(self) -> Needs:
        """What a case takes: one thread below the number of grains from which several pay."""
        from multicor_cli.engine.jit.threads import PARALLEL_GRAINS

        return Needs(threads=1 if self.grains < PARALLEL_GRAINS else 1024, memory=self.memory)


def check_cases(study: Study, cases: Sequence[Case]) -> None:
    """Look at every case before the first one starts.

    Raises:
        ScenarioError: Cases are wrong; the problems of up to ten different kinds are told.
    """
    problems: dict[tuple[str, str], Problem] = {}
    for case in cases:
        try:
            scenario = check_case(study, case)
            if findings := list(missing(study.model.observe, scenario)):
                raise study.refuse(
                    *(Refused(finding.where, f"{finding.what} (case {case.name})", finding.remedy) for finding in findings)
                )
        except ScenarioError as error:
            for problem in error.problems:
                problems.setdefault((problem.key, problem.message.split(" (case ")[0]), problem)
            if len(problems) >= 10:
                break
    if problems:
        raise ScenarioError(list(problems.values()))


def forecast(study: Study, cases: Sequence[Case], directory: Path) -> Forecast:
    """Estimate some cases of a study from a few of them; those that differ by the seed alone cost the same.

    Args:
        study: The study.
        cases: Those that are to be computed.
        directory: Where runs will go.

    Raises:
        ScenarioError: Grains of a case cannot be placed, or there is not enough space for all runs.
    """
    different = list({str({key: value for key, value in case.values.items() if key != SEED}): case for case in cases}.values())
    chosen = _spread(different)
    prepared = [_prepare(study, case, directory) for case in chosen]
    costs = [run.cost for run in prepared]
    share = len(cases) / len(chosen) if chosen else 0.0
    seconds = _sum([cost.seconds for cost in costs])
    disk = _sum([cost.disk for cost in costs])
    found = Forecast(
        cases=len(cases),
        hours=None if seconds is None else seconds * share / 3600.0,
        disk=None if disk is None else disk * share,
        memory=max((cost.memory for cost in costs), default=0.0),
        grains=max((run.model.grain_count for run in prepared), default=0),
        placed=len(chosen),
        doubtful=_doubtful(chosen, prepared),
    )
    _refuse_without_space(study, found, directory)
    return found


def _spread(cases: Sequence[Case]) -> list[Case]:
    """A few cases from all over the grid: by the golden ratio, which keeps step with no key, unlike every second case."""
    order = sorted(range(len(cases)), key=lambda k: (k * 0.6180339887498949) % 1.0)
    return [cases[k] for k in sorted(order[:SAMPLES])]


def _sum(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return math.fsum(known) if len(known) == len(values) else None


def _prepare(study: Study, case: Case, directory: Path) -> Prepared:
    from multicor_cli.checks import Prepared
    from multicor_cli.packing.build import place
    from multicor_cli.running.planning import make_plan

    scenario = check_case(study, case)
    placed = place(scenario)
    plan = make_plan(scenario, placed.model, placed.state)
    return Prepared(scenario, plan, placed.model, placed.state, 1, directory, placed.origin)


def _doubtful(cases: Sequence[Case], prepared: Sequence[Prepared]) -> list[tuple[str, Check]]:
    from multicor_cli.checks import Verdict, check_prepared

    found: dict[tuple[str, Verdict], tuple[str, Check]] = {}
    for case, run in zip(cases, prepared, strict=True):
        for check in check_prepared(run):
            if check.verdict is not Verdict.OK and check.name not in _OF_THE_STUDY:
                found.setdefault((check.name, check.verdict), (case.name, check))
    return list(found.values())


def _refuse_without_space(study: Study, found: Forecast, directory: Path) -> None:
    place = directory.absolute()
    while not place.exists():
        place = place.parent
    free = shutil.disk_usage(place).free
    if found.disk is not None and found.disk > free:
        runs = f"{found.cases} runs" if found.cases != 1 else "one run"
        message = f"{runs} will take about {format_bytes(found.disk)}, {format_bytes(free)} are free in {place}"
        remedy = 'choose another disk with -o, write fewer frames (output.frame_interval), or use precision = "single"'
        raise study.refuse(Refused(("study", "scenario"), message, remedy))
