"""The kernels of a first run, compiled on two cores."""

from __future__ import annotations

import contextlib
import subprocess
import sys
from collections.abc import Iterator

from multicor_cli.engine.jit.cache import is_compiled, is_kept


@contextlib.contextmanager
def shared_compilation(threads: int) -> Iterator[subprocess.Popen[bytes] | None]:
    """Let another process compile kernels too, if there are none yet and the run may use a second thread; yields that process.

    Numba compiles on one core, one kernel after the other. The other process takes them in another order
    (`multicor_cli.engine.rehearsal`) and leaves them in the cache; if it fails, they are compiled here. It ends with the block.
    """
    if threads < 2 or is_compiled() or not is_kept():
        yield None
        return
    quiet = subprocess.DEVNULL
    other = subprocess.Popen([sys.executable, "-m", "multicor_cli.engine.rehearsal"], stdin=quiet, stdout=quiet, stderr=quiet)
    try:
        yield other
    finally:
        other.terminate()
        other.wait()
