"""Shapes at one moment, as kernels see them, and the gaps and normals of their pairs."""

from __future__ import annotations

from math import floor, inf, sqrt
from typing import NamedTuple

import numpy as np

from multicor_cli.arithmetic import cos, sin
from multicor_cli.engine.jit.compile import kernel, subroutine
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.model.columns import ANGLE, TAIL_X, TAIL_Y, X, Y
from multicor_cli.model.model import Floats, Ints, Model
from multicor_cli.model.shapes import TAIL, ShapeKind, Tail

# ---- Gap and normal between a disc and each kind of shape; normals point to the disc

_DISC = int(ShapeKind.DISC)
_PLANE = int(ShapeKind.PLANE)
_VERTEX = int(ShapeKind.VERTEX)
_CIRCLE = int(ShapeKind.CIRCLE)
_SIDE = int(ShapeKind.SIDE)


@formula
def minimum_image(dx: float, period: float) -> float:
    """Nearest periodic image of a difference in x [m] below 3/2 period; ``period`` 0: none."""
    if period > 0.0:
        half = 0.5 * period
        if dx > half:
            return dx - period
        if dx < -half:
            return dx + period
    return dx


@formula
def shortest(
    dx: float, dy: float, period: float, height: float, tilt: float
) -> tuple[float, float]:
    """Nearest periodic image of a vector between grains [m], much shorter than the periods.

    In a cell (``height`` > 0) images in y lie ``height`` apart in y and ``tilt`` in x; else as
    `minimum_image`.
    """
    if height > 0.0:
        images = floor(dy / height + 0.5)
        dx -= images * tilt
        return dx - period * floor(dx / period + 0.5), dy - images * height
    return minimum_image(dx, period), dy


@formula
def nearest_image(dx: float, period: float) -> float:
    """As `minimum_image` for any dx, however many periods long (a wall that keeps moving)."""
    if period > 0.0:
        return dx - period * floor(dx / period + 0.5)
    return dx


@formula
def disc_disc(dx: float, dy: float, radii: float) -> tuple[float, float, float]:
    """Gap [m] and unit normal of two discs with centers (dx, dy) apart and this sum of radii."""
    distance = sqrt(dx * dx + dy * dy)
    if distance == 0.0:
        return -radii, 0.0, 1.0
    return distance - radii, dx / distance, dy / distance


@formula
def disc_plane(
    dx: float, dy: float, nx: float, ny: float, radius: float
) -> tuple[float, float, float]:
    """Disc against a half-plane; (dx, dy) from a point of the plane to the center."""
    return dx * nx + dy * ny - radius, nx, ny


@formula
def from_first_end(x: float, x0: float, x1: float, period: float) -> float:
    """``x − x0`` [m] of the image of x nearest to the middle of a line: the one it may meet.

    Lines are shorter than half a period (`WallBody.with_line`), so that an image near one of their
    ends is near no other image.
    """
    if period > 0.0:
        return x - x0 - period * floor((x - 0.5 * (x0 + x1)) / period + 0.5)
    return x - x0


@formula
def segment_parameter(px: float, py: float, x0: float, y0: float, x1: float, y1: float) -> float:
    """Foot of (px, py) on the line from (x0, y0) to (x1, y1): 0 and 1 at the ends."""
    ex, ey = x1 - x0, y1 - y0
    return ((px - x0) * ex + (py - y0) * ey) / (ex * ex + ey * ey)


@formula
def disc_circle(
    dx: float, dy: float, circle_radius: float, radius: float
) -> tuple[float, float, float]:
    """Disc inside a circle (a drum); (dx, dy) from its center to the disc's. Normal inwards."""
    distance = sqrt(dx * dx + dy * dy)
    if distance == 0.0:
        return circle_radius - radius, 0.0, 1.0
    return circle_radius - distance - radius, -dx / distance, -dy / distance


@subroutine
def _past_end(
    x: float, y: float, world: Floats, segment: int, is_start: bool, period: float
) -> bool:
    """Whether the point of the segment closest to (x, y) is that end."""
    s = world[segment]
    dx = from_first_end(x, s[X], s[TAIL_X], period)
    foot = segment_parameter(s[X] + dx, y, s[X], s[Y], s[TAIL_X], s[TAIL_Y])
    return foot <= 0.0 if is_start else foot >= 1.0


@kernel
def gap_to_shape(
    x: float, y: float, radius: float, shape: int, kind: Ints, world: Floats, period: float
) -> tuple[float, float, float]:
    """Gap [m] and normal of a grain and a wall shape; ``inf`` where another one is closer."""
    what = kind[shape]
    g0, g1, g2, g3 = world[shape, X], world[shape, Y], world[shape, TAIL_X], world[shape, TAIL_Y]
    dx, dy = nearest_image(x - g0, period), y - g1
    if what == _DISC:
        return disc_disc(dx, dy, radius + g2)
    if what == _PLANE:
        return disc_plane(dx, dy, g2, g3, radius)
    if what == _CIRCLE:
        return disc_circle(dx, dy, g2, radius)
    if what != _VERTEX:  # a segment or a side
        px, py = g0 + from_first_end(x, g0, g2, period), g1 + dy
        foot = segment_parameter(px, py, g0, g1, g2, g3)
        if foot <= 0.0 or foot >= 1.0:
            return inf, 0.0, 1.0
        return disc_disc(px - g0 - foot * (g2 - g0), py - g1 - foot * (g3 - g1), radius)
    px, py = g0 + dx, g1 + dy
    if g2 >= 0.0 and not _past_end(px, py, world, int(g2), False, period):
        return inf, 0.0, 1.0
    if g3 >= 0.0 and not _past_end(px, py, world, int(g3), True, period):
        return inf, 0.0, 1.0
    return disc_disc(dx, dy, radius)


@formula
def distance_to_whole(
    x: float, y: float, what: int, g0: float, g1: float, g2: float, g3: float, period: float
) -> tuple[float, float, float]:
    """Distance of (x, y) from a shape with its ends [m] and normal, even if another is closer."""
    dx, dy = nearest_image(x - g0, period), y - g1
    if what == _DISC:
        return disc_disc(dx, dy, g2)
    if what == _PLANE:
        return disc_plane(dx, dy, g2, g3, 0.0)
    if what == _CIRCLE:
        return disc_circle(dx, dy, g2, 0.0)
    if what != _VERTEX:  # a segment or a side
        dx = from_first_end(x, g0, g2, period)
        foot = min(max(segment_parameter(g0 + dx, y, g0, g1, g2, g3), 0.0), 1.0)
        dx -= foot * (g2 - g0)
        dy -= foot * (g3 - g1)
    return disc_disc(dx, dy, 0.0)


@formula
def distance_to_shape(
    x: float, y: float, shape: int, kind: Ints, world: Floats, period: float
) -> tuple[float, float, float]:
    """As `distance_to_whole`, from a wall shape of a scene."""
    g0, g1, g2, g3 = world[shape, X], world[shape, Y], world[shape, TAIL_X], world[shape, TAIL_Y]
    return distance_to_whole(x, y, kind[shape], g0, g1, g2, g3, period)


@formula
def is_near_shape(
    x: float, y: float, radius: float, shape: int, kind: Ints, world: Floats, period: float,
    cutoff: float,
) -> bool:  # fmt: skip
    """Whether a grain is nearer than ``cutoff`` [m] to a wall shape, even if another is closer.

    For the neighbor list: `gap_to_shape` is infinite where another shape of the wall is closer.
    """
    return distance_to_shape(x, y, shape, kind, world, period)[0] - radius < cutoff


# ---- Shapes at one moment, as kernels see them, and the gap of a pair of them

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
        temperature: Temperatures of all shapes [K], nan where a wall has none, shape ``(n + m,)``;
            of size 0 where no friction depends on them.
        height: Period in y [m] of a cell, or 0.
        tilt: How far images across the height lie to the right [m].
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
    height: float = 0.0
    tilt: float = 0.0


@formula
def placed_shape(
    kind: int, local: Floats, shape: int, frame_x: float, frame_y: float, angle: float
) -> tuple[float, float, float, float]:
    """Four numbers of a wall shape in the world, its wall at (frame_x, frame_y) [m] and turned."""
    c, s = cos(angle), sin(angle)
    x, y, u, v = local[shape, X], local[shape, Y], local[shape, TAIL_X], local[shape, TAIL_Y]
    tail = TAIL[kind]
    if tail == _DIRECTION:
        u, v = c * u - s * v, s * u + c * v
    elif tail == _POINT:
        u, v = frame_x + c * u - s * v, frame_y + s * u + c * v
    return frame_x + c * x - s * y, frame_y + s * x + c * y, u, v


@kernel
def place_shapes(
    kind: Ints, wall: Ints, local: Floats, wall_position: Floats, world: Floats
) -> None:
    """Move wall shapes from the frames of their walls, ``local``, to the ``world`` (**modified**).

    Shapes are ``(m, 4)`` [m]; frames are an origin [m] and an angle [rad], shape ``(w, 3)``.
    """
    for k in range(kind.size):
        frame = wall_position[wall[k]]
        world[k, X], world[k, Y], world[k, TAIL_X], world[k, TAIL_Y] = placed_shape(
            kind[k], local, k, frame[X], frame[Y], frame[ANGLE]
        )


def scene_of(
    model: Model, position: Floats, wall_position: Floats, temperature: Floats = _NO_TEMPERATURE
) -> Scene:
    """Shapes where grains and walls are; positions are the arrays given, no copies of them."""
    shapes, world = model.shapes, np.empty((model.shape_count, 4))
    place_shapes(shapes.kind, shapes.wall, shapes.geometry, wall_position, world)
    period, height, tilt = model.period, 0.0, 0.0
    if model.is_cell:
        period, height, tilt = wall_position[0].tolist()
    return Scene(
        position, model.grains.radius, model.material, shapes.kind, shapes.wall, world,
        wall_position, period, temperature, height, tilt,
    )  # fmt: skip


@formula
def from_other(scene: Scene, i: int, j: int) -> tuple[float, float]:
    """From the center of a grain j to that of another, i, over the nearest images [m]."""
    at = scene.position
    dx, dy = at[i, X] - at[j, X], at[i, Y] - at[j, Y]
    return shortest(dx, dy, scene.period, scene.height, scene.tilt)


@formula
def pair_geometry(scene: Scene, i: int, j: int) -> tuple[float, float, float]:
    """Gap and normal (from j to i) of a pair."""
    count = scene.radius.size
    if j < count:
        dx, dy = from_other(scene, i, j)
        return disc_disc(dx, dy, scene.radius[i] + scene.radius[j])
    x, y = scene.position[i, X], scene.position[i, Y]
    return gap_to_shape(x, y, scene.radius[i], j - count, scene.kind, scene.world, scene.period)


@formula
def are_apart(scene: Scene, i: int, j: int, gap: float) -> bool:
    """Whether a pair is one of grains, discs, with at least that gap [m]; found without a root."""
    if j >= scene.radius.size:
        return False
    dx, dy = from_other(scene, i, j)
    reach = scene.radius[i] + scene.radius[j] + gap
    return dx * dx + dy * dy >= reach * reach


@formula
def known_geometry(scene: Scene, i: int, j: int) -> tuple[float, float, float]:
    """As `pair_geometry` of a pair that has met: walls with ends, even if another is closer now."""
    count = scene.radius.size
    if j < count:
        return pair_geometry(scene, i, j)
    x, y = scene.position[i, X], scene.position[i, Y]
    distance, nx, ny = distance_to_shape(x, y, j - count, scene.kind, scene.world, scene.period)
    return distance - scene.radius[i], nx, ny
