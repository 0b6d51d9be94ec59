"""Conductivity of layers between walls, against chains in series, by hand, and dense solves."""

from dataclasses import replace

import numpy as np
import pytest
from layers import SOLID, THICKNESS, layer, layer_model, with_ways
from made_up_frames import contacts_of
from scene_parts import between_planes

from multicor_cli.post import PostError, Selection, layer_conductivity, layer_flow
from multicor_cli.post.conductivity import WAYS, Network
from multicor_cli.post.layer_conductivity import FLOW_QUANTITIES, LAYER_QUANTITIES

ALL = Selection(start=0.0)


@pytest.mark.parametrize(("columns", "rows", "inside", "wall"), [
    (4, 6, 0.3, 0.5), (3, 1, 0.3, 0.2), (5, 20, 1.0, 1e-3),
])  # fmt: skip
def test_a_square_lattice_is_chains_of_contacts(columns, rows, inside, wall):
    """G = columns/(2/H_w + (rows − 1)/H); no heat flows across, whatever H is there."""
    table = layer_conductivity(layer(columns, rows, inside, wall), ALL, margin=0.0)
    conductance = columns / (2.0 / wall + (rows - 1) / inside)
    assert table.mean["conductance"] == pytest.approx(conductance, rel=1e-12)
    square = conductance * rows / columns
    assert table.mean["square"] == pytest.approx(square, rel=1e-12)
    assert table.mean["conductivity"] == pytest.approx(square / THICKNESS, rel=1e-12)
    assert table.mean["over_solid"] == pytest.approx(square / THICKNESS / SOLID, rel=1e-12)
    if rows > 1:  # whatever the walls' contacts
        assert table.mean["square_bulk"] == pytest.approx(inside, rel=1e-10)
        assert table.mean["over_contact"] == pytest.approx(square / inside)
    assert table.error["conductance"] == 0.0


def test_what_is_in_a_table():
    table = layer_conductivity(layer(), ALL)
    assert [*table.mean] == [q.name for q in LAYER_QUANTITIES]
    assert table.mean["solid_fraction"] == pytest.approx(np.pi / 4.0)
    assert table.mean["coordination"] == pytest.approx(4.0)
    assert table.mean["joined"] == 1.0
    # Each contact has the force 1 along a branch of 1, or of ½ with a wall: 24 across, 20 + 4 up
    assert table.mean["pressure"] == pytest.approx(0.5 * (24.0 + 24.0) / 24.0)
    data = table.as_dict()
    assert (data["walls"], data["height"], data["width"]) == (["floor", "lid"], 6.0, 4.0)
    assert (data["thickness"], data["left_out"], data["frame_count"]) == (THICKNESS, "", 3)


def test_temperatures_and_conductance_against_a_dense_solve():
    """A random network in which some nodes hang on one end and some on nothing."""
    random = np.random.default_rng(5)
    i, j = random.integers(0, 30, (2, 60))
    i, j = i[i != j], j[i != j]
    h = random.uniform(0.1, 2.0, i.size)
    network = Network(i, j, h, np.zeros((i.size, 2)), 34, 1.0)  # 30 to 33 touch nothing
    conductance, temperature = network.between(3, 17)
    balance = np.zeros((34, 34))
    for a, b, c in zip(i, j, h, strict=True):
        balance[[a, b], [a, b]] += c
        balance[[a, b], [b, a]] -= c
    rows = np.eye(34)
    rows[[k for k in range(34) if k not in (3, 17)]] = balance[
        [k for k in range(34) if k not in (3, 17)]
    ]
    expected = np.linalg.lstsq(rows, np.eye(34)[3], rcond=None)[0]
    known = np.isfinite(temperature)
    assert 20 < known.sum() <= 30
    np.testing.assert_allclose(temperature[known], expected[known], atol=1e-12)
    assert conductance == pytest.approx(float((balance @ expected)[3]), rel=1e-12)
    assert network.between(17, 3)[0] == pytest.approx(conductance, rel=1e-12)
    assert network.between(3, 31)[0] == 0.0


def test_other_walls_conduct_nothing():
    """Shapes of one wall are one node; contacts with a third wall are left out."""
    source = layer(3, 2, 0.3, 0.5)
    model = source.model
    walls = replace(
        model.walls, names=("floor", "lid", "gate"),
        **{k: np.append(getattr(model.walls, k), getattr(model.walls, k)[0])
           for k in ("mass", "inertia", "has_gravity", "length")},
    )  # fmt: skip
    shapes = model.shapes
    shapes = replace(shapes, kind=np.append(shapes.kind, 1), wall=np.append(shapes.wall, 2),
        geometry=np.vstack([shapes.geometry, [0.0, 0.0, 1.0, 0.0]]),
        material=np.append(shapes.material, 0))  # fmt: skip
    source.model = replace(model, walls=walls, shapes=shapes)
    for frame in source.frames:
        frame.wall_position = np.zeros((3, 3))
        contacts = frame.contacts
        more = contacts_of([0], [model.grain_count + 2], (1.0, 0.0), (1.0, 0.0))
        for name in ("i", "j", "normal", "force", "gap", "sliding"):
            setattr(contacts, name, np.concatenate([getattr(contacts, name), getattr(more, name)]))
        contacts.conductance = np.append(contacts.conductance, 9.0)
    table = layer_conductivity(source, ALL, between=("floor", "lid"))
    assert table.mean["conductance"] == pytest.approx(3.0 / (4.0 + 1.0 / 0.3))


def test_spheres_have_no_conductivity_and_two_solids_no_ratio():
    spheres = layer_conductivity(layer(model=layer_model(4, 6, shape="sphere")), ALL)
    assert {"conductivity", "over_solid"}.isdisjoint(spheres.mean)
    unknown = layer()
    unknown.scenario_resolved = ""
    assert "over_solid" not in layer_conductivity(unknown, ALL).mean
    assert "flow_over_solid" not in layer_flow(unknown, ALL).mean
    assert "flow_conductivity" in layer_flow(unknown, ALL).mean


# --- what flows


def test_a_steady_flow_and_the_contacts_agree():
    source = with_ways(layer(), [1.0, 0.0, 0.0, 0.0])
    flows, contacts = layer_flow(source, ALL), layer_conductivity(source, ALL)
    assert [*flows.mean] == [q.name for q in FLOW_QUANTITIES]
    for name in ("conductance", "square", "conductivity", "over_solid"):
        assert flows.mean[f"flow_{name}"] == pytest.approx(contacts.mean[name], rel=1e-12)
    assert flows.mean["stored"] == pytest.approx(0.0, abs=1e-12)
    assert flows.mean["difference"] == 20.0
    assert flows.walls == ("floor", "lid")
    assert flows.time.tolist() == [2.0, 4.0]


def test_what_is_stored_is_told():
    """The flow through is the mean of both walls; the hot one may be above."""
    for hot, cold, walls in ((310.0, 290.0, ("floor", "lid")), (290.0, 310.0, ("lid", "floor"))):
        table = layer_flow(layer(hot=hot, cold=cold, stored=0.7), ALL)
        flow = 4.0 * 20.0 / (2.0 / 0.5 + 5.0 / 0.3)
        assert table.walls == walls
        assert table.mean["flow"] == pytest.approx(flow)
        assert table.mean["stored"] == pytest.approx(0.7)
        assert table.mean["unsteadiness"] == pytest.approx(0.7 / flow)


def test_means_are_ratios_of_sums_with_errors():
    source = layer(frames=40)
    noise = np.random.default_rng(2).normal(0.0, 0.05, (40, 1))
    for frame, more in zip(source.frames, np.cumsum(noise, axis=0), strict=True):
        frame.wall_heat = frame.wall_heat + np.array([[1.0, 0.0], [-1.0, 0.0]]) * more
    table = layer_flow(source, ALL)
    heat = np.array([frame.wall_heat[:, 0] for frame in source.frames])
    flow = 0.5 * ((heat[-1, 0] - heat[0, 0]) - (heat[-1, 1] - heat[0, 1])) / 78.0
    assert table.mean["flow"] == pytest.approx(flow)
    assert table.mean["flow_conductance"] == pytest.approx(flow / 20.0)
    steps = 0.5 * noise[1:, 0]
    assert table.error["flow"] == pytest.approx(steps.std() / np.sqrt(39), rel=0.3)


def test_walls_have_their_temperatures_from_the_first_step_on():
    source = layer()
    source.frames[0].step, source.frames[0].wall_temperature = 0, np.full(2, np.nan)
    assert layer_flow(source, ALL).mean["difference"] == 20.0


def test_shares_are_parts_of_all_that_goes_to_the_other_wall():
    """Ratios of sums, with the errors of an independent jackknife; of older runs nothing is known."""
    ways = np.random.default_rng(3).uniform(1.0, 2.0, (300, 4))
    table = layer_flow(with_ways(layer(frames=300), ways), ALL)
    sums = ways[1:].sum(axis=0)
    without = sums - ways[1:]
    for k, way in enumerate(WAYS):
        share = f"share_{way}"
        np.testing.assert_allclose(table.values[share], ways[1:, k] / ways[1:].sum(axis=1))
        assert table.mean[share] == pytest.approx(sums[k] / sums.sum())
        left = without[:, k] / without.sum(axis=1)
        error = np.sqrt(298.0 / 299.0 * ((left - left.mean()) ** 2).sum())
        assert table.error[share] == pytest.approx(error, rel=0.2)
    assert not any(name.startswith("share") for name in layer_flow(layer(), ALL).mean)


# --- walls on the left and on the right


def beside(source):
    """The layer mirrored at the diagonal: its floor is on the left, its lid on the right."""
    model = source.model
    geometry = model.shapes.geometry.reshape(-1, 2, 2)[..., ::-1].reshape(-1, 4)
    source.model = replace(
        model, period=0.0, shapes=replace(model.shapes, geometry=geometry),
        walls=replace(model.walls, names=("left", "right")),
    )  # fmt: skip
    for frame in source.frames:
        frame.position = frame.position[:, ::-1]
        frame.contacts.normal = frame.contacts.normal[:, ::-1]
    return source


@pytest.mark.parametrize("between", [None, ("left", "right")])
def test_a_layer_between_walls_at_its_sides_conducts_as_one_between_floor_and_lid(between):
    level, upright = layer(), beside(layer())
    for measure, more in ((layer_conductivity, {"margin": 1.0}), (layer_flow, {})):
        expected = measure(with_ways(level, [1.0, 2.0, 3.0, 4.0]), ALL, **more)
        given = with_ways(upright, [1.0, 2.0, 3.0, 4.0], "x")
        found = measure(given, ALL, between=between, **more)
        assert found.mean == pytest.approx(expected.mean, rel=1e-12)
        assert found.walls == ("left", "right")
        assert (found.height, found.width) == (6.0, 4.0)


def test_walls_at_the_sides_are_taken_if_they_are_named_or_there_are_no_others():
    with pytest.raises(PostError, match=r"'right' is not below 'left' \(or left of it"):
        layer_flow(beside(layer()), ALL, between=("right", "left"))
    source = beside(layer())
    source.model = replace(source.model, period=9.0)
    with pytest.raises(PostError, match="'left' is upright"):
        layer_flow(source, ALL, between=("left", "right"))
    with pytest.raises(PostError, match="walls on their left and right"):
        layer_flow(source, ALL)


def test_wrong_runs_are_refused():
    cold = layer()
    cold.model = between_planes()
    with pytest.raises(PostError, match="the run has no heat"):
        layer_conductivity(cold, ALL)
    with pytest.raises(PostError, match="take the contacts of this one with --network"):
        layer_flow(layer(), Selection(frames=slice(0, 1)))
    for hot, cold in ((300.0, 300.0), (np.nan, 300.0)):
        source = layer()
        for frame in source.frames:
            frame.wall_temperature = np.array([hot, cold])
        with pytest.raises(PostError, match="have no different temperatures in these frames"):
            layer_flow(source, ALL)
    source = layer()
    for frame in source.frames:
        frame.contacts.conductance = np.zeros_like(frame.contacts.conductance)
    with pytest.raises(PostError, match="no contact conducts in these frames"):
        layer_conductivity(source, ALL)
    for frame in source.frames:
        frame.contacts = contacts_of(recorded=False)
    with pytest.raises(PostError, match="these frames have no contacts"):
        layer_conductivity(source, ALL)
    with pytest.raises(PostError, match="there is no wall 'roof'"):
        layer_flow(layer(), ALL, between=("floor", "roof"))
