"""Deposits: grains fall one by one and roll down until two others, a side or the floor hold them.

The classical drop-and-roll construction of Visscher & Bolsterli (Nature 239, 504, 1972): every
grain falls from above at a random place, rolls around the first disc it meets, over the next if
that lies under its rear, falls on where it passes the widest point of a disc, and stops between two
supports. Forces play no role: grains touch to rounding and the fill comes out at about 0.8, but not
every heap made so is stable under every friction. It always builds along −y on the bottom of the
region, between its sides unless it is periodic. Grains of earlier groups, glued grains and solid
discs are piled upon; other walls are not seen, so the region has to keep clear of them.

Grains begin to fall at the top of the region, or below a row of glued grains in it that faces down.
Discs that lie there or higher are not piled upon, and the grains that come to rest have to keep
clear of them, as of a smooth lid.

Solid polygons and regions that are no rectangles are not seen either. Where a grain comes to rest
in solid matter or beyond the boundary, a dummy of its size stays as a support for the others, and
the grain is dropped again; dummies are then taken away.
"""

from __future__ import annotations

import math

import numpy as np

from multicor_cli.arithmetic.sums import mean, total
from multicor_cli.model.columns import RADIUS
from multicor_cli.model.model import Floats
from multicor_cli.packing.initial_grains import PackingRegion
from multicor_cli.packing.placing import drop_and_roll, make_field
from multicor_cli.packing.sizes import Stream
from multicor_cli.packing.walls import Obstacles
from multicor_cli.scenario.problems import Refused

_ATTEMPTS = 200
_SPARE = 2.0  # room for dummies, over the number of mean grains that cover the region
_SLACK = 1e-9
_BATCH = 4096


def deposit(radius: Floats, region: PackingRegion, obstacles: Obstacles, rng: Stream) -> Floats:
    """Centers of grains deposited in the order given [m], shape ``(n, 2)``.

    ``region``'s bottom is the floor; ``rng`` gives the places from which grains fall. Where not all
    fit, `Refused` says how many do.
    """
    if not region.is_periodic and 2.0 * radius.max() > region.width:
        text = f"the largest diameter, {2.0 * radius.max():g} m, exceeds the width of the region, "
        raise Refused((), f"{text}{region.width:g} m", "widen the region")
    left = 0.0 if region.is_periodic else region.left
    top = min([region.top, *(height for height in obstacles.lids if height > region.bottom)])
    sides = np.array([left, region.bottom, left + region.width, top])
    if not obstacles.room.is_open:
        return _deposit_in_room(radius, region, obstacles, rng, sides)
    field, fixed = make_field(radius, region, obstacles, top)
    done, tried = 0, 0
    while done < radius.size:
        uniform = rng.random(max(_BATCH, radius.size - done))
        done, tried = drop_and_roll(field, fixed, done, tried, _ATTEMPTS, uniform, sides)
        if tried >= _ATTEMPTS:
            area = region.width * (top - region.bottom)
            filled = np.pi * total(radius[:done] * radius[:done]) / area
            raise _refusal(radius, done, f" (area fraction {filled:.3f})", region, top)
    return field.disc[fixed:, :2].copy()


def _deposit_in_room(
    radius: Floats, region: PackingRegion, obstacles: Obstacles, rng: Stream, sides: Floats
) -> Floats:
    """As `deposit`, with dummies where grains must not be."""
    # Dummies cover less than the region; large grains, which fit in fewer places, are more often
    # among them than small ones.
    top = float(sides[-1])
    spare = math.ceil(_SPARE * region.area / (math.pi * mean(radius * radius)))
    sizes = radius[np.arange(radius.size + spare) % radius.size]
    field, fixed = make_field(sizes, region, obstacles, top)
    level = field.grids.level[fixed : fixed + radius.size].copy()
    kept: list[int] = []
    for d in range(fixed, len(field.disc)):
        i = len(kept)
        field.disc[d, RADIUS], field.grids.level[d] = radius[i], level[i]
        so_far, places = field._replace(disc=field.disc[: d + 1]), rng.random(_ATTEMPTS)
        done, _ = drop_and_roll(so_far, fixed, d - fixed, 0, _ATTEMPTS, places, sides)
        if done == d - fixed:
            break
        if obstacles.room.clearance(field.disc[d : d + 1, :2])[0] >= radius[i] * (1.0 - _SLACK):
            kept.append(d)
        if len(kept) == radius.size:
            return field.disc[kept, :2].copy()
    raise _refusal(radius, len(kept), "", region, top)


def _refusal(radius: Floats, done: int, more: str, region: PackingRegion, top: float) -> Refused:
    under = f" up to the rough wall above them at y = {top:g} m" if top < region.top else ""
    text = f"{radius.size} grains do not fit: the region is full{under} with {done} of them{more}"
    larger = "raise the wall, or" if under else "enlarge the region or"
    return Refused((), text, f"{larger} ask for fewer grains")
