"""Heat of friction and impacts, its partition, wear, softening: closed forms (theory §15.1)."""

from dataclasses import replace

import numpy as np
import pytest
from heat_parts import (
    at_temperature,
    coupled_engine,
    heat_book,
    make_heat_laws,
    temperatures,
    warm_model,
    with_flash,
    with_heat,
    with_softening,
)
from scene_parts import (
    FLOOR,
    G,
    advance,
    begin,
    book,
    floor_and_lid,
    make_model,
    resume,
    shear_scene,
)

from multicor_cli.engine import Interrupted, Settings
from multicor_cli.engine.heat.books import receive, receive_walls
from multicor_cli.engine.heat.convection import Ambient
from multicor_cli.engine.heat.gas import Gas
from multicor_cli.engine.heat.hertz import contact_radius
from multicor_cli.engine.heat.impacts import impact_exchange
from multicor_cli.engine.heat.radiation import Radiation
from multicor_cli.engine.heat.settings import ContactForce
from multicor_cli.engine.heat.walls import WallHeat
from multicor_cli.engine.motion.drives import Constant, DofDrive, Sine, WallDrive
from multicor_cli.model.flash import flash_rise
from multicor_cli.model.state import State

MU = 0.3


def slide(shape="disc", dt=1e-3, conditions=None, model=None, duration=0.2, **settings):
    """A body on a floor, sliding at 1 m/s; ends rolling."""
    model = model or warm_model(shapes=FLOOR, friction=MU, shape=shape)
    engine = coupled_engine(model, [[0.0, 1.0]], [[1.0, 0.0, 0.0]], conditions, **settings)
    advance(engine, dt, round(duration / dt))
    return engine


def with_law(model, rate, lowest=0.0):
    """μ(T) = μ_0 [1 − rate (T − 300 K)], between ``lowest`` and 1."""
    one = np.ones((1, 1))
    return replace(
        model, laws=with_softening(model.laws, rate * one, 300.0 * one, lowest * one, one)
    )


@pytest.mark.parametrize(("shape", "ratio"), [("disc", 0.5), ("sphere", 0.4)])
@pytest.mark.parametrize("dt", [1e-2, 3.7e-3, 1e-3])
def test_sliding_body_ends_rolling_with_the_exact_velocity_and_heat(shape, ratio, dt):
    """v = v0/(1 + I/(m a²)) whatever Δt; heat is exactly I/(m a²)/(1 + I/(m a²)) of the energy."""
    engine = slide(shape, dt)
    state, energy = engine.state, 0.5 * engine.model.grains.mass[0]
    assert state.velocity[0, 0] == pytest.approx(1.0 / (1.0 + ratio), abs=1e-12)
    assert state.velocity[0, 2] == pytest.approx(-state.velocity[0, 0], abs=1e-12)
    assert state.heat[0] / energy == pytest.approx(ratio / (1.0 + ratio), abs=1e-12)
    assert state.generated[0] == state.heat[0]
    for lost in (book(state, "friction_loss"), heat_book(state, "friction")):
        assert lost == pytest.approx(state.heat[0], rel=1e-14)


@pytest.mark.parametrize(("dt", "share"), [(1e-2, 0.304474540), (1e-3, 0.330395371)])
def test_sliding_disc_end_of_step_rule(dt, share):
    """The paper's rule μ|u_t⁺| r_n Δt misses part of it; the scheme's values (theory §15.1)."""
    engine = slide(dt=dt, friction="sliding")
    energy = 0.5 * engine.model.grains.mass[0]
    assert book(engine.state, "friction_sliding") / energy == pytest.approx(share, abs=1e-9)
    assert engine.state.heat[0] / energy == pytest.approx(share, abs=1e-9)
    assert heat_book(engine.state, "closure") < 1e-14


def test_a_wall_of_known_temperature_takes_its_share():
    laws = make_heat_laws()._replace(share=np.full((1, 1), 0.25))
    engine = slide(conditions=[at_temperature(300.0)], laws=laws, conduction="none")
    total = 0.5 * engine.model.grains.mass[0] / 3.0
    assert engine.state.generated[0] == pytest.approx(0.25 * total, rel=1e-12)
    assert engine.state.wall_heat[0, 1] == pytest.approx(0.75 * total, rel=1e-12)
    assert heat_book(engine.state, "to_walls") == pytest.approx(0.75 * total, rel=1e-12)


def test_no_heat_of_friction_moves_a_grain():
    assert slide(friction="none").state.heat[0] == 0.0
    # Heat acts back on motion through friction alone: without that it is the same to the bit
    heated, cold = shear(**ALL_ON), shear(friction="none", conduction="none")
    assert np.array_equal(heated.state.position, cold.state.position)


def test_wear_is_archard_s():
    """V = K F s/H with F s = m g · v0²/(6 μ g) (theory §15.1), whatever Δt."""
    for dt in (1e-2, 1e-3):
        engine = slide(dt=dt, laws=make_heat_laws(wear=1e-4 / 2e9))
        mass = engine.model.grains.mass[0]
        expected = 1e-4 / 2e9 * mass / (6.0 * MU)
        assert engine.state.wear[0] == pytest.approx(expected, rel=1e-12)
        assert engine.state.wall_wear[0] == pytest.approx(expected, rel=1e-12)


def test_friction_that_falls_with_temperature():
    """μ(T) = μ_0 [1 − c (T − T_r)]: dv/dt = −μ g, and all heat stays in the grain (first order)."""
    rate, heat_per_speed = 1e-2, 2.0
    model = make_model([1.0], FLOOR, friction=MU, shape="sphere")
    model = with_heat(model, 300.0, capacity=model.grains.mass[0] * heat_per_speed * 1e-3)
    model, dt = with_law(model, rate, 0.05), 1e-5
    engine = slide(model=model, dt=dt, duration=0.02)
    # dT/dt = μ g u/(C/m), du/dt = −3.5 μ g, so C/m (T − T_r) = (u0² − u²)/7 and dμ follows.
    u, temperature = 1.0, 0.0
    for _ in range(2000):
        mu = MU * (1.0 - rate * temperature)
        temperature += dt * mu * G * (u - 0.5 * dt * 3.5 * mu * G) / (heat_per_speed * 1e-3)
        u -= dt * 3.5 * mu * G
    velocity = engine.state.velocity[0]
    assert velocity[0] + velocity[2] == pytest.approx(u, rel=1e-9)
    rise = temperatures(engine)[0] - 300.0
    assert rise == pytest.approx(temperature, rel=1e-9)
    assert rise * heat_per_speed * 1e-3 == pytest.approx((1.0 - u * u) / 7.0, rel=1e-9)
    assert u > 1.0 - 3.5 * MU * G * 0.02 + 0.01  # friction has fallen for certain


def test_friction_that_weakens_at_lower_speeds_when_hot():
    """V_w falls as (T_w − T)² with the temperature of the sliding grain (Rice 2006), and all heat
    stays in the grain: as an integration of the two equations; f_w where it is hotter than T_w.
    """
    per_speed, weakened, v_w, limit = 5e-3, 0.1, 2.0, 320.0
    model = make_model([1.0], FLOOR, friction=MU, shape="sphere")
    model = with_heat(model, 300.0, capacity=model.grains.mass[0] * per_speed)
    model, dt = with_flash(model, weakened, v_w, limit), 1e-5
    engine = slide(model=model, dt=dt, duration=0.09)
    u, rise, was_hot = 1.0, 0.0, False
    for _ in range(9000):
        speed = v_w * (1.0 - rise / 20.0) ** 2 if rise < 20.0 else 0.0
        mu = MU if u <= speed else weakened + (MU - weakened) * speed / u
        was_hot |= speed == 0.0
        rise += dt * mu * G * (u - 0.5 * dt * 3.5 * mu * G) / per_speed
        u -= dt * 3.5 * mu * G
    assert was_hot
    velocity = engine.state.velocity[0]
    assert velocity[0] + velocity[2] == pytest.approx(u, rel=1e-9)
    assert temperatures(engine)[0] - 300.0 == pytest.approx(rise, rel=1e-9)
    assert heat_book(engine.state, "closure") < 1e-13


@pytest.mark.parametrize("rolling", [0.0, 0.1])
@pytest.mark.parametrize("wall", [None, 340.0])
def test_the_hottest_spot_is_that_of_the_contact_that_slides(wall, rolling):
    """(T_i + T_j)/2 + P/(G_i + G_j) with P = μ F v and the spot of Hertz (model.flash), the largest
    of the window; a grain alone where the wall takes no heat; no flash when the grain rolls, even
    against a resistance, whose heat is no sliding's.
    """
    conditions = None if wall is None else [at_temperature(wall)]
    laws, dt = make_heat_laws(), 1e-3
    model = warm_model(shapes=FLOOR, friction=MU, rolling=rolling)
    engine = coupled_engine(model, [[0.0, 1.0]], [[1.0, 0.0, 0.0]], conditions, laws=laws)
    force = model.grains.mass[0] * G
    spot = contact_radius(force, 1.0, laws.modulus[0, 0])
    body = laws.conductivity[0], laws.volumetric[0]
    engine.step(dt, 0.0)
    velocity = engine.state.velocity[0]
    slip = 0.5 * (1.0 + velocity[0] + velocity[2])  # the mean of the first step
    rise = flash_rise(MU * force * slip, spot, slip, *body, *(body if wall else (0.0, body[1])))
    expected = (300.0 if wall is None else 320.0) + rise
    first = heat_book(engine.state, "hottest_spot")
    assert first == pytest.approx(expected, rel=1e-12)
    advance(engine, dt, 200)
    assert heat_book(engine.state, "hottest_spot") >= first
    engine.state.window[:] = 0.0
    before = heat_book(engine.state, "friction")
    engine.step(dt, 0.0)
    assert (heat_book(engine.state, "friction") > before + 1e-3) == (rolling > 0.0)
    assert heat_book(engine.state, "hottest_spot") < 300.01 + 20.0 * (wall is not None)


def impact(steps=1, shape="disc", restitution=0.5, **settings):
    """Steps of two grains that meet at 1 m/s in free flight."""
    model = warm_model(
        [1.0, 1.0], [300.0, 400.0], restitution=restitution, gravity=(0.0, 0.0), shape=shape
    )
    meeting = [[0.0, 0.0], [2.0, 0.0]], [[0.5, 0.0, 0.0], [-0.5, 0.0, 0.0]]
    engine = coupled_engine(model, *meeting, **settings)
    advance(engine, 1e-3, steps)
    return engine


def test_impacts_heat_where_asked():
    """−p_n ½(u_n⁻+u_n⁺) = ½(1−e²) u_n²/W_nn, half to each of two like grains."""
    engine = impact(impact=True, conduction="none")
    mass = engine.model.grains.mass[0]
    assert engine.state.heat == pytest.approx(np.full(2, 0.25 * mass * 0.75 * 0.5), rel=1e-12)
    assert heat_book(engine.state, "impact") == pytest.approx(
        book(engine.state, "impact_loss"), rel=1e-14
    )
    assert np.abs(impact(conduction="none").state.heat).max() == 0.0


def test_a_collision_conducts_by_its_own_law():
    """Sun & Chen: heat per kelvin of an impact of this mass, radius and speed, whatever Δt."""
    engine = impact(collisional=True)
    mass = engine.model.grains.mass[0]
    laws = make_heat_laws()
    exchange = impact_exchange(0.5 * mass, 0.5, laws.modulus[0, 0], 1.0, 15.0, 3.75e6, 15.0, 3.75e6)
    assert engine.state.heat[0] == pytest.approx(100.0 * exchange, rel=1e-6)
    assert engine.state.heat.sum() == pytest.approx(0.0, abs=1e-12 * engine.state.heat[0])


@pytest.mark.parametrize("dt", [0.05, 0.25, 0.5, 2.0])
def test_each_impact_of_a_grain_in_flight_conducts(dt):
    """20 between two walls, 0.2 s apart: one by one, or up to ten in a step."""
    model = warm_model(
        shapes=floor_and_lid(2.2), walls=("floor", "lid"), restitution=1.0, friction=0.0,
        gravity=(0.0, 0.0), capacity=1e9,
    )  # fmt: skip
    engine = coupled_engine(
        model, [[0.0, 1.13]], [[0.0, 1.0, 0.0]], [at_temperature(350.0), at_temperature(400.0)],
        collisional=True, friction="none",
    )  # fmt: skip
    state, solid = advance(engine, dt, round(4.0 / dt)), (15.0, 3.75e6)
    assert state.velocity[0, 1] == pytest.approx(1.0, rel=1e-12)
    mass, modulus = model.grains.mass[0], make_heat_laws().modulus[0, 0]
    exchange = impact_exchange(mass, 1.0, modulus, 1.0, *solid, *solid)
    assert state.heat[0] == pytest.approx(10.0 * (50.0 + 100.0) * exchange, rel=1e-7)


@pytest.mark.parametrize(
    ("free", "damping"), [("", 0.0), ("y", 0.0), ("spin", 0.0), ("y spin", 0.0), ("y", 1e4)]
)
def test_a_collision_feels_the_mass_of_a_wall_that_gives_way(free, damping):
    """1/m = 1/m_i + 1/M + l²/I of what is free; in so short a time dampers do nothing."""
    drive = DofDrive(force=Constant(0.0), damping=damping)
    model = warm_model(shapes=FLOOR, gravity=(0.0, 0.0), friction=0.0, mass=3.0, inertia=2.0)
    engine = coupled_engine(
        model, [[0.7, 1.0]], [[0.0, -0.5, 0.0]], [at_temperature(310.0)], friction="none",
        drives=[WallDrive(**dict.fromkeys(free.split(), drive))], collisional=True,
    )  # fmt: skip
    engine.step(1e-3, 0.0)
    gives = ("y" in free) / 3.0 + ("spin" in free) * 0.7**2 / 2.0
    mass = 1.0 / (1.0 / model.grains.mass[0] + gives)
    solid = 15.0, 3.75e6
    exchange = impact_exchange(mass, 1.0, make_heat_laws().modulus[0, 0], 0.5, *solid, *solid)
    assert engine.state.heat[0] == pytest.approx(10.0 * exchange, rel=1e-6)


@pytest.mark.parametrize("speed", [0.0, 1e-17, 1e-9])
def test_what_closes_under_a_load_has_no_impact(speed):
    """A grain is set down on a warm floor: what it conducts does not go by whether rounding lets it
    approach, but by its weight."""
    found = []
    for collisional in (True, False):
        engine = coupled_engine(
            warm_model(shapes=FLOOR), [[0.0, 1.0]], [[0.0, -speed, 0.0]], [at_temperature(310.0)],
            collisional=collisional,
        )  # fmt: skip
        engine.step(1e-3, 0.0)
        found.append(float(engine.state.heat[0]))
    assert found[0] == found[1] > 0.0


def test_running_average_of_the_force():
    """A grain at rest: F̄ = F from the first step on; the kept sum grows as 1 − exp(−t/τ)."""
    model = warm_model(shapes=FLOOR)
    engine = coupled_engine(model, [[0.0, 1.0]], force=ContactForce("average", 0.01))
    advance(engine, 1e-3, 20)
    weight = model.grains.mass[0] * G
    assert engine.state.mean_force == pytest.approx([weight * (1.0 - np.exp(-2.0))], rel=1e-9)
    spot = (3.0 * weight / (4.0 * make_heat_laws().modulus[0, 0])) ** (1.0 / 3.0)
    assert engine.contacts().conductance == pytest.approx([2.0 * 15.0 * spot], rel=1e-9)


AIR = {"conductivity": 0.026, "viscosity": 1.6e-5, "prandtl": 0.7}
ALL_ON = {"impact": True, "mechanisms": (
    Gas(0.026, reach=0.5),
    Ambient(350.0, correlation="whitaker", velocity=(0.3, 0.0), **AIR),
    Radiation(surroundings=250.0, reach=0.4),
)}  # fmt: skip
AVERAGED = {**ALL_ON, "force": ContactForce("average", 0.1), "collisional": True}
CONDITIONS = [WallHeat("temperature", Sine(320.0, 30.0, 0.3)), WallHeat("flow", Constant(5.0))]


def shear(steps=200, dt=0.02, solver=None, conditions=None, specific=1e-3, **settings):
    model, positions, origins, drives = shear_scene(columns=8, rows=6, gravity=(0.0, -0.02))
    temperature = 300.0 + 40.0 * np.random.default_rng(1).random(model.grain_count)
    engine = coupled_engine(
        with_heat(model, temperature, specific=specific), positions, drives=drives,
        conditions=conditions or CONDITIONS, solver=solver or Settings(max_sweeps=300),
        laws=make_heat_laws(conductivity=5.0, emissivity=0.8), **settings,
    )  # fmt: skip
    engine.state.wall_position[:] = origins
    advance(engine, dt, steps)
    return engine


@pytest.mark.parametrize(("integrator", "specific"), [("explicit", 3e-2), ("implicit", 1e-3)])
@pytest.mark.parametrize("settings", [ALL_ON, AVERAGED])
def test_first_law_closes_with_everything_on(integrator, specific, settings):
    """Explicit sub-steps are as short as the least C/ΣH: large capacities need 30 times fewer."""
    state = shear(integrator=integrator, specific=specific, **settings).state
    assert heat_book(state, "closure") < 1e-12
    assert heat_book(state, "exchanged") > 0.0
    froms = "from_walls", "from_ambient", "from_surroundings"
    assert all(heat_book(state, name) for name in ("friction", "impact", "to_walls", *froms))


@pytest.mark.parametrize("integrator", ["explicit", "implicit"])
def test_insulated_grains_store_what_friction_and_impacts_lose(integrator):
    """Stored heat = mechanical losses, to round-off, though the solver is far from converged."""
    insulated = [WallHeat(), WallHeat()]
    state = shear(
        conditions=insulated, impact=True, integrator=integrator, solver=Settings(max_sweeps=10)
    ).state
    losses = book(state, "friction_loss") + book(state, "impact_loss")
    assert losses > 0.0
    ahead = heat_book(state, "ahead")
    assert state.heat.sum() == pytest.approx(losses + ahead, rel=1e-12)
    assert state.generated.sum() == pytest.approx(losses + ahead, rel=1e-12)
    assert book(state, "closure") < 1e-12


def test_frozen_frames_keep_the_forces_beside_averages():
    model = warm_model([1.0, 1.0], shapes=FLOOR)
    engine = coupled_engine(model, [[0.0, 1.0], [5.0, 1.0]], force=ContactForce("average", 0.01))
    engine.step(1e-3, 0.0)
    state = engine.state
    carried = state.contact_impulse[0, 0]
    # Grain 1 has left the floor: an average without a force.
    for name in ("contact_i", "contact_j", "contact_impulse"):
        setattr(state, name, getattr(state, name)[:1])
    resume(engine, is_frozen=True)
    engine.step(1.0, 0.0)
    table = engine.contacts()
    assert state.mean_i.tolist() == [0, 1]
    assert table.i.tolist() == [0]
    assert table.impulse[:, 0] == pytest.approx([carried])
    assert table.conductance[0] > 0.0


def test_friction_knows_the_wall_from_the_first_step():
    """μ = 0.3 [1 − 10⁻³ (600 − 300)] at the mean of a grain at 300 K and a wall at 900 K."""
    model = with_law(warm_model(shapes=FLOOR, friction=0.3), 1e-3)
    engine = slide(
        model=model, duration=1e-3, conditions=[at_temperature(900.0)], conduction="none"
    )
    assert engine.mechanics.moved.contacts[0].mu == pytest.approx(0.21, rel=1e-12)


@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_an_impact_in_free_flight_is_over_after_its_step(restitution):
    """Nothing pushes afterwards: the impulse must not act twice, nor heat turn into motion."""
    state = impact(4, "sphere", restitution, impact=True, conduction="none").state
    assert state.velocity[1, 0] == pytest.approx(0.5 * restitution, abs=1e-12)
    lost = (1.0 - restitution**2) * book(state, "kinetic_start")
    assert heat_book(state, "impact") == pytest.approx(lost, rel=1e-12)


def test_friction_never_cools_and_heat_runs_ahead_of_losses_only_until_they_come():
    """What each grain has received is the most that its contacts had lost at any time (theory §11.3)."""
    model = warm_model((1.0, 1.0, 1.0))
    state = State.at_rest(model, np.zeros((3, 2)))
    lost = np.random.default_rng(3).normal(0.2, 1.0, (200, 3))
    for source in lost:
        before = state.generated.copy()
        received = receive(state, source)
        assert (received >= 0.0).all()
        np.testing.assert_array_equal(state.generated, before + received)
    most = np.maximum(np.cumsum(lost, axis=0).max(axis=0), 0.0)
    np.testing.assert_allclose(state.generated, most, rtol=1e-12)
    np.testing.assert_allclose(state.heat_ahead, most - lost.sum(axis=0), rtol=0, atol=1e-11)
    assert heat_book(state, "ahead") == pytest.approx(state.heat_ahead.sum(), abs=1e-11)


def test_no_grain_of_an_insulated_flow_becomes_colder_than_the_coldest_was():
    """Although single contacts gain energy in many steps, by the solver's errors and the step's."""
    engine = shear(conditions=[WallHeat(), WallHeat()], impact=True, solver=Settings(max_sweeps=10))
    state, coldest = engine.state, engine.model.thermal.initial_temperature.min()
    assert book(state, "negative_loss") < 0.0
    assert temperatures(engine).min() >= coldest
    assert 0.0 < heat_book(state, "ahead") == pytest.approx(state.heat_ahead.sum(), rel=1e-9)
    assert state.generated.sum() == pytest.approx(
        heat_book(state, "friction") + heat_book(state, "impact") + heat_book(state, "ahead"),
        rel=1e-12,
    )


def test_friction_never_cools_a_wall_with_a_heat_capacity():
    """As of grains: it receives the most that its contacts had lost at any time (theory §11.3)."""
    state = State.at_rest(warm_model(shapes=floor_and_lid(5.0)), np.zeros((1, 2)))
    lost, bodies = np.random.default_rng(4).normal(0.2, 1.0, (200, 2)), np.array([1])
    given = []
    for source in lost:
        to_walls = source.copy()
        receive_walls(state, to_walls, bodies)
        assert to_walls[0] == source[0]  # of known temperature: nothing happens to it
        given.append(to_walls[1])
    most = np.maximum(np.maximum.accumulate(np.cumsum(lost[:, 1])), 0.0)
    np.testing.assert_allclose(np.cumsum(given), most, rtol=1e-12)
    assert state.wall_ahead[0] == 0.0
    assert state.wall_ahead[1] == pytest.approx(most[-1] - lost[:, 1].sum(), abs=1e-11)
    assert heat_book(state, "ahead") == pytest.approx(state.wall_ahead[1], abs=1e-11)


def test_no_wall_of_an_insulated_flow_becomes_colder_than_all_were():
    """As single contacts of grains gain energy, so do those of walls; the books close."""
    body = WallHeat("capacity", capacity=1e-6, initial=300.0)
    engine = shear(
        0, conditions=[body, body], impact=True, conduction="none", solver=Settings(max_sweeps=10)
    )
    begin(engine, is_new=np.array([True, True]))
    state, walls = engine.state, [np.full(2, 300.0)]
    for k in range(200):
        engine.step(0.02, 0.02 * k)
        walls.append(state.wall_temperature.copy())
    assert (np.diff(walls, axis=0) >= 0.0).all()
    assert state.wall_ahead.max() > 0.0
    assert heat_book(state, "ahead") == pytest.approx(
        state.heat_ahead.sum() + state.wall_ahead.sum(), rel=1e-9
    )
    assert heat_book(state, "closure") < 1e-13


def test_an_interrupted_step_of_a_frozen_stage_leaves_the_state_alone():
    """The hottest spot of the window is in it."""
    engine = slide(duration=2e-3, conditions=[at_temperature(310.0)])
    resume(engine, is_frozen=True)
    assert heat_book(engine.state, "hottest_spot") > 310.0
    before = engine.state.digest()
    with pytest.raises(Interrupted):
        engine.step(1e9, 0.0, lambda: True)
    assert engine.state.digest() == before
