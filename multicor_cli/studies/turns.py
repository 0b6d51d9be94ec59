"""Taking turns at compiling: of the cases that start together on a machine one compiles the kernels, the others then load them."""

from __future__ import annotations

import contextlib
import fcntl
import os
import tempfile
from pathlib import Path


class CompilationTurn:
    """The turn of a process to compile; waits until it has it, unless someone has compiled before.

    Args:
        name: What the processes have in common that share their kernels: version of the program and study.
    """

    def __init__(self, name: str) -> None:
        # Beside the kernels: where these are removed, the next one has to compile again.
        directory = Path(os.environ.get("NUMBA_CACHE_DIR") or tempfile.gettempdir())
        self._marker = directory / f"turn-{name}.done"
        self._descriptor = -1
        if self._marker.exists() or not os.access(directory, os.W_OK):
            return
        self._descriptor = os.open(directory / f"turn-{name}.lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
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
