"""Values of grains that come from elsewhere: finite and within bounds, or named with their row."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats
from multicor_cli.packing.errors import NAMED
from multicor_cli.scenario.base import KELVIN_BOUNDS

MAX_COORDINATE = 1e6
"""Bound on coordinates and radii [m], as in the scenario file."""
MAX_SPEED = 1e12
"""Bound on angles [rad], velocities [m/s] and spins [rad/s]."""


def find_fault(name: str, value: float) -> str:
    """What is wrong with a value of the column ``name`` (``x, y, radius, temperature`` or a motion); empty if nothing is."""
    if not math.isfinite(value):
        return f"{name} = {value} is not finite"
    if name == "radius" and not 0.0 < value <= MAX_COORDINATE:
        return f"radius = {value:g} m is not between 0 and {MAX_COORDINATE:g} m"
    if name == "temperature" and not KELVIN_BOUNDS[0] <= value <= KELVIN_BOUNDS[1]:
        hint = f" (from degrees Celsius: {value + 273.15:g})" if -273.15 < value <= 0.0 else ""
        return f"temperature = {value:g} K is not between {KELVIN_BOUNDS[0]:g} and {KELVIN_BOUNDS[1]:g} K{hint}"
    low, high = _bounds(name)
    if not low <= value <= high:
        return f"{name} = {value:g} m is beyond {high:g} m" if name in ("x", "y") else f"{name} = {value:g} is beyond {high:g}"
    return ""


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
    bad = ~(columns["radius"] > 0.0)
    for name, values in columns.items():
        low, high = _bounds(name)
        bad |= ~((values >= low) & (values <= high))
    return np.flatnonzero(bad)


def _bounds(name: str) -> tuple[float, float]:
    if name == "temperature":
        return KELVIN_BOUNDS
    size = MAX_COORDINATE if name in ("x", "y", "radius") else MAX_SPEED
    return -size, size


def _name_rows(columns: Mapping[str, Floats], rows: NDArray[np.int64]) -> Iterator[str]:
    for row in rows:
        for name, values in columns.items():
            if fault := find_fault(name, float(values[row])):
                yield f"row {row}: {fault}"
                break
