"""How many threads kernels run on."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

PARALLEL_GRAINS = 4_000
"""Below this, starting threads costs more than they save; results are the same."""


@contextlib.contextmanager
def threads_for(grains: int) -> Iterator[None]:
    """One thread where grains are few: kernels for several would be compiled for nothing."""
    import numba

    before = numba.get_num_threads()
    numba.set_num_threads(before if grains >= PARALLEL_GRAINS else 1)
    try:
        yield
    finally:
        numba.set_num_threads(before)
