"""What the controller hands to the writer: one frame, or one row of the time series, in the layout of the engine."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli.arithmetic.sums import total
from multicor_cli.model import BOOK_NAMES, HEAT_BOOK_NAMES, TALLY_NAMES, WINDOW_NAMES, Model, State
from multicor_cli.model.contacts import ContactTable
from multicor_cli.model.model import Floats, Ints, Thermal

Columns = dict[str, NDArray[Any]]
"""Arrays by path of the schema."""


def contact_columns(contacts: ContactTable, grain_count: int, *, has_heat: bool = False) -> Columns:
    """Arrays by path of the schema; ``grain_count`` tells grains from wall shapes. Without heat in the table it counts as 0."""
    data: Columns = {
        "contacts/i": contacts.i,
        "contacts/j": contacts.j,
        "contacts/kind": (np.asarray(contacts.j) >= grain_count).astype(np.uint8),
        "contacts/normal": contacts.normal,
        "contacts/gap": contacts.gap,
        "contacts/impulse": contacts.impulse,
        "contacts/slip": contacts.slip,
        "contacts/sliding": np.asarray(contacts.sliding).astype(np.uint8),
    }
    if has_heat:
        data["contacts/heat"] = _or_zeros(contacts.heat, contacts.i)
        data["contacts/conductance"] = _or_zeros(contacts.conductance, contacts.i)
    return data


@dataclass(frozen=True)
class FrameHeat:
    """What else a frame of a run with heat has; ``n`` grains, ``w`` walls.

    Attributes:
        temperature: Grains: temperature [K], shape ``(n,)``.
        generated: Grains: heat of friction and impacts received since the start [J], shape ``(n,)``.
        wear: Grains: volume worn off since the start [m³], shape ``(n,)``.
        wall_temperature: Walls: temperature [K], nan where none is prescribed, shape ``(w,)``.
        wall_heat: Walls: heat given to the grains, and heat of friction and impacts received, since the start [J], shape
            ``(w, 2)``.
        wall_wear: Walls: volume worn off since the start [m³], shape ``(w,)``.
    """

    temperature: Floats
    generated: Floats
    wear: Floats
    wall_temperature: Floats
    wall_heat: Floats
    wall_wear: Floats

    @classmethod
    def from_state(cls, state: State, thermal: Thermal) -> FrameHeat:
        """The heat of a state."""
        temperature = state.temperature(thermal)
        walls = (state.wall_temperature, state.wall_heat, state.wall_wear)
        return cls(temperature, state.generated, state.wear, *walls)

    def columns(self) -> Columns:
        """Arrays by path of the schema."""
        return {
            "particles/temperature": self.temperature,
            "particles/generated": self.generated,
            "particles/wear": self.wear,
            "walls/temperature": self.wall_temperature[np.newaxis],
            "walls/heat": self.wall_heat[np.newaxis],
            "walls/wear": self.wall_wear[np.newaxis],
        }


@dataclass(frozen=True)
class FrameData:
    """A frame: the grains, walls and, if recorded, contacts at the end of a step.

    Attributes:
        step: Steps done since the start of the run.
        time: Time [s].
        dt: Length of the last step [s].
        stage: Index of the loading stage.
        position: Grains: x, y [m] (x wrapped) and angle [rad], shape ``(n, 3)``.
        image: Grains: periods by which x was wrapped, shape ``(n,)``.
        velocity: Grains: velocity [m/s] and spin [rad/s], shape ``(n, 3)``.
        wall_position: Walls: displacement [m] and angle [rad], shape ``(w, 3)``.
        wall_velocity: Walls: velocity [m/s] and spin [rad/s], shape ``(w, 3)``.
        contacts: Contacts of the last step, or ``None`` if they are not recorded.
        heat: Temperatures and heat, or ``None`` in a run without heat.
    """

    step: int
    time: float
    dt: float
    stage: int
    position: Floats
    image: NDArray[np.int64]
    velocity: Floats
    wall_position: Floats
    wall_velocity: Floats
    contacts: ContactTable | None = None
    heat: FrameHeat | None = None

    @classmethod
    def from_state(cls, state: State, model: Model, contacts: ContactTable | None = None) -> FrameData:
        """The frame of a state of a model. Arrays are shared, not copied: the writer copies them."""
        return cls(
            step=state.step,
            time=state.time,
            dt=state.last_dt,
            stage=state.stage,
            position=state.position,
            image=state.image,
            velocity=state.velocity,
            wall_position=state.wall_position,
            wall_velocity=state.wall_velocity,
            contacts=contacts,
            heat=None if model.thermal is None else FrameHeat.from_state(state, model.thermal),
        )

    def columns(self) -> Columns:
        """Arrays by path of the schema; those of one value per frame have a first dimension of 1."""
        data: Columns = {
            "steps/step": np.array([self.step], np.int64),
            "steps/time": np.array([self.time]),
            "steps/dt": np.array([self.dt]),
            "steps/stage": np.array([self.stage], np.int32),
            "steps/contacts_recorded": np.array([self.contacts is not None], np.uint8),
            "particles/position": _in_plane(self.position),
            "particles/angle": self.position[:, 2],
            "particles/image": self.image,
            "particles/velocity": _in_plane(self.velocity),
            "particles/spin": self.velocity[:, 2],
            "walls/position": self.wall_position[np.newaxis],
            "walls/velocity": self.wall_velocity[np.newaxis],
        }
        contacts = self.contacts if self.contacts is not None else ContactTable.empty()
        data |= contact_columns(contacts, len(self.position), has_heat=self.heat is not None)
        return data if self.heat is None else data | self.heat.columns()


@dataclass(frozen=True)
class SeriesRow:
    """A row of the time series: values by the names of the table ``schema.SERIES``.

    Attributes:
        values: One value per name, a number or an array of the shape that the table gives after the first dimension.
    """

    values: dict[str, float | int | Floats]

    @classmethod
    def from_state(cls, state: State, model: Model) -> SeriesRow:
        """The row that ends the window of a state of ``model``; the caller then clears the window.

        A window without steps (the row at the start of a run) has means, rates and forces of zero.
        """
        tallies = dict(zip(TALLY_NAMES, state.tallies.tolist(), strict=True))
        return cls(
            {
                "step": state.step,
                "time": state.time,
                "stage": state.stage,
                "strain": state.stage_strain,
                **dict(zip(BOOK_NAMES, state.books.tolist(), strict=True)),
                "max_overlap": tallies["max_overlap"],
                "max_impulse_rate": tallies["max_impulse_rate"],
                "corrected_steps": round(tallies["corrected_steps"]),
                **_window_values(state),
                "wall_position": state.wall_position,
                "wall_velocity": state.wall_velocity,
                **({} if model.thermal is None else _heat_values(state, model.thermal)),
            }
        )

    def columns(self) -> Columns:
        """Arrays by path of the schema, each with a first dimension of 1."""
        return {f"series/{name}": np.asarray(value)[np.newaxis] for name, value in self.values.items()}


def _window_values(state: State) -> dict[str, float | int | Floats]:
    window = dict(zip(WINDOW_NAMES, state.window.tolist(), strict=True))
    steps, duration = round(window["steps"]), window["duration"]
    per_step = 1.0 / steps if steps else 0.0
    virial = np.array([[window["virial_xx"], window["virial_xy"]], [window["virial_yx"], window["virial_yy"]]])
    rate = virial / duration if duration > 0.0 else np.zeros((2, 2))
    impulse = state.window_wall_impulse
    return {
        "window_duration": duration,
        "window_steps": steps,
        "sweeps_mean": window["sweeps"] * per_step,
        "unconverged": round(window["unconverged"]),
        "residual_rms": window["residual_rms"],
        "residual_max": window["residual_max"],
        "residual_energy": window["residual_energy"],
        "contacts_mean": window["contacts"] * per_step,
        "virial_rate": rate,
        "wall_force": impulse / duration if duration > 0.0 else np.zeros_like(impulse),
    }


def series_name(book: str) -> str:
    """Name in the time series of a heat book, one of `HEAT_BOOK_NAMES`."""
    return book if book.startswith(("max_", "solid_gas_")) else f"heat_{book}"


def _heat_values(state: State, thermal: Thermal) -> dict[str, float | int | Floats]:
    books: dict[str, float | int | Floats] = dict(zip(map(series_name, HEAT_BOOK_NAMES), state.heat_books.tolist(), strict=True))
    books["heat_sub_steps"] = round(float(state.heat_books[HEAT_BOOK_NAMES.index("sub_steps")]))
    temperature = state.temperature(thermal)
    return {
        **books,
        "temperature_mean": mean_temperature(temperature, thermal),
        "temperature_min": float(temperature.min()),
        "temperature_max": float(temperature.max()),
        "wall_heat": state.wall_heat,
    }


def mean_temperature(temperature: Floats, thermal: Thermal) -> float:
    """Mean temperature of the grains [K], weighted by their heat capacities."""
    return total(temperature * thermal.capacity) / total(thermal.capacity)


def _or_zeros(values: Floats | None, like: Ints) -> Floats:
    return np.zeros(len(like)) if values is None else values


def _in_plane(values: Floats) -> Floats:
    """Points of a 3D viewer from ``(x, y, rotation)``: x, y and z = 0."""
    full = np.zeros((len(values), 3))
    full[:, :2] = values[:, :2]
    return full
