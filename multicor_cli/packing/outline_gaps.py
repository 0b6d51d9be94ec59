"""Gaps of outlines at the start: of grains that are no discs, and between these and walls.

Distances of convex cores: where they overlap, the least way that parts them (separating axes),
else that between the nearest points of their edges.
"""

from __future__ import annotations

from math import floor, inf, sqrt
from typing import NamedTuple

import numpy as np

from multicor_cli.arithmetic import cos, sin
from multicor_cli.engine.geometry.scene import shortest
from multicor_cli.engine.jit.compile import kernel
from multicor_cli.model.columns import ANGLE, RADIUS, TAIL_X, TAIL_Y, X, Y
from multicor_cli.model.model import Floats, Ints
from multicor_cli.model.outlines import Outlines
from multicor_cli.model.shapes import TAIL, ShapeKind, Tail

# ---- Gaps of outlines


class Placed(NamedTuple):
    """Outlines of grains in the world, as `Outlines`, for kernels.

    Attributes:
        piece: First piece of each grain.
        start: First corner of each piece.
        corner: Corners in the world [m].
        rounding: Radius of the corners of each piece [m].
    """

    piece: Ints
    start: Ints
    corner: Floats
    rounding: Floats


def place_outlines(outlines: Outlines, position: Floats) -> Placed:
    """Outlines of grains at x, y [m] and angles [rad], shape ``(n, 3)``."""
    corner = np.empty(outlines.corner.shape)
    turn_corners(outlines.piece, outlines.start, outlines.corner, position, corner)
    return Placed(outlines.piece, outlines.start, corner, outlines.rounding)


@kernel
def turn_corners(piece: Ints, start: Ints, local: Floats, position: Floats, corner: Floats) -> None:
    """Bring corners from the frames of their grains, ``local``, to the world (**modified**)."""
    for i in range(position.shape[0]):
        c, s = cos(position[i, ANGLE]), sin(position[i, ANGLE])
        for v in range(start[piece[i]], start[piece[i + 1]]):
            x, y = local[v, X], local[v, Y]
            corner[v, X] = position[i, X] + c * x - s * y
            corner[v, Y] = position[i, Y] + s * x + c * y


@kernel
def _beside_edges(
    corner: Floats, a: int, a_end: int, b: int, b_end: int, dx: float, dy: float
) -> tuple[float, float, float, int]:
    """Largest separation of core b, moved by (dx, dy), beyond an edge of core a; −inf without.

    Returns it [m], the normal of the edge and the corner of b that is nearest to it.
    """
    best, nx, ny, nearest = -inf, 0.0, 1.0, b
    for k in range(a, a_end if a_end > a + 1 else a):
        m = k + 1 if k + 1 < a_end else a
        ex, ey = corner[m, X] - corner[k, X], corner[m, Y] - corner[k, Y]
        length = sqrt(ex * ex + ey * ey)
        ux, uy = ey / length, -ex / length
        least, which = inf, b
        for v in range(b, b_end):
            away = ux * (corner[v, X] + dx - corner[k, X]) + uy * (corner[v, Y] + dy - corner[k, Y])
            if away < least:
                least, which = away, v
        if least > best:
            best, nx, ny, nearest = least, ux, uy, which
    return best, nx, ny, nearest


@kernel
def _to_edges(
    corner: Floats, a: int, a_end: int, b: int, b_end: int, dx: float, dy: float
) -> tuple[float, float, float, float, float]:
    """Least square of the distance of a corner of b, moved by (dx, dy), to core a.

    Returns it [m²], the way from a to b [m] and the point on a [m].
    """
    best, wx, wy, px, py = inf, 0.0, 0.0, 0.0, 0.0
    for k in range(a, a_end):
        m = k + 1 if k + 1 < a_end else a
        x, y = corner[k, X], corner[k, Y]
        ex, ey = corner[m, X] - x, corner[m, Y] - y
        square = ex * ex + ey * ey
        for v in range(b, b_end):
            ox, oy = corner[v, X] + dx - x, corner[v, Y] + dy - y
            share = 0.0
            if square > 0.0:
                share = min(max((ox * ex + oy * ey) / square, 0.0), 1.0)
            ux, uy = ox - share * ex, oy - share * ey
            if ux * ux + uy * uy < best:
                best, wx, wy, px, py = ux * ux + uy * uy, ux, uy, x + share * ex, y + share * ey
    return best, wx, wy, px, py


_CROSSED = 1e-9
"""Cores overlap from here on, over the distance at which pieces touch: else rounding decides."""


@kernel
def gap_of_pieces(
    placed: Placed, a: int, b: int, dx: float, dy: float, size: float
) -> tuple[float, float, float, float, float]:
    """Gap of two pieces, the second moved by (dx, dy) [m]; a lower bound of it if it is positive.

    ``size`` is a length of the grains [m]. Returns the gap [m], the unit normal from the first to
    the second piece, and a point between them [m]. Where cores overlap, it is the least way that
    parts them.
    """
    corner = placed.corner
    a0, a1, b0, b1 = placed.start[a], placed.start[a + 1], placed.start[b], placed.start[b + 1]
    reach = placed.rounding[a] + placed.rounding[b]
    best, nx, ny, v = _beside_edges(corner, a0, a1, b0, b1, dx, dy)
    px, py = corner[v, X] + dx, corner[v, Y] + dy
    if best > reach:
        return best - reach, nx, ny, px, py
    other, mx, my, w = _beside_edges(corner, b0, b1, a0, a1, -dx, -dy)
    if other > best:
        best, nx, ny, px, py = other, -mx, -my, corner[w, X], corner[w, Y]
    if -inf < best < -_CROSSED * size or best > reach:
        return best - reach, nx, ny, px, py
    square, wx, wy, qx, qy = _to_edges(corner, a0, a1, b0, b1, dx, dy)
    second, ux, uy, sx, sy = _to_edges(corner, b0, b1, a0, a1, -dx, -dy)
    if second < square:
        square, wx, wy, qx, qy = second, -ux, -uy, sx + dx + ux, sy + dy + uy
    if square == 0.0:
        return -reach, nx, ny, px, py
    distance = sqrt(square)
    return distance - reach, wx / distance, wy / distance, qx, qy


@kernel
def gap_of_grains(placed: Placed, i: int, j: int, dx: float, dy: float, size: float) -> float:
    """Least gap of two grains, the second moved by (dx, dy); arguments as `gap_of_pieces`."""
    gap = inf
    for a in range(placed.piece[i], placed.piece[i + 1]):
        for b in range(placed.piece[j], placed.piece[j + 1]):
            gap = min(gap, gap_of_pieces(placed, a, b, dx, dy, size)[0])
    return gap


@kernel
def gap_to_plane(placed: Placed, i: int, plane: Floats) -> tuple[float, int]:
    """Gap of a grain to a plane (a point of it, its normal) [m], and the corner next to it."""
    best, nearest = inf, 0
    for a in range(placed.piece[i], placed.piece[i + 1]):
        for v in range(placed.start[a], placed.start[a + 1]):
            ox, oy = placed.corner[v, X] - plane[X], placed.corner[v, Y] - plane[Y]
            gap = ox * plane[TAIL_X] + oy * plane[TAIL_Y] - placed.rounding[a]
            if gap < best:
                best, nearest = gap, v
    return best, nearest


@kernel
def _gap_in_circle(placed: Placed, i: int, circle: Floats, dx: float) -> float:
    """Gap of a grain within a circle that is moved by dx [m]."""
    farthest = 0.0
    for a in range(placed.piece[i], placed.piece[i + 1]):
        for v in range(placed.start[a], placed.start[a + 1]):
            ox, oy = placed.corner[v, X] - circle[X] - dx, placed.corner[v, Y] - circle[Y]
            farthest = max(farthest, sqrt(ox * ox + oy * oy) + placed.rounding[a])
    return float(circle[RADIUS] - farthest)


# ---- Gaps of pairs of grains, and of grains and wall shapes


_DISC, _PLANE, _CIRCLE = int(ShapeKind.DISC), int(ShapeKind.PLANE), int(ShapeKind.CIRCLE)
_LINE = int(Tail.POINT)


def _of_walls(kind: Ints, world: Floats) -> Outlines:
    """Wall shapes as grains that do not move: a line is a core of two corners, the rest of one."""
    is_line = TAIL[kind] == Tail.POINT
    start = np.concatenate([[0], np.cumsum(np.where(is_line, 2, 1))]).astype(np.int32)
    corner = np.empty((int(start[-1]), 2))
    corner[start[:-1]] = world[:, :2]
    corner[start[1:][is_line] - 1] = world[is_line, TAIL_X:]
    rounding = np.where(kind == _DISC, world[:, RADIUS], 0.0)
    none, each = np.zeros(kind.size), np.arange(kind.size + 1, dtype=np.int32)
    return Outlines(each, start, corner, rounding, none, none)


def relative_gaps(
    outlines: Outlines, position: Floats, radius: Floats, i: Ints, j: Ints, kind: Ints,
    world: Floats, periods: tuple[float, float, float],
) -> Floats:  # fmt: skip
    """Gaps of pairs over the smaller reach ``radius`` [m]; from n on ``j`` is a wall shape.

    Positions [m, rad] have shape ``(n, 3)``; ``periods`` are the period in x, and height and tilt
    of a cell [m], 0 without. A gap that is positive may be larger than said.
    """
    both = Outlines.joined([outlines, _of_walls(kind, world)])
    placed = place_outlines(both, np.concatenate([position, np.zeros((kind.size, 3))]))
    out = np.empty(i.size)
    _relative_gaps(placed, position, radius, i, j, kind, world, *periods, out)
    return out


@kernel
def _relative_gaps(
    placed: Placed, position: Floats, radius: Floats, i: Ints, j: Ints, kind: Ints, world: Floats,
    period: float, height: float, tilt: float, out: Floats,
) -> None:  # fmt: skip
    count = radius.size
    for p in range(i.size):
        a, b = i[p], j[p]
        x, y = position[a, X], position[a, Y]
        if b < count:
            dx, dy = position[b, X] - x, position[b, Y] - y
            ux, uy = shortest(dx, dy, period, height, tilt)
            small = min(radius[a], radius[b])
            out[p] = gap_of_grains(placed, a, b, ux - dx, uy - dy, small) / small
            continue
        shape = b - count
        what, small = kind[shape], radius[a]
        if what == _PLANE:
            out[p] = gap_to_plane(placed, a, world[shape])[0] / small
            continue
        middle = world[shape, X]
        if TAIL[what] == _LINE:
            middle = 0.5 * (middle + world[shape, TAIL_X])
        dx = period * floor((x - middle) / period + 0.5) if period > 0.0 else 0.0
        if what == _CIRCLE:
            out[p] = _gap_in_circle(placed, a, world[shape], dx) / small
            continue
        if what == _DISC:
            small = min(small, world[shape, RADIUS])
        out[p] = gap_of_grains(placed, a, b, dx, 0.0, small) / small
