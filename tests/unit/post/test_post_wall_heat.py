"""Transfer coefficients of made-up beds, and distances from walls of every shape."""

from dataclasses import replace

import numpy as np
import pytest
from cells import square_of_discs
from layers import MATERIALS, SOLID, THICKNESS, layer, layer_model
from made_up_frames import contacts_of, frame_of
from scene_parts import make_model

from multicor_cli.model import ShapeKind
from multicor_cli.post import PostError, Selection, wall_heat
from multicor_cli.post.wall_heat import WALL_QUANTITIES, wall_distance

ALL = Selection(start=0.0)
FLOW = 4.0 * 20.0 / (2.0 / 0.5 + 5.0 / 0.3)


def test_coefficients_of_a_steady_layer():
    """Floor and lid, 10 K off the mean of the bed, over 4 diameters of discs."""
    table = wall_heat(layer(), ALL)
    assert table.walls == ["floor", "lid"]
    assert [*table.mean] == [f"{w}: {q.name}" for w in table.walls for q in WALL_QUANTITIES]
    h = FLOW / (4.0 * THICKNESS * 10.0)
    for wall, sign in (("floor", 1.0), ("lid", -1.0)):
        expected = {
            "flow": sign * FLOW, "bed": 300.0, "difference": sign * 10.0, "wetted": 4.0,
            "coefficient": h, "nusselt": h * 1.0 / SOLID,
        }  # fmt: skip
        for name, value in expected.items():
            assert table.mean[f"{wall}: {name}"] == pytest.approx(value), name
    data = table.as_dict()
    assert (data["thickness"], data["over"], data["conductivity"]) == (THICKNESS, "solid", SOLID)
    assert len(table.time) == 2


def test_the_bed_may_be_what_is_near():
    source = layer()
    table = wall_heat(source, ALL, ["lid"], near=0.6)
    assert table.mean["lid: bed"] == pytest.approx(source.frames[0].temperature[-1])
    assert table.mean["lid: difference"] == pytest.approx(-FLOW / 4.0 / 0.5)
    two = wall_heat(source, ALL, ["lid"], near=1.1).mean["lid: bed"]
    assert two == pytest.approx(source.frames[0].temperature[-8:].mean())


def test_length_thickness_and_conductivity_are_what_is_given():
    table = wall_heat(layer(), ALL, ["floor"], length=8.0)
    assert table.mean["floor: coefficient"] == pytest.approx(FLOW / (8.0 * THICKNESS * 10.0))
    spheres = layer(model=layer_model(4, 6, shape="sphere"))
    assert wall_heat(spheres, ALL).thickness == 1.0
    in_air = layer()
    in_air.scenario_resolved = MATERIALS + "[heat]\ngas = { conductivity = 0.026 }\n"
    gas, solid = (wall_heat(in_air, ALL, over=over) for over in ("gas", "solid"))
    ratio = gas.mean["floor: nusselt"] / solid.mean["floor: nusselt"]
    assert ratio == pytest.approx(SOLID / 0.026)
    assert "floor: nusselt" not in wall_heat(layer(), ALL, over="gas").mean


def test_capacities_weigh():
    source = layer()
    capacity = np.arange(1.0, 25.0)
    source.model = replace(source.model, thermal=replace(source.model.thermal, capacity=capacity))
    expected = np.average(source.frames[0].temperature, weights=capacity)
    assert wall_heat(source, ALL).mean["floor: bed"] == pytest.approx(expected)


def test_means_are_ratios_of_sums_and_walls_may_warm():
    source = layer(frames=4)
    for k, frame in enumerate(source.frames):
        frame.wall_temperature = np.array([310.0 + k, np.nan])
        frame.wall_heat = np.array([[3.0 * k**2, 0.0], [0.0, 0.0]])
    table = wall_heat(source, ALL)
    assert table.walls == ["floor"]
    np.testing.assert_allclose(table.values["floor: difference"], [10.5, 11.5, 12.5])
    np.testing.assert_allclose(table.values["floor: flow"], [1.5, 4.5, 7.5])
    driving = 2.0 * (10.5 + 11.5 + 12.5) * 4.0 * THICKNESS
    assert table.mean["floor: coefficient"] == pytest.approx(27.0 / driving)
    assert table.left_out == []
    source.frames[1].wall_temperature = np.array([311.0, 300.0])
    assert wall_heat(source, ALL).left_out == [source.model.walls.names[1]]
    assert wall_heat(source, ALL, ["floor"]).left_out == []


@pytest.mark.parametrize(("shape", "expected"), [
    ((ShapeKind.PLANE, (0.0, 0.0, 0.6, 0.8)), [1.1, 1.6]),
    ((ShapeKind.SEGMENT, (0.0, 0.0, 0.0, 0.5)), [np.sqrt(0.5), 1.5]),
    ((ShapeKind.DISC, (1.0, 2.0, 0.25, 0.0)), [np.hypot(0.5, 1.0) - 0.25, 0.75]),
    ((ShapeKind.CIRCLE, (0.0, 0.0, 3.0, 0.0)), [3.0 - np.hypot(0.5, 1.0), 3.0 - 2.0]),
])  # fmt: skip
def test_distances_from_shapes(shape, expected):
    """Of points at (½, 1) and (0, 2) with a wall in its place; a segment ends at a vertex."""
    kind, numbers = shape
    shapes = [(kind, 0, numbers)]
    if kind == ShapeKind.SEGMENT:
        shapes.append((ShapeKind.VERTEX, 0, (0.0, 0.5, -1.0, -1.0)))
    model = make_model([0.1, 0.1], shapes)
    frame = frame_of([(0.5, 1.0), (0.0, 2.0)], walls=1)
    assert wall_distance(model, frame, 0) == pytest.approx(expected)


def test_distances_follow_the_wall_and_the_period():
    model = make_model([0.1], [(ShapeKind.SEGMENT, 0, (0.0, 0.0, 1.0, 0.0))], period=10.0)
    frame = frame_of([(9.5, 3.0)], walls=1)
    assert wall_distance(model, frame, 0) == pytest.approx([np.hypot(0.5, 3.0)])
    frame.wall_position = np.array([[0.0, 1.0, np.pi / 2.0]])  # upright from (0, 1) to (0, 2)
    assert wall_distance(model, frame, 0) == pytest.approx([np.hypot(0.5, 1.0)])


def test_wrong_runs_are_refused():
    for options, message in (
        ({"near": 0.0}, "the distance 0 must be positive"),
        ({"length": -1.0}, "the length -1 must be positive"),
        ({"length": np.inf}, "the length inf must be positive and finite"),
        ({"walls": ["roof"]}, "there is no wall 'roof'"),
        ({"selection": Selection(frames=slice(0, 1))}, "needs two frames"),
    ):
        with pytest.raises(PostError, match=message):
            wall_heat(layer(), **{"selection": ALL, **options})
    cold = layer()
    for frame in cold.frames:
        frame.wall_temperature = np.full(2, np.nan)
    with pytest.raises(PostError, match="those that have one: none"):
        wall_heat(cold, ALL)
    with pytest.raises(PostError, match="periodic in x and y there are no walls"):
        wall_heat(square_of_discs([0.3]), ALL)
    silent = layer()
    silent.frames[1].contacts = contacts_of(recorded=False)
    with pytest.raises(PostError, match="give its wetted length with --length"):
        wall_heat(silent, ALL)
    assert wall_heat(silent, ALL, length=4.0).mean["floor: flow"] == pytest.approx(FLOW)
