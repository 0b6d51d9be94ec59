"""A coefficient of friction that depends on temperature: ``μ(T) = μ_0 [1 − c (T − T_r)]``, cut to a range (phenomenological).

Validity: the linear law has no universal source: its rate is a fit to a material pair over the measured range, and T is the
temperature of the grains, not that of the spot.
"""

from __future__ import annotations

from multicor_cli.engine.jit.formulas import formula


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
