"""The yardstick for everything but the solve: work of the same kind in code that is not part of the product.

What a step does besides its sweeps is a hundred calls of short kernels and array functions from Python. How
fast a machine does that has little to do with how fast it sweeps, so it has a yardstick of its own: grains are moved, sorted into
cells, paired with their neighbors, and gather from their pairs; and small kernels are called. Never make this faster or slower:
what is recorded is measured in it.
"""

from __future__ import annotations

import math
import time

import numpy as np

from multicor_cli.engine.jit.compile import kernel
from multicor_cli.model.model import Floats, Ints

_CALLS = 120  # in one step, whatever the number of grains
_FEW = 64  # grains of a call
_NEIGHBORS = 5  # cells whose grains are looked at: the own one and half of those around it


class ReferenceStep:
    """A step of ``n`` grains of a square lattice, shaken."""

    def __init__(self, grains: int) -> None:
        """Place the grains; always the same ones."""
        self._side = max(4, round(math.sqrt(grains)))
        count = self._side * self._side
        shake = np.random.Philox(1).random_raw(2 * count).astype(np.float64).reshape(count, 2) / 2.0**64
        corner = np.column_stack([np.arange(count) % self._side, np.arange(count) // self._side])
        self._position, self._velocity = corner + 0.1 + 0.8 * shake, shake - 0.5
        self._share = grains / count
        self.take()  # what has to be compiled is

    def take(self) -> float:
        """One step; returns what keeps it from being left out."""
        total = 0.0
        for number in range(_CALLS):
            total += float(self._move(number, _FEW)[0, 0])
        middle = self._move(_CALLS, len(self._position))
        first, order = np.zeros(self._side**2 + 1, np.int32), np.empty(len(middle), np.int32)
        _sort(middle, self._side, first, order)
        pair, gap = np.empty((6 * len(middle), 2), np.int32), np.empty(6 * len(middle))
        found = _measure(middle, self._side, first, order, pair, gap)
        near = np.flatnonzero(gap[:found] < 0.4)
        pull = np.zeros((len(middle), 2))
        _gather(middle, pair[near], gap[near], pull)
        return total + float((pull * pull).sum())

    def _move(self, number: int, count: int) -> Floats:
        middle = np.empty((count, 2))
        _move(self._position[:count], self._velocity[:count], 1e-3 * number, float(self._side), middle)
        if not np.isfinite(middle).all():
            raise FloatingPointError
        return middle

    def seconds(self) -> float:
        """Time of a step, as if there were exactly the wanted number of grains [s]."""
        started = time.thread_time()
        self.take()
        return self._share * (time.thread_time() - started)


@kernel
def _move(position: Floats, velocity: Floats, dt: float, side: float, middle: Floats) -> None:
    for i in range(len(position)):
        for axis in range(2):
            x = position[i, axis] + dt * velocity[i, axis]
            middle[i, axis] = min(max(x, 0.0), side - 1e-9)


@kernel
def _sort(position: Floats, side: int, first: Ints, order: Ints) -> None:
    for i in range(len(position)):
        first[int(position[i, 1]) * side + int(position[i, 0]) + 1] += 1
    for cell in range(side * side):
        first[cell + 1] += first[cell]
    fill = first[:-1].copy()
    for i in range(len(position)):
        cell = int(position[i, 1]) * side + int(position[i, 0])
        order[fill[cell]] = i
        fill[cell] += 1


@kernel
def _measure(position: Floats, side: int, first: Ints, order: Ints, pair: Ints, gap: Floats) -> int:
    found = 0
    for cell in range(side * side):
        column, row = cell % side, cell // side
        for k in range(_NEIGHBORS):
            across, up = (0, 0) if k == 0 else (1, 0) if k == 1 else (k - 3, 1)
            if not 0 <= column + across < side or row + up >= side:
                continue
            other = cell + across + side * up
            for a in range(first[cell], first[cell + 1]):
                for b in range(a + 1 if k == 0 else first[other], first[other + 1]):
                    i, j = order[a], order[b]
                    x, y = position[j, 0] - position[i, 0], position[j, 1] - position[i, 1]
                    if found < len(gap):
                        pair[found, 0], pair[found, 1], gap[found] = i, j, np.sqrt(x * x + y * y) - 0.8
                        found += 1
    return found


@kernel
def _gather(position: Floats, pair: Ints, gap: Floats, pull: Floats) -> None:
    for k in range(len(gap)):
        i, j = pair[k]
        length = gap[k] + 0.8 + 1e-9
        for axis in range(2):
            unit = (position[j, axis] - position[i, axis]) / length
            pull[i, axis] += gap[k] * unit
            pull[j, axis] -= gap[k] * unit
