"""How grains lie that are no discs: their long axes, the order of these, where grains touch."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats, Model
from multicor_cli.model.outlines import Outlines
from multicor_cli.post.contacts import LoadedContacts
from multicor_cli.post.cuts import sides_of
from multicor_cli.post.lattice import Complexes
from multicor_cli.post.rings import rings_of
from multicor_cli.post.source import Frame, PostError, rotated

_ROUND = 1e-6  # relative difference of the principal second moments from which on an axis is long
_AT_CORNER = 5e-3  # of the grain: what is nearer to a corner touches there

KINDS = ("edge_edge", "edge_corner", "corner_corner")
"""How grains touch; see `kinds_of`."""


def axes_of(model: Model, frame: Frame) -> Complexes:
    """e^{2iθ} of the directions θ of the long axes of the grains, shape ``(n,)``.

    The long axis is that along which ∫ (x − x̄)² dA is largest; nan of grains that have none, as
    discs and regular polygons.
    """
    if model.outlines is None:
        return np.full(model.grain_count, np.nan, np.complex128)
    along = _stretch(model.outlines)
    length = np.abs(along)
    with np.errstate(invalid="ignore"):
        unit = np.where(length > _ROUND, along / length, np.nan)
    return np.asarray(unit * np.exp(2j * np.asarray(frame.angle, np.float64)))


def has_axes(model: Model) -> bool:
    """Whether any grain has a long axis."""
    return model.outlines is not None and bool((np.abs(_stretch(model.outlines)) > _ROUND).any())


def need_axes(model: Model) -> None:
    """Raises `PostError` if no grain has a long axis."""
    if not has_axes(model):
        raise PostError(
            "no grain has a long axis, as discs and regular polygons have none: choose a quantity "
            "that they have"
        )


def order_of(axes: Complexes) -> tuple[float, float]:
    """Nematic order and director [°] of those that have long axes; nan if none has.

    S e^{2iθ_S} = Σ e^{2iθ}/n, see `multicor_cli.post.quantities.QUANTITIES`.
    """
    known = axes[np.isfinite(axes)]
    if not known.size:
        return np.nan, np.nan
    mean = known.mean()
    return float(np.abs(mean)), float(degrees_of(mean))


def degrees_of(axes: Complexes) -> Floats:
    """θ of e^{2iθ} [°], from 0 to below 180."""
    found = np.degrees(0.5 * np.angle(axes)) % 180.0
    return np.asarray(np.where(found == 180.0, 0.0, found))  # of −0 but for rounding


@np.errstate(invalid="ignore")
def _stretch(outlines: Outlines) -> Complexes:
    """(J_xx − J_yy + 2i J_xy)/(J_xx + J_yy) of second moments of area, of each grain at angle 0.

    Nan of grains so thin that the lines around them enclose nothing.
    """
    grain, start, end = sides_of(rings_of(outlines))
    (x, y), (u, v), n = start.T, end.T, outlines.area.size
    cross = x * v - u * y

    def total(values: Floats) -> Floats:
        return np.asarray(np.bincount(grain, cross * values, n), np.float64)

    area = total(np.full(grain.size, 0.5))
    a, b = total((x + u) / 6.0) / area, total((y + v) / 6.0) / area
    xx = total((x * x + x * u + u * u) / 12.0) - area * a * a
    yy = total((y * y + y * v + v * v) / 12.0) - area * b * b
    xy = total((x * v + 2.0 * x * y + 2.0 * u * v + u * y) / 24.0) - area * a * b
    return np.asarray((xx - yy + 2j * xy) / (xx + yy))


# ---- Contacts by kind


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
    alike = (points.normal * points.normal[strongest[of]]).sum(axis=1) > 1.0 - _ROUND
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
        rows[0, has], rows[1, has], at_corner[has] = _places(outlines, grain[has], turned)
        found.append(End(grain, rows[0], rows[1], at_corner))
    return found[0], found[1]


def _places(
    outlines: Outlines, grain: NDArray[np.int64], at: Floats
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
    """Pieces and nearest corners of points on outlines of grains, and whether they are at these.

    Points lead from their centers at angle 0 [m], shape ``(p, 2)``.
    """
    first = outlines.start[outlines.piece].astype(np.int64)
    number = np.diff(first)[grain]
    before = np.cumsum(number) - number
    corner = np.arange(number.sum()) + np.repeat(first[grain] - before, number)
    point = np.repeat(np.arange(grain.size), number)
    after = np.arange(1, len(outlines.corner) + 1)
    after[outlines.start[1:] - 1] = outlines.start[:-1]
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
