"""How many threads kernels run on."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator

PARALLEL_GRAINS = 4_000
"""Below this, starting threads costs more than they save; results are the same."""

_own = threading.local()  # each thread of Python has its number


def use_threads(number: int) -> None:
    """Let kernels run on so many threads from now on."""
    import numba

    if number != getattr(_own, "number", 0):
        numba.set_num_threads(number)
        _own.number = number


def threads_in_use() -> int:
    """The number that `use_threads` was told last; asking Numba costs as much as a small kernel."""
    number: int = getattr(_own, "number", 0)
    if number == 0:
        import numba

        number = _own.number = numba.get_num_threads()
    return number


@contextlib.contextmanager
def threads_for(grains: int) -> Iterator[None]:
    """One thread where grains are few: kernels for several would be compiled for nothing."""
    before = threads_in_use()
    use_threads(before if grains >= PARALLEL_GRAINS else 1)
    try:
        yield
    finally:
        use_threads(before)
