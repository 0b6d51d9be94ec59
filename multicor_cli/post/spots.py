"""Where grains touch and press on each other: edges and corners, radii of curvature, sides."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model import ShapeKind
from multicor_cli.model.columns import RADIUS
from multicor_cli.model.model import Floats, Model
from multicor_cli.model.outlines import Outlines
from multicor_cli.post.contacts import LoadedContacts
from multicor_cli.post.rings import around, counted
from multicor_cli.post.source import Frame, rotated

_AT_CORNER = 5e-3  # of the grain: what is nearer to a corner touches there
_PARALLEL = 1e-6  # how far cosines of normals along each other are from 1, at most

KINDS = ("edge_edge", "edge_corner", "corner_corner")
"""How grains touch; see `kinds_of`."""


def kinds_of(contacts: LoadedContacts, model: Model, frame: Frame) -> NDArray[np.int64]:
    """Which of `KINDS` contacts between grains of any shape are, shape ``(c,)``; −1 with walls.

    Edges meet where two points of the same pieces carry forces along the same normal. What touches
    at one point does so with a corner, or at its rounding, of one or of both grains; of a contact
    at several points of different pieces the one with the largest force counts. Discs and the ends
    of rods are corners.
    """
    outlines = model.outlines
    assert outlines is not None
    points, of = contacts.points
    count = contacts.i.size
    force = np.abs(points.force[:, 0])
    order = np.lexsort((force, of))
    strongest = np.zeros(count, np.int64)
    strongest[of[order]] = order
    near_corner, piece = map(
        np.array, zip(*((e.is_corner, e.piece) for e in ends_of(points, model, frame)), strict=True)
    )
    alike = (points.normal * points.normal[strongest[of]]).sum(axis=1) > 1.0 - _PARALLEL
    alike &= (piece == piece[:, strongest[of]]).all(axis=0) & (force > 0.0)
    is_side = np.bincount(of, alike, count) > 1.0
    kind = np.where(is_side, 0, np.where(near_corner[:, strongest].all(axis=0), 2, 1))
    return np.where(contacts.is_wall, -1, kind)


class End(NamedTuple):
    """Where points of contacts lie on the outlines of one of their two bodies, ``p`` of them.

    Attributes:
        grain: The grain; of walls any, shape ``(p,)``.
        piece: The piece, −1 of walls, shape ``(p,)``.
        corner: The nearest corner of this piece, shape ``(p,)``.
        is_corner: Whether they are at it, or at its rounding, shape ``(p,)``.
    """

    grain: NDArray[np.int64]
    piece: NDArray[np.int64]
    corner: NDArray[np.int64]
    is_corner: NDArray[np.bool_]


def ends_of(points: LoadedContacts, model: Model, frame: Frame) -> tuple[End, End]:
    """Where points of grains of any shape lie on their first and second bodies."""
    outlines = model.outlines
    assert outlines is not None
    found = []
    for end, arm, is_wall in (
        (points.i, points.arm, np.zeros(points.i.size, np.bool_)),
        (points.j, points.branch + points.arm, points.is_wall),
    ):
        grain, has = np.where(is_wall, 0, end).astype(np.int64), ~is_wall
        turned = rotated(arm[has], -np.asarray(frame.angle)[grain[has]])
        rows = np.full((2, grain.size), -1, np.int64)
        at_corner = np.zeros(grain.size, np.bool_)
        rows[0, has], rows[1, has], at_corner[has] = _nearest_corners(outlines, grain[has], turned)
        found.append(End(grain, rows[0], rows[1], at_corner))
    return found[0], found[1]


def _nearest_corners(
    outlines: Outlines, grain: NDArray[np.int64], at: Floats
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
    """Pieces and nearest corners of points on outlines of grains, and whether they are at these.

    Points lead from their centers at angle 0 [m], shape ``(p, 2)``.
    """
    first = outlines.start[outlines.piece].astype(np.int64)
    number = np.diff(first)[grain]
    before, after = np.cumsum(number) - number, around(outlines.start)[0]
    corner = first[grain].repeat(number) + counted(number)
    point = np.repeat(np.arange(grain.size), number)
    piece = np.repeat(np.arange(outlines.rounding.size), np.diff(outlines.start))[corner]
    edge = (outlines.corner[after] - outlines.corner)[corner]
    way, square = at[point] - outlines.corner[corner], (edge * edge).sum(axis=1)
    part = (way * edge).sum(axis=1) / np.where(square > 0.0, square, 1.0)
    part = np.clip(part, 0.0, 1.0)
    off = np.hypot(*(way - part[:, np.newaxis] * edge).T) - outlines.rounding[piece]
    nearest = np.lexsort((np.abs(off), point))[before]
    away = (np.minimum(part, 1.0 - part) * np.sqrt(square))[nearest]
    size = np.sqrt(outlines.area / np.pi)[grain]
    corner = np.where(part < 0.5, corner, after[corner])[nearest]
    return piece[nearest], corner, away <= _AT_CORNER * size


# ---- Radii of curvature, and areas of sides
#
# Definitions are those of heat in the engine (theory §11.1), but that sharp corners have no radius
# here, and that points of a curve are one place only if their normals are.

_LARGEST_CUP = 100.0  # radius of contact in a circle over the grain's, at most; as in the engine
_BENDS = 0.3  # 2 sin ½δ of corners: those that turn by less than 17.3° are of curves
_ALIKE = 1.0 - 1e-6  # cosine from which on two normals are one


class Spots(NamedTuple):
    """Places that bear, ``s`` of them, of ``c`` points of contacts.

    Attributes:
        place: The place of each point, shape ``(c,)``.
        first: The first point of each place, shape ``(s,)``.
        radius: a* [m], mean by force; nan where a sharp corner bears, shape ``(s,)``.
        area: On which sides are pressed [m²], 0 where none is, shape ``(s,)``.
    """

    place: NDArray[np.int64]
    first: NDArray[np.int64]
    radius: Floats
    area: Floats

    def total(self, values: Floats) -> Floats:
        """Sums over the points of places, shape ``(s,)``."""
        return np.asarray(np.bincount(self.place, values, self.first.size), np.float64)


def spots_of(points: LoadedContacts, model: Model, frame: Frame, pair: NDArray[np.int64]) -> Spots:
    """Places of points that press, each of a ``pair``, shape ``(c,)``; discs have one each.

    Points of the same two pieces, or of a piece and a wall, whose normals are one are one place.
    """
    if model.outlines is None:
        each = np.arange(points.i.size)
        return Spots(each, each, hertz_radius(model, points.i, points.j), np.zeros(each.size))
    ends, bent = ends_of(points, model, frame), _Bent.of(model.outlines)
    other = pair.astype(np.int64)
    other[points.is_wall] = -1 - model.shapes.wall[points.j[points.is_wall] - model.grain_count]
    keys = np.column_stack([points.i, ends[0].piece, other, ends[1].piece])
    force = np.maximum(points.force[:, 0], 0.0)
    place, first = _places(keys, points.normal, force)
    is_joined = np.bincount(place)[place] > 1
    single, joined = np.zeros((2, 2, place.size))  # curvatures of both ends
    for own, end in enumerate(ends):
        has = np.flatnonzero(end.piece >= 0)
        outward = points.normal[has] * (2.0 * own - 1.0)
        edge = bent.facing(end.piece[has], outward, np.asarray(frame.angle)[end.grain[has]])
        joined[own, has] = bent.edge[edge]
        at_corner = end.is_corner[has]
        single[own, has] = np.where(at_corner, bent.corner[end.corner[has]], bent.edge[edge])
    of_walls = _wall_curvatures(model, points)
    single[1] += of_walls
    joined[1] += of_walls
    is_side = is_joined & ~joined.any(axis=0)
    mine, theirs = np.where(is_joined & ~is_side, joined, single)
    curvature = np.maximum(mine + theirs, np.where(theirs < 0.0, mine / _LARGEST_CUP, -np.inf))
    radius = 1.0 / np.where(curvature > 0.0, curvature, np.nan)
    spots = Spots(place, first, np.zeros(first.size), np.zeros(first.size))
    weighted = spots.total(np.where(force > 0.0, force * radius, 0.0))
    total = spots.total(force)
    return spots._replace(
        radius=weighted / np.where(total > 0.0, total, np.nan),
        area=_areas(points, spots, force, is_side, model),
    )


def hertz_radius(model: Model, i: Floats, j: Floats) -> Floats:
    """a* of contacts of discs, 1/a* = 1/a_i + 1/a_j [m], shape ``(c,)``.

    A smooth line has no curvature; a circle around the grain has −1/R, up to a* = 100 a_i.
    """
    curvature = np.concatenate([1.0 / model.grains.radius, _of_shapes(model)])
    mine = curvature[i]
    return np.asarray(1.0 / np.maximum(mine + curvature[j], mine / _LARGEST_CUP))


def _of_shapes(model: Model) -> Floats:
    """Curvature of wall shapes [1/m], shape ``(m,)``."""
    shapes = model.shapes
    size = np.where(shapes.geometry[:, RADIUS] > 0.0, shapes.geometry[:, RADIUS], 1.0)
    sign = np.select([shapes.kind == ShapeKind.DISC, shapes.kind == ShapeKind.CIRCLE], [1.0, -1.0])
    return np.asarray(sign / size)


def _wall_curvatures(model: Model, points: LoadedContacts) -> Floats:
    """Of the walls that points touch, 0 of grains, nan of a corner that a grain with sides does."""
    assert model.outlines is not None
    is_corner, is_disc = model.shapes.kind == ShapeKind.VERTEX, model.outlines.is_disc
    found, rows = np.zeros(points.i.size), np.flatnonzero(points.is_wall)
    shape = points.j[rows] - model.grain_count
    found[rows] = np.where(
        is_corner[shape] & ~is_disc[points.i[rows]], np.nan, _of_shapes(model)[shape]
    )
    return found


def _places(
    keys: NDArray[np.int64], normal: Floats, force: Floats
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Places of points, and the first point of each.

    Points with equal keys that share the normal of the one with the largest force are one place,
    all others are alone.
    """
    group = np.unique(keys, axis=0, return_inverse=True)[1].reshape(-1)
    order, count = np.lexsort((force, group)), group.max(initial=-1) + 1
    strongest = np.zeros(count, np.int64)
    strongest[group[order]] = order
    is_one = (normal * normal[strongest[group]]).sum(axis=1) > _ALIKE
    label = np.where(is_one, group, count + np.arange(group.size))
    _, first, place = np.unique(label, return_index=True, return_inverse=True)
    return place, first


def _areas(
    points: LoadedContacts, spots: Spots, force: Floats, is_side: NDArray[np.bool_], model: Model
) -> Floats:
    """On which sides are pressed: l' = min(l, 3e) of theory §11.1, as thick as the thinner grain.

    l is the length between the outermost points that bear, e how far the center of the forces is
    from the nearer one.
    """
    thermal, place = model.thermal, spots.place
    assert thermal is not None
    normal = points.normal[spots.first][place]
    along = points.arm[:, 1] * normal[:, 0] - points.arm[:, 0] * normal[:, 1]
    rows = np.flatnonzero(is_side & (force > 0.0))
    low, high = np.full((2, spots.first.size), np.nan)
    np.fmin.at(low, place[rows], along[rows])
    np.fmax.at(high, place[rows], along[rows])
    total = spots.total(np.where(is_side, force, 0.0))
    center = spots.total(np.where(is_side, force * along, 0.0)) / np.where(total > 0.0, total, 1.0)
    length = np.clip(3.0 * np.minimum(center - low, high - center), 0.0, high - low)
    thickness = thermal.surface / model.perimeter
    i, j = points.i[spots.first], points.j[spots.first]
    other = np.where(
        j < model.grain_count, thickness[np.where(j < model.grain_count, j, i)], np.inf
    )
    return np.asarray(np.nan_to_num(length) * np.minimum(thickness[i], other))


class _Bent(NamedTuple):
    """How outlines bend; ``p`` pieces of ``v`` corners in all.

    Attributes:
        start: First corner of each piece, shape ``(p + 1,)``.
        normal: Outward, of the edge that begins at each corner, shape ``(v, 2)``.
        corner: Curvature of corners [1/m], nan of sharp ones, shape ``(v,)``.
        edge: Curvature of edges [1/m], 0 of flat ones, shape ``(v,)``.
    """

    start: NDArray[np.int64]
    normal: Floats
    corner: Floats
    edge: Floats

    @classmethod
    def of(cls, outlines: Outlines) -> _Bent:
        start, count = outlines.start.astype(np.int64), np.diff(outlines.start)
        piece, (after, before) = np.repeat(np.arange(count.size), count), around(start)
        x, y = (outlines.corner[after] - outlines.corner).T
        length = np.hypot(x, y)
        normal = np.column_stack([y, -x]) / np.where(length > 0.0, length, 1.0)[:, np.newaxis]
        turn = np.hypot(*(normal - normal[before]).T)  # 2 sin ½δ
        bends = (count[piece] > 2) & (turn > 0.0) & (turn < _BENDS)
        mean = 0.5 * (length + length[before])
        radius = outlines.rounding[piece] + np.where(bends, mean / np.where(bends, turn, 1.0), 0.0)
        corner = 1.0 / np.where(radius > 0.0, radius, np.nan)
        is_curve = (bends & bends[after]) | (count[piece] == 1)
        with_next = 0.5 * (radius + radius[after])
        return cls(
            start, normal, corner, np.where(is_curve, 1.0 / np.where(is_curve, with_next, 1.0), 0.0)
        )

    def facing(self, piece: NDArray[np.int64], outward: Floats, angle: Floats) -> NDArray[np.int64]:
        """The edge of each piece, turned by an angle [rad], whose normal is nearest to a vector."""
        c, s, (x, y) = np.cos(angle), np.sin(angle), outward.T
        local = np.column_stack([c * x + s * y, c * y - s * x])
        number = np.diff(self.start)[piece]
        before = np.cumsum(number) - number
        edge = self.start[piece].repeat(number) + counted(number)
        point = np.repeat(np.arange(piece.size), number)
        along = (self.normal[edge] * local[point]).sum(axis=1)
        return np.asarray(edge[np.lexsort((-along, point))[before]])
