"""Where grains that are no discs touch: pieces with corners, their points, and those with walls.

A piece is what lies within its rounding r of its core: a corner, two, or a convex polygon
(`model/outlines.py`). Two cores that are apart are nearest at two of their corners, or at a corner
and an edge; two edges that are nearly parallel touch at both ends of what they share. So two pieces
have up to two points, and each is at a corner of one of them.

Source: separating axes and clipping, as in E. Catto, *Box2D* (2024); that the edge which separates
two cores most ends in their nearest corner follows from the support functions (derived).
"""

from __future__ import annotations

from math import inf, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.arithmetic import cos, sin
from multicor_cli.engine.geometry.scene import (
    Scene,
    distance_to_shape,
    from_first_end,
    nearest_image,
    pair_geometry,
    shortest,
)
from multicor_cli.engine.jit.compile import kernel, subroutine
from multicor_cli.model.columns import (
    ANGLE,
    RADIUS,
    SURFACE,
    TAIL_X,
    TAIL_Y,
    XX,
    XY,
    YY,
    X,
    Y,
)
from multicor_cli.model.model import Floats, Ints, Model
from multicor_cli.model.outlines import Outlines
from multicor_cli.model.shapes import ShapeKind

NORMAL_X, NORMAL_Y = 2, 3
"""Columns of corners: outward normal of the edge to the next one."""

_PLANE, _CIRCLE, _VERTEX = int(ShapeKind.PLANE), int(ShapeKind.CIRCLE), int(ShapeKind.VERTEX)
_DISC, _SEGMENT, _SIDE = int(ShapeKind.DISC), int(ShapeKind.SEGMENT), int(ShapeKind.SIDE)
_CORNERS = {_PLANE: 0, _CIRCLE: 0, _VERTEX: 1, _DISC: 1, _SEGMENT: 2, _SIDE: 2}

_PARALLEL = 1e-9
"""Of an edge: shorter pieces that two edges share are points, and closer corners are one."""

LEAN = 1e-6
"""How far, as a sine, the normal at a corner of a wall may lie outside of those of both sides: the
corner of a flush joint is no obstacle to what slides towards it."""


# ---- Pieces of grains and of wall shapes, at one moment


class Pieces(NamedTuple):
    """Pieces of all grains, and then those of the wall shapes; planes and circles have none.

    Attributes:
        piece: First piece of each grain or wall shape, shape ``(n + m + 1,)``.
        start: First corner of each piece, shape ``(p + 1,)``.
        corner: Corners from the center, turned with their grain, and normals of the edges that
            begin there; those of walls in the world [m], shape ``(v, 4)``.
        rounding: How far each piece reaches beyond its core [m], shape ``(p,)``.
        spin: σ, by which spins are speeds σω [m], shape ``(n,)`` (`Model.spin_radius`).
        is_face: Which grains are no discs, shape ``(n,)``.
    """

    piece: Ints
    start: Ints
    corner: Floats
    rounding: Floats
    spin: Floats
    is_face: NDArray[np.bool_]


def pieces_of(model: Model) -> Pieces | None:
    """Pieces of a model at angle 0, walls anywhere; None if all grains are discs."""
    if model.outlines is None:
        return None
    kind = model.shapes.kind
    wide = np.where(kind == _DISC, model.shapes.geometry[:, RADIUS], 0.0)
    return pieces_with(model.outlines, kind, wide, model.spin_radius)


def pieces_with(outlines: Outlines, kind: Ints, wide: Floats, spin: Floats) -> Pieces:
    """Pieces of grains and of wall shapes, which reach ``wide`` beyond their corners [m]."""
    corners = np.array([_CORNERS[each] for each in kind.tolist()], np.int32)
    has = (corners > 0).astype(np.int32)
    ends = outlines.start[-1] + np.cumsum(corners[corners > 0])
    start = np.concatenate([outlines.start, ends]).astype(np.int32)
    corner = np.zeros((int(start[-1]), 4))
    corner[: len(outlines.corner)] = with_normals(outlines)
    return Pieces(
        np.concatenate([outlines.piece, outlines.piece[-1] + np.cumsum(has)]).astype(np.int32),
        start,
        corner,
        np.concatenate([outlines.rounding, wide[corners > 0]]),
        spin,
        ~outlines.is_disc,
    )


def with_normals(outlines: Outlines) -> Floats:
    """Corners at angle 0 and normals of the edges that begin there, as in `Pieces`."""
    found = np.zeros((len(outlines.corner), 4))
    found[:, :2] = outlines.corner
    after = np.arange(1, len(found) + 1)
    after[outlines.start[1:] - 1] = outlines.start[:-1]
    x, y = (outlines.corner[after] - outlines.corner).T
    length = np.sqrt(x * x + y * y)
    length[length == 0.0] = 1.0
    found[:, NORMAL_X], found[:, NORMAL_Y] = y / length, -x / length
    return found


def turned(pieces: Pieces, scene: Scene) -> Pieces:
    """The pieces as grains and walls lie in a scene; ``pieces`` are at angle 0."""
    corner = np.empty(pieces.corner.shape)
    turn_grains(pieces, scene.position, corner)
    place_walls(pieces, scene, corner)
    return pieces._replace(corner=corner)


@kernel
def turn_grains(pieces: Pieces, position: Floats, corner: Floats) -> None:
    """Turn the corners of grains with them, into ``corner``, **modified**."""
    local = pieces.corner
    for k in range(position.shape[0]):
        c, s = cos(position[k, ANGLE]), sin(position[k, ANGLE])
        for v in range(pieces.start[pieces.piece[k]], pieces.start[pieces.piece[k + 1]]):
            x, y, nx, ny = local[v, X], local[v, Y], local[v, NORMAL_X], local[v, NORMAL_Y]
            corner[v, X], corner[v, Y] = c * x - s * y, s * x + c * y
            corner[v, NORMAL_X], corner[v, NORMAL_Y] = c * nx - s * ny, s * nx + c * ny


@subroutine
def turn_by(pieces: Pieces, scene: Scene, k: int, angle: float) -> None:
    """Turn a grain, whose position and corners are **modified**."""
    scene.position[k, ANGLE] += angle
    c, s, corner = cos(angle), sin(angle), pieces.corner
    for v in range(pieces.start[pieces.piece[k]], pieces.start[pieces.piece[k + 1]]):
        x, y, nx, ny = corner[v, X], corner[v, Y], corner[v, NORMAL_X], corner[v, NORMAL_Y]
        corner[v, X], corner[v, Y] = c * x - s * y, s * x + c * y
        corner[v, NORMAL_X], corner[v, NORMAL_Y] = c * nx - s * ny, s * nx + c * ny


@kernel
def place_walls(pieces: Pieces, scene: Scene, corner: Floats) -> None:
    """Put the corners of wall shapes where they are in a scene, into ``corner``, **modified**."""
    count, world = scene.radius.size, scene.world
    for k in range(scene.kind.size):
        piece = pieces.piece[count + k]
        if piece == pieces.piece[count + k + 1]:
            continue
        v = pieces.start[piece]
        corner[v, X], corner[v, Y] = world[k, X], world[k, Y]
        if pieces.start[piece + 1] - v == 1:
            corner[v, NORMAL_X], corner[v, NORMAL_Y] = 0.0, 0.0
            continue
        corner[v + 1, X], corner[v + 1, Y] = world[k, TAIL_X], world[k, TAIL_Y]
        x, y = world[k, TAIL_X] - world[k, X], world[k, TAIL_Y] - world[k, Y]
        length = sqrt(x * x + y * y)
        corner[v, NORMAL_X], corner[v, NORMAL_Y] = y / length, -x / length
        corner[v + 1, NORMAL_X], corner[v + 1, NORMAL_Y] = -y / length, x / length


@kernel
def resize_grains(at_start: Pieces, initial: Floats, radius: Floats, pieces: Pieces) -> None:
    """Let pieces at angle 0 (**modified**) follow the radii of their grains [m], shape ``(n,)``.

    ``at_start`` are those with the ``initial`` radii. Outlines keep their shapes.
    """
    for k in range(radius.size):
        factor = radius[k] / initial[k]
        pieces.spin[k] = factor * at_start.spin[k] if pieces.is_face[k] else radius[k]
        for p in range(pieces.piece[k], pieces.piece[k + 1]):
            rounding = at_start.rounding[p]
            pieces.rounding[p] = factor * rounding if pieces.is_face[k] else radius[k]
            for v in range(pieces.start[p], pieces.start[p + 1]):
                pieces.corner[v, X] = factor * at_start.corner[v, X]
                pieces.corner[v, Y] = factor * at_start.corner[v, Y]


# ---- Two pieces


class Point(NamedTuple):
    """Where two pieces touch or nearly do.

    Attributes:
        nx: Normal from j to i, (n_x, n_y).
        ny: Its second component.
        gap: Gap along it [m]; infinite where there is no point.
        i_x: From the center of i to its surface, (x, y) [m].
        i_y: Its second component.
        j_x: From the center of j to its surface, (x, y) [m].
        j_y: Its second component.
        corner: The corner of one of them at which it is.
    """

    nx: float
    ny: float
    gap: float
    i_x: float
    i_y: float
    j_x: float
    j_y: float
    corner: np.int64


NOWHERE = Point(0.0, 1.0, inf, 0.0, 0.0, 0.0, 0.0, np.int64(-1))


@subroutine
def _widest(
    corner: Floats, first: int, last: int, other: int, end: int, ox: float, oy: float
) -> tuple[float, int, int]:
    """The edge of a core that is farthest from another core, whose center lies (ox, oy) away.

    Returns how far [m], below 0 if none separates them; the edge, and the nearest corner.
    """
    widest, edge, nearest = -inf, first, other
    if last - first == 1:  # no edge
        return widest, edge, nearest
    for e in range(first, last):
        nx, ny = corner[e, NORMAL_X], corner[e, NORMAL_Y]
        least, at = inf, other
        for v in range(other, end):
            height = nx * (ox + corner[v, X] - corner[e, X]) + ny * (
                oy + corner[v, Y] - corner[e, Y]
            )
            if height < least:
                least, at = height, v
        if least > widest:
            widest, edge, nearest = least, e, at
    return widest, edge, nearest


@subroutine
def _between(
    px: float, py: float, qx: float, qy: float, nx: float, ny: float, r_p: float, r_q: float,
    ox: float, oy: float, corner: int,
) -> Point:  # fmt: skip
    """The point between places of two cores with this normal from p to q, for `_seen_from`."""
    return Point(
        -nx, -ny, (qx - px) * nx + (qy - py) * ny - (r_p + r_q), px + r_p * nx, py + r_p * ny,
        qx - ox - r_q * nx, qy - oy - r_q * ny, np.int64(corner),
    )  # fmt: skip


@subroutine
def _seen_from(
    p: int, edge: int, separation: float, q: int, v: int, ox: float, oy: float, pieces: Pieces
) -> tuple[Point, Point]:
    """Points of the piece p, whose ``edge`` is nearest to the corner v of q; i is p here.

    (ox, oy) leads from the center of p to that of q, ``separation`` is the distance of v from the
    line of the edge [m].
    """
    corner, start = pieces.corner, pieces.start
    last, other, end = start[p + 1], start[q], start[q + 1]
    r_p, r_q = pieces.rounding[p], pieces.rounding[q]
    px, py = corner[edge, X], corner[edge, Y]
    vx, vy = ox + corner[v, X], oy + corner[v, Y]
    nx, ny = corner[edge, NORMAL_X], corner[edge, NORMAL_Y]
    ax, ay, bx, by, gap, key = px, py, vx, vy, separation, np.int64(v)
    second = NOWHERE
    if last - start[p] == 1:  # two corners alone
        nx, ny = vx - px, vy - py
        gap = sqrt(nx * nx + ny * ny)
        nx, ny = (nx / gap, ny / gap) if gap > 0.0 else (0.0, -1.0)
    else:
        after = edge + 1 if edge + 1 < last else start[p]
        length = (corner[after, Y] - py) * nx - (corner[after, X] - px) * ny
        # Of the two edges at v the one that faces p more, to its other corner w
        w, before = v + 1 if v + 1 < end else other, v - 1 if v > other else end - 1
        ahead = nx * corner[v, NORMAL_X] + ny * corner[v, NORMAL_Y]
        behind = nx * corner[before, NORMAL_X] + ny * corner[before, NORMAL_Y]
        w = w if ahead <= behind else before
        wx, wy = ox + corner[w, X], oy + corner[w, Y]
        # Places along the edge of p, from its first corner
        at_v = (vy - py) * nx - (vx - px) * ny
        at_w = (wy - py) * nx - (wx - px) * ny
        low, high, at = min(at_v, at_w), max(at_v, at_w), min(max(at_v, 0.0), length)
        mx, my, is_edge = nx, ny, True
        ax, ay = px - at * ny, py + at * nx
        if at != at_v:
            nearest_end = edge if at == 0.0 else after
            along = (ax - vx) * (wx - vx) + (ay - vy) * (wy - vy)
            if low < at < high and along > 0.0:
                # Edges that are parallel to rounding: the end of this one is over the other
                part = (at - at_v) / (at_w - at_v)
                bx, by = vx + part * (wx - vx), vy + part * (wy - vy)
                gap, key = (bx - ax) * nx + (by - ay) * ny, np.int64(nearest_end)
            elif separation > -_PARALLEL * length:  # or in line
                away = sqrt((vx - ax) * (vx - ax) + (vy - ay) * (vy - ay))
                away_w = sqrt((wx - ax) * (wx - ax) + (wy - ay) * (wy - ay))
                nearer = v
                if away_w < away:  # both as far from the line, to rounding
                    nearer, bx, by, away = w, wx, wy, away_w
                if away > _PARALLEL * length:
                    mx, my, gap = (bx - ax) / away, (by - ay) / away, away
                    is_edge = abs(at - at_v) <= _PARALLEL * length
                    key = np.int64(max(nearer, nearest_end))  # with a wall that of the wall
        to = min(at_w, length) if at_w > at_v else max(at_w, 0.0)
        is_edge = is_edge and low <= to <= high and (to > at) == (at_w > at_v)
        if is_edge and abs(to - at) > _PARALLEL * length:
            part = (to - at_v) / (at_w - at_v)
            second = _between(
                px - to * ny, py + to * nx, vx + part * (wx - vx), vy + part * (wy - vy), mx, my,
                r_p, r_q, ox, oy, w if to == at_w else (after if to == length else edge),
            )  # fmt: skip
        nx, ny = mx, my
    first = Point(
        -nx, -ny, gap - (r_p + r_q), ax + r_p * nx, ay + r_p * ny, bx - ox - r_q * nx,
        by - oy - r_q * ny, key,
    )  # fmt: skip
    return first, second


@subroutine
def _swapped(point: Point) -> Point:
    return Point(
        -point.nx, -point.ny, point.gap, point.j_x, point.j_y, point.i_x, point.i_y, point.corner
    )


@subroutine
def touch(pieces: Pieces, a: int, b: int, dx: float, dy: float) -> tuple[Point, Point]:
    """Points of two pieces, the nearer first; (dx, dy) leads from the center of b's to a's."""
    start, corner = pieces.start, pieces.corner
    of_a, edge_a, far_b = _widest(corner, start[a], start[a + 1], start[b], start[b + 1], -dx, -dy)
    of_b, edge_b, far_a = _widest(corner, start[b], start[b + 1], start[a], start[a + 1], dx, dy)
    if of_b > of_a or start[a + 1] - start[a] == 1:
        first, second = _seen_from(b, edge_b, of_b, a, far_a, dx, dy, pieces)
        return _swapped(first), _swapped(second)
    return _seen_from(a, edge_a, of_a, b, far_b, -dx, -dy, pieces)


# ---- A piece of a grain and a wall shape


@subroutine
def _touch_plane(
    pieces: Pieces, a: int, dx: float, dy: float, nx: float, ny: float
) -> tuple[Point, Point]:
    """The two lowest neighbors of its corners over a half-plane, whose point is −(dx, dy) away."""
    first, last, r, corner = pieces.start[a], pieces.start[a + 1], pieces.rounding[a], pieces.corner
    low = first
    for v in range(first, last):
        if corner[v, X] * nx + corner[v, Y] * ny < corner[low, X] * nx + corner[low, Y] * ny:
            low = v
    before, after = low - 1 if low > first else last - 1, low + 1 if low + 1 < last else first
    of_before = corner[before, X] * nx + corner[before, Y] * ny
    of_after = corner[after, X] * nx + corner[after, Y] * ny
    next_one = before if of_before < of_after else after
    found = _over_plane(corner, low, r, dx, dy, nx, ny)
    if last - first == 1:
        return found, NOWHERE
    return found, _over_plane(corner, next_one, r, dx, dy, nx, ny)


@subroutine
def _over_plane(
    corner: Floats, v: int, r: float, dx: float, dy: float, nx: float, ny: float
) -> Point:
    x, y = corner[v, X] - r * nx, corner[v, Y] - r * ny
    gap = (dx + x) * nx + (dy + y) * ny
    return Point(nx, ny, gap, x, y, dx + x - gap * nx, dy + y - gap * ny, np.int64(v))


@subroutine
def _touch_circle(
    pieces: Pieces, a: int, dx: float, dy: float, radius: float
) -> tuple[Point, Point]:
    """The two corners of a piece nearest to a circle around it; its center is −(dx, dy) away."""
    first, second = NOWHERE, NOWHERE
    r, corner = pieces.rounding[a], pieces.corner
    for v in range(pieces.start[a], pieces.start[a + 1]):
        x, y = dx + corner[v, X], dy + corner[v, Y]
        away = sqrt(x * x + y * y)
        nx, ny = (-x / away, -y / away) if away > 0.0 else (0.0, 1.0)
        point = Point(
            nx, ny, radius - away - r, corner[v, X] - r * nx, corner[v, Y] - r * ny, -radius * nx,
            -radius * ny, np.int64(v),
        )  # fmt: skip
        if point.gap < first.gap:
            first, second = point, first
        elif point.gap < second.gap:
            second = point
    return first, second


@subroutine
def _is_outside(scene: Scene, shape: int, nx: float, ny: float, lean: float) -> bool:
    """Whether something with this normal can lie on a corner of a wall, beside both its sides.

    ``lean`` is a sine by which it may lie outside of their normals.
    """
    world = scene.world
    for side in range(2):
        line = int(world[shape, TAIL_X if side == 0 else TAIL_Y])
        if line < 0:
            continue
        x, y = world[line, TAIL_X] - world[line, X], world[line, TAIL_Y] - world[line, Y]
        # Along the one that ends here it leads on, along the one that begins here back
        leads = (x * nx + y * ny) * (1.0 if side == 0 else -1.0)
        if leads < -lean * sqrt(x * x + y * y):
            return False
    return True


@subroutine
def _touch_corner(
    pieces: Pieces, scene: Scene, a: int, shape: int, dx: float, dy: float, found: Point
) -> Point:
    """The point of a piece at a corner of a wall, which is −(dx, dy) from its center.

    ``found`` is the one without regard to the sides that meet there. Where the corner is in the
    piece, and the way out that is shortest leads along a side, the shortest is that away from one.
    """
    if _is_outside(scene, shape, found.nx, found.ny, LEAN):
        return found
    if found.gap >= 0.0:
        return NOWHERE
    world, corner, best, nx, ny = scene.world, pieces.corner, -inf, 0.0, 1.0
    for side in range(2):
        line = int(world[shape, TAIL_X if side == 0 else TAIL_Y])
        if line < 0:
            continue
        x, y = world[line, TAIL_X] - world[line, X], world[line, TAIL_Y] - world[line, Y]
        length = sqrt(x * x + y * y)
        for sign in (-1.0, 1.0):
            away_x, away_y = -sign * y / length, sign * x / length
            if not _is_outside(scene, shape, away_x, away_y, LEAN):
                continue
            least = inf
            for v in range(pieces.start[a], pieces.start[a + 1]):
                height = away_x * (dx + corner[v, X]) + away_y * (dy + corner[v, Y])
                least = min(least, height)
            if least - pieces.rounding[a] > best:
                best, nx, ny = least - pieces.rounding[a], away_x, away_y
    if best >= 0.0:
        return NOWHERE
    return Point(
        nx, ny, best, best * nx - dx, best * ny - dy, world[shape, X], world[shape, Y],
        found.corner,
    )  # fmt: skip


@subroutine
def touch_wall(pieces: Pieces, scene: Scene, i: int, a: int, shape: int) -> tuple[Point, Point]:
    """Points of a piece of a grain and a wall shape; levers of j lead from its reference point.

    Corners of walls are shapes of their own: lines have no points there.
    """
    kind, wall, world = scene.kind[shape], scene.wall[shape], scene.world
    x, y = scene.position[i, X], scene.position[i, Y]
    at_x, at_y = world[shape, X], world[shape, Y]
    if kind in (_SEGMENT, _SIDE):
        dx = from_first_end(x, at_x, world[shape, TAIL_X], scene.period)
    else:
        dx = nearest_image(x - at_x, scene.period)
    dy = y - at_y
    if kind == _PLANE:
        first, second = _touch_plane(pieces, a, dx, dy, world[shape, TAIL_X], world[shape, TAIL_Y])
    elif kind == _CIRCLE:
        first, second = _touch_circle(pieces, a, dx, dy, world[shape, RADIUS])
    else:
        b = pieces.piece[scene.radius.size + shape]
        first, second = touch(pieces, a, b, dx + at_x, y)
        at_x, at_y = 0.0, 0.0  # its corners are in the world
        if kind in (_SEGMENT, _SIDE):
            first = first if first.corner < pieces.start[b] else NOWHERE
            second = second if second.corner < pieces.start[b] else NOWHERE
        elif kind == _VERTEX:
            first = _touch_corner(pieces, scene, a, shape, dx, dy, first)
    at_x -= scene.wall_position[wall, X]
    at_y -= scene.wall_position[wall, Y]
    return _moved(first, at_x, at_y), _moved(second, at_x, at_y)


@subroutine
def _moved(point: Point, x: float, y: float) -> Point:
    return Point(
        point.nx, point.ny, point.gap, point.i_x, point.i_y, point.j_x + x, point.j_y + y,
        point.corner,
    )  # fmt: skip


@subroutine
def touch_pieces(
    pieces: Pieces, scene: Scene, i: int, a: int, j: int, b: int
) -> tuple[Point, Point]:
    """Points of a piece of a grain with one of another grain, or with a wall shape (any ``b``)."""
    if j >= scene.radius.size:
        return touch_wall(pieces, scene, i, a, j - scene.radius.size)
    dx, dy = shortest(
        scene.position[i, X] - scene.position[j, X], scene.position[i, Y] - scene.position[j, Y],
        scene.period, scene.height, scene.tilt,
    )  # fmt: skip
    return touch(pieces, a, b, dx, dy)


@subroutine
def pieces_met(pieces: Pieces, scene: Scene, j: int) -> tuple[int, int]:
    """First and last pieces b of j for `touch_pieces`: one, whatever it is, of a wall shape."""
    if j >= scene.radius.size:
        return 0, 1
    return pieces.piece[j], pieces.piece[j + 1]


# ---- What passes along an edge

PASSING = 0.1
"""Closing speed over that of the nearest point, up to which a pair moves along an edge."""

BESIDE = 20.0
"""How far from a corner of both pieces a point may be that is passed, over the overlap there: at
corners of more than 3° another edge overlaps by more where it is farther."""

ALIKE = 1e-3
"""Sine of the angle between two normals that are the same axis."""


@subroutine
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
    return _between(
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
def _is_axis(
    point: Point, first: Point, scene: Scene, shape: int, graze: float
) -> bool:  # fmt: skip
    """Whether a pair may pass over the edge of this point, not that of its nearest one."""
    turned_by = abs(point.nx * first.ny - point.ny * first.nx)
    if point.gap < -graze or turned_by < ALIKE:
        return False
    is_vertex = shape >= 0 and scene.kind[shape] == _VERTEX
    return not is_vertex or _is_outside(scene, shape, point.nx, point.ny, PASSING)


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
            point = point if turn == 0 else _swapped(point)
            if not _is_axis(point, first, scene, shape, graze):
                continue
            point = _moved(point, -wall_x, -wall_y)
            speed = approach(point, scene, pieces, velocity, i, j)
            later = point.gap + dt * speed
            if later > widest and (later >= 0.0 or speed >= PASSING * closing):
                found, widest = point, later
    return found


@subroutine
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
    shape, wall_x, wall_y, met = j - scene.radius.size, 0.0, 0.0, b
    if shape >= 0:
        met = pieces.piece[j]
        wall_x = scene.wall_position[scene.wall[shape], X]
        wall_y = scene.wall_position[scene.wall[shape], Y]
    has_corners = shape < 0 or met < pieces.piece[j + 1]  # no plane, no circle around it
    if first.gap == inf or not has_corners:
        return first, second
    r_a, r_b, near = pieces.rounding[a], pieces.rounding[met], BESIDE * graze
    if not _is_beside_corner(
        pieces, a, first.i_x + r_a * first.nx, first.i_y + r_a * first.ny, near
    ) or not _is_beside_corner(
        pieces, met, first.j_x + wall_x - r_b * first.nx, first.j_y + wall_y - r_b * first.ny, near
    ):
        return first, second
    if first.gap + dt * approach(first, scene, pieces, velocity, i, j) >= 0.0:
        return first, second
    found = _past(
        first, scene, pieces, velocity, i, a, j, met, wall_x, wall_y, dt, graze
    )  # fmt: skip
    if found.nx == first.nx and found.ny == first.ny:
        return first, second
    is_line = shape >= 0 and scene.kind[shape] in (_SEGMENT, _SIDE)
    if is_line and found.corner >= pieces.start[met]:
        return NOWHERE, NOWHERE  # its ends are shapes of their own
    return found, NOWHERE


# ---- Pairs


@subroutine
def are_faces(pieces: Pieces, i: int, j: int) -> bool:
    """Whether one of a pair is a grain that is no disc."""
    return pieces.is_face[i] or (j < pieces.is_face.size and pieces.is_face[j])


@subroutine
def circle_gap(scene: Scene, i: int, j: int) -> float:
    """Gap of the circle around a grain and the one around another, or a wall shape with its ends.

    No point of the pair has a smaller gap.
    """
    count = scene.radius.size
    if j < count:
        return pair_geometry(scene, i, j)[0]
    x, y = scene.position[i, X], scene.position[i, Y]
    away = distance_to_shape(x, y, j - count, scene.kind, scene.world, scene.period)[0]
    return float(away - scene.radius[i])


@subroutine
def fastest_points(scene: Scene, pieces: Pieces, velocity: Floats, i: int, j: int) -> float:
    """No points of a grain and of j approach faster [m/s]; ``velocity`` of all bodies."""
    count = scene.radius.size
    turning = velocity[i, SURFACE] / pieces.spin[i]
    vx, vy = velocity[i, X], velocity[i, Y]
    if j < count:
        vx, vy = vx - velocity[j, X], vy - velocity[j, Y]
        theirs = velocity[j, SURFACE] / pieces.spin[j] * scene.radius[j]
        if scene.height > 0.0:  # as the gradient of a cell carries them apart
            dx, dy = shortest(
                scene.position[i, X] - scene.position[j, X],
                scene.position[i, Y] - scene.position[j, Y],
                scene.period, scene.height, scene.tilt,
            )  # fmt: skip
            vx += velocity[count, XX] * dx + velocity[count, XY] * dy
            vy += velocity[count, YY] * dy
        return float(sqrt(vx * vx + vy * vy) + abs(turning) * scene.radius[i] + abs(theirs))
    # As the wall sees it, whose points turn around the center of the grain
    wall = scene.wall[j - count]
    body, x = count + wall, scene.position[i, X] - scene.wall_position[wall, X]
    of_wall = velocity[body, SURFACE]
    vx -= velocity[body, X] - of_wall * (scene.position[i, Y] - scene.wall_position[wall, Y])
    vy -= velocity[body, Y] + of_wall * nearest_image(x, scene.period)
    return float(sqrt(vx * vx + vy * vy) + abs(turning - of_wall) * scene.radius[i])


@subroutine
def points_within(scene: Scene, pieces: Pieces, i: int, j: int, margin: float) -> int:
    """Number of points of a pair with a gap up to ``margin`` [m]."""
    count = 0
    first, last = pieces_met(pieces, scene, j)
    for a in range(pieces.piece[i], pieces.piece[i + 1]):
        for b in range(first, last):
            for point in touch_pieces(pieces, scene, i, a, j, b):
                count += point.gap <= margin
    return count


@subroutine
def room_within(scene: Scene, pieces: Pieces, i: int, j: int, margin: float) -> int:
    """Number of points that the pieces of a pair with a gap up to ``margin`` [m] may come to have.

    How many there are changes as they turn: two of edges, one of what has a single corner.
    """
    room = 0
    first, last = pieces_met(pieces, scene, j)
    for a in range(pieces.piece[i], pieces.piece[i + 1]):
        for b in range(first, last):
            one, two = touch_pieces(pieces, scene, i, a, j, b)
            if min(one.gap, two.gap) <= margin:
                is_corner = pieces.start[a + 1] == pieces.start[a] + 1
                if j < scene.radius.size:
                    is_corner = is_corner or pieces.start[b + 1] == pieces.start[b] + 1
                room += 1 if is_corner else 2
    return room


@subroutine
def nearest_point(scene: Scene, pieces: Pieces, i: int, j: int) -> Point:
    """The point of a pair with the smallest gap, infinite if there is none."""
    nearest = NOWHERE
    first, last = pieces_met(pieces, scene, j)
    for a in range(pieces.piece[i], pieces.piece[i + 1]):
        for b in range(first, last):
            for point in touch_pieces(pieces, scene, i, a, j, b):
                if point.gap < nearest.gap:
                    nearest = point
    return nearest


@subroutine
def are_convex(pieces: Pieces, i: int, j: int) -> bool:
    """Whether a pair is two grains of a piece each."""
    if j >= pieces.is_face.size:
        return False
    of_i, of_j = pieces.piece[i + 1] - pieces.piece[i], pieces.piece[j + 1] - pieces.piece[j]
    return bool(of_i == 1 and of_j == 1)


@subroutine
def gap_along(scene: Scene, pieces: Pieces, i: int, j: int, nx: float, ny: float) -> float:
    """Gap of two grains of a piece each along a normal from j to i [m]; never more than theirs."""
    dx, dy = shortest(
        scene.position[i, X] - scene.position[j, X], scene.position[i, Y] - scene.position[j, Y],
        scene.period, scene.height, scene.tilt,
    )  # fmt: skip
    a, b, corner, lowest, highest = pieces.piece[i], pieces.piece[j], pieces.corner, inf, -inf
    for v in range(pieces.start[a], pieces.start[a + 1]):
        lowest = min(lowest, nx * corner[v, X] + ny * corner[v, Y])
    for v in range(pieces.start[b], pieces.start[b + 1]):
        highest = max(highest, nx * corner[v, X] + ny * corner[v, Y])
    apart = nx * dx + ny * dy + lowest - highest
    return float(apart - (pieces.rounding[a] + pieces.rounding[b]))


@subroutine
def true_gap(scene: Scene, pieces: Pieces | None, i: int, j: int) -> tuple[float, float, float]:
    """As `pair_geometry`, of the nearest point of a pair if one is no disc; none: all are discs."""
    if pieces is None:
        return pair_geometry(scene, i, j)
    if not are_faces(pieces, i, j):
        return pair_geometry(scene, i, j)
    nearest = nearest_point(scene, pieces, i, j)
    return nearest.gap, nearest.nx, nearest.ny
