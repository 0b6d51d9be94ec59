"""Thermal radiation between neighboring grains, and to surroundings.

Formula: ``Q = σ X (T_j⁴ − T_i⁴)`` with an area factor X [m²]. Two surfaces that see only each other:
``X = A/(1/ε_i + 1/ε_j − 1)``. Two spheres are given the area ``A = π a²`` of the smaller one's cross-section, as parallel plates.

This is an upper estimate: six neighbors take 1.5 times what a grain radiates, and none hides another or the surroundings.
A grain in black surroundings has ``X = ε · surface``.

Source: Stefan–Boltzmann; M. F. Modest, Radiative Heat Transfer (parallel plates, crossed strings for cylinders); Z. Y. Zhou,
A. B. Yu & P. Zulli, AIChE J. 55 (2009) 868 (environment of a grain).

Validity: gray, diffuse, opaque surfaces, large against the wavelength (grains above 0.1 mm at room temperature), a gas that
does not absorb. The exchange of neighbors takes no account of what other grains hide or reflect. For steel of emissivity 0.3 at
310 K it is some percent of the conduction of one lightly loaded contact; it counts at high temperature and for poor conductors.
"""

from __future__ import annotations

from math import pi, sqrt

from multicor_cli.arithmetic import acos
from multicor_cli.engine.jit.formulas import formula

STEFAN_BOLTZMANN = 5.670374419e-8
"""Stefan–Boltzmann constant σ [W/(m² K⁴)] (exact in SI)."""


def emission_factor(e_i: float, e_j: float) -> float:
    """``1/(1/ε_i + 1/ε_j − 1)`` of two gray surfaces that see only each other (Modest); 0 if one emissivity ε is 0."""
    if e_i <= 0.0 or e_j <= 0.0:
        return 0.0
    return 1.0 / (1.0 / e_i + 1.0 / e_j - 1.0)


@formula
def sphere_area_factor(emission: float, radius_i: float, radius_j: float) -> float:
    """Area factor of two neighboring spheres ``X = π a²·emission`` [m²]: a the smaller radius [m], `emission_factor` of the two."""
    a = radius_i if radius_i < radius_j else radius_j
    return pi * a * a * emission


@formula
def linear_coefficient(area_factor: float, T_i: float, T_j: float) -> float:
    """Conductance ``σ X (T_i² + T_j²)(T_i + T_j)`` [W/K]: the exchange is this times T_j − T_i; X [m²], temperatures [K]."""
    return STEFAN_BOLTZMANN * area_factor * (T_i * T_i + T_j * T_j) * (T_i + T_j)


def exchange(area_factor: float, T_i: float, T_j: float) -> float:
    """Heat flow into body i ``σ X (T_j⁴ − T_i⁴)`` [W] (Stefan–Boltzmann), factored so that nothing cancels and equal T give 0.

    Args:
        area_factor: X [m²].
        T_i: Temperature of the body that gains [K].
        T_j: Temperature of the other [K].
    """
    return linear_coefficient(area_factor, T_i, T_j) * (T_j - T_i)


@formula
def cylinder_view_factor(radius_i: float, radius_j: float, gap: float) -> float:
    """Share of what a long cylinder i radiates that falls on a parallel cylinder j (crossed strings; Modest, appendix D).

    ``F = [π + √(A²−(B+1)²) − √(A²−(B−1)²) + (B−1) acos((B−1)/A) − (B+1) acos((B+1)/A)]/2π``, ``B = r_j/r_i``,
    ``A = 1 + B + h/r_i``.

    Args:
        radius_i: Radius r_i [m].
        radius_j: Radius r_j [m].
        gap: Gap h between the surfaces [m]; an overlap counts as 0.
    """
    b = radius_j / radius_i
    opening = gap / radius_i if gap > 0.0 else 0.0
    a = 1.0 + b + opening
    outer = sqrt(opening * (a + b + 1.0))
    inner = sqrt((a - b + 1.0) * (a + b - 1.0))
    return (pi + outer - inner + (b - 1.0) * acos((b - 1.0) / a) - (b + 1.0) * acos((b + 1.0) / a)) / (2.0 * pi)


def zhou_environment(porosity: float, fluid_temperature: float, mean_neighbor: float) -> float:
    """Temperature of the environment of a grain ``ε_p T_f + (1 − ε_p) ⟨T_j⟩`` [K] (Zhou, Yu & Zulli 2009).

    Args:
        porosity: Volume fraction of the fluid ε_p.
        fluid_temperature: T_f [K].
        mean_neighbor: Mean temperature of the neighbors ⟨T_j⟩ [K].
    """
    return porosity * fluid_temperature + (1.0 - porosity) * mean_neighbor
