"""Grains in flight: impacts in the order of their times, each where the two touch.

A step solves all contacts at once, as if they met in its middle. That is right for grains that stay
together, and wrong for grains that rebound: the second impact of a step finds a grain whose first
one has not happened yet. So grains *fly* in a step if none of their contacts lasts, and none of
those whom they meet has one that does. What flies goes on a parabola from one impact to the next,
as in an event-driven simulation (Lubachevsky 1991); an impact is that of the contact law (theory
§3), one contact at a time. All others belong to the solve alone.

After an impact at a time t a grain is given the start that would have led it, without an impact, to
where it was: x' = x − t Δv, v' = v + Δv. From there the step takes it as any other.

Everything here is a function of the state at the start of the step alone.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.contact.contacts import Contacts, Speeds, normal_velocity
from multicor_cli.engine.contact.impacts import COLUMNS, U_N, Impacts, hit
from multicor_cli.engine.contact.law import GRAZE
from multicor_cli.engine.contact.meetings import Air, Walls, discs_meet_soon, meets, relative
from multicor_cli.engine.geometry.neighbors import Around
from multicor_cli.engine.geometry.radii import smaller_of
from multicor_cli.engine.geometry.scene import Scene, known_geometry
from multicor_cli.engine.jit.compile import kernel, loop_body, subroutine
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.engine.jit.vectors import LANES
from multicor_cli.model.columns import (
    ANGLE,
    BIAS,
    FIRST,
    INVERSE_MASS,
    NORMAL,
    NX,
    NY,
    SECOND,
    SURFACE,
    X,
    Y,
)
from multicor_cli.model.model import ContactLaws, Floats, Ints

MOST = 64
"""Impacts of a grain in a step; one that has more of them has come to rest on something."""

_ROUNDING = 1e-12
"""Of their speeds, what grains in flight may approach by beyond what they do by themselves."""

SOLVED = 1.5
"""Steps within which a contact in the solve closes: from half a step before q_m to one after it."""


class Flight(NamedTuple):
    """The flights of a step.

    Attributes:
        flying: Grains that fly, shape ``(n,)``.
        impacts: Their impacts.
        struck: Those that have had some.
        gravity_work: Of gravity on x' − x [J].
        reach: A gap that no pair closes while it counts, impacts and all [m].
        unseen: Grains that may have flown and do no more, if some go so far in the step that they
            may be through others before the solve sees them: no step before has kept them apart.
        speeds: What impacts add to the `Speeds` of a step.
    """

    flying: NDArray[np.bool_]
    impacts: Impacts
    struck: NDArray[np.int64]
    gravity_work: float
    reach: float
    unseen: NDArray[np.int64]
    speeds: Speeds


@formula
def _opens(air: Air, i: int, j: int) -> bool:
    """Whether two grains open by more than `GRAZE` in a step."""
    dx, dy, u, v = relative(air, i, j, 0.0)
    along, dt = dx * u + dy * v, air.dt
    graze = GRAZE * smaller_of(air.scene, i, j)
    square = dx * dx + dy * dy
    return bool((along > 0.0) & (dt * dt * along * along > graze * graze * square))


@formula
def _leaves(scene: Scene, i: int, j: int, start: Floats, dt: float, limit: float) -> bool:
    """Whether a grain is farther from a wall than a limit [m], or opens by more than `GRAZE`."""
    gap, nx, ny = known_geometry(scene, i, j)
    opening = dt * normal_velocity(scene, start, i, j, nx, ny, gap)
    return bool(gap > limit or opening > GRAZE * scene.radius[i])


@subroutine
def _find_flying(
    air: Air, contact_i: Ints, contact_j: Ints, row: NDArray[np.int64], partner: Ints
) -> None:
    """Ground all grains one of whose contacts lasts.

    A contact lasts that carried an impulse in the step before, and does not open by more than
    `GRAZE` within this one; on a wall the next piece goes on with it.
    """
    scene, flying, count = air.scene, air.flying, air.flying.size
    for c in range(contact_i.size):
        i, j = contact_i[c], contact_j[c]
        if j < count:
            # Without a branch, which nobody could foresee
            opens = _opens(air, i, j)
            flying[i] &= opens
            flying[j] &= opens
            continue
        # The contact itself comes first, then what else may hold the grain on the wall
        for p in range(row[i] - 1, row[i + 1]):
            shape = j if p < row[i] else partner[p]
            limit = inf if p < row[i] else GRAZE * scene.radius[i]
            if flying[i] and shape >= count:
                flying[i] = _leaves(scene, i, shape, air.bodies, air.dt, limit)


# ---- Next meetings: the earliest of each grain, and a tournament of them


class _Meetings(NamedTuple):
    """Whom grains in flight meet on the ways on which they start.

    Attributes:
        i: Pairs of them that meet while a solve would count it; ``j`` is larger.
        time: When they do [s].
        wall_time: When each grain meets a wall first [s], shape ``(n,)``; ``wall`` is its shape.
        few: Work space, listed pairs.
    """

    i: NDArray[np.int64]
    j: NDArray[np.int64]
    time: Floats
    wall_time: Floats
    wall: NDArray[np.int64]
    few: NDArray[np.int64]


class _Plan(NamedTuple):
    """The next meetings of grains in flight, which have numbers of their own.

    Attributes:
        entry: These numbers, shape ``(n,)``.
        time: When each meets something next [s], and ``other``, what.
        tree: Whose is the first: of all in row 1, of each half in rows 2 and 3, …; -1 is nobody.
        queue: Grains whose next meeting has to be found, and who is ``waiting`` there.
        impacts: How many each has had.
    """

    entry: NDArray[np.int64]
    time: Floats
    other: NDArray[np.int64]
    tree: NDArray[np.int64]
    queue: NDArray[np.int64]
    waiting: NDArray[np.bool_]
    impacts: NDArray[np.int64]


@formula
def _grounds(air: Air, laws: ContactLaws, i: int, j: int) -> bool:
    """Whether a grain does not fly on from a shape that it meets."""
    scene, count = air.scene, air.flying.size
    if laws.restitution[scene.material[i], scene.material[j]] == 0.0:
        return True
    if j >= count:
        return bool(air.walls.is_free[scene.wall[j - count]])
    return not air.flying[j]


@loop_body
def _look_at_what_rests(
    air: Air, laws: ContactLaws, begun: NDArray[np.bool_], partner: Ints, meetings: _Meetings
) -> int:
    """Those that meet what grounds them **fly no more**: in a dense flow nearly all.

    Enters meetings with walls, and into ``few`` the pairs of grains that have begun to fly; returns
    how many these are.
    """
    flying, count, long, owner = air.flying, begun.size, SOLVED * air.dt, air.around.owner
    few, near, found = meetings.few, 0, 0
    meetings.wall_time[:], meetings.wall[:] = inf, -1
    for p in range(partner.size):
        few[near] = p  # without a branch, as above
        near += begun[owner[p]] | begun[min(partner[p], count - 1)]
    for k in range(near):
        p = few[k]
        i, j = int(owner[p]), int(partner[p])
        if j >= count:
            t = meets(air, i, j, 0.0, long) if flying[i] else inf
            if t < inf and _grounds(air, laws, i, j):
                flying[i] = False
            elif t < min(air.dt, meetings.wall_time[i]):
                meetings.wall_time[i], meetings.wall[i] = t, j
            continue
        one, both = i if begun[i] else j, begun[i] & begun[j]
        flying[one] &= both | (not discs_meet_soon(air, i, j, long))
        few[found] = p
        found += both
    return found


@loop_body
def _look_at_each_other(
    air: Air, laws: ContactLaws, partner: Ints, meetings: _Meetings, pairs: int
) -> int:
    """Enter whom those that fly meet first, of these ``few``; returns the number of meetings."""
    flying, found = air.flying, 0
    for k in range(pairs):
        p = meetings.few[k]
        i, j = int(air.around.owner[p]), int(partner[p])
        if not (flying[i] or flying[j]):
            continue
        t = meets(air, i, j, 0.0, SOLVED * air.dt)
        if t < inf and flying[i] and flying[j] and not _grounds(air, laws, i, j):
            meetings.i[found], meetings.j[found], meetings.time[found] = i, j, t
            found += 1
        elif t < inf:
            flying[i] = flying[j] = False
    return found


@subroutine
def _ground(flying: NDArray[np.bool_], i: NDArray[np.int64], j: NDArray[np.int64]) -> bool:
    """Whoever meets a grain that does not fly does not either; returns if that grounds any."""
    changed = False
    for k in range(i.size):
        if flying[i[k]] != flying[j[k]]:
            flying[i[k]] = flying[j[k]] = False
            changed = True
    return changed


@kernel
def _plan_of(air: Air, meetings: _Meetings, pairs: int) -> _Plan:
    """The first meetings of a step."""
    flying = air.flying
    grains, half = np.flatnonzero(flying), 1
    while half < grains.size:
        half *= 2
    entry, tree = np.full(flying.size, -1, np.int64), np.full(2 * half, -1, np.int64)
    time, other = np.full(half, inf), np.full(half, -1, np.int64)
    for k in range(grains.size):
        i = grains[k]
        entry[i], tree[half + k] = k, k
        time[k], other[k] = meetings.wall_time[i], meetings.wall[i]
    for m in range(pairs):
        i, j, t = meetings.i[m], meetings.j[m], meetings.time[m]
        if flying[i] and flying[j] and t < air.dt:
            if t < time[entry[i]]:
                time[entry[i]], other[entry[i]] = t, j
            if t < time[entry[j]]:
                time[entry[j]], other[entry[j]] = t, i
    for node in range(half - 1, 0, -1):
        a, b = tree[2 * node], tree[2 * node + 1]
        tree[node] = a if _is_before(time, a, b) else b
    return _Plan(
        entry, time, other, tree, np.empty(flying.size, np.int64), np.zeros(flying.size, np.bool_),
        np.zeros(half, np.int64),
    )  # fmt: skip


@formula
def _is_before(time: Floats, a: int, b: int) -> bool:
    """Whether entry a comes first; -1 is none."""
    if a < 0 or b < 0:
        return b < 0 <= a
    return time[a] < time[b] or (time[a] == time[b] and a < b)


@formula
def _set_next(plan: _Plan, i: int, time: float, other: int) -> None:
    """Enter the next meeting of a grain, and find anew who is first."""
    tree, k = plan.tree, plan.entry[i]
    plan.time[k], plan.other[k] = time, other
    node = (tree.size // 2 + k) // 2
    while node > 0:
        a, b = tree[2 * node], tree[2 * node + 1]
        tree[node] = a if _is_before(plan.time, a, b) else b
        node //= 2


@loop_body
def _seek(
    air: Air, laws: ContactLaws, plan: _Plan, i: int, now: float, queued: int
) -> tuple[int, bool]:
    """The next meeting of a grain from a time on [s], and of those that it meets before their own.

    Whoever had it as its next and does not meet it any more is queued, if it is not waiting.
    Returns how many are, and whether the grain meets what grounds it.
    """
    best, partner, count = inf, -1, air.flying.size
    for p in range(air.around.start[i], air.around.start[i + 1]):
        j = int(air.around.other[p])
        ends = _grounds(air, laws, i, j)
        t = meets(air, i, j, now, SOLVED * air.dt if ends else air.dt)
        if ends and t < inf:
            return queued, True
        if t < best:
            best, partner = t, j
        if j < count and air.flying[j]:
            k = plan.entry[j]
            if t < plan.time[k]:
                _set_next(plan, j, t, i)
            elif plan.other[k] == i and t != plan.time[k] and not plan.waiting[j]:
                plan.queue[queued], plan.waiting[j] = j, True
                queued += 1
    _set_next(plan, i, best, partner)
    return queued, False


# ---- The impacts of a step


@formula
def _note(
    air: Air, plan: _Plan, i: int, start: Floats, queued: int, fastest: float, jump: float
) -> tuple[int, float, float]:
    """A grain after an impact: it is to be looked at; largest squares of speeds and changes."""
    k = plan.entry[i]
    plan.impacts[k] += 1
    plan.time[k], plan.other[k] = inf, -1
    plan.queue[queued], plan.waiting[i] = i, True
    u, v = air.bodies[i, X], air.bodies[i, Y]
    du, dv = u - start[i, X], v - start[i, Y]
    return queued + 1, max(fastest, u * u + v * v), max(jump, du * du + dv * dv)


@subroutine
def _restart(
    air: Air, grains: NDArray[np.int64], middle: Floats, start: Floats, free: Floats
) -> float:
    """Give grains their last starts; returns the work of gravity on q' − q [J]."""
    scene, dt, gravity, work = air.scene, air.dt, air.gravity, 0.0
    for k in range(grains.size):
        i = grains[k]
        place, body = air.place[i], air.bodies[i]
        dx, dy = place[X] - scene.position[i, X], place[Y] - scene.position[i, Y]
        work += (gravity[X] * dx + gravity[Y] * dy) / body[INVERSE_MASS]
        for d in range(3):
            start[i, d] = free[i, d] = body[d]
        free[i, X] += dt * gravity[X]
        free[i, Y] += dt * gravity[Y]
        middle[i, X], middle[i, Y] = place[X] + 0.5 * dt * body[X], place[Y] + 0.5 * dt * body[Y]
        middle[i, ANGLE] = place[ANGLE] + 0.5 * dt * (body[SURFACE] / scene.radius[i])
    return work


@formula
def _go_back(air: Air, grains: NDArray[np.int64], start: Floats) -> None:
    """Give grains the starts with which they began."""
    for k in range(grains.size):
        for d in range(4):
            air.bodies[grains[k], d] = start[grains[k], d]
            if d < 3:
                air.place[grains[k], d] = air.scene.position[grains[k], d]


@kernel
def _take_impacts(
    air: Air, laws: ContactLaws, plan: _Plan, grains: NDArray[np.int64], beta: float, start: Floats
) -> tuple[Impacts, bool, float, float]:
    """Impacts until the step ends; also whether any grain **flies no more**: then nothing holds.

    Last come the largest squares of speeds, and of what they changed by [m²/s²].
    """
    who, said = np.empty((64, 2), np.int32), np.empty((64, COLUMNS))
    count, queued, now, found, is_grounded = air.flying.size, 0, 0.0, 0, False
    fastest, jump = 0.0, 0.0
    while grains.size > 0:
        while queued > 0:
            queued -= 1
            i = plan.queue[queued]
            plan.waiting[i] = False
            queued, ends = _seek(air, laws, plan, i, now, queued)
            if ends or plan.impacts[plan.entry[i]] >= MOST:
                air.flying[i], is_grounded = False, True
                _set_next(plan, i, inf, -1)
        k = plan.tree[1]
        if k < 0 or not plan.time[k] < air.dt:
            break
        now, i, j = plan.time[k], grains[k], plan.other[k]
        if j < count and not air.flying[j]:
            air.flying[i] = False
            _set_next(plan, i, inf, -1)
            continue
        if found == who.shape[0]:
            who, said = np.append(who, who, axis=0), np.append(said, said, axis=0)
        first, second = (j, i) if j < i else (i, j)
        who[found, FIRST], who[found, SECOND] = first, second
        hit(air, laws, beta, first, second, now, said[found])
        found += 1
        queued, fastest, jump = _note(air, plan, first, start, queued, fastest, jump)
        if second < count:
            queued, fastest, jump = _note(air, plan, second, start, queued, fastest, jump)
    impacts = Impacts(who[:found, FIRST].copy(), who[:found, SECOND].copy(), said[:found].copy())
    return impacts, is_grounded, fastest, jump


@kernel
def fly(
    scene: Scene, flow: Floats, laws: ContactLaws, walls: Walls, contact_i: Ints, contact_j: Ints,
    row: NDArray[np.int64], partner: Ints, around: Around, gravity: Floats, dt: float, beta: float,
    moved: float, listed: float, middle: Floats, start: Floats, free: Floats,
) -> Flight:  # fmt: skip
    """Impacts of grains in flight within a step, from the earliest on.

    ``scene`` is that at the start of the step, with the gradient ``flow`` of a cell, where bodies
    have their real velocities, ``contact_i`` and ``contact_j`` carried an impulse
    in the one before; ``row`` and ``partner``, and ``around`` by both grains, list all pairs up to
    a gap ``listed`` [m]; ``beta`` is m a²/I, ``moved`` a gap that no pair closes with v⁻ in
    `SOLVED` steps [m]. The rows of ``middle``, ``start`` and ``free`` (as in
    `motion.moves.predict`) of grains that have had impacts are **modified**, unless the ``reach``
    of the result is above ``listed``: pairs may meet that are not listed.
    """
    flying = np.ones(scene.radius.size, np.bool_)
    place, bodies = scene.position.copy(), start.copy()
    air = Air(scene, flow, walls, around, gravity, dt, place, bodies, flying)
    _find_flying(air, contact_i, contact_j, row, partner)
    begun, count = flying.copy(), flying.size
    if not begun.any():
        nobody, none = np.empty(0, np.int64), np.empty(0, np.int32)
        impacts = Impacts(none, none, np.empty((0, COLUMNS)))
        return Flight(
            begun, impacts, nobody, 0.0, moved, nobody, Speeds(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        )
    slowest = 0.0
    for i in range(count):
        slowest = max(slowest, start[i, X] * start[i, X] + start[i, Y] * start[i, Y])
    slowest, long = sqrt(slowest), SOLVED * dt
    fall = dt * sqrt(gravity[X] * gravity[X] + gravity[Y] * gravity[Y])
    meetings, reach = _Meetings(
        np.empty(partner.size, np.int64), np.empty(partner.size, np.int64),
        np.empty(partner.size), np.empty(count), np.empty(count, np.int64),
        np.empty(partner.size, np.int64),
    ), moved  # fmt: skip
    pairs = _look_at_what_rests(air, laws, begun, partner, meetings)
    pairs = _look_at_each_other(air, laws, partner, meetings, pairs)
    meet_i, meet_j = meetings.i[:pairs], meetings.j[:pairs]
    while True:
        while _ground(flying, meet_i, meet_j):
            pass
        grains, plan = np.flatnonzero(flying), _plan_of(air, meetings, pairs)
        impacts, is_grounded, fastest, jump = _take_impacts(air, laws, plan, grains, beta, start)
        fastest = max(sqrt(fastest), slowest)
        far = max(moved, long * (2.0 * fastest + fall)) + long * (fastest - slowest)
        reach = max(reach, min(moved + 2.0 * long * sqrt(jump), far))
        if not is_grounded or reach > listed:
            break
        # Once more, without all who have had to do with those that fly no more
        hit_i, hit_j = np.empty(impacts.i.size, np.int64), np.empty(impacts.i.size, np.int64)
        for k in range(hit_i.size):
            i, j = impacts.i[k], impacts.j[k]
            hit_i[k], hit_j[k] = i, j if j < count else i
        while _ground(flying, hit_i, hit_j) or _ground(flying, meet_i, meet_j):
            pass
        _go_back(air, grains, start)
    struck, squares, motion = np.empty(grains.size, np.int64), 0.0, 0.0
    found, number = 0, 1.0 * impacts.i.size
    for k in range(grains.size):
        if plan.impacts[k] > 0:
            struck[found] = grains[k]
            found += 1
    for k in range(impacts.i.size):
        squares += impacts.said[k, U_N] * impacts.said[k, U_N]
        motion += abs(impacts.said[k, U_N])
    struck, work = struck[:found], 0.0
    if reach <= listed:
        work = _restart(air, struck, middle, start, free)
    speeds = Speeds(squares, number, 0.0, 0.0, motion, number)
    # In half a step two come nearer by no more than this; the solve sees overlaps up to a radius
    is_far = dt * slowest > scene.radius.min()
    unseen = np.flatnonzero(begun & ~flying) if is_far else np.empty(0, np.int64)
    return Flight(flying, impacts, struck, work, reach, unseen, speeds)


# ---- Flights beside the solve


@kernel
def leave_flights_out(
    scene: Scene, flying: NDArray[np.bool_], is_free: NDArray[np.bool_], i: Ints, j: Ints,
    lane: Ints, frame: Floats, before: Floats, contacts: Contacts, free: Floats,
) -> int:  # fmt: skip
    """Take contacts out of the solve whose grains fly: only what does not may push into them.

    A grain in flight that leaves another may come back as fast and no faster: its next impact is
    one of the next step. (Held apart they would gain energy, p·½(u⁻ + u⁺) > 0.) Nor may the solve
    brake what the step itself does to the two, as gravity, with which a ball comes down faster than
    it went up: with the velocities ``free`` of all bodies the contact bears nothing.

    Returns how many contacts are left. Arrays of a `Schedule`; ``frame`` and ``contacts`` are
    **modified**.
    """
    count, left = flying.size, 0
    for c in range(i.size):
        is_grain = j[c] < count
        if not (flying[i[c]] or (is_grain and flying[j[c]])):
            left += 1
            continue
        q, k = lane[c] // LANES, lane[c] % LANES
        u_n = before[q, NORMAL, k] if is_grain else contacts[c].u_n
        flies = flying[j[c]] if is_grain else not is_free[scene.wall[j[c] - count]]
        if flying[i[c]] and flies:
            body = j[c] if is_grain else count + scene.wall[j[c] - count]
            nx = frame[q, NX, k] if is_grain else contacts[c].nx
            ny = frame[q, NY, k] if is_grain else contacts[c].ny
            gap = known_geometry(scene, i[c], j[c])[0]
            closing = -normal_velocity(scene, free, i[c], j[c], nx, ny, gap)
            own = abs(free[i[c], X]) + abs(free[i[c], Y])
            other = abs(free[body, X]) + abs(free[body, Y])
            u_n = max(abs(u_n), closing) + _ROUNDING * (own + other)
        else:
            left += 1
        if is_grain:
            frame[q, BIAS, k] = max(frame[q, BIAS, k], u_n)
        else:
            contacts[c].bias = max(contacts[c].bias, u_n)
    return left
