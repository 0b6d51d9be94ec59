"""`multicor_cli.arithmetic` on float64 arrays of any shape, compiled when first called."""

from __future__ import annotations

import numpy as np

from multicor_cli import arithmetic
from multicor_cli.engine.jit.compile import elementwise, kernel
from multicor_cli.model.model import Floats

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
