"""Shapes at one moment, as kernels see them, and the gap of a pair of them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from multicor_cli.arithmetic import cos, sin
from multicor_cli.engine.geometry.gaps import disc_disc, distance_to_shape, gap_to_shape, minimum_image
from multicor_cli.engine.jit.compile import kernel
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.model.columns import ANGLE, TAIL_X, TAIL_Y, X, Y
from multicor_cli.model.model import Floats, Ints, Model
from multicor_cli.model.shapes import TAIL, Tail

_DIRECTION = int(Tail.DIRECTION)
_POINT = int(Tail.POINT)
_NO_TEMPERATURE = np.empty(0)


class Scene(NamedTuple):
    """Positions and shapes at the middle of a step, as the kernels see them.

    Attributes:
        position: Grains at q_m: x, y [m], angle, shape ``(n, 3)``.
        radius: Radii [m], shape ``(n,)``.
        material: Materials of all shapes, grains first, shape ``(n + m,)``.
        kind: `ShapeKind` of the wall shapes, shape ``(m,)``.
        wall: Wall of each wall shape, shape ``(m,)``.
        world: Wall shapes at q_m [m], shape ``(m, 4)``.
        wall_position: Wall frames at q_m, shape ``(w, 3)``.
        period: Period in x [m] or 0.
        temperature: Temperatures of all shapes [K] for friction that depends on them, nan where a wall has none, shape
            ``(n + m,)``; of size 0 where nobody asks for them.
    """

    position: Floats
    radius: Floats
    material: Ints
    kind: Ints
    wall: Ints
    world: Floats
    wall_position: Floats
    period: float
    temperature: Floats = _NO_TEMPERATURE


@formula
def placed_shape(
    kind: int, local: Floats, shape: int, frame_x: float, frame_y: float, angle: float
) -> tuple[float, float, float, float]:
    """The four numbers of a wall shape in the world, if the frame of its wall is at (frame_x, frame_y) [m] and turned [rad]."""
    c, s = cos(angle), sin(angle)
    x, y, u, v = local[shape, X], local[shape, Y], local[shape, TAIL_X], local[shape, TAIL_Y]
    tail = TAIL[kind]
    if tail == _DIRECTION:
        u, v = c * u - s * v, s * u + c * v
    elif tail == _POINT:
        u, v = frame_x + c * u - s * v, frame_y + s * u + c * v
    return frame_x + c * x - s * y, frame_y + s * x + c * y, u, v


@kernel
def place_shapes(kind: Ints, wall: Ints, local: Floats, wall_position: Floats, world: Floats) -> None:
    """Move the wall shapes from the frame of their wall to the world.

    Args:
        kind: `ShapeKind` of each shape, shape ``(m,)``.
        wall: Wall of each shape, shape ``(m,)``.
        local: Geometry in the wall's frame [m], shape ``(m, 4)``.
        wall_position: Frames: origin [m] and angle [rad], shape ``(w, 3)``.
        world: Geometry in the world [m], shape ``(m, 4)``. **Modified.**
    """
    for k in range(kind.size):
        frame = wall_position[wall[k]]
        world[k, X], world[k, Y], world[k, TAIL_X], world[k, TAIL_Y] = placed_shape(
            kind[k], local, k, frame[X], frame[Y], frame[ANGLE]
        )


def scene_of(model: Model, position: Floats, wall_position: Floats, temperature: Floats = _NO_TEMPERATURE) -> Scene:
    """Shapes where grains and walls are, in arrays of its own where the wall shapes are; arguments as the attributes of `Scene`."""
    shapes, world = model.shapes, np.empty((model.shape_count, 4))
    place_shapes(shapes.kind, shapes.wall, shapes.geometry, wall_position, world)
    return Scene(
        position, model.grains.radius, model.material, shapes.kind, shapes.wall, world, wall_position, model.period, temperature
    )


@formula
def pair_geometry(scene: Scene, i: int, j: int) -> tuple[float, float, float]:
    """Gap and normal (from j to i) of a pair."""
    count = scene.radius.size
    x, y = scene.position[i, X], scene.position[i, Y]
    if j < count:
        dx = minimum_image(x - scene.position[j, X], scene.period)
        return disc_disc(dx, y - scene.position[j, Y], scene.radius[i] + scene.radius[j])
    return gap_to_shape(x, y, scene.radius[i], j - count, scene.kind, scene.world, scene.period)


@formula
def known_geometry(scene: Scene, i: int, j: int) -> tuple[float, float, float]:
    """As `pair_geometry`, of a pair that is known to have met: a wall shape counts with its ends, even if another is closer now."""
    count = scene.radius.size
    if j < count:
        return pair_geometry(scene, i, j)
    x, y = scene.position[i, X], scene.position[i, Y]
    distance, nx, ny = distance_to_shape(x, y, j - count, scene.kind, scene.world, scene.period)
    return distance - scene.radius[i], nx, ny
