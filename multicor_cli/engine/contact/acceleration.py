"""The loop of the global solve: plain or accelerated Gauss–Seidel sweeps until the residual is small enough.

The accelerated method extrapolates the sweep as Nesterov does, y = x + ω (x − x_last), on impulses and velocities alike (they are
linear in each other). Friction makes the problem no minimization, and unguarded momentum cycles in sliding states. Four guards:

* the momentum restarts when the new change points against the extrapolation (gradient restart);
* it restarts when the change per sweep has grown to 1.5 times its lowest value since the last restart (any growth: 1.5 to 3 times
  as many sweeps in shear; growth by 2: more sweeps, and fewer errors left at the same residual; by 5 and more: some sliding states
  cycle). A solve that is still not done after 250 sweeps has errors of long wavelength, which only a long run of momentum removes:
  the change may then grow threefold (a bed of 116 layers from a cold start: 1,350 sweeps instead of 8,645; flows that need so many
  sweeps: up to a quarter more);
* near the tolerance momentum's own noise in a few contacts keeps the residual up: thirty sweeps with half of the normal
  corrections calm it, in very long solves only (earlier it would end them with more of the smooth errors left);
* where nothing has been gained for long, a cluster of contacts cycles: the loop goes through the escapes among its `MODES`,
  plain sweeps first, which end most of these cycles within a thousand sweeps.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from multicor_cli.engine.contact.residual import measure_residual
from multicor_cli.engine.contact.sweep import ONE, TWO, Relaxation, System, sweep
from multicor_cli.engine.jit.chunks import CHUNK
from multicor_cli.engine.jit.compile import kernel, parallel_kernel, prange
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.model.model import Floats


class Momentum(NamedTuple):
    """Last iterate, and last change of the velocities; shapes as in `System`.

    Attributes:
        velocity: Last velocities of the bodies; the last column as in `System`.
        change: Their last change; 0 in the last column.
        weight: Mass of each velocity [kg] (m, m, m/β; of walls M, M, J), 0 where nothing can be moved.
        impulse: Last impulses of the light contacts.
        general_impulse: Last impulses of the general contacts.
    """

    velocity: Floats
    change: Floats
    weight: Floats
    impulse: Floats
    general_impulse: Floats


# Slots of the memory that carries the loop from one slice of sweeps to the next.
SWEEPS, CHECKS, CONVERGED, RMS, MAXIMUM, ENERGY = range(6)  # for the caller
ACTIVE, THETA, FACTOR, LOWEST, BEST, BEST_AT, MODE, SINCE, ESCAPE, NEXT_CHECK = range(6, 16)  # for the loop
MEMORY = 16

FAST, CALM = 0, 1
MODES = np.array([[1.0, 1.0, 1.5], [0.5, 1.0, 1.2], [1.0, 1.0, 0.0], [0.25, 1.0, 1.2], [1.0, 0.3, 0.0]])
"""Rows: factors on the normal and tangential corrections; growth of the change per sweep over its lowest value since the last
restart, at which the momentum restarts (0: no momentum). The first two take turns; the others are escapes."""
LONG_FROM, LONG_TO, LONG_GROWTH = 250.0, 1000.0, 3.0  # sweeps between which `FAST` has another growth, unless it had to escape
CALM_BELOW, CALM_AFTER, CALM_FOR = 2.0, 1000.0, 30.0  # times the tolerance; sweeps in `FAST` before; sweeps in `CALM`
GAIN = 0.9  # the loop has gained if the change per sweep is lower by this factor
PATIENCE = 300.0  # sweeps without gain after which it tries another escape
ESCAPE_FOR = 1000.0  # sweeps after which an escape ends even if it still gains


@kernel
def start_memory(contact_count: int) -> Floats:
    """Memory of a loop that has not begun."""
    memory = np.zeros(MEMORY)
    memory[ACTIVE] = contact_count
    memory[THETA] = 1.0
    memory[LOWEST] = np.inf
    memory[BEST] = np.inf
    memory[ESCAPE] = CALM
    return memory


@kernel
def start_momentum(s: System) -> Momentum:
    """Momentum at rest, at the present iterate."""
    bodies = s.inverse.shape[0]
    weight = np.zeros((bodies, 4))
    for b in range(bodies):
        for d in range(3):
            inverse = s.velocity[b, 3]
            if inverse > 0.0:
                weight[b, d] = 1.0 / inverse if d < 2 else 1.0 / (inverse * s.spin_factor)
            elif s.inverse[b, d] > 0.0:
                weight[b, d] = 1.0 / s.inverse[b, d]
    velocity = s.velocity[:bodies].copy()
    return Momentum(velocity, np.zeros((bodies, 4)), weight, s.impulse.copy(), s.general_impulse.copy())


@formula
def inner_products(first: int, last: int, now: Floats, before: Floats, change: Floats, weight: Floats) -> tuple[float, float]:
    """Products of the new change of velocity with the last one and with itself in the metric of the kinetic energy [J].

    ``first`` and ``last`` are bodies, the arrays flat. One sum for each component: they do not wait for each other.
    """
    cross_x, cross_y, cross_s, square_x, square_y, square_s = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for b in range(first, last):
        q = np.uint64(4) * np.uint64(b)
        dx, dy, ds = now[q] - before[q], now[q + ONE] - before[q + ONE], now[q + TWO] - before[q + TWO]
        wx, wy, ws = weight[q] * dx, weight[q + ONE] * dy, weight[q + TWO] * ds
        cross_x += wx * change[q]
        cross_y += wy * change[q + ONE]
        cross_s += ws * change[q + TWO]
        square_x += wx * dx
        square_y += wy * dy
        square_s += ws * ds
    return cross_x + cross_y + cross_s, square_x + square_y + square_s


@parallel_kernel
def _products_on_threads(now: Floats, before: Floats, change: Floats, weight: Floats, partial: Floats) -> None:
    for chunk in prange(partial.shape[0]):
        last = min(before.size // 4, (chunk + 1) * CHUNK)
        partial[chunk, 0], partial[chunk, 1] = inner_products(chunk * CHUNK, last, now, before, change, weight)


@kernel
def _change_products(s: System, m: Momentum, parallel: bool) -> tuple[float, float]:
    """As `inner_products` over all bodies, in fixed chunks."""
    now, before, change, weight = s.velocity.reshape(-1), m.velocity.reshape(-1), m.change.reshape(-1), m.weight.reshape(-1)
    bodies = m.velocity.shape[0]
    chunks = max(1, -(-bodies // CHUNK))
    partial = np.empty((chunks, 2))
    if parallel:
        _products_on_threads(now, before, change, weight, partial)
    else:
        for chunk in range(chunks):
            last = min(bodies, (chunk + 1) * CHUNK)
            partial[chunk, 0], partial[chunk, 1] = inner_products(chunk * CHUNK, last, now, before, change, weight)
    cross, square = 0.0, 0.0
    for chunk in range(chunks):
        cross += partial[chunk, 0]
        square += partial[chunk, 1]
    return cross, square


@formula
def extrapolate_velocity(first: int, last: int, current: Floats, before: Floats, change: Floats, factor: float) -> None:
    """Record velocities and their change, and move them on by ``factor`` times the change; the arrays are flat."""
    for q in range(first, last):
        new = current[q]
        step = new - before[q]
        change[q] = step
        before[q] = new
        current[q] = new + factor * step


@formula
def extrapolate_impulse(first: int, last: int, current: Floats, before: Floats, factor: float) -> None:
    """As `extrapolate_velocity`, for impulses; their change is not needed."""
    for q in range(first, last):
        new = current[q]
        current[q] = new + factor * (new - before[q])
        before[q] = new


@parallel_kernel
def _extrapolate_on_threads(
    velocity: Floats, last_velocity: Floats, change: Floats, impulse: Floats, last_impulse: Floats, factor: float
) -> None:
    # Array by array: Numba drops stores of a parallel loop to an array that it only knows as part of a tuple.
    for chunk in prange(-(-last_velocity.size // (4 * CHUNK))):
        first, last = 4 * CHUNK * chunk, min(last_velocity.size, 4 * CHUNK * (chunk + 1))
        extrapolate_velocity(first, last, velocity, last_velocity, change, factor)
    for chunk in prange(-(-last_impulse.size // (4 * CHUNK))):
        first, last = 4 * CHUNK * chunk, min(last_impulse.size, 4 * CHUNK * (chunk + 1))
        extrapolate_impulse(first, last, impulse, last_impulse, factor)


@kernel
def _extrapolate(s: System, m: Momentum, factor: float, parallel: bool) -> None:
    """Record the new iterate and its change, and move on by ``factor`` times the change."""
    velocity, before, change = s.velocity.reshape(-1), m.velocity.reshape(-1), m.change.reshape(-1)
    impulse, last_impulse = s.impulse.reshape(-1), m.impulse.reshape(-1)
    if parallel:
        _extrapolate_on_threads(velocity, before, change, impulse, last_impulse, factor)
    else:
        extrapolate_velocity(0, before.size, velocity, before, change, factor)
        extrapolate_impulse(0, impulse.size, impulse, last_impulse, factor)
    extrapolate_impulse(0, 2 * s.general_impulse.shape[0], s.general_impulse.reshape(-1), m.general_impulse.reshape(-1), factor)


@kernel
def _switch(mode: float, memory: Floats) -> None:
    memory[MODE], memory[SINCE], memory[LOWEST] = mode, memory[SWEEPS], np.inf


@kernel
def _leave(mode: float, change: float, memory: Floats) -> None:
    """Switch to a mode with fresh momentum, and measure its gain from here."""
    memory[THETA], memory[FACTOR] = 1.0, 0.0
    memory[BEST], memory[BEST_AT] = change, memory[SWEEPS]
    _switch(mode, memory)


@kernel
def _choose_mode(change: float, tolerance: float, memory: Floats) -> None:
    """Calm down where the tolerance is near, escape where nothing has been gained for long, and come back."""
    if change < GAIN * memory[BEST]:
        memory[BEST], memory[BEST_AT] = change, memory[SWEEPS]
    in_mode, mode = memory[SWEEPS] - memory[SINCE], memory[MODE]
    is_stuck = memory[SWEEPS] - memory[BEST_AT] >= PATIENCE
    if mode > CALM:
        if is_stuck or in_mode >= ESCAPE_FOR:
            _leave(FAST, change, memory)
    elif is_stuck:
        memory[ESCAPE] += 1.0
        if memory[ESCAPE] == MODES.shape[0]:
            memory[ESCAPE] = CALM + 1
        _leave(memory[ESCAPE], change, memory)
    elif mode == CALM:
        if in_mode >= CALM_FOR:
            _switch(FAST, memory)
    elif change < CALM_BELOW * tolerance and in_mode >= CALM_AFTER:
        _switch(CALM, memory)


@kernel
def _growth(memory: Floats) -> float:
    """Growth of the change per sweep at which the momentum restarts now; 0: no momentum."""
    mode, sweeps = int(memory[MODE]), memory[SWEEPS]
    is_long = mode == FAST and memory[ESCAPE] == CALM and LONG_FROM <= sweeps < LONG_TO
    return LONG_GROWTH if is_long else MODES[mode, 2]


@kernel
def choose_factor(cross: float, square: float, change: float, growth: float, memory: Floats) -> float:
    """The factor ω of the next extrapolation, with the two restarts."""
    if change > growth * memory[LOWEST] or memory[FACTOR] * cross > square:
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
        local: Kind of local solve, see `multicor_cli.engine.contact.sweep`.
        accelerated: Extrapolate, or sweep plainly.
        parallel: Use several threads; the result is the same.
        limit: Number of sweeps at which to return.
        is_last: Whether the caller gives up at ``limit``: the residual is then evaluated there.
        tolerance: Tolerances of rms and maximum [m/s] and energy [J], shape ``(3,)``.
        memory: From `start_memory`, carried from one call to the next. **Modified.**
        partial: Work space, shape ``(tiles,)``.
    """
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
            _choose_mode(change, tolerance[0], memory)
            growth = _growth(memory)
            factor = 0.0
            if growth > 0.0:
                cross, square = _change_products(s, m, parallel)
                factor = choose_factor(cross, square, change, growth, memory)
            memory[FACTOR] = factor
            _extrapolate(s, m, factor, parallel)
