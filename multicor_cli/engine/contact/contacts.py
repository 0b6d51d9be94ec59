"""From the neighbor list to the contacts of a step: gaps, frames, velocities, laws, warm start.

Bodies are rows of one velocity array: grains ``0 … n-1`` hold (v_x, v_y, s = a ω, 1/m); walls
``n … n+w-1`` hold (V_x, V_y, Ω, s), with s = −V_s where a drive lets the surface of the wall run.
With the surface speed s instead of the spin, a contact of discs needs no radius: u_t = (v_i −
v_j)·t − s_i − s_j, and s_j of a wall is what its surface adds to its velocity at the contact.
"""

from __future__ import annotations

from math import floor, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.arithmetic.sums import column_totals
from multicor_cli.engine.contact.law import bias, softened_friction
from multicor_cli.engine.contact.sweep import NO_COUPLES, Couples
from multicor_cli.engine.contact.vector_sweep import IMPULSE_ROWS
from multicor_cli.engine.geometry.neighbors import NeighborList
from multicor_cli.engine.geometry.places import find_places, met_before, totals_of_places
from multicor_cli.engine.geometry.radii import pair_radius, surface_turning
from multicor_cli.engine.geometry.scene import Scene, pair_geometry
from multicor_cli.engine.jit.chunks import CHUNK, chunks_for
from multicor_cli.engine.jit.compile import kernel, parallel_kernel, prange
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.engine.jit.vectors import LANES
from multicor_cli.model.columns import (
    ARM,
    BEFORE,
    BELT,
    BIAS,
    COUPLE,
    FIRST,
    GAP,
    INVERSE_MASS,
    LIMIT,
    MU,
    NORMAL,
    NX,
    NY,
    SECOND,
    SPIN,
    SURFACE,
    TANGENTIAL,
    X,
    Y,
)
from multicor_cli.model.model import ContactLaws, Floats, Grains, Ints

_SQUARES, _CLOSING, _SLIP, _LOADED, _MOTION, _MET = range(6)
_NONE, _NO_ROLLING = np.empty(0), np.empty((0, 4))


class StepContacts(NamedTuple):
    """Contacts of one step, sorted by (i, j); ``c`` rows.

    Attributes:
        i: Grain, shape ``(c,)``.
        j: Grain or wall shape, shape ``(c,)``.
        frame: n_x, n_y (from j to i), gap at q_m [m], bias b [m/s], friction μ, shape ``(c, 5)``.
        before: u_n⁻, u_t⁻ [m/s], shape ``(c, 2)``.
        impulse: p_n, p_t [N s], shape ``(c, 2)``.
        lever: From the wall's reference point to the contact [m]; 0 for grains, shape ``(c, 2)``.
        attraction: F_a Δt of adhesive contacts [N s], shape ``(c,)``; ``impulse`` then holds q_n =
            p_n + F_a Δt in place of p_n. Of size 0 if no pair of materials has adhesion.
        rolling: μ_r, a* [m], u_r⁻ [m/s], p_r [N s], shape ``(c, 4)``; of size 0 if no pair of
            materials has rolling resistance.
    """

    i: Ints
    j: Ints
    frame: Floats
    before: Floats
    impulse: Floats
    lever: Floats
    attraction: Floats = _NONE
    rolling: Floats = _NO_ROLLING


class WarmStart(NamedTuple):
    """Impulses of the step before, of grain i ``row[i]:row[i+1]``; couples, if any [N m s]."""

    row: NDArray[np.int64]
    j: Ints
    impulse: Floats
    couple: Floats = _NONE


@formula
def _wall_lever(
    scene: Scene, i: int, wall: int, nx: float, ny: float, gap: float
) -> tuple[float, float]:
    """From the reference point of a wall to the point of the wall that is closest to grain i."""
    branch_length = scene.radius[i] + gap
    dx = scene.position[i, X] - scene.wall_position[wall, X]
    # The image of the point on the wall counts: the grain may lie beyond half a period
    if scene.period > 0.0:
        dx -= scene.period * floor((dx - branch_length * nx) / scene.period + 0.5)
    return dx - branch_length * nx, scene.position[i, Y] - scene.wall_position[
        wall, Y
    ] - branch_length * ny


@formula
def relative_velocity(
    velocity: Floats, i: int, body_j: int, nx: float, ny: float, is_wall: bool, lx: float, ly: float
) -> tuple[float, float]:
    """u_n, u_t of grain i relative to grain ``body_j``, or to point (lx, ly) of that wall [m/s]."""
    # Number by number: threads count references to a row of an array one after the other.
    if is_wall:
        dx = velocity[i, X] - (velocity[body_j, X] - velocity[body_j, SURFACE] * ly)
        dy = velocity[i, Y] - (velocity[body_j, Y] + velocity[body_j, SURFACE] * lx)
        return dx * nx + dy * ny, dy * nx - dx * ny - velocity[i, SURFACE] - velocity[body_j, BELT]
    dx, dy = velocity[i, X] - velocity[body_j, X], velocity[i, Y] - velocity[body_j, Y]
    return dx * nx + dy * ny, dy * nx - dx * ny - velocity[i, SURFACE] - velocity[body_j, SURFACE]


@formula
def _normal_velocity(
    scene: Scene, velocity: Floats, i: int, j: int, nx: float, ny: float, gap: float
) -> float:
    count = scene.radius.size
    if j < count:
        return relative_velocity(velocity, i, j, nx, ny, False, 0.0, 0.0)[0]
    wall = scene.wall[j - count]
    lx, ly = _wall_lever(scene, i, wall, nx, ny, gap)
    return relative_velocity(velocity, i, count + wall, nx, ny, True, lx, ly)[0]


@parallel_kernel
def measure_pairs(
    scene: Scene,
    row: NDArray[np.int64],
    partner: Ints,
    start: Floats,
    free: Floats,
    cutoff: float,
    gap: Floats,
    normal: Floats,
    fastest: Floats,
) -> None:
    """Gaps and normals of the listed pairs at q_m; largest approach speed below ``cutoff``.

    No pair farther apart than that can touch in this step [m]. **Modifies** ``gap`` [m], ``normal``
    (from j to i) and ``fastest``: the largest approach speed in each chunk of grains, at the start
    or free [m/s]; 0 if nothing approaches, shape ``(chunks, 1)``.
    """
    count = scene.radius.size
    for chunk in prange(fastest.shape[0]):
        best = 0.0
        for i in range(chunk * CHUNK, min(count, (chunk + 1) * CHUNK)):
            for p in range(row[i], row[i + 1]):
                j = partner[p]
                g, nx, ny = pair_geometry(scene, i, j)
                gap[p], normal[p, X], normal[p, Y] = g, nx, ny
                if g < cutoff:
                    best = max(best, -_normal_velocity(scene, start, i, j, nx, ny, g))
                    best = max(best, -_normal_velocity(scene, free, i, j, nx, ny, g))
        fastest[chunk, 0] = best


@kernel
def count_contacts(row: NDArray[np.int64], gap: Floats, margin: float) -> NDArray[np.int64]:
    """Row pointers ``(n + 1,)`` of the pairs whose gap does not exceed ``margin`` [m]."""
    kept = np.zeros(row.size, np.int64)
    found = 0
    for i in range(row.size - 1):
        for p in range(row[i], row[i + 1]):
            if gap[p] <= margin:
                found += 1
        kept[i + 1] = found
    return kept


@formula
def friction_of(laws: ContactLaws, a: int, b: int, speed: float) -> float:
    """μ of a pair of materials at a sliding speed [m/s]: constant, or linear in its table."""
    table = laws.table[a, b]
    if table < 0:
        return laws.friction[a, b]
    first, last = laws.table_start[table], laws.table_start[table + 1] - 1
    if speed <= laws.table_speed[first]:
        return laws.table_friction[first]
    for k in range(first, last):
        if speed < laws.table_speed[k + 1]:
            share = (speed - laws.table_speed[k]) / (laws.table_speed[k + 1] - laws.table_speed[k])
            return laws.table_friction[k] + share * (
                laws.table_friction[k + 1] - laws.table_friction[k]
            )
    return laws.table_friction[last]


@kernel
def _softened(laws: ContactLaws, a: int, b: int, mu: float, first: float, second: float) -> float:
    """μ at the mean of two temperatures [K]; of the first where the second is nan (a wall's)."""
    rate = laws.softening_rate[a, b]
    if rate == 0.0:
        return mu
    mean = first if np.isnan(second) else 0.5 * (first + second)
    start, lowest, highest = (
        laws.softening_start[a, b],
        laws.softening_lowest[a, b],
        laws.softening_highest[a, b],
    )
    return softened_friction(mu, rate, mean, start, lowest, highest)


@formula
def _fill_contact(
    c: int,
    i: int,
    j: int,
    gap: float,
    nx: float,
    ny: float,
    scene: Scene,
    laws: ContactLaws,
    start: Floats,
    dt: float,
    out: StepContacts,
) -> float:
    """Fill row ``c`` but for impulses; returns min(u_n⁻, 0) if it closes in the step, else 0."""
    count = scene.radius.size
    lx, ly = 0.0, 0.0
    if j < count:
        u_n, u_t = relative_velocity(start, i, j, nx, ny, False, lx, ly)
    else:
        wall = scene.wall[j - count]
        lx, ly = _wall_lever(scene, i, wall, nx, ny, gap)
        u_n, u_t = relative_velocity(start, i, count + wall, nx, ny, True, lx, ly)
    a, b = scene.material[i], scene.material[j]
    out.i[c], out.j[c] = i, j
    out.frame[c, NX], out.frame[c, NY], out.frame[c, GAP] = nx, ny, gap
    out.frame[c, BIAS] = bias(gap, u_n, laws.restitution[a, b], dt)
    mu = friction_of(laws, a, b, abs(u_t))
    if laws.softening_rate.size:
        mu = _softened(laws, a, b, mu, scene.temperature[i], scene.temperature[j])
    out.frame[c, MU] = mu
    out.before[c, NORMAL], out.before[c, TANGENTIAL] = u_n, u_t
    out.lever[c, X], out.lever[c, Y] = lx, ly
    return u_n if u_n < 0.0 and gap + dt * u_n <= 0.0 else 0.0


@formula
def _start_warm(
    c: int, j: int, k: int, last: int, warm: WarmStart, scale: float, out: StepContacts
) -> int:
    """Start contact ``c`` from impulses of the step before, ``k … last-1``; returns the next k."""
    while k < last and warm.j[k] < j:  # both ascend
        k += 1
    if k < last and warm.j[k] == j:
        out.impulse[c, NORMAL], out.impulse[c, TANGENTIAL] = (
            scale * warm.impulse[k, NORMAL],
            scale * warm.impulse[k, TANGENTIAL],
        )
    else:
        out.impulse[c, NORMAL], out.impulse[c, TANGENTIAL] = 0.0, 0.0
    return k


@formula
def _speed(c: int, scene: Scene, start: Floats, contacts: StepContacts) -> float:
    """How fast a grain moves past the other, or past the surface of a wall, spins left out [m/s].

    (Without friction spins never end, also where everything rests.)
    """
    i, j = contacts.i[c], contacts.j[c]
    u_n = contacts.before[c, NORMAL]
    u_t = contacts.before[c, TANGENTIAL] + start[i, SURFACE]
    if j < scene.radius.size:
        u_t += start[j, SURFACE]
    return sqrt(u_n * u_n + u_t * u_t)


@parallel_kernel
def fill_contacts(
    scene: Scene,
    laws: ContactLaws,
    row: NDArray[np.int64],
    partner: Ints,
    gap: Floats,
    normal: Floats,
    margin: float,
    kept: NDArray[np.int64],
    start: Floats,
    dt: float,
    warm: WarmStart,
    scale: float,
    out: StepContacts,
    speeds: Floats,
) -> None:
    """Fill the contacts of a step, sorted by (i, j), with the pairs up to the gap ``margin`` [m].

    ``kept`` are row pointers from `count_contacts`, ``scale`` is the ratio of this time step to
    that of the warm start. **Modifies** ``out`` and ``speeds``: in each chunk of grains the sum of
    min(u_n⁻, 0)² [m²/s²] and the number of contacts that close in the step; the sum of |u_t⁻| [m/s]
    and the number of contacts of two grains that carried an impulse; the sum of `_speed` [m/s] and
    the number of contacts that carried an impulse or close; shape ``(chunks, 6)``.
    """
    count = row.size - 1
    for chunk in prange(speeds.shape[0]):
        squares, closing, slip, loaded, motion, met = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(chunk * CHUNK, min(count, (chunk + 1) * CHUNK)):
            c = kept[i]
            last, k = warm.row[i + 1], warm.row[i]
            for p in range(row[i], row[i + 1]):
                if gap[p] <= margin:
                    j = partner[p]
                    u = _fill_contact(
                        c, i, j, gap[p], normal[p, X], normal[p, Y], scene, laws, start, dt, out
                    )
                    k = _start_warm(c, j, k, last, warm, scale, out)
                    squares += u * u
                    closing += 1.0 if u < 0.0 else 0.0
                    counts = j < count and out.impulse[c, NORMAL] > 0.0
                    slip += abs(out.before[c, TANGENTIAL]) if counts else 0.0
                    loaded += 1.0 if counts else 0.0
                    if out.impulse[c, NORMAL] > 0.0 or u < 0.0:
                        motion += _speed(c, scene, start, out)
                        met += 1.0
                    c += 1
        speeds[chunk, _SQUARES], speeds[chunk, _CLOSING] = squares, closing
        speeds[chunk, _SLIP], speeds[chunk, _LOADED] = slip, loaded
        speeds[chunk, _MOTION], speeds[chunk, _MET] = motion, met


@kernel
def warm_rows(count: int, contact_i: Ints) -> NDArray[np.int64]:
    """Row pointers ``(count + 1,)`` of contacts sorted by grain."""
    row = np.zeros(count + 1, np.int64)
    for c in range(contact_i.size):
        row[contact_i[c] + 1] += 1
    for i in range(count):
        row[i + 1] += row[i]
    return row


@parallel_kernel
def find_missed(
    scene: Scene,
    row: NDArray[np.int64],
    partner: Ints,
    gap: Floats,
    normal: Floats,
    margin: float,
    cutoff: float,
    after: Floats,
    dt: float,
    worst: Floats,
) -> None:
    """Largest approach speed of a pair that was left out although it closes within the step, or 0.

    Arguments as `fill_contacts`; ``after`` are the velocities v⁺, ``cutoff`` is what no pair closes
    [m] and ``worst`` the result per chunk of grains [m/s], shape ``(chunks, 1)``, **modified**.
    """
    count = row.size - 1
    for chunk in prange(worst.shape[0]):
        best = 0.0
        for i in range(chunk * CHUNK, min(count, (chunk + 1) * CHUNK)):
            for p in range(row[i], row[i + 1]):
                g = gap[p]
                if g > margin and g < cutoff:
                    u_n = _normal_velocity(
                        scene, after, i, partner[p], normal[p, X], normal[p, Y], g
                    )
                    if g + dt * u_n < 0.0:
                        best = max(best, -u_n)
        worst[chunk, 0] = best


@formula
def contact_after(
    c: int, scene: Scene, contacts: StepContacts, after: Floats
) -> tuple[float, float]:
    """u_n⁺ and u_t⁺ of a contact, in the frame at q_m [m/s]."""
    i, j = contacts.i[c], contacts.j[c]
    count = scene.radius.size
    nx, ny = contacts.frame[c, NX], contacts.frame[c, NY]
    if j < count:
        return relative_velocity(after, i, j, nx, ny, False, 0.0, 0.0)
    body = count + scene.wall[j - count]
    return relative_velocity(
        after, i, body, nx, ny, True, contacts.lever[c, X], contacts.lever[c, Y]
    )


# ---- Adhesion: contacts that touch bear tension up to a force F_a; its range is zero.
#
# The law is that of Signorini and Coulomb for q_n = p_n + F_a Δt in place of p_n (theory §3.1). F_a
# is known before the step is solved, so it is given to the free velocities, as an attraction of the
# two bodies, and the solver looks for q: no sweep knows of it. A place has one F_a: pieces of walls
# that a grain touches in one place (`engine/geometry/places.py`) divide it among them. In
# `StepContacts` `impulse` holds q and `attraction` F_a Δt; p, the impulse of one body on the other,
# is their difference.

TOUCHING = 1e-9
"""Largest gap, over the radius, of bodies that touch as far as rounded positions tell."""


@formula
def attraction_of(c: int, contacts: StepContacts) -> float:
    """F_a Δt of a contact [N s]; 0 if it is not adhesive in this step."""
    return contacts.attraction[c] if contacts.attraction.size else 0.0


@kernel
def attractions(
    scene: Scene,
    laws: ContactLaws,
    contacts: StepContacts,
    bodies: Floats,
    warm: WarmStart,
    dt: float,
) -> Floats:
    """F_a Δt of all contacts [N s], shape ``(c,)``; 0 where one is not adhesive in this step.

    Adhesive are contacts without a gap (but for rounding), and those whose place carried an impulse
    in the step before and that adhesion alone would close within this one, ``gap ≤ F_a Δt² W_nn``
    (of the grains): contacts turn, which leaves a gap of second order.

    New ones start with p = 0: ``contacts`` are **modified**. ``bodies`` hold velocities and inverse
    masses, shape ``(bodies, 4)``.
    """
    count = scene.radius.size
    found = np.zeros(contacts.i.size)
    carried = met_before(scene, warm.row, warm.j, contacts.i, contacts.j)
    for c in range(found.size):
        i, j = contacts.i[c], contacts.j[c]
        force = laws.adhesion[scene.material[i], scene.material[j]]
        w = bodies[i, INVERSE_MASS] + (bodies[j, INVERSE_MASS] if j < count else 0.0)
        gap = contacts.frame[c, GAP]
        if gap <= TOUCHING * scene.radius[i] or (carried[c] and gap <= dt * dt * force * w):
            found[c] = dt * force
    place, _ = find_places(scene, contacts.i, contacts.j)
    sharing = totals_of_places(place, (found > 0.0).astype(np.float64))
    for c in range(found.size):
        if found[c] > 0.0:
            found[c] /= sharing[c]
            if contacts.impulse[c, NORMAL] == 0.0:
                contacts.impulse[c, NORMAL] = found[c]
    return found


def closing_distance(laws: ContactLaws, grains: Grains, dt: float) -> float:
    """No adhesive contact has a larger gap [m]; 0 if no pair of materials has adhesion."""
    if not laws.adhesion.size:
        return 0.0
    fastest = dt * dt * 2.0 * float(laws.adhesion.max()) / float(grains.mass.min())
    return max(fastest, TOUCHING * float(grains.radius.max()))


def attract(scene: Scene, contacts: StepContacts, free: Floats, wall_inverse: Floats) -> Floats:
    """Free velocities of grains and walls after adhesion; ``free`` itself where there is none."""
    if not contacts.attraction.any():
        return free
    attracted = free.copy()
    _attract(scene, contacts, wall_inverse, attracted)
    return attracted


@kernel
def _attract(scene: Scene, contacts: StepContacts, wall_inverse: Floats, velocity: Floats) -> None:
    count = scene.radius.size
    for c in range(contacts.attraction.size):
        i, j, d = contacts.i[c], contacts.j[c], contacts.attraction[c]
        px, py = d * contacts.frame[c, NX], d * contacts.frame[c, NY]
        velocity[i, X] -= velocity[i, INVERSE_MASS] * px
        velocity[i, Y] -= velocity[i, INVERSE_MASS] * py
        if j < count:
            velocity[j, X] += velocity[j, INVERSE_MASS] * px
            velocity[j, Y] += velocity[j, INVERSE_MASS] * py
        else:
            wall = scene.wall[j - count]
            velocity[count + wall, X] += wall_inverse[wall, X] * px
            velocity[count + wall, Y] += wall_inverse[wall, Y] * py
            torque = contacts.lever[c, X] * py - contacts.lever[c, Y] * px
            velocity[count + wall, SURFACE] += wall_inverse[wall, SPIN] * torque


def net_impulses(reaction: Floats, attraction: Floats) -> Floats:
    """p_n, p_t from q and F_a Δt, which may be of size 0 [N s], shape ``(c, 2)``."""
    if not attraction.size:
        return reaction
    net = reaction.copy()
    net[:, NORMAL] -= attraction
    return net


def resting_attraction(laws: ContactLaws, scene: Scene, i: Ints, j: Ints, dt: float) -> Floats:
    """F_a Δt of contacts known to touch [N s], shape ``(c,)``; of size 0 without any adhesion."""
    if not laws.adhesion.size:
        return np.empty(0)
    sharing = totals_of_places(find_places(scene, i, j)[0], np.ones(i.size))
    return dt * laws.adhesion[scene.material[i], scene.material[j]] / sharing


# ---- Rolling resistance: what it is in a step, and where its couples stand (theory §3.2)


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
def rolling_of_contacts(
    scene: Scene,
    laws: ContactLaws,
    contacts: StepContacts,
    start: Floats,
    warm: WarmStart,
    scale: float,
) -> Floats:
    """Rolling resistance as in `StepContacts`, shape ``(c, 4)``; arguments as `fill_contacts`."""
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
    """Energy that a couple takes in a step, −p_r ½(u_r⁻ + u_r⁺) [J]; ``after`` are the v⁺."""
    if not contacts.rolling.size or contacts.rolling[c, COUPLE] == 0.0:
        return 0.0
    u_r = _rolling_velocity(scene, contacts.i[c], contacts.j[c], contacts.rolling[c, ARM], after)
    return -contacts.rolling[c, COUPLE] * 0.5 * (contacts.rolling[c, BEFORE] + u_r)


@formula
def rolled_loss(c: int, scene: Scene, contacts: StepContacts, after: Floats) -> float:
    """What a couple that rolls takes by the rule of the end of the step, |p_r u_r⁺| [J]."""
    if not contacts.rolling.size or contacts.rolling[c, COUPLE] == 0.0:
        return 0.0
    u_r = _rolling_velocity(scene, contacts.i[c], contacts.j[c], contacts.rolling[c, ARM], after)
    return abs(contacts.rolling[c, COUPLE] * u_r)


@formula
def couple_of(c: int, contacts: StepContacts) -> float:
    """Impulse of a contact's couple on its first body [N m s]; 0 without rolling resistance."""
    return contacts.rolling[c, ARM] * contacts.rolling[c, COUPLE] if contacts.rolling.size else 0.0


def couples_of_contacts(contacts: StepContacts) -> Floats:
    """`couple_of` of all contacts, shape ``(c,)``; of size 0 if no pair of materials has any."""
    return np.asarray(contacts.rolling[:, ARM] * contacts.rolling[:, COUPLE])


def pack_couples(
    scene: Scene,
    contacts: StepContacts,
    belt: Floats,
    slot: Ints,
    general: Ints,
    place: Ints,
    inverse: Floats,
) -> Couples:
    """Couples of contacts, in their order; arrays of `Schedule`, `System` and `OrderedSystem`."""
    if not contacts.rolling.size:
        return NO_COUPLES
    contact = np.flatnonzero(contacts.rolling[:, LIMIT] > 0.0)
    i, j = contacts.i[contact], contacts.j[contact]
    is_wall, effective = j >= scene.radius.size, contacts.rolling[contact, ARM]
    body, arm = np.empty((contact.size, 2), np.int32), np.empty((contact.size, 2))
    body[:, FIRST], arm[:, FIRST] = place[i], effective / scene.radius[i]
    body[~is_wall, SECOND], arm[~is_wall, SECOND] = (
        place[j[~is_wall]],
        effective[~is_wall] / scene.radius[j[~is_wall]],
    )
    body[is_wall, SECOND], arm[is_wall, SECOND] = (
        scene.radius.size + scene.wall[j[is_wall] - scene.radius.size],
        effective[is_wall],
    )
    spins = inverse[body, SPIN]
    mobility = spins[:, FIRST] * (arm[:, FIRST] * arm[:, FIRST]) + spins[:, SECOND] * (
        arm[:, SECOND] * arm[:, SECOND]
    )
    where = _places(slot, general, contacts.i.size)[contact]
    limit, impulse = contacts.rolling[contact, LIMIT], contacts.rolling[contact, COUPLE]
    turning = effective * _turning(scene, j, belt)
    return Couples(
        contact.astype(np.int32), where, body, arm, limit, 1.0 / mobility, impulse, turning
    )


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


# ---- Contacts out of the neighbor list


def gather_contacts(
    scene: Scene,
    lists: NeighborList,
    margin: float,
    laws: ContactLaws,
    start: Floats,
    dt: float,
    warm: WarmStart,
    ratio: float,
) -> tuple[StepContacts, Floats]:
    """Contacts with a gap up to ``margin`` [m], sorted by key; arguments as `fill_contacts`.

    Also returns the sums of the ``speeds`` of `fill_contacts` over all chunks, shape ``(6,)``.
    """
    kept = count_contacts(lists.row, lists.gap, margin)
    count = int(kept[-1])
    contacts = StepContacts(
        np.empty(count, np.int32), np.empty(count, np.int32), np.empty((count, 5)),
        np.empty((count, 2)),
        np.empty((count, 2)), np.empty((count, 2)),
    )  # fmt: skip
    speeds = chunks_for(lists.row.size - 1, 6)
    fill_contacts(
        scene,
        laws,
        lists.row,
        lists.partner,
        lists.gap,
        lists.normal,
        margin,
        kept,
        start,
        dt,
        warm,
        ratio,
        contacts,
        speeds,
    )
    if laws.adhesion.size:
        contacts = contacts._replace(attraction=attractions(scene, laws, contacts, start, warm, dt))
    if laws.rolling.size:
        contacts = contacts._replace(
            rolling=rolling_of_contacts(scene, laws, contacts, start, warm, ratio)
        )
    return contacts, column_totals(speeds)
