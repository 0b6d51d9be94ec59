"""Conduction through a contact of rough, elastic spheres: constriction of the spot and of the asperities inside it in series.

Formula: ``H = 1/(R_L + R_s)`` in vacuum, ``R_L = 1/(2 λ_h a_c)``, ``R_s = (H'/p_0)^0.96 · 1.184/(π a_c² λ_h) · σ/m``. With gas,
the microgap R_g between the asperities lies parallel to R_s and the macrogap R_G around the spot parallel to all of it:
``H = 1/(R_L + 1/(1/R_s + 1/R_g)) + 1/R_G``.

Source: M. Bahrami, M. M. Yovanovich & J. R. Culham, Int. J. Heat Mass Transf. 49 (2006) 3691 (R_L, R_g, R_G); J. T. Van Lew,
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

from math import inf, pi, sqrt

from multicor_cli.arithmetic import log, normal_quantile, power
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


def inverse_erfc(value: float) -> float:
    """The x with ``erfc(x) = value``, for value in (10⁻³⁰⁰, 2), from the quantile of the normal distribution."""
    return -normal_quantile(0.5 * value) / sqrt(2.0)


def microgap_resistance(
    gas_conductivity: float, contact_radius: float, roughness: float, jump: float, near: float, far: float
) -> float:
    """Resistance of the gas between the asperities [K/W] (Bahrami et al. 2006).

    ``R_g = 2√2 σ a_2/(π λ_g a_c² ln(1 + a_2/(a_1 + M/(2√2 σ))))``, with ``a_1 = erfc⁻¹(2p_0/H')`` and
    ``a_2 = erfc⁻¹(0.03 p_0/H') − a_1`` (`inverse_erfc`). Needs p_0 < H'. Where a_1 + M/(2√2 σ) ≤ 0 (from p_0 = H'/2 on, without
    rarefaction) the mean planes of the surfaces touch, no gap is left, and the resistance is infinite.

    Args:
        gas_conductivity: λ_g [W/(m K)].
        contact_radius: a_c [m].
        roughness: σ [m].
        jump: Temperature-jump distance M [m] (`gap.temperature_jump`).
        near: a_1.
        far: a_2.
    """
    scale = 2.0 * sqrt(2.0) * roughness
    distance = near + jump / scale
    if distance <= 0.0:
        return inf
    return scale * far / (pi * gas_conductivity * contact_radius * contact_radius * log(1.0 + far / distance))


def macrogap_resistance(gas_conductivity: float, contact_radius: float, radius: float, jump: float) -> float:
    """Resistance of the gas around the spot of two equal spheres [K/W] (Bahrami et al. 2006, simple cubic packing: B = 0).

    ``R_G = 2/(π λ_g [S ln(S/(S−A)) − A])``, ``A = 2√(a²−a_c²)``, ``S = 2(a − a_c²/2a) + M``: with M = 0 the parallel-flux
    integral of `gap.parallel_conductance` for spheres that overlap by a_c²/a.

    Args:
        gas_conductivity: λ_g [W/(m K)].
        contact_radius: a_c [m].
        radius: Radius a of the spheres, the harmonic mean of unequal ones [m].
        jump: Temperature-jump distance M [m]; must be positive: at 0 the printed S − A is of order a_c⁴/a³, below round-off.
    """
    width = 2.0 * sqrt(radius * radius - contact_radius * contact_radius)
    distance = 2.0 * (radius - contact_radius * contact_radius / (2.0 * radius)) + jump
    return 2.0 / (pi * gas_conductivity * (distance * log(distance / (distance - width)) - width))


def cmy_coefficient(harmonic: float, slope: float, roughness: float, pressure: float, microhardness: float) -> float:
    """Conductance per area of flat rough surfaces ``h = 1.25 λ_h (m/σ)(P/H')^0.95`` [W/(m² K)] (Cooper, Mikic & Yovanovich 1969).

    Args:
        harmonic: λ_h [W/(m K)].
        slope: Mean slope of the asperities m.
        roughness: σ [m].
        pressure: Mean pressure P [Pa].
        microhardness: H' [Pa].
    """
    return 1.25 * harmonic * slope / roughness * power(pressure / microhardness, 0.95)
