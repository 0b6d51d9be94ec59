"""Masses and moments of inertia of grains and solid polygons."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from multicor_cli.model.model import SHAPE_FACTOR, Floats
from multicor_cli.model.shapes import Polygon

Shape = Literal["disc", "sphere"]


def masses(radius: Floats, density: float, shape: Shape, thickness: float | None) -> Floats:
    """Mass of each grain [kg]: π a² h ρ of a disc of thickness h, 4/3 π a³ ρ of a sphere.

    Args:
        radius: Radii a [m].
        density: ρ [kg/m³].
        shape: Shape of the grains.
        thickness: h [m], for discs.
    """
    if shape == "sphere":
        return np.asarray(4.0 / 3.0 * math.pi * (radius * radius * radius) * density)
    if thickness is None:
        message = "discs need a thickness"
        raise ValueError(message)
    return np.asarray(math.pi * (radius * radius) * thickness * density)


def inertias(radius: Floats, mass: Floats, shape: Shape) -> Floats:
    """Moment of inertia of each grain about its center [kg m²]: ½ m a² of a disc, 2/5 m a² of a sphere."""
    return np.asarray(mass * (radius * radius) / SHAPE_FACTOR[shape])


def prism_inertia(polygon: Polygon, density: float, height: float) -> tuple[float, float]:
    """Mass ρ h A [kg] and moment of inertia about the centroid ρ h ∫ r² dA [kg m²] of a polygon of thickness h [m]."""
    return density * height * polygon.size, density * height * polygon.polar_moment
