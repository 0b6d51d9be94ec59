"""Sums of arrays in a stated order: the halves of an array are added to each other until one value is left.

Rounding errors grow with the logarithm of the number of values, and nothing depends on how a library's sum is vectorized.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[Any]


def total(values: Floats) -> float:
    """Sum of all values of a float array; 0 if there are none."""
    return float(column_totals(np.reshape(values, (-1, 1)))[0])


def mean(values: Floats) -> float:
    """Mean of all values of a float array; raises `ZeroDivisionError` if there are none."""
    return total(values) / values.size


def column_totals(values: Floats) -> Floats:
    """Sum over the first axis of an array of two or more dimensions; zeros if it has no rows."""
    rest = values
    while len(rest) > 1:
        half = len(rest) // 2
        folded = rest[:half] + rest[half : 2 * half]
        if len(rest) % 2:
            folded[0] += rest[-1]
        rest = folded
    return np.array(rest[0]) if len(rest) else np.zeros(values.shape[1:])
