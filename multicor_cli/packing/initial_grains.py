"""What packings give and need: grains, their masses, the region, and what goes wrong."""

from __future__ import annotations

import io
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from multicor_cli.files import open_regular
from multicor_cli.model.model import SHAPE_FACTOR, Floats
from multicor_cli.scenario.base import (
    COORDINATE_BOUNDS,
    KELVIN_BOUNDS,
    NUMBER_BOUNDS,
    RADIUS_BOUNDS,
)

# ---- What goes wrong while bodies are made, before it is tied to a place in the scenario file

NAMED = 5
"""So many faulty lines, rows or grains are named."""

LINE_LIMIT = 10_000
"""So much of a line is read at a time [characters]: a file may be one line as long as itself."""


def text_lines(path: Path, most: int) -> Iterator[str]:
    """Lines of a UTF-8 file of at most ``most`` bytes, in pieces of `LINE_LIMIT` if longer."""
    with io.TextIOWrapper(open_regular(path, most), encoding="utf-8-sig", newline="") as file:
        yield from iter(lambda: file.readline(LINE_LIMIT), "")


# ---- Values of grains that come from elsewhere: finite and within bounds, or named with their row

_BOUNDS = {
    "x": COORDINATE_BOUNDS,
    "y": COORDINATE_BOUNDS,
    "radius": RADIUS_BOUNDS,
    "temperature": KELVIN_BOUNDS,
}
"""Bounds of columns, as of keys of a scenario; others are angles [rad], [m/s] and [rad/s]."""

_UNITS = {"x": " m", "y": " m", "radius": " m", "temperature": " K"}


def find_fault(name: str, value: float) -> str:
    """What is wrong with a value of ``x, y, radius, temperature`` or a motion; empty if nothing."""
    if not math.isfinite(value):
        return f"{name} = {value} is not finite"
    low, high = _BOUNDS.get(name, NUMBER_BOUNDS)
    if low <= value <= high:
        return ""
    is_celsius = name == "temperature" and -273.15 < value <= 0.0
    hint = f" (from degrees Celsius: {value + 273.15:g})" if is_celsius else ""
    unit = _UNITS.get(name, "")
    return f"{name} = {value:g}{unit} is not between {low:g} and {high:g}{unit}{hint}"


def describe_faults(columns: Mapping[str, Floats]) -> str:
    """Name the first faulty rows, and how many more; empty if none. Columns have shape ``(n,)``."""
    rows = faulty_rows(columns)
    if not rows.size:
        return ""
    named = []
    for row in rows[:NAMED]:
        faults = (find_fault(name, float(values[row])) for name, values in columns.items())
        named.append(f"row {row}: {next(filter(None, faults), '')}")
    more = f"; and {rows.size - NAMED} more rows" if rows.size > NAMED else ""
    return "; ".join(named) + more


def faulty_rows(columns: Mapping[str, Floats]) -> NDArray[np.int64]:
    """Rows with a value that `find_fault` finds something wrong with."""
    bad = np.zeros(columns["radius"].shape, np.bool_)
    for name, values in columns.items():
        low, high = _BOUNDS.get(name, NUMBER_BOUNDS)
        bad |= ~((values >= low) & (values <= high))
    return np.flatnonzero(bad)


# ---- Masses and moments of inertia of grains

Shape = Literal["disc", "sphere"]


def masses(radius: Floats, density: float, shape: Shape, thickness: float | None) -> Floats:
    """Mass of each grain [kg]: π a² h ρ of a disc of thickness h, 4/3 π a³ ρ of a sphere.

    Radii a [m], density ρ [kg/m³], thickness h [m].
    """
    if shape == "sphere":
        return np.asarray(4.0 / 3.0 * math.pi * (radius * radius * radius) * density)
    if thickness is None:
        message = "discs need a thickness"
        raise ValueError(message)
    return np.asarray(math.pi * (radius * radius) * thickness * density)


def inertias(radius: Floats, mass: Floats, shape: Shape) -> Floats:
    """Moments of inertia about the center [kg m²]: ½ m a² of a disc, 2/5 m a² of a sphere."""
    return np.asarray(mass * (radius * radius) / SHAPE_FACTOR[shape])


# ---- The rectangle that a packing fills


@dataclass(frozen=True)
class PackingRegion:
    """A rectangle [m]; ``is_periodic``: left and right are one, as it spans the period exactly.

    ``is_periodic_in_y``: so are bottom and top.
    """

    left: float
    bottom: float
    right: float
    top: float
    is_periodic: bool = False
    is_periodic_in_y: bool = False

    @property
    def width(self) -> float:
        return self.right - self.left

    @property
    def height(self) -> float:
        return self.top - self.bottom

    @property
    def area(self) -> float:
        return self.width * self.height

    @property
    def period(self) -> float:
        """Period in x [m]; 0 if the region is not periodic."""
        return self.width if self.is_periodic else 0.0


# ---- Grains that a packing brings: radii, places, motion and, from a run with heat, temperatures


@dataclass(frozen=True)
class InitialGrains:
    """Grains at rest or in motion.

    Radii [m]; positions x, y [m] and angle [rad], velocities [m/s] and spins [rad/s], shape
    ``(n, 3)``; temperatures [K], None if the packing does not tell them. In a cell velocities are
    real ones or those beside its mean flow; None if the packing tells none.
    """

    radius: Floats
    position: Floats
    velocity: Floats
    temperature: Floats | None = None
    is_velocity_real: bool | None = None

    @classmethod
    def at_rest(cls, radius: Floats, position: Floats) -> InitialGrains:
        """Grains that do not move; ``position`` has shape ``(n, 2)``."""
        full = np.zeros((radius.size, 3))
        full[:, :2] = position
        return cls(radius, full, np.zeros((radius.size, 3)))
