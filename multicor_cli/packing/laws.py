"""Contact laws of all pairs of materials, as arrays."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from multicor_cli.state.model import ContactLaws

Points = tuple[tuple[float, ...], tuple[float, ...]]
"""Sliding speeds [m/s], ascending, and the coefficients of friction at them."""

Law = tuple[float | Points, float]
"""Coefficient of friction, or its table, and coefficient of restitution."""


def touching_pairs(grains: Iterable[int], walls: Iterable[int]) -> list[tuple[int, int]]:
    """Pairs of materials that can meet, smaller index first: those of grains with each other, and with those of walls."""
    mobile = set(grains)
    return sorted({(min(a, b), max(a, b)) for a in mobile for b in mobile | set(walls)})


def contact_laws(materials: Sequence[str], touching: Iterable[tuple[int, int]], law_of: Callable[[str, str], Law]) -> ContactLaws:
    """The laws of the pairs ``touching``; other pairs are left at zero and are never used.

    Args:
        materials: Names of the materials, by index.
        touching: Pairs of indices that need a law.
        law_of: The law between two materials.
    """
    k = len(materials)
    friction, restitution, table = np.zeros((k, k)), np.zeros((k, k)), np.full((k, k), -1, np.int32)
    number: dict[Points, int] = {}
    for a, b in touching:
        mu, e = law_of(materials[a], materials[b])
        restitution[a, b] = restitution[b, a] = e
        if isinstance(mu, tuple):
            table[a, b] = table[b, a] = number.setdefault(mu, len(number))
        else:
            friction[a, b] = friction[b, a] = mu
    sizes = [len(speeds) for speeds, _ in number]
    return ContactLaws(
        friction=friction,
        restitution=restitution,
        table=table,
        table_start=np.cumsum([0, *sizes]).astype(np.int32),
        table_speed=np.array([speed for speeds, _ in number for speed in speeds], float),
        table_friction=np.array([value for _, values in number for value in values], float),
    )
