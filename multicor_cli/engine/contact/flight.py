"""Grains in flight: impacts in the order of their times, each where the two touch.

A step solves all contacts at once, as if they met in its middle. That is right for grains that stay
together, and wrong for grains that rebound: the second impact of a step finds a grain whose first
one has not happened yet. So grains *fly* in a step if none of their contacts lasts, and until they
meet something that does not. What flies goes on a parabola from one impact to the next, as in an
event-driven simulation (Lubachevsky 1991); an impact is that of the contact law (theory §3), one
contact at a time.

After an impact at a time t a grain is given the start that would have led it, without an impact, to
where it was: x' = x − t Δv, v' = v + Δv. From there the step takes it as any other. Where it met
something that does not fly, this is the start of its contacts in the solve.

Everything here is a function of the state at the start of the step alone.
"""

from __future__ import annotations

from math import floor, inf, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.contact.contacts import (
    Contacts,
    Speeds,
    contact_after,
    friction_between,
    normal_velocity,
)
from multicor_cli.engine.contact.law import GRAZE, solve_exact
from multicor_cli.engine.geometry.neighbors import Around
from multicor_cli.engine.geometry.radii import smaller_of
from multicor_cli.engine.geometry.scene import (
    Scene,
    distance_to_whole,
    known_geometry,
    nearest_image,
    placed_shape,
)
from multicor_cli.engine.jit.compile import kernel, loop_body
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
    SPIN,
    SURFACE,
    TANGENTIAL,
    X,
    Y,
)
from multicor_cli.model.model import ContactLaws, Floats, Ints
from multicor_cli.model.shapes import ShapeKind

_CIRCLE = int(ShapeKind.CIRCLE)

MOST = 64
"""Impacts of a grain in a step; one that has more of them has come to rest on something."""

TOUCHING = 1e-13
"""Gap over the radius at which a grain touches a wall."""

NEVER = 1e30
"""Bias of contacts that are no part of the solve [m/s]: no velocity reaches it."""

_LOOKS = 60  # at a way towards a wall; five do


class Walls(NamedTuple):
    """Walls in a step, each with its mean velocity.

    Attributes:
        local: Shapes in the frames of their walls, shape ``(m, 4)``.
        frame: These frames at the start of the step, shape ``(w, 3)``.
        velocity: Mean velocities, shape ``(w, 3)``; belt speeds as in column `BELT`, ``(w,)``.
        is_free: Which walls loads move: what meets them does not fly on, shape ``(w,)``.
    """

    local: Floats
    frame: Floats
    velocity: Floats
    belt: Floats
    is_free: NDArray[np.bool_]


class Impacts(NamedTuple):
    """Impacts of a step, in the order of their times.

    Attributes:
        i: Grains, shape ``(k,)``.
        j: Grains or wall shapes.
        said: Columns of `_NX` … `_LEVER_Y`, shape ``(k, 10)``.
    """

    i: Ints
    j: Ints
    said: Floats


_NX, _NY, _P_N, _P_T, _IMPACT, _FRICTION, _U_N, _U_T, _LEVER_X, _LEVER_Y = range(10)
_COLUMNS = 10


class Flight(NamedTuple):
    """The flights of a step.

    Attributes:
        begun: Grains that fly when it begins, shape ``(n,)``.
        flying: Those that still do when it ends.
        impacts: Their impacts, and those of others before they met what does not fly.
        landed: Pairs with which flights have ended, in the order of their times, shape ``(l, 2)``.
        struck: Grains that have had impacts.
        gravity_work: Of gravity on x' − x [J].
        reach: A gap that no pair closes in the step, impacts and all [m].
        is_wild: Whether grains that land have been among others that fly farther than a diameter:
            then nothing of this holds.
        speeds: What impacts add to the `Speeds` of a step.
    """

    begun: NDArray[np.bool_]
    flying: NDArray[np.bool_]
    impacts: Impacts
    landed: Ints
    struck: NDArray[np.int64]
    gravity_work: float
    reach: float
    is_wild: bool
    speeds: Speeds


@formula
def _lasts(scene: Scene, i: int, j: int, start: Floats, dt: float, limit: float) -> bool:
    """Whether a pair is no farther apart than a limit [m], and opens by no more than `GRAZE`."""
    gap, nx, ny = known_geometry(scene, i, j)
    opening = dt * normal_velocity(scene, start, i, j, nx, ny, gap)
    return gap <= limit and opening <= GRAZE * smaller_of(scene, i, j)


@kernel
def find_flying(
    scene: Scene, contact_i: Ints, contact_j: Ints, row: NDArray[np.int64], partner: Ints,
    start: Floats, dt: float,
) -> NDArray[np.bool_]:  # fmt: skip
    """Grains none of whose contacts lasts, shape ``(n,)``.

    A contact lasts that carried an impulse in the step before, and does not open by more than
    `GRAZE` within this one; on a wall the next piece goes on with it. ``contact_i`` and
    ``contact_j`` carried one, ``row`` and ``partner`` list the pairs that are near. ``scene`` is
    that at the start of the step, ``start`` are v⁻.
    """
    count = scene.radius.size
    flying = np.ones(count, np.bool_)
    for c in range(contact_i.size):
        i, j = contact_i[c], contact_j[c]
        if _lasts(scene, i, j, start, dt, inf):
            flying[i] = False
            if j < count:
                flying[j] = False
        elif j >= count and flying[i]:
            for p in range(row[i], row[i + 1]):
                if partner[p] >= count and _lasts(
                    scene, i, partner[p], start, dt, GRAZE * scene.radius[i]
                ):
                    flying[i] = False
    return flying


# ---- When a pair meets


@formula
def _relative(
    place: Floats, bodies: Floats, i: int, j: int, t: float, period: float
) -> tuple[float, float, float, float]:
    """Where grain i is from grain j at a time [m], nearest image, and how fast it moves so [m/s].

    Gravity acts on both.
    """
    u, v = bodies[i, X] - bodies[j, X], bodies[i, Y] - bodies[j, Y]
    dx = nearest_image(place[i, X] - place[j, X] + t * u, period)
    return dx, place[i, Y] - place[j, Y] + t * v, u, v


@formula
def _discs_meet(
    scene: Scene, place: Floats, bodies: Floats, i: int, j: int, now: float, end: float
) -> float:
    """When two grains meet, from a time on and before the ``end`` [s]; else infinite."""
    dx, dy, u, v = _relative(place, bodies, i, j, now, scene.period)
    reach, images, best = scene.radius[i] + scene.radius[j], 0, inf
    if scene.period > 0.0 and abs(dx) + abs(u) * (end - now) + reach > 0.5 * scene.period:
        images = int(abs(u) * (end - now) / scene.period) + 1
    for image in range(-images, images + 1):
        x = dx + image * scene.period
        along = x * u + dy * v
        room = x * x + dy * dy - reach * reach
        square = along * along - (u * u + v * v) * room
        if along < 0.0 and square > 0.0:
            wait = room / (sqrt(square) - along) if room > 0.0 else 0.0
            best = min(best, now + wait)
    return best if best < end else inf


@formula
def _wall_at(
    scene: Scene, walls: Walls, place: Floats, bodies: Floats, gravity: Floats, i: int, shape: int,
    t: float,
) -> tuple[float, float, float, float, float, float, float, float, float]:  # fmt: skip
    """A grain and a wall shape at a time.

    Returns the gap [m] and its normal, the lever of the point that is nearest on the wall [m], the
    velocity of the grain against it [m/s], a bound of how fast the gap's rate may fall [m/s²], and
    the time for which it holds [s].
    """
    w = scene.wall[shape]
    x = place[i, X] + t * (bodies[i, X] + 0.5 * t * gravity[X])
    y = place[i, Y] + t * (bodies[i, Y] + 0.5 * t * gravity[Y])
    frame, move = walls.frame[w], walls.velocity[w]
    fx, fy, spin = frame[X] + t * move[X], frame[Y] + t * move[Y], move[SPIN]
    g0, g1, g2, g3 = placed_shape(
        scene.kind[shape], walls.local, shape, fx, fy, frame[ANGLE] + t * spin
    )
    distance, nx, ny = distance_to_whole(x, y, scene.kind[shape], g0, g1, g2, g3, scene.period)
    dx = x - fx - distance * nx
    if scene.period > 0.0:  # the image of the point on the wall counts
        dx -= scene.period * floor(dx / scene.period + 0.5)
    dy = y - fy - distance * ny
    u = bodies[i, X] + t * gravity[X] - (move[X] - spin * dy)
    v = bodies[i, Y] + t * gravity[Y] - (move[Y] + spin * dx)
    falls = sqrt(gravity[X] * gravity[X] + gravity[Y] * gravity[Y])
    holds = inf
    if spin != 0.0:  # Coriolis and centrifugal forces in the frame of the wall
        speed = sqrt(u * u + v * v) + abs(spin) * abs(distance)
        arm = sqrt(dx * dx + dy * dy) + abs(distance)
        falls = 2.0 * falls + 2.0 * abs(spin) * (2.0 * speed + abs(spin) * arm)
        holds = 0.1 / abs(spin)
    if scene.period > 0.0:  # until another image may be nearer; lines are shorter than half of it
        speed = sqrt(u * u + v * v) + abs(spin) * abs(distance)
        away = max(0.25 * scene.period - abs(distance * nx), distance - scene.radius[i])
        holds = min(holds, max(away, 1e-3 * scene.radius[i]) / speed) if speed > 0.0 else holds
    if scene.kind[shape] == _CIRCLE:  # inside, a straight way bends towards it
        inner, speed = g2 - distance, sqrt(u * u + v * v)
        if speed > 0.0:
            holds = min(holds, max(0.5 * inner, 1e-3 * scene.radius[i]) / speed)
        falls += 2.0 * speed * speed / max(inner, 2e-3 * scene.radius[i])
    return distance - scene.radius[i], nx, ny, dx, dy, u, v, falls, holds


@loop_body
def _wall_meets(
    scene: Scene, walls: Walls, place: Floats, bodies: Floats, gravity: Floats, i: int, shape: int,
    now: float, end: float,
) -> float:  # fmt: skip
    """When a grain meets a wall shape, from a time on and before the ``end`` [s]; else infinite.

    From below: the gap is at least gap + rate s − ½ a s² after s, with the bound a of `_wall_at`.
    """
    t, touching = now, TOUCHING * scene.radius[i]
    for _ in range(_LOOKS):
        gap, nx, ny, _, _, u, v, falls, holds = _wall_at(
            scene, walls, place, bodies, gravity, i, shape, t
        )
        rate = u * nx + v * ny
        if gap <= touching and (
            rate < 0.0 or (rate == 0.0 and gravity[X] * nx + gravity[Y] * ny < 0.0)
        ):
            return t
        room = max(gap, 0.0)
        root = sqrt(rate * rate + 2.0 * falls * room)
        if rate < 0.0:
            wait = 2.0 * room / (root - rate)
        else:
            wait = (rate + root) / falls if falls > 0.0 else inf
        t += min(wait, holds)
        if t >= end:
            return inf
    return inf


# ---- Next meetings: the earliest of each grain, and a tournament of them


class _Air(NamedTuple):
    """What the flights of a step need; ``place`` and ``bodies`` are starts as they are now."""

    scene: Scene
    walls: Walls
    around: Around
    gravity: Floats
    dt: float
    place: Floats
    bodies: Floats
    flying: NDArray[np.bool_]


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


@kernel
def _plan_of(flying: NDArray[np.bool_]) -> _Plan:
    """Nobody meets anybody yet, and all are waiting."""
    grains, half = np.flatnonzero(flying), 1
    while half < grains.size:
        half *= 2
    entry, tree = np.full(flying.size, -1, np.int64), np.full(2 * half, -1, np.int64)
    queue = np.empty(flying.size, np.int64)
    for k in range(grains.size):
        entry[grains[k]], tree[half + k], queue[k] = k, k, grains[k]
    return _Plan(
        entry, np.full(half, inf), np.full(half, -1, np.int64), tree, queue, flying.copy(),
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
def _seek(air: _Air, plan: _Plan, i: int, now: float, queued: int) -> int:
    """The next meeting of a grain from a time on [s], and of those that it meets before their own.

    Whoever had it as its next and does not meet it any more is queued, if it is not waiting.
    Returns how many are.
    """
    best, partner, count = inf, -1, air.flying.size
    for p in range(air.around.start[i], air.around.start[i + 1]):
        j = int(air.around.other[p])
        if j >= count:
            t = _wall_meets(
                air.scene, air.walls, air.place, air.bodies, air.gravity, i, j - count, now, air.dt
            )
        else:  # the same bits whoever asks
            first, second = (i, j) if i < j else (j, i)
            t = _discs_meet(air.scene, air.place, air.bodies, first, second, now, air.dt)
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
    return queued


# ---- The impacts of a step


@loop_body
def _hit(air: _Air, laws: ContactLaws, beta: float, i: int, j: int, t: float, said: Floats) -> None:
    """An impact of two bodies that touch: new starts of the grains, and a row of `Impacts`."""
    scene, place, bodies, count = air.scene, air.place, air.bodies, air.flying.size
    is_wall, lx, ly, belt = j >= count, 0.0, 0.0, 0.0
    if is_wall:
        _, nx, ny, lx, ly, u, v, _, _ = _wall_at(
            scene, air.walls, place, bodies, air.gravity, i, j - count, t
        )
        belt = air.walls.belt[scene.wall[j - count]]
        inverse = bodies[i, INVERSE_MASS]
    else:
        dx, dy, u, v = _relative(place, bodies, i, j, t, scene.period)
        distance = sqrt(dx * dx + dy * dy)
        nx, ny = (dx / distance, dy / distance) if distance > 0.0 else (0.0, 1.0)
        belt, inverse = bodies[j, SURFACE], bodies[i, INVERSE_MASS] + bodies[j, INVERSE_MASS]
    u_n, u_t = u * nx + v * ny, v * nx - u * ny - bodies[i, SURFACE] - belt
    a, b = scene.material[i], scene.material[j]
    mu = friction_between(scene, laws, i, j, abs(u_t))
    turning = (1.0 + beta) * inverse
    approach = u_n if u_n < 0.0 else 0.0
    p_n, p_t = solve_exact(
        0.0, 0.0, (1.0 + laws.restitution[a, b]) * approach, u_t, 1.0 / inverse, 1.0 / turning, mu
    )
    px, py = p_n * nx - p_t * ny, p_n * ny + p_t * nx
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
    said[_NX], said[_NY], said[_P_N], said[_P_T] = nx, ny, p_n, p_t
    said[_U_N], said[_U_T] = u_n, u_t
    said[_IMPACT] = -p_n * (u_n + 0.5 * inverse * p_n)
    said[_FRICTION] = -p_t * (u_t + 0.5 * turning * p_t)
    said[_LEVER_X], said[_LEVER_Y] = lx, ly


@formula
def _goes_on(air: _Air, laws: ContactLaws, plan: _Plan, i: int, j: int) -> bool:
    """Whether a grain that meets a shape flies on."""
    scene, count = air.scene, air.flying.size
    if laws.restitution[scene.material[i], scene.material[j]] == 0.0:
        return False
    if plan.impacts[plan.entry[i]] >= MOST:
        return False
    if j >= count:
        return not air.walls.is_free[scene.wall[j - count]]
    return bool(air.flying[j] and plan.impacts[plan.entry[j]] < MOST)


@formula
def _note(
    air: _Air, plan: _Plan, i: int, start: Floats, queued: int, fastest: float, jump: float
) -> tuple[int, float, float]:
    """A grain after an impact: it is to be looked at; largest squares of speeds and changes."""
    k = plan.entry[i]
    plan.impacts[k] += 1
    plan.time[k], plan.other[k] = inf, -1
    plan.queue[queued], plan.waiting[i] = i, True
    u, v = air.bodies[i, X], air.bodies[i, Y]
    du, dv = u - start[i, X], v - start[i, Y]
    return queued + 1, max(fastest, u * u + v * v), max(jump, du * du + dv * dv)


@kernel
def _restart(
    air: _Air, grains: NDArray[np.int64], middle: Floats, start: Floats, free: Floats
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


@kernel
def fly(
    scene: Scene, laws: ContactLaws, walls: Walls, around: Around, gravity: Floats, dt: float,
    beta: float, begun: NDArray[np.bool_], moved: float, listed: float, middle: Floats,
    start: Floats, free: Floats,
) -> Flight:  # fmt: skip
    """Impacts of grains in flight, from the earliest on, until the step ends or they fly no more.

    ``scene`` is that at the start of the step, ``around`` lists all pairs up to a gap ``listed``
    [m] by both grains; ``beta`` is m a²/I, ``moved`` a gap that no pair closes with v⁻ [m],
    ``begun`` from `find_flying`. The rows of ``middle``, ``start`` and ``free`` (as in
    `motion.moves.predict`) of grains that have had impacts are **modified**, unless the result
    ``is_wild``, or its ``reach`` is above ``listed``: pairs may meet that are not listed.
    """
    flying = begun.copy()
    air = _Air(scene, walls, around, gravity, dt, scene.position.copy(), start.copy(), flying)
    grains, plan = np.flatnonzero(begun), _plan_of(begun)
    slowest = 0.0
    for i in range(begun.size):
        slowest = max(slowest, start[i, X] * start[i, X] + start[i, Y] * start[i, Y])
    queued, now, found, ended = grains.size, 0.0, 0, 0
    fastest, jump, squares, motion = slowest, 0.0, 0.0, 0.0
    landed = np.empty((grains.size, 2), np.int32)
    who, said = np.empty((64, 2), np.int32), np.empty((64, _COLUMNS))
    while True:
        while queued > 0:
            queued -= 1
            i = plan.queue[queued]
            plan.waiting[i] = False
            if flying[i]:
                queued = _seek(air, plan, i, now, queued)
        k = plan.tree[1]
        if k < 0 or not plan.time[k] < dt:
            break
        now, i, j = plan.time[k], grains[k], plan.other[k]
        if not _goes_on(air, laws, plan, i, j):
            # From here on the solve has it, and all that meet it
            landed[ended, FIRST], landed[ended, SECOND] = i, j
            ended += 1
            for body in (i, j):
                if body < begun.size and flying[body]:
                    flying[body] = False
                    _set_next(plan, body, inf, -1)
            continue
        if found == who.shape[0]:
            who, said = np.append(who, who, axis=0), np.append(said, said, axis=0)
        first, second = (j, i) if j < i else (i, j)
        who[found, FIRST], who[found, SECOND] = first, second
        _hit(air, laws, beta, first, second, now, said[found])
        squares += said[found, _U_N] * said[found, _U_N]
        motion += abs(said[found, _U_N])
        found += 1
        queued, fastest, jump = _note(air, plan, first, start, queued, fastest, jump)
        if second < begun.size:
            queued, fastest, jump = _note(air, plan, second, start, queued, fastest, jump)
    fall = dt * sqrt(gravity[X] * gravity[X] + gravity[Y] * gravity[Y])
    faster = dt * (sqrt(fastest) - sqrt(slowest))
    reach = min(
        moved + 2.0 * dt * sqrt(jump), max(moved, dt * (2.0 * sqrt(fastest) + fall)) + faster
    )
    is_wild = ended > 0 and dt * sqrt(fastest) > 2.0 * scene.radius.min()
    struck, work = grains[plan.impacts[: grains.size] > 0], 0.0
    if not is_wild and reach <= listed:
        work = _restart(air, struck, middle, start, free)
    return Flight(
        begun, flying, Impacts(who[:found, FIRST].copy(), who[:found, SECOND].copy(),
        said[:found].copy()), landed[:ended].copy(), struck, work, reach, is_wild,
        Speeds(squares, 1.0 * found, 0.0, 0.0, motion, 1.0 * found),
    )  # fmt: skip


# ---- Flights beside the solve


@kernel
def land(scene: Scene, flight: Flight, gravity: Floats, mass: Floats) -> float:
    """Put grains to where they touched what their flights ended with, if they overlap it at q_m.

    ``scene`` is that at q_m, whose positions are **modified**. Returns the work of gravity [J].
    """
    work, count = 0.0, scene.radius.size
    for k in range(flight.landed.shape[0]):
        i, j = flight.landed[k, FIRST], flight.landed[k, SECOND]
        gap, nx, ny = known_geometry(scene, i, j)
        if gap >= 0.0:
            continue
        share = 1.0
        if j < count and flight.begun[j]:
            share = mass[j] / (mass[i] + mass[j])
            back = (1.0 - share) * gap
            work += mass[j] * _shift(scene, j, back * nx, back * ny, gravity)
        work += mass[i] * _shift(scene, i, -share * gap * nx, -share * gap * ny, gravity)
    return work


@formula
def _shift(scene: Scene, i: int, dx: float, dy: float, gravity: Floats) -> float:
    """Shift a grain [m]; returns the work of gravity over its mass [J/kg]."""
    scene.position[i, X] += dx
    scene.position[i, Y] += dy
    return float(gravity[X] * dx + gravity[Y] * dy)


@kernel
def _row_of(i: Ints, j: Ints, first: int, second: int) -> int:
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
def leave_flights_out(
    scene: Scene, flight: Flight, is_free: NDArray[np.bool_], i: Ints, j: Ints, lane: Ints,
    frame: Floats, impulse: Floats, before: Floats, contacts: Contacts,
) -> int:  # fmt: skip
    """Take contacts out of the solve whose grains fly: only what does not may push into them.

    A grain that began in flight and leaves another may come back as fast and no faster: its next
    impact is one of the next step. (Held apart they would gain energy, p·½(u⁻ + u⁺) > 0.)

    Returns how many contacts are left. Arrays of a `Schedule`; ``frame``, ``impulse`` and
    ``contacts`` are **modified**.
    """
    begun, flying = flight.begun, flight.flying
    count, left = flying.size, 0
    has_landed, is_on_wall = np.zeros(i.size, np.bool_), np.zeros(count, np.bool_)
    for k in range(flight.landed.shape[0]):
        first, second = flight.landed[k, FIRST], flight.landed[k, SECOND]
        c = _row_of(i, j, first, second)
        if second >= count:
            is_on_wall[first] = True
        elif c >= 0:
            has_landed[c] = True
    for c in range(i.size):
        is_grain = j[c] < count
        if not (begun[i[c]] or (is_grain and begun[j[c]])):
            left += 1
            continue
        contact, q, k = contacts[c], lane[c] // LANES, lane[c] % LANES
        u_n = before[q, NORMAL, k] if is_grain else contact.u_n
        flies = flying[j[c]] if is_grain else not is_free[scene.wall[j[c] - count]]
        if flying[i[c]] and flies:
            u_n = abs(u_n)
        else:
            left += 1
            if has_landed[c] or (is_on_wall[i[c]] and not is_grain):
                continue
        if is_grain:
            frame[q, BIAS, k] = max(frame[q, BIAS, k], u_n)
        else:
            contact.bias = max(contact.bias, u_n)
    return left


@kernel
def are_contacts(impacts: Impacts, i: Ints, j: Ints) -> bool:
    """Whether all pairs that had impacts are among pairs sorted by (i, j)."""
    missing = 0
    for k in range(impacts.i.size):
        missing += _row_of(i, j, impacts.i[k], impacts.j[k]) < 0
    return missing == 0


@kernel
def enter_impacts(
    scene: Scene, impacts: Impacts, i: Ints, j: Ints, after: Floats, lane: Ints, frame: Floats,
    impulse: Floats, before: Floats, gap: Floats, contacts: Contacts,
) -> tuple[Ints, Floats]:  # fmt: skip
    """Impacts into the contacts of a step, as if the solve had found them: impulse, normal, u⁻.

    u⁻ is such that a contact loses −p·½(u⁻ + u⁺), as all others, with the u⁺ of the end of the
    step. Several impulses of one pair add up, and so do their losses and torques. ``scene`` is
    that at q_m, ``after`` are v⁺; arrays of a `Schedule` and ``contacts`` are **modified**. Returns
    the contacts, and the impulses that they had.
    """
    count = scene.radius.size
    rows, known = np.full(impacts.i.size, -1, np.int32), np.empty((impacts.i.size, 2))
    for e in range(impacts.i.size):
        said = impacts.said[e]
        if said[_P_N] == 0.0:
            continue
        c = _row_of(i, j, impacts.i[e], impacts.j[e])
        contact, is_wall = contacts[c], j[c] >= count
        q, k = lane[c] // LANES, lane[c] % LANES
        if not is_wall:
            contact.nx, contact.ny, contact.gap = frame[q, NX, k], frame[q, NY, k], gap[q, k]
            contact.p_n, contact.p_t = impulse[q, NORMAL, k], impulse[q, TANGENTIAL, k]
            contact.u_n, contact.u_t = before[q, NORMAL, k], before[q, TANGENTIAL, k]
        rows[e], known[e, NORMAL], known[e, TANGENTIAL] = c, contact.p_n, contact.p_t
        nx, ny = said[_NX], said[_NY]
        px, py = said[_P_N] * nx - said[_P_T] * ny, said[_P_N] * ny + said[_P_T] * nx
        impact, friction, along = said[_IMPACT], said[_FRICTION], said[_P_T]
        torque = said[_LEVER_X] * py - said[_LEVER_Y] * px
        if contact.p_n > 0.0:
            u_n, u_t = contact_after(c, scene, contacts, after)
            impact -= contact.p_n * 0.5 * (contact.u_n + u_n)
            friction -= contact.p_t * 0.5 * (contact.u_t + u_t)
            dx, dy = (
                contact.p_n * contact.nx - contact.p_t * contact.ny,
                contact.p_n * contact.ny + contact.p_t * contact.nx,
            )
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
    return rows, known


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
