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

from multicor_cli.engine.contact.late import NOWHERE, SPACING, contacts_with_walls, place_late
from multicor_cli.engine.contact.sweep import System
from multicor_cli.engine.contact.vector_step import ABOUT_ROWS, SMALLER
from multicor_cli.engine.contact.vector_sweep import (
    BRANCH_ROWS,
    FRAME_ROWS,
    IMPULSE_ROWS,
    PAIR_ROWS,
)
from multicor_cli.engine.geometry.scene import Scene, pair_geometry
from multicor_cli.engine.jit.arrays import aligned, aligned_zeros
from multicor_cli.engine.jit.compile import kernel, loop_body
from multicor_cli.engine.jit.vectors import LANES
from multicor_cli.model.columns import FIRST, MASS, SECOND, X, Y
from multicor_cli.model.model import Floats, Ints

MANY = 16  # contacts of a grain from which on they are crowded: relaxed serially

TILED, CROWDED, GENERAL, FACE, FREE_FACE, LATE = range(6)
"""Classes of contacts; those of grains that are no discs (`engine/contact/faces.py`) are faces."""

_NO_FACES, _NOBODY = np.empty(0, np.bool_), np.empty(0, np.int32)
COLORS = 4
STREAMS = 4  # parts of a tile whose contacts take turns


@kernel
def classify_contacts(
    scene: Scene, i: Ints, j: Ints, wall_is_free: NDArray[np.bool_], is_face: NDArray[np.bool_],
    late: Ints,
) -> NDArray[np.int8]:  # fmt: skip
    """How each contact is relaxed, shape ``(c,)``.

    `TILED`, `CROWDED`, or `GENERAL`: with a wall that has a free degree of freedom. What is a face
    is a `FACE`, or a `FREE_FACE` with such a wall; what came ``late`` is so whatever it is.
    """
    n, classes = scene.radius.size, np.zeros(i.size, np.int8)
    degree = np.zeros(n, np.int32)
    for c in late:
        classes[c] = LATE
    for c in range(i.size):
        if (is_face.size and is_face[c]) or classes[c] == LATE:
            continue
        degree[i[c]] += 1
        if j[c] < n:
            degree[j[c]] += 1
    for c in range(i.size):
        if classes[c] == LATE:
            continue
        is_general = j[c] >= n and wall_is_free[scene.wall[j[c] - n]]
        if is_face.size and is_face[c]:
            classes[c] = FREE_FACE if is_general else FACE
        elif is_general:
            classes[c] = GENERAL
        elif degree[i[c]] > MANY or (j[c] < n and degree[j[c]] > MANY):
            classes[c] = CROWDED
    return classes


@kernel
def _with_walls(j: Ints, grains: int, classes: NDArray[np.int8], least: int, most: int) -> Ints:
    """Contacts with walls, of the classes from ``least`` to ``most``."""
    found, ours = 0, np.empty(j.size, np.int32)
    for c in range(j.size):
        ours[found] = c
        found += j[c] >= grains and least <= classes[c] <= most
    return ours[:found].copy()


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
def order_contacts(
    i: Ints, classes: NDArray[np.int8], kind: int, tile: Ints, color_start: NDArray[np.int64],
    columns: int,
) -> tuple[Ints, NDArray[np.int64]]:  # fmt: skip
    """The contacts of a ``kind`` by the tile of their grain i and key, and the starts of tiles.

    Crowded ones come last, with the tiled; ``tile`` is from `tiles_of`.
    """
    tiles, half_x = color_start[COLORS] + 1, (columns + 1) // 2
    of_contact, start = np.empty(i.size, np.int32), np.zeros(tiles + 1, np.int64)
    for c in range(i.size):
        of_contact[c] = -1
        if classes[c] == kind:
            tx, ty = tile[i[c], X], tile[i[c], Y]
            wide = half_x if tx % 2 == 0 else columns - half_x
            of_contact[c] = color_start[tx % 2 + 2 * (ty % 2)] + (ty // 2) * wide + tx // 2
        elif classes[c] == CROWDED and kind == TILED:
            of_contact[c] = color_start[COLORS]
        if of_contact[c] >= 0:
            start[of_contact[c] + 1] += 1
    for t in range(tiles):
        start[t + 1] += start[t]
    fill = start[:-1].copy()
    order = np.empty(start[-1], np.int32)
    for c in range(i.size):
        t = of_contact[c]
        if t >= 0:
            order[fill[t]] = c
            fill[t] += 1
    _interleave(order, start[:-1])
    return order, start


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

SPARE = 16
"""Further batches, and proxies, for contacts that come late: so many, and a share of all others."""


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


class Arrangement(NamedTuple):
    """Order, rows and batches of contacts.

    Attributes:
        order: Diagonal contacts in the order of the sweep, shape ``(k,)``; then faces.
        bodies: Rows of their bodies, shape ``(k + f, 2)``.
        rows: Number of rows without those of empty lanes.
        general: General contacts; ``walls`` are diagonal ones with walls, both ascending.
        face_rest: Faces with walls that have a free degree of freedom; it, ``face_start`` and
            ``place`` are those of `Schedule`, what is left is as in `System`.
    """

    order: Ints
    bodies: Ints
    rows: int
    place: Ints
    slot: Ints
    tile_start: NDArray[np.int64]
    color_start: NDArray[np.int64]
    general: Ints
    walls: Ints
    face_start: NDArray[np.int64]
    face_rest: Ints


@kernel
def arrange_contacts(
    scene: Scene, i: Ints, j: Ints, tile: Ints, wall_is_free: NDArray[np.bool_],
    is_face: NDArray[np.bool_], late: Ints,
) -> Arrangement:  # fmt: skip
    """Order and batches of contacts but ``late`` ones; arguments as `schedule_contacts`."""
    grains, columns, rows = scene.radius.size, 1, 1
    for k in range(tile.shape[0]):
        columns, rows = max(columns, tile[k, X] + 1), max(rows, tile[k, Y] + 1)
    color_start = color_tiles(columns, rows)
    classes = classify_contacts(scene, i, j, wall_is_free, is_face, late)
    tiled, start = order_contacts(i, classes, TILED, tile, color_start, columns)
    faces, face_start = tiled[:0], np.zeros(start.size, np.int64)
    if is_face.size:
        faces, face_start = order_contacts(i, classes, FACE, tile, color_start, columns)
    order = np.empty(tiled.size + faces.size, np.int32)
    for k in range(order.size):
        order[k] = tiled[k] if k < tiled.size else faces[k - tiled.size]
    walls = _with_walls(j, grains, classes, TILED, CROWDED)
    general = _with_walls(j, grains, classes, GENERAL, GENERAL)
    place, bodies, count = number_bodies(i, j, order, general, grains, wall_is_free.size)
    slot, tile_start = make_batches(bodies[: tiled.size], start, count)
    return Arrangement(
        order, bodies, count, place, slot, tile_start, color_start, general, walls, face_start,
        _with_walls(j, grains, classes, FREE_FACE, FREE_FACE),
    )  # fmt: skip


@kernel
def fill_lanes(
    made: Arrangement, slot: Ints, pair: Ints, lane: Ints, middle: Floats, frame: Floats,
    about: Floats,
) -> None:  # fmt: skip
    """Put contacts and their bodies into their lanes; empty ones lie apart, and have a mass.

    Two more rows are for the empty lanes of each tile: no two tiles share a body. There are more
    batches than are ``made``, which belong to the last tile. **Modifies** the other arguments, as
    in `Schedule`.
    """
    batches, tiles = made.slot.shape[0], made.tile_start.size - 1
    for c in range(lane.size):
        lane[c] = NOWHERE
    for t in range(tiles):
        empty = made.rows + 2 * t
        middle[empty + 1, X] = 1.0
        last = made.tile_start[t + 1] if t + 1 < tiles else slot.shape[0]
        for q in range(made.tile_start[t], last):
            for k in range(LANES):
                rank, c, first, second = -1, -1, empty, empty + 1
                if q < batches:
                    rank = made.slot[q, k]
                if rank >= 0:
                    c, first, second = (
                        made.order[rank], made.bodies[rank, FIRST], made.bodies[rank, SECOND],
                    )  # fmt: skip
                    lane[c] = LANES * q + k
                slot[q, k], pair[q, FIRST, k], pair[q, SECOND, k] = c, 4 * first, 4 * second
                frame[q, MASS, k] = about[q, SMALLER, k] = 1.0
    for k in range(made.general.size):
        lane[made.general[k]] = -1 - k


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
        depth: Overlaps of two grains at the end of a step over the smaller radius, ``(q, 4)``.
        of_general: Rows of the general contacts of discs, as in `System`: bodies, frames, levers
            and impulses.
        face_order: Faces in the order of their sweep, shape ``(f,)``: a step makes batches of those
            that have a point (`faces.batch_points`).
        face_pair: Rows of their bodies, shape ``(f, 2)``.
        face_start: First of them of each tile, shape ``(tiles + 1,)``.
        face_rest: Faces with walls that have a free degree of freedom.
        room: First batch of the last tile, number of batches in use, first row that is no body's,
            and the number of general contacts: where the next late contact goes.
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
    depth: Floats
    inverse: Floats
    of_general: tuple[Ints, Floats, Floats, Floats]
    face_order: Ints
    face_pair: Ints
    face_start: NDArray[np.int64]
    face_rest: Ints
    room: tuple[int, int, int, int]

    def with_late(
        self, room: tuple[int, int, int, int], lane: Ints, walls: Ints, general: Ints
    ) -> Schedule:
        """The same with more contacts, for which `place_late` has found lanes."""
        of_general = self.of_general
        if general.size > self.general.size:
            of_general = rows_of_general(general.size)
        return self._replace(
            room=room, lane=lane, walls=walls, general=general,
            of_walls=np.concatenate([walls, general]), of_general=of_general,
        )  # fmt: skip

    def cut(self) -> Schedule:
        """The same with the batches that are in use alone; they share memory."""
        start, used = self.tile_start.copy(), self.room[1]
        start[-1] = used
        return self._replace(
            tile_start=start, slot=self.slot[:used], pair=self.pair[:used],
            frame=self.frame[:used], impulse=self.impulse[:used], about=self.about[:used],
            before=self.before[:used], gap=self.gap[:used], depth=self.depth[:used],
            branch=self.branch[:used],
        )  # fmt: skip

    def system(self, spin_factor: float, contacts: int) -> System:
        """The `System` of discs without couples; ``spin_factor`` and ``contacts`` as there."""
        return System(
            self.velocity, self.inverse, self.slot, self.pair, self.frame, self.impulse,
            self.tile_start, self.color_start, *self.of_general, spin_factor, contacts,
        )  # fmt: skip


def lay_tiles(scene: Scene, span: float, mean_diameter: float) -> Ints:
    """Column and row of the tile of each grain, shape ``(n, 2)``, for contacts of this `span_of`.

    No two tiles of one color have a grain in common, wherever these contacts go.
    """
    columns, rows, corner, width, height = _grid(scene, max(TILE * mean_diameter, 2.2 * span))
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
    is_face: NDArray[np.bool_] = _NO_FACES, late: Ints = _NOBODY, times: int = 1,
) -> Schedule:  # fmt: skip
    """The schedule of contacts with these shapes, sorted by key; ``tile`` is from `lay_tiles`.

    ``wall_is_free`` marks walls that loads move, ``is_face`` contacts of grains that are no discs;
    ``late`` are contacts of discs that come after all others, in this order. It has all batches for
    which there is room (see `Schedule.cut`): ``times`` as many to spare as `SPARE` says, and twice
    that if the late ones need it.
    """
    made = arrange_contacts(scene, i, j, tile, wall_is_free, is_face, late)
    general, walls, used = made.general, made.walls, made.slot.shape[0]
    tiled, spare = made.order.size - made.face_start[-1], times * (SPARE + walls.size // SPARE)
    rows = made.rows + 2 * (made.tile_start.size - 1) + spare
    batches = used + times * (SPARE + used // SPARE)
    velocity, start, middle, frame, impulse, about, before, gap, depth, branch = aligned_zeros(
        (rows, 4), (rows, 4), (rows, 4), (batches, FRAME_ROWS, LANES),
        (batches, IMPULSE_ROWS, LANES), (batches, ABOUT_ROWS, LANES),
        (batches, IMPULSE_ROWS, LANES), (batches, LANES), (batches, LANES),
        (batches if scene.height > 0.0 else 0, BRANCH_ROWS, LANES),
    )  # fmt: skip
    pair, lane = aligned((batches, PAIR_ROWS, LANES), np.int32), np.empty(i.size, np.int32)
    slot = np.empty((batches, LANES), np.int32)
    fill_lanes(made, slot, pair, lane, middle, frame, about)
    whole = Schedule(
        slot, pair, made.tile_start, made.color_start, general, walls,
        np.concatenate([walls, general]), lane, made.place, velocity, start, middle, frame, impulse,
        about, before, gap, branch, depth, np.empty((made.place.size + wall_is_free.size, 3)),
        rows_of_general(general.size), made.order[tiled:].copy(), made.bodies[tiled:].copy(),
        made.face_start, made.face_rest, (made.tile_start[-2], used, rows - spare, general.size),
    )  # fmt: skip
    if late.size:
        room = place_late(
            late, i, j, made.place, wall_is_free[scene.wall], rows, *whole.room, slot, pair, lane
        )
        if room[1] < 0:  # there were more others when these came
            return schedule_contacts(scene, i, j, tile, wall_is_free, is_face, late, 2 * times)
        whole = whole.with_late(room, lane, *contacts_with_walls(j, lane, made.place.size, room[3]))
    return whole


def rows_of_general(count: int) -> tuple[Ints, Floats, Floats, Floats]:
    """Room for bodies, frames, levers and impulses of general contacts, as in `System`."""
    return (
        np.zeros((count, 2), np.int32), np.zeros((count, 8)), np.zeros((count, 2, 2)),
        np.zeros((count, 2)),
    )  # fmt: skip


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
