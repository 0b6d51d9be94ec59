"""The contacts of two grains before and after a solve, four at a time.

What the loops compute is defined by their scalar twins, to the bit. Arrays are those of a
`Schedule`, flat. Lanes of other contacts, or of none, hold numbers without meaning in between and
add to no sum.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import floor, sqrt
from typing import Any, NamedTuple

import numpy as np

from multicor_cli.engine.contact.law import GRAZE, bias, guard_plane
from multicor_cli.engine.contact.vector_sweep import (
    BIAS_,
    BRANCH_ROWS,
    BRANCH_Y_,
    FRAME_ROWS,
    IMPULSE_ROWS,
    MU_,
    NY_,
    OPPOSITE,
    SECOND_,
    SURFACE_,
    TANGENTIAL_,
    Y_,
    Stretch,
    bodies_of,
    branch_place,
    frame_place,
    impulse_place,
    pair_place,
)
from multicor_cli.engine.jit.compile import loop_body
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.engine.jit.vectors import HAS_VECTORS, LANES, Vector, Writer, vector_loop
from multicor_cli.model.columns import BIAS, MU, NORMAL, NX, NY, TANGENTIAL, X, Y
from multicor_cli.model.model import Floats, Ints

_Value = Any  # of LLVM

BOUNCE, SMALLER, IS_OURS = 0, 1, 2
"""Rows of what lasts with a contact: restitution, smaller radius [m], 1 if it joins two grains."""

ABOUT_ROWS = 3
_ABOUT, _SMALLER, _OURS = np.uint64(LANES * ABOUT_ROWS), np.uint64(LANES), np.uint64(2 * LANES)
_LANES, _SHIFT, _MASK = np.uint64(LANES), np.uint64(2), np.uint64(LANES - 1)
_RADIUS = SURFACE_  # column of the rows of places


@formula
def about_place(lane: np.uint64) -> np.uint64:
    """Place of the restitution of a contact."""
    return _ABOUT * (lane >> _SHIFT) + (lane & _MASK)


# ---- Before: geometry, velocities, biases, impulses to start from


@loop_body
def begin_scalar(
    first: int, last: int, middle: Floats, start: Floats, pair: Ints, about: Floats, frame: Floats,
    impulse: Floats, before: Floats, gap: Floats, dt: float, period: float, half: float,
    ratio: float, branch: Floats, height: float, tilt: float, xx: float, yy: float, xy: float,
) -> tuple[float, float, float, float, float, float]:  # fmt: skip
    """Frames, gaps and velocities u⁻ of the contacts of two grains in batches ``first … last-1``.

    ``middle`` are places at q_m, rows of x, y, radius; ``start`` velocities v⁻. With a ``period``
    ``half`` is half of it, else infinite; ``ratio`` is that of this time step to the last.
    In a cell (``height`` > 0) its gradient is (xx, yy, xy), and ``branch`` gets the branch vectors.
    **Modifies** ``frame`` (but W and μ), ``impulse``, ``before``: u⁻, and ``gap``.

    Returns the sum of min(u_n⁻, 0)² of contacts that close in the step and their number; the sums,
    spins left out, of |u_t⁻| of those that carry an impulse and of the speeds of those that carry
    one or close, each with their number. Sums are taken lane by lane.
    """
    sums = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for column in range(LANES):
        squares, closes, shear, loaded, motion, met = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for batch in range(first, last):
            lane = np.uint64(LANES * batch + column)
            q, f, p, a = pair_place(lane), frame_place(lane), impulse_place(lane), about_place(lane)
            if about[a + _OURS] == 0.0:
                continue
            i, j = np.uint64(pair[q]), np.uint64(pair[q + SECOND_])
            dx, dy = middle[i] - middle[j], middle[i + Y_] - middle[j + Y_]
            radii = middle[i + _RADIUS] + middle[j + _RADIUS]
            ux, uy = start[i] - start[j], start[i + Y_] - start[j + Y_]
            if height > 0.0:
                images = floor(dy / height + 0.5)
                dx, dy = dx - images * tilt, dy - images * height
                dx -= period * floor(dx / period + 0.5)
                b = branch_place(lane)
                branch[b], branch[b + BRANCH_Y_] = dx, dy
                ux, uy = ux + (xx * dx + xy * dy), uy + yy * dy
            else:
                dx = dx - period if dx > half else dx + period if dx < -half else dx
            graze = GRAZE * about[a + _SMALLER]
            g, room, nx, ny = guard_plane(dx, dy, ux, uy, radii, graze, dt)
            u_n, across = ux * nx + uy * ny, uy * nx - ux * ny
            u_t = across - (start[i + SURFACE_] + start[j + SURFACE_])
            frame[f], frame[f + NY_] = nx, ny
            frame[f + BIAS_] = bias(room, u_n, about[a], dt)
            gap[lane], before[p], before[p + TANGENTIAL_] = g, u_n, u_t
            # Of a contact that bears nothing p_t may be −0, which no state remembers
            impulse[p] *= ratio
            impulse[p + TANGENTIAL_] = ratio * impulse[p + TANGENTIAL_] + 0.0
            if u_n < 0.0 and room + dt * u_n <= 0.0:
                squares += u_n * u_n
                closes += 1.0
            if impulse[p] > 0.0:
                shear += abs(across)
                loaded += 1.0
            if impulse[p] > 0.0 or (u_n < 0.0 and room + dt * u_n <= 0.0):
                motion += sqrt(u_n * u_n + across * across)
                met += 1.0
        sums = (
            sums[0] + squares, sums[1] + closes, sums[2] + shear, sums[3] + loaded,
            sums[4] + motion, sums[5] + met,
        )  # fmt: skip
    return sums


def _difference(code: Writer, rows: Sequence[Sequence[Vector]]) -> list[Vector]:
    """First two columns of the rows of i less those of j; the last two added."""
    return code.transpose([a + b.flipped(OPPOSITE) for a, b in zip(*rows, strict=True)])


def _rows(code: Writer, array: _Value, bodies: Sequence[Sequence[_Value]]) -> list[list[Vector]]:
    return [[code.load(array, at) for at in side] for side in bodies]


def _nearest(dx: Vector, period: Vector, half: Vector) -> Vector:
    return dx.where(">", half, dx - period, dx.where("<", -half, dx + period, dx))


def _guard_planes(
    code: Writer, dx: Vector, dy: Vector, ux: Vector, uy: Vector, radii: Vector, graze: Vector,
    step: Vector,
) -> list[Vector]:  # fmt: skip
    """As `law.guard_plane`."""
    zero, one = code.number(0.0), code.number(1.0)
    distance = (dx * dx + dy * dy).root()
    nx = distance.where(">", zero, dx / distance, zero)
    ny = distance.where(">", zero, dy / distance, one)
    gap = distance.where(">", zero, distance - radii, -radii)
    along, square = dx * ux + dy * uy, ux * ux + uy * uy
    when = -along / square
    least = when.where(">=", step, radii, radii - graze)
    when = when.smaller(step)
    px, py = dx + when * ux, dy + when * uy
    closest = (px * px + py * py).root()
    passes = gap.where(">", zero, along.where("<", zero, square, zero), zero)
    passes = closest.where("<", least, zero, passes)
    nx = passes.where(">", zero, px / closest, nx)
    ny = passes.where(">", zero, py / closest, ny)
    room = passes.where(">", zero, dx * nx + dy * ny - radii, gap)
    return [gap, room, nx, ny]


@vector_loop(results=6)
def begin_batches(
    code: Writer, first: _Value, last: _Value, middle: _Value, start: _Value, pair: _Value,
    about: _Value, frame: _Value, impulse: _Value, before: _Value, gap: _Value,
    dt: _Value, period: _Value, half: _Value, ratio: _Value,
) -> list[_Value]:  # fmt: skip
    """As `begin_scalar`."""
    period, half = code.spread(period), code.spread(half)

    def between(
        batch: _Value, dx: Vector, dy: Vector, ux: Vector, uy: Vector
    ) -> tuple[Vector, Vector, Vector, Vector]:
        return _nearest(dx, period, half), dy, ux, uy

    arrays = middle, start, pair, about, frame, impulse, before, gap
    return _begin(code, first, last, arrays, dt, ratio, between)


@vector_loop(results=6)
def begin_stretched_batches(
    code: Writer, first: _Value, last: _Value, middle: _Value, start: _Value, pair: _Value,
    about: _Value, frame: _Value, impulse: _Value, before: _Value, gap: _Value,
    dt: _Value, period: _Value, ratio: _Value, branch: _Value, height: _Value, tilt: _Value,
    xx: _Value, yy: _Value, xy: _Value,
) -> list[_Value]:  # fmt: skip
    """As `begin_scalar` in a cell."""
    period, height, tilt = code.spread(period), code.spread(height), code.spread(tilt)
    stretch = Stretch(code, branch, (xx, yy, xy))
    zero, part = code.number(0.0), code.number(0.5)

    def between(
        batch: _Value, dx: Vector, dy: Vector, ux: Vector, uy: Vector
    ) -> tuple[Vector, Vector, Vector, Vector]:
        images = (dy / height + part).floor()
        dx, dy = dx - images * tilt, dy - images * height
        dx = dx - period * (dx / period + part).floor()
        (ours,) = code.block(about, batch, ABOUT_ROWS, IS_OURS)
        lx, ly = (ours.where(">", zero, value, zero) for value in (dx, dy))
        code.fill(branch, batch, BRANCH_ROWS, {X: lx, Y: ly})
        sx, sy = stretch.of(lx, ly)
        return dx, dy, ux + sx, uy + sy

    arrays = middle, start, pair, about, frame, impulse, before, gap
    return _begin(code, first, last, arrays, dt, ratio, between)


_Between = Callable[[_Value, Vector, Vector, Vector, Vector], tuple[Vector, Vector, Vector, Vector]]
"""From differences of places and velocities of a batch, those of nearest images."""


def _begin(
    code: Writer, first: _Value, last: _Value, arrays: Sequence[_Value], dt: _Value, ratio: _Value,
    between: _Between,
) -> list[_Value]:  # fmt: skip
    middle, start, pair, about, frame, impulse, before, gap = arrays
    zero, one, least = code.number(0.0), code.number(1.0), code.number(GRAZE)
    step, ratio = code.spread(dt), code.spread(ratio)
    sums = code.keep([zero] * 6)
    with code.each(first, last) as batch:
        bodies = bodies_of(code, pair, batch)
        dx, dy, radii, _ = _difference(code, _rows(code, middle, bodies))
        ux, uy, spins, _ = _difference(code, _rows(code, start, bodies))
        dx, dy, ux, uy = between(batch, dx, dy, ux, uy)
        bounce, smaller, ours = code.block(about, batch, ABOUT_ROWS, BOUNCE, SMALLER, IS_OURS)
        g, room, nx, ny = _guard_planes(code, dx, dy, ux, uy, radii, least * smaller, step)
        u_n, across = ux * nx + uy * ny, uy * nx - ux * ny
        u_t = across - spins
        closing = u_n.smaller(zero)
        reached = room + step * closing
        rebound = bounce.where(
            ">", zero, reached.where("<=", zero, bounce * closing, room.larger(zero) / step),
            room.larger(zero) / step,
        )  # fmt: skip
        code.fill(frame, batch, FRAME_ROWS, {NX: nx, NY: ny, BIAS: rebound})
        code.fill(before, batch, IMPULSE_ROWS, {NORMAL: u_n, TANGENTIAL: u_t})
        code.fill(gap, batch, 1, {0: g})
        p_n, p_t = code.block(impulse, batch, IMPULSE_ROWS, NORMAL, TANGENTIAL)
        p_n, p_t = ratio * p_n, ratio * p_t + zero
        code.fill(impulse, batch, IMPULSE_ROWS, {NORMAL: p_n, TANGENTIAL: p_t})
        hit = ours.where(">", zero, reached.where("<=", zero, closing, zero), zero)
        closes = hit.where("<", zero, one, zero)
        loaded = p_n.where(">", zero, ours, zero)
        meets = closes.larger(loaded)
        speed = (u_n * u_n + across * across).root()
        added = (
            hit * hit, closes, loaded.where(">", zero, abs(across), zero), loaded,
            meets.where(">", zero, speed, zero), meets,
        )  # fmt: skip
        sums.put([a + b for a, b in zip(sums.get(), added, strict=True)])
    return [code.total(vector) for vector in sums.get()]


# ---- After: losses, virial, overlaps

FRICTION, IMPACT, SLIDING, NEGATIVE, VIRIAL, LOADED, LARGEST, OVERLAP = 0, 1, 2, 3, 4, 8, 9, 10
"""Sums over contacts: losses [J], virial (four, xx xy yx yy) [J s], number of loaded contacts; and
largest p_n [N s] and overlap over the smaller radius at the end of the step."""

SUMS = 11


@loop_body
def end_scalar(
    first: int, last: int, middle: Floats, velocity: Floats, pair: Ints, about: Floats,
    frame: Floats, impulse: Floats, before: Floats, gap: Floats, half_step: float, period: float,
    half: float, branch: Floats, xx: float, yy: float, xy: float, depth: Floats,
) -> tuple[
    float, float, float, float, float, float, float, float, float, float, float
]:  # fmt: skip
    """What the contacts of two grains in batches ``first … last-1`` add to `SUMS`, lane by lane.

    ``velocity`` are v⁺; places at the end are q_m + ½Δt v⁺. Other arguments as `begin_scalar`:
    ``branch`` has no elements but in a cell. **Modifies** ``depth``: what contacts overlap at the
    end, over the smaller radius; negative where they are apart, 0 in lanes of others.
    """
    sums = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    largest, deepest = 0.0, 0.0
    for column in range(LANES):
        friction, impact, sliding, negative, loaded = 0.0, 0.0, 0.0, 0.0, 0.0
        s_xx, s_xy, s_yx, s_yy = 0.0, 0.0, 0.0, 0.0
        for batch in range(first, last):
            lane = np.uint64(LANES * batch + column)
            q, f, p, a = pair_place(lane), frame_place(lane), impulse_place(lane), about_place(lane)
            depth[lane] = 0.0
            if about[a + _OURS] == 0.0:
                continue
            i, j = np.uint64(pair[q]), np.uint64(pair[q + SECOND_])
            nx, ny, p_n, p_t = frame[f], frame[f + NY_], impulse[p], impulse[p + TANGENTIAL_]
            ux, uy = velocity[i] - velocity[j], velocity[i + Y_] - velocity[j + Y_]
            radii = middle[i + _RADIUS] + middle[j + _RADIUS]
            px, py = p_n * nx - p_t * ny, p_n * ny + p_t * nx
            if branch.size:
                b = branch_place(lane)
                lx, ly = branch[b], branch[b + BRANCH_Y_]
                ux, uy = ux + (xx * lx + xy * ly), uy + yy * ly
                dx, dy = lx + half_step * ux, ly + half_step * uy
                virial = px * lx, px * ly, py * lx, py * ly
            else:
                length = radii + gap[lane]
                virial = (
                    px * length * nx, px * length * ny, py * length * nx, py * length * ny
                )  # fmt: skip
                dx = (middle[i] + half_step * velocity[i]) - (middle[j] + half_step * velocity[j])
                dx = dx - period if dx > half else dx + period if dx < -half else dx
                dy = (middle[i + Y_] + half_step * velocity[i + Y_]) - (
                    middle[j + Y_] + half_step * velocity[j + Y_]
                )
            u_n = ux * nx + uy * ny
            u_t = uy * nx - ux * ny - (velocity[i + SURFACE_] + velocity[j + SURFACE_])
            of_impact = -p_n * 0.5 * (before[p] + u_n)
            of_friction = -p_t * 0.5 * (before[p + TANGENTIAL_] + u_t)
            friction += of_friction
            impact += of_impact
            sliding += frame[f + MU_] * abs(u_t) * p_n
            negative += min(of_friction + of_impact, 0.0)
            s_xx += virial[0]
            s_xy += virial[1]
            s_yx += virial[2]
            s_yy += virial[3]
            loaded += 1.0 if p_n > 0.0 else 0.0
            largest = max(largest, p_n)
            depth[lane] = (radii - sqrt(dx * dx + dy * dy)) / about[a + _SMALLER]
            deepest = max(deepest, depth[lane])
        sums = (
            sums[0] + friction, sums[1] + impact, sums[2] + sliding, sums[3] + negative,
            sums[4] + s_xx, sums[5] + s_xy, sums[6] + s_yx, sums[7] + s_yy, sums[8] + loaded,
            largest, deepest,
        )  # fmt: skip
    return sums


@vector_loop(results=SUMS)
def end_batches(
    code: Writer, first: _Value, last: _Value, middle: _Value, velocity: _Value, pair: _Value,
    about: _Value, frame: _Value, impulse: _Value, before: _Value, gap: _Value,
    half_step: _Value, period: _Value, half: _Value, depth: _Value,
) -> list[_Value]:  # fmt: skip
    """As `end_scalar`."""
    period, half = code.spread(period), code.spread(half)
    moves = code.masked(code.spread(half_step), (True, True, False, False))
    arrays = middle, velocity, pair, about, frame, impulse, before, gap

    def geometry(
        batch: _Value, places: Sequence[Sequence[Vector]], velocities: Sequence[Sequence[Vector]]
    ) -> _Geometry:
        ux, uy, spins, _ = _difference(code, velocities)
        ends = [
            [place + moves * v for place, v in zip(*side, strict=True)]
            for side in zip(places, velocities, strict=True)
        ]
        dx, dy, radii, _ = _difference(code, ends)
        nx, ny = code.block(frame, batch, FRAME_ROWS, NX, NY)
        (g,) = code.block(gap, batch, 1, 0)

        def virial(px: Vector, py: Vector) -> list[Vector]:
            length = radii + g
            return [px * length * nx, px * length * ny, py * length * nx, py * length * ny]

        return _Geometry(ux, uy, spins, _nearest(dx, period, half), dy, radii, virial)

    return _end(code, first, last, arrays, depth, geometry)


@vector_loop(results=SUMS)
def end_stretched_batches(
    code: Writer, first: _Value, last: _Value, middle: _Value, velocity: _Value, pair: _Value,
    about: _Value, frame: _Value, impulse: _Value, before: _Value, gap: _Value,
    half_step: _Value, branch: _Value, xx: _Value, yy: _Value, xy: _Value, depth: _Value,
) -> list[_Value]:  # fmt: skip
    """As `end_scalar` in a cell."""
    stretch, half_step = Stretch(code, branch, (xx, yy, xy)), code.spread(half_step)
    arrays = middle, velocity, pair, about, frame, impulse, before, gap

    def geometry(
        batch: _Value, places: Sequence[Sequence[Vector]], velocities: Sequence[Sequence[Vector]]
    ) -> _Geometry:
        ux, uy, spins, _ = _difference(code, velocities)
        _, _, radii, _ = _difference(code, places)
        lx, ly = stretch.branches(batch)
        sx, sy = stretch.of(lx, ly)
        ux, uy = ux + sx, uy + sy

        def virial(px: Vector, py: Vector) -> list[Vector]:
            return [px * lx, px * ly, py * lx, py * ly]

        dx, dy = lx + half_step * ux, ly + half_step * uy
        return _Geometry(ux, uy, spins, dx, dy, radii, virial)

    return _end(code, first, last, arrays, depth, geometry)


class _Geometry(NamedTuple):
    """Contacts of a batch: velocities v⁺ between centers, branch vectors at the end of the step."""

    ux: Vector
    uy: Vector
    spins: Vector
    dx: Vector
    dy: Vector
    radii: Vector
    virial: Callable[[Vector, Vector], list[Vector]]


def _end(
    code: Writer, first: _Value, last: _Value, arrays: Sequence[_Value], depth: _Value,
    geometry: Callable[..., _Geometry],
) -> list[_Value]:  # fmt: skip
    middle, velocity, pair, about, frame, impulse, before, _ = arrays
    zero, one, part = code.number(0.0), code.number(1.0), code.number(0.5)
    kept = code.keep([zero] * SUMS)
    with code.each(first, last) as batch:
        bodies = bodies_of(code, pair, batch)
        ux, uy, spins, dx, dy, radii, virial = geometry(
            batch, _rows(code, middle, bodies), _rows(code, velocity, bodies)
        )
        nx, ny, mu = code.block(frame, batch, FRAME_ROWS, NX, NY, MU)
        p_n, p_t = code.block(impulse, batch, IMPULSE_ROWS, NORMAL, TANGENTIAL)
        was_n, was_t = code.block(before, batch, IMPULSE_ROWS, NORMAL, TANGENTIAL)
        smaller, ours = code.block(about, batch, ABOUT_ROWS, SMALLER, IS_OURS)
        u_n, u_t = ux * nx + uy * ny, uy * nx - ux * ny - spins
        impact, friction = -p_n * part * (was_n + u_n), -p_t * part * (was_t + u_t)
        px, py = p_n * nx - p_t * ny, p_n * ny + p_t * nx
        deep = (radii - (dx * dx + dy * dy).root()) / smaller
        added = (
            friction, impact, mu * abs(u_t) * p_n, (friction + impact).smaller(zero),
            *virial(px, py), p_n.where(">", zero, one, zero), p_n, deep,
        )  # fmt: skip
        mine = [ours.where(">", zero, value, zero) for value in added]
        code.fill(depth, batch, 1, {0: mine[OVERLAP]})
        both = enumerate(zip(kept.get(), mine, strict=True))
        kept.put([b.larger(a) if k >= LARGEST else a + b for k, (a, b) in both])
    totals = kept.get()
    return [
        code.largest(vector) if k >= LARGEST else code.total(vector)
        for k, vector in enumerate(totals)
    ]


@loop_body
def _begin_vectors(
    first: int, last: int, middle: Floats, start: Floats, pair: Ints, about: Floats, frame: Floats,
    impulse: Floats, before: Floats, gap: Floats, dt: float, period: float, half: float,
    ratio: float, branch: Floats, height: float, tilt: float, xx: float, yy: float, xy: float,
) -> tuple[float, float, float, float, float, float]:  # fmt: skip
    if height > 0.0:
        return begin_stretched_batches(  # type: ignore[no-any-return]
            first, last, middle, start, pair, about, frame, impulse, before, gap, dt, period, ratio,
            branch, height, tilt, xx, yy, xy,
        )  # fmt: skip
    return begin_batches(  # type: ignore[no-any-return]
        first, last, middle, start, pair, about, frame, impulse, before, gap, dt, period, half,
        ratio,
    )  # fmt: skip


@loop_body
def _end_vectors(
    first: int, last: int, middle: Floats, velocity: Floats, pair: Ints, about: Floats,
    frame: Floats, impulse: Floats, before: Floats, gap: Floats, half_step: float, period: float,
    half: float, branch: Floats, xx: float, yy: float, xy: float, depth: Floats,
) -> tuple[
    float, float, float, float, float, float, float, float, float, float, float
]:  # fmt: skip
    if branch.size:
        return end_stretched_batches(  # type: ignore[no-any-return]
            first, last, middle, velocity, pair, about, frame, impulse, before, gap, half_step,
            branch, xx, yy, xy, depth,
        )  # fmt: skip
    return end_batches(  # type: ignore[no-any-return]
        first, last, middle, velocity, pair, about, frame, impulse, before, gap, half_step, period,
        half, depth,
    )  # fmt: skip


begin_lanes = _begin_vectors if HAS_VECTORS else begin_scalar
end_lanes = _end_vectors if HAS_VECTORS else end_scalar
