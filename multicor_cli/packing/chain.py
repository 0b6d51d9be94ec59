"""Rows of touching glued grains: along a line, and inside or around a circle."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from multicor_cli.arithmetic import hypot
from multicor_cli.arithmetic.sums import total
from multicor_cli.engine.jit import elementwise
from multicor_cli.model.model import Floats
from multicor_cli.packing.errors import PackingError
from multicor_cli.packing.sizes import SizeDistribution, diameter, draw_to_total
from multicor_cli.packing.streams import Stream

_ROUNDS = 20
_BISECTIONS = 200


def chain_on_line(start: Floats, end: Floats, sizes: SizeDistribution, restart: Callable[[], Stream]) -> Floats:
    """Discs with centers on a line, each touching the next: x, y, radius [m], shape ``(k, 3)``.

    The number of discs is the one whose diameters add up best to the length of the line; the radii are then scaled by one
    factor close to 1, so that the chain begins and ends exactly at the ends of the line (the first and last disc touch them
    from inside). If the line spans a period, the last disc therefore touches the first.

    Args:
        start: Where the line begins [m], shape ``(2,)``.
        end: Where it ends [m], shape ``(2,)``.
        sizes: Distribution of the radii.
        restart: Gives the random stream at its beginning.

    Raises:
        PackingError: The line is shorter than one grain.
    """
    length = hypot(*(end - start).tolist())
    _check_length(length, 2.0 * sizes.largest, "line")
    radii = draw_to_total(sizes, diameter, length, restart)
    radii = radii * (length / total(diameter(radii)))
    along = np.cumsum(diameter(radii)) - radii
    return np.column_stack([start + along[:, None] * ((end - start) / length), radii])


def chain_on_circle(radius: float, sizes: SizeDistribution, restart: Callable[[], Stream], *, is_outside: bool = False) -> Floats:
    """Discs that touch a circle around the origin, each touching the next: x, y, radius [m], shape ``(k, 3)``.

    As with `chain_on_line`, the radii are scaled by one factor so that the chain closes.

    Args:
        radius: Radius of the circle [m].
        sizes: Distribution of the radii.
        restart: Gives the random stream at its beginning.
        is_outside: Whether they touch it from outside.

    Raises:
        PackingError: The circle is not at least four times as large as the grains, or twice from outside.
    """
    side = 1.0 if is_outside else -1.0
    _check_length(radius, (2.0 if is_outside else 4.0) * sizes.largest, "radius of the circle")

    def angles(radii: Floats) -> Floats:
        # What each grain takes of the full circle; exact for equal grains.
        return np.asarray(2.0 * elementwise.asin(radii / (radius + side * radii)))

    radii = draw_to_total(sizes, angles, 2.0 * math.pi, restart)
    found = {}
    for _ in range(_ROUNDS):  # unequal neighbors take a little less: a few grains more are needed
        factor = _closing_factor(radii, radius, side)
        found[radii.size] = abs(factor - 1.0), factor * radii
        after = round(radii.size * factor)
        if after in found:
            break
        radii = sizes.draw(after, restart())
    radii = min(found.values(), key=lambda pair: pair[0])[1]
    steps = _turns(radii, radius, side)
    bearing = np.concatenate([[0.0], np.cumsum(steps[:-1])])
    away = radius + side * radii
    return np.column_stack([away * elementwise.cos(bearing), away * elementwise.sin(bearing), radii])


def _turns(radii: Floats, radius: float, side: float) -> Floats:
    """Angle at the center of the circle between each disc and the next [rad]; ``side`` is 1 for discs outside, −1 inside."""
    after = np.roll(radii, -1)
    a, b, c = radius + side * radii, radius + side * after, radii + after
    return np.asarray(elementwise.acos(np.clip((a * a + b * b - c * c) / (2.0 * a * b), -1.0, 1.0)))


def _closing_factor(radii: Floats, radius: float, side: float) -> float:
    """Factor on the radii with which the turns of the chain add up to a full circle (bisection to the last bit)."""
    low, high = 0.5, 2.0 if side > 0.0 else min(2.0, 0.49 * radius / float(radii.max()))
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        if total(_turns(middle * radii, radius, side)) < 2.0 * math.pi:
            low = middle
        else:
            high = middle
    return low


def _check_length(length: float, needed: float, what: str) -> None:
    if length < needed:
        raise PackingError(
            f"the {what}, {length:g} m, is too short for glued grains: at least {needed:g} m",
            "make it longer or the grains smaller",
        )
