"""What no step looks at: the way from q to q_m of a body whose velocity no step before has seen.

A step looks for contacts at q_m and lets no pair approach by more than its gap there. So the next
q_m is admissible, if that step is no longer, and so is the way there: nothing can be passed. This
does not hold for the first step of a run, for grains that have just come or have flown
(`contact.flight`), for the longer part of a step that is longer than the one before, and for walls
that have to be elsewhere than their velocity leads.

Where such a way leads through a wall or another grain, it ends where they meet: q_m is the place at
which they touch, and the contact law of the step does the rest, as for any impact. From there on a
grain goes with the wall, or with the mean motion of two grains that meet; a third one goes with
what it meets. Times of contact are found by conservative advancement: a gap that closes no faster
than L lasts for gap/L (Mirtich 1996).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.arithmetic import cos, sin
from multicor_cli.engine.geometry.passing import fastest_points
from multicor_cli.engine.geometry.pieces import Pieces, are_faces, thinnest
from multicor_cli.engine.geometry.radii import smaller_radius
from multicor_cli.engine.geometry.scene import (
    Scene,
    disc_disc,
    distance_to_whole,
    nearest_image,
    pair_geometry,
    placed_shape,
    scene_of,
)
from multicor_cli.engine.jit.compile import kernel, subroutine
from multicor_cli.engine.motion.correction import ALLOWED
from multicor_cli.engine.motion.layout import Layout
from multicor_cli.engine.motion.walls import WallMotion
from multicor_cli.engine.orders import PhysicsError
from multicor_cli.model.columns import ANGLE, SPIN, X, Y
from multicor_cli.model.model import Floats, Ints, Model
from multicor_cli.model.state import State

SHORTEST = math.sqrt(2.0 * ALLOWED)
"""Half of the shortest way through a disc or a point, over the smaller radius, that goes deeper
than overlaps may be."""

_OWN = -1
"""Motion of a grain that has met nothing; then that of walls, and of grains that have met."""


class Unseen(NamedTuple):
    """Bodies that go where no step has looked: grains ``(n,)``, and walls ``(w,)``."""

    grains: NDArray[np.bool_]
    walls: NDArray[np.bool_]


class Paths(NamedTuple):
    """How grains and walls move in the first half of a step.

    Attributes:
        scene: Shapes at q.
        local: Wall shapes in the frames of their walls, shape ``(m, 4)``.
        wall_velocity: Velocities V⁻ of the walls, shape ``(w, 3)``.
        mass: Masses of the grains [kg], shape ``(n,)``.
        motion: What each grain goes with, shape ``(n,)``.
        since: Time since which it does [s], shape ``(n,)``.
        place: Its center at that time [m], shape ``(n, 2)``.
        velocity: From then on its own, or that of the wall's reference point [m/s], ``(n, 2)``.
    """

    scene: Scene
    local: Floats
    wall_velocity: Floats
    mass: Floats
    motion: Ints
    since: Floats
    place: Floats
    velocity: Floats


def find_unseen(
    state: State, strangers: NDArray[np.int64], model: Model, motion: WallMotion, dt: float,
    seen: float,
) -> Unseen | None:  # fmt: skip
    """Who goes farther in the next half step than was looked at; None if too little to pass any.

    The step before looked ``seen`` far ahead [s], for all but ``strangers``, indices of grains.
    """
    seen = min(dt, seen)
    if seen == dt and not strangers.size and not motion.jumps:
        return None
    grains = np.full(model.grain_count, seen < dt)
    far = 0.5 * (dt - seen) * _fastest(state.velocity) if seen < dt else 0.0
    if strangers.size:
        grains[strangers] = True
        far = max(far, 0.5 * dt * _fastest(state.velocity[strangers]))
    jump = np.abs(0.5 * (dt * motion.before - seen * state.wall_velocity))
    jumps = (
        np.sqrt(jump[:, X] * jump[:, X] + jump[:, Y] * jump[:, Y]) + jump[:, SPIN] * motion.extent
    )
    limit = 0.5 * SHORTEST * float(model.grains.radius.min())
    if max(far, float(jumps.max(initial=0.0))) <= limit:
        return None
    return Unseen(grains, (jumps > limit) | (seen < dt))


def _fastest(velocity: Floats) -> float:
    u, v = velocity[:, X], velocity[:, Y]
    return math.sqrt(float((u * u + v * v).max()))


def stop_unseen(
    layout: Layout, motion: WallMotion, unseen: Unseen, flying: NDArray[np.bool_] | None, dt: float
) -> Floats | None:
    """Let ways that nobody has looked at end where they meet something, if any leads through it.

    Not those of grains that are ``flying``, whose impacts have been found (`contact.flight`).
    **Modifies** q_m of the layout. Returns how far grains are from where they would be [m], shape
    ``(n, 2)``; None if nothing is passed. Raises `PhysicsError` if two walls catch a grain.
    """
    state, model, middle = layout.state, layout.model, layout.middle
    n = model.grain_count
    paths = Paths(
        scene_of(model, state.position, state.wall_position), model.shapes.geometry, motion.before,
        model.grains.mass,
        np.full(n, _OWN, np.int32), np.zeros(n), state.position[:, :2].copy(),
        state.velocity[:, :2].copy(),
    )  # fmt: skip
    passing = np.zeros(n, np.bool_)
    flying = np.zeros(n, np.bool_) if flying is None else flying
    row, partner = layout.pairs.row, layout.pairs.partner
    if layout.pieces is not None:
        row, partner = those_passable(paths, layout.pieces, layout.before, row, partner, 0.5 * dt)
    if not find_passing(
        paths, row, partner, unseen.grains, unseen.walls, flying, 0.5 * dt, passing
    ):
        return None
    owner = np.repeat(np.arange(n, dtype=np.int32), np.diff(row))
    caught, time = meet(paths, owner, partner, 0.5 * dt, passing)
    if caught >= 0:
        raise PhysicsError(
            state.step, _name_caught(model, paths, int(owner[caught]), int(partner[caught]), time)
        )
    free = middle[:, :2].copy()
    place_grains(paths, 0.5 * dt, middle)
    return middle[:, :2] - free


def _name_caught(model: Model, paths: Paths, grain: int, shape: int, time: float) -> str:
    n = model.grain_count
    other = paths.motion[shape] if shape < n else model.shapes.wall[shape - n]
    first, second = model.walls.names[paths.motion[grain]], model.walls.names[other]
    steps = f"steps of at most {2.0 * time:.3g} s" if time > 0.0 else "far shorter steps"
    return (
        f"{model.name_of(grain)} is caught between the walls '{first}' and '{second}' in the "
        f"first half of a step; take {steps}, or let the walls begin more slowly"
    )


@subroutine
def _grain_at(paths: Paths, k: int, t: float) -> tuple[float, float, float, float, float]:
    """Center [m], velocity [m/s] and magnitude of the acceleration [m/s²] of a grain at a time."""
    ago = t - paths.since[k]
    x, y, u, v = paths.place[k, X], paths.place[k, Y], paths.velocity[k, X], paths.velocity[k, Y]
    w = paths.motion[k]
    if w < 0 or w >= paths.wall_velocity.shape[0] or paths.wall_velocity[w, SPIN] == 0.0:
        return x + ago * u, y + ago * v, u, v, 0.0
    spin, frame = paths.wall_velocity[w, SPIN], paths.scene.wall_position[w]
    lx = nearest_image(x - frame[X] - paths.since[k] * u, paths.scene.period)
    ly = y - frame[Y] - paths.since[k] * v
    c, s = cos(ago * spin), sin(ago * spin)
    rx, ry = c * lx - s * ly, s * lx + c * ly
    return (
        x + ago * u + rx - lx, y + ago * v + ry - ly, u - spin * ry, v + spin * rx,
        spin * spin * np.sqrt(lx * lx + ly * ly),
    )  # fmt: skip


@subroutine
def _approach(paths: Paths, i: int, j: int, t: float, end: float) -> tuple[float, float, float]:
    """Gap of a pair at a time [m], its rate, and how fast it may change until the end [m/s]."""
    scene = paths.scene
    x, y, u, v, a = _grain_at(paths, i, t)
    count, left = scene.radius.size, end - t
    if j < count:
        other_x, other_y, other_u, other_v, b = _grain_at(paths, j, t)
        u, v = u - other_u, v - other_v
        dx = nearest_image(x - other_x, scene.period)
        gap, nx, ny = disc_disc(dx, y - other_y, scene.radius[i] + scene.radius[j])
        return gap, u * nx + v * ny, np.sqrt(u * u + v * v) + (a + b) * left
    shape, w = j - count, scene.wall[j - count]
    frame, move = scene.wall_position[w], paths.wall_velocity[w]
    fx, fy, spin = frame[X] + t * move[X], frame[Y] + t * move[Y], move[SPIN]
    g0, g1, g2, g3 = placed_shape(
        scene.kind[shape], paths.local, shape, fx, fy, frame[ANGLE] + t * spin
    )
    distance, nx, ny = distance_to_whole(x, y, scene.kind[shape], g0, g1, g2, g3, scene.period)
    # In the frame of the wall the rate of a gap is at most the speed of the center.
    u, v = u - move[X], v - move[Y]
    lx, ly = nearest_image(x - fx, scene.period), y - fy
    rest = (abs(spin) * (np.sqrt(u * u + v * v) + a * left) + a) * left
    u, v = u + spin * ly, v - spin * lx
    return distance - scene.radius[i], u * nx + v * ny, np.sqrt(u * u + v * v) + rest


@kernel
def those_passable(
    paths: Paths, pieces: Pieces, velocity: Floats, row: NDArray[np.int64], partner: Ints,
    end: float,
) -> tuple[NDArray[np.int64], Ints]:  # fmt: skip
    """The pairs of a list that may pass each other until ``end`` [s].

    Ways are those of circles. Grains that are no discs often lie within the circles of others, and
    slide there without meeting anything; over less than half of their width they pass nothing.
    """
    count, found = row.size - 1, 0
    first, kept = np.zeros(row.size, np.int64), np.empty(partner.size, np.int32)
    for i in range(count):
        for p in range(row[i], row[i + 1]):
            j = partner[p]
            if are_faces(pieces, i, j) and _approach(paths, i, j, 0.0, 0.0)[0] < 0.0:
                width = thinnest(pieces, i)
                if j < count:
                    width = min(width, thinnest(pieces, j))
                if fastest_points(paths.scene, pieces, velocity, i, j) * end < 0.5 * width:
                    continue
            kept[found] = j
            found += 1
        first[i + 1] = found
    return first, kept[:found].copy()


@subroutine
def meeting_time(paths: Paths, i: int, j: int, begin: float, end: float) -> float:
    """When a pair meets in ``begin … end`` [s]; infinite if it overlaps by no more than allowed.

    That is beside what it has overlapped at the start of the step: the deepest contacts of a dense
    flow are at the bound, and move past each other as all others do.
    """
    smaller = smaller_radius(paths.scene, i, j)
    allowed, t = ALLOWED * smaller, begin
    depth = max(0.0, -pair_geometry(paths.scene, i, j)[0])
    while t < end:
        gap, rate, fastest = _approach(paths, i, j, t, end)
        gap += depth
        if fastest == 0.0:
            break
        if gap + 0.999 * allowed > 0.0:
            t += (gap + allowed) / fastest
        elif rate < 0.0:
            return max(begin, t - gap / rate)
        else:
            t += 0.01 * smaller / fastest
    return np.inf


@subroutine
def _is_seen(paths: Paths, i: int, j: int, met: float, end: float) -> bool:
    """Whether a pair that met is found at q_m as the contact it is: closing, and not too deep."""
    gap, rate, fastest = _approach(paths, i, j, end, end)
    is_elsewhere = 0.0 < paths.scene.period < 2.0 * fastest * (end - met)
    return (
        gap <= 0.0 and rate < 0.0 and -gap <= smaller_radius(paths.scene, i, j) and not is_elsewhere
    )


@kernel
def find_passing(
    paths: Paths, row: NDArray[np.int64], partner: Ints, unseen: NDArray[np.bool_],
    unseen_walls: NDArray[np.bool_], flying: NDArray[np.bool_], end: float,
    passing: NDArray[np.bool_],
) -> bool:  # fmt: skip
    """Whether anything is passed unseen until ``end`` [s], half a step.

    ``unseen`` and ``unseen_walls`` are those whose ways nobody has looked at, ``passing``
    (**modified**) the grains that pass something or are passed.
    """
    count, is_any = row.size - 1, False
    for i in range(count):
        for p in range(row[i], row[i + 1]):
            j = partner[p]
            if flying[i] or (j < count and flying[j]):
                continue
            if unseen[i] or (unseen[j] if j < count else unseen_walls[paths.scene.wall[j - count]]):
                met = meeting_time(paths, i, j, 0.0, end)
                if met < end and not _is_seen(paths, i, j, met, end):
                    is_any = passing[i] = True
                    if j < count:
                        passing[j] = True
    return is_any


@kernel
def _join(
    paths: Paths, k: int, t: float, motion: int, u: float, v: float, changed: NDArray[np.bool_]
) -> None:
    if paths.motion[k] != motion:
        x, y, _, _, _ = _grain_at(paths, k, t)
        paths.motion[k], paths.since[k] = motion, t
        paths.place[k, X], paths.place[k, Y] = x, y
        paths.velocity[k, X], paths.velocity[k, Y] = u, v
        changed[k] = True


@kernel
def meet(
    paths: Paths, owner: Ints, partner: Ints, end: float, changed: NDArray[np.bool_]
) -> tuple[int, float]:
    """From one meeting to the next: both go on with the older of two motions; walls come first.

    So the motion of a grain only ever becomes an older one, and meetings come to an end.
    **Modifies** the motions, and ``changed``: grains whose meetings count from the start. Returns
    the pair by which a grain that goes with a wall meets another wall, or -1, and when [s].
    """
    scene, walls = paths.scene, paths.wall_velocity.shape[0]
    count, now, next_motion = scene.radius.size, 0.0, walls
    time = np.full(partner.size, np.inf)
    while True:
        first = -1
        for p in range(partner.size):
            i, j = owner[p], partner[p]
            if changed[i] or (j < count and changed[j]):
                mine = paths.motion[i]
                is_one = mine >= 0 and mine == (
                    paths.motion[j] if j < count else scene.wall[j - count]
                )
                time[p] = np.inf if is_one else meeting_time(paths, i, j, now, end)
            if time[p] < end and (first < 0 or time[p] < time[first]):
                first = p
        if first < 0:
            return -1, end
        changed[:] = False
        now = time[first]
        i, j = owner[first], partner[first]
        mine = paths.motion[i]
        other = paths.motion[j] if j < count else scene.wall[j - count]
        if 0 <= mine < walls and 0 <= other < walls:
            return first, now
        if mine < 0 and other < 0:
            share = paths.mass[i] / (paths.mass[i] + paths.mass[j])
            u = share * paths.velocity[i, X] + (1.0 - share) * paths.velocity[j, X]
            v = share * paths.velocity[i, Y] + (1.0 - share) * paths.velocity[j, Y]
            motion = next_motion
            next_motion += 1
        elif j >= count:
            motion, u, v = other, paths.wall_velocity[other, X], paths.wall_velocity[other, Y]
        else:
            leader = i if other < 0 or 0 <= mine < other else j
            motion = paths.motion[leader]
            u, v = paths.velocity[leader, X], paths.velocity[leader, Y]
        _join(paths, i, now, motion, u, v, changed)
        if j < count:
            _join(paths, j, now, motion, u, v, changed)


@kernel
def place_grains(paths: Paths, t: float, middle: Floats) -> None:
    """Put grains that have met something where they are at a time: ``middle`` (**modified**)."""
    for k in range(paths.motion.size):
        if paths.motion[k] >= 0:
            middle[k, X], middle[k, Y], _, _, _ = _grain_at(paths, k, t)
