"""Sweeps with Nesterov's momentum by the program's own rules, in variants, to find out what matters
about them.

Parameters, in this order:

0. growth of the change per sweep over its lowest value since the last restart at which the momentum
   restarts;
1. 1 if every iteration sweeps forward and backward (else 0);
2. sweeps between two looks at contacts that carry nothing and do not close (these are left out
   meanwhile); 0 leaves none out;
3. inner sweeps: how often each tile is relaxed before the next one.
"""

from __future__ import annotations

import numpy as np

from methods.operators import Log, copy_impulses, kernel, record, sweep_backward
from multicor_cli.engine.contact.acceleration import Momentum, move_on, start_loop
from multicor_cli.engine.contact.sweep import (
    EXACT,
    Before,
    Relaxation,
    System,
    relax_general,
    relax_lane,
    sweep,
)
from multicor_cli.engine.contact.vector_sweep import relax_batches
from multicor_cli.engine.jit.vectors import LANES
from multicor_cli.model.columns import BIAS, FIRST, NORMAL, NX, NY, SECOND, X, Y
from multicor_cli.model.model import Floats, Ints


@kernel
def _relax_generals(s: System, before: Before, factor: float) -> tuple[float, float]:
    """The general contacts as in the program's sweep."""
    return relax_general(
        s.velocity, s.inverse, s.general_pair, s.general_frame, s.general_lever, s.general_impulse,
        before.general_impulse,
        True, factor, s.cell,
    )  # fmt: skip


@kernel
def _sweep_tiles(
    s: System, before: Before, spare: Before, factor: float, inner: int
) -> tuple[float, float]:
    """Each tile several times; the contacts beyond the colors and the general ones once. Returns
    the squares of the last turn, and where the corrections of the first point, as `sweep` does.

    Impulses are extrapolated by ``factor`` in the first turn; in the others ``spare`` takes the
    last ones.
    """
    velocity, pair, frame, impulse = (
        s.velocity.reshape(-1),
        s.pair.reshape(-1),
        s.frame.reshape(-1),
        s.impulse.reshape(-1),
    )
    last, scratch, start, beta = (
        before.impulse.reshape(-1),
        spare.impulse.reshape(-1),
        s.tile_start,
        s.spin_factor,
    )
    total, ahead = _relax_generals(s, before, factor)
    for t in range(start.size - 1):
        square, onward = relax_batches(
            start[t], start[t + 1], velocity, pair, frame, impulse, last, beta, 1.0, 1.0, factor
        )
        for _ in range(1, inner if t < s.color_start[-1] else 1):
            square, _ = relax_batches(
                start[t], start[t + 1], velocity, pair, frame, impulse, scratch, beta, 1.0, 1.0, 0.0
            )
        total += square
        ahead += onward
    return total, ahead


@kernel
def _sweep_some(s: System, before: Before, factor: float, some: Ints) -> tuple[float, float]:
    """As the program's sweep, over the diagonal contacts in some lanes and all general ones."""
    velocity, pair, frame, impulse = (
        s.velocity.reshape(-1),
        s.pair.reshape(-1),
        s.frame.reshape(-1),
        s.impulse.reshape(-1),
    )
    last, way = before.impulse.reshape(-1), Relaxation(1.0, 1.0, factor)
    total, ahead = _relax_generals(s, before, factor)
    for lane in some:
        square, onward = relax_lane(
            np.uint64(lane), velocity, pair, frame, impulse, last, s.spin_factor, EXACT, way
        )
        total += square
        ahead += onward
    return total, ahead


@kernel
def _list_near(s: System, before: Before, near: Ints) -> int:
    """List the lanes of contacts that carry an impulse, did before the last sweep or would close
    soon; returns their number.

    All others have no impulse to extrapolate.
    """
    velocity, pair, frame = s.velocity, s.pair, s.frame
    count = 0
    for q in range(s.slot.shape[0]):
        for lane in range(LANES):
            i, j = pair[q, FIRST, lane] // 4, pair[q, SECOND, lane] // 4
            dx, dy = velocity[i, X] - velocity[j, X], velocity[i, Y] - velocity[j, Y]
            u_n = dx * frame[q, NX, lane] + dy * frame[q, NY, lane]
            carries = s.impulse[q, NORMAL, lane] > 0.0 or before.impulse[q, NORMAL, lane] > 0.0
            if carries or u_n + 0.5 * frame[q, BIAS, lane] < 0.0:
                near[count] = LANES * q + lane
                count += 1
    return count


@kernel
def run_momentum(s: System, iterations: int, parameters: Floats, log: Log) -> int:
    """The sweeps with momentum."""
    growth, goes_back, period, inner = (
        parameters[0],
        parameters[1] > 0.0,
        int(parameters[2]),
        int(parameters[3]),
    )
    m = Momentum(s.velocity[: s.inverse.shape[0]].copy(), copy_impulses(s))
    memory, partial = start_loop(1), np.empty((s.tile_start.size - 1, 2))
    spare, near, loop = copy_impulses(s), np.empty(s.slot.size, np.int32), memory[0]
    count, work = 0, 0.0
    for number in range(iterations):
        factor = loop["factor"]
        if period > 0 and number % period > 0:
            square, onward = _sweep_some(s, m.before, factor, near[:count])
            work += count / max(1, s.contacts - s.general_pair.shape[0])
        else:
            if inner > 1:
                square, onward = _sweep_tiles(s, m.before, spare, factor, inner)
            else:
                way = Relaxation(1.0, 1.0, factor)
                square, onward = sweep(s, m.before, EXACT, way, False, partial)
            work += inner
            count = _list_near(s, m.before, near) if period > 0 else 0
        if goes_back:
            square = sweep_backward(s, spare)
            work += 1.0
        if record(s, log, number, work):
            return number + 1
        move_on(s, m, np.sqrt(square), onward, growth, loop, False)
    return iterations
