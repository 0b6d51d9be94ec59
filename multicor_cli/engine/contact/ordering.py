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
from multicor_cli.engine.jit.compile import kernel, parallel_kernel, prange
from multicor_cli.model.columns import (
    BIAS,
    FIRST,
    GAP,
    INVERSE_MASS,
    MASS,
    MU,
    NORMAL,
    NX,
    NY,
    SECOND,
    SPIN,
    SURFACE,
    TANGENTIAL,
    W_NN,
    W_NT,
    W_TT,
    X,
    Y,
)
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
        ``(tiles + 1,)``; the first tile of each color, shape ``(5,)``.
    """
    # Tiles are numbered color by color, so that sorting by tile number sorts by color too.
    half_x, half_y = (columns + 1) // 2, (rows + 1) // 2
    color_start = np.zeros(COLORS + 1, np.int64)
    for color in range(COLORS):
        wide = half_x if color % 2 == 0 else columns - half_x
        high = half_y if color // 2 == 0 else rows - half_y
        color_start[color + 1] = color_start[color] + wide * high
    tile = np.empty(contacts.i.size, np.int32)
    start = np.zeros(color_start[COLORS] + 1, np.int64)
    for c in range(contacts.i.size):
        if classes[c] == 0:
            i = contacts.i[c]
            tx = min(max(int((scene.position[i, X] - corner[X]) / width), 0), columns - 1)
            ty = min(max(int((scene.position[i, Y] - corner[Y]) / height), 0), rows - 1)
            color = tx % 2 + 2 * (ty % 2)
            wide = half_x if tx % 2 == 0 else columns - half_x
            tile[c] = color_start[color] + (ty // 2) * wide + tx // 2
            start[tile[c] + 1] += 1
    for t in range(start.size - 1):
        start[t + 1] += start[t]
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
    _interleave(order, start)
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
def number_wall_contacts(scene: Scene, contacts: StepContacts, order: Ints) -> Ints:
    """Running number of each ordered contact with a prescribed wall, -1 for grain–grain contacts, shape ``(len(order),)``."""
    number = np.empty(order.size, np.int32)
    found = 0
    for k in range(order.size):
        if contacts.j[order[k]] >= scene.radius.size:
            number[k] = found
            found += 1
        else:
            number[k] = -1
    return number


@kernel
def number_grains(contacts: StepContacts, order: Ints, general: Ints, count: int) -> Ints:
    """Rows of the ``count`` grains in the velocities of the sweep, in the order in which the sweep first meets them.

    However grains are numbered, a tile then reads and writes one piece of memory: three times faster where the velocities of all
    grains do not fit into the caches.
    """
    place = np.full(count, -1, np.int32)
    found = 0
    for contact in (order, general):
        for k in range(contact.size):
            i, j = contacts.i[contact[k]], contacts.j[contact[k]]
            if place[i] < 0:
                place[i] = found
                found += 1
            if j < count and place[j] < 0:
                place[j] = found
                found += 1
    for i in range(count):  # those that touch nothing
        if place[i] < 0:
            place[i] = found
            found += 1
    return place


@parallel_kernel
def pack_contacts(
    scene: Scene,
    contacts: StepContacts,
    free: Floats,
    place: Ints,
    order: Ints,
    wall_number: Ints,
    first_anchor: int,
    velocity: Floats,
    pair: Ints,
    frame: Floats,
    impulse: Floats,
) -> None:
    """Copy bodies and ordered contacts into the arrays of the sweep.

    A prescribed wall is replaced by one *anchor* per contact: a body of infinite mass that has the velocity of the wall at the
    contact. The sweep then needs no branch, and no two contacts share an anchor.

    Args:
        scene: Shapes at q_m.
        contacts: Contacts sorted by key.
        free: Free velocities of grains and walls, shape ``(bodies, 4)``.
        place: From `number_grains`.
        order: Contacts in the order of the sweep, shape ``(k,)``.
        wall_number: From `number_wall_contacts`.
        first_anchor: Row of the first anchor in ``velocity``.
        velocity: Bodies, then anchors, shape ``(bodies + anchors, 4)``. **Modified.**
        pair: Bodies of each contact, shape ``(k, 2)``. **Modified.**
        frame: n_x, n_y, 1/W_nn [kg], bias [m/s], μ, shape ``(k, 5)``. **Modified.**
        impulse: p_n, p_t [N s], shape ``(k, 2)``. **Modified.**
    """
    n = scene.radius.size
    for b in prange(free.shape[0]):
        row = np.int64(place[b]) if b < n else np.int64(b)
        for d in range(4):
            velocity[row, d] = free[b, d]
    for k in prange(order.size):
        c = order[k]
        i, j = place[contacts.i[c]], contacts.j[c]
        if j < n:
            body = np.int64(place[j])
        else:
            body = first_anchor + wall_number[k]
            wall = n + scene.wall[j - n]
            velocity[body, X] = velocity[wall, X] - velocity[wall, SURFACE] * contacts.lever[c, Y]
            velocity[body, Y] = velocity[wall, Y] + velocity[wall, SURFACE] * contacts.lever[c, X]
            velocity[body, SURFACE] = 0.0
            velocity[body, INVERSE_MASS] = 0.0
        pair[k, FIRST], pair[k, SECOND] = i, body
        frame[k, NX], frame[k, NY] = contacts.frame[c, NX], contacts.frame[c, NY]
        frame[k, MASS] = 1.0 / (velocity[i, INVERSE_MASS] + velocity[body, INVERSE_MASS])
        frame[k, BIAS], frame[k, MU] = contacts.frame[c, BIAS], contacts.frame[c, MU]
        impulse[k, NORMAL], impulse[k, TANGENTIAL] = contacts.impulse[c, NORMAL], contacts.impulse[c, TANGENTIAL]


@kernel
def pack_general(
    scene: Scene, contacts: StepContacts, place: Ints, general: Ints, inverse: Floats
) -> tuple[Ints, Floats, Floats, Floats]:
    """Arrays of the contacts with walls that have a free degree of freedom, as in `multicor_cli.engine.contact.sweep.System`.

    Args:
        scene: Shapes at q_m.
        contacts: Contacts sorted by key.
        place: From `number_grains`.
        general: Contacts of class 2, shape ``(g,)``.
        inverse: Inverse mass per degree of freedom of grains and walls, shape ``(n + w, 3)``.

    Returns:
        Bodies ``(g, 2)``, frames ``(g, 7)``, levers ``(g, 2, 2)`` and impulses ``(g, 2)``.
    """
    n = scene.radius.size
    pair, impulse = np.empty((general.size, 2), np.int32), np.empty((general.size, 2))
    frame, lever = np.zeros((general.size, 7)), np.empty((general.size, 2, 2))
    for g in range(general.size):
        c = general[g]
        nx, ny = contacts.frame[c, NX], contacts.frame[c, NY]
        lx, ly = contacts.lever[c, X], contacts.lever[c, Y]
        pair[g, FIRST], pair[g, SECOND] = place[contacts.i[c]], n + scene.wall[contacts.j[c] - n]
        frame[g, NX], frame[g, NY] = nx, ny
        frame[g, BIAS], frame[g, MU] = contacts.frame[c, BIAS], contacts.frame[c, MU]
        impulse[g, NORMAL], impulse[g, TANGENTIAL] = contacts.impulse[c, NORMAL], contacts.impulse[c, TANGENTIAL]
        # u_t gains −s from the grain's surface speed; u_n and u_t −Ω (l_x n_y − l_y n_x) and −Ω (l_x n_x + l_y n_y) from the wall.
        lever[g, FIRST, NORMAL], lever[g, FIRST, TANGENTIAL] = 0.0, -1.0
        lever[g, SECOND, NORMAL], lever[g, SECOND, TANGENTIAL] = lx * ny - ly * nx, lx * nx + ly * ny
        for side in range(2):
            m, l_n, l_t = inverse[pair[g, side]], lever[g, side, NORMAL], lever[g, side, TANGENTIAL]
            frame[g, W_NN] += m[X] * (nx * nx) + m[Y] * (ny * ny) + m[SPIN] * (l_n * l_n)
            frame[g, W_NT] += (m[Y] - m[X]) * nx * ny + m[SPIN] * l_n * l_t
            frame[g, W_TT] += m[X] * (ny * ny) + m[Y] * (nx * nx) + m[SPIN] * (l_t * l_t)
    return pair, frame, lever, impulse


@parallel_kernel
def unpack(order: Ints, impulse: Floats, place: Ints, velocity: Floats, by_contact: Floats, by_body: Floats) -> None:
    """Back from the arrays of the sweep.

    Args:
        order: Contacts in the order of the sweep, shape ``(k,)``.
        impulse: Their impulses, shape ``(k, 2)``.
        place: From `number_grains`, shape ``(n,)``.
        velocity: Bodies as in `pack_contacts`.
        by_contact: Impulses of the contacts, shape ``(c, 2)``. **Modified.**
        by_body: Velocities of grains and walls, shape ``(bodies, 4)``. **Modified.**
    """
    # The arrays are passed by themselves: Numba drops stores of a parallel loop to an array that it only knows as part of a tuple.
    for k in prange(order.size):
        by_contact[order[k], NORMAL] = impulse[k, NORMAL]
        by_contact[order[k], TANGENTIAL] = impulse[k, TANGENTIAL]
    for b in prange(by_body.shape[0]):
        row = np.int64(place[b]) if b < place.size else np.int64(b)
        for d in range(4):
            by_body[b, d] = velocity[row, d]
