"""The explicit integrator: Euler's forward rule, as in the paper, in sub-steps short enough to be stable."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from multicor_cli.engine.heat.flow import Flow, stop_if_asked
from multicor_cli.engine.heat.rates import Network, total_conductance
from multicor_cli.engine.heat.walls import WallValues
from multicor_cli.model.model import Floats

MOST = 100_000_000
"""Most sub-steps of a step; only absurdly high temperatures, which radiate absurdly, would need more."""


def advance_explicit(
    net: Network,
    capacity: Floats,
    temperature: Floats,
    walls: WallValues,
    source: Floats,
    dt: float,
    limit: float,
    should_stop: Callable[[], bool] | None = None,
) -> Flow:
    """Heat that flows within ``dt``, in sub-steps with Δt ΣH/C ≤ ``limit`` for every grain.

    With a limit of 1 no temperature leaves the range of its neighbors' (Euler is stable up to 2); the error is of first order.
    Sub-steps are equal, except where radiation makes the bound change with temperature.

    The others are those of `multicor_cli.engine.heat.integration.integrate`; ``should_stop`` is asked before every sub-step.

    Raises:
        Interrupted: If ``should_stop`` says so.
        ArithmeticError: If more than `MOST` sub-steps would be needed.
    """
    total = np.empty(capacity.size)
    power = source / dt
    flow = Flow.empty(capacity.size, walls.count)
    done, count = 0.0, 0
    while done < dt:
        stop_if_asked(should_stop)
        if count == 0 or net.radiates:
            total_conductance(net, temperature, walls(done), total)
            count = _sub_steps((dt - done) * float((total / capacity).max()) / limit)
        step = (dt - done) / count
        flow.add(net, temperature, walls(done + 0.5 * step), step)  # the middle is exact for signals that rise linearly
        temperature += step * (flow.rate + power) / capacity
        done = dt if count == 1 else done + step
        count -= 1
        flow.sub_steps += 1
    flow.received += source
    return flow


def _sub_steps(needed: float) -> int:
    if not needed <= MOST:
        message = f"the temperatures cannot be integrated: {needed:.3g} sub-steps would be needed"
        raise ArithmeticError(message)
    return max(1, math.ceil(needed))
