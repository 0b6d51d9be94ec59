"""Profiles of made-up runs against closed forms and direct computation."""

from dataclasses import replace

import numpy as np
import pytest
from from_wall_to_wall import profile
from made_up_frames import frame_of, source_of
from scene_parts import between_planes, make_shapes

from multicor_cli import post
from multicor_cli.model import ShapeKind, Walls
from multicor_cli.post import PostError, Selection
from multicor_cli.post.sums import spread

EVERY = Selection(frames=slice(None))


def make_source(y, radius, speed, *, lid=0.0, lid_speed=1.0):
    """Frames with heights ``y`` and velocities ``speed``, both ``(frames, n)``, between walls at 0
    and 1 + lid."""
    walls = {
        "wall_position": np.array([[0.0, 0.0, 0.0], [0.0, lid, 0.0]]),
        "wall_velocity": np.array([[0.0, 0.0, 0.0], [lid_speed, 0.0, 0.0]]),
    }
    frames = []
    for heights, values in zip(y, speed, strict=True):
        none = np.zeros_like(heights)
        frame = frame_of(
            np.column_stack([none, heights]), **{k: v.copy() for k, v in walls.items()}
        )
        frame.velocity[:, 0] = values
        frames.append(frame)
    return source_of(between_planes(radius), frames)


def with_shapes(source, kinds, geometry):
    shapes = make_shapes(list(zip(kinds, range(len(kinds)), geometry, strict=True)))
    return source_of(replace(source.model, shapes=shapes), source.frames)


def two_grains(kinds, geometry, lower, lid, x=0.0):
    """Two grains in two frames, ``x`` apart, and two walls at the places ``lower`` and ``lid``."""
    source = make_source(np.array([[0.1, 0.3], [0.1, 0.4]]), np.full(2, 0.1), np.ones((2, 2)))
    for frame in source.frames:
        frame.position[:, 0] = [0.0, x]
        frame.wall_position[:] = [[*lower, 0.0], [0.0, lid, 0.0]]
    return with_shapes(source, kinds, geometry)


def random_source(frames=7, n=60, seed=1):
    rng = np.random.default_rng(seed)
    radius = rng.uniform(0.02, 0.12, n)
    y = radius + rng.uniform(0.0, 1.0, (frames, n)) * (1.0 - 2.0 * radius)
    return make_source(y, radius, rng.normal(y, 0.1))


def test_errors_are_those_of_the_frames_and_drifts_are_told():
    rng = np.random.default_rng(2)
    speed = np.repeat(rng.normal(size=(60, 1)), 2, axis=1)
    drifting = speed + np.linspace(0.0, 10.0, 60)[:, np.newaxis]
    steady, drift = (
        profile(make_source(np.full((60, 2), 0.5), np.full(2, 0.1), v), selection=EVERY, bins=1)
        for v in (speed, drifting)
    )
    assert steady.error[0] == pytest.approx(float(spread(speed[:, 0]).error))
    assert steady.note == ""
    assert "1 bin drift, most in bin 1: by " in drift.note
    slope = np.polyfit(np.arange(60), drifting[:, 0], 1)[0]
    found = float(drift.note.split("by ")[1].split(";")[0])
    assert found == pytest.approx(slope * 59, rel=0.05)


def test_normalized_runs_from_wall_to_wall():
    """The lid is 0.5 higher than in its frame and moves at −2 m/s."""
    y = np.array([[0.2, 0.75, 1.3]])
    source = make_source(y, np.full(3, 0.1), -2.0 * y / 1.5, lid=0.5, lid_speed=-2.0)
    table = profile(source, bins=3)
    assert table.height == pytest.approx(1.5)
    assert table.walls == ("bottom", "top")
    scaled = table.normalized()
    assert scaled.y == pytest.approx([1 / 6, 3 / 6, 5 / 6])
    assert scaled.value == pytest.approx(y[0] / 1.5)
    assert scaled.units == ("1", "1")
    assert scaled.normalized() is scaled


def test_normalizing_needs_two_walls_that_differ():
    source = make_source(np.full((2, 2), 0.5), np.full(2, 0.1), np.ones((2, 2)), lid_speed=0.0)
    with pytest.raises(PostError, match="different horizontal velocity"):
        profile(source).normalized()
    alone = with_shapes(source, [ShapeKind.PLANE, ShapeKind.PLANE], [[0, 0, 1, 0], [1, 0, -1, 0]])
    table = profile(alone)
    assert table.walls == ("", "")
    assert table.height == pytest.approx(0.2)  # from the lowest to the highest point of the grains
    with pytest.raises(PostError, match="a wall below and a wall above"):
        table.normalized()


SEGMENT, PLANE, DISC = ShapeKind.SEGMENT, ShapeKind.PLANE, ShapeKind.DISC


def gate(width, lower):
    """A gate that was dropped: heights do not count from where it lies now."""
    return two_grains([SEGMENT] * 2, [[0, 0, width, 0], [0, 0, 0.1, 0]], lower, 9.0, x=1.0)


@pytest.mark.parametrize(
    ("source", "floor", "height"),
    [
        (two_grains([SEGMENT, PLANE], [[3, 0, 4, 0], [0, 0, 1, 0]], (0, -0.05), 0.0), "bottom", 0.55),
        # a solid disc below most grains
        (two_grains([SEGMENT, DISC], [[3, 0, 4, 0], [1, 0, 0.15, 0]], (0, -0.05), 0.05), "bottom", 0.55),
        (gate(0.3, (0.4, -1.0)), "", 0.5),
        (gate(0.7, (0.4, -1.0)), "bottom", 1.5),
        (gate(0.7, (0.4, -5.0)), "", 0.5),
    ],
    ids=["no lid", "disc", "narrow gate", "wide gate", "gate far away"],
)  # fmt: skip
def test_which_walls_are_a_floor(source, floor, height):
    """Without one heights count from the lowest point of the grains."""
    table = profile(source, selection=EVERY)
    assert table.walls == (floor, "")
    assert table.height == pytest.approx(height)


def test_selection_of_frames():
    source = make_source(np.full((10, 2), 0.5), np.full(2, 0.1), np.ones((10, 2)))
    source.frames.stage = np.array([0] * 4 + [1] * 6)
    for selection, expected in (
        # The last stage's frames are 4 … 9, its later half begins at 6.5
        (None, [7, 8, 9]),
        (Selection(start=2.0, end=4.5), [2, 3, 4]),
        (Selection(end=1.0), [0, 1]),
        (Selection(frames=slice(None, None, 4)), [0, 4, 8]),
        (Selection(frames=slice(-2, None)), [8, 9]),
    ):
        assert profile(source, selection=selection).frames.tolist() == expected
    with pytest.raises(PostError, match="10 frames from t = 0 s to 9 s"):
        profile(source, selection=Selection(start=20.0))


def test_what_cannot_be_done_is_refused():
    source = random_source()
    with pytest.raises(PostError, match="choose from: velocity"):
        profile(source, "wetness")
    with pytest.raises(PostError, match="between 1 and"):
        profile(source, bins=0)
    with pytest.raises(PostError, match="no frames yet"):
        profile(source_of(source.model, []))


def test_the_layers_at_the_walls_are_left_out_unless_told_otherwise():
    source = random_source()
    diameter = source.model.mean_diameter
    table, whole = post.profile(source, "velocity", EVERY), profile(source, "velocity", EVERY)
    edge = min(diameter, 0.125)
    assert table.y[0] - 0.5 * table.width == pytest.approx(edge)
    assert table.y[-1] + 0.5 * table.width == pytest.approx(1.0 - edge)
    assert (
        table.about_walls
        == f"left out next to 'bottom' and 'top': {edge / diameter:.3g} of a mean diameter"
    )
    assert table.as_dict()["excluded_at_walls"] == pytest.approx(edge / diameter)
    assert whole.y[0] - 0.5 * whole.width == pytest.approx(0.0)
    assert whole.about_walls == ""


def test_walls_may_be_named():
    """A grid inside the layer, which would bound nothing by itself, and a post that is upright."""
    model = between_planes(np.full(9, 0.05))
    shapes = make_shapes(
        [
            (ShapeKind.PLANE, 0, (0.0, 0.0, 0.0, 1.0)), (ShapeKind.PLANE, 1, (0.0, 1.0, 0.0, -1.0)),
            (ShapeKind.SEGMENT, 2, (0.0, 0.6, 0.2, 0.6)),
            (ShapeKind.SEGMENT, 3, (1.0, 0.0, 1.0, 1.0)),
        ]
    )  # fmt: skip
    fill, none = np.full(4, np.nan), np.zeros(4, bool)
    names = ("bottom", "top", "grid", "post")
    bodies = Walls(names, fill, fill, none, np.ones(4))
    model = replace(model, shapes=shapes, walls=bodies)
    y = np.linspace(0.1, 0.9, 9)
    velocity = np.column_stack([y, 0.0 * y])
    frame = frame_of(np.column_stack([np.full(9, 2.0), y]), walls=4, velocity=velocity)
    source = source_of(model, [frame])
    assert profile(source, "velocity", EVERY, 1).walls == ("bottom", "top")
    lower = profile(source, "velocity", EVERY, 1, between=("bottom", "grid"))
    assert (lower.walls, lower.height) == (("bottom", "grid"), pytest.approx(0.6))
    # of 0.1 to 0.5, and half of that at 0.6
    assert lower.value[0] == pytest.approx(0.325, abs=0.01)
    for walls, message in (
        (("grid", "bottom"), "'grid' is not below 'bottom'"),
        (("bottom", "lid"), "no wall 'lid'"),
        (("bottom", "post"), "'post' is upright"),
    ):
        with pytest.raises(PostError, match=message):
            profile(source, "velocity", EVERY, between=walls)
