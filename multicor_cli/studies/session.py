"""A study from its file to its table."""

from __future__ import annotations

import signal
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from multicor_cli.running.outcome import StopReason
from multicor_cli.scenario.load import load_scenario
from multicor_cli.scenario.problems import Refused
from multicor_cli.studies.axes import Case, expand
from multicor_cli.studies.clusters import Cluster, connected, existing, require_libraries
from multicor_cli.studies.computing import Computation, Progress, Watcher
from multicor_cli.studies.directory import LOGS, CaseState, CaseStatus, StudyDirectory
from multicor_cli.studies.forecast import Forecast, Needs, check_cases, forecast
from multicor_cli.studies.load import Study, load_study
from multicor_cli.studies.observing import unknown
from multicor_cli.studies.table import StudyTable, make_table


class _WarnsOnly:
    def warning(self, text: str) -> None:
        """As Python warns."""
        warnings.warn(text, stacklevel=2)

    def began(self, text: str, cases: int) -> None:
        """Ignore it."""

    def ended(self, case: Case, outcome: dict[str, Any]) -> None:
        """Ignore it."""

    def looked(self, running: Callable[[], Sequence[Case]]) -> None:
        """Ignore it."""

    def stopping(self) -> None:
        """Ignore it."""


@dataclass(frozen=True)
class StudySession:
    """A study, its cases and its directory.

    Attributes:
        study: What the file says.
        cases: Its cases.
        directory: Where their runs are, or will be.
    """

    study: Study
    cases: list[Case]
    directory: StudyDirectory

    @classmethod
    def open(cls, file: str | Path, directory: str | Path | None = None) -> StudySession:
        """Load a study file and list its cases; writes nothing.

        Raises:
            ScenarioError: It is wrong.
        """
        study = load_study(file)
        path = Path(directory) if directory is not None else Path("studies") / study.name
        return cls(study, expand(study), StudyDirectory(path))

    def check(self) -> Forecast:
        """Look at every case that has not begun, and estimate what is left of the study.

        Raises:
            ScenarioError: A case is wrong, its grains cannot be placed, or there is no space for the runs.
        """
        if findings := list(unknown(self.study.model.observe)):
            raise self.study.refuse(*findings)
        by_status: dict[CaseStatus, list[Case]] = {}
        for case in self.cases:
            by_status.setdefault(self.directory.state(case).status, []).append(case)
        check_cases(self.study, by_status.get(CaseStatus.WAITING, []))
        left = [case for status, cases in by_status.items() if status is not CaseStatus.FINISHED for case in cases]
        return forecast(self.study, left, self.directory.path)

    def states(self) -> list[CaseState]:
        """How each case stands."""
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
        """Compute the cases that are left.

        Args:
            client: A `dask.distributed.Client` to use; default: what the file says.
            retry: Whether cases that failed are tried again.
            max_hours: Wall-clock time after which to stop with checkpoints [h].
            watcher: Is told how it goes; default: Python's warnings are given.
            predicted: What `check` has found, if it has been called.

        Raises:
            ScenarioError: A case is wrong, or not as when the study began; or one needs more memory than there is.
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
            left = [case for case in self.cases if self._is_left(case, retry=retry)]
            if not left:
                return Progress()
            with _stop_signals() as asked, self._site(client, predicted.needs, len(left)) as site:
                work = Computation(self.directory, self.study, site, watcher or _WarnsOnly())
                return work.run(left, asked, None if max_hours is None else 3600.0 * max_hours)

    def _is_left(self, case: Case, *, retry: bool) -> bool:
        status = self.directory.state(case).status
        if status is CaseStatus.FAILED and retry:
            self.directory.failure(case.name).unlink(missing_ok=True)
            return True
        return status not in (CaseStatus.FINISHED, CaseStatus.FAILED)

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
        return make_table(self.directory, self.study.model.observe, self.cases)


@contextmanager
def _stop_signals() -> Iterator[Callable[[], StopReason | None]]:
    """Why to stop, if Ctrl-C, SIGTERM or SIGHUP has come; the second Ctrl-C interrupts at once."""
    came: list[int] = []
    if threading.current_thread() is not threading.main_thread():
        yield lambda: None
        return

    def note(number: int, _frame: Any) -> None:
        if came and number == signal.SIGINT:
            raise KeyboardInterrupt
        came.append(number)

    before = {number: signal.signal(number, note) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    try:
        yield lambda: StopReason.of_signal(came[0]) if came else None
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
