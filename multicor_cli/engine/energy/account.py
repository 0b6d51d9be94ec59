"""Books of the contacts of one step: where the energy went, and what the grains exert on the walls."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from multicor_cli.arithmetic.sums import column_totals
from multicor_cli.engine.contact.detection import StepContacts, contact_after
from multicor_cli.engine.geometry.scene import Scene
from multicor_cli.engine.jit.chunks import CHUNK, chunks_for
from multicor_cli.engine.jit.compile import kernel, parallel_kernel, prange
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.model.columns import GAP, MU, NORMAL, NX, NY, SPIN, TANGENTIAL, X, Y
from multicor_cli.model.model import Floats, Ints

FRICTION, IMPACT, SLIDING, NEGATIVE, VIRIAL, LARGEST, LOADED = 0, 1, 2, 3, 4, 8, 9
"""Columns of the sums: losses [J], virial (four columns, xx xy yx yy) [J s], largest p_n [N s], number of loaded contacts."""

SUMS = 10


class ContactSums(NamedTuple):
    """Result of `account_contacts`: ``total`` of shape ``(SUMS,)``, ``wall_impulse`` (on the walls) of shape ``(w, 3)``."""

    total: Floats
    wall_impulse: Floats


@formula
def _account_one(c: int, scene: Scene, contacts: StepContacts, after: Floats, total: Floats, wall_impulse: Floats) -> None:
    p_n, p_t = contacts.impulse[c, NORMAL], contacts.impulse[c, TANGENTIAL]
    if p_n == 0.0:
        return
    i, j = contacts.i[c], contacts.j[c]
    nx, ny, gap, mu = contacts.frame[c, NX], contacts.frame[c, NY], contacts.frame[c, GAP], contacts.frame[c, MU]
    u_n, u_t = contact_after(c, scene, contacts, after)
    impact = -p_n * 0.5 * (contacts.before[c, NORMAL] + u_n)
    friction = -p_t * 0.5 * (contacts.before[c, TANGENTIAL] + u_t)
    total[FRICTION] += friction
    total[IMPACT] += impact
    total[SLIDING] += mu * abs(u_t) * p_n
    total[NEGATIVE] += min(0.0, friction + impact)
    total[LARGEST] = max(total[LARGEST], p_n)
    total[LOADED] += 1.0
    px, py = p_n * nx - p_t * ny, p_n * ny + p_t * nx
    count = scene.radius.size
    if j < count:
        branch = scene.radius[i] + scene.radius[j] + gap
        total[VIRIAL] += px * branch * nx
        total[VIRIAL + 1] += px * branch * ny
        total[VIRIAL + 2] += py * branch * nx
        total[VIRIAL + 3] += py * branch * ny
    else:
        wall = scene.wall[j - count]
        wall_impulse[wall, X] -= px
        wall_impulse[wall, Y] -= py
        wall_impulse[wall, SPIN] -= contacts.lever[c, X] * py - contacts.lever[c, Y] * px


@parallel_kernel
def _account_chunks(scene: Scene, contacts: StepContacts, after: Floats, partial: Floats, partial_wall: Floats) -> None:
    count = contacts.i.size
    for chunk in prange(partial.shape[0]):
        total, wall_impulse = partial[chunk], partial_wall[chunk]
        for c in range(chunk * CHUNK, min(count, (chunk + 1) * CHUNK)):
            _account_one(c, scene, contacts, after, total, wall_impulse)


def account_contacts(scene: Scene, contacts: StepContacts, after: Floats) -> ContactSums:
    """Sum losses, virial and wall impulses over the contacts of a step, in fixed chunks.

    The losses are −p·½(u⁻+u⁺), exact for the scheme whether or not the solver has converged (Moreau–Jean energy identity).

    Args:
        scene: Shapes at q_m.
        contacts: Contacts with their impulses, sorted by key.
        after: Body velocities v⁺, shape ``(bodies, 4)``.
    """
    partial = chunks_for(contacts.i.size, SUMS)
    partial_wall = np.zeros((len(partial), scene.wall_position.shape[0], 3))
    _account_chunks(scene, contacts, after, partial, partial_wall)
    total = column_totals(partial)
    total[LARGEST] = partial[:, LARGEST].max()
    return ContactSums(total, column_totals(partial_wall))


@kernel
def warm_start_of(contacts: StepContacts) -> tuple[Ints, Ints, Floats]:
    """Shapes i, j and impulses [N s] of the contacts that carry an impulse, in the same order: shapes ``(k,), (k,), (k, 2)``."""
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
