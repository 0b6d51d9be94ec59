"""Gauss–Seidel sweeps without momentum: forward, symmetric, over-relaxed."""

from __future__ import annotations

import numpy as np

from methods.operators import Log, copy_impulses, kernel, record, sweep_backward
from multicor_cli.engine.contact.sweep import EXACT, Relaxation, System, sweep
from multicor_cli.model.model import Floats


@kernel
def run_gauss_seidel(s: System, iterations: int, parameters: Floats, log: Log) -> int:
    """Sweeps; parameters: factor ω on the corrections of forward sweeps, and 1 if every second
    sweep goes backward (else 0).
    """
    way, alternates = Relaxation(parameters[0], parameters[0], 0.0), parameters[1] > 0.0
    before, partial = copy_impulses(s), np.empty((s.tile_start.size - 1, 2))
    for number in range(iterations):
        if alternates and number % 2 == 1:
            sweep_backward(s, before)
        else:
            sweep(s, before, EXACT, way, False, partial)
        if record(s, log, number, number + 1.0):
            return number + 1
    return iterations
