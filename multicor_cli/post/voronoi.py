"""Radical cells of the grains: their neighbors and areas, local solid fractions, hexatic order."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model import Model, ShapeKind
from multicor_cli.model.model import Floats
from multicor_cli.model.shapes import Outline
from multicor_cli.optional import library
from multicor_cli.post.lattice import Complexes, in_plane, lattice_of
from multicor_cli.post.source import (
    Frame,
    PostError,
    Run,
    Selection,
    bin_count,
    chosen_frames,
    frames_of,
    frames_told,
    need_grains,
    placed_walls,
    places_of,
    times_of,
)
from multicor_cli.post.structure import margin_of, region_of
from multicor_cli.post.sums import Spread, of_sums
from multicor_cli.post.table import Column, Quantity, Table, line_of

WALL = -1
"""What lies across a side on a smooth wall."""

OPEN = 2.5
"""From how many roots of the median area of cells on a cell is open, unless there are images all
around."""

_NEAR = 4.0  # how far images are looked at first, in mean distances of the grains
_SHORT = 1e-6  # in mean distances of the grains: shorter sides are corners where four cells meet
_CORNERS = 2.0 * np.array([-1.0 - 1.0j, 1.0 - 1.0j, 1.0 + 1.0j, -1.0 + 1.0j])  # over the extent
_QHULL = "Qt Q11 Q5 Q7"  # triangles; nobody asks for outer planes; depth first suits the cache


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
        wave = length * in_plane(self.normal)[is_bond] ** fold
        whole, real, imaginary = (
            np.bincount(grain, part, minlength=n) for part in (length, wave.real, wave.imag)
        )
        order = np.full(n, np.nan, np.complex128)
        return np.divide(real + 1j * imaginary, whole, out=order, where=whole > 0.0)


class _Sides(NamedTuple):
    """Sides of cells, counter-clockwise: from ``start`` to ``end`` as seen from the grain [m]."""

    grain: NDArray[np.int64]
    other: NDArray[np.int64]
    start: Complexes
    end: Complexes

    def area_of(self, count: int) -> Floats:
        """Areas of the cells of so many grains [m²], shape ``(n,)``."""
        twice = _cross(self.start, self.end)
        return np.asarray(0.5 * np.bincount(self.grain, twice, minlength=count))

    def reach_of(self, count: int) -> Floats:
        """How far the cells of so many grains reach from their centers [m], shape ``(n,)``."""
        square = np.zeros(count)
        np.maximum.at(square, self.grain, _dot(self.end, self.end))
        return np.sqrt(square)


def cells_of(model: Model, frame: Frame) -> Cells:
    """The radical cells of the grains of a frame; raises `MissingLibrary` without SciPy."""
    lattice = lattice_of(model, frame).reduced
    center = lattice.wrapped(places_of(frame))
    pose, n = np.asarray(frame.wall_position, np.float64), len(center)
    walls = [*placed_walls(model, pose)]
    glued = [
        np.column_stack([outline.points[:, 0], outline.radius])
        for _, outline in walls
        if outline.is_grain and outline.radius is not None
    ]
    discs = np.concatenate([np.column_stack([center, model.disc_radius]), *glued])
    discs[n:, :2] = lattice.wrapped(discs[n:, :2])
    place, radius = discs[:, :2], discs[:, 2]
    around = [np.ptp(np.concatenate([x - radius, x + radius])) for x in place.T]
    size = np.where(np.array(lattice[:2]) > 0.0, lattice[:2], around)
    spacing = float(np.sqrt(size.prod() / n))
    is_cell, limit = lattice.height > 0.0, OPEN * spacing
    reach = _NEAR * spacing if is_cell else limit + float(np.hypot(limit, radius.max()))
    while True:
        which, shift = lattice.images(place, np.full(len(discs), reach))
        sides = _radical_sides(in_plane(place[which] + shift), radius[which], n, reach)
        sides = sides._replace(other=np.append(which, np.full(4, len(discs)))[sides.other])
        for foot in _feet(model, walls, center, lattice.width, sides.reach_of(n)):
            sides = _cut(sides, foot)
        farthest = sides.reach_of(n)
        # What could cut a corner off lies in the circle about it that is orthogonal to the discs
        needed = float((farthest + np.hypot(farthest, radius.max())).max())
        if not is_cell or needed <= reach:
            break
        reach = needed if (sides.other < len(discs)).all() else 2.0 * reach
    area = sides.area_of(n)
    is_open = np.bincount(sides.grain, minlength=n) == 0
    if not is_cell:
        is_open |= farthest > min(OPEN * float(np.sqrt(np.median(area))), limit)
    way = sides.end - sides.start
    length = np.sqrt(_dot(way, way))
    kept = ~is_open[sides.grain] & (length > _SHORT * spacing)
    normal = (-1j / length[kept]) * way[kept]
    area[is_open] = np.nan
    return Cells(
        area, sides.grain[kept], sides.other[kept], normal.view(np.float64).reshape(-1, 2),
        length[kept],
    )  # fmt: skip


def _radical_sides(points: Complexes, radius: Floats, count: int, room: float) -> _Sides:
    """Sides of the cells of the first ``count`` of some discs, whose neighbors are numbered.

    Four more points, farther than ``room`` [m] around them all, close the cells. Cells are dual to
    the lower faces of the convex hull of the points (x, y, x² + y² − a²).
    """
    x, y = points.real, points.imag
    middle = 0.5 * complex(x.min() + x.max(), y.min() + y.max())
    scale = float(max(np.ptp(x), np.ptp(y))) + 2.0 * room
    at = np.concatenate([(points - middle) / scale, _CORNERS])
    square = np.append(radius / scale, np.zeros(_CORNERS.size)) ** 2
    hull = library("scipy.spatial").ConvexHull(
        np.column_stack([at.real, at.imag, _dot(at, at) - square]), qhull_options=_QHULL
    )
    number = np.full(len(hull.simplices), -1)
    is_lower = hull.equations[:, 2] < 0.0
    number[is_lower] = np.arange(is_lower.sum())
    face, beyond = hull.simplices[is_lower].T, number[hull.neighbors[is_lower].T]
    a, b, c = at[face]
    u, v, power = b - a, c - a, square[face]
    twice = _cross(u, v)  # the area of the triangle
    with np.errstate(invalid="ignore", divide="ignore"):
        p = 0.5 * (_dot(u, u) - power[1] + power[0]) / twice
        q = 0.5 * (_dot(v, v) - power[2] + power[0]) / twice
        corner = a - 1j * (p * v - q * u)
    # The edge opposite to each point of a face; counter-clockwise it is the one of the first
    one, two, is_left = face[[1, 2, 0]], face[[2, 0, 1]], twice > 0.0
    first, second = np.where(is_left, one, two), np.where(is_left, two, one)
    is_own = (first < count) & (beyond >= 0)
    grain = first[is_own].astype(np.int64)
    # The face is on the left of the edge: around the grain its corner follows the other's
    start = corner[beyond[is_own]] - at[grain]
    end = corner[np.nonzero(is_own)[1]] - at[grain]
    return _Sides(grain, second[is_own], scale * start, scale * end)


def _feet(
    model: Model,
    walls: Sequence[tuple[NDArray[np.int64], Outline]],
    center: Floats,
    period: float,
    reach: Floats,
) -> Iterator[Complexes]:
    """Ways from the grains to points at which smooth walls end their cells, nan for none [m].

    Each of the shape ``(n,)``, with one such point of every grain; only those within ``reach`` of
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
    grain, ways = np.concatenate(grains), in_plane(np.concatenate(feet))
    order = np.argsort(grain, kind="stable")
    grain, ways = grain[order], ways[order]
    turn = np.arange(grain.size) - np.searchsorted(grain, grain)
    for number in range(int(turn.max(initial=-1)) + 1):
        found = np.full(len(center), np.nan + 0.0j)
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


def _cut(sides: _Sides, foot: Complexes) -> _Sides:
    """The cells as far as they lie before the lines through some feet, across the ways there."""
    own = foot[sides.grain]
    square = _dot(own, own)
    one, two = (
        np.nan_to_num(_dot(own, ends) - square, nan=-1.0) for ends in (sides.start, sides.end)
    )
    leaves, enters = (one <= 0.0) & (two > 0.0), (one > 0.0) & (two <= 0.0)
    part = np.divide(one, one - two, out=np.zeros_like(one), where=leaves | enters)
    crossing = sides.start + part * (sides.end - sides.start)
    end, start = np.where(leaves, crossing, sides.end), np.where(enters, crossing, sides.start)
    kept = (one <= 0.0) | (two <= 0.0)
    inside = sides.grain[kept], sides.other[kept], start[kept], end[kept]
    # Along the wall from where a cell leaves to where it enters again
    out, back = np.full_like(foot, np.nan), np.full_like(foot, np.nan)
    out[sides.grain[leaves]], back[sides.grain[enters]] = crossing[leaves], crossing[enters]
    grain = np.flatnonzero(np.isfinite(out) & np.isfinite(back))
    wall = grain, np.full(grain.size, WALL), out[grain], back[grain]
    return _Sides(*(np.concatenate(pair) for pair in zip(inside, wall, strict=True)))


def _dot(a: Complexes, b: Complexes) -> Floats:
    return np.asarray(a.real * b.real + a.imag * b.imag)


def _cross(a: Complexes, b: Complexes) -> Floats:
    return np.asarray(a.real * b.imag - a.imag * b.real)


# ---- How much room grains have

_BINS = 50  # between 0 and 1
SIDES = np.arange(3, 10)
"""Numbers of neighbors whose shares are told."""

QUANTITIES = (
    Quantity("local_solid_fraction", "local solid fraction", r"\langle\nu_i\rangle"),
    Quantity("deviation", "its standard deviation over the grains"),
    Quantity("solid_fraction", "area of the grains over that of their cells", r"\nu"),
    Quantity("neighbors", "neighbors of a grain"),
    *(Quantity(f"share_{k}", f"share of grains with {k} neighbors") for k in (5, 6, 7)),
    Quantity("hexatic", "hexatic order of a grain", r"\langle|\psi_6|\rangle"),
    Quantity("hexatic_global", "hexatic order of all", r"|\langle\psi_6\rangle|"),
)
"""What `voronoi` measures, in the order of the table."""

_SUMS = (
    "grains", "fraction", "square", "solid", "cells", "neighbors", "hexatic", "hexatic_global",
)  # fmt: skip
"""Sums over the grains with a cell, before their numbers by neighbors and by local fraction."""


class VoronoiTable(Table):
    """Radical cells of the grains: averages, and P(ν) of the local solid fraction; ``b`` bins.

    The local solid fraction of a grain is its area over that of its cell (see
    `Cells`), of spheres their cross-section. Neighbors are grains
    across a side of the cell, glued ones too. Grains with open cells are left out, and with a
    margin those near sides that are not periodic. Grains count alike.

    Attributes:
        mean: Averages over grains and frames of `QUANTITIES` by name.
        spread: Their standard errors and drifts; see `multicor_cli.post.sums.spread`.
        fraction: Centers of the bins of the local solid fraction, shape ``(b,)``.
        density: Probability density P(ν) there, shape ``(b,)``.
        density_error: Its standard errors, nan with too few frames to tell, shape ``(b,)``.
        grains: Grains of all frames in each bin, shape ``(b,)``.
        sides: Numbers of neighbors `SIDES`.
        share: Shares of the grains that have as many; ``share_error``, standard errors.
        open_share: Share of grains whose cells are open.
        grain_count: Grains that count, averaged over the frames.
        mean_diameter: Mean diameter d̄ [m].
        margin: What is left out at sides that are not periodic, in mean diameters.
    """


def voronoi(
    source: Run,
    selection: Selection | None = None,
    bins: int | None = None,
    *,
    margin: float | None = None,
) -> VoronoiTable:
    """Local solid fractions, numbers of neighbors and hexatic order of the radical cells.

    Args:
        source: The run.
        selection: Which frames; default: the later half of the last stage.
        bins: Bins of the local solid fraction between 0 and 1; default: 50.
        margin: Mean diameters left out at sides that are not periodic, counted from the outermost
            centers; default: 1.

    Raises:
        PostError: If no frame is selected, one has no grain, or no grain that counts has a cell; if
            ``margin`` is negative, or given for a cell.
        MissingLibrary: If SciPy is not installed.
        StoreError: If the run cannot be read.
    """
    diameter, edge = source.model.mean_diameter, margin_of(source.model, margin)
    chosen = chosen_frames(source, selection)
    need_grains(source, chosen)
    count = _BINS if bins is None else bin_count(bins)
    rows = np.array([_sums(source, f, edge, count) for f in frames_of(source, chosen)])
    if not rows[:, 1].any():
        raise PostError(
            "no grain in the region has a cell: too few are there, or each is at a free surface; "
            "lower --margin, or choose other frames"
        )
    open_share, rows = rows[:, 0].sum() / rows[:, :2].sum(), rows[:, 1:]
    times = times_of(source, chosen)
    values, spreads = of_sums(lambda sums: _derive(sums, count), rows, times)
    k = len(QUANTITIES)
    names = [quantity.name for quantity in QUANTITIES]
    mean = dict(zip(names, values.tolist(), strict=False))
    spread = {name: Spread(*(each[n] for each in spreads)) for n, name in enumerate(names)}
    of_sides, of_bins = slice(k, k + SIDES.size), slice(k + SIDES.size, None)
    number = rows[:, -count:].sum(axis=0)
    seen = np.flatnonzero(number)
    shown = slice(int(seen[0]), int(seen[-1]) + 1)
    details = [
        Column("fraction", "1", ((np.arange(count) + 0.5) / count)[shown], "local solid fraction"),
        Column("density", "1", values[of_bins][shown], "probability density"),
        Column("density_error", "1", spreads.error[of_bins][shown], "standard error"),
        Column("grains", "", number[shown].astype(np.int64)),
    ]
    facts = {
        "mean_diameter": diameter, "margin": edge, **frames_told(source, chosen),
        "grain_count": float(rows[:, 0].mean()), "open_share": float(open_share), "mean": mean,
        "standard_error": {name: float(one.error) for name, one in spread.items()},
        "drift": {name: float(one.drift) for name, one in spread.items()},
        "note": {name: one.note() for name, one in spread.items()},
        "sides": SIDES, "share": values[of_sides], "share_error": spreads.error[of_sides],
        **{column.name: column.values for column in details},
    }  # fmt: skip
    lines = [line_of(q.label, mean[q.name], spread[q.name]) for q in QUANTITIES]
    headings = ("quantity", "mean", "standard error", "drift", "note")
    columns = [
        Column(f"of_{heading}", "", values, heading, "")
        for heading, values in zip(headings, zip(*lines, strict=True), strict=True)
    ]
    return VoronoiTable(columns, facts, details, spread=spread, frames=chosen)


def _sums(source: Run, frame: Frame, margin: float, count: int) -> Floats:
    """Grains with open cells; the `_SUMS`; grains by number of neighbors and by local fraction."""
    model = frame.model
    inside = region_of(source.model, frame, margin).which
    cells = cells_of(model, frame)
    known = inside[~cells.is_open[inside]]
    solid, area = model.area[known], cells.area[known]
    neighbors, order = cells.neighbors[known], np.nan_to_num(cells.order()[known])
    fraction = solid / area
    bin_ = np.minimum((fraction * count).astype(np.int64), count - 1)  # 1, and cut grains
    return np.array([
        inside.size - known.size, known.size, fraction.sum(), (fraction**2).sum(), solid.sum(),
        area.sum(), neighbors.sum(), np.abs(order).sum(), np.abs(order.sum()),
        *np.bincount(neighbors, minlength=SIDES[-1] + 1)[SIDES],
        *np.bincount(bin_, minlength=count),
    ])  # fmt: skip


def _derive(sums: Floats, count: int) -> Floats:
    """`QUANTITIES`, shares by number of neighbors, and densities, from sums ``(…, q)``."""
    s: dict[str, Any] = dict(zip(_SUMS, np.moveaxis(sums, -1, 0), strict=False))
    n = s["grains"]
    mean, sides = s["fraction"] / n, sums[..., len(_SUMS) : len(_SUMS) + SIDES.size] / n[..., None]
    found: dict[str, NDArray[Any]] = {
        "local_solid_fraction": mean,
        "deviation": np.sqrt(np.maximum(s["square"] / n - mean**2, 0.0)),
        "solid_fraction": s["solid"] / s["cells"],
        "neighbors": s["neighbors"] / n,
        **{f"share_{k}": sides[..., k - SIDES[0]] for k in (5, 6, 7)},
        "hexatic": s["hexatic"] / n,
        "hexatic_global": s["hexatic_global"] / n,
    }
    averages = np.stack([found[quantity.name] for quantity in QUANTITIES], axis=-1)
    density = sums[..., -count:] * (count / n[..., None])
    return np.concatenate([averages, sides, density], axis=-1)
