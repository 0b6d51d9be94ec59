"""Sums of arrays in a stated order: halves are added until few values are left, then one by one.

Rounding errors grow with the logarithm of the number of values, and nothing depends on how a
library's sum is vectorized.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[Any]


FEW = 32
"""Values that are added one after the other."""


def total(values: Floats) -> float:
    """Sum of all values of a float array; 0 if there are none."""
    flat = values.reshape(-1)
    rest = _folded(flat).tolist()
    if not rest:
        return 0.0
    result = float(rest[0])
    for value in rest[1:]:
        result += value
    return result


def mean(values: Floats) -> float:
    """Mean of all values of a float array; raises `ZeroDivisionError` if there are none."""
    return total(values) / values.size


def column_totals(values: Floats) -> Floats:
    """Sum over the first axis of an array of two or more dimensions; zeros if it has no rows."""
    rest = _folded(values)
    return np.array(rest.cumsum(axis=0)[-1]) if len(rest) else np.zeros(values.shape[1:])


def _folded(values: Floats) -> Floats:
    count, rest = len(values), values
    while count > FEW:
        half = count // 2
        # The first fold makes an array of its own, the others stay in it.
        folded = np.add(
            rest[:half], rest[half : 2 * half], out=None if rest is values else rest[:half]
        )
        if count % 2:
            folded[0] += rest[count - 1]
        count, rest = half, folded
    return rest
