"""Relaxations: grains repel each other and obstacles as they overlap, until none does.

The sum of squared overlaps is minimized with the fast inertial relaxation engine (Bitzek et al.,
Phys. Rev. Lett. 97, 170201, 2006): damped dynamics of unit masses that speeds up while it runs
downhill and stops when it runs uphill. Below the density at which frictionless grains jam (discs
near 0.84 in the plane) states without overlap exist and are reached. Grains that are no discs turn
meanwhile, and a weight lets them settle.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.geometry.outlines import touch, touch_wall
from multicor_cli.engine.geometry.pieces import Pieces, pieces_with, place_walls, turn_grains
from multicor_cli.engine.geometry.scene import Scene, gap_to_shape, minimum_image
from multicor_cli.engine.jit.compile import kernel, subroutine
from multicor_cli.model.columns import ANGLE, RADIUS, X, Y
from multicor_cli.model.model import Floats, Ints
from multicor_cli.model.outlines import Outlines
from multicor_cli.model.shapes import ShapeKind
from multicor_cli.packing.initial_grains import PackingRegion
from multicor_cli.packing.overlap import DiscPairs, find_pairs, wrap
from multicor_cli.packing.walls import GRAIN, Obstacles

INFLATION = 5e-4
"""Share by which radii are enlarged while relaxing: what is left over is a gap, no overlap."""

# Unit mass and stiffness: six contacts per disc give a highest frequency of √12, stable below 0.57
_LARGEST_STEP = 0.4
_FIRST_STEP = 0.1
_FIRST_MIXING = 0.1
_STEP, _MIXING, _COUNT = range(3)  # of a clock: time step, mixing, steps since the last uphill one
_JAMMED = 1e-3  # net force over the largest overlap at which a minimum of the energy is reached
_HOPE = 0.9  # the largest overlap has to fall to this share while one is patient
_FASTEST = 0.1  # reach of the smallest grain that those with a weight move in a unit of time

_DISC = int(ShapeKind.DISC)


class Ghosts(NamedTuple):
    """Images of grains across the lower and upper side of a region that is periodic in y too.

    The obstacle ``shape`` stands for the grain ``source``, moved by ``shift`` in y [m].
    """

    shape: Ints
    source: Ints
    shift: Floats


class Outlined(NamedTuple):
    """Grains that are no discs, those that are there and do not move, and obstacles.

    Attributes:
        local: Pieces at angle 0, of the grains, of those that do not move, and of obstacles.
        pieces: The same as they are turned, **modified**.
        scene: Obstacles; its positions are those that are relaxed.
        turns: Whether grains may turn.
        weight: Force on each of them, downward [m], with unit stiffness.
    """

    local: Pieces
    pieces: Pieces
    scene: Scene
    turns: bool
    weight: float


# ---- Forces


@subroutine
def _repel_discs(
    position: Floats,
    radius: Floats,
    pairs: DiscPairs,
    kind: Ints,
    world: Floats,
    period: float,
    force: Floats,
) -> float:
    """Fill ``force`` [m] (unit stiffness); return the largest overlap over the smaller radius."""
    count = radius.size
    worst = 0.0
    force[:] = 0.0
    for i in range(count):
        x, y, r = position[i, X], position[i, Y], radius[i]
        for p in range(pairs.row[i], pairs.row[i + 1]):
            j = pairs.partner[p]
            if j >= count:
                gap, nx, ny = gap_to_shape(x, y, r, j - count, kind, world, period)
                if gap < 0.0:
                    force[i, X] -= gap * nx
                    force[i, Y] -= gap * ny
                    # Only one of the two is enlarged, so only half as much may be left over.
                    worst = max(worst, -2.0 * gap / r)
                continue
            dx, dy = minimum_image(x - position[j, X], period), y - position[j, Y]
            near = r + radius[j]
            square = dx * dx + dy * dy
            if square >= near * near or square == 0.0:
                continue
            distance = np.sqrt(square)
            share = (near - distance) / distance
            force[i, X] += share * dx
            force[i, Y] += share * dy
            force[j, X] -= share * dx
            force[j, Y] -= share * dy
            worst = max(worst, (near - distance) / min(r, radius[j]))
    return worst


@kernel
def _push(force: Floats, i: int, fx: float, fy: float, ox: float, oy: float, reach: float) -> None:
    """Add a force at (ox, oy) from the center of a grain."""
    force[i, X] += fx
    force[i, Y] += fy
    force[i, ANGLE] += (ox * fy - oy * fx) / reach


@subroutine
def _repel_pair(
    pieces: Pieces, i: int, j: int, dx: float, dy: float, reach_i: float, reach_j: float,
    is_alone: bool, force: Floats,
) -> float:  # fmt: skip
    """Add the forces of two grains, or of i alone; (dx, dy) leads from j to i.

    Returns their overlap over the smaller reach.
    """
    least = 0.0
    for a in range(pieces.piece[i], pieces.piece[i + 1]):
        for b in range(pieces.piece[j], pieces.piece[j + 1]):
            for point in touch(pieces, a, b, dx, dy):
                if point.gap >= 0.0:
                    continue
                fx, fy = -point.gap * point.nx, -point.gap * point.ny
                _push(force, i, fx, fy, point.i_x, point.i_y, reach_i)
                if not is_alone:
                    _push(force, j, -fx, -fy, point.j_x, point.j_y, reach_j)
                least = min(least, point.gap)
    return float(-least / min(reach_i, reach_j))


@subroutine
def _repel_wall(outlined: Outlined, reach: float, i: int, shape: int, force: Floats) -> float:
    """Add the forces of an obstacle on a grain; return the overlap over its reach."""
    pieces, least = outlined.pieces, 0.0
    for a in range(pieces.piece[i], pieces.piece[i + 1]):
        for point in touch_wall(pieces, outlined.scene, i, a, shape):
            if point.gap < 0.0:
                fx, fy = -point.gap * point.nx, -point.gap * point.ny
                _push(force, i, fx, fy, point.i_x, point.i_y, reach)
                least = min(least, point.gap)
    return float(-least / reach)


@kernel
def _repel_outlines(
    position: Floats, outlined: Outlined, reach: Floats, pairs: DiscPairs, kind: Ints,
    world: Floats, ghosts: Ghosts, period: float, force: Floats,
) -> float:  # fmt: skip
    """As `_repel_discs`, by true outlines; with torques over the reach as a third component."""
    count = reach.size
    first = kind.size - ghosts.shape.size
    worst = 0.0
    force[:] = 0.0
    for i in range(count):
        for p in range(pairs.row[i], pairs.row[i + 1]):
            j = pairs.partner[p]
            shape, source = j - count, j
            if shape >= first:
                source = ghosts.source[shape - first]
            elif shape >= 0 and kind[shape] == _DISC and world[shape, GRAIN] > 0.0:
                source = count + int(world[shape, GRAIN]) - 1
            elif shape >= 0:
                # Only one of the two is enlarged, so only half as much may be left over.
                worst = max(worst, 2.0 * _repel_wall(outlined, reach[i], i, shape, force))
                continue
            if shape >= 0:
                x, y, other = world[shape, X], world[shape, Y], world[shape, RADIUS]
            else:
                x, y, other = position[j, X], position[j, Y], reach[j]
            dx, dy = minimum_image(position[i, X] - x, period), position[i, Y] - y
            if dx * dx + dy * dy < (reach[i] + other) * (reach[i] + other):
                overlap = _repel_pair(
                    outlined.pieces, i, source, dx, dy, reach[i], other, shape >= 0, force
                )
                worst = max(worst, 2.0 * overlap if 0 <= shape < first else overlap)
    return worst


# ---- The descent


@subroutine
def _follow(position: Floats, ghosts: Ghosts, world: Floats) -> None:
    """Bring images to where their grains are; **modifies** ``world``."""
    for g in range(ghosts.shape.size):
        world[ghosts.shape[g], X] = position[ghosts.source[g], X]
        world[ghosts.shape[g], Y] = position[ghosts.source[g], Y] + ghosts.shift[g]


@kernel
def _steer(velocity: Floats, force: Floats, clock: Floats) -> None:
    """Adapt time step, mixing and velocities (Bitzek et al.)."""
    power, speed, strength = 0.0, 0.0, 0.0
    for i in range(force.shape[0]):
        for c in range(force.shape[1]):
            power += velocity[i, c] * force[i, c]
            speed += velocity[i, c] * velocity[i, c]
            strength += force[i, c] * force[i, c]
    if power < 0.0:
        clock[_STEP], clock[_MIXING], clock[_COUNT] = 0.5 * clock[_STEP], _FIRST_MIXING, 0.0
        velocity[:] = 0.0
        return
    clock[_COUNT] += 1.0
    share = clock[_MIXING] * np.sqrt(speed / strength) if strength > 0.0 else 0.0
    for i in range(force.shape[0]):
        for c in range(force.shape[1]):
            velocity[i, c] = (1.0 - clock[_MIXING]) * velocity[i, c] + share * force[i, c]
    if clock[_COUNT] > 5.0:
        clock[_STEP] = min(1.1 * clock[_STEP], _LARGEST_STEP)
        clock[_MIXING] *= 0.99


@kernel
def _descend(
    position: Floats, velocity: Floats, reach: Floats, outlined: Outlined | None,
    pairs: DiscPairs, kind: Ints, world: Floats, ghosts: Ghosts, period: float, clock: Floats,
    target: float, travel: float, steps: int,
) -> tuple[int, float, bool]:  # fmt: skip
    """Relax until overlaps fall to ``target``, a grain moves by ``travel``, or ``steps`` are done.

    The neighbor list ``pairs`` allows a ``travel`` [m]; ``world`` [m] holds the obstacles
    and images of grains, ``clock`` time step, mixing and steps since the last uphill one.
    **Modifies** ``position`` and ``velocity`` [m], shape ``(n, 2)``, or ``(n, 3)`` with angles,
    ``world``, ``clock`` and the corners of ``outlined``.

    Returns:
        Steps done, largest overlap over the smaller reach, whether a minimum with overlaps is met.
    """
    before = position.copy()
    force = np.zeros_like(position)
    smallest, worst = np.inf, 0.0
    for one in reach:
        smallest = min(smallest, one)
    for step in range(steps):
        _follow(position, ghosts, world)
        if outlined is None:
            worst = _repel_discs(position, reach, pairs, kind, world, period, force)
        else:
            turn_grains(outlined.local, position, outlined.pieces.corner)
            worst = _repel_outlines(
                position, outlined, reach, pairs, kind, world, ghosts, period, force
            )
            for i in range(force.shape[0]):
                force[i, Y] -= outlined.weight
                if not outlined.turns:
                    force[i, ANGLE] = 0.0
        if worst <= target:
            return step, worst, False
        if _largest(force) < _JAMMED * worst * smallest:
            return step, worst, True
        _steer(velocity, force, clock)
        if outlined is not None and outlined.weight > 0.0:
            _slow(velocity, _FASTEST * smallest)
        moved = 0.0
        for i in range(position.shape[0]):
            for c in range(position.shape[1]):
                velocity[i, c] += clock[_STEP] * force[i, c]
                way = clock[_STEP] * velocity[i, c]
                position[i, c] += way / reach[i] if c == ANGLE else way
            dx, dy = position[i, X] - before[i, X], position[i, Y] - before[i, Y]
            moved = max(moved, dx * dx + dy * dy)
        if moved > travel * travel:
            return step + 1, worst, False
    return steps, worst, False


@subroutine
def _largest(force: Floats) -> float:
    largest = 0.0
    for i in range(force.shape[0]):
        for c in range(force.shape[1]):
            largest = max(largest, abs(force[i, c]))
    return largest


@subroutine
def _slow(velocity: Floats, most: float) -> None:
    for i in range(velocity.shape[0]):
        for c in range(velocity.shape[1]):
            velocity[i, c] = min(max(velocity[i, c], -most), most)


def _images_of(
    position: Floats, radius: Floats, region: PackingRegion, obstacles: Obstacles, skin: float
) -> tuple[Ghosts, Obstacles]:
    """Images of the grains near the lower and upper side, and the obstacles with them."""
    cutoff = 2.0 * radius.max() + skin
    low = np.flatnonzero(position[:, Y] < region.bottom + cutoff)
    high = np.flatnonzero(position[:, Y] > region.top - cutoff)
    source = np.concatenate([low, high]).astype(np.int32)
    shift = np.concatenate([np.full(low.size, region.height), np.full(high.size, -region.height)])
    shape = (obstacles.kind.size + np.arange(source.size)).astype(np.int32)
    discs = np.column_stack([position[source, X], position[source, Y] + shift, radius[source]])
    return Ghosts(shape, source, shift), obstacles.with_discs(discs)


_NO_GHOSTS = Ghosts(np.zeros(0, np.int32), np.zeros(0, np.int32), np.zeros(0))


def relax(
    position: Floats,
    reach: Floats,
    region: PackingRegion,
    obstacles: Obstacles,
    target: float,
    outlined: Outlined | None = None,
    *,
    skin: float,
    patience: int,
    most: int,
) -> tuple[float, int]:
    """Move grains apart until overlaps fall to ``target``, or they are jammed.

    Jammed they are too if overlaps hardly fall in ``patience`` steps; no more than ``most`` are
    done; neighbors are sought up to the ``skin`` [m]. Closed sides of the region have to be among
    the obstacles. **Modifies** ``position`` [m], shape ``(n, 2)`` of discs with radii ``reach``
    [m], or ``(n, 3)``.

    Returns:
        The largest overlap over the smaller reach, and steps.
    """
    velocity = np.zeros(position.shape)
    clock = np.array([_FIRST_STEP, _FIRST_MIXING, 0.0])
    done, checked, before = 0, 0, math.inf
    worst, is_jammed = math.inf, False
    while done < most and not is_jammed and worst > target:
        if region.is_periodic:
            position[:, X] = wrap(position[:, X], region.width)
        ghosts, solid = _NO_GHOSTS, obstacles
        if region.is_periodic_in_y:
            position[:, Y] = region.bottom + wrap(position[:, Y] - region.bottom, region.height)
            ghosts, solid = _images_of(position, reach, region, obstacles, skin)
        pairs = find_pairs(position, reach, solid, skin, region.period)
        steps, worst, is_jammed = _descend(
            position, velocity, reach, outlined, pairs, solid.kind, solid.world.copy(), ghosts,
            region.period, clock, target, 0.5 * skin, min(checked + patience, most) - done,
        )  # fmt: skip
        done += steps
        if done >= checked + patience:
            is_jammed = is_jammed or worst > _HOPE * before
            checked, before = done, worst
    return worst, done


def outlined(
    outlines: Outlines, position: Floats, region: PackingRegion, obstacles: Obstacles, *,
    turns: bool, weight: float = 0.0,
) -> Outlined:  # fmt: skip
    """Grains of these outlines at ``position`` [m], [rad], ``(n, 3)``, for `relax`."""
    fixed, angle = obstacles.grains, obstacles.angle
    every = outlines if fixed is None else Outlines.joined([outlines, fixed])
    kind, world = obstacles.kind, obstacles.world
    wide = np.where(kind == _DISC, world[:, RADIUS], 0.0)
    local = pieces_with(every, kind, wide, np.ones(every.area.size))
    nobody = np.zeros(kind.size, np.int32)
    scene = Scene(
        position, local.spin, np.concatenate([np.zeros(every.area.size, np.int32), nobody]), kind,
        nobody, world, np.zeros((1, 3)), region.period,
    )  # fmt: skip
    corner = np.zeros(local.corner.shape)
    turns_of_fixed = np.column_stack([np.zeros((angle.size, 2)), angle])
    turn_grains(local, np.concatenate([position, turns_of_fixed]), corner)
    place_walls(local, scene, corner)
    return Outlined(local, local._replace(corner=corner), scene, turns, weight)


def are_hit(
    discs: Floats, radius: float, region: PackingRegion, obstacles: Obstacles
) -> NDArray[np.bool_]:
    """Which discs of this radius [m] overlap obstacles, by their true outlines.

    Centers [m] have shape ``(n, 2)``.
    """
    radii, position = np.full(len(discs), radius), np.column_stack([discs, np.zeros(len(discs))])
    grains = outlined(Outlines.of_discs(radii), position, region, obstacles, turns=False)
    row, partner = find_pairs(position, radii, obstacles, 0.0, region.period)
    is_fixed = partner >= len(discs)
    ends = np.concatenate([[0], np.cumsum(is_fixed)])[row]
    force = np.zeros(position.shape)
    _repel_outlines(
        position, grains, radii, DiscPairs(ends, partner[is_fixed]), obstacles.kind,
        obstacles.world, _NO_GHOSTS, region.period, force,
    )  # fmt: skip
    return np.asarray((force != 0.0).any(axis=1))
