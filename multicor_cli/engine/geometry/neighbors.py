"""Neighbor list: all pairs of shapes whose gap is below a cutoff, in O(N) time and memory for any mixture of sizes.

Discs are binned on several grids, one per class of radii (factor two), so that a few large grains do not make the cells of the
small ones large. Each grain owns the row of its partners with a higher shape number.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.geometry.gaps import is_near_shape, minimum_image
from multicor_cli.engine.geometry.grids import Grids
from multicor_cli.engine.jit.chunks import CHUNK
from multicor_cli.engine.jit.compile import kernel, parallel_kernel, prange
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.model.columns import X, Y
from multicor_cli.model.model import Floats, Ints

CROWDED = 100  # discs side by side in cells, above which those near a grain are counted one by one


@kernel
def bin_discs(
    center: Floats, level: Ints, level_cells: Floats, origin: Floats, level_start: Ints, level_shape: Ints
) -> tuple[Ints, Ints]:
    """Sort discs into the cells of their level.

    Args:
        center: Centers [m], shape ``(d, 2)``.
        level: Grid of each disc, shape ``(d,)``.
        level_cells: Cell width and height of each level [m], shape ``(levels, 2)``.
        origin: Lower left corner of all grids [m], shape ``(2,)``.
        level_start: Number of the first cell of each level, shape ``(levels + 1,)``.
        level_shape: Number of cells in x and y of each level, shape ``(levels, 2)``.

    Returns:
        Start of each cell in the sorted list, shape ``(cells + 1,)``, and the discs sorted by cell (ascending within a cell).
    """
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
def _scan_row(
    i: int,
    grain_count: int,
    center: Floats,
    radius: Floats,
    shape_of: Ints,
    cutoff: float,
    period: float,
    level_cells: Floats,
    level_radius: Floats,
    origin: Floats,
    level_start: Ints,
    level_shape: Ints,
    cell_start: Ints,
    sorted_x: Floats,
    sorted_y: Floats,
    sorted_radius: Floats,
    cell_disc: Ints,
    out: Ints,
    offset: int,
) -> int:
    """Partners of grain ``i`` with a higher number go to ``out[offset:]``; returns how many.

    With a negative ``offset`` only a bound of their number is returned: all discs in the cells around, unless these are crowded
    (one grain that has flown far away makes all cells large).
    """
    found = 0
    x, y, r = center[i, X], center[i, Y], radius[i]
    for k in range(level_radius.size):
        reach = r + level_radius[k] + cutoff
        columns, rows = level_shape[k, X], level_shape[k, Y]
        first_y = max(int(np.floor((y - reach - origin[Y]) / level_cells[k, Y])), 0)
        last_y = min(int(np.floor((y + reach - origin[Y]) / level_cells[k, Y])), rows - 1)
        # Cells beyond the last row or column are merged into it, so a disc outside the grid is still found there.
        first_y = min(first_y, rows - 1)
        last_y = max(last_y, 0)
        first_x = int(np.floor((x - reach - origin[X]) / level_cells[k, X]))
        last_x = int(np.floor((x + reach - origin[X]) / level_cells[k, X]))
        if period > 0.0:
            last_x = min(last_x, first_x + columns - 1)
        else:
            first_x = min(max(first_x, 0), columns - 1)
            last_x = max(min(last_x, columns - 1), 0)
        for cy in range(first_y, last_y + 1):
            base = level_start[k] + cy * columns
            column = first_x
            while column <= last_x:  # cells side by side are one run of discs, except across the period
                cx = column % columns if period > 0.0 else column
                run = min(last_x + 1 - column, columns - cx)
                column += run
                first, last = cell_start[base + cx], cell_start[base + cx + run]
                if offset < 0 and last - first <= CROWDED:
                    found += last - first
                    continue
                for place in range(first, last):
                    other = cell_disc[place]
                    dx = minimum_image(x - sorted_x[place], period)
                    dy = y - sorted_y[place]
                    near = r + sorted_radius[place] + cutoff
                    if other > i and dx * dx + dy * dy < near * near:
                        if offset >= 0:
                            out[offset + found] = other if other < grain_count else shape_of[other - grain_count]
                        found += 1
    return found


@kernel
def _scan_shapes(
    i: int,
    grain_count: int,
    center: Floats,
    radius: Floats,
    others: Ints,
    kind: Ints,
    world: Floats,
    cutoff: float,
    period: float,
    out: Ints,
    offset: int,
) -> int:
    """As `_scan_row`, for the wall shapes that are not discs: ``others``, ascending."""
    found = 0
    for k in range(others.size):
        shape = others[k]
        if is_near_shape(center[i, X], center[i, Y], radius[i], shape, kind, world, period, cutoff):
            if offset >= 0:
                out[offset + found] = grain_count + shape
            found += 1
    return found


@formula
def _sort(values: Ints, first: int, last: int) -> None:
    """Insertion sort of ``values[first:last]``: rows are short."""
    for k in range(first + 1, last):
        value = values[k]
        m = k - 1
        while m >= first and values[m] > value:
            values[m + 1] = values[m]
            m -= 1
        values[m + 1] = value


@parallel_kernel
def list_pairs(
    grain_count: int,
    center: Floats,
    radius: Floats,
    shape_of: Ints,
    others: Ints,
    kind: Ints,
    world: Floats,
    cutoff: float,
    period: float,
    level_cells: Floats,
    level_radius: Floats,
    origin: Floats,
    level_start: Ints,
    level_shape: Ints,
    cell_start: Ints,
    sorted_x: Floats,
    sorted_y: Floats,
    sorted_radius: Floats,
    cell_disc: Ints,
) -> tuple[Ints, Ints]:
    """All pairs with a gap below ``cutoff`` [m]; see `bin_discs` for the grids.

    Args:
        grain_count: Number of grains; they are the first discs.
        center: Centers of all discs, grains first, then the discs of walls [m], shape ``(d, 2)``.
        radius: Radii of all discs [m], shape ``(d,)``.
        shape_of: Shape number of each wall disc, ascending, shape ``(d - n,)``.
        others: Wall shapes that are not discs, ascending.
        kind: `ShapeKind` of the wall shapes, shape ``(m,)``.
        world: Their geometry in the world [m], shape ``(m, 4)``.
        cutoff: Largest gap of interest [m].
        period: Period in x [m] or 0.
        level_cells: Cell sizes [m], shape ``(levels, 2)``.
        level_radius: Largest radius of each level [m], shape ``(levels,)``.
        origin: Corner of the grids [m], shape ``(2,)``.
        level_start: First cell of each level, shape ``(levels + 1,)``.
        level_shape: Cells in x and y, shape ``(levels, 2)``.
        cell_start: Start of each cell in ``cell_disc``.
        sorted_x: x of the discs sorted by cell.
        sorted_y: Their y.
        sorted_radius: Their radii.
        cell_disc: Discs sorted by cell.

    Returns:
        ``row`` of shape ``(n + 1,)`` and ``partner``: the shapes near grain i, ascending, are ``partner[row[i]:row[i+1]]``.
    """
    row = np.zeros(grain_count + 1, np.int64)
    chunks = max(1, -(-grain_count // CHUNK))
    begin = np.zeros(chunks + 1, np.int64)
    found_pairs = np.empty(0, np.int32)
    # The same loop first finds how much room each chunk of grains needs at most, then fills its part from the start on.
    for is_writing in range(2):
        for number in prange(chunks):
            chunk: int = np.int64(number)  # type: ignore[assignment]  # unsigned, the functions below would be compiled once more
            at = int(begin[chunk]) if is_writing else -1
            room = 0
            for grain in range(chunk * CHUNK, min(grain_count, (chunk + 1) * CHUNK)):
                found = _scan_row(
                    grain, grain_count, center, radius, shape_of, cutoff, period, level_cells, level_radius, origin, level_start,
                    level_shape, cell_start, sorted_x, sorted_y, sorted_radius, cell_disc, found_pairs, at,
                )  # fmt: skip
                beyond = at + found if is_writing else -1
                found += _scan_shapes(grain, grain_count, center, radius, others, kind, world, cutoff, period, found_pairs, beyond)
                if is_writing:
                    _sort(found_pairs, at, at + found)
                    row[grain + 1] = found
                    at += found
                room += found
            if not is_writing:
                begin[chunk + 1] = room
        if not is_writing:
            for chunk in range(chunks):
                begin[chunk + 1] += begin[chunk]
            found_pairs = np.empty(begin[chunks], np.int32)
    for grain in range(grain_count):
        row[grain + 1] += row[grain]
    partner = np.empty(row[grain_count], np.int32)
    for chunk in range(chunks):
        begin_row = row[chunk * CHUNK]
        for p in range(row[min(grain_count, (chunk + 1) * CHUNK)] - begin_row):
            partner[begin_row + p] = found_pairs[begin[chunk] + p]
    return row, partner


@kernel
def leave_out_unmet(
    row: NDArray[np.int64], partner: Ints, group: Ints, wall: Ints, meets: NDArray[np.bool_]
) -> tuple[NDArray[np.int64], Ints]:
    """A list without the pairs of grains and walls that do not meet.

    Args:
        row: From `find_near`, shape ``(n + 1,)``.
        partner: From `find_near`.
        group: Group of each grain, shape ``(n,)``.
        wall: Wall of each wall shape, shape ``(m,)``.
        meets: Which groups meet each wall, shape ``(w, g)``.
    """
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
    grids: Grids,
    grain_count: int,
    center: Floats,
    radius: Floats,
    shape_of: Ints,
    others: Ints,
    kind: Ints,
    world: Floats,
    cutoff: float,
    period: float,
) -> tuple[NDArray[np.int64], Ints]:
    """All pairs with a gap below ``cutoff`` [m], whatever the grids are; arguments and result as of `list_pairs`."""
    _, cells, largest, origin, start, shape = grids
    cell_start, cell_disc = bin_discs(center, grids.level, cells, origin, start, shape)
    row, partner = list_pairs(
        grain_count, center, radius, shape_of, others, kind, world, cutoff, period,
        cells, largest, origin, start, shape, cell_start,
        center[cell_disc, X], center[cell_disc, Y], radius[cell_disc], cell_disc,
    )  # fmt: skip
    return row.astype(np.int64, copy=False), partner
