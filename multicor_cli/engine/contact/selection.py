"""Which pairs are contacts: all that are near at one moment, until another pair may close.

What lasts with them is not made in every step: the order in which they are relaxed, their places in
the arrays of the sweep, and the list of the pairs beside them. The state holds which they are, so
that a run which goes on from a checkpoint makes the same steps.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.contact.contacts import CONTACT, Contacts, normal_velocity
from multicor_cli.engine.contact.ordering import Schedule, lay_tiles, schedule_contacts
from multicor_cli.engine.geometry.neighbors import NeighborList, pairs_within
from multicor_cli.engine.geometry.scene import Scene, pair_geometry
from multicor_cli.engine.jit.chunks import CHUNK, chunks_for
from multicor_cli.engine.jit.compile import kernel, parallel_kernel, prange
from multicor_cli.model.model import Floats, Ints, Model
from multicor_cli.model.state import State

SKIN = 0.02
"""Gap up to which pairs become contacts, over the mean diameter."""

AHEAD = 1.5
"""Time steps within which a pair that is no contact may not close, with velocities before the
solve."""


@parallel_kernel
def measure_pairs(
    scene: Scene,
    row: NDArray[np.int64],
    partner: Ints,
    start: Floats,
    free: Floats,
    cutoff: float,
    gap: Floats,
    fastest: Floats,
) -> None:
    """Gaps of the listed pairs at q_m, and the largest approach speed below ``cutoff``.

    No pair farther apart than that can touch in this step [m]. **Modifies** ``gap`` [m] and
    ``fastest``: the largest approach speed in each chunk of grains, at the start or free [m/s]; 0
    if nothing approaches, shape ``(chunks, 1)``.
    """
    count = scene.radius.size
    for chunk in prange(fastest.shape[0]):
        best = 0.0
        for i in range(chunk * CHUNK, min(count, (chunk + 1) * CHUNK)):
            for p in range(row[i], row[i + 1]):
                j = partner[p]
                g, nx, ny = pair_geometry(scene, i, j)
                gap[p] = g
                if g < cutoff:
                    best = max(best, -normal_velocity(scene, start, i, j, nx, ny, g))
                    best = max(best, -normal_velocity(scene, free, i, j, nx, ny, g))
        fastest[chunk, 0] = best


@kernel
def leave_out(row: NDArray[np.int64], partner: Ints, i: Ints, j: Ints) -> tuple[Ints, Ints]:
    """The listed pairs without some pairs, sorted; listed are rows of grains, as in a list."""
    first, second = np.empty(partner.size, np.int32), np.empty(partner.size, np.int32)
    found, k = 0, 0
    for grain in range(row.size - 1):
        for p in range(row[grain], row[grain + 1]):
            while k < i.size and (i[k] < grain or (i[k] == grain and j[k] < partner[p])):
                k += 1
            if not (k < i.size and i[k] == grain and j[k] == partner[p]):
                first[found], second[found] = grain, partner[p]
                found += 1
    return first[:found].copy(), second[:found].copy()


@parallel_kernel
def find_closing(
    scene: Scene,
    i: Ints,
    j: Ints,
    start: Floats,
    end: Floats,
    cutoff: float,
    dt: float,
    reach: float,
) -> tuple[bool, float]:
    """Pairs that are no contacts although they close within ``dt`` or are within ``reach`` [m].

    ``start`` and ``end`` are velocities with either of which they may, ``cutoff`` a gap that no
    pair closes [m]. Returns whether there is any, and their largest approach speed [m/s].
    """
    found = np.zeros(((i.size + CHUNK - 1) // CHUNK, 2))
    for chunk in prange(found.shape[0]):
        count, fastest = 0.0, 0.0
        for k in range(chunk * CHUNK, min(i.size, (chunk + 1) * CHUNK)):
            gap, nx, ny = pair_geometry(scene, i[k], j[k])
            if gap <= reach:
                count += 1.0
            elif gap < cutoff:
                u_n = min(
                    normal_velocity(scene, start, i[k], j[k], nx, ny, gap),
                    normal_velocity(scene, end, i[k], j[k], nx, ny, gap),
                )
                if gap + dt * u_n < 0.0:
                    count += 1.0
                    fastest = max(fastest, -u_n)
        found[chunk, 0], found[chunk, 1] = count, fastest
    total, fastest = 0.0, 0.0
    for chunk in range(found.shape[0]):
        total += found[chunk, 0]
        fastest = max(fastest, found[chunk, 1])
    return total > 0.0, fastest


@kernel
def deepest_overlap(scene: Scene, i: Ints, j: Ints) -> float:
    """Largest overlap of pairs of a grain and a wall over its radius; 0 if there is none."""
    best = 0.0
    for k in range(i.size):
        if j[k] >= scene.radius.size:
            best = max(best, -pair_geometry(scene, i[k], j[k])[0] / scene.radius[i[k]])
    return best


class Selection:
    """The contacts of steps to come, and what lasts with them.

    Attributes:
        i: Grains, shape ``(c,)``.
        j: Grains or wall shapes, shape ``(c,)``; sorted by (i, j).
        tile: Column and row of the tile of each grain when they were sought, shape ``(n, 2)``.
        contacts: Their table, for each step to fill.
    """

    def __init__(self, model: Model, pairs: NeighborList) -> None:
        self._model, self._pairs = model, pairs
        self.i: Ints = np.empty(0, np.int32)
        self.j: Ints = np.empty(0, np.int32)
        self.tile: Ints = np.zeros((model.grain_count, 2), np.int32)
        self.contacts: Contacts = np.zeros(0, CONTACT)
        self._schedule: Schedule | None = None
        self._is_free: NDArray[np.bool_] = np.zeros(0, np.bool_)
        self._beside: tuple[Ints, Ints] | None = None
        self._builds = -1

    def take(self, state: State) -> None:
        """Go on with the contacts of a state, if they are not those that it was given."""
        if not (self.i is state.near_i and self.j is state.near_j and self.tile is state.tile):
            self._set(state.near_i, state.near_j, state.tile)

    def give(self, state: State) -> None:
        """Enter the contacts into a state."""
        state.near_i, state.near_j, state.tile = self.i, self.j, self.tile

    def seek(self, scene: Scene, margin: float) -> None:
        """Take all pairs with a gap up to ``margin`` [m], or to `SKIN`.

        The list is complete so far, and its gaps are those of the scene (`measure`).
        """
        pairs = self._pairs
        margin = max(margin, SKIN * self._model.mean_diameter)
        i, j = pairs_within(pairs.row, pairs.partner, pairs.gap, margin)
        self._set(i, j, lay_tiles(scene, i, j, self._model.mean_diameter))

    def _set(self, i: Ints, j: Ints, tile: Ints) -> None:
        self.i, self.j, self.tile = i, j, tile
        self.contacts = np.zeros(i.size, CONTACT)
        self.contacts["i"], self.contacts["j"] = i, j
        self._schedule = self._beside = None

    def measure(self, scene: Scene, start: Floats, free: Floats, cutoff: float) -> float:
        """Gaps into the list; returns the largest approach speed below ``cutoff`` [m/s]."""
        pairs, fastest = self._pairs, chunks_for(self._model.grain_count)
        measure_pairs(scene, pairs.row, pairs.partner, start, free, cutoff, pairs.gap, fastest)
        return float(fastest.max())

    def schedule(self, scene: Scene, wall_is_free: NDArray[np.bool_]) -> Schedule:
        """Order and places of the contacts; ``wall_is_free`` marks walls that loads move."""
        if self._schedule is None or not np.array_equal(self._is_free, wall_is_free):
            self._schedule = schedule_contacts(scene, self.i, self.j, self.tile, wall_is_free)
            self._is_free = wall_is_free
        return self._schedule

    @property
    def beside(self) -> tuple[Ints, Ints]:
        """The listed pairs that are no contacts."""
        pairs = self._pairs
        if self._beside is None or self._builds != pairs.builds:
            self._beside = leave_out(pairs.row, pairs.partner, self.i, self.j)
            self._builds = pairs.builds
        return self._beside

    def closing(
        self, scene: Scene, start: Floats, end: Floats, cutoff: float, dt: float, reach: float
    ) -> tuple[bool, float]:
        """As `find_closing`, of all pairs; the list is complete up to ``cutoff`` and ``reach``."""
        return find_closing(scene, *self.beside, start, end, cutoff, dt, reach)

    def overlap_beside(self, scene: Scene) -> float:
        """Largest overlap at the end of a step of pairs that are no contacts, over the radius.

        They did not close within the step: on a straight way a gap between discs is convex, so they
        are apart. Pieces of walls may turn or curve.
        """
        return deepest_overlap(scene, *self.beside)
