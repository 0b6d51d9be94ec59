"""Contact laws of all pairs of materials, as arrays."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from multicor_cli.model.model import ContactLaws, Floats

SofteningOfPair = tuple[float, float, float, float]
"""Of a pair of materials: c [1/K], T_r [K], and the smallest and largest coefficient; see `multicor_cli.model.ContactLaws`."""

Points = tuple[tuple[float, ...], tuple[float, ...]]
"""Sliding speeds [m/s], ascending, and the coefficients of friction at them."""


class Law(NamedTuple):
    """The law of a pair of materials.

    Attributes:
        friction: Coefficient of friction, or its table.
        restitution: Coefficient of normal restitution.
        softening: How the friction depends on temperature, or None.
    """

    friction: float | Points
    restitution: float
    softening: SofteningOfPair | None = None


_UNSOFTENED: SofteningOfPair = (0.0, 293.15, 0.0, 10.0)
"""Leaves every coefficient that a scenario can have as it is, at any temperature."""


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
    softening: dict[tuple[int, int], SofteningOfPair] = {}
    for a, b in touching:
        mu, e, soft = law_of(materials[a], materials[b])
        if soft is not None:
            softening[a, b] = softening[b, a] = soft
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
        **(_softening(k, softening) if softening else {}),
    )


def _softening(k: int, pairs: Mapping[tuple[int, int], SofteningOfPair]) -> dict[str, Floats]:
    table: Floats = np.empty((4, k, k))
    table[:] = np.array(_UNSOFTENED)[:, None, None]
    for (a, b), soft in pairs.items():
        table[:, a, b] = soft
    return dict(zip(("softening_rate", "softening_start", "softening_lowest", "softening_highest"), table, strict=True))
