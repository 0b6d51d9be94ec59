"""Linear complementarity problems, w = q + M z with 0 ≤ w ⟂ z ≥ 0, by Lemke's method.

After Cottle, Pang & Stone 1992, chapter 4. Numbers of a problem are to be of order 1.
"""

from __future__ import annotations

import numpy as np

from multicor_cli.engine.jit.compile import kernel, loop_body, subroutine
from multicor_cli.model.model import Floats, Ints

PIVOTS = 10
"""Cap on the number of pivots, per unknown."""

SMALLEST = 1e-11
"""Pivots below this are rounding errors, in a problem whose numbers are of order 1."""

TIE = 1e-12
"""Ratios that differ by less are the same."""

GOLDEN = 0.6180339887498949
"""Multiples of it are spread evenly modulo 1."""

TRIES = ((1e-9, 1e-9, 0.0), (SMALLEST, TIE, 0.0), (1e-9, 1e-9, 0.5), (SMALLEST, TIE, 0.5))
"""Smallest pivot, tie and spread of the covering vector, one after the other where grains have
corners: edges on edges leave W singular to rounding, and a pivot that is a rounding error spoils
all later ones. The first solution that proves to be one is taken."""

PROVEN = 1e-6
"""Largest |min(w, z)| of a solution, in a problem whose numbers are of order 1."""


@loop_body
def _add(target: Floats, source: Floats, factor: float) -> None:
    for k in range(target.size):
        target[k] += factor * source[k]


@kernel
def _exchange(table: Floats, row: int, column: int) -> None:
    pivot = 1.0 / table[row, column]
    for k in range(table.shape[1]):
        table[row, k] *= -pivot
    table[row, column] = pivot
    # A copy, of which the compiler knows that no other row changes it: this is where time goes.
    source = table[row].copy()
    for i in range(table.shape[0]):
        factor = table[i, column]
        if i != row and factor != 0.0:
            table[i, column] = 0.0
            _add(table[i], source, factor)


@subroutine
def _leaving_row(
    table: Floats, column: int, basic: Ints, artificial: int, smallest: float, tie: float
) -> int:
    """The row that first becomes negative as the variable of a column grows; -1 if none does.

    Of several the artificial variable's, which solves the problem, else that of the largest pivot.
    """
    last = table.shape[1] - 1
    least = np.inf
    for i in range(table.shape[0]):
        if table[i, column] < -smallest:
            least = min(least, table[i, last] / -table[i, column])
    found = -1
    for i in range(table.shape[0]):
        if table[i, column] < -smallest and table[i, last] / -table[i, column] <= least + tie:
            if basic[i] == artificial:
                return i
            if found < 0 or table[i, column] < table[found, column]:
                found = i
    return found


@kernel
def solve_complementarity(
    matrix: Floats, vector: Floats, limit: int, solution: Floats, smallest: float = SMALLEST,
    tie: float = TIE, spread: float = 0.0,
) -> bool:  # fmt: skip
    """Whether Lemke's method finds z; it may end at a ray or the cap.

    The covering vector is one of ones, or of numbers from 1 to 1 + ``spread``: another path.
    """
    n = vector.size
    artificial = 2 * n
    solution[:] = 0.0
    cover = 1.0 + spread * ((GOLDEN * np.arange(n)) % 1.0)
    row = int(np.argmin(vector / cover))
    if vector[row] >= 0.0:
        return True
    # Basic variables as functions of the others: of z (or w), of the artificial one, and constants
    table = np.empty((n, n + 2))
    for i in range(n):
        for k in range(n):
            table[i, k] = matrix[i, k]
        table[i, n], table[i, n + 1] = cover[i], vector[i]
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
        row = _leaving_row(table, column, basic, artificial, smallest, tie)
        if row < 0:
            return False
    return False


@kernel
def find_solution(matrix: Floats, vector: Floats, has_corners: bool, z: Floats) -> bool:
    """Whether z is found, among grains with corners on any of several paths."""
    if not has_corners:
        return solve_complementarity(matrix, vector, PIVOTS * z.size, z)
    for smallest, tie, spread in TRIES:
        if solve_complementarity(
            matrix, vector, PIVOTS * z.size, z, smallest, tie, spread
        ) and _is_proven(matrix, vector, z):
            return True
    return False


@subroutine
def _is_proven(matrix: Floats, vector: Floats, solution: Floats) -> bool:
    for k in range(vector.size):
        w = vector[k]
        for c in range(vector.size):
            w += matrix[k, c] * solution[c]
        if not abs(min(w, solution[k])) <= PROVEN:
            return False
    return True
