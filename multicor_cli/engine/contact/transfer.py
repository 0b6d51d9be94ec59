"""Between the contacts and bodies of a step and the arrays of the sweep: once a step, and memory is what takes time."""

from __future__ import annotations

import numpy as np

from multicor_cli.engine.contact.detection import StepContacts
from multicor_cli.engine.geometry.scene import Scene
from multicor_cli.engine.jit.compile import kernel, loop_body, parallel_kernel, prange
from multicor_cli.engine.jit.vectors import LANES
from multicor_cli.model.columns import (
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
from multicor_cli.model.model import Floats, Ints


@kernel
def pack_bodies(free: Floats, place: Ints, velocity: Floats) -> None:
    """Copy bodies into the arrays of the sweep.

    Args:
        free: Free velocities of grains and walls, shape ``(bodies, 4)``.
        place: Row of each grain, shape ``(n,)``; walls follow the grains.
        velocity: All bodies of the sweep, bodies first. **Modified.**
    """
    for b in range(free.shape[0]):
        row = np.int64(place[b]) if b < place.size else np.int64(b)
        for d in range(4):
            velocity[row, d] = free[b, d]
        if b >= place.size:
            velocity[row, INVERSE_MASS] = 0.0  # the inverse masses of walls stand elsewhere, and their surfaces in the contacts


@loop_body
def _leave_empty(q: int, lane: int, frame: Floats, impulse: Floats) -> None:
    """A lane without contact; 1/W = 1, for a residual is measured there too."""
    for d in range(5):
        frame[q, d, lane] = 0.0
    frame[q, MASS, lane] = 1.0
    impulse[q, NORMAL, lane] = impulse[q, TANGENTIAL, lane] = 0.0


@parallel_kernel
def pack_contacts(
    scene: Scene, contacts: StepContacts, belt: Floats, slot: Ints, pair: Ints, velocity: Floats, frame: Floats, impulse: Floats
) -> None:
    """Copy contacts into their lanes, and give the anchors of walls their velocities.

    Args:
        scene: Shapes at q_m.
        contacts: Contacts sorted by key.
        belt: Speed of the surface of each wall, column `BELT` of the bodies [m/s], shape ``(w,)``.
        slot: Contact in each lane, shape ``(q, 4)``.
        pair: Their bodies as in `System`, shape ``(q, 2, 4)``.
        velocity: From `pack_bodies`. **Modified.**
        frame: As in `System`, shape ``(q, 5, 4)``. **Modified.**
        impulse: As in `System`, shape ``(q, 2, 4)``. **Modified.**
    """
    n = scene.radius.size
    for q in prange(slot.shape[0]):
        for lane in range(LANES):
            c = slot[q, lane]
            if c < 0:
                _leave_empty(q, lane, frame, impulse)
                continue
            i, j = pair[q, FIRST, lane] // 4, pair[q, SECOND, lane] // 4
            if contacts.j[c] >= n:
                wall = n + scene.wall[contacts.j[c] - n]
                velocity[j, X] = velocity[wall, X] - velocity[wall, SURFACE] * contacts.lever[c, Y]
                velocity[j, Y] = velocity[wall, Y] + velocity[wall, SURFACE] * contacts.lever[c, X]
                velocity[j, SURFACE] = belt[wall - n]
                velocity[j, INVERSE_MASS] = 0.0
            frame[q, NX, lane], frame[q, NY, lane] = contacts.frame[c, NX], contacts.frame[c, NY]
            frame[q, MASS, lane] = 1.0 / (velocity[i, INVERSE_MASS] + velocity[j, INVERSE_MASS])
            frame[q, BIAS, lane], frame[q, MU, lane] = contacts.frame[c, BIAS], contacts.frame[c, MU]
            impulse[q, NORMAL, lane] = contacts.impulse[c, NORMAL]
            impulse[q, TANGENTIAL, lane] = contacts.impulse[c, TANGENTIAL]


@kernel
def pack_general(
    scene: Scene, contacts: StepContacts, belt: Floats, place: Ints, general: Ints, inverse: Floats
) -> tuple[Ints, Floats, Floats, Floats]:
    """Arrays of the contacts with walls that have a free degree of freedom, as in `System`.

    Args:
        scene: Shapes at q_m.
        contacts: Contacts sorted by key.
        belt: As for `pack_contacts`.
        place: From `number_bodies`.
        general: Contacts of class 2, shape ``(g,)``.
        inverse: Inverse mass per degree of freedom of grains and walls, shape ``(n + w, 3)``.

    Returns:
        Bodies ``(g, 2)``, frames ``(g, 8)``, levers ``(g, 2, 2)`` and impulses ``(g, 2)``.
    """
    n = scene.radius.size
    pair, impulse = np.empty((general.size, 2), np.int32), np.empty((general.size, 2))
    frame, lever = np.zeros((general.size, 8)), np.empty((general.size, 2, 2))
    for g in range(general.size):
        c = general[g]
        nx, ny = contacts.frame[c, NX], contacts.frame[c, NY]
        lx, ly = contacts.lever[c, X], contacts.lever[c, Y]
        pair[g, FIRST], pair[g, SECOND] = place[contacts.i[c]], n + scene.wall[contacts.j[c] - n]
        frame[g, NX], frame[g, NY] = nx, ny
        frame[g, BIAS], frame[g, MU] = contacts.frame[c, BIAS], contacts.frame[c, MU]
        frame[g, SLIDE] = belt[scene.wall[contacts.j[c] - n]]
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


@kernel
def unpack(slot: Ints, impulse: Floats, place: Ints, velocity: Floats, by_contact: Floats, by_body: Floats) -> None:
    """Back from the arrays of the sweep.

    Args:
        slot: Contact in each lane, shape ``(q, 4)``.
        impulse: Their impulses, shape ``(q, 2, 4)``.
        place: Row of each grain, shape ``(n,)``.
        velocity: Bodies as in `pack_bodies`.
        by_contact: Impulses of the contacts, shape ``(c, 2)``. **Modified.**
        by_body: Velocities of grains and walls, shape ``(bodies, 4)``. **Modified.**
    """
    for q in range(slot.shape[0]):
        for lane in range(LANES):
            c = slot[q, lane]
            if c >= 0:
                by_contact[c, NORMAL] = impulse[q, NORMAL, lane]
                by_contact[c, TANGENTIAL] = impulse[q, TANGENTIAL, lane]
    for b in range(by_body.shape[0]):
        row = np.int64(place[b]) if b < place.size else np.int64(b)
        for d in range(4):
            by_body[b, d] = velocity[row, d]
