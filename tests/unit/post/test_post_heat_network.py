"""Where heat flows: networks, fluxes of grains and fields, of lattices by hand."""

from dataclasses import replace

import numpy as np
import pytest
from cells import square_of_discs
from layers import layer
from made_up_frames import contacts_of

from multicor_cli.post import PostError, Selection, fields, grain_map, heat_network
from multicor_cli.post.contacts import heat_flows
from multicor_cli.post.heat import HEAT_SUMMARY

ALL = Selection(start=0.0)
FLOW = 20.0 / (2.0 / 0.5 + 5.0 / 0.3)
"""Through a column of the layer of 4 by 6 discs."""


def test_numbers_of_a_lattice():
    """Heat flows up each column alone: through 28 of 52 contacts, alike."""
    table = heat_network(layer())
    expected = {
        "contacts": 52, "wall_contacts": 8, "coordination": 4.0, "idle_share": 0.0,
        "flow_mean": 28.0 * FLOW / 52.0, "flow_max": FLOW, "strongest_share": 5.2 / 28.0,
        "from_walls": 4.0 * FLOW, "to_walls": 4.0 * FLOW,
    }  # fmt: skip
    assert tuple(expected) == HEAT_SUMMARY
    assert table.summary == pytest.approx(expected)
    data = table.as_dict()
    assert (data["frame"], data["time"], data["left_out"]) == (2, 4.0, "")
    rows = np.array(table.detail_rows)
    assert table.detail_headings == ("i", "j", "x [m]", "y [m]", "conductance [W/K]", "flow [W]")
    upwards = rows[rows[:, 4] == 0.5]
    assert upwards[:, 5].sum() == pytest.approx(0.0, abs=1e-12)  # in at the floor, out at the lid
    assert sorted(set(upwards[:, 3])) == [0.0, 6.0]


def test_flow_goes_from_warm_to_cold():
    """Positive into i; a wall without temperature conducts nothing."""
    source = layer(3, 2)
    flows = heat_flows(source.frames[0], source.model)
    warm = source.frames[0].temperature
    for i, j, flow in zip(flows.contacts.i, flows.contacts.j, flows.flow, strict=True):
        other = [310.0, 290.0][j - 6] if j >= 6 else warm[j]
        assert np.sign(flow) == np.sign(np.round(other - warm[i], 9))
    source.frames[0].wall_temperature = np.array([310.0, np.nan])
    assert heat_flows(source.frames[0], source.model).contacts.j.max() == 6
    assert heat_network(source, 0).summary["to_walls"] == 0.0


def test_flux_of_grains_and_of_the_field():
    """Uniform upwards: FLOW per diameter in the plane; of a grain that over its share of area."""
    table = grain_map(layer(), "heat-flux")
    assert table.field.unit == "W/m"
    np.testing.assert_allclose(table.vector[:, 0], 0.0, atol=1e-12)
    np.testing.assert_allclose(table.vector[:, 1], FLOW / (np.pi / 4.0))
    line = fields(layer(), ["heat-flux"], ALL, along=((0.5, 3.0), (3.5, 3.0)), reach=1.0)
    along = fields(layer(), ["heat-flux-y"], ALL, along=((0.0, 3.3), (4.0, 3.3)), spacing=0.02)
    mean = along.values["heat-flux-y"][:-1].mean()
    assert mean == pytest.approx(FLOW, rel=2e-3)
    np.testing.assert_allclose(along.values["heat-flux-x"], 0.0, atol=1e-12)
    np.testing.assert_allclose(line.values["heat-flux"], np.abs(line.values["heat-flux-y"]))
    assert [field.name for field in line.of] == ["heat-flux"]
    polar = fields(layer(), ["heat-flux-r"], ALL, center=(2.0, 3.0))
    up = np.hypot(polar.values["heat-flux-r"], polar.values["heat-flux-t"])
    np.testing.assert_allclose(up, polar.values["heat-flux"])


def test_flux_in_a_cell_is_that_of_the_gradient():
    """All grains equally warm beside the gradient: in a square lattice q = −H G."""
    source = square_of_discs([0.3, 0.3])
    source.model = replace(source.model, heat_gradient=(5.0, -2.0))
    for frame in source.frames:
        frame.temperature, frame.wall_temperature = np.full(5, 300.0), np.array([np.nan])
    flows = heat_flows(source.frames[0], source.model)
    flux = [flows.virial(axis).sum() / 4.0 for axis in (0, 1)]
    assert flux == pytest.approx([-0.3 * 5.0, 0.3 * 2.0])
    vector = grain_map(source, "heat-flux").vector
    np.testing.assert_allclose(vector[:4].sum(axis=0) * np.pi / 4.0 / 4.0, flux)
    assert not vector[4].any()


def test_no_heat_flux_without_heat_or_contacts():
    cold = layer()
    cold.model = replace(cold.model, thermal=None)
    for frame in cold.frames:
        frame.temperature = frame.contacts.conductance = None
    with pytest.raises(PostError, match="the run has no heat"):
        heat_network(cold)
    with pytest.raises(PostError, match="the run has no heat"):
        grain_map(cold, "heat-flux")
    names = [field.name for field in fields(cold, selection=ALL).fields]
    assert not [name for name in names if name.startswith("heat-flux")]
    silent = layer()
    silent.frames[-1].contacts = contacts_of(recorded=False)
    with pytest.raises(PostError, match="these frames have no contacts"):
        heat_network(silent)
    first = layer()
    first.frames[0].step = 0
    with pytest.raises(PostError, match="which begin with the first step"):
        heat_network(first, 0)
    idle = layer()
    idle.frames[-1].contacts.conductance = np.zeros(52)
    table = heat_network(idle)
    assert (table.summary["contacts"], table.summary["from_walls"]) == (0, 0.0)
    assert np.isnan(table.summary["flow_max"])
