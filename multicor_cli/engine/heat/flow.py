"""Heat that has flowed within a time: what each grain received, and what the outside gave."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from multicor_cli.engine.contact.solve import Interrupted
from multicor_cli.engine.heat.rates import OUTSIDE_BOOKS, Network, heat_rates
from multicor_cli.model.model import Floats


class Rates(NamedTuple):
    """Heat flows at one moment; ``n`` nodes, ``w`` walls.

    Attributes:
        nodes: Into each grain and body [W], shape ``(n,)``.
        walls: Out of each wall [W], shape ``(w,)``.
        outside: From what is outside, by heat book [W], shape ``(2,)``.
    """

    nodes: Floats
    walls: Floats
    outside: Floats


def rates_at(net: Network, temperature: Floats, wall_value: Floats) -> Rates:
    """Rates at these temperatures [K]; arguments as `heat_rates`."""
    rates = Rates(np.empty(temperature.size), np.empty(wall_value.size), np.empty(len(OUTSIDE_BOOKS)))
    heat_rates(net, temperature, wall_value, *rates)
    return rates


@dataclass
class Flow:
    """Sums over the sub-steps of an integrator; ``n`` grains and bodies, ``w`` walls.

    Attributes:
        received: Heat received by each grain [J], shape ``(n,)``.
        walls: Heat given by each wall [J], shape ``(w,)``.
        outside: Heat given by what is outside, by heat book [J], shape ``(2,)``.
        sub_steps: Number of sub-steps.
        next_step: Sub-step to try next [s].
        error: Largest estimated error of a sub-step over the spread of the temperatures.
    """

    received: Floats
    walls: Floats
    outside: Floats
    sub_steps: int = 0
    next_step: float = 0.0
    error: float = 0.0

    @classmethod
    def empty(cls, grains: int, walls: int) -> Flow:
        """Nothing has flowed yet."""
        return cls(np.zeros(grains), np.zeros(walls), np.zeros(len(OUTSIDE_BOOKS)))

    def add(self, rates: Rates, weight: float) -> None:
        """Let heat flow for ``weight`` seconds at these rates."""
        self.received += weight * rates.nodes
        self.walls += weight * rates.walls
        self.outside += weight * rates.outside

    def note_sub_step(self, error: float) -> None:
        """Count a sub-step of this estimated error, over the spread of the temperatures."""
        self.sub_steps += 1
        self.error = max(self.error, error)


def stop_if_asked(should_stop: Callable[[], bool] | None) -> None:
    """Raise `Interrupted` if a stop has been requested."""
    if should_stop is not None and should_stop():
        raise Interrupted
