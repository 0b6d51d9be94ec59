"""Computing the cases of a study that are left, until they are done or someone asks to stop."""

from __future__ import annotations

import contextlib
import hashlib
import queue
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

import multicor_cli
from multicor_cli.studies.cases import Case
from multicor_cli.studies.clusters import MEMORY, Site
from multicor_cli.studies.directory import StudyDirectory
from multicor_cli.studies.load import Study
from multicor_cli.studies.task import run_case, stop_cases

if TYPE_CHECKING:
    from distributed import Future

_INTERVAL = 0.5
_LONELY = 60.0
_AGAIN = 3
"""How often a case that stopped without having come any further, or whose process was killed, is tried again."""


class Watcher(Protocol):
    """Is told how a study goes."""

    def warning(self, text: str) -> None:
        """Something that a person should know."""

    def began(self, text: str, cases: int) -> None:
        """Cases are about to be computed, and where."""

    def ended(self, case: Case, outcome: dict[str, Any]) -> None:
        """A case has finished, failed, or was stopped."""

    def looked(self, running: Sequence[Case]) -> None:
        """Twice a second; ``running`` may have finished in the meantime."""

    def stopping(self) -> None:
        """Cases have been asked to stop."""


@dataclass
class Tally:
    """What became of the cases of one call.

    Attributes:
        finished: Number of them.
        failed: Reasons by name.
        stopped: Names of those that go on with the same command.
    """

    finished: int = 0
    failed: dict[str, str] = field(default_factory=dict)
    stopped: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Needs:
    """What a case takes.

    Attributes:
        threads: Threads that it can use.
        memory: Memory [bytes].
    """

    threads: int = 1
    memory: float = 0.0


class Computation:
    """The cases of a study on their way through a cluster.

    Args:
        directory: The study.
        study: What its file says.
        site: Where it is computed.
        needs: What a case takes.
        watcher: Is told how it goes.
    """

    def __init__(self, directory: StudyDirectory, study: Study, site: Site, needs: Needs, watcher: Watcher) -> None:
        self._directory, self._study, self._site, self._needs, self._watcher = directory, study, site, needs, watcher
        self._id = hashlib.sha256(f"{directory.path.absolute()} {multicor_cli.__version__}".encode()).hexdigest()[:16]
        self._cases: dict[Future, Case] = {}
        self._next_look = time.monotonic() + _LONELY
        self._asked: dict[str, float] | None = None
        self._tries: Counter[str] = Counter()
        self._steps: dict[str, int] = {}
        self._ended: queue.SimpleQueue[Future] = queue.SimpleQueue()

    def run(self, cases: Sequence[Case], should_stop: Any, seconds: float | None = None) -> Tally:
        """Compute cases until all are done, or ``should_stop()`` says so; then running ones stop with a checkpoint.

        Args:
            cases: Those that are left.
            should_stop: Asked twice a second.
            seconds: Wall-clock time after which to stop [s].
        """
        tally, deadline, is_stopping = Tally(), None if seconds is None else time.monotonic() + seconds, False
        self._watcher.began(self._site.text, len(cases))
        self._asked = self._resources()
        for case in cases:
            self._submit(case, deadline)
        while self._cases:
            for future in self._done():
                case = self._cases.pop(future)
                self._take(case, _result(future), tally, deadline, is_stopping=is_stopping)
            if not is_stopping and (should_stop() or (deadline is not None and time.monotonic() > deadline)):
                is_stopping = True
                self._watcher.stopping()
                self._stop(tally)
            self._warn_without_workers()
            self._watcher.looked([case for future, case in self._cases.items() if future.status == "pending"])
        return tally

    def _warn_without_workers(self) -> None:
        """Say once a minute that nobody computes anything, if that is so."""
        if time.monotonic() < self._next_look:
            return
        self._next_look = time.monotonic() + _LONELY
        if not self._site.client.scheduler_info(n_workers=-1)["workers"]:
            self._watcher.warning(f"no worker has come for {_LONELY:.0f} s ({self._site.text})")

    def _submit(self, case: Case, deadline: float | None) -> None:
        task = {
            "study": self._id,
            "name": case.name,
            "scenario": str(self._study.scenario.absolute()),
            "overrides": [*self._study.fixed, *case.overrides],
            "turn": self._id,
            "directory": str(self._directory.case(case.name).absolute()),
            "threads": min(self._needs.threads, self._site.cores),
            "max_hours": None if deadline is None else max(0.0, deadline - time.monotonic()) / 3600.0,
        }
        self._tries[case.name] += 1
        future = self._site.client.submit(
            run_case, task, key=f"{case.name}-{self._id}-{self._tries[case.name]}", resources=self._asked, retries=0, pure=False
        )
        self._cases[future] = case
        future.add_done_callback(self._ended.put)

    def _resources(self) -> dict[str, float] | None:
        """What a case asks of a worker: memory, if all workers say how much they have, and it is enough."""
        workers = self._site.client.scheduler_info(n_workers=-1)["workers"].values()
        offered = [worker.get("resources", {}).get(MEMORY, 0.0) for worker in workers]
        return {MEMORY: self._needs.memory} if offered and min(offered) >= self._needs.memory > 0.0 else None

    def _done(self) -> list[Future]:
        """Futures that are done, after half a second at most."""
        found: list[Future] = []
        with contextlib.suppress(queue.Empty):
            found.append(self._ended.get(timeout=_INTERVAL))
            while True:
                found.append(self._ended.get_nowait())
        return [future for future in found if future in self._cases]

    def _take(self, case: Case, outcome: dict[str, Any], tally: Tally, deadline: float | None, *, is_stopping: bool) -> None:
        status = outcome["status"]
        if status in ("stopped", "killed") and not is_stopping and self._may_go_on(case, outcome, deadline):
            self._submit(case, deadline)
            return
        if status == "finished":
            tally.finished += 1
        elif status == "stopped" or is_stopping:
            tally.stopped.append(case.name)
        else:
            tally.failed[case.name] = outcome["reason"]
            self._directory.record_failure(case.name, outcome["reason"], int(outcome["exit_code"]))
        self._watcher.ended(case, outcome)

    def _may_go_on(self, case: Case, outcome: dict[str, Any], deadline: float | None) -> bool:
        """Whether a case that a worker could not end is tried again: if it has come further, or has not been tried often."""
        if deadline is not None and time.monotonic() > deadline:
            return False
        step = self._directory.state(case).step
        if step > self._steps.get(case.name, -1):
            self._steps[case.name] = step
            return True
        return self._tries[case.name] <= _AGAIN

    def _stop(self, tally: Tally) -> None:
        """Cancel what has not begun; stop what runs."""
        told = self._site.client.run(stop_cases, self._id, on_error="ignore")
        running = sum(count for count in told.values() if isinstance(count, int))
        if not running:
            tally.stopped += [case.name for case in self._cases.values()]
            self._site.client.cancel(list(self._cases))
            self._cases.clear()


def _result(future: Future) -> dict[str, Any]:
    """The outcome of a case; that of a worker which died under it too often, or of a task that was cancelled, is made up."""
    if future.status == "finished":
        found = future.result()
        if isinstance(found, dict):
            return found
    if future.status in ("cancelled", "lost"):
        return {"status": "stopped", "reason": "cancelled", "exit_code": 75, "step": 0}
    error = future.exception()
    return {"status": "failed", "reason": f"{type(error).__name__}: {error}", "exit_code": 1, "step": 0}
