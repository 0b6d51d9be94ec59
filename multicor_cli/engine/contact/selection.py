"""Which pairs are contacts: all that are near at one moment, and who comes late until the next.

What lasts with them is not made in every step: the order in which they are relaxed, their places in
the arrays of the sweep, and the list of the pairs beside them. The state holds which they are, so
that a run which goes on from a checkpoint makes the same steps.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.contact.contacts import (
    CONTACT,
    Contacts,
    fix_lanes,
    normal_velocity,
    recall_impulses,
    tabulate,
)
from multicor_cli.engine.contact.faces import (
    NO_FACES,
    carried_points,
    make_room,
    recall_points,
    rows_of_faces,
)
from multicor_cli.engine.contact.impacts import Impacts, enter_impacts, take_back
from multicor_cli.engine.contact.late import (
    closing_soon,
    contacts_with_walls,
    make_rows,
    merge_late,
    place_late,
)
from multicor_cli.engine.contact.ordering import Schedule, lay_tiles, schedule_contacts, span_of
from multicor_cli.engine.contact.sweep import System
from multicor_cli.engine.contact.system import carried
from multicor_cli.engine.geometry.neighbors import NeighborList
from multicor_cli.engine.geometry.outlines import circle_gap, room_within, true_gap
from multicor_cli.engine.geometry.passing import fastest_points
from multicor_cli.engine.geometry.pieces import Pieces, are_faces
from multicor_cli.engine.geometry.scene import Scene, are_apart, pair_geometry
from multicor_cli.engine.jit.arrays import CHUNK
from multicor_cli.engine.jit.compile import inlined, kernel, parallel_kernel, prange
from multicor_cli.engine.jit.vectors import LANES
from multicor_cli.model.model import ContactLaws, Floats, Ints, Model
from multicor_cli.model.state import State

SKIN, LASTS = 0.05, 3.0
"""Gap up to which pairs become contacts: over the mean diameter; among grains that are no discs
over the way of the fastest pair in a step, too."""

AHEAD = 1.1
"""Time steps within which a pair that is no contact may not close, with velocities before the
solve."""

SOON = 6.0
"""Time steps within which pairs of discs close that become contacts whatever their gap."""

LATE_SHARE = 1.0 / 16.0
"""Contacts that come after the others were sought, over all; with more of them all are sought."""

MOST, _FEW, OFTEN = 4.0, 16, 8
"""Contacts over the number of grains (and a few) with more of which they are sought anew, and in
which steps: discs have six neighbors in the mean, so that three contacts would do."""


@parallel_kernel
def look_at_pairs(
    scene: Scene, pieces: Pieces | None, row: NDArray[np.int64], partner: Ints, start: Floats,
    free: Floats, cutoff: float, margin: float, dt: float, gap: Floats,
) -> float:  # fmt: skip
    """Largest speed of approach of the listed pairs with a gap below ``cutoff`` [m], or 0 [m/s].

    At q_m, with the velocities ``start`` or ``free``, whichever approach faster; of grains that are
    no discs a bound. The gaps [m] of listed pairs of discs go into ``gap``, **modified**: of those
    up to ``margin``, or that close within ``dt`` from below the cutoff; infinity of all others.
    """
    count = scene.radius.size
    fastest = np.zeros((count + CHUNK - 1) // CHUNK)
    for chunk in prange(fastest.size):
        best = 0.0
        for i in range(chunk * CHUNK, min(count, (chunk + 1) * CHUNK)):
            for p in range(row[i], row[i + 1]):
                j, u_n = partner[p], 0.0
                g, nx, ny = pair_geometry(scene, i, j)
                if g < cutoff:
                    u_n = min(
                        closing_velocity(scene, pieces, start, i, j, nx, ny, g),
                        closing_velocity(scene, pieces, free, i, j, nx, ny, g),
                    )
                    best = max(best, -u_n)
                if gap.size:
                    gap[p] = g if g <= margin or (u_n < 0.0 and g + dt * u_n < 0.0) else np.inf
        fastest[chunk] = best
    best = 0.0
    for chunk in range(fastest.size):
        best = max(best, fastest[chunk])
    return best


@inlined
def closing_velocity(
    scene: Scene, pieces: Pieces | None, velocity: Floats, i: int, j: int, nx: float, ny: float,
    gap: float,
) -> float:  # fmt: skip
    """`normal_velocity` of a pair that is no contact; a bound if one is no disc [m/s].

    No two points of such a pair approach faster, whatever its normal.
    """
    if pieces is not None and are_faces(pieces, i, j):
        return -fastest_points(scene, pieces, velocity, i, j)
    return normal_velocity(scene, velocity, i, j, nx, ny, gap)


@kernel
def points_up_to(
    scene: Scene, pieces: Pieces, row: NDArray[np.int64], partner: Ints, margin: float
) -> tuple[Ints, Ints, Ints]:
    """Listed pairs with a gap up to ``margin``, and the number of points that each has room for.

    That is 1 of discs.
    """
    first, second = np.empty(partner.size, np.int32), np.empty(partner.size, np.int32)
    room, found = np.empty(partner.size, np.int32), 0
    for i in range(row.size - 1):
        for p in range(row[i], row[i + 1]):
            j = partner[p]
            if circle_gap(scene, i, j) > margin:
                continue
            count = 0
            if are_faces(pieces, i, j):
                count = room_within(scene, pieces, i, j, margin)
            elif pair_geometry(scene, i, j)[0] <= margin:
                count = 1
            first[found], second[found], room[found] = i, j, count
            found += count > 0
    return first[:found].copy(), second[:found].copy(), room[:found].copy()


@kernel
def near_pairs(
    scene: Scene, row: NDArray[np.int64], partner: Ints, gap: Floats
) -> tuple[Ints, Ints, Ints, Ints, float]:
    """Grains i, and grains or wall shapes j, of the listed pairs with a finite ``gap``.

    Then the other listed pairs, and the largest distance between the centers of two grains of the
    first [m]. Gaps are those of `look_at_pairs`.
    """
    grains, span = row.size - 1, 0.0
    first, second = np.empty(partner.size, np.int32), np.empty(partner.size, np.int32)
    beside_i, beside_j = np.empty(partner.size, np.int32), np.empty(partner.size, np.int32)
    found, beside = 0, 0
    for i in range(grains):
        for p in range(row[i], row[i + 1]):
            # Nobody could guess which are near: each is written, and the next over it
            j, is_near = partner[p], gap[p] < np.inf
            first[found], second[found] = i, j
            beside_i[beside], beside_j[beside] = i, j
            found += is_near
            beside += not is_near
            if is_near and j < grains:
                span = max(span, scene.radius[i] + scene.radius[j] + gap[p])
    return (
        first[:found].copy(), second[:found].copy(), beside_i[:beside].copy(),
        beside_j[:beside].copy(), span,
    )  # fmt: skip


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


@inlined
def beside_gap(
    scene: Scene, pieces: Pieces | None, i: int, j: int, cutoff: float
) -> tuple[float, float, float]:
    """Gap and normal of a pair, the true gap of grains that are no discs and nearer than that."""
    if pieces is not None and are_faces(pieces, i, j):
        apart = circle_gap(scene, i, j)
        if apart < cutoff:
            return true_gap(scene, pieces, i, j)
        if j < scene.radius.size:
            return apart, 0.0, 1.0
    return pair_geometry(scene, i, j)


@parallel_kernel
def find_closing(
    scene: Scene, pieces: Pieces | None, i: Ints, j: Ints, start: Floats, end: Floats,
    cutoff: float, dt: float, reach: float,
) -> tuple[bool, float]:  # fmt: skip
    """Pairs that are no contacts although they close within ``dt`` or are within ``reach`` [m].

    ``start`` and ``end`` are velocities with either of which they may, ``cutoff`` a gap that no
    pair closes [m], not below the reach. Returns whether there is any, and their largest approach
    speed [m/s].
    """
    found = np.zeros(((i.size + CHUNK - 1) // CHUNK, 2))
    for chunk in prange(found.shape[0]):
        count, fastest = 0.0, 0.0
        for k in range(chunk * CHUNK, min(i.size, (chunk + 1) * CHUNK)):
            if pieces is None and are_apart(scene, i[k], j[k], cutoff):
                continue
            gap, nx, ny = beside_gap(scene, pieces, i[k], j[k], cutoff)
            if gap <= reach:
                count += 1.0
            elif gap < cutoff:
                u_n = min(
                    closing_velocity(scene, pieces, start, i[k], j[k], nx, ny, gap),
                    closing_velocity(scene, pieces, end, i[k], j[k], nx, ny, gap),
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
def deepest_overlap(scene: Scene, pieces: Pieces | None, i: Ints, j: Ints) -> float:
    """Largest overlap of pairs of a grain and a wall over its radius; 0 if there is none."""
    best = 0.0
    for k in range(i.size):
        best = max(best, -true_gap(scene, pieces, i[k], j[k])[0] / scene.radius[i[k]])
    return best


@kernel
def deep_pairs(
    depth: Floats, slot: Ints, of_walls: Ints, i: Ints, j: Ints, least: float
) -> tuple[Ints, Ints, float]:
    """Those of the pairs (i, j) that overlap by more than ``least``, and all with walls.

    ``least`` is not negative; ``depth``, ``slot`` and ``of_walls`` are those of a `Schedule`. Also
    returns the largest overlap of all others, over the smaller radius; 0 if there is none.
    """
    is_deep, found, below = np.zeros(i.size, np.bool_), of_walls.size, 0.0
    for k in range(of_walls.size):
        is_deep[of_walls[k]] = True
    for q in range(depth.shape[0]):
        deepest = depth[q, 0]
        for lane in range(1, LANES):
            deepest = max(deepest, depth[q, lane])
        if deepest <= least:
            below = max(below, deepest)
            continue
        for lane in range(LANES):
            if depth[q, lane] > least:
                is_deep[slot[q, lane]] = True
                found += 1
            else:
                below = max(below, depth[q, lane])
    first, second, at = np.empty(found, np.int32), np.empty(found, np.int32), 0
    for c in range(i.size):
        if is_deep[c]:
            first[at], second[at] = i[c], j[c]
            at += 1
    return first, second, below


_OF_SOME_LAWS = "attraction", "mu_r", "arm", "u_r", "p_r"
_BLANK = np.zeros(1, CONTACT)
_NO_ROOM, _NO_FACES = np.empty(0, np.int32), np.empty(0, np.bool_)


class Selection:
    """The contacts of steps to come, and what lasts with them.

    Attributes:
        i: Grains, shape ``(c,)``.
        j: Grains or wall shapes, shape ``(c,)``; sorted by (i, j).
        pair_i: The same with each pair once; else it has room for all its points.
        pair_j: Likewise.
        room: Number of points of each pair for which there is room; of size 0 among discs.
        faces: Pairs of which one is no disc, and their room.
        late: Which pairs came late, and in what order: `near_late` of a state.
        tile: Column and row of the tile of each grain when they were sought, shape ``(n, 2)``.
        contacts: Their table, for each step to fill.
    """

    def __init__(self, model: Model, pairs: NeighborList, pieces: Pieces | None = None) -> None:
        self._model, self._pairs, self._pieces = model, pairs, pieces
        self._has_corners = pieces is not None and bool(pieces.is_face.any())
        self.pair_i: Ints = np.empty(0, np.int32)
        self.pair_j: Ints = np.empty(0, np.int32)
        self.room, self.faces, self.late = _NO_ROOM, NO_FACES, _NO_ROOM
        self.i: Ints = np.empty(0, np.int32)
        self.j: Ints = np.empty(0, np.int32)
        self.tile: Ints = np.zeros((model.grain_count, 2), np.int32)
        self._table: Contacts = np.zeros(0, CONTACT)  # with spare rows
        self.contacts = self._table
        self._schedule: Schedule | None = None
        self._whole: Schedule | None = None  # with spare batches
        self._system: System | None = None
        self._is_free: NDArray[np.bool_] = np.zeros(0, np.bool_)
        self._laws: ContactLaws | None = None
        self._writers: ContactLaws | None = None  # laws that have written into the table
        self._impulse: Floats = np.empty((0, 2))  # what the lanes hold, as in the state
        self._entered: tuple[Ints, Floats] | None = None  # impacts, and what they hold beside them
        self._beside: tuple[Ints, Ints] | None = None
        self._walls_beside = self.i, self.j
        self._builds = -1

    def take(self, state: State) -> None:
        """Go on with the contacts of a state, if they are not those that it was given."""
        is_same = self.pair_i is state.near_i and self.pair_j is state.near_j
        if not (is_same and self.tile is state.tile):
            self._set(state.near_i, state.near_j, state.tile, state.near_points, state.near_late)

    def give(self, state: State) -> None:
        """Enter the contacts, and those that carry an impulse, into a state."""
        lanes = self.lanes
        of_lanes = self.i, self.j, lanes.lane, lanes.impulse, self.contacts
        if self._pieces is None:
            self.enter_carried(state, *carried(self._model.grain_count, *of_lanes))
        else:
            self.enter_carried(state, *carried_points(*of_lanes))

    def enter_carried(
        self, state: State, i: Ints, j: Ints, impulse: Floats, point: Ints | None = None
    ) -> None:
        """As `give`: (i, j) are the contacts that carry an ``impulse``, at a ``point`` of faces."""
        state.near_i, state.near_j, state.tile = self.pair_i, self.pair_j, self.tile
        state.near_points, state.near_late = self.room, self.late
        state.contact_i, state.contact_j = i, j
        if point is not None:
            state.contact_point = point
        self._impulse = state.contact_impulse = impulse

    def tabulate(self) -> None:
        """Contacts of two discs into the table, which else holds those with walls, and faces."""
        lanes = self.lanes
        tabulate(
            self._model.grain_count, self.i, self.j, lanes.lane, lanes.frame, lanes.impulse,
            lanes.before, lanes.gap, lanes.branch, self.contacts,
        )  # fmt: skip

    def enter(self, impacts: Impacts, scene: Scene, after: Floats) -> Floats:
        """Impacts before the solve into the contacts; returns the virial, as `enter_impacts`."""
        if not impacts.i.size:
            return np.zeros(4)
        lanes = self.lanes
        rows, known, virial = enter_impacts(
            scene, impacts, self.i, self.j, after, lanes.lane, lanes.frame, lanes.impulse,
            lanes.before, lanes.gap, lanes.branch, self.contacts,
        )  # fmt: skip
        self.note_impacts(rows, known)
        return virial

    def note_impacts(self, rows: Ints, known: Floats) -> None:
        """Contacts ``rows`` have impulses of impacts, beside what is ``known``: see `enter`."""
        self._entered = rows, known

    def _take_back(self) -> None:
        """Impulses of impacts are not those that the next step begins with."""
        if self._entered is not None:
            lanes = self.lanes
            take_back(
                *self._entered, self._model.grain_count, self.j, lanes.lane, lanes.impulse,
                self.contacts,
            )  # fmt: skip
            self._entered = None

    def seek(
        self, scene: Scene, pieces: Pieces | None, start: Floats, free: Floats, cutoff: float,
        dt: float, reach: float, least: float,
    ) -> float:  # fmt: skip
        """Take all pairs with a gap up to a margin, ``least`` [m] or more, and that close soon.

        The list has been looked at in this scene; ``pieces`` are as they lie, other arguments as
        those of `closing`. Returns the margin: among grains that are no discs it is greater where
        they are fast.
        """
        pairs, diameter = self._pairs, self._model.mean_diameter
        margin = max(least, reach + SKIN * diameter)
        if margin > pairs.complete:
            pairs.update(scene, margin)
        gap = np.empty(0 if self._has_corners else pairs.partner.size)
        fastest = look_at_pairs(
            scene, pieces, pairs.row, pairs.partner, start, free, cutoff, margin, SOON * dt, gap
        )
        if pieces is None or not self._has_corners:
            i, j, *beside, span = near_pairs(scene, pairs.row, pairs.partner, gap)
            self._set(i, j, lay_tiles(scene, span, diameter), self._one_each(i.size))
            self._lay_beside(*beside)
            return margin
        margin = max(margin, reach + LASTS * dt * fastest)
        if margin > pairs.complete:
            pairs.update(scene, margin)
        i, j, room = points_up_to(scene, pieces, pairs.row, pairs.partner, margin)
        self._set(i, j, lay_tiles(scene, span_of(scene, i, j), diameter), room)
        return margin

    def add(self, scene: Scene, impacts: Impacts) -> None:
        """Take pairs that have had impacts too, wherever they are in the middle of the step."""
        pairs = np.unique(
            np.column_stack([np.append(self.i, impacts.i), np.append(self.j, impacts.j)]), axis=0
        )
        i, j = np.ascontiguousarray(pairs.T)
        tile = lay_tiles(scene, span_of(scene, i, j), self._model.mean_diameter)
        self._set(i, j, tile, _NO_ROOM)

    def _one_each(self, count: int) -> Ints:
        """Room for the points of so many pairs of discs."""
        return _NO_ROOM if self._pieces is None else np.ones(count, np.int32)

    def receive(
        self, scene: Scene, wall_is_free: NDArray[np.bool_], laws: ContactLaws, start: Floats,
        free: Floats, state: State, cutoff: float, dt: float, reach: float,
    ) -> bool:  # fmt: skip
        """Take pairs of discs that close soon, too; False if contacts are to be sought instead.

        Arguments as those of `schedule`, of which ``bodies`` are ``start``, and of `closing`.
        """
        if self._has_corners:
            return False
        first, second, *beside = closing_soon(
            scene, *self.beside, start, free, cutoff, SOON * dt, reach
        )
        if np.count_nonzero(self.late) + first.size > LATE_SHARE * self.i.size:
            return False
        old, grains = self.schedule(scene, wall_is_free, laws, start, state), scene.radius.size
        whole = self._whole
        assert whole is not None  # `schedule` has made it
        i, j, late, lane, to, new = merge_late(
            self.i, self.j, self.late, first, second, old.lane, old.slot
        )
        room = place_late(
            new, i, j, whole.place, wall_is_free[scene.wall], whole.velocity.shape[0], *whole.room,
            whole.slot, whole.pair, lane,
        )  # fmt: skip
        if room[1] < 0:
            return False
        make_rows(self._table, _BLANK, i, j, to, new, grains)
        self._whole = whole.with_late(room, lane, *contacts_with_walls(j, lane, grains, room[3]))
        schedule, last = self._whole.cut(), room[0]
        fix_lanes(
            scene, laws, start, i, j, schedule.slot[last:], schedule.about[last:],
            schedule.frame[last:],
        )  # fmt: skip
        self.i, self.j = self.pair_i, self.pair_j = i, j
        self.room, self.late = self._one_each(i.size), late
        self._schedule, self._system = schedule, None
        self.contacts, self._impulse = self._table[: i.size], state.contact_impulse
        if self._pieces is not None:
            self._name_rows(slice(None))
        self._lay_beside(*beside)
        return True

    def is_crowded(self, state: State) -> bool:
        """Whether far more pairs of discs are contacts than can be, as they were fast when sought.

        Not in every step: among grains of very different sizes that may be so for good.
        """
        if self._has_corners or state.step % OFTEN != 0:
            return False
        return self.i.size > MOST * (self._model.grain_count + _FEW)

    def _set(self, i: Ints, j: Ints, tile: Ints, room: Ints, late: Ints = _NO_ROOM) -> None:
        self.i, self.j, self.tile = self.pair_i, self.pair_j, _ = i, j, tile
        self.room, self.faces, self.late = room, NO_FACES, late
        if self._pieces is not None:
            self.i, self.j, self.faces = make_room(self._pieces, i, j, room)
        spare = 0 if self._has_corners else int(2.0 * LATE_SHARE * self.i.size)
        self._table = np.zeros(self.i.size + spare, CONTACT)
        self.contacts = self._table[: self.i.size]
        # Two discs have their rows when these are asked for: memory that nobody looks at costs most
        self._name_rows(slice(None) if self._pieces is not None else j >= self._model.grain_count)
        self._schedule = self._whole = self._system = None
        self._beside = self._entered = self._writers = None
        self._impulse = np.empty((0, 2))

    def _name_rows(self, rows: slice | NDArray[np.bool_]) -> None:
        self.contacts["i"][rows], self.contacts["j"][rows] = self.i[rows], self.j[rows]
        self.contacts["key"][rows] = -1

    def schedule(
        self, scene: Scene, wall_is_free: NDArray[np.bool_], laws: ContactLaws, bodies: Floats,
        state: State,
    ) -> Schedule:  # fmt: skip
        """Order and places of the contacts, which hold the impulses of the last step.

        The lanes know them unless ``state`` has another array of impulses than it was given.

        ``wall_is_free`` marks walls that loads move; ``bodies`` have inverse masses in their last
        column.
        """
        if state.radius.size:  # lanes hold what follows from radii
            self._laws = None
        schedule = self._schedule
        is_same = self._is_free is wall_is_free or np.array_equal(self._is_free, wall_is_free)
        if schedule is None or not is_same:
            came = np.argsort(self.late, kind="stable")
            late: Ints = came[came.size - np.count_nonzero(self.late) :].astype(np.int32)
            self._whole = schedule_contacts(
                scene, self.i, self.j, self.tile, wall_is_free, self._are_faces(), late
            )
            schedule = self._whole.cut()
            self._laws, self._impulse = None, np.empty((0, 2))
            self._entered = self._system = None
            self._schedule = schedule
        self._is_free = wall_is_free
        if self._laws is not laws:
            fix_lanes(
                scene, laws, bodies, self.i, self.j, schedule.slot, schedule.about, schedule.frame
            )
            if self._writers is not laws:
                # Laws without adhesion or rolling resistance do not look at these in a step
                for name in _OF_SOME_LAWS if self._writers is not None else ():
                    self.contacts[name] = 0.0
            self._laws = self._writers = laws
        self._take_back()
        if self._impulse is not state.contact_impulse:
            recall_impulses(
                state.contact_i, state.contact_j, state.contact_impulse, self._model.grain_count,
                self.i, self.j, schedule.lane, schedule.impulse, self.contacts,
            )  # fmt: skip
            if self.faces.first.size:
                recall_points(
                    state.contact_i, state.contact_j, state.contact_impulse, state.contact_point,
                    self.faces, self.contacts,
                )  # fmt: skip
        # A step that is not finished leaves others behind
        self._impulse = np.empty((0, 2))
        return schedule

    def go_on(self, state: State, laws: ContactLaws, wall_is_free: NDArray[np.bool_]) -> bool:
        """Begin a step with what the lanes hold; False, and nothing is done, if it is not theirs.

        Then contacts are those of another state, or `schedule` would change their lanes.
        """
        is_same = self.pair_i is state.near_i and self.tile is state.tile
        is_known = self._impulse is state.contact_impulse
        is_laid = self._schedule is not None and self._is_free is wall_is_free
        if not (is_same and is_known and is_laid and self._laws is laws) or self.is_crowded(state):
            return False
        self._take_back()
        # A step that is not finished leaves others behind
        self._impulse = np.empty((0, 2))
        return True

    def wait(self, state: State) -> None:
        """Go on from `go_on` as if it had not been asked: nothing has changed the lanes since."""
        self._impulse = state.contact_impulse

    def system(self, spin_factor: float) -> System:
        """The problem in these lanes, as `Schedule.system`."""
        if self._system is None:
            self._system = self.lanes.system(spin_factor, self.contacts.size)
        return self._system

    def _are_faces(self) -> NDArray[np.bool_]:
        if self._pieces is None or not self.faces.first.size:
            return _NO_FACES
        return rows_of_faces(self._pieces.is_face, self.i, self.j)

    def pairs_with(self, chosen: NDArray[np.bool_]) -> tuple[Ints, Ints]:
        """Pairs of grains with corners that are ``chosen``, shape ``(f,)``, and all others."""
        kept = np.ones(self.pair_i.size, np.bool_)
        kept[self.faces.pair] = chosen
        return self.pair_i[kept], self.pair_j[kept]

    @property
    def lanes(self) -> Schedule:
        """The schedule of the present step."""
        assert self._schedule is not None  # `schedule` has made it
        return self._schedule

    @property
    def beside(self) -> tuple[Ints, Ints]:
        """The listed pairs that are no contacts."""
        pairs = self._pairs
        if self._beside is None or self._builds != pairs.builds:
            of_list = leave_out(pairs.row, pairs.partner, self.pair_i, self.pair_j)
            return self._lay_beside(*of_list)
        return self._beside

    def _lay_beside(self, i: Ints, j: Ints) -> tuple[Ints, Ints]:
        is_wall = j >= self._model.grain_count
        self._walls_beside, self._builds = (i[is_wall], j[is_wall]), self._pairs.builds
        self._beside = i, j
        return self._beside

    @property
    def walls_beside(self) -> tuple[Ints, Ints]:
        """Those of them with walls."""
        assert self.beside  # makes both
        return self._walls_beside

    def closing(
        self, scene: Scene, pieces: Pieces | None, start: Floats, end: Floats, cutoff: float,
        dt: float, reach: float,
    ) -> tuple[bool, float]:  # fmt: skip
        """As `find_closing`, of all pairs; the list is complete up to ``cutoff`` and ``reach``."""
        return find_closing(scene, pieces, *self.beside, start, end, cutoff, dt, reach)

    def deep_pairs(self, least: float) -> tuple[Ints, Ints, float]:
        """As `deep_pairs` of a step of discs with walls, by what its lanes have been told."""
        lanes = self.lanes
        return deep_pairs(lanes.depth, lanes.slot, lanes.of_walls, self.i, self.j, least)

    def with_walls(self) -> tuple[Ints, Ints]:
        """The contacts, and `walls_beside` as the step has looked at them."""
        i, j = self._walls_beside
        return np.concatenate([self.pair_i, i]), np.concatenate([self.pair_j, j])
