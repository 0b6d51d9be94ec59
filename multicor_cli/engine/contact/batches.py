"""Puts the light contacts of a step into batches of four that share no body, for the vector loops.

The order of the sweep is kept: a contact goes into the first batch with an empty lane that comes `SPACING` batches or more after
the last one with one of its bodies. Contacts that share no body commute, so the iterates are those of a sweep contact by contact in
the given order. (That of `multicor_cli.engine.contact.ordering`, four places of a tile in turn, fills 96 to 99 % of the lanes.)
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.jit.compile import kernel, loop_body
from multicor_cli.engine.jit.vectors import LANES
from multicor_cli.model.columns import FIRST, SECOND
from multicor_cli.model.model import Ints

SPACING = 3
"""A body comes again after so many batches at the earliest.

The vector sweep gathers a batch before the last one is applied, which asks for 2; with 3 it waits less (by a tenth), with 4 more
lanes are empty.
"""


class _Work(NamedTuple):
    """Work space of the schedule.

    Attributes:
        ready: First batch that each body may come in; zeros between tiles.
        filled: Filled lanes of each batch of a tile.
        following: Where to look for an empty lane from each batch on: there itself, or at a later one.
    """

    ready: Ints
    filled: Ints
    following: Ints


@loop_body
def _open(batch: int, base: int, slot: Ints, work: _Work) -> None:
    """An empty batch of a tile whose batches begin at ``base``."""
    work.filled[batch], work.following[batch] = 0, batch
    for lane in range(LANES):
        slot[base + batch, lane] = -1


@kernel
def _schedule(pair: Ints, first: int, last: int, base: int, slot: Ints, work: _Work) -> int:
    """Write the contacts ``first … last-1`` of a tile into ``slot`` from batch ``base`` on; returns the number of batches."""
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
def make_batches(pair: Ints, tile_start: NDArray[np.int64], bodies: int) -> tuple[Ints, NDArray[np.int64]]:
    """Batches of the contacts of each tile.

    Args:
        pair: Bodies of the contacts in the order of the sweep, shape ``(k, 2)``.
        tile_start: First contact of each tile, shape ``(tiles + 1,)``.
        bodies: Number of bodies.

    Returns:
        Contact in each lane, -1 if there is none, shape ``(q, 4)``, and the first batch of each tile, shape ``(tiles + 1,)``.
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
        start[t + 1] = start[t] + _schedule(pair, tile_start[t], tile_start[t + 1], start[t], slot, work)
    return slot[: start[-1]].copy(), start


@kernel
def fill_lanes(order: Ints, bodies: Ints, rows: int, tile_start: NDArray[np.int64], slot: Ints, pair: Ints) -> None:
    """Put the bodies of the contacts into their lanes.

    Args:
        order: Contacts in the order of the sweep, shape ``(k,)``.
        bodies: Rows of their bodies, shape ``(k, 2)``.
        rows: Number of rows; two for the empty lanes of each tile follow, so that no two tiles share a body.
        tile_start: First batch of each tile, shape ``(tiles + 1,)``.
        slot: From `make_batches`, shape ``(q, 4)``; on return the contacts themselves in place of their ranks. **Modified.**
        pair: Four times the rows of the bodies, shape ``(q, 2, 4)``. **Modified.**
    """
    for t in range(tile_start.size - 1):
        for q in range(tile_start[t], tile_start[t + 1]):
            for lane in range(LANES):
                k = slot[q, lane]
                if k >= 0:
                    slot[q, lane] = order[k]
                    pair[q, FIRST, lane], pair[q, SECOND, lane] = 4 * bodies[k, FIRST], 4 * bodies[k, SECOND]
                else:
                    pair[q, FIRST, lane], pair[q, SECOND, lane] = 4 * (rows + 2 * t), 4 * (rows + 2 * t + 1)
