"""Pieces of grains that are no discs, and of wall shapes, as they lie at one moment.

A piece is what lies within its rounding r of its core: a corner, two, or a convex polygon
(`model/outlines.py`).
"""

from __future__ import annotations

from math import inf, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.arithmetic import cos, sin
from multicor_cli.engine.geometry.scene import Scene
from multicor_cli.engine.jit.compile import kernel, subroutine
from multicor_cli.model.columns import ANGLE, RADIUS, TAIL_X, TAIL_Y, X, Y
from multicor_cli.model.model import Floats, Ints, Model, WallShapes
from multicor_cli.model.outlines import Outlines
from multicor_cli.model.shapes import ShapeKind

NORMAL_X, NORMAL_Y = 2, 3
"""Columns of corners: outward normal of the edge to the next one."""

_DISC, _VERTEX = int(ShapeKind.DISC), int(ShapeKind.VERTEX)
_CORNERS = {
    ShapeKind.PLANE: 0, ShapeKind.CIRCLE: 0, ShapeKind.VERTEX: 1, ShapeKind.DISC: 1,
    ShapeKind.SEGMENT: 2, ShapeKind.SIDE: 2,
}  # fmt: skip


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
        turn: By which angle walls turn at the ends of their lines, as a sine that is positive to
            the left, shape ``(v,)``; 0 for grains, and where nothing follows.
    """

    piece: Ints
    start: Ints
    corner: Floats
    rounding: Floats
    spin: Floats
    is_face: NDArray[np.bool_]
    turn: Floats


def pieces_of(model: Model) -> Pieces | None:
    """Pieces of a model at angle 0, walls anywhere; None if all grains are discs."""
    if model.outlines is None:
        return None
    kind = model.shapes.kind
    wide = np.where(kind == _DISC, model.shapes.geometry[:, RADIUS], 0.0)
    pieces = pieces_with(model.outlines, kind, wide, model.spin_radius)
    _note_turns(model.shapes, model.grain_count, pieces)
    return pieces


def _note_turns(shapes: WallShapes, grains: int, pieces: Pieces) -> None:
    """Enter ``turn``, **modified**, of the lines that meet at corners of walls."""
    x, y, u, v = shapes.geometry.T
    at = shapes.geometry[shapes.kind == _VERTEX, 2:].astype(np.int64)
    before, after = at[(at >= 0).all(axis=1)].T
    dx, dy = u - x, v - y
    length = np.sqrt(dx * dx + dy * dy)
    turn = dx[before] * dy[after] - dy[before] * dx[after]
    first = pieces.start[pieces.piece[grains:-1]]
    pieces.turn[first[before] + 1] = pieces.turn[first[after]] = turn / (
        length[before] * length[after]
    )


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
        np.zeros(len(corner)),
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


@subroutine
def _turn(pieces: Pieces, k: int, angle: float, corner: Floats) -> None:
    """The corners of a grain, turned, into ``corner``, **modified**: perhaps its own."""
    c, s, local = cos(angle), sin(angle), pieces.corner
    for v in range(pieces.start[pieces.piece[k]], pieces.start[pieces.piece[k + 1]]):
        x, y, nx, ny = local[v, X], local[v, Y], local[v, NORMAL_X], local[v, NORMAL_Y]
        corner[v, X], corner[v, Y] = c * x - s * y, s * x + c * y
        corner[v, NORMAL_X], corner[v, NORMAL_Y] = c * nx - s * ny, s * nx + c * ny


@kernel
def turn_grains(pieces: Pieces, position: Floats, corner: Floats) -> None:
    """Turn the corners of grains with them, into ``corner``, **modified**."""
    for k in range(position.shape[0]):
        _turn(pieces, k, position[k, ANGLE], corner)


@subroutine
def turn_by(pieces: Pieces, scene: Scene, k: int, angle: float) -> None:
    """Turn a grain, whose position and corners are **modified**."""
    scene.position[k, ANGLE] += angle
    _turn(pieces, k, angle, pieces.corner)


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


@subroutine
def pieces_met(pieces: Pieces, scene: Scene, j: int) -> tuple[int, int]:
    """First and last pieces b of j for `touch_pieces`: one, whatever it is, of a wall shape."""
    if j >= scene.radius.size:
        return 0, 1
    return pieces.piece[j], pieces.piece[j + 1]


@subroutine
def are_faces(pieces: Pieces, i: int, j: int) -> bool:
    """Whether one of a pair is a grain that is no disc."""
    return pieces.is_face[i] or (j < pieces.is_face.size and pieces.is_face[j])


@subroutine
def are_convex(pieces: Pieces, i: int, j: int) -> bool:
    """Whether a pair is two grains of a piece each."""
    if j >= pieces.is_face.size:
        return False
    of_i, of_j = pieces.piece[i + 1] - pieces.piece[i], pieces.piece[j + 1] - pieces.piece[j]
    return bool(of_i == 1 and of_j == 1)


@subroutine
def farthest(pieces: Pieces, p: int, x: float, y: float) -> int:
    """The corner of a piece that is farthest along (x, y)."""
    corner, far = pieces.corner, pieces.start[p]
    for v in range(pieces.start[p], pieces.start[p + 1]):
        if x * corner[v, X] + y * corner[v, Y] > x * corner[far, X] + y * corner[far, Y]:
            far = v
    return int(far)


@subroutine
def thinnest(pieces: Pieces, k: int) -> float:
    """Width of the thinnest piece of a grain [m]: between the two closest lines around it."""
    width, corner = inf, pieces.corner
    for p in range(pieces.piece[k], pieces.piece[k + 1]):
        first, last = pieces.start[p], pieces.start[p + 1]
        core = inf
        for v in range(first, last):
            nx, ny, deepest = corner[v, NORMAL_X], corner[v, NORMAL_Y], 0.0
            for u in range(first, last):
                dx, dy = corner[v, X] - corner[u, X], corner[v, Y] - corner[u, Y]
                deepest = max(deepest, nx * dx + ny * dy)
            core = min(core, deepest)
        width = min(width, core + 2.0 * pieces.rounding[p])
    return float(width)
