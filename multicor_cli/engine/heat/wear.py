"""Archard's law of sliding wear.

Formula: volume ``V = K F s/H``. Source: J. F. Archard, J. Appl. Phys. 24 (1953) 981.

Validity: steady adhesive or abrasive wear below the load at which it becomes severe; K (10⁻⁸ to 10⁻³; dry steel on steel some
10⁻⁴) is a measurement on the pair of materials and known to a factor of ten at best. Grains keep their size: the volume is an
output.
"""

from __future__ import annotations

from multicor_cli.engine.jit.formulas import formula


@formula
def rubbing_of(normal: float, slip: float, work: float, mu: float) -> float:
    """Normal load times slipped distance F s [N m]: the work of friction over μ, so that a contact that sticks does not wear.

    Args:
        normal: Normal impulse F Δt [N s].
        slip: Sliding speed s/Δt [m/s], of either sign; counts where there is no friction.
        work: Work of friction [J]; below 0 counts as 0.
        mu: Coefficient of friction.
    """
    return max(work, 0.0) / mu if mu > 0.0 else normal * abs(slip)


@formula
def archard_volume(coefficient_over_hardness: float, rubbing: float) -> float:
    """Worn volume ``V = (K/H) F s`` [m³] (Archard 1953).

    Args:
        coefficient_over_hardness: K/H [1/Pa], H the hardness of the worn body.
        rubbing: Normal force times sliding distance F s [N m].
    """
    return coefficient_over_hardness * rubbing
