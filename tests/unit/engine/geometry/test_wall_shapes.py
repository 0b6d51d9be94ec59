"""Every kind of wall shape: what is compiled (gap and normal) agrees with what the table says
(outline, motion with the wall)."""

import numpy as np
import pytest

from multicor_cli.engine.geometry.scene import gap_to_shape, is_near_shape, place_shapes
from multicor_cli.model.shapes import SHAPES, ShapeKind, WallBody, outlines

EXAMPLES = {
    ShapeKind.DISC: (0.5, -0.2, 0.7, 0.0), ShapeKind.PLANE: (0.3, 0.1, 0.6, 0.8),
    ShapeKind.SEGMENT: (-0.5, 0.2, 1.0, 0.6), ShapeKind.VERTEX: (0.4, 0.3, -1.0, -1.0),
    ShapeKind.CIRCLE: (0.2, 0.1, 2.5, 0.0), ShapeKind.SIDE: (0.4, -0.9, -0.6, 0.7),
}  # fmt: skip
"""Four numbers of a shape of each kind; all grains lie within a square of side 3 around the
origin."""

RADIUS = 0.3
GRAINS = np.random.default_rng(3).uniform(-1.5, 1.5, (200, 2))
NO_PERIOD = 0.0


def world_of(kind, pose=(0.0, 0.0, 0.0)):
    world = np.empty((1, 4))
    place_shapes(
        np.array([kind], np.int32), np.zeros(1, np.int32), np.array([EXAMPLES[kind]]),
        np.array([pose]), world,
    )  # fmt: skip
    return world


def gaps(kind, grains, world):
    """Gap and normal of each grain, shape ``(n, 3)``."""
    return np.array(
        [
            gap_to_shape(x, y, RADIUS, 0, np.array([kind], np.int32), world, NO_PERIOD)
            for x, y in grains
        ]
    )


def are_near(kind, grains, cutoffs):
    shape, world = (0, np.array([kind], np.int32)), world_of(kind)
    return np.array(
        [
            is_near_shape(x, y, RADIUS, *shape, world, NO_PERIOD, c)
            for (x, y), c in zip(grains, cutoffs, strict=True)
        ]
    )


def test_kinds_stand_in_the_order_of_their_numbers():
    assert list(SHAPES) == list(ShapeKind) == list(EXAMPLES)
    assert [int(kind) for kind in ShapeKind] == list(range(len(SHAPES)))


@pytest.mark.parametrize("kind", ShapeKind)
def test_outlines_are_where_grains_touch_and_move_with_their_wall(kind):
    ((which, outline),) = outlines(np.array([kind]), np.array([EXAMPLES[kind]]))
    assert which.tolist() == [0]
    points = outline.points[0]
    if outline.radius is not None:
        angle = np.linspace(0.0, 6.0, 20)
        points = points + outline.radius * np.column_stack([np.cos(angle), np.sin(angle)])
    if outline.normal is not None:
        points = points + np.linspace(-3.0, 3.0, 20)[:, np.newaxis] * outline.normal[0, ::-1] * (
            -1,
            1,
        )
    assert are_near(kind, points, np.full(len(points), 1e-9 - RADIUS)).all()
    gap = gaps(kind, points, world_of(kind))[:, 0]
    assert gap[np.isfinite(gap)] == pytest.approx(-RADIUS, abs=1e-12)
    angle = 0.7
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, s], [-s, c]])
    before, after = (
        gaps(kind, GRAINS, world_of(kind)),
        gaps(kind, GRAINS @ turn + (3.0, -2.0), world_of(kind, (3.0, -2.0, angle))),
    )
    assert np.isfinite(before[:, 0]).any()
    assert after[:, 0] == pytest.approx(before[:, 0], abs=1e-12)
    touching = np.isfinite(before[:, 0])
    assert after[touching, 1:] == pytest.approx(before[touching, 1:] @ turn, abs=1e-12)


@pytest.mark.parametrize("kind", ShapeKind)
def test_gaps_grow_along_their_normals_and_are_near_before_a_touch(kind):
    found = gaps(kind, GRAINS, world_of(kind))
    touching, way = np.isfinite(found[:, 0]), 1e-4
    assert np.hypot(*found[touching, 1:].T) == pytest.approx(1.0)
    moved = gaps(kind, GRAINS[touching] + way * found[touching, 1:], world_of(kind))
    assert moved[:, 0] == pytest.approx(found[touching, 0] + way, abs=1e-9)
    # So the list of neighbors holds them
    gap = gaps(kind, GRAINS, world_of(kind))[:, 0]
    after, cutoff = GRAINS[np.isfinite(gap)], gap[np.isfinite(gap)] + 1e-9
    for step in np.random.default_rng(5).normal(0.0, 0.3, (10, *after.shape)):
        assert are_near(kind, after - step, cutoff + np.hypot(*step.T)).all()


PERIOD = 1.0
LINES = {
    "full-width floor": ([[0.0, 0.4], [1.0, 0.4]], False),
    "ramp that ends above its image": ([[0.02, 0.5], [1.0, 0.3]], False),
    "nearly half a period": ([[0.0, 0.3], [0.49, 0.33]], False),
    "half a period": ([[0.3, 0.3], [0.8, 0.3]], False),
    "several periods": ([[0.0, 0.9], [1.4, 0.6], [2.7, 0.2]], False),
    "a sawtooth without ends": ([[0.0, 0.5], [0.7, 0.2], [1.0, 0.5]], False),
    "a wide triangle": ([[0.1, 0.2], [0.9, 0.2], [0.5, 0.5]], True),
    "an upright side": ([[0.2, 0.1], [0.2, 1.7]], False),
}


@pytest.mark.parametrize(
    "pose", [(0.0, 0.0, 0.0), (-7.3, 0.2, 0.0), (0.55, 0.1, 0.9), (3.2, -0.1, -2.2)]
)
@pytest.mark.parametrize("name", LINES)
def test_a_line_in_a_periodic_domain_is_where_it_is_drawn(name, pose):
    """Against the distances to all images of the line, by brute force."""
    drawn, is_closed = LINES[name]
    if pose[2] and drawn[-1][0] - drawn[0][0] == PERIOD and drawn[-1][1] == drawn[0][1]:
        pose = (pose[0], pose[1], 0.0)  # one without ends cannot turn
    points = np.array(drawn)
    body = WallBody.empty((0.0, 0.0), 1.0).with_line(points, PERIOD, is_closed=is_closed)
    world = np.empty(body.geometry.shape)
    place_shapes(
        body.kind, np.zeros(len(body.kind), np.int32), body.geometry, np.array([pose]), world
    )
    turn = np.array([[np.cos(pose[2]), np.sin(pose[2])], [-np.sin(pose[2]), np.cos(pose[2])]])
    corners = points @ turn + pose[:2]
    ends = np.roll(corners, -1, axis=0) if is_closed else corners[1:]
    radius, cutoff = PERIOD / 8.0, PERIOD / 8.0
    near = 0
    for x, y in np.random.default_rng(5).uniform((0.0, -1.5), (PERIOD, 2.5), (300, 2)):
        images = np.column_stack([x + PERIOD * np.arange(-12, 13), np.full(25, y)])
        distance = min(distances(images, a, b).min() for a, b in zip(corners, ends, strict=False))
        found = [
            gap_to_shape(x, y, radius, k, body.kind, world, PERIOD) for k in range(len(body.kind))
        ]
        listed = [
            is_near_shape(x, y, radius, k, body.kind, world, PERIOD, cutoff)
            for k in range(len(body.kind))
        ]
        if distance < radius + cutoff:
            near += 1
            assert min(gap for gap, _, _ in found) == pytest.approx(distance - radius, abs=1e-9)
        assert any(listed) == (distance < radius + cutoff)
        assert all(near for near, (gap, _, _) in zip(listed, found, strict=True) if gap < cutoff)
    assert near > 30


def distances(points, start, end):
    way = end - start
    along = np.clip((points - start) @ way / (way @ way), 0.0, 1.0)
    return np.hypot(*(points - start - along[:, np.newaxis] * way).T)
