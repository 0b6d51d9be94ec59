"""The cases in neutral terms: arrays and numbers that every code starts from."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


TANGENTIAL_SHARE = 0.5
"""Damping of the soft contacts along the tangent over that along the normal."""


@dataclass(frozen=True)
class SoftContact:
    """The contact of the soft codes: a spring and a damper along the normal, the same and a slider
    along the tangent.

    Attributes:
        stiffness: k_n [N/m].
        tangential: k_t [N/m].
        damping: γ_n, so that the damper has the constant m_eff γ_n [1/s].
        friction: μ.
        collision: Duration of a collision of the two smallest grains [s].
    """

    stiffness: float
    tangential: float
    damping: float
    friction: float
    collision: float


def soft_contact(
    stiffness: float, friction: float, mass: Floats, restitution: float
) -> SoftContact:
    """A linear contact with k_t = 2/7 k_n whose damper gives the restitution to grains of the mean
    mass.

    Args:
        stiffness: k_n [N/m].
        friction: μ.
        mass: Masses of the grains [kg].
        restitution: e between 0 and 1, both excluded.
    """
    log = math.log(restitution)
    ratio = -log / math.hypot(math.pi, log)  # damping over critical damping
    damping = 2.0 * ratio * math.sqrt(stiffness / (0.5 * float(mass.mean())))
    fastest = math.sqrt(stiffness / (0.5 * float(mass.min())))
    collision = math.pi / math.sqrt(fastest**2 - 0.25 * damping**2)
    return SoftContact(stiffness, 2.0 / 7.0 * stiffness, damping, friction, collision)


@dataclass(frozen=True)
class Glued:
    """Grains glued to a wall.

    Attributes:
        position: Centers at the start [m], shape ``(k, 2)``.
        radius: Radii [m], shape ``(k,)``.
    """

    position: Floats
    radius: Floats


@dataclass(frozen=True)
class Layer:
    """A sheared layer without gravity, periodic in x, between two rough walls; spheres with their
    centers in a plane.

    Attributes:
        position: Centers of the flowing grains [m], shape ``(n, 2)``.
        velocity: v_x, v_y [m/s] and spin [rad/s], shape ``(n, 3)``.
        radius: Radii [m], shape ``(n,)``.
        density: Density of the grains [kg/m³].
        friction: μ.
        bottom: The lower wall, at rest.
        top: The upper wall; it moves along x at a given speed and along y under its load.
        period: Period in x [m].
        speed: Speed of the upper wall along x [m/s].
        rise: Velocity of the upper wall along y at the start [m/s].
        wall_mass: Mass of the upper wall [kg].
        load: Force that presses the upper wall down [N].
        wall_damping: Constant of the damper on the upper wall's motion along y [N s/m].
        height: Distance of the centers of the walls at the start [m]; strain is speed × time over
            it.
    """

    position: Floats
    velocity: Floats
    radius: Floats
    density: float
    friction: float
    bottom: Glued
    top: Glued
    period: float
    speed: float
    rise: float
    wall_mass: float
    load: float
    wall_damping: float
    height: float

    @property
    def mass(self) -> Floats:
        """Masses of the flowing grains [kg], shape ``(n,)``."""
        return sphere_mass(self.radius, self.density)

    @property
    def pressure(self) -> float:
        """P, the load per length of the wall [N/m]."""
        return self.load / self.period

    @property
    def tau(self) -> float:
        """√(m̄/P) [s]."""
        return math.sqrt(float(self.mass.mean()) / self.pressure)

    @property
    def inertial(self) -> float:
        """Nominal inertial number, of the shear rate speed/height."""
        return self.speed / self.height * self.tau

    def duration(self, strain: float) -> float:
        """Time that a strain takes [s]."""
        return strain * self.height / self.speed

    @property
    def all_radius(self) -> Floats:
        """Radii of flowing grains, lower wall, upper wall in this order [m]."""
        return np.concatenate([self.radius, self.bottom.radius, self.top.radius])


@dataclass(frozen=True)
class FlowPlan:
    """Strains of a run.

    Attributes:
        settle: Strain before the measurement.
        strain: Strain that is measured.
        between: Strain between two frames; a divisor of the others.
    """

    settle: float
    strain: float
    between: float

    @property
    def frames(self) -> int:
        """Number of frames."""
        return max(1, round(self.strain / self.between))


@dataclass(frozen=True)
class Frames:
    """What a code did while it was measured; ``f`` frames at equal strains.

    Attributes:
        position: Centers of flowing grains, lower wall, upper wall [m], shape ``(f, n + k, 2)``.
        velocity: v_x of the flowing grains [m/s], shape ``(f, n)``.
        wall_force: Mean force of the grains on the upper wall since the frame before [N], shape
            ``(f, 2)``.
    """

    position: Floats
    velocity: Floats
    wall_force: Floats


def sphere_mass(radius: Floats, density: float) -> Floats:
    """Masses of spheres [kg]."""
    return density * 4.0 / 3.0 * math.pi * radius**3


@dataclass(frozen=True)
class Bed:
    """Grains above a level floor at y = 0, periodic in x, under gravity.

    Attributes:
        position: Centers at the start [m], shape ``(n, 2)``; all are at rest.
        radius: Radii [m], shape ``(n,)``.
        density: Density of the grains [kg/m³].
        friction: μ.
        period: Period in x [m].
        gravity: g [m/s²].
        layers: Height of the dense bed over the mean diameter, for the pressure on the floor.
    """

    position: Floats
    radius: Floats
    density: float
    friction: float
    period: float
    gravity: float
    layers: float

    @property
    def mass(self) -> Floats:
        """Masses of the grains [kg], shape ``(n,)``."""
        return sphere_mass(self.radius, self.density)

    @property
    def diameter(self) -> float:
        """Mean diameter [m]."""
        return 2.0 * float(self.radius.mean())

    @property
    def pressure(self) -> float:
        """Weight per length of the floor: layers m̄ g/d̄ [N/m]."""
        return float(self.mass.sum()) * self.gravity / self.period


@dataclass(frozen=True)
class BedFrames:
    """A bed at equal times after its start; ``f`` frames.

    Attributes:
        seconds: Time of the program between a frame and the one before [s], shape ``(f,)``.
        position: Centers [m], shape ``(f, n, 2)``.
        velocity: v_x, v_y [m/s], shape ``(f, n, 2)``.
        floor_force: Mean force on the floor since the frame before, over the weight, shape
            ``(f,)``.
        steps: Steps between two frames.
        dt: Time step [s].
    """

    seconds: Floats
    position: Floats
    velocity: Floats
    floor_force: Floats
    steps: int
    dt: float
