"""Grains placed one by one among discs: at random free places, or dropped and rolled (deposits).

Everything that the kernels call lies in this file or in packages that the name of the cache
covers, so that no compiled copy of it can be stale.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from multicor_cli.arithmetic import acos, asin, atan2, cos, sin
from multicor_cli.arithmetic.sums import mean, total
from multicor_cli.engine.geometry.neighbors import Grids, classify, make_grids
from multicor_cli.engine.geometry.scene import gap_to_shape, minimum_image
from multicor_cli.engine.jit.compile import kernel, subroutine
from multicor_cli.model.columns import RADIUS, X, Y
from multicor_cli.model.model import Floats, Ints
from multicor_cli.model.shapes import ShapeKind
from multicor_cli.packing.initial_grains import PackingRegion
from multicor_cli.packing.overlap import wrap
from multicor_cli.packing.sizes import Stream
from multicor_cli.packing.walls import Obstacles
from multicor_cli.scenario.problems import Refused

_DISC = int(ShapeKind.DISC)


class PlacedDiscs(NamedTuple):
    """Discs that are already there, as linked lists by cell, and the fixed shapes.

    Attributes:
        disc: x, y, radius of all discs, obstacles first [m], shape ``(d, 3)``; rows of grains are
            filled as they are placed.
        head: Last disc put into each cell, or -1.
        next: The disc that was put into the same cell before, or -1, shape ``(d,)``.
        highest: Highest occupied row of each column of each level, or -1.
        first_column: Start of each level in ``highest``, shape ``(levels,)``.
        grids: Cell grids of all discs.
        kind: `ShapeKind` of the obstacles, shape ``(m,)``.
        world: Geometry of the obstacles [m], shape ``(m, 4)``.
        period: Period in x [m] or 0.
    """

    disc: Floats
    head: Ints
    next: Ints
    highest: Ints
    first_column: Ints
    grids: Grids
    kind: Ints
    world: Floats
    period: float


@subroutine
def _cell_of(place: float, field: PlacedDiscs, level: int, axis: int) -> int:
    """Column (``axis`` `X`) or row of a cell, the nearest one outside of the grid."""
    cells = field.grids
    # Clamped before it becomes an integer: y may be infinite.
    inside = max(np.floor((place - cells.origin[axis]) / cells.cells[level, axis]), 0.0)
    return int(min(inside, cells.shape[level, axis] - 1.0))


@subroutine
def _columns_between(low: float, high: float, field: PlacedDiscs, level: int) -> tuple[int, int]:
    """First and last column that [low, high] touches; modulo their number if periodic."""
    columns = field.grids.shape[level, X]
    first = int(np.floor((low - field.grids.origin[X]) / field.grids.cells[level, X]))
    last = int(np.floor((high - field.grids.origin[X]) / field.grids.cells[level, X]))
    if field.period > 0.0:
        return first, min(last, first + columns - 1)
    return min(max(first, 0), columns - 1), min(max(last, 0), columns - 1)


@kernel
def _file(field: PlacedDiscs, d: int) -> None:
    """Put disc ``d`` into its cell."""
    level = field.grids.level[d]
    column = _cell_of(field.disc[d, X], field, level, X)
    row = _cell_of(field.disc[d, Y], field, level, Y)
    cell = field.grids.start[level] + row * field.grids.shape[level, X] + column
    field.next[d] = field.head[cell]
    field.head[cell] = d
    place = field.first_column[level] + column
    field.highest[place] = max(field.highest[place], row)


@kernel
def _file_first(field: PlacedDiscs, count: int) -> None:
    for d in range(count):
        _file(field, d)


def make_field(
    radius: Floats, region: PackingRegion, obstacles: Obstacles, ceiling: float = math.inf
) -> tuple[PlacedDiscs, int]:
    """A field for grains of these radii that holds the obstacles so far, and their number of discs.

    Discs with their centers at ``ceiling`` [m] or above it are left out.
    """
    period = region.period
    left = 0.0 if region.is_periodic else region.left
    reach = 2.0 * float(radius.max())
    across = 0.0 if region.is_periodic else reach
    low = np.array([left - across, region.bottom - reach])
    high = np.array([left + region.width + across, region.top + reach])
    discs = obstacles.discs()
    if period > 0.0:
        discs = np.column_stack([wrap(discs[:, X], period), discs[:, 1:]])
    # Discs far from the region can hit nothing; clamped into the border cells they would only
    # lengthen the lists.
    reaches = (discs[:, :2] + discs[:, 2:] > low) & (discs[:, :2] - discs[:, 2:] < high)
    discs = discs[reaches.all(axis=1) & (discs[:, Y] < ceiling)]
    disc = np.concatenate([discs, np.column_stack([np.zeros((radius.size, 2)), radius])])
    grids = make_grids(classify(disc[:, RADIUS]), low, high, period, 0.0)
    columns = np.concatenate([[0], np.cumsum(grids.shape[:, X])]).astype(np.int32)
    field = PlacedDiscs(
        disc=disc,
        head=np.full(int(grids.start[-1]), -1, np.int32),
        next=np.full(len(disc), -1, np.int32),
        highest=np.full(int(columns[-1]), -1, np.int32),
        first_column=columns[:-1],
        grids=grids,
        kind=obstacles.kind,
        world=obstacles.world,
        period=period,
    )
    _file_first(field, len(discs))
    return field, len(discs)


# ---- At random free places


@subroutine
def _hits_disc(x: float, y: float, radius: float, field: PlacedDiscs) -> bool:
    for k in range(field.grids.radius.size):
        reach = radius + field.grids.radius[k]
        columns = field.grids.shape[k, X]
        first, last = _columns_between(x - reach, x + reach, field, k)
        low, high = _cell_of(y - reach, field, k, Y), _cell_of(y + reach, field, k, Y)
        for row in range(low, high + 1):
            base = field.grids.start[k] + row * columns
            for column in range(first, last + 1):
                d = field.head[base + column % columns]
                while d >= 0:
                    dx = minimum_image(x - field.disc[d, X], field.period)
                    dy = y - field.disc[d, Y]
                    near = radius + field.disc[d, RADIUS]
                    if dx * dx + dy * dy < near * near:
                        return True
                    d = field.next[d]
    return False


@kernel
def _is_free(x: float, y: float, radius: float, field: PlacedDiscs) -> bool:
    kind, world = field.kind, field.world
    for shape in range(kind.size):
        is_solid = kind[shape] != _DISC
        if is_solid and gap_to_shape(x, y, radius, shape, kind, world, field.period)[0] < 0.0:
            return False
    return not _hits_disc(x, y, radius, field)


@kernel
def insert_at_random(
    field: PlacedDiscs,
    fixed: int,
    first: int,
    tried: int,
    attempts: int,
    uniform: Floats,
    box: tuple[float, float, float, float],
    blocked: Ints,
) -> tuple[int, int]:
    """Place grains at random from number ``first`` on, to the last or until numbers run out.

    Of ``field`` the discs ``fixed + i`` are the grains. ``tried`` attempts of ``attempts`` have
    been spent on the first; each takes a row of ``uniform``, shape ``(k, 2)``. **Modifies** the
    field, and ``blocked``: 1 for a grain without a free place, which stays at the last one tried.

    Returns:
        The grain to go on with and the attempts spent on it.
    """
    left, bottom, width, height = box
    i = first
    for k in range(uniform.shape[0]):
        if fixed + i >= field.disc.shape[0]:
            break
        d = fixed + i
        field.disc[d, X] = left + uniform[k, X] * width
        field.disc[d, Y] = bottom + uniform[k, Y] * height
        tried += 1
        is_free = _is_free(field.disc[d, X], field.disc[d, Y], field.disc[d, RADIUS], field)
        if is_free or tried >= attempts:
            blocked[i] = 0 if is_free else 1
            _file(field, d)
            i += 1
            tried = 0
    return i, tried


# ---- Deposits: grains fall one by one and roll until two others, a side or the floor hold them
#
# The classical drop-and-roll construction of Visscher & Bolsterli (Nature 239, 504, 1972): every
# grain falls from above at a random place, rolls around the first disc it meets, over the next if
# that lies under its rear, falls on where it passes the widest point of a disc, and stops between
# two supports. Forces play no role: grains touch to rounding and the fill comes out at about 0.8,
# but not every heap made so is stable under every friction. It always builds along −y on the bottom
# of the region, between its sides unless it is periodic. Grains of earlier groups, glued grains and
# solid discs are piled upon; other walls are not seen, so the region has to keep clear of them.
#
# Grains begin to fall at the top of the region, or below a row of glued grains in it that faces
# down. Discs that lie there or higher are not piled upon, and the grains that come to rest have to
# keep clear of them, as of a smooth lid.
#
# Solid polygons and regions that are no rectangles are not seen either. Where a grain comes to rest
# in solid matter or beyond the boundary, a dummy of its size stays as a support for the others, and
# the grain is dropped again; dummies are then taken away.

_FALLS = -1
_FLOOR = -2
_SIDE = -3
_MOST_ROLLS = 100_000
_ATTEMPTS = 200
_SPARE = 2.0  # room for dummies, over the number of mean grains that cover the region
_SLACK = 1e-9
_BATCH = 4096


@subroutine
def _fall(
    x: float, y: float, radius: float, left_disc: int, floor: float, field: PlacedDiscs
) -> tuple[float, int]:
    """Height of its center where a grain falling from (x, y) lands [m], and the disc, or `_FLOOR`.

    ``left_disc`` is the disc it has just rolled off, or -1; ``floor`` the height of the floor [m].
    """
    best, support = floor + radius, _FLOOR
    for k in range(field.grids.radius.size):
        reach = radius + field.grids.radius[k]
        columns, height = field.grids.shape[k, X], field.grids.cells[k, Y]
        first, last = _columns_between(x - reach, x + reach, field, k)
        for column in range(first, last + 1):
            place = column % columns
            row = min(field.highest[field.first_column[k] + place], _cell_of(y, field, k, Y))
            # Rows whose upper edge lies more than a reach below the best landing cannot beat it.
            while row >= 0 and field.grids.origin[Y] + (row + 1) * height + reach > best:
                d = field.head[field.grids.start[k] + row * columns + place]
                while d >= 0:
                    dx = abs(minimum_image(x - field.disc[d, X], field.period))
                    near = radius + field.disc[d, RADIUS]
                    if d != left_disc and dx < near * (1.0 - 1e-12):
                        landing = field.disc[d, Y] + np.sqrt(near * near - dx * dx)
                        if landing > best and landing <= y + 1e-9 * near:
                            best, support = landing, d
                    d = field.next[d]
                row -= 1
    return best, support


@kernel
def _meeting(angle: float, rolling: float, dx: float, dy: float, near: float) -> float:
    """Angle at which a grain that rolls around a disc meets another one; ``inf`` if it does not.

    ``angle`` is its own now, from the vertical towards the side it rolls to [rad], at the distance
    ``rolling`` [m]; the other disc is at ``dx``, towards that side, and ``dy``, upwards, and
    touched at a distance of ``near`` [m].
    """
    apart = np.sqrt(dx * dx + dy * dy)
    if apart == 0.0:
        return np.inf
    bearing = atan2(dx, dy)
    square = rolling * rolling + apart * apart
    if square - 2.0 * rolling * apart * cos(angle - bearing) <= near * near * (1.0 + 1e-10):
        # Touching: an obstacle if the grain moves towards it, nothing if it moves away.
        return angle if sin(angle - bearing) < 0.0 else np.inf
    cosine = (square - near * near) / (2.0 * rolling * apart)
    if abs(cosine) >= 1.0:
        return np.inf
    meeting: float = bearing - acos(cosine)
    while meeting < angle:
        meeting += 2.0 * np.pi
    return meeting


@subroutine
def _roll(
    x: float, y: float, radius: float, j: int, side: float, sides: Floats, field: PlacedDiscs
) -> tuple[float, float, int]:
    """Roll a grain at (x, y) down around disc ``j`` towards ``side`` (±1).

    Returns its new center [m], and what stopped it: another disc, `_FLOOR`, `_SIDE`, or `_FALLS`
    past the widest point of ``j``.
    """
    left, floor, right, _ = sides
    xj, yj = field.disc[j, X], field.disc[j, Y]
    rolling = radius + field.disc[j, RADIUS]
    start = atan2(side * minimum_image(x - xj, field.period), y - yj)
    best, what = 0.5 * np.pi, _FALLS
    above = (floor + radius - yj) / rolling
    if above > 0.0:
        best, what = max(start, acos(min(1.0, above))), _FLOOR
    if field.period <= 0.0:
        room = (right - radius - xj) / rolling if side > 0.0 else (xj - left - radius) / rolling
        if room < 1.0 and asin(max(room, 0.0)) < best:
            best, what = max(start, asin(max(room, 0.0))), _SIDE
    for k in range(field.grids.radius.size):
        reach = radius + field.grids.radius[k]
        columns = field.grids.shape[k, X]
        ends = xj + side * (rolling * sin(start) - reach), xj + side * (rolling + reach)
        first, last = _columns_between(min(ends), max(ends), field, k)
        low = _cell_of(yj - reach, field, k, Y)
        high = _cell_of(yj + rolling + reach, field, k, Y)
        for row in range(low, high + 1):
            base = field.grids.start[k] + row * columns
            for column in range(first, last + 1):
                d = field.head[base + column % columns]
                while d >= 0:
                    if d != j:
                        dx = side * minimum_image(field.disc[d, X] - xj, field.period)
                        dy, near = field.disc[d, Y] - yj, radius + field.disc[d, RADIUS]
                        meeting = _meeting(start, rolling, dx, dy, near)
                        if meeting < best:
                            best, what = meeting, d
                    d = field.next[d]
    return xj + side * rolling * sin(best), yj + rolling * cos(best), what


@kernel
def _wrapped(x: float, period: float) -> float:
    if period <= 0.0:
        return x
    inside = x - period * np.floor(x / period)
    return 0.0 if inside >= period else inside


@kernel
def _settle(x: float, radius: float, sides: Floats, field: PlacedDiscs) -> tuple[float, float]:
    """Where a grain dropped at ``x`` comes to rest [m]."""
    floor = sides[1]
    nothing: int = np.int64(-1)  # type: ignore[assignment]  # for a literal `_fall` would be compiled once more
    y, j = _fall(x, np.inf, radius, nothing, floor, field)
    side = 0.0
    for _ in range(_MOST_ROLLS):
        if j == _FLOOR:
            break
        offset = minimum_image(x - field.disc[j, X], field.period)
        if side == 0.0:
            side = 1.0 if offset >= 0.0 else -1.0
        x, y, what = _roll(x, y, radius, j, side, sides, field)
        x = _wrapped(x, field.period)
        if what == _FALLS:
            y, j = _fall(x, y, radius, j, floor, field)
            side = 0.0
        elif what < 0 or side * minimum_image(x - field.disc[what, X], field.period) < 0.0:
            break  # between two supports
        else:
            j = what  # the disc met lies under the grain's rear: roll on over it
    return x, y


@kernel
def _drop_and_roll(
    field: PlacedDiscs,
    fixed: int,
    first: int,
    tried: int,
    attempts: int,
    uniform: Floats,
    sides: Floats,
) -> tuple[int, int]:
    """Drop grains one by one from ``first`` on, until all rest, one does not fit, or numbers end.

    As `insert_at_random`; ``uniform`` has shape ``(k,)``, ``sides`` are left, bottom, right and top
    of the region [m]. One that would stick out at the top is dropped again elsewhere.

    Returns:
        The grain to go on with and the attempts spent on it; ``attempts`` if it does not fit.
    """
    left, _, right, top = sides
    i = first
    for k in range(uniform.size):
        d = fixed + i
        if d >= field.disc.shape[0] or tried >= attempts:
            break
        radius = field.disc[d, RADIUS]
        inset = radius if field.period <= 0.0 else 0.0
        x = left + inset + uniform[k] * (right - left - 2.0 * inset)
        x, y = _settle(x, radius, sides, field)
        tried += 1
        if y + radius <= top * (1.0 + 1e-12):
            field.disc[d, X], field.disc[d, Y] = x, y
            _file(field, d)
            i += 1
            tried = 0
    return i, tried


def deposit(radius: Floats, region: PackingRegion, obstacles: Obstacles, rng: Stream) -> Floats:
    """Centers of grains deposited in the order given [m], shape ``(n, 2)``.

    ``region``'s bottom is the floor; ``rng`` gives the places from which grains fall. Where not all
    fit, `Refused` says how many do.
    """
    if not region.is_periodic and 2.0 * radius.max() > region.width:
        text = f"the largest diameter, {2.0 * radius.max():g} m, exceeds the width of the region, "
        raise Refused((), f"{text}{region.width:g} m", "widen the region")
    left = 0.0 if region.is_periodic else region.left
    top = min([region.top, *(height for height in obstacles.lids if height > region.bottom)])
    sides = np.array([left, region.bottom, left + region.width, top])
    if not obstacles.room.is_open:
        return _deposit_in_room(radius, region, obstacles, rng, sides)
    field, fixed = make_field(radius, region, obstacles, top)
    done, tried = 0, 0
    while done < radius.size:
        uniform = rng.random(max(_BATCH, radius.size - done))
        done, tried = _drop_and_roll(field, fixed, done, tried, _ATTEMPTS, uniform, sides)
        if tried >= _ATTEMPTS:
            area = region.width * (top - region.bottom)
            filled = np.pi * total(radius[:done] * radius[:done]) / area
            raise _refusal(radius, done, f" (area fraction {filled:.3f})", region, top)
    return field.disc[fixed:, :2].copy()


def _deposit_in_room(
    radius: Floats, region: PackingRegion, obstacles: Obstacles, rng: Stream, sides: Floats
) -> Floats:
    """As `deposit`, with dummies where grains must not be."""
    # Dummies cover less than the region; large grains, which fit in fewer places, are more often
    # among them than small ones.
    top = float(sides[-1])
    spare = math.ceil(_SPARE * region.area / (math.pi * mean(radius * radius)))
    sizes = radius[np.arange(radius.size + spare) % radius.size]
    field, fixed = make_field(sizes, region, obstacles, top)
    level = field.grids.level[fixed : fixed + radius.size].copy()
    kept: list[int] = []
    for d in range(fixed, len(field.disc)):
        i = len(kept)
        field.disc[d, RADIUS], field.grids.level[d] = radius[i], level[i]
        so_far, places = field._replace(disc=field.disc[: d + 1]), rng.random(_ATTEMPTS)
        done, _ = _drop_and_roll(so_far, fixed, d - fixed, 0, _ATTEMPTS, places, sides)
        if done == d - fixed:
            break
        if obstacles.room.clearance(field.disc[d : d + 1, :2])[0] >= radius[i] * (1.0 - _SLACK):
            kept.append(d)
        if len(kept) == radius.size:
            return field.disc[kept, :2].copy()
    raise _refusal(radius, len(kept), "", region, top)


def _refusal(radius: Floats, done: int, more: str, region: PackingRegion, top: float) -> Refused:
    under = f" up to the rough wall above them at y = {top:g} m" if top < region.top else ""
    text = f"{radius.size} grains do not fit: the region is full{under} with {done} of them{more}"
    larger = "raise the wall, or" if under else "enlarge the region or"
    return Refused((), text, f"{larger} ask for fewer grains")
