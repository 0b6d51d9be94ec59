"""A study from its file to its table; before it begins, its cost and what is doubtful."""

from __future__ import annotations

import math
import signal
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from multicor_cli.running.machine import free_space
from multicor_cli.running.outcome import StopReason
from multicor_cli.scenario.problems import Problem, Refused, ScenarioError
from multicor_cli.scenario.scenario import load_scenario
from multicor_cli.studies.axes import SEED, Case, check_case, expand, in_numbers
from multicor_cli.studies.clusters import Cluster, Needs, connected, existing, require_libraries
from multicor_cli.studies.computing import Computation, Progress, WarningsOnly, Watcher
from multicor_cli.studies.directory import LOGS, CaseState, CaseStatus, StudyDirectory
from multicor_cli.studies.observing import missing, unknown
from multicor_cli.studies.study_file import Study, load_study
from multicor_cli.studies.table import StudyTable, make_table
from multicor_cli.text import format_bytes

if TYPE_CHECKING:
    from multicor_cli.checks import Check, Prepared


@dataclass(frozen=True)
class StudySession:
    """A study, its cases, and the directory where their runs are, or will be."""

    study: Study
    cases: list[Case]
    directory: StudyDirectory

    @classmethod
    def open(cls, file: str | Path, directory: str | Path | None = None) -> StudySession:
        """Load a study file and list its cases, writing nothing; raises `ScenarioError`.

        `DamagedRun` if the directory holds a study that cannot be read.
        """
        study = load_study(file)
        path = Path(directory) if directory is not None else Path("studies") / study.name
        where = StudyDirectory(path)
        return cls(study, where.as_named(expand(study)), where)

    def check(self) -> Forecast:
        """Look at every case that has not begun, and estimate what is left of the study.

        Raises:
            ScenarioError: A case is wrong, its grains cannot be placed, or space for runs is short.
        """
        if findings := list(unknown(self.study.model.observe)):
            raise self.study.refuse(*findings)
        states = list(zip(self.cases, self.states(), strict=True))
        check_cases(
            self.study, [case for case, state in states if state.status is CaseStatus.WAITING]
        )
        left = [case for case, state in states if state.status is not CaseStatus.FINISHED]
        done = [(case, state.seconds) for case, state in states if state.seconds is not None]
        return forecast(self.study, left, self.directory.path, done)

    def states(self) -> list[CaseState]:
        return [self.directory.state(case) for case in self.cases]

    def compute(
        self,
        *,
        client: Any = None,
        retry: bool = False,
        max_hours: float | None = None,
        watcher: Watcher | None = None,
        predicted: Forecast | None = None,
    ) -> Progress:
        """Compute the cases that are left; see `multicor_cli.studies.study`.

        ``predicted`` is what `check` has found, if it has been called.

        Raises:
            ScenarioError: A case is wrong, not as when the study began, or too large for memory.
            StoreError: The directory cannot be used, Dask is missing, or its scheduler is lost.
            RunLocked: Another client is at work on the study.
        """
        if client is None:
            require_libraries(self.study.model.compute)
        resolved = load_scenario(self.study.scenario, self.study.fixed).resolved_toml()
        if predicted is None:
            predicted = self.check()
        with self.directory.held():
            self.directory.begin(self.study, self.cases, resolved)
            done = {CaseStatus.FINISHED, CaseStatus.FAILED}
            left = []
            for case, state in zip(self.cases, self.states(), strict=True):
                if state.status is CaseStatus.FAILED and retry:
                    self.directory.failure(case.name).unlink(missing_ok=True)
                elif state.status in done:
                    continue
                left.append(case)
            if not left:
                return Progress()
            with _stop_signals() as asked, self._site(client, predicted.needs, len(left)) as site:
                work = Computation(self.directory, self.study, site, watcher or WarningsOnly())
                return work.run(left, asked, None if max_hours is None else 3600.0 * max_hours)

    @contextmanager
    def _site(self, client: Any, needs: Needs, most: int) -> Iterator[Cluster]:
        compute = self.study.model.compute
        try:
            if client is not None:
                yield existing(client, compute, needs)
                return
            with connected(compute, self.directory.path / LOGS, needs, most=most) as site:
                yield site
        except Refused as error:
            raise self.study.refuse(error) from None

    def table(self) -> StudyTable:
        """A row for each case, finished or not."""
        values = [in_numbers(self.study, case) for case in self.cases]
        return make_table(self.directory, self.study.model.observe, self.cases, values)


@contextmanager
def _stop_signals() -> Iterator[Callable[[], StopReason | None]]:
    """Why to stop, if Ctrl-C, SIGTERM or SIGHUP has come; the second Ctrl-C interrupts at once.

    SIGHUP stays ignored if it was (``nohup``).
    """
    came: list[int] = []
    if threading.current_thread() is not threading.main_thread():
        yield lambda: None
        return

    def note(number: int, _frame: Any) -> None:
        if came and number == signal.SIGINT:
            raise KeyboardInterrupt
        came.append(number)

    numbers = [signal.SIGINT, signal.SIGTERM]
    if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
        numbers.append(signal.SIGHUP)
    before = {number: signal.signal(number, note) for number in numbers}
    try:
        yield lambda: StopReason.of_signal(came[0]) if came else None
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


# ---- What a study will cost, and what is doubtful: cases are looked at as `multicor validate` does

SAMPLES = 12
"""Cases that are placed: others cost what these do on average."""

_OF_THE_STUDY = ("disk", "memory")
"""Checks of a run that are made for all runs together."""


@dataclass(frozen=True)
class Forecast:
    """What the cases of a study will cost that are left, or all.

    Attributes:
        cases: Number of them.
        hours: Time on one core [h]; None if the steps of one are not known.
        measured: How many finished runs the time is scaled by; 0: it is not.
        disk: Size of all runs [bytes]; None if the steps of one are not known.
        memory: Of the largest case that was placed [bytes].
        grains: Of the case with the most grains.
        placed: Number of cases that were placed.
        doubtful: What `multicor validate` doubts, each check once, with its first case.
    """

    cases: int
    hours: float | None
    disk: float | None
    memory: float
    grains: int
    placed: int
    measured: int = 0
    doubtful: list[tuple[str, Check]] = field(default_factory=list)

    @property
    def needs(self) -> Needs:
        """What a case takes: one thread below the number of grains from which several pay."""
        from multicor_cli.engine.jit.threads import PARALLEL_GRAINS

        return Needs(threads=1 if self.grains < PARALLEL_GRAINS else 1024, memory=self.memory)


def check_cases(study: Study, cases: Sequence[Case]) -> None:
    """Look at every case first; the `ScenarioError` tells problems of up to ten kinds."""
    problems: dict[tuple[str, str], Problem] = {}
    for case in cases:
        try:
            scenario = check_case(study, case)
            if findings := list(missing(study.model.observe, scenario)):
                of_case = f"(case {case.name})"
                raise study.refuse(
                    *(Refused(it.where, f"{it.what} {of_case}", it.remedy) for it in findings)
                )
        except ScenarioError as error:
            for problem in error.problems:
                problems.setdefault((problem.key, problem.message.split(" (case ")[0]), problem)
            if len(problems) >= 10:
                break
    if problems:
        raise ScenarioError(list(problems.values()))


def forecast(
    study: Study,
    cases: Sequence[Case],
    directory: Path,
    finished: Sequence[tuple[Case, float]] = (),
) -> Forecast:
    """Estimate the cases to be computed from a few; those that differ by the seed cost the same.

    What runs of the study have taken, ``finished`` [s], scales the time: the estimate of a run is
    rough, runs beside each other slow each other down, and that is the same for those to come.

    Raises:
        ScenarioError: Grains of a case cannot be placed, or space for all runs is short.
    """
    from multicor_cli.checks import Verdict, check_prepared

    chosen = _some(cases)
    prepared = [_prepare(study, case, directory) for case in chosen]
    doubtful: dict[tuple[str, Verdict], tuple[str, Check]] = {}
    for case, run in zip(chosen, prepared, strict=True):
        for check in check_prepared(run):
            if check.verdict is not Verdict.OK and check.name not in _OF_THE_STUDY:
                doubtful.setdefault((check.name, check.verdict), (case.name, check))
    costs = [run.cost for run in prepared]
    share = len(cases) / len(chosen) if chosen else 0.0
    seconds = _sum([cost.seconds for cost in costs])
    compared = _some([case for case, _ in finished]) if seconds else []
    said = _sum([_prepare(study, case, directory).cost.seconds for case in compared])
    if seconds and said:
        took = {case.name: each for case, each in finished}
        seconds *= math.fsum(took[case.name] for case in compared) / said
    disk = _sum([cost.disk for cost in costs])
    found = Forecast(
        cases=len(cases),
        hours=None if seconds is None else seconds * share / 3600.0,
        disk=None if disk is None else disk * share,
        memory=max((cost.memory for cost in costs), default=0.0),
        grains=max((run.model.grain_count for run in prepared), default=0),
        placed=len(chosen),
        measured=len(compared),
        doubtful=list(doubtful.values()),
    )
    _refuse_without_space(study, found, directory)
    return found


def _some(cases: Iterable[Case]) -> list[Case]:
    """Up to `SAMPLES` cases that differ by more than the seed, from all over the grid."""
    different = {
        str({key: value for key, value in case.values.items() if key != SEED}): case
        for case in cases
    }
    # The golden ratio, unlike halves, keeps step with no key
    order = sorted(range(len(different)), key=lambda k: (k * 0.6180339887498949) % 1.0)
    return [list(different.values())[k] for k in sorted(order[:SAMPLES])]


def _prepare(study: Study, case: Case, directory: Path) -> Prepared:
    from multicor_cli.checks import Prepared
    from multicor_cli.packing import place
    from multicor_cli.running.from_scenario import make_plan

    scenario = check_case(study, case)
    placed = place(scenario)
    plan = make_plan(scenario, placed.model, placed.state)
    return Prepared(scenario, plan, placed.model, placed.state, 1, directory, placed.origin)


def _sum(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return math.fsum(known) if len(known) == len(values) else None


def _refuse_without_space(study: Study, found: Forecast, directory: Path) -> None:
    place, free = free_space(directory)
    if found.disk is not None and found.disk > free:
        runs = f"{found.cases} runs" if found.cases != 1 else "one run"
        sizes = f"about {format_bytes(found.disk)}, {format_bytes(free)} are free in {place}"
        remedy = (
            "choose another disk with -o, write fewer frames (output.frame_interval), or use "
            'precision = "single"'
        )
        where = ("study", "scenario")
        raise study.refuse(Refused(where, f"{runs} will take {sizes}", remedy))
