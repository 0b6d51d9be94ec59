"""The shipped scenario `configs/lattice14.toml` in numbers, read without the program that is
checked against it.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

CONFIG = Path(__file__).parents[2] / "configs" / "lattice14.toml"
RADIUS = 1e-3
"""Radius of the grains [m], as the paper states it."""


@dataclass(frozen=True)
class Case:
    """What the finite elements need of the scenario.

    Attributes:
        conductance: H of a contact [W/K].
        capacity: C of a grain [J/K].
        biot: H/(λ h), h the thickness of the discs.
        spot_biot: H/(λ a) = 2 a_c/a, the Biot number of a Hertz contact of spheres.
        duration: Time that the scenario covers [s].
    """

    conductance: float
    capacity: float
    biot: float
    spot_biot: float
    duration: float

    @property
    def time_unit(self) -> float:
        """C/H [s]."""
        return self.capacity / self.conductance


def read_case(path: Path = CONFIG) -> Case:
    """The case of a scenario file with one material, one group of discs and a prescribed contact
    force.

    Hertz: a_c = (3 F a*/(4 E*))^⅓ with a* = a/2 and 1/E* = 2 (1 − ν²)/E; H = 2 λ a_c.

    Raises:
        OSError: If the file cannot be read.
        KeyError: If the scenario has not these tables.
    """
    scenario = tomllib.loads(path.read_text(encoding="utf-8"))
    (material,), (group,), (stage,) = (
        scenario["materials"].values(),
        scenario["particles"],
        scenario["loading"],
    )
    modulus = material["young"] / (2.0 * (1.0 - material["poisson"] ** 2))
    spot = (3.0 * scenario["heat"]["force"]["prescribed"] * 0.5 * RADIUS / (4.0 * modulus)) ** (
        1.0 / 3.0
    )
    conductance = 2.0 * material["conductivity"] * spot
    volume = np.pi * RADIUS**2 * group["thickness"]
    return Case(
        conductance=conductance,
        capacity=float(material["density"] * material["heat_capacity"] * volume),
        biot=conductance / (material["conductivity"] * group["thickness"]),
        spot_biot=conductance / (material["conductivity"] * RADIUS),
        duration=stage["duration"],
    )
