"""Cases on this machine: a thread of this process for each that runs at a time. No port is open, so nobody else can get in."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Iterable
from concurrent.futures import Future
from typing import Any, Self

from multicor_cli.studies.task import close_nurseries, stop_cases

_HERE = "here"


class LocalFuture(Future[dict[str, Any]]):
    """The outcome of a case, with the names that Dask has for it.

    Attributes:
        key: Its name.
    """

    def __init__(self, key: str) -> None:
        super().__init__()
        self.key = key

    @property
    def status(self) -> str:
        """``pending``, ``finished``, ``cancelled`` or ``error``."""
        if not self.done():
            return "pending"
        return "cancelled" if self.cancelled() else "finished" if self.exception() is None else "error"


class LocalClient:
    """What `multicor_cli.studies.computing.Computation` asks of a `distributed.Client`.

    Args:
        workers: Cases at a time.
    """

    status = "running"

    def __init__(self, workers: int) -> None:
        self._workers = workers
        self._waiting: queue.SimpleQueue[tuple[LocalFuture, Callable[..., dict[str, Any]], dict[str, Any]]] = queue.SimpleQueue()
        self._running: set[str] = set()
        self._owners: set[str] = set()
        self._is_closed = False
        for _ in range(workers):
            threading.Thread(target=self._work, daemon=True).start()  # the second Ctrl-C waits for nobody

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        """Stop what still runs, with a checkpoint, and wait for nothing."""
        self._is_closed = True
        for owner in self._owners:
            stop_cases(owner)
        for _ in range(self._workers):
            self._waiting.put((LocalFuture(""), dict, {}))  # wakes a thread
        close_nurseries()

    def submit(self, function: Callable[..., dict[str, Any]], task: dict[str, Any], *, key: str, **_options: Any) -> LocalFuture:
        """Call a function with a task as soon as there is room for another case."""
        future = LocalFuture(key)
        self._owners.add(task["client"])
        self._waiting.put((future, function, task))
        return future

    def nthreads(self) -> dict[str, int]:
        """How many cases can run at a time."""
        return {_HERE: self._workers}

    def processing(self) -> dict[str, list[str]]:
        """Names of the cases that have begun."""
        return {_HERE: sorted(self._running)}

    def run(self, function: Callable[..., Any], *arguments: Any, **_options: Any) -> dict[str, Any]:
        """Call a function now."""
        return {_HERE: function(*arguments)}

    def cancel(self, futures: Iterable[LocalFuture]) -> None:
        """Forget cases that have not begun."""
        for future in futures:
            future.cancel()

    def _work(self) -> None:
        while True:
            future, function, task = self._waiting.get()
            if self._is_closed:
                return
            if not future.set_running_or_notify_cancel():
                continue
            self._running.add(future.key)
            try:
                outcome = function(task)
            except Exception as error:
                future.set_exception(error)
            else:
                future.set_result(outcome)
            finally:
                self._running.discard(future.key)
