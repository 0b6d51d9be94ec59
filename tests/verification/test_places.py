"""What a wall does to a grain does not depend on its pieces: heat and adhesion by the place."""

import itertools

import numpy as np
import pytest
from heat_parts import (
    at_temperature,
    coupled_engine,
    heat_book,
    heat_engine,
    make_heat_laws,
    with_heat,
)  # fmt: skip
from scene_parts import TIGHT, G, advance, book, make_engine, make_model, resume
from wall_lines import level, walls_of

from multicor_cli.engine.geometry.places import RISE
from multicor_cli.engine.heat import gas
from multicor_cli.engine.heat.hertz import contact_radius, hertz_conductance, rough_conductance
from multicor_cli.engine.heat.impacts import impact_exchange
from multicor_cli.engine.heat.radiation import Radiation, cylinder_view_factor, linear_coefficient
from multicor_cli.engine.heat.settings import ContactForce
from multicor_cli.engine.heat.walls import WallHeat
from multicor_cli.engine.motion.drives import Constant, DofDrive, WallDrive
from multicor_cli.model import ShapeKind

FORCE, GAS = 1e5, 0.5
LAWS = make_heat_laws(emissivity=0.9)
"""Of one material: grains of 1 m radius, λ 15 W/(m K), in a gas of 0.5 W/(m K)."""
SPOT = contact_radius(FORCE, 1.0, LAWS.modulus[0, 0])
WEIGHT = make_model([1.0], shape="sphere").grains.mass[0] * G
WARM = at_temperature(300.0001)


def heavy(lines, **choices):
    """A sphere of 1 m at 300 K and 1 GJ/K between walls, and what these are kept at."""
    shapes, names = walls_of(lines)
    model = make_model([1.0], shapes, names, **{"shape": "sphere", **choices})
    return with_heat(model, 300.0, capacity=1e9), [WARM] * len(names)


def tiles(width, shift):
    edges = np.arange(-8.0, 8.0, width) + shift
    return [level(a, b) for a, b in itertools.pairwise(edges)]


FLOORS = {
    "one piece": [level(-8.0, 8.0)],
    "two pieces": [level(-8.0, 0.0, 8.0)],
    "twenty pieces": [level(*np.linspace(-8.0, 8.0, 21))],
    **{
        f"two walls, {x} beside": [level(-8.0, x), level(x, 8.0)] for x in (0.0, 0.1, 0.5, 1.0, 2.0)
    },
    "tiles on an edge": tiles(0.25, 0.0),
    "tiles off an edge": tiles(0.25, 0.1),
    "small tiles": tiles(0.0625, 0.03125),
    "coincident": [level(-8.0, 8.0), level(-8.0, 8.0)],
    "a corner": [[(-8.0, -6.0), (0.0, 0.0), (8.0, -6.0)]],
    "a corner of two walls": [[(-8.0, -6.0), (0.0, 0.0)], [(0.0, 0.0), (8.0, -6.0)]],
    "a sharp corner of two walls": [[(-1.0, -6.0), (0.0, 0.0)], [(0.0, 0.0), (1.0, -6.0)]],
    "a slab": [[(-8.0, 0.0), (8.0, 0.0), (8.0, -0.1), (-8.0, -0.1)], level(-9.0, 9.0)],
}
"""Walls below a grain of radius 1 that touches them at the origin, by the points of each."""

MECHANISMS = {
    "hertz": {},
    "rough": {"conduction": "rough"},
    "parallel": {"conduction": "none", "mechanisms": (gas.Gas(GAS),)},
    "batchelor": {"mechanisms": (gas.Gas(GAS, "batchelor"),)},
    "vargas": {"conduction": "none", "mechanisms": (gas.Gas(GAS, "vargas"),)},
    "radiation": {"conduction": "none", "mechanisms": (Radiation(reach=0.4),)},
}


def closed_form(mechanism, radius=1.0):
    """Conductance of a grain of radius 1 with this effective radius at the contact [W/K]."""
    modulus = LAWS.modulus[0, 0]
    spot = contact_radius(FORCE, radius, modulus)
    if mechanism == "rough":
        sigma, slope, hardness = LAWS.roughness[0, 0], LAWS.slope[0, 0], LAWS.microhardness[0, 0]
        return rough_conductance(FORCE, spot, modulus, radius, 15.0, sigma, slope, hardness)
    return {
        "hertz": hertz_conductance(15.0, spot),
        "parallel": gas.parallel_conductance_wall(GAS, 1.0, GAS / 15.0, 0.0),
        "batchelor": hertz_conductance(15.0, spot)
        + gas.batchelor_conductance(GAS, 15.0, 1.0, spot, 0.0),
        "vargas": gas.vargas_conductance(GAS, 1.0, spot),
        "radiation": linear_coefficient(np.pi / (2.0 / 0.9 - 1.0), 300.0, 300.0),
    }[mechanism]


def conductances(shapes, names, position, mechanism, *, conditions=None, pose=None, **choices):
    """What each wall gives per degree [W/K] to a grain at 300 K and 1 GJ/K, if it is a little
    warmer."""
    engine = resting(shapes, names, position, conditions, **choices, **MECHANISMS[mechanism])
    if pose is not None:
        engine.state.wall_position[:] = pose
    engine.step(1e-3, 0.0)
    return engine.state.wall_heat[:, 0] / 1e-3 / (300.0001 - 300.0)


def resting(shapes, names, position, conditions=None, *, shape="sphere", period=0.0, **settings):
    """Heat of one grain between walls that are a little warmer."""
    model = make_model([1.0], shapes, names, period=period, shape=shape)
    return heat_engine(
        with_heat(model, 300.0, capacity=1e9), [position], laws=LAWS,
        conditions=conditions or [WARM] * len(names),
        **{"force": ContactForce("prescribed", FORCE), **settings},
    )  # fmt: skip


@pytest.mark.parametrize("mechanism", MECHANISMS)
@pytest.mark.parametrize("name", FLOORS)
def test_a_floor_conducts_the_same_in_any_number_of_pieces(name, mechanism):
    """Level and tilted."""
    for angle in (0.0, 0.7):
        where, pose = (3.0 - np.sin(angle), 2.0 + np.cos(angle)), (3.0, 2.0, angle)
        found = conductances(*walls_of(FLOORS[name]), where, mechanism, pose=pose)
        assert found.sum() == pytest.approx(closed_form(mechanism), rel=1e-6)


@pytest.mark.parametrize("mechanism", MECHANISMS)
def test_joints_and_coinciding_floors_are_one(mechanism):
    shapes, _ = walls_of([level(-8.0, 8.0)])
    shapes.append((ShapeKind.PLANE, 1, (0.0, 0.0, 0.0, 1.0)))
    found = conductances(shapes, ("line", "plane"), (0.5, 1.0), mechanism)
    assert found == pytest.approx(np.full(2, 0.5 * closed_form(mechanism)), rel=1e-6)
    walls = walls_of([level(-5.0, 0.0), level(0.0, 5.0)])
    for x in (-5.0, 5.0, 4.9, -4.7):
        found = conductances(*walls, (x, 1.0), mechanism, period=10.0)
        assert found.sum() == pytest.approx(closed_form(mechanism), rel=1e-6)


@pytest.mark.parametrize("gap", [0.0, 0.1])
def test_a_cylinder_sees_a_floor_once(gap):
    view = cylinder_view_factor(1.0, 1.0, gap) * 4.0 * np.pi / (2.0 / 0.9 - 1.0)
    expected = pytest.approx(linear_coefficient(view, 300.0, 300.0), rel=1e-6)
    for floor in ("one piece", "two walls, 0.0 beside", "small tiles", "tiles on an edge"):
        walls = walls_of(FLOORS[floor])
        assert conductances(*walls, (0.0, 1.0 + gap), "radiation", shape="disc").sum() == expected


def corner(inside, of_walls):
    """Two lines that meet below a grain that touches both; their angle around it in degrees."""
    half = np.radians(0.5 * inside)
    left, right = [np.array([sign * np.sin(half), np.cos(half)]) * 9.0 for sign in (-1.0, 1.0)]
    bottom = np.array([0.0, 0.0])
    lines = [[left, bottom, right]] if of_walls == 1 else [[left, bottom], [bottom, right]]
    return *walls_of(lines), (0.0, 1.0 / np.sin(half))


@pytest.mark.parametrize(("count", "insides"), [(2, (60, 90, 120, 150)), (1, (165, 170, 175, 179))])
@pytest.mark.parametrize("of_walls", [1, 2])
@pytest.mark.parametrize("mechanism", MECHANISMS)
def test_a_concave_corner_is_two_places_and_one_if_it_is_as_flat_as_that_of_a_round_polygon(
    mechanism, of_walls, count, insides
):
    found = [conductances(*corner(inside, of_walls), mechanism).sum() for inside in insides]
    assert found == pytest.approx([count * closed_form(mechanism)] * 4, rel=1e-6)


def test_the_angle_between_places_is_where_points_of_contact_are_three_tenths_of_a_radius_apart():
    angle = np.degrees(np.arccos(1.0 - RISE))
    assert 2.0 * np.sin(np.radians(0.5 * angle)) == pytest.approx(0.3)
    for inside, count in ((180.0 - angle - 0.01, 2.0), (180.0 - angle + 0.01, 1.0)):
        found = conductances(*corner(inside, 1), "parallel")
        assert found.sum() == pytest.approx(count * closed_form("parallel"), rel=1e-6)


@pytest.mark.parametrize("sides", [24, 96, 384, 1536])
@pytest.mark.parametrize("where", ["corner", "side"])
@pytest.mark.parametrize("mechanism", MECHANISMS)
def test_a_fine_polygon_is_one_place_like_a_circle(mechanism, where, sides):
    """Its sides are flat: the spot is that on a plane, (1 − a/R)^⅓ of that in the circle."""
    circle, half = 4.0, np.pi / sides
    angle = 2.0 * np.pi * np.arange(sides) / sides
    walls = walls_of([circle * np.column_stack([np.cos(angle), np.sin(angle)])], closed=True)
    way, distance = (
        (0.0, circle - 1.0 / np.cos(half)) if where == "corner"
        else (half, circle * np.cos(half) - 1.0)
    )  # fmt: skip
    for turn in (0.0, 0.3):
        at = distance * np.cos(way + turn), distance * np.sin(way + turn)
        found = conductances(*walls, at, mechanism, pose=(0.0, 0.0, turn))
        assert found.sum() == pytest.approx(closed_form(mechanism), rel=1e-6)


@pytest.mark.parametrize("mechanism", ["hertz", "rough", "parallel", "radiation"])
def test_a_circle_is_as_hollow_as_it_is_for_the_spot(mechanism):
    """1/a* = 1/a − 1/R (Johnson, eq. 4.3); what crosses the gap is that of a plane."""
    shapes = [(ShapeKind.CIRCLE, 0, (0.0, 0.0, 4.0, 0.0))]
    found = conductances(shapes, ("drum",), (0.0, -3.0), mechanism)
    assert found[0] == pytest.approx(closed_form(mechanism, 4.0 / 3.0), rel=1e-6)


@pytest.mark.parametrize("mechanism", MECHANISMS)
def test_walls_that_meet_below_a_grain_share_what_they_give(mechanism):
    """Hot and insulated, hot and cold, of prescribed flow: by the halves of the one place."""
    for joint, conditions, expected in (
        (0.0, [WARM, WallHeat()], [0.5, 0.0]),
        (0.0, [WARM, at_temperature(299.9999)], [0.5, -0.5]),
        (0.1, None, [1.0, 0.0]),
    ):
        walls = walls_of([level(-8.0, joint), level(joint, 8.0)])
        found = conductances(*walls, (0.0, 1.0), mechanism, conditions=conditions)
        assert found == pytest.approx(closed_form(mechanism) * np.array(expected), rel=1e-6)


def test_a_flow_goes_to_grains_in_proportion_to_places():
    """Two walls of known flow, a grain on their joint, one beside it: each shares its own by H."""
    shapes, names = walls_of([level(-8.0, 0.0), level(0.0, 8.0)])
    model = with_heat(make_model([1.0, 1.0], shapes, names, shape="sphere"), 300.0, capacity=1e9)
    conditions = [WallHeat("flow", Constant(3.0)), WallHeat("flow", Constant(0.5))]
    force = ContactForce("prescribed", FORCE)
    positions = [[-4.0, 1.0], [0.0, 1.0]]
    engine = heat_engine(model, positions, conditions=conditions, laws=LAWS, force=force)
    engine.step(1.0, 0.0)
    assert engine.state.heat == pytest.approx([2.0, 1.5], rel=1e-9)


def test_the_biot_number_is_that_of_a_place():
    for name in ("one piece", "coincident", "tiles on an edge"):
        engine = resting(*walls_of(FLOORS[name]), (0.0, 1.0))
        engine.step(1e-3, 0.0)
        assert heat_book(engine.state, "max_biot") == pytest.approx(2.0 * SPOT, rel=1e-9)


def rolling(lines, **settings):
    """Heat that a grain has got that rolls over walls, which carry its weight."""
    model, conditions = heavy(lines)
    engine = coupled_engine(
        model, [[-0.5, 1.0]], [[0.3, 0.0, -0.3]], conditions, laws=LAWS, friction="none", **settings
    )
    first = advance(engine, 0.01, 1).heat[0]  # in which the contact is new
    advance(engine, 0.01, 220)
    assert engine.state.position[0, 0] > 0.1
    return engine.state.heat[0] - first


ROLLING = {
    "step": {},
    "average": {"force": ContactForce("average", 0.7)},
    "prescribed": {"force": ContactForce("prescribed", 10.0)},
    "collisional": {"collisional": True},
    "rough": {"conduction": "rough"},
    "parallel and radiation": {"mechanisms": (gas.Gas(GAS), Radiation(reach=0.4))},
    "batchelor": {"mechanisms": (gas.Gas(GAS, "batchelor"),)},
}


@pytest.mark.parametrize("settings", ROLLING.values(), ids=ROLLING)
def test_a_grain_that_rolls_over_pieces_gets_what_it_gets_on_one(settings):
    """Exactly within one wall. At the end of another it is lifted and slowed by some (vΔt/a)²,
    which its heat follows."""
    expected = rolling(FLOORS["one piece"], **settings)
    assert rolling(FLOORS["twenty pieces"], **settings) == pytest.approx(expected, rel=1e-12)
    for name in ("two walls, 0.0 beside", "tiles off an edge", "small tiles"):
        assert rolling(FLOORS[name], **settings) == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize(
    "name", ["one piece", "two walls, 0.0 beside", "tiles on an edge", "coincident"]
)
def test_an_impact_on_a_joint_conducts_as_one(name):
    """Sun & Chen's formula once, with the mass of the grain and its speed."""
    model, conditions = heavy(FLOORS[name], gravity=(0.0, 0.0), restitution=0.5)
    hot = [at_temperature(301.0)] * len(conditions)
    engine = coupled_engine(
        model, [[0.0, 1.001]], [[0.0, -0.5, 0.0]], hot, laws=LAWS, friction="none", collisional=True
    )
    advance(engine, 0.005, 4)
    solid = 15.0, 7500.0 * 500.0
    expected = impact_exchange(model.grains.mass[0], 1.0, LAWS.modulus[0, 0], 0.5, *solid, *solid)
    assert engine.state.heat[0] == pytest.approx(expected, rel=1e-6)


CEILINGS = {
    **{name: [[(x, -y) for x, y in line] for line in FLOORS[name]] for name in FLOORS},
    "a flat corner": [[(-8.0, -8.0 * np.tan(0.1)), (0.0, 0.0), (8.0, -8.0 * np.tan(0.1))]],
}


@pytest.mark.parametrize(("factor", "hangs"), [(1.01, True), (0.99, False)])
@pytest.mark.parametrize("name", CEILINGS)
def test_a_grain_hangs_by_one_adhesion_for_each_place(name, factor, hangs):
    """From any cutting of a ceiling; in a flat corner the forces lie 0.1 off the vertical.

    One that falls has paid ½ F_a ℓ once.
    """
    shapes, names = walls_of(CEILINGS[name])
    tilt, start = (np.cos(0.1), -1.0 / np.cos(0.1)) if name == "a flat corner" else (1.0, -1.0)
    force, reach = factor * WEIGHT / tilt, 0.02
    model = make_model([1.0], shapes, names, shape="sphere", adhesion=force, reach=reach)
    state = advance(make_engine(model, [[0.0, start]], settings=TIGHT), 1e-3, 400)
    if hangs:
        assert state.position[0, :2] == pytest.approx([0.0, start], abs=1e-9)
    else:
        assert state.position[0, 1] < start - reach
        assert state.adhesion_books[0] == pytest.approx(-0.5 * force * reach, rel=1e-3)
        assert book(state, "closure") < 1e-12


@pytest.mark.parametrize("name", ["twenty pieces", "two walls, 0.0 beside", "tiles on an edge"])
def test_a_bridge_goes_along_a_ceiling_of_pieces(name):
    """Thrown down and along, a grain comes back to the ceiling as it does to one piece."""

    def way(pieces):
        shapes, names = walls_of(CEILINGS[pieces])
        keys = {"shape": "sphere", "gravity": (0.0, 0.0), "reach": 0.02, "wet": True}
        model = make_model([1.0], shapes, names, adhesion=3.0 * WEIGHT, **keys)
        engine = make_engine(model, [[-1.0, -1.0]], [[9.0, -0.9, 0.0]], settings=TIGHT)
        return np.array([advance(engine, 1e-3, 1, k).position[0, :2].copy() for k in range(100)])

    expected = way("one piece")
    assert expected[:, 1].min() < -1.01
    assert abs(expected[-1, 1] + 1.0) < 1e-4
    assert way(name) == pytest.approx(expected, abs=1e-3)


@pytest.mark.parametrize(("inside", "count"), [(90, 2), (120, 2), (150, 2), (170, 1), (175, 1)])
@pytest.mark.parametrize("of_walls", [1, 2])
def test_adhesion_in_a_concave_corner_counts_its_places(of_walls, inside, count):
    shapes, names, (_, height) = corner(inside, of_walls)
    tilt = np.sin(np.radians(0.5 * inside))  # of each force against the middle line
    for factor, holds in ((1.01, True), (0.99, False)):
        adhesion = factor * WEIGHT / (count * tilt)
        model = make_model(
            [1.0], shapes, names, shape="sphere", adhesion=adhesion, gravity=(0.0, G), friction=0.0
        )
        state = advance(make_engine(model, [[0.0, height]], settings=TIGHT), 1e-3, 50)
        assert (abs(state.velocity[0, 1]) < 1e-9) == holds


@pytest.mark.parametrize(
    "name", ["one piece", "twenty pieces", "two walls, 0.0 beside", "small tiles"]
)
def test_a_grain_that_rolls_along_a_ceiling_of_pieces_stays_up(name):
    """Until the next contact is known, adhesion is the place's, not that of the piece left."""
    shapes, names = walls_of(CEILINGS[name])
    model = make_model([1.0], shapes, names, shape="sphere", adhesion=1.2 * WEIGHT)
    state = advance(
        make_engine(model, [[-2.0, -1.0]], [[0.5, 0.0, 0.5]], settings=TIGHT), 0.01, 700
    )
    assert state.position[0, 0] > 1.0
    assert state.position[0, 1] == pytest.approx(-1.0, abs=1e-4)


def test_tension_in_a_frozen_stage_counts_the_adhesion_of_a_joint_once():
    shapes, names = walls_of(CEILINGS["two walls, 0.0 beside"])
    model = with_heat(
        make_model([1.0], shapes, names, shape="sphere", adhesion=3.0 * WEIGHT), 300.0
    )
    engine = coupled_engine(model, [[0.0, -1.0]])
    for is_frozen in (False, True):
        resume(engine, is_frozen=is_frozen)
        advance(engine, 1e-3, 5)
        assert engine.contacts().impulse[:, 0].sum() == pytest.approx(-1e-3 * WEIGHT, rel=1e-9)


def test_a_moving_and_turning_floor_of_tiles_conducts_as_one():
    """It carries the grain up, along and round; at ends of walls the grain is lifted, as above."""
    heats = []
    for name in ("one piece", "tiles on an edge", "two walls, 0.1 beside"):
        model, conditions = heavy(FLOORS[name], friction=0.0)
        x, y, spin = (DofDrive(velocity=Constant(value)) for value in (0.4, 0.3, 0.05))
        engine = coupled_engine(
            model, [[0.0, 1.0]], [[0.0, 0.3, 0.0]], conditions, laws=LAWS, friction="none",
            drives=[WallDrive(x=x, y=y, spin=spin)] * len(conditions),
            force=ContactForce("prescribed", 10.0),
            mechanisms=(gas.Gas(GAS),),
        )  # fmt: skip
        advance(engine, 0.01, 100)
        heats.append(engine.state.heat[0])
    assert heats == pytest.approx([heats[0]] * 3, rel=1e-4)
