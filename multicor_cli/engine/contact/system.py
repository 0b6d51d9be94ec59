"""Puts the contacts of a step into the arrays of the sweep, and takes them out again."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.contact.contacts import (
    Contacts,
    contact_after,
    couples_of,
    net_impulses,
    pack_couples,
)
from multicor_cli.engine.contact.ordering import Schedule, make_batches
from multicor_cli.engine.contact.sweep import NO_COUPLES, System, add_impulses
from multicor_cli.engine.geometry.scene import Scene
from multicor_cli.engine.jit.chunks import aligned
from multicor_cli.engine.jit.compile import kernel, parallel_kernel, prange
from multicor_cli.engine.jit.vectors import LANES
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
    SECOND,
    SLIDE,
    SPIN,
    SURFACE,
    TANGENTIAL,
    W_NN,
    W_NT,
    W_TT,
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


class Batches(NamedTuple):
    """The part of a `System` that diagonal contacts take; fields as there."""

    velocity: Floats
    slot: Ints
    pair: Ints
    frame: Floats
    impulse: Floats
    tile_start: NDArray[np.int64]


def flatten(system: System) -> OneByOne:
    """The diagonal contacts, copied, in an order of which their batches make the same sweep."""
    has = system.slot.reshape(-1) >= 0
    pair, frame, impulse = (
        _rows(blocks)[has] for blocks in (system.pair, system.frame, system.impulse)
    )
    return OneByOne(
        np.ascontiguousarray(pair // 4), np.ascontiguousarray(frame), np.ascontiguousarray(impulse)
    )


def batch(contacts: OneByOne, velocity: Floats) -> Batches:
    """Contacts, in the order of the sweep, as batches of one tile; ``slot`` names their rows."""
    bodies = velocity.shape[0]
    slot, start = make_batches(contacts.pair, np.array([0, len(contacts.pair)]), bodies)
    has = slot.reshape(-1) >= 0
    rows = slot.reshape(-1)[has]
    pair, frame, impulse = (
        np.empty((has.size, 2), np.int32),
        np.zeros((has.size, 5)),
        np.zeros((has.size, 2)),
    )
    pair[:] = bodies, bodies + 1  # of the lanes without contact: nothing moves them
    frame[:, MASS] = 1.0
    pair[has], frame[has], impulse[has] = (
        contacts.pair[rows],
        contacts.frame[rows],
        contacts.impulse[rows],
    )
    full = aligned((bodies + 2, 4))
    full[:bodies], full[bodies:] = velocity, 0.0
    return Batches(full, slot, _blocks(4 * pair), _blocks(frame), _blocks(impulse), start)


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


@kernel
def pack_bodies(
    free: Floats, place: Ints, wall_inverse: Floats, spin_factor: float, velocity: Floats
) -> Floats:
    """Copy bodies into those of the sweep: grains to their ``place``, then walls.

    Returns the inverse masses of all degrees of freedom, as in `System`.
    """
    inverse = np.empty((free.shape[0], 3))
    for b in range(free.shape[0]):
        row = np.int64(place[b]) if b < place.size else np.int64(b)
        for d in range(4):
            velocity[row, d] = free[b, d]
        if b < place.size:
            inverse[row, X] = inverse[row, Y] = free[b, INVERSE_MASS]
            inverse[row, SPIN] = spin_factor * free[b, INVERSE_MASS]
        else:
            # The inverse masses of walls stand elsewhere, and their surfaces in the contacts
            velocity[row, INVERSE_MASS] = 0.0
            for d in range(3):
                inverse[row, d] = wall_inverse[b - place.size, d]
    return inverse


@parallel_kernel
def pack_contacts(
    scene: Scene,
    contacts: Contacts,
    belt: Floats,
    slot: Ints,
    pair: Ints,
    velocity: Floats,
    frame: Floats,
    impulse: Floats,
) -> None:
    """Copy contacts into their lanes, and give the proxies of walls their velocities.

    Arrays as in `System`; ``velocity``, from `pack_bodies`, ``frame`` and ``impulse`` are
    **modified**. ``belt`` as in `OrderedSystem`.
    """
    n = scene.radius.size
    for q in prange(slot.shape[0]):
        for lane in range(LANES):
            c = slot[q, lane]
            if c < 0:
                continue
            i, j = pair[q, FIRST, lane] // 4, pair[q, SECOND, lane] // 4
            contact = contacts[c]
            if contact.j >= n:
                wall = n + scene.wall[contact.j - n]
                velocity[j, X] = velocity[wall, X] - velocity[wall, SURFACE] * contact.lever_y
                velocity[j, Y] = velocity[wall, Y] + velocity[wall, SURFACE] * contact.lever_x
                velocity[j, SURFACE] = belt[wall - n]
                velocity[j, INVERSE_MASS] = 0.0
            frame[q, NX, lane], frame[q, NY, lane] = contact.nx, contact.ny
            frame[q, MASS, lane] = 1.0 / (velocity[i, INVERSE_MASS] + velocity[j, INVERSE_MASS])
            frame[q, BIAS, lane], frame[q, MU, lane] = contact.bias, contact.mu
            impulse[q, NORMAL, lane], impulse[q, TANGENTIAL, lane] = contact.p_n, contact.p_t


@kernel
def pack_general(
    scene: Scene, contacts: Contacts, belt: Floats, place: Ints, general: Ints, inverse: Floats
) -> tuple[Ints, Floats, Floats, Floats]:
    """Arrays of the contacts with walls that have a free degree of freedom, as in `System`.

    ``general`` are these contacts, ``inverse`` as in `System`, ``belt`` as in `OrderedSystem`.
    Returns bodies ``(g, 2)``, frames ``(g, 8)``, levers ``(g, 2, 2)`` and impulses ``(g, 2)``.
    """
    n = scene.radius.size
    pair, impulse = np.empty((general.size, 2), np.int32), np.empty((general.size, 2))
    frame, lever = np.zeros((general.size, 8)), np.empty((general.size, 2, 2))
    for g in range(general.size):
        contact = contacts[general[g]]
        wall = scene.wall[contact.j - n]
        nx, ny, lx, ly = contact.nx, contact.ny, contact.lever_x, contact.lever_y
        pair[g, FIRST], pair[g, SECOND] = place[contact.i], n + wall
        frame[g, NX], frame[g, NY] = nx, ny
        frame[g, BIAS], frame[g, MU], frame[g, SLIDE] = contact.bias, contact.mu, belt[wall]
        impulse[g, NORMAL], impulse[g, TANGENTIAL] = contact.p_n, contact.p_t
        # Grains add −s to u_t; walls −Ω (l_x n_y − l_y n_x) to u_n, −Ω (l_x n_x + l_y n_y) to u_t
        lever[g, FIRST, NORMAL], lever[g, FIRST, TANGENTIAL] = 0.0, -1.0
        lever[g, SECOND, NORMAL], lever[g, SECOND, TANGENTIAL] = (
            lx * ny - ly * nx,
            lx * nx + ly * ny,
        )
        for side in range(2):
            m, l_n, l_t = inverse[pair[g, side]], lever[g, side, NORMAL], lever[g, side, TANGENTIAL]
            frame[g, W_NN] += m[X] * (nx * nx) + m[Y] * (ny * ny) + m[SPIN] * (l_n * l_n)
            frame[g, W_NT] += (m[Y] - m[X]) * nx * ny + m[SPIN] * l_n * l_t
            frame[g, W_TT] += m[X] * (ny * ny) + m[Y] * (nx * nx) + m[SPIN] * (l_t * l_t)
    return pair, frame, lever, impulse


@kernel
def unpack(system: System, general: Ints, place: Ints, belt: Floats, contacts: Contacts) -> Floats:
    """Back from the arrays of the sweep; returns v⁺, shape ``(n + w, 4)``; fills ``contacts``."""
    slot, impulse, velocity = system.slot, system.impulse, system.velocity
    for q in range(slot.shape[0]):
        for lane in range(LANES):
            c = slot[q, lane]
            if c >= 0:
                contacts[c].p_n = impulse[q, NORMAL, lane]
                contacts[c].p_t = impulse[q, TANGENTIAL, lane]
    for g in range(general.size):
        contacts[general[g]].p_n = system.general_impulse[g, NORMAL]
        contacts[general[g]].p_t = system.general_impulse[g, TANGENTIAL]
    for k in range(system.couples.impulse.size):
        contacts[system.couples.contact[k]].p_r = system.couples.impulse[k]
    after = np.empty((system.inverse.shape[0], 4))
    for b in range(after.shape[0]):
        row = np.int64(place[b]) if b < place.size else np.int64(b)
        for d in range(4):
            after[b, d] = velocity[row, d]
        if b >= place.size:
            after[b, BELT] = belt[b - place.size]
    return after


# ---- Puts the contacts of a step into the arrays of the sweep


@dataclass(frozen=True)
class OrderedSystem:
    """A `System`, and where its contacts come from.

    Attributes:
        system: What the sweep works on; ``slot`` names contacts by their rank by key.
        general: Contact behind each general one.
        place: Row of each grain in the velocities of the system; walls follow the grains.
        belt: Speed of the surface of each wall, column `BELT` of the bodies [m/s], shape ``(w,)``.
    """

    system: System
    general: Ints
    place: Ints
    belt: Floats

    def collect(self, contacts: Contacts) -> Floats:
        """Put impulses and couples into ``contacts``; returns v⁺, shape ``(n + w, 4)``."""
        return unpack(self.system, self.general, self.place, self.belt, contacts)


def assemble(
    scene: Scene,
    contacts: Contacts,
    schedule: Schedule,
    free: Floats,
    wall_inverse: Floats,
    spin_factor: float,
    has_couples: bool,
) -> OrderedSystem:
    """Fill the arrays of the sweep, from contacts sorted by key, with their warm start.

    ``free`` are velocities of grains and walls, shape ``(n + w, 4)``, ``wall_inverse`` inverse
    masses per degree of freedom, shape ``(w, 3)``. Without couples the rolling resistance of the
    contacts is not looked at.
    """
    slot, pair, tile_start, color_start, general, place, velocity, frame, impulse = schedule
    belt = free[place.size :, BELT].copy()
    inverse = pack_bodies(free, place, wall_inverse, spin_factor, velocity)
    pack_contacts(scene, contacts, belt, slot, pair, velocity, frame, impulse)
    system = System(
        velocity, inverse, slot, pair, frame, impulse, tile_start, color_start,
        *pack_general(scene, contacts, belt, place, general, inverse), spin_factor, contacts.size,
        pack_couples(scene, contacts, belt, slot, general, place, inverse)
        if has_couples
        else NO_COUPLES,
    )  # fmt: skip
    add_impulses(system)
    return OrderedSystem(system, general, place, belt)


# ---- To a table that can be stored or looked at


class Moved(NamedTuple):
    """A step of the mechanics that has been taken.

    ``scene`` is at q_m, ``after`` are velocities v⁺, shape ``(bodies, 4)``; ``i`` and ``j`` the
    shapes of ``contacts``; ``loaded_i`` and ``loaded_j`` those of contacts that carried an impulse
    in the step before, ascending.
    """

    scene: Scene
    contacts: Contacts
    after: Floats
    i: Ints
    j: Ints
    loaded_i: Ints
    loaded_j: Ints


@kernel
def _slips(scene: Scene, contacts: Contacts, after: Floats) -> Floats:
    slip = np.empty(contacts.size)
    for c in range(contacts.size):
        slip[c] = contact_after(c, scene, contacts, after)[1]
    return slip


def tabulate_contacts(moved: Moved | None, has_couples: bool) -> ContactTable:
    """Make the table; empty if there has been no step."""
    if moved is None:
        return ContactTable.empty()
    scene, contacts, after = moved[:3]
    q_n, p_t = contacts["p_n"], contacts["p_t"]
    # The local solve cuts p_t to ±μ q_n exactly: equality, but for rounding, means sliding.
    sliding = (q_n > 0.0) & (np.abs(p_t) >= contacts["mu"] * q_n * (1.0 - 1e-12))
    return ContactTable(
        contacts["i"].copy(),
        contacts["j"].copy(),
        np.column_stack([contacts["nx"], contacts["ny"]]),
        contacts["gap"].copy(),
        net_impulses(np.column_stack([q_n, p_t]), contacts["attraction"]),
        _slips(scene, contacts, after),
        sliding,
        couple=couples_of(contacts) if has_couples else None,
    )
