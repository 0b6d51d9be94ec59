"""How many threads the kernels use. Numba fixes the largest possible number when it is imported; more than cores is allowed."""

from __future__ import annotations

import os
import sys

LIMIT = 1024
"""Largest number of threads."""

_VARIABLE = "NUMBA_NUM_THREADS"


def available_cores() -> int:
    """Number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def reserve_threads(requested: int = 0) -> int:
    """Make room for a number of threads; call before Numba is imported.

    Args:
        requested: Number of threads; 0 takes ``$NUMBA_NUM_THREADS`` if set, else all cores.

    Returns:
        The number of threads to use.

    Raises:
        ValueError: If the number is not between 0 and `LIMIT`, or if Numba has been imported with room for fewer.
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
        raise ValueError(f"{requested} threads: Numba has been imported with room for {room}; set {_VARIABLE} beforehand")
    return min(wanted, room)
