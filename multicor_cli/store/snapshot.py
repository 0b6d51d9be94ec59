"""What the writer is given: a state of a run at the end of a step, and what is stored of it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli.arithmetic.sums import total
from multicor_cli.model import BOOK_NAMES, EXCHANGE_NAMES, HEAT_BOOK_NAMES, TALLY_NAMES, WINDOW_NAMES, Model, State
from multicor_cli.model.contacts import ContactTable
from multicor_cli.model.model import Floats, Thermal


@dataclass(frozen=True)
class Snapshot:
    """A state between two steps. Arrays are shared, not copied: the writer copies them.

    Attributes:
        state: The state.
        model: Its model.
        contacts: Contacts of the last step, or None if they are not recorded.
    """

    state: State
    model: Model
    contacts: ContactTable | None = None

    @property
    def table(self) -> ContactTable:
        """The contacts; none if they are not recorded."""
        return ContactTable.empty() if self.contacts is None else self.contacts

    def of_contacts(self, values: Floats | None) -> Floats:
        """Values of the contacts; 0 where the engine had none."""
        return np.zeros(self.table.i.size) if values is None else values

    @cached_property
    def books(self) -> dict[str, float]:
        """Energy books by name, see `multicor_cli.model.BOOK_NAMES`."""
        return dict(zip(BOOK_NAMES, self.state.books.tolist(), strict=True))

    @cached_property
    def tallies(self) -> dict[str, float]:
        """Counters by name, see `multicor_cli.model.TALLY_NAMES`."""
        return dict(zip(TALLY_NAMES, self.state.tallies.tolist(), strict=True))

    @cached_property
    def window(self) -> dict[str, float]:
        """Sums since the last row of the time series by name, see `multicor_cli.model.WINDOW_NAMES`."""
        return dict(zip(WINDOW_NAMES, self.state.window.tolist(), strict=True))

    @cached_property
    def heat_books(self) -> dict[str, float]:
        """Heat books by name, see `multicor_cli.model.HEAT_BOOK_NAMES`."""
        return dict(zip(HEAT_BOOK_NAMES, self.state.heat_books.tolist(), strict=True))

    @cached_property
    def exchange(self) -> dict[str, float]:
        """Books of grains that come and go by name, see `multicor_cli.model.EXCHANGE_NAMES`."""
        return dict(zip(EXCHANGE_NAMES, self.state.exchange.tolist(), strict=True))

    def per_step(self, name: str) -> float:
        """Mean of a sum of the window over its steps; 0 without steps."""
        return self.window[name] * (1.0 / self.window["steps"]) if self.window["steps"] else 0.0

    def rate(self, values: NDArray[Any]) -> Floats:
        """A sum over the window per time; 0 without steps."""
        duration = self.window["duration"]
        return np.asarray(values / duration if duration > 0.0 else np.zeros_like(values))

    @property
    def virial(self) -> Floats:
        """Sum of the virial over the window [J s], shape ``(2, 2)``."""
        return np.array([[self.window[f"virial_{a}{b}"] for b in "xy"] for a in "xy"])

    @property
    def wall_surface(self) -> Floats:
        """Velocities of the surfaces of the walls [m/s], shape ``(w,)``."""
        return self.state.wall_surface if self.state.wall_surface.size else np.zeros(self.model.wall_count)

    @property
    def thermal(self) -> Thermal:
        """What temperatures need; only in runs with heat."""
        assert self.model.thermal is not None
        return self.model.thermal

    @cached_property
    def temperature(self) -> Floats:
        """Temperatures of the grains [K], shape ``(n,)``; only in runs with heat."""
        return self.state.temperature(self.thermal)

    @cached_property
    def temperatures_here(self) -> tuple[float, float, float]:
        """As `temperatures_of` this moment."""
        return temperatures_of(self.state, self.thermal)


def temperatures_of(state: State, thermal: Thermal) -> tuple[float, float, float]:
    """Mean temperature of the grains that are there, weighted by heat capacity, lowest and highest [K]; 0 if none is there."""
    temperature, capacity = state.temperature(thermal)[state.here], thermal.capacity[state.here]
    if not temperature.size:
        return 0.0, 0.0, 0.0
    return total(temperature * capacity) / total(capacity), float(temperature.min()), float(temperature.max())


def in_plane(values: Floats) -> Floats:
    """Points of a 3D viewer from ``(x, y, rotation)``: x, y and z = 0."""
    full = np.zeros((len(values), 3))
    full[:, :2] = values[:, :2]
    return full
