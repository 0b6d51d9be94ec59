"""Gas between grains that are no discs, and between these and walls: parallel flux over outlines.

Formula: heat crosses the gap g(x) of two outlines that face each other straight along the normal of
their nearest point, and comes to it through the solids as to a side that lies on another
(`engine/heat/hertz.py`):

``H = λ_f b ∫ dx/(g(x) + y + e)``, ``e = λ_f (d_i/λ_i + d_j/λ_j)``

over all x where one faces the other, with the thickness b of the thinner grain, the ways d from the
centers straight to the surfaces (0 of a wall), and the distance y of the mean planes of rough
sides. Lines face each other in closed form; what has arcs is integrated by Gauss' rule, with nodes
as close as the gap is narrow.

What is a disc, or a curve cut into pieces (`engine/heat/faces.py`), counts as a sphere against a
curve or a side, as everywhere in heat: there *parallel* is that of `engine/heat/gas.py`, each half
of it as far as both outlines reach. A circle of a wall is hollow for all other shapes.

Sides that lie on each other conduct by their asperities and by the gas between these, both in
series with the ways d: ``H = S P/(S + P)`` with what a perfect joint conducts, P = b l/(d_i/λ_i +
d_j/λ_j), and ``S = H_c P/(P − H_c) + H_f P/(P − H_f)`` of contact and film. (Derived.)

Source: as *parallel* of `engine/heat/gas.py`; y = 1.53 σ (p/H')^−0.097 of M. M. Yovanovich, IEEE
Trans. Compon. Packag. Technol. 28 (2005) 182, at p/H' = 10⁻⁵, the lightest load that it holds for.

Validity: that of *parallel*. In a steady state blocks of one width with gas between them are
exactly a bar. Pieces of a clump have a film each: where they overlap, an upper estimate.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import NamedTuple

import numpy as np

from multicor_cli.arithmetic import exp, log, log1p
from multicor_cli.engine.geometry.outlines import Point, touch_pieces
from multicor_cli.engine.geometry.pieces import NORMAL_X, NORMAL_Y, Pieces, farthest, pieces_met
from multicor_cli.engine.geometry.radii import smaller_radius
from multicor_cli.engine.geometry.scene import Scene, from_first_end, nearest_image, shortest
from multicor_cli.engine.heat.faces import Corners, curve_towards
from multicor_cli.engine.heat.gas import CORE, SMALLEST_SPOT, parallel_between
from multicor_cli.engine.heat.mechanism import HeatLaws, Rows
from multicor_cli.engine.jit.compile import kernel, subroutine
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.model.columns import RADIUS, TAIL_X, TAIL_Y, X, Y
from multicor_cli.model.model import Floats, Ints
from multicor_cli.model.shapes import ShapeKind

_PLANE, _CIRCLE = int(ShapeKind.PLANE), int(ShapeKind.CIRCLE)
_SEGMENT, _SIDE = int(ShapeKind.SEGMENT), int(ShapeKind.SIDE)

SEPARATION = 4.67
"""Mean planes of rough sides are so many σ apart: 1.53 (10⁻⁵)^−0.097."""

# ---- What of an outline faces a direction: lines and arcs, one after the other

_LINE, _ARC, _HOLLOW = 0.0, 1.0, -1.0
_FROM, _TO, _KIND, _AT, _HEIGHT, _BEND = 0, 1, 2, 3, 4, 5
"""Columns of a part of a chain [m]: first and last place u, what it is, a place and its height
(those of the center of an arc), and the slope of a line or the radius of an arc."""


_EDGE_ON = 1e-9
"""Cosine to the view up to which a side is seen from its edge: as a line without width it would
have no slope."""


class _View(NamedTuple):
    """A unit vector (x, y) along which heights are, places u along (−y, x); and the origin of a
    body (ox, oy) [m].
    """

    x: float
    y: float
    ox: float
    oy: float


@formula
def _place(view: _View, x: float, y: float) -> float:
    return (view.oy + y) * view.x - (view.ox + x) * view.y


@formula
def _height(view: _View, x: float, y: float) -> float:
    return (view.ox + x) * view.x + (view.oy + y) * view.y


@subroutine
def _add(
    chain: Floats, count: int, first: float, last: float, kind: float, at: float, height: float,
    bend: float,
) -> int:  # fmt: skip
    """Put a part at the end of a chain, unless it has no length; returns how many there are."""
    if not last > first:
        return count
    chain[count, _FROM], chain[count, _TO], chain[count, _KIND] = first, last, kind
    chain[count, _AT], chain[count, _HEIGHT], chain[count, _BEND] = at, height, bend
    return count + 1


@subroutine
def _trace(pieces: Pieces, p: int, view: _View, chain: Floats) -> int:
    """The chain of a piece that faces the view, by ascending places; returns its length."""
    corner, r = pieces.corner, pieces.rounding[p]
    first, last = pieces.start[p], pieces.start[p + 1]
    edge, v = -1, first
    for e in range(first, last):
        before = e - 1 if e > first else last - 1
        faces = corner[e, NORMAL_X] * view.x + corner[e, NORMAL_Y] * view.y
        faced = corner[before, NORMAL_X] * view.x + corner[before, NORMAL_Y] * view.y
        if faces > _EDGE_ON >= faced:
            edge = e
        if _height(view, corner[e, X], corner[e, Y]) > _height(view, corner[v, X], corner[v, Y]):
            v = e
    count, leans = 0, -1.0
    if edge >= 0:
        v = edge
        while True:
            nx, ny = corner[v, NORMAL_X], corner[v, NORMAL_Y]
            if nx * view.x + ny * view.y <= _EDGE_ON:
                break
            w = v + 1 if v + 1 < last else first
            u = _place(view, corner[v, X], corner[v, Y])
            height = _height(view, corner[v, X], corner[v, Y])
            along, up = ny * view.x - nx * view.y, nx * view.x + ny * view.y
            count = _add(chain, count, u + r * leans, u + r * along, _ARC, u, height, r)
            to = _place(view, corner[w, X], corner[w, Y])
            slope = (_height(view, corner[w, X], corner[w, Y]) - height) / (to - u)
            count = _add(
                chain, count, u + r * along, to + r * along, _LINE, u + r * along,
                height + r * up, slope,
            )  # fmt: skip
            v, leans = w, along
    u = _place(view, corner[v, X], corner[v, Y])
    height = _height(view, corner[v, X], corner[v, Y])
    return _add(chain, count, u + r * leans, u + r, _ARC, u, height, r)


@subroutine
def _at(chain: Floats, k: int, u: float) -> float:
    """Height of a part of a chain at a place."""
    away = u - chain[k, _AT]
    if chain[k, _KIND] == _LINE:
        return float(chain[k, _HEIGHT] + chain[k, _BEND] * away)
    r = chain[k, _BEND]
    return float(chain[k, _HEIGHT] + chain[k, _KIND] * sqrt(max((r - away) * (r + away), 0.0)))


# ---- Integrals of 1/gap

_NODES = (
    0.14887433898163122, 0.4333953941292472, 0.6794095682990244, 0.8650633666889845,
    0.9739065285171717,
)  # fmt: skip
_WEIGHTS = (
    0.29552422471475287, 0.26926671930999635, 0.21908636251598204, 0.1494513491505806,
    0.06667134430868814,
)  # fmt: skip
"""Of Gauss' rule with ten nodes on (−1, 1), which are those and their opposites."""


@formula
def between_lines(length: float, gap: float, other: float) -> float:
    """``∫ dx/g`` of a gap that goes from one value to another linearly [m]; 1 of equal ones."""
    rise = (other - gap) / gap
    return length / gap * (log1p(rise) / rise if rise != 0.0 else 1.0)


@subroutine
def _over(
    mine: Floats, a: int, other: Floats, b: int, first: float, last: float, more: float
) -> float:
    """``∫ du/(g + more)`` between a part of a chain and one of the chain of what it faces."""
    gap = more - _at(mine, a, first) - _at(other, b, -first)
    to = more - _at(mine, a, last) - _at(other, b, -last)
    if mine[a, _KIND] == _LINE and other[b, _KIND] == _LINE:
        return float(between_lines(last - first, gap, to))
    # Nodes u = near + w sinh v: 1/g has a peak as wide as w where it is narrow
    near, narrow, way = (first, gap, last - first) if gap <= to else (last, to, first - last)
    bent = 0.0
    bent += 1.0 / mine[a, _BEND] if mine[a, _KIND] != _LINE else 0.0
    bent += other[b, _KIND] / other[b, _BEND] if other[b, _KIND] != _LINE else 0.0
    length, width = abs(way), abs(way)
    if bent > 0.0:
        width = min(width, sqrt(2.0 * narrow / bent))
    elif to != gap:
        width = min(width, max(narrow * length / abs(to - gap), 1e-6 * length))
    far = length / width
    most, found = log(far + sqrt(1.0 + far * far)), 0.0
    for k in range(5):
        for side in (-1.0, 1.0):
            grown = exp(0.5 * most * (1.0 + side * _NODES[k]))
            u = near + (width if way > 0.0 else -width) * 0.5 * (grown - 1.0 / grown)
            open_gap = more - _at(mine, a, u) - _at(other, b, -u)
            found += _WEIGHTS[k] * width * 0.5 * (grown + 1.0 / grown) / open_gap
    return 0.5 * most * found


@subroutine
def _along(
    mine: Floats, count: int, other: Floats, met: int, at: float, more: float
) -> tuple[float, float]:
    """``∫ du/(g + more)`` over all places at which chains face each other, and their length [m].

    The gap is narrowest at the place ``at``; those of the other chain run the other way.
    """
    found, length, a, b = 0.0, 0.0, 0, met - 1
    while a < count and b >= 0:
        first = max(mine[a, _FROM], -other[b, _TO])
        last = min(mine[a, _TO], -other[b, _FROM])
        if last > first:
            length += last - first
            if first < at < last:
                found += _over(mine, a, other, b, first, at, more)
                found += _over(mine, a, other, b, at, last, more)
            else:
                found += _over(mine, a, other, b, first, last, more)
        if mine[a, _TO] < -other[b, _FROM]:
            a += 1
        else:
            b -= 1
    return found, length


# ---- A piece of a grain and what it faces


class Film(NamedTuple):
    """A gas: λ_f [W/(m K)], and the largest gap that it crosses over the smaller radius."""

    conductivity: float
    reach: float


@subroutine
def _reach_along(pieces: Pieces, p: int, x: float, y: float) -> float:
    """How far a piece reaches from the center of its grain along (x, y) [m]."""
    v = farthest(pieces, p, x, y)
    return float(pieces.corner[v, X] * x + pieces.corner[v, Y] * y + pieces.rounding[p])


@subroutine
def _to_shape(scene: Scene, i: int, shape: int) -> tuple[float, float]:
    """From the center of grain i to the origin of the corners of a wall shape [m]."""
    x, y, world = scene.position[i, X], scene.position[i, Y], scene.world
    if scene.kind[shape] in (_SEGMENT, _SIDE):
        dx = from_first_end(x, world[shape, X], world[shape, TAIL_X], scene.period)
    else:
        dx = nearest_image(x - world[shape, X], scene.period)
    if scene.kind[shape] in (_PLANE, _CIRCLE):  # they have no corners: their point, or center
        return -dx, world[shape, Y] - y
    return -(dx + world[shape, X]), -y


@subroutine
def _facing_line(pieces: Pieces, scene: Scene, a: int, shape: int, ox: float, oy: float) -> Point:
    """The point of a piece that is nearest to the line of a wall, wherever this ends.

    Its normal leads to the side of the line on which the piece is.
    """
    if scene.kind[shape] == _PLANE:
        nx, ny = scene.world[shape, TAIL_X], scene.world[shape, TAIL_Y]
        away = -(ox * nx + oy * ny)
        reach = _reach_along(pieces, a, -nx, -ny)
    else:
        v = pieces.start[pieces.piece[scene.radius.size + shape]]
        nx, ny = pieces.corner[v, NORMAL_X], pieces.corner[v, NORMAL_Y]
        away = -((ox + pieces.corner[v, X]) * nx + (oy + pieces.corner[v, Y]) * ny)
        reach, behind = _reach_along(pieces, a, -nx, -ny), _reach_along(pieces, a, nx, ny)
        if -away - behind > away - reach:
            nx, ny, away, reach = -nx, -ny, -away, behind
    low, r = farthest(pieces, a, -nx, -ny), pieces.rounding[a]
    x, y = pieces.corner[low, X] - r * nx, pieces.corner[low, Y] - r * ny
    return Point(nx, ny, away - reach, x, y, 0.0, 0.0, np.int64(low))


@subroutine
def _film(
    scene: Scene, pieces: Pieces, corners: Corners, laws: HeatLaws, gas: Film, apart: float,
    spot: float, i: int, a: int, j: int, b: int, mine: Floats, other: Floats,
) -> tuple[float, float]:  # fmt: skip
    """Conductances of the gas between two pieces and of a perfect joint there [W/K].

    ``apart`` is y [m], ``spot`` the radius of the contact [m]; ``mine`` and ``other`` are room.
    """
    count, shape = scene.radius.size, j - scene.radius.size
    kind = scene.kind[shape] if shape >= 0 else -1
    if shape >= 0:
        ox, oy = _to_shape(scene, i, shape)
        b = pieces.piece[j]
    else:
        ox, oy = shortest(
            scene.position[j, X] - scene.position[i, X],
            scene.position[j, Y] - scene.position[i, Y],
            scene.period, scene.height, scene.tilt,
        )  # fmt: skip
    is_line = kind in (_PLANE, _SEGMENT, _SIDE)
    if is_line:
        point = _facing_line(pieces, scene, a, shape, ox, oy)
    else:
        point = touch_pieces(pieces, scene, i, a, j, b)[0]
    if not point.gap <= gas.reach * smaller_radius(scene, i, j):
        return 0.0, 0.0
    nx, ny = point.nx, point.ny
    parts = _trace(pieces, a, _View(-nx, -ny, 0.0, 0.0), mine)
    view = _View(nx, ny, ox, oy)
    if kind == _PLANE:
        met = _add(other, 0, -inf, inf, _LINE, 0.0, _height(view, 0.0, 0.0), 0.0)
    elif kind == _CIRCLE:
        radius, center = scene.world[shape, RADIUS], _place(view, 0.0, 0.0)
        met = _add(
            other, 0, center - radius, center + radius, _HOLLOW, center,
            _height(view, 0.0, 0.0), radius,
        )  # fmt: skip
    else:
        met = _trace(pieces, b, view, other)
    if parts == 0 or met == 0:
        return 0.0, 0.0
    at = point.i_x * ny - point.i_y * nx
    material, facing = scene.material[i], scene.material[j]
    is_plane = is_line or kind == _CIRCLE
    bent, x, y = curve_towards(pieces, corners, a, -nx, -ny)
    bent_too, x_too, y_too = inf, 0.0, 0.0
    if not is_plane:
        bent_too, x_too, y_too = curve_towards(pieces, corners, b, nx, ny)
    if bent > 0.0 and bent_too > 0.0 and min(bent, bent_too) < inf:
        at = _place(_View(-nx, -ny, 0.0, 0.0), x, y)
        if bent == inf:
            at = -_place(view, x_too, y_too)
        low = at - max(mine[0, _FROM], -other[met - 1, _TO])
        high = min(mine[parts - 1, _TO], -other[0, _FROM]) - at
        core = gas.conductivity / laws.harmonic[material, facing]
        between = 0.0
        for far, near in ((low, -high), (high, -low)):
            between += 0.5 * _of_spheres(
                gas.conductivity, bent, bent_too, max(near, 0.0), far, core, spot,
                max(point.gap, 0.0),
            )  # fmt: skip
        return between, 0.0
    breadth = corners.thickness[i]
    way = max(_reach_along(pieces, a, -nx, -ny), corners.least[i]) / laws.conductivity[material]
    if j < count:
        breadth = min(breadth, corners.thickness[j])
        through = max(_reach_along(pieces, b, nx, ny), corners.least[j])
        way += through / laws.conductivity[facing]
    inner = gas.conductivity * way
    integral, length = _along(
        mine, parts, other, met, at, max(-point.gap, 0.0) + apart + inner
    )  # fmt: skip
    return gas.conductivity * breadth * integral, breadth * length / way


@formula
def _of_spheres(
    gas_conductivity: float, radius: float, other: float, near: float, far: float, contrast: float,
    spot: float, gap: float,
) -> float:  # fmt: skip
    """As `parallel_between`, with a core as there, between two distances from the axis [m]."""
    is_plane = max(radius, other) == inf
    small = min(radius, other)
    mean = small if is_plane else 2.0 * radius * other / (radius + other)
    inner = max(spot, mean * min(CORE, contrast), SMALLEST_SPOT, near)
    rim = min(far, small)
    if inner >= rim:
        return 0.0
    between = parallel_between(gas_conductivity, mean, inner, rim, gap if is_plane else 0.5 * gap)
    return 2.0 * between if is_plane else between


@kernel
def film_conductances(
    scene: Scene, pieces: Pieces, corners: Corners, laws: HeatLaws, gas: Film, is_rough: bool,
    rows: Rows, i: Ints, j: Ints, spot: Floats, of_sides: Floats, out: Floats,
) -> None:  # fmt: skip
    """Add the conductance of the gas between pairs to ``out`` [W/K]: those in ``rows``.

    Radii of spots [m], and what sides that lie on each other conduct [W/K], are 0 where there is no
    contact; shapes are ``(e,)``.
    """
    most = 0
    for p in range(pieces.start.size - 1):
        most = max(most, pieces.start[p + 1] - pieces.start[p])
    mine, other = np.empty((2 * most + 1, 6)), np.empty((2 * most + 1, 6))
    for k in rows:
        a, b = scene.material[i[k]], scene.material[j[k]]
        apart = SEPARATION * laws.roughness[a, b] if is_rough else 0.0
        first, last = pieces_met(pieces, scene, j[k])
        film, perfect = 0.0, 0.0
        for p in range(pieces.piece[i[k]], pieces.piece[i[k] + 1]):
            for q in range(first, last):
                found, joint = _film(
                    scene, pieces, corners, laws, gas, apart, spot[k], i[k], p, j[k], q, mine,
                    other,
                )  # fmt: skip
                film += found
                perfect += joint
        out[k] += film if of_sides[k] <= 0.0 else _beside(of_sides[k], film, perfect)


@formula
def _beside(contact: float, film: float, perfect: float) -> float:
    """What a film of gas adds to sides that lie on each other [W/K], with the ways inside."""
    if contact >= perfect:
        return 0.0
    if film >= perfect:
        return perfect - contact
    both = contact * perfect / (perfect - contact) + film * perfect / (perfect - film)
    return max(both * perfect / (both + perfect) - contact, 0.0)
