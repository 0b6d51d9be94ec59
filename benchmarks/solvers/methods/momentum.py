"""Sweeps with Nesterov's momentum by the program's own rules, in variants, to find out what matters about them.

Parameters, in this order:

0. growth of the change per sweep over its lowest value since the last restart at which the momentum restarts;
1. 1 if every iteration sweeps forward and backward (else 0);
2. sweeps between two looks at contacts that carry nothing and do not close (these are left out meanwhile); 0 leaves none out;
3. inner sweeps: how often each tile is relaxed before the next one.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from methods.operators import Log, kernel, record, relax_general, relax_light, sweep_backward
from multicor_cli.engine.contact.acceleration import (
    Momentum,
    choose_factor,
    extrapolate_impulse,
    extrapolate_velocity,
    inner_products,
    start_loop,
    start_momentum,
)
from multicor_cli.engine.contact.sweep import EXACT, Relaxation, System, sweep
from multicor_cli.model.model import Floats, Ints


@kernel
def _sweep_tiles(s: System, inner: int) -> float:
    """Each tile several times; the contacts beyond the tiles and the general ones once. Returns the squares of the last turn."""
    velocity, pair, frame, impulse = s.velocity.reshape(-1), s.pair.reshape(-1), s.frame.reshape(-1), s.impulse.reshape(-1)
    tile_start, beta, way, total = s.tile_start, s.spin_factor, Relaxation(1.0, 1.0), 0.0
    for t in range(tile_start.size - 1):
        for _ in range(inner):
            square = 0.0
            for k in range(tile_start[t], tile_start[t + 1]):
                square += relax_light(np.uint64(k), velocity, pair, frame, impulse, beta, EXACT, way)
        total += square
    for k in range(tile_start[-1], s.pair.shape[0]):
        total += relax_light(np.uint64(k), velocity, pair, frame, impulse, beta, EXACT, way)
    for g in range(s.general_pair.shape[0]):
        total += relax_general(g, s, EXACT)
    return total


@kernel
def _sweep_some(s: System, some: Ints) -> float:
    """As the program's sweep, over some light contacts and all general ones."""
    velocity, pair, frame, impulse = s.velocity.reshape(-1), s.pair.reshape(-1), s.frame.reshape(-1), s.impulse.reshape(-1)
    beta, way, total = s.spin_factor, Relaxation(1.0, 1.0), 0.0
    for k in some:
        total += relax_light(np.uint64(k), velocity, pair, frame, impulse, beta, EXACT, way)
    for g in range(s.general_pair.shape[0]):
        total += relax_general(g, s, EXACT)
    return total


@kernel
def _list_near(s: System, near: Ints) -> int:
    """List the light contacts that carry an impulse or would close soon; returns their number."""
    velocity, pair, frame, impulse = s.velocity, s.pair, s.frame, s.impulse
    count = 0
    for k in range(pair.shape[0]):
        i, j = pair[k, 0], pair[k, 1]
        u_n = (velocity[i, 0] - velocity[j, 0]) * frame[k, 0] + (velocity[i, 1] - velocity[j, 1]) * frame[k, 1]
        if impulse[k, 0] > 0.0 or u_n + 0.5 * frame[k, 3] < 0.0:
            near[count] = k
            count += 1
    return count


@kernel
def _move_on(s: System, m: Momentum, change: float, growth: float, loop: Any) -> None:
    """Choose the factor and extrapolate, as the program does on one thread."""
    velocity, before, last_change = s.velocity.reshape(-1), m.velocity.reshape(-1), m.change.reshape(-1)
    cross, square = inner_products(0, m.velocity.shape[0], velocity, before, last_change, m.weight.reshape(-1))
    factor = choose_factor(cross, square, change, growth, loop)
    loop["factor"] = factor
    extrapolate_velocity(0, before.size, velocity, before, last_change, factor)
    extrapolate_impulse(0, s.impulse.size, s.impulse.reshape(-1), m.impulse.reshape(-1), factor)
    general = s.general_impulse.reshape(-1)
    extrapolate_impulse(0, general.size, general, m.general_impulse.reshape(-1), factor)


@kernel
def run_momentum(s: System, iterations: int, parameters: Floats, log: Log) -> int:
    """The sweeps with momentum."""
    growth, goes_back, period, inner = parameters[0], parameters[1] > 0.0, int(parameters[2]), int(parameters[3])
    m, memory, partial = start_momentum(s), start_loop(1), np.empty(s.tile_start.size - 1)
    near = np.empty(s.pair.shape[0], np.int32)
    count, work = 0, 0.0
    for number in range(iterations):
        if period > 0 and number % period > 0:
            square = _sweep_some(s, near[:count])
            work += count / max(1, s.pair.shape[0])
        else:
            square = _sweep_tiles(s, inner) if inner > 1 else sweep(s, EXACT, Relaxation(1.0, 1.0), False, partial)
            work += inner
            count = _list_near(s, near) if period > 0 else 0
        if goes_back:
            square = sweep_backward(s)
            work += 1.0
        if record(s, log, number, work):
            return number + 1
        _move_on(s, m, np.sqrt(square), growth, memory[0])
    return iterations
