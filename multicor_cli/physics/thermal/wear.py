"""Archard's law of sliding wear.

Formula: volume ``V = K F s/H``. Source: J. F. Archard, J. Appl. Phys. 24 (1953) 981.

Validity: steady adhesive or abrasive wear below the load at which it becomes severe; K (10⁻⁸ to 10⁻³; dry steel on steel some
10⁻⁴) is a measurement on the pair of materials and known to a factor of ten at best. Grains keep their size: the volume is an
output.
"""

from __future__ import annotations


def archard_volume(coefficient_over_hardness: float, force: float, distance: float) -> float:
    """Worn volume ``V = (K/H) F s`` [m³] (Archard 1953).

    Args:
        coefficient_over_hardness: K/H [1/Pa], H the hardness of the worn body.
        force: Normal force F [N].
        distance: Sliding distance s [m], of either sign.
    """
    return coefficient_over_hardness * force * abs(distance)
