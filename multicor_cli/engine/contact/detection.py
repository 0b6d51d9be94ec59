"""From the neighbor list to the contacts of one step: gaps, frames, relative velocities, laws and warm start.

Bodies are rows of one velocity array: grains ``0 … n-1`` hold (v_x, v_y, s = a ω, 1/m); walls ``n … n+w-1`` hold (V_x, V_y, Ω, s),
with s = −V_s where a drive lets the surface of the wall run. With the surface speed s instead of the spin, a contact of discs needs
no radius: u_t = (v_i − v_j)·t − s_i − s_j, and s_j of a wall is what its surface adds to its velocity at the contact.
"""

from __future__ import annotations

from math import floor
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.contact.law import bias
from multicor_cli.engine.contact.softening import softened_friction
from multicor_cli.engine.geometry.scene import Scene, pair_geometry
from multicor_cli.engine.jit.chunks import CHUNK
from multicor_cli.engine.jit.compile import kernel, parallel_kernel, prange
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.model.columns import BELT, BIAS, GAP, MU, NORMAL, NX, NY, SURFACE, TANGENTIAL, X, Y
from multicor_cli.model.model import ContactLaws, Floats, Ints

_SQUARES, _CLOSING, _SLIP, _LOADED = range(4)
_NONE, _NO_ROLLING = np.empty(0), np.empty((0, 4))


class StepContacts(NamedTuple):
    """Contacts of one step, sorted by (i, j); ``c`` rows.

    Attributes:
        i: Grain, shape ``(c,)``.
        j: Grain or wall shape, shape ``(c,)``.
        frame: Normal n_x, n_y (from j to i), gap at q_m [m], bias b [m/s], friction μ, shape ``(c, 5)``.
        before: u_n⁻, u_t⁻ [m/s], shape ``(c, 2)``.
        impulse: p_n, p_t [N s], shape ``(c, 2)``.
        lever: From the wall's reference point to the contact [m]; 0 for grains, shape ``(c, 2)``.
        attraction: F_a Δt of adhesive contacts [N s], shape ``(c,)``; ``impulse`` then holds q_n = p_n + F_a Δt in place of p_n.
            Of size 0 if no pair of materials has adhesion.
        rolling: μ_r, a* [m], u_r⁻ [m/s], p_r [N s], shape ``(c, 4)``; of size 0 if no pair of materials has rolling resistance.
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
    """Impulses of the step before, by grain: those of grain i are ``row[i]:row[i+1]``; couples where there are any [N m s]."""

    row: NDArray[np.int64]
    j: Ints
    impulse: Floats
    couple: Floats = _NONE


@formula
def _wall_lever(scene: Scene, i: int, wall: int, nx: float, ny: float, gap: float) -> tuple[float, float]:
    """From the reference point of a wall to the point of the wall that is closest to grain i."""
    reach = scene.radius[i] + gap
    dx = scene.position[i, X] - scene.wall_position[wall, X]
    if scene.period > 0.0:  # the image of the point on the wall counts: the grain may lie beyond half a period
        dx -= scene.period * floor((dx - reach * nx) / scene.period + 0.5)
    return dx - reach * nx, scene.position[i, Y] - scene.wall_position[wall, Y] - reach * ny


@formula
def relative_velocity(
    velocity: Floats, i: int, body_j: int, nx: float, ny: float, is_wall: bool, lx: float, ly: float
) -> tuple[float, float]:
    """u_n, u_t of grain i relative to grain ``body_j``, or to the point (lx, ly) of the wall in row ``body_j`` [m/s]."""
    # Number by number: a row taken out of an array would count as a reference to it, and threads count one after the other.
    if is_wall:
        dx = velocity[i, X] - (velocity[body_j, X] - velocity[body_j, SURFACE] * ly)
        dy = velocity[i, Y] - (velocity[body_j, Y] + velocity[body_j, SURFACE] * lx)
        return dx * nx + dy * ny, dy * nx - dx * ny - velocity[i, SURFACE] - velocity[body_j, BELT]
    dx, dy = velocity[i, X] - velocity[body_j, X], velocity[i, Y] - velocity[body_j, Y]
    return dx * nx + dy * ny, dy * nx - dx * ny - velocity[i, SURFACE] - velocity[body_j, SURFACE]


@formula
def _normal_velocity(scene: Scene, velocity: Floats, i: int, j: int, nx: float, ny: float, gap: float) -> float:
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
    reach: float,
    gap: Floats,
    normal: Floats,
    fastest: Floats,
) -> None:
    """Gaps and normals of all listed pairs at q_m, and the largest approach speed among those nearer than ``reach``.

    Args:
        scene: Shapes at q_m.
        row: Start of each grain's row, shape ``(n + 1,)``.
        partner: Partners, shape ``(pairs,)``.
        start: Body velocities at the start of the step, shape ``(bodies, 4)``.
        free: Free velocities, shape ``(bodies, 4)``.
        reach: No pair farther apart can touch in this step [m].
        gap: Gaps [m], shape ``(pairs,)``. **Modified.**
        normal: Normals n_x, n_y, from j to i, shape ``(pairs, 2)``. **Modified.**
        fastest: Largest approach speed in each chunk of grains, at the start or free [m/s]; 0 if nothing approaches, shape
            ``(chunks, 1)``. **Modified.**
    """
    count = scene.radius.size
    for chunk in prange(fastest.shape[0]):
        best = 0.0
        for i in range(chunk * CHUNK, min(count, (chunk + 1) * CHUNK)):
            for p in range(row[i], row[i + 1]):
                j = partner[p]
                g, nx, ny = pair_geometry(scene, i, j)
                gap[p], normal[p, X], normal[p, Y] = g, nx, ny
                if g < reach:
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
    """μ of a pair of materials at a sliding speed [m/s]: the table of the pair, linear between its points, or a constant."""
    table = laws.table[a, b]
    if table < 0:
        return laws.friction[a, b]
    first, last = laws.table_start[table], laws.table_start[table + 1] - 1
    if speed <= laws.table_speed[first]:
        return laws.table_friction[first]
    for k in range(first, last):
        if speed < laws.table_speed[k + 1]:
            share = (speed - laws.table_speed[k]) / (laws.table_speed[k + 1] - laws.table_speed[k])
            return laws.table_friction[k] + share * (laws.table_friction[k + 1] - laws.table_friction[k])
    return laws.table_friction[last]


@kernel
def _softened(laws: ContactLaws, a: int, b: int, mu: float, first: float, second: float) -> float:
    """μ at the mean of two temperatures [K]; the second may be nan (a wall without temperature), then the first counts."""
    rate = laws.softening_rate[a, b]
    if rate == 0.0:
        return mu
    mean = first if np.isnan(second) else 0.5 * (first + second)
    start, lowest, highest = laws.softening_start[a, b], laws.softening_lowest[a, b], laws.softening_highest[a, b]
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
    """Fill row ``c`` of ``out``, impulses left out; returns min(u_n⁻, 0) if the contact closes within the step, else 0."""
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
def _start_warm(c: int, j: int, k: int, last: int, warm: WarmStart, scale: float, out: StepContacts) -> int:
    """Start contact ``c`` with j from the impulses of the step before, if it is among ``k … last-1``; returns where to go on."""
    while k < last and warm.j[k] < j:  # both ascend
        k += 1
    if k < last and warm.j[k] == j:
        out.impulse[c, NORMAL], out.impulse[c, TANGENTIAL] = scale * warm.impulse[k, NORMAL], scale * warm.impulse[k, TANGENTIAL]
    else:
        out.impulse[c, NORMAL], out.impulse[c, TANGENTIAL] = 0.0, 0.0
    return k


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
    """Fill the contacts of a step, sorted by (i, j).

    Args:
        scene: Shapes at q_m.
        laws: Contact laws.
        row: Rows of the neighbor list, shape ``(n + 1,)``.
        partner: Partners in the list.
        gap: Gaps of the listed pairs [m].
        normal: Their normals.
        margin: Pairs with a larger gap are left out [m].
        kept: Row pointers from `count_contacts`.
        start: Body velocities at the start of the step, shape ``(bodies, 4)``.
        dt: Time step [s].
        warm: Impulses of the step before.
        scale: Ratio of this time step to that of the warm start.
        out: The contacts. **Modified.**
        speeds: For each chunk of grains the sum of min(u_n⁻, 0)² over the contacts that close within the step [m²/s²] and their
            number; the sum of |u_t⁻| over the contacts of two grains that carried an impulse [m/s] and their number; shape
            ``(chunks, 4)``. **Modified.**
    """
    count = row.size - 1
    for chunk in prange(speeds.shape[0]):
        squares, closing, slip, loaded = 0.0, 0.0, 0.0, 0.0
        for i in range(chunk * CHUNK, min(count, (chunk + 1) * CHUNK)):
            c = kept[i]
            last, k = warm.row[i + 1], warm.row[i]
            for p in range(row[i], row[i + 1]):
                if gap[p] <= margin:
                    j = partner[p]
                    u = _fill_contact(c, i, j, gap[p], normal[p, X], normal[p, Y], scene, laws, start, dt, out)
                    k = _start_warm(c, j, k, last, warm, scale, out)
                    squares += u * u
                    closing += 1.0 if u < 0.0 else 0.0
                    counts = j < count and out.impulse[c, NORMAL] > 0.0
                    slip += abs(out.before[c, TANGENTIAL]) if counts else 0.0
                    loaded += 1.0 if counts else 0.0
                    c += 1
        speeds[chunk, _SQUARES], speeds[chunk, _CLOSING] = squares, closing
        speeds[chunk, _SLIP], speeds[chunk, _LOADED] = slip, loaded


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
    reach: float,
    after: Floats,
    dt: float,
    worst: Floats,
) -> None:
    """Largest approach speed of a pair that was left out although it closes within the step; 0 if there is none.

    Args as `fill_contacts`; ``after`` are the velocities v⁺, ``reach`` the distance that no pair can close [m] and ``worst`` the
    result per chunk of grains [m/s], shape ``(chunks, 1)``, **modified**.
    """
    count = row.size - 1
    for chunk in prange(worst.shape[0]):
        best = 0.0
        for i in range(chunk * CHUNK, min(count, (chunk + 1) * CHUNK)):
            for p in range(row[i], row[i + 1]):
                g = gap[p]
                if g > margin and g < reach:
                    u_n = _normal_velocity(scene, after, i, partner[p], normal[p, X], normal[p, Y], g)
                    if g + dt * u_n < 0.0:
                        best = max(best, -u_n)
        worst[chunk, 0] = best


@formula
def contact_after(c: int, scene: Scene, contacts: StepContacts, after: Floats) -> tuple[float, float]:
    """u_n⁺ and u_t⁺ of a contact, in the frame at q_m [m/s]."""
    i, j = contacts.i[c], contacts.j[c]
    count = scene.radius.size
    nx, ny = contacts.frame[c, NX], contacts.frame[c, NY]
    if j < count:
        return relative_velocity(after, i, j, nx, ny, False, 0.0, 0.0)
    body = count + scene.wall[j - count]
    return relative_velocity(after, i, body, nx, ny, True, contacts.lever[c, X], contacts.lever[c, Y])
