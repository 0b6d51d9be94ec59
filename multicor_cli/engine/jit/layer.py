"""Which threading layer Numba takes. To be chosen before Numba is imported."""

from __future__ import annotations

import os
import sys

PRIORITY = "omp tbb workqueue"
"""OpenMP first: under TBB, which Numba prefers where some other program has installed it, sweeps do not gain from threads."""

_CHOICES = ("NUMBA_THREADING_LAYER", "NUMBA_THREADING_LAYER_PRIORITY")


def prefer_openmp() -> None:
    """Prefer OpenMP unless the user's environment chooses a layer. Results do not depend on it, only speed does."""
    if any(os.environ.get(name) for name in _CHOICES):
        return
    os.environ["NUMBA_THREADING_LAYER_PRIORITY"] = PRIORITY
    numba = sys.modules.get("numba")
    if numba is not None:  # Numba was imported before us and has read the environment already
        numba.config.THREADING_LAYER_PRIORITY = PRIORITY.split()


def describe_layer() -> str:
    """The threading layer that kernels get here, found by starting its threads; in words, also if there is none."""
    prefer_openmp()
    import numba

    if numba.config.DISABLE_JIT:  # type: ignore[attr-defined]
        return "none: nothing is compiled, as NUMBA_DISABLE_JIT is set"
    try:
        require_layer()
    except NoThreadingLayer as error:
        return f"none: {error}"
    threads = numba.get_num_threads()  # starts them
    return f"{numba.threading_layer()}, {threads} threads"  # type: ignore[attr-defined]


class NoThreadingLayer(Exception):
    """The threading layer that the environment asks for is not there: one message for the user."""

    exit_code = 5


def require_layer() -> None:
    """Start the threads of a layer that the environment chooses: Numba complains of one that is not there in the midst of a kernel.

    Raises:
        NoThreadingLayer: If it is not there.
    """
    import numba

    chosen = [f"{name}={os.environ[name]}" for name in _CHOICES if os.environ.get(name) not in (None, "", PRIORITY)]
    if not chosen:
        return
    try:
        numba.get_num_threads()  # starts them
    except ValueError as error:
        message = f"{', '.join(chosen)}: Numba has no such threading layer here; unset it, or choose omp or workqueue"
        raise NoThreadingLayer(message) from error
