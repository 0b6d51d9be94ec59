"""How fast shapes can come closer: far slower than they move in a flow, where neighbors move alike.

The vectors of the grains (displacements, or velocities) are split into an affine field a + G x,
fitted by least squares, and the rest. Two discs at a distance D approach by |G| D and twice the
largest rest at most. In a sheared layer this does not depend on its height, which the largest speed
does.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from multicor_cli.engine.geometry.scene import Scene
from multicor_cli.engine.jit.arrays import CHUNK
from multicor_cli.engine.jit.compile import kernel, parallel_kernel, prange
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.model.columns import SPIN, TAIL_X, TAIL_Y, XX, XY, YY, X, Y
from multicor_cli.model.model import Floats, Ints
from multicor_cli.model.shapes import ShapeKind

# ---- Motions split into an affine field and a rest, by which alone shapes come nearer

_DISC = int(ShapeKind.DISC)
_PLANE = int(ShapeKind.PLANE)

AT_ORIGIN, PER_X, PER_Y = range(3)
"""Rows of a fit: the field at the first grain, its change per length in x and in y."""

_SUM_X, _SUM_Y, _SUM_XX, _SUM_XY, _SUM_YY, _SUM_U, _SUM_V, _SUM_XU, _SUM_XV, _SUM_YU, _SUM_YV = (
    range(11)
)
_DEVIATION, _LARGEST_U, _LARGEST_V = range(3)


class Box(NamedTuple):
    """How space repeats, and how a cell changes.

    Attributes:
        period: Period in x [m] or 0.
        height: Period in y [m] of a cell or 0.
        tilt: How far its images across the height lie to the right [m].
        xx: Gradient of what its images do, in units of the vectors; so are ``yy`` and ``xy``.
    """

    period: float
    height: float = 0.0
    tilt: float = 0.0
    xx: float = 0.0
    yy: float = 0.0
    xy: float = 0.0


class Drift(NamedTuple):
    """Vectors of the grains as an affine field and a rest.

    Attributes:
        center: Where the field is ``fit[0]``, shape ``(2,)``.
        fit: a, and the changes per length in x and in y, shape ``(3, 2)``.
        gradient: Bound of |G x|/|x| (Frobenius norm).
        rest: Largest deviation from the field.
        largest: Largest components in x and in y, shape ``(2,)``.
        is_whole: Whether these are those of images too.
    """

    center: Floats
    fit: Floats
    gradient: float
    rest: float
    largest: Floats
    is_whole: bool


@formula
def _vector(i: int, vectors: Floats, origin: Floats, box: Box) -> tuple[float, float]:
    """A vector itself, or its difference from ``origin``, nearest image."""
    if origin.shape[0] == 0:
        return vectors[i, X], vectors[i, Y]
    dx, dy = vectors[i, X] - origin[i, X], vectors[i, Y] - origin[i, Y]
    if box.height > 0.0:
        images = np.floor(dy / box.height + 0.5)
        dx, dy = dx - images * box.tilt, dy - images * box.height
    if box.period > 0.0:
        dx -= box.period * np.floor(dx / box.period + 0.5)
    return dx, dy


@formula
def _add_sums(
    first: int, last: int, vectors: Floats, origin: Floats, position: Floats, box: Box, row: int,
    out: Floats,
) -> None:  # fmt: skip
    """Write the sums of a chunk of grains. Numbers, not elements, are added to: 3 times faster."""
    sx, sy, sxx, sxy, syy, su, sv, sxu, sxv, syu, syv = (
        0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
    )  # fmt: skip
    for i in range(first, last):
        x, y = position[i, X] - position[0, X], position[i, Y] - position[0, Y]
        u, v = _vector(i, vectors, origin, box)
        sx += x
        sy += y
        sxx += x * x
        sxy += x * y
        syy += y * y
        su += u
        sv += v
        sxu += x * u
        sxv += x * v
        syu += y * u
        syv += y * v
    out[row, _SUM_X], out[row, _SUM_Y], out[row, _SUM_U], out[row, _SUM_V] = sx, sy, su, sv
    out[row, _SUM_XX], out[row, _SUM_XY], out[row, _SUM_YY] = sxx, sxy, syy
    out[row, _SUM_XU], out[row, _SUM_XV], out[row, _SUM_YU], out[row, _SUM_YV] = sxu, sxv, syu, syv


@formula
def _compare_with_fit(
    first: int, last: int, vectors: Floats, origin: Floats, position: Floats, box: Box, fit: Floats,
    row: int, out: Floats,
) -> None:  # fmt: skip
    """Write the largest square of a deviation from the fit, and the largest components."""
    a_x, a_y = fit[AT_ORIGIN, X], fit[AT_ORIGIN, Y]
    xx, xy, yx, yy = fit[PER_X, X], fit[PER_X, Y], fit[PER_Y, X], fit[PER_Y, Y]
    deviation, largest_u, largest_v = 0.0, 0.0, 0.0
    for i in range(first, last):
        x, y = position[i, X] - position[0, X], position[i, Y] - position[0, Y]
        u, v = _vector(i, vectors, origin, box)
        du = u - a_x - x * xx - y * yx
        dv = v - a_y - x * xy - y * yy
        deviation = max(deviation, du * du + dv * dv)
        largest_u = max(largest_u, abs(u))
        largest_v = max(largest_v, abs(v))
    out[row, _DEVIATION] = deviation
    out[row, _LARGEST_U], out[row, _LARGEST_V] = largest_u, largest_v


@formula
def _least_squares(count: int, sums: Floats, box: Box, fit: Floats) -> None:
    is_periodic = box.period > 0.0
    mean_x, mean_y = sums[0, _SUM_X] / count, sums[0, _SUM_Y] / count
    # A little more on the diagonal: places may lie on one line. Any fit is good for a bound.
    more = 1e-9 * (sums[0, _SUM_XX] + sums[0, _SUM_YY])
    more = more if more > 0.0 else 1.0
    xx = sums[0, _SUM_XX] - count * mean_x * mean_x + more
    yy = sums[0, _SUM_YY] - count * mean_y * mean_y + more
    xy = 0.0 if is_periodic else sums[0, _SUM_XY] - count * mean_x * mean_y
    for d in range(2):
        total = sums[0, _SUM_U + d]
        x = 0.0 if is_periodic else sums[0, _SUM_XU + d] - mean_x * total
        y = sums[0, _SUM_YU + d] - mean_y * total
        fit[PER_X, d] = (x * yy - y * xy) / (xx * yy - xy * xy)
        fit[PER_Y, d] = (y * xx - x * xy) / (xx * yy - xy * xy)
        if box.height > 0.0:
            fit[PER_X, d] = box.xx if d == X else 0.0
            fit[PER_Y, d] = box.xy if d == X else box.yy
        fit[AT_ORIGIN, d] = total / count - mean_x * fit[PER_X, d] - mean_y * fit[PER_Y, d]


@formula
def _fold(rows: Floats, is_maximum: bool) -> None:
    """Sum or maximum of each column into the first row, in order."""
    for r in range(1, rows.shape[0]):
        for k in range(rows.shape[1]):
            rows[0, k] = max(rows[0, k], rows[r, k]) if is_maximum else rows[0, k] + rows[r, k]


@parallel_kernel
def fit_drift(vectors: Floats, position: Floats, box: Box, origin: Floats) -> Drift:
    """Split vectors into an affine field, fitted by least squares, and a rest.

    ``vectors`` are in the first two columns; ``origin`` is taken from them, nearest image, if it
    has rows. With a period in x the field does not depend on x; in a cell it is that by which
    the cell changes, and no other would be that of all images.
    """
    count = position.shape[0]
    fit, out = np.empty((3, 2)), np.zeros((-(-count // CHUNK), 11))
    for has_fit in range(2):  # one loop for both passes compiles faster than two
        for chunk in prange(out.shape[0]):
            first, last = chunk * CHUNK, min(count, (chunk + 1) * CHUNK)
            if has_fit:
                _compare_with_fit(first, last, vectors, origin, position, box, fit, chunk, out)
            else:
                _add_sums(first, last, vectors, origin, position, box, chunk, out)
        _fold(out, has_fit == 1)
        if not has_fit:
            _least_squares(count, out, box, fit)
    squares = 0.0
    for d in range(2):
        squares += fit[PER_X, d] * fit[PER_X, d] + fit[PER_Y, d] * fit[PER_Y, d]
    center, largest = np.empty(2), np.empty(2)
    for d in range(2):
        center[d], largest[d] = position[0, d], out[0, _LARGEST_U + d]
    return Drift(center, fit, sqrt(squares), sqrt(out[0, _DEVIATION]), largest, box.height == 0.0)


# ---- Bounds of approach


class ApproachBound(NamedTuple):
    """Bounds on how fast shapes come closer.

    Two discs: ``rest``, and ``gradient`` times the distance of their centers, or ``disc`` at any
    distance. A grain and a wall shape that is not a disc: ``wall``.
    """

    rest: float
    gradient: float
    disc: float
    wall: float


@kernel
def bound_approach(
    kind: Ints, drift: Drift, world: Floats, vectors: Floats, turn: Floats
) -> ApproachBound:
    """Bounds of grains and wall shapes together.

    ``vectors`` are displacements or velocities of the reference points of wall shapes, shape
    ``(m, 2)``; ``turn``, shape ``(m,)``, is what turning adds to the motion of any of their points
    that a grain may meet (discs do without). Of planes only what is along their normal counts.
    """
    center, fit, largest = drift.center, drift.fit, drift.largest
    square, fastest, wall = 0.0, 0.0, 0.0
    for k in range(kind.size):
        u, v = vectors[k, X], vectors[k, Y]
        if kind[k] == _DISC:
            x, y = world[k, X] - center[X], world[k, Y] - center[Y]
            du = u - fit[AT_ORIGIN, X] - x * fit[PER_X, X] - y * fit[PER_Y, X]
            dv = v - fit[AT_ORIGIN, Y] - x * fit[PER_X, Y] - y * fit[PER_Y, Y]
            square, fastest = max(square, du * du + dv * dv), max(fastest, u * u + v * v)
        elif kind[k] == _PLANE:
            nx, ny = world[k, TAIL_X], world[k, TAIL_Y]
            wall = max(
                wall, abs(nx) * largest[X] + abs(ny) * largest[Y] + abs(nx * u + ny * v) + turn[k]
            )
        else:
            wall = max(
                wall,
                np.sqrt(largest[X] * largest[X] + largest[Y] * largest[Y])
                + np.sqrt(u * u + v * v)
                + turn[k],
            )
    own = np.sqrt(largest[X] * largest[X] + largest[Y] * largest[Y])
    rest = max(drift.rest, np.sqrt(square))
    disc = max(own, np.sqrt(fastest)) if drift.is_whole else np.inf
    return ApproachBound(2.0 * rest, drift.gradient, 2.0 * disc, wall)


@formula
def approach_over(bound: ApproachBound, distance: float) -> float:
    """Bound for discs whose centers are ``distance`` [m] apart, and for walls."""
    return max(min(bound.rest + bound.gradient * distance, bound.disc), bound.wall)


@formula
def closing_gap(bound: ApproachBound, dt: float, diameter: float) -> float:
    """Gap [m] that no pair closes in ``dt``, from velocities; discs up to ``diameter`` [m]."""
    growth, cutoff = dt * bound.gradient, dt * bound.disc
    if growth < 1.0:
        cutoff = min(cutoff, dt * (bound.rest + bound.gradient * diameter) / (1.0 - growth))
    return max(cutoff, dt * bound.wall)


@formula
def _norm(gradient: Floats) -> float:
    """Frobenius norm of the gradient of a cell."""
    xx, yy, xy = gradient[XX], gradient[YY], gradient[XY]
    return sqrt(xx * xx + yy * yy + xy * xy)


@parallel_kernel
def cutoff_of_velocities(
    scene: Scene, bodies: Floats, more: Floats, first: Floats, second: Floats, extent: Floats,
    dt: float, diameter: float,
) -> float:  # fmt: skip
    """A gap that no pair closes in ``dt`` [m].

    Velocities of grains are those of ``bodies``, grains first, or differ from them by up to
    ``more``, shape ``(2,)``; those of walls ``first`` or ``second``, shape ``(w, 3)``. ``extent``
    is how far the shapes of a wall reach from its reference point [m], shape ``(w,)``.
    """
    period, height, tilt = scene.period, scene.height, scene.tilt
    # Velocities of grains in a cell are those beside its mean flow
    nothing, box = np.empty((0, 2)), Box(period, height, tilt, 0.0, 0.0, 0.0)
    drift = fit_drift(bodies, scene.position, box, nothing)
    largest = drift.largest + more
    rest = drift.rest + np.sqrt(more[X] * more[X] + more[Y] * more[Y])
    gradient = drift.gradient
    if height > 0.0:
        gradient = max(_norm(first[0]), _norm(second[0]))
    wider = Drift(drift.center, drift.fit, gradient, rest, largest, drift.is_whole)
    count, cutoff = scene.kind.size, 0.0
    vectors, turn = np.empty((count, 2)), np.empty(count)
    for velocity in (first, second):
        for k in range(count):
            w = scene.wall[k]
            spin = velocity[w, SPIN]
            vectors[k, X], vectors[k, Y] = velocity[w, X], velocity[w, Y]
            turn[k] = abs(spin) * extent[w]
            if scene.kind[k] == _DISC:
                vectors[k, X] -= spin * (scene.world[k, Y] - scene.wall_position[w, Y])
                vectors[k, Y] += spin * (scene.world[k, X] - scene.wall_position[w, X])
        bound = bound_approach(scene.kind, wider, scene.world, vectors, turn)
        cutoff = max(cutoff, closing_gap(bound, dt, diameter))
    return cutoff


@parallel_kernel
def approach_of_displacements(
    kind: Ints, position: Floats, reference: Floats, box: Box, before: Floats, now: Floats,
    extent: float, distance: float,
) -> float:  # fmt: skip
    """How much closer pairs may have come that were ``distance`` [m] apart, or walls [m].

    Grains have gone from ``reference`` to ``position``, nearest image; wall shapes from ``before``
    to ``now``, shape ``(m, 4)``; ``extent`` bounds the distance of grains from the points of planes
    [m].
    """
    drift = fit_drift(position, reference, box, reference)
    moved, turn = np.empty((kind.size, 2)), np.zeros(kind.size)
    largest = np.sqrt(drift.largest[X] * drift.largest[X] + drift.largest[Y] * drift.largest[Y])
    for k in range(kind.size):
        moved[k, X], moved[k, Y] = now[k, X] - before[k, X], now[k, Y] - before[k, Y]
        if kind[k] == _DISC:
            continue
        du, dv = now[k, TAIL_X] - before[k, TAIL_X], now[k, TAIL_Y] - before[k, TAIL_Y]
        turn[k] = np.sqrt(du * du + dv * dv)
        if kind[k] == _PLANE:  # one that tilts moves in proportion to the distance from its point
            own = np.sqrt(moved[k, X] * moved[k, X] + moved[k, Y] * moved[k, Y])
            turn[k] *= extent + own + largest
    return approach_over(bound_approach(kind, drift, before, moved, turn), distance)
