"""Closed forms for the heating of a plane shear flow, for validation.

Formula: ``ρφc ∂T/∂t = ∂_y(k_eff ∂_y T) + q`` with the source ``q = μ* P γ̇``, uniform. Source: derived.

Validity: uniform shear rate, stress ratio and conductivity; all mechanical loss becomes heat where it arises; mixing by the
flow adds ``D_mix ~ 0.05–0.2 d² γ̇`` to the diffusivity k_eff/(ρφc) and must be small against it, or be counted. The steady
profile needs several `relaxation_time`; for granular beds of a tenth of a meter that is 10³ to 10⁴ s.
"""

from __future__ import annotations

from math import pi


def shear_source(friction: float, pressure: float, shear_rate: float) -> float:
    """Heat per volume and time ``q = μ* P γ̇`` [W/m³]; stress ratio μ*, pressure P [Pa], shear rate γ̇ [1/s]."""
    return friction * pressure * abs(shear_rate)


def adiabatic_rate(source: float, bulk_density: float, heat_capacity: float) -> float:
    """Rate of temperature without loss ``q/(ρφc)`` [K/s].

    Args:
        source: q [W/m³].
        bulk_density: Mass per volume of the bed ρφ [kg/m³].
        heat_capacity: c [J/(kg K)].
    """
    return source / (bulk_density * heat_capacity)


def adiabatic_per_strain(friction: float, pressure: float, bulk_density: float, heat_capacity: float) -> float:
    """Rise of temperature per unit strain without loss ``μ* P/(ρφc)`` [K]; arguments as above."""
    return friction * pressure / (bulk_density * heat_capacity)


def parabola(y: float, height: float, source: float, conductivity: float) -> float:
    """Steady rise over two walls of one temperature ``q y (h − y)/(2 k_eff)`` [K].

    Args:
        y: Distance from the lower wall [m].
        height: Distance of the walls h [m].
        source: q [W/m³].
        conductivity: k_eff [W/(m K)].
    """
    return source * y * (height - y) / (2.0 * conductivity)


def peak(height: float, source: float, conductivity: float) -> float:
    """Largest rise between two isothermal walls ``q h²/(8 k_eff)`` [K]; arguments as `parabola`."""
    return source * height * height / (8.0 * conductivity)


def one_sided_peak(height: float, source: float, conductivity: float) -> float:
    """Rise at an adiabatic wall opposite an isothermal one ``q h²/(2 k_eff)`` [K]: four times `peak`."""
    return source * height * height / (2.0 * conductivity)


def wall_flux(height: float, source: float) -> float:
    """Steady heat flux into each of two isothermal walls ``q h/2`` [W/m²]; h [m], q [W/m³]."""
    return 0.5 * source * height


def relaxation_time(height: float, diffusivity: float) -> float:
    """Slowest time of diffusion between isothermal walls ``h²/(π² D)`` [s]; h [m], D = k_eff/(ρφc) [m²/s]."""
    return height * height / (pi * pi * diffusivity)


def mean_spin(shear_rate: float) -> float:
    """Mean angular velocity of the grains ``−γ̇/2`` [rad/s], γ̇ = ∂v_x/∂y [1/s]."""
    return -0.5 * shear_rate
