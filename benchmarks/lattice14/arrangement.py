"""The 14 grains: where they are, who touches whom, and the exact solution with one temperature per
grain.

Lengths are in radii, temperatures in θ = (T − T_cold)/(T_hot − T_cold), times in s = t H/C (H:
conductance of a contact, C: heat capacity of a grain) unless a name says otherwise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

ROWS = (2, 3, 4, 5)
"""Grains per row, from the top. The paper does not state it; this page's README says why this
one."""

WATCHED = (0, 4, 13)
"""Indices of the paper's grains 1, 5 and 14."""

HOT, COLD = 100.0, 20.0
"""Initial temperature of grain 1 and of the others [°C]."""

_TOUCHING = 1e-9  # of a radius


@dataclass(frozen=True)
class Contact:
    """Two grains that touch.

    Attributes:
        i: The one with the smaller index.
        j: The other.
        direction: Direction from ``i`` to ``j`` in units of 60°; from ``j`` to ``i`` it is
            ``direction + 3`` modulo 6.
    """

    i: int
    j: int
    direction: int


def place_rows(rows: tuple[int, ...] = ROWS) -> Floats:
    """Centers of touching grains of radius 1 in rows, each row half a diameter beside its neighbor;
    shape ``(sum(rows), 2)``.
    """
    return np.array(
        [
            (2.0 * k - count, -np.sqrt(3.0) * row)
            for row, count in enumerate(rows)
            for k in range(count)
        ]
    )


def find_contacts(centers: Floats) -> list[Contact]:
    """All pairs of grains of radius 1 that touch, in ascending order."""
    contacts = []
    for j in range(len(centers)):
        for i in range(j):
            dx, dy = centers[j] - centers[i]
            if abs(np.hypot(dx, dy) - 2.0) < _TOUCHING:
                contacts.append(Contact(i, j, round(np.degrees(np.arctan2(dy, dx)) / 60.0) % 6))
    return contacts


def start_values(count: int) -> Floats:
    """θ at the start: 1 in grain 1, 0 in the others."""
    start = np.zeros(count)
    start[0] = 1.0
    return start


def solve_lumped(contacts: list[Contact], count: int, times: Floats) -> Floats:
    """Exact θ of grains with one temperature each: dθ_i/ds = Σ_j (θ_j − θ_i), by the eigenvectors
    of the network.

    Args:
        contacts: Who touches whom.
        count: Number of grains.
        times: s, shape ``(m,)``.

    Returns:
        θ, shape ``(m, count)``.
    """
    network = np.zeros((count, count))
    for contact in contacts:
        i, j = contact.i, contact.j
        network[[i, j], [i, j]] += 1.0
        network[[i, j], [j, i]] -= 1.0
    rates, modes = np.linalg.eigh(network)
    weights = modes.T @ start_values(count)
    return np.asarray((np.exp(-np.outer(times, rates)) * weights) @ modes.T)


def to_celsius(theta: Floats) -> Floats:
    """T [°C] of θ."""
    return COLD + (HOT - COLD) * theta
