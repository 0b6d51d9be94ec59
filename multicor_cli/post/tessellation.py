"""Radical cells of the grains: the part of the plane that belongs to each, and its neighbors."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model import Model, ShapeKind
from multicor_cli.model.model import Floats
from multicor_cli.model.shapes import Outline
from multicor_cli.optional import library
from multicor_cli.post.lattice import lattice_of
from multicor_cli.post.source import Frame
from multicor_cli.post.walls import placed_walls

WALL = -1
"""What lies across a side on a smooth wall."""

OPEN = 2.5
"""From how many roots of the median area of cells on a cell is open, unless there are images all
around."""

_NEAR = 4.0  # how far images are looked at first, in mean distances of the grains
_SHORT = 1e-6  # in mean distances of the grains: shorter sides are corners where four cells meet
_FAR = 2.0  # distance of the four points around everything, over its extent


class Cells(NamedTuple):
    """Radical cells of the ``n`` grains of a frame, with ``s`` sides in all.

    The cell of a grain is where |x − x_i|² − a_i² is less than for every other grain, glued ones
    and images included: its sides lie on the radical axes, which do not cut discs that touch
    (Gellatly & Finney, J. Non-Cryst. Solids 50, 313, 1982; Aurenhammer, SIAM J. Comput. 16, 78,
    1987). It ends at smooth walls: at each straight piece that the grain is beside of, at the
    tangent of a circle in the point nearest to the center, and across the way to a corner that is
    nearer than those; what is nearer to a grain beyond a thin wall belongs to none. Unless a domain
    is periodic in both directions, cells are open that reach farther from the center of their grain
    than `OPEN` times the root of the median area of all cells: those at a free surface.

    Attributes:
        area: Areas of the cells [m²], nan of open ones, shape ``(n,)``.
        grain: To which grain a side belongs, shape ``(s,)``; open cells have no sides.
        other: The grain across it; not below n: a glued grain; `WALL`: a smooth wall.
        normal: Unit normals outwards, shape ``(s, 2)``.
        length: Lengths of the sides [m], shape ``(s,)``.
    """

    area: Floats
    grain: NDArray[np.int64]
    other: NDArray[np.int64]
    normal: Floats
    length: Floats

    @property
    def is_open(self) -> NDArray[np.bool_]:
        """Whether a cell is open, shape ``(n,)``."""
        return np.isnan(self.area)

    @property
    def neighbors(self) -> NDArray[np.int64]:
        """Grains across the sides of each cell, glued ones too, shape ``(n,)``."""
        return np.bincount(self.grain[self.other != WALL], minlength=self.area.size)

    def order(self, fold: int = 6) -> NDArray[np.complex128]:
        """ψ of each grain: Σ l exp(i fold θ)/Σ l over its neighbors, nan of open cells, ``(n,)``.

        Each neighbor, in the direction θ, counts with the length l of the side between both, so
        that ψ is continuous where neighbors change (Mickel, Kapfer, Schröder-Turk & Mecke, J. Chem.
        Phys. 138, 044501, 2013).
        """
        is_bond, n = self.other != WALL, self.area.size
        grain, length = self.grain[is_bond], self.length[is_bond]
        angle = fold * np.arctan2(self.normal[is_bond, 1], self.normal[is_bond, 0])
        parts = (np.bincount(grain, length * wave(angle), minlength=n) for wave in (np.cos, np.sin))
        whole = np.bincount(grain, length, minlength=n)
        real, imaginary = (
            np.where(whole > 0.0, part / np.where(whole > 0.0, whole, 1.0), np.nan)
            for part in parts
        )
        return np.asarray(real + 1j * imaginary)


class _Sides(NamedTuple):
    """Sides of cells, counter-clockwise: from ``start`` to ``end`` as seen from the grain [m]."""

    grain: NDArray[np.int64]
    other: NDArray[np.int64]
    start: Floats
    end: Floats

    def area_of(self, count: int) -> Floats:
        """Areas of the cells of so many grains [m²], shape ``(n,)``."""
        (x, y), (u, v) = self.start.T, self.end.T
        return np.asarray(0.5 * np.bincount(self.grain, x * v - y * u, minlength=count))

    def reach_of(self, count: int) -> Floats:
        """How far the cells of so many grains reach from their centers [m], shape ``(n,)``."""
        found = np.zeros(count)
        np.maximum.at(found, self.grain, np.sqrt(_dot(self.end, self.end)))
        return found


def cells_of(model: Model, frame: Frame) -> Cells:
    """The radical cells of the grains of a frame; raises `MissingLibrary` without SciPy."""
    lattice = lattice_of(model, frame).reduced
    center = lattice.wrapped(np.asarray(frame.position, np.float64)[:, :2])
    pose, n = np.asarray(frame.wall_position, np.float64), len(center)
    walls = [*placed_walls(model, pose)]
    glued = [
        np.column_stack([outline.points[:, 0], outline.radius])
        for _, outline in walls
        if outline.is_grain and outline.radius is not None
    ]
    discs = np.concatenate([np.column_stack([center, model.grains.radius]), *glued])
    discs[n:, :2] = lattice.wrapped(discs[n:, :2])
    place, radius = discs[:, :2], discs[:, 2]
    around = np.ptp([(place.T - radius).min(axis=1), (place.T + radius).max(axis=1)], axis=0)
    size = np.where(np.array(lattice[:2]) > 0.0, lattice[:2], around)
    spacing = float(np.sqrt(size.prod() / n))
    is_cell, limit = lattice.height > 0.0, OPEN * spacing
    reach = _NEAR * spacing if is_cell else limit + float(np.hypot(limit, radius.max()))
    while True:
        which, shift = lattice.images(place, np.full(len(discs), reach))
        sides = _radical_sides(place[which] + shift, radius[which], n, reach)
        sides = sides._replace(other=np.append(which, np.full(4, len(discs)))[sides.other])
        for foot in _feet(model, walls, center, lattice.width, sides.reach_of(n)):
            sides = _cut(sides, foot)
        if not is_cell:
            break
        # What could cut a corner off lies in the circle about it that is orthogonal to the discs
        farthest = sides.reach_of(n)
        needed = float((farthest + np.hypot(farthest, radius.max())).max())
        if needed <= reach:
            break
        reach = needed if (sides.other < len(discs)).all() else 2.0 * reach
    area = sides.area_of(n)
    is_open = np.bincount(sides.grain, minlength=n) == 0
    if not is_cell:
        is_open |= sides.reach_of(n) > min(OPEN * float(np.sqrt(np.median(area))), limit)
    way = sides.end - sides.start
    length = np.hypot(*way.T)
    kept = ~is_open[sides.grain] & (length > _SHORT * spacing)
    normal = np.column_stack([way[kept, 1], -way[kept, 0]]) / length[kept, np.newaxis]
    area[is_open] = np.nan
    return Cells(area, sides.grain[kept], sides.other[kept], normal, length[kept])


def _radical_sides(points: Floats, radius: Floats, count: int, room: float) -> _Sides:
    """Sides of the cells of the first ``count`` of some discs, whose neighbors are numbered.

    Four more points, farther than ``room`` [m] around them all, close the cells. Cells are dual to
    the lower faces of the convex hull of the points (x, y, x² + y² − a²).
    """
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    scale = float(np.max(np.ptp(points, axis=0))) + 2.0 * room
    corners = _FAR * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    at = np.concatenate([(points - middle) / scale, corners])
    square = np.append(radius / scale, np.zeros(4)) ** 2
    hull = library("scipy.spatial").ConvexHull(
        np.column_stack([at, _dot(at, at) - square]), qhull_options="Qt Q11"
    )
    number = np.full(len(hull.simplices), -1)
    is_lower = hull.equations[:, 2] < 0.0
    number[is_lower] = np.arange(is_lower.sum())
    face, beyond = hull.simplices[is_lower], number[hull.neighbors[is_lower]]
    a, b, c = at[face].transpose(1, 0, 2)
    (ux, uy), (vx, vy) = (b - a).T, (c - a).T
    twice = ux * vy - uy * vx  # twice the area of the triangle
    power = square[face]
    p = 0.5 * (ux**2 + uy**2 - power[:, 1] + power[:, 0])
    q = 0.5 * (vx**2 + vy**2 - power[:, 2] + power[:, 0])
    with np.errstate(invalid="ignore", divide="ignore"):
        corner = a + np.column_stack([p * vy - q * uy, q * ux - p * vx]) / twice[:, np.newaxis]
    is_left = twice > 0.0
    found = []
    for k in range(3):  # the edge opposite to k: counter-clockwise it is the first one's
        one, two = face[:, (k + 1) % 3], face[:, (k + 2) % 3]
        first, second = np.where(is_left, one, two), np.where(is_left, two, one)
        own = np.flatnonzero((first < count) & (beyond[:, k] >= 0))
        grain = first[own]
        # The face is on the left of the edge: around the grain its corner follows the other's
        start, end = corner[beyond[own, k]] - at[grain], corner[own] - at[grain]
        found.append(_Sides(grain, second[own], scale * start, scale * end))
    return _Sides(*(np.concatenate(values) for values in zip(*found, strict=True)))


def _feet(
    model: Model,
    walls: Sequence[tuple[NDArray[np.int64], Outline]],
    center: Floats,
    period: float,
    reach: Floats,
) -> Iterator[Floats]:
    """Ways from the grains to points at which smooth walls end their cells, nan for none [m].

    Each of the shape ``(n, 2)``, with one such point of every grain; only those within ``reach`` of
    the grains, shape ``(n,)``.
    """
    shapes, nearest = model.shapes, np.full((model.wall_count, len(center)), np.inf)
    # Corners come last: they count where nothing else of their wall is as near
    smooth = [pair for pair in walls if not pair[1].is_grain]
    smooth.sort(key=lambda pair: bool(shapes.kind[pair[0][0]] == ShapeKind.VERTEX))
    grains, feet = [np.zeros(0, np.int64)], [np.zeros((0, 2))]
    for which, outline in smooth:
        for k, shape in enumerate(which.tolist()):
            own = nearest[shapes.wall[shape]]
            foot = _foot(outline, k, center, period)
            distance = np.hypot(*foot.T)
            is_near = distance < reach
            if shapes.kind[shape] == ShapeKind.VERTEX:
                is_near &= distance < own
            grain = np.flatnonzero(is_near)
            own[grain] = np.minimum(own[grain], distance[grain])
            grains.append(grain)
            feet.append(foot[grain])
    grain, ways = np.concatenate(grains), np.concatenate(feet)
    order = np.argsort(grain, kind="stable")
    grain, ways = grain[order], ways[order]
    turn = np.arange(grain.size) - np.searchsorted(grain, grain)
    for number in range(int(turn.max(initial=-1)) + 1):
        found = np.full((len(center), 2), np.nan)
        found[grain[turn == number]] = ways[turn == number]
        yield found


def _foot(outline: Outline, k: int, center: Floats, period: float) -> Floats:
    """Ways from the grains to the nearest point of a shape, nan of pieces aside, ``(n, 2)``."""
    point = outline.points[k, 0]
    away = point - center
    if outline.normal is not None:
        normal = outline.normal[k]
        return np.asarray((away @ normal)[:, np.newaxis] * normal)
    if outline.radius is not None:
        distance = np.hypot(*away.T)[:, np.newaxis]
        return np.asarray(
            away * (1.0 - outline.radius[k] / np.where(distance > 0.0, distance, 1.0))
        )
    middle = outline.points[k].mean(axis=0) - center
    if period > 0.0:
        away[:, 0] -= period * np.round(middle[:, 0] / period)
    if outline.points.shape[1] == 1:
        return np.asarray(away)
    way = outline.points[k, 1] - point
    part = -(away @ way) / (way @ way)
    is_beside = (part >= 0.0) & (part <= 1.0)
    return np.where(is_beside[:, np.newaxis], away + part[:, np.newaxis] * way, np.nan)


def _cut(sides: _Sides, foot: Floats) -> _Sides:
    """The cells as far as they lie before the lines through some feet, across the ways there."""
    own = foot[sides.grain]
    square = _dot(own, own)
    one, two = (
        np.nan_to_num(_dot(own, ends) - square, nan=-1.0) for ends in (sides.start, sides.end)
    )
    leaves, enters = (one <= 0.0) & (two > 0.0), (one > 0.0) & (two <= 0.0)
    part = np.divide(one, one - two, out=np.zeros_like(one), where=leaves | enters)
    crossing = sides.start + part[:, np.newaxis] * (sides.end - sides.start)
    end = np.where(leaves[:, np.newaxis], crossing, sides.end)
    start = np.where(enters[:, np.newaxis], crossing, sides.start)
    kept = (one <= 0.0) | (two <= 0.0)
    inside = sides.grain[kept], sides.other[kept], start[kept], end[kept]
    # Along the wall from where a cell leaves to where it enters again
    out, back = np.full_like(foot, np.nan), np.full_like(foot, np.nan)
    out[sides.grain[leaves]], back[sides.grain[enters]] = crossing[leaves], crossing[enters]
    grain = np.flatnonzero(np.isfinite(out[:, 0]) & np.isfinite(back[:, 0]))
    wall = grain, np.full(grain.size, WALL), out[grain], back[grain]
    return _Sides(*(np.concatenate(pair) for pair in zip(inside, wall, strict=True)))


def _dot(a: Floats, b: Floats) -> Floats:
    """Products of vectors, row by row."""
    return np.asarray(a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1])
