"""What cannot be in a state: values not finite or absurd, shapes and indices that do not fit."""

from __future__ import annotations

import numpy as np

from multicor_cli.model.books import NAMES, stored_fields
from multicor_cli.model.columns import XY
from multicor_cli.model.model import Model
from multicor_cli.model.state import Presence, State, state_shapes

LARGEST = 1e50
"""Larger magnitudes are absurd in SI units, and their squares may not be finite."""

_CONTACTS = {
    "contact_impulse": ("contact_i", "contact_j"),
    "contact_couple": ("contact_i", "contact_j"),
    "mean_force": ("mean_i", "mean_j"),
}
_PAIRS = {"near_j": ("near_i", "near_j"), "bridge_j": ("bridge_i", "bridge_j")}


def _fields(dtype: str, *dims: str) -> tuple[str, ...]:
    found = stored_fields(State)
    return tuple(
        name
        for dim in dims
        for name, about in found.items()
        if about.dims[0] == dim and about.dtype == dtype
    )


_NOTES = _fields("f8", "stage_note", "before_row", "exchange_group", "exchange_outlet")
_OF_GRAINS, _OF_WALLS = (
    _fields("f8", "heat_grain", "grain", "cell_grain", "expansion_grain"),
    _fields("f8", "wall", "heat_wall", "origin_row", "surface_row"),
)
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
    for name, shape in (("wall_origin", (count, 3)), ("wall_surface", (count,))):
        if getattr(state, name).shape not in ((0, *shape[1:]), shape):
            return f"{name} has shape {getattr(state, name).shape} instead of {shape}"
    if model.is_cell and not (state.wall_position[0, :XY] > 0.0).all():
        return "the cell has no area"
    wrong = _find_wrong_pairs(state, model)
    if wrong is not None:
        return wrong
    if (state.tile < 0).any():
        return "tile is negative"
    for name in _COUNTS:
        if getattr(state, name) < 0:
            return f"{name} is negative"
    if state.presence.max(initial=0) > max(Presence):
        return "presence holds a number that means nothing"
    return find_absurd_value(state, model)


def _find_wrong_pairs(state: State, model: Model) -> str | None:
    n, shapes = model.grain_count, model.shape_count
    for name, (i, j) in {**_CONTACTS, **_PAIRS}.items():
        first, second = getattr(state, i), getattr(state, j)
        rows = first.size if name != "contact_couple" or model.laws.rolling.size else 0
        if not (first.shape == second.shape and getattr(state, name).shape[:1] == (rows,)):
            return f"{i}, {j} and {name} have different lengths"
        are_pairs = (first >= 0) & (first < n) & (second > first) & (second < n + shapes)
        order = first.astype(np.int64) * (n + shapes) + second
        if not (are_pairs.all() and (np.diff(order) > 0).all()):
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
