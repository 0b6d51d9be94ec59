"""Impacts of grains in flight: one contact at a time, and how the contacts of a step hold them."""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from multicor_cli.engine.contact.contacts import (
    Contacts,
    contact_after,
    friction_between,
    recall_lane,
)
from multicor_cli.engine.contact.law import solve_exact
from multicor_cli.engine.contact.meetings import Air, relative, wall_at
from multicor_cli.engine.geometry.scene import Scene
from multicor_cli.engine.jit.compile import kernel, loop_body, subroutine
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.engine.jit.vectors import LANES
from multicor_cli.model.columns import (
    ANGLE,
    INVERSE_MASS,
    NORMAL,
    NX,
    NY,
    SURFACE,
    TANGENTIAL,
    XX,
    XY,
    YY,
    X,
    Y,
)
from multicor_cli.model.model import ContactLaws, Floats, Ints


class Impacts(NamedTuple):
    """Impacts of a step, in the order of their times.

    Attributes:
        i: Grains, shape ``(k,)``.
        j: Grains or wall shapes.
        said: Columns of `_NX` … `_LEVER_Y` and, in a cell, `_CONVECTED`, shape ``(k, 13)``.
    """

    i: Ints
    j: Ints
    said: Floats


_NX, _NY, P_N, _P_T, _IMPACT, _FRICTION, U_N, _U_T, _LEVER_X, _LEVER_Y, _CONVECTED = range(11)
COLUMNS = _CONVECTED + 3
"""The lever is that of a wall, or the branch vector ℓ of two grains [m]; convected is what the rest
of the step convects otherwise than if the impact had been at its start: xx, yy, xy [J s]."""


@formula
def _in_world(p_n: float, p_t: float, nx: float, ny: float) -> tuple[float, float]:
    return p_n * nx - p_t * ny, p_n * ny + p_t * nx


@loop_body
def hit(air: Air, laws: ContactLaws, beta: float, i: int, j: int, t: float, said: Floats) -> None:
    """An impact of two bodies that touch: new starts of the grains, and a row of `Impacts`."""
    scene, place, bodies, count = air.scene, air.place, air.bodies, air.flying.size
    is_wall, lx, ly, belt = j >= count, 0.0, 0.0, 0.0
    if is_wall:
        _, nx, ny, lx, ly, u, v, _, _ = wall_at(
            scene, air.walls, place, bodies, air.gravity, i, j - count, t
        )
        belt = air.walls.belt[scene.wall[j - count]]
        inverse = bodies[i, INVERSE_MASS]
    else:
        dx, dy, u, v = relative(air, i, j, t)
        lx, ly = dx, dy
        distance = sqrt(dx * dx + dy * dy)
        nx, ny = (dx / distance, dy / distance) if distance > 0.0 else (0.0, 1.0)
        belt, inverse = bodies[j, SURFACE], bodies[i, INVERSE_MASS] + bodies[j, INVERSE_MASS]
    more_u, more_v = 0.0, 0.0
    if scene.height > 0.0:
        more_u, more_v = _bend(air.flow, lx - t * u, ly - t * v, t)
    all_u, all_v = u + more_u, v + more_v
    u_n, u_t = all_u * nx + all_v * ny, all_v * nx - all_u * ny - bodies[i, SURFACE] - belt
    a, b = scene.material[i], scene.material[j]
    mu = friction_between(scene, laws, i, j, abs(u_t))
    turning = (1.0 + beta) * inverse
    approach = u_n if u_n < 0.0 else 0.0
    p_n, p_t = solve_exact(
        0.0, 0.0, (1.0 + laws.restitution[a, b]) * approach, u_t, 1.0 / inverse, 1.0 / turning, mu
    )
    px, py = _in_world(p_n, p_t, nx, ny)
    for side in range(1 if is_wall else 2):
        k, sign = (i, 1.0) if side == 0 else (j, -1.0)
        m = bodies[k, INVERSE_MASS]
        change = -beta * m * p_t  # of a ω, the same for both
        bodies[k, X] += sign * m * px
        bodies[k, Y] += sign * m * py
        bodies[k, SURFACE] += change
        place[k, X] -= t * sign * m * px
        place[k, Y] -= t * sign * m * py
        place[k, ANGLE] -= t * change / scene.radius[k]
    said[_NX], said[_NY], said[P_N], said[_P_T] = nx, ny, p_n, p_t
    said[U_N], said[_U_T] = u_n, u_t
    said[_IMPACT] = -p_n * (u_n + 0.5 * inverse * p_n)
    said[_FRICTION] = -p_t * (u_t + 0.5 * turning * p_t)
    said[_LEVER_X], said[_LEVER_Y] = lx, ly
    if scene.height > 0.0:
        _convect(air.flow, lx, ly, u, v, px, py, inverse, t, said)


@formula
def _bend(flow: Floats, x: float, y: float, t: float) -> tuple[float, float]:
    """What a cell has added to the velocity on a straight way by a time t, t L² ℓ: as ċ = −L c.

    The branch vector (x, y) is that at the start of the step.
    """
    xx, yy, xy = flow[XX], flow[YY], flow[XY]
    x, y = xx * x + xy * y, yy * y
    return t * (xx * x + xy * y), t * (yy * y)


@formula
def _convect(
    flow: Floats, lx: float, ly: float, u: float, v: float, px: float, py: float, inverse: float,
    t: float, said: Floats,
) -> None:  # fmt: skip
    """Enter what an impact at a time t convects, for books that close.

    Velocities c at the start of the step change by (1 + t L) p/m. So grains gain p (u + ½ p/m),
    what their impact does not lose, and −L : (p⊗ℓ + convected), with convected = −t (c⊗p + p⊗c +
    p⊗p/m + ½ t (L p)⊗p/m).
    """
    xx, yy, xy = flow[XX], flow[YY], flow[XY]
    x, y, more = lx - t * u, ly - t * v, 0.5 * t * inverse
    cx, cy = u - (xx * x + xy * y), v - yy * y
    ax = cx + inverse * px + more * (xx * px + xy * py)
    ay = cy + inverse * py + more * (yy * py)
    said[_CONVECTED + XX] = -t * (ax * px + px * cx)
    said[_CONVECTED + YY] = -t * (ay * py + py * cy)
    said[_CONVECTED + XY] = -t * (ax * py + px * cy)


@kernel
def convected_by(impacts: Impacts, change: Floats) -> Floats:
    """What impacts convect: xx, yy, xy [J s], shape ``(3,)``.

    They were found with the gradient of a cell before the step, which in the books differs by
    ``change`` [1/s], shape ``(3,)``. What they then give to it less is among their losses, which
    are **modified**.
    """
    convected = np.zeros(3)
    for e in range(impacts.i.size):
        said = impacts.said[e]
        px, py = _in_world(said[P_N], said[_P_T], said[_NX], said[_NY])
        given = change[XX] * px * said[_LEVER_X] + change[YY] * py * said[_LEVER_Y]
        given += change[XY] * px * said[_LEVER_Y]
        for d in range(3):
            convected[d] += said[_CONVECTED + d]
            given += change[d] * said[_CONVECTED + d]
        said[_IMPACT] -= given
    return convected


@subroutine
def row_of(i: Ints, j: Ints, first: int, second: int) -> int:
    """Where a pair is in pairs sorted by (i, j), or -1."""
    low, high = 0, i.size
    while low < high:
        middle = (low + high) // 2
        if i[middle] < first or (i[middle] == first and j[middle] < second):
            low = middle + 1
        else:
            high = middle
    return low if low < i.size and i[low] == first and j[low] == second else -1


@kernel
def are_contacts(impacts: Impacts, i: Ints, j: Ints) -> bool:
    """Whether all pairs that had impacts are among pairs sorted by (i, j)."""
    missing = 0
    for k in range(impacts.i.size):
        missing += row_of(i, j, impacts.i[k], impacts.j[k]) < 0
    return missing == 0


@formula
def _add(virial: Floats, px: float, py: float, x: float, y: float) -> None:
    """Add p⊗(x, y): xx, xy, yx, yy."""
    virial[0] += px * x
    virial[1] += px * y
    virial[2] += py * x
    virial[3] += py * y


@kernel
def enter_impacts(
    scene: Scene, impacts: Impacts, i: Ints, j: Ints, after: Floats, lane: Ints, frame: Floats,
    impulse: Floats, before: Floats, gap: Floats, branch: Floats, contacts: Contacts,
) -> tuple[Ints, Floats, Floats]:  # fmt: skip
    """Impacts into the contacts of a step, as if the solve had found them: impulse, normal, u⁻.

    u⁻ is such that a contact loses −p·½(u⁻ + u⁺), as all others, with the u⁺ of the end of the
    step. Several impulses of one pair add up, and so do their losses and torques. ``scene`` is
    that at q_m, ``after`` are v⁺; arrays of a `Schedule` and ``contacts`` are **modified**. Returns
    the contacts, the impulses that they had, and in a cell what p⊗ℓ lacks where ℓ is that at q_m
    and not that of the touch: xx, xy, yx, yy [J s].
    """
    count, virial = scene.radius.size, np.zeros(4)
    rows, known = np.full(impacts.i.size, -1, np.int32), np.empty((impacts.i.size, 2))
    for e in range(impacts.i.size):
        said = impacts.said[e]
        if said[P_N] == 0.0:
            continue
        c = row_of(i, j, impacts.i[e], impacts.j[e])
        contact, is_wall = contacts[c], j[c] >= count
        q, k = lane[c] // LANES, lane[c] % LANES
        if not is_wall:
            recall_lane(contact, i[c], j[c], frame, impulse, before, gap, branch, q, k)
        rows[e], known[e, NORMAL], known[e, TANGENTIAL] = c, contact.p_n, contact.p_t
        nx, ny = said[_NX], said[_NY]
        px, py = _in_world(said[P_N], said[_P_T], nx, ny)
        if scene.height > 0.0:
            _add(virial, px, py, said[_LEVER_X] - contact.lever_x, said[_LEVER_Y] - contact.lever_y)
        impact, friction, along = said[_IMPACT], said[_FRICTION], said[_P_T]
        torque = said[_LEVER_X] * py - said[_LEVER_Y] * px
        if contact.p_n > 0.0:
            u_n, u_t = contact_after(c, scene, contacts, after)
            impact -= contact.p_n * 0.5 * (contact.u_n + u_n)
            friction -= contact.p_t * 0.5 * (contact.u_t + u_t)
            dx, dy = _in_world(contact.p_n, contact.p_t, contact.nx, contact.ny)
            torque += contact.lever_x * dy - contact.lever_y * dx
            px, py, along = px + dx, py + dy, along + contact.p_t
            # The normal for which what acts along the surface is the sum, too
            square = px * px + py * py
            along = along if square > along * along else 0.0
            if square == 0.0:
                continue
            across = sqrt(square - along * along)
            nx, ny = (across * px + along * py) / square, (across * py - along * px) / square
        # In tables −0 says that no step begins with this: the solve has found nothing here
        was_impact = contact.p_n == 0.0 or (contact.gap == 0.0 and 1.0 / contact.gap < 0.0)
        contact.nx, contact.ny, contact.gap = nx, ny, -0.0 if was_impact else 0.0
        contact.p_n, contact.p_t = px * nx + py * ny, along
        if is_wall:
            rest = torque - said[_LEVER_X] * py + said[_LEVER_Y] * px
            rest /= px * px + py * py
            contact.lever_x = said[_LEVER_X] + rest * py
            contact.lever_y = said[_LEVER_Y] - rest * px
        u_n, u_t = contact_after(c, scene, contacts, after)
        contact.u_t = said[_U_T]
        if contact.p_t != 0.0:
            contact.u_t = -2.0 * friction / contact.p_t - u_t
        else:
            impact += friction
        contact.u_n = -2.0 * impact / contact.p_n - u_n
        if not is_wall:
            frame[q, NX, k], frame[q, NY, k], gap[q, k] = nx, ny, contact.gap
            impulse[q, NORMAL, k], impulse[q, TANGENTIAL, k] = contact.p_n, contact.p_t
            before[q, NORMAL, k], before[q, TANGENTIAL, k] = contact.u_n, contact.u_t
    return rows, known, virial


@kernel
def take_back(
    rows: Ints, known: Floats, grains: int, j: Ints, lane: Ints, impulse: Floats, contacts: Contacts
) -> None:
    """Give contacts the impulses that they had before `enter_impacts`; latest first."""
    for e in range(rows.size - 1, -1, -1):
        c = rows[e]
        if c >= 0 and j[c] < grains:
            q, k = lane[c] // LANES, lane[c] % LANES
            impulse[q, NORMAL, k] = known[e, NORMAL]
            impulse[q, TANGENTIAL, k] = known[e, TANGENTIAL]
        elif c >= 0:
            contacts[c].p_n, contacts[c].p_t = known[e, NORMAL], known[e, TANGENTIAL]
