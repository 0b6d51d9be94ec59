"""Wall geometries: chains of glued grains close, polylines know their corners, inertia and
lengths."""

import math

import numpy as np
import pytest
from packing_support import generator, scenario, uniform, wall

from multicor_cli.model import ShapeKind
from multicor_cli.packing.sizes import list_sizes
from multicor_cli.packing.walls import build_walls, chain_on_circle, chain_on_line, join_shapes
from multicor_cli.scenario import Refused
from multicor_cli.scenario.settings import Domain
from multicor_cli.scenario.walls import BoxGeometry, CircleGeometry, PlaneGeometry, PolylineGeometry

SIZES = {
    "equal": list_sizes(np.array([1e-3]), None, 0),
    "list": list_sizes(np.array([0.5e-3, 1e-3, 1.5e-3]), None, 2),
    "uniform": uniform(0.4e-3, 1.6e-3),
}


@pytest.mark.parametrize("sizes", SIZES)
@pytest.mark.parametrize("length", [0.08, 0.0813, 0.0037])
def test_chain_on_a_line_touches_and_ends_exactly(sizes, length):
    start, end = np.array([0.01, 0.02]), np.array([0.01 + 0.6 * length, 0.02 + 0.8 * length])
    chain = chain_on_line(start, end, SIZES[sizes], generator)
    step = np.hypot(*np.diff(chain[:, :2], axis=0).T)
    np.testing.assert_allclose(step, chain[1:, 2] + chain[:-1, 2], rtol=1e-12)
    assert 2 * chain[:, 2].sum() == pytest.approx(length, rel=1e-13)
    assert np.hypot(*(chain[0, :2] - start)) == pytest.approx(chain[0, 2], rel=1e-10)
    assert np.hypot(*(chain[-1, :2] - end)) == pytest.approx(chain[-1, 2], rel=1e-9)
    drawn = SIZES[sizes].draw(len(chain), generator())
    factor = chain[0, 2] / drawn[0]
    np.testing.assert_allclose(chain[:, 2], factor * drawn, rtol=1e-12)  # one factor for all
    assert abs(factor - 1) <= 0.51 * 2 * SIZES[sizes].largest / length


def test_chain_over_the_period_closes():
    chain = chain_on_line(np.zeros(2), np.array([0.03, 0.0]), SIZES["uniform"], generator)
    across = chain[0, 0] + 0.03 - chain[-1, 0]
    assert across == pytest.approx(chain[0, 2] + chain[-1, 2], rel=1e-11)


@pytest.mark.parametrize("sizes", SIZES)
@pytest.mark.parametrize(("radius", "side"), [(0.02, -1), (0.01, 1)])
def test_chain_around_a_circle_touches_it_and_closes(sizes, radius, side):
    """From inside and from outside."""
    chain = chain_on_circle(radius, SIZES[sizes], generator, is_outside=side > 0)
    away = np.hypot(chain[:, 0], chain[:, 1])
    np.testing.assert_allclose(away - side * chain[:, 2], radius, rtol=1e-13)
    after = np.roll(chain, -1, axis=0)
    gap = np.hypot(*(after[:, :2] - chain[:, :2]).T) - chain[:, 2] - after[:, 2]
    assert np.abs(gap).max() < 1e-12
    drawn, largest = SIZES[sizes].draw(len(chain), generator()), SIZES[sizes].largest
    # By half of a disc of them all, whose centers lie on another circle when they grow
    scatter = 0.51 * largest / (math.pi * min(radius, radius + side * 1e-3))
    assert chain[:, 2].mean() == pytest.approx(drawn.mean(), rel=scatter)


def test_line_shorter_than_a_grain_is_refused():
    with pytest.raises(Refused, match="too short"):
        chain_on_line(np.zeros(2), np.array([1e-3, 0.0]), SIZES["equal"], generator)


DOMAIN = Domain(size=(2.0, 1.0))
PERIODIC = Domain(size=(2.0, 1.0), periodic=True)


def line(*points, domain=DOMAIN, **more):
    return PolylineGeometry(kind="polyline", points=points, **more).body(domain)


def box(*sides):
    return BoxGeometry(kind="box", min=(0.0, 0.0), max=(2.0, 1.0), open=sides).body(DOMAIN)


def test_open_polyline_corners_name_their_segments():
    body = line((0.0, 0.0), (1.0, 0.0), (1.0, 2.0))
    assert body.kind.tolist() == [ShapeKind.SEGMENT] * 2 + [ShapeKind.VERTEX] * 3
    np.testing.assert_allclose(body.origin, [2 / 3, 2 / 3])
    assert body.length == 3.0
    for k, (before, after) in enumerate(body.geometry[2:, 2:].astype(int)):
        corner = body.geometry[2 + k, :2]
        assert before < 0 or np.array_equal(body.geometry[before, 2:], corner)
        assert after < 0 or np.array_equal(body.geometry[after, :2], corner)


CORNERS = ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0))
RING = [[2, 0], [0, 1], [1, 2]]


@pytest.mark.parametrize(("body", "lines"), [
    (line((0.0, 0.0), (1.0, 0.0), (1.0, 2.0)), [[-1, 0], [0, 1], [1, -1]]),
    (line(*CORNERS, closed=True), RING),
    (line(*CORNERS, CORNERS[0]), RING),
    (line((0.1, 0.2), (2.1, 0.2), domain=PERIODIC), RING),  # joined to its image
    # This one ends, one end above the other
    (line((0.1, 0.2), (2.1, 0.3), domain=PERIODIC), [[-1, 0], [0, 1], [1, 2], [2, -1]]),
    (box(), [[3, 0], [0, 1], [1, 2], [2, 3]]),
])  # fmt: skip
def test_corners_name_the_lines_that_meet_there(body, lines):
    assert body.geometry[body.kind == ShapeKind.VERTEX, 2:].tolist() == lines


def test_a_line_through_the_period_is_cut():
    floor = line((0.1, 0.2), (2.1, 0.2), domain=PERIODIC)
    assert floor.kind.tolist() == [ShapeKind.SEGMENT] * 3 + [ShapeKind.VERTEX] * 3
    parts = [[-1, -1 / 3], [-1 / 3, 1 / 3], [1 / 3, 1]]
    np.testing.assert_allclose(floor.geometry[:3, 0::2], parts)


def test_corners_refer_to_rows_of_the_joined_table():
    plane = PlaneGeometry(kind="plane", point=(0.0, 0.0), normal=(0.0, 2.0)).body(DOMAIN)
    bodies = [plane, line((0.0, 0.0), (1.0, 0.0))]
    shapes = join_shapes(bodies, [0, 1])
    assert shapes.geometry[2:, 2:].tolist() == [[-1, 1], [1, -1]]
    # The body itself is not changed
    assert bodies[1].geometry[1:, 2:].tolist() == [[-1, 0], [0, -1]]
    assert shapes.wall.tolist() == shapes.material.tolist() == [0, 1, 1, 1]


LEFT, LOW, RIGHT = [-1, 0.5, -1, -0.5], [-1, -0.5, 1, -0.5], [1, -0.5, 1, 0.5]
BODIES = {
    "plane": (PlaneGeometry(kind="plane", point=(0.3, 0.1), normal=(3.0, 4.0)).body(DOMAIN),
        [0.3, 0.1], [[0, 0, 0.6, 0.8]], 0.8 * 2.0 + 0.6 * 1.0),
    "box": (box("top"), [1.0, 0.5], [LEFT, LOW, RIGHT, [-1, 0.5, -1, 0], [-1, -0.5, 0, 1],
        [1, -0.5, 1, 2], [1, 0.5, 2, -1]], 4.0),
    "posts": (box("top", "bottom"), [1.0, 0.5], [RIGHT, [1, -0.5, -1, 0], [1, 0.5, 0, -1], LEFT,
        [-1, 0.5, -1, 3], [-1, -0.5, 3, -1]], 2.0),
    "circle": (CircleGeometry(kind="circle", center=(0.5, 0.6), radius=0.25).body(DOMAIN),
        [0.5, 0.6], [[0, 0, 0.25, 0]], math.pi / 2),
    "triangle": (line(*CORNERS, closed=True), [1 / 3] * 2, None, 2 + 2**0.5),
}  # fmt: skip


@pytest.mark.parametrize("name", BODIES)
def test_bodies_of_simple_geometries(name):
    body, origin, geometry, length = BODIES[name]
    np.testing.assert_allclose(body.origin, origin)
    if geometry is not None:
        np.testing.assert_allclose(body.geometry, geometry)
    assert body.length == pytest.approx(length)


def test_shapes_stand_in_the_world_before_grains_are_placed():
    corners = "[[0.01, 0.0], [0.03, 0.0], [0.02, 0.03]]"
    walls = wall("a", SMOOTH) + wall("b", f'kind = "polyline", points = {corners}')
    solid = build_walls(scenario(extra=walls)).obstacles()
    lines = [[0.01, 0, 0.03, 0], [0.03, 0, 0.02, 0.03]]
    ends = [[0.01, 0, -1, 1], [0.03, 0, 1, 2], [0.02, 0.03, 2, -1]]
    np.testing.assert_allclose(solid.world, [[0, 0, 0, 1], *lines, *ends], atol=1e-15)


SMOOTH = 'kind = "plane", point = [0.0, 0.0], normal = [0.0, 1.0]'
ROUGH = 'kind = "rough", from = [0.0, 0.0], to = [0.06, 0.0], side = "left"'


def built(geometry, rest="", *overrides):
    return build_walls(scenario(*overrides, extra=wall("w", geometry, rest)))


GLUED = {
    "rough": (ROUGH, [0.03, 0.0, 0.0], 28),
    "disc": ('kind = "disc", center = [0.03, 0.04], radius = 0.01, rough = "grains"', [0.03, 0.04, 0.0], 30),
    "circle": ('kind = "circle", center = [0.03, 0.04], radius = 0.03, rough = "grains"', [0.03, 0.04, 0.0], 60),
}  # fmt: skip


@pytest.mark.parametrize("name", GLUED)
def test_mass_of_a_rough_wall_is_that_of_its_discs_unless_given(name):
    geometry, position, least = GLUED[name]
    result = built(geometry)
    discs, walls = result.bodies[0].glued, result.walls
    assert len(discs) >= least
    mass = math.pi * discs[:, 2] ** 2 * 2e-3 * 7800.0
    assert walls.mass[0] == pytest.approx(mass.sum(), rel=1e-12)
    about = 0.5 * mass * discs[:, 2] ** 2 + mass * (discs[:, :2] ** 2).sum(axis=1)
    assert walls.inertia[0] == pytest.approx(about.sum(), rel=1e-12)
    np.testing.assert_allclose(result.position, [position])
    # A rough drum keeps its circle, a rough disc is one
    kinds = result.shapes.kind.tolist()
    assert (kinds.count(ShapeKind.CIRCLE), kinds.count(ShapeKind.DISC)) == (
        name == "circle",
        len(discs),
    )
    assert (discs[0].tolist() == [0.0, 0.0, 0.01]) == (name == "disc")
    given = built(geometry, "mass = 2.0").walls
    assert given.mass[0] == 2.0
    assert given.inertia[0] == pytest.approx(2.0 / walls.mass[0] * walls.inertia[0], rel=1e-12)
    assert built(geometry, "inertia = 7.0").walls.inertia[0] == 7.0


def test_walls_have_the_mass_that_is_given_or_known():
    assert built(ROUGH).walls.length[0] == pytest.approx(0.06)
    walls = built(SMOOTH).walls
    assert math.isnan(walls.mass[0])
    assert math.isnan(walls.inertia[0])
    load = "loading.0.drives.w={y={force=0.0}}"
    walls = built(SMOOTH, "mass = 1.5\ngravity = true", load).walls
    assert walls.mass[0] == 1.5
    assert math.isnan(walls.inertia[0])
    assert walls.has_gravity[0]


def test_glued_sizes_depend_on_seed_and_wall_only():
    alone = built(ROUGH).bodies[0].geometry
    higher = ROUGH.replace("0.0], to", "0.01], to").replace("0.06, 0.0", "0.06, 0.01")
    both = build_walls(scenario(extra=wall("w", ROUGH) + wall("other", higher))).bodies
    np.testing.assert_array_equal(alone, both[0].geometry)
    assert not np.array_equal(both[0].geometry[:, 2], both[1].geometry[:, 2])
    assert not np.array_equal(alone, built(ROUGH, "", "scenario.seed=6").bodies[0].geometry)
