"""Radiation, gas and convection: closed forms, and where they are easily got wrong."""

import numpy as np
import pytest
from heat_parts import (
    advanced,
    at_temperature,
    chain,
    coupled_engine,
    heat_book,
    heat_engine,
    make_heat_laws,
    temperatures,
    touching_engine,
    warm_model,
)
from scene_parts import FLOOR, resume

from multicor_cli.engine.heat.convection import Ambient
from multicor_cli.engine.heat.gas import Gas, batchelor_conductance, parallel_conductance_wall
from multicor_cli.engine.heat.radiation import STEFAN_BOLTZMANN, Radiation
from multicor_cli.engine.heat.settings import ContactForce
from multicor_cli.engine.heat.walls import WallHeat
from multicor_cli.engine.motion.drives import Constant, DofDrive, WallDrive

RADIUS, CENTER = 1e-4, [[0.0, 0.0]]


def test_radiation_of_one_grain_to_the_surroundings():
    """C dT/dt = ε σ A (T_s⁴ − T⁴): cooling towards 0 K, T^-3 = T_0^-3 + 3 ε σ A t/C."""
    laws, mechanisms = make_heat_laws(emissivity=0.5), (Radiation(surroundings=1e-3),)
    model = warm_model(start=1000.0, capacity=1.0)
    engine = heat_engine(model, CENTER, laws=laws, mechanisms=mechanisms, tolerance=1e-9)
    t, coefficient = 20.0e-3, 0.5 * 5.670374419e-8 * 4.0 * np.pi
    engine.step(t, 0.0)
    exact = (1e-9 + 3.0 * coefficient * t) ** (-1.0 / 3.0)
    assert temperatures(engine)[0] == pytest.approx(exact, rel=1e-6)


def radiating_grain(start, wall, *, surroundings=None, **settings):
    """A grain of 0.1 mm that hangs over a floor and radiates at it; emissivity 0.8, no contact."""
    model = warm_model([RADIUS], start, FLOOR, density=7500.0)
    conditions = [WallHeat() if wall is None else at_temperature(wall)]
    radiation = Radiation(surroundings, reach=0.0 if wall is None else 0.4)
    laws = make_heat_laws(emissivity=0.8)
    return heat_engine(
        model, [[0.0, 1.1 * RADIUS]], conditions=conditions, laws=laws, mechanisms=(radiation,),
        **settings,
    )  # fmt: skip


def cooled(start, sink, rate, t):
    """T after t of dT/dt = rate (sink⁴ − T⁴), by the closed form for the time to reach T."""

    def primitive(x):
        logarithm = np.log((x + sink) / abs(x - sink))
        return (0.5 * logarithm + np.arctan(x / sink)) / (2.0 * sink**3)

    def time_to(temperature):
        return (primitive(temperature) - primitive(start)) / rate

    low, high = sink * (1.0 + 1e-14), start
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if time_to(middle) > t else (low, middle)
    return 0.5 * (low + high)


@pytest.mark.parametrize("start", [1500.0, 3000.0])
@pytest.mark.parametrize("dt", [10.0, 100.0, 1e4])
def test_a_hot_grain_cools_to_a_wall_however_long_the_step(start, dt):
    """Radiation is stiff if the grain is far hotter: stages must be solved, or the step refused."""
    engine = radiating_grain(start, 300.0)
    engine.step(dt, 0.0)
    capacity = engine.model.thermal.capacity[0]
    rate = STEFAN_BOLTZMANN * np.pi * RADIUS**2 / (2.0 / 0.8 - 1.0) / capacity
    exact = cooled(start, 300.0, rate, dt)
    assert temperatures(engine)[0] == pytest.approx(exact, abs=2e-3 * (start - 300.0))


@pytest.mark.parametrize(("wall", "surroundings"), [(3000.0, None), (None, 3000.0)])
def test_explicit_steps_stay_in_range_while_radiation_heats(wall, surroundings):
    """ΣH grows 4-fold (wall) or 1000-fold (surroundings) on the way from 300 K to 3000 K."""
    engine = radiating_grain(300.0, wall, surroundings=surroundings, integrator="explicit")
    for _ in range(20):
        assert 300.0 <= advanced(engine, 0.3)[0] <= 3000.0 * (1.0 + 1e-12)


def test_convection_of_one_grain():
    """T_f − T decays with C/(h A)."""
    model, mechanisms = warm_model(capacity=8.0 * np.pi), (Ambient(400.0, coefficient=2.0),)
    engine = heat_engine(model, CENTER, mechanisms=mechanisms, tolerance=1e-8)
    engine.step(1.0, 0.0)
    assert temperatures(engine)[0] == pytest.approx(400.0 - 100.0 * np.exp(-1.0), rel=1e-6)
    assert heat_book(engine.state, "from_ambient") == pytest.approx(engine.state.heat[0], rel=1e-14)


def test_a_contact_conducts_however_short_the_reach_of_the_gas():
    """A grain that lands within the step has a gap at q_m wider than the reach, and a force."""
    model = warm_model(shapes=FLOOR)
    given = []
    for gas in ((), (Gas(1e-6, reach=1e-3),)):
        engine = coupled_engine(
            model, [[0.0, 1.02]], [[0.0, -4.0, 0.0]], [at_temperature(400.0)], mechanisms=gas
        )
        engine.step(5e-3, 0.0)
        given.append(engine.state.wall_heat[0, 0])
    assert given[0] > 0.0
    assert given[1] == pytest.approx(given[0], rel=1e-3)


def test_gas_under_a_moving_wall_fills_the_gap_of_the_middle_of_the_step():
    model = warm_model(shapes=FLOOR, gravity=(0.0, 0.0))
    drives = [WallDrive(y=DofDrive(velocity=Constant(1.0)))]
    engine = coupled_engine(
        model, [[0.0, 1.2]], None, [at_temperature(400.0)], drives=drives, mechanisms=(Gas(0.026),)
    )
    engine.state.wall_velocity[0, 1] = 1.0
    engine.step(0.1, 0.0)
    expected = 0.1 * 100.0 * parallel_conductance_wall(0.026, 1.0, 0.0, 0.15)
    assert engine.state.wall_heat[0, 0] == pytest.approx(expected, rel=1e-3)


def conductance_of_a_pair(**choices):
    """Across the gap of two touching grains of 1.5 mm in air [W/K], and the largest Biot number."""
    model = warm_model([1.5e-3] * 2, [300.0, 400.0], density=7500.0)
    engine = heat_engine(model, chain(2, 1.5e-3), mechanisms=(Gas(0.026),), **choices)
    engine.step(1e-6, 0.0)
    return engine.state.heat[0] / 1e-6 / 100.0, heat_book(engine.state, "max_biot")


def test_gas_counts_in_the_biot_number_and_less_under_pressure():
    """The solid's resistance bounds what passes a contact without force (3.45·10⁻³ W/K)."""
    whole, _ = conductance_of_a_pair(conduction="none")
    assert whole == pytest.approx(batchelor_conductance(0.026, 15.0, 0.75e-3, 0.0, 0.0), rel=0.05)
    # Bi of the contact alone is 0.002, but contact and gas together exceed λ a
    laws = make_heat_laws(conductivity=0.2, density=2500.0, capacity=800.0)
    whole, biot = conductance_of_a_pair(laws=laws, force=ContactForce("prescribed", 1e-3))
    assert biot == pytest.approx(whole / (0.2 * 1.5e-3), rel=1e-3)


def test_frozen_grains_stand_still_in_the_fluid():
    """Nu = 2, whatever velocity they will have when they move on."""
    model = warm_model([1e-3], gravity=(0.0, 0.0), density=7500.0)
    ambient = Ambient(
        400.0, correlation="ranz-marshall", conductivity=0.026, viscosity=1.6e-5, prandtl=0.7
    )
    engine = coupled_engine(model, CENTER, [[5.0, 0.0, 0.0]], mechanisms=(ambient,))
    resume(engine, is_frozen=True)
    engine.step(1e-3, 0.0)
    expected = 1e-3 * 100.0 * 0.026 / 1e-3 * model.thermal.surface[0]
    assert engine.state.heat[0] == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("integrator", ["explicit", "implicit"])
def test_mechanisms_of_one_kind_add_up(integrator):
    """Two fluids are one of mean temperature; emissivities 0.5 and 0.8 give 1/3, 2/3 of black."""
    near = Radiation(reach=0.4)
    mean, *fluids = (Ambient(t, coefficient=c) for t, c in ((350, 4.0), (400, 2.0), (300, 2.0)))
    several, single = (
        touching_engine(
            chain(2), [300.0, 900.0], emissivity=emissivity, mechanisms=mechanisms,
            conduction="none", integrator=integrator, tolerance=1e-9,
        )
        for emissivity, mechanisms in ((0.5, (*fluids, near, near)), (0.8, (mean, near)))
    )  # fmt: skip
    for engine in (several, single):
        advanced(engine, 5e-3, 5)
    assert several.state.heat == pytest.approx(single.state.heat, rel=1e-6)  # sub-steps differ
    assert several.state.heat[0] > 1.0
    assert heat_book(several.state, "from_ambient") == pytest.approx(
        several.state.heat.sum(), rel=1e-10
    )
    assert heat_book(several.state, "closure") < 1e-13
