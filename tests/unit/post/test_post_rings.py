"""Lines around grains of any shape: what they enclose is what the pieces of the grains cover."""

import numpy as np
import pytest
from matplotlib.path import Path
from shaped_run import ANGLE, DISC, DUMBBELL, FRAME, PENTAGON, ROD, box, make_outlines
from shapes import regular

from multicor_cli.model.outlines import Outlines
from multicor_cli.post.rings import FINE, Rings, joined, rings_of


def depth_in_pieces(points, pieces):
    """How deep points lie in the union of pieces; negative outside, by distances to cores."""
    found = np.full(len(points), -np.inf)
    for corners, rounding in pieces:
        start, end = corners, np.roll(corners, -1, axis=0)
        way, to = end - start, points[:, np.newaxis] - start
        share = (to * way).sum(axis=2) / np.maximum((way**2).sum(axis=1), 1e-300)
        foot = np.clip(share, 0.0, 1.0)[..., np.newaxis] * way
        distance = np.hypot(*np.moveaxis(to - foot, 2, 0)).min(axis=1)
        left = way[:, 0] * to[..., 1] - way[:, 1] * to[..., 0] > 0.0
        inside = left.all(axis=1) & (len(corners) > 2)
        found = np.maximum(found, rounding + np.where(inside, distance, -distance))
    return found


def winding(points, rings):
    """How often rings go around points: each counter-clockwise one adds 1."""
    turns = np.zeros(len(points))
    for ring in rings:
        x, y = (ring[np.newaxis] - points[:, np.newaxis]).transpose(2, 0, 1)
        u, v = np.roll(x, -1, axis=1), np.roll(y, -1, axis=1)
        turns += np.arctan2(x * v - y * u, x * u + y * v).sum(axis=1) / (2.0 * np.pi)
    return np.rint(turns).astype(int)


def check_cover(outlines, rings, grain, count=4000):
    """Rings go once around points that a grain covers, and around no other."""
    radius = outlines.radius[grain]
    points = np.random.default_rng(grain).uniform(-1.1 * radius, 1.1 * radius, (count, 2))
    depth = depth_in_pieces(points, outlines.pieces(grain))
    clear = np.abs(depth) > FINE * radius
    assert clear.sum() > 0.97 * count
    own = [ring for ring, of in zip(rings, rings.grain, strict=True) if of == grain]
    assert winding(points[clear], own).tolist() == (depth[clear] > 0.0).astype(int).tolist()


def test_rings_enclose_what_grains_cover():
    outlines = make_outlines()
    rings = rings_of(outlines)
    assert np.bincount(rings.grain).tolist() == [1, 1, 1, 1, 1, 1, 1, 2, 1]  # a frame has a hole
    for grain in range(outlines.area.size):
        check_cover(outlines, rings, grain)
    assert rings.area == pytest.approx(outlines.area, rel=2.0 * FINE)
    sharp = np.array([outlines.rounding[p] == 0.0 for p in outlines.piece[:-1]])
    assert rings.area[sharp] == pytest.approx(outlines.area[sharp], rel=1e-8)


def test_arcs_have_as_many_points_as_they_need():
    lengths = np.diff(rings_of(make_outlines()).start)
    # A half circle of half the radius, and one side of five
    whole, half, corner = np.pi / np.arccos(1.0 - np.array([1.0, 3.0, 5.5]) * FINE)
    assert lengths[DISC] == np.ceil(whole)
    assert lengths[ROD] == 2 * (np.ceil(half / 2) + 1)
    assert lengths[PENTAGON] == 5 * (np.ceil(corner / 5) + 1)
    coarse = np.diff(rings_of(make_outlines(), 5e-3).start)
    assert coarse[DISC] == 32


def test_clumps_that_overlap_anyhow_are_joined():
    """Pieces at random places and angles, some in others, rounded or not."""
    rng = np.random.default_rng(3)
    grains = []
    for _ in range(60):
        pieces = []
        for _ in range(rng.integers(2, 6)):
            corners = regular(rng.integers(1, 6), rng.uniform(0.2, 0.6), rng.uniform(0.0, 7.0))
            pieces.append((corners + rng.normal(0.0, 0.35, 2), rng.choice([0.02, 0.3])))
        grains.append(pieces)
    outlines = Outlines.of(grains, np.ones(60), np.ones(60))
    rings = rings_of(outlines)
    assert np.bincount(rings.grain).max() > 1
    for grain in range(60):
        check_cover(outlines, rings, grain, 1000)


@pytest.mark.parametrize(("boxes", "area"), [
    ([(0, 0, 1, 1), (1, 0, 2, 1)], [2.0]),  # side by side
    ([(0, 0, 1, 1), (1, 0.5, 2, 1.5)], [2.0]),  # along a part of a side
    ([(0, 0, 2, 1), (0, 0, 1, 2)], [3.0]),  # from one corner
    ([(0, 0, 1, 1), (0, 0, 1, 1), (0, 0, 1, 1)], [1.0]),  # the same again
    ([(0, 0, 3, 3), (1, 0, 2, 1)], [9.0]),  # within, along a side
    ([(0, 0, 1, 1), (2, 0, 3, 2)], [1.0, 2.0]),  # apart
    ([(0, 0, 3, 1), (0, 2, 3, 3), (0, 0, 1, 3), (2, 0, 3, 3)], [9.0, -1.0]),  # around a hole
])  # fmt: skip
def test_sides_that_lie_on_each_other_are_within(boxes, area):
    found = joined([box(*map(float, sides)) for sides in boxes])
    sizes = [Rings(np.zeros(1, int), np.array([0, len(ring)]), ring).area[0] for ring in found]
    assert sorted(sizes, reverse=True) == pytest.approx(sorted(area, reverse=True))


def test_rings_turn_and_move_with_their_grains():
    rings = rings_of(make_outlines())
    place, angle = np.array([[3.0, -1.0], [0.5, 0.25]]), np.array([0.5 * np.pi, 2.0])
    some = rings.of_grains(np.array([FRAME, ANGLE]))
    assert some.grain.tolist() == [0, 0, 1]
    own = [ring for ring, of in zip(rings, rings.grain, strict=True) if of == FRAME]
    placed = list(some.placed(place, angle))
    for ring, before in zip(placed, own, strict=False):
        assert ring == pytest.approx(np.column_stack([3.0 - before[:, 1], before[:, 0] - 1.0]))
    assert some.placed(place, angle).area == pytest.approx(some.area)
    assert list(rings.of_grains(np.zeros(0, int))) == []


def test_one_line_leads_around_holes_and_parts():
    apart = [(box(-3.0, -1.0, -1.0, 1.0), 0.0), (box(1.0, -1.0, 3.0, 1.0), 0.0)]
    outlines = make_outlines()
    grains = [outlines.pieces(k) for k in (FRAME, DUMBBELL)] + [apart]
    outlines = Outlines.of(grains, np.ones(3), np.ones(3))
    lines = rings_of(outlines).single()
    assert lines.grain.tolist() == [0, 1, 2]
    for grain, line in enumerate(lines):
        check_cover(outlines, lines, grain)
        assert Path(line).contains_point((0.0, 0.0)) == (grain == 1)
    assert lines.area == pytest.approx(rings_of(outlines).area)
