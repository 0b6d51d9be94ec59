"""Deposits: grains fall one after another and roll down until two others, a side or the floor hold them.

The classical drop-and-roll construction of Visscher & Bolsterli (Nature 239, 504, 1972): every grain falls from above at a
random place, rolls around the first disc it meets, over the next if that lies under its rear, falls on where it passes the
widest point of a disc, and stops between two supports. Forces play no role: grains touch to rounding and the fill comes out at
about 0.8, but not every heap made so is stable under every friction. It always builds along −y on the bottom of the region,
between its sides unless it is periodic. Grains of earlier groups and glued grains of walls are piled upon; other walls are not
seen, so the region has to keep clear of them.
"""

from __future__ import annotations

import numpy as np

from multicor_cli.arithmetic.sums import total
from multicor_cli.model.model import Floats
from multicor_cli.packing.errors import PackingError
from multicor_cli.packing.obstacles import Obstacles
from multicor_cli.packing.placing import drop_and_roll, make_field
from multicor_cli.packing.region import PackingRegion
from multicor_cli.packing.streams import Stream

_ATTEMPTS = 200
_BATCH = 4096


def deposit(radius: Floats, region: PackingRegion, obstacles: Obstacles, rng: Stream) -> Floats:
    """Centers of grains deposited in the order given [m], shape ``(n, 2)``.

    Args:
        radius: Radii [m], shape ``(n,)``.
        region: Where they fall; its bottom is the floor.
        obstacles: Discs to pile upon.
        rng: Source of the places from which grains fall.

    Raises:
        PackingError: The region is full before all grains are placed; says how many fit.
    """
    if not region.is_periodic and 2.0 * radius.max() > region.width:
        text = f"the largest diameter, {2.0 * radius.max():g} m, exceeds the width of the region, {region.width:g} m"
        raise PackingError(text, "widen the region")
    field, fixed = make_field(radius, region, obstacles)
    left = 0.0 if region.is_periodic else region.left
    sides = np.array([left, region.bottom, left + region.width, region.top])
    done, tried = 0, 0
    while done < radius.size:
        uniform = rng.random(max(_BATCH, radius.size - done))
        done, tried = drop_and_roll(field, fixed, done, tried, _ATTEMPTS, uniform, sides)
        if tried >= _ATTEMPTS:
            fill = np.pi * total(radius[:done] * radius[:done]) / region.area
            text = f"{radius.size} grains do not fit: the region is full with {done} of them (area fraction {fill:.3f})"
            raise PackingError(text, "enlarge the region or ask for fewer grains")
    return field.disc[fixed:, :2].copy()
