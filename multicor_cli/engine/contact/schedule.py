"""Which contact is relaxed when, and where its bodies lie: everything about a sweep that forces and velocities do not change."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.contact.batches import fill_lanes, make_batches
from multicor_cli.engine.contact.detection import StepContacts
from multicor_cli.engine.contact.ordering import (
    assign_tiles,
    classify_contacts,
    color_tiles,
    extent_of,
    number_bodies,
    order_contacts,
)
from multicor_cli.engine.geometry.scene import Scene
from multicor_cli.engine.jit.chunks import aligned
from multicor_cli.engine.jit.vectors import LANES
from multicor_cli.model.columns import X, Y
from multicor_cli.model.model import Floats, Ints

TILE = 16.0  # width of a tile in mean diameters: a few hundred contacts


class Schedule(NamedTuple):
    """Order and places of the contacts of a step.

    Attributes:
        slot: Contact in each lane of the batches, -1 if there is none, shape ``(q, 4)``.
        pair: Four times the rows of their bodies, shape ``(q, 2, 4)``.
        tile_start: First batch of each tile, shape ``(tiles + 1,)``.
        color_start: First tile of each color, shape ``(colors + 1,)``.
        general: General contacts, shape ``(g,)``.
        place: Row of each grain, shape ``(n,)``; walls follow the grains, then come the anchors.
        rows: Number of all these rows. Two rows for the empty lanes of each tile follow.
    """

    slot: Ints
    pair: Ints
    tile_start: NDArray[np.int64]
    color_start: NDArray[np.int64]
    general: Ints
    place: Ints
    rows: int


class Scheduler:
    """Makes schedules, and keeps the last one for as long as the same contacts lie in the same tiles, as they do at rest.

    A schedule is a pure function of these: keeping it changes nothing but the time.
    """

    def __init__(self) -> None:
        self._last: Schedule | None = None
        self._key: tuple[Ints, Ints, Ints] = (np.empty(0, np.int32),) * 3

    def schedule(self, scene: Scene, contacts: StepContacts, wall_is_free: NDArray[np.bool_], mean_diameter: float) -> Schedule:
        """The schedule of the contacts of a step.

        Args:
            scene: Shapes at q_m.
            contacts: Contacts sorted by key.
            wall_is_free: Walls with a driven degree of freedom, shape ``(w,)``.
            mean_diameter: d̄ [m].
        """
        classes, span = classify_contacts(scene, contacts, wall_is_free)
        columns, rows, corner, width, height = _grid(scene, max(TILE * mean_diameter, 2.2 * span))
        color_start = color_tiles(columns, rows)
        tile = assign_tiles(scene, contacts, classes, columns, rows, corner, width, height, color_start)
        key = (contacts.i, contacts.j, tile)
        last = self._last
        if last is None or not (np.array_equal(last.color_start, color_start) and all(map(np.array_equal, self._key, key))):
            last = _make(contacts, tile, color_start, scene.radius.size, wall_is_free.size)
            self._last, self._key = last, key
        return last


def _make(contacts: StepContacts, tile: Ints, color_start: NDArray[np.int64], grains: int, walls: int) -> Schedule:
    tiles = int(color_start[-1]) + 1
    order, general, start = order_contacts(tile, tiles)
    place, bodies, rows = number_bodies(contacts.i, contacts.j, order, general, grains, walls)
    slot, tile_start = make_batches(bodies, start, rows)
    pair = aligned((slot.shape[0], 2, LANES), np.int32)
    fill_lanes(order, bodies, rows, tile_start, slot, pair)
    return Schedule(slot, pair, tile_start, color_start, general, place, rows)


def _grid(scene: Scene, width: float) -> tuple[int, int, Floats, float, float]:
    """Numbers of columns and rows, the corner and the size of the tiles; at least ``width`` wide and high."""
    left, right, bottom, top = extent_of(scene.position)
    low = np.array([left, bottom])
    size = np.array([right - left, top - bottom])
    if scene.period > 0.0:
        low[X], size[X] = 0.0, scene.period
    limit = max(4, scene.radius.size)  # grains that fly far away must not make the grid large
    rows = min(max(1, int(size[Y] / width)), limit)
    columns = min(max(1, int(size[X] / width)), limit)
    while rows * columns > limit:
        rows, columns = max(1, rows // 2), max(1, columns // 2)
    if scene.period > 0.0 and columns > 1:
        columns -= columns % 2
    return columns, rows, low, max(size[X], width) / columns, max(size[Y], width) / rows
