"""Parts of grains of any shape below lines, in bins and regions: against clipping corner by corner,
level lines added up, and closed forms."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from made_up_frames import frame_of, source_of
from shaped_frames import (
    below,
    box,
    chords,
    disc,
    outlines_of,
    regular,
    rod,
    shaped_frame,
    shaped_model,
    shoelace,
)

from multicor_cli import post
from multicor_cli.model.outlines import Outlines
from multicor_cli.model.shapes import Polygon, Rectangle
from multicor_cli.post import rings
from multicor_cli.post.rings import area_below, cut_of, reach_of, rings_of, turned
from multicor_cli.post.source import turned as turned_run
from multicor_cli.post.sums import plane_width

ALL = post.Selection(start=0.0)


def random_polygon(random, corners=7):
    """A convex polygon around its center, with corners at random on a circle."""
    angle = np.sort(random.uniform(0.0, 2.0 * np.pi, corners))
    points = random.uniform(0.5, 2.0) * np.column_stack([np.cos(angle), np.sin(angle)])
    return points - points.mean(axis=0)


def rotated(points, angle):
    c, s = np.cos(angle), np.sin(angle)
    return points @ np.array([[c, s], [-s, c]])


def test_sharp_polygons_are_cut_exactly():
    random = np.random.default_rng(1)
    polygons = [random_polygon(random, k) for k in random.integers(3, 9, 40)]
    model, angle = shaped_model([[(p, 0.0)] for p in polygons]), random.uniform(-9.0, 9.0, 40)
    cut = turned(model, angle)
    grain, height = np.repeat(np.arange(40), 50), random.uniform(-2.5, 2.5, 2000)
    expected = [
        below(rotated(polygons[k], angle[k]), h) for k, h in zip(grain, height, strict=True)
    ]
    assert cut.below(grain, height) == pytest.approx(np.array(expected), abs=1e-13)
    y = [rotated(p, a)[:, 1] for p, a in zip(polygons, angle, strict=True)]
    assert cut.low == pytest.approx([each.min() for each in y])
    assert cut.high == pytest.approx([each.max() for each in y])


def test_many_lines_are_looked_at_in_parts(monkeypatch):
    random = np.random.default_rng(2)
    model = shaped_model([[(random_polygon(random), 0.1)] for _ in range(9)])
    cut, grain = turned(model, np.arange(9.0)), random.integers(0, 9, 500)
    height = random.uniform(-2.0, 2.0, 500)
    whole = cut.below(grain, height)
    monkeypatch.setattr(rings, "_AT_ONCE", 100)
    assert cut.below(grain, height).tolist() == whole.tolist()


def test_no_grain_and_level_sides():
    empty = shaped_model([[box(1.0, 1.0)]]).with_grains(np.zeros(0, np.int64))
    cut = turned(empty, np.zeros(0))
    assert cut.below(np.zeros(0, np.int64), np.zeros(0)).size == 0
    cut = turned(shaped_model([[box(2.0, 1.0)]]), np.array([0.0]))
    heights = np.array([-1.0, -0.5, -0.25, 0.0, 0.5, 3.0])
    assert cut.below(np.zeros(6, np.int64), heights).tolist() == [0.0, 0.0, 0.5, 1.0, 2.0, 2.0]


CLUMP = [disc(0.6, (-0.5, 0.0)), disc(0.7, (0.5, 0.1))]
GRAINS = {
    "disc": ([disc(1.0)], None),
    "rod": ([rod(1.4, 0.4)], None),
    "rounded pentagon": ([regular(5, 0.8, 0.2)], None),
    "hardly rounded": ([regular(5, 0.98, 0.02)], None),
    "much rounded": ([regular(20, 0.4, 0.6)], None),
    "two discs": (CLUMP, None),
    "cross": ([box(2.0, 0.4), box(0.4, 2.0)], 1.6 - 0.16),
    "corner of two flush boxes": ([box(1.0, 0.5), box(0.5, 1.0, at=(0.75, 0.25))], 1.0),
    "bar of two boxes": ([box(1.0, 0.5, at=(-0.3, 0.0)), box(1.0, 0.5, at=(0.3, 0.0))], 0.8),
    "frame with a hole": (
        [box(2.0, 0.5, at=(0.0, -0.75)), box(2.0, 0.5, at=(0.0, 0.75)),
         box(0.5, 2.0, at=(-0.75, 0.0)), box(0.5, 2.0, at=(0.75, 0.0))], 3.0),
    "rounded boxes": ([box(1.2, 0.3, 0.2), box(0.3, 1.2, 0.2)], None),
}  # fmt: skip


@pytest.mark.parametrize("name", GRAINS)
def test_parts_are_sums_of_level_lines(name):
    """At 4,000 heights, whose midpoints are good to 10⁻⁵ of the area; arcs are within 10⁻⁴."""
    pieces, area = GRAINS[name]
    for angle in (0.0, 0.4, 1.3):
        edges = np.linspace(-2.0, 2.0, 4001)
        whole = np.cumsum(chords(pieces, angle, edges[:-1] + 5e-4) * 1e-3)
        area = area or float(whole[-1])
        model = shaped_model([pieces], areas=[area])
        cut = turned(model, np.array([angle]))
        found = cut.below(np.zeros(4000, np.int64), edges[1:])
        assert found[-1] == pytest.approx(area, rel=1e-9)
        assert np.abs(found - whole).max() < 1e-4 * area


@pytest.mark.parametrize("sides", [1, 2, 5, 30])
@pytest.mark.parametrize("rounding", [0.01, 0.2, 1.0])
def test_rings_have_the_area_of_arcs(sides, rounding):
    piece = {1: disc(rounding), 2: rod(1.0, rounding)}.get(sides, regular(sides, 1.0, rounding))
    outlines = outlines_of([[piece]])
    assert rings_of(outlines).area == pytest.approx(outlines.area, rel=1e-12)


def test_discs_among_others_are_cut_as_discs():
    model = shaped_model([[disc(0.7)], [box(1.0, 1.0)]])
    cut, height = turned(model, np.array([0.3, 0.0])), np.linspace(-0.8, 0.8, 301)
    found = cut.below(np.zeros(301, np.int64), height)
    assert np.abs(found - area_below(height, np.full(301, 0.7))).max() < 1e-4 * np.pi * 0.49
    assert model.disc_radius == pytest.approx([0.7, 1.0 / np.sqrt(np.pi)])
    assert model.perimeter == pytest.approx([1.4 * np.pi, 4.0])


# ---- Tables


def lattice_of_boxes(turn=0.0, columns=4, rows=5):
    """Squares of side 0.6 at distances of 1 in a cell."""
    place = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), -1).reshape(-1, 2) + 0.5
    model = shaped_model(
        [[box(0.6, 0.6)]] * len(place), walls=("cell",), period=float(columns), height=float(rows)
    )
    cell = {"walls": 1, "wall_position": np.array([[columns, rows, 0.0]], float)}
    return source_of(model, [shaped_frame(place.astype(float), turn, **cell)])


def test_a_lattice_of_squares():
    table = post.profile(lattice_of_boxes(), "solid-fraction", ALL, 20)
    # bins are 0.25 high, squares from 0.2 to 0.8 of each row
    expected = np.tile([0.05 / 0.25 * 0.6, 0.6, 0.6, 0.05 / 0.25 * 0.6], 5)
    assert table.value == pytest.approx(expected, abs=1e-14)
    on_edge = post.profile(lattice_of_boxes(np.pi / 4.0), "solid-fraction", ALL, 10).value
    assert on_edge == pytest.approx(np.full(10, 0.36), abs=1e-14)


def random_grains(random, count=40, frames=3):
    """Polygons, rods and discs, rounded and sharp, at random places in a period of 6 m."""
    kinds = [
        lambda: (random_polygon(random), float(random.choice([0.0, 0.1]))),
        lambda: rod(random.uniform(0.5, 1.5), 0.2), lambda: disc(random.uniform(0.2, 0.6)),
    ]  # fmt: skip
    grains = [[kinds[k % 3]()] for k in range(count)]
    model = shaped_model(grains, walls=(), period=6.0)
    made = []
    for k in range(frames):
        place = random.uniform((0.0, 0.0), (6.0, 8.0), (count, 2))
        frame = shaped_frame(place, random.uniform(-4.0, 4.0, count), walls=0)
        frame.velocity[:] = random.normal(size=(count, 3))
        frame.generated = np.cumsum(random.exponential(1.0, count)) * (k + 1.0)
        made.append(frame)
    return source_of(model, made)


def test_profiles_against_level_lines():
    """Means by area, and rates, of which the grains are halfway, turned halfway."""
    source = random_grains(np.random.default_rng(5))
    model, frames = source.model, source.frames
    pieces = [model.outlines.pieces(k) for k in range(model.grain_count)]

    def areas(y, angle, edges):
        found = []
        for k, piece in enumerate(pieces):
            lines = np.linspace(edges[0], edges[-1], 400 * (edges.size - 1) + 1)
            middle, step = 0.5 * (lines[1:] + lines[:-1]) - y[k], lines[1] - lines[0]
            found.append(step * chords(piece, angle[k], middle).reshape(-1, 400).sum(axis=1))
        return np.array(found)

    table = post.profile(source, "velocity", ALL, 12)
    edges = table.y[0] - 0.5 * table.width + np.arange(13) * table.width
    low = min((f.position + reach_of(model, f)[0])[:, 1].min() for f in frames)
    high = max((f.position + reach_of(model, f)[1])[:, 1].max() for f in frames)
    edges = low + edges
    assert edges[-1] == pytest.approx(high)
    inside = [areas(f.position[:, 1], f.angle, edges) for f in frames]
    moved = sum(f.velocity[:, 0] @ own for f, own in zip(frames, inside, strict=True))
    assert table.value == pytest.approx(moved / np.sum(inside, axis=(0, 1)), abs=5e-4)
    solid = post.profile(source, "solid-fraction", ALL, 12)
    expected = np.sum(inside, axis=(0, 1)) / (3 * table.width * 6.0)
    assert solid.value == pytest.approx(expected, abs=2e-4)
    assert solid.value.sum() * solid.bin_area == pytest.approx(model.area.sum(), rel=1e-4)
    source.model = replace(model, thermal=object())
    heat = post.profile(source, "heat", ALL, 12).value
    gained = np.zeros(12)
    for first, second in pairwise(frames):
        y, angle = 0.5 * (first.position + second.position)[:, 1], first.angle + second.angle
        half = areas(y, 0.5 * angle, edges)
        gained += ((second.generated - first.generated) / model.area) @ half
    assert heat == pytest.approx(gained / (2.0 * table.width * 6.0), abs=2e-3 * np.abs(heat).max())


def test_ends_of_the_grains_bound_the_plane():
    """Without a period the plane is as wide as grains reach, not their bounding circles."""
    model = shaped_model([[box(2.0, 0.2)], [box(2.0, 0.2)]], walls=())
    frame = shaped_frame(np.array([[0.0, 0.0], [3.0, 0.0]]), [0.0, np.pi / 2.0], walls=0)
    source = source_of(model, [frame])
    assert plane_width(source, source.frames[0]) == pytest.approx(4.1)
    found = turned_run(source)
    assert plane_width(found, found.frames[0]) == pytest.approx(2.0)  # what was its height
    assert reach_of(model, frame)[1] == pytest.approx(np.array([[1.0, 0.1], [0.1, 1.0]]))
    # Heights end where grains do
    assert post.profile(source, "solid-fraction", ALL, 1).height == pytest.approx(2.0)


@pytest.mark.parametrize("turn", [0.0, 0.7, 2.5])
def test_regions_take_the_part_of_a_grain_inside(turn):
    """Of polygons across a straight boundary: clipped; all directions of boundaries are alike."""
    random = np.random.default_rng(3)
    polygons = [random_polygon(random) for _ in range(20)]
    model = shaped_model([[(p, 0.0)] for p in polygons], walls=())
    away, angle = random.uniform(-1.5, 1.5, 20), random.uniform(-3.0, 3.0, 20)
    place = rotated(np.column_stack([random.uniform(-3.0, 3.0, 20), away]), turn)
    frame = shaped_frame(place, angle, walls=0, velocity=np.zeros((20, 2)))
    lower = np.array([[-50.0, -90.0], [50.0, -90.0], [50.0, 0.0], [-50.0, 0.0]])
    area = Polygon(rotated(lower, turn))
    table = post.in_region(source_of(model, [frame]), area, ALL)
    expected = sum(
        below(rotated(p, a - turn), -y) for p, a, y in zip(polygons, angle, away, strict=True)
    )
    assert table.values["solid_fraction"][0] * area.size == pytest.approx(expected, rel=1e-9)
    inside = Rectangle((-90.0, -90.0), (90.0, 90.0))
    whole = post.in_region(source_of(model, [frame]), inside, ALL).values["solid_fraction"][0]
    assert whole * inside.size == pytest.approx(sum(map(shoelace, polygons)), rel=1e-12)


def test_outlines_of_discs_change_nothing():
    """Discs that are told as outlines have the tables of discs, to the fineness of lines."""
    random = np.random.default_rng(8)
    radius, place = random.uniform(0.2, 0.5, 60), random.uniform(0.0, 5.0, (60, 2))
    shaped = shaped_model([[disc(r)] for r in radius], walls=(), period=5.0)
    frame = shaped_frame(place, random.uniform(0.0, 6.0, 60), walls=0)
    frame.velocity[:] = random.normal(size=(60, 3))
    for of in ("solid-fraction", "velocity", "kinetic-stress-xy", "granular-temperature"):
        tables = [
            post.profile(source_of(model, [frame]), of, ALL, 9)
            for model in (shaped, replace(shaped, outlines=None))
        ]
        scale = np.abs(tables[1].value).max()
        assert tables[0].value == pytest.approx(tables[1].value, abs=3e-4 * scale)
    fields = [
        post.fields(source_of(model, [frame]), selection=ALL, spacing=2.0).values["solid-fraction"]
        for model in (shaped, replace(shaped, outlines=None))
    ]
    assert fields[0] == pytest.approx(fields[1], rel=1e-12)


def test_models_without_outlines_read_no_angles():
    model = replace(shaped_model([[disc(0.5)]]), outlines=None)
    cut = cut_of(model, frame_of(np.zeros((1, 2))))
    assert cut.below(np.zeros(1, np.int64), np.zeros(1))[0] == pytest.approx(np.pi / 8.0)
    assert isinstance(outlines_of([[disc(0.5)]]), Outlines)
