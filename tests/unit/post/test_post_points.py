"""Contacts at several points: two boxes on each other have one contact, with all that it carries."""

from dataclasses import replace

import numpy as np
import pytest
from cells import strained
from made_up_frames import contacts_of, frame_of, source_of
from scene_parts import FLOOR
from shaped_frames import box, disc, points_of, regular, rod, shaped_frame, shaped_model

from multicor_cli import post
from multicor_cli.model import Thermal
from multicor_cli.post.chains import find_chains
from multicor_cli.post.contacts import (
    conducting_contacts,
    contacts_at,
    heat_flows,
    loaded_contacts,
    own_stress,
)
from multicor_cli.post.lattice import Lattice
from multicor_cli.post.source import turned
from multicor_cli.post.spots import KINDS, kinds_of
from multicor_cli.post.wall_heat import _wetted

ALL = post.Selection(start=0.0)
GAP = 1e-3


def column(forces=((3.0, 0.3), (1.0, -0.5)), on_floor=((4.0, 0.2), (2.0, 0.1)), **said):
    """A box on a box on the floor; each pair touches at two points, which carry these forces.

    Boxes are 1 wide and 0.5 high, the upper one 0.2 to the right of the lower one.
    """
    model = shaped_model([[box(1.0, 0.5)], [box(1.0, 0.5)]], FLOOR)
    i, j = [0, 0, 0, 0], [1, 1, 2, 2]
    normal = [[0.0, -1.0], [0.0, -1.0], [0.0, 1.0], [0.0, 1.0]]
    arm = [[-0.3, 0.25], [0.5, 0.25], [-0.5, -0.25], [0.5, -0.25]]
    contacts = points_of(i, j, normal, [*forces, *on_floor], arm, GAP, **said)
    place = np.array([[0.0, 0.25 + GAP], [0.2, 0.75 + 2.0 * GAP]])
    return source_of(model, [shaped_frame(place, walls=1, contacts=contacts)])


def test_a_side_is_one_contact_with_the_sum_of_its_forces():
    source = column()
    network = post.force_network(source)
    assert network.i.tolist() == [0, 0]
    assert network.j.tolist() == [1, 2]
    assert network.force == pytest.approx(np.array([[4.0, -0.2], [6.0, 0.3]]))
    assert network.normal.tolist() == [[0.0, -1.0], [0.0, 1.0]]
    # where the resultant acts
    assert network.touch[:, 0] == pytest.approx([(3 * -0.3 + 0.5) / 4, (4 * -0.5 + 2 * 0.5) / 6])
    assert network.touch[:, 1] == pytest.approx([0.5 + GAP, GAP])
    assert network.start - network.end == pytest.approx(
        np.array([[-0.2, -0.5 - GAP], [0.5 / 3.0, 0.25 + GAP]])
    )
    expected = {
        "contacts": 2, "wall_contacts": 1, "coordination": 1.5, "points": 3.0,
        "normal_force_mean": 5.0, "normal_force_max": 6.0, "tangential_force_mean": 0.25,
        "rattler_share": 0.0,  # what lies on a side is held
    }  # fmt: skip
    assert {name: network.summary[name] for name in expected} == pytest.approx(expected)


def dyads(source):
    """Σ f⊗ℓ over points one by one, with the branch from center to center, or to the floor."""
    frame, found = source.frames[0], np.zeros((2, 2))
    c = frame.contacts
    for k in range(c.i.size):
        n, (f, g) = c.normal[k], c.force[k]
        force = f * n + g * np.array([-n[1], n[0]])
        branch = c.gap[k] * n - c.arm[k]
        if c.j[k] < len(frame.position):
            branch = frame.position[c.i[k]] - frame.position[c.j[k]]
        found += np.outer(force, branch)
    return found


def test_stress_is_that_of_the_points():
    source = column()
    contacts = loaded_contacts(source.frames[0], source.model)
    for a in (0, 1):
        for b in (0, 1):
            assert contacts.virial(a, b).sum() == pytest.approx(dyads(source)[a, b])
    table = post.profile(source, "stress-yy", ALL, 1, exclude_walls=0.0)
    assert table.value[0] * table.bin_area == pytest.approx(dyads(source)[1, 1])
    stress, c = np.zeros((2, 2, 2)), source.frames[0].contacts
    for k in range(4):
        n, (f, g) = c.normal[k], c.force[k]
        force = f * n + g * np.array([-n[1], n[0]])
        stress[0] += np.outer(force, -c.arm[k]) / 0.5
        if c.j[k] == 1:
            there = source.frames[0].position[0] + c.arm[k] - GAP * n
            stress[1] += np.outer(-force, source.frames[0].position[1] - there) / 0.5
    assert own_stress(contacts, source.model) == pytest.approx(stress.reshape(2, 4))


def test_a_grain_that_is_pressed_from_two_sides():
    """Σ f⊗r/A of a box under the force F above and below: F h/A, whatever the points are."""
    model = shaped_model([[box(2.0, 0.5)], [box(2.0, 0.5)]], FLOOR)
    arm = [[-1.0, 0.25], [0.5, 0.25], [-0.7, -0.25], [0.1, -0.25], [0.9, -0.25]]
    normal = [[0.0, -1.0]] * 2 + [[0.0, 1.0]] * 3
    force = [[3.0, 0.0], [1.0, 0.0], [1.5, 0.0], [1.5, 0.0], [1.0, 0.0]]
    contacts = points_of([0] * 5, [1] * 2 + [2] * 3, normal, force, arm)
    place = np.array([[0.0, 0.25], [0.0, 0.75]])
    source = source_of(model, [shaped_frame(place, walls=1, contacts=contacts)])
    found = own_stress(loaded_contacts(source.frames[0], model), model)
    assert found[0, 3] == pytest.approx(4.0 * 0.5 / 1.0)
    assert found[1, 3] == pytest.approx(4.0 * 0.25 / 1.0)
    assert post.grain_map(source, "stress").value == pytest.approx(
        0.5 * (found[:, 0] + found[:, 3])
    )


def test_images_are_contacts_of_their_own():
    """A box that is as wide as the period touches itself, one beside it two images of the other."""
    model = shaped_model(
        [[box(1.0, 1.0)], [box(1.0, 1.0)]], walls=("cell",), period=2.0, height=3.0
    )
    arm = [[0.5, -0.5], [-0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]]
    normal = [[-1.0, 0.0], [1.0, 0.0]] * 2
    contacts = points_of([0] * 4, [1] * 4, normal, (1.0, 0.0), arm)
    frame = shaped_frame(np.array([[0.4, 1.0], [1.4, 1.0]]), walls=1, contacts=contacts)
    frame.wall_position = np.array([[2.0, 3.0, 0.3]])
    found = loaded_contacts(frame, model)
    assert found.counts.tolist() == [2, 2]
    assert found.force[:, 0].tolist() == [2.0, 2.0]
    assert found.branch[np.argsort(found.branch[:, 0])] == pytest.approx(
        np.array([[-1.0, 0.0], [1.0, 0.0]])
    )
    assert found.row.tolist() == [0, 1]


@pytest.mark.parametrize("tilt", [0.0, 0.9])
def test_branches_lead_to_the_image_that_is_touched(tilt):
    random = np.random.default_rng(2)
    size, lattice = np.array([5.0, 4.0]), Lattice(5.0, 4.0, tilt)
    place = lattice.wrapped(random.uniform(0.0, 5.0, (300, 2)))
    model = shaped_model([[disc(0.5)]] * 300, walls=("cell",), period=size[0], height=size[1])
    i, j = np.arange(150), np.arange(150) + 150
    angle, away = random.uniform(0.0, 6.3, 150), random.uniform(0.9, 1.1, 150)
    branch = away[:, np.newaxis] * np.column_stack([np.cos(angle), np.sin(angle)])
    place[j] = lattice.wrapped(place[i] - branch)
    normal = branch / away[:, np.newaxis]
    contacts = points_of(i, j, normal, (1.0, 0.0), -0.5 * normal, away - 1.0)
    frame = shaped_frame(place, walls=1, contacts=contacts)
    frame.wall_position = np.array([[*size, tilt]])
    assert loaded_contacts(frame, model).branch == pytest.approx(branch, abs=1e-12)


def disc_source(random, *, are_shapes, heat=True):
    """Discs that touch in a cell, with random forces; told as outlines, or not."""
    n, size = 120, 8.0
    lattice = Lattice(size, size, 1.5)
    radius, place = random.uniform(0.35, 0.6, n), lattice.wrapped(random.uniform(0, size, (n, 2)))
    i, j = np.triu_indices(n, 1)
    way = place[i] - place[j]
    way = way - lattice.nearest(way) @ lattice.vectors
    away = np.hypot(*way.T)
    near = away < 1.1 * (radius[i] + radius[j])
    i, j, away, normal = i[near], j[near], away[near], (way / away[:, np.newaxis])[near]
    force = np.column_stack([random.exponential(1.0, i.size), random.normal(0.0, 0.2, i.size)])
    gap, sliding = away - radius[i] - radius[j], random.random(i.size) < 0.3
    contacts = points_of(i, j, normal, force, -radius[i, np.newaxis] * normal, gap, sliding)
    contacts.conductance = random.exponential(1.0, i.size) * (random.random(i.size) < 0.8)
    model = shaped_model([[disc(r)] for r in radius], walls=("cell",), period=size, height=size)
    if not are_shapes:
        model = replace(model, outlines=None)
        contacts.arm = None
    if heat:
        model = replace(model, thermal=Thermal(np.ones(n), np.ones(n), 2.0 * np.pi * radius))
    frame = shaped_frame(place, walls=1, contacts=contacts, temperature=random.uniform(1, 2, n))
    frame.velocity = random.normal(size=(n, 2))
    frame.wall_temperature = np.full(0, np.nan)
    frame.wall_position = np.array([[size, size, 1.5]])
    frame.step = 1
    text = {"scenario_resolved": "[heat]\n", "path": "."}
    series = strained((size, size, 1.5), (0.0, 0.0, 0.1), [0.0, 1.0])
    return source_of(model, [frame, frame], [0.0, 1.0], series=series, **text)


TABLES = {
    "fabric": lambda source: post.fabric(source, ALL).mean,
    "chains": lambda source: post.chains(source, ALL).mean,
    "clusters": lambda source: post.clusters(source, ALL).mean,
    "lifetimes": lambda source: {"it": post.lifetimes(source, ALL).contacts_per_frame},
    "conductivity": lambda source: post.conductivity(source, ALL).mean,
    "heat network": lambda source: post.heat_network(source).summary,
    "forces": lambda source: post.force_network(source).summary,
    "angles": lambda source: post.angular_distribution(source, ALL).moments,
    "mobilization": lambda source: {"it": post.mobilization(source, ALL).mean},
    "stress": lambda source: {"it": post.profile(source, "stress-xy", ALL, 3).value.sum()},
    "coordination": lambda source: {"it": post.profile(source, "coordination", ALL, 1).value[0]},
    "heat flux": lambda source: {"it": post.grain_map(source, "heat-flux").value.mean()},
    "pressure": lambda source: {"it": post.grain_map(source, "stress").value.mean()},
    "force": lambda source: {"it": post.grain_map(source, "force").value.mean()},
    "fields": lambda source: {
        name: np.nanmean(values)
        for name, values in post.fields(source, selection=ALL, spacing=2.0).values.items()
        if name.startswith(("stress", "heat", "solid"))
    },
}


@pytest.mark.parametrize("name", TABLES)
def test_discs_have_the_same_contacts_as_outlines(name):
    measure = TABLES[name]
    plain, shaped = (
        measure(disc_source(np.random.default_rng(4), are_shapes=told)) for told in (False, True)
    )
    assert {key: shaped[key] for key in plain} == pytest.approx(
        plain, rel=1e-9, abs=1e-9, nan_ok=True
    )


def test_each_point_conducts_and_the_contact_has_the_sum():
    source = column()
    frame, n = source.frames[0], 2
    frame.contacts.conductance = np.array([1.0, 3.0, 0.5, 0.25])
    model = replace(source.model, thermal=Thermal(np.ones(n), np.ones(n), np.ones(n)))
    frame.temperature, frame.wall_temperature, frame.step = np.array([1.0, 5.0]), [2.0], 1
    contacts, conductance = conducting_contacts(frame, model, has_walls=True)
    assert conductance.tolist() == [4.0, 0.75]
    assert contacts.arm[0] == pytest.approx([(-0.3 + 3.0 * 0.5) / 4.0, 0.25])
    flows = heat_flows(frame, model)
    assert flows.flow.tolist() == [16.0, 0.75]
    assert flows.conductance.tolist() == [4.0, 0.75]
    made = source_of(model, [frame], scenario_resolved="[heat]\n")
    network = post.heat_network(made)
    assert network.flow.tolist() == [16.0, 0.75]
    assert network.summary["coordination"] == 1.5


def test_friction_of_a_side_is_mobilized_by_both_points_together():
    """0.2 of 0.5 · 4 N, where one point alone bears 0.5 of 0.5 N."""
    found = post.mobilization(column(), ALL, 10)
    assert found.mean == pytest.approx(0.2 / (0.5 * 4.0))
    assert found.contacts == 1
    one = post.mobilization(column(sliding=[True, False, False, False]), ALL, 10)
    assert one.sliding == 0.0  # the other point holds it
    both = post.mobilization(column(sliding=[True, True, False, False]), ALL, 10)
    assert both.sliding == both.mean == 1.0


def test_frames_without_contacts_have_none():
    """Beside one that has some."""
    source, none = column(), points_of([], [], np.zeros((0, 2)), np.zeros((0, 2)), np.zeros((0, 2)))
    frame = shaped_frame(np.array([[0.0, 1.0], [0.0, 2.0]]), walls=1, contacts=none)
    both = source_of(source.model, [frame, source.frames[0]])
    assert post.fabric(both, ALL).values["contacts"].tolist() == [0.0, 1.0]
    assert post.clusters(both, ALL).mean["clusters"] == 0.0
    assert post.mobilization(both, ALL).contacts == 1
    assert post.profile(both, "stress-yy", ALL, 1).value[0] > 0.0
    assert loaded_contacts(frame, source.model).force.dtype == np.float64


def test_lifetimes_count_pairs():
    first, last = column(), column(((3.0, 0.0), (0.0, 0.0)))
    source = source_of(first.model, [first.frames[0], last.frames[0]])
    found = post.lifetimes(source, ALL)
    assert found.contacts_per_frame == 2.0
    assert found.contacts.tolist() == [1.0]


def test_links_of_chains_follow_branches():
    """Boxes on each other, shifted: links are from center to center."""
    count, shift = 5, 0.3
    model = shaped_model([[box(1.0, 0.5)]] * count, FLOOR)
    i = np.repeat(np.arange(count - 1), 2)
    arm = np.tile([[-0.5 + shift, 0.25], [0.5, 0.25]], (count - 1, 1))
    contacts = points_of(i, i + 1, (0.0, -1.0), (1.0, 0.0), arm)
    place = np.column_stack([shift * np.arange(count), 0.25 + 0.5 * np.arange(count)])
    frame = shaped_frame(place, walls=1, contacts=contacts)
    table = post.chains(source_of(model, [frame]), ALL)
    assert table.mean["longest"] == 3.0  # the ends bear half
    assert table.mean["direction"] == pytest.approx(np.degrees(np.arctan2(0.5, shift)))
    found = find_chains(loaded_contacts(frame, model), model)
    assert found.length.tolist() == [3]


def test_opposite_normals_of_a_pair_do_not_cancel_its_forces():
    """A disc between the prongs of a clump: the resultant, and the normal of the first point."""
    prongs = [box(2.0, 0.2, at=(0.0, 0.6)), box(2.0, 0.2, at=(0.0, -0.6))]
    model = shaped_model([[disc(0.5)], prongs], areas=[np.pi / 4.0, 0.8])
    contacts = points_of(
        [0, 0], [1, 1], [[0, -1], [0, 1]], [[2, 0.5], [2, 0.5]], [[0, 0.5], [0, -0.5]]
    )
    frame = shaped_frame(np.zeros((2, 2)), walls=1, contacts=contacts)
    found = loaded_contacts(frame, model)
    assert found.vector == pytest.approx(np.zeros((1, 2)), abs=1e-15)
    assert found.normal.tolist() == [[0.0, -1.0]]
    assert found.virial(1, 1)[0] == 0.0
    assert own_stress(found, model)[0, 3] == pytest.approx(2.0 / (np.pi / 4.0))


def test_walls_that_stand_upright_turn_arms_too():
    source = turned(column())
    frame = source.frames[0]
    found = loaded_contacts(frame, source.model)
    plain = loaded_contacts(column().frames[0], source.model)
    for name in ("arm", "branch", "vector"):
        x, y = getattr(plain, name).T
        assert getattr(found, name) == pytest.approx(np.column_stack([-y, x]))
    assert frame.angle.tolist() == [np.pi / 2.0] * 2


# ---- Kinds


def kind_of(first, second, place, angle, points, **more):
    """The kind of the contacts of two grains: (normal, arm, force) of each point."""
    normal, arm, force = zip(*points, strict=True)
    model = shaped_model([first, second], (), (), **more)
    count = len(points)
    contacts = points_of([0] * count, [1] * count, normal, [[f, 0.0] for f in force], arm)
    frame = shaped_frame(np.array([[0.0, 0.0], place]), angle, walls=0, contacts=contacts)
    contacts = loaded_contacts(frame, model)
    return [KINDS[k] for k in kinds_of(contacts, model, frame)]


RIGHT = (-1.0, 0.0)
HALF = 0.5 * np.sqrt(2.0)
CASES = {
    "sides": (box(1, 1), box(1, 1), (1.0, 0.4), (0, 0), [(RIGHT, (0.5, -0.1), 1), (RIGHT, (0.5, 0.5), 1)],
        "edge_edge"),
    "sides of equal boxes": (box(1, 1), box(1, 1), (1.0, 0.0), (0, 0),
        [(RIGHT, (0.5, -0.5), 1), (RIGHT, (0.5, 0.5), 1)], "edge_edge"),
    "sides, one point bears": (box(1, 1), box(1, 1), (1.0, 0.4), (0, 0),
        [(RIGHT, (0.5, -0.1), 1), (RIGHT, (0.5, 0.5), 0)], "edge_corner"),
    "a corner on a side": (box(1, 1), box(1, 1), (0.5 + HALF, 0.1), (0, np.pi / 4),
        [(RIGHT, (0.5, 0.1), 1)], "edge_corner"),
    "rounded corners": (box(0.8, 0.8, 0.1), box(0.8, 0.8, 0.1), (0.8 + 0.2 * HALF, 0.8 + 0.2 * HALF),
        (0, 0), [((-HALF, -HALF), (0.4 + 0.1 * HALF, 0.4 + 0.1 * HALF), 1)], "corner_corner"),
    "a rounded corner on a side": (box(0.8, 0.8, 0.1), disc(0.5), (1.0, 0.3), (0, 0),
        [(RIGHT, (0.5, 0.3), 1)], "edge_corner"),
    "discs": (disc(0.5), disc(0.5), (1.0, 0.0), (0, 0), [(RIGHT, (0.5, 0.0), 1)], "corner_corner"),
    "sides of rods": (rod(1, 0.2), rod(1, 0.2), (0.3, -0.4), (0, np.pi),
        [((0.0, 1.0), (-0.2, -0.2), 1), ((0.0, 1.0), (0.5, -0.2), 1)], "edge_edge"),
    "ends of rods": (rod(1, 0.2), rod(1, 0.2), (1.4, 0.0), (0, 0), [(RIGHT, (0.7, 0.0), 1)],
        "corner_corner"),
    "an end on the side of a rod": (rod(1, 0.2), rod(1, 0.2), (0.1, 0.9), (0, np.pi / 2),
        [((0.0, -1.0), (0.1, 0.2), 1)], "edge_corner"),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("turn", [0.0, 1.1])
def test_kinds_of_contacts(name, turn):
    """As they lie, and all turned."""
    first, second, place, angle, points, expected = CASES[name]
    c, s = np.cos(turn), np.sin(turn)

    def turned(vector):
        return c * vector[0] - s * vector[1], s * vector[0] + c * vector[1]

    points = [(turned(normal), turned(arm), force) for normal, arm, force in points]
    found = kind_of([first], [second], turned(place), np.array(angle) + turn, points)
    assert found == [expected]


def test_two_pieces_beside_each_other_are_no_edge():
    """Two clumps of two discs that lie on each other touch twice, with four corners."""
    clump = [disc(0.5, (-0.4, 0.0)), disc(0.5, (0.4, 0.0))]
    down = (0.0, -1.0)
    points = [(down, (-0.4, 0.5), 2.0), (down, (0.4, 0.5), 1.0)]
    assert kind_of(clump, clump, (0.0, 1.0), (0.0, 0.0), points, areas=[1.4, 1.4]) == [
        "corner_corner"
    ]


def test_shares_of_kinds_in_fabric():
    """A pentagon on a side, and on a corner: shares of contacts, and of what they carry."""
    model = shaped_model([[regular(4, HALF, turn=np.pi / 4)]] * 3, walls=())
    arm = [[-0.2, 0.5], [0.5, 0.5], [0.5, 0.1]]
    normal = [[0.0, -1.0], [0.0, -1.0], [-1.0, 0.0]]
    contacts = points_of([0, 0, 0], [1, 1, 2], normal, [[1, 0], [2, 0], [1, 0]], arm)
    place = np.array([[0.0, 0.0], [0.3, 1.0], [0.5 + HALF, 0.1]])
    frame = shaped_frame(place, [0.0, 0.0, np.pi / 4], walls=0, contacts=contacts)
    mean = post.fabric(source_of(model, [frame]), ALL).mean
    expected = {
        "contacts": 2.0, "edge_edge": 0.5, "edge_corner": 0.5, "corner_corner": 0.0,
        "edge_edge_force": 0.75, "edge_corner_force": 0.25, "corner_corner_force": 0.0,
    }  # fmt: skip
    assert {name: mean[name] for name in expected} == expected
    assert "nematic_order" not in mean  # squares have no long axes


# ---- Stress and fabric of branches that are not along normals


def test_stress_of_known_anisotropies_with_branches_across():
    """q/p in closed form, as `Fabric` says; pairs of grains at any distance stand for contacts."""
    c, n, t, l, m = 0.3, 0.2, 0.15, -0.1, 0.25  # noqa: E741
    count = 4000
    u = (np.arange(count) + 0.5) / count * 2.0 * np.pi
    theta = u.copy()
    for _ in range(60):
        theta = u - 0.5 * c * np.sin(2.0 * theta)
    normal = np.column_stack([np.cos(theta), np.sin(theta)])
    tangent = np.column_stack([-normal[:, 1], normal[:, 0]])
    wave, across = np.cos(2.0 * theta), np.sin(2.0 * theta)
    force = np.column_stack([1.0 + n * wave, -t * across])
    branch = (1.0 + l * wave)[:, None] * normal - (m * across)[:, None] * tangent
    place = np.concatenate([branch, np.zeros((count, 2))])
    i = np.arange(count)
    contacts = points_of(i, i + count, normal, force, -0.5 * normal)
    model = shaped_model([[disc(0.5)]] * (2 * count), walls=())
    mean = post.fabric(
        source_of(model, [shaped_frame(place, walls=0, contacts=contacts)]), ALL
    ).mean
    for name, value in {"a_c": c, "a_n": n, "a_t": t, "a_l": l, "a_lt": m}.items():
        assert mean[name] == pytest.approx(value, abs=2e-3)
    first = 0.5 * (c + n + t + l + m)
    above = first + 0.125 * c * (3.0 * n * l + t * l + n * m - t * m)
    exact = above / (1.0 + 0.5 * (c * n + c * l + n * l + t * m))
    assert mean["stress_ratio"] == pytest.approx(exact, abs=1e-5)
    assert mean["stress_fabric"] == pytest.approx(first, abs=3e-3)
    assert mean["stress_fabric_full"] == pytest.approx(exact, abs=3e-3)
    assert (mean["theta_s"] + 90.0) % 180.0 == pytest.approx(90.0, abs=1e-6)


def test_models_of_discs_have_rows_as_contacts():
    from scene_parts import make_model

    model = make_model([0.5, 0.5])
    contacts = contacts_of([0, 0], [1, 1], (1.0, 0.0), (2.0, 0.0))  # two images
    frame = frame_of(np.zeros((2, 2)), walls=1, contacts=contacts)
    found = contacts_at(frame, model, np.arange(2))
    assert found.joined is None
    assert found.counts.tolist() == found.point_counts.tolist() == [2, 2]


@pytest.mark.parametrize(("angle", "width"), [(0.0, 2.0), (np.pi / 2.0, 0.5), (np.pi / 6.0, 1.982)])
def test_what_touches_a_wall_wets_its_width_along_it(angle, width):
    """On a floor, and turned with it; a side that touches at two points counts once."""
    model = shaped_model([[box(2.0, 0.5)]] * 3, FLOOR)
    contacts = points_of([0, 0, 1], [3, 3, 3], (0.0, 1.0), (1.0, 0.0), (0.0, -0.5))
    frame = shaped_frame(np.zeros((3, 2)), angle, walls=1, contacts=contacts)
    assert _wetted(model, frame, 0) == pytest.approx(2.0 * width, rel=1e-3)
    contacts.normal = np.tile([np.cos(1.0), np.sin(1.0)], (3, 1))
    frame.angle += 1.0 - np.pi / 2.0
    assert _wetted(model, frame, 0) == pytest.approx(2.0 * width, rel=1e-3)
