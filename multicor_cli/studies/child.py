"""The process of a case: runs it as `multicor run` would, and stops when who started it is gone.

What is to be done comes as JSON in the first line of standard input, which stays open: its end
means that nobody waits any more. Standard output says how it ended, in a line of JSON.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import signal
import socket
import sys
import tempfile
import time
import traceback
from pathlib import Path
from typing import Any

from multicor_cli.running.machine import end_with_parent
from multicor_cli.running.outcome import SilentObserver, Status, exit_code_of
from multicor_cli.store.layout import LOCK, PROGRESS, RUN

# ---- Turns at compiling: of cases that start together one compiles the kernels, the others load


class CompilationTurn:
    """The turn to compile of processes of one ``name``, awaited unless someone has compiled."""

    def __init__(self, name: str) -> None:
        # Beside the kernels: where these are removed, the next one has to compile again.
        directory = Path(os.environ.get("NUMBA_CACHE_DIR") or tempfile.gettempdir())
        self._marker = directory / f"turn-{name}.done"
        self._descriptor = -1
        if self._marker.exists() or not os.access(directory, os.W_OK):
            return
        self._descriptor = os.open(
            directory / f"turn-{name}.lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600
        )
        fcntl.flock(self._descriptor, fcntl.LOCK_EX)  # given back by the kernel if the process dies
        if self._marker.exists():
            self.leave()

    def done(self) -> None:
        """Kernels are there: nobody has to wait any more."""
        if self._descriptor >= 0:
            with contextlib.suppress(OSError):
                self._marker.touch(mode=0o600)
            self.leave()

    def leave(self) -> None:
        """Give the turn to the next; does nothing the second time."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1


# ---- The case

_PATIENCE = 180.0
"""How long a run directory may be held by another process that is about to stop [s]."""

SILENCE = 180.0
"""How long another machine's case may stand still before it is taken over [s]: a dozen beats of a
living worker, three times as long as shared file systems keep what they know of files."""

_PAUSE = 0.5


class _Released(SilentObserver):
    """Gives the turn to compile to the next case once the first step is done."""

    def __init__(self, turn: CompilationTurn) -> None:
        self._turn = turn

    def stepped(self, status: Status) -> None:
        self._turn.done()

    def closed(self) -> None:
        self._turn.leave()


def outcome(status: str, reason: str, exit_code: int, step: int = 0) -> dict[str, Any]:
    """How a case ended: ``status`` is finished, stopped, failed or killed."""
    return {"status": status, "reason": reason, "exit_code": exit_code, "step": step}


def main() -> int:
    """Run the case that standard input describes."""
    task = json.loads(sys.stdin.buffer.readline())
    # When the worker's end closes, the worker has died
    end_with_parent(lambda: os.kill(os.getpid(), signal.SIGTERM))
    # on a line of its own, whatever else was said
    print(f"\n{json.dumps(run_task(task))}", flush=True)
    return 0


def run_task(task: dict[str, Any]) -> dict[str, Any]:
    """Run, or go on with, a case.

    Args:
        task: ``scenario``, ``overrides``, ``directory``, ``threads``, ``turn`` (what cases share
            compiled kernels), ``max_hours``, ``observe`` (the observables of the study).

    Returns:
        Its `outcome`.
    """
    import multicor_cli as multicor
    from multicor_cli.store import RunDirectory
    from multicor_cli.store.errors import DirectoryRefused, RunLocked

    deadline = time.monotonic() + _PATIENCE
    path, turn = Path(task["directory"]), CompilationTurn(task["turn"])
    elsewhere: Silence | None = None
    while True:
        try:
            done = multicor.run(
                task["scenario"], path, overrides=task["overrides"], threads=task["threads"],
                max_hours=task.get("max_hours"), observer=_Released(turn),
            )  # fmt: skip
        except RunLocked as error:
            if error.host not in ("", socket.gethostname()):
                elsewhere = elsewhere or Silence(path, task.get("silence", SILENCE))
                if elsewhere.is_over():
                    (path / LOCK).unlink(missing_ok=True)
            elif time.monotonic() > deadline:
                return outcome("stopped", str(error), 6)
            time.sleep(_PAUSE)
        except DirectoryRefused as error:
            # A process of this case whose worker has died may have begun the run just now.
            if not RunDirectory.is_run(path) or time.monotonic() > deadline:
                return _failed(error)
            time.sleep(_PAUSE)
        except Exception as error:
            return _failed(error)
        else:
            if done.is_finished:
                _observe(task)
            status = "finished" if done.is_finished else "stopped"
            return outcome(status, done.reason.value, int(done.reason.exit_code), done.step)


def _failed(error: Exception) -> dict[str, Any]:
    code = int(exit_code_of(error))
    if code == 1:
        traceback.print_exception(error)
    return outcome("failed", str(error) or type(error).__name__, code)


def _observe(task: dict[str, Any]) -> None:
    """Take the case's numbers here, not one case after the other when the table is made."""
    from multicor_cli.studies.axes import Case
    from multicor_cli.studies.directory import StudyDirectory
    from multicor_cli.studies.observing import observe
    from multicor_cli.studies.study_file import Observable

    path = Path(task["directory"])
    rows = [Observable.model_validate(row) for row in task.get("observe", [])]
    # a disk that is full: the table tries again, and says what is wrong
    with contextlib.suppress(Exception):
        observe(StudyDirectory(path.parent.parent), Case(path.name, {}), rows)


class Silence:
    """Whether nothing has moved in a run for so long that the machine that held it must be gone.

    Clocks of machines are not compared: what counts is that files change, seen from here. While a
    case runs, its worker touches its lock. Should the other process live after all, it finds its
    lock gone and writes nothing more.
    """

    def __init__(self, path: Path, seconds: float) -> None:
        self._path, self._seconds = path, seconds
        self._seen, self._since = self._look(), time.monotonic()

    def is_over(self) -> bool:
        """Whether nothing has moved for so long; to be asked again and again."""
        seen, now = self._look(), time.monotonic()
        if seen != self._seen:
            self._seen, self._since = seen, now
        return now - self._since >= self._seconds

    def _look(self) -> list[tuple[int, int]]:
        found = []
        for name in (LOCK, PROGRESS, RUN):
            with contextlib.suppress(OSError):
                status = (self._path / name).stat()
                found.append((status.st_mtime_ns, status.st_ino))
        return found
