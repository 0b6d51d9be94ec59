"""Points of grains that are no discs as heat sees them: names, radii of curvature, places."""

import numpy as np
import pytest
from entries import entry
from heat_parts import with_heat
from shapes import box, convex, disc, regular, rod, shaped_model
from wall_lines import level, walls_of

from multicor_cli.engine.contact import faces
from multicor_cli.engine.geometry import outlines
from multicor_cli.engine.geometry.pieces import pieces_of, turned
from multicor_cli.engine.geometry.scene import scene_of
from multicor_cli.engine.heat.faces import SHARP, FacePoints, corners_of, points_at_rest
from multicor_cli.model import ShapeKind

touch_pieces, pieces_of_key, point_key = map(
    entry, (outlines.touch_pieces, faces.pieces_of_key, faces.point_key)
)

LAMBDA = np.array([15.0])


def scene_with(grains, places, shapes=(), walls=()):
    model = shaped_model(grains, shapes, walls)
    mass = model.grains.mass
    model = with_heat(model, mass, capacity=mass, thickness=0.5)
    places = np.asarray(places, float)
    position = np.zeros((len(places), 3))
    position[:, : places.shape[1]] = places
    scene = scene_of(model, position, np.zeros((model.wall_count, 3)))
    pieces = pieces_of(model)
    return model, scene, turned(pieces, scene), corners_of(model, pieces)


def points_of(grains, places, shapes=(), walls=(), reach=1e-4):
    """All points, as at rest: their i and j, and `FacePoints`."""
    _, scene, pieces, corners = scene_with(grains, places, shapes, walls)
    count = len(grains)
    pairs = [(i, j) for i in range(count) for j in range(i + 1, count + len(shapes))]
    i, j = np.array(pairs, np.int32).T.copy()
    i, j, key = points_at_rest(scene, pieces, i, j, reach)
    return i, j, FacePoints.of(scene, pieces, corners, LAMBDA, i, j, key, np.ones(i.size))


def test_a_key_says_of_which_pieces_a_point_is():
    rng = np.random.default_rng(4)
    grains = []
    for _ in range(12):
        pieces = []
        for _ in range(rng.integers(1, 4)):
            kind, at = rng.integers(3), rng.uniform(-1.0, 1.0, 2)
            corners = (convex(rng, rng.integers(3, 7)), rod(1.0), np.zeros((1, 2)))[kind]
            pieces.append((corners + at, rng.uniform(0.1, 0.2)))
        grains.append(pieces)
    shapes, names = walls_of([level(-9.0, 9.0)])
    _, scene, pieces, _ = scene_with(grains, rng.uniform(-3.0, 3.0, (12, 3)), shapes, names)
    seen = 0
    for i in range(12):
        for j in range(i + 1, 12 + len(shapes)):
            others = range(pieces.piece[j], pieces.piece[j + 1])
            for a in range(pieces.piece[i], pieces.piece[i + 1]):
                for b in others:
                    for point in touch_pieces(pieces, scene, i, a, j, b):
                        if np.isfinite(point.gap):
                            key = point_key(pieces, scene, i, a, j, b, point.corner)
                            found = pieces_of_key(pieces, scene, i, j, key)
                            assert found == (a, b, point.corner)
                            seen += 1
    assert seen > 300


@pytest.mark.parametrize("rounding", [0.0, 0.2])
def test_corners_of_a_round_outline_have_the_radius_of_the_circle_around_it(rounding):
    """An ellipse of many corners: b²/a and a²/b at its ends, to second order in their number."""
    errors = []
    for sides in (60, 120):
        angle = 2.0 * np.pi * np.arange(sides) / sides
        corners = np.column_stack([1.5 * np.cos(angle), np.sin(angle)])
        found = scene_with([[(corners, rounding)]], [[0.0, 0.0]])[3]
        assert found.is_side[:sides].sum() == 0
        ends = found.radius[[0, sides // 4]] - rounding
        errors.append(np.abs(ends / [1.0 / 1.5, 1.5**2] - 1.0).max())
        assert found.thickness == pytest.approx([0.5])
    assert errors[0] < 0.01
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)


def test_corners_that_turn_much_have_their_rounding_or_are_sharp():
    model, _, _, found = scene_with(
        [[(box(2.0, 1.0), 0.3)], [(box(2.0, 1.0), 0.0)], disc(0.7), [(regular(20), 0.0)]],
        [[0.0, 0.0]] * 4,
    )
    sharp = SHARP * model.grains.radius
    assert found.radius[:4] == pytest.approx(np.full(4, 0.3))
    assert found.radius[4:8] == pytest.approx(np.full(4, sharp[1]))
    assert found.radius[8] == 0.7
    assert found.radius[9:] == pytest.approx(np.full(20, sharp[3]))
    assert found.is_side.all()
    assert found.least[1] == pytest.approx(0.5 * 2.0 / 6.0)


def test_a_block_on_pieces_of_walls_is_one_place():
    for lines in ([level(-3.0, 3.0)], [level(-3.0, 0.1, 3.0)], [level(-3.0, 0.1), level(0.1, 3.0)]):
        shapes, names = walls_of(lines)
        _, _, points = points_of([[(box(1.0, 1.0), 0.0)]], [[0.0, 0.5]], shapes, names)
        assert np.unique(points.head).size == 1
        assert points.is_side.all()
        area = points.pressed_areas(np.ones(points.head.size))
        assert area == pytest.approx(np.full(area.size, 0.5))
        assert points.way == pytest.approx(0.5 / 15.0)


def test_posts_and_glued_discs_below_a_block_are_places_of_their_own():
    posts = [(ShapeKind.VERTEX, 0, (x, 0.0, -1.0, -1.0)) for x in (-0.3, 0.3)]
    discs = [(ShapeKind.DISC, 0, (x, -1.0, 1.0, 0.0)) for x in (-0.3, 0.3)]
    for shapes in (posts, discs):
        i, _, points = points_of([[(box(1.0, 1.0), 0.0)]], [[0.0, 0.5]], shapes, ("wall",))
        assert i.size == 2
        assert points.head.tolist() == [0, 1]
        assert not points.is_side.any()


def test_feet_of_a_clump_conduct_each_for_itself():
    """A bench on a block: two sides, not the gap between its feet."""
    foot, way = box(0.2, 0.4), np.array([0.8, 0.0])
    seat = box(2.0, 0.2) + np.array([0.0, 0.3])
    bench = [(seat, 0.0), (foot - way, 0.0), (foot + way, 0.0)]
    block = [(box(4.0, 1.0), 0.0)]
    model, *_ = scene_with([bench, block], [[0.0, 0.0]] * 2)
    height = -float(model.outlines.corner[: 3 * 4, 1].min())
    i, _, points = points_of([bench, block], [[0.0, 0.5 + height], [0.0, 0.0]])
    assert i.size == 4
    assert np.unique(points.head).size == 2
    force = np.ones(4)
    assert points.pressed_areas(force) == pytest.approx(np.full(4, 0.2 * 0.5))


def test_points_that_are_no_more_are_those_that_came_instead():
    """Flush blocks: whichever corners a key names, both points are found."""
    grains = [[(box(1.0, 1.0), 0.0)]] * 2
    _, scene, pieces, corners = scene_with(grains, [[0.0, 0.0], [0.2, 1.0]])
    i, j = np.zeros(2, np.int32), np.ones(2, np.int32)
    for keys in ((0, 2), (4, 6), (1, 3), (5, 7), (0, 7)):
        key = np.array(keys, np.int32)
        points = FacePoints.of(scene, pieces, corners, LAMBDA, i, j, key, np.ones(2))
        assert sorted(points.arm[:, 0].tolist()) == pytest.approx([-0.3, 0.5])
        assert points.pressed_areas(np.ones(2)) == pytest.approx(np.full(2, 0.4))
