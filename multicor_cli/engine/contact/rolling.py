"""Rolling resistance: couples of contacts, further unknowns of a step (theory §3.2).

In velocity units a couple is friction on the rolling velocity u_r = a* (ω_i − ω_j): |p_r| ≤ μ_r
q_n, where p_r is the impulse of the couple over a*. It acts on spins alone and takes its bound
from the normal impulse of its contact, so neither the contacts nor their vectors know of it.
Couples are relaxed serially after all contacts, in their order; one takes some three times as long
as a diagonal contact, which is one of four in a vector (14 and 5 ns in a bed of 18,000 contacts).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.contact.contacts import Contacts
from multicor_cli.engine.contact.vector_sweep import IMPULSE_ROWS
from multicor_cli.engine.geometry.radii import pair_radius, surface_turning
from multicor_cli.engine.geometry.scene import Scene
from multicor_cli.engine.jit.compile import kernel, loop_body
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.engine.jit.vectors import LANES
from multicor_cli.model.columns import BELT, FIRST, NORMAL, SECOND, SPIN, SURFACE
from multicor_cli.model.model import ContactLaws, Floats, Ints

# ---- What it is in a step


@formula
def _rolling_velocity(scene: Scene, i: int, j: int, arm: float, velocity: Floats) -> float:
    """u_r = a* (ω_i − ω_j) of a pair [m/s]; ``velocity`` of all bodies, shape ``(bodies, 4)``."""
    count = scene.radius.size
    if j < count:
        return arm * (
            velocity[i, SURFACE] / scene.radius[i] - velocity[j, SURFACE] / scene.radius[j]
        )
    body = count + scene.wall[j - count]
    turning = arm * surface_turning(scene, j, velocity[body, BELT])
    return arm * (velocity[i, SURFACE] / scene.radius[i] - velocity[body, SURFACE]) - turning


@kernel
def begin_rolling(
    scene: Scene, laws: ContactLaws, start: Floats, row: NDArray[np.int64], known_j: Ints,
    couple: Floats, ratio: float, contacts: Contacts,
) -> None:  # fmt: skip
    """Rolling resistance into all contacts, **modified**; arguments as `begin_walls`.

    Contacts of the step before, of grain i ``row[i]:row[i+1]``, had the couples ``couple`` [N m s].
    """
    for c in range(contacts.size):
        contact = contacts[c]
        i, j = contact.i, contact.j
        contact.mu_r = laws.rolling[scene.material[i], scene.material[j]]
        contact.arm, contact.u_r, contact.p_r = 0.0, 0.0, 0.0
        if contact.mu_r == 0.0:
            continue
        arm = pair_radius(scene, i, j)
        contact.arm, contact.u_r = arm, _rolling_velocity(scene, i, j, arm, start)
        for k in range(row[i], row[i + 1]):
            if known_j[k] == j:
                contact.p_r = ratio * couple[k] / arm


@formula
def rolling_loss(c: int, scene: Scene, contacts: Contacts, after: Floats) -> float:
    """Energy that a couple takes in a step, −p_r ½(u_r⁻ + u_r⁺) [J]; ``after`` are the v⁺."""
    contact = contacts[c]
    if contact.p_r == 0.0:
        return 0.0
    u_r = _rolling_velocity(scene, contact.i, contact.j, contact.arm, after)
    return -contact.p_r * 0.5 * (contact.u_r + u_r)


@formula
def rolled_loss(c: int, scene: Scene, contacts: Contacts, after: Floats) -> float:
    """What a couple that rolls takes by the rule of the end of the step, |p_r u_r⁺| [J]."""
    contact = contacts[c]
    if contact.p_r == 0.0:
        return 0.0
    u_r = _rolling_velocity(scene, contact.i, contact.j, contact.arm, after)
    return abs(contact.p_r * u_r)


def couples_of(contacts: Contacts) -> Floats:
    """Impulses of the couples of contacts on their first bodies [N m s], shape ``(c,)``."""
    return np.asarray(contacts["arm"] * contacts["p_r"])


# ---- Couples of a sweep


class Couples(NamedTuple):
    """The couples of a `System`, ``k`` rows; none where there is no rolling resistance.

    Attributes:
        contact: Contact behind each, shape ``(k,)``.
        place: Where its normal impulse is: in the flat ``impulse`` of the system, or -1 - g for the
            general contact g, shape ``(k,)``.
        body: Rows of its bodies, shape ``(k, 2)``.
        arm: Factors of both third velocities in u_r: a*/a for grains, a* [m] for walls, ``(k, 2)``.
        limit: μ_r, shape ``(k,)``.
        inverse: 1/W_rr [kg], shape ``(k,)``.
        impulse: p_r [N s], shape ``(k,)``. **Modified by sweeps.**
        turning: What the running surface of a wall takes from u_r [m/s], shape ``(k,)``.
    """

    contact: Ints
    place: NDArray[np.int64]
    body: Ints
    arm: Floats
    limit: Floats
    inverse: Floats
    impulse: Floats
    turning: Floats


_NONE = np.empty(0)
NO_COUPLES = Couples(
    np.empty(0, np.int32), np.empty(0, np.int64), np.empty((0, 2), np.int32), np.empty((0, 2)),
    _NONE, _NONE, _NONE, _NONE
)  # fmt: skip


def pack_couples(
    scene: Scene, contacts: Contacts, belt: Floats, slot: Ints, general: Ints, place: Ints,
    inverse: Floats,
) -> Couples:  # fmt: skip
    """Couples of contacts, in their order; arrays of `Schedule`, `System` and `OrderedSystem`."""
    contact = np.flatnonzero(contacts["mu_r"] > 0.0)
    if not contact.size:
        return NO_COUPLES
    rolling = contacts[contact]
    i, j = rolling["i"], rolling["j"]
    is_wall, effective = j >= scene.radius.size, rolling["arm"]
    body, arm = np.empty((contact.size, 2), np.int32), np.empty((contact.size, 2))
    body[:, FIRST], arm[:, FIRST] = place[i], effective / scene.radius[i]
    body[~is_wall, SECOND] = place[j[~is_wall]]
    arm[~is_wall, SECOND] = effective[~is_wall] / scene.radius[j[~is_wall]]
    body[is_wall, SECOND] = scene.radius.size + scene.wall[j[is_wall] - scene.radius.size]
    arm[is_wall, SECOND] = effective[is_wall]
    spins = inverse[body, SPIN]
    mobility = spins[:, FIRST] * (arm[:, FIRST] * arm[:, FIRST]) + spins[:, SECOND] * (
        arm[:, SECOND] * arm[:, SECOND]
    )
    where = _places(slot, general, contacts.size)[contact]
    turning = effective * _turning(scene, np.ascontiguousarray(j), belt)
    return Couples(
        contact.astype(np.int32), where, body, arm, rolling["mu_r"].copy(), 1.0 / mobility,
        rolling["p_r"].copy(), turning,
    )  # fmt: skip


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


@formula
def solve_rolling(p_r: float, u_r: float, w_inverse: float, bound: float) -> float:
    """Exact p_r of one couple with all else held [N s]: stick, cut to ± μ_r q_n (theory §3.2)."""
    return min(max(p_r - u_r * w_inverse, -bound), bound)


@loop_body
def _bound(k: int, couples: Couples, impulse: Floats, general_impulse: Floats) -> float:
    """μ_r q_n; ``impulse`` flat."""
    place = couples.place[k]
    q_n = impulse[place] if place >= 0 else general_impulse[-1 - place, NORMAL]
    return couples.limit[k] * q_n


@loop_body
def couple_velocity(k: int, couples: Couples, velocity: Floats) -> float:
    """u_r [m/s]; ``velocity`` as in `System`."""
    i, j = couples.body[k, FIRST], couples.body[k, SECOND]
    turning = (
        couples.arm[k, FIRST] * velocity[i, SURFACE] - couples.arm[k, SECOND] * velocity[j, SURFACE]
    )
    return turning - couples.turning[k]


@loop_body
def push_couple(k: int, d_r: float, couples: Couples, velocity: Floats, inverse: Floats) -> None:
    """Change the spins of both bodies by an impulse of a couple. Arrays as in `System`."""
    i, j = couples.body[k, FIRST], couples.body[k, SECOND]
    velocity[i, SURFACE] += inverse[i, SPIN] * couples.arm[k, FIRST] * d_r
    velocity[j, SURFACE] -= inverse[j, SPIN] * couples.arm[k, SECOND] * d_r


@loop_body
def relax_couples(
    velocity: Floats, inverse: Floats, couples: Couples, impulse: Floats, general_impulse: Floats,
    before: Floats,
    extrapolation: float,
) -> tuple[float, float]:  # fmt: skip
    """Relax all couples, extrapolated first; returns what `sweep` does, of these; impulses flat."""
    squares, onward = 0.0, 0.0
    for k in range(couples.impulse.size):
        now = couples.impulse[k]
        p_r = now + extrapolation * (now - before[k])
        bound = _bound(k, couples, impulse, general_impulse)
        new = solve_rolling(p_r, couple_velocity(k, couples, velocity), couples.inverse[k], bound)
        couples.impulse[k], before[k] = new, now
        push_couple(k, new - p_r, couples, velocity, inverse)
        correction = (new - p_r) / couples.inverse[k]
        squares += correction * correction
        onward += correction * (new - now)
    return squares, onward


@loop_body
def couple_correction(
    k: int, couples: Couples, velocity: Floats, impulse: Floats, general_impulse: Floats
) -> float:
    """Velocity correction e_r of one couple [m/s], arguments as `relax_couples`."""
    p_r, bound = couples.impulse[k], _bound(k, couples, impulse, general_impulse)
    u_r = couple_velocity(k, couples, velocity)
    return (solve_rolling(p_r, u_r, couples.inverse[k], bound) - p_r) / couples.inverse[k]


@loop_body
def measure_couples(
    velocity: Floats, couples: Couples, impulse: Floats, general_impulse: Floats
) -> tuple[float, float, float, float]:
    """Residuals of the couples, arguments as `relax_couples`.

    Returns Σ e_r² and the largest e_r² of their velocity corrections e_r [m²/s²], the power Σ p_r
    e_r [J], and the number of couples with p_r ≠ 0 or e_r ≠ 0.
    """
    squares, largest, power, active = 0.0, 0.0, 0.0, 0.0
    for k in range(couples.impulse.size):
        p_r = couples.impulse[k]
        correction = couple_correction(k, couples, velocity, impulse, general_impulse)
        squares += correction * correction
        largest = max(largest, correction * correction)
        power += p_r * correction
        active += 1.0 if p_r != 0.0 or correction != 0.0 else 0.0
    return squares, largest, power, active
