"""What grains that are no discs look like, and where they and discs lie in a frame.

Closed polygonal lines around each of them; how far grains reach, and what part of them lies below a
level line; their long axes, and the order of these.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats, Model
from multicor_cli.model.outlines import Outlines
from multicor_cli.post.lattice import Complexes, in_plane
from multicor_cli.post.source import Frame, PostError

FINE = 2e-3
"""Height of arcs over their chords at most, over the radius of the grain, unless told otherwise: 50
points on a disc."""

_COARSEST = 0.3  # the same over the radius of an arc: at least four sides a turn
_SAME = 1e-9  # points that are nearer than this part of a piece are one


@dataclass(frozen=True)
class Rings:
    """Closed lines of ``k`` points in all, counter-clockwise around grains, clockwise around holes.

    Attributes:
        grain: The grain of each ring, ascending, shape ``(q,)``.
        start: First point of each ring, shape ``(q + 1,)``.
        point: The points [m], shape ``(k, 2)``.
    """

    grain: NDArray[np.int64]
    start: NDArray[np.int64]
    point: Floats

    def __iter__(self) -> Iterator[Floats]:
        """The points of each ring, shape ``(p, 2)``."""
        return iter(np.split(self.point, self.start[1:-1])) if self.grain.size else iter(())

    @property
    def owner(self) -> NDArray[np.int64]:
        """The grain of each point, shape ``(k,)``."""
        return self.grain.repeat(np.diff(self.start))

    @property
    def area(self) -> Floats:
        """Area inside of the lines around each grain [m²], shape ``(n,)``."""
        (x, y), after = self.point.T, around(self.start)[0]
        cross = 0.5 * (x * y[after] - x[after] * y)
        return np.asarray(np.bincount(self.owner, cross), np.float64)

    def of_grains(self, which: NDArray[np.int64]) -> Rings:
        """Those of some grains, which count from 0 then, in this order."""
        first, last = (np.searchsorted(self.grain, which, side) for side in ("left", "right"))
        ring = first.repeat(last - first) + counted(last - first)
        length = np.diff(self.start)[ring]
        point = self.start[ring].repeat(length) + counted(length)
        grain = np.arange(len(which)).repeat(last - first)
        return Rings(grain, _edges(length), self.point[point])

    def single(self) -> Rings:
        """One line around each grain: bridges of no width lead to holes and to parts beside it."""
        parts: list[list[Floats]] = [[] for _ in range(int(self.grain.max(initial=-1)) + 1)]
        for grain, ring in zip(self.grain.tolist(), self, strict=True):
            parts[grain].append(ring)
        lines = [part[0] if len(part) == 1 else _bridged(part) for part in parts]
        points = np.concatenate(lines) if lines else self.point
        length = np.array([len(line) for line in lines], np.int64)
        return Rings(np.arange(len(lines)), _edges(length), points)

    def sized(self, factor: Floats) -> Rings:
        """The same around grains that have become larger by factors, shape ``(n,)``."""
        return replace(self, point=self.point * factor[self.owner, np.newaxis])

    def placed(self, center: Floats, angle: Floats) -> Rings:
        """The same around grains with these centers [m], ``(n, 2)``, and angles [rad], ``(n,)``."""
        owner = self.owner
        (x, y), c, s = self.point.T, np.cos(angle)[owner], np.sin(angle)[owner]
        turned = np.column_stack([c * x - s * y, s * x + c * y])
        return replace(self, point=turned + center[owner])


def rings_of(outlines: Outlines, fine: float = FINE) -> Rings:
    """Rings around grains, from their centers at angle 0: of a clump around all that it covers.

    Arcs are ``fine`` radii of the grain higher than their chords at most.
    """
    lines = (outlines.piece, outlines.start, outlines.corner, outlines.rounding)
    return _rings(fine, *(np.ascontiguousarray(line).tobytes() for line in lines))


@functools.lru_cache(maxsize=2)
def _rings(fine: float, piece: bytes, start: bytes, corner: bytes, rounding: bytes) -> Rings:
    """The same of the bytes: frames of a run have the same ones."""
    of_grain, of_piece = (np.frombuffer(line, np.int32) for line in (piece, start))
    none, count = np.zeros(0), len(of_grain) - 1
    corners, radii = np.frombuffer(corner).reshape(-1, 2), np.frombuffer(rounding)
    outlines = Outlines(of_grain, of_piece, corners, radii, none, none)
    ends, point = _convex_rings(outlines, fine)
    parts = np.split(point, ends[1:-1])
    radius, found, grain = outlines.radius, list[Floats](), list[int]()
    known: dict[tuple[bytes, ...], list[Floats]] = {}
    for k in range(count):
        rings = parts[of_grain[k] : of_grain[k + 1]]
        if len(rings) > 1:  # clumps are often alike but for their size
            unit = [np.round(ring / radius[k], 9) for ring in rings]
            key = tuple(ring.tobytes() for ring in unit)
            if key not in known:
                known[key] = joined(unit)
            rings = [radius[k] * ring for ring in known[key]]
        found += rings
        grain += [k] * len(rings)
    points = np.concatenate(found) if found else np.zeros((0, 2))
    return Rings(np.array(grain, np.int64), _edges(np.array([len(r) for r in found], int)), points)


def _convex_rings(outlines: Outlines, fine: float) -> tuple[NDArray[np.int64], Floats]:
    """Rings around all pieces: first point of each, shape ``(p + 1,)``, and points.

    At each corner an arc leads from the normal of the side before to that of the side after it.
    Points between its ends lie so far outside that the ring has the area of the arc.
    """
    start, corner = outlines.start.astype(np.int64), outlines.corner
    count = np.diff(start)
    piece = np.arange(count.size).repeat(count)
    number, (after, before) = np.arange(len(corner)), around(start)
    way = corner[after] - corner
    normal = np.arctan2(-way[:, 0], way[:, 1])
    turn = (normal - normal[before]) % (2.0 * np.pi)
    turn[turn > 2.0 * np.pi - _SAME] = 0.0  # sides in a line
    is_disc = count[piece] == 1
    turn[is_disc] = 2.0 * np.pi
    rounding = outlines.rounding[piece]
    sagitta = fine * outlines.radius.repeat(np.diff(outlines.piece))[piece]
    is_round = (rounding > 0.0) & (turn > 0.0)
    share = np.minimum(sagitta / np.where(is_round, rounding, 1.0), _COARSEST)
    steps = np.ceil(turn / (2.0 * np.arccos(1.0 - share))).astype(np.int64)
    steps = np.where(is_round, np.maximum(steps, 2), 0)
    points = np.where(is_disc, np.maximum(steps, 3), steps + 1)
    at, k = number.repeat(points), counted(points)
    angle = normal[before][at] + turn[at] * k / np.maximum(steps, 1)[at]
    is_end = ~is_disc[at] & ((k == 0) | (k == steps[at]))
    radius = rounding[at] * np.where(is_end, 1.0, _outside(turn, steps, is_disc)[at])
    arc = radius[:, np.newaxis] * np.column_stack([np.cos(angle), np.sin(angle)])
    lengths = np.add.reduceat(points, start[:-1]) if count.size else points
    return _edges(lengths), corner[at] + arc


def _outside(turn: Floats, steps: NDArray[np.int64], is_disc: NDArray[np.bool_]) -> Floats:
    """Radius of the inner points of arcs, all points of circles, over that of the arcs.

    Chords over the angle φ from the ends of an arc, which lie on it, with s − 2 between others:
    ρ² (s − 2) + 2 ρ = s φ/sin φ. Of circles ρ² = φ/sin φ.
    """
    number = np.maximum(steps, 1)
    angle = turn / number
    whole = np.where(angle > 0.0, turn / np.where(angle > 0.0, np.sin(angle), 1.0), number)
    between = np.maximum(number - 2, 0)
    inner = whole / (1.0 + np.sqrt(1.0 + between * whole))
    return np.where(is_disc, np.sqrt(whole / number), inner)


def joined(polygons: Sequence[Floats]) -> list[Floats]:
    """Rings around all that convex polygons cover, each of them counter-clockwise ``(p, 2)``."""
    first, last = [], []
    for a, polygon in enumerate(polygons):
        way = np.roll(polygon, -1, axis=0) - polygon
        low, high = np.array([
            _inside(polygon, way, other, is_kept=a < b)
            for b, other in enumerate(polygons) if b != a
        ]).transpose(1, 2, 0)  # fmt: skip
        is_cut = (high - low > _SAME).any(axis=1).tolist()
        for k in range(len(polygon)):
            for begin, end in _gaps(low[k], high[k]) if is_cut[k] else [(0.0, 1.0)]:
                first.append(polygon[k] + begin * way[k])
                last.append(polygon[k] + end * way[k])
    return _chained(np.array(first), np.array(last))


def _inside(point: Floats, way: Floats, other: Floats, *, is_kept: bool) -> tuple[Floats, Floats]:
    """Which part of each side lies inside another convex polygon, as shares of its length.

    Of sides that run along each other, both are inside if the polygons lie on either side, and one
    of them, which is not ``is_kept``, if on the same (Cyrus & Beck 1978).
    """
    side = np.roll(other, -1, axis=0) - other
    normal = np.column_stack([side[:, 1], -side[:, 0]])
    normal /= np.maximum(np.hypot(*side.T), 1e-300)[:, np.newaxis]
    size = float(np.ptp(other, axis=0).max())
    away = np.einsum("kmx,mx->km", point[:, np.newaxis] - other, normal)
    slope, along = way @ normal.T, way @ side.T
    length = np.hypot(*way.T)[:, np.newaxis]
    is_flat = np.abs(slope) <= _SAME * np.maximum(length, size)
    limit = np.where((along > 0.0) & is_kept, -_SAME, _SAME) * size
    is_out = (is_flat & (away > limit)).any(axis=1)
    share = -away / np.where(is_flat, 1.0, slope)
    low = np.where(~is_flat & (slope < 0.0), share, 0.0).max(axis=1, initial=0.0)
    high = np.where(~is_flat & (slope > 0.0), share, 1.0).min(axis=1, initial=1.0)
    return low, np.where(is_out, low, high)


def _gaps(low: Floats, high: Floats) -> Iterator[tuple[float, float]]:
    """What intervals leave of 0 … 1."""
    reached = 0.0
    order = np.argsort(low)
    for begin, end in zip(low[order].tolist(), high[order].tolist(), strict=True):
        if end - begin <= _SAME:
            continue
        if begin - reached > _SAME:
            yield reached, begin
        reached = max(reached, end)
    if 1.0 - reached > _SAME:
        yield reached, 1.0


def _chained(first: Floats, last: Floats) -> list[Floats]:
    """Rings of lines, each of which ends where another begins."""
    rings, is_left = list[Floats](), np.ones(len(first), np.bool_)
    while is_left.any():
        ring = [int(np.argmax(is_left))]
        is_left[ring] = False
        while True:
            apart = np.hypot(*(first - last[ring[-1]]).T)
            apart[~is_left] = np.inf
            apart[ring[0]] = np.hypot(*(first[ring[0]] - last[ring[-1]]))
            following = int(np.argmin(apart))
            if following == ring[0]:
                break
            ring.append(following)
            is_left[following] = False
        if len(ring) > 2:
            rings.append(first[ring])
    return rings


def _bridged(rings: Sequence[Floats]) -> Floats:
    """One line along all rings, from the longest one to whichever is nearest to what it has."""
    left = sorted(rings, key=len)
    line = left.pop()
    while left:
        apart = [np.abs(in_plane(line)[:, np.newaxis] - in_plane(ring)) for ring in left]
        nearest = int(np.argmin([distances.min() for distances in apart]))
        here, there = np.unravel_index(int(np.argmin(apart[nearest])), apart[nearest].shape)
        way = np.roll(left.pop(nearest), -there, axis=0)
        line = np.concatenate([line[: here + 1], way, way[:1], line[here:]])
    return line


def _edges(lengths: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)


def around(start: NDArray[Any]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Numbers of the points after and before each one around its line; ``start`` as of `Rings`."""
    number = np.arange(int(start[-1]))
    after, before = number + 1, number - 1
    after[start[1:] - 1], before[start[:-1]] = start[:-1], start[1:] - 1
    return after, before


def counted(lengths: NDArray[np.int64]) -> NDArray[np.int64]:
    """``0 … length-1`` for each length, one after the other."""
    return np.asarray(np.arange(lengths.sum()) - (np.cumsum(lengths) - lengths).repeat(lengths))


# ---- How far grains reach, and what part of them lies below a level line: discs, and any shape

_AT_ONCE = 1 << 20  # lines of outlines that are looked at together


class Cut(Protocol):
    """Grains as they lie in a frame, which level lines cut; ``n`` of them."""

    @property
    def low(self) -> Floats:
        """How far below their centers they end [m], a negative number, shape ``(n,)``."""

    @property
    def high(self) -> Floats:
        """How far above their centers they end [m], shape ``(n,)``."""

    def below(self, grain: NDArray[np.int64], height: Floats) -> Floats:
        """Area of grains, by their numbers, below lines so far above their centers [m²]."""


def cut_of(model: Model, *frames: Frame) -> Cut:
    """The grains as they lie in a frame, or halfway between two."""
    if model.outlines is None:
        return _Discs(model.grains.radius)
    return turned(model, np.mean([np.asarray(f.angle, np.float64) for f in frames], axis=0))


def turned(model: Model, angle: Floats) -> Cut:
    """Grains of any shape, turned by angles [rad], shape ``(n,)``."""
    assert model.outlines is not None
    rings, (low, high) = rings_of(model.outlines), spans(model, angle)[:, :, 1]
    grain, *ends = sides_of(rings)
    c, s = np.cos(angle)[grain], np.sin(angle)[grain]
    (x, start), (u, end) = ((c * a - s * b, s * a + c * b) for a, b in (at.T for at in ends))
    first = np.concatenate([[0], np.cumsum(np.bincount(grain, minlength=angle.size))])
    # So that grains have their true area
    return _Shapes(low, high, first, start, end, (u - x) * (model.area / rings.area)[grain])


def reach_of(model: Model, frame: Frame) -> Floats:
    """How far grains reach to the left and down, and to the right and up [m], ``(2, n, 2)``."""
    if model.outlines is None:
        radius = np.stack([model.grains.radius] * 2, axis=1)
        return np.stack([-radius, radius])
    return spans(model, np.asarray(frame.angle, np.float64))


def spans(model: Model, angle: Floats) -> Floats:
    """The same of grains of any shape, turned by angles [rad], shape ``(n,)``."""
    outlines = model.outlines
    assert outlines is not None
    piece = np.repeat(np.arange(outlines.rounding.size), np.diff(outlines.start))
    grain = np.repeat(np.arange(angle.size), np.diff(outlines.piece))[piece]
    (x, y), c, s = outlines.corner.T, np.cos(angle)[grain], np.sin(angle)[grain]
    at = np.column_stack([c * x - s * y, s * x + c * y])
    rounding, first = outlines.rounding[piece, np.newaxis], outlines.start[outlines.piece[:-1]]
    if not first.size:
        return np.zeros((2, 0, 2))
    ends = np.minimum.reduceat(at - rounding, first), np.maximum.reduceat(at + rounding, first)
    return np.stack(ends)


def area_below(height: Floats, radius: Floats) -> Floats:
    """Area of discs below a level line at ``height`` above their centers [m²].

    a²(π − arccos s + s√(1−s²)) with s = height/a cut to −1 … 1.
    """
    s = np.clip(height / radius, -1.0, 1.0)
    return np.asarray(radius * radius * (np.pi - np.arccos(s) + s * np.sqrt(1.0 - s * s)))


class _Discs(NamedTuple):
    radius: Floats

    @property
    def low(self) -> Floats:
        return -self.radius

    @property
    def high(self) -> Floats:
        return self.radius

    def below(self, grain: NDArray[np.int64], height: Floats) -> Floats:
        return area_below(height, self.radius[grain])


class _Shapes(NamedTuple):
    """Lines around grains of any shape, those of a grain next to each other.

    Attributes:
        low, high: As of `Cut`.
        first: First line of each grain, shape ``(n + 1,)``.
        start, end: Heights of the ends of lines above the center [m], shape ``(s,)``.
        right: How far lines lead to the right [m], shape ``(s,)``.
    """

    low: Floats
    high: Floats
    first: NDArray[np.int64]
    start: Floats
    end: Floats
    right: Floats

    def below(self, grain: NDArray[np.int64], height: Floats) -> Floats:
        """∮ max(h − y, 0) dx around each grain, by Green's theorem; along a line it is a mean."""
        number = np.diff(self.first)[grain]
        ends, found = np.cumsum(number), []
        parts = np.flatnonzero(np.diff(ends // _AT_ONCE)) + 1
        for own, h, count in zip(
            *(np.split(each, parts) for each in (grain, height, number)), strict=True
        ):
            before, line = np.cumsum(count) - count, self.first[own].repeat(count) + counted(count)
            level = np.repeat(h, count)
            a, b = level - self.start[line], level - self.end[line]
            above = np.maximum(a, 0.0) + np.maximum(b, 0.0)
            crossing = a * b < 0.0
            share = above / np.where(crossing, np.abs(a - b), 1.0)
            depth = 0.5 * above * np.where(crossing, share, 1.0)
            found.append(np.add.reduceat(depth * self.right[line], before) if own.size else h)
        return np.concatenate(found)


def sides_of(rings: Rings) -> tuple[NDArray[np.int64], Floats, Floats]:
    """The grain of each line around grains, where it begins and ends [m], ``(s,)``, ``(s, 2)``."""
    return rings.owner, rings.point, rings.point[around(rings.start)[0]]


# ---- Long axes

_ROUND = 1e-6  # relative difference of the principal second moments from which on an axis is long


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
