"""Processes of cases: what a worker does with them, how they are forked, and what they do.

They are forked from one that has loaded the program: loading outlasts short cases. `ForkServer` is
the side of the worker. It starts ``python -m multicor_cli.studies.processes`` once, sends it one
end of a pair of sockets for each case, and gets the number of a process that uses this end as its
standard streams. The forked processes belong to the other side, which waits for them and tells how
they have ended. That side has one thread only, for the others would be missing in what it forks,
and ends with the worker.

What a process is to do comes as JSON in the first line of its standard input, which stays open: its
end means that nobody waits any more. Standard output says how it ended, in a line of JSON.

The fork server of `multiprocessing` does not do here: it runs the user's program once more in every
process that it forks, unless that guards its `__main__`; workers of Dask are daemons, which may
start no process with it; it takes modules from the working directory; and it listens at a socket
with a name, where cases shall have no door at all.
"""

from __future__ import annotations

import contextlib
import fcntl
import gc
import importlib
import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import traceback
from collections import deque
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Never

from multicor_cli.running.machine import available_cores, end_with_parent, python_child
from multicor_cli.running.outcome import QuietObserver, Status, exit_code_of
from multicor_cli.store.layout import LOCK, PROGRESS, RUN

_LOST = -signal.SIGKILL
"""How a process has ended whose parent has died: nobody knows."""

_LONGEST = 64
"""Bytes of a question or an answer at most: one at a time, received as it was sent."""

_SINGLE = {"OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
"""Linear algebra starts no threads when it is loaded."""

_LOADED = ("running.session", "checks", "post", "store", "studies.observing")
"""Everything that a case needs before it does anything of its own."""


@dataclass(frozen=True)
class CaseProcess:
    """A process of a case, with all of its standard streams in one ``stream``."""

    server: ForkServer
    pid: int
    stream: socket.socket

    def send_signal(self, number: int) -> None:
        """Send it a signal; nothing happens if it has ended."""
        with contextlib.suppress(ProcessLookupError):
            os.kill(self.pid, number)

    def wait(self) -> int:
        """How it has ended, as of `subprocess.Popen`; called once, when its stream has ended."""
        self.stream.close()
        try:
            return self.server.ask(f"{self.pid}")
        except OSError:
            return _LOST


class ForkServer:
    """Starts processes of cases, each of which may use so many ``threads`` at most."""

    def __init__(self, threads: int) -> None:
        self.threads = max(threads, available_cores())
        self._lock = threading.Lock()
        command, environment = python_child("-m", __name__)
        # The other side ends with the last reference to this one
        self._socket, theirs = socket.socketpair()
        with theirs:
            self._process = subprocess.Popen(
                command,
                stdin=theirs.fileno(), stdout=subprocess.DEVNULL,
                env=_SINGLE | environment | {"NUMBA_NUM_THREADS": str(self.threads)},
                start_new_session=True,  # Ctrl-C is for the client, which stops cases in order
            )  # fmt: skip

    @property
    def is_alive(self) -> bool:
        """Whether it can start processes."""
        return self._process.poll() is None

    def start(self) -> CaseProcess:
        """Start a process; raises `OSError` without descriptors or if the other side has died."""
        ours, theirs = socket.socketpair()
        with theirs:
            try:
                return CaseProcess(self, self.ask("fork", theirs.fileno()), ours)
            except OSError as error:
                ours.close()
                raise OSError(f"no process could be started for a case: {error}") from None

    def ask(self, question: str, *descriptors: int) -> int:
        """The answer to a question; raises `OSError` if nobody answers."""
        with self._lock:
            socket.send_fds(self._socket, [question.encode()], descriptors)
            answer = self._socket.recv(_LONGEST)
        if not answer:
            raise OSError("the process that starts others has died")
        return int(answer)


# ---- What a worker, one of Dask or a thread here, does with a case

BEAT = 15.0
"""How often the lock of a case is touched while its process lives [s]."""

_TAIL = 2000
_running: dict[str, CaseProcess] = {}
_fork_servers: list[ForkServer] = []
_lock = threading.Lock()
_stopping: set[str] = set()


def run_case(task: dict[str, Any]) -> dict[str, Any]:
    """Run a case in a process; as `run_task`, with its client and name.

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


def end_fork_servers() -> None:
    """Start no more processes from those that are there; each ends once its last case has."""
    with _lock:
        _fork_servers.clear()


# ---- The other side


def main() -> int:
    """The other side: loads the program, then answers until nobody asks any more."""
    # Whoever has asked may be dead by now
    with socket.socket(fileno=os.dup(0)) as asking, contextlib.suppress(OSError):
        for name in _LOADED:
            # a library that is not there is met again by the case
            with contextlib.suppress(ImportError):
                importlib.import_module(f"multicor_cli.{name}")
        gc.collect()
        gc.freeze()  # objects that are there stay in memory that all processes share
        while True:
            question, descriptors, _, _ = socket.recv_fds(asking, _LONGEST, 1)
            if not question:
                break
            if descriptors:
                answer = os.fork()
                if answer == 0:
                    asking.close()
                    _become_case(descriptors[0])
                os.close(descriptors[0])
            else:
                answer = _LOST
                with contextlib.suppress(ChildProcessError):
                    answer = os.waitstatus_to_exitcode(os.waitpid(int(question), 0)[1])
            asking.sendall(str(answer).encode())
    return 0


def _become_case(stream: int) -> Never:
    """In the new process: take the stream, do the case, and leave past the parent's loop."""
    code = 1
    try:
        os.setsid()
        for number in range(3):
            os.dup2(stream, number)
        os.close(stream)
        code = _run_described_case()
    except BaseException:
        traceback.print_exc()
    finally:
        with contextlib.suppress(BaseException):
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(code)


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


class _Released(QuietObserver):
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


def _run_described_case() -> int:
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


if __name__ == "__main__":
    sys.exit(main())
