"""Heat of grains that are no discs: closed forms, series of resistances, the first law."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from heat_parts import (
    at_temperature,
    coupled_engine,
    frozen_engine,
    heat_book,
    make_heat_laws,
    temperatures,
    with_heat,
)
from scene_parts import FLOOR, TIGHT, G, advance, book, continued, make_model, resume
from shapes import POINT, box, disc, on_slope, outlines_of, regular, rod, shaped_model
from wall_lines import level, walls_of

from multicor_cli.engine import Settings
from multicor_cli.engine.heat.convection import Ambient
from multicor_cli.engine.heat.gas import Gas
from multicor_cli.engine.heat.hertz import (
    contact_radius,
    hertz_conductance,
    joint_coefficient,
    pressed_length,
    rough_conductance,
)
from multicor_cli.engine.heat.radiation import STEFAN_BOLTZMANN, Radiation
from multicor_cli.engine.heat.settings import ContactForce
from multicor_cli.engine.heat.walls import WallHeat
from multicor_cli.engine.motion.drives import Constant, DofDrive, WallDrive
from multicor_cli.model import ShapeKind
from multicor_cli.model.flash import flash_rise
from multicor_cli.model.state import State

THICKNESS, LAMBDA, MU = 0.5, 15.0, 0.4
LAWS = make_heat_laws(emissivity=0.8)
MODULUS = LAWS.modulus[0, 0]
ROUGH = LAWS.roughness[0, 0], LAWS.slope[0, 0], LAWS.microhardness[0, 0]
SETTINGS = {"laws": LAWS, "friction": "none"}


def hot(grains, start=300.0, *, specific=500.0, **keys):
    """A model of prisms of one thickness with temperatures."""
    model = shaped_model(grains, **{"friction": MU, **keys})
    return with_heat(model, start, specific=specific, thickness=THICKNESS)


def spot(force, radius):
    return hertz_conductance(LAMBDA, contact_radius(force, radius, MODULUS))


def of_pairs(engine):
    """Conductances of pairs, the sum over their points [W/K]."""
    table, found = engine.contacts(), {}
    for i, j, h in zip(table.i, table.j, table.conductance, strict=True):
        found[int(i), int(j)] = found.get((int(i), int(j)), 0.0) + float(h)
    return found


def at(height, x=0.0, angle=0.0):
    return [[x, height, angle]]


# ---- Friction


@pytest.mark.parametrize("rounding", [0.0, 0.1])
def test_a_block_that_slides_down_gets_the_work_of_friction(rounding):
    """μ m g cosα times the way; of it the floor takes its share."""
    tangent = 0.6
    gravity = on_slope(tangent)
    for share, conditions in ((1.0, None), (0.5, [at_temperature(300.0)])):
        model = hot([[(box(2.0, 1.0), rounding)]], gravity=gravity)
        engine = coupled_engine(
            model, at(0.5 + rounding), conditions=conditions, laws=LAWS, conduction="none"
        )
        state = advance(engine, 2e-3, 100)
        load = -model.grains.mass[0] * gravity[1]
        assert state.contact_i.size == 2
        work = MU * load * state.position[0, 0]
        assert work > 0.0
        assert state.heat[0] == pytest.approx(share * work, rel=1e-12)
        assert heat_book(state, "friction") == pytest.approx(book(state, "friction_loss"))
        assert engine.contacts().heat.sum() == pytest.approx(
            MU * load * state.velocity[0, 0] * 2e-3, rel=0.01
        )
        assert heat_book(state, "closure") < 1e-14


def test_points_wear_as_archard_says():
    """V = K F s/H, of a block that slides: the sum over its points."""
    model = hot([[(box(2.0, 1.0), 0.0)]], gravity=on_slope(0.6))
    engine = coupled_engine(model, at(0.5), laws=make_heat_laws(wear=1e-13), conduction="none")
    state = advance(engine, 2e-3, 50)
    rubbed = -model.grains.mass[0] * on_slope(0.6)[1] * state.position[0, 0]
    assert state.wear[0] == pytest.approx(1e-13 * rubbed, rel=1e-12)
    assert state.wall_wear[0] == pytest.approx(1e-13 * rubbed, rel=1e-12)


def test_an_inelastic_stop_heats_a_block():
    """It falls flat: all of ½ m v² is heat where impacts heat."""
    model = hot([[(box(2.0, 1.0), 0.0)]], gravity=(0.0, 0.0))
    engine = coupled_engine(
        model, at(0.5 + 1e-4), [[0.0, -0.5, 0.0]], laws=LAWS, impact=True, conduction="none"
    )
    state = advance(engine, 1e-3, 3)
    assert state.heat[0] == pytest.approx(0.125 * model.grains.mass[0], rel=1e-12)


def test_the_hottest_spot_is_that_of_a_corner_or_of_a_side():
    """Of a sliding rounded square on a corner Hertz' spot, on its side a circle of its area."""
    length, r, step, velocity = 1.0, 0.05, 1e-4, 0.1
    for angle, height in ((0.0, 0.5 + r), (0.25 * np.pi, np.sqrt(0.5) + r)):
        model = hot([[(box(length, length), r)]])
        engine = coupled_engine(model, at(height, angle=angle), [[velocity, 0.0, 0.0]], laws=LAWS)
        engine.step(step, 0.0)
        force = engine.state.contact_impulse[:, 0] / step
        slip = 0.5 * (velocity + abs(engine.contacts().slip[0]))
        if angle:
            radius = contact_radius(force[0], r, MODULUS)
        else:
            area = pressed_length(length * force.min() / force.sum(), length) * THICKNESS
            radius = np.sqrt(area / np.pi)
        body = LAWS.conductivity[0], LAWS.volumetric[0]
        rise = flash_rise(MU * force.sum() * slip, radius, slip, *body, 0.0, LAWS.volumetric[0])
        hottest = heat_book(engine.state, "hottest_spot")
        assert hottest == pytest.approx(300.0 + rise, rel=1e-9 + 1e-3 * rise / 300.0)


# ---- Conductances of points


def standing(corners, rounding, angle, radius, *, rough=False):
    """Conductance on a floor of a grain whose lowest point is a corner, and that of Hertz."""
    model = hot([[(corners, rounding)]], friction=2.0)
    c, s = np.cos(angle), np.sin(angle)
    own = model.outlines.corner
    height = rounding - float((s * own[:, 0] + c * own[:, 1]).min())
    conduction = "rough" if rough else "hertz"
    engine = coupled_engine(model, at(height, angle=angle), conduction=conduction, **SETTINGS)
    engine.step(1e-6, 0.0)
    force = engine.state.contact_impulse[:, 0].sum() / 1e-6
    assert force > 0.1 * G * model.grains.mass[0]
    expected = spot(force, radius)
    if rough:
        a_c = contact_radius(force, radius, MODULUS)
        expected = rough_conductance(force, a_c, MODULUS, radius, LAMBDA, *ROUGH)
    return of_pairs(engine)[0, 1], expected


@pytest.mark.parametrize("rough", [False, True])
@pytest.mark.parametrize(("rounding", "radius"), [(0.2, 0.2), (0.05, 0.05), (0.0, np.sqrt(0.005))])
def test_a_corner_conducts_as_a_sphere_of_its_rounding(rounding, radius, rough):
    """A sharp one as if rounded by a hundredth of how far the grain reaches."""
    radius = radius if rounding else 0.01 * np.sqrt(0.5)
    found, expected = standing(box(1.0, 1.0), rounding, 0.5, radius, rough=rough)
    assert found == pytest.approx(expected, rel=1e-9)


def test_a_rod_on_its_end_conducts_as_a_sphere():
    found, expected = standing(rod(2.0), 0.3, 0.5 * np.pi, 0.3)
    assert found == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("sides", [22, 31, 64])
@pytest.mark.parametrize("rounding", [0.0, 0.1])
@pytest.mark.parametrize("on_side", [True, False])
def test_a_round_polygon_conducts_as_a_disc_does(sides, rounding, on_side):
    """On a corner and on a side, with all its force on one end or shared: as Hertz' sphere around
    it, whatever the number of sides, from 21 on."""
    turn = -0.5 * np.pi + (np.pi / sides if on_side else 0.0)
    found, expected = standing(regular(sides, turn=turn), rounding, 0.0, 1.0 + rounding)
    assert found == pytest.approx(expected, rel=1e-9)


def test_a_polygon_of_few_sides_is_none():
    """On its side one of 20 conducts straight through it, far more than a sphere."""
    found, _ = standing(regular(20, turn=-0.5 * np.pi + np.pi / 20), 0.0, 0.0, 1.0)
    side = 2.0 * np.sin(np.pi / 20)
    assert found == pytest.approx(LAMBDA * side * THICKNESS / np.cos(np.pi / 20), rel=1e-6)


def test_round_polygons_and_discs_conduct_alike():
    """Two grains one on the other: discs, polygons and one of each, of radii 1 and 0.5."""
    found = []
    for lower, upper in (
        (disc(1.0), disc(0.5)),
        ([(regular(64, turn=np.pi / 64), 0.0)], disc(0.5)),
        (disc(1.0), [(regular(40, 0.5, turn=np.pi / 2), 0.0)]),
        ([(regular(64, turn=np.pi / 64), 0.0)], [(regular(40, 0.5, turn=np.pi / 40), 0.0)]),
    ):
        model = hot([lower, upper], friction=0.0)
        below = [float(corner[:, 1].min()) - r for ((corner, r),) in (lower, upper)]
        above = float(lower[0][0][:, 1].max()) + lower[0][1]
        places = [[0.0, -below[0]], [0.0, -below[0] + above - below[1]]]
        engine = coupled_engine(model, places, **SETTINGS)
        engine.step(1e-6, 0.0)
        table = engine.contacts()
        force = table.impulse[table.j == 1, 0].sum() / 1e-6
        assert force > 0.9 * G * model.grains.mass[1]
        found.append(of_pairs(engine)[0, 1] / spot(force, 1.0 / 3.0))
    assert found == pytest.approx(np.ones(4), rel=1e-9)


def test_corners_on_sides_discs_and_in_drums():
    """a* = r against a side, R r/(R + r) on a disc, R r/(R − r) in a circle."""
    r, square = 0.1, [(box(1.0, 1.0), 0.1)]
    lowest = np.sqrt(0.5) + r
    for shapes, height, radius in (
        ([(ShapeKind.SEGMENT, 0, (-9.0, 0.0, 9.0, 0.0))], lowest, r),
        ([(ShapeKind.DISC, 0, (0.0, -2.0, 2.0, 0.0))], lowest, 2.0 * r / (2.0 + r)),
        ([(ShapeKind.CIRCLE, 0, (0.0, 4.0, 4.0, 0.0))], lowest, 4.0 * r / (4.0 - r)),
        ([(ShapeKind.VERTEX, 0, (0.0, 0.0, -1.0, -1.0))], lowest, None),
    ):
        model = hot([square], shapes=shapes, friction=2.0)
        engine = coupled_engine(model, at(height, angle=0.25 * np.pi), **SETTINGS)
        engine.step(1e-6, 0.0)
        sharp = 0.01 * model.grains.radius[0]
        radius = sharp * r / (sharp + r) if radius is None else radius
        force = engine.state.contact_impulse[0, 0] / 1e-6
        assert of_pairs(engine)[0, 1] == pytest.approx(spot(force, radius), rel=1e-9)


# ---- Conductances of sides


def through_side(force, area, way, *, rough):
    """Conductance of a side [W/K] under a force, by the page about theory."""
    joint = joint_coefficient(force / area, LAMBDA, *ROUGH) if rough else np.inf
    return area / (1.0 / joint + way / LAMBDA)


@pytest.mark.parametrize("rough", [False, True])
@pytest.mark.parametrize("tangent", [0.0, 0.1, 0.3, 0.34, 0.7, 0.95])
def test_a_side_conducts_where_it_is_pressed(tangent, rough):
    """On a slope the load of a square lies ½ tanα of its side off the middle: beyond a sixth the
    pressed length shrinks to 3 (½ − ½ tanα)."""
    model = hot([[(box(1.0, 1.0), 0.0)]], gravity=on_slope(tangent), friction=2.0)
    conduction = "rough" if rough else "hertz"
    engine = coupled_engine(model, at(0.5), conduction=conduction, **SETTINGS)
    advance(engine, 1e-3, 5)
    force = -model.grains.mass[0] * on_slope(tangent)[1]
    length = min(1.0, 1.5 * (1.0 - tangent))
    expected = through_side(force, length * THICKNESS, 0.5, rough=rough)
    assert of_pairs(engine)[0, 1] == pytest.approx(expected, rel=1e-6)


def test_a_side_goes_over_into_a_spot():
    """As one of the two forces vanishes, without a jump."""
    found = []
    for tangent in (0.99, 0.9999, 0.999999, 0.99999999, 1.0 + 1e-8):
        model = hot([[(box(1.0, 1.0), 0.0)]], gravity=on_slope(tangent), friction=2.0)
        engine = coupled_engine(model, at(0.5), conduction="rough", **SETTINGS)
        engine.step(1e-5, 0.0)
        found.append(of_pairs(engine)[0, 1])
        force = engine.state.contact_impulse[:, 0].sum() / 1e-5
    radius = 0.01 * model.grains.radius[0]
    a_c = contact_radius(force, radius, MODULUS)
    assert found[-1] == pytest.approx(
        rough_conductance(force, a_c, MODULUS, radius, LAMBDA, *ROUGH), rel=1e-6
    )
    assert (np.diff(found) <= 0.0).all()
    assert found[-2] == pytest.approx(found[-1], rel=1e-6)


def stack(widths, heights, load=0.0, *, offset=0.0, **keys):
    """Blocks one on the other between a floor and a lid that presses with ``load`` [N]."""
    shapes = [*FLOOR, (ShapeKind.PLANE, 1, (0.0, 0.0, 0.0, -1.0))]
    grains = [[(box(w, h), 0.0)] for w, h in zip(widths, heights, strict=True)]
    model = hot(grains, shapes=shapes, walls=("floor", "lid"), mass=1.0, **keys)
    places = [[offset * (k % 2), sum(heights[:k]) + 0.5 * heights[k]] for k in range(len(heights))]
    return model, places, [WallDrive(), WallDrive(y=DofDrive(force=Constant(-load)))]


@pytest.mark.parametrize("rough", [False, True])
def test_a_column_of_blocks_is_a_series_of_resistances(rough):
    """Between a hot floor and a cold lid in a steady state, at rest and frozen: each joint has the
    pressure of what lies above it, each block the way through it. Smooth blocks of one width are
    one bar."""
    heights, load = [0.7, 1.0, 0.4], 100.0
    widths = [1.0, 0.8, 1.2] if rough else [1.0, 1.0, 1.0]
    model, places, drives = stack(widths, heights, load, specific=1e-3, friction=0.0)
    conditions = [at_temperature(400.0), at_temperature(300.0)]
    conduction = "rough" if rough else "hertz"
    engine = coupled_engine(
        model, places, conditions=conditions, drives=drives, conduction=conduction,
        tolerance=1e-8, **SETTINGS,
    )  # fmt: skip
    engine.state.wall_position[1, 1] = sum(heights)
    advance(engine, 1e-2, 20)
    weights = np.cumsum((model.grains.mass * G)[::-1])[::-1]
    forces = load + np.append(weights, 0.0)
    lengths = [widths[0], *map(min, widths[:-1], widths[1:]), widths[-1]]
    ways = 0.5 * np.append(heights, 0.0) + 0.5 * np.append(0.0, heights)
    series = sum(
        1.0 / through_side(force, length * THICKNESS, way, rough=rough)
        for force, length, way in zip(forces, lengths, ways, strict=True)
    )
    flow = 100.0 / series
    if not rough:
        assert flow == pytest.approx(100.0 * LAMBDA * THICKNESS / sum(heights), rel=1e-12)
    for is_frozen in (False, True):
        resume(engine, is_frozen=is_frozen)
        before = engine.state.wall_heat[:, 0].copy()
        advance(engine, 1e-2, 20)
        given = (engine.state.wall_heat[:, 0] - before) / 0.2
        assert given == pytest.approx([flow, -flow], rel=1e-6)
        passed = engine.state.flux_books.copy()
        advance(engine, 1e-2, 1)
        since = (engine.state.flux_books - passed).reshape(2, 4)
        # From wall to wall: the heat times its way
        assert since[1, 0] == pytest.approx(1e-2 * flow * sum(heights), rel=1e-6)
        assert abs(since[0, 0]) < 1e-2 * since[1, 0]  # both ends bear alike, nearly


def test_two_blocks_conduct_by_what_they_share():
    """Side by side, moved along: in proportion to the length; the thinner one counts."""
    for offset in (0.0, 0.2, 0.5):
        grains = [[(box(1.0, 1.0), 0.0)]] * 2
        model = hot(grains, gravity=(0.0, 0.0), shapes=(), walls=())
        thin = model.thermal.surface * np.array([1.0, 0.5])
        model = replace(model, thermal=replace(model.thermal, surface=thin))
        engine = coupled_engine(
            model, [[0.0, 0.0], [1.0, offset]], [[0.01, 0.0, 0.0], [-0.01, 0.0, 0.0]],
            force=ContactForce("prescribed", 3.0), conduction="rough", **SETTINGS,
        )  # fmt: skip
        engine.step(1e-4, 0.0)
        carried, shared = engine.state.contact_impulse[:, 0], 1.0 - offset
        length = pressed_length(shared * carried.min() / carried.sum(), shared)
        expected = through_side(3.0, length * 0.5 * THICKNESS, 1.0, rough=True)
        assert of_pairs(engine)[0, 1] == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("kind", ["step", "average", "prescribed"])
def test_frozen_stages_conduct_as_the_last_step_did(kind):
    """Pair by pair, at the same forces: flush stacks, where rounding decides at which corners the
    points are, leaning blocks and discs."""
    grains = [[(box(1.0, 1.0), 0.0)], [(box(1.0, 1.0), 0.0)], disc(0.4), [(box(0.8, 0.8), 0.1)]]
    model = hot(grains, friction=0.6)
    places = [[0.0, 0.5, 0.0], [0.3, 1.5, 0.0], [3.0, 0.4, 0.0], [1.3, 0.55, 0.1]]
    force = {"step": ContactForce(), "average": ContactForce("average", 0.02),
             "prescribed": ContactForce("prescribed", 5.0)}[kind]  # fmt: skip
    engine = coupled_engine(
        model, places, solver=Settings(), force=force, conduction="rough", **SETTINGS
    )
    advance(engine, 1e-3, 600)
    moving = of_pairs(engine)
    resume(engine, is_frozen=True)
    engine.step(1e-3, 0.0)
    frozen, table = of_pairs(engine), engine.contacts()
    loaded = {pair: h for pair, h in moving.items() if h > 0.0}
    assert len(loaded) >= 4
    assert {pair for pair, h in frozen.items() if h > 0.0} == set(loaded)
    for pair, h in loaded.items():
        assert frozen[pair] == pytest.approx(h, rel=1e-6)
    assert table.arm.shape == (table.i.size, 2)


def test_a_frozen_run_finds_the_points_that_touch():
    """No step has been: blocks on a floor and beside each other, under a prescribed force."""
    grains = [[(box(1.0, 1.0), 0.0)], [(box(1.0, 1.0), 0.0)], disc(0.5)]
    model = hot(grains, [300.0, 350.0, 400.0])
    state = State.at_rest(model, np.array([[0.0, 0.5, 0.0], [1.0, 0.7, 0.0], [-1.0, 0.5, 0.0]]))
    engine = frozen_engine(
        model, state, force=ContactForce("prescribed", 2.0), conduction="rough", laws=LAWS
    )
    engine.step(1e-3, 0.0)
    found = of_pairs(engine)
    assert set(found) == {(0, 1), (0, 2), (0, 3), (2, 3)}
    shared = through_side(2.0, 0.8 * THICKNESS, 1.0, rough=True)
    on_floor = through_side(2.0, 1.0 * THICKNESS, 0.5, rough=True)
    a_c = contact_radius(2.0, 0.5, MODULUS)
    point = rough_conductance(2.0, a_c, MODULUS, 0.5, LAMBDA, *ROUGH)
    assert found == pytest.approx(
        {(0, 1): shared, (0, 3): on_floor, (0, 2): point, (2, 3): point}, rel=1e-9
    )


@pytest.mark.parametrize("conduction", ["hertz", "rough"])
@pytest.mark.parametrize("one_wall", [True, False])
@pytest.mark.parametrize("joints", [[], [-0.1], [0.4], [-0.2, 0.3]])
def test_a_floor_of_pieces_conducts_as_one(joints, one_wall, conduction):
    """Whatever the pieces, which share it by their forces; with three points and more it is not
    determined how much each of them bears."""
    edges = [-4.0, *joints, 4.0]
    lines = [level(*edges)] if one_wall else [level(a, b) for a, b in pairwise(edges)]
    shapes, names = walls_of(lines)
    model = hot([[(box(1.0, 1.0), 0.0)]], shapes=shapes, walls=names)
    engine = coupled_engine(model, at(0.5), conduction=conduction, **SETTINGS)
    advance(engine, 1e-3, 3)
    table = engine.contacts()
    found, force = table.conductance.sum(), table.impulse[:, 0]
    expected = through_side(1e3 * force.sum(), THICKNESS, 0.5, rough=conduction == "rough")
    assert found == pytest.approx(expected, rel=1e-9)
    assert table.conductance == pytest.approx(found * force / force.sum(), rel=1e-9)


def test_a_block_over_the_end_of_a_table_conducts_through_what_lies_on_it():
    shapes, names = walls_of([level(-4.0, 0.1)])
    model = hot([[(box(1.0, 1.0), 0.0)]], shapes=shapes, walls=names)
    engine = coupled_engine(model, at(0.5), **SETTINGS)
    advance(engine, 1e-3, 3)
    # The weight is 0.1 from the end, more than a sixth of what is shared is pressed
    expected = LAMBDA * THICKNESS * 0.3 / 0.5
    assert sum(of_pairs(engine).values()) == pytest.approx(expected, rel=1e-6)


# ---- Walls of all kinds, film and radiation


def test_walls_of_all_kinds_heat_a_block():
    """Known temperature, capacity, flow, insulated: closed forms of one body."""
    t, capacity = 5.0, 800.0
    conductance = LAMBDA * THICKNESS / 0.5
    for condition, expected in (
        (at_temperature(400.0), lambda c: 400.0 - 100.0 * np.exp(-conductance * t / c)),
        (WallHeat("flow", Constant(3.0)), lambda c: 300.0 + 3.0 * t / c),
        (WallHeat(), lambda _: 300.0),
        (
            WallHeat("capacity", capacity=capacity, initial=400.0),
            lambda c: 300.0 + 100.0 * capacity / (c + capacity)
            * (1.0 - np.exp(-conductance * t * (1.0 / c + 1.0 / capacity))),
        ),
    ):  # fmt: skip
        model = hot([[(box(1.0, 1.0), 0.0)]], specific=100.0)
        engine = coupled_engine(model, at(0.5), conditions=[condition], tolerance=1e-9, **SETTINGS)
        if condition.kind == "capacity":
            engine.state.wall_temperature[:] = 400.0
        state = advance(engine, 0.05, 100)
        assert temperatures(engine)[0] == pytest.approx(
            expected(model.thermal.capacity[0]), abs=1e-4
        )
        assert heat_book(state, "closure") < 1e-14


@pytest.mark.parametrize("corners", [regular(5), box(3.0, 0.5), rod(2.0)])
def test_film_and_radiation_are_those_of_the_perimeter(corners):
    """h and ε σ (T_s⁴ − T⁴) times the perimeter times the thickness, in a short time."""
    model = hot([[(corners, 0.1)]], gravity=(0.0, 0.0), shapes=(), walls=())
    ring = np.vstack([corners, corners[:1]])
    length = float(np.hypot(*np.diff(ring, axis=0).T).sum()) + 0.2 * np.pi
    surface = length * THICKNESS
    for mechanism, power in (
        (Ambient(350.0, coefficient=20.0), 20.0 * surface * 50.0),
        (Radiation(250.0), 0.8 * STEFAN_BOLTZMANN * surface * (250.0**4 - 300.0**4)),
    ):
        engine = coupled_engine(model, at(0.0), laws=LAWS, mechanisms=(mechanism,))
        engine.step(1e-3, 0.0)
        assert engine.state.heat[0] == pytest.approx(1e-3 * power, rel=1e-5)


# ---- Heaps of all kinds


def kinds_of_grains(rng, count):
    """Discs, rods, polygons of all kinds, a cross, an L."""
    cross = [(box(1.0, 0.2), 0.05), (box(0.2, 1.0), 0.05)]
    angle = [(box(1.0, 0.2), 0.0), (box(0.2, 1.0) + 0.4, 0.0)]
    all_kinds = [
        lambda: disc(rng.uniform(0.3, 0.5)),
        lambda: [(rod(rng.uniform(0.4, 1.0)), 0.2)],
        lambda: [(regular(5, 0.4), 0.1)],
        lambda: [(regular(4, rng.uniform(0.4, 0.6)), 0.0)],
        lambda: [(regular(30, 0.4), 0.0)],
        lambda: cross,
        lambda: angle,
    ]
    return [all_kinds[k % len(all_kinds)]() for k in range(count)]


def heap(count=28, seed=2, conditions=None, **settings):
    """A heap between a floor and two walls, one of which shakes it."""
    rng = np.random.default_rng(seed)
    shapes = [
        *FLOOR, (ShapeKind.PLANE, 1, (-4.0, 0.0, 1.0, 0.0)),
        (ShapeKind.PLANE, 2, (4.0, 0.0, -1.0, 0.0)),
    ]  # fmt: skip
    grains = kinds_of_grains(rng, count)
    model = hot(
        grains, rng.uniform(290.0, 330.0, count), shapes=shapes, walls=("floor", "left", "right"),
        specific=1e-3, friction=0.4,
    )  # fmt: skip
    k = np.arange(count)
    places = np.column_stack([-2.8 + 1.4 * (k % 5), 1.0 + 1.4 * (k // 5), rng.uniform(0, 6, count)])
    push = WallDrive(x=DofDrive(velocity=Constant(0.05)))
    return coupled_engine(
        model, places, conditions=conditions, drives=[WallDrive(), push, WallDrive()],
        solver=Settings(), laws=make_heat_laws(emissivity=0.8, conductivity=5.0), **settings,
    )  # fmt: skip


WALLS = [at_temperature(320.0), WallHeat("flow", Constant(5.0)), WallHeat()]
ALL_ON = {
    "mechanisms": (Gas(0.026), Ambient(350.0, coefficient=0.2), Radiation(250.0, reach=0.4)),
    "impact": True, "collisional": True,
}  # fmt: skip


@pytest.mark.parametrize(("kind", "conduction", "integrator"), [
    ("step", "rough", "implicit"), ("average", "hertz", "implicit"),
    ("prescribed", "rough", "explicit"),
])  # fmt: skip
def test_the_first_law_closes_in_a_heap_of_all_shapes(kind, conduction, integrator):
    force = {"step": ContactForce(), "average": ContactForce("average", 0.1),
             "prescribed": ContactForce("prescribed", 0.1)}[kind]  # fmt: skip
    settings = {"force": force, "conduction": conduction, "integrator": integrator, **ALL_ON}
    if integrator == "explicit":  # steps of which are short where gas conducts much
        settings["mechanisms"] = ALL_ON["mechanisms"][1:]
    engine = heap(conditions=WALLS, **settings)
    state = advance(engine, 5e-3, 300)
    assert heat_book(state, "closure") < 1e-12
    names = ("friction", "impact", "to_walls", "from_walls", "from_ambient", "from_surroundings")
    assert all(heat_book(state, name) for name in names)
    resume(engine, is_frozen=True)
    advance(engine, 5e-3 if integrator == "explicit" else 5e-2, 5)
    assert heat_book(state, "closure") < 1e-12
    assert np.isfinite(temperatures(engine)).all()


def test_an_insulated_heap_stores_what_it_loses():
    state = advance(heap(impact=True), 5e-3, 300)
    losses = book(state, "friction_loss") + book(state, "impact_loss")
    assert losses > 0.0
    assert state.heat.sum() == pytest.approx(losses + heat_book(state, "ahead"), rel=1e-12)
    assert book(state, "closure") < 1e-10


def test_a_heap_goes_on_with_the_same_bits():
    engine = heap(12, conditions=WALLS, force=ContactForce("average", 0.1), **ALL_ON)
    advance(engine, 5e-3, 150)
    other = continued(engine)
    advance(engine, 5e-3, 20, 150)
    advance(other, 5e-3, 20, 150)
    assert engine.state.digest() == other.state.digest()


@pytest.mark.parametrize("rolls", [False, True])
def test_discs_by_their_outlines_have_the_bits_of_discs(rolls):
    """Heat of discs among which there are outlines; an average of forces, a frozen stage."""
    radius = np.array([0.5, 0.4, 0.5, 0.45])
    model = make_model(radius, FLOOR, friction=MU)
    model = with_heat(model, [300.0, 310.0, 320.0, 305.0], thickness=THICKNESS)
    outlines, _, _ = outlines_of([[(POINT, a)] for a in radius])
    outlines = outlines._replace(area=model.area)
    places = [[0.0, 0.5], [1.0, 0.4], [0.4, 1.35], [-0.95, 0.45]]
    digests = []
    for seen in (model, replace(model, outlines=outlines)):
        engine = coupled_engine(
            seen, places, [[0.3 * rolls, 0.0, 0.0]] * 4, [at_temperature(290.0)], laws=LAWS,
            force=ContactForce("average", 0.05), solver=TIGHT,
        )  # fmt: skip
        advance(engine, 1e-3, 100)
        resume(engine, is_frozen=True)
        advance(engine, 1e-3, 3)
        digests.append(engine.state.heat.tobytes() + engine.contacts().conductance.tobytes())
    assert digests[0] == digests[1]
