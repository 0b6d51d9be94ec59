"""Heat between walls and packings: conductances, transfer coefficients, fluxes of real runs."""

from math import erfc, exp, pi, sqrt

import numpy as np
import pytest
from recorded import keep
from scenarios import plane, scenario

from multicor_cli.post import (
    Selection,
    fields,
    grain_map,
    heat_network,
    layer_conductivity,
    layer_flow,
    wall_heat,
)
from multicor_cli.post.conductivity import WAYS
from multicor_cli.post.contacts import heat_flows

ALL = Selection(start=0.0)
RADIUS, THICKNESS = 1e-3, 1e-3

# --- a packing in its steady state

STEPS = """
[[loading]]
name = "press"
duration = 0.04
drives = { lid = { y = { force = -5.0, damping = 0.5 } } }
[[loading]]
name = "soak"
duration = 60000.0
frozen = true
dt = 1000.0
"""


@pytest.mark.parametrize("sides", [False, True])
def test_flow_and_contacts_of_a_packing_agree(run, sides, record_property):
    """Pressed discs between a warm floor and a cold lid, then frozen for long: what flows is what
    the network of their contacts conducts, and its field is that flow over the width."""
    walls = {
        "floor": {"geometry": plane(0.0), "thermal": {"temperature": 310.0}},
        "lid": {"geometry": plane(0.04, -1), "mass": 1e-3, "thermal": {"temperature": 290.0}},
    }
    if sides:
        walls |= {
            "left": {"kind": "plane", "point": [0.0, 0.0], "normal": [1.0, 0.0]},
            "right": {"kind": "plane", "point": [0.02, 0.0], "normal": [-1.0, 0.0]},
        }
    sizes = {"kind": "uniform", "min": 0.8e-3, "max": 1.2e-3}
    made = run(scenario(
        STEPS, size=[0.02, 0.04], periodic=not sides, gravity=[0, 0], walls=walls, friction=0.3,
        grains={"count": 90, "sizes": sizes}, heat={"temperature": 300.0}, dt=2e-4,
    ))  # fmt: skip
    late = Selection(start=40000.0)
    flows, contacts = layer_flow(made, late), layer_conductivity(made, late)
    keep(record_property, unsteadiness=flows.mean["unsteadiness"], square=contacts.mean["square"],
        flow_square=flows.mean["flow_square"])  # fmt: skip
    assert abs(flows.mean["unsteadiness"]) < 2e-3
    for name in ("conductance", "square", "conductivity"):
        assert flows.mean[f"flow_{name}"] == pytest.approx(contacts.mean[name], rel=1e-3)
    assert contacts.mean["square"] < contacts.mean["square_bulk"]
    network = heat_network(made)
    flow = flows.values["flow"][-1]
    assert network.summary["from_walls"] == pytest.approx(flow, rel=2e-3)
    assert network.summary["to_walls"] == pytest.approx(flow, rel=2e-3)
    # Through a line at any height goes the whole flow
    for y in (0.4 * contacts.height, 0.6 * contacts.height):
        line = fields(
            made, ["heat-flux"], late, along=((0.0, y), (0.02, y)), spacing=0.1, reach=1.0
        )
        through = np.trapezoid(line.values["heat-flux-y"], line.distance)
        assert through == pytest.approx(flow, rel=0.02)
    # Flux of grains by area: the mean flux
    flux = grain_map(made, "heat-flux").vector
    area = np.pi * made.model.grains.radius**2
    mean = (flux * area[:, np.newaxis]).sum(axis=0) / (contacts.width * contacts.height)
    assert mean[1] == pytest.approx(flow / contacts.width, rel=2e-3)


@pytest.mark.parametrize("axis", ["x", "y"])
def test_shares_of_a_packing_in_its_steady_state(run, axis, record_property):
    """Pressed discs in a gas that radiate, between a floor and a lid, or walls on the left and on
    the right: contacts have what their network in the frames passes, Σ q ℓ/(Q H), and the books of
    all ways together Q H."""
    low, high = (plane(0.0), plane(0.04, -1))
    if axis == "x":
        low = {"kind": "plane", "point": [0.0, 0.0], "normal": [1.0, 0.0]}
        high = {"kind": "plane", "point": [0.04, 0.0], "normal": [-1.0, 0.0]}
    walls = {
        "hot": {"geometry": low, "thermal": {"temperature": 700.0}},
        "cold": {"geometry": high, "mass": 1e-3, "thermal": {"temperature": 500.0}},
        "near": {"geometry": plane(0.0)},
        "far": {"geometry": plane(0.02, -1)},
    }
    size = [0.04, 0.02]
    if axis == "y":
        size = size[::-1]
        walls["near"] = {"kind": "plane", "point": [0.0, 0.0], "normal": [1.0, 0.0]}
        walls["far"] = {"kind": "plane", "point": [0.02, 0.0], "normal": [-1.0, 0.0]}
    made = run(scenario(
        STEPS.replace("lid = { y", f"cold = {{ {axis}"), size=size, periodic=False, gravity=[0, 0],
        walls=walls, friction=0.3,
        grains={"count": 90, "sizes": {"kind": "uniform", "min": 0.8e-3, "max": 1.2e-3}},
        heat={"temperature": 600.0, "gas": {"conductivity": 0.03},
            "radiation": {"neighbors": True, "reach": 0.4}}, dt=2e-4,
        overrides=["materials.glass.emissivity=0.8"],
    ))  # fmt: skip
    late = Selection(start=40000.0)
    table = layer_flow(made, late, between=("hot", "cold"))
    assert table.walls == ("hot", "cold")
    assert abs(table.mean["unsteadiness"]) < 1e-3
    shares = {way: table.mean[f"share_{way}"] for way in WAYS}
    keep(record_property, **shares)
    assert sum(shares.values()) == pytest.approx(1.0)
    frame, flow = made.frames[-1], table.mean["flow"] * table.height
    passed = heat_flows(frame, made.model).virial("xy".index(axis)).sum()
    assert shares["contacts"] == pytest.approx(passed / flow, rel=2e-3)
    series, k = made.series, -1
    window = series["time"][k] - series["time"][k - 1]
    books = [np.diff(series[f"heat_way_by_{way}_{axis}"])[k] / window for way in WAYS]
    assert sum(books) == pytest.approx(flow, rel=2e-3)
    assert all(shares[way] > 0.01 for way in WAYS[:3])
    assert shares["motion"] == pytest.approx(0.0, abs=1e-6)
    assert table.error["share_gas"] < 1e-3
    network = layer_conductivity(made, late, between=("hot", "cold"))
    assert 0.0 < network.mean["square"] < table.mean["flow_square"]


# --- beds on a warm floor


def standing(run, columns, rows, dt, duration):
    """Columns of discs that stand still on a floor 10 K warmer, each contact under 1 N; their run,
    conductance of a contact and of one with the floor, heat capacity of a disc."""
    places = [
        [0.01 + 4.0 * RADIUS * column, RADIUS + 2.0 * RADIUS * row, RADIUS]
        for row in range(rows)
        for column in range(columns)
    ]
    made = run(scenario(
        size=[0.02 + 4.0 * RADIUS * columns, 2.0], gravity=[0, 0], grains=places,
        walls={"floor": {"geometry": plane(0.0), "thermal": {"temperature": 310.0}}},
        heat={"temperature": 300.0, "force": {"prescribed": 1.0}}, dt=dt, frame_interval=dt,
        loading=[{"frozen": True, "duration": duration}],
    ))  # fmt: skip
    contacts, n = made.frames[-1].contacts, made.model.grain_count
    of_wall = contacts.j >= n
    inside = contacts.conductance[~of_wall]
    h, wall = float(inside.mean()) if inside.size else np.nan, contacts.conductance[of_wall]
    return made, h, float(wall.mean()), float(made.model.thermal.capacity[0])


def test_a_lumped_bed_relaxes_exponentially(run):
    """Three discs on the floor: h = H/(d b), and T_wall − T_bed falls with ΣC/(h A)."""
    made, _, wall, capacity = standing(run, 3, 1, 1.0, 200.0)
    table = wall_heat(made, ALL)
    h = wall / (2.0 * RADIUS * THICKNESS)
    assert table.mean["floor: wetted"] == pytest.approx(6.0 * RADIUS)
    assert table.mean["floor: coefficient"] == pytest.approx(h, rel=1e-3)
    assert table.mean["floor: nusselt"] == pytest.approx(h * 2.0 * RADIUS / 1.0, rel=1e-3)
    left = table.values["floor: difference"]
    time = (table.time[-1] - table.time[0]) * wall / capacity
    assert left[-1] / left[0] == pytest.approx(exp(-time), rel=1e-3)
    fixed = wall_heat(made, ALL, ["floor"], length=0.01)
    assert fixed.mean["floor: coefficient"] == pytest.approx(h * 0.6, rel=1e-3)


def test_a_deep_bed_takes_heat_as_a_half_space(run, record_property):
    """Penetration theory: Q/(A ΔT) falls as √(λρc/πt), here λρc = H C/(d b)² of a column of discs.

    The floor's contact adds the resistance R = 1/H_w − 1/2H: Q = ΔT/R exp(s²) erfc(s) with
    s = √t/(R √(H C)) (Carslaw & Jaeger 1959). That the bed is made of discs adds C/16Ht of it, from
    the next term of the impedance of a ladder, √(1/HCp) (1 + Cp/8H) − 1/2H.
    """
    made, h, wall, capacity = standing(run, 1, 120, 5.0, 1200.0)
    effusivity, resistance = sqrt(h * capacity), 1.0 / wall - 0.5 / h

    def flow(time):
        s = sqrt(time) / (resistance * effusivity)
        return 10.0 / resistance * exp(s * s) * erfc(s) * (1.0 + capacity / (16.0 * h * time))

    table = wall_heat(made, ALL)
    late = table.time > 400.0
    time, found = table.time[late] - 2.5, table.values["floor: flow"][late]
    expected = np.array([flow(t) for t in time])
    keep(record_property, time=time, flow=found, expected=expected)
    np.testing.assert_allclose(found, expected, rtol=1e-3)
    # h, over the difference from a bed that has warmed a little; in the end near the half-space's
    area, difference = 2.0 * RADIUS * THICKNESS, table.values["floor: difference"][late]
    coefficient = table.values["floor: coefficient"][late]
    np.testing.assert_allclose(coefficient, expected / (area * difference), rtol=1e-3)
    half_space = effusivity / area / np.sqrt(pi * time[-1])
    assert coefficient[-1] * difference[-1] / 10.0 == pytest.approx(half_space, rel=0.01)
    # The lowest disc for the bed: what is between is its contact
    near = wall_heat(made, Selection(start=400.0), near=0.1)
    assert near.mean["floor: coefficient"] == pytest.approx(wall / area, rel=1e-3)
