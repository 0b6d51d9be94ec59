"""How heat flow is integrated over a step: by which integrator, how finely, and piece by piece where signals of walls bend."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from multicor_cli.engine.heat.explicit import advance_explicit
from multicor_cli.engine.heat.flow import Flow
from multicor_cli.engine.heat.implicit import advance_implicit
from multicor_cli.engine.heat.rates import Network
from multicor_cli.engine.heat.walls import WallValues
from multicor_cli.model.model import Floats


@dataclass(frozen=True, kw_only=True)
class Integration:
    """Choices about the integration, named as the keys of ``[heat]``.

    Attributes:
        integrator: ``"auto"``: implicit in frozen stages, explicit while grains move.
        sub_step: Largest sub-step of the explicit integrator, as Δt ΣH/C.
        tolerance: Largest error of an implicit sub-step over the spread of the temperatures.
    """

    integrator: Literal["auto", "explicit", "implicit"] = "auto"
    sub_step: float = 1.0
    tolerance: float = 1e-4


def integrate(
    net: Network,
    capacity: Floats,
    temperature: Floats,
    walls: WallValues,
    source: Floats,
    dt: float,
    first: float,
    choices: Integration,
    should_stop: Callable[[], bool] | None = None,
    *,
    is_frozen: bool,
) -> Flow:
    """Heat that flows within ``dt``.

    Args:
        net: The network.
        capacity: C [J/K], shape ``(n,)``.
        temperature: T at the start [K], shape ``(n,)``. **Modified.**
        walls: Temperatures or flows of the walls as functions of the time since the start of ``dt``.
        source: Heat generated within ``dt`` [J], shape ``(n,)``.
        dt: Duration [s].
        first: Sub-step that the implicit integrator tries first [s]; 0: the whole duration.
        choices: By which integrator, and how finely.
        should_stop: Asked now and then.
        is_frozen: Whether nothing moves.

    Raises:
        Interrupted: If ``should_stop`` says so.
        ArithmeticError: If the temperatures cannot be integrated.
    """
    is_implicit = choices.integrator == "implicit" or (choices.integrator == "auto" and is_frozen)
    flow = Flow.empty(capacity.size, walls.count)
    flow.next_step = first
    for values, length in walls.pieces(dt):
        common = (net, capacity, temperature, values, source * (length / dt), length)
        if is_implicit:
            flow.join(advance_implicit(*common, choices.tolerance, flow.next_step, should_stop))
        else:
            flow.join(advance_explicit(*common, choices.sub_step, should_stop))
    return flow
