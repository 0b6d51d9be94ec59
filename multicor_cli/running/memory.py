"""Memory: what the machine has left, and keeping what was freed for the next time step."""

from __future__ import annotations

import contextlib
import ctypes
import os
import sys
from pathlib import Path

_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3  # options of mallopt(3)
_NEVER = 2**31 - 1


def keep_freed_memory() -> bool:
    """Ask the C library not to give freed memory back to the system before the process ends.

    Otherwise every array above some 100 kB is a fresh mapping, whose pages the system has to find and to clear when they are first
    touched, in every time step again: a fifth of what is done before the first sweep. The peak of the memory stays as it is.

    Returns:
        Whether the C library knows how (that of GNU does).
    """
    if not sys.platform.startswith("linux"):
        return False
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is None:
        return False
    return bool(mallopt(_MMAP_THRESHOLD, _NEVER)) and bool(mallopt(_TRIM_THRESHOLD, _NEVER))


def available_memory() -> int | None:
    """Memory that a process can have without others being pushed out [bytes]; None where the system does not tell."""
    with contextlib.suppress(OSError, ValueError, IndexError):
        lines = Path("/proc/meminfo").read_text().splitlines()
        for line in lines:
            if line.startswith("MemAvailable:"):
                return int(line.split()[1]) << 10
    with contextlib.suppress(OSError, ValueError):
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    return None
