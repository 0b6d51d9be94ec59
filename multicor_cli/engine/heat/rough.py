"""Conduction through a contact of rough, elastic spheres: constriction of the spot and of the asperities inside it in series.

Formula: ``H = 1/(R_L + R_s)`` in vacuum, ``R_L = 1/(2 λ_h a_c)``, ``R_s = (H'/p_0)^0.96 · 1.184/(π a_c² λ_h) · σ/m``.

Source: M. Bahrami, M. M. Yovanovich & J. R. Culham, Int. J. Heat Mass Transf. 49 (2006) 3691 (R_L); J. T. Van Lew,
thesis, UCLA (2016), in the form used by C. Beaulieu, thesis, Polytechnique Montréal (2020) (R_s with exponent 0.96 and 1.184 =
(1 + 0.96/2)/1.25, the mean over the pressures of a Hertz contact of M. G. Cooper, B. B. Mikic & M. M. Yovanovich, Int. J. Heat
Mass Transf. 12 (1969) 279; their own exponent is 0.95).

Validity: isotropic Gaussian roughness, plastic asperities of microhardness H' on elastic spheres, p_0 < H', asperity spots
small against a_c and a_c ≪ a. The spot is that of smooth spheres: Hertz' radius holds for σ well below the approach δ, as
roughness widens the spot; R_s depends on the force and hardly on the spot, R_L is then an upper estimate (1 µm on each surface
nearly doubles the resistance of 1 N on steel of 3 mm, but exceeds its δ = 0.4 µm). σ and m are root sums of squares of the two
surfaces, H' the harmonic mean.
"""

from __future__ import annotations

from math import pi

from multicor_cli.arithmetic import power
from multicor_cli.engine.jit.formulas import formula


@formula
def macro_resistance(contact_radius: float, harmonic: float) -> float:
    """Resistance of the spot ``R_L = 1/(2 λ_h a_c)`` [K/W]; a_c [m], λ_h [W/(m K)]."""
    return 1.0 / (2.0 * harmonic * contact_radius)


@formula
def micro_resistance(
    contact_radius: float, peak_pressure: float, harmonic: float, roughness: float, slope: float, microhardness: float
) -> float:
    """Resistance of the asperities ``R_s = (H'/p_0)^0.96 · 1.184/(π a_c² λ_h) · σ/m`` [K/W] (Bahrami et al.; Van Lew).

    Args:
        contact_radius: a_c [m].
        peak_pressure: p_0 [Pa].
        harmonic: λ_h [W/(m K)].
        roughness: σ [m].
        slope: Mean slope of the asperities m.
        microhardness: H' [Pa].
    """
    spots = power(microhardness / peak_pressure, 0.96)
    return spots * 1.184 / (pi * contact_radius * contact_radius * harmonic) * (roughness / slope)


@formula
def rough_conductance(
    force: float,
    contact_radius: float,
    modulus: float,
    effective_radius: float,
    harmonic: float,
    roughness: float,
    slope: float,
    microhardness: float,
) -> float:
    """Conductance of a rough contact in vacuum ``1/(R_L + R_s)`` [W/K]; 0 without force (Bahrami et al. 2006).

    Args:
        force: Normal force F [N].
        contact_radius: a_c that belongs to this force [m].
        modulus: E* [Pa], for ``p_0 = 2 E* δ/(π a_c)`` with ``δ = a_c²/a*``.
        effective_radius: a* [m].
        harmonic: λ_h [W/(m K)].
        roughness: σ [m]; 0: a smooth contact.
        slope: Mean slope of the asperities m.
        microhardness: H' [Pa].
    """
    if force <= 0.0 or contact_radius <= 0.0:
        return 0.0
    pressure = 2.0 * modulus * contact_radius / (pi * effective_radius)
    macro = macro_resistance(contact_radius, harmonic)
    micro = micro_resistance(contact_radius, pressure, harmonic, roughness, slope, microhardness)
    return 1.0 / (macro + micro)
