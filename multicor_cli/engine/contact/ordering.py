"""The order in which contacts are relaxed: tiles in four colors, batches of four, a schedule.

The order is a pure function of the contacts and positions of the step, hence the same for any
number of threads. Tiles are square; those of one color share no body. Within a tile the contacts
are ordered by key, which keeps the propagation of a serial sweep, cut into `STREAMS` parts from
which one contact is taken in turn: neighbors by key share a grain, and could not lie in one batch.
Tiles also keep the bodies of a thread in its cache. Contacts with fixed or prescribed walls do not
tie tiles together. Crowded grains (many contacts) come last, serially.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.contact.sweep import System
from multicor_cli.engine.contact.vector_step import ABOUT_ROWS, SMALLER
from multicor_cli.engine.geometry.scene import Scene, pair_geometry
from multicor_cli.engine.jit.arrays import aligned
from multicor_cli.engine.jit.compile import kernel, loop_body
from multicor_cli.engine.jit.vectors import LANES
from multicor_cli.model.columns import FIRST, MASS, SECOND, X, Y
from multicor_cli.model.model import Floats, Ints

MANY = 16  # contacts of a grain from which on they are crowded: relaxed serially

TILED, CROWDED, GENERAL, FACE = 0, 1, 2, 3
"""Classes of contacts; those of grains that are no discs (`engine/contact/faces.py`) are faces."""

_NONE = np.empty(0, np.int32)
_NOWHERE = -(1 << 31)  # the lane of what lies in none
COLORS = 4
STREAMS = 4  # parts of a tile whose contacts take turns


@kernel
def classify_contacts(
    scene: Scene, i: Ints, j: Ints, wall_is_free: NDArray[np.bool_], classes: NDArray[np.int8]
) -> None:
    """How each contact is relaxed, into ``classes``, **modified**, shape ``(c,)``.

    `TILED`, `CROWDED`, or `GENERAL`: with a wall that has a free degree of freedom. What has a
    `FACE` is none of this.
    """
    n = scene.radius.size
    degree = np.zeros(n, np.int32)
    for c in range(i.size):
        if classes[c] == FACE:
            continue
        degree[i[c]] += 1
        if j[c] < n:
            degree[j[c]] += 1
    for c in range(i.size):
        if classes[c] == FACE:
            continue
        if j[c] >= n:
            if wall_is_free[scene.wall[j[c] - n]]:
                classes[c] = GENERAL
            elif degree[i[c]] > MANY:
                classes[c] = CROWDED
        elif degree[i[c]] > MANY or degree[j[c]] > MANY:
            classes[c] = CROWDED


@kernel
def span_of(scene: Scene, i: Ints, j: Ints) -> float:
    """Largest distance between the centers of two grains in contact [m]."""
    span = 0.0
    for c in range(i.size):
        if j[c] < scene.radius.size:
            reach = scene.radius[i[c]] + scene.radius[j[c]]
            span = max(span, reach + pair_geometry(scene, i[c], j[c])[0])
    return span


@kernel
def extent_of(position: Floats) -> tuple[float, float, float, float]:
    """Least and largest x, least and largest y of grains."""
    left, right, bottom, top = np.inf, -np.inf, np.inf, -np.inf
    for i in range(position.shape[0]):
        x, y = position[i, X], position[i, Y]
        left, right = min(left, x), max(right, x)
        bottom, top = min(bottom, y), max(top, y)
    return left, right, bottom, top


@kernel
def color_tiles(columns: int, rows: int) -> NDArray[np.int64]:
    """First tile of each color, shape ``(COLORS + 1,)``: tiles are numbered color by color."""
    half_x, half_y = (columns + 1) // 2, (rows + 1) // 2
    start = np.zeros(COLORS + 1, np.int64)
    for color in range(COLORS):
        wide = half_x if color % 2 == 0 else columns - half_x
        high = half_y if color // 2 == 0 else rows - half_y
        start[color + 1] = start[color] + wide * high
    return start


@kernel
def tiles_of(
    position: Floats, corner: Floats, width: float, height: float, columns: int, rows: int
) -> Ints:
    """Column and row of the tile of each grain, shape ``(n, 2)``.

    Tiles of ``width`` and ``height`` [m] begin at a ``corner``; with a period ``columns`` (in a
    cell ``rows`` too) are even or 1.
    """
    tile = np.empty((position.shape[0], 2), np.int32)
    for i in range(position.shape[0]):
        tile[i, X] = min(max(int((position[i, X] - corner[X]) / width), 0), columns - 1)
        tile[i, Y] = min(max(int((position[i, Y] - corner[Y]) / height), 0), rows - 1)
    return tile


@kernel
def assign_tiles(
    i: Ints, classes: NDArray[np.int8], tile: Ints, color_start: NDArray[np.int64], columns: int
) -> Ints:
    """Tile of each contact, shape ``(c,)``: of its grain i; the next if crowded, -1 if general.

    ``tile`` is from `tiles_of`, ``classes`` from `classify_contacts`.
    """
    half_x = (columns + 1) // 2
    found = np.empty(i.size, np.int32)
    for c in range(i.size):
        if classes[c] == TILED:
            tx, ty = tile[i[c], X], tile[i[c], Y]
            wide = half_x if tx % 2 == 0 else columns - half_x
            found[c] = color_start[tx % 2 + 2 * (ty % 2)] + (ty // 2) * wide + tx // 2
        else:
            found[c] = color_start[COLORS] if classes[c] == CROWDED else -1
    return found


@kernel
def order_contacts(tile: Ints, tiles: int) -> tuple[Ints, Ints, NDArray[np.int64]]:
    """Diagonal contacts by tile, crowded ones last, and key; general ones; the starts of tiles."""
    start = np.zeros(tiles + 1, np.int64)
    for c in range(tile.size):
        if tile[c] >= 0:
            start[tile[c] + 1] += 1
    for t in range(tiles):
        start[t + 1] += start[t]
    fill = start[:-1].copy()
    order = np.empty(start[-1], np.int32)
    general = np.empty(tile.size - start[-1], np.int32)
    found = 0
    for c in range(tile.size):
        if tile[c] >= 0:
            order[fill[tile[c]]] = c
            fill[tile[c]] += 1
        else:
            general[found] = c
            found += 1
    _interleave(order, start[:-1])
    return order, general, start


@kernel
def _interleave(order: Ints, start: NDArray[np.int64]) -> None:
    """Deal each tile out to `STREAMS` parts of equal length and take one from each in turn."""
    longest = 0
    for t in range(start.size - 1):
        longest = max(longest, start[t + 1] - start[t])
    tile = np.empty(longest, np.int32)
    for t in range(start.size - 1):
        first, count = start[t], start[t + 1] - start[t]
        for r in range(count):
            tile[r] = order[first + r]
        length = -(-count // STREAMS)
        k = first
        for r in range(length):
            for stream in range(STREAMS):
                place = stream * length + r
                if place < min(count, (stream + 1) * length):
                    order[k] = tile[place]
                    k += 1


@kernel
def number_bodies(
    i: Ints, j: Ints, order: Ints, general: Ints, grains: int, walls: int
) -> tuple[Ints, Ints, int]:
    """Rows of the bodies: grains in the order in which the sweep first meets them, walls, proxies.

    However grains are numbered, a tile then reads and writes one piece of memory: three times
    faster where the velocities of all grains do not fit into the caches. A prescribed wall is
    replaced by one *proxy* per contact: a body of infinite mass that has the velocity of the wall
    at the contact. The sweep then needs no branch, and no two contacts share a proxy.

    ``order`` are the diagonal contacts in the order of the sweep, shape ``(k,)``. Returns the row
    of each grain; the rows of the bodies of ``order``, shape ``(k, 2)``; and the number of rows.
    """
    place = np.full(grains, -1, np.int32)
    pair = np.empty((order.size, 2), np.int32)
    found, rows = 0, grains + walls
    for k in range(order.size):
        first, second = i[order[k]], j[order[k]]
        if place[first] < 0:
            place[first] = found
            found += 1
        pair[k, FIRST] = place[first]
        if second >= grains:
            pair[k, SECOND] = rows
            rows += 1
            continue
        if place[second] < 0:
            place[second] = found
            found += 1
        pair[k, SECOND] = place[second]
    for k in range(general.size):
        for body in (i[general[k]], j[general[k]]):
            if body < grains and place[body] < 0:
                place[body] = found
                found += 1
    for grain in range(grains):  # those that touch nothing
        if place[grain] < 0:
            place[grain] = found
            found += 1
    return place, pair, rows


# ---- Batches of four diagonal contacts that share no body, for the vector loops.
#
# The order of the sweep is kept: a contact goes into the first batch with an empty lane that comes
# `SPACING` batches or more after the last one with one of its bodies. Contacts that share no body
# commute, so the iterates are those of a sweep contact by contact in the given order. (The order
# above, four places of a tile in turn, fills 96 to 99 % of the lanes.)

SPACING = 3
"""A body comes again after so many batches at the earliest.

The vector sweep gathers a batch before the last one is applied, which asks for 2; with 3 it waits
less (by a tenth), with 4 more lanes are empty.
"""


class _Work(NamedTuple):
    """Work space of the schedule: the first batch that each body may come in (else zeros), filled
    lanes of batches, and where to look for an empty lane from each batch on.
    """

    ready: Ints
    filled: Ints
    following: Ints


@loop_body
def _open(batch: int, base: int, slot: Ints, work: _Work) -> None:
    work.filled[batch], work.following[batch] = 0, batch
    for lane in range(LANES):
        slot[base + batch, lane] = -1


@kernel
def _schedule(pair: Ints, first: int, last: int, base: int, slot: Ints, work: _Work) -> int:
    """Write contacts ``first … last-1`` of a tile to ``slot[base:]``; returns how many batches."""
    ready, filled, following = work.ready, work.filled, work.following
    count = 0
    for k in range(first, last):
        i, j = pair[k, FIRST], pair[k, SECOND]
        allowed = max(ready[i], ready[j])
        while count <= allowed:
            _open(count, base, slot, work)
            count += 1
        free = allowed
        while following[free] != free:
            free = following[free]
            if free == count:
                _open(count, base, slot, work)
                count += 1
        at = allowed
        while at != free:  # a shorter way for those who come later
            after = following[at]
            following[at] = free
            at = after
        slot[base + free, filled[free]] = k
        filled[free] += 1
        if filled[free] == LANES:
            following[free] = free + 1
        ready[i] = ready[j] = free + SPACING
    while 0 < count < SPACING:
        _open(count, base, slot, work)
        count += 1
    for k in range(first, last):
        ready[pair[k, FIRST]] = ready[pair[k, SECOND]] = 0
    return count


@kernel
def make_batches(
    pair: Ints, tile_start: NDArray[np.int64], bodies: int
) -> tuple[Ints, NDArray[np.int64]]:
    """Batches of the contacts of each tile, from the rows ``(k, 2)`` of their bodies, in order.

    Returns the contact in each lane, -1 if there is none, shape ``(q, 4)``, and the first batch of
    each tile, shape ``(tiles + 1,)``.
    """
    longest = 0
    for t in range(tile_start.size - 1):
        longest = max(longest, tile_start[t + 1] - tile_start[t])
    room = SPACING * longest + 1
    work = _Work(np.zeros(bodies, np.int32), np.empty(room, np.int32), np.empty(room, np.int32))
    # Room for the worst case; what is not needed is never touched.
    slot = np.empty((SPACING * (pair.shape[0] + tile_start.size), LANES), np.int32)
    start = np.zeros(tile_start.size, np.int64)
    for t in range(tile_start.size - 1):
        start[t + 1] = start[t] + _schedule(
            pair, tile_start[t], tile_start[t + 1], start[t], slot, work
        )
    return slot[: start[-1]].copy(), start


@kernel
def fill_lanes(
    order: Ints, bodies: Ints, rows: int, tile_start: NDArray[np.int64], slot: Ints, pair: Ints
) -> None:
    """Put contacts and their bodies into their lanes: ``slot`` and ``pair`` are **modified**.

    ``order`` are the contacts in the order of the sweep, ``bodies`` their rows. Two more rows are
    for the empty lanes of each tile: no two tiles share a body. ``slot`` has ranks at first.
    """
    for t in range(tile_start.size - 1):
        for q in range(tile_start[t], tile_start[t + 1]):
            for lane in range(LANES):
                k = slot[q, lane]
                if k >= 0:
                    slot[q, lane] = order[k]
                    pair[q, FIRST, lane], pair[q, SECOND, lane] = (
                        4 * bodies[k, FIRST],
                        4 * bodies[k, SECOND],
                    )
                else:
                    pair[q, FIRST, lane], pair[q, SECOND, lane] = (
                        4 * (rows + 2 * t),
                        4 * (rows + 2 * t + 1),
                    )


# ---- Schedules: everything about a sweep that forces and velocities do not change

TILE = 16.0  # width of a tile in mean diameters: a few hundred contacts


class Schedule(NamedTuple):
    """Order and places of contacts, and room for what a step says of them, as long as they last.

    What is not listed is as in `System`.

    Attributes:
        general: General contacts, shape ``(g,)``.
        walls: Diagonal contacts with walls, ascending.
        of_walls: All contacts with walls: these, and then the general ones.
        lane: Lane of each contact, -1 - g for the general contact g, less for faces, ``(c,)``.
        place: Row of each grain, shape ``(n,)``; then come the walls, then the wall proxies, and
            two rows for the empty lanes of each tile.
        start: Velocities v⁻ of these rows.
        middle: Places at q_m: x, y, radius [m], 0.
        about: What lasts with a contact, rows as in `vector_step`, shape ``(q, 3, 4)``.
        before: u_n⁻, u_t⁻ [m/s], shape ``(q, 2, 4)``.
        gap: Gaps at q_m [m], shape ``(q, 4)``.
        branch: Branch vectors at q_m in a cell [m], shape ``(q, 2, 4)``; else no batches.
        of_general: Rows of the general contacts of discs, as in `System`: bodies, frames, levers
            and impulses.
        face_order: Faces in the order of their sweep, shape ``(f,)``: a step makes batches of those
            that have a point (`faces.batch_points`).
        face_pair: Rows of their bodies, shape ``(f, 2)``.
        face_start: First of them of each tile, shape ``(tiles + 1,)``.
        face_rest: Faces with walls that have a free degree of freedom.
    """

    slot: Ints
    pair: Ints
    tile_start: NDArray[np.int64]
    color_start: NDArray[np.int64]
    general: Ints
    walls: Ints
    of_walls: Ints
    lane: Ints
    place: Ints
    velocity: Floats
    start: Floats
    middle: Floats
    frame: Floats
    impulse: Floats
    about: Floats
    before: Floats
    gap: Floats
    branch: Floats
    inverse: Floats
    of_general: tuple[Ints, Floats, Floats, Floats]
    face_order: Ints
    face_pair: Ints
    face_start: NDArray[np.int64]
    face_rest: Ints

    def system(self, spin_factor: float, contacts: int) -> System:
        """The `System` of discs without couples; ``spin_factor`` and ``contacts`` as there."""
        return System(
            self.velocity, self.inverse, self.slot, self.pair, self.frame, self.impulse,
            self.tile_start, self.color_start, *self.of_general, spin_factor, contacts,
        )  # fmt: skip


def lay_tiles(scene: Scene, i: Ints, j: Ints, mean_diameter: float) -> Ints:
    """Column and row of the tile of each grain, shape ``(n, 2)``, for contacts with these shapes.

    No two tiles of one color have a grain in common, wherever these contacts go.
    """
    columns, rows, corner, width, height = _grid(
        scene, max(TILE * mean_diameter, 2.2 * span_of(scene, i, j))
    )
    return tiles_of(_upright(scene), corner, width, height, columns, rows)


def _upright(scene: Scene) -> Floats:
    """Positions, shape ``(n, 2)`` or more; in a cell wrapped, and where they were without tilt."""
    if scene.height == 0.0:
        return scene.position
    x, y = scene.position[:, X], scene.position[:, Y]
    up = np.floor(y / scene.height)
    x, y = x - up * scene.tilt, y - up * scene.height
    x = x - scene.tilt * (y / scene.height)
    return np.column_stack([x - scene.period * np.floor(x / scene.period), y])


def schedule_contacts(
    scene: Scene, i: Ints, j: Ints, tile: Ints, wall_is_free: NDArray[np.bool_],
    is_face: NDArray[np.bool_] | None = None,
) -> Schedule:  # fmt: skip
    """The schedule of contacts with these shapes, sorted by key; ``tile`` is from `lay_tiles`.

    ``wall_is_free`` marks walls that loads move, ``is_face`` contacts of grains that are no discs.
    """
    columns, rows = (tile.max(axis=0) + 1).tolist()
    color_start = color_tiles(columns, rows)
    classes = np.zeros(i.size, np.int8)
    if is_face is not None:
        classes[is_face] = FACE
    classify_contacts(scene, i, j, wall_is_free, classes)
    of_contact = assign_tiles(i, classes, tile, color_start, columns)
    tiles, grains = int(color_start[-1]) + 1, scene.radius.size
    order, general, start = order_contacts(of_contact, tiles)
    of_faces, face_start, rest = _NONE, np.zeros(tiles + 1, np.int64), _NONE
    if is_face is not None:
        general = general[~is_face[general]]
        stands, with_walls = np.ones(i.size, np.bool_), j >= grains
        stands[with_walls] = ~wall_is_free[scene.wall[j[with_walls] - grains]]
        classes[is_face & stands] = TILED
        classes[~is_face] = GENERAL
        of_face = assign_tiles(i, classes, tile, color_start, columns)
        of_faces, _, face_start = order_contacts(of_face, tiles)
        rest = np.flatnonzero(is_face & ~stands).astype(np.int32)
    place, bodies, count = number_bodies(
        i, j, np.concatenate([order, of_faces]), general, grains, wall_is_free.size
    )
    slot, tile_start = make_batches(bodies[: order.size], start, count)
    pair = aligned((slot.shape[0], 2, LANES), np.int32)
    fill_lanes(order, bodies, count, tile_start, slot, pair)
    batches, rows = slot.shape[0], count + 2 * (tile_start.size - 1)
    velocity, start_velocity, middle, frame, impulse, about, before, gap, branch = (
        _zeros(shape)
        for shape in (
            (rows, 4), (rows, 4), (rows, 4), (batches, 5, LANES), (batches, 2, LANES),
            (batches, ABOUT_ROWS, LANES), (batches, 2, LANES), (batches, LANES),
            (batches if scene.height > 0.0 else 0, 2, LANES),
        )
    )  # fmt: skip
    middle[count + 1 :: 2, X] = 1.0  # the two bodies of empty lanes are apart
    frame[:, MASS] = about[:, SMALLER] = 1.0
    lane = np.empty(i.size, np.int32)
    filled = np.flatnonzero(slot.reshape(-1) >= 0).astype(np.int32)
    lane[slot.reshape(-1)[filled]] = filled
    if is_face is not None:
        lane[is_face] = _NOWHERE
    lane[general] = -1 - np.arange(general.size, dtype=np.int32)
    of_general = (
        np.zeros((general.size, 2), np.int32), np.zeros((general.size, 8)),
        np.zeros((general.size, 2, 2)), np.zeros((general.size, 2)),
    )  # fmt: skip
    walls = np.flatnonzero((j >= scene.radius.size) & (lane >= 0)).astype(np.int32)
    return Schedule(
        slot, pair, tile_start, color_start, general, walls, np.concatenate([walls, general]), lane,
        place, velocity, start_velocity, middle, frame, impulse, about, before, gap, branch,
        np.empty((grains + wall_is_free.size, 3)), of_general,
        of_faces, bodies[order.size :].copy(), face_start, rest,
    )  # fmt: skip


def _zeros(shape: tuple[int, ...]) -> Floats:
    array = aligned(shape)
    array[:] = 0.0
    return array


def _grid(scene: Scene, width: float) -> tuple[int, int, Floats, float, float]:
    left, right, bottom, top = extent_of(scene.position)
    low = np.array([left, bottom])
    size = np.array([right - left, top - bottom])
    if scene.period > 0.0:
        low[X], size[X] = 0.0, scene.period
    if scene.height > 0.0:
        low[Y], size[Y] = 0.0, scene.height
    limit = max(4, scene.radius.size)  # grains that fly far away must not make the grid large
    rows = min(max(1, int(size[Y] / width)), limit)
    columns = min(max(1, int(size[X] / width)), limit)
    if scene.height > 0.0:  # tiles lean, and are narrower across than along
        slope = scene.tilt / scene.height
        columns = max(1, int(size[X] / (width * math.sqrt(1.0 + slope * slope))))
    while rows * columns > limit:
        rows, columns = max(1, rows // 2), max(1, columns // 2)
    if scene.period > 0.0 and columns > 1:
        columns -= columns % 2
    if scene.height > 0.0 and rows > 1:
        rows -= rows % 2
    return columns, rows, low, max(size[X], width) / columns, max(size[Y], width) / rows
