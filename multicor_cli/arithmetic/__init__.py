"""Elementary functions and sums by + − × ÷ √ in a stated order: every machine gives the same bits.

IEEE 754 fixes those five operations, and splitting a number into fraction and exponent, to the last
bit. It does not fix sin, exp or pow: C libraries differ, each has variants for different
processors, NumPy has further ones of its own for some of them, and the order of a sum or a matrix
product is the library's business. A flow of grains is chaotic: one different bit makes another
trajectory. So whatever reaches a `Model` or a `State` calls the functions of this package instead;
a test walks the code and finds every other call.

The functions are plain Python over floats; `arithmetic.sums` is about arrays. Kernels compile these
very functions (`engine.jit.compile` registers them) and `engine.jit.arrays` applies them to
arrays, so interpreted and compiled results are equal to the bit. Their accuracy is tested against
many digits.
"""

from multicor_cli.arithmetic.elementary import (
    acos,
    asin,
    atan2,
    cbrt,
    cos,
    exp,
    expm1,
    hypot,
    log,
    log1p,
    normal_cdf,
    normal_quantile,
    power,
    sin,
)

__all__ = [
    "acos", "asin", "atan2", "cbrt", "cos", "exp", "expm1", "hypot", "log", "log1p", "normal_cdf",
    "normal_quantile", "power", "sin",
]  # fmt: skip
