"""Where links lead, what lasts with contacts, and what it may hold without changing a bit."""

import numpy as np
from heat_parts import make_heat_laws, with_heat
from scene_parts import make_model

from multicor_cli.engine.geometry.places import (
    Places,
    find_places,
    rows_in_corners,
    totals_of_places,
)
from multicor_cli.engine.geometry.scene import scene_of
from multicor_cli.engine.heat.network import contact_links, ends_of, network_of, shapes_of
from multicor_cli.engine.heat.rates import rates_at
from multicor_cli.engine.heat.settings import HeatSettings
from multicor_cli.engine.heat.spots import Spots, Touching
from multicor_cli.engine.heat.walls import WallHeat
from multicor_cli.model import ShapeKind

SETTINGS = HeatSettings(make_heat_laws())
KINDS = ("insulated", "flow", "capacity", "temperature", "flow", "capacity")
FLAT = [(ShapeKind.PLANE, wall, (0.0, -1.0, 0.0, 1.0)) for wall in range(len(KINDS))]
RADII = np.linspace(1.0, 2.0, 5)


def model_of(shapes):
    names = tuple(f"wall {wall}" for wall in sorted({wall for _, wall, _ in shapes}))
    return with_heat(make_model(RADII, shapes, names, shape="sphere"), 300.0)


def every_pair(count, others):
    pairs = [(i, j) for i in range(count) for j in range(i + 1, count + others)]
    return np.array(pairs, np.int32).T.copy()


def network(conductance):
    """Five grains, each with the four others and six walls of all kinds, and the links."""
    model = model_of(FLAT)
    scene = scene_of(model, np.zeros((5, 2)), np.zeros((len(KINDS), 3)))
    i, j = every_pair(5, len(KINDS))
    ends = ends_of(shapes_of([WallHeat(kind) for kind in KINDS], model, SETTINGS), i, j)
    touching = Touching.of(scene, i, j, SETTINGS)
    places = Places.of(scene, i, j, np.zeros(0, np.int64))
    links = contact_links(Spots(touching, places, conductance, conductance), ends)
    return network_of(links, 7, np.zeros((5, 2)), model, SETTINGS, np.empty(0)), links


def test_links_are_sorted_by_what_they_lead_to():
    i, j = every_pair(5, len(KINDS))
    conductance = np.arange(1.0, i.size + 1)
    net, links = network(conductance)
    nodes = {7: 5, 10: 6}  # walls with a heat capacity
    between = [k for k in range(i.size) if j[k] < 5 or int(j[k]) in nodes]
    assert net.i.tolist() == i[between].tolist()
    assert net.j.tolist() == [nodes.get(int(b), b) for b in j[between]]
    assert net.conductance.tolist() == conductance[between].tolist()
    known, flowing = np.flatnonzero(j == 8), np.flatnonzero((j == 6) | (j == 9))
    assert (net.wall_i.tolist(), set(net.wall.tolist())) == (i[known].tolist(), {3})
    assert net.wall_conductance.tolist() == conductance[known].tolist()
    assert net.flow_i.tolist() == i[flowing].tolist()
    assert net.flow_wall.tolist() == (j[flowing] - 5).tolist()
    for wall in (1, 4):
        share = net.flow_share[net.flow_wall == wall]
        touched = conductance[j == 5 + wall]
        assert share.tolist() == (touched / touched.sum()).tolist()
    inner = np.append(15.0 * RADII, np.full(len(KINDS), np.inf))
    assert links.biot == max(conductance / np.minimum(inner[i], inner[j]))


def test_links_that_conduct_nothing_change_no_bit():
    i, _ = every_pair(5, len(KINDS))
    rng = np.random.default_rng(3)
    conductance = np.where(rng.random(i.size) < 0.5, 0.0, rng.random(i.size))
    full, _ = network(conductance)
    has, at_wall, flows = full.conductance > 0.0, full.wall_conductance > 0.0, full.flow_share > 0.0
    assert not any(every.all() for every in (has, at_wall, flows))
    few = full._replace(
        i=full.i[has], j=full.j[has], conductance=full.conductance[has],
        wall_i=full.wall_i[at_wall], wall=full.wall[at_wall],
        wall_conductance=full.wall_conductance[at_wall], flow_i=full.flow_i[flows],
        flow_wall=full.flow_wall[flows], flow_share=full.flow_share[flows],
    )  # fmt: skip
    temperature, walls = 300.0 + rng.random(7), 300.0 + rng.random(len(KINDS))
    for of_all, of_few in zip(
        rates_at(full, temperature, walls), rates_at(few, temperature, walls), strict=True
    ):
        assert of_all.tobytes() == of_few.tobytes()


def test_flow_walls_that_touch_nothing_share_nothing_out():
    net, _ = network(np.zeros(every_pair(5, len(KINDS))[0].size))
    assert net.flow_share.size == 10
    assert not net.flow_share.any()


def test_only_pieces_beside_others_are_looked_at_for_places():
    """A polygon of 40 sides round five grains: what they touch of it may be one place or two."""
    angle = np.linspace(0.0, 2.0 * np.pi, 41)
    x, y = 6.0 * np.cos(angle), 6.0 * np.sin(angle)
    sides = [
        (ShapeKind.SEGMENT, 0, (x[k], y[k], x[k + 1], y[k + 1])) for k in range(angle.size - 1)
    ]
    model = model_of([*sides, (ShapeKind.DISC, 0, (0.0, 0.0, 0.5, 0.0))])
    rng, some = np.random.default_rng(4), []
    for _ in range(20):
        scene = scene_of(model, rng.uniform(-4.0, 4.0, (5, 2)), np.zeros((1, 3)))
        i, j = every_pair(5, len(model.shapes.kind))
        chosen = rng.random(i.size) < 0.1
        i, j, values = i[chosen], j[chosen], rng.random(int(chosen.sum()))
        rows = rows_in_corners(scene, i, j)
        some.append(0 < rows.size < i.size)
        assert (
            Places.of(scene, i, j, rows).totals(values).tobytes()
            == totals_of_places(find_places(scene, i, j)[0], values).tobytes()
        )
    assert any(some)
