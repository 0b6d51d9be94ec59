"""Books of grains that come and go: their numbers and masses, and the energy and heat that go with them.

A grain enters the energy books with the kinetic energy of its release, and leaves them with what it has then. Its heat content
counts from the temperature with which it came, so that it brings none, and takes along what it has received.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from multicor_cli.arithmetic.sums import total
from multicor_cli.engine.energy.books import book_exchange
from multicor_cli.engine.heat.books import book_heat_out
from multicor_cli.model.books import EXCHANGE_NAMES
from multicor_cli.model.columns import SPIN, X, Y
from multicor_cli.model.model import Model
from multicor_cli.model.state import Presence, State

_BOOK = {name: k for k, name in enumerate(EXCHANGE_NAMES)}


def book_in(state: State, model: Model, grains: NDArray[np.int64]) -> None:
    """Enter grains that have just been released, where they are and as they move."""
    kinetic, potential = _energies(state, model, grains)
    book_exchange(state, kinetic, 0.0)
    _add(state, "potential_in", potential)
    _count(state, model, grains, "released")


def book_out(state: State, model: Model, grains: NDArray[np.int64], what: str) -> None:
    """Enter grains that are about to go; ``what`` is ``"left"`` or ``"lost"``."""
    kinetic, potential = _energies(state, model, grains)
    book_exchange(state, 0.0, kinetic)
    _add(state, "potential_out", potential)
    _count(state, model, grains, what)
    if state.heat.size:
        book_heat_out(state, state.heat[grains])


def book_returned(state: State, model: Model, grains: NDArray[np.int64]) -> None:
    """Enter grains that have left and go back to wait."""
    _count(state, model, grains, "returned")


def note_presence(state: State, model: Model, behind: int) -> None:
    """Count who is there and who waits, and compare all masses; ``behind`` are the releases that found no room."""
    books, mass = state.exchange, model.grains.mass
    for name, status in (("waiting", Presence.WAITS), ("present", Presence.THERE)):
        which = np.flatnonzero(state.presence == status)
        books[_BOOK[name]] = which.size
        books[_BOOK[f"mass_{name}"]] = total(mass[which])
    books[_BOOK["behind"]] = behind
    found = books[_BOOK["mass_waiting"]] + books[_BOOK["mass_present"]]
    found += books[_BOOK["mass_left"]] - books[_BOOK["mass_returned"]] + books[_BOOK["mass_lost"]]
    whole = total(mass)
    books[_BOOK["mass_closure"]] = max(books[_BOOK["mass_closure"]], abs(found - whole) / whole)


def _count(state: State, model: Model, grains: NDArray[np.int64], what: str) -> None:
    _add(state, what, float(grains.size))
    _add(state, f"mass_{what}", total(model.grains.mass[grains]))


def _add(state: State, name: str, value: float) -> None:
    state.exchange[_BOOK[name]] += value


def _energies(state: State, model: Model, grains: NDArray[np.int64]) -> tuple[float, float]:
    """Kinetic energy, and energy in the gravity of the domain −m g·r, zero at the origin [J]; x is unwrapped."""
    (u, v), spin = state.velocity[grains, :SPIN].T, state.velocity[grains, SPIN]
    mass, (gx, gy) = model.grains.mass[grains], model.gravity.tolist()
    x = state.position[grains, X] + model.period * state.image[grains]
    kinetic = total(0.5 * mass * (u * u + v * v) + 0.5 * model.grains.inertia[grains] * (spin * spin))
    return kinetic, -total(mass * (gx * x + gy * state.position[grains, Y]))
