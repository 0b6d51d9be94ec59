"""Points at which pieces with corners touch each other and walls, against plain distances."""

import numpy as np
import pytest
from entries import entry
from shapes import box, convex, disc, regular, rod, shaped_model, wall_line

from multicor_cli.engine.geometry import outlines
from multicor_cli.engine.geometry.pieces import pieces_of, turned
from multicor_cli.engine.geometry.scene import scene_of
from multicor_cli.model.shapes import ShapeKind

touch, touch_pieces, touch_wall, true_gap, gap_at_least = map(
    entry,
    (
        outlines.touch, outlines.touch_pieces, outlines.touch_wall, outlines.true_gap,
        outlines.gap_at_least,
    ),
)  # fmt: skip

SIDES = (1, 2, 3, 4, 5, 7, 20)
TINY = 1e-12


class Placed:
    """Pieces of grains, wherever these are."""

    def __init__(self, grains, shapes=(), period=0.0):
        self.model = shaped_model(grains, shapes, ("wall",) if shapes else (), period=period)
        self.pieces = pieces_of(self.model)

    def at(self, *places, wall=(0.0, 0.0, 0.0)):
        """Pieces and scene with the grains at x, y and an angle each."""
        frames = np.array([wall] * self.model.wall_count, float).reshape(-1, 3)
        scene = scene_of(self.model, np.array(places, float), frames)
        return turned(self.pieces, scene), scene


def core(pieces, piece, place=(0.0, 0.0)):
    """Corners of a piece in the world."""
    return pieces.corner[pieces.start[piece] : pieces.start[piece + 1], :2] + place[:2]


def lever_i(point):
    return np.array([point.i_x, point.i_y])


def lever_j(point):
    return np.array([point.j_x, point.j_y])


def edges(corners):
    return list(zip(corners, np.roll(corners, -1, axis=0), strict=True))


def from_segment(point, a, b):
    way = b - a
    square = way @ way
    share = np.clip((point - a) @ way / square, 0.0, 1.0) if square else 0.0
    return np.hypot(*(point - a - share * way))


def from_core(point, corners):
    """Distance of a point from the boundary of a core."""
    return min(from_segment(point, a, b) for a, b in edges(corners))


def separation(one, other):
    """Largest gap between the projections of two cores on a normal of one of their edges."""
    best = -np.inf
    for first, second in ((one, other), (other, one)):
        for a, b in edges(first):
            x, y = b - a
            if x or y:
                best = max(best, ((second - a) @ (y, -x)).min() / np.hypot(x, y))
    return best


def core_distance(one, other):
    """Distance of two cores by all their corners and edges; below 0 how deep they overlap."""
    deep = separation(one, other) if max(len(one), len(other)) > 1 else 0.0
    apart = min(
        from_core(point, of) for points, of in ((one, other), (other, one)) for point in points
    )
    return deep if deep < -1e-9 else apart  # in line nothing separates them either


def is_at_corner(point, a, b, pieces):
    """Whether a point of pieces a and b is over the corner that it names."""
    on_a = pieces.start[a] <= point.corner < pieces.start[a + 1]
    piece, lever, side = (a, lever_i(point), 1.0) if on_a else (b, lever_j(point), -1.0)
    reach = pieces.rounding[piece] * side * np.array([point.nx, point.ny])
    return pieces.corner[point.corner, :2] == pytest.approx(lever + reach, abs=TINY)


def random_pairs(seed, count, near=0.6):
    """Two grains with corners each, sharp or rounded, that overlap or are near each other."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        grains = []
        for sides in rng.choice(SIDES, 2):
            rounding = rng.choice([0.0, 0.2, 0.5] if sides > 2 else [0.2, 0.5])
            corners = rod(1.6) if sides == 2 else convex(rng, sides, rng.uniform(0.5, 1.0))
            grains.append(disc(rounding) if sides == 1 else [(corners, rounding)])
        angle = rng.uniform(0.0, 7.0, 3)
        away = rng.uniform(near, 3.0)
        place = away * np.cos(angle[2]), away * np.sin(angle[2]), angle[0]
        yield Placed(grains).at(place, (0.0, 0.0, angle[1]))


def test_gaps_are_distances_and_points_lie_on_both_surfaces():
    apart = deep = 0
    for pieces, scene in random_pairs(1, 400):
        d = scene.position[0, :2]
        first, second = touch(pieces, 0, 1, *d.tolist())
        radii = pieces.rounding[:2].sum()
        distance = core_distance(core(pieces, 0, d), core(pieces, 1))
        assert first.gap == pytest.approx(distance - radii, abs=TINY)
        normal = np.array([first.nx, first.ny])
        assert np.hypot(*normal) == pytest.approx(1.0, abs=TINY)
        on_i, on_j = d + lever_i(first), lever_j(first)
        assert true_gap(scene, pieces, 0, 1) == (first.gap, first.nx, first.ny)
        if distance <= 0.0:
            deep += 1
            continue
        apart += 1
        assert on_i - on_j == pytest.approx(first.gap * normal, abs=TINY)
        for piece, place, point in ((0, d, on_i), (1, (0.0, 0.0), on_j)):
            away = from_core(point, core(pieces, piece, place))
            assert away == pytest.approx(pieces.rounding[piece], abs=TINY)
        assert is_at_corner(first, 0, 1, pieces)
        if second.gap < np.inf:
            assert second.gap >= first.gap - TINY
            assert (second.nx, second.ny) == (first.nx, first.ny)
            assert is_at_corner(second, 0, 1, pieces)
            assert second.corner != first.corner
    assert min(apart, deep) > 30


def test_the_bound_on_a_gap_never_exceeds_it_and_often_is_it():
    equal = 0
    for pieces, scene in random_pairs(3, 400):
        bound, gap = gap_at_least(scene, pieces, 0, 1), true_gap(scene, pieces, 0, 1)[0]
        assert bound <= gap + TINY
        equal += bound >= gap - TINY
    assert equal > 100  # others are nearest at two corners, or over an edge that faces them less


def test_pairs_the_other_way_round_are_the_same_to_the_bit():
    for pieces, scene in random_pairs(2, 300):
        dx, dy = scene.position[0, :2].tolist()
        for one, other in zip(touch(pieces, 0, 1, dx, dy), touch(pieces, 1, 0, -dx, -dy),
                              strict=True):  # fmt: skip
            if one.gap == np.inf:
                assert other.gap == np.inf
                continue
            turned_round = (-other.nx, -other.ny, other.gap, other.j_x, other.j_y, other.i_x,
                            other.i_y)  # fmt: skip
            assert tuple(one)[:7] == turned_round
            assert one.corner == other.corner or pieces.corner.shape[0] == 2  # of two discs


def test_discs_touch_as_discs_do():
    """Pieces of one corner, beside one with three so that there are outlines at all."""
    rng = np.random.default_rng(3)
    for _ in range(50):
        radii, place = rng.uniform(0.2, 1.0, 2), rng.uniform(-1.0, 1.0, 2)
        grains = [disc(radii[0]), disc(radii[1]), [(regular(3), 0.0)]]
        pieces, scene = Placed(grains).at((*place, 1.0), (0.0, 0.0, 2.0), (9.0, 9.0, 0.0))
        point, none = touch(pieces, 0, 1, *place.tolist())
        distance = np.sqrt(place[0] * place[0] + place[1] * place[1])
        assert (point.gap, point.nx, point.ny) == (
            distance - (radii[0] + radii[1]), place[0] / distance, place[1] / distance,
        )  # fmt: skip
        assert none.gap == np.inf
        assert true_gap(scene, pieces, 0, 1) == (point.gap, point.nx, point.ny)


def test_two_corners_at_one_place_have_a_normal():
    pieces, _ = Placed([disc(0.5), disc(0.5), [(box(1.0, 1.0), 0.0)]]).at(*np.zeros((3, 3)))
    point, _ = touch(pieces, 0, 1, 0.0, 0.0)
    assert (point.gap, np.hypot(point.nx, point.ny)) == (-1.0, 1.0)


# ---- Edges that are parallel to rounding


@pytest.mark.parametrize("rounding", [0.0, 0.05])
def test_flush_boxes_touch_at_both_ends_of_what_they_share(rounding):
    """5,000 offsets and angles: which corner is nearer is a matter of the last bit."""
    rng = np.random.default_rng(4)
    boxes = Placed([[(box(1.0, 0.4), rounding)], [(box(0.6, 1.0), rounding)]])
    height = 0.7 + 2.0 * rounding
    for k in range(2500):
        offset = rng.choice([rng.uniform(-0.79, 0.79), 0.2, -0.2, 0.0])
        gap, turn = rng.choice([0.0, 1e-3]), (0.0 if k % 5 == 0 else rng.uniform(0.0, 7.0))
        c, s = np.cos(turn), np.sin(turn)
        d = np.array([c * offset - s * (height + gap), s * offset + c * (height + gap)])
        pieces, _ = boxes.at((*d, turn), (0.0, 0.0, turn))
        points = touch(pieces, 0, 1, *d.tolist())
        back = np.array([[c, s], [-s, c]])
        ends = sorted((back @ (d + lever_i(p)))[0] for p in points if p.gap < np.inf)
        expected = [max(offset - 0.5, -0.3), min(offset + 0.5, 0.3)]
        assert ends == pytest.approx(expected, abs=1e-11), (k, offset, turn)
        for point in points:
            assert back @ (point.nx, point.ny) == pytest.approx([0.0, 1.0], abs=1e-11)
            assert point.gap == pytest.approx(gap, abs=TINY)
            assert is_at_corner(point, 0, 1, pieces)


@pytest.mark.parametrize("turn", [0.0, 0.3, 2.0, 4.0])
def test_boxes_beside_each_other_are_as_far_apart_as_their_corners(turn):
    """Parallel edges that share nothing: both corners are as far from the edge's line."""
    c, s = np.cos(turn), np.sin(turn)
    boxes = Placed([[(box(1.0, 1.0), 0.0)]] * 2)
    for x in (-2.0, -1.5, -1.0625, 1.0625, 1.5, 2.0):
        for y in (-2.0, -1.5, -1.25, 1.25, 1.5, 2.5):
            d = np.array([c * x - s * y, s * x + c * y])
            pieces, _ = boxes.at((*d, turn), (0.0, 0.0, turn))
            first, _ = touch(pieces, 0, 1, *d.tolist())
            apart = np.hypot(abs(x) - 1.0, abs(y) - 1.0)
            assert first.gap == pytest.approx(apart, abs=TINY)
            assert is_at_corner(first, 0, 1, pieces)


@pytest.mark.parametrize("turn", [0.0, 0.3, 1.1, 2.0, 3.0, 4.7])
@pytest.mark.parametrize("other", [[(rod(2.0), 0.1)], [(rod(0.5), 0.2)], disc(0.2)])
def test_rods_in_line_touch_at_their_ends(turn, other):
    """Cores on one line: none of their edges separates them."""
    way = np.array([np.cos(turn), np.sin(turn)])
    half = 1.0 + max(np.abs(other[0][0][:, 0]))
    both = Placed([other, [(rod(2.0), 0.1)]])
    for side in (-1.0, 1.0):
        for gap in (1e-3, 0.3):
            d = side * way * (half + 0.1 + other[0][1] + gap)
            pieces, _ = both.at((*d, turn), (0.0, 0.0, turn))
            for a, b, sign in ((0, 1, 1.0), (1, 0, -1.0)):
                first, second = touch(pieces, a, b, *(sign * d).tolist())
                assert first.gap == pytest.approx(gap, abs=TINY)
                assert (first.nx, first.ny) == pytest.approx(sign * side * way, abs=1e-9)
                assert second.gap == np.inf


# ---- Along small steps


def walk(grains, steps=2000, seed=5):
    """Points of a pair, one of which goes around the other and turns, to and from it."""
    rng, step, pair = np.random.default_rng(seed), 2e-3, Placed(grains)
    place, inward = np.array([1.9, 0.0, 0.3]), 1.0
    for _ in range(steps):
        out = place[:2] / np.hypot(*place[:2])
        place[:2] += step * (np.array([-out[1], out[0]]) - inward * out)
        place[2] += step * rng.uniform(0.5, 1.5)
        pieces, _ = pair.at(place, (0.0, 0.0, 0.0))
        points = touch(pieces, 0, 1, *place[:2].tolist())
        if not -0.05 < points[0].gap < 0.1:
            inward = 1.0 if points[0].gap > 0.0 else -1.0
        yield place.copy(), points


@pytest.mark.parametrize("sides", [(4, 4), (5, 3), (2, 4), (2, 2), (20, 5)])
def test_points_follow_small_steps(sides):
    """The gap changes as far as the grains move, the normal over the radius of curvature there.

    A second point comes and goes where the first one is, or far from touching.
    """
    rounding = 0.1
    grains = [[(rod(1.4) if n == 2 else regular(n, 0.8), rounding)] for n in sides]
    before, closest = None, np.inf
    for place, points in walk(grains):
        first = points[0]
        normal = np.array([first.nx, first.ny])
        if before is not None and min(first.gap, before[1][0].gap) > -2.0 * rounding:
            moved = np.hypot(*(place - before[0])[:2]) + 0.9 * abs(place[2] - before[0][2])
            assert abs(first.gap - before[1][0].gap) <= moved + TINY
            old = np.array([before[1][0].nx, before[1][0].ny])
            curved = min(first.gap, before[1][0].gap) + 2.0 * rounding
            assert np.hypot(*(normal - old)) <= 2.0 * moved / curved + TINY
            known = [(p.i_x + before[0][0], p.i_y + before[0][1]) for p in before[1]
                     if p.gap < np.inf]  # fmt: skip
            for point in points:
                if point.gap < first.gap + 5e-3:
                    here = place[:2] + lever_i(point)
                    assert min(np.hypot(*(here - there)) for there in known) < 0.1
        closest = min(closest, abs(first.gap))
        before = place, points
    assert closest < 0.005


# ---- Walls and images

LINE = np.array([[-2.0, 0.4], [-0.5, -0.3], [0.3, -0.2], [0.9, 0.8], [2.0, 0.1]])
TRIANGLE = np.array([[-0.7, -0.4], [0.8, -0.2], [0.1, 0.9]])
SHAPES = {
    "plane": [(ShapeKind.PLANE, 0, (0.1, -0.2, 0.6, 0.8))],
    "circle": [(ShapeKind.CIRCLE, 0, (0.1, -0.2, 3.5, 0.0))],
    "disc": [(ShapeKind.DISC, 0, (0.1, -0.2, 0.7, 0.0))],
    "lone vertex": [(ShapeKind.VERTEX, 0, (0.1, -0.2, -1.0, -1.0))],
}


SHAPES["line"] = wall_line(LINE)
SHAPES["triangle"] = wall_line(TRIANGLE, kind=ShapeKind.SIDE, is_closed=True)


def from_wall(corners, name):
    """Distance of a core from a wall at the origin, by brute force."""
    if name == "plane":
        return ((corners - (0.1, -0.2)) @ (0.6, 0.8)).min()
    if name == "circle":
        return 3.5 - np.hypot(*(corners - (0.1, -0.2)).T).max()
    if name in ("disc", "lone vertex"):
        radius = 0.7 if name == "disc" else 0.0
        return core_distance(corners, np.array([[0.1, -0.2]])) - radius
    lines = edges(TRIANGLE) if name == "triangle" else edges(LINE)[:-1]
    return min(core_distance(corners, np.array(line)) for line in lines)


def wall_points(pieces, scene, grain=0):
    """All points of a grain of one piece with the wall."""
    return [
        point
        for shape in range(scene.kind.size)
        for point in touch_wall(pieces, scene, grain, pieces.piece[grain], shape)
        if point.gap < np.inf
    ]


@pytest.mark.parametrize("wall", [(0.0, 0.0, 0.0), (5.0, -3.0, 0.9)])
@pytest.mark.parametrize("name", SHAPES)
def test_gaps_of_walls_are_distances(name, wall):
    """Wherever the wall is and however it is turned; levers lead to both surfaces."""
    rng, apart = np.random.default_rng(6), 0
    turn = np.array([[np.cos(wall[2]), np.sin(wall[2])], [-np.sin(wall[2]), np.cos(wall[2])]])
    for sides in (1, 2, 3, 4, 5, 20):
        for rounding in (0.0, 0.15)[sides < 3 :]:
            corners = rod(0.8) if sides == 2 else convex(rng, sides, 0.5)
            grain = disc(rounding) if sides == 1 else [(corners, rounding)]
            # A second one, so that a disc alone is looked at as a piece
            one = Placed([grain, [(regular(3), 0.0)]], SHAPES[name])
            for _ in range(12):
                local = np.append(rng.uniform(-1.8, 1.8, 2), rng.uniform(0.0, 7.0))
                place = np.append(local[:2] @ turn + wall[:2], local[2] + wall[2])
                pieces, scene = one.at(place, (50.0, 50.0, 0.0), wall=wall)
                away = from_wall((core(pieces, 0, place) - wall[:2]) @ turn.T, name)
                if away <= 0.0:
                    continue
                apart += 1
                points = wall_points(pieces, scene)
                first = min(points, key=lambda point: point.gap)
                assert first.gap == pytest.approx(away - rounding, abs=TINY)
                for point in points:
                    on_i = place[:2] + lever_i(point)
                    on_j = wall[:2] + lever_j(point)
                    normal = np.array([point.nx, point.ny])
                    assert on_i - on_j == pytest.approx(point.gap * normal, abs=1e-11)
                if first.gap >= 0.0:
                    surface = from_core(place[:2] + lever_i(first), core(pieces, 0, place))
                    assert surface == pytest.approx(rounding, abs=1e-11)
    assert apart > 50


@pytest.mark.parametrize("rounding", [0.0, 0.05])
@pytest.mark.parametrize("kind", [ShapeKind.SEGMENT, ShapeKind.SIDE])
def test_a_box_on_a_line_of_flush_pieces_has_upright_points_only(kind, rounding):
    """At its two corners, and at the corners of the wall below it; anywhere along the line."""
    floor = wall_line(np.column_stack([0.3 * np.arange(-9, 10), np.zeros(19)]), kind=kind)
    grain = Placed([[(box(1.0, 0.5), rounding)]], floor)
    for x in np.append(np.random.default_rng(7).uniform(-1.0, 1.0, 200), [0.0, 0.2, -0.1, 0.5]):
        pieces, scene = grain.at((x, 0.25 + rounding, 0.0))
        near = [point for point in wall_points(pieces, scene) if point.gap < 0.1]
        assert all((p.nx, p.ny) == pytest.approx((0.0, 1.0), abs=1e-11) for p in near)
        assert all(p.gap == pytest.approx(0.0, abs=TINY) for p in near)
        at = sorted(x + point.i_x for point in near)
        below = [0.3 * k for k in range(-9, 10) if abs(0.3 * k - x) < 0.5 - 1e-9]
        for there in (x - 0.5, *below, x + 0.5):
            assert min(abs(there - found) for found in at) < 1e-9


def test_images_touch_as_the_grains_would():
    """A pair, and a grain with a line, across the period; walls may have moved many periods."""
    rng, period = np.random.default_rng(8), 8.0
    floor = wall_line([[0.0, 0.0], [3.5, 0.4], [8.0, 0.0]], period=period)
    pair = Placed([[(convex(rng, 5, 0.9), 0.05)], [(rod(1.0), 0.2)]], floor, period)
    for _ in range(100):
        a = np.append(rng.uniform((0.0, 0.3), (period, 2.0)), rng.uniform(0.0, 7.0))
        b = np.append(a[:2] + rng.uniform(-2.0, 2.0, 2), rng.uniform(0.0, 7.0))
        found = []
        for images, wall in ((0, 0), (1, 0), (-1, 0), (0, 5)):
            image = b + np.array([images * period, 0.0, 0.0])
            pieces, scene = pair.at(a, image, wall=(wall * period, 0.0, 0.0))
            points = [*touch_pieces(pieces, scene, 0, 0, 1, 1)]
            points += [*wall_points(pieces, scene, 0), *wall_points(pieces, scene, 1)]
            found.append([point[:5] for point in points])
        plain = touch(pieces, 0, 1, *(a - b)[:2].tolist())
        assert found[0][:2] == [point[:5] for point in plain]
        for other in found[1:]:
            assert np.array(other) == pytest.approx(np.array(found[0]), abs=1e-9)
