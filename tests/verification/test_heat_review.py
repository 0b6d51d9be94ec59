"""Heat where it is easily got wrong: stiff radiation, moving walls, short reaches, signals within a step, free flight."""

from dataclasses import replace

import numpy as np
import pytest
from heat_parts import (
    at_temperature,
    chain,
    coupled_engine,
    heat_book,
    heat_engine,
    make_heat_laws,
    touching_engine,
    with_heat,
    with_softening,
)
from scene_parts import FLOOR, book, make_model, resume

from multicor_cli.engine import PhysicsError
from multicor_cli.engine.heat import integration
from multicor_cli.engine.heat.conduction import ContactForce
from multicor_cli.engine.heat.convection import Ambient
from multicor_cli.engine.heat.gas import Gas, batchelor_conductance, parallel_conductance_wall
from multicor_cli.engine.heat.radiation import STEFAN_BOLTZMANN, Radiation
from multicor_cli.engine.heat.walls import WallHeat
from multicor_cli.engine.motion.drives import Constant, DofDrive, Interpolated, Sine, WallDrive

RADIUS = 1e-4
FLOW_TABLE = Interpolated((0.0, 20.0, 21.0, 26.0, 27.0, 1e4), (0.0, 0.0, 10.0, 10.0, 0.0, 0.0))
"""60 J within 7 s, in the middle of a step of 60 s."""


def temperatures(engine):
    return engine.state.temperature(engine.model.thermal)


def radiating_grain(start, wall, *, surroundings=None, **settings):
    """A grain of 0.1 mm that hangs over a floor and radiates at it; emissivity 0.8, no contact."""
    model = with_heat(make_model([RADIUS], FLOOR, shape="sphere", gravity=(0.0, 0.0), density=7500.0), start)
    conditions = [WallHeat() if wall is None else at_temperature(wall)]
    radiation = Radiation(surroundings, reach=0.0 if wall is None else 0.4)
    laws = make_heat_laws(emissivity=0.8)
    return heat_engine(model, [[0.0, 1.1 * RADIUS]], conditions=conditions, laws=laws, mechanisms=(radiation,), **settings)


def cooled(start, sink, rate, t):
    """T after t of dT/dt = rate (sink⁴ − T⁴), by the closed form for the time to reach T."""

    def time_to(temperature):
        primitive = lambda x: np.log((x + sink) / abs(x - sink)) / (4.0 * sink**3) + np.arctan(x / sink) / (2.0 * sink**3)  # noqa: E731
        return (primitive(temperature) - primitive(start)) / rate

    low, high = sink * (1.0 + 1e-14), start
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if time_to(middle) > t else (low, middle)
    return 0.5 * (low + high)


@pytest.mark.parametrize("start", [1500.0, 3000.0])
@pytest.mark.parametrize("dt", [10.0, 100.0, 1e4])
def test_a_hot_grain_cools_to_a_wall_however_long_the_step(start, dt):
    """Radiation is stiff where the grain is far hotter than what it sees: the stages must be solved, or the step refused."""
    engine = radiating_grain(start, 300.0)
    engine.step(dt, 0.0)
    capacity = engine.model.thermal.capacity[0]
    rate = STEFAN_BOLTZMANN * np.pi * RADIUS**2 / (2.0 / 0.8 - 1.0) / capacity
    assert temperatures(engine)[0] == pytest.approx(cooled(start, 300.0, rate, dt), abs=2e-3 * (start - 300.0))


@pytest.mark.parametrize(("wall", "surroundings"), [(3000.0, None), (None, 3000.0)])
def test_explicit_steps_stay_in_range_while_radiation_heats(wall, surroundings):
    """ΣH grows 4-fold (wall) or 1000-fold (surroundings) on the way from 300 K to 3000 K."""
    engine = radiating_grain(300.0, wall, surroundings=surroundings, integrator="explicit")
    for k in range(20):
        engine.step(0.3, 0.3 * k)
        assert 300.0 <= temperatures(engine)[0] <= 3000.0 * (1.0 + 1e-12)


@pytest.mark.parametrize("integrator", ["explicit", "implicit"])
def test_no_grain_below_absolute_zero(integrator):
    """A wall that draws more heat than there is ends the run."""
    engine = touching_engine(
        [[0.0, 1.0]], 300.0, shapes=FLOOR, walls=("floor",), conditions=[WallHeat("flow", Constant(-10.0))], integrator=integrator
    )
    with pytest.raises(PhysicsError, match="absolute zero"):
        engine.step(100.0, 0.0)


@pytest.mark.parametrize("start", [300.0, [300.0, 301.0, 302.0]])
def test_nothing_depends_on_memory_that_nobody_wrote(start, monkeypatch):
    """Where stages need no iteration: steady states, and short steps to a loose tolerance."""

    def heat(fill):
        fake = type("Numpy", (), {"__getattr__": lambda _, name: getattr(np, name)})()
        fake.empty = lambda *shape: np.full(*shape, fill)
        monkeypatch.setattr(integration, "np", fake)
        engine = touching_engine(chain(3), start, integrator="implicit", tolerance=1e-2)
        engine.step(5e-6, 0.0)
        return engine.state.heat.tolist(), engine.state.heat_dt

    assert heat(np.nan) == heat(0.0)


@pytest.mark.parametrize("kind", ["flow", "temperature"])
def test_a_pulse_between_two_steps_is_felt(kind):
    """A wall that acts within a step only: all of a flow arrives; of a temperature, H ∫(T_w − T) dt."""
    signal = FLOW_TABLE if kind == "flow" else replace(FLOW_TABLE, values=tuple(300.0 + v for v in FLOW_TABLE.values))
    engine = touching_engine(
        [[0.0, 1.0]],
        300.0,
        shapes=FLOOR,
        walls=("floor",),
        conditions=[WallHeat(kind, signal)],
        capacity=1e6,
        integrator="implicit",
    )
    engine.step(60.0, 0.0)
    expected = 60.0 if kind == "flow" else 60.0 * 2.0 ** (1.0 / 3.0)
    assert engine.state.heat[0] == pytest.approx(expected, rel=1e-2)


def test_sub_steps_of_a_grain_that_is_alone():
    """No difference of temperatures to measure the error by: the change within the sub-step is one too."""
    engine = touching_engine(
        [[0.0, 1.0]],
        300.0,
        shapes=FLOOR,
        walls=("floor",),
        conditions=[WallHeat("flow", Sine(1.0, 5.0, 60.0))],
        integrator="implicit",
    )
    engine.step(60.0, 0.0)
    assert engine.state.heat[0] == pytest.approx(60.0, abs=1.0)
    assert heat_book(engine.state, "sub_steps") < 500


def test_a_contact_conducts_however_short_the_reach_of_the_gas():
    """A grain that lands within the step has a gap at q_m wider than the reach, and a force."""
    model = with_heat(make_model([1.0], FLOOR, shape="sphere"), 300.0)
    given = []
    for gas in ((), (Gas(1e-6, reach=1e-3),)):
        engine = coupled_engine(model, [[0.0, 1.02]], [[0.0, -4.0, 0.0]], [at_temperature(400.0)], mechanisms=gas)
        engine.step(5e-3, 0.0)
        given.append(engine.state.wall_heat[0, 0])
    assert given[0] > 0.0
    assert given[1] == pytest.approx(given[0], rel=1e-3)


def test_gas_under_a_moving_wall_fills_the_gap_of_the_middle_of_the_step():
    model = with_heat(make_model([1.0], FLOOR, shape="sphere", gravity=(0.0, 0.0)), 300.0)
    drives = [WallDrive(y=DofDrive(velocity=Constant(1.0)))]
    engine = coupled_engine(model, [[0.0, 1.2]], None, [at_temperature(400.0)], drives=drives, mechanisms=(Gas(0.026),))
    engine.state.wall_velocity[0, 1] = 1.0
    engine.step(0.1, 0.0)
    expected = 0.1 * 100.0 * parallel_conductance_wall(0.026, 1.0, 0.0, 0.15)
    assert engine.state.wall_heat[0, 0] == pytest.approx(expected, rel=1e-3)


def test_gas_conducts_no_more_where_grains_press_less():
    """The solid's own resistance bounds what isothermal surfaces would let through a contact without force (3.45·10⁻³ W/K)."""
    radius = 1.5e-3
    model = with_heat(make_model([radius] * 2, (), (), shape="sphere", density=7500.0), [300.0, 400.0])
    engine = heat_engine(model, [[0.0, 0.0], [2.0 * radius, 0.0]], conduction="none", mechanisms=(Gas(0.026),))
    engine.step(1e-6, 0.0)
    assert engine.state.heat[0] / 1e-6 / 100.0 == pytest.approx(batchelor_conductance(0.026, 15.0, 0.75e-3, 0.0, 0.0), rel=0.05)


def test_the_biot_number_counts_the_gas():
    """Poor conductors in air: Bi of the contact alone is 0.002, but what crosses contact and gas together exceeds λ a."""
    radius = 1.5e-3
    model = with_heat(make_model([radius] * 2, (), (), shape="sphere", density=2500.0), [300.0, 400.0])
    laws, force = make_heat_laws(conductivity=0.2, density=2500.0, capacity=800.0), ContactForce("prescribed", 1e-3)
    engine = heat_engine(model, [[0.0, 0.0], [2.0 * radius, 0.0]], laws=laws, mechanisms=(Gas(0.026),), force=force)
    engine.step(1e-6, 0.0)
    whole = engine.state.heat[0] / 1e-6 / 100.0
    assert heat_book(engine.state, "max_biot") == pytest.approx(whole / (0.2 * radius), rel=1e-3)


def test_frozen_grains_stand_still_in_the_fluid():
    """Nu = 2, whatever velocity they will have when they move on."""
    model = with_heat(make_model([1e-3], (), (), shape="sphere", gravity=(0.0, 0.0), density=7500.0), 300.0)
    ambient = Ambient(400.0, correlation="ranz-marshall", conductivity=0.026, viscosity=1.6e-5, prandtl=0.7)
    engine = coupled_engine(model, [[0.0, 0.0]], [[5.0, 0.0, 0.0]], mechanisms=(ambient,))
    resume(engine, is_frozen=True)
    engine.step(1e-3, 0.0)
    expected = 1e-3 * 100.0 * 0.026 / 1e-3 * model.thermal.surface[0]
    assert engine.state.heat[0] == pytest.approx(expected, rel=1e-3)


def test_frozen_frames_keep_the_forces_beside_averages():
    model = with_heat(make_model([1.0, 1.0], FLOOR, shape="sphere"), 300.0)
    engine = coupled_engine(model, [[0.0, 1.0], [5.0, 1.0]], force=ContactForce("average", 0.01))
    engine.step(1e-3, 0.0)
    state = engine.state
    carried = state.contact_impulse[0, 0]
    # Grain 1 has left the floor: an average without a force.
    state.contact_i, state.contact_j, state.contact_impulse = state.contact_i[:1], state.contact_j[:1], state.contact_impulse[:1]
    resume(engine, is_frozen=True)
    engine.step(1.0, 0.0)
    table = engine.contacts()
    assert state.mean_i.tolist() == [0, 1]
    assert table.i.tolist() == [0]
    assert table.impulse[:, 0] == pytest.approx([carried])
    assert table.conductance[0] > 0.0


def test_friction_knows_the_wall_from_the_first_step():
    """μ = 0.3 [1 − 10⁻³ (600 − 300)] at the mean of a grain at 300 K and a wall at 900 K."""
    one = np.ones((1, 1))
    model = with_heat(make_model([1.0], FLOOR, friction=0.3, shape="sphere"), 300.0)
    model = replace(model, laws=with_softening(model.laws, 1e-3 * one, 300.0 * one, 0.0 * one, one))
    engine = coupled_engine(model, [[0.0, 1.0]], [[1.0, 0.0, 0.0]], [at_temperature(900.0)], conduction="none")
    engine.step(1e-3, 0.0)
    assert engine.moved.contacts.frame[0, 4] == pytest.approx(0.21, rel=1e-12)


@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_an_impact_in_free_flight_is_over_after_its_step(restitution):
    """Without loads and gravity nothing pushes afterwards: the impulse must not act twice, nor heat turn into motion."""
    model = make_model([1.0, 1.0], (), (), shape="sphere", gravity=(0.0, 0.0), restitution=restitution)
    engine = coupled_engine(
        with_heat(model, 300.0), [[0.0, 0.0], [2.0, 0.0]], [[0.5, 0.0, 0.0], [-0.5, 0.0, 0.0]], impact=True, conduction="none"
    )
    for k in range(4):
        engine.step(1e-3, k * 1e-3)
    state = engine.state
    assert state.velocity[1, 0] == pytest.approx(0.5 * restitution, abs=1e-12)
    lost = (1.0 - restitution**2) * book(state, "kinetic_start")
    assert heat_book(state, "impact") == pytest.approx(lost, rel=1e-12)


@pytest.mark.parametrize("integrator", ["explicit", "implicit"])
def test_mechanisms_of_one_kind_add_up(integrator):
    """Two fluids are one of the mean temperature; emissivities of 0.5 and 0.8 give 1/3 and 2/3 of what black bodies exchange."""
    fluids, fluid = (Ambient(400.0, coefficient=2.0), Ambient(300.0, coefficient=2.0)), (Ambient(350.0, coefficient=4.0),)
    near = Radiation(reach=0.4)
    choices = {"conduction": "none", "integrator": integrator, "tolerance": 1e-9}
    several = touching_engine(chain(2), [300.0, 900.0], emissivity=0.5, mechanisms=(*fluids, near, near), **choices)
    single = touching_engine(chain(2), [300.0, 900.0], emissivity=0.8, mechanisms=(*fluid, near), **choices)
    for engine in (several, single):
        for k in range(5):
            engine.step(1e-3, k * 1e-3)
    assert several.state.heat == pytest.approx(single.state.heat, rel=1e-6)  # sub-steps differ
    assert several.state.heat[0] > 1.0
    assert heat_book(several.state, "from_ambient") == pytest.approx(several.state.heat.sum(), rel=1e-10)
    assert heat_book(several.state, "closure") < 1e-13
