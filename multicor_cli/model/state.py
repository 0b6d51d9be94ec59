"""The time-varying part of a run, as a checkpoint holds it: whatever changes the future."""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass, fields
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.books import (
    ADHESION_BOOKS,
    EXCHANGE_BOOKS,
    FLUX_BOOKS,
    GRADIENT_BOOKS,
    GROWTH_BOOKS,
    HEAT_BOOKS,
    NAMES,
    DType,
    Shape,
    entry_counts,
    stored,
    stored_fields,
)
from multicor_cli.model.columns import ANGLE, XY, X, Y
from multicor_cli.model.model import Floats, Ints, Model, Thermal


def _array(dims: Shape, unit: str, meaning: str, dtype: DType = "f8", **more: Any) -> Any:
    """An array; without elements until it is given some."""
    word = str(dims[0]).split("_")[0]
    about = {
        "only_with": word if word in ("heat", "exchange", "cell", "expansion") else None,
        **more,
    }
    about |= {"dtype": dtype, "dims": dims, "unit": unit, "meaning": meaning}
    return stored(default_factory=lambda: np.zeros(_shape(dims, entry_counts()), dtype), **about)


def _number(unit: str, meaning: str) -> Any:
    return stored(0.0, dtype="f8", dims=("one",), unit=unit, meaning=meaning)


def _count(meaning: str) -> Any:
    return stored(0, dtype="i8", dims=("one",), unit="1", meaning=meaning)


def _shape(dims: Shape, lengths: dict[str, int]) -> tuple[int, ...]:
    return tuple(d if isinstance(d, int) else lengths.get(d, 0) for d in dims)


class Presence(IntEnum):
    """Whether a grain is there."""

    WAITS = 0
    THERE = 1
    LEFT = 2
    LOST = 3


@dataclass
class State:
    """State of a run between two steps.

    Each field says its shape, unit and meaning, as docs/reference/formats/checkpoint.md lists them.

    Without arguments it is the state of a model without anything.
    """

    position: Floats = _array(("grain", 3), "m, m, rad",
        "centers (x wrapped into the period, y too in a cell) and angles of the "
        "grains")  # fmt: skip
    image: NDArray[np.int64] = _array(
        ("grain",), "1", "periods by which x was wrapped; 0 in a cell", "i8"
    )
    velocity: Floats = _array(("grain", 3), "m/s, m/s, rad/s",
        "velocities and spins of the grains; in a cell velocities beside its mean "
        "flow")  # fmt: skip
    wall_position: Floats = _array(("wall", 3), "m, m, rad",
        "reference points and angles of the walls; width, height and tilt [m] of a "
        "cell")  # fmt: skip
    wall_velocity: Floats = _array(("wall", 3), "m/s, m/s, rad/s",
        "velocities and spins of the walls; rates xx, yy and xy [1/s] of a cell")  # fmt: skip
    # The contacts that carried an impulse, ascending by both shapes; where the next solve starts.
    # With adhesion normal impulses are p_n + F Δt (theory §3.1).
    contact_i: Ints = _array(
        ("contact_row",), "1", "first shape of each contact that carried an impulse", "i4"
    )
    contact_j: Ints = _array(("contact_row",), "1", "second shape of each of these contacts", "i4")
    contact_impulse: Floats = _array(
        ("contact_row", 2), "N s", "normal and tangential impulse of the last step"
    )
    contact_couple: Floats = _array(
        ("rolling_row",), "N m s", "impulse of the rolling resistance of each of them", since=(1, 1)
    )
    contact_point: Ints = _array(
        ("point_row",), "1", "which corner each of them is at, and of which pieces", "i4",
        only_with="outlines", since=(1, 12),
    )  # fmt: skip
    # What else the solver looks at: all pairs that were near when contacts were last sought or came
    # late since, and where the grains were in the order of the sweep.
    near_i: Ints = _array(
        ("near_row",), "1", "first shape of each pair that may be in contact", "i4", since=(1, 5)
    )
    near_j: Ints = _array(
        ("near_row",), "1", "second shape of each of these pairs", "i4", since=(1, 5)
    )
    near_points: Ints = _array(
        ("near_point_row",), "1", "number of points of each of these pairs for which there is room",
        "i4", only_with="outlines", since=(1, 12),
    )  # fmt: skip
    near_late: Ints = _array(
        ("late_row",), "1", "which of these pairs came after contacts were sought: 1, 2, … in this "
        "order; 0 of all others", "i4", since=(1, 13),
    )  # fmt: skip
    tile: Ints = _array(("grain", 2), "1",
        "column and row of the tile in which a grain was when these pairs were sought", "i4",
        since=(1, 5))  # fmt: skip
    books: Floats = _array(("book",), "J", "energy books, in the order of model.BOOK_NAMES")
    tallies: Floats = _array(("tally",), "mixed", "counters, in the order of model.TALLY_NAMES")
    window: Floats = _array(("window",), "mixed", "sums, in the order of model.WINDOW_NAMES")
    window_wall_impulse: Floats = _array(
        ("wall", 3), "N s, N s, N m s", "impulse on each wall since the last series row"
    )
    step: int = _count("steps done since the start of the run")
    frozen_steps: int = _count("how many of the steps were of frozen stages")
    stage: int = _count("current loading stage")
    stage_step: int = _count("steps done in this stage")
    stage_start: float = _number("s", "time at which this stage began")
    stage_peak: float = _number("J", "largest kinetic energy in this stage")
    stage_strain: float = _number("1", "shear strain accumulated in this stage")
    time: float = _number("s", "time since the start of the run")
    last_dt: float = _number("s", "length of the last step")
    # What follows is empty without heat.
    heat: Floats = _array(("heat_grain",), "J",
        "heat content of the grains since the start, or that of the run from which this one "
        "goes on")  # fmt: skip
    generated: Floats = _array(
        ("heat_grain",), "J", "heat of friction and impacts received since the start"
    )
    heat_ahead: Floats = _array(("heat_grain",), "J",
        "heat received beyond what the contacts of a grain have lost: later losses make up for it",
        since=(1, 6))  # fmt: skip
    wear: Floats = _array(("heat_grain",), "m3", "volume worn off since the start")
    wall_heat: Floats = _array(("heat_wall", 2), "J",
        "heat given to the grains; heat of friction and impacts received",
        columns=("heat_given", "heat_received"))  # fmt: skip
    wall_wear: Floats = _array(("heat_wall",), "m3", "volume worn off since the start")
    wall_temperature: Floats = _array(
        ("heat_wall",), "K", "temperature of the walls; nan where none is prescribed"
    )
    heat_books: Floats = _array(
        ("heat_book",), "mixed", "heat books, in the order of model.HEAT_BOOK_NAMES"
    )
    # The contacts whose force is averaged, ascending by both shapes; from zero at their start.
    mean_i: Ints = _array(
        ("mean_row",), "1", "first shape of each contact with an averaged force", "i4"
    )
    mean_j: Ints = _array(("mean_row",), "1", "second shape of each of these contacts", "i4")
    mean_force: Floats = _array(("mean_row",), "N", "running average of the normal force")
    mean_age: float = _number("s", "time since the start of the running averages")
    heat_dt: float = _number(
        "s", "sub-step that the heat integrator tries first; 0: the whole step"
    )
    heat_before: Floats = _array(("before_row",), "J",
        "heat content of all grains at the start, if the run goes on from another with heat",
        since=(1, 2))  # fmt: skip
    stage_notes: Floats = _array(("stage_note",), "mixed",
        "what the condition that ends this stage remembers; empty if it needs nothing",
        since=(1, 1))  # fmt: skip
    wall_origin: Floats = _array(("origin_row", 3), "m, m, rad",
        "where displacements of each wall count from, for prescribed positions and springs; "
        "empty without them", since=(1, 2))  # fmt: skip
    wall_surface: Floats = _array(("surface_row",), "m/s",
        "velocity of the surface of each wall along it; empty as long as none has run",
        since=(1, 3))  # fmt: skip
    wall_ahead: Floats = _array(("ahead_row",), "J",
        "heat that each wall has received beyond what its contacts have lost; empty as long as "
        "none has", since=(1, 14))  # fmt: skip
    # What follows is empty where no grain comes or goes. Arrays of grains hold all: one that is not
    # there keeps what it had.
    presence: NDArray[np.uint8] = _array(("exchange_grain",), "1",
        "whether a grain is there: 0 waits, 1 is there, 2 has left, 3 is lost", "u1",
        since=(1, 2))  # fmt: skip
    released: Floats = _array(
        ("exchange_group", 2), "1, kg", "grains and mass released of each group", since=(1, 2)
    )
    outlet_flow: Floats = _array(("exchange_outlet", 2), "1, kg",
        "grains and mass that left through each outlet", columns=("grains", "mass"),
        since=(1, 2))  # fmt: skip
    exchange: Floats = _array(("exchange_book",), "mixed",
        "books of grains that come and go, in the order of model.EXCHANGE_NAMES",
        since=(1, 2))  # fmt: skip
    # What follows is empty without adhesion.
    bridge_i: Ints = _array(
        ("bridge_row",), "1", "first shape of each bridge of liquid", "i4", since=(1, 7)
    )
    bridge_j: Ints = _array(
        ("bridge_row",), "1", "second shape of each of these bridges", "i4", since=(1, 7)
    )
    adhesion_books: Floats = _array(
        ("adhesion_book",), "J", "work of adhesion since the start", since=(1, 7)
    )

    # What follows is empty where there are walls.
    nonaffine: Floats = _array(("cell_grain", 2), "m",
        "displacement of the grains beside the mean flow of their cell since the start",
        columns=("nonaffine_x", "nonaffine_y"), since=(1, 9))  # fmt: skip
    gradient_books: Floats = _array(("gradient_book",), "mixed",
        "books of the mean gradient of temperature, in the order of model.GRADIENT_BOOKS",
        since=(1, 9))  # fmt: skip

    # What follows is empty in cells, and without heat.
    flux_books: Floats = _array(("flux_book",), "J m",
        "heat times its way since the start, in the order of model.FLUX_BOOKS",
        since=(1, 11))  # fmt: skip

    # What follows is empty unless grains expand, or shrink as they wear.
    radius: Floats = _array(("expansion_grain",), "m", "radius of the grains", since=(1, 10))
    growth_books: Floats = _array(("expansion_book",), "J",
        "books of the size of the grains, in the order of model.GROWTH_BOOKS",
        since=(1, 10))  # fmt: skip

    @classmethod
    def at_rest(cls, model: Model, position: Floats) -> State:
        """A state with everything at rest; ``position`` has shape ``(n, 2)`` or ``(n, 3)``."""
        state, about = cls(), stored_fields(cls)
        for name, shape in state_shapes(model).items():
            setattr(state, name, np.zeros(shape, about[name].dtype))
        state.position[:, : position.shape[1]] = position
        state.wall_temperature[:] = np.nan
        state.presence[:] = Presence.THERE
        if state.radius.size:
            state.radius[:] = model.grains.radius
        return state

    def temperature(self, thermal: Thermal) -> Floats:
        """Temperatures of the grains T = T₀ + Q/C [K], shape ``(n,)``; beside a mean gradient."""
        return thermal.initial_temperature + self.heat / thermal.capacity

    @property
    def here(self) -> NDArray[np.int64] | slice:
        """The grains that are there: their numbers, or all of them where none comes or goes."""
        return (
            np.flatnonzero(self.presence == Presence.THERE) if self.presence.size else slice(None)
        )

    def named(self, field: str) -> dict[str, float]:
        """The numbers of one of the arrays in `books.NUMBERS` by name; none if it is empty."""
        values: Floats = getattr(self, field)
        return dict(zip(NAMES[field] if values.size else (), values.tolist(), strict=True))

    def as_dict(self) -> dict[str, NDArray[np.generic]]:
        """All fields as arrays (numbers 0-d), in declaration order: what a checkpoint stores."""
        return {f.name: np.asarray(getattr(self, f.name)) for f in fields(self)}

    @classmethod
    def from_dict(cls, data: dict[str, NDArray[np.generic]]) -> State:
        """The inverse of `as_dict`; raises `KeyError` if a field is missing."""
        arrays = {f.name: np.asarray(data[f.name]) for f in fields(cls)}
        values = {k: np.ascontiguousarray(v) if v.ndim else v.item() for k, v in arrays.items()}
        return cls(**values)  # type: ignore[arg-type]

    def digest(self) -> str:
        """BLAKE2 digest over the raw bytes of every field, in declaration order (little-endian)."""
        return digest_of(self.as_dict())


class FrameFields:
    """What frames keep of a state as it is: attributes of `store.Frame`, None in runs without heat.

    A field of `State` with a row for each grain, or wall (``wall_…``), that is named here is in
    every frame, and is exported.
    """

    generated: NDArray[Any] | None
    wear: NDArray[Any] | None
    presence: NDArray[Any] | None
    wall_heat: NDArray[Any] | None
    wall_wear: NDArray[Any] | None
    nonaffine: NDArray[Any] | None
    radius: NDArray[Any] | None


def digest_of(arrays: dict[str, NDArray[Any]]) -> str:
    """`State.digest` of what `State.as_dict` gives.

    Empty arrays that came with a later version of the format do not count: what a run does not have
    leaves its digest as it was.
    """
    total = hashlib.blake2b(digest_size=16)
    about = stored_fields(State)
    for name, value in arrays.items():
        if value.size == 0 and about[name].since > (1, 0):
            continue
        total.update(name.encode())
        total.update(str(value.shape).encode())
        total.update(np.ascontiguousarray(value).tobytes())
    return total.hexdigest()


def state_shapes(model: Model) -> dict[str, tuple[int, ...]]:
    """Shapes of the arrays of a state of a model, as far as the model decides on them."""
    n, w = model.grain_count, model.wall_count
    is_heated, is_open = model.thermal is not None, model.outlets is not None
    lengths = {
        "grain": n,
        "wall": w,
        "heat_grain": n if is_heated else 0,
        "heat_wall": w if is_heated else 0,
        "heat_book": len(HEAT_BOOKS) if is_heated else 0,
        "exchange_grain": n if is_open else 0,
        "exchange_group": len(model.groups) if is_open else 0,
        "exchange_outlet": len(model.outlets or ()),
        "exchange_book": len(EXCHANGE_BOOKS) if is_open else 0,
        "adhesion_book": len(ADHESION_BOOKS) if model.laws.adhesion_range.size else 0,
        "cell_grain": n if model.is_cell else 0,
        "expansion_grain": n if model.expansion.size else 0,
        "expansion_book": len(GROWTH_BOOKS) if model.expansion.size else 0,
        "gradient_book": len(GRADIENT_BOOKS) if any(model.heat_gradient) else 0,
        "flux_book": len(FLUX_BOOKS) if is_heated and not model.is_cell else 0,
    }
    return {
        name: _shape(about.dims, lengths)
        for name, about in stored_fields(State).items()
        if about.dims[0] in lengths
    }


# ---- What cannot be in a state: values not finite or absurd, shapes and indices that do not fit

LARGEST = 1e50
"""Larger magnitudes are absurd in SI units, and their squares may not be finite."""

_CONTACTS = {
    "contact_impulse": ("contact_i", "contact_j"),
    "contact_couple": ("contact_i", "contact_j"),
    "mean_force": ("mean_i", "mean_j"),
}
_PAIRS = {
    "near_j": ("near_i", "near_j"),
    "bridge_j": ("bridge_i", "bridge_j"),
    "contact_point": ("contact_i", "contact_j"),
    "near_points": ("near_i", "near_j"),
    "near_late": ("near_i", "near_j"),
}


def _fields(dtype: str, *dims: str) -> tuple[str, ...]:
    found = stored_fields(State)
    return tuple(
        name
        for dim in dims
        for name, about in found.items()
        if about.dims[0] == dim and about.dtype == dtype
    )


_NOTES = _fields("f8", "stage_note", "before_row", "exchange_group", "exchange_outlet")
_OF_GRAINS = _fields("f8", "heat_grain", "grain", "cell_grain", "expansion_grain")
_OF_WALLS = _fields("f8", "wall", "heat_wall", "origin_row", "surface_row", "ahead_row")
_CALLED = {"generated": "the heat generated", "nonaffine": "the displacement beside the mean flow"}
_NUMBERS, _COUNTS = _fields("f8", "one"), _fields("i8", "one")


def find_absurd_value(state: State, model: Model) -> str | None:
    """Name the first value that is not finite or above `LARGEST`, and its owner; None without one.

    Impulses and heat, which friction may depend on, come first: where one is wrong, velocities
    follow within a step.
    """
    for name in (*_CONTACTS, *_OF_GRAINS, *_OF_WALLS, *NAMES, *_NUMBERS, *_NOTES):
        values = np.atleast_1d(getattr(state, name))
        wrong = ~(np.abs(values) <= LARGEST)
        if name == "wall_temperature":  # nan where none is prescribed
            wrong &= ~np.isnan(values)
        if wrong.any():
            row = int(np.argwhere(wrong)[0][0])
            value = float(values[wrong][0])
            what = f"absurd ({value:.3g})" if np.isfinite(value) else "not finite"
            return f"{_owner(state, model, name, row)} is {what}"
    return None


def find_misfit(state: State, model: Model) -> str | None:
    """Say what of a state read from a file does not fit the model; None if all does."""
    for name, shape in state_shapes(model).items():
        if getattr(state, name).shape != shape:
            return f"{name} has shape {getattr(state, name).shape} instead of {shape}"
    count = model.wall_count
    per_wall = (("wall_origin", (count, 3)), ("wall_surface", (count,)), ("wall_ahead", (count,)))
    for name, shape in per_wall:
        if getattr(state, name).shape not in ((0, *shape[1:]), shape):
            return f"{name} has shape {getattr(state, name).shape} instead of {shape}"
    if model.is_cell and not (state.wall_position[0, :XY] > 0.0).all():
        return "the cell has no area"
    wrong = _find_wrong_pairs(state, model)
    if wrong is not None:
        return wrong
    for name in ("tile", "near_late", *_COUNTS):
        if (np.asarray(getattr(state, name)) < 0).any():
            return f"{name} is negative"
    if state.presence.max(initial=0) > max(Presence):
        return "presence holds a number that means nothing"
    return find_absurd_value(state, model)


def _find_wrong_pairs(state: State, model: Model) -> str | None:
    n, shapes, has_points = model.grain_count, model.shape_count, model.outlines is not None
    only = {
        "contact_couple": model.laws.rolling.size > 0,
        "contact_point": has_points,
        "near_points": has_points,
        "near_late": state.near_late.size > 0,
    }
    for name, (i, j) in {**_CONTACTS, **_PAIRS}.items():
        first, second = getattr(state, i), getattr(state, j)
        rows = first.size if only.get(name, True) else 0
        if not (first.shape == second.shape and getattr(state, name).shape[:1] == (rows,)):
            return f"{i}, {j} and {name} have different lengths"
        are_pairs = (first >= 0) & (first < n) & (second > first) & (second < n + shapes)
        order = first.astype(np.int64) * (n + shapes) + second
        step = np.diff(order) + has_points  # grains that are no discs may touch at several points
        if not (are_pairs.all() and (step > 0).all()):
            return f"{i} and {j} are not pairs of shapes in ascending order"
    return None


def _owner(state: State, model: Model, name: str, row: int) -> str:
    plain = _CALLED.get(name, f"the {name.replace('_', ' ')}")
    if name in _OF_GRAINS:
        return f"{plain} of {model.name_of(row)}"
    if name in _OF_WALLS:
        return f"{plain} of wall {model.walls.names[row]}"
    if name in _CONTACTS:
        i, j = (int(getattr(state, index)[row]) for index in _CONTACTS[name])
        n = model.grain_count
        other = model.name_of(j) if j < n else f"wall {model.walls.names[model.shapes.wall[j - n]]}"
        return f"{plain} between {model.name_of(i)} and {other}"
    if name in NAMES:
        return f"{NAMES[name][row]} in the {plain.removeprefix('the ')}"
    return plain


# ---- A switch for tests: all initial positions moved by an ulp, to show what the last bits decide.
#
# `MULTICOR_NUDGE=SEED` moves each coordinate of each grain at random to the next number up or down,
# or leaves it. Flows are chaotic: after some hundred collisions the two runs share only their
# statistics. A test that passes for several seeds checks physics; one that does not depends on one
# particular trajectory. Never set it for a run that is to be kept: the provenance in run.json has
# an entry `nudge` if it was.

VARIABLE = "MULTICOR_NUDGE"

_DIGITS = 18
"""Of the longest seed: below 2⁶³."""


class NudgeError(ValueError):
    """The switch is set to something that is not a seed: one message for the user."""

    exit_code = 5


def nudge_seed() -> int | None:
    """The seed in the environment; None if positions stay; `NudgeError` if it is not a seed."""
    value = os.environ.get(VARIABLE, "")
    if not value:
        return None
    if not (value.isascii() and value.isdigit() and len(value) <= _DIGITS):
        message = (
            f"{VARIABLE}={value} is not a valid seed; unset it, or give a whole number of at most "
            f"{_DIGITS} digits (for tests only)"
        )
        raise NudgeError(message)
    return int(value)


def nudge(position: Floats, period: float, seed: int, height: float = 0.0) -> Floats:
    """Move x and y to a neighboring number or not at all, as ``seed`` decides.

    ``position`` holds x, y [m] and angle [rad], shape ``(n, 3)``, x within the period, if there is
    one, and y within the ``height`` of a cell. Zeros stay: the next number is 10⁻³²⁴ away, which no
    arithmetic would notice.
    """
    center = position[:, :2]
    raw = np.random.Philox(seed).random_raw(center.size) % np.uint64(3)
    lot = raw.astype(np.int64).reshape(center.shape) - 1
    beside = np.nextafter(center, np.where(lot > 0, np.inf, -np.inf))
    moved = np.where((lot == 0) | (center == 0.0), center, beside)
    for axis, length in ((X, period), (Y, height)):
        if length > 0.0:
            moved[:, axis] = np.where(moved[:, axis] < length, moved[:, axis], center[:, axis])
    return np.column_stack([moved, position[:, ANGLE]])
