"""Neighbor list: all pairs of shapes with a gap below a cutoff, in O(N) for any mixture of sizes.

Discs are binned on several grids, one per class of radii (factor two), so that a few large grains
do not make the cells of the small ones large. Each grain owns the row of its partners with a higher
shape number.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli import arithmetic
from multicor_cli.engine.geometry.drift import Box, approach_of_displacements
from multicor_cli.engine.geometry.scene import Scene, is_near_shape, shortest
from multicor_cli.engine.jit.arrays import CHUNK
from multicor_cli.engine.jit.compile import kernel, parallel_kernel, prange, subroutine
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.model.columns import RADIUS, X, Y
from multicor_cli.model.model import Floats, Ints, Model
from multicor_cli.model.shapes import ShapeKind

# ---- Cell grids for discs of any sizes: one per class of radii, with a few cells per disc at most


class SizeClasses(NamedTuple):
    """Classes of radii, a factor of two wide: of each disc, and the largest radius of each [m]."""

    level: Ints
    radius: Floats


class Grids(NamedTuple):
    """Cell grids, one for each class of radii.

    Attributes:
        level: Grid of each disc, shape ``(d,)``.
        cells: Width and height of the cells of each level [m], shape ``(levels, 2)``.
        radius: Largest radius of each level [m], shape ``(levels,)``.
        origin: Lower left corner [m], shape ``(2,)``.
        start: Number of the first cell of each level, shape ``(levels + 1,)``.
        shape: Cells in x and y of each level, shape ``(levels, 2)``.
    """

    level: Ints
    cells: Floats
    radius: Floats
    origin: Floats
    start: Ints
    shape: Ints


def classify(radius: Floats) -> SizeClasses:
    """Classes of the radii [m]; only those that occur count."""
    exponent = np.frexp(radius / (radius.min() * (1.0 - 1e-9)))[1]
    _, level = np.unique(exponent, return_inverse=True)
    largest = np.array([radius[level == k].max() for k in range(level.max() + 1)])
    return SizeClasses(level.astype(np.int32), largest)


def make_grids(
    classes: SizeClasses, low: Floats, high: Floats, period: float, cutoff: float,
    height: float = 0.0,
) -> Grids:  # fmt: skip
    """Grids for discs between the corners ``low`` and ``high``; cells grow if these are far apart.

    With a period, or ``height``, they span 0 to it exactly. Pairs are looked for up to the gap
    ``cutoff`` [m].
    """
    cutoff = max(cutoff, 0.0)
    origin = np.array(low, np.float64)
    size = np.maximum(high - low, 2.0 * classes.radius.max() + cutoff)
    if period > 0.0:
        origin[X], size[X] = 0.0, period
    if height > 0.0:
        origin[Y], size[Y] = 0.0, height
    cells, shape = np.empty((classes.radius.size, 2)), np.empty((classes.radius.size, 2), np.int32)
    for k, radius in enumerate(classes.radius):
        width = 2.0 * radius + cutoff
        allowed = cells_for(int(np.count_nonzero(classes.level == k)))
        while cell_count(size, width) > allowed:
            width *= 1.5
        shape[k] = np.maximum(1, np.floor(size / width))
        cells[k] = size / shape[k]
    start = np.concatenate([[0], np.cumsum(shape.prod(axis=1))]).astype(np.int32)
    return Grids(classes.level, cells, classes.radius, origin, start, shape)


def cells_for(discs: int) -> int:
    """Most cells of a grid."""
    return 64 + 4 * discs


def cell_count(size: Floats, width: float) -> float:
    """About how many cells of this width [m] cover a rectangle of this size [m]."""
    across, up = (np.floor(size / width) + 1.0).tolist()
    return float(across * up)


# ---- All pairs of shapes whose gap is below a cutoff

ROOM = 8  # pairs of a disc for which there is room at first


@kernel
def centers_between(
    position: Floats, world: Floats, disc_shapes: Ints, period: float, height: float, tilt: float
) -> tuple[Floats, Floats, Floats]:
    """Centers of the grains, wrapped into the periods, and of the discs of walls [m].

    Also the lower left and the upper right corner of what they span.
    """
    count = position.shape[0]
    center = np.empty((count + disc_shapes.size, 2))
    low, high = np.full(2, np.inf), np.full(2, -np.inf)
    for d in range(center.shape[0]):
        images = np.floor(position[d, Y] / height) if height > 0.0 else 0.0
        for k in range(2):
            value = position[d, k] if d < count else world[disc_shapes[d - count], k]
            if height > 0.0:  # which has no walls
                value -= images * (tilt if k == X else height)
            if k == X and period > 0.0:
                value -= period * np.floor(value / period)
            center[d, k] = value
            low[k], high[k] = min(low[k], value), max(high[k], value)
    return center, low, high


@kernel
def bin_discs(
    center: Floats, level: Ints, level_cells: Floats, origin: Floats, level_start: Ints,
    level_shape: Ints,
) -> tuple[Ints, Ints]:  # fmt: skip
    """Discs sorted into the cells of `Grids`, ascending in each, after the start of each cell."""
    cell = np.empty(level.size, np.int32)
    start = np.zeros(level_start[-1] + 1, np.int32)
    for d in range(level.size):
        k = level[d]
        cx = min(max(int((center[d, X] - origin[X]) / level_cells[k, X]), 0), level_shape[k, X] - 1)
        cy = min(max(int((center[d, Y] - origin[Y]) / level_cells[k, Y]), 0), level_shape[k, Y] - 1)
        cell[d] = level_start[k] + cy * level_shape[k, X] + cx
        start[cell[d] + 1] += 1
    for c in range(start.size - 1):
        start[c + 1] += start[c]
    fill = start[:-1].copy()
    order = np.empty(level.size, np.int32)
    for d in range(level.size):
        order[fill[cell[d]]] = d
        fill[cell[d]] += 1
    return start, order


@formula
def _cells_within(
    low: float, high: float, size: float, count: int, is_periodic: bool
) -> tuple[int, int]:
    """First and last of the cells that an interval touches; beyond the grid those at its edge.

    With a period they go on beyond it, and each comes once.
    """
    first, last = int(np.floor(low / size)), int(np.floor(high / size))
    if is_periodic:
        return (first, last) if last - first < count else (0, count - 1)
    return min(max(first, 0), count - 1), max(min(last, count - 1), 0)


@formula
def _next_cell(cell: int, count: int, is_periodic: bool) -> int:
    """The cell ahead of one, or this one where that is not there, or sees it as the one ahead."""
    return cell + 1 if is_periodic and count > 2 else min(cell + 1, count - 1)


@formula
def _period_of(cell: int, count: int) -> int:
    """Periods by which a cell beside the grid is off the one that it is an image of."""
    return 1 if cell >= count else -1 if cell < 0 else 0


@formula
def _scan_cell(
    cell: int, k: int, grain_count: int, shape_of: Ints, cutoff: float, period: float,
    height: float, tilt: float, level_cells: Floats, level_radius: Floats, level_start: Ints,
    level_shape: Ints, cell_start: Ints, sorted_x: Floats, sorted_y: Floats, sorted_radius: Floats,
    cell_disc: Ints, first: Ints, second: Ints, offset: int, last: int,
) -> int:  # fmt: skip
    """Pairs of the discs in a cell of level ``k`` with those that come later.

    These are in the same cell, in the cells ahead, or in the cells around of larger classes:
    whoever is near is no more than one cell away, so that one of both finds the other. Pairs go to
    ``(first, second)[offset:last]``, which is **modified**; returns how many, if there is room for
    them or not.
    """
    found, width, depth = 0, level_cells[k, X], level_cells[k, Y]
    cy = (cell - level_start[k]) // level_shape[k, X]
    cx = cell - level_start[k] - cy * level_shape[k, X]
    for other in range(k, level_shape.shape[0]):
        span = level_radius[k] + level_radius[other] + cutoff
        columns, rows = level_shape[other, X], level_shape[other, Y]
        first_y, last_y = cy, _next_cell(cy, rows, height > 0.0)
        is_low = height > 0.0 and rows < 3
        if other > k:
            first_y, last_y = _cells_within(
                cy * depth - span, (cy + 1) * depth + span, level_cells[other, Y], rows,
                height > 0.0,
            )  # fmt: skip
            is_low = height > 0.0 and last_y - first_y == rows - 1
        for row in range(first_y, last_y + 1):
            is_own = other == k and row == cy
            images = _period_of(row, rows)
            left = cx * width
            if images != 0:  # in a cell the image of a row lies elsewhere, however far it leans
                left -= images * tilt
                left -= period * np.floor(left / period)
            column, last_x = _cells_within(
                left - span, left + width + span, level_cells[other, X], columns, period > 0.0
            )
            if is_own:
                column, last_x = cx, _next_cell(cx, columns, period > 0.0)
            if is_low:  # which image is near is not known by the row
                column, last_x = cx if is_own else 0, columns - 1
            base = level_start[other] + (row - images * rows) * columns
            # Cells side by side are one run of discs, except across the period
            while column <= last_x:
                at = base + column - columns * _period_of(column, columns)
                run = min(last_x + 1 - column, base + columns - at)
                is_same, column = is_own and at == cell, column + run
                end = cell_start[at + run]
                for place in range(cell_start[cell], cell_start[cell + 1]):
                    x, y, r = sorted_x[place], sorted_y[place], sorted_radius[place] + cutoff
                    for p in range(place + 1 if is_same else cell_start[at], end):
                        dx, dy = shortest(x - sorted_x[p], y - sorted_y[p], period, height, tilt)
                        near = r + sorted_radius[p]
                        # Nobody could guess which are near: each is written, and the next over it
                        to = min(offset + found, last)
                        first[to], second[to] = cell_disc[place], cell_disc[p]
                        found += dx * dx + dy * dy < near * near
    if offset + found > last:
        return found
    return _name(grain_count, shape_of, first, second, offset, found)


@formula
def _name(
    grain_count: int, shape_of: Ints, first: Ints, second: Ints, offset: int, found: int
) -> int:
    """Turn pairs of two discs into those of a grain and a shape; returns how many are left."""
    kept = offset
    for p in range(offset, offset + found):
        lower, higher = min(first[p], second[p]), max(first[p], second[p])
        if lower < grain_count:  # else both are parts of walls
            is_grain = higher < grain_count
            first[kept] = lower
            second[kept] = higher if is_grain else shape_of[higher - grain_count]
            kept += 1
    return kept - offset


@subroutine
def _scan_shapes(
    begin: int, end: int, grain_count: int, sorted_x: Floats, sorted_y: Floats,
    sorted_radius: Floats, cell_disc: Ints, others: Ints, kind: Ints, world: Floats, cutoff: float,
    period: float, first: Ints, second: Ints, offset: int, last: int,
) -> int:  # fmt: skip
    """As `_scan_cell`, of the grains in places ``begin … end`` and the wall shapes ``others``."""
    found = 0
    for place in range(begin, end):
        x, y, i = sorted_x[place], sorted_y[place], cell_disc[place]
        for k in range(others.size if i < grain_count else 0):
            shape = others[k]
            if is_near_shape(x, y, sorted_radius[place], shape, kind, world, period, cutoff):
                to = min(offset + found, last)
                first[to], second[to] = i, grain_count + shape
                found += 1
    return found


@kernel
def _rows_of(
    grain_count: int, first: Ints, second: Ints, begin: NDArray[np.int64], count: NDArray[np.int64]
) -> tuple[NDArray[np.int64], Ints]:
    """Rows of the grains ``first``, with partners ascending, of ``count`` pairs in each chunk."""
    row = np.zeros(grain_count + 1, np.int64)
    for chunk in range(count.size):
        for p in range(begin[chunk], begin[chunk] + count[chunk]):
            row[first[p] + 1] += 1
    for grain in range(grain_count):
        row[grain + 1] += row[grain]
    fill, partner = row[:-1].copy(), np.empty(row[grain_count], np.int32)
    for chunk in range(count.size):
        for p in range(begin[chunk], begin[chunk] + count[chunk]):
            at, start, value = fill[first[p]], row[first[p]], second[p]
            fill[first[p]] += 1
            while at > start and partner[at - 1] > value:
                partner[at] = partner[at - 1]
                at -= 1
            partner[at] = value
    return row, partner


@parallel_kernel
def list_pairs(
    grain_count: int, shape_of: Ints, others: Ints, kind: Ints, world: Floats, cutoff: float,
    period: float, height: float, tilt: float, level_cells: Floats, level_radius: Floats,
    level_start: Ints, level_shape: Ints, cell_start: Ints, sorted_x: Floats, sorted_y: Floats,
    sorted_radius: Floats, cell_disc: Ints,
) -> tuple[NDArray[np.int64], Ints]:  # fmt: skip
    """All pairs with a gap below ``cutoff`` [m].

    Discs are the grains, then those of walls, whose shape numbers are ``shape_of``; ``others`` are
    the wall shapes that are not discs: both ascending. Levels and cells are those of `Grids`,
    ``cell_start`` and ``cell_disc`` from `bin_discs`, and ``sorted_…`` of the discs sorted by cell
    [m]. Returns ``row``, shape ``(n + 1,)``, and ``partner``: ``partner[row[i]:row[i+1]]`` are the
    shapes near grain i, ascending.
    """
    cells = cell_start.size - 1
    chunks = max(1, -(-cells // CHUNK))
    count = np.zeros(chunks, np.int64)
    for c in range(chunks):
        count[c] = ROOM * (cell_start[min(cells, (c + 1) * CHUNK)] - cell_start[c * CHUNK])
    begin, room = np.zeros(chunks + 1, np.int64), count.copy()
    first, second = np.empty(0, np.int32), np.empty(0, np.int32)
    is_full = True
    while is_full:  # once more where there was not room enough
        for c in range(chunks):
            begin[c + 1] = begin[c] + room[c] + 1  # one that is not near is written, too
        first, second = np.empty(begin[chunks], np.int32), np.empty(begin[chunks], np.int32)
        for number in prange(chunks):
            chunk: int = np.int64(number)  # type: ignore[assignment]  # unsigned, the functions below would be compiled once more
            found, last, k = 0, begin[chunk + 1] - 1, 0
            for cell in range(chunk * CHUNK, min(cells, (chunk + 1) * CHUNK)):
                while cell >= level_start[k + 1]:
                    k += 1
                if cell_start[cell] < cell_start[cell + 1]:
                    found += _scan_cell(
                        cell, k, grain_count, shape_of, cutoff, period, height, tilt, level_cells,
                        level_radius, level_start, level_shape, cell_start, sorted_x, sorted_y,
                        sorted_radius, cell_disc, first, second, begin[chunk] + found, last,
                    )  # fmt: skip
                if others.size:
                    found += _scan_shapes(
                        cell_start[cell], cell_start[cell + 1], grain_count, sorted_x, sorted_y,
                        sorted_radius, cell_disc, others, kind, world, cutoff, period, first,
                        second, begin[chunk] + found, last,
                    )  # fmt: skip
            count[chunk] = found
        is_full = False
        for c in range(chunks):
            is_full |= count[c] > room[c]
            room[c] = max(room[c], count[c])
    return _rows_of(grain_count, first, second, begin, count)


@kernel
def leave_out_unmet(
    row: NDArray[np.int64], partner: Ints, group: Ints, wall: Ints, meets: NDArray[np.bool_]
) -> tuple[NDArray[np.int64], Ints]:
    """A list without pairs of grains and walls that do not meet; ``meets`` is ``(w, g)``."""
    count, found = row.size - 1, 0
    kept_row, kept = np.zeros(row.size, np.int64), np.empty(partner.size, np.int32)
    for i in range(count):
        for p in range(row[i], row[i + 1]):
            j = partner[p]
            if j < count or meets[wall[j - count], group[i]]:
                kept[found] = j
                found += 1
        kept_row[i + 1] = found
    return kept_row, kept[:found].copy()


def find_near(
    grids: Grids, grain_count: int, center: Floats, radius: Floats, shape_of: Ints, others: Ints,
    kind: Ints, world: Floats, cutoff: float, period: float, height: float = 0.0, tilt: float = 0.0,
) -> tuple[NDArray[np.int64], Ints]:  # fmt: skip
    """All pairs with a gap below ``cutoff`` [m], whatever the grids; as `list_pairs`."""
    level, cells, largest, origin, start, shape = grids
    cell_start, cell_disc = bin_discs(center, level, cells, origin, start, shape)
    return list_pairs(
        grain_count, shape_of, others, kind, world, cutoff, period, height, tilt, cells, largest,
        start, shape, cell_start, center[cell_disc, X], center[cell_disc, Y],
        radius[cell_disc], cell_disc,
    )  # fmt: skip


class Around(NamedTuple):
    """The pairs of a list from both of their grains.

    Attributes:
        start: Rows of the grains, shape ``(n + 1,)``.
        other: The other shape, ascending within a row.
        owner: Grain in whose row of the list each pair is, shape ``(pairs,)``.
    """

    start: NDArray[np.int64]
    other: Ints
    owner: Ints


@kernel
def both_ways(row: NDArray[np.int64], partner: Ints) -> Around:
    """The pairs of a list, rows of grains with partners of higher numbers, from both sides."""
    grains = row.size - 1
    start = np.zeros(grains + 1, np.int64)
    for i in range(grains):
        start[i + 1] += row[i + 1] - row[i]
        for p in range(row[i], row[i + 1]):
            if partner[p] < grains:
                start[partner[p] + 1] += 1
    for i in range(grains):
        start[i + 1] += start[i]
    fill = start[:-1].copy()
    other, owner = np.empty(start[grains], np.int32), np.empty(partner.size, np.int32)
    for i in range(grains):  # those of lower numbers come first, in order
        for p in range(row[i], row[i + 1]):
            owner[p] = i
            if partner[p] < grains:
                other[fill[partner[p]]] = i
                fill[partner[p]] += 1
    for i in range(grains):
        for p in range(row[i], row[i + 1]):
            other[fill[i]] = partner[p]
            fill[i] += 1
    return Around(start, other, owner)


# ---- The list that is kept

OUTSIDE = 0.005  # share of the grains on each side that a grid may leave outside
SKIN = 0.4  # of the mean diameter: what is listed beyond the cutoff of a step


class NeighborList:
    """All pairs of shapes closer than a cutoff, with a skin that lets the list serve many steps.

    A grain and a wall that its group does not meet are never a pair: no contact, no heat and no
    correction joins them. The list is only a superset of the contacts of a step: results do not
    depend on its age.

    Attributes:
        row: Rows of the grains, shape ``(n + 1,)``.
        partner: Shapes near each grain, ascending within a row.
        complete: Gap up to which all pairs are listed, at the positions of the last update [m].
        builds: How often the list was built.
        largest: Largest diameter of a disc [m].
    """

    def __init__(self, model: Model) -> None:
        self._model = model
        kind = model.shapes.kind
        self._disc_shapes = np.flatnonzero(kind == ShapeKind.DISC).astype(np.int32)
        self._others = np.flatnonzero(kind != ShapeKind.DISC).astype(np.int32)
        self._planes = np.flatnonzero(kind == ShapeKind.PLANE)
        self._shape_of = (model.grain_count + self._disc_shapes).astype(np.int32)
        self._radius = np.concatenate(
            [model.grains.radius, model.shapes.geometry[self._disc_shapes, RADIUS]]
        )
        self.largest = 2.0 * float(self._radius.max())
        self._largest_disc = float(self._radius[model.grain_count :].max(initial=0.0))
        self._grown: Floats | None = None
        self._classes = classify(self._radius)
        self._skin = SKIN * model.mean_diameter
        self._cutoff = -1.0
        self._reference = np.empty((0, 2))
        self._reference_world = np.empty((0, 4))
        self._reference_box = 0.0, 0.0, 0.0
        self._extent = 0.0
        self.row: NDArray[np.int64] = np.zeros(model.grain_count + 1, np.int64)
        self.partner: Ints = np.empty(0, np.int32)
        self._around: Around | None = None
        self.complete = -1.0
        self.builds = 0

    @property
    def around(self) -> Around:
        """The listed pairs from both sides."""
        if self._around is None:
            self._around = both_ways(self.row, self.partner)
        return self._around

    def note_radii(self, radius: Floats) -> None:
        """Take up radii of grains that grow [m], shape ``(n,)``."""
        self._grown = radius
        self.largest = 2.0 * max(float(radius.max()), self._largest_disc)

    @property
    def made_at(self) -> tuple[Floats, Floats, float, float, float]:
        """What `approach_of_displacements` is to know of the list, and the gap up to which it went.

        Places of grains and shapes of walls, their extent, and the distance of what is not listed.
        """
        distance = self.largest + self._cutoff
        return self._reference, self._reference_world, self._extent, distance, self._cutoff

    def update(self, scene: Scene, cutoff: float) -> None:
        """Make sure that all pairs with a gap below ``cutoff`` [m] are listed."""
        if self._cutoff >= 0.0:
            self.complete = self._cutoff - self._approach(scene)
            if self._grown is not None:
                growth = self._grown - self._radius[: self._grown.size]
                self.complete -= 2.0 * max(float(growth.max()), 0.0)
        if self.complete < cutoff:
            self.complete = cutoff + self._skin
            self._build(scene, self.complete)

    def _approach(self, scene: Scene) -> float:
        """How much closer than when the list was built any pair that is not listed may be [m]."""
        reference, box = self._reference, Box(scene.period)
        if scene.height > 0.0:
            width, height, tilt = self._reference_box
            wider = scene.period / width
            box = Box(
                scene.period, scene.height, scene.tilt, wider - 1.0, scene.height / height - 1.0,
                (scene.tilt - wider * tilt) / height,
            )  # fmt: skip
        # Those not listed are at least this far apart; farther apart they have more room to lose.
        distance, before = self.largest + self._cutoff, self._reference_world
        return approach_of_displacements(
            scene.kind, scene.position, reference, box, before, scene.world, self._extent, distance
        )

    def _build(self, scene: Scene, cutoff: float) -> None:
        model, position, world = self._model, scene.position, scene.world
        if self._grown is not None:
            self._radius[: self._grown.size] = self._grown
            self._classes = classify(self._radius)
        period, height, tilt = self._reference_box = scene.period, scene.height, scene.tilt
        centers, low, high = centers_between(
            position, world, self._disc_shapes, period, height, tilt
        )
        diagonal = arithmetic.hypot(*(high - low).tolist())
        low, high = self._box(centers, low, high, cutoff)
        grids = make_grids(self._classes, low, high, period, cutoff, height)
        shapes = model.shapes
        self.row, self.partner = find_near(
            grids, model.grain_count, centers, self._radius, self._shape_of, self._others,
            shapes.kind, world, cutoff, period, height, tilt,
        )  # fmt: skip
        if model.walls.meets.size:
            self.row, self.partner = leave_out_unmet(
                self.row, self.partner, model.grains.group, shapes.wall, model.walls.meets
            )
        self._around = None
        self._cutoff = cutoff
        self._reference = position[:, :2].copy()
        self._reference_world = world.copy()
        # Planes pass anywhere: their lever is the farthest grain from any of their points.
        self._extent = diagonal + float(np.abs(world[self._planes, :2]).max(initial=0.0))
        self.builds += 1

    def _box(
        self, centers: Floats, low: Floats, high: Floats, cutoff: float
    ) -> tuple[Floats, Floats]:
        """Corners of what the grids cover. What lies beyond is found in the cells at the edge."""
        if cell_count(high - low, 2.0 * float(self._classes.radius.min()) + cutoff) > cells_for(
            len(centers)
        ):
            # A few grains far away must not make all cells large, and all grains neighbors.
            few = int(OUTSIDE * len(centers))
            low, high = np.partition(centers, (few, len(centers) - 1 - few), axis=0)[
                [few, -1 - few]
            ]
        return low, high
