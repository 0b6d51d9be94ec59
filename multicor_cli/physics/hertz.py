"""Elastic deflection of a contact that the rigid-grain model neglects (Hertz)."""

from __future__ import annotations

import math


def hertz_flattening(force: float, radius: float, young: float, poisson: float) -> float:
    """Deflection of two equal elastic spheres pressed together, over their diameter: δ/(2a).

    δ = (3F/(4E* √a*))^⅔ with a* = a/2 and E* = E/(2(1−ν²)) (Hertz; K. L. Johnson, Contact Mechanics, 1985, eq. 4.23). Discs are
    treated as spheres of their radius.

    Args:
        force: Normal force F [N].
        radius: Radius a [m].
        young: Young's modulus E [Pa].
        poisson: Poisson's ratio ν.
    """
    modulus = young / (2.0 * (1.0 - poisson * poisson))
    deflection: float = (3.0 * force / (4.0 * modulus * math.sqrt(0.5 * radius))) ** (2.0 / 3.0)
    return deflection / (2.0 * radius)
