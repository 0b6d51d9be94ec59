"""What the writer is given, a state between steps, and the few numbers that sum it up."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli.arithmetic.sums import total
from multicor_cli.model import BOOK_NAMES, Model, State
from multicor_cli.model.books import (
    COUNTS_LAST,
    EXCHANGE_BOOKS,
    NUMBERS,
    Version,
    entry_counts,
)
from multicor_cli.model.cell import real_velocity
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

    def of_contacts(self, values: Floats | None, columns: tuple[int, ...]) -> Floats:
        """Values of the contacts in so many columns; 0 where the engine had none."""
        return np.zeros((self.table.i.size, *columns)) if values is None else values

    @cached_property
    def numbers(self) -> dict[str, dict[str, float]]:
        """Books, counters and sums by name, for each array of `model.books.NUMBERS`."""
        return {field: self.state.named(field) for field in NUMBERS}

    @property
    def window(self) -> dict[str, float]:
        return self.numbers["window"]

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
        return (
            self.state.wall_surface
            if self.state.wall_surface.size
            else np.zeros(self.model.wall_count)
        )

    @property
    def velocity(self) -> Floats:
        """Velocities and spins of the grains [m/s, rad/s], shape ``(n, 3)``."""
        return real_velocity(self.model, self.state)

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
    """Mean (by heat capacity), least and largest temperature of present grains [K]; 0 if none."""
    temperature, capacity = state.temperature(thermal)[state.here], thermal.capacity[state.here]
    if not temperature.size:
        return 0.0, 0.0, 0.0
    return (
        total(temperature * capacity) / total(capacity),
        float(temperature.min()),
        float(temperature.max()),
    )


def in_plane(values: Floats) -> Floats:
    """Points of a 3D viewer from ``(x, y, rotation)``: x, y and z = 0."""
    full = np.zeros((len(values), 3))
    full[:, :2] = values[:, :2]
    return full


# ---- What ``run.json``, checkpoints and ``results.h5`` carry of a state, and `run_info` reports

Summary = dict[str, Any]

_SUMMARIZED = {entry.summary: entry for entry in COUNTS_LAST if entry.summary is not None}


def summarize(state: State, model: Model) -> Summary:
    """Counters, books and digest of a state of a model.

    Returns:
        ``step, time, stage, grain_count, state_digest, energy_closure, heat_closure`` (null: no
        heat), ``max_overlap`` (over the smaller radius), ``max_contact_force`` [N],
        ``corrected_steps``, ``negative_loss_share``, ``solver``, ``books`` [J], and ``heat`` (null:
        no heat) with ``books`` [J], ``sub_steps``, ``max_biot``, ``integration_error``,
        ``solid_gas_min``, ``solid_gas_max`` (null: no gas) and ``temperature.{mean, min, max}``
        [K]; and ``exchange`` (null: no grain comes or goes) with its books and
        ``outlets.NAME.{grains, mass}``.
    """
    tallies, books = state.named("tallies"), state.named("books")
    heat = None if model.thermal is None else _summarize_heat(state, model.thermal)
    exchange: Summary | None = None
    if model.outlets is not None:
        counts = {entry.name for entry in EXCHANGE_BOOKS if entry.dtype == "i8"}
        named = state.named("exchange").items()
        exchange = {name: round(value) if name in counts else value for name, value in named}
        exchange["outlets"] = {
            name: {"grains": round(grains), "mass": mass}
            for name, (grains, mass) in zip(model.outlets, state.outlet_flow.tolist(), strict=True)
        }
    # Energy gained at contacts, by which the sum of their losses is less than what was lost
    gained, lost = abs(books["negative_loss"]), books["friction_loss"] + books["impact_loss"]
    return {
        "step": state.step,
        "time": state.time,
        "stage": state.stage,
        "grain_count": len(state.position),
        "state_digest": state.digest(),
        "energy_closure": books["closure"],
        "heat_closure": None if heat is None else heat["books"]["closure"],
        **{
            key: round(tallies[e.name]) if e.dtype == "i8" else tallies[e.name]
            for key, e in _SUMMARIZED.items()
        },
        "negative_loss_share": gained / (gained + lost) if gained + lost > 0.0 else 0.0,
        "solver": {
            "sweeps_mean": tallies["sweeps"] / max(1, state.step - state.frozen_steps),
            "residual_rms_max": tallies["residual_rms_max"],
            "residual_max_max": tallies["residual_max_max"],
            "unconverged_steps": round(tallies["unconverged_steps"]),
        },
        "books": books | state.named("adhesion_books") | state.named("growth_books"),
        "heat": heat,
        "exchange": exchange,
    }


def _summarize_heat(state: State, thermal: Thermal) -> Summary:
    books = state.named("heat_books")
    books.pop("hottest_spot", None)  # of a window, not of the run
    counters = {
        name: books.pop(name)
        for name in ("sub_steps", "max_biot", "solid_gas_min", "solid_gas_max", "integration_error")
    }
    mean, lowest, highest = temperatures_of(state, thermal)
    return {
        "books": books,
        "sub_steps": round(counters["sub_steps"]),
        "max_biot": counters["max_biot"],
        "integration_error": counters["integration_error"],
        "solid_gas_min": counters["solid_gas_min"] or None,
        "solid_gas_max": counters["solid_gas_max"] or None,
        "temperature": {"mean": mean, "min": lowest, "max": highest},
    }


def empty_summary(version: Version | None = None) -> Summary:
    """The summary of a run without a state: the keys (of an older version if given), no values."""
    counters = (
        key for key, entry in _SUMMARIZED.items() if version is None or entry.since <= version
    )
    names = ("step", "time", "stage", "grain_count", "state_digest", "energy_closure")
    later = ("exchange",) if version is None or version >= (1, 2) else ()
    names = (*names, "heat_closure", *counters, "negative_loss_share", "heat", *later)
    solver = ("sweeps_mean", "residual_rms_max", "residual_max_max", "unconverged_steps")
    books = BOOK_NAMES[: entry_counts(version)["book"]]
    return dict.fromkeys(names) | {"solver": dict.fromkeys(solver), "books": dict.fromkeys(books)}
