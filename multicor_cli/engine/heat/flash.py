"""Flash temperature: how much hotter than its body a sliding spot is. A diagnostic; the grains' temperatures know nothing of it.

Formulas: stationary circular source of uniform flux: largest ``Q/(π a λ)``, mean ``8 Q/(3π² a λ)``; band moving fast: largest
``1.596 (q/λ) √(α l/V)``, mean ``1.064 (q/λ) √(α l/V)`` (1.596 = 2√(2/π), mean 2/3 of it); ``Pe = V a/(2α)``.

Source: J. C. Jaeger, Proc. R. Soc. NSW 76 (1942) 203; H. Blok, Proc. Gen. Disc. Lubrication, Inst. Mech. Eng. 2 (1937) 222.
Between the two limits: Y. S. Muzychka & M. M. Yovanovich, J. Tribol. 123 (2001) 624.

Validity: stationary source Pe ≪ 1, moving band Pe > 10; half-space, uniform flux, smooth spot of which all conducts. Q is the
share of the heat that enters this body.
"""

from __future__ import annotations

from math import pi, sqrt


def peclet_number(speed: float, spot: float, diffusivity: float) -> float:
    """Péclet number ``Pe = V a/(2α)`` of a sliding spot; V [m/s] of either sign, a [m], α = λ/(ρc) [m²/s] (Jaeger 1942)."""
    return abs(speed) * spot / (2.0 * diffusivity)


def stationary_max(heat: float, conductivity: float, spot: float) -> float:
    """Largest rise of a stationary circular source ``Q/(π a λ)`` [K], at its center (Jaeger 1942).

    Args:
        heat: Heat flow into the body Q [W].
        conductivity: λ [W/(m K)].
        spot: Radius a [m].
    """
    return heat / (pi * spot * conductivity)


def stationary_mean(heat: float, conductivity: float, spot: float) -> float:
    """Mean rise over a stationary circular source ``8 Q/(3π² a λ)`` [K] (Jaeger 1942); arguments as `stationary_max`."""
    return 8.0 * heat / (3.0 * pi * pi * spot * conductivity)


def moving_max(flux: float, conductivity: float, diffusivity: float, half_length: float, speed: float) -> float:
    """Largest rise under a fast band ``1.596 (q/λ) √(α l/V)`` [K], at its trailing edge (Jaeger 1942; Blok 1937).

    Args:
        flux: Heat flux into the body q [W/m²].
        conductivity: λ [W/(m K)].
        diffusivity: α [m²/s].
        half_length: Half the length of the band in the direction of motion l [m].
        speed: V [m/s], positive.
    """
    return 1.596 * flux / conductivity * sqrt(diffusivity * half_length / speed)


def moving_mean(flux: float, conductivity: float, diffusivity: float, half_length: float, speed: float) -> float:
    """Mean rise under a fast band ``1.064 (q/λ) √(α l/V)`` [K] (Jaeger 1942); arguments as `moving_max`."""
    return 1.064 * flux / conductivity * sqrt(diffusivity * half_length / speed)
