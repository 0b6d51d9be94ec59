"""The contacts of a step: geometry, velocities, laws and warm start of the pairs that may touch.

Bodies are rows of one velocity array: grains ``0 … n-1`` hold (v_x, v_y, s = a ω, 1/m); walls
``n … n+w-1`` hold (V_x, V_y, Ω, s), with s = −V_s where a drive lets the surface of the wall run.
With the surface speed s instead of the spin, a contact of discs needs no radius: u_t = (v_i −
v_j)·t − s_i − s_j, and s_j of a wall is what its surface adds to its velocity at the contact.

Which pairs are contacts lasts for several steps (`engine/contact/selection.py`).
"""

from __future__ import annotations

from math import floor, inf, sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.contact.law import (
    GRAZE,
    bias,
    guard_plane,
    softened_friction,
    weakened_friction,
    weakening_speed,
)
from multicor_cli.engine.contact.vector_step import BOUNCE, IS_OURS, SMALLER
from multicor_cli.engine.geometry.scene import Scene, nearest_image, pair_geometry
from multicor_cli.engine.jit.compile import kernel
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.engine.jit.vectors import LANES
from multicor_cli.model.columns import (
    BELT,
    BIAS,
    INVERSE_MASS,
    MASS,
    MU,
    NORMAL,
    NX,
    NY,
    RADIUS,
    SURFACE,
    TANGENTIAL,
    XX,
    XY,
    YY,
    X,
    Y,
)
from multicor_cli.model.model import ContactLaws, Floats, Ints
from multicor_cli.model.shapes import ShapeKind

_VERTEX, _DISC = int(ShapeKind.VERTEX), int(ShapeKind.DISC)

CONTACT = np.dtype(
    (
        np.record,
        np.dtype(
            [
                # What most passes look at: a cache line
                ("i", "i4"),  # grain
                ("j", "i4"),  # grain or wall shape
                ("key", "i4"),  # of faces: which point it is, or -1
                ("gap", "f8"),  # at q_m [m]; infinite where another piece of the wall is nearer
                ("p_n", "f8"),  # impulse [N s]; with adhesion q_n = p_n + F Δt
                ("p_t", "f8"),
                ("u_n", "f8"),  # u_n⁻ [m/s]
                ("u_t", "f8"),  # u_t⁻ [m/s]
                ("attraction", "f8"),  # F Δt of adhesion [N s]
                ("nx", "f8"),  # normal from j to i; of their closest approach where they pass
                ("ny", "f8"),
                ("bias", "f8"),  # b [m/s]
                ("mu", "f8"),  # friction μ
                # Of faces (`engine/contact/faces.py`), and of walls that loads move: what spins of
                # i and j add to u_n and u_t
                ("turn_in", "f8"),
                ("turn_it", "f8"),
                ("turn_jn", "f8"),
                ("turn_jt", "f8"),
                # From a wall's reference point to the contact [m]; ℓ of two grains in a cell, or
                # of faces
                ("lever_x", "f8"),
                ("lever_y", "f8"),
                ("own_x", "f8"),  # of faces: from the center of i to its point [m]
                ("own_y", "f8"),
                ("mu_r", "f8"),  # rolling resistance μ_r
                ("arm", "f8"),  # a* [m] of rolling resistance
                ("u_r", "f8"),  # u_r⁻ [m/s]
                ("p_r", "f8"),  # impulse of the couple over a* [N s]
            ],
            align=True,
        ),
    )
)
"""A contact of a step; arrays of them are sorted by (i, j)."""

Contacts = NDArray[Any]


class Speeds(NamedTuple):
    """Sums over the contacts of a step, from which the scale of its residuals follows.

    Attributes:
        squares: Σ min(u_n⁻, 0)² of contacts that close in the step [m²/s²].
        closing: Number of these contacts.
        shear: Σ |u_t⁻|, of discs with spins left out, of contacts of two grains that carried an
            impulse [m/s].
        loaded: Number of these contacts.
        motion: Sum of the speeds, spins left out, at which contacts that carried an impulse or
            close move [m/s].
        met: Number of these contacts.
    """

    squares: float
    closing: float
    shear: float
    loaded: float
    motion: float
    met: float


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
def stretch_along(
    velocity: Floats, count: int, lx: float, ly: float, nx: float, ny: float
) -> tuple[float, float]:
    """What the gradient of a cell adds to u_n and u_t of two of ``count`` grains [m/s].

    The gradient is the velocity of the first wall; (lx, ly) is the branch vector [m].
    """
    sx = velocity[count, XX] * lx + velocity[count, XY] * ly
    sy = velocity[count, YY] * ly
    return sx * nx + sy * ny, sy * nx - sx * ny


@formula
def normal_velocity(
    scene: Scene, velocity: Floats, i: int, j: int, nx: float, ny: float, gap: float
) -> float:
    """u_n of a pair that is not a contact [m/s]."""
    count = scene.radius.size
    if j < count:
        u_n = relative_velocity(velocity, i, j, nx, ny, False, 0.0, 0.0)[0]
        if scene.height > 0.0:
            length = scene.radius[i] + scene.radius[j] + gap
            u_n += stretch_along(velocity, count, length * nx, length * ny, nx, ny)[0]
        return u_n
    wall = scene.wall[j - count]
    lx, ly = _wall_lever(scene, i, wall, nx, ny, gap)
    return relative_velocity(velocity, i, count + wall, nx, ny, True, lx, ly)[0]


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


@formula
def _mean_temperature(scene: Scene, i: int, j: int) -> float:
    """Mean of two temperatures [K]; of the first where the second is nan (a wall's)."""
    first, second = scene.temperature[i], scene.temperature[j]
    return first if np.isnan(second) else 0.5 * (first + second)


@kernel
def _softened(laws: ContactLaws, a: int, b: int, mu: float, temperature: float) -> float:
    """μ at a temperature [K]."""
    rate = laws.softening_rate[a, b]
    if rate == 0.0:
        return mu
    start, lowest = laws.softening_start[a, b], laws.softening_lowest[a, b]
    highest = laws.softening_highest[a, b]
    return softened_friction(mu, rate, temperature, start, lowest, highest)


@kernel
def _weakened(scene: Scene, laws: ContactLaws, i: int, j: int, mu: float, slip: float) -> float:
    """μ that flash heating leaves at a sliding speed [m/s]."""
    a, b = scene.material[i], scene.material[j]
    speed, limit = laws.flash_speed[a, b], laws.flash_limit[a, b]
    if limit < inf:
        temperature = _mean_temperature(scene, i, j)
        speed = weakening_speed(speed, temperature, limit, laws.flash_reference[a, b])
    return weakened_friction(mu, laws.flash_weakened[a, b], speed, slip)


@formula
def friction_between(scene: Scene, laws: ContactLaws, i: int, j: int, speed: float) -> float:
    """μ of two shapes at a sliding speed [m/s], at their temperatures where it depends on them."""
    a, b = scene.material[i], scene.material[j]
    mu = friction_of(laws, a, b, speed)
    if laws.softening_rate.size:
        mu = _softened(laws, a, b, mu, _mean_temperature(scene, i, j))
    if laws.flash_speed.size:
        mu = _weakened(scene, laws, i, j, mu, speed)
    return mu


# ---- What changes from step to step


@formula
def _wall_plane(
    scene: Scene, i: int, j: int, start: Floats, dt: float
) -> tuple[float, float, float, float]:
    """As `guard_plane`, of a grain and a wall shape: the normal turns beside points and discs."""
    gap, nx, ny = pair_geometry(scene, i, j)
    shape = j - scene.radius.size
    kind, wall = scene.kind[shape], scene.wall[shape]
    if not 0.0 < gap < inf or kind not in (_VERTEX, _DISC):
        return gap, gap, nx, ny
    body, x, y = scene.radius.size + wall, scene.world[shape, X], scene.world[shape, Y]
    lx, ly = x - scene.wall_position[wall, X], y - scene.wall_position[wall, Y]
    ux, _ = relative_velocity(start, i, body, 1.0, 0.0, True, lx, ly)
    uy, _ = relative_velocity(start, i, body, 0.0, 1.0, True, lx, ly)
    dx, dy = nearest_image(scene.position[i, X] - x, scene.period), scene.position[i, Y] - y
    radii = scene.radius[i] + (scene.world[shape, RADIUS] if kind == _DISC else 0.0)
    return guard_plane(dx, dy, ux, uy, radii, GRAZE * scene.radius[i], dt)


@formula
def _refresh(
    c: int, scene: Scene, laws: ContactLaws, start: Floats, dt: float, contacts: Contacts
) -> float:
    """Geometry, velocities and laws of a contact with a wall.

    Returns min(u_n⁻, 0) if it closes in the step, else 0.
    """
    contact = contacts[c]
    i, j, count = contact.i, contact.j, scene.radius.size
    gap, room, nx, ny = _wall_plane(scene, i, j, start, dt)
    u_n, u_t, lx, ly = 0.0, 0.0, 0.0, 0.0
    if gap < inf:
        wall = scene.wall[j - count]
        lx, ly = _wall_lever(scene, i, wall, nx, ny, room)
        u_n, u_t = relative_velocity(start, i, count + wall, nx, ny, True, lx, ly)
    a, b = scene.material[i], scene.material[j]
    mu = friction_between(scene, laws, i, j, abs(u_t))
    contact.nx, contact.ny, contact.gap = nx, ny, gap
    contact.bias, contact.mu = bias(room, u_n, laws.restitution[a, b], dt), mu
    contact.u_n, contact.u_t, contact.lever_x, contact.lever_y = u_n, u_t, lx, ly
    return u_n if u_n < 0.0 and room + dt * u_n <= 0.0 else 0.0


@formula
def _speed(c: int, start: Floats, contacts: Contacts) -> float:
    """How fast a grain moves past the surface of a wall, its spin left out [m/s].

    (Without friction spins never end, also where everything rests.)
    """
    contact = contacts[c]
    u_t = contact.u_t + start[contact.i, SURFACE]
    return sqrt(contact.u_n * contact.u_n + u_t * u_t)


@kernel
def begin_walls(
    scene: Scene, laws: ContactLaws, start: Floats, dt: float, ratio: float, which: Ints,
    contacts: Contacts,
) -> Speeds:  # fmt: skip
    """Everything of some contacts with walls but adhesion and rolling resistance.

    ``start`` are velocities v⁻ of all bodies; ``ratio`` is that of this time step to the last, by
    which impulses change. **Modifies** ``contacts``.
    """
    squares, closing, motion, met = 0.0, 0.0, 0.0, 0.0
    for k in range(which.size):
        c = which[k]
        contact = contacts[c]
        u = _refresh(c, scene, laws, start, dt, contacts)
        kept = ratio if contact.gap < inf else 0.0
        # Of a contact that bears nothing p_t may be −0, which no state remembers
        contact.p_n, contact.p_t = kept * contact.p_n, kept * contact.p_t + 0.0
        squares += u * u
        closing += 1.0 if u < 0.0 else 0.0
        if contact.p_n > 0.0 or u < 0.0:
            motion += _speed(c, start, contacts)
            met += 1.0
    return Speeds(squares, closing, 0.0, 0.0, motion, met)


@kernel
def fix_lanes(
    scene: Scene, laws: ContactLaws, bodies: Floats, i: Ints, j: Ints, slot: Ints, about: Floats,
    frame: Floats,
) -> None:  # fmt: skip
    """What lasts with the contacts of two grains, into their lanes: laws, masses and radii.

    ``bodies`` have inverse masses in their last column. **Modifies** ``about`` and ``frame``.
    """
    for q in range(slot.shape[0]):
        for lane in range(LANES):
            c = slot[q, lane]
            if c < 0 or j[c] >= scene.radius.size:
                continue
            a, b = scene.material[i[c]], scene.material[j[c]]
            about[q, BOUNCE, lane], about[q, IS_OURS, lane] = laws.restitution[a, b], 1.0
            about[q, SMALLER, lane] = min(scene.radius[i[c]], scene.radius[j[c]])
            w = bodies[i[c], INVERSE_MASS] + bodies[j[c], INVERSE_MASS]
            frame[q, MASS, lane], frame[q, MU, lane] = 1.0 / w, laws.friction[a, b]


@kernel
def vary_friction(
    scene: Scene, laws: ContactLaws, i: Ints, j: Ints, slot: Ints, before: Floats, frame: Floats
) -> None:
    """Friction of two grains that depends on speed or temperature, into ``frame``, **modified**."""
    for q in range(slot.shape[0]):
        for lane in range(LANES):
            c = slot[q, lane]
            if c < 0 or j[c] >= scene.radius.size:
                continue
            speed = abs(before[q, TANGENTIAL, lane])
            frame[q, MU, lane] = friction_between(scene, laws, i[c], j[c], speed)


@kernel
def recall_impulses(
    known_i: Ints, known_j: Ints, known: Floats, grains: int, i: Ints, j: Ints, lane: Ints,
    impulse: Floats, contacts: Contacts,
) -> None:  # fmt: skip
    """Impulses that are known of some contacts; 0 of all others.

    Both are sorted. Those of two discs go into their lanes, ``impulse``, others into the table:
    both are **modified**.
    """
    k = 0
    for c in range(i.size):
        while k < known_i.size and (
            known_i[k] < i[c] or (known_i[k] == i[c] and known_j[k] < j[c])
        ):
            k += 1
        p_n, p_t = 0.0, 0.0
        if k < known_i.size and known_i[k] == i[c] and known_j[k] == j[c]:
            p_n, p_t = known[k, NORMAL], known[k, TANGENTIAL]
        at = lane[c]
        if at >= 0:
            impulse[at // LANES, NORMAL, at % LANES] = p_n
            impulse[at // LANES, TANGENTIAL, at % LANES] = p_t
        if at < 0 or j[c] >= grains:
            contacts[c].p_n, contacts[c].p_t = p_n, p_t


@kernel
def scatter_impulses(contacts: Contacts, slot: Ints, impulse: Floats) -> None:
    """Impulses from the table into the lanes, **modified**."""
    for q in range(slot.shape[0]):
        for lane in range(LANES):
            c = slot[q, lane]
            if c >= 0:
                impulse[q, NORMAL, lane] = contacts[c].p_n
                impulse[q, TANGENTIAL, lane] = contacts[c].p_t


@formula
def recall_lane(
    contact: Any, i: int, j: int, frame: Floats, impulse: Floats, before: Floats, gap: Floats,
    branch: Floats, q: int, k: int,
) -> None:  # fmt: skip
    """What the lanes hold of two grains i and j, into their contact, but the bias and μ."""
    contact.i, contact.j, contact.key = i, j, -1
    contact.nx, contact.ny, contact.gap = frame[q, NX, k], frame[q, NY, k], gap[q, k]
    contact.p_n, contact.p_t = impulse[q, NORMAL, k], impulse[q, TANGENTIAL, k]
    contact.u_n, contact.u_t = before[q, NORMAL, k], before[q, TANGENTIAL, k]
    if branch.size:
        contact.lever_x, contact.lever_y = branch[q, X, k], branch[q, Y, k]


@kernel
def tabulate(
    grains: int, i: Ints, j: Ints, lane: Ints, frame: Floats, impulse: Floats, before: Floats,
    gap: Floats, branch: Floats, contacts: Contacts,
) -> None:  # fmt: skip
    """Contacts (i, j) of two discs from their lanes into the table, **modified**.

    Arrays are those of `Schedule`.
    """
    for c in range(contacts.size):
        if j[c] >= grains or lane[c] < 0:
            continue
        contact, q, k = contacts[c], lane[c] // LANES, lane[c] % LANES
        recall_lane(contact, i[c], j[c], frame, impulse, before, gap, branch, q, k)
        contact.bias, contact.mu = frame[q, BIAS, k], frame[q, MU, k]


@kernel
def warm_rows(count: int, contact_i: Ints) -> NDArray[np.int64]:
    """Row pointers ``(count + 1,)`` of contacts sorted by grain."""
    row = np.zeros(count + 1, np.int64)
    for c in range(contact_i.size):
        row[contact_i[c] + 1] += 1
    for i in range(count):
        row[i + 1] += row[i]
    return row


@formula
def contact_after(c: int, scene: Scene, contacts: Contacts, after: Floats) -> tuple[float, float]:
    """u_n⁺ and u_t⁺ of a contact, in the frame at q_m [m/s]."""
    contact = contacts[c]
    i, j, nx, ny = contact.i, contact.j, contact.nx, contact.ny
    count = scene.radius.size
    if contact.key >= 0:
        body = j if j < count else count + scene.wall[j - count]
        s_i, s_j = after[i, SURFACE], after[body, SURFACE]
        dx, dy = after[i, X] - after[body, X], after[i, Y] - after[body, Y]
        u_n = dx * nx + dy * ny + s_i * contact.turn_in - s_j * contact.turn_jn
        u_t = dy * nx - dx * ny + s_i * contact.turn_it - s_j * contact.turn_jt
        if j >= count:
            return u_n, u_t - after[body, BELT]
    elif j < count:
        u_n, u_t = relative_velocity(after, i, j, nx, ny, False, 0.0, 0.0)
    else:
        body = count + scene.wall[j - count]
        return relative_velocity(after, i, body, nx, ny, True, contact.lever_x, contact.lever_y)
    if scene.height > 0.0:
        more_n, more_t = stretch_along(after, count, contact.lever_x, contact.lever_y, nx, ny)
        u_n, u_t = u_n + more_n, u_t + more_t
    return u_n, u_t
