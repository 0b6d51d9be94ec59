"""Radical cells: of lattices, against points sampled one by one, and against walls; and the tables
made of them."""

import numpy as np
import pytest
from cells import make_cell
from made_up_frames import frame_of, source_of
from scene_parts import make_model

from multicor_cli.model import ShapeKind
from multicor_cli.model.shapes import WallBody
from multicor_cli.post import PostError, Selection, grain_map, profile, voronoi
from multicor_cli.post.lattice import Lattice
from multicor_cli.post.voronoi import WALL, cells_of

ALL = Selection(start=0.0)


def cell_frame(lattice, position, radius):
    model, _ = make_cell(position, radius, lattice[:2], tilt=lattice.tilt)
    frame = frame_of(position, walls=1)
    frame.wall_position = np.array([lattice], float)
    return model, frame


def square(size=12):
    x, y = np.meshgrid(np.arange(size) + 0.1, np.arange(size) + 0.3)
    return Lattice(float(size), float(size)), np.column_stack([x.ravel(), y.ravel()])


def hexagonal(size=12):
    row = np.sqrt(0.75)
    x, k = np.meshgrid(np.arange(size) + 0.1, np.arange(size))
    places = np.column_stack([(x + 0.5 * k).ravel(), (k * row).ravel()])
    return Lattice(float(size), size * row), places


# --- lattices


@pytest.mark.parametrize("turns", [0, 1, -3])
@pytest.mark.parametrize(
    ("make", "fraction", "sides"),
    [(square, np.pi / 4.0, 4), (hexagonal, np.pi / (2.0 * np.sqrt(3.0)), 6)],
)
def test_cells_of_a_lattice(make, fraction, sides, turns):
    """In whatever way the cell is told; corners where four cells meet are no sides."""
    lattice, position = make()
    told = lattice._replace(tilt=turns * lattice.width)
    model, frame = cell_frame(told, position, np.full(len(position), 0.5))
    cells = cells_of(model, frame)
    assert np.pi * 0.25 / cells.area == pytest.approx(fraction, rel=1e-12)
    assert set(cells.neighbors) == {sides}
    assert cells.length == pytest.approx(1.0 if sides == 4 else 1.0 / np.sqrt(3.0), rel=1e-9)
    assert np.abs(cells.order(sides)) == pytest.approx(1.0)
    assert np.abs(cells.order(10 - sides)) == pytest.approx(0.0, abs=1e-9)


def test_tables_of_lattices():
    """Of a hexagonal lattice both orders are 1; turned ones cancel each other."""
    lattice, position = hexagonal()
    model, frame = cell_frame(lattice, position, np.full(len(position), 0.5))
    source = source_of(model, [frame, frame])
    table = voronoi(source, ALL)
    expected = np.pi / (2.0 * np.sqrt(3.0))
    for name in ("local_solid_fraction", "solid_fraction"):
        assert table.mean[name] == pytest.approx(expected, rel=1e-12)
    assert table.mean["deviation"] == pytest.approx(0.0, abs=1e-7)
    assert (table.mean["neighbors"], table.mean["share_6"]) == (6.0, 1.0)
    assert table.mean["hexatic"] == pytest.approx(1.0)
    assert table.mean["hexatic_global"] == pytest.approx(1.0)
    assert table.standard_error["hexatic"] == 0.0
    assert (table.grains.sum(), table.open_share) == (288, 0.0)
    assert (table.fraction, table.density) == (pytest.approx([0.91]), pytest.approx([50.0]))
    assert table.as_dict()["share"] == [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]
    assert grain_map(source, "local-solid-fraction", 0).value == pytest.approx(expected)
    assert profile(source, "hexatic", ALL, 3).value == pytest.approx(1.0)


# --- discs of several sizes in a tilted cell, point by point


def gas(count=80, seed=5, size=(11.0, 8.0), tilt=3.7):
    random = np.random.default_rng(seed)
    lattice = Lattice(*size, tilt)
    position = random.random((count, 2)) @ lattice.corners[[1, 3]]
    return lattice, position, random.uniform(0.1, 0.6, count)


def test_areas_and_neighbors_point_by_point():
    """A point belongs to the grain that has the least power there; of sampled points as many as
    the area says, within five deviations of a binomial. Some are hidden: small ones in large."""
    lattice, position, radius = gas()
    cells = cells_of(*cell_frame(lattice, position, radius))
    assert np.nansum(cells.area) == pytest.approx(lattice.area, rel=1e-12)
    number = 40_000
    points = np.random.default_rng(2).random((number, 2)) @ lattice.corners[[1, 3]]
    power = np.full((number, len(position)), np.inf)
    for a in (-2, -1, 0, 1, 2):
        for b in (-1, 0, 1):
            away = points[:, np.newaxis] - position - (a, b) @ lattice.corners[[1, 3]]
            np.minimum(power, (away**2).sum(axis=2) - radius**2, out=power)
    order = np.argsort(power, axis=1)
    part = np.bincount(order[:, 0], minlength=len(position)) / number
    expected = np.nan_to_num(cells.area) / lattice.area
    assert np.abs(part - expected).max() < 5.0 * np.sqrt(expected.max() / number)
    # whoever is next to a point near a side is across it
    gap = np.take_along_axis(power, order[:, :2], axis=1)
    near = order[gap[:, 1] - gap[:, 0] < 1e-3]
    known = set(zip(cells.grain.tolist(), cells.other.tolist(), strict=True))
    assert {(i, j) for i, j in near[:, :2].tolist()} <= known
    assert {(j, i) for i, j in known} == known


def test_the_order_weights_neighbors_by_their_sides():
    lattice, position, radius = gas()
    cells = cells_of(*cell_frame(lattice, position, radius))
    for i in (0, 17, 40):
        own = cells.grain == i
        wave = (cells.normal[own, 0] + 1j * cells.normal[own, 1]) ** 6
        expected = (cells.length[own] * wave).sum() / cells.length[own].sum()
        assert cells.order()[i] == pytest.approx(expected)
        closed = (cells.length[own, np.newaxis] * cells.normal[own]).sum(axis=0)
        assert closed == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("count", [1, 2, 5])
def test_few_grains_are_surrounded_by_their_images(count):
    lattice = Lattice(9.0, 2.0, -4.0)
    position = np.random.default_rng(count).random((count, 2)) @ lattice.corners[[1, 3]]
    cells = cells_of(*cell_frame(lattice, position, np.full(count, 0.1)))
    assert cells.area.sum() == pytest.approx(lattice.area, rel=1e-12)


# --- walls

BOX = [
    (ShapeKind.PLANE, 0, (0.0, 0.0, 0.0, 1.0)), (ShapeKind.PLANE, 1, (0.0, 8.0, 0.0, -1.0)),
    (ShapeKind.PLANE, 2, (0.0, 0.0, 1.0, 0.0)), (ShapeKind.PLANE, 3, (12.0, 0.0, -1.0, 0.0)),
]  # fmt: skip
NAMES = ("floor", "lid", "left", "right")


def shapes_of(body, wall):
    return [(ShapeKind(k), wall, tuple(g)) for k, g in zip(body.kind, body.geometry, strict=True)]


def scattered(size, count=150, seed=3):
    return np.random.default_rng(seed).random((count, 2)) * size


def test_smooth_walls_end_cells():
    """Planes; a tray of a bent line, whose corners are its ends; a circle."""
    places = scattered([12.0, 8.0])
    model = make_model(np.full(150, 0.1), BOX, NAMES)
    cells = cells_of(model, frame_of(places, walls=4))
    assert cells.area.sum() == pytest.approx(96.0, rel=1e-12)
    beside = cells.other == WALL
    assert cells.length[beside].sum() == pytest.approx(40.0, rel=1e-9)
    tray = WallBody.empty((0.0, 0.0), 1.0).with_line(
        np.array([[0.0, 8.0], [0.0, 0.0], [12.0, 0.0], [12.0, 8.0]]), 0.0
    )
    model = make_model(
        np.full(150, 0.1), [*shapes_of(tray, 0), (ShapeKind.PLANE, 1, (0, 8, 0, -1))], NAMES[:2]
    )
    assert cells_of(model, frame_of(places)).area == pytest.approx(cells.area, rel=1e-9)
    around = places[np.hypot(*(places - [6.0, 4.0]).T) < 4.0]
    ring = make_model(
        np.full(len(around), 0.1), [(ShapeKind.CIRCLE, 0, (6.0, 4.0, 4.0, 0.0))], ("ring",)
    )
    found = cells_of(ring, frame_of(around, walls=1)).area
    assert np.pi * 16.0 < found.sum() < 1.02 * np.pi * 16.0


def test_a_floor_that_goes_around_and_a_free_surface():
    """Pieces that cross the period are as good as a plane; cells at the surface are open."""
    places = scattered([12.0, 8.0])
    floor = WallBody.empty((0.0, 0.0), 1.0).with_line(np.array([[-3.0, 0.0], [9.0, 0.0]]), 12.0)
    lid = [(ShapeKind.PLANE, 1, (0.0, 8.0, 0.0, -1.0))]
    closed = make_model(np.full(150, 0.1), shapes_of(floor, 0) + lid, NAMES[:2], period=12.0)
    cells = cells_of(closed, frame_of(places))
    assert cells.area.sum() == pytest.approx(96.0, rel=1e-12)
    free = make_model(np.full(150, 0.1), shapes_of(floor, 0), NAMES[:1], period=12.0)
    beside = cells_of(free, frame_of(places, walls=1))
    assert 0 < beside.is_open.sum() < 30
    assert places[beside.is_open, 1].min() > 5.0
    below = places[:, 1] < 5.0
    assert beside.area[below] == pytest.approx(cells.area[below], rel=1e-12)


def test_a_thin_wall_parts_cells():
    """No cell reaches through; what is nearer to a grain beyond belongs to none."""
    places = scattered([12.0, 8.0])
    parted = [*BOX, (ShapeKind.SEGMENT, 4, (6.0, 0.0, 6.0, 8.0))]
    model = make_model(np.full(150, 0.1), parted, (*NAMES, "divider"))
    cells = cells_of(model, frame_of(places, walls=5))
    for side in (places[:, 0] < 6.0, places[:, 0] > 6.0):
        assert 0.9 * 48.0 < cells.area[side].sum() <= 48.0 * (1.0 + 1e-12)


def test_glued_grains_have_cells_of_their_own():
    """The lowest row of a square lattice, glued, bounds the cells of those above as they do."""
    _, position = square(6)
    low = position[:, 1] < 1.0
    glued = [(ShapeKind.DISC, 0, (*at, 0.5, 0.0)) for at in position[low].tolist()]
    model = make_model(
        np.full(30, 0.5), [*glued, (ShapeKind.PLANE, 1, (0, 5.8, 0, -1))], NAMES[:2], period=6.0
    )
    cells = cells_of(model, frame_of(position[~low]))
    assert cells.area == pytest.approx(1.0)
    assert (cells.other >= 30).sum() == 6
    source = source_of(model, [frame_of(position[~low])])
    table = voronoi(source, ALL, margin=0.0)
    assert table.mean["local_solid_fraction"] == pytest.approx(np.pi / 4.0)
    assert table.mean["neighbors"] == pytest.approx((24 * 4 + 6 * 3) / 30)
    assert voronoi(source, ALL, margin=1.0).grain_count == 18.0


# --- averages and what is refused


def test_averages_grain_by_grain():
    lattice = Lattice(11.0, 8.0, 3.7)
    frames = [gas(seed=seed) for seed in range(4)]
    radius = frames[0][2]
    made = [cell_frame(lattice, position, radius) for _, position, _ in frames]
    table = voronoi(source_of(made[0][0], [frame for _, frame in made]), ALL, 20)
    cells = [cells_of(model, frame) for model, frame in made]
    known = [~each.is_open for each in cells]
    fractions = np.concatenate(
        [(np.pi * radius**2 / each.area)[k] for each, k in zip(cells, known, strict=True)]
    )
    orders = [each.order()[k] for each, k in zip(cells, known, strict=True)]
    n = fractions.size
    expected = {
        "local_solid_fraction": fractions.mean(), "deviation": fractions.std(),
        "solid_fraction": sum((np.pi * radius[k] ** 2).sum() for k in known) / (4 * lattice.area),
        "neighbors": sum(each.neighbors.sum() for each in cells) / n,
        "share_5": sum((each.neighbors == 5).sum() for each in cells) / n,
        "hexatic": np.abs(np.concatenate(orders)).mean(),
        "hexatic_global": sum(np.abs(each.sum()) for each in orders) / n,
    }  # fmt: skip
    for name, value in expected.items():
        assert table.mean[name] == pytest.approx(value), name
    inside = np.minimum((fractions * 20).astype(int), 19)
    counts = np.bincount(inside, minlength=20)
    shown = np.flatnonzero(counts)
    assert table.grains.tolist() == counts[shown[0] : shown[-1] + 1].tolist()
    assert table.density == pytest.approx(table.grains / n * 20.0)
    assert table.open_share == pytest.approx(1.0 - n / 320)


def test_what_is_refused():
    lattice, position = square(4)
    model, frame = cell_frame(lattice, position, np.full(16, 0.5))
    with pytest.raises(PostError, match="has no sides: leave out --margin"):
        voronoi(source_of(model, [frame]), ALL, margin=1.0)
    with pytest.raises(PostError, match="0 bins: choose between 1"):
        voronoi(source_of(model, [frame]), ALL, 0)
    alone = make_model([0.5])
    with pytest.raises(PostError, match="no grain in the region has a cell"):
        voronoi(source_of(alone, [frame_of([[0.0, 0.5]], walls=1)]), ALL, margin=0.0)
    same = make_model(np.full(4, 0.1), BOX, NAMES)
    assert cells_of(same, frame_of(np.ones((4, 2)), walls=4)).is_open.all()
