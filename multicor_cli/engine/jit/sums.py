"""`multicor_cli.arithmetic.sums` compiled, for what is summed in every step: the same bits."""

from __future__ import annotations

import numpy as np

from multicor_cli.arithmetic.sums import FEW
from multicor_cli.engine.jit.compile import kernel
from multicor_cli.model.model import Floats


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
