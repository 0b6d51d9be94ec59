"""Contacts of grains that are no discs, as heat sees them: spots at their points, and sides.

A point conducts as the contact of two spheres, as that of discs does (`engine/heat/hertz.py`), with
the radii of curvature there: a corner has that of its rounding, a side none (1/R = 0), and what is
sharp counts as rounded by `SHARP` times the radius of the grain. Corners that turn by less than
δ₀ = 17.3°, the angle below which the corners of walls are round, too (`engine/geometry/places.py`),
are those of a curve cut into pieces: there R = r + ½ (ℓ + ℓ′)/(2 sin ½δ) with the two sides ℓ, ℓ′,
which for a regular polygon is the radius of the circle around it, and a side between two such
corners is no side but a part of the curve. (Derived.)

Points of one side are one place: those of the same two pieces, or of a piece and the lines of
walls, with their ends, whose normals are one. The whole force makes its spot, with the mean of the
radii by force. It conducts as the spot does, or as the sides that lie on each other do
(`side_conductance`), whichever conducts more. Sides are pressed about the center of the forces,
between the outermost points that bear: the pressed length goes to 0 where one point bears all, so
that H is continuous; a gap between walls that one side lies on is not seen. Points of a curve are
one place if they are less than δ₀ apart. Pieces of a clump conduct each for itself.
"""

from __future__ import annotations

from math import inf, pi, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.contact.faces import pieces_of_key, point_key, rows_of_faces
from multicor_cli.engine.geometry.outlines import Point, touch_pieces
from multicor_cli.engine.geometry.pieces import (
    NORMAL_X,
    NORMAL_Y,
    Pieces,
    are_faces,
    farthest,
    pieces_met,
)
from multicor_cli.engine.geometry.places import RISE, Places, rows_in_corners
from multicor_cli.engine.geometry.radii import cup_radius, effective_radius, smaller_radius
from multicor_cli.engine.geometry.scene import Scene, known_geometry, pair_geometry
from multicor_cli.engine.heat.hertz import pressed_length, side_conductance
from multicor_cli.engine.jit.compile import kernel, subroutine
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.model.columns import RADIUS, TAIL_X, TAIL_Y, X, Y
from multicor_cli.model.model import Floats, Ints, Model
from multicor_cli.model.shapes import ShapeKind

_PLANE, _CIRCLE = int(ShapeKind.PLANE), int(ShapeKind.CIRCLE)
_DISC, _VERTEX = int(ShapeKind.DISC), int(ShapeKind.VERTEX)

SHARP = 0.01
"""Least radius of curvature of a corner over the radius of its grain, or of the one on a wall."""

# ---- What lasts with the grains


class Corners(NamedTuple):
    """Corners of `Pieces`, ``v`` of them, and ``n`` grains as heat sees them.

    Attributes:
        radius: Radius of curvature of each corner R [m], shape ``(v,)``; of walls not yet `SHARP`.
        is_curve: Whether it is that of a curve cut into pieces, shape ``(v,)``.
        is_side: Whether the edge that begins there is flat, no part of a curve, shape ``(v,)``.
        thickness: Of the grains [m], shape ``(n,)``.
        least: Least way from the center of a grain to a side [m], half its area over its perimeter:
            the center of a clump may lie on a side, or beyond; shape ``(n,)``.
    """

    radius: Floats
    is_curve: NDArray[np.bool_]
    is_side: NDArray[np.bool_]
    thickness: Floats
    least: Floats

    def resized(self, pieces: Pieces, factor: Floats) -> Corners:
        """Those of grains that have become larger by factors, shape ``(n,)``."""
        n = factor.size
        of_piece = np.repeat(factor, np.diff(pieces.piece[: n + 1]))
        of_corner = np.repeat(of_piece, np.diff(pieces.start[: of_piece.size + 1]))
        radius = self.radius.copy()
        radius[: of_corner.size] *= of_corner
        return self._replace(radius=radius, least=self.least * factor)


def corners_of(model: Model, pieces: Pieces) -> Corners:
    """Corners of a model with outlines and heat; ``pieces`` are at angle 0."""
    outlines, thermal = model.outlines, model.thermal
    assert outlines is not None
    assert thermal is not None
    counts = np.diff(pieces.start)
    of_piece = np.repeat(np.arange(counts.size), counts)
    before = np.arange(of_piece.size) - 1
    before[pieces.start[:-1]] = pieces.start[1:] - 1
    after = np.empty(before.size, np.int64)
    after[before] = np.arange(before.size)
    edge, normal = pieces.corner[after, :2] - pieces.corner[:, :2], pieces.corner[:, NORMAL_X:]
    turn = normal - normal[before]
    length = np.sqrt(edge[:, X] * edge[:, X] + edge[:, Y] * edge[:, Y])
    square = turn[:, X] * turn[:, X] + turn[:, Y] * turn[:, Y]  # of 2 sin ½δ
    bends = (counts[of_piece] > 2) & (square > 0.0) & (square < 2.0 * RISE)
    radius = pieces.rounding[of_piece].copy()
    radius[bends] += (0.5 * (length + length[before]))[bends] / np.sqrt(square[bends])
    grains = np.repeat(np.arange(model.grain_count), np.diff(outlines.start[outlines.piece]))
    radius[: grains.size] = np.maximum(radius[: grains.size], SHARP * model.grains.radius[grains])
    return Corners(
        radius, bends, ~(bends & bends[after]), thermal.surface / model.perimeter,
        0.5 * model.area / model.perimeter,
    )  # fmt: skip


def corners_of_discs(scene: Scene, pieces: Pieces, i: Ints, j: Ints) -> NDArray[np.int64]:
    """As `rows_in_corners`, without the pairs of grains that are no discs."""
    rows = np.flatnonzero(~rows_of_faces(pieces.is_face, i, j))
    return rows[rows_in_corners(scene, i[rows], j[rows])]


# ---- The points of a moment


class FacePoints(NamedTuple):
    """Where contacts of grains that are no discs touch; ``c`` contacts, of discs too.

    Attributes:
        key: Which point of its pair each is, −1 of discs and where there is none, shape ``(c,)``.
        head: The first contact of its place, likewise.
        pair: The first contact of its pair, likewise.
        radius: a* [m], likewise.
        is_side: Whether it is one of several of a side, likewise.
        breadth: Thickness of the thinner grain [m], likewise.
        way: d_i/λ_i + d_j/λ_j [m² K/W], likewise.
        normal: Unit normal from j to i, shape ``(c, 2)``; with what follows of points alone.
        gap: Gap [m], shape ``(c,)``.
        arm: From the center of i to the point [m], shape ``(c, 2)``.
        of_i: Its piece of i, shape ``(c,)``; and ``of_j``.
        together: Contacts in places with others, ascending.
    """

    key: Ints
    head: Ints
    pair: Ints
    radius: Floats
    is_side: NDArray[np.bool_]
    breadth: Floats
    way: Floats
    normal: Floats
    gap: Floats
    arm: Floats
    of_i: Ints
    of_j: Ints
    together: NDArray[np.int64]

    @classmethod
    def of(
        cls, scene: Scene, pieces: Pieces, corners: Corners, conductivity: Floats, i: Ints, j: Ints,
        key: Ints, radius: Floats,
    ) -> FacePoints:  # fmt: skip
        """Points in a scene; ``pieces`` lie there, ``radius`` is a* of discs [m], ``(c,)``."""
        count = i.size
        head = np.arange(count, dtype=np.int32)
        is_new = np.ones(count, np.bool_)
        is_new[1:] = (np.diff(i) != 0) | (np.diff(j) != 0)
        pair = head[is_new][np.cumsum(is_new) - 1]
        points = cls(
            key, head, pair, radius.copy(), np.zeros(count, np.bool_), np.zeros(count),
            np.zeros(count), np.zeros((count, 2)), np.full(count, inf), np.zeros((count, 2)),
            np.zeros(count, np.int32), np.zeros(count, np.int32), np.empty(0, np.int64),
        )  # fmt: skip
        _lay_points(scene, pieces, corners, conductivity, i, j, points)
        _join_points(scene, pieces, corners, i, j, points)
        count_of = np.bincount(points.head, minlength=count)
        return points._replace(together=np.flatnonzero(count_of[points.head] > 1))

    def join(self, places: Places) -> Places:
        """These places beside those of discs."""
        rows = self.together
        place = np.searchsorted(rows, self.head[rows]) + places.rows.size
        return Places(
            np.concatenate([places.rows, rows]),
            np.concatenate([places.place, place]).astype(np.int32),
        )

    def or_of_discs(
        self, scene: Scene, i: Ints, gap: Floats, normal: Floats
    ) -> tuple[Floats, Floats, Floats]:
        """Gaps, normals and arms of the points, and where there are none those of discs."""
        is_point = self.key >= 0
        gap = np.where(is_point, self.gap, gap)
        normal = np.where(is_point[:, np.newaxis], self.normal, normal)
        of_discs = -scene.radius[i][:, np.newaxis] * normal
        return gap, normal, np.where(is_point[:, np.newaxis], self.arm, of_discs)

    def lead_to_walls(self, is_wall: NDArray[np.bool_], branch: Floats) -> None:
        """From where points touch walls to the centers, into ``branch`` [m], **modified**."""
        row = np.flatnonzero(is_wall & (self.key >= 0))
        branch[row] = self.gap[row][:, np.newaxis] * self.normal[row] - self.arm[row]

    def per_pair(self, values: Floats) -> Floats:
        """Sums over pairs, at their first contacts, 0 at others, shape ``(c,)``."""
        return _sums(self.pair, values)

    def shared(self, of_pairs: Floats, carried: Floats) -> Floats:
        """What pairs have at their first contacts, shared out as ``carried``, shape ``(c,)``."""
        total = self.per_pair(carried)[self.pair]
        is_loaded = total > 0.0
        share = np.where(is_loaded, carried / np.where(is_loaded, total, 1.0), 0.0)
        return np.where(is_loaded, share * of_pairs[self.pair], of_pairs)

    def spot_radii(self, force: Floats, total: Floats) -> Floats:
        """a* of each place under the forces of its contacts [N], shape ``(c,)``."""
        found, rows = self.radius.copy(), self.together
        rows = rows[total[rows] > 0.0]
        weighted = _sums(self.head, force * self.radius)
        found[rows] = weighted[self.head[rows]] / total[rows]
        return found

    def pressed_areas(self, force: Floats) -> Floats:
        """Areas on which sides are pressed by forces [N] in [m²], shape ``(c,)``."""
        return _areas_of(force, self)

    def flash_radii(self, force: Floats, total: Floats, modulus: Floats) -> Floats:
        """As `spot_radii`, but where sides are pressed those whose spots have their area."""
        found = self.spot_radii(force, total)
        area = self.pressed_areas(force) / pi
        side = np.flatnonzero(area)
        volume = area[side] * np.sqrt(area[side])
        as_large = 4.0 * modulus[side] * volume / (3.0 * total[side])
        found[side] = np.maximum(found[side], as_large)
        return found

    def conduct_sides(
        self, force: Floats, total: Floats, harmonic: Floats,
        rough: tuple[()] | tuple[Floats, Floats, Floats],
        spot: Floats, conductance: Floats,
    ) -> None:  # fmt: skip
        """Let sides conduct; arguments as `hertz_spots`, ``rough`` as in `Touching`.

        Forces are those of the contacts and of their places [N]. **Modifies** ``spot``, of a side
        that of a circle of its pressed area, and ``conductance``.
        """
        area = self.pressed_areas(force)
        if area.any():
            smooth = np.zeros(area.size)
            about = rough or (smooth, smooth, smooth)
            _conduct_sides(area, total, self.way, harmonic, *about, spot, conductance)


@formula
def _blunted(scene: Scene, i: int, radius: float) -> float:
    """A radius of curvature [m] of grain i or of what it touches, at least that of a sharp one."""
    return float(max(radius, SHARP * scene.radius[i]))


@subroutine
def _facing(pieces: Pieces, p: int, x: float, y: float) -> int:
    """The edge of a piece whose normal is nearest to (x, y)."""
    best, most = pieces.start[p], -inf
    for v in range(pieces.start[p], pieces.start[p + 1]):
        along = x * pieces.corner[v, NORMAL_X] + y * pieces.corner[v, NORMAL_Y]
        if along > most:
            best, most = v, along
    return int(best)


@subroutine
def _edge_radius(pieces: Pieces, corners: Corners, p: int, edge: int) -> float:
    """Radius of curvature of an edge of a piece [m]; infinite of a side."""
    if corners.is_side[edge]:
        return inf
    after = edge + 1 if edge + 1 < pieces.start[p + 1] else pieces.start[p]
    return float(0.5 * (corners.radius[edge] + corners.radius[after]))


_ALONG = 1.0 - 1e-6
"""Least cosine of two directions that count as one: 1.4 mrad apart."""


@subroutine
def _radius_towards(pieces: Pieces, corners: Corners, p: int, x: float, y: float) -> float:
    """Radius of curvature of a piece where its outward normal is (x, y) [m]; infinite on sides."""
    first, last, corner = pieces.start[p], pieces.start[p + 1], pieces.corner
    if last - first == 1:
        return float(corners.radius[first])
    edge = _facing(pieces, p, x, y)
    if x * corner[edge, NORMAL_X] + y * corner[edge, NORMAL_Y] >= _ALONG:
        return _edge_radius(pieces, corners, p, edge)
    return float(corners.radius[farthest(pieces, p, x, y)])


@subroutine
def curve_towards(
    pieces: Pieces, corners: Corners, p: int, x: float, y: float
) -> tuple[float, float, float]:
    """As `_radius_towards`, of discs and of curves cut into pieces; −1 of all other corners.

    And the corner, or the middle of the edge, at which the outward normal is (x, y) [m].
    """
    v, corner = farthest(pieces, p, x, y), pieces.corner
    if pieces.start[p + 1] - pieces.start[p] == 1:
        radius = pieces.rounding[p] if pieces.rounding[p] > 0.0 else -1.0
        return radius, corner[v, X], corner[v, Y]
    edge = _facing(pieces, p, x, y)
    if x * corner[edge, NORMAL_X] + y * corner[edge, NORMAL_Y] >= _ALONG:
        w = edge + 1 if edge + 1 < pieces.start[p + 1] else pieces.start[p]
        middle_x = 0.5 * (corner[edge, X] + corner[w, X])
        middle_y = 0.5 * (corner[edge, Y] + corner[w, Y])
        return _edge_radius(pieces, corners, p, edge), middle_x, middle_y
    return corners.radius[v] if corners.is_curve[v] else -1.0, corner[v, X], corner[v, Y]


@formula
def _joined(radius: float, other: float) -> float:
    """a* of two radii of curvature [m], of which the second may be infinite; not both."""
    return radius if other == inf else effective_radius(radius, other)


@subroutine
def _wall_kind(scene: Scene, j: int) -> int:
    """Kind of a wall shape; −1 of a grain."""
    return int(scene.kind[j - scene.radius.size]) if j >= scene.radius.size else -1


@subroutine
def _enter_point(
    c: int, point: Point, scene: Scene, pieces: Pieces, corners: Corners, i: int, j: int,
    points: FacePoints,
) -> None:  # fmt: skip
    """Put a point into a row; one that is no more lies where the bounding circle would touch."""
    key = points.key[c]
    a, b, corner = pieces_of_key(pieces, scene, i, j, key)
    kind = _wall_kind(scene, j)
    points.of_i[c], points.of_j[c] = a, b
    own = _blunted(scene, i, corners.radius[corner])
    if point.gap < inf:
        nx, ny = point.nx, point.ny
        points.gap[c], points.arm[c, X], points.arm[c, Y] = point.gap, point.i_x, point.i_y
    else:
        points.gap[c], nx, ny = known_geometry(scene, i, j)
        points.arm[c, X], points.arm[c, Y] = -scene.radius[i] * nx, -scene.radius[i] * ny
    points.normal[c, X], points.normal[c, Y] = nx, ny
    if kind == _CIRCLE:
        points.radius[c] = cup_radius(own, scene.world[j - scene.radius.size, RADIUS])
    elif kind == _PLANE:
        points.radius[c] = own
    else:
        other = (
            _radius_towards(pieces, corners, b, nx, ny) if key % 2 == 0
            else _radius_towards(pieces, corners, a, -nx, -ny)
        )  # fmt: skip
        points.radius[c] = _joined(own, _blunted(scene, i, other))


@subroutine
def _is_line(scene: Scene, j: int) -> bool:
    """Whether a wall shape is a line, or the end of one."""
    shape = j - scene.radius.size
    if scene.kind[shape] != _VERTEX:
        return bool(scene.kind[shape] != _DISC)
    return bool(scene.world[shape, TAIL_X] >= 0.0 or scene.world[shape, TAIL_Y] >= 0.0)


@subroutine
def _may_join(c: int, k: int, scene: Scene, j: Ints, points: FacePoints) -> bool:
    """Whether two points of a grain are of the same piece, and of another, or of lines of walls."""
    count = scene.radius.size
    if points.of_i[c] != points.of_i[k] or (j[c] < count) != (j[k] < count):
        return False
    if j[c] < count:
        return bool(j[c] == j[k] and points.of_j[c] == points.of_j[k])
    return bool(j[c] == j[k] or (_is_line(scene, j[c]) and _is_line(scene, j[k])))


@subroutine
def _join(
    c: int, k: int, scene: Scene, pieces: Pieces, corners: Corners, j: Ints, points: FacePoints
) -> None:
    """Make two points of the same two pieces one place, if they are of one side or curve."""
    nx, ny = points.normal[c, X], points.normal[c, Y]
    cosine = nx * points.normal[k, X] + ny * points.normal[k, Y]
    nx, ny = nx + points.normal[k, X], ny + points.normal[k, Y]
    size, kind = sqrt(nx * nx + ny * ny), _wall_kind(scene, j[c])
    if cosine <= 1.0 - RISE:
        return
    nx, ny = nx / size, ny / size
    a, b = points.of_i[c], points.of_j[c]
    mine, other = _edge_radius(pieces, corners, a, _facing(pieces, a, -nx, -ny)), inf
    if kind < 0:
        other = _edge_radius(pieces, corners, b, _facing(pieces, b, nx, ny))
    if mine < inf or other < inf:
        radius = _joined(min(mine, other), max(mine, other))
        if kind == _CIRCLE:
            radius = cup_radius(mine, scene.world[j[c] - scene.radius.size, RADIUS])
        points.head[k] = c
        points.radius[c], points.radius[k] = radius, radius
    elif kind != _CIRCLE and cosine >= _ALONG:  # in a circle the corners of a side are apart
        points.head[k] = c
        points.is_side[c], points.is_side[k] = True, True


@subroutine
def _lead_through(
    c: int, point: Point, scene: Scene, corners: Corners, conductivity: Floats, i: int, j: int,
    points: FacePoints,
) -> None:  # fmt: skip
    """How thick a side is at a point, and the ways from the centers to it."""
    nx, ny, breadth = point.nx, point.ny, corners.thickness[i]
    way = max(abs(point.i_x * nx + point.i_y * ny), corners.least[i])
    resistance = way / conductivity[scene.material[i]]
    if j < scene.radius.size:
        breadth = min(breadth, corners.thickness[j])
        way = max(abs(point.j_x * nx + point.j_y * ny), corners.least[j])
        resistance += way / conductivity[scene.material[j]]
    points.breadth[c], points.way[c] = breadth, resistance


@kernel
def _lay_points(
    scene: Scene, pieces: Pieces, corners: Corners, conductivity: Floats, i: Ints, j: Ints,
    points: FacePoints,
) -> None:  # fmt: skip
    """Fill the rows of points: those of the keys, or what has become of them by now."""
    key = points.key
    is_done = key < 0
    for c in range(i.size):
        if is_done[c]:
            continue
        a, b, _ = pieces_of_key(pieces, scene, i[c], j[c], key[c])
        k = c + 1
        while k < i.size and i[k] == i[c] and j[k] == j[c]:
            if key[k] >= 0 and pieces_of_key(pieces, scene, i[k], j[k], key[k])[:2] == (a, b):
                break
            k += 1
        has_mate = k < i.size and i[k] == i[c] and j[k] == j[c]
        first, second = touch_pieces(pieces, scene, i[c], a, j[c], b)
        of_first, of_second = -1, -1
        if first.gap < inf:
            of_first = point_key(pieces, scene, i[c], a, j[c], b, first.corner)
        if second.gap < inf:
            of_second = point_key(pieces, scene, i[c], a, j[c], b, second.corner)
        is_second = key[c] == of_second or (has_mate and key[k] == of_first)
        if key[c] != of_first and (is_second or first.gap == inf):
            first, second = second, first
        row, point = c, first
        for _ in range(2 if has_mate else 1):
            _enter_point(row, point, scene, pieces, corners, i[row], j[row], points)
            _lead_through(row, point, scene, corners, conductivity, i[row], j[row], points)
            is_done[row] = True
            row, point = k, second


@kernel
def _join_points(
    scene: Scene, pieces: Pieces, corners: Corners, i: Ints, j: Ints, points: FacePoints
) -> None:
    """Places of the points."""
    key = points.key
    for c in range(i.size):
        if key[c] < 0 or points.head[c] != c:
            continue
        k = c + 1
        while k < i.size and i[k] == i[c]:
            if key[k] >= 0 and points.head[k] == k and _may_join(c, k, scene, j, points):
                _join(c, k, scene, pieces, corners, j, points)
            k += 1


@kernel
def _areas_of(force: Floats, points: FacePoints) -> Floats:
    """Areas on which sides are pressed [m²], 0 where there is none, shape ``(c,)``."""
    count, head, is_side, normal = force.size, points.head, points.is_side, points.normal
    total, moment, area = np.zeros(count), np.zeros(count), np.zeros(count)
    low, high = np.full(count, inf), np.full(count, -inf)
    for c in range(count):
        h = head[c]
        if is_side[c] and force[c] > 0.0:
            along = points.arm[c, Y] * normal[h, X] - points.arm[c, X] * normal[h, Y]
            total[h] += force[c]
            moment[h] += force[c] * along
            low[h], high[h] = min(low[h], along), max(high[h], along)
    for c in range(count):
        h = head[c]
        if is_side[c] and total[h] > 0.0:
            center = moment[h] / total[h]
            nearer = min(center - low[h], high[h] - center)
            area[c] = pressed_length(nearer, high[h] - low[h]) * points.breadth[h]
    return area


@kernel
def _conduct_sides(
    area: Floats, total: Floats, way: Floats, harmonic: Floats, roughness: Floats, slope: Floats,
    microhardness: Floats, spot: Floats, conductance: Floats,
) -> None:  # fmt: skip
    """Conductances of sides where they are more than those of spots; **modifies** the last two."""
    for c in range(area.size):
        if area[c] <= 0.0:
            continue
        of_side = side_conductance(
            total[c], area[c], way[c], harmonic[c], roughness[c], slope[c], microhardness[c]
        )
        conductance[c] = max(conductance[c], of_side)
        spot[c] = max(spot[c], sqrt(area[c] / pi))


def _sums(first: Ints, values: Floats) -> Floats:
    """Sums of the values that have the same ``first`` row, there, shape ``(c,)``."""
    return np.asarray(np.bincount(first, values, first.size), np.float64)


# ---- Pairs that touch before any step has said which do


@kernel
def points_at_rest(
    scene: Scene, pieces: Pieces, i: Ints, j: Ints, reach: float
) -> tuple[Ints, Ints, Ints]:
    """Points of pairs with gaps up to ``reach`` times the smaller radius: i, j and key.

    Discs have one, of the key −1.
    """
    room = 0
    for k in range(i.size):
        met = 1 if j[k] >= scene.radius.size else pieces.piece[j[k] + 1] - pieces.piece[j[k]]
        room += 2 * (pieces.piece[i[k] + 1] - pieces.piece[i[k]]) * met
    first, second = np.empty(room, np.int32), np.empty(room, np.int32)
    key, found = np.empty(room, np.int32), 0
    for k in range(i.size):
        limit = reach * smaller_radius(scene, i[k], j[k])
        if not are_faces(pieces, i[k], j[k]):
            first[found], second[found], key[found] = i[k], j[k], -1
            found += pair_geometry(scene, i[k], j[k])[0] <= limit
            continue
        start, end = pieces_met(pieces, scene, j[k])
        for a in range(pieces.piece[i[k]], pieces.piece[i[k] + 1]):
            for b in range(start, end):
                for point in touch_pieces(pieces, scene, i[k], a, j[k], b):
                    if point.gap <= limit:
                        first[found], second[found] = i[k], j[k]
                        key[found] = point_key(pieces, scene, i[k], a, j[k], b, point.corner)
                        found += 1
    return first[:found].copy(), second[:found].copy(), key[:found].copy()
