"""D²_min: nothing of an affine deformation, a displaced grain by hand, least squares grain by
grain."""

import numpy as np
import pytest
from cells import make_cell
from made_up_frames import frame_of, source_of
from scene_parts import make_model

from multicor_cli.post import PostError, Selection, grain_map, profile
from multicor_cli.post.flow import NEIGHBORHOOD, d2min

ALL = Selection(start=0.0)
WIDTH, HEIGHT, TILT = 14.0, 12.0, 6.5
STRAIN = np.array([[1.01, 0.2], [0.0, 0.98]])


def cell_frame(position, sides, time):
    frame = frame_of(position, walls=1, time=time)
    frame.wall_position = np.array([sides], float)
    frame.wall_velocity = np.array([[0.01, -0.02, 0.2]])
    return frame


def sheared(noise=0.0, seed=1):
    """Places in a cell and after a deformation, in any images; the tilt has gone around once."""
    random = np.random.default_rng(seed)
    x, y = np.meshgrid(np.arange(14.0), np.arange(12.0))
    start = np.column_stack([x.ravel(), y.ravel()]) + random.uniform(-0.2, 0.2, (168, 2))
    end = start @ STRAIN.T + noise * random.normal(size=(168, 2))
    up = STRAIN @ [TILT, HEIGHT]
    sides = (STRAIN[0, 0] * WIDTH, up[1], up[0] - STRAIN[0, 0] * WIDTH)
    images = random.integers(-1, 2, (168, 2)) @ [[sides[0], 0.0], [sides[2], sides[1]]]
    model, _ = make_cell(start, np.full(168, 0.5), (WIDTH, HEIGHT), tilt=TILT)
    frames = [cell_frame(start, (WIDTH, HEIGHT, TILT), 0.0), cell_frame(end + images, sides, 1.0)]
    return model, frames, start, end


def one_by_one(start, end, images):
    """Least squares of the neighbors of each grain, whose images move ``images``: from, to."""
    found = []
    for i in range(len(start)):
        before, after = [], []
        for one, two in images:
            away = start + one - start[i]
            near = (np.hypot(*away.T) <= NEIGHBORHOOD) & (np.hypot(*away.T) > 0.0)
            before.append(away[near])
            after.append((end + two - end[i])[near])
        before, after = np.concatenate(before), np.concatenate(after)
        _, left, rank, _ = np.linalg.lstsq(before, after, rcond=None)
        is_known = len(before) > 2 and rank == 2
        found.append(left.sum() / len(before) if is_known else np.nan)
    return np.array(found)


def test_an_affine_deformation_leaves_nothing():
    model, frames, _, _ = sheared()
    assert d2min(model, *frames).max() < 1e-28


def test_least_squares_grain_by_grain_in_a_cell():
    model, frames, start, end = sheared(0.05)
    ways = [(a * WIDTH + b * TILT, b * HEIGHT) for a in (-1, 0, 1) for b in (-1, 0, 1)]
    images = [(np.array(way), STRAIN @ way) for way in ways]
    expected = one_by_one(start, end, images)
    assert d2min(model, *frames) == pytest.approx(expected, rel=1e-9)


def layer_frames(start, moves, period=9.0):
    """Frames of grains that move by so much each time, wrapped into a period."""
    frames, place = [], start.copy()
    for move in moves:
        place = place + move
        wrapped = place.copy()
        wrapped[:, 0] %= period
        frames.append(frame_of(wrapped, walls=1, unwrapped=place.copy()))
    return frames


def test_a_displaced_grain_by_hand():
    """In the middle of eight: e away, its neighbors are where they were. Of them it is seen
    displaced by −e each, of which no gradient explains anything by symmetry: its D² is e². Of a
    neighbor one of the displacements r → e is left by what a gradient explains."""
    x, y = np.meshgrid([4.0, 5.0, 6.0], [4.0, 5.0, 6.0])
    start = np.column_stack([x.ravel(), y.ravel()])
    move = np.zeros((9, 2))
    move[4] = [0.03, -0.01]
    model = make_model(np.full(9, 0.5), period=30.0)
    frames = layer_frames(start, [np.zeros((9, 2)), move], 30.0)
    found = d2min(model, *frames)
    assert found[4] == pytest.approx(0.03**2 + 0.01**2, rel=1e-12)
    corner = start - start[0]
    corner = corner[(np.hypot(*corner.T) > 0.0) & (np.hypot(*corner.T) <= NEIGHBORHOOD)]
    r = np.array([1.0, 1.0])  # of the middle, seen from the corner
    explained = r @ np.linalg.inv(corner.T @ corner) @ r
    assert found[0] == pytest.approx((1.0 - explained) * 0.001 / len(corner), rel=1e-12)


def test_maps_and_profiles_of_a_layer():
    """Between consecutive frames of those chosen; the first has none before it."""
    random = np.random.default_rng(4)
    x, y = np.meshgrid(np.arange(9.0), np.arange(6.0) + 0.5)
    start = np.column_stack([x.ravel(), y.ravel()])
    moves = [random.normal((0.4, 0.0), 0.1, (54, 2)) for _ in range(4)]
    model = make_model(np.full(54, 0.5), period=9.0)
    source = source_of(model, layer_frames(start, moves))
    places = [frame.unwrapped for frame in source.frames]
    images = [(np.array([way, 0.0]),) * 2 for way in (-9.0, 0.0, 9.0)]
    expected = [one_by_one(places[k], places[k + 1], images) for k in range(3)]
    assert grain_map(source, "d2min", 2).value == pytest.approx(expected[1], rel=1e-9)
    table = profile(source, "d2min", ALL, 1)
    assert table.value[0] == pytest.approx(np.mean(expected), rel=1e-9)
    assert table.frames.tolist() == [0, 1, 2, 3]
    lag = profile(source, "d2min", Selection(frames=slice(0, None, 3)), 1)
    assert lag.value[0] == pytest.approx(one_by_one(places[0], places[3], images).mean(), rel=1e-9)


def test_few_neighbors_have_none_and_one_frame_is_refused():
    model = make_model(np.full(3, 0.5))
    row = np.array([[0.0, 0.5], [1.0, 0.5], [2.0, 0.5]])
    frames = layer_frames(row, [np.zeros((3, 2))] * 2, np.inf)
    assert np.isnan(d2min(model, *frames)).all()
    source = source_of(model, frames)
    with pytest.raises(PostError, match="needs two frames; only one is selected"):
        profile(source, "d2min", Selection(frames=slice(0, 1)))
    with pytest.raises(PostError, match="frame 0 has none"):
        grain_map(source, "d2min", 0)
    assert grain_map(source, "d2min", 1).rows == [("grains", 0.0)]
