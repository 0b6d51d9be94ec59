"""The loop of the global solve: plain or accelerated Gauss–Seidel sweeps until the residual is small enough.

The accelerated method extrapolates the sweep as Nesterov does, y = x + ω (x − x_last), on impulses and velocities alike (they are
linear in each other). Friction makes the problem no minimization, and unguarded momentum cycles in sliding states. Three guards
keep it no slower than plain sweeps. The momentum restarts when the new change points against the extrapolation (gradient
restart), and when the change per sweep has grown to `GROWTH` times its lowest value since the last restart. (Restarting at any
growth costs 1.5 to 3 times as many sweeps in shear; at growth by 5 and more, some sliding states cycle.) And where a cluster of
contacts cycles under exact local solves, which plain sweeps do too, the loop goes through other `MODES`, with partial
corrections and without momentum, that break such cycles.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from multicor_cli.kernels.jit import CHUNK, kernel, parallel_kernel, prange
from multicor_cli.kernels.residual import measure_residual
from multicor_cli.kernels.sweep import Relaxation, System, sweep
from multicor_cli.state.model import Floats


class Momentum(NamedTuple):
    """Last iterate, and last change of the velocities; shapes as in `System`, velocities without the last column."""

    velocity: Floats
    velocity_change: Floats
    impulse: Floats
    general_impulse: Floats


# Slots of the memory that carries the loop from one slice of sweeps to the next.
SWEEPS, CHECKS, CONVERGED, RMS, MAXIMUM, ENERGY = range(6)  # for the caller
ACTIVE, THETA, FACTOR, LOWEST, BEST, BEST_AT, MODE, NEXT_CHECK = range(6, 14)  # for the loop
MEMORY = 14

GROWTH = 2.0  # of the change per sweep over its lowest value since the last restart
GAIN = 0.9  # a mode has gained if the change per sweep is lower by this factor
PATIENCE = 500.0  # sweeps without gain after which the next mode is tried
MODES = np.array([[1.0, 1.0, 1.0], [1.0, 0.3, 1.0], [1.0, 0.3, 0.0], [0.5, 1.0, 0.0]])
"""Rows: factors on the normal and tangential corrections, and whether there is momentum."""


@kernel
def start_memory(contact_count: int) -> Floats:
    """Memory of a loop that has not begun."""
    memory = np.zeros(MEMORY)
    memory[ACTIVE] = contact_count
    memory[THETA] = 1.0
    memory[LOWEST] = np.inf
    memory[BEST] = np.inf
    return memory


@kernel
def _inner_products(first: int, last: int, s: System, m: Momentum) -> tuple[float, float]:
    """Products of the new change of velocity with the last one and with itself in the metric of the kinetic energy [J]."""
    cross, square = 0.0, 0.0
    for b in range(first, last):
        inverse = s.velocity[b, 3]
        for d in range(3):
            weight = 0.0
            if inverse > 0.0:
                weight = 1.0 / inverse if d < 2 else 1.0 / (inverse * s.spin_factor)
            elif s.inverse[b, d] > 0.0:
                weight = 1.0 / s.inverse[b, d]
            new = s.velocity[b, d] - m.velocity[b, d]
            cross += weight * new * m.velocity_change[b, d]
            square += weight * new * new
    return cross, square


@parallel_kernel
def _inner_products_of_chunks(s: System, m: Momentum, partial: Floats) -> None:
    for chunk in prange(partial.shape[0]):
        last = min(m.velocity.shape[0], (chunk + 1) * CHUNK)
        partial[chunk, 0], partial[chunk, 1] = _inner_products(chunk * CHUNK, last, s, m)


@kernel
def _change_products(s: System, m: Momentum, parallel: bool) -> tuple[float, float]:
    """As `_inner_products` over all bodies, in fixed chunks."""
    bodies = m.velocity.shape[0]
    chunks = max(1, -(-bodies // CHUNK))
    partial = np.empty((chunks, 2))
    if parallel:
        _inner_products_of_chunks(s, m, partial)
    else:
        for chunk in range(chunks):
            last = min(bodies, (chunk + 1) * CHUNK)
            partial[chunk, 0], partial[chunk, 1] = _inner_products(chunk * CHUNK, last, s, m)
    cross, square = 0.0, 0.0
    for chunk in range(chunks):
        cross += partial[chunk, 0]
        square += partial[chunk, 1]
    return cross, square


@kernel
def _extrapolate_velocity(current: Floats, last: Floats, change: Floats, b: int, factor: float) -> None:
    """Record the new velocity of a body and its change, and move it on by ``factor`` times the change."""
    for d in range(3):
        new = current[b, d]
        step = new - last[b, d]
        change[b, d] = step
        last[b, d] = new
        current[b, d] = new + factor * step


@kernel
def _extrapolate_impulse(current: Floats, last: Floats, k: int, factor: float) -> None:
    """As `_extrapolate_velocity`, for an impulse; nobody asks for its change."""
    for d in range(2):
        new = current[k, d]
        current[k, d] = new + factor * (new - last[k, d])
        last[k, d] = new


@parallel_kernel
def _extrapolate_on_threads(
    velocity: Floats, last_velocity: Floats, change: Floats, impulse: Floats, last_impulse: Floats, factor: float
) -> None:
    # Array by array: Numba drops stores of a parallel loop to an array that it only knows as part of a tuple.
    for b in prange(last_velocity.shape[0]):
        _extrapolate_velocity(velocity, last_velocity, change, b, factor)
    for k in prange(last_impulse.shape[0]):
        _extrapolate_impulse(impulse, last_impulse, k, factor)


@kernel
def _extrapolate(s: System, m: Momentum, factor: float, parallel: bool) -> None:
    """Record the new iterate and its change, and move on by ``factor`` times the change."""
    if parallel:
        _extrapolate_on_threads(s.velocity, m.velocity, m.velocity_change, s.impulse, m.impulse, factor)
    else:
        for b in range(m.velocity.shape[0]):
            _extrapolate_velocity(s.velocity, m.velocity, m.velocity_change, b, factor)
        for k in range(m.impulse.shape[0]):
            _extrapolate_impulse(s.impulse, m.impulse, k, factor)
    for g in range(m.general_impulse.shape[0]):
        _extrapolate_impulse(s.general_impulse, m.general_impulse, g, factor)


@kernel
def _remember(s: System, m: Momentum) -> None:
    """Start the momentum at the present iterate."""
    for b in range(m.velocity.shape[0]):
        for d in range(3):
            m.velocity[b, d] = s.velocity[b, d]
            m.velocity_change[b, d] = 0.0
    for k in range(m.impulse.shape[0]):
        for d in range(2):
            m.impulse[k, d] = s.impulse[k, d]
    for g in range(m.general_impulse.shape[0]):
        for d in range(2):
            m.general_impulse[g, d] = s.general_impulse[g, d]


@kernel
def _watch_gain(change: float, memory: Floats) -> None:
    """Go to the next mode if this one has not gained anything for long."""
    if change < GAIN * memory[BEST]:
        memory[BEST] = change
        memory[BEST_AT] = memory[SWEEPS]
    elif memory[SWEEPS] - memory[BEST_AT] >= PATIENCE:
        memory[MODE] = (memory[MODE] + 1.0) % MODES.shape[0]
        memory[BEST] = change
        memory[BEST_AT] = memory[SWEEPS]
        memory[THETA] = 1.0
        memory[FACTOR] = 0.0
        memory[LOWEST] = np.inf


@kernel
def _choose_factor(cross: float, square: float, change: float, memory: Floats) -> float:
    """The factor ω of the next extrapolation, with the two restarts."""
    if change > GROWTH * memory[LOWEST] or memory[FACTOR] * cross > square:
        memory[THETA] = 1.0
        memory[LOWEST] = change
    memory[LOWEST] = min(memory[LOWEST], change)
    theta = memory[THETA]
    following = 0.5 * theta * (np.sqrt(theta * theta + 4.0) - theta)
    memory[THETA] = following
    return theta * (1.0 - theta) / (theta * theta + following)


@kernel
def _is_converged(s: System, tolerance: Floats, memory: Floats, parallel: bool) -> bool:
    """Evaluate the residual; decides alone when the loop ends."""
    rms, largest, energy, active = measure_residual(s, parallel)
    memory[CHECKS] += 1.0
    memory[RMS], memory[MAXIMUM], memory[ENERGY] = rms, largest, energy
    memory[ACTIVE] = max(1.0, active)
    excess = max(rms / tolerance[0], largest / tolerance[1], np.sqrt(energy / tolerance[2]))
    # A residual far above its tolerance is not worth looking at again soon.
    memory[NEXT_CHECK] = memory[SWEEPS] + (2.0 if excess < 1.5 else 4.0 if excess < 4.0 else 8.0)
    if rms <= tolerance[0] and largest <= tolerance[1] and energy <= tolerance[2]:
        memory[CONVERGED] = 1.0
        return True
    return False


@kernel
def iterate(
    s: System,
    m: Momentum,
    local: int,
    accelerated: bool,
    parallel: bool,
    limit: int,
    is_last: bool,
    tolerance: Floats,
    memory: Floats,
    partial: Floats,
) -> None:
    """Sweep until converged, or until ``limit`` sweeps have been done in all.

    Args:
        s: The problem. **Impulses and velocities modified.**
        m: Momentum, carried from one call to the next. **Modified.**
        local: Kind of local solve, see `multicor_cli.kernels.sweep`.
        accelerated: Extrapolate, or sweep plainly.
        parallel: Use several threads; the result is the same.
        limit: Number of sweeps at which to return.
        is_last: Whether the caller gives up at ``limit``: the residual is then evaluated there.
        tolerance: Tolerances of rms and maximum [m/s] and energy [J], shape ``(3,)``.
        memory: From `start_memory`, carried from one call to the next. **Modified.**
        partial: Work space, shape ``(tiles,)``.
    """
    if memory[SWEEPS] == 0.0:
        _remember(s, m)
    while memory[SWEEPS] < limit:
        mode = int(memory[MODE])
        relaxation = Relaxation(MODES[mode, 0], MODES[mode, 1])
        change = np.sqrt(sweep(s, local, relaxation, parallel, partial) / memory[ACTIVE])
        memory[SWEEPS] += 1.0
        # The change per sweep is cheap; the residual is evaluated only where it may pass.
        if change <= 2.0 * tolerance[0] and memory[SWEEPS] >= memory[NEXT_CHECK]:
            if _is_converged(s, tolerance, memory, parallel):
                return
        elif is_last and memory[SWEEPS] == limit:
            _is_converged(s, tolerance, memory, parallel)
            return
        if accelerated:
            _watch_gain(change, memory)
            factor = 0.0
            if MODES[mode, 2] > 0.0:
                cross, square = _change_products(s, m, parallel)
                factor = _choose_factor(cross, square, change, memory)
            memory[FACTOR] = factor
            _extrapolate(s, m, factor, parallel)
