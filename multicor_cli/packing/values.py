"""Values of grains that come from elsewhere: finite and within bounds, or named with their row."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats
from multicor_cli.packing.errors import NAMED
from multicor_cli.scenario.base import COORDINATE_BOUNDS, KELVIN_BOUNDS, NUMBER_BOUNDS, RADIUS_BOUNDS

_BOUNDS = {"x": COORDINATE_BOUNDS, "y": COORDINATE_BOUNDS, "radius": RADIUS_BOUNDS, "temperature": KELVIN_BOUNDS}
"""Bounds of columns, those of the keys of a scenario; all others are angles [rad], velocities [m/s] and spins [rad/s]."""

_UNITS = {"x": " m", "y": " m", "radius": " m", "temperature": " K"}


def find_fault(name: str, value: float) -> str:
    """What is wrong with a value of the column ``name`` (``x, y, radius, temperature`` or a motion); empty if nothing is."""
    if not math.isfinite(value):
        return f"{name} = {value} is not finite"
    low, high = _BOUNDS.get(name, NUMBER_BOUNDS)
    if low <= value <= high:
        return ""
    hint = f" (from degrees Celsius: {value + 273.15:g})" if name == "temperature" and -273.15 < value <= 0.0 else ""
    unit = _UNITS.get(name, "")
    return f"{name} = {value:g}{unit} is not between {low:g} and {high:g}{unit}{hint}"


def describe_faults(columns: Mapping[str, Floats]) -> str:
    """The first faulty rows and how many more there are; empty if all values are fine.

    Args:
        columns: Values of each column, all of shape ``(n,)``, ``radius`` among them.
    """
    rows = faulty_rows(columns)
    if not rows.size:
        return ""
    more = f"; and {rows.size - NAMED} more rows" if rows.size > NAMED else ""
    return "; ".join(_name_rows(columns, rows[:NAMED])) + more


def faulty_rows(columns: Mapping[str, Floats]) -> NDArray[np.int64]:
    """Rows with a value that `find_fault` finds something wrong with."""
    bad = np.zeros(columns["radius"].shape, np.bool_)
    for name, values in columns.items():
        low, high = _BOUNDS.get(name, NUMBER_BOUNDS)
        bad |= ~((values >= low) & (values <= high))
    return np.flatnonzero(bad)


def _name_rows(columns: Mapping[str, Floats], rows: NDArray[np.int64]) -> Iterator[str]:
    for row in rows:
        for name, values in columns.items():
            if fault := find_fault(name, float(values[row])):
                yield f"row {row}: {fault}"
                break
