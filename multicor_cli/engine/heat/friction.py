"""Heat of sliding friction, and a coefficient of friction that depends on temperature.

Formulas: ``Q = μ F_n |u_t|`` (derived: the work of Coulomb's law); ``μ(T) = μ_0 [1 − c (T − T_r)]``, cut to a range
(phenomenological).

Validity: the power is that of a contact that slides with the velocity u_t; over a step of changing velocity the dissipated
energy is ``−p_t ½(u_t⁻ + u_t⁺)`` instead. The linear law of μ has no universal source: its rate is a fit to a material pair
over the measured range, and T is the temperature of the grains, not that of the spot (see `flash`).
"""

from __future__ import annotations

from multicor_cli.engine.jit.formulas import formula


@formula
def sliding_power(mu: float, normal_force: float, slip_speed: float) -> float:
    """Power of sliding friction ``Q = μ F_n |u_t|`` [W]; F_n [N], u_t [m/s] of either sign."""
    return mu * abs(slip_speed) * normal_force


@formula
def softened_friction(mu: float, rate: float, temperature: float, start: float, lowest: float, highest: float) -> float:
    """Coefficient of friction ``μ_0 [1 − c (T − T_r)]``, cut to [lowest, highest].

    Args:
        mu: μ_0, the coefficient at T_r.
        rate: c [1/K]; negative if friction rises with temperature.
        temperature: T [K].
        start: T_r [K].
        lowest: Smallest coefficient.
        highest: Largest coefficient.
    """
    value = mu * (1.0 - rate * (temperature - start))
    value = value if value > lowest else lowest
    return value if value < highest else highest
