"""Convex pieces of polygons against shapely's unions, and measures against closed forms."""

import numpy as np
import pytest
import shapely
from shapely.geometry import Polygon
from shapely.geometry.polygon import orient

from multicor_cli.model.decomposition import convex_pieces, turns, without_idle
from multicor_cli.model.measures import measure, measure_polygons


def rings_of(polygon):
    polygon = orient(polygon)
    return [without_idle(np.array(ring.coords)) for ring in (polygon.exterior, *polygon.interiors)]


def star(rng, count, holes):
    """A polygon around the origin with corners turned in and out, and holes in it."""
    angle = np.sort(2 * np.pi * (np.arange(count) + rng.uniform(-0.4, 0.4, count)) / count)
    found = Polygon((rng.uniform(0.3, 1.0, count) * [np.cos(angle), np.sin(angle)]).T)
    for _ in range(holes):
        spot = rng.uniform(-0.4, 0.4, 2)
        turn = np.sort(rng.uniform(0, 2 * np.pi, 6))
        hole = Polygon(spot + (rng.uniform(0.02, 0.15, 6) * [np.cos(turn), np.sin(turn)]).T)
        if hole.is_valid and found.buffer(-1e-3).contains(hole):
            without = found.difference(hole)
            if without.geom_type == "Polygon" and len(without.interiors) > len(found.interiors):
                found = without
    return found


def pixels(rng, size):
    """Polygons around squares of a grid: many corners in line, and many holes."""
    boxes = [
        shapely.box(i, j, i + 1, j + 1) for i, j in np.argwhere(rng.random((size, size)) < 0.8)
    ]
    union = shapely.union_all(boxes)
    for polygon in getattr(union, "geoms", [union]):
        corners = [c for ring in rings_of(polygon) for c in map(tuple, ring)]
        if len(set(corners)) == len(corners):  # squares that meet at a corner touch
            yield polygon


def check(polygon):
    """Pieces are convex, do not overlap, make up the polygon, and are few; how many there are."""
    rings = rings_of(polygon)
    pieces = convex_pieces(rings)
    for piece in pieces:
        assert (turns(piece) > 1e-9).all()
    areas = [Polygon(piece) for piece in pieces]
    assert sum(each.area for each in areas) == pytest.approx(polygon.area, rel=1e-12)
    off = shapely.union_all(areas).symmetric_difference(polygon).area
    assert off < 1e-12 * polygon.area
    inward = sum(int((turns(ring) < -1e-9).sum()) for ring in rings)
    assert len(pieces) <= 1.5 * inward + 1
    return len(pieces), inward


def test_pieces_make_up_the_polygon():
    rng = np.random.default_rng(1)
    stars = [star(rng, rng.integers(5, 60), rng.integers(0, 5)) for _ in range(120)]
    assert max(len(each.interiors) for each in stars) >= 3
    pixel = [polygon for _ in range(20) for polygon in pixels(rng, 10)]
    assert max(len(each.interiors) for each in pixel) >= 3
    found = np.array([check(polygon) for polygon in stars + pixel]).sum(axis=0)
    assert found[0] < 1.2 * found[1]  # a triangulation has more than twice as many


def test_pieces_are_those_one_would_draw():
    corner = np.array([[0, 0], [3, 0], [3, 1], [1, 1], [1, 3], [0, 3]], float)
    assert len(convex_pieces([corner])) == 2
    cross = np.array([[1, 0], [2, 0], [2, 1], [3, 1], [3, 2], [2, 2], [2, 3], [1, 3], [1, 2], [0, 2],
                      [0, 1], [1, 1]], float)  # fmt: skip
    assert len(convex_pieces([cross])) == 3
    square = 4.0 * np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    (piece,) = convex_pieces([square])
    assert np.array_equal(piece, square)
    assert len(convex_pieces([square, square[::-1] / 2 + 1])) == 4


def test_corners_that_nearly_touch_are_told():
    tip = np.array([[0, 0], [4, 0], [4, 3], [2, 1e-12], [0, 3]], float)
    assert convex_pieces([tip]) is None


def test_idle_corners_go():
    ring = np.array([[0, 0], [0, 0], [1, 0], [2, 0], [2, 2], [0, 2], [0, 1], [0, 0]], float)
    assert without_idle(ring).tolist() == [[0, 0], [2, 0], [2, 2], [0, 2]]


def test_measures_are_those_of_the_pieces_and_of_closed_forms():
    rng = np.random.default_rng(2)
    polygons = [star(rng, 20, 3) for _ in range(10)]
    off = np.array([300.0, -40.0])
    rings = [[ring + off for ring in rings_of(polygon)] for polygon in polygons]
    found = measure_polygons(rings)
    pieces = measure([[(piece, 0.0) for piece in convex_pieces(each)] for each in rings])
    for name, value in pieces._asdict().items():
        assert getattr(found, name) == pytest.approx(value, rel=1e-11), name
    assert found.area == pytest.approx([each.area for each in polygons], rel=1e-12)
    assert found.perimeter == pytest.approx([each.length for each in polygons], rel=1e-12)
    centers = [each.centroid.coords[0] for each in polygons]
    assert found.center - off == pytest.approx(np.array(centers), abs=1e-12)
    # A square with a hole off its middle, by parallel axes
    outer, hole = shapely.box(0, 0, 4, 4), shapely.box(0.5, 0.5, 1.5, 1.5)
    one = measure_polygons([rings_of(outer.difference(hole))])
    mid = (16 * 2.0 - 1.0) / 15
    square = 16 * (32 / 12 + 2 * (2 - mid) ** 2) - (2 / 12 + 2 * (1 - mid) ** 2)
    assert one.gyration[0] == pytest.approx(square / 15, rel=1e-13)
