"""Computing the cases of a study that are left, until they are done or someone asks to stop."""

from __future__ import annotations

import contextlib
import hashlib
import queue
import secrets
import time
import warnings
from collections import Counter, deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

import multicor_cli
from multicor_cli.running.outcome import StopReason
from multicor_cli.store.errors import StoreError
from multicor_cli.studies.axes import Case
from multicor_cli.studies.clusters import Cluster
from multicor_cli.studies.directory import StudyDirectory
from multicor_cli.studies.processes import outcome, run_case, stop_cases
from multicor_cli.studies.study_file import Study

if TYPE_CHECKING:
    from distributed import Future

_INTERVAL = 0.5
_SPARE = 2
"""Cases ready at a worker beside each that runs: it need not ask. Others wait here for free."""

_LONELY = 60.0
_LOST = (
    "the Dask scheduler does not answer any more; cases stop with a checkpoint, and the same "
    "command goes on"
)
_AGAIN = 3
"""How often a case is tried again that was killed, or stopped without having come further."""


class Watcher(Protocol):
    """Is told how a study goes."""

    def warning(self, text: str) -> None:
        """Something that a person should know."""

    def began(self, text: str, cases: int) -> None:
        """Cases are about to be computed, and where."""

    def ended(self, case: Case, outcome: dict[str, Any]) -> None:
        """A case has finished, failed, or was stopped."""

    def looked(self, running: Callable[[], Sequence[Case]]) -> None:
        """About twice a second; cases of ``running()`` may have finished in the meantime."""

    def stopping(self) -> None:
        """Cases have been asked to stop."""


class WarningsOnly:
    """Gives the warnings of Python, and shows nothing else."""

    def warning(self, text: str) -> None:
        warnings.warn(text, stacklevel=2)

    def _ignore(self, *_: Any, **__: Any) -> None:
        pass

    began = ended = looked = stopping = _ignore


class LostScheduler(StoreError):
    """The Dask scheduler has gone."""


@dataclass
class Progress:
    """The cases of one call: how many finished; others, by name, and why they failed or stopped."""

    finished: int = 0
    failed: dict[str, str] = field(default_factory=dict)
    stopped: list[str] = field(default_factory=list)
    reason: StopReason | None = None


class Computation:
    """The cases of a study on their way through a cluster."""

    def __init__(
        self, directory: StudyDirectory, study: Study, site: Cluster, watcher: Watcher
    ) -> None:
        self._directory, self._study, self._site, self._watcher = directory, study, site, watcher
        self._kernels = hashlib.sha256(
            f"{directory.path.absolute()} {multicor_cli.__version__}".encode()
        ).hexdigest()[:16]
        # Workers that live longer than this client are not to mix it up with the next
        self._id = secrets.token_hex(8)
        self._waiting: deque[Case] = deque()
        self._submitted: dict[Future, Case] = {}
        self._next_look = time.monotonic() + _LONELY
        self._deadline: float | None = None
        self._tries: Counter[str] = Counter()
        self._steps: dict[str, int] = {}
        self._ended: queue.SimpleQueue[Future] = queue.SimpleQueue()

    def run(
        self,
        cases: Iterable[Case],
        should_stop: Callable[[], StopReason | None],
        seconds: float | None = None,
    ) -> Progress:
        """Compute all cases, or until ``should_stop()`` gives a reason and running ones checkpoint.

        It is asked twice a second; ``seconds`` limit the time. Raises `LostScheduler`.
        """
        self._waiting.extend(cases)
        self._deadline = None if seconds is None else time.monotonic() + seconds
        self._watcher.began(self._site.text, len(self._waiting))
        if self._site.doubt:
            self._watcher.warning(self._site.doubt)
        tally = Progress()
        try:
            self._fill()
            while self._submitted:
                for future in self._done():
                    self._take(self._submitted.pop(future), _result(future), tally)
                self._stop_if_asked(should_stop, tally)
                self._fill()
                if time.monotonic() >= self._next_look:
                    self._next_look = time.monotonic() + _LONELY
                    if not self._site.client.nthreads():
                        told = f"no worker has come for {_LONELY:.0f} s ({self._site.text})"
                        self._watcher.warning(told)
                self._watcher.looked(self._running)
                if self._site.client.status in ("closed", "closing"):
                    raise LostScheduler(_LOST)
        except OSError as error:
            raise LostScheduler(f"{_LOST} ({error})") from None
        return tally

    def _fill(self) -> None:
        """Give the workers enough, but no more: the scheduler knows a few of ten thousand cases."""
        if not self._waiting:
            return
        slots = max(self._site.slots, sum(self._site.client.nthreads().values()))
        while self._waiting and len(self._submitted) < _SPARE * (slots + 1):
            self._submit(self._waiting.popleft())

    def _running(self) -> list[Case]:
        """Cases that workers have begun."""
        by_key = {future.key: case for future, case in self._submitted.items()}
        with contextlib.suppress(OSError):
            keys = [key for keys in self._site.client.processing().values() for key in keys]
            return [by_key[key] for key in keys if key in by_key]
        return []

    def _submit(self, case: Case) -> None:
        observed = self._study.model.observe
        left = None if self._deadline is None else max(0.0, self._deadline - time.monotonic())
        task = {
            "client": self._id,
            "name": case.name,
            "scenario": str(self._study.scenario.absolute()),
            "overrides": [*self._study.fixed, *case.overrides],
            "turn": self._kernels,
            "observe": [row.model_dump(mode="json", exclude_none=True) for row in observed],
            "directory": str(self._directory.case(case.name).absolute()),
            "threads": self._site.threads,
            "max_hours": None if left is None else left / 3600.0,
        }
        self._tries[case.name] += 1
        future = self._site.client.submit(
            run_case, task, key=f"{case.name}-{self._id}-{self._tries[case.name]}",
            resources=self._site.asked or None,
            retries=0, pure=False,
        )  # fmt: skip
        self._submitted[future] = case
        future.add_done_callback(self._ended.put)

    def _done(self) -> list[Future]:
        """Futures that are done, after half a second at most."""
        found: list[Future] = []
        with contextlib.suppress(queue.Empty):
            found.append(self._ended.get(timeout=_INTERVAL))
            while True:
                found.append(self._ended.get_nowait())
        return [future for future in found if future in self._submitted]

    def _take(self, case: Case, ended: dict[str, Any], tally: Progress) -> None:
        status, reason = ended["status"], ended["reason"]
        if status in ("stopped", "killed") and tally.reason is None and self._may_go_on(case):
            self._submit(case)
            return
        if status == "finished":
            tally.finished += 1
        elif status == "stopped" or tally.reason is not None:
            tally.stopped.append(case.name)
        else:
            tally.failed[case.name] = reason
            self._directory.record_failure(case.name, reason, int(ended["exit_code"]))
        self._watcher.ended(case, ended)

    def _may_go_on(self, case: Case) -> bool:
        """Whether an unfinished case is tried again: it has come further, or was seldom tried."""
        if self._deadline is not None and time.monotonic() > self._deadline:
            return False
        step = self._directory.state(case).step
        if step > self._steps.get(case.name, -1):
            self._steps[case.name] = step
            return True
        return self._tries[case.name] <= _AGAIN

    def _stop_if_asked(self, should_stop: Callable[[], StopReason | None], tally: Progress) -> None:
        if tally.reason is not None:
            return
        is_late = self._deadline is not None and time.monotonic() > self._deadline
        tally.reason = should_stop() or (StopReason.TIME_LIMIT if is_late else None)
        if tally.reason is None:
            return
        self._watcher.stopping()
        # Forget what has not been given out, stop what runs, or cancel what has not begun
        tally.stopped += [case.name for case in self._waiting]
        self._waiting.clear()
        told = self._site.client.run(stop_cases, self._id, on_error="ignore")
        if not sum(count for count in told.values() if isinstance(count, int)):
            tally.stopped += [case.name for case in self._submitted.values()]
            self._site.client.cancel(list(self._submitted))
            self._submitted.clear()


def _result(future: Future) -> dict[str, Any]:
    """The outcome of a case; made up where workers died too often or it was cancelled."""
    if future.status == "finished":
        found = future.result()
        if isinstance(found, dict):
            return found
    if future.status in ("cancelled", "lost"):
        return outcome("stopped", "cancelled", 75)
    error = future.exception()
    return outcome("failed", f"{type(error).__name__}: {error}", 1)
