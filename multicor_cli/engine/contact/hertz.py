"""Elastic deflection of a contact that the rigid-grain model neglects (Hertz)."""

from __future__ import annotations

from multicor_cli.engine.heat import conduction


def hertz_flattening(force: float, radius: float, young: float, poisson: float) -> float:
    """Deflection of two equal elastic spheres pressed together, over their diameter: δ/(2a).

    δ = a_c²/a* with the contact radius a_c of `thermal.conduction` and a* = a/2. Discs are treated as spheres of their radius.

    Args:
        force: Normal force F [N].
        radius: Radius a [m].
        young: Young's modulus E [Pa].
        poisson: Poisson's ratio ν.
    """
    modulus = conduction.contact_modulus(young, poisson, young, poisson)
    effective = conduction.effective_radius(radius, radius)
    return conduction.approach(conduction.contact_radius(force, effective, modulus), effective) / (2.0 * radius)
