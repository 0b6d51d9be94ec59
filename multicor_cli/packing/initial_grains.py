"""What packings give and need: grains, their masses, and the region."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import SHAPE_FACTOR, Floats
from multicor_cli.model.outlines import Outlines

NAMED = 5
"""So many faulty lines, rows or grains are named."""

# ---- Masses and moments of inertia of grains

Shape = Literal["disc", "sphere"]


class Forms(NamedTuple):
    """Grains that are no discs.

    Attributes:
        outlines: Their outlines [m].
        gyration: Square of the radius of gyration of each about its center [m²], shape ``(n,)``.
    """

    outlines: Outlines
    gyration: Floats

    def scaled(self, factor: Floats) -> Forms:
        """The same shapes, each so many times as large; shape ``(n,)``."""
        return Forms(self.outlines.scaled(factor), self.gyration * (factor * factor))

    def of_grains(self, which: NDArray[np.int64]) -> Forms:
        """Those of some grains, in this order."""
        return Forms(self.outlines.of_grains(which), self.gyration[which])


def masses(
    radius: Floats,
    density: float,
    shape: Shape,
    thickness: float | None,
    forms: Forms | None = None,
) -> Floats:
    """Mass of each grain [kg]: π a² h ρ of a disc of thickness h, 4/3 π a³ ρ of a sphere.

    Radii a [m], mean density ρ [kg/m³], thickness h [m]; A h ρ of a grain of another area A.
    """
    if shape == "sphere":
        return np.asarray(4.0 / 3.0 * math.pi * (radius * radius * radius) * density)
    assert thickness is not None  # the scenario has been checked
    area = math.pi * (radius * radius) if forms is None else forms.outlines.area
    return np.asarray(area * thickness * density)


def inertias(radius: Floats, mass: Floats, shape: Shape, forms: Forms | None = None) -> Floats:
    """Moments of inertia about the center [kg m²]: ½ m a² of a disc, 2/5 m a² of a sphere.

    Of other grains m times the square of the radius of gyration.
    """
    if forms is not None:
        return np.asarray(mass * forms.gyration)
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
    real ones or those beside its mean flow; None if the packing tells none. ``forms`` is None if
    all are discs or spheres; else radii are how far grains reach.
    """

    radius: Floats
    position: Floats
    velocity: Floats
    temperature: Floats | None = None
    is_velocity_real: bool | None = None
    forms: Forms | None = None

    @classmethod
    def at_rest(cls, radius: Floats, position: Floats, forms: Forms | None = None) -> InitialGrains:
        """Grains that do not move; ``position`` has shape ``(n, 2)``, or ``(n, 3)`` with angles."""
        full = np.zeros((radius.size, 3))
        full[:, : position.shape[-1]] = position
        return cls(radius, full, np.zeros((radius.size, 3)), forms=forms)
