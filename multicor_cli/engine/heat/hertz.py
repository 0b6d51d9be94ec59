"""Elastic spheres, smooth and rough: spots that conduct, and deflections rigid grains leave out.

Formulas alone, no kernels.

Formula: Hertz' contact radius ``a_c = (3 F a*/4E*)^⅓`` and the constriction of the heat flow on
both sides of an isothermal spot between half-spaces in series, ``H = 2 λ_h a_c`` with
``λ_h = 2 λ_i λ_j/(λ_i + λ_j)``.

Source: K. L. Johnson, Contact Mechanics (1985), eq. 4.22–4.24 (radius, approach, pressure); R.
Holm, Electric Contacts (1967), and G. K. Batchelor & R. W. O'Brien, Proc. R. Soc. Lond. A 355
(1977) 313 (constriction); W. L. Vargas & J. J. McCarthy, AIChE J. 47 (2001) 1052 (use for grains).

Validity: smooth, elastic, non-adhesive spheres with ``a_c ≪ a`` in vacuum; the grains must be
nearly isothermal inside, which the Biot number ``H/(λ a) ≪ 1`` measures. Steel of 215 MPa yields
first at the center of the spot where ``p_0 ≈ 1.6 σ_y``, already at 0.011 N for grains of 3 mm; the
spot is then larger than computed. Contacts in parallel on one grain do not disturb each other.
Pieces of walls that a grain touches in one place (`engine/geometry/places.py`) have one spot, which
the sum of their forces makes, and share its conductance in proportion to their forces. Inside a
circle of radius R ``1/a* = 1/a − 1/R``. Discs and circles are treated as spheres of their radius: a
line contact in two dimensions has no conductance that is independent of the size of the bodies (its
constriction resistance is logarithmic).
"""

from __future__ import annotations

from collections.abc import Mapping
from math import pi

from multicor_cli.arithmetic import cbrt, power
from multicor_cli.engine.geometry.radii import effective_radius
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.model.model import Model

# ---- Smooth spheres (Hertz)


def contact_modulus(young_i: float, poisson_i: float, young_j: float, poisson_j: float) -> float:
    """Contact modulus ``1/E* = (1−ν_i²)/E_i + (1−ν_j²)/E_j`` (Hertz); E [Pa], Poisson's ratio ν."""
    return 1.0 / ((1.0 - poisson_i * poisson_i) / young_i + (1.0 - poisson_j * poisson_j) / young_j)


@formula
def contact_volume(force: float, effective_radius: float, modulus: float) -> float:
    """``a_c³ = 3 F a*/4E*`` [m³] of a contact spot, 0 if F is not positive; as `contact_radius`."""
    return 0.75 * force * effective_radius / modulus if force > 0.0 else 0.0


@formula
def contact_radius(force: float, effective_radius: float, modulus: float) -> float:
    """Radius of the contact spot ``a_c = (3 F a*/4E*)^⅓`` [m] (Johnson, eq. 4.22).

    Normal force F [N], a_c = 0 if it is not positive; a* [m]; contact modulus E* [Pa].
    """
    return cbrt(contact_volume(force, effective_radius, modulus))


def approach(contact_radius: float, effective_radius: float) -> float:
    """Approach of the two bodies ``δ = a_c²/a*`` [m] (Johnson, eq. 4.23); arguments [m]."""
    return contact_radius * contact_radius / effective_radius


def relative_deflection(force: float, radius: float, young: float, poisson: float) -> float:
    """Deflection of two equal elastic spheres pressed together, over their diameter: δ/(2a).

    δ = a_c²/a* with a* = a/2. Force F [N], radius a [m], Young's modulus E [Pa], Poisson's ratio ν.
    """
    modulus = contact_modulus(young, poisson, young, poisson)
    effective = effective_radius(radius, radius)
    return approach(contact_radius(force, effective, modulus), effective) / (2.0 * radius)


def largest_deflection(
    model: Model, force: float, elastic: Mapping[str, tuple[float, float]]
) -> float | None:
    """The largest `relative_deflection` of two equal grains, the smallest of each material.

    ``elastic``: Young's modulus [Pa] and Poisson's ratio by material; None if it has none of
    theirs.
    """
    grains, found = model.grains, []
    for index, name in enumerate(model.materials):
        radii = grains.radius[grains.material == index]
        if radii.size and name in elastic:
            found.append(relative_deflection(force, float(radii.min()), *elastic[name]))
    return max(found, default=None)


def harmonic_mean(first: float, second: float) -> float:
    """Harmonic mean ``λ_h = 2 λ_i λ_j/(λ_i + λ_j)`` [W/(m K)]: half-spaces in series (Holm)."""
    return 2.0 * first * second / (first + second)


@formula
def hertz_conductance(harmonic: float, contact_radius: float) -> float:
    """``H = 2 λ_h a_c`` of a spot [W/K]; λ_h [W/(m K)], a_c [m] (Holm; Batchelor & O'Brien)."""
    return 2.0 * harmonic * contact_radius


@formula
def biot_number(conductance: float, inner: float) -> float:
    """Biot number ``Bi = H/(λ a)``, to be ≪ 1: H [W/K], and ``inner`` λ a of a grain [W/K]."""
    return conductance / inner


# ---- Rough elastic spheres: constriction of the spot and of the asperities in it, in series.
#
# Formula: `H = 1/(R_L + R_s)` in vacuum, `R_L = 1/(2 λ_h a_c)`,
# `R_s = (H'/p_0)^0.96 · 1.184/(π a_c² λ_h) · σ/m`.
#
# Source: M. Bahrami, M. M. Yovanovich & J. R. Culham, Int. J. Heat Mass Transf. 49 (2006) 3691
# (R_L); J. T. Van Lew, thesis, UCLA (2016), in the form used by C. Beaulieu, thesis, Polytechnique
# Montréal (2020) (R_s with exponent 0.96 and 1.184 = (1 + 0.96/2)/1.25, the mean over the pressures
# of a Hertz contact of M. G. Cooper, B. B. Mikic & M. M. Yovanovich, Int. J. Heat Mass Transf. 12
# (1969) 279; their own exponent is 0.95).
#
# Validity: isotropic Gaussian roughness, plastic asperities of microhardness H' on elastic spheres,
# p_0 < H', asperity spots small against a_c and a_c ≪ a. The spot is that of smooth spheres: Hertz'
# radius holds for σ well below the approach δ, as roughness widens the spot; R_s depends on the
# force and hardly on the spot, R_L is then an upper estimate (1 µm on each surface nearly doubles
# the resistance of 1 N on steel of 3 mm, but exceeds its δ = 0.4 µm). σ and m are root sums of
# squares of the two surfaces, H' the harmonic mean.


@formula
def micro_resistance(
    contact_radius: float, peak_pressure: float, harmonic: float, roughness: float, slope: float,
    microhardness: float,
) -> float:  # fmt: skip
    """Resistance of the asperities ``R_s = (H'/p_0)^0.96 · 1.184/(π a_c² λ_h) · σ/m`` [K/W].

    Bahrami et al.; Van Lew. a_c [m], p_0 [Pa], λ_h [W/(m K)], σ [m], mean slope m, H' [Pa].
    """
    spots = power(microhardness / peak_pressure, 0.96)
    return spots * 1.184 / (pi * contact_radius * contact_radius * harmonic) * (roughness / slope)


@formula
def rough_conductance(
    force: float, contact_radius: float, modulus: float, effective_radius: float, harmonic: float,
    roughness: float, slope: float, microhardness: float,
) -> float:  # fmt: skip
    """Conductance of a rough contact in vacuum ``1/(R_L + R_s)`` [W/K] (Bahrami et al. 2006).

    0 without force F [N]; a_c of this force [m]; E* [Pa], a* [m] for ``p_0 = 2 E* δ/(π a_c)`` with
    ``δ = a_c²/a*``; λ_h [W/(m K)]; roughness σ [m], 0: smooth; mean slope m; H' [Pa].
    """
    if force <= 0.0 or contact_radius <= 0.0:
        return 0.0
    pressure = 2.0 * modulus * contact_radius / (pi * effective_radius)
    macro = 1.0 / hertz_conductance(harmonic, contact_radius)
    micro = micro_resistance(contact_radius, pressure, harmonic, roughness, slope, microhardness)
    return 1.0 / (macro + micro)


# ---- Flat sides that lie on each other: asperities, and the way inside the grains, in series.
#
# Formula: `H = A/(1/h + d_i/λ_i + d_j/λ_j)` with the area A = l' b that is pressed, d from the
# center of each grain straight to the side (0 of a wall, which has its temperature at the surface),
# and `h = 1.25 λ_h (m/σ) (p/H')^0.95` of rough sides under their mean pressure p = F/A.
#
# Source: M. G. Cooper, B. B. Mikic & M. M. Yovanovich, Int. J. Heat Mass Transf. 12 (1969) 279,
# with the constant of M. M. Yovanovich, AIAA 82-0004 (1982) (h); one-dimensional conduction (d).
# The pressed length is that of a pressure without tension that is linear along the side (G. G.
# Meyerhof, Proc. 3rd ICSMFE I (1953) 440; the kern of a section).
#
# Validity: h that of `rough_conductance`, but of nominally flat sides; the pressure is even, as its
# exponent is nearly 1 (a triangle of the same mean conducts 1 % less). The way inside is exact in a
# column of blocks in a steady state, of one width; smooth sides have no other resistance, and Bi is
# of order 1: temperatures within the grains then take as long to even out as those between them.


@formula
def pressed_length(nearer: float, length: float) -> float:
    """Length on which a side of ``length`` [m] is pressed if its force is so near to an end [m].

    All of it while the force is within the middle third, else three times its distance, at least 0.
    """
    return max(0.0, min(length, 3.0 * nearer))


@formula
def joint_coefficient(
    pressure: float, harmonic: float, roughness: float, slope: float, microhardness: float
) -> float:
    """Conductance of rough flat sides per area ``h = 1.25 λ_h (m/σ) (p/H')^0.95`` [W/(m² K)].

    Cooper, Mikic & Yovanovich. p [Pa], λ_h [W/(m K)], σ > 0 [m], mean slope m, H' [Pa].
    """
    return 1.25 * harmonic * (slope / roughness) * power(pressure / microhardness, 0.95)


@formula
def side_conductance(
    force: float, area: float, way: float, harmonic: float, roughness: float, slope: float,
    microhardness: float,
) -> float:  # fmt: skip
    """Conductance of sides ``H = A/(1/h + d_i/λ_i + d_j/λ_j)`` [W/K]; 0 where A [m²] is.

    Normal force F [N]; ``way`` is d_i/λ_i + d_j/λ_j [m² K/W]; σ = 0: smooth, 1/h = 0; others as
    `joint_coefficient`.
    """
    if area <= 0.0 or force <= 0.0:
        return 0.0
    asperities = 0.0
    if roughness > 0.0:
        pressure = force / area
        asperities = 1.0 / joint_coefficient(pressure, harmonic, roughness, slope, microhardness)
    return area / (asperities + way)
