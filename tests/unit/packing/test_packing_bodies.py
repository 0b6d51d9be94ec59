"""Solid bodies and regions: what they are made of, what they weigh, where packings put grains."""

import math

import numpy as np
import pytest
from packing_support import GRAVITY, PERIODIC, built, problems, scenario, wall
from stars import star, winding

from multicor_cli.engine.geometry.scene import gap_to_shape
from multicor_cli.model import ShapeKind
from multicor_cli.model.shapes import Polygon
from multicor_cli.packing.walls import build_walls
from multicor_cli.scenario import ScenarioError

DENSITY, THICKNESS = 7800.0, 2e-3  # of steel, and of the discs of the scenario
TRIANGLE = [[0.02, 0.02], [0.05, 0.02], [0.02, 0.06]]
SPHERES = 'particles.0={name="grains",material="glass",shape="sphere",sizes={kind="list",radii=[1e-3]},count=50,packing={kind="random"}}'
LOADED = "loading.0.drives.w={x={force=0.0}}"


def walls_of(geometry, *overrides, rest=""):
    return build_walls(scenario(*overrides, extra=wall("w", geometry, rest)))


def polygon(corners, more='grains = "outside"'):
    points = np.asarray(corners, float).tolist()
    return f'kind = "polygon", points = {points}, {more}'


def test_a_smooth_disc_among_spheres_is_a_sphere():
    walls = walls_of('kind = "disc", center = [0.03, 0.04], radius = 0.01', SPHERES).walls
    assert walls.mass[0] == pytest.approx(DENSITY * 4.0 / 3.0 * math.pi * 1e-6)
    assert walls.inertia[0] == pytest.approx(0.4 * walls.mass[0] * 1e-4)


@pytest.mark.parametrize(("power", "overrides"), [(2, ()), (3, (SPHERES,))])
def test_a_cluster_turns_about_its_center_of_mass(power, overrides):
    discs = [[0.01, 0.02, 1e-3], [0.013, 0.02, 2e-3]]
    result = walls_of(f'kind = "cluster", discs = {discs}', *overrides)
    share = 2.0**power / (1.0 + 2.0**power)
    assert result.position[0, :2] == pytest.approx([0.01 + 0.003 * share, 0.02])
    np.testing.assert_allclose(result.obstacles().world[:, :3], discs, rtol=1e-12)
    single = DENSITY * (THICKNESS * math.pi * 1e-6 if power == 2 else 4.0 / 3.0 * math.pi * 1e-9)
    assert result.walls.mass[0] == pytest.approx(single * (1.0 + 2.0**power))
    factor, reduced = (0.5, 0.4)[power - 2], single * share
    own = factor * single * (1e-6 + 2.0**power * 4e-6)
    assert result.walls.inertia[0] == pytest.approx(own + reduced * 0.003**2)


def test_overlapping_grains_of_a_cluster_have_no_mass_of_their_own():
    geometry = 'kind = "cluster", discs = [[0.01, 0.02, 1e-3], [0.011, 0.02, 1e-3]]'
    assert math.isnan(walls_of(geometry).walls.mass[0])
    with pytest.raises(ScenarioError, match="has no mass"):
        walls_of(geometry, LOADED)
    assert walls_of(geometry, LOADED, rest="mass = 1e-3").walls.mass[0] == 1e-3


@pytest.mark.parametrize("order", [1, -1])
def test_a_solid_polygon_weighs_its_area_and_lies_left_of_its_sides(order):
    result = walls_of(polygon(TRIANGLE[::order]))
    mass = DENSITY * THICKNESS * 0.5 * 0.03 * 0.04
    assert result.walls.mass[0] == pytest.approx(mass)
    assert result.walls.inertia[0] == pytest.approx(mass * (0.03**2 + 0.04**2) / 18.0)
    assert result.position[0, :2] == pytest.approx([0.03, 0.1 / 3.0])
    assert result.walls.length[0] == pytest.approx(0.12)
    body = result.bodies[0]
    assert body.kind.tolist() == [ShapeKind.SIDE] * 3 + [ShapeKind.VERTEX] * 3
    assert Polygon(body.geometry[:3, :2]).signed_size > 0.0
    np.testing.assert_array_equal(body.geometry[:3, 2:], np.roll(body.geometry[:3, :2], -1, axis=0))
    container = walls_of(polygon(TRIANGLE[::order], 'grains = "inside"'))
    assert Polygon(container.bodies[0].geometry[:3, :2]).signed_size < 0.0
    assert math.isnan(container.walls.mass[0])


def test_a_polygon_among_spheres_is_as_thick_as_the_largest_of_them():
    mass = walls_of(polygon(TRIANGLE), SPHERES).walls.mass[0]
    assert mass == pytest.approx(DENSITY * 2e-3 * 6e-4)
    unknown = 'particles.0={name="grains",material="glass",shape="sphere",packing={kind="file",path="a.csv"}}'
    with pytest.raises(ScenarioError, match="has no mass"):
        walls_of(polygon(TRIANGLE), unknown, LOADED)


def test_grains_glued_to_a_polygon_have_their_centers_on_its_sides():
    result = walls_of(polygon(TRIANGLE, 'grains = "outside", rough = "grains"'))
    glued = result.bodies[0].glued[:, :2] + result.position[0, :2]
    assert np.abs(Polygon(np.array(TRIANGLE)).depth(glued)).max() < 1e-12
    assert len(glued) == pytest.approx(0.12 / 2e-3, abs=3)
    assert result.walls.mass[0] == pytest.approx(DENSITY * THICKNESS * 6e-4)
    # Each side draws its own
    assert len({round(radius, 12) for radius in result.bodies[0].glued[:, 2]}) > 0.9 * len(glued)


@pytest.mark.parametrize("seed", range(10))
def test_the_gap_to_a_polygon_is_that_to_its_nearest_side_or_corner(seed):
    shape = Polygon(corners := star_in_domain(np.random.default_rng(seed)))
    obstacles = walls_of(polygon(corners)).obstacles()
    kind, world = obstacles.kind, obstacles.world
    points = np.random.default_rng(seed + 50).uniform(0.0, 0.08, (300, 2))
    depth = shape.depth(points)
    for (x, y), expected in zip(points[depth < 0.0], -depth[depth < 0.0], strict=True):
        gap, nx, ny = min(gap_to_shape(x, y, 1e-3, k, kind, world, 0.0) for k in range(kind.size))
        assert gap == pytest.approx(expected - 1e-3, abs=1e-15)
        foot = np.array([[x - expected * nx, y - expected * ny]])
        assert shape.depth(foot)[0] == pytest.approx(0.0, abs=1e-12)


def star_in_domain(rng):
    return np.array([0.03, 0.03]) + star(rng, int(rng.integers(3, 10)), 0.004, 0.018)


PACKINGS = {
    "lattice": ('kind="lattice",lattice="triangular"', ""),
    "random": ('kind="random"', "count=300,"),
    "dense": ('kind="random"', "fill=0.62,"),
    "deposited": ('kind="deposited"', "count=300,"),
}


def group(packing, more=""):
    kind, count = PACKINGS[packing]
    return (
        'particles.0={name="grains",material="glass",shape="disc",thickness=2e-3,'
        f'sizes={{kind="uniform",min=0.6e-3,max=0.9e-3}},{count}packing={{{kind}}}{more}}}'
    )


@pytest.mark.parametrize("seed", range(16))
def test_no_grain_is_placed_in_solid_matter(seed):
    """Random polygons and discs, large enough to hold grains that do not touch their outline;
    `build` refuses overlaps."""
    rng, packing = np.random.default_rng(seed), list(PACKINGS)[seed % len(PACKINGS)]
    corners, disc = star_in_domain(rng), rng.uniform([0.01, 0.055, 2e-3], [0.05, 0.07, 9e-3])
    round_one = f'kind = "disc", center = {disc[:2].tolist()}, radius = {disc[2]}'
    walls = wall("p", polygon(corners)) + wall("d", round_one)
    model, state = built(group(packing), GRAVITY, extra=walls)
    center, radius = state.position[:, :2], model.grains.radius
    assert not winding(corners, center).any()
    assert (np.hypot(*(center - disc[:2]).T) >= (disc[2] + radius) * (1.0 - 1e-3)).all()
    assert (Polygon(corners).depth(center) <= -radius * (1.0 - 1e-3)).all()


@pytest.mark.parametrize("packing", PACKINGS)
def test_containers_keep_grains_inside(packing):
    sides = [[0.005, 0.07], [0.005, 0.03], [0.025, 0.005]]
    hopper = [*sides, *([0.06 - x, y] for x, y in sides[::-1])]
    table = group(packing).replace("fill=0.62", "count=900")  # 0.58 of the hopper
    inside = wall("p", polygon(hopper, 'grains = "inside"'))
    model, state = built(table, GRAVITY, extra=inside)
    depth = Polygon(np.array(hopper)).depth(state.position[:, :2])
    assert (depth >= model.grains.radius * (1.0 - 1e-3)).all()


REGIONS = {
    "circle": ('kind="circle",center=[0.03,0.035],radius=0.025', math.pi * 0.025**2),
    "annulus": ('kind="annulus",center=[0.03,0.04],inner=0.012,outer=0.028',
        math.pi * (0.028**2 - 0.012**2)),
    "polygon": ('kind="polygon",points=[[0.0,0.01],[0.06,0.01],[0.03,0.08]]', 0.5 * 0.06 * 0.07),
}  # fmt: skip


def distance_inside(region, center):
    """How far points are inside a region, written out."""
    x, y = center.T
    if region == "polygon":
        return np.minimum(y - 0.01, (0.08 - y - np.abs(x - 0.03) * 7 / 3) / math.hypot(1, 7 / 3))
    if region == "circle":
        return 0.025 - np.hypot(x - 0.03, y - 0.035)
    away = np.hypot(x - 0.03, y - 0.04)
    return np.minimum(0.028 - away, away - 0.012)


@pytest.mark.parametrize("packing", PACKINGS)
@pytest.mark.parametrize("region", REGIONS)
def test_grains_lie_wholly_in_their_region(region, packing):
    text, size = REGIONS[region]
    model, state = built(group(packing, f",region={{{text}}}"), GRAVITY)
    radius = model.grains.radius
    assert (distance_inside(region, state.position[:, :2]) >= radius * (1.0 - 1e-3)).all()
    area = math.pi * (radius**2).sum()
    if packing == "dense":
        assert area == pytest.approx(0.62 * size, rel=5e-3)
    elif packing == "lattice":
        assert area > 0.5 * size
    else:
        assert radius.size == 300


def polygon_region(points):
    return f',region={{kind="polygon",points={points}}}'


SMALL = ',region={kind="circle",center=[0.03,0.03],radius=0.0135}'
TINY = polygon_region("[[0.0,0.0],[0.004,0.0],[0.002,0.004]]")  # its inscribed circle is too small
# The probes for the free area lie on its diagonal, random points hardly ever in it
NEEDLE = polygon_region("[[0.0,0.0],[0.06,0.0599],[0.06,0.06],[0.0,0.0001]]")


@pytest.mark.parametrize(("packing", "region", "words"), [
    ("random", SMALL, "do not fit"), ("deposited", SMALL, "do not fit"),
    ("lattice", TINY, "holds no site"), ("random", NEEDLE, "do not fit"),
])  # fmt: skip
def test_a_full_region_is_refused(packing, region, words):
    table = group(packing, region)
    table = table.replace("count=300", "fill=0.5") if region is NEEDLE else table
    (problem,) = problems(table, GRAVITY)
    assert words in problem.message


def test_deposited_grains_pile_up_on_a_disc():
    """Only those whose center is in solid matter are dropped again: the pile touches the disc."""
    disc = wall("d", 'kind = "disc", center = [0.03, 0.03], radius = 0.02')
    table = group("deposited").replace("count=300", "count=900")
    model, state = built(table, GRAVITY, extra=disc)
    gap = np.hypot(*(state.position[:, :2] - 0.03).T) - 0.02 - model.grains.radius
    assert np.count_nonzero(np.abs(gap) < 1e-9) > 5


@pytest.mark.parametrize("geometry", [
    polygon([[0.01, 0.01], [0.05, 0.01], [0.05, 0.05], [0.01, 0.05]]),
    'kind = "disc", center = [0.03, 0.03], radius = 0.02',
])  # fmt: skip
def test_grains_from_a_file_in_solid_matter_are_refused(geometry, tmp_path):
    rows = "x,y,radius\n0.03,0.03,1e-3\n0.005,0.07,1e-3\n0.025,0.035,1e-3\n"
    (tmp_path / "grains.csv").write_text(rows)
    grains = 'particles.0={name="grains",material="glass",shape="disc",thickness=2e-3,packing={kind="file",path="grains.csv"}}'
    (problem,) = problems(grains, extra=wall("body", geometry), path=tmp_path / "test.toml")
    assert problem.key == "walls.0"
    named = "in the solid matter of the wall 'body': grain 1 of 'grains' at (0.03, 0.03) m, grain 3 of 'grains' at"
    assert named in problem.message
    assert problem.remedy == "move the wall, or move the grains by shift in their packing"
    assert "grain 2" not in problem.message


@pytest.mark.parametrize("packing", PACKINGS)
def test_solid_bodies_repeat_with_the_period(packing):
    """A disc across the ends of the period leaves no room at either."""
    disc = wall("d", 'kind = "disc", center = [0.001, 0.04], radius = 0.01')
    block = wall("p", polygon([[0.053, 0.06], [0.065, 0.06], [0.059, 0.07]]))
    model, state = built(group(packing), GRAVITY, PERIODIC, extra=disc + block)
    dx = state.position[:, 0] - 0.001
    dx -= 0.06 * np.round(dx / 0.06)
    away = np.hypot(dx, state.position[:, 1] - 0.04)
    assert (away >= (0.01 + model.grains.radius) * (1.0 - 1e-3)).all()
