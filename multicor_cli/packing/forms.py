"""From ``shape`` and ``orientation`` of a group to outlines and angles of its grains."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from multicor_cli.model.model import Floats
from multicor_cli.model.outlines import Outlines
from multicor_cli.packing.initial_grains import Forms, InitialGrains
from multicor_cli.packing.sizes import Purpose, Stream
from multicor_cli.scenario.particles import OutlinesPacking, ParticleGroup
from multicor_cli.scenario.problems import Refused
from multicor_cli.scenario.shapes import FixedOrientation, GrainShape, ListOrientation

MakeForms = Callable[[int], Forms]
"""The forms of so many grains, of size 1: of the first ones, whatever their number."""


_DEGREE = math.pi / 180.0


def forms_of(shape: GrainShape | None, random: Callable[[Purpose], Stream]) -> MakeForms | None:
    """What makes the grains of a group; None if they are discs. ``random`` as in `make_group`."""
    if shape is None:
        return None
    if not shape.draws:
        family = _of_size_one(shape, np.zeros((1, 0)))
        return lambda count: family.of_grains(np.arange(count) % family.gyration.size)
    return lambda count: _of_size_one(shape, random(Purpose.SHAPES).random((count, shape.draws)))


def _of_size_one(shape: GrainShape, uniform: Floats) -> Forms:
    forms, _ = _around_centers(shape, uniform)
    if shape.size == "area":
        return forms.scaled(1.0 / np.sqrt(forms.outlines.area / math.pi))
    return forms.scaled(1.0 / forms.outlines.radius)


def _around_centers(shape: GrainShape, uniform: Floats) -> tuple[Forms, Floats]:
    """Grains around their centers of mass, and where these are [m], shape ``(n, 2)``."""
    grains = shape.forms(uniform)
    found = shape.measures(grains)
    local = [
        [(corners - center, rounding) for corners, rounding in grain]
        for grain, center in zip(grains, found.center, strict=True)
    ]
    outlines = Outlines.of(local, found.area, found.perimeter)
    return Forms(outlines, found.gyration), found.center


def angles_of(group: ParticleGroup, count: int, random: Callable[[Purpose], Stream]) -> Floats:
    """Angles of the grains at the start [rad], shape ``(n,)``; `Refused` if not one is for each."""
    table = group.orientation
    if isinstance(table, FixedOrientation):
        return np.full(count, table.angle * _DEGREE)
    if isinstance(table, ListOrientation):
        if len(table.angles) != count:
            what = f"{len(table.angles)} angles are given for {count} grains"
            raise Refused(("orientation", "angles"), what, "give one per grain of the group")
        return np.array(table.angles) * _DEGREE
    return 2.0 * math.pi * random(Purpose.ANGLES).random(count)


def turned(
    group: ParticleGroup,
    sizes: Floats,
    center: Floats,
    make: MakeForms | None,
    random: Callable[[Purpose], Stream],
) -> InitialGrains:
    """Grains of these sizes at rest at their centers [m], turned as the group says."""
    if make is None:
        return InitialGrains.at_rest(sizes, center)
    forms, angle = make(sizes.size).scaled(sizes), angles_of(group, sizes.size, random)
    full = np.column_stack([np.zeros((sizes.size, 2)) + center, angle])
    return InitialGrains.at_rest(forms.outlines.radius, full, forms)


def outlined_as_drawn(shape: GrainShape, packing: OutlinesPacking) -> InitialGrains:
    """Grains where the file of their shape draws them."""
    forms, center = _around_centers(shape, np.zeros((1, 0)))
    forms = forms.scaled(np.full(len(center), packing.scale))
    place = packing.scale * center + np.array(packing.shift)
    return InitialGrains.at_rest(forms.outlines.radius, place, forms)
