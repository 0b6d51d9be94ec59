"""Areas: sizes and distances against closed forms, winding numbers and points thrown at random."""

import math
from itertools import pairwise

import numpy as np
import pytest
from stars import star, winding

from multicor_cli.model.shapes import Annulus, Discs, Polygon, Rectangle, Room, fault_of_polygon

L_SHAPE = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]])
AREAS = {
    "rectangle": Rectangle((-1.0, -0.5), (1.5, 1.0)),
    "disc": Annulus((0.2, -0.1), 1.3),
    "annulus": Annulus((0.2, -0.1), 1.3, 0.6),
    "polygon": Polygon(L_SHAPE - 1.0),
    "clockwise": Polygon(L_SHAPE[::-1] - 1.0),
    "discs": Discs(np.array([[-1.0, 0.0, 0.7], [0.5, 0.0, 0.8], [0.5, 1.8, 1.0]])),
}
POINTS = np.random.default_rng(2).uniform(-2.5, 3.0, (4000, 2))


@pytest.mark.parametrize("name", AREAS)
def test_size_and_depth_are_those_of_random_points(name):
    area = AREAS[name]
    low, high = area.corners()
    points = np.random.default_rng(1).uniform(low, high, (200_000, 2))
    share = area.contains(points).mean()
    error = math.sqrt(share * (1.0 - share) / len(points))
    assert area.size == pytest.approx(
        share * np.prod(high - low), abs=5.0 * error * np.prod(high - low)
    )
    boundary = outline(AREAS[name])
    distance = np.array([np.hypot(*(boundary - point).T).min() for point in POINTS[:500]])
    assert np.abs(AREAS[name].depth(POINTS[:500])) == pytest.approx(distance, abs=5e-3)
    assert AREAS[name].contains(boundary + 1e-9 * (boundary.mean(axis=0) - boundary)).any()


def outline(area):
    """Many points of the boundary."""
    angle = np.linspace(0.0, 2.0 * np.pi, 4000)
    around = np.column_stack([np.cos(angle), np.sin(angle)])
    if isinstance(area, Annulus):
        return np.concatenate(
            [area.center + radius * around for radius in (area.outer, area.inner) if radius]
        )
    if isinstance(area, Discs):
        return np.concatenate([row[:2] + row[2] * around for row in area.discs])
    low, high = area.corners()
    corners = (
        area.points
        if isinstance(area, Polygon)
        else np.array([low, [high[0], low[1]], high, [low[0], high[1]]])
    )
    along = np.linspace(0.0, 1.0, 2000)[:, np.newaxis]
    return np.concatenate([a + along * (b - a) for a, b in pairwise([*corners, corners[0]])])


@pytest.mark.parametrize("seed", range(20))
def test_points_in_polygons_are_those_that_it_winds_around(seed):
    rng = np.random.default_rng(seed)
    corners = star(rng, int(rng.integers(3, 40)), 0.3, 1.0)
    points = rng.uniform(-1.1, 1.1, (2000, 2))
    assert np.array_equal(Polygon(corners).contains(points), winding(corners, points) != 0)


def test_a_ray_through_corners_counts_them_once():
    diamond = Polygon(np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]]))
    assert diamond.contains(
        np.array([[0.0, 0.0], [-0.5, 0.0], [-2.0, 0.0], [-0.5, 1.0], [1.0, 0.0]])
    ).tolist() == [1, 1, 0, 0, 1]


def test_moments_of_polygons_are_those_of_the_textbook():
    """Rectangle: A (w² + h²)/12; regular n-gon of circumradius R: A R² (2 + cos 2π/n)/6; any place,
    any direction."""
    rectangle = Polygon(np.array([[2.0, 1.0], [5.0, 1.0], [5.0, 3.0], [2.0, 3.0]]))
    assert rectangle.centroid == pytest.approx([3.5, 2.0])
    assert rectangle.polar_moment == pytest.approx(6.0 * (9.0 + 4.0) / 12.0)
    angle = 2.0 * np.pi * np.arange(7) / 7
    heptagon = Polygon(np.column_stack([4.0 + 2.0 * np.cos(angle), -3.0 - 2.0 * np.sin(angle)]))
    assert heptagon.signed_size == pytest.approx(-0.5 * 7 * 4.0 * math.sin(2.0 * math.pi / 7))
    assert heptagon.centroid == pytest.approx([4.0, -3.0])
    assert heptagon.polar_moment == pytest.approx(
        heptagon.size * 4.0 * (2.0 + math.cos(2.0 * math.pi / 7)) / 6.0
    )
    assert heptagon.perimeter == pytest.approx(7 * 4.0 * math.sin(math.pi / 7))


def test_moments_of_an_irregular_polygon_are_those_of_random_points():
    polygon = Polygon(L_SHAPE)
    points = np.random.default_rng(4).uniform(*polygon.corners(), (400_000, 2))
    inside = points[polygon.contains(points)]
    assert inside.mean(axis=0) == pytest.approx(polygon.centroid, abs=5e-3)
    assert ((inside - polygon.centroid) ** 2).sum(axis=1).mean() == pytest.approx(
        polygon.polar_moment / polygon.size, rel=5e-3
    )


@pytest.mark.parametrize(("points", "corner", "words"), [
    ([[0, 0], [1, 1], [1, 0], [0, 1]], 0, "crosses"),
    ([[0, 0], [1, 0], [1, 1], [0, 0], [-1, 1]], 3, "twice"),
    ([[0, 0], [2, 0], [1, 0], [1, 1]], 1, "back on itself"),
    ([[0, 0], [4, 0], [4, 2], [2, 0], [0, 2]], 0, "touches"),
    ([[0, 0], [1, 0], [2, 0]], 0, "back on itself"),
])  # fmt: skip
def test_what_is_no_simple_polygon(points, corner, words):
    fault = fault_of_polygon(np.array(points, float))
    assert fault[0] == corner
    assert words in fault[1]


def test_simple_polygons_have_no_fault():
    rng = np.random.default_rng(8)
    for corners in [L_SHAPE, L_SHAPE[::-1], *(star(rng, 30, 0.3, 1.0) for _ in range(20))]:
        assert fault_of_polygon(corners) is None


def test_a_room_is_what_areas_leave_and_repeats_with_the_period():
    room = (
        Room(period=4.0)
        .within(Rectangle((-9.0, 0.0), (9.0, 2.0)))
        .without(Annulus((3.9, 1.0), 0.5))
    )
    points = np.array([[2.0, 1.5], [3.0, 1.0], [0.1, 1.0], [0.9, 1.0], [7.6, 1.0]])
    assert room.clearance(points) == pytest.approx([0.5, 0.4, -0.3, 0.5, -0.2])
    assert Room().is_open
    assert np.isinf(Room().clearance(points)).all()
