"""What a run takes of the machine: processes, threads, memory, and a second core that compiles."""

from __future__ import annotations

import contextlib
import ctypes
import os
import shutil
import site
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

from multicor_cli.engine.jit.cache import is_compiled, is_kept

# ---- How every Python process of this program begins: without the working directory on its path


def python_child(*words: str, **variables: str) -> tuple[list[str], dict[str, str]]:
    """Command and environment of a Python process that finds modules as this one does.

    But never in the working directory, which ``python -c`` and ``python -m`` put first: a file
    ``random.py`` there, of the user or of a folder from somewhere, would be run in place of the
    library's. ``-P`` keeps it out, ``PYTHONSAFEPATH`` out of what the child starts in turn. ``-I``
    would keep out ``PYTHONPATH`` and the user's own packages too, where libraries may be installed;
    of ``PYTHONPATH`` only the parts go that mean the working directory.

    ``words`` follow the interpreter; ``variables`` are further ones of the environment.
    """
    path = [
        part
        for part in os.environ.get("PYTHONPATH", "").split(os.pathsep)
        if os.path.normpath(part) != "."
    ]
    root = str(Path(__file__).resolve().parents[2])
    if root not in (*path, *site.getsitepackages(), site.getusersitepackages()):
        path.append(root)  # a source tree that is not installed
    safe = {"PYTHONSAFEPATH": "1", "PYTHONPATH": os.pathsep.join(path)}
    return [sys.executable, "-I" if sys.flags.isolated else "-P", *words], {
        **os.environ,
        **safe,
        **variables,
    }


def end_with_parent(end: Callable[[], None] = lambda: os._exit(0)) -> None:
    """End this process when the other end of its standard input is closed; returns at once."""

    def wait() -> None:
        with contextlib.suppress(OSError):  # the other side died before it read everything
            # a buffered read would hold a lock that the end of the interpreter needs
            while os.read(sys.stdin.fileno(), 4096):
                pass
        end()

    threading.Thread(target=wait, daemon=True).start()


# ---- Threads of the kernels. Numba fixes the largest number on import; more than cores is allowed

LIMIT = 1024
"""Largest number of threads."""

_VARIABLE = "NUMBA_NUM_THREADS"


def available_cores() -> int:
    """Number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def reserve_threads(requested: int = 0) -> int:
    """Make room for a number of threads, which is returned; call before Numba is imported.

    0 takes ``$NUMBA_NUM_THREADS`` if set, else all cores. Raises `ValueError` if the number is not
    between 0 and `LIMIT`, or Numba was imported with room for fewer.
    """
    if not 0 <= requested <= LIMIT:
        raise ValueError(f"{requested} threads: choose between 1 and {LIMIT}, or 0 for all cores")
    given = os.environ.get(_VARIABLE, "")
    room = int(given) if given.isdecimal() and 0 < int(given) <= LIMIT else available_cores()
    wanted = requested or room
    numba = sys.modules.get("numba")
    if numba is None:
        os.environ[_VARIABLE] = str(max(room, wanted))
        return wanted
    room = int(numba.config.NUMBA_NUM_THREADS)
    if requested > room:
        raise ValueError(
            f"{requested} threads: Numba has been imported with room for {room}; set {_VARIABLE} "
            "beforehand"
        )
    return min(wanted, room)


# ---- Memory and disk: what is left, and keeping what was freed for the next time step

_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3  # options of mallopt(3)
_NEVER = 2**31 - 1


def keep_freed_memory() -> bool:
    """Ask the C library to keep freed memory to the end; returns whether it can (that of GNU).

    Otherwise every array above some 100 kB is a fresh mapping, whose pages the system has to find
    and to clear when they are first touched, in every time step again: a fifth of what is done
    before the first sweep. The peak of the memory stays as it is.
    """
    if not sys.platform.startswith("linux"):
        return False
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is None:
        return False
    return bool(mallopt(_MMAP_THRESHOLD, _NEVER)) and bool(mallopt(_TRIM_THRESHOLD, _NEVER))


def available_memory() -> int | None:
    """Memory that is to be had without pushing others out [bytes]; None where that is not told."""
    with contextlib.suppress(OSError, ValueError, IndexError):
        lines = Path("/proc/meminfo").read_text().splitlines()
        for line in lines:
            if line.startswith("MemAvailable:"):
                return int(line.split()[1]) << 10
    with contextlib.suppress(OSError, ValueError):
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    return None


def free_space(directory: Path) -> tuple[Path, int]:
    """The directory, or the nearest above it that there is, and what is free in it [bytes]."""
    place = directory.absolute()
    while not place.exists():
        place = place.parent
    return place, shutil.disk_usage(place).free


# ---- The kernels of a first run, compiled on two cores

_SHAPES, _HEAT = "shapes", "heat"
"""What the other process is told to compile for."""


@contextlib.contextmanager
def shared_compilation(
    threads: int, *, has_shapes: bool = False, has_heat: bool = True
) -> Iterator[subprocess.Popen[bytes] | None]:
    """Let another process, which is yielded, compile kernels too if there are none and threads > 1.

    Kernels for some grains that are no discs, and with or without those of heat.
    Numba compiles on one core, one kernel after the other. The other process takes them in another
    order (`multicor_cli.engine.precompile`) and leaves them in the cache; if it fails, they are
    compiled here. It ends with the block, and with this process however that ends.
    """
    if threads < 2 or is_compiled(has_shapes=has_shapes) or not is_kept():
        yield None
        return
    quiet = subprocess.DEVNULL
    kinds = [kind for kind, has in ((_SHAPES, has_shapes), (_HEAT, has_heat)) if has]
    command, environment = python_child("-m", __name__, *kinds)
    try:
        other = subprocess.Popen(
            command, env=environment, stdin=subprocess.PIPE, stdout=quiet, stderr=quiet
        )
    # no more processes, or an interpreter that this user may not start: one core is enough
    except OSError:
        yield None
        return
    with other:
        try:
            yield other
        finally:
            other.terminate()


if __name__ == "__main__":
    end_with_parent()
    from multicor_cli.engine.precompile import precompile

    precompile(has_shapes=_SHAPES in sys.argv, has_heat=_HEAT in sys.argv)
