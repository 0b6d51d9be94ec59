"""Contact forces: networks and scenes of made-up frames, and distributions that were drawn from
known ones."""

import numpy as np
import pytest
from heat_run import GRAINS, RADIUS
from made_up_frames import contacts_of, frame_of, source_of
from scene_parts import between_planes, make_model

from multicor_cli import post
from multicor_cli.model import ShapeKind


def test_numbers_of_a_network(column):
    """Nine contacts between ten grains and one with the top plane, with 1 … 10 N; the lowest grain
    has only one contact."""
    network = post.force_network(column)
    expected = {
        "contacts": 10, "wall_contacts": 1, "normal_force_mean": 5.5, "normal_force_max": 10.0,
        "tangential_force_mean": 0.55, "coordination": 1.9, "rattler_share": 0.1,
        "sliding_share": 0.4,
    }  # fmt: skip
    assert network.summary == pytest.approx(expected)
    assert dict(network.rows)["coordination number"] == pytest.approx(1.9)
    assert network.as_dict()["frame"] == 4


def test_lines_join_centers_and_images_and_end_at_walls(column):
    network = post.force_network(column)
    heights = RADIUS + 2 * RADIUS * np.arange(GRAINS)
    assert network.start[:, 1] == pytest.approx(heights)
    assert network.end[:, 1] == pytest.approx([*heights[1:], 1.0])
    assert network.detail_rows[-1] == pytest.approx((9, 11, 2.0, 1.0, 0.0, -1.0, 10.0, -1.0, 1))
    assert len(network.detail_rows) == 10


def test_frames_without_forces_are_refused(column, silent):
    with pytest.raises(post.PostError, match="no step of the mechanics was done before"):
        post.force_network(column, 0)
    with pytest.raises(post.PostError, match="no frame -6"):
        post.force_network(column, -6)
    for function in (post.force_network, post.force_distribution, post.angular_distribution):
        with pytest.raises(post.PostError, match=r"contacts = true in \[output\]"):
            function(silent)


def scene_of(kinds, geometry, pose, *, period=0.0):
    shapes = [(kind, 0, numbers) for kind, numbers in zip(kinds, geometry, strict=True)]
    model = make_model([0.5, 0.5], shapes, ("bottom", "top"), period=period)
    walls = np.array([pose, [0.0, 0.0, 0.0]])
    frame = frame_of([[0.5, 0.5], [4.5, 0.5]], wall_position=walls)
    source = source_of(model, [frame])
    return post.make_scene(source, source.frames[0])


def test_walls_are_turned_and_moved_with_their_frame():
    """A quarter turn about (1, 2)."""
    kinds = [ShapeKind.DISC, ShapeKind.SEGMENT, ShapeKind.PLANE, ShapeKind.CIRCLE, ShapeKind.VERTEX]
    geometry = [[1, 0, 0.1, 0], [0, 0, 2, 0], [1, 0, 1, 0], [0, 0, 3, 0], [0, 0, -1, -1]]
    scene = scene_of(kinds, geometry, [1.0, 2.0, np.pi / 2])
    glued, plane, segment, _, circle = scene.walls  # in the order of their kinds
    assert glued.points == pytest.approx(np.array([[[1.0, 3.0]]]))
    assert (glued.radius, glued.is_grain) == ([0.1], True)
    assert segment.points == pytest.approx(np.array([[[1.0, 2.0], [1.0, 4.0]]]))
    assert plane.points == pytest.approx(np.array([[[1.0, 3.0]]]))
    assert plane.normal == pytest.approx(np.array([[0.0, 1.0]]), abs=1e-12)
    assert circle.points == pytest.approx(np.array([[[1.0, 2.0]]]))
    assert (circle.radius, circle.is_grain) == ([3.0], False)


def test_box_holds_the_grains_and_the_walls_nearby():
    near = scene_of([ShapeKind.SEGMENT], [[5.5, 0, 5.5, 3]], [0.0, 0.0, 0.0])
    assert (near.box[0] < [0.0, 0.0]).all()
    assert (near.box[1] > [5.5, 3.0]).all()
    far = scene_of([ShapeKind.SEGMENT], [[0, 50, 5, 50]], [0.0, 0.0, 0.0])
    assert far.box[1, 1] < 1.5
    periodic = scene_of([ShapeKind.DISC], [[9.0, 0.0, 0.3, 0.0]], [0.0, 0.0, 0.0], period=5.0)
    assert periodic.box[:, 0].tolist() == [0.0, 5.0]
    assert periodic.walls[0].points[0, 0, 0] == pytest.approx(4.0)


# ---- Distributions of forces and contact directions that were drawn from known ones, and the
#      forces of a small run

ALL = post.Selection(start=0.0)


def make_source(normal, force, *, frames=1, scale=1.0):
    """Contacts between two grains with these normals and forces; those of the frame of number k are
    ``scale``ᵏ times as large."""
    count = len(force)
    contacts = [
        contacts_of(np.zeros(count), np.ones(count), normal, force * scale**k)
        for k in range(frames)
    ]
    return source_of(between_planes(), [frame_of(np.zeros((2, 2)), contacts=c) for c in contacts])


def exponential(count=200_000):
    rng = np.random.default_rng(4)
    normal = np.tile([0.0, 1.0], (count, 1))
    return normal, np.column_stack([rng.exponential(3.0, count), rng.uniform(-1.0, 1.0, count)])


def test_contacts_without_friction_have_no_tangential_distribution():
    table = post.force_distribution(make_source(np.ones((9, 2)), np.eye(9, 2)), ALL)
    assert np.isnan(table.tangential).all()


@pytest.mark.parametrize("turned", [False, True])
def test_angular_distribution_gives_the_anisotropies_back(turned):
    """Evenly spaced directions weighted by number: contacts drawn with a_c = 0.4 at 120°, forces
    with a_n = 0.3, a_t = 0.1."""
    u = (np.arange(400_000) + 0.5) / 400_000 * 2.0 * np.pi
    theta = u.copy()
    for _ in range(50):  # invert the cumulative distribution θ + a/2 (sin 2(θ − c) + sin 2c) = u
        theta = u - 0.2 * (
            np.sin(2.0 * (theta - np.radians(120.0))) + np.sin(2.0 * np.radians(120.0))
        )
    if turned:
        theta = theta[::-1] + np.pi  # each contact seen from its other grain
    f = 2.0 * (1.0 + 0.3 * np.cos(2.0 * (theta - np.radians(130.0))))
    g = -2.0 * 0.1 * np.sin(2.0 * (theta - np.radians(140.0)))
    table = post.angular_distribution(
        make_source(np.column_stack([np.cos(theta), np.sin(theta)]), np.column_stack([f, g])), ALL
    )
    expected = {"a_c": 0.4, "a_n": 0.3, "a_t": 0.1}
    expected |= {"theta_c": 120.0, "theta_n": 130.0, "theta_t": 140.0}
    assert table.moments == pytest.approx(expected, rel=2e-2)
    density = 1.0 + 0.4 * np.cos(2.0 * (table.angle - np.radians(120.0)))
    assert table.density == pytest.approx(density / (2.0 * np.pi), rel=0.02)
    assert table.density.sum() * 2.0 * np.pi / table.angle.size == pytest.approx(1.0)
    half = table.angle.size // 2
    assert table.density[:half].tolist() == table.density[half:].tolist()


def test_directions_without_contacts_have_no_force():
    normal = np.tile([1.0, 0.0], (10, 1))
    table = post.angular_distribution(make_source(normal, np.ones((10, 2))), ALL, 8)
    assert np.isfinite(table.normal).tolist() == [True, False, False, False] * 2
    assert table.moments["a_c"] == pytest.approx(2.0)
    assert table.moments["theta_c"] == pytest.approx(0.0)
    for bins in (2, 7):
        with pytest.raises(post.PostError, match="even number"):
            post.angular_distribution(make_source(normal, np.ones((10, 2))), ALL, bins)


def test_walls_do_not_count_and_frames_without_forces_are_left_out(column):
    table = post.force_distribution(column, ALL)
    assert table.frames.tolist() == [1, 2, 3, 4]
    assert table.contacts == 4 * (GRAINS - 1)
    assert table.mean == pytest.approx(5.0)  # of 1 … 9 N
    assert post.angular_distribution(column, ALL).moments["theta_c"] == pytest.approx(90.0)
    alone = make_source(np.zeros((0, 2)), np.zeros((0, 2)))
    for function in (post.force_distribution, post.angular_distribution):
        with pytest.raises(post.PostError, match="no two grains press"):
            function(alone, ALL)
