"""The decorators of all kernels, in one place: cached, IEEE arithmetic (no fastmath), division by zero gives inf.

`CHUNK` grains or contacts form one unit of a reduction: sums run within a chunk and then over chunks in order, so that their bits
do not depend on the number of threads.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from multicor_cli.kernels.cache import configure_cache

configure_cache()

import numba  # noqa: E402  (the cache directory must be set first)

F = TypeVar("F", bound=Callable[..., Any])

CHUNK = 512

prange = numba.prange


def scalar(function: F) -> F:
    """Compile a scalar formula of `multicor_cli.physics` for use inside kernels."""
    return numba.njit(cache=True, error_model="numpy")(function)  # type: ignore[no-any-return]


def kernel(function: F) -> F:
    """Compile a serial kernel."""
    return numba.njit(cache=True, error_model="numpy")(function)  # type: ignore[no-any-return]


def parallel_kernel(function: F) -> F:
    """Compile a kernel whose ``prange`` loops run on several threads."""
    return numba.njit(cache=True, error_model="numpy", parallel=True)(function)  # type: ignore[no-any-return]


def chunk_count(size: int) -> int:
    """Number of chunks that ``size`` items form (at least one)."""
    return max(1, -(-size // CHUNK))
