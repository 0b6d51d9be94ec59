"""Elastic contact of smooth spheres (Hertz): the spot that conducts, and the deflection that rigid grains leave out.

Source: K. L. Johnson, Contact Mechanics (1985), eq. 4.22–4.24. Discs are treated as spheres of their radius.
"""

from __future__ import annotations

from collections.abc import Mapping

from multicor_cli.arithmetic import cbrt
from multicor_cli.engine.geometry.radii import effective_radius
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.model.model import Model


def contact_modulus(young_i: float, poisson_i: float, young_j: float, poisson_j: float) -> float:
    """Contact modulus E* [Pa] with ``1/E* = (1−ν_i²)/E_i + (1−ν_j²)/E_j``; E Young's modulus [Pa], ν Poisson's ratio (Hertz)."""
    return 1.0 / ((1.0 - poisson_i * poisson_i) / young_i + (1.0 - poisson_j * poisson_j) / young_j)


@formula
def contact_radius(force: float, effective_radius: float, modulus: float) -> float:
    """Radius of the contact spot ``a_c = (3 F a*/4E*)^⅓`` [m] (Johnson, eq. 4.22); 0 for a force that is not positive.

    Args:
        force: Normal force F [N].
        effective_radius: a* [m].
        modulus: Contact modulus E* [Pa].
    """
    if force <= 0.0:
        return 0.0
    return cbrt(0.75 * force * effective_radius / modulus)


def approach(contact_radius: float, effective_radius: float) -> float:
    """Approach of the two bodies ``δ = a_c²/a*`` [m] (Johnson, eq. 4.23); arguments [m]."""
    return contact_radius * contact_radius / effective_radius


def relative_deflection(force: float, radius: float, young: float, poisson: float) -> float:
    """Deflection of two equal elastic spheres pressed together, over their diameter: δ/(2a).

    δ = a_c²/a* with the contact radius a_c and a* = a/2. Discs are treated as spheres of their radius.

    Args:
        force: Normal force F [N].
        radius: Radius a [m].
        young: Young's modulus E [Pa].
        poisson: Poisson's ratio ν.
    """
    modulus = contact_modulus(young, poisson, young, poisson)
    effective = effective_radius(radius, radius)
    return approach(contact_radius(force, effective, modulus), effective) / (2.0 * radius)


def largest_deflection(model: Model, force: float, elastic: Mapping[str, tuple[float, float]]) -> float | None:
    """The largest `relative_deflection` of two equal grains, the smallest of each material; None if ``elastic`` has none of theirs.

    Args:
        model: Grains and their materials.
        force: Normal force F [N].
        elastic: Young's modulus [Pa] and Poisson's ratio by the name of the material.
    """
    grains, found = model.grains, []
    for index, name in enumerate(model.materials):
        radii = grains.radius[grains.material == index]
        if radii.size and name in elastic:
            found.append(relative_deflection(force, float(radii.min()), *elastic[name]))
    return max(found, default=None)
