"""Conduction through the contact spot of two smooth elastic spheres.

Formula: Hertz' contact radius ``a_c = (3 F a*/4E*)^⅓`` and the constriction of the heat flow on both sides of an isothermal spot
between half-spaces in series, ``H = 2 λ_h a_c`` with ``λ_h = 2 λ_i λ_j/(λ_i + λ_j)``.

Source: K. L. Johnson, Contact Mechanics (1985), eq. 4.22–4.24 (radius, approach, pressure); R. Holm, Electric Contacts (1967),
and G. K. Batchelor & R. W. O'Brien, Proc. R. Soc. Lond. A 355 (1977) 313 (constriction); W. L. Vargas & J. J. McCarthy, AIChE
J. 47 (2001) 1052 (use for grains).

Validity: smooth, elastic, non-adhesive spheres with ``a_c ≪ a`` in vacuum; the grains must be nearly isothermal inside, which the
Biot number ``H/(λ a) ≪ 1`` measures. Steel of 215 MPa yields first at the center of the spot where ``p_0 ≈ 1.6 σ_y``, already at
0.011 N for grains of 3 mm; the spot is then larger than computed. Contacts in parallel on one grain do not disturb each other.
Discs are treated as spheres of their radius: a line contact in two dimensions has no conductance that is independent of the size
of the bodies (its constriction resistance is logarithmic).
"""

from __future__ import annotations

from math import pi, sqrt

from multicor_cli.arithmetic import cbrt
from multicor_cli.engine.jit.formulas import formula


def contact_modulus(young_i: float, poisson_i: float, young_j: float, poisson_j: float) -> float:
    """Contact modulus E* [Pa] with ``1/E* = (1−ν_i²)/E_i + (1−ν_j²)/E_j``; E Young's modulus [Pa], ν Poisson's ratio (Hertz)."""
    return 1.0 / ((1.0 - poisson_i * poisson_i) / young_i + (1.0 - poisson_j * poisson_j) / young_j)


@formula
def effective_radius(a_i: float, a_j: float) -> float:
    """Effective radius ``a* = a_i a_j/(a_i + a_j)`` [m]; on a plane wall it is a_i (Hertz)."""
    return a_i * a_j / (a_i + a_j)


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


def peak_pressure(force: float, contact_radius: float) -> float:
    """Largest pressure ``p_0 = 3 F/(2π a_c²)`` [Pa] (Johnson, eq. 4.24); F [N], a_c [m]; 0 without a spot."""
    if contact_radius <= 0.0:
        return 0.0
    return 1.5 * force / (pi * contact_radius * contact_radius)


def harmonic_conductivity(k_i: float, k_j: float) -> float:
    """Harmonic mean ``λ_h = 2 λ_i λ_j/(λ_i + λ_j)`` [W/(m K)]: two half-spaces in series (Holm)."""
    return 2.0 * k_i * k_j / (k_i + k_j)


@formula
def hertz_conductance(harmonic: float, contact_radius: float) -> float:
    """Conductance of the spot ``H = 2 λ_h a_c`` [W/K]; λ_h [W/(m K)], a_c [m] (Holm; Batchelor & O'Brien 1977)."""
    return 2.0 * harmonic * contact_radius


@formula
def biot_number(conductance: float, conductivity: float, radius: float) -> float:
    """Biot number ``Bi = H/(λ a)``: the resistance inside a grain over that of its contact; it should be far below 1.

    Args:
        conductance: H [W/K].
        conductivity: λ of the grain [W/(m K)].
        radius: Its radius a [m].
    """
    return conductance / (conductivity * radius)


def pair_time(capacity_i: float, capacity_j: float, conductance: float) -> float:
    """Time constant of two bodies ``τ = 1/(H (1/C_i + 1/C_j))`` [s] (derived); an infinite capacity is a body of fixed temperature.

    Args:
        capacity_i: Heat capacity C_i [J/K].
        capacity_j: Heat capacity C_j [J/K].
        conductance: H between them [W/K].
    """
    return 1.0 / (conductance * (1.0 / capacity_i + 1.0 / capacity_j))


def line_half_width(force_per_length: float, effective_radius: float, modulus: float) -> float:
    """Half-width of the line contact of parallel cylinders ``b = √(4 F' a*/(π E*))`` [m] (Johnson, eq. 4.43).

    For comparison with two-dimensional codes that take ``2 λ_h b`` per length for the conductance, which is a convention.

    Args:
        force_per_length: F' [N/m].
        effective_radius: a* [m].
        modulus: E* [Pa].
    """
    return sqrt(4.0 * force_per_length * effective_radius / (pi * modulus))
