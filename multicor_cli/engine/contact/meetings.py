"""When and where grains in flight meet what is around them: on parabolas, from a time on.

In a cell ways are straight, and images move with the mean flow: those of a grain that is ℓ away
are faster by L ℓ.
"""

from __future__ import annotations

from math import floor, inf, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.geometry.neighbors import Around
from multicor_cli.engine.geometry.scene import Scene, distance_to_whole, nearest_image, placed_shape
from multicor_cli.engine.jit.compile import loop_body
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.model.columns import ANGLE, SPIN, XX, XY, YY, X, Y
from multicor_cli.model.model import Floats
from multicor_cli.model.shapes import ShapeKind

_CIRCLE = int(ShapeKind.CIRCLE)

TOUCHING = 1e-13
"""Gap over the radius at which a grain touches a wall."""

_LOOKS = 60  # at a way towards a wall; five do


class Walls(NamedTuple):
    """Walls in a step, each with its mean velocity.

    Attributes:
        local: Shapes in the frames of their walls, shape ``(m, 4)``.
        frame: These frames at the start of the step, shape ``(w, 3)``.
        velocity: Mean velocities, shape ``(w, 3)``; belt speeds as in column `BELT`, ``(w,)``.
        is_free: Which walls loads move: what meets them does not fly on, shape ``(w,)``.
    """

    local: Floats
    frame: Floats
    velocity: Floats
    belt: Floats
    is_free: NDArray[np.bool_]


class Air(NamedTuple):
    """What the flights of a step need; ``place`` and ``bodies`` are starts as they are now.

    ``flow`` is the gradient of a cell at the start of the step [1/s], shape ``(3,)``; else zeros.
    """

    scene: Scene
    flow: Floats
    walls: Walls
    around: Around
    gravity: Floats
    dt: float
    place: Floats
    bodies: Floats
    flying: NDArray[np.bool_]


@formula
def relative(air: Air, i: int, j: int, t: float) -> tuple[float, float, float, float]:
    """Where grain i is from grain j at a time [m], nearest image, and how fast it moves so [m/s].

    Gravity acts on both.
    """
    scene, place, bodies = air.scene, air.place, air.bodies
    u, v = bodies[i, X] - bodies[j, X], bodies[i, Y] - bodies[j, Y]
    dx, dy = place[i, X] - place[j, X] + t * u, place[i, Y] - place[j, Y] + t * v
    if scene.height > 0.0:
        right, up = _image(air, dx, dy, t)
        return _to_image(air, dx, dy, u, v, -right, -up, t)
    return nearest_image(dx, scene.period), dy, u, v


@formula
def _image(air: Air, dx: float, dy: float, t: float) -> tuple[float, float]:
    """How many widths and heights of a cell at a time [s] a vector is long."""
    scene, flow = air.scene, air.flow
    xx, yy, xy = flow[XX], flow[YY], flow[XY]
    up = floor(dy / (scene.height + t * yy * scene.height) + 0.5)
    dx -= up * (scene.tilt + t * (xx * scene.tilt + xy * scene.height))
    return floor(dx / (scene.period + t * xx * scene.period) + 0.5), up


@formula
def _to_image(
    air: Air, dx: float, dy: float, u: float, v: float, right: float, up: float, t: float
) -> tuple[float, float, float, float]:
    """A vector and its velocity, to the image so many widths and heights of a cell farther."""
    scene, flow = air.scene, air.flow
    xx, yy, xy = flow[XX], flow[YY], flow[XY]
    x, y = right * scene.period + up * scene.tilt, up * scene.height
    more_u, more_v = xx * x + xy * y, yy * y
    return dx + (x + t * more_u), dy + (y + t * more_v), u + more_u, v + more_v


@formula
def _wait(dx: float, dy: float, u: float, v: float, reach: float) -> float:
    """How long two discs fly until they touch [s]; infinite if they do not."""
    along = dx * u + dy * v
    room = dx * dx + dy * dy - reach * reach
    square = along * along - (u * u + v * v) * room
    if along < 0.0 and square > 0.0:
        return room / (sqrt(square) - along) if room > 0.0 else 0.0
    return inf


@formula
def _discs_meet(air: Air, i: int, j: int, now: float, end: float) -> float:
    """When two grains meet, from a time on and before the ``end`` [s]; else infinite."""
    scene = air.scene
    dx, dy, u, v = relative(air, i, j, now)
    reach, long, images, best = scene.radius[i] + scene.radius[j], end - now, 0, inf
    if scene.height > 0.0:
        images = _images_within(air, dx, dy, u, v, reach, long)
        for up in range(-images, images + 1):
            for right in range(-images, images + 1):
                x, y, vx, vy = _to_image(air, dx, dy, u, v, right, up, now)
                best = min(best, now + _wait(x, y, vx, vy, reach))
        return best if best < end else inf
    if scene.period > 0.0 and abs(dx) + abs(u) * long + reach > 0.5 * scene.period:
        images = int(abs(u) * long / scene.period) + 1
    elif dx * u + dy * v >= 0.0:
        return inf
    for image in range(-images, images + 1):
        best = min(best, now + _wait(dx + image * scene.period, dy, u, v, reach))
    return best if best < end else inf


@formula
def _images_within(
    air: Air, dx: float, dy: float, u: float, v: float, reach: float, long: float
) -> int:
    """How many widths and heights of a cell away are images that come within reach in a time [s].

    None but the nearest, as long as steps are short. Strain takes a part of the way to the others.
    """
    scene, flow = air.scene, air.flow
    strain = long * (abs(flow[XX]) + abs(flow[YY]) + abs(flow[XY]))
    room = max(1.0 - strain, 0.1) * min(scene.period, scene.height)
    return int((reach + abs(dx) + abs(dy) + long * (abs(u) + abs(v))) / room)


@formula
def discs_meet_soon(air: Air, i: int, j: int, end: float) -> bool:
    """Whether two grains meet before the ``end`` [s], without branches that nobody could foresee.

    As `_discs_meet` from time 0 on says.
    """
    scene = air.scene
    dx, dy, u, v = relative(air, i, j, 0.0)
    reach = scene.radius[i] + scene.radius[j]
    if scene.height > 0.0:
        if _images_within(air, dx, dy, u, v, reach, end) > 0:
            return bool(_discs_meet(air, i, j, 0.0, end) < inf)
    elif scene.period > 0.0 and abs(dx) + abs(u) * end + reach > 0.5 * scene.period:
        return bool(_discs_meet(air, i, j, 0.0, end) < inf)
    along = dx * u + dy * v
    room = dx * dx + dy * dy - reach * reach
    square = along * along - (u * u + v * v) * room
    wait = room / (sqrt(max(square, 0.0)) - along)
    return bool((along < 0.0) & (square > 0.0) & ((room <= 0.0) | (wait < end)))


@formula
def wall_at(
    scene: Scene, walls: Walls, place: Floats, bodies: Floats, gravity: Floats, i: int, shape: int,
    t: float,
) -> tuple[float, float, float, float, float, float, float, float, float]:  # fmt: skip
    """A grain and a wall shape at a time.

    Returns the gap [m] and its normal, the lever of the point that is nearest on the wall [m], the
    velocity of the grain against it [m/s], a bound of how fast the gap's rate may fall [m/s²], and
    the time for which it holds [s].
    """
    w = scene.wall[shape]
    x = place[i, X] + t * (bodies[i, X] + 0.5 * t * gravity[X])
    y = place[i, Y] + t * (bodies[i, Y] + 0.5 * t * gravity[Y])
    frame, move = walls.frame[w], walls.velocity[w]
    fx, fy, spin = frame[X] + t * move[X], frame[Y] + t * move[Y], move[SPIN]
    g0, g1, g2, g3 = placed_shape(
        scene.kind[shape], walls.local, shape, fx, fy, frame[ANGLE] + t * spin
    )
    distance, nx, ny = distance_to_whole(x, y, scene.kind[shape], g0, g1, g2, g3, scene.period)
    dx = x - fx - distance * nx
    if scene.period > 0.0:  # the image of the point on the wall counts
        dx -= scene.period * floor(dx / scene.period + 0.5)
    dy = y - fy - distance * ny
    u = bodies[i, X] + t * gravity[X] - (move[X] - spin * dy)
    v = bodies[i, Y] + t * gravity[Y] - (move[Y] + spin * dx)
    falls = sqrt(gravity[X] * gravity[X] + gravity[Y] * gravity[Y])
    holds = inf
    if spin != 0.0:  # Coriolis and centrifugal forces in the frame of the wall
        speed = sqrt(u * u + v * v) + abs(spin) * abs(distance)
        arm = sqrt(dx * dx + dy * dy) + abs(distance)
        falls = 2.0 * falls + 2.0 * abs(spin) * (2.0 * speed + abs(spin) * arm)
        holds = 0.1 / abs(spin)
    if scene.period > 0.0:  # until another image may be nearer; lines are shorter than half of it
        speed = sqrt(u * u + v * v) + abs(spin) * abs(distance)
        away = max(0.25 * scene.period - abs(distance * nx), distance - scene.radius[i])
        holds = min(holds, max(away, 1e-3 * scene.radius[i]) / speed) if speed > 0.0 else holds
    if scene.kind[shape] == _CIRCLE:  # inside, a straight way bends towards it
        inner, speed = g2 - distance, sqrt(u * u + v * v)
        if speed > 0.0:
            holds = min(holds, max(0.5 * inner, 1e-3 * scene.radius[i]) / speed)
        falls += 2.0 * speed * speed / max(inner, 2e-3 * scene.radius[i])
    return distance - scene.radius[i], nx, ny, dx, dy, u, v, falls, holds


@loop_body
def _wall_meets(
    scene: Scene, walls: Walls, place: Floats, bodies: Floats, gravity: Floats, i: int, shape: int,
    now: float, end: float,
) -> float:  # fmt: skip
    """When a grain meets a wall shape, from a time on and before the ``end`` [s]; else infinite.

    From below: the gap is at least gap + rate s − ½ a s² after s, with the bound a of `wall_at`.
    """
    t, touching = now, TOUCHING * scene.radius[i]
    for _ in range(_LOOKS):
        gap, nx, ny, _, _, u, v, falls, holds = wall_at(
            scene, walls, place, bodies, gravity, i, shape, t
        )
        rate = u * nx + v * ny
        if gap <= touching and (
            rate < 0.0 or (rate == 0.0 and gravity[X] * nx + gravity[Y] * ny < 0.0)
        ):
            return t
        room = max(gap, 0.0)
        root = sqrt(rate * rate + 2.0 * falls * room)
        if rate < 0.0:
            wait = 2.0 * room / (root - rate)
        else:
            wait = (rate + root) / falls if falls > 0.0 else inf
        t += min(wait, holds)
        if t >= end:
            return inf
    return inf


@formula
def meets(air: Air, i: int, j: int, now: float, end: float) -> float:
    """When a grain meets a shape, from a time on and before the ``end`` [s]; else infinite."""
    count = air.flying.size
    if j >= count:
        return _wall_meets(
            air.scene, air.walls, air.place, air.bodies, air.gravity, i, j - count, now, end
        )
    # The same bits whoever asks
    first, second = (i, j) if i < j else (j, i)
    return _discs_meet(air, first, second, now, end)
