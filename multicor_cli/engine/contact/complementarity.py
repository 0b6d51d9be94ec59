"""Linear complementarity problems ``w = q + M z, 0 ≤ w ⟂ z ≥ 0``, by Lemke's method (Cottle, Pang & Stone 1992, chapter 4)."""

from __future__ import annotations

import numpy as np

from multicor_cli.engine.jit.compile import kernel, loop_body
from multicor_cli.model.model import Floats, Ints

SMALLEST = 1e-11
"""Pivots below this are rounding errors, in a problem whose numbers are of order 1."""

TIE = 1e-12
"""Ratios that differ by less are the same."""


@loop_body
def _add(target: Floats, source: Floats, factor: float) -> None:
    for k in range(target.size):
        target[k] += factor * source[k]


@kernel
def _exchange(table: Floats, row: int, column: int) -> None:
    """Let the variables of a row and a column of the table change places."""
    pivot = 1.0 / table[row, column]
    for k in range(table.shape[1]):
        table[row, k] *= -pivot
    table[row, column] = pivot
    source = table[row].copy()  # of which the compiler knows that no other row changes it: this is where time goes
    for i in range(table.shape[0]):
        factor = table[i, column]
        if i != row and factor != 0.0:
            table[i, column] = 0.0
            _add(table[i], source, factor)


@kernel
def _leaving_row(table: Floats, column: int, basic: Ints, artificial: int) -> int:
    """The row that first becomes negative as the variable of a column grows; -1 if none does.

    Of several the artificial variable's, for then the problem is solved, or else the one with the largest pivot.
    """
    last = table.shape[1] - 1
    least = np.inf
    for i in range(table.shape[0]):
        if table[i, column] < -SMALLEST:
            least = min(least, table[i, last] / -table[i, column])
    found = -1
    for i in range(table.shape[0]):
        if table[i, column] < -SMALLEST and table[i, last] / -table[i, column] <= least + TIE:
            if basic[i] == artificial:
                return i
            if found < 0 or table[i, column] < table[found, column]:
                found = i
    return found


@kernel
def solve_complementarity(matrix: Floats, vector: Floats, limit: int, solution: Floats) -> bool:
    """Lemke's method with a covering vector of ones.

    Args:
        matrix: M, its numbers of order 1, shape ``(n, n)``.
        vector: q, likewise, shape ``(n,)``.
        limit: Cap on the number of pivots.
        solution: z, shape ``(n,)``. **Modified.**

    Returns:
        Whether a solution was found; the method may end at a ray, or at the cap.
    """
    n = vector.size
    artificial = 2 * n
    solution[:] = 0.0
    row = int(np.argmin(vector))
    if vector[row] >= 0.0:
        return True
    table = np.empty((n, n + 2))  # basic variables as functions of the others: of z (or w), of the artificial one, and constants
    for i in range(n):
        for k in range(n):
            table[i, k] = matrix[i, k]
        table[i, n], table[i, n + 1] = 1.0, vector[i]
    basic = np.arange(n)  # w_k is k, z_k is n + k
    free = n + np.arange(n + 1)
    column = n
    for _ in range(limit):
        _exchange(table, row, column)
        basic[row], free[column] = free[column], basic[row]
        left = free[column]
        if left == artificial:
            for i in range(n):
                if n <= basic[i] < artificial:
                    solution[basic[i] - n] = table[i, n + 1]
            return True
        partner = left + n if left < n else left - n
        for k in range(n + 1):
            if free[k] == partner:
                column = k
        row = _leaving_row(table, column, basic, artificial)
        if row < 0:
            return False
    return False
