"""Puts the contacts of a step into the arrays of the sweep, and takes them out again."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.contact.adhesion import net_impulses
from multicor_cli.engine.contact.contacts import Contacts, Speeds, contact_after
from multicor_cli.engine.contact.face_sweep import FaceBatches
from multicor_cli.engine.contact.faces import (
    General,
    batch_points,
    blocks_for,
    pack_faces,
    pack_row,
    unpack_points,
)
from multicor_cli.engine.contact.impacts import Impacts
from multicor_cli.engine.contact.ordering import Schedule, make_batches, rows_of_general
from multicor_cli.engine.contact.rolling import couples_of, pack_couples
from multicor_cli.engine.contact.sweep import NO_CELL, CellTerms, System, add_impulses
from multicor_cli.engine.contact.vector_step import begin_lanes
from multicor_cli.engine.geometry.scene import Scene
from multicor_cli.engine.jit.arrays import CHUNK, aligned, copy_row
from multicor_cli.engine.jit.compile import kernel, parallel_kernel, prange
from multicor_cli.engine.jit.vectors import BATCHES, LANES
from multicor_cli.model.columns import (
    BELT,
    BIAS,
    FIRST,
    INVERSE_MASS,
    MASS,
    MU,
    NORMAL,
    NX,
    NY,
    RADIUS,
    SECOND,
    SPIN,
    SURFACE,
    TANGENTIAL,
    X,
    Y,
)
from multicor_cli.model.contacts import ContactTable
from multicor_cli.model.model import Floats, Ints

# ---- Diagonal contacts in plain rows, one after the other, and in the batches of a `System`


class OneByOne(NamedTuple):
    """Diagonal contacts in the order of the sweep, a row for each; fields as in `System`."""

    pair: Ints
    frame: Floats
    impulse: Floats


def flatten(system: System) -> OneByOne:
    """The diagonal contacts, copied, in an order of which their batches make the same sweep."""
    has = system.slot.reshape(-1) >= 0
    pair, frame, impulse = (
        _rows(blocks)[has] for blocks in (system.pair, system.frame, system.impulse)
    )
    return OneByOne(
        np.ascontiguousarray(pair // 4), np.ascontiguousarray(frame), np.ascontiguousarray(impulse)
    )


def one_tile(contacts: OneByOne, velocity: Floats, inverse: Floats, spin_factor: float) -> System:
    """Contacts, in the order of the sweep, as a system of one tile; ``slot`` names their rows."""
    bodies = velocity.shape[0]
    slot, start = make_batches(contacts.pair, np.array([0, len(contacts.pair)]), bodies)
    has = slot.reshape(-1) >= 0
    rows = slot.reshape(-1)[has]
    pair = np.empty((has.size, 2), np.int32)
    frame, impulse = np.zeros((has.size, 5)), np.zeros((has.size, 2))
    pair[:] = bodies, bodies + 1  # of the lanes without contact: nothing moves them
    frame[:, MASS] = 1.0
    pair[has], frame[has] = contacts.pair[rows], contacts.frame[rows]
    impulse[has] = contacts.impulse[rows]
    full = aligned((bodies + 2, 4))
    full[:bodies], full[bodies:] = velocity, 0.0
    return System(
        full, inverse, slot, _blocks(4 * pair), _blocks(frame), _blocks(impulse), start,
        np.array([0, 1]), *rows_of_general(0), spin_factor, len(contacts.pair),
    )  # fmt: skip


def by_slot(slot: Ints, impulse: Floats, count: int) -> Floats:
    """Impulses of ``count`` contacts, as ``slot`` numbers them, shape ``(count, 2)``."""
    has = slot.reshape(-1) >= 0
    result = np.zeros((count, 2))
    result[slot.reshape(-1)[has]] = _rows(impulse)[has]
    return result


def _rows(blocks: NDArray[Any]) -> NDArray[Any]:
    """A row for each lane from blocks of shape ``(q, columns, 4)``."""
    return blocks.transpose(0, 2, 1).reshape(-1, blocks.shape[1])


def _blocks(rows: NDArray[Any]) -> NDArray[Any]:
    """The reverse of `_rows`."""
    columns = rows.shape[1]
    blocks = aligned((rows.shape[0] // LANES, columns, LANES), rows.dtype.type)
    blocks[:] = rows.reshape(-1, LANES, columns).transpose(0, 2, 1)
    return blocks


# ---- To the arrays of the sweep and back: once a step, and memory is what takes time


@parallel_kernel
def pack_bodies(
    scene: Scene, before: Floats, free: Floats, place: Ints, velocity: Floats, start: Floats,
    middle: Floats,
) -> None:  # fmt: skip
    """Copy bodies into the rows of a `Schedule`: grains to their ``place``, then walls.

    Velocities at the start of the step ``before``, and ``free`` ones, have shape ``(n + w, 4)``.
    """
    bodies, grains = free.shape[0], place.size
    for chunk in prange((bodies + CHUNK - 1) // CHUNK):
        for b in range(chunk * CHUNK, min(bodies, (chunk + 1) * CHUNK)):
            row = np.int64(place[b]) if b < grains else np.int64(b)
            copy_row(velocity, row, free, b)
            copy_row(start, row, before, b)
            if b < grains:
                middle[row, X], middle[row, Y] = scene.position[b, X], scene.position[b, Y]
                middle[row, RADIUS] = scene.radius[b]
            else:
                # The inverse masses of walls stand elsewhere, and their surfaces in the contacts
                velocity[row, INVERSE_MASS] = 0.0


@parallel_kernel
def begin_grains(
    middle: Floats, start: Floats, pair: Ints, about: Floats, frame: Floats, impulse: Floats,
    before: Floats, gap: Floats, branch: Floats, dt: float, ratio: float, period: float,
    height: float, tilt: float, xx: float, yy: float, xy: float,
) -> Speeds:  # fmt: skip
    """Everything of the contacts of two grains but friction that varies, adhesion and rolling.

    Arrays of `Schedule`; ``ratio`` is that of this time step to the last, by which impulses change.
    ``period``, ``height`` and ``tilt`` are those of a `Scene`, and (xx, yy, xy) the gradient at the
    start of the step, where it is a cell. **Modifies** ``frame``, ``impulse``, ``before``, ``gap``
    and ``branch``.
    """
    batches, half = pair.shape[0], 0.5 * period if period > 0.0 else np.inf
    sums = np.zeros(((batches + BATCHES - 1) // BATCHES, 6))
    for chunk in prange(sums.shape[0]):
        last = min(batches, (chunk + 1) * BATCHES)
        (
            sums[chunk, 0], sums[chunk, 1], sums[chunk, 2], sums[chunk, 3], sums[chunk, 4],
            sums[chunk, 5],
        ) = begin_lanes(
            chunk * BATCHES, last, middle.reshape(-1), start.reshape(-1), pair.reshape(-1),
            about.reshape(-1), frame.reshape(-1), impulse.reshape(-1), before.reshape(-1),
            gap.reshape(-1), dt, period, half, ratio, branch.reshape(-1), height, tilt, xx, yy, xy,
        )  # fmt: skip
    total = np.zeros(6)
    for chunk in range(sums.shape[0]):
        for k in range(6):
            total[k] += sums[chunk, k]
    return Speeds(total[0], total[1], total[2], total[3], total[4], total[5])


@kernel
def place_walls(
    scene: Scene, contacts: Contacts, belt: Floats, walls: Ints, lane: Ints, pair: Ints,
    velocity: Floats, frame: Floats, impulse: Floats,
) -> None:  # fmt: skip
    """Copy contacts with walls into their lanes, and give their proxies velocities.

    Arrays as in `Schedule`; ``velocity``, ``frame`` and ``impulse`` are **modified**. ``belt`` as
    in `OrderedSystem`.
    """
    n = scene.radius.size
    for k in range(walls.size):
        contact, q, column = contacts[walls[k]], lane[walls[k]] // LANES, lane[walls[k]] % LANES
        i, j = pair[q, FIRST, column] // 4, pair[q, SECOND, column] // 4
        wall = n + scene.wall[contact.j - n]
        velocity[j, X] = velocity[wall, X] - velocity[wall, SURFACE] * contact.lever_y
        velocity[j, Y] = velocity[wall, Y] + velocity[wall, SURFACE] * contact.lever_x
        velocity[j, SURFACE] = belt[wall - n]
        velocity[j, INVERSE_MASS] = 0.0
        frame[q, NX, column], frame[q, NY, column] = contact.nx, contact.ny
        frame[q, MASS, column] = 1.0 / velocity[i, INVERSE_MASS]
        frame[q, BIAS, column], frame[q, MU, column] = contact.bias, contact.mu
        impulse[q, NORMAL, column], impulse[q, TANGENTIAL, column] = contact.p_n, contact.p_t


@kernel
def inverse_masses(
    velocity: Floats, wall_inverse: Floats, spin_factor: float, inverse: Floats
) -> None:
    """Inverse masses of all degrees of freedom into ``inverse``, **modified**, as in `System`."""
    grains = inverse.shape[0] - wall_inverse.shape[0]
    for row in range(grains):
        inverse[row, X] = inverse[row, Y] = velocity[row, INVERSE_MASS]
        inverse[row, SPIN] = spin_factor * velocity[row, INVERSE_MASS]
    for w in range(wall_inverse.shape[0]):
        for d in range(3):
            inverse[grains + w, d] = wall_inverse[w, d]


@kernel
def pack_general(
    scene: Scene, contacts: Contacts, belt: Floats, place: Ints, general: Ints, inverse: Floats,
    pair: Ints, frame: Floats, lever: Floats, impulse: Floats,
) -> None:  # fmt: skip
    """Rows of the contacts with walls that have a free degree of freedom, as in `System`.

    ``general`` are these contacts, ``inverse`` as in `System`, ``belt`` as in `OrderedSystem`.
    **Modifies** bodies ``(g, 2)``, frames ``(g, 8)``, levers ``(g, 2, 2)``, impulses ``(g, 2)``,
    and the turns in ``contacts``.
    """
    for g in range(general.size):
        contact = contacts[general[g]]
        nx, ny, lx, ly = contact.nx, contact.ny, contact.lever_x, contact.lever_y
        # Grains add −s to u_t; walls −Ω (l_x n_y − l_y n_x) to u_n, −Ω (l_x n_x + l_y n_y) to u_t
        contact.turn_in, contact.turn_it = 0.0, -1.0
        contact.turn_jn, contact.turn_jt = lx * ny - ly * nx, lx * nx + ly * ny
        pack_row(g, general[g], scene, contacts, belt, place, inverse, pair, frame, lever, impulse)


@parallel_kernel
def unpack_bodies(velocity: Floats, place: Ints, belt: Floats, walls: int) -> Floats:
    """v⁺ of grains and walls from the rows of the sweep, shape ``(n + w, 4)``."""
    grains = place.size
    after = np.empty((grains + walls, 4))
    for chunk in prange((grains + CHUNK - 1) // CHUNK):
        for b in range(chunk * CHUNK, min(grains, (chunk + 1) * CHUNK)):
            copy_row(after, b, velocity, place[b])
    for w in range(walls):
        for d in range(3):
            after[grains + w, d] = velocity[grains + w, d]
        after[grains + w, BELT] = belt[w]
    return after


@kernel
def unpack_walls(
    walls: Ints, general: Ints, lane: Ints, impulse: Floats, general_impulse: Floats,
    contacts: Contacts,
) -> None:  # fmt: skip
    """Impulses of contacts with walls into the table, **modified**; arrays of `Schedule`."""
    for k in range(walls.size):
        c = walls[k]
        q, column = lane[c] // LANES, lane[c] % LANES
        contacts[c].p_n = impulse[q, NORMAL, column]
        contacts[c].p_t = impulse[q, TANGENTIAL, column]
    for g in range(general.size):
        contacts[general[g]].p_n = general_impulse[g, NORMAL]
        contacts[general[g]].p_t = general_impulse[g, TANGENTIAL]


@kernel
def carried(
    grains: int, i: Ints, j: Ints, lane: Ints, impulse: Floats, contacts: Contacts
) -> tuple[Ints, Ints, Floats]:
    """Shapes i, j and impulses of contacts that carry one [N s], in order; arrays of `Schedule`."""
    found = 0
    first, second = np.empty(i.size, np.int32), np.empty(i.size, np.int32)
    known = np.empty((i.size, 2))
    for c in range(i.size):
        if j[c] < grains:
            q, column = lane[c] // LANES, lane[c] % LANES
            p_n, p_t = impulse[q, NORMAL, column], impulse[q, TANGENTIAL, column]
        else:
            p_n, p_t = contacts[c].p_n, contacts[c].p_t
        # Nobody could guess which do: each is written, and the next over it
        first[found], second[found] = i[c], j[c]
        known[found, NORMAL], known[found, TANGENTIAL] = p_n, p_t
        found += p_n > 0.0
    return first[:found], second[:found], known[:found]


# ---- The problem of a step


_NO_POINTS = np.empty(0, np.int32)


@dataclass(frozen=True)
class OrderedSystem:
    """A `System`, and where its contacts come from.

    Attributes:
        system: What the sweep works on; ``slot`` names contacts by their rank by key.
        schedule: Order and places of its contacts.
        belt: Speed of the surface of each wall, column `BELT` of the bodies [m/s], shape ``(w,)``.
        points: Contacts of grains that are no discs, the last of the general ones in ``system``; -1
            where a lane has none.
    """

    system: System
    schedule: Schedule
    belt: Floats
    points: Ints

    def collect(self, contacts: Contacts) -> Floats:
        """Put impulses with walls, and couples, into ``contacts``; returns v⁺, ``(n + w, 4)``."""
        schedule, system = self.schedule, self.system
        unpack_walls(
            schedule.walls, schedule.general, schedule.lane, system.impulse,
            system.general_impulse, contacts,
        )  # fmt: skip
        if self.points.size:
            unpack_points(self.points, system.general_impulse[schedule.general.size :], contacts)
        if system.couples.impulse.size:
            contacts["p_r"][system.couples.contact] = system.couples.impulse
        return unpack_bodies(system.velocity, schedule.place, self.belt, self.belt.size)


def _add_faces(
    scene: Scene, contacts: Contacts, schedule: Schedule, belt: Floats, inverse: Floats,
    others: General,
) -> tuple[Ints, FaceBatches, General]:  # fmt: skip
    """Contacts of grains that are no discs, and them behind the ``others`` of `pack_general`."""
    slot, start = batch_points(
        contacts, schedule.face_order, schedule.face_pair, schedule.face_start,
        len(schedule.velocity),
    )  # fmt: skip
    block_pair, block = blocks_for(slot.shape[0])
    points, rows = pack_faces(
        scene, contacts, belt, schedule.place, slot, schedule.face_rest, start, inverse, others,
        block_pair, block,
    )  # fmt: skip
    branch = NO_CELL.branch
    if scene.height > 0.0:
        branch = _blocks(_branches(contacts, points[points.size - slot.size :]))
    first = len(rows[0]) - slot.size
    return points, FaceBatches(block_pair, block, branch, start, first), rows


@kernel
def _branches(contacts: Contacts, points: Ints) -> Floats:
    """Branch vectors ℓ of records [m], shape ``(g, 2)``; zeros where there is none."""
    branch = np.zeros((points.size, 2))
    for g in range(points.size):
        if points[g] >= 0:
            branch[g, X] = contacts[points[g]].lever_x
            branch[g, Y] = contacts[points[g]].lever_y
    return branch


def assemble(
    scene: Scene, contacts: Contacts, schedule: Schedule, belt: Floats, wall_inverse: Floats,
    spin_factor: float, has_couples: bool, has_faces: bool,
) -> OrderedSystem:  # fmt: skip
    """The problem of a step, whose contacts have begun (`begin_grains`, `begin_walls`).

    ``wall_inverse`` are inverse masses per degree of freedom, shape ``(w, 3)``, ``belt`` is that of
    `OrderedSystem`. Without couples the rolling resistance of the contacts is not looked at. Where
    there are grains that are no discs, the system has batches of points, if only empty ones: it is
    of one kind then, and what solves it is compiled once.
    """
    place, general = schedule.place, schedule.general
    inverse_masses(schedule.velocity, wall_inverse, spin_factor, schedule.inverse)
    place_walls(
        scene, contacts, belt, schedule.walls, schedule.lane, schedule.pair, schedule.velocity,
        schedule.frame, schedule.impulse,
    )  # fmt: skip
    others = schedule.of_general
    pack_general(scene, contacts, belt, place, general, schedule.inverse, *others)
    points, faces, system = _NO_POINTS, None, schedule.system(spin_factor, contacts.size)
    if has_faces:
        points, faces, others = _add_faces(
            scene, contacts, schedule, belt, schedule.inverse, others
        )
        pair, frame, lever, impulse = others
        system = system._replace(
            general_pair=pair, general_frame=frame, general_lever=lever, general_impulse=impulse,
            faces=faces,
        )  # fmt: skip
    if scene.height > 0.0:
        own = np.zeros((schedule.tile_start.size - 1, 3 * LANES))
        cell = CellTerms(schedule.branch, _branches(contacts, points), place.size, own)
        system = system._replace(cell=cell)
    if has_couples:
        couples = pack_couples(
            scene, contacts, belt, schedule.slot, general, place, schedule.inverse
        )
        system = system._replace(couples=couples)
    add_impulses(system)
    return OrderedSystem(system, schedule, belt, points)


# ---- To a table that can be stored or looked at


class Moved(NamedTuple):
    """A step of the mechanics that has been taken.

    ``scene`` is at q_m, ``after`` are velocities v⁺, shape ``(bodies, 4)``; ``i`` and ``j`` the
    shapes of ``contacts``; ``loaded_i`` and ``loaded_j`` those of contacts that carried an impulse
    in the step before, ascending, and ``loaded_point`` which points of grains that are no discs
    (-1; of size 0 if all are). Grains have ``strayed`` by what they have moved, in a cell beside
    its mean flow [m], shape ``(n, 2)``. ``mobility`` are inverse masses of walls in x and y [1/kg]
    and inverse moments of inertia, 0 where they are held, shape ``(w, 3)``; ``impacts`` those of
    grains in flight, which ``contacts`` hold as sums, or None.
    """

    scene: Scene
    contacts: Contacts
    after: Floats
    i: Ints
    j: Ints
    loaded_i: Ints
    loaded_j: Ints
    loaded_point: Ints
    strayed: Floats
    mobility: Floats
    impacts: Impacts | None


@kernel
def _slips(scene: Scene, contacts: Contacts, after: Floats) -> Floats:
    slip = np.empty(contacts.size)
    for c in range(contacts.size):
        slip[c] = contact_after(c, scene, contacts, after)[1]
    return slip


def tabulate_contacts(moved: Moved | None, has_couples: bool, has_faces: bool) -> ContactTable:
    """Make the table; empty if there has been no step."""
    if moved is None:
        return ContactTable.empty()
    scene, contacts, after = moved[:3]
    if has_faces:  # there is room for more
        contacts = contacts[contacts["gap"] < np.inf]
    q_n, p_t = contacts["p_n"], contacts["p_t"]
    # The local solve cuts p_t to ±μ q_n exactly: equality, but for rounding, means sliding.
    sliding = (q_n > 0.0) & (np.abs(p_t) >= contacts["mu"] * q_n * (1.0 - 1e-12))
    arm = np.column_stack([contacts["own_x"], contacts["own_y"]])
    of_discs = contacts["key"] < 0
    radius = scene.radius[contacts["i"]]
    arm[of_discs] = (
        -radius[of_discs, np.newaxis] * np.column_stack([contacts["nx"], contacts["ny"]])[of_discs]
    )
    return ContactTable(
        contacts["i"].copy(), contacts["j"].copy(),
        np.column_stack([contacts["nx"], contacts["ny"]]), contacts["gap"].copy(),
        net_impulses(np.column_stack([q_n, p_t]), contacts["attraction"]),
        _slips(scene, contacts, after), sliding, arm=arm if has_faces else None,
        couple=couples_of(contacts) if has_couples else None,
    )  # fmt: skip
