"""The order in which contacts are relaxed: square tiles in four colors, so that tiles of one color share no body.

The order is a pure function of the contacts and positions of the step, hence the same for any number of threads. Within a tile
the contacts are ordered by key, which keeps the propagation of a serial sweep, cut into `STREAMS` parts from which one contact is
taken in turn: neighbors by key share a grain, and could not lie in one batch. Tiles also keep the bodies of a thread in its cache.
Contacts with fixed or prescribed walls do not tie tiles together. Heavy grains (many contacts) come last, serially.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.contact.detection import StepContacts
from multicor_cli.engine.geometry.scene import Scene
from multicor_cli.engine.jit.compile import kernel
from multicor_cli.model.columns import FIRST, GAP, SECOND, X, Y
from multicor_cli.model.model import Floats, Ints

MANY = 16  # contacts of a grain from which on they are heavy: relaxed serially

TILED, HEAVY, GENERAL = 0, 1, 2
"""Classes of contacts."""

COLORS = 4
STREAMS = 4  # parts of a tile whose contacts take turns


@kernel
def classify_contacts(scene: Scene, contacts: StepContacts, wall_is_free: NDArray[np.bool_]) -> tuple[NDArray[np.int8], float]:
    """Say how each contact is relaxed.

    Returns:
        Class of each contact (`TILED`, `HEAVY`, or `GENERAL`: with a wall that has a free degree of freedom), shape ``(c,)``, and
        the largest distance in x or y between the grains of a tiled contact [m].
    """
    n = scene.radius.size
    degree = np.zeros(n, np.int32)
    for c in range(contacts.i.size):
        degree[contacts.i[c]] += 1
        if contacts.j[c] < n:
            degree[contacts.j[c]] += 1
    classes = np.zeros(contacts.i.size, np.int8)
    span = 0.0
    for c in range(contacts.i.size):
        i, j = contacts.i[c], contacts.j[c]
        if j >= n:
            if wall_is_free[scene.wall[j - n]]:
                classes[c] = GENERAL
            elif degree[i] > MANY:
                classes[c] = HEAVY
        elif degree[i] > MANY or degree[j] > MANY:
            classes[c] = HEAVY
        else:
            span = max(span, scene.radius[i] + scene.radius[j] + contacts.frame[c, GAP])
    return classes, span


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
def assign_tiles(
    scene: Scene,
    contacts: StepContacts,
    classes: NDArray[np.int8],
    columns: int,
    rows: int,
    corner: Floats,
    width: float,
    height: float,
    color_start: NDArray[np.int64],
) -> Ints:
    """Tile of each contact, shape ``(c,)``: that of its grain i; one more for all heavy contacts, and -1 for general ones.

    Args:
        scene: Positions at q_m.
        contacts: Contacts sorted by key.
        classes: From `classify_contacts`.
        columns: Number of tiles in x; even or 1 if the domain is periodic.
        rows: Number of tiles in y.
        corner: Lower left corner of the first tile [m], shape ``(2,)``.
        width: Width of a tile [m].
        height: Height of a tile [m].
        color_start: From `color_tiles`.
    """
    half_x = (columns + 1) // 2
    tile = np.empty(contacts.i.size, np.int32)
    last, of_last = -1, 0  # contacts of a grain follow each other
    for c in range(contacts.i.size):
        if classes[c] == TILED:
            i = contacts.i[c]
            if i != last:
                tx = min(max(int((scene.position[i, X] - corner[X]) / width), 0), columns - 1)
                ty = min(max(int((scene.position[i, Y] - corner[Y]) / height), 0), rows - 1)
                wide = half_x if tx % 2 == 0 else columns - half_x
                last, of_last = i, color_start[tx % 2 + 2 * (ty % 2)] + (ty // 2) * wide + tx // 2
            tile[c] = of_last
        else:
            tile[c] = color_start[COLORS] if classes[c] == HEAVY else -1
    return tile


@kernel
def order_contacts(tile: Ints, tiles: int) -> tuple[Ints, Ints, NDArray[np.int64]]:
    """Sort contacts by tile and key.

    Args:
        tile: From `assign_tiles`.
        tiles: Number of tiles, that of the heavy contacts included.

    Returns:
        Light contacts in the order of the sweep, general contacts, and the start of each tile in the order, shape ``(tiles + 1,)``.
    """
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
    """Deal the contacts of each tile out to `STREAMS` parts of equal length and take one from each part in turn."""
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
def number_bodies(i: Ints, j: Ints, order: Ints, general: Ints, grains: int, walls: int) -> tuple[Ints, Ints, int]:
    """Rows of the bodies in the velocities of the sweep: grains in the order in which the sweep first meets them, walls, anchors.

    However grains are numbered, a tile then reads and writes one piece of memory: three times faster where the velocities of all
    grains do not fit into the caches. A prescribed wall is replaced by one *anchor* per contact: a body of infinite mass that has
    the velocity of the wall at the contact. The sweep then needs no branch, and no two contacts share an anchor.

    Args:
        i: Grain of each contact.
        j: Grain, or wall shape (a number beyond those of the grains), of each contact.
        order: Light contacts in the order of the sweep, shape ``(k,)``.
        general: General contacts.
        grains: Number of grains.
        walls: Number of walls.

    Returns:
        Row of each grain, shape ``(n,)``; rows of the bodies of each light contact in the order of the sweep, shape ``(k, 2)``; and
        the number of rows.
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
    for k in range(general.size):  # with walls
        if place[i[general[k]]] < 0:
            place[i[general[k]]] = found
            found += 1
    for grain in range(grains):  # those that touch nothing
        if place[grain] < 0:
            place[grain] = found
            found += 1
    return place, pair, rows
