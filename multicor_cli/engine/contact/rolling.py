"""Rolling resistance of contacts: what it is in a step, and where its couples stand in the sweep (theory §3.2)."""

from __future__ import annotations

import numpy as np

from multicor_cli.engine.contact.couples import NO_COUPLES, Couples
from multicor_cli.engine.contact.detection import StepContacts, WarmStart
from multicor_cli.engine.contact.lanes import IMPULSE_ROWS
from multicor_cli.engine.geometry.radii import pair_radius, surface_turning
from multicor_cli.engine.geometry.scene import Scene
from multicor_cli.engine.jit.compile import kernel
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.engine.jit.vectors import LANES
from multicor_cli.model.columns import ARM, BEFORE, BELT, COUPLE, FIRST, LIMIT, SECOND, SPIN, SURFACE
from multicor_cli.model.model import ContactLaws, Floats, Ints


@formula
def _rolling_velocity(scene: Scene, i: int, j: int, arm: float, velocity: Floats) -> float:
    """u_r = a* (ω_i − ω_j) of a pair [m/s]; ``velocity`` of grains and walls, shape ``(bodies, 4)``."""
    count = scene.radius.size
    if j < count:
        return arm * (velocity[i, SURFACE] / scene.radius[i] - velocity[j, SURFACE] / scene.radius[j])
    body = count + scene.wall[j - count]
    turning = arm * surface_turning(scene, j, velocity[body, BELT])
    return arm * (velocity[i, SURFACE] / scene.radius[i] - velocity[body, SURFACE]) - turning


@kernel
def rolling_of_contacts(
    scene: Scene, laws: ContactLaws, contacts: StepContacts, start: Floats, warm: WarmStart, scale: float
) -> Floats:
    """Rolling resistance of all contacts, as in `StepContacts`.

    Arguments as `multicor_cli.engine.contact.detection.fill_contacts`.
    """
    rolling = np.zeros((contacts.i.size, 4))
    for c in range(contacts.i.size):
        i, j = contacts.i[c], contacts.j[c]
        limit = laws.rolling[scene.material[i], scene.material[j]]
        if limit == 0.0:
            continue
        arm = pair_radius(scene, i, j)
        rolling[c, LIMIT], rolling[c, ARM] = limit, arm
        rolling[c, BEFORE] = _rolling_velocity(scene, i, j, arm, start)
        for k in range(warm.row[i], warm.row[i + 1]):
            if warm.j[k] == j:
                rolling[c, COUPLE] = scale * warm.couple[k] / arm
    return rolling


@formula
def rolling_loss(c: int, scene: Scene, contacts: StepContacts, after: Floats) -> float:
    """Energy that the couple of a contact takes in a step, −p_r ½(u_r⁻ + u_r⁺) [J]; ``after`` are the velocities v⁺."""
    if not contacts.rolling.size or contacts.rolling[c, COUPLE] == 0.0:
        return 0.0
    u_r = _rolling_velocity(scene, contacts.i[c], contacts.j[c], contacts.rolling[c, ARM], after)
    return -contacts.rolling[c, COUPLE] * 0.5 * (contacts.rolling[c, BEFORE] + u_r)


@formula
def rolled_loss(c: int, scene: Scene, contacts: StepContacts, after: Floats) -> float:
    """What the couple of a contact that rolls takes by the rule of the end of the step, |p_r u_r⁺| [J]."""
    if not contacts.rolling.size or contacts.rolling[c, COUPLE] == 0.0:
        return 0.0
    u_r = _rolling_velocity(scene, contacts.i[c], contacts.j[c], contacts.rolling[c, ARM], after)
    return abs(contacts.rolling[c, COUPLE] * u_r)


@formula
def couple_of(c: int, contacts: StepContacts) -> float:
    """Impulse of the couple of a contact on its first body [N m s]; 0 without rolling resistance."""
    return contacts.rolling[c, ARM] * contacts.rolling[c, COUPLE] if contacts.rolling.size else 0.0


def couples_of_contacts(contacts: StepContacts) -> Floats:
    """`couple_of` of all contacts, shape ``(c,)``; of size 0 if no pair of materials has rolling resistance."""
    return np.asarray(contacts.rolling[:, ARM] * contacts.rolling[:, COUPLE])


def pack_couples(
    scene: Scene, contacts: StepContacts, belt: Floats, slot: Ints, general: Ints, place: Ints, inverse: Floats
) -> Couples:
    """The couples of the contacts that have rolling resistance, in the order of these.

    Args:
        scene: Shapes at q_m.
        contacts: Contacts sorted by key, with the warm start in ``rolling``.
        belt: Speed of the surface of each wall, column `BELT` of the bodies [m/s], shape ``(w,)``.
        slot: Contact in each lane, -1 if there is none, shape ``(q, 4)``.
        general: General contacts, shape ``(g,)``.
        place: Row of each grain, shape ``(n,)``; walls follow the grains.
        inverse: Inverse mass per degree of freedom of grains and walls, in these rows, shape ``(n + w, 3)``.
    """
    if not contacts.rolling.size:
        return NO_COUPLES
    contact = np.flatnonzero(contacts.rolling[:, LIMIT] > 0.0)
    i, j = contacts.i[contact], contacts.j[contact]
    is_wall, reach = j >= scene.radius.size, contacts.rolling[contact, ARM]
    body, arm = np.empty((contact.size, 2), np.int32), np.empty((contact.size, 2))
    body[:, FIRST], arm[:, FIRST] = place[i], reach / scene.radius[i]
    body[~is_wall, SECOND], arm[~is_wall, SECOND] = place[j[~is_wall]], reach[~is_wall] / scene.radius[j[~is_wall]]
    body[is_wall, SECOND], arm[is_wall, SECOND] = scene.radius.size + scene.wall[j[is_wall] - scene.radius.size], reach[is_wall]
    spins = inverse[body, SPIN]
    mobility = spins[:, FIRST] * (arm[:, FIRST] * arm[:, FIRST]) + spins[:, SECOND] * (arm[:, SECOND] * arm[:, SECOND])
    where = _places(slot, general, contacts.i.size)[contact]
    limit, impulse = contacts.rolling[contact, LIMIT], contacts.rolling[contact, COUPLE]
    turning = reach * _turning(scene, j, belt)
    return Couples(contact.astype(np.int32), where, body, arm, limit, 1.0 / mobility, impulse, turning)


@kernel
def _turning(scene: Scene, shape: Ints, belt: Floats) -> Floats:
    """`surface_turning` of the second bodies of pairs [rad/s]; 0 for grains."""
    count, found = scene.radius.size, np.zeros(shape.size)
    for k in range(shape.size):
        if shape[k] >= count:
            found[k] = surface_turning(scene, shape[k], belt[scene.wall[shape[k] - count]])
    return found


def _places(slot: Ints, general: Ints, count: int) -> Ints:
    """Where the normal impulse of each contact is, as `Couples.place` says, shape ``(count,)``."""
    where = np.empty(count, np.int64)
    filled = np.flatnonzero(slot.reshape(-1) >= 0)
    where[slot.reshape(-1)[filled]] = IMPULSE_ROWS * LANES * (filled // LANES) + filled % LANES
    where[general] = -1 - np.arange(general.size)
    return where
