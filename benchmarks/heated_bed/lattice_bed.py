"""The same heating of a perfect triangular lattice under gravity, solved exactly and without the
program.

Rows of touching spheres, frictionless, each in the hollows of the one below: an inclined contact
with k rows above it carries k m g/√3, the floor N m g. Rows then have one temperature each, and C
dθ/dt = −K θ + b is solved by the eigenvectors of K.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

HEIGHT = 0.304
"""Height of the lattice [m]: 116 rows of spheres of 3 mm."""


@dataclass(frozen=True)
class Sphere:
    """A grain, and the material of the floor.

    Attributes:
        radius: a [m].
        density: ρ [kg/m³].
        heat_capacity: c_p [J/(kg K)].
        conductivity: λ [W/(m K)].
        young: E [Pa].
        poisson: ν.
        gravity: g [m/s²].
    """

    radius: float
    density: float
    heat_capacity: float
    conductivity: float
    young: float
    poisson: float
    gravity: float

    @property
    def mass(self) -> float:
        """m [kg]."""
        return self.density * 4.0 / 3.0 * np.pi * self.radius**3

    @property
    def capacity(self) -> float:
        """C [J/K]."""
        return self.mass * self.heat_capacity


class Profile(NamedTuple):
    """Temperatures of the rows.

    Attributes:
        eta: Heights of the centers over the height of the lattice, shape ``(rows,)``.
        theta: θ, shape ``(rows,)``.
    """

    eta: Floats
    theta: Floats

    def at(self, eta: Floats) -> Floats:
        """θ between the rows, linear."""
        return np.interp(eta, self.eta, self.theta)


def heat_lattice(sphere: Sphere, duration: float, gas: float = 0.0) -> Profile:
    """θ of the rows after ``duration`` [s] on a floor of θ = 1, with a gas of conductivity ``gas``
    [W/(m K)]; 0: vacuum.
    """
    pitch = sphere.radius * np.sqrt(3.0)
    count = int((HEIGHT - 2.0 * sphere.radius) / pitch) + 1
    weight = sphere.mass * sphere.gravity
    above = np.arange(count - 1, 0, -1)
    links = _conductance(sphere, above * weight / np.sqrt(3.0), 0.5 * sphere.radius, gas)
    # Twice the gas of a gap of grains
    floor = _conductance(sphere, np.array([count * weight]), sphere.radius, 2.0 * gas)[0]
    between = 2.0 * links  # every grain has two contacts with the row above
    matrix = (
        np.diag(np.r_[between, 0.0] + np.r_[floor, between])
        - np.diag(between, 1)
        - np.diag(between, -1)
    )
    rate, modes = np.linalg.eigh(matrix / sphere.capacity)
    drive = modes[0] * floor / sphere.capacity
    theta = modes @ (drive * -np.expm1(-rate * duration) / rate)
    return Profile((sphere.radius + pitch * np.arange(count)) / HEIGHT, theta)


def _conductance(sphere: Sphere, force: Floats, reduced: float, gas: float) -> Floats:
    """Conductance of contacts: 2 λ s, s = (3 F a*/4E*)^⅓, and heat straight through the gas of the
    gap beside the spot [W/K].
    """
    modulus = sphere.young / (2.0 * (1.0 - sphere.poisson**2))
    spot = (0.75 * force * reduced / modulus) ** (1.0 / 3.0)
    a, z = sphere.radius, np.sqrt(sphere.radius**2 - spot**2)
    return 2.0 * sphere.conductivity * spot + np.pi * gas * (a * np.log(a / (a - z)) - z)
