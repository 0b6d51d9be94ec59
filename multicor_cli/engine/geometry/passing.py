"""What passes along an edge meets no corner ahead; and how fast points approach.

Discrete steps see corners that a motion in continuous time never reaches: of boxes that slide over
flush boxes, of joints (theory §3.4).
"""

from __future__ import annotations

from math import inf, sqrt

from multicor_cli.engine.geometry.outlines import (
    LEAN,
    NOWHERE,
    Point,
    between,
    is_of_corner,
    is_outside,
    moved,
    swapped,
    touch_pieces,
)
from multicor_cli.engine.geometry.pieces import NORMAL_X, NORMAL_Y, Pieces
from multicor_cli.engine.geometry.scene import Scene, from_other, nearest_image
from multicor_cli.engine.jit.compile import inlined, subroutine
from multicor_cli.model.columns import SURFACE, XX, XY, YY, X, Y
from multicor_cli.model.model import Floats
from multicor_cli.model.shapes import ShapeKind

_VERTEX, _SEGMENT, _SIDE = int(ShapeKind.VERTEX), int(ShapeKind.SEGMENT), int(ShapeKind.SIDE)

PASSING = 0.1
"""Closing speed over that of the nearest point, up to which a pair moves along an edge."""

BESIDE = 20.0
"""How far from a corner of both pieces a point may be that is passed, over the overlap there: at
corners of more than 3° another edge overlaps by more where it is farther. Or it is as far as the
pair moves in a step: a side that leans forward meets the corner of the next joint that far up."""

ALIKE = 1e-3
"""Sine of the angle between two normals that are the same axis."""


@inlined
def approach(point: Point, scene: Scene, pieces: Pieces, velocity: Floats, i: int, j: int) -> float:
    """u_n of a point with these velocities of the bodies [m/s]."""
    body, turning = j, velocity[i, SURFACE] / pieces.spin[i]
    if j < scene.radius.size:
        theirs = velocity[j, SURFACE] / pieces.spin[j]
    else:
        body = scene.radius.size + scene.wall[j - scene.radius.size]
        theirs = velocity[body, SURFACE]
    dx = velocity[i, X] - turning * point.i_y - (velocity[body, X] - theirs * point.j_y)
    dy = velocity[i, Y] + turning * point.i_x - (velocity[body, Y] + theirs * point.j_x)
    if scene.height > 0.0:  # and as the gradient of a cell carries their centers
        lx = point.j_x + point.gap * point.nx - point.i_x
        ly = point.j_y + point.gap * point.ny - point.i_y
        row = scene.radius.size
        dx += velocity[row, XX] * lx + velocity[row, XY] * ly
        dy += velocity[row, YY] * ly
    return float(dx * point.nx + dy * point.ny)


@subroutine
def _over_edge(pieces: Pieces, p: int, edge: int, q: int, ox: float, oy: float) -> Point:
    """The lowest corner of q over an edge of p, whichever is nearest to its ends; i is p here.

    (ox, oy) leads from the center of p to that of q.
    """
    corner, start = pieces.corner, pieces.start
    after = edge + 1 if edge + 1 < start[p + 1] else start[p]
    px, py = corner[edge, X], corner[edge, Y]
    nx, ny = corner[edge, NORMAL_X], corner[edge, NORMAL_Y]
    length = (corner[after, Y] - py) * nx - (corner[after, X] - px) * ny
    least, nearest, low, beyond = inf, start[q], inf, inf
    for v in range(start[q], start[q + 1]):
        least = min(least, nx * (ox + corner[v, X] - px) + ny * (oy + corner[v, Y] - py))
    for v in range(start[q], start[q + 1]):
        x, y = ox + corner[v, X] - px, oy + corner[v, Y] - py
        height, at = nx * x + ny * y, y * nx - x * ny
        outside = max(-at, at - length, 0.0)
        if height <= least + LEAN * length and outside < beyond:
            nearest, low, beyond = v, height, outside
    vx, vy = ox + corner[nearest, X], oy + corner[nearest, Y]
    return between(
        vx - low * nx, vy - low * ny, vx, vy, nx, ny, pieces.rounding[p], pieces.rounding[q], ox,
        oy, nearest,
    )  # fmt: skip


@subroutine
def _is_beside_corner(pieces: Pieces, p: int, x: float, y: float, near: float) -> bool:
    """Whether a place is no farther than ``near`` [m] from a corner of a core."""
    for v in range(pieces.start[p], pieces.start[p + 1]):
        dx, dy = x - pieces.corner[v, X], y - pieces.corner[v, Y]
        if dx * dx + dy * dy <= near * near:
            return True
    return False


@subroutine
def _is_axis(point: Point, first: Point, scene: Scene, shape: int, graze: float) -> bool:
    """Whether a pair may pass over the edge of this point, not that of its nearest one."""
    turned_by = abs(point.nx * first.ny - point.ny * first.nx)
    if point.gap < -graze or turned_by < ALIKE:
        return False
    is_vertex = shape >= 0 and scene.kind[shape] == _VERTEX
    return not is_vertex or is_outside(scene, shape, point.nx, point.ny, PASSING)


@subroutine
def _past(
    first: Point, scene: Scene, pieces: Pieces, velocity: Floats, i: int, a: int, j: int, b: int,
    wall_x: float, wall_y: float, dt: float, graze: float,
) -> Point:  # fmt: skip
    """The point over the edge that the motion keeps open longest, or the nearest one.

    The pieces are a and b, (wall_x, wall_y) the reference point of a wall, or 0.
    """
    closing = approach(first, scene, pieces, velocity, i, j)
    found, widest, shape = first, first.gap + dt * closing, j - scene.radius.size
    # From the center of i to that of j, or for walls to the origin
    ox = first.i_x - first.j_x - first.gap * first.nx - wall_x
    oy = first.i_y - first.j_y - first.gap * first.ny - wall_y
    for turn in range(2):
        p, q = (a, b) if turn == 0 else (b, a)
        x, y = (ox, oy) if turn == 0 else (-ox, -oy)
        last = pieces.start[p + 1] if pieces.start[p + 1] > pieces.start[p] + 1 else 0
        for edge in range(pieces.start[p], last):  # a single corner has none
            point = _over_edge(pieces, p, edge, q, x, y)
            point = point if turn == 0 else swapped(point)
            if not _is_axis(point, first, scene, shape, graze):
                continue
            point = moved(point, -wall_x, -wall_y)
            speed = approach(point, scene, pieces, velocity, i, j)
            later = point.gap + dt * speed
            if later > widest and (later >= 0.0 or speed >= PASSING * closing):
                found, widest = point, later
    return found


@inlined
def touch_passing(
    pieces: Pieces, scene: Scene, i: int, a: int, j: int, b: int, velocity: Floats, dt: float,
    graze: float,
) -> tuple[Point, Point]:  # fmt: skip
    """As `touch_pieces`, of what passes along an edge with these velocities the point over it.

    A corner ahead is no obstacle if the pair is apart over another edge, or overlaps there by no
    more than ``graze`` [m], and moves along this edge or stays above it (theory §3.4).
    """
    first, second = touch_pieces(pieces, scene, i, a, j, b)
    if first.gap == inf:  # at the end of a side, but the other one is not
        first, second = second, first
    if first.gap == inf or first.gap + dt * approach(first, scene, pieces, velocity, i, j) >= 0.0:
        return first, second
    return _pass(first, second, scene, pieces, velocity, i, a, j, b, dt, graze)


@subroutine
def _pass(
    first: Point, second: Point, scene: Scene, pieces: Pieces, velocity: Floats, i: int, a: int,
    j: int, b: int, dt: float, graze: float,
) -> tuple[Point, Point]:  # fmt: skip
    """As `touch_passing`, of points that `touch_pieces` has found and that close."""
    shape, wall_x, wall_y, met = j - scene.radius.size, 0.0, 0.0, b
    if shape >= 0:
        met = pieces.piece[j]
        if met == pieces.piece[j + 1]:  # a plane, or a circle around it, has no corners
            return first, second
        wall_x = scene.wall_position[scene.wall[shape], X]
        wall_y = scene.wall_position[scene.wall[shape], Y]
    r_a, r_b = pieces.rounding[a], pieces.rounding[met]
    near = max(BESIDE * graze, dt * fastest_points(scene, pieces, velocity, i, j))
    if not _is_beside_corner(
        pieces, a, first.i_x + r_a * first.nx, first.i_y + r_a * first.ny, near
    ) or not _is_beside_corner(
        pieces, met, first.j_x + wall_x - r_b * first.nx, first.j_y + wall_y - r_b * first.ny, near
    ):
        return first, second
    found = _past(first, scene, pieces, velocity, i, a, j, met, wall_x, wall_y, dt, graze)
    if found.nx == first.nx and found.ny == first.ny:
        return first, second
    is_line = shape >= 0 and scene.kind[shape] in (_SEGMENT, _SIDE)
    if is_line and is_of_corner(pieces, met, found):
        return NOWHERE, NOWHERE
    return found, NOWHERE


@inlined
def fastest_points(scene: Scene, pieces: Pieces, velocity: Floats, i: int, j: int) -> float:
    """No points of a grain and of j approach faster [m/s]; ``velocity`` of all bodies."""
    count = scene.radius.size
    if j >= count:
        return _fastest_over(scene, pieces, velocity, i, j - count)
    mine = velocity[i, SURFACE] / pieces.spin[i]
    theirs = velocity[j, SURFACE] / pieces.spin[j] * scene.radius[j]
    vx, vy = velocity[i, X] - velocity[j, X], velocity[i, Y] - velocity[j, Y]
    if scene.height > 0.0:  # as the gradient of a cell carries them apart
        dx, dy = from_other(scene, i, j)
        vx += velocity[count, XX] * dx + velocity[count, XY] * dy
        vy += velocity[count, YY] * dy
    return float(sqrt(vx * vx + vy * vy) + abs(mine) * scene.radius[i] + abs(theirs))


@subroutine
def _fastest_over(scene: Scene, pieces: Pieces, velocity: Floats, i: int, shape: int) -> float:
    """As `fastest_points`, over a wall shape."""
    # As the wall sees it, whose points turn around the center of the grain
    wall = scene.wall[shape]
    body, x = scene.radius.size + wall, scene.position[i, X] - scene.wall_position[wall, X]
    turning, of_wall = velocity[i, SURFACE] / pieces.spin[i], velocity[body, SURFACE]
    y = scene.position[i, Y] - scene.wall_position[wall, Y]
    vx = velocity[i, X] - (velocity[body, X] - of_wall * y)
    vy = velocity[i, Y] - (velocity[body, Y] + of_wall * nearest_image(x, scene.period))
    return float(sqrt(vx * vx + vy * vy) + abs(turning - of_wall) * scene.radius[i])
