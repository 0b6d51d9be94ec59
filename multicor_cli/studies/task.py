"""What a worker does with a case: starts, awaits and stops its process; workers here."""

from __future__ import annotations

import contextlib
import json
import os
import queue
import signal
import socket
import threading
from collections import deque
from collections.abc import Callable, Iterable
from concurrent.futures import Future
from pathlib import Path
from typing import Any, Self

from multicor_cli.store.layout import LOCK
from multicor_cli.studies.child import outcome
from multicor_cli.studies.forking import CaseProcess, ForkServer

# ---- A worker, one of Dask or a thread here

BEAT = 15.0
"""How often the lock of a case is touched while its process lives [s]."""

_TAIL = 2000
_running: dict[str, CaseProcess] = {}
_fork_servers: list[ForkServer] = []
_lock = threading.Lock()
_stopping: set[str] = set()


def run_case(task: dict[str, Any]) -> dict[str, Any]:
    """Run a case in a process; as `multicor_cli.studies.child.run_task`, with its client and name.

    A process that did not say how it ended (killed, out of memory) failed with its last words.
    """
    name = f"{task['client']}/{task['name']}"
    with _lock:
        if task["client"] in _stopping:
            return outcome("stopped", "not begun", 75)
        try:
            process = _start(task["threads"])
        except OSError as error:
            return outcome("killed", str(error), 5)
        _running[name] = process
    try:
        said: deque[bytes] = deque(maxlen=50)
        listener = threading.Thread(target=_listen, args=(process.stream, said), daemon=True)
        listener.start()
        with contextlib.suppress(OSError):
            process.stream.sendall(json.dumps(task).encode() + b"\n")
        listener.join(BEAT)
        while listener.is_alive():
            # show other machines that the process is alive: the time of its lock moves on
            with contextlib.suppress(OSError):
                lock = Path(task["directory"]) / LOCK
                if lock.stat().st_size:
                    os.utime(lock)
            listener.join(BEAT)
    finally:
        with _lock:
            _running.pop(name, None)
        code = process.wait()
    for line in reversed(said):
        with contextlib.suppress(ValueError):
            found = json.loads(line)
            if isinstance(found, dict) and "status" in found:
                return found
    return _unsaid(code, b"".join(said)[-_TAIL:].decode(errors="replace").strip())


def _start(threads: int) -> CaseProcess:
    """A process of a case; the one that starts them must live and have room for the threads."""
    _fork_servers[:] = [each for each in _fork_servers if each.is_alive and each.threads >= threads]
    if _fork_servers:
        with contextlib.suppress(OSError):  # it has just died
            return _fork_servers[-1].start()
    _fork_servers[:] = [ForkServer(threads)]
    return _fork_servers[-1].start()


def _listen(stream: socket.socket, said: deque[bytes]) -> None:
    """Keep the last lines of what a process says and complains about, until it has ended."""
    with contextlib.suppress(OSError), stream.makefile("rb") as lines:
        said.extend(lines)


def _unsaid(code: int, said: str) -> dict[str, Any]:
    """The outcome of a process that said nothing."""
    stops = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP)
    if code in (*(-number for number in stops), *(128 + number for number in stops)):
        return outcome("stopped", "stopped before its first step", abs(code))
    if code == -signal.SIGKILL:
        return outcome("killed", "its process was killed (out of memory?)", 137)
    last = said.splitlines()[-1] if said else f"its process ended with exit code {code}"
    return outcome("failed", last, abs(code))


def stop_cases(client: str) -> int:
    """Ask a client's cases on this worker to stop with a checkpoint; returns their number."""
    with _lock:
        _stopping.add(client)
        found = [process for name, process in _running.items() if name.startswith(f"{client}/")]
    for process in found:
        process.send_signal(signal.SIGTERM)
    return len(found)


# ---- Cases on this machine, a thread each. No port is open, so nobody else can get in

_HERE = "here"

Task = dict[str, Any]
Work = Callable[[Task], dict[str, Any]]


class LocalFuture(Future[dict[str, Any]]):
    """The outcome of the case ``key``, with the names that Dask has for it."""

    def __init__(self, key: str) -> None:
        super().__init__()
        self.key = key

    @property
    def status(self) -> str:
        """``pending``, ``finished``, ``cancelled`` or ``error``."""
        if not self.done():
            return "pending"
        if self.cancelled():
            return "cancelled"
        return "finished" if self.exception() is None else "error"


class LocalClient:
    """What `Computation` asks of a `distributed.Client`, with so many cases at a time."""

    status = "running"

    def __init__(self, workers: int) -> None:
        self._workers = workers
        self._waiting: queue.SimpleQueue[tuple[LocalFuture, Work, Task]] = queue.SimpleQueue()
        self._running: set[str] = set()
        self._owners: set[str] = set()
        self._is_closed = False
        for _ in range(workers):
            # The second Ctrl-C waits for nobody
            threading.Thread(target=self._work, daemon=True).start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        """Stop what still runs, with a checkpoint, and wait for nothing."""
        self._is_closed = True
        for owner in self._owners:
            stop_cases(owner)
        for _ in range(self._workers):
            self._waiting.put((LocalFuture(""), dict, {}))  # wakes a thread
        with _lock:
            _fork_servers.clear()  # each ends once its last case has ended

    def submit(self, function: Work, task: Task, *, key: str, **_options: Any) -> LocalFuture:
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
        return {_HERE: function(*arguments)}

    def cancel(self, futures: Iterable[LocalFuture]) -> None:
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
                future.set_result(function(task))
            except Exception as error:
                future.set_exception(error)
            finally:
                self._running.discard(future.key)
