"""Where a grain finds room among the grains that are there and the walls."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.exchange.rules import Release
from multicor_cli.engine.geometry.gaps import gap_to_shape, minimum_image
from multicor_cli.engine.geometry.scene import scene_of
from multicor_cli.engine.jit.compile import kernel
from multicor_cli.model.columns import RADIUS, X, Y
from multicor_cli.model.model import Floats, Ints, Model
from multicor_cli.model.state import State


@kernel
def first_free(
    place: Floats, radius: float, disc: Floats, kind: Ints, world: Floats, is_met: NDArray[np.bool_], period: float
) -> int:
    """The first place where a grain overlaps nothing; −1 if there is none.

    Args:
        place: Centers to try, shape ``(k, 2)``.
        radius: Radius of the grain [m].
        disc: x, y and radius of the grains around [m], shape ``(d, 3)``.
        kind: `ShapeKind` of the wall shapes, shape ``(m,)``.
        world: Their geometry in the world [m], shape ``(m, 4)``.
        is_met: Whether the grain meets them, shape ``(m,)``.
        period: Period in x [m] or 0.
    """
    for k in range(place.shape[0]):
        x, y = place[k, X], place[k, Y]
        is_free = True
        for d in range(disc.shape[0]):
            dx, dy = minimum_image(x - disc[d, X], period), y - disc[d, Y]
            near = radius + disc[d, RADIUS]
            if dx * dx + dy * dy < near * near:
                is_free = False
                break
        for shape in range(kind.size):
            if not is_free:
                break
            is_free = not is_met[shape] or gap_to_shape(x, y, radius, shape, kind, world, period)[0] >= 0.0
        if is_free:
            return k
    return -1


def find_room(release: Release, number: int, grain: int, model: Model, state: State) -> tuple[float, float] | None:
    """Where a waiting grain can be released now [m]; None if it finds no room.

    Args:
        release: How its group comes.
        number: Number of the release.
        grain: The grain.
        model: The model.
        state: The state.
    """
    radius = float(model.grains.radius[grain])
    low, high = np.array(release.region.low), np.array(release.region.high)
    inset = np.array([0.0 if release.spans_period else radius, radius])
    place = low + inset + release.draw(number) * np.maximum(high - low - 2.0 * inset, 0.0)
    scene = scene_of(model, state.position, state.wall_position)
    shapes = np.arange(model.shape_count)
    is_met = model.is_met(np.full(shapes.size, grain), shapes)
    found = first_free(place, radius, _discs_near(low, high, model, state), scene.kind, scene.world, is_met, model.period)
    return None if found < 0 else (float(place[found, X]), float(place[found, Y]))


def _discs_near(low: Floats, high: Floats, model: Model, state: State) -> Floats:
    """x, y and radius of the grains that are there and reach into a rectangle [m], shape ``(d, 3)``."""
    here = state.here
    position, radius = state.position[here], model.grains.radius[here]
    offset = np.abs(position[:, :2] - 0.5 * (low + high))
    if model.period > 0.0:
        offset[:, X] = np.minimum(offset[:, X], np.abs(model.period - offset[:, X]))
    near = (offset < 0.5 * (high - low) + radius[:, np.newaxis]).all(axis=1)
    return np.column_stack([position[near, :2], radius[near]])
