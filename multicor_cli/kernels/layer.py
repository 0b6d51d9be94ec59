"""Which threading layer Numba takes. This module does not import Numba, and must run before kernels start threads."""

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
    if numba is not None:  # somebody imported Numba before us: it has read the environment already
        numba.config.THREADING_LAYER_PRIORITY = PRIORITY.split()
