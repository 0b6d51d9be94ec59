"""The loop of the global solve: plain or accelerated Gauss–Seidel sweeps until the residual is small enough.

EXPERIMENTAL DRIVER (being tuned).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from multicor_cli.kernels.jit import kernel
from multicor_cli.kernels.residual import measure_residual
from multicor_cli.kernels.sweep import System, sweep
from multicor_cli.state.model import Floats


class Momentum(NamedTuple):
    """Last iterate and last change of all unknowns, for the extrapolation; shapes as in `System`."""

    velocity: Floats
    velocity_change: Floats
    impulse: Floats
    impulse_change: Floats
    general_impulse: Floats
    general_change: Floats


# Slots of the memory that carries the loop from one slice of sweeps to the next.
THETA, SWEEPS, CHECKS, GATE, RMS, MAXIMUM, ENERGY, CONVERGED, FACTOR, PLAIN, LAST, BEST, SPAN = range(13)
MEMORY = 16


@kernel
def start_memory(memory: Floats) -> None:
    memory[:] = 0.0
    memory[THETA] = 1.0
    memory[GATE] = 1.0
    memory[LAST] = np.inf
    memory[BEST] = np.inf
    memory[SPAN] = 4.0


@kernel
def _dots(s: System, m: Momentum) -> tuple[float, float]:
    """Inner products of the new change with the last one and itself, in the metric of the kinetic energy."""
    cross, square = 0.0, 0.0
    for b in range(m.velocity.shape[0]):
        inverse = s.velocity[b, 3]
        for d in range(3):
            if inverse > 0.0:
                w = 1.0 / inverse
                if d == 2:
                    w /= s.spin_factor
            elif s.inverse[b, d] > 0.0:
                w = 1.0 / s.inverse[b, d]
            else:
                continue
            new = s.velocity[b, d] - m.velocity[b, d]
            cross += w * new * m.velocity_change[b, d]
            square += w * new * new
    return cross, square


@kernel
def _shift(current: Floats, last: Floats, change: Floats, columns: int, factor: float) -> None:
    for r in range(last.shape[0]):
        for d in range(columns):
            new = current[r, d]
            change[r, d] = new - last[r, d]
            last[r, d] = new
            current[r, d] = new + factor * change[r, d]


@kernel
def iterate(
    s: System,
    m: Momentum,
    local: int,
    accelerated: bool,
    parallel: bool,
    limit: int,
    tolerance: Floats,
    memory: Floats,
    partial: Floats,
    variant: int,
) -> None:
    """Sweep until converged or ``limit`` sweeps in total. tolerance: rms [m/s], max [m/s], energy [J]."""
    active = max(1.0, float(s.pair.shape[0] + s.general_pair.shape[0]))
    if memory[SWEEPS] == 0.0:
        m.velocity[:, :] = s.velocity[: m.velocity.shape[0], :3]
        m.impulse[:, :] = s.impulse
        m.general_impulse[:, :] = s.general_impulse
        m.velocity_change[:, :] = 0.0
        m.impulse_change[:, :] = 0.0
        m.general_change[:, :] = 0.0
    factor = memory[FACTOR]
    wait = 0
    while memory[SWEEPS] < limit:
        change = np.sqrt(sweep(s, local, parallel, partial) / active)
        memory[SWEEPS] += 1.0
        wait -= 1
        if change < tolerance[0] * memory[GATE] and wait <= 0:
            rms, largest, energy, count = measure_residual(s, parallel)
            active = max(1.0, count)
            memory[CHECKS] += 1.0
            memory[RMS], memory[MAXIMUM], memory[ENERGY] = rms, largest, energy
            if rms <= tolerance[0] and largest <= tolerance[1] and energy <= tolerance[2]:
                memory[CONVERGED] = 1.0
                return
            wait = 4
        if not accelerated:
            continue
        cross, square = _dots(s, m)
        if memory[PLAIN] > 0:
            memory[PLAIN] -= 1
            factor = 0.0
            memory[THETA] = 1.0
        else:
            restart = False
            if factor * cross > square:
                restart = True
            if variant >= 1 and change > memory[LAST] and memory[THETA] < 1.0 and factor > 0:
                restart = True
            if restart:
                memory[THETA] = 1.0
            theta = memory[THETA]
            new_theta = 0.5 * (-theta * theta + theta * np.sqrt(theta * theta + 4.0))
            factor = theta * (1.0 - theta) / (theta * theta + new_theta)
            memory[THETA] = new_theta
        memory[LAST] = change
        _shift(s.velocity, m.velocity, m.velocity_change, 3, factor)
        _shift(s.impulse, m.impulse, m.impulse_change, 2, factor)
        _shift(s.general_impulse, m.general_impulse, m.general_change, 2, factor)
    memory[FACTOR] = factor
