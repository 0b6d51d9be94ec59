"""The kernels of a first run, compiled on two cores. As a program, the process on the second one."""

from __future__ import annotations

import contextlib
import subprocess
from collections.abc import Iterator

from multicor_cli.engine.jit.cache import is_compiled, is_kept
from multicor_cli.running.children import end_with_parent, python_child


@contextlib.contextmanager
def shared_compilation(threads: int) -> Iterator[subprocess.Popen[bytes] | None]:
    """Let another process compile kernels too, if there are none yet and the run may use a second thread; yields that process.

    Numba compiles on one core, one kernel after the other. The other process takes them in another order
    (`multicor_cli.engine.rehearsal`) and leaves them in the cache; if it fails, they are compiled here. It ends with the block,
    and with this process however that ends.
    """
    if threads < 2 or is_compiled() or not is_kept():
        yield None
        return
    quiet = subprocess.DEVNULL
    command, environment = python_child("-m", __name__)
    try:
        other = subprocess.Popen(command, env=environment, stdin=subprocess.PIPE, stdout=quiet, stderr=quiet)
    except OSError:  # no more processes, or an interpreter that this user may not start: one core is enough
        yield None
        return
    with other:
        try:
            yield other
        finally:
            other.terminate()


if __name__ == "__main__":
    end_with_parent()
    from multicor_cli.engine.rehearsal import rehearse

    rehearse()
