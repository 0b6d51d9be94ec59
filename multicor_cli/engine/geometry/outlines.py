"""Where grains that are no discs touch: points of two pieces, and of pieces with walls.

Two cores that are apart are nearest at two of their corners, or at a corner and an edge; two edges
that are nearly parallel touch at both ends of what they share. So two pieces have up to two points,
and each is at a corner of one of them.

Source: separating axes and clipping, as in E. Catto, *Box2D* (2024); that the edge which separates
two cores most ends in their nearest corner follows from the support functions (derived).
"""

from __future__ import annotations

from math import inf, sqrt
from typing import NamedTuple

import numpy as np

from multicor_cli.engine.geometry.pieces import (
    NORMAL_X,
    NORMAL_Y,
    Pieces,
    are_convex,
    are_faces,
    pieces_met,
)
from multicor_cli.engine.geometry.scene import (
    Scene,
    distance_to_shape,
    from_first_end,
    from_other,
    nearest_image,
    pair_geometry,
)
from multicor_cli.engine.jit.compile import inlined, subroutine
from multicor_cli.model.columns import RADIUS, TAIL_X, TAIL_Y, X, Y
from multicor_cli.model.model import Floats
from multicor_cli.model.shapes import ShapeKind

_PLANE, _CIRCLE, _VERTEX = int(ShapeKind.PLANE), int(ShapeKind.CIRCLE), int(ShapeKind.VERTEX)
_DISC, _SEGMENT, _SIDE = int(ShapeKind.DISC), int(ShapeKind.SEGMENT), int(ShapeKind.SIDE)

_PARALLEL = 1e-9
"""Of an edge: shorter pieces that two edges share are points, and closer corners are one."""

LEAN = 1e-6
"""How far, as a sine, the normal at a corner of a wall may lie outside of those of both sides: the
corner of a flush joint is no obstacle to what slides towards it."""

_FLAT = 0.999
"""Cosine of the angle between a line and an edge from which on the edge lies on it."""


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


class Core(NamedTuple):
    """A piece: its corners are rows ``first`` to ``last`` of `Pieces.corner`, which it exceeds.

    Attributes:
        first: Its first corner.
        last: The one after its last.
        rounding: How far it reaches beyond them [m].
    """

    first: int
    last: int
    rounding: float


@inlined
def core_of(pieces: Pieces, p: int) -> Core:
    """The core of a piece."""
    return Core(int(pieces.start[p]), int(pieces.start[p + 1]), pieces.rounding[p])


@inlined
def _widest(corner: Floats, one: Core, other: Core, ox: float, oy: float) -> tuple[float, int, int]:
    """The edge of a core that is farthest from another core, whose center lies (ox, oy) away.

    Returns how far [m], below 0 if none separates them; the edge, and the nearest corner.
    """
    widest, edge, nearest = -inf, one.first, other.first
    if one.last - one.first == 1:  # no edge
        return widest, edge, nearest
    for e in range(one.first, one.last):
        nx, ny = corner[e, NORMAL_X], corner[e, NORMAL_Y]
        least, at = inf, other.first
        for v in range(other.first, other.last):
            height = nx * (ox + corner[v, X] - corner[e, X]) + ny * (
                oy + corner[v, Y] - corner[e, Y]
            )
            if height < least:
                least, at = height, v
        if least > widest:
            widest, edge, nearest = least, e, at
    return widest, edge, nearest


@inlined
def _facing(corner: Floats, one: Core, other: Core, ox: float, oy: float) -> float:
    """As the first of `_widest`, of the edge that faces the other core: no more than that [m]."""
    most, edge, height = -inf, one.first, inf
    for e in range(one.first, one.last):
        ahead = corner[e, NORMAL_X] * ox + corner[e, NORMAL_Y] * oy
        if ahead > most:
            most, edge = ahead, e
    px, py = corner[edge, X], corner[edge, Y]
    nx, ny = corner[edge, NORMAL_X], corner[edge, NORMAL_Y]
    for v in range(other.first, other.last):
        height = min(height, nx * (ox + corner[v, X] - px) + ny * (oy + corner[v, Y] - py))
    return height


@subroutine
def between(
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
    corner: Floats, one: Core, edge: int, separation: float, other: Core, v: int, ox: float,
    oy: float,
) -> tuple[Point, Point]:  # fmt: skip
    """Points of a core p, whose ``edge`` is nearest to the corner v of another, q; i is p here.

    (ox, oy) leads from the center of p to that of q, ``separation`` is the distance of v from the
    line of the edge [m].
    """
    last, r_p, r_q = one.last, one.rounding, other.rounding
    px, py = corner[edge, X], corner[edge, Y]
    vx, vy = ox + corner[v, X], oy + corner[v, Y]
    nx, ny = corner[edge, NORMAL_X], corner[edge, NORMAL_Y]
    ax, ay, bx, by, gap, key = px, py, vx, vy, separation, np.int64(v)
    second = NOWHERE
    if last - one.first == 1:  # two corners alone
        nx, ny = vx - px, vy - py
        gap = sqrt(nx * nx + ny * ny)
        nx, ny = (nx / gap, ny / gap) if gap > 0.0 else (0.0, -1.0)
    else:
        after = edge + 1 if edge + 1 < last else one.first
        length = (corner[after, Y] - py) * nx - (corner[after, X] - px) * ny
        # Of the two edges at v the one that faces p more, to its other corner w
        w = v + 1 if v + 1 < other.last else other.first
        before = v - 1 if v > other.first else other.last - 1
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
            second = between(
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
def swapped(point: Point) -> Point:
    """The point with i for j."""
    return Point(
        -point.nx, -point.ny, point.gap, point.j_x, point.j_y, point.i_x, point.i_y, point.corner
    )


@subroutine
def _touch(corner: Floats, one: Core, other: Core, dx: float, dy: float) -> tuple[Point, Point]:
    """As `touch`, of the cores of the two."""
    of_a, edge_a, far_b = _widest(corner, one, other, -dx, -dy)
    of_b, edge_b, far_a = _widest(corner, other, one, dx, dy)
    if of_b > of_a or one.last - one.first == 1:
        first, second = _seen_from(corner, other, edge_b, of_b, one, far_a, dx, dy)
        return swapped(first), swapped(second)
    return _seen_from(corner, one, edge_a, of_a, other, far_b, -dx, -dy)


@inlined
def touch(pieces: Pieces, a: int, b: int, dx: float, dy: float) -> tuple[Point, Point]:
    """Points of two pieces, the nearer first; (dx, dy) leads from the center of b's to a's."""
    return _touch(pieces.corner, core_of(pieces, a), core_of(pieces, b), dx, dy)


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
def is_outside(scene: Scene, shape: int, nx: float, ny: float, lean: float) -> bool:
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
    piece, and the way out that is shortest leads along a side, the shortest is that away from one,
    to where the piece is: in a concave corner both sides hold it, and the corner has no point.
    """
    if is_outside(scene, shape, found.nx, found.ny, LEAN):
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
        away_x, away_y, lowest, highest = -y / length, x / length, inf, -inf
        for v in range(pieces.start[a], pieces.start[a + 1]):
            height = away_x * (dx + corner[v, X]) + away_y * (dy + corner[v, Y])
            lowest, highest = min(lowest, height), max(highest, height)
        if lowest < -highest:  # the piece is on the other side of the line
            away_x, away_y, lowest = -away_x, -away_y, -highest
        if lowest - pieces.rounding[a] > best and is_outside(scene, shape, away_x, away_y, LEAN):
            best, nx, ny = lowest - pieces.rounding[a], away_x, away_y
    if best >= 0.0 or best == -inf:
        return NOWHERE
    return Point(
        nx, ny, best, best * nx - dx, best * ny - dy, world[shape, X], world[shape, Y],
        found.corner,
    )  # fmt: skip


@subroutine
def is_of_corner(pieces: Pieces, b: int, point: Point) -> bool:
    """Whether a point of the line b is that of the corner at its end.

    In a concave corner nothing touches that: what lies there does so on the ends of both lines.
    """
    start, corner = pieces.start[b], pieces.corner
    if point.corner < start:
        return False
    x, y = corner[start + 1, X] - corner[start, X], corner[start + 1, Y] - corner[start, Y]
    side, length = x * point.ny - y * point.nx, sqrt(x * x + y * y)  # the left one is positive
    is_flat = abs(side) > _FLAT * length
    return not (is_flat and pieces.turn[point.corner] * side > LEAN * length)


@subroutine
def touch_wall(pieces: Pieces, scene: Scene, i: int, a: int, shape: int) -> tuple[Point, Point]:
    """Points of a piece of a grain and a wall shape; levers of j lead from its reference point.

    Corners of walls are shapes of their own: lines have no points there, but in concave ones.
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
            first = NOWHERE if is_of_corner(pieces, b, first) else first
            second = NOWHERE if is_of_corner(pieces, b, second) else second
        elif kind == _VERTEX:
            first = _touch_corner(pieces, scene, a, shape, dx, dy, first)
    at_x -= scene.wall_position[wall, X]
    at_y -= scene.wall_position[wall, Y]
    return moved(first, at_x, at_y), moved(second, at_x, at_y)


@subroutine
def moved(point: Point, x: float, y: float) -> Point:
    """The point with levers of j from a place (x, y) before its own [m]."""
    return Point(
        point.nx, point.ny, point.gap, point.i_x, point.i_y, point.j_x + x, point.j_y + y,
        point.corner,
    )  # fmt: skip


@inlined
def touch_pieces(
    pieces: Pieces, scene: Scene, i: int, a: int, j: int, b: int
) -> tuple[Point, Point]:
    """Points of a piece of a grain with one of another grain, or with a wall shape (any ``b``)."""
    if j >= scene.radius.size:
        return touch_wall(pieces, scene, i, a, j - scene.radius.size)
    dx, dy = from_other(scene, i, j)
    return touch(pieces, a, b, dx, dy)


# ---- Pairs


@inlined
def circle_gap(scene: Scene, i: int, j: int) -> float:
    """Gap of the circle around a grain and the one around another, or a wall shape with its ends.

    No point of the pair has a smaller gap.
    """
    count = scene.radius.size
    if j >= count:
        return _circle_over(scene, i, j - count)
    dx, dy = from_other(scene, i, j)
    return float(sqrt(dx * dx + dy * dy) - (scene.radius[i] + scene.radius[j]))


@subroutine
def _circle_over(scene: Scene, i: int, shape: int) -> float:
    """As `circle_gap`, over a wall shape."""
    x, y = scene.position[i, X], scene.position[i, Y]
    away = distance_to_shape(x, y, shape, scene.kind, scene.world, scene.period)[0]
    return float(away - scene.radius[i])


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


@inlined
def nearest_point(scene: Scene, pieces: Pieces, i: int, j: int) -> Point:
    """The point of a pair with the smallest gap, infinite if there is none."""
    if are_convex(pieces, i, j):
        return touch_pieces(pieces, scene, i, pieces.piece[i], j, pieces.piece[j])[0]
    return _nearest_of(scene, pieces, i, j)


@subroutine
def _nearest_of(scene: Scene, pieces: Pieces, i: int, j: int) -> Point:
    """As `nearest_point`, of any pair."""
    nearest = NOWHERE
    first, last = pieces_met(pieces, scene, j)
    for a in range(pieces.piece[i], pieces.piece[i + 1]):
        for b in range(first, last):
            for point in touch_pieces(pieces, scene, i, a, j, b):
                if point.gap < nearest.gap:
                    nearest = point
    return nearest


@inlined
def gap_at_least(scene: Scene, pieces: Pieces, i: int, j: int) -> float:
    """A bound on the gap of two grains of a piece each [m], for less than a look at all edges."""
    a, b = core_of(pieces, pieces.piece[i]), core_of(pieces, pieces.piece[j])
    dx, dy = from_other(scene, i, j)
    of_i, of_j = -inf, -inf
    if a.last - a.first > 1:
        of_i = _facing(pieces.corner, a, b, -dx, -dy)
    if b.last - b.first > 1:
        of_j = _facing(pieces.corner, b, a, dx, dy)
    return max(of_i, of_j) - (a.rounding + b.rounding)


@inlined
def true_gap(scene: Scene, pieces: Pieces | None, i: int, j: int) -> tuple[float, float, float]:
    """As `pair_geometry`, of the nearest point of a pair if one is no disc; none: all are discs."""
    if pieces is not None and are_faces(pieces, i, j):
        nearest = nearest_point(scene, pieces, i, j)
        return nearest.gap, nearest.nx, nearest.ny
    return pair_geometry(scene, i, j)
