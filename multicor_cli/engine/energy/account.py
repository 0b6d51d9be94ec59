"""Books of the contacts of one step: where the energy went, and what the grains exert on the walls."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from multicor_cli.arithmetic.sums import column_totals
from multicor_cli.engine.contact.detection import (
    StepContacts,
    attraction_of,
    contact_after,
    couple_of,
    couples_of_contacts,
    rolling_loss,
)
from multicor_cli.engine.geometry.radii import surface_turning
from multicor_cli.engine.geometry.scene import Scene
from multicor_cli.engine.jit.chunks import CHUNK, chunks_for
from multicor_cli.engine.jit.compile import kernel, parallel_kernel, prange
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.model.columns import GAP, MU, NORMAL, NX, NY, SPIN, TANGENTIAL, X, Y
from multicor_cli.model.model import Floats, Ints

FRICTION, IMPACT, SLIDING, NEGATIVE, VIRIAL, LARGEST, LOADED = 0, 1, 2, 3, 4, 8, 9
"""Columns of the sums: losses [J], virial (four columns, xx xy yx yy) [J s], largest p_n [N s], number of loaded contacts."""

SUMS = 10
_ALONG = 3  # column of the impulses of walls, after x, y and spin


class ContactSums(NamedTuple):
    """Result of `account_contacts`.

    Attributes:
        total: Sums over the contacts, shape ``(SUMS,)``.
        wall_impulse: Impulse and angular impulse on the walls, shape ``(w, 3)``.
        belt_impulse: What the surface of each wall takes up along it, conjugate to its speed `BELT`: −Σ (p_t + κ C) with the
            curvature κ of the surface and the couple C on the grain [N s], shape ``(w,)``.
    """

    total: Floats
    wall_impulse: Floats
    belt_impulse: Floats


@formula
def _push_wall(c: int, scene: Scene, contacts: StepContacts, px: float, py: float, chunk: int, wall_impulse: Floats) -> None:
    wall = scene.wall[contacts.j[c] - scene.radius.size]
    wall_impulse[chunk, wall, X] -= px
    wall_impulse[chunk, wall, Y] -= py
    wall_impulse[chunk, wall, SPIN] -= contacts.lever[c, X] * py - contacts.lever[c, Y] * px + couple_of(c, contacts)
    wall_impulse[chunk, wall, _ALONG] -= contacts.impulse[c, TANGENTIAL]
    if contacts.rolling.size:
        wall_impulse[chunk, wall, _ALONG] -= surface_turning(scene, contacts.j[c], 1.0) * couple_of(c, contacts)


@formula
def _account_chunk(
    chunk: int, first: int, last: int, scene: Scene, contacts: StepContacts, after: Floats, partial: Floats, wall_impulse: Floats
) -> None:
    """Write the sums over contacts ``first … last-1``. Numbers, not elements of an array, are added to: twice as fast."""
    friction, impact, sliding, negative, largest, loaded = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    xx, xy, yx, yy = 0.0, 0.0, 0.0, 0.0
    for c in range(first, last):
        q_n, p_t, attraction = contacts.impulse[c, NORMAL], contacts.impulse[c, TANGENTIAL], attraction_of(c, contacts)
        if q_n == 0.0 and attraction == 0.0:
            continue
        p_n = q_n - attraction
        i, j = contacts.i[c], contacts.j[c]
        nx, ny = contacts.frame[c, NX], contacts.frame[c, NY]
        u_n, u_t = contact_after(c, scene, contacts, after)
        hit = -p_n * 0.5 * (contacts.before[c, NORMAL] + u_n)
        rub = -p_t * 0.5 * (contacts.before[c, TANGENTIAL] + u_t) + rolling_loss(c, scene, contacts, after)
        friction += rub
        impact += hit
        sliding += contacts.frame[c, MU] * abs(u_t) * q_n
        negative += min(0.0, rub + hit)
        largest = max(largest, p_n)
        loaded += 1.0 if q_n > 0.0 else 0.0
        px, py = p_n * nx - p_t * ny, p_n * ny + p_t * nx
        if j < scene.radius.size:
            branch = scene.radius[i] + scene.radius[j] + contacts.frame[c, GAP]
            xx += px * branch * nx
            xy += px * branch * ny
            yx += py * branch * nx
            yy += py * branch * ny
        else:
            _push_wall(c, scene, contacts, px, py, chunk, wall_impulse)
    partial[chunk, FRICTION], partial[chunk, IMPACT] = friction, impact
    partial[chunk, SLIDING], partial[chunk, NEGATIVE] = sliding, negative
    partial[chunk, VIRIAL], partial[chunk, VIRIAL + 1] = xx, xy
    partial[chunk, VIRIAL + 2], partial[chunk, VIRIAL + 3] = yx, yy
    partial[chunk, LARGEST], partial[chunk, LOADED] = largest, loaded


@parallel_kernel
def _account_chunks(scene: Scene, contacts: StepContacts, after: Floats, partial: Floats, wall_impulse: Floats) -> None:
    count = contacts.i.size
    for chunk in prange(partial.shape[0]):
        last = min(count, (chunk + 1) * CHUNK)
        _account_chunk(chunk, chunk * CHUNK, last, scene, contacts, after, partial, wall_impulse)


def account_contacts(scene: Scene, contacts: StepContacts, after: Floats) -> ContactSums:
    """Sum losses, virial and wall impulses over the contacts of a step, in fixed chunks.

    The losses are −p·½(u⁻+u⁺), exact for the scheme whether or not the solver has converged (Moreau–Jean energy identity). p is
    what acts, adhesion taken off; couples count as friction.

    Args:
        scene: Shapes at q_m.
        contacts: Contacts with their impulses, sorted by key.
        after: Body velocities v⁺, shape ``(bodies, 4)``.
    """
    partial = chunks_for(contacts.i.size, SUMS)
    partial_wall = np.zeros((len(partial), scene.wall_position.shape[0], 4))
    _account_chunks(scene, contacts, after, partial, partial_wall)
    total = column_totals(partial)
    total[LARGEST] = partial[:, LARGEST].max()
    of_walls = column_totals(partial_wall)
    return ContactSums(total, of_walls[:, :_ALONG].copy(), of_walls[:, _ALONG].copy())


def warm_start_of(contacts: StepContacts) -> tuple[Ints, Ints, Floats, Floats]:
    """Shapes i, j, impulses [N s] and couples [N m s] of the contacts that carry an impulse, in the same order.

    Shapes ``(k,), (k,), (k, 2)``, and ``(k,)``, or ``(0,)`` without rolling resistance. With adhesion impulses are those of
    `StepContacts`.
    """
    couple = couples_of_contacts(contacts)
    return *_carrying(contacts), couple[contacts.impulse[:, NORMAL] > 0.0] if couple.size else couple


@kernel
def _carrying(contacts: StepContacts) -> tuple[Ints, Ints, Floats]:
    found = 0
    for c in range(contacts.i.size):
        if contacts.impulse[c, NORMAL] > 0.0:
            found += 1
    i, j, impulse = np.empty(found, np.int32), np.empty(found, np.int32), np.empty((found, 2))
    k = 0
    for c in range(contacts.i.size):
        if contacts.impulse[c, NORMAL] > 0.0:
            i[k], j[k] = contacts.i[c], contacts.j[c]
            impulse[k, NORMAL], impulse[k, TANGENTIAL] = contacts.impulse[c, NORMAL], contacts.impulse[c, TANGENTIAL]
            k += 1
    return i, j, impulse
