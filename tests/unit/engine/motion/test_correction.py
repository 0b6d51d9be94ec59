"""Position correction: which grains it may move, and what it leaves of overlaps."""

import numpy as np
import pytest
from entries import entry
from scene_parts import FLOOR, make_engine, make_model
from shapes import box, disc, regular, rod, shaped_engine, shaped_model

from multicor_cli.engine.geometry import outlines
from multicor_cli.engine.geometry.neighbors import both_ways
from multicor_cli.engine.geometry.pieces import pieces_of, turned
from multicor_cli.engine.geometry.scene import Scene, pair_geometry, scene_of
from multicor_cli.engine.motion import correction
from multicor_cli.engine.motion.correction import mark_again, mark_overlaps, pairs_of, surround
from multicor_cli.engine.motion.separation import separate
from multicor_cli.model.shapes import ShapeKind

touch_pieces = entry(outlines.touch_pieces)

# a chain: grain k is near grain k + 1, and the last near a wall
ROW = np.array([0, 1, 2, 3, 4, 5, 6], np.int64)
PARTNER = np.array([1, 2, 3, 4, 5, 6], np.int32)


def chain():
    """Discs in a row with gaps of 0.1, but one of 0.9; a plane at the end."""
    x = np.array([0.0, 1.1, 2.2, 3.3, 5.2, 6.3])
    position = np.column_stack([x, np.zeros(6), np.zeros(6)])
    plane = np.array([[6.9, 0.0, -1.0, 0.0]])
    return Scene(
        position, np.full(6, 0.5), np.zeros(7, np.int32), np.full(1, ShapeKind.PLANE, np.int32),
        np.array([0], np.int32), plane, np.array([[6.9, 0.0, 0.0]]), 0.0,
    )  # fmt: skip


def test_rings_and_pairs_of_marked_grains():
    around = both_ways(ROW, PARTNER)
    assert around.owner.tolist() == [0, 1, 2, 3, 4, 5]
    assert around.other.tolist() == [1, 0, 2, 1, 3, 2, 4, 3, 5, 4, 6]
    marked = np.array([False, True, False, False, False, False])
    assert surround(chain(), None, around, 0.5, 1, marked) == 3
    assert marked.tolist() == [True, True, True, False, False, False]
    assert surround(chain(), None, around, 0.5, 9, marked) == 4  # the gap beside 3 is too wide
    assert marked.tolist() == [True] * 4 + [False] * 2
    marked = np.array([False, True, True, False, False, True])
    i, j = pairs_of(both_ways(ROW, PARTNER), marked)
    listed = [(0, 1), (1, 2), (2, 3), (4, 5), (5, 6)]
    assert sorted(zip(i.tolist(), j.tolist(), strict=True)) == listed


def test_overlaps_mark_grains_and_the_largest_are_told():
    scene, every = chain(), np.ones(6, np.bool_)
    scene.position[1, 0] -= 0.13  # the first pair overlaps by 0.03, 0.06 of the radius
    scene.position[5, 0] += 0.105  # and the last grain the wall by 0.01
    i, marked = np.arange(6, dtype=np.int32), every.copy()
    assert mark_overlaps(scene, None, i, PARTNER, 0.05, marked) == pytest.approx((0.06, 0.01))
    assert marked.tolist() == [True] + [False] * 5
    around = both_ways(ROW, PARTNER)
    assert mark_again(scene, None, around, 0.05, every) == pytest.approx((0.06, 0.01))
    assert every.tolist() == [True, True] + [False] * 4


def corrected(overlap, count=60):
    """A row of discs on a floor, none of which touches another but two in the middle, after a
    correction."""
    radius = np.full(count, 0.5)
    model = make_model(radius, FLOOR, gravity=(0.0, 0.0))
    x = 1.0002 * np.arange(count)
    x[count // 2 :] -= 0.0002 + overlap
    engine = make_engine(model, np.column_stack([x, np.full(count, 0.5)]))
    report = engine.step(1e-3, 0.0)
    return engine.state.position[:, 0] - x, report.overlap


def test_few_overlaps_move_the_grains_nearby_only():
    moved, overlap = corrected(6e-4)
    assert overlap <= correction.ALLOWED
    middle = len(moved) // 2
    assert moved[middle - 1] < 0.0 < moved[middle]
    assert abs(moved.sum()) < 1e-12  # equal masses: the center of mass stays
    far = correction.RINGS + 2
    assert np.all(moved[: middle - far] == 0.0)
    assert np.all(moved[middle + far :] == 0.0)


def test_what_cannot_be_done_nearby_is_done_everywhere(monkeypatch):
    """A cage of held grains that leaves no room: only moving everything helps."""
    monkeypatch.setattr(correction, "RINGS", 0)
    moved, overlap = corrected(9e-3)
    assert overlap <= correction.ALLOWED
    assert np.count_nonzero(moved) > 10


def smallest_displacements(scene, i, j, mass, wall_inverse, target):
    """The same convex problem with dense matrices: projected Jacobi steps find the pairs that push,
    a linear system how much."""
    n, w = len(mass), len(wall_inverse)
    rows, limits = [], []
    for a, b in zip(i, j, strict=True):
        gap, nx, ny = pair_geometry(scene, a, b)
        body = b if b < n else n + scene.wall[b - n]
        row = np.zeros((n + w, 2))
        row[a] += (nx, ny)
        row[body] -= (nx, ny)
        rows.append(row.ravel())
        limits.append(
            -gap - target * (min(scene.radius[a], scene.radius[b]) if b < n else scene.radius[a])
        )
    inverse = np.concatenate([np.repeat(1.0 / mass, 2), wall_inverse.ravel()])
    return smallest(np.array(rows), np.array(limits), inverse).reshape(n + w, 2)


def smallest(g, h, inverse):
    """The x with g x ≥ h that is smallest, weighed by the reciprocals of ``inverse``."""
    dual = np.zeros(len(h))
    delassus = (g * inverse) @ g.T
    for _ in range(20_000):
        dual = np.maximum(0.0, dual - (delassus @ dual - h) / np.abs(delassus).sum(axis=1).max())
    pushing = dual > 1e-6 * dual.max()
    dual = np.zeros(len(h))
    dual[pushing] = np.linalg.lstsq(delassus[np.ix_(pushing, pushing)], h[pushing], rcond=None)[0]
    assert (dual >= 0.0).all()
    assert (delassus @ dual - h > -1e-9).all()
    return inverse * (g.T @ dual)


@pytest.mark.parametrize("lid_inverse", [0.0, 0.02])
def test_displacements_solve_the_convex_problem(lid_inverse):
    """Overlapping discs of several sizes between a floor and a lid, heavy or held: against dense
    matrices."""
    rng = np.random.default_rng(5)
    radius = rng.uniform(0.4, 0.6, 12)
    position = np.zeros((12, 3))
    position[:, 0], position[:, 1] = np.tile([0.5, 1.4, 2.3], 4), np.repeat([0.5, 1.4, 2.3, 3.2], 3)
    position[:, :2] += rng.uniform(-0.05, 0.05, (12, 2))
    planes = np.array([[0.0, 0.0, 0.0, 1.0], [0.0, 4.05, 0.0, -1.0]])
    scene = Scene(
        position, radius, np.zeros(14, np.int32), np.full(2, ShapeKind.PLANE, np.int32),
        np.array([0, 1], np.int32), planes,
        np.array([[0.0, 0.0, 0.0], [0.0, 4.05, 0.0]]), 0.0,
    )  # fmt: skip
    i, j = np.array([(a, b) for a in range(12) for b in range(a + 1, 14)], np.int32).T.copy()
    gap = np.array([pair_geometry(scene, a, b)[0] for a, b in zip(i, j, strict=True)])
    near = gap < 0.1
    mass, wall_inverse = np.pi * radius**2, np.array([[0.0, 0.0], [0.0, lid_inverse]])
    expected = smallest_displacements(scene, i[near], j[near], mass, wall_inverse, 1e-3)
    before = position[:, :2].copy()
    shift, pull_x, pull_y = separate(
        scene,
        None,
        i,
        j,
        np.ones(12, np.bool_),
        mass,
        mass,
        wall_inverse,
        0.1,
        1e-3,
        2e-3,
        1e-12,
        10_000,
    )
    assert np.abs(expected).max() > 0.005
    np.testing.assert_allclose(position[:, :2] - before, expected[:12], atol=1e-7)
    np.testing.assert_allclose(shift, expected[12:], atol=1e-7)
    pull = (mass[:, None] * (position[:, :2] - before)).sum(axis=0)
    np.testing.assert_allclose([pull_x, pull_y], pull, rtol=1e-12)


def test_held_grains_stay():
    """Only the marked grain moves, and all the way."""
    scene = Scene(
        np.array([[0.0, 0.0, 0.0], [0.9, 0.0, 0.0]]), np.full(2, 0.5), np.zeros(2, np.int32),
        np.empty(0, np.int32),
        np.empty(0, np.int32), np.empty((0, 4)), np.empty((0, 3)), 0.0,
    )  # fmt: skip
    pair = (np.array([0], np.int32), np.array([1], np.int32))
    one_of_two = np.array([False, True]), np.ones(2), np.ones(2), np.empty((0, 2))
    separate(scene, None, *pair, *one_of_two, 0.1, 0.01, 0.02, 1e-9, 100)
    np.testing.assert_allclose(scene.position[:, 0], [0.0, 0.995], atol=1e-9)


@pytest.mark.parametrize(("depth", "place"), [(0.04, 0.96), (0.06, 1.0)])
def test_a_pair_with_a_held_grain_keeps_an_allowed_overlap(depth, place):
    """Allowed are 0.1 of the radius of 0.5: between two held grains there may be no room for less.
    More than that is taken away."""
    scene = Scene(
        np.array([[0.0, 0.0, 0.0], [1.0 - depth, 0.0, 0.0]]), np.full(2, 0.5),
        np.zeros(2, np.int32), np.empty(0, np.int32),
        np.empty(0, np.int32), np.empty((0, 4)), np.empty((0, 3)), 0.0,
    )  # fmt: skip
    pair = (np.array([0], np.int32), np.array([1], np.int32))
    one_of_two = np.array([False, True]), np.ones(2), np.ones(2), np.empty((0, 2))
    separate(scene, None, *pair, *one_of_two, 0.1, 0.0, 0.1, 1e-9, 100)
    assert scene.position[1, 0] == pytest.approx(place, abs=1e-9)


def points_of(model, position):
    """Gaps of all points of a model's grains, by pair and corner [m], and the scene."""
    scene = scene_of(model, position, np.zeros((model.wall_count, 3)))
    pieces, n = turned(pieces_of(model), scene), model.grain_count
    return scene, pieces, {
        (i, j, int(point.corner)): point.gap
        for i in range(n)
        for j in range(i + 1, n + model.shape_count)
        for point in touch_pieces(pieces, scene, i, i, j, j)
        if point.gap < np.inf
    }  # fmt: skip


def test_grains_with_corners_turn_as_the_convex_problem_says():
    """Discs between others, on a floor: against dense matrices of derivatives.

    Not of pairs of edges: a second point that is clipped moves along both as they turn.
    """
    rng = np.random.default_rng(3)
    kinds = [[(rod(0.8), 0.2)], [(box(0.9, 0.7), 0.0)], [(regular(5, 0.55), 0.0)]]
    others = [kinds[k % 3] for k in range(16)]
    model = shaped_model([others[k] if (k + k // 4) % 2 else disc(0.5) for k in range(16)])
    position = np.zeros((16, 3))
    position[:, 0], position[:, 1] = np.tile(np.arange(4.0), 4), np.repeat(np.arange(4.0) + 0.42, 4)
    position[:, :2] *= 0.9
    position[:, 2] = rng.uniform(0.0, 7.0, 16)
    scene, pieces, gaps = points_of(model, position.copy())
    near, target = 0.1, 1e-3
    known = [point for point, gap in gaps.items() if gap <= near]
    rows, limits = np.zeros((len(known), 48)), np.zeros(len(known))
    for d in range(48):
        moved = [position.copy(), position.copy()]
        for sign in (0, 1):
            moved[sign].flat[d] += (1e-6, -1e-6)[sign]
        ahead, behind = (points_of(model, each)[2] for each in moved)
        rows[:, d] = [(ahead[point] - behind[point]) / 2e-6 for point in known]
    radius, mass, inertia = model.grains.radius, model.grains.mass, model.grains.inertia
    for row, (i, j, _) in enumerate(known):
        smaller = min(radius[i], radius[j]) if j < 16 else radius[i]
        limits[row] = -gaps[known[row]] - target * smaller
    inverse = np.column_stack([1.0 / mass, 1.0 / mass, 1.0 / inertia]).ravel()
    expected = smallest(rows, limits, inverse).reshape(16, 3)
    i, j = np.array([(a, b) for a in range(16) for b in range(a + 1, 17)], np.int32).T.copy()
    separate(
        scene, pieces, i, j, np.ones(16, np.bool_), mass, inertia, np.zeros((1, 3)), near, target,
        target, 1e-12, 20_000,
    )  # fmt: skip
    assert np.abs(expected).max(axis=0).min() > 0.005
    np.testing.assert_allclose(scene.position - position, expected, atol=1e-7)
    again = turned(pieces_of(model), scene)
    np.testing.assert_allclose(pieces.corner, again.corner, atol=1e-14)


@pytest.mark.parametrize("count", [1, 20])
def test_a_box_turns_out_of_where_it_is_wedged(count):
    """Between planes hardly farther apart than it is high: moving it does not help.

    Alone it is moved with everything that there is; beside others, all of which fit, it is pushed.
    """
    planes = [
        (ShapeKind.PLANE, 0, (0.0, 0.0, 0.0, 1.0)),
        (ShapeKind.PLANE, 1, (0.0, 0.501, 0.0, -1.0)),
    ]
    model = shaped_model([[(box(1.0, 0.5), 0.0)]] * count, planes, ("floor", "lid"), gravity=(0, 0))
    places = np.column_stack([1.2 * np.arange(count), np.full(count, 0.2505), np.zeros(count)])
    places[0, 2] = 0.01
    engine = shaped_engine(model, places)
    report = engine.step(1e-3, 0.0)
    assert report.overlap <= correction.ALLOWED
    assert abs(engine.state.position[0, 2]) < 0.003
    np.testing.assert_array_equal(engine.state.position[1:], places[1:])
