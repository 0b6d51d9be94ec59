"""The neighbor list against all pairs, for mixtures, periods and every kind of wall shape."""

import numpy as np
import pytest
from cells import make_cell
from scene_parts import make_model

from multicor_cli.engine.geometry.neighbors import NeighborList
from multicor_cli.engine.geometry.scene import place_shapes, scene_of
from multicor_cli.model import ShapeKind


def _listed(lists):
    return {
        (i, int(j))
        for i in range(len(lists.row) - 1)
        for j in lists.partner[lists.row[i] : lists.row[i + 1]]
    }


def _all_pairs(positions, radius, period, reach):
    dx = positions[:, None, 0] - positions[None, :, 0]
    if period:
        dx -= period * np.round(dx / period)
    dy = positions[:, None, 1] - positions[None, :, 1]
    gap = np.hypot(dx, dy) - radius[:, None] - radius[None, :]
    i, j = np.nonzero(np.triu(gap < reach, 1))
    return set(zip(i.tolist(), j.tolist(), strict=True))


def _scene(model, positions):
    return scene_of(model, positions, np.zeros((model.wall_count, 3)))


@pytest.mark.parametrize("period", [0.0, 12.0])
@pytest.mark.parametrize("ratio", [1.0, 3.0, 20.0])
def test_list_holds_every_near_pair(period, ratio):
    rng = np.random.default_rng(1)
    n = 300
    radius = 0.5 * ratio ** (-rng.random(n)) / (2.0 if period else 1.0)
    positions = np.column_stack([12.0 * rng.random(n), 30.0 * rng.random(n), np.zeros(n)])
    model = make_model(radius, walls=(), period=period)
    lists = NeighborList(model)
    for reach in (0.0, 0.1, 1.0):
        lists.update(_scene(model, positions), reach)
        assert _all_pairs(positions, radius, period, reach) <= _listed(lists)
    # Rows are sorted and hold each pair once, owned by the lower number.
    for i in range(n):
        partners = lists.partner[lists.row[i] : lists.row[i + 1]]
        assert (np.diff(partners) > 0).all()
        assert (partners > i).all()


@pytest.mark.parametrize("ratio", [1.0, 2.5, 9.0])
@pytest.mark.parametrize("columns", [2.05, 2.7, 3.1, 4.4, 9.0])
@pytest.mark.parametrize("rows", [0.0, 2.05, 2.7, 3.1, 4.4, 9.0])
@pytest.mark.parametrize("tilt", [0.0, -0.5, 0.3, 1.0, -2.4, 3.7])
def test_list_holds_near_pairs_and_no_others(ratio, columns, rows, tilt):
    """In few cells, which see each other from both sides, and where they are images, too."""
    rng = np.random.default_rng(round(100 * (columns + 10 * rows + tilt + 9)))
    width, height = 2.0 * columns, 2.0 * rows
    n = max(6, round(0.5 * width * (height or 8.0) * ratio))
    radius = 0.5 * ratio ** (-rng.random(n))
    radius[0] = 0.5
    positions = np.column_stack([rng.uniform(-30.0, 30.0, (n, 2)), np.zeros(n)])
    if rows:
        model, state = make_cell(positions, radius, (width, height), tilt=tilt * width)
        scene = scene_of(model, state.position, state.wall_position)
    else:
        positions[:, 1] *= 0.1
        model = make_model(radius, walls=(), period=width)
        scene = _scene(model, positions)
    lists = NeighborList(model)
    lists.update(scene, 0.3)
    apart = positions[:, None, :2] - positions[None, :, :2]
    up = np.round(apart[..., 1] / height) if rows else np.zeros((n, n))
    nearest = np.full((n, n), np.inf)
    for k in (-1, 0, 1) if rows else (0,):
        x = apart[..., 0] - (up + k) * tilt * width * (rows > 0.0)
        y = apart[..., 1] - (up + k) * height
        nearest = np.minimum(nearest, np.hypot(x - width * np.round(x / width), y))
    gap = nearest - radius[:, None] - radius[None, :]
    near = np.nonzero(np.triu(gap < lists.complete, 1))
    assert _listed(lists) == set(zip(*(index.tolist() for index in near), strict=True))


def test_list_has_room_for_all():
    """Though far more than usual are near."""
    rng = np.random.default_rng(6)
    positions = np.column_stack([rng.uniform(0.0, 20.0, (700, 2)), np.zeros(700)])
    radius = rng.uniform(0.1, 0.5, 700)
    model = make_model(radius, walls=())
    lists = NeighborList(model)
    lists.update(_scene(model, positions), 6.0)
    near = _all_pairs(positions, radius, 0.0, lists.complete)
    assert len(near) > 60 * 700
    assert _listed(lists) == near


def test_room_for_all_is_found_where_walls_are_rough():
    """Pairs of two discs of walls count as long as there is no room, and no longer."""
    ring, top = 27, 0.5
    angles = 2.0 * np.pi * np.arange(int(2.0 * np.pi * ring)) / int(2.0 * np.pi * ring)
    x, y = np.meshgrid(np.arange(-ring, ring, 1.03), np.arange(1.0 - ring, ring, 0.9))
    x = x + 0.5 * (np.arange(len(x)) % 2)[:, None]
    inside = (np.hypot(x, y) < ring - 1.01) & (y < top * ring)
    positions = np.column_stack([x[inside], y[inside], np.zeros(inside.sum())])
    radius = np.full(len(positions), 0.5)
    rough = [(ShapeKind.DISC, 0, (ring * np.cos(a), ring * np.sin(a), 0.5, 0.0)) for a in angles]
    model = make_model(radius, rough, ("drum",))
    lists = NeighborList(model)
    lists.update(_scene(model, positions), 0.7)
    everyone = np.concatenate(
        [positions[:, :2], ring * np.column_stack([np.cos(angles), np.sin(angles)])]
    )
    of_all = _all_pairs(everyone, np.full(len(everyone), 0.5), 0.0, lists.complete)
    assert _listed(lists) == {(i, j) for i, j in of_all if i < len(positions)}


@pytest.mark.parametrize("cutoff", [2.6, 3.0, 4.5, 9.0])
def test_a_list_may_reach_farther_than_a_period(cutoff):
    """Each pair is listed once, by its nearest images, and no grain with itself."""
    rng = np.random.default_rng(8)
    radius = np.tile([0.2, 0.5], 20)
    positions = np.column_stack([5.0 * rng.random(40), 60.0 * rng.random(40), np.zeros(40)])
    model = make_model(radius, walls=(), period=5.0)
    lists = NeighborList(model)
    lists.update(_scene(model, positions), cutoff)
    assert _listed(lists) == _all_pairs(positions, radius, 5.0, lists.complete)


def test_list_is_kept_while_nothing_moves_far_and_rebuilt_in_time():
    rng = np.random.default_rng(2)
    n, reach = 200, 0.05
    radius = np.full(n, 0.4)
    positions = np.column_stack([15.0 * rng.random(n), 15.0 * rng.random(n), np.zeros(n)])
    model = make_model(radius, walls=())
    lists = NeighborList(model)
    velocity = rng.normal(size=(n, 2))
    for _ in range(60):
        lists.update(_scene(model, positions), reach)
        assert _all_pairs(positions, radius, 0.0, reach) <= _listed(lists)
        positions[:, :2] += 0.004 * velocity
    assert 1 < lists.builds < 30


def test_far_flying_grains_do_not_cost_memory():
    positions = np.array(
        [[0.0, 0.0, 0.0], [1e9, 0.0, 0.0], [1e9 + 0.5, 0.0, 0.0], [0.0, -1e9, 0.0]]
    )
    model = make_model(np.full(4, 0.5), walls=())
    lists = NeighborList(model)
    lists.update(_scene(model, positions), 0.1)
    assert _listed(lists) == {(1, 2)}


def test_far_flying_grains_do_not_make_all_others_neighbors():
    """They lie outside the grid then; what is near them is found all the same."""
    rng = np.random.default_rng(4)
    positions = np.zeros((2000, 3))
    positions[:, :2] = rng.uniform(0.0, 60.0, (2000, 2))
    positions[:6, :2] += 1e6 * np.array(
        [[1.0, 0.0], [1.0, 0.0], [-1.0, 3.0], [0.0, -1.0], [0.0, 2.0], [2.0, 2.0]]
    )
    positions[1, :2] = positions[0, :2] + (0.9, 0.0)
    radius = np.full(2000, 0.4)
    model = make_model(radius, walls=())
    lists = NeighborList(model)
    centers = positions[:, :2]
    low, high = lists._box(centers, centers.min(axis=0), centers.max(axis=0), 0.5)
    assert (low > -1.0).all()
    assert (high < 61.0).all()
    lists.update(_scene(model, positions), 0.2)
    near = _all_pairs(positions, radius, 0.0, 0.2)
    assert (0, 1) in near
    assert near <= _listed(lists)


SHAPES = {
    "plane": ([(ShapeKind.PLANE, 0, (0.0, 0.0, 0.0, 1.0))], lambda x, y, a: y - a),
    "circle": (
        [(ShapeKind.CIRCLE, 0, (0.0, 0.0, 5.0, 0.0))],
        lambda x, y, a: 5.0 - np.hypot(x, y) - a,
    ),
    "disc": (
        [(ShapeKind.DISC, 0, (1.0, 1.0, 0.7, 0.0))],
        lambda x, y, a: np.hypot(x - 1.0, y - 1.0) - 0.7 - a,
    ),
}


@pytest.mark.parametrize("name", SHAPES)
def test_wall_shapes_are_listed(name):
    shapes, gap = SHAPES[name]
    rng = np.random.default_rng(4)
    n = 200
    radius = rng.uniform(0.1, 0.5, n)
    positions = np.column_stack([rng.uniform(-4, 4, n), rng.uniform(-4, 4, n), np.zeros(n)])
    model = make_model(radius, shapes)
    lists = NeighborList(model)
    lists.update(_scene(model, positions), 0.1)
    near = {
        (int(i), n) for i in np.flatnonzero(gap(positions[:, 0], positions[:, 1], radius) < 0.1)
    }
    assert near <= _listed(lists)
    assert near


def test_shapes_turn_with_their_wall():
    kind = np.array([ShapeKind.SEGMENT, ShapeKind.PLANE, ShapeKind.DISC], np.int32)
    local = np.array([[1.0, 0.0, 2.0, 0.0], [0.0, 0.0, 0.0, 1.0], [1.0, 0.0, 0.3, 0.0]])
    world = np.empty((3, 4))
    place_shapes(kind, np.zeros(3, np.int32), local, np.array([[5.0, 7.0, np.pi / 2]]), world)
    expected = [[5.0, 8.0, 5.0, 9.0], [5.0, 7.0, -1.0, 0.0], [5.0, 8.0, 0.3, 0.0]]
    assert world == pytest.approx(np.array(expected), abs=1e-12)
