"""Heat of friction and impacts, its partition, wear and friction that depends on temperature: closed forms (theory §15.1)."""

from dataclasses import replace

import numpy as np
import pytest
from heat_parts import at_temperature, coupled_engine, heat_book, heat_engine, make_heat_laws, with_heat, with_softening
from scene_parts import FLOOR, G, book, continued, make_model, resume, shear_scene

from multicor_cli.engine import Settings
from multicor_cli.engine.heat.conduction import ContactForce
from multicor_cli.engine.heat.convection import Ambient
from multicor_cli.engine.heat.gas import Gas
from multicor_cli.engine.heat.radiation import Radiation
from multicor_cli.engine.heat.walls import WallHeat
from multicor_cli.engine.motion.drives import Constant, Sine

MU = 0.3


def slide(shape="disc", dt=1e-3, conditions=None, model=None, duration=0.2, **settings):
    """A body on a floor, sliding at 1 m/s; ends rolling."""
    model = model or with_heat(make_model([1.0], FLOOR, friction=MU, shape=shape), 300.0)
    engine = coupled_engine(model, [[0.0, 1.0]], [[1.0, 0.0, 0.0]], conditions, **settings)
    for k in range(round(duration / dt)):
        engine.step(dt, k * dt)
    return engine


@pytest.mark.parametrize(("shape", "share"), [("disc", 1.0 / 3.0), ("sphere", 2.0 / 7.0)])
@pytest.mark.parametrize("dt", [1e-2, 3.7e-3, 1e-3])
def test_slide_to_roll_heat_is_exact(shape, share, dt):
    engine = slide(shape, dt)
    energy = 0.5 * engine.model.grains.mass[0]
    assert engine.state.heat[0] / energy == pytest.approx(share, abs=1e-12)
    assert engine.state.generated[0] == engine.state.heat[0]
    assert heat_book(engine.state, "friction") == pytest.approx(book(engine.state, "friction_loss"), rel=1e-14)


@pytest.mark.parametrize(("dt", "share"), [(1e-2, 0.304474540), (1e-3, 0.330395371)])
def test_the_paper_s_rule_misses_part_of_it(dt, share):
    engine = slide(dt=dt, friction="sliding")
    assert engine.state.heat[0] / (0.5 * engine.model.grains.mass[0]) == pytest.approx(share, abs=1e-9)
    assert heat_book(engine.state, "closure") < 1e-14


def test_a_wall_of_known_temperature_takes_its_share():
    laws = make_heat_laws()._replace(share=np.full((1, 1), 0.25))
    engine = slide(conditions=[at_temperature(300.0)], laws=laws, conduction="none")
    total = 0.5 * engine.model.grains.mass[0] / 3.0
    assert engine.state.generated[0] == pytest.approx(0.25 * total, rel=1e-12)
    assert engine.state.wall_heat[0, 1] == pytest.approx(0.75 * total, rel=1e-12)
    assert heat_book(engine.state, "to_walls") == pytest.approx(0.75 * total, rel=1e-12)


def test_no_heat_of_friction_where_it_is_switched_off():
    assert slide(friction="none").state.heat[0] == 0.0


def test_wear_is_archard_s():
    """V = K F s/H with F s = m g · v0²/(6 μ g) (theory §15.1), whatever Δt."""
    for dt in (1e-2, 1e-3):
        engine = slide(dt=dt, laws=make_heat_laws(wear=1e-4 / 2e9))
        mass = engine.model.grains.mass[0]
        expected = 1e-4 / 2e9 * mass / (6.0 * MU)
        assert engine.state.wear[0] == pytest.approx(expected, rel=1e-12)
        assert engine.state.wall_wear[0] == pytest.approx(expected, rel=1e-12)


def test_friction_that_falls_with_temperature():
    """μ(T) = μ_0 [1 − c (T − T_r)] with T of the grain: dv/dt = −μ g, and all heat of sliding stays in it (first order in Δt)."""
    rate, heat_per_speed = 1e-2, 2.0
    model = make_model([1.0], FLOOR, friction=MU, shape="sphere")
    model = with_heat(model, 300.0, capacity=model.grains.mass[0] * heat_per_speed * 1e-3)
    one = np.ones((1, 1))
    model = replace(model, laws=with_softening(model.laws, rate * one, 300.0 * one, 0.05 * one, 1.0 * one))
    dt = 1e-5
    engine = slide(model=model, dt=dt, duration=0.02)
    # dT/dt = μ g u/(C/m), du/dt = −3.5 μ g, so C/m (T − T_r) = (u0² − u²)/7 and dμ follows.
    u, temperature = 1.0, 0.0
    for _ in range(2000):
        mu = MU * (1.0 - rate * temperature)
        temperature += dt * mu * G * (u - 0.5 * dt * 3.5 * mu * G) / (heat_per_speed * 1e-3)
        u -= dt * 3.5 * mu * G
    velocity = engine.state.velocity[0]
    assert velocity[0] + velocity[2] == pytest.approx(u, rel=1e-9)
    rise = engine.state.temperature(model.thermal)[0] - 300.0
    assert rise == pytest.approx(temperature, rel=1e-9)
    assert rise * heat_per_speed * 1e-3 == pytest.approx((1.0 - u * u) / 7.0, rel=1e-9)
    assert u > 1.0 - 3.5 * MU * G * 0.02 + 0.01  # friction has fallen for certain


def impact(**settings):
    model = with_heat(make_model([1.0, 1.0], (), (), restitution=0.5, gravity=(0.0, 0.0)), [300.0, 400.0])
    engine = coupled_engine(model, [[0.0, 0.0], [2.0, 0.0]], [[0.5, 0.0, 0.0], [-0.5, 0.0, 0.0]], **settings)
    engine.step(1e-3, 0.0)
    return engine


def test_impacts_heat_where_asked():
    """−p_n ½(u_n⁻+u_n⁺) = ½(1−e²) u_n²/W_nn, half to each of two like grains."""
    engine = impact(impact=True, conduction="none")
    mass = engine.model.grains.mass[0]
    assert engine.state.heat == pytest.approx(np.full(2, 0.25 * mass * 0.75 * 0.5), rel=1e-12)
    assert heat_book(engine.state, "impact") == pytest.approx(book(engine.state, "impact_loss"), rel=1e-14)
    assert np.abs(impact(conduction="none").state.heat).max() == 0.0


def test_a_collision_conducts_by_its_own_law():
    """Sun & Chen: heat per kelvin of one impact, independent of Δt; the mass, radius and speed of this one."""
    from multicor_cli.engine.heat.friction import impact_exchange

    engine = impact(collisional=True)
    mass = engine.model.grains.mass[0]
    laws = make_heat_laws()
    exchange = impact_exchange(0.5 * mass, 0.5, laws.modulus[0, 0], 1.0, 15.0, 3.75e6, 15.0, 3.75e6)
    assert engine.state.heat[0] == pytest.approx(100.0 * exchange, rel=1e-6)
    assert engine.state.heat.sum() == pytest.approx(0.0, abs=1e-12 * engine.state.heat[0])


def test_running_average_of_the_force():
    """A grain at rest: F̄ = F from the first step on; the sum kept in the state grows as 1 − exp(−t/τ)."""
    model = with_heat(make_model([1.0], FLOOR, shape="sphere"), 300.0)
    engine = coupled_engine(model, [[0.0, 1.0]], force=ContactForce("average", 0.01))
    for k in range(20):
        engine.step(1e-3, k * 1e-3)
    weight = model.grains.mass[0] * G
    assert engine.state.mean_force == pytest.approx([weight * (1.0 - np.exp(-2.0))], rel=1e-9)
    spot = (3.0 * weight / (4.0 * make_heat_laws().modulus[0, 0])) ** (1.0 / 3.0)
    assert engine.contacts().conductance == pytest.approx([2.0 * 15.0 * spot], rel=1e-9)


ALL_ON = {
    "impact": True,
    "mechanisms": (
        Gas(0.026, reach=0.5),
        Ambient(350.0, correlation="whitaker", conductivity=0.026, viscosity=1.6e-5, prandtl=0.7, velocity=(0.3, 0.0)),
        Radiation(surroundings=250.0, reach=0.4),
    ),
}


def shear(steps=200, dt=0.02, solver=None, conditions=None, **settings):
    model, positions, origins, drives = shear_scene(columns=8, rows=6, gravity=(0.0, -0.02))
    model = with_heat(model, 300.0 + 40.0 * np.random.default_rng(1).random(model.grain_count), specific=1e-3)
    conditions = conditions or [WallHeat("temperature", Sine(320.0, 30.0, 0.3)), WallHeat("flow", Constant(5.0))]
    laws = make_heat_laws(conductivity=5.0, emissivity=0.8)
    engine = coupled_engine(
        model, positions, conditions=conditions, laws=laws, solver=solver or Settings(max_sweeps=300), drives=drives, **settings
    )
    engine.state.wall_position[:] = origins
    for k in range(steps):
        engine.step(dt, k * dt)
    return engine


@pytest.mark.parametrize("integrator", ["explicit", "implicit"])
@pytest.mark.parametrize("settings", [ALL_ON, {**ALL_ON, "force": ContactForce("average", 0.1), "collisional": True}])
def test_first_law_closes_with_everything_on(integrator, settings):
    state = shear(integrator=integrator, **settings).state
    assert heat_book(state, "closure") < 1e-12
    assert heat_book(state, "exchanged") > 0.0
    for name in ("friction", "impact", "to_walls", "from_walls", "from_ambient", "from_surroundings"):
        assert heat_book(state, name) != 0.0, name


@pytest.mark.parametrize("integrator", ["explicit", "implicit"])
def test_insulated_grains_store_what_friction_and_impacts_lose(integrator):
    """Stored heat = mechanical losses, to round-off, though the contact solver is far from converged."""
    insulated = [WallHeat(), WallHeat()]
    state = shear(conditions=insulated, impact=True, integrator=integrator, solver=Settings(max_sweeps=10)).state
    losses = book(state, "friction_loss") + book(state, "impact_loss")
    assert losses > 0.0
    assert state.heat.sum() == pytest.approx(losses, rel=1e-12)
    assert state.generated.sum() == pytest.approx(losses, rel=1e-12)
    assert book(state, "closure") < 1e-12


def test_heat_does_not_move_a_grain():
    """Heat acts back on the mechanics through the friction coefficient only: without it the motion is the same to the bit."""
    heated, cold = shear(**ALL_ON), shear(friction="none", conduction="none")
    assert np.array_equal(heated.state.position, cold.state.position)


def test_a_state_goes_on_to_the_bit_from_a_copy():
    """Everything that the future depends on is in the state: averages and sub-steps included."""
    settings = {**ALL_ON, "force": ContactForce("average", 0.1), "integrator": "implicit", "collisional": True}
    through = shear(steps=40, **settings)
    half = shear(steps=20, **settings)
    engine = continued(half)
    for k in range(20, 40):
        engine.step(0.02, k * 0.02)
    assert engine.state.digest() == through.state.digest()


def test_radiation_of_one_grain_to_the_surroundings():
    """C dT/dt = ε σ A (T_s⁴ − T⁴): cooling towards 0 K, T^-3 = T_0^-3 + 3 ε σ A t/C."""
    model = with_heat(make_model([1.0], (), (), shape="sphere", gravity=(0.0, 0.0)), 1000.0, capacity=1.0)
    laws, radiation = make_heat_laws(emissivity=0.5), Radiation(surroundings=1e-3)
    engine = coupled_engine(model, [[0.0, 0.0]], laws=laws, mechanisms=(radiation,), tolerance=1e-9)
    resume(engine, is_frozen=True)
    t = 20.0e-3
    engine.step(t, 0.0)
    coefficient = 0.5 * 5.670374419e-8 * 4.0 * np.pi
    assert engine.state.temperature(model.thermal)[0] == pytest.approx((1e-9 + 3.0 * coefficient * t) ** (-1.0 / 3.0), rel=1e-6)


def test_convection_of_one_grain():
    """T_f − T decays with C/(h A)."""
    model = with_heat(make_model([1.0], (), (), shape="sphere", gravity=(0.0, 0.0)), 300.0, capacity=8.0 * np.pi)
    heat = heat_engine(model, [[0.0, 0.0]], mechanisms=(Ambient(400.0, coefficient=2.0),), tolerance=1e-8)
    heat.step(1.0, 0.0)
    state = heat.state
    assert state.temperature(model.thermal)[0] == pytest.approx(400.0 - 100.0 * np.exp(-1.0), rel=1e-6)
    assert heat_book(state, "from_ambient") == pytest.approx(state.heat[0], rel=1e-14)
