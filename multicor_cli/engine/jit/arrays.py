"""Arrays for kernels: reductions on threads, alignment; `multicor_cli.arithmetic` of whole arrays.

`CHUNK` grains or contacts form one unit: a kernel leaves one row of partial results per chunk, and
its caller sums the rows in order, so that bits do not depend on the number of threads. (Array
expressions and reductions inside a parallel kernel would be turned into parallel loops of their
own, at a second of compilation each.)
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli import arithmetic
from multicor_cli.arithmetic.sums import FEW
from multicor_cli.engine.jit.compile import elementwise, kernel, loop_body
from multicor_cli.model.model import Floats

CHUNK = 512

_CACHE_LINE = 64  # bytes


def aligned(shape: tuple[int, ...], dtype: type[Any] = np.float64) -> NDArray[Any]:
    """An unset array from a cache line on: the sweep is up to a sixth slower if rows lie in two."""
    size = math.prod(shape) * np.dtype(dtype).itemsize
    memory = np.empty(size + _CACHE_LINE, np.uint8)
    address = memory.__array_interface__["data"][0]
    return np.ndarray(shape, dtype, memory, -address % _CACHE_LINE)


def aligned_zeros(*shapes: tuple[int, ...]) -> list[Floats]:
    """Arrays of zeros in one piece of memory, each from a cache line on."""
    line, ends = _CACHE_LINE // np.dtype(np.float64).itemsize, [0]
    for shape in shapes:
        ends.append(ends[-1] + -(-math.prod(shape) // line) * line)
    memory = aligned((ends[-1],))
    memory[:] = 0.0
    return [
        memory[begin : begin + math.prod(shape)].reshape(shape)
        for begin, shape in zip(ends[:-1], shapes, strict=True)
    ]


def aligned_copy(array: NDArray[Any]) -> NDArray[Any]:
    """A copy that begins at a cache line."""
    copy = aligned(array.shape, array.dtype.type)
    copy[:] = array
    return copy


# ---- Copying arrays within kernels


@loop_body
def copy_into(target: NDArray[Any], source: NDArray[Any]) -> None:
    """Write ``source`` over the beginning of ``target``; both flat.

    ``target[:] = source`` compiles an error message too: up to three seconds in each kernel.
    """
    for k in range(source.size):
        target[k] = source[k]


@loop_body
def copy_row(target: Floats, row: int, source: Floats, other: int) -> None:
    """Write row ``other`` of ``source`` over a row of ``target``, of four columns: as one vector.

    All four are read before any is written, since the compiler cannot know that arrays are apart.
    """
    a, b, c, d = source[other, 0], source[other, 1], source[other, 2], source[other, 3]
    target[row, 0], target[row, 1], target[row, 2], target[row, 3] = a, b, c, d


# ---- `multicor_cli.arithmetic.sums` compiled, for what is summed in every step: the same bits


@kernel
def column_totals(values: Floats) -> Floats:
    """Sum over the first axis of an array of two dimensions; zeros if it has no rows."""
    count, columns = values.shape
    result = np.zeros(columns)
    if count == 0:
        return result
    rest = values.copy()
    while count > FEW:
        half = count // 2
        for k in range(half):
            for d in range(columns):
                rest[k, d] += rest[half + k, d]
        if count % 2 == 1:
            for d in range(columns):
                rest[0, d] += rest[count - 1, d]
        count = half
    for d in range(columns):
        result[d] = rest[0, d]
        for k in range(1, count):
            result[d] += rest[k, d]
    return result


@kernel
def total_and_magnitude(values: Floats) -> tuple[float, float]:
    """Sum of all values, and of their magnitudes; zeros if there are none."""
    both = np.empty((values.size, 2))
    for k in range(values.size):
        both[k, 0], both[k, 1] = values[k], abs(values[k])
    sums = column_totals(both)
    return sums[0], sums[1]


# ---- `multicor_cli.arithmetic` on float64 arrays of any shape, compiled when first called

acos = elementwise(arithmetic.acos)
asin = elementwise(arithmetic.asin)
cos = elementwise(arithmetic.cos)
exp = elementwise(arithmetic.exp)
log1p = elementwise(arithmetic.log1p)
normal_quantile = elementwise(arithmetic.normal_quantile)
sin = elementwise(arithmetic.sin)


def hypot(x: Floats, y: Floats) -> Floats:
    """Lengths of the vectors (x, y), as `arithmetic.hypot`."""
    return np.asarray(np.sqrt(x * x + y * y))


_FRACTION, _BITS, _REGULAR = (1 << 52) - 1, 52, 2046


@kernel
def cube_roots(values: Floats) -> None:
    """`arithmetic.cbrt` of all values, for kernels: the same bits, twenty times as fast.

    Instructions on vectors do it: there is no branch, and no function of the C library, which
    `frexp` and `ldexp` are. **Modifies** ``values``, of shape ``(k,)``.
    """
    mantissa, third, is_regular = np.empty(values.size), np.empty(values.size), True
    bits, bits_of_mantissa, bits_of_third = (
        values.view(np.int64), mantissa.view(np.int64), third.view(np.int64),
    )  # fmt: skip
    for k in range(values.size):
        exponent = bits[k] >> _BITS  # with a bias of 1,023
        part = (exponent * 43691) >> 17  # a third of it
        bits_of_mantissa[k] = (bits[k] & _FRACTION) | ((1020 + exponent - 3 * part) << _BITS)
        bits_of_third[k] = (683 + part) << _BITS
        is_regular &= (bits[k] == 0) | ((exponent > 0) & (exponent <= _REGULAR))
    if not is_regular:  # some are tiny, infinite, negative or nan
        for k in range(values.size):
            values[k] = arithmetic.cbrt(values[k])
        return
    for k in range(values.size):
        m = mantissa[k]  # between 1/8 and 1
        root = 0.39 + m * (1.02 - 0.41 * m)
        for _ in range(3):
            cube = root * root * root
            root = root - root * (cube - m) / (2.0 * cube + m)
        values[k] = root * third[k] if bits[k] != 0 else 0.0
