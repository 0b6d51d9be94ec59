"""How much grains that are no discs see of each other: view factors of any convex outlines.

Formula: long prisms i and j exchange heat through ``A_i F_ij = ½ b (crossed − uncrossed strings)``,
which is half the measure of the straight lines that meet both outlines (M. W. Crofton, Phil. Trans.
R. Soc. 158 (1868) 181), and so

``A_i F_ij = ½ b ∫_0^π o(φ) dφ``

where o is what the shadows of both along the direction φ have in common. It is summed exactly,
between the angles at which another corner is the outermost of one of the two; of two discs it is
`cylinder_view_factor`.

Source: H. C. Hottel (in W. H. McAdams, Heat Transmission (1954)); L. A. Santaló, Integral Geometry
(1976), I.3 (the measure of lines).

Validity: long prisms, whose ends do not count, of one thickness b (that of the thinner one). A
clump is what a string around it encloses, which is exact if no other reaches into its bays. Third
bodies hide nothing. A line or circle of a wall counts as a copy of the grain that is turned by half
a turn and lies behind the tangent plane there, as it counts as a disc like the grain for a disc.
"""

from __future__ import annotations

from math import floor, inf, pi, sqrt
from typing import NamedTuple

import numpy as np

from multicor_cli.arithmetic import acos, atan2, cos, sin
from multicor_cli.engine.geometry.outlines import true_gap
from multicor_cli.engine.geometry.pieces import Pieces
from multicor_cli.engine.geometry.radii import other_radius
from multicor_cli.engine.geometry.scene import Scene, known_geometry, shortest
from multicor_cli.engine.heat.mechanism import HeatLaws, Rows
from multicor_cli.engine.jit.compile import kernel, subroutine
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.model.columns import ANGLE, X, Y
from multicor_cli.model.model import Floats, Ints

# ---- What a string around a grain touches


class Hulls(NamedTuple):
    """Convex hulls of ``n`` grains with ``v`` round corners, counter-clockwise, at angle 0.

    Attributes:
        start: First corner of each grain, shape ``(n + 1,)``.
        corner: Center (x, y) and radius of each corner over the radius of its grain, and the angle
            of the outward normal of the edge to the next one [rad], shape ``(v, 4)``.
    """

    start: Rows
    corner: Floats


_ROUND, _NORMAL = 2, 3
_FULL = 2.0 * pi
_EQUAL = 1e-12
"""Of a turn or a size: what differs less is one."""


@kernel
def hulls_of(pieces: Pieces, radius: Floats) -> Hulls:
    """Hulls of grains with these radii [m]; their pieces are at angle 0."""
    start = np.zeros(radius.size + 1, np.int64)
    found = np.empty((pieces.start[pieces.piece[radius.size]], 4))
    for k in range(radius.size):
        first, last = pieces.piece[k], pieces.piece[k + 1]
        count = pieces.start[last] - pieces.start[first]
        disc = np.empty((count, 3))
        for p in range(first, last):
            for v in range(pieces.start[p], pieces.start[p + 1]):
                at = v - pieces.start[first]
                disc[at, X] = pieces.corner[v, X] / radius[k]
                disc[at, Y] = pieces.corner[v, Y] / radius[k]
                disc[at, _ROUND] = pieces.rounding[p] / radius[k]
        start[k + 1] = start[k] + _wrap(disc[: _leave_out_inner(disc)], found[start[k] :])
    return Hulls(start, found[: start[-1]].copy())


@subroutine
def _leave_out_inner(disc: Floats) -> int:
    """Move to the front the discs (x, y, radius) that lie in no other, of equal ones the last, in
    their order; returns how many they are.
    """
    kept = 0
    for k in range(len(disc)):
        is_within = False
        for m in range(len(disc)):
            if kept <= m <= k:
                continue  # left out before, or the disc itself
            x, y = disc[k, X] - disc[m, X], disc[k, Y] - disc[m, Y]
            is_within |= sqrt(x * x + y * y) <= disc[m, _ROUND] - disc[k, _ROUND] + _EQUAL
        if not is_within:
            for column in range(3):
                disc[kept, column] = disc[k, column]
            kept += 1
    return kept


@subroutine
def _wrap(disc: Floats, hull: Floats) -> int:
    """Wrap a string around discs (x, y, radius), into ``hull``; returns how many it touches."""
    at = 0
    for k in range(len(disc)):
        reach, most = disc[k, X] + disc[k, _ROUND], disc[at, X] + disc[at, _ROUND]
        at = k if reach > most or (reach == most and disc[k, Y] > disc[at, Y]) else at
    angle, count = 0.0, 0
    while count < len(disc):
        next_one, least, far = -1, inf, 0.0
        for k in range(len(disc)):
            x, y = disc[k, X] - disc[at, X], disc[k, Y] - disc[at, Y]
            away, larger = sqrt(x * x + y * y), disc[at, _ROUND] - disc[k, _ROUND]
            if away <= abs(larger) + _EQUAL:
                continue
            turn = _within_turn(atan2(y, x) - acos(larger / away) - angle)
            turn = 0.0 if turn > _FULL - _EQUAL * 10.0 else turn
            if turn < least - _EQUAL or (turn < least + _EQUAL and away > far):
                next_one, least, far = k, turn, away
        hull[count, X], hull[count, Y] = disc[at, X], disc[at, Y]
        hull[count, _ROUND] = disc[at, _ROUND]
        hull[count, _NORMAL] = angle + least
        count += 1
        angle += least
        if next_one < 0 or angle >= _FULL - _EQUAL * 10.0:
            break
        at = next_one
    return count


@formula
def _within_turn(angle: float) -> float:
    """The same angle in [0, 2π)."""
    return angle - _FULL * floor(angle / _FULL)


# ---- What the shadows of two outlines have in common


class _Wave(NamedTuple):
    """``x cos φ + y sin φ + c`` [m]: how far a round corner reaches along the direction φ."""

    x: float
    y: float
    c: float


@formula
def _less(one: _Wave, other: _Wave) -> _Wave:
    return _Wave(one.x - other.x, one.y - other.y, one.c - other.c)


@formula
def _integral(wave: _Wave, a: float, b: float) -> float:
    return wave.x * (sin(b) - sin(a)) + wave.y * (cos(a) - cos(b)) + wave.c * (b - a)


@subroutine
def _roots(wave: _Wave, first: float, last: float) -> tuple[float, float]:
    """Where a wave is 0 between two angles, ascending; ``last`` where it is not."""
    size = sqrt(wave.x * wave.x + wave.y * wave.y)
    if size <= abs(wave.c):
        return last, last
    top, half = atan2(wave.y, wave.x), acos(-wave.c / size)
    one = first + _within_turn(top - half - first)
    other = first + _within_turn(top + half - first)
    one, other = min(one, last), min(other, last)
    return min(one, other), max(one, other)


@subroutine
def _above(wave: _Wave, first: float, last: float) -> float:
    """Integral of what of a wave is above 0."""
    low, high = _roots(wave, first, last)
    found = 0.0
    for a, b in ((first, low), (low, high), (high, last)):  # each of one sign
        found += max(_integral(wave, a, b), 0.0)
    return found


@subroutine
def _shared(
    up: _Wave, up_too: _Wave, down: _Wave, down_too: _Wave, first: float, last: float
) -> float:
    """Integral of the common shadow of two bodies: upper ends, and how far they reach down."""
    a, b = _roots(_less(up, up_too), first, last)
    c, d = _roots(_less(down, down_too), first, last)
    found, at = 0.0, first
    while at < last:
        to = last
        for cut in (a, b, c, d):
            to = cut if at < cut < to else to
        top = up if _integral(up, at, to) <= _integral(up_too, at, to) else up_too
        bottom = down if _integral(down, at, to) <= _integral(down_too, at, to) else down_too
        both = _Wave(top.x + bottom.x, top.y + bottom.y, top.c + bottom.c)
        found += _above(both, at, to)
        at = to
    return found


class _Body(NamedTuple):
    """A hull in the world: its first corner and the end of them, and how it lies.

    ``size`` is the radius [m] that lengths are multiplied by, (x, y) where its center is [m].
    """

    first: int
    last: int
    size: float
    angle: float
    x: float
    y: float


@subroutine
def _wave(corner: Floats, body: _Body, v: int, sign: float) -> _Wave:
    """How far a corner of a body reaches, up or down (``sign`` −1)."""
    c, s = cos(body.angle), sin(body.angle)
    x = body.x + body.size * (c * corner[v, X] - s * corner[v, Y])
    y = body.y + body.size * (s * corner[v, X] + c * corner[v, Y])
    return _Wave(sign * x, sign * y, body.size * corner[v, _ROUND])


@subroutine
def _first(corner: Floats, body: _Body, turned: float) -> tuple[int, float]:
    """The outermost corner along 0 less ``turned``, and the angle at which it is no more."""
    at, least = body.first, inf
    if body.last - body.first > 1:
        for v in range(body.first, body.last):
            to = _within_turn(corner[v, _NORMAL] + body.angle - turned)
            if to < least:
                at, least = v, to
    return at, least


@subroutine
def _next(corner: Floats, body: _Body, v: int, to: float) -> tuple[int, float]:
    """The corner after another, and the angle at which it is no more the outermost."""
    w = v + 1 if v + 1 < body.last else body.first
    return w, to + _within_turn(corner[w, _NORMAL] - corner[v, _NORMAL])


@subroutine
def shared_lines(corner: Floats, one: _Body, other: _Body) -> float:
    """Half the measure of the lines that meet two hulls, ``½ ∫ o(φ) dφ`` [m]."""
    (a, to_a), (b, to_b) = _first(corner, one, 0.0), _first(corner, other, 0.0)
    (c, to_c), (d, to_d) = _first(corner, one, pi), _first(corner, other, pi)
    at, found = 0.0, 0.0
    while at < pi:
        to = min(to_a, to_b, to_c, to_d, pi)
        if to > at:
            found += _shared(
                _wave(corner, one, a, 1.0), _wave(corner, other, b, 1.0),
                _wave(corner, one, c, -1.0), _wave(corner, other, d, -1.0), at, to,
            )  # fmt: skip
        at = to
        if to >= pi:
            break
        if to_a == to:
            a, to_a = _next(corner, one, a, to_a)
        if to_b == to:
            b, to_b = _next(corner, other, b, to_b)
        if to_c == to:
            c, to_c = _next(corner, one, c, to_c)
        if to_d == to:
            d, to_d = _next(corner, other, d, to_d)
    return 0.5 * found


# ---- Pairs


@subroutine
def reach_towards(hulls: Hulls, scene: Scene, i: int, x: float, y: float) -> float:
    """How far a grain reaches from its center along (x, y) [m]."""
    c, s = cos(scene.position[i, ANGLE]), sin(scene.position[i, ANGLE])
    along, across, most = c * x + s * y, c * y - s * x, -inf
    for v in range(hulls.start[i], hulls.start[i + 1]):
        corner = hulls.corner[v]
        most = max(most, corner[X] * along + corner[Y] * across + corner[_ROUND])
    return float(scene.radius[i] * most)


@kernel
def gaps_of_outlines(
    scene: Scene, pieces: Pieces, hulls: Hulls, rows: Rows, i: Ints, j: Ints, gap: Floats,
    normal: Floats,
) -> None:  # fmt: skip
    """True gaps [m] and normals of some pairs, into arrays of all, ``(e,)`` and ``(e, 2)``.

    Of a wall that of its point nearest to the center of the grain, which belongs to one of its
    shapes alone.
    """
    for k in rows:
        if j[k] < scene.radius.size:
            gap[k], normal[k, X], normal[k, Y] = true_gap(scene, pieces, i[k], j[k])
        else:
            around, nx, ny = known_geometry(scene, i[k], j[k])
            gap[k] = around + scene.radius[i[k]] - reach_towards(hulls, scene, i[k], -nx, -ny)
            normal[k, X], normal[k, Y] = nx, ny


@kernel
def views_of_outlines(
    scene: Scene, hulls: Hulls, laws: HeatLaws, thickness: Floats, rows: Rows, i: Ints, j: Ints,
    gap: Floats, normal: Floats, area: Floats,
) -> None:  # fmt: skip
    """Area factors of radiation [m²] of some pairs, into ``area``, **modified**, shape ``(e,)``."""
    corner = np.empty((len(hulls.corner) + 1, 4))
    corner[:-1] = hulls.corner
    corner[-1] = np.array([0.0, 0.0, 1.0, 0.0])  # of discs of walls
    for k in rows:
        a, b = i[k], j[k]
        emission = laws.emission[scene.material[a], scene.material[b]]
        breadth, nx, ny = thickness[a], normal[k, X], normal[k, Y]
        overlap, x, y = max(-gap[k], 0.0), scene.position[a, X], scene.position[a, Y]
        mine = _Body(
            hulls.start[a], hulls.start[a + 1], scene.radius[a], scene.position[a, ANGLE], 0.0, 0.0
        )
        if b < scene.radius.size:
            breadth = min(breadth, thickness[b])
            dx, dy = shortest(
                x - scene.position[b, X], y - scene.position[b, Y], scene.period, scene.height,
                scene.tilt,
            )  # fmt: skip
            other = _Body(
                hulls.start[b], hulls.start[b + 1], scene.radius[b], scene.position[b, ANGLE],
                -dx - overlap * nx, -dy - overlap * ny,
            )  # fmt: skip
        elif other_radius(scene, b) > 0.0:
            size = other_radius(scene, b)
            away = reach_towards(hulls, scene, a, -nx, -ny) + max(gap[k], 0.0) + size
            other = _Body(len(corner) - 1, len(corner), size, 0.0, -away * nx, -away * ny)
        else:
            away = 2.0 * reach_towards(hulls, scene, a, -nx, -ny) + max(gap[k], 0.0)
            other = _Body(mine.first, mine.last, mine.size, mine.angle + pi, -away * nx, -away * ny)
        area[k] = emission * breadth * shared_lines(corner, mine, other)
