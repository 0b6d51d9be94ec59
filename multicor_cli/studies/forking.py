"""Processes of cases, forked from one that has loaded the program already: loading takes longer than a short case.

`ForkServer` is the side of the worker: it starts ``python -m multicor_cli.studies.forking`` once, sends it three descriptors for
each case, and gets the number of a process that uses them as its standard streams. The forked processes run
`multicor_cli.studies.child.main`; they belong to the other side, which waits for them and tells how they have ended. That side has
one thread only, for the others would be missing in what it forks, and ends with the worker.
"""

from __future__ import annotations

import contextlib
import gc
import os
import signal
import socket
import subprocess
import sys
import threading
from typing import IO, Any

from multicor_cli.running.compiling import python_child

_LOST = -signal.SIGKILL
"""How a process has ended whose parent has died: nobody knows."""

_WORD = 64

_SINGLE = {"OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
"""Linear algebra starts no threads when it is loaded."""


class CaseProcess:
    """A process of a case.

    Attributes:
        pid: Its number.
        stdin: What it reads; it ends when this is closed.
        stdout: What it says.
        stderr: What it complains about.
    """

    def __init__(self, server: ForkServer, pid: int, streams: tuple[IO[bytes], IO[bytes], IO[bytes]]) -> None:
        self._server, self.pid = server, pid
        self.stdin, self.stdout, self.stderr = streams

    def send_signal(self, number: int) -> None:
        """Send it a signal; nothing happens if it has ended."""
        with contextlib.suppress(ProcessLookupError):
            os.kill(self.pid, number)

    def wait(self) -> int:
        """How it has ended, as of `subprocess.Popen`; to be called once, when its streams have ended."""
        try:
            return int(self._server.ask(f"wait {self.pid}"))
        except (OSError, ValueError):
            return _LOST
        finally:
            for stream in (self.stdin, self.stdout, self.stderr):
                with contextlib.suppress(OSError):
                    stream.close()


class ForkServer:
    """Starts processes of cases.

    Args:
        threads: Most threads that one of them may use.
    """

    def __init__(self, threads: int) -> None:
        from multicor_cli.running.compiling import available_cores

        self.threads = max(threads, available_cores())
        self._lock = threading.Lock()
        command, environment = python_child("-m", __name__)
        self._socket, theirs = socket.socketpair()  # the other side ends with the last reference to this one
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
        """Start a process; raises `OSError` if there are no descriptors left or the other side has died."""
        ends = [os.pipe() for _ in range(3)]
        theirs = (ends[0][0], ends[1][1], ends[2][1])
        ours = (ends[0][1], ends[1][0], ends[2][0])
        try:
            pid = int(self.ask("fork", theirs))
        except (OSError, ValueError) as error:
            for descriptor in ours:
                os.close(descriptor)
            raise OSError(f"no process could be started for a case: {error}") from None
        finally:
            for descriptor in theirs:
                os.close(descriptor)
        stdin, stdout, stderr = (os.fdopen(descriptor, mode) for descriptor, mode in zip(ours, ("wb", "rb", "rb"), strict=True))
        return CaseProcess(self, pid, (stdin, stdout, stderr))

    def ask(self, text: str, descriptors: tuple[int, ...] = ()) -> bytes:
        """The answer to a question; raises `OSError` if nobody answers."""
        with self._lock:
            socket.send_fds(self._socket, [text.encode().ljust(_WORD)], descriptors)
            return self._answer()

    def _answer(self) -> bytes:
        answer = b""
        while len(answer) < _WORD:
            part = self._socket.recv(_WORD - len(answer))
            if not part:
                raise OSError("the process that starts others has died")
            answer += part
        return answer.strip()


def main() -> int:
    """The other side: loads the program, then answers until nobody asks any more."""
    with socket.socket(fileno=os.dup(0)) as asking:
        _load()
        gc.collect()
        gc.freeze()  # objects that are there stay in memory that all processes share
        with contextlib.suppress(OSError):  # whoever has asked may be dead by now
            _answer_all(asking)
    return 0


def _answer_all(asking: socket.socket) -> None:
    while True:
        text, descriptors, _, _ = socket.recv_fds(asking, _WORD, 3)
        if not text:
            return
        asking.sendall(str(_do(text.decode().split(), descriptors, asking)).encode().ljust(_WORD))


def _load() -> None:
    """Everything that a case needs before it does anything of its own; a library that is not there is met again by the case."""
    import importlib

    for name in ("running.session", "checks", "post", "store", "studies.child", "studies.observing"):
        with contextlib.suppress(ImportError):
            importlib.import_module(f"multicor_cli.{name}")


def _do(words: list[str], descriptors: list[int], asking: socket.socket) -> int:
    if words[0] == "wait":
        return _wait(int(words[1]))
    pid = os.fork()
    if pid == 0:
        _become_case(descriptors, asking)
    for descriptor in descriptors:
        os.close(descriptor)
    return pid


def _wait(pid: int) -> int:
    try:
        return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
    except ChildProcessError:
        return _LOST


def _become_case(descriptors: list[int], asking: socket.socket) -> Any:
    """In the new process: take the streams, do the case, and leave without a way back into the loop of the parent."""
    code = 1
    try:
        asking.close()
        os.setsid()
        for number, descriptor in enumerate(descriptors):
            os.dup2(descriptor, number)
            os.close(descriptor)
        from multicor_cli.studies.child import main

        code = main()
    except BaseException:
        import traceback

        traceback.print_exc()
    finally:
        with contextlib.suppress(BaseException):
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(code)


if __name__ == "__main__":
    sys.exit(main())
