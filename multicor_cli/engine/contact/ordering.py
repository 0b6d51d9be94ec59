"""The order in which contacts are relaxed: square tiles in four colors, so that tiles of one color share no body.

The order is a pure function of the contacts and positions of the step, hence the same for any number of threads. Within a tile
the contacts are ordered by key, which keeps the propagation of a serial sweep, cut into `STREAMS` parts from which one contact is
taken in turn: neighbors by key share a grain, and a processor would wait for the one before it could begin the next (15 to 20 %
of a sweep). Tiles also keep the bodies of a thread in its cache. Contacts with fixed or prescribed walls do not tie
tiles together. Heavy grains (many contacts) come last, serially.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.contact.detection import StepContacts
from multicor_cli.engine.geometry.scene import Scene
from multicor_cli.engine.jit.compile import kernel
from multicor_cli.model.columns import FIRST, GAP, SECOND, X, Y
from multicor_cli.model.model import Floats, Ints

HEAVY = 16  # a grain with more contacts than this is relaxed serially

COLORS = 4
STREAMS = 4  # parts of a tile whose contacts take turns


@kernel
def classify_contacts(
    scene: Scene, contacts: StepContacts, wall_is_free: NDArray[np.bool_]
) -> tuple[NDArray[np.int8], float, NDArray[np.int64]]:
    """Say how each contact is relaxed.

    Returns:
        Class of each contact (0 tiled, 1 heavy, 2 with a wall that has a free degree of freedom), the largest distance in x or y
        between the grains of a tiled contact [m], and the numbers of contacts in the classes, shape ``(3,)``.
    """
    n = scene.radius.size
    degree = np.zeros(n, np.int32)
    for c in range(contacts.i.size):
        degree[contacts.i[c]] += 1
        if contacts.j[c] < n:
            degree[contacts.j[c]] += 1
    classes = np.zeros(contacts.i.size, np.int8)
    sizes = np.zeros(3, np.int64)
    span = 0.0
    for c in range(contacts.i.size):
        i, j = contacts.i[c], contacts.j[c]
        if j >= n:
            if wall_is_free[scene.wall[j - n]]:
                classes[c] = 2
            elif degree[i] > HEAVY:
                classes[c] = 1
        elif degree[i] > HEAVY or degree[j] > HEAVY:
            classes[c] = 1
        else:
            span = max(span, scene.radius[i] + scene.radius[j] + contacts.frame[c, GAP])
        sizes[classes[c]] += 1
    return classes, span, sizes


@kernel
def order_contacts(
    scene: Scene,
    contacts: StepContacts,
    classes: NDArray[np.int8],
    sizes: NDArray[np.int64],
    columns: int,
    rows: int,
    corner: Floats,
    width: float,
    height: float,
) -> tuple[Ints, Ints, NDArray[np.int64], NDArray[np.int64]]:
    """Sort contacts by color, tile and key.

    Args:
        scene: Positions at q_m.
        contacts: Contacts sorted by key.
        classes: From `classify_contacts`.
        sizes: From `classify_contacts`.
        columns: Number of tiles in x; even or 1 if the domain is periodic.
        rows: Number of tiles in y.
        corner: Lower left corner of the first tile [m], shape ``(2,)``.
        width: Width of a tile [m].
        height: Height of a tile [m].

    Returns:
        Contacts of classes 0 and 1 in the order of the sweep; those of class 2; the start of each tile in the order, shape
        ``(tiles + 1,)``; the first tile of each color, shape ``(5,)``. The last tile has no color: the contacts of class 1.
    """
    # Tiles are numbered color by color, so that sorting by tile number sorts by color too.
    half_x, half_y = (columns + 1) // 2, (rows + 1) // 2
    color_start = np.zeros(COLORS + 1, np.int64)
    for color in range(COLORS):
        wide = half_x if color % 2 == 0 else columns - half_x
        high = half_y if color // 2 == 0 else rows - half_y
        color_start[color + 1] = color_start[color] + wide * high
    tile = np.empty(contacts.i.size, np.int32)
    start = np.zeros(color_start[COLORS] + 2, np.int64)
    for c in range(contacts.i.size):
        if classes[c] == 0:
            i = contacts.i[c]
            tx = min(max(int((scene.position[i, X] - corner[X]) / width), 0), columns - 1)
            ty = min(max(int((scene.position[i, Y] - corner[Y]) / height), 0), rows - 1)
            color = tx % 2 + 2 * (ty % 2)
            wide = half_x if tx % 2 == 0 else columns - half_x
            tile[c] = color_start[color] + (ty // 2) * wide + tx // 2
            start[tile[c] + 1] += 1
    for t in range(color_start[COLORS]):
        start[t + 1] += start[t]
    start[-1] = sizes[0] + sizes[1]
    fill = start[:-1].copy()
    order = np.empty(sizes[0] + sizes[1], np.int32)
    general = np.empty(sizes[2], np.int32)
    heavy_at, general_at = sizes[0], 0
    for c in range(contacts.i.size):
        if classes[c] == 0:
            order[fill[tile[c]]] = c
            fill[tile[c]] += 1
        elif classes[c] == 1:
            order[heavy_at] = c
            heavy_at += 1
        else:
            general[general_at] = c
            general_at += 1
    _interleave(order, start[:-1])
    return order, general, start, color_start


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
def number_bodies(scene: Scene, contacts: StepContacts, order: Ints, general: Ints, walls: int) -> tuple[Ints, Ints, int]:
    """Rows of the bodies in the velocities of the sweep: grains in the order in which the sweep first meets them, walls, anchors.

    However grains are numbered, a tile then reads and writes one piece of memory: three times faster where the velocities of all
    grains do not fit into the caches. A prescribed wall is replaced by one *anchor* per contact: a body of infinite mass that has
    the velocity of the wall at the contact. The sweep then needs no branch, and no two contacts share an anchor.

    Args:
        scene: Shapes at q_m.
        contacts: Contacts sorted by key.
        order: Light contacts in the order of the sweep, shape ``(k,)``.
        general: General contacts.
        walls: Number of walls.

    Returns:
        Row of each grain, shape ``(n,)``; rows of the bodies of each light contact in the order of the sweep, shape ``(k, 2)``; and
        the number of rows.
    """
    n = scene.radius.size
    place = np.full(n, -1, np.int32)
    pair = np.empty((order.size, 2), np.int32)
    found, rows = 0, n + walls
    for k in range(order.size):
        i, j = contacts.i[order[k]], contacts.j[order[k]]
        if place[i] < 0:
            place[i] = found
            found += 1
        pair[k, FIRST] = place[i]
        if j >= n:
            pair[k, SECOND] = rows
            rows += 1
            continue
        if place[j] < 0:
            place[j] = found
            found += 1
        pair[k, SECOND] = place[j]
    for k in range(general.size):  # with walls
        i = contacts.i[general[k]]
        if place[i] < 0:
            place[i] = found
            found += 1
    for i in range(n):  # those that touch nothing
        if place[i] < 0:
            place[i] = found
            found += 1
    return place, pair, rows
