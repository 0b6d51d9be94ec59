"""Processes of cases: what a worker does with them, and how they are forked.

They are forked from one that has loaded the program: loading outlasts short cases. `ForkServer` is
the side of the worker. It starts ``python -m multicor_cli.studies.forking`` once, sends it one end
of a pair of sockets for each case, and gets the number of a process that uses this end as its
standard streams. The forked processes run `multicor_cli.studies.child.main`; they belong to the
other side, which waits for them and tells how they have ended. That side has one thread only, for
the others would be missing in what it forks, and ends with the worker.

The fork server of `multiprocessing` does not do here: it runs the user's program once more in every
process that it forks, unless that guards its `__main__`; workers of Dask are daemons, which may
start no process with it; it takes modules from the working directory; and it listens at a socket
with a name, where cases shall have no door at all.
"""

from __future__ import annotations

import contextlib
import gc
import importlib
import json
import os
import signal
import socket
import subprocess
import sys
import threading
import traceback
from collections import deque
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Never

from multicor_cli.running.machine import available_cores, python_child
from multicor_cli.store.layout import LOCK
from multicor_cli.studies.child import outcome

_LOST = -signal.SIGKILL
"""How a process has ended whose parent has died: nobody knows."""

_LONGEST = 64
"""Bytes of a question or an answer at most: one at a time, received as it was sent."""

_SINGLE = {"OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
"""Linear algebra starts no threads when it is loaded."""

_LOADED = ("running.session", "checks", "post", "store", "studies.child", "studies.observing")
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
        from multicor_cli.studies.child import main

        code = main()
    except BaseException:
        traceback.print_exc()
    finally:
        with contextlib.suppress(BaseException):
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(code)


if __name__ == "__main__":
    sys.exit(main())
