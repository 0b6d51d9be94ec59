"""Heat that has flowed within a time: what each grain received, and what the outside gave."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from multicor_cli.engine.contact.solve import Interrupted
from multicor_cli.engine.heat.rates import OUTSIDE_BOOKS, Network, heat_rates
from multicor_cli.model.model import Floats


@dataclass
class Flow:
    """Sums over the sub-steps of an integrator; ``n`` grains, ``w`` walls.

    Attributes:
        received: Heat received by each grain [J], shape ``(n,)``.
        walls: Heat given by each wall [J], shape ``(w,)``.
        outside: Heat given by what is outside, by heat book [J], shape ``(2,)``.
        sub_steps: Number of sub-steps.
        next_step: Sub-step to try next [s].
        rate: Rates of the last evaluation [W], shape ``(n,)``.
    """

    received: Floats
    walls: Floats
    outside: Floats
    rate: Floats
    sub_steps: int = 0
    next_step: float = 0.0
    _wall_rate: Floats = field(default_factory=lambda: np.zeros(0))
    _outside_rate: Floats = field(default_factory=lambda: np.zeros(len(OUTSIDE_BOOKS)))

    @classmethod
    def empty(cls, grains: int, walls: int) -> Flow:
        """Nothing has flowed yet."""
        return cls(np.zeros(grains), np.zeros(walls), np.zeros(len(OUTSIDE_BOOKS)), np.zeros(grains), _wall_rate=np.zeros(walls))

    def join(self, later: Flow) -> None:
        """Add what has flowed after this."""
        self.received += later.received
        self.walls += later.walls
        self.outside += later.outside
        self.sub_steps += later.sub_steps
        self.next_step = later.next_step

    def evaluate(self, net: Network, temperature: Floats, wall_value: Floats) -> None:
        """Fill ``rate`` for these temperatures [K]."""
        heat_rates(net, temperature, wall_value, self.rate, self._wall_rate, self._outside_rate)

    def add(self, net: Network, temperature: Floats, wall_value: Floats, weight: float) -> None:
        """Let heat flow for ``weight`` seconds at the rates of these temperatures."""
        self.evaluate(net, temperature, wall_value)
        self.received += weight * self.rate
        self.walls += weight * self._wall_rate
        self.outside += weight * self._outside_rate


def stop_if_asked(should_stop: Callable[[], bool] | None) -> None:
    """Raise `Interrupted` if a stop has been requested."""
    if should_stop is not None and should_stop():
        raise Interrupted
