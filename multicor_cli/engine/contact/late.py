"""Contacts that come late: pairs that close although they were not near when contacts were sought.

A grain that is hit is suddenly fast, so that in a flow a pair or two close in any step that nobody
expected to. They go after all other contacts, into the last tile, which one thread relaxes. Each
gets the first lane that the schedule of all contacts would give it, so that it does not matter how
many come at once: a state says which came late, and in what order, and another process that takes
it up has the same lanes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.contact.contacts import Contacts, normal_velocity
from multicor_cli.engine.geometry.scene import Scene, are_apart, pair_geometry
from multicor_cli.engine.jit.compile import kernel
from multicor_cli.engine.jit.vectors import LANES
from multicor_cli.model.columns import FIRST, SECOND
from multicor_cli.model.model import Floats, Ints

SPACING = 3
"""A body comes again after so many batches at the earliest.

The vector sweep gathers a batch before the last one is applied, which asks for 2; with 3 it waits
less (by a tenth), with 4 more lanes are empty.
"""


NOWHERE = -(1 << 31)
"""The lane of what lies in none."""


@kernel
def closing_soon(
    scene: Scene, i: Ints, j: Ints, start: Floats, end: Floats, cutoff: float, dt: float,
    reach: float,
) -> tuple[Ints, Ints, Ints, Ints]:  # fmt: skip
    """Pairs that are no contacts although they close within ``dt``, and the others.

    Arguments as those of `find_closing`, of discs; only gaps below ``cutoff`` count, up to which
    the list is complete.
    """
    first, second = np.empty(i.size, np.int32), np.empty(i.size, np.int32)
    rest_i, rest_j = np.empty(i.size, np.int32), np.empty(i.size, np.int32)
    found, rest = 0, 0
    for k in range(i.size):
        closes = False
        if not are_apart(scene, i[k], j[k], cutoff):
            gap, nx, ny = pair_geometry(scene, i[k], j[k])
            closes = gap <= reach
            if gap < cutoff:
                u_n = min(
                    normal_velocity(scene, start, i[k], j[k], nx, ny, gap),
                    normal_velocity(scene, end, i[k], j[k], nx, ny, gap),
                )
                closes |= gap + dt * u_n < 0.0
        first[found], second[found] = i[k], j[k]
        rest_i[rest], rest_j[rest] = i[k], j[k]
        found += closes
        rest += not closes
    return (
        first[:found].copy(), second[:found].copy(), rest_i[:rest].copy(), rest_j[:rest].copy()
    )  # fmt: skip


@kernel
def place_late(
    late: Ints, i: Ints, j: Ints, place: Ints, is_free: NDArray[np.bool_], rows: int, first: int,
    used: int, proxy: int, general: int, slot: Ints, pair: Ints, lane: Ints,
) -> tuple[int, int, int, int]:  # fmt: skip
    """Lanes for ``late`` ones of the contacts (i, j), in this order, in batches of the last tile.

    That begins with batch ``first``; ``used`` batches are in use. Grains have rows, ``place``; of
    ``rows`` those from ``proxy`` on are free, for walls. Contacts with wall shapes that are
    ``is_free`` are general ones, of which there are so many. Arrays as in `Schedule`; ``slot``,
    ``pair`` and ``lane`` are **modified**. Returns the four numbers for those that come next;
    ``used`` is -1 if there is no room.
    """
    ready = np.full(rows, first)
    for q in range(first, used):
        for k in range(LANES):
            ready[pair[q, FIRST, k] // 4] = ready[pair[q, SECOND, k] // 4] = q + SPACING
    for c in late:
        a, b, k = place[i[c]], proxy, LANES
        if j[c] < place.size:
            b = place[j[c]]
        elif is_free[j[c] - place.size]:
            lane[c] = -1 - general
            general += 1
            continue
        elif proxy == rows:
            return first, -1, proxy, general
        else:
            proxy += 1
        q = max(ready[a], ready[b])
        while k == LANES and q < slot.shape[0]:
            k = 0
            while k < LANES and slot[q, k] >= 0:
                k += 1
            q += k == LANES
        used = max(used, q + 1, first + SPACING)
        if used > slot.shape[0]:
            return first, -1, proxy, general
        slot[q, k], lane[c] = c, LANES * q + k
        pair[q, FIRST, k], pair[q, SECOND, k] = 4 * a, 4 * b
        ready[a] = ready[b] = q + SPACING
    return first, used, proxy, general


@kernel
def contacts_with_walls(j: Ints, lane: Ints, grains: int, general: int) -> tuple[Ints, Ints]:
    """The diagonal contacts of discs with walls, ascending, and the ``general`` ones."""
    walls, others, found = np.empty(j.size, np.int32), np.empty(general, np.int32), 0
    for c in range(j.size):
        if j[c] >= grains:
            walls[found] = c
            found += lane[c] >= 0
            if lane[c] < 0:
                others[-1 - lane[c]] = c
    return walls[:found].copy(), others


@kernel
def merge_late(
    i: Ints, j: Ints, late: Ints, first: Ints, second: Ints, lane: Ints, slot: Ints
) -> tuple[Ints, Ints, Ints, Ints, Ints, Ints]:  # fmt: skip
    """Contacts (i, j) with those of (first, second), sorted as both are, which come ``late``.

    Also returns in what order late ones came (0 of others), lanes as far as contacts have any, and
    where the former and the latter are now. Those in ``slot``, **modified**, are numbered anew.
    """
    count, more, k = i.size, first.size, 0
    both_i, both_j = np.empty(count + more, np.int32), np.empty(count + more, np.int32)
    came, lanes = np.zeros(count + more, np.int32), np.zeros(count + more, np.int32)
    to, new = np.empty(count, np.int32), np.empty(more, np.int32)
    for c in range(count + 1):
        while k < more and (
            c == count or first[k] < i[c] or (first[k] == i[c] and second[k] < j[c])
        ):
            both_i[c + k], both_j[c + k], new[k] = first[k], second[k], c + k
            k += 1
        if c < count:
            both_i[c + k], both_j[c + k], lanes[c + k], to[c] = i[c], j[c], lane[c], c + k
    latest = 0
    for c in range(late.size):
        came[to[c]], latest = late[c], max(latest, late[c])
    for k in range(more):
        came[new[k]] = latest + 1 + k
    for q in range(slot.shape[0]):
        for column in range(LANES):
            if slot[q, column] >= 0:
                slot[q, column] = to[slot[q, column]]
    return both_i, both_j, came, lanes, to, new


@kernel
def make_rows(
    table: Contacts, blank: Contacts, i: Ints, j: Ints, to: Ints, new: Ints, grains: int
) -> None:
    """Move contacts with walls in a table, **modified**, to where they are now among (i, j).

    ``to`` and ``new`` are from `merge_late`; rows that are left are ``blank``.
    """
    for c in range(to.size - 1, -1, -1):
        if j[to[c]] >= grains and to[c] > c:
            table[to[c]] = table[c]
            table[c] = blank[0]
    for c in new:
        if j[c] >= grains:
            table[c] = blank[0]
            table[c].i, table[c].j, table[c].key = i[c], j[c], -1
