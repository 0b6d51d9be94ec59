"""Arrays for kernels on threads: reductions whose bits do not depend on their number, alignment.

`CHUNK` grains or contacts form one unit: a kernel leaves one row of partial results per chunk, and
its caller sums the rows in order. (Array expressions and reductions inside a parallel kernel would
be turned into parallel loops of their own, at a second of compilation each.)
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.jit.compile import loop_body
from multicor_cli.model.model import Floats

CHUNK = 512

_CACHE_LINE = 64  # bytes


def chunks_for(size: int, columns: int = 1) -> Floats:
    """Zeroed partial results, one row per chunk of items (at least one), ``(chunks, columns)``."""
    return np.zeros((max(1, -(-size // CHUNK)), columns))


def aligned(shape: tuple[int, ...], dtype: type[Any] = np.float64) -> NDArray[Any]:
    """An unset array from a cache line on: the sweep is up to a sixth slower if rows lie in two."""
    size = math.prod(shape) * np.dtype(dtype).itemsize
    memory = np.empty(size + _CACHE_LINE, np.uint8)
    return np.ndarray(shape, dtype, memory, -memory.ctypes.data % _CACHE_LINE)


def aligned_copy(array: NDArray[Any]) -> NDArray[Any]:
    """A copy that begins at a cache line."""
    copy = aligned(array.shape, array.dtype.type)
    copy[:] = array
    return copy


# ---- Copying arrays within kernels


@loop_body
def copy_into(target: Floats, source: Floats) -> None:
    """Write ``source`` over the beginning of ``target``; both flat.

    ``target[:] = source`` compiles an error message too: up to three seconds in each kernel.
    """
    for k in range(source.size):
        target[k] = source[k]
