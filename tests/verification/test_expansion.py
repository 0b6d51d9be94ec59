"""Grains that expand with temperature: closed forms of chains, rings and springs; books, stops."""

from dataclasses import replace

import numpy as np
import pytest
from heat_parts import coupled_engine, make_heat_laws, warm_model, with_heat
from scene_parts import FLOOR, G, book, continued, floor_and_lid, make_model

from multicor_cli.engine import Settings
from multicor_cli.engine.heat.gas import Gas
from multicor_cli.engine.heat.radiation import Radiation
from multicor_cli.engine.motion.drives import Constant, DofDrive, Spring, WallDrive
from multicor_cli.engine.orders import PhysicsError
from multicor_cli.model import ShapeKind

ALPHA = 1e-3


def expanding(model, alpha=ALPHA):
    return replace(model, expansion=np.full(len(model.materials), alpha))


def warmed(engine, rate, steps, dt=1e-3):
    """Steps in which all grains warm at a rate [K/s]."""
    for _ in range(steps):
        engine.state.heat += engine.model.thermal.capacity * (rate * dt)
        engine.step(dt, engine.state.time)
    return engine.state


def column(load=-20.0, stiffness=0.0):
    """Five spheres on each other under a lid that a load and a spring press."""
    model = make_model(
        [0.5] * 5, floor_and_lid(), ("floor", "lid"), friction=0.0, mass=1.0, shape="sphere"
    )
    model = with_heat(model, 300.0)
    spring = Spring(stiffness, Constant(0.0)) if stiffness else None
    lid = DofDrive(force=Constant(load), spring=spring)
    engine = coupled_engine(
        expanding(model), [[0.0, 0.5 + k] for k in range(5)], conduction="none", friction="none",
        drives=[WallDrive(), WallDrive(y=lid)],
    )  # fmt: skip
    engine.state.wall_position[1, 1] = 5.0
    engine.begin(engine.orders)
    return engine


def height(state):
    return state.wall_position[1, 1] - 5.0


def test_a_column_lifts_its_load_and_lets_it_down():
    """Five spheres grow by 5·2a α ΔT, and do the work of the load and of their weight; as they cool
    they take it back. What is lost are the impacts of growth that begins and ends at once."""
    engine = column()
    warmed(engine, 10.0, 300)
    warmed(engine, 0.0, 200)
    state, grown = engine.state, 5.0 * ALPHA * 3.0
    assert height(state) == pytest.approx(grown, rel=1e-10)
    assert state.radius == pytest.approx(np.full(5, 0.5 * (1.0 + ALPHA * 3.0)), rel=1e-14)
    weight = float(engine.model.grains.mass[0]) * G
    lifted = 20.0 * grown + weight * grown * (0.1 + 0.3 + 0.5 + 0.7 + 0.9)
    lost = book(state, "impact_loss")
    assert state.growth_books[0] == pytest.approx(lifted + lost, rel=1e-10)
    assert 0.0 < lost < 0.01 * lifted
    warmed(engine, -10.0, 300)
    warmed(engine, 0.0, 200)
    assert height(state) == pytest.approx(0.0, abs=1e-9)
    assert state.growth_books[0] == pytest.approx(book(state, "impact_loss"), rel=1e-9)
    assert book(state, "impact_loss") < 0.02 * lifted
    assert book(state, "closure") < 1e-13


def test_a_spring_is_pressed_by_what_expands():
    """A lid on a spring bears k·5·2a α ΔT more than its load."""
    engine = column(stiffness=1e4)
    warmed(engine, 10.0, 300)
    warmed(engine, 0.0, 200)
    pressed = engine.contacts().impulse[-1, 0] / 1e-3
    assert pressed == pytest.approx(20.0 + 1e4 * 5.0 * ALPHA * 3.0, rel=1e-6)
    assert book(engine.state, "closure") < 1e-13


@pytest.mark.parametrize("wet", [False, True])
def test_what_hangs_by_adhesion_lifts_its_weight_and_no_attraction(wet):
    """Below a ceiling a disc goes down by a α ΔT: it gets that of its weight. On a floor it goes up
    by as much, whatever it sticks with."""
    for plane, place in (((0.0, 0.0, 0.0, -1.0), -0.5), ((0.0, 0.0, 0.0, 1.0), 0.5)):
        model = make_model(
            [0.5], [(ShapeKind.PLANE, 0, plane)], mass=1.0, adhesion=60.0, reach=0.01, wet=wet
        )
        model = expanding(with_heat(model, 300.0))
        engine = coupled_engine(model, [[0.0, place]], conduction="none", friction="none")
        warmed(engine, 10.0, 100)
        state, risen = engine.state, 0.5 * ALPHA
        assert state.radius[0] == pytest.approx(0.5 + risen, rel=1e-12)
        assert abs(state.position[0, 1]) == pytest.approx(0.5 + risen, rel=1e-5)
        work = float(model.grains.mass[0]) * G * risen * np.sign(place)
        assert state.growth_books[0] == pytest.approx(work, rel=1e-2)
        assert book(state, "closure") < 1e-12


def test_a_ring_of_touching_discs_grows_as_they_do():
    """Twelve discs, each touching two, on a circle of the radius a/sin(π/12)."""
    angle = 2.0 * np.pi * np.arange(12) / 12
    place = 0.5 / np.sin(np.pi / 12) * np.column_stack([np.cos(angle), np.sin(angle)])
    model = expanding(warm_model([0.5] * 12, gravity=(0.0, 0.0), friction=0.3))
    engine = coupled_engine(model, place, conduction="none")
    state = warmed(engine, 10.0, 400)
    ring = np.hypot(*state.position[:, :2].T)
    assert ring == pytest.approx(np.full(12, state.radius[0] / np.sin(np.pi / 12)), rel=2e-5)
    assert state.radius[0] == pytest.approx(0.5 * (1.0 + ALPHA * 4.0), rel=1e-14)
    assert book(state, "closure") < 1e-13


def test_spins_keep_their_angular_momentum():
    model = expanding(warm_model([0.5], gravity=(0.0, 0.0)), 1e-2)
    engine = coupled_engine(model, [[0.0, 0.0]], [[0.0, 0.0, 3.0]], conduction="none")
    state = warmed(engine, 5.0, 200)
    assert state.velocity[0, 2] * state.radius[0] ** 2 == pytest.approx(0.75, rel=1e-14)
    assert state.growth_books[0] < 0.0
    assert book(state, "closure") < 1e-13


def test_what_has_warmed_at_rest_grows_step_by_step():
    """No more than 10⁻⁴ of the radius in a step, so that nothing is thrown."""
    engine = column()
    engine.state.heat += engine.model.thermal.capacity * 1.05
    warmed(engine, 0.0, 10)
    assert engine.state.radius[0] == pytest.approx(0.5 * (1.0 + 1e-4) ** 10, rel=1e-12)
    warmed(engine, 0.0, 200)
    assert height(engine.state) == pytest.approx(5.0 * ALPHA * 1.05, rel=1e-9)


@pytest.mark.parametrize(("shape", "power"), [("sphere", 3.0), ("disc", 2.0)])
def test_wear_takes_mass_and_size_and_what_moves_with_them(shape, power):
    """A body that slides loses V = (K/H) m g times its way, while it slows as one that keeps its
    mass; a = a₀ (1 − V/V₀)^(1/p), and what is worn off takes its momentum and spin along."""
    k, wears = {"sphere": 2.5, "disc": 2.0}[shape], 1e-4
    model = make_model([0.5], FLOOR, ("floor",), friction=0.3, shape=shape)
    surface = 4.0 * np.pi * 0.25 if shape == "sphere" else 2.0 * np.pi * 0.5  # of a disc 1 m high
    mass = float(model.grains.mass[0])
    model = with_heat(model, thickness=None if shape == "sphere" else 1.0)
    model = replace(model, sheds=True, expansion=np.zeros(1))
    heat = {"laws": make_heat_laws(wear=wears), "conduction": "none"}
    engine = coupled_engine(model, [[0.0, 0.5]], [[1.0, 0.0, 0.0]], **heat)
    volume = surface * 0.5 / power
    slid, rubbed = 1.0, 0.0
    for _ in range(60):  # while it slides: a step rubs the load now times the mean way
        load = mass * (1.0 - wears * rubbed / volume) * G * 1e-3
        rubbed += load * (slid - 0.5 * (1.0 + k) * 0.3 * G * 1e-3)
        slid -= (1.0 + k) * 0.3 * G * 1e-3
        engine.step(1e-3, engine.state.time)
    state = engine.state
    assert state.wear[0] == pytest.approx(wears * rubbed, rel=1e-3)  # it sinks meanwhile
    share = state.wear[0] / volume
    assert share > 1e-5
    assert state.radius[0] == pytest.approx(0.5 * (1.0 - share) ** (1.0 / power), rel=1e-14)
    velocity = state.velocity[0]
    assert velocity[0] == pytest.approx(1.0 - 0.3 * G * 0.06, rel=1e-3)
    squares = velocity[0] ** 2 + velocity[1] ** 2 + (state.radius[0] * velocity[2]) ** 2 / k
    moving = 0.5 * mass * (1.0 - share) * squares
    assert book(state, "kinetic") == pytest.approx(moving, rel=1e-12)
    assert state.growth_books[1] > 0.0
    assert book(state, "closure") < 1e-13


def test_worn_grains_go_on_to_the_same_bits():
    rng = np.random.default_rng(7)
    place = np.array([[x, 0.5 + y] for x in range(6) for y in range(5)]) * 1.02
    model = replace(
        expanding(warm_model(rng.uniform(0.4, 0.5, 30), 300.0, FLOOR, friction=0.4)), sheds=True
    )
    laws = make_heat_laws(wear=1e-4)
    one, two = (coupled_engine(model, place, laws=laws, solver=Settings()) for _ in range(2))
    for engine in (one, two):
        engine.state.velocity[:, 0] = np.linspace(0.0, 3.0, 30)
    warmed(one, 5.0, 120)
    warmed(two, 5.0, 50)
    again = continued(two)
    warmed(again, 5.0, 70)
    assert again.state.digest() == one.state.digest()
    assert (one.state.wear > 0.0).any()
    assert book(one.state, "closure") < 1e-12


def test_what_flows_through_gaps_that_close_does_not_know_how_old_the_list_of_pairs_is():
    """Two large grains grow towards each other where they stand, by more than what the list of heat
    has room for (0.3 mean diameters, which is little beside many small ones): at each gap gas and
    radiation pass the same bits as with a list of now, none beyond their reach."""
    radius, reach = np.array([1.0, 1.0, *[0.05] * 30]), 0.1
    room = 0.3 * 2.0 * radius.mean()
    place = np.column_stack([np.arange(32) * 0.5, np.full(32, 9.0)])
    place[:2] = (0.0, 0.0), (2.0 + reach + 1.1 * room, 0.0)
    start = np.array([300.0, 350.0, *[300.0] * 30])
    engine = coupled_engine(
        expanding(warm_model(radius, start, gravity=(0.0, 0.0)), 1e-2), place,
        laws=make_heat_laws(emissivity=0.8), solver=Settings(),
        mechanisms=(Gas(0.03, reach=reach), Radiation(reach=reach)),
    )  # fmt: skip
    passed = []
    for _ in range(6):
        warmed(engine, 10.0, 100)
        fresh, before = continued(engine), engine.state.heat.copy()
        for each in (engine, fresh):
            each.step(1e-3, each.state.time)
        assert engine.state.digest() == fresh.state.digest()
        large = engine.state.radius[:2]
        is_near = place[1, 0] - large.sum() <= reach * large.min()
        passed.append(bool(engine.state.heat[0] > before[0]))
        assert passed[-1] == is_near
    assert not passed[0]
    assert passed[-1]


def test_who_is_worn_away_is_named():
    model = replace(expanding(warm_model([0.5], 300.0, FLOOR, friction=0.3)), sheds=True)
    engine = coupled_engine(model, [[0.0, 0.5]], [[1.0, 0.0, 0.0]], laws=make_heat_laws(wear=100.0))
    with pytest.raises(PhysicsError, match=r"grain 0 has lost .* by wear"):
        warmed(engine, 0.0, 90)


def test_walls_that_do_not_give_way_are_named():
    engine = column()
    engine.begin(replace(engine.orders, drives=None))
    with pytest.raises(PhysicsError, match="grains that expand need walls that give way"):
        warmed(engine, 100.0, 20)


def test_a_stop_changes_nothing():
    """A pile of discs of all temperatures that expand goes on to the same bits from its state."""
    rng = np.random.default_rng(4)
    place = np.array([[x, 0.5 + y] for x in range(6) for y in range(5)]) * 1.02
    model = expanding(
        warm_model(rng.uniform(0.4, 0.5, 30), rng.uniform(300.0, 400.0, 30), FLOOR, friction=0.4)
    )
    engines = [coupled_engine(model, place, solver=Settings()) for _ in range(2)]
    warmed(engines[0], 5.0, 200)
    warmed(engines[1], 5.0, 90)
    again = continued(engines[1])
    warmed(again, 5.0, 110)
    assert again.state.digest() == engines[0].state.digest()
    assert book(again.state, "closure") < 1e-12
