"""From thermal keys to the choices of the heat engine and the thermal conditions of walls."""

import math
from dataclasses import fields
from typing import get_args

import numpy as np
import pytest
from packing_support import scenario as cold_scenario
from scenes import HEATED, SHEAR, WARM, changed

from multicor_cli.engine.heat.convection import Ambient
from multicor_cli.engine.heat.gas import Gas
from multicor_cli.engine.heat.radiation import Radiation
from multicor_cli.engine.heat.settings import MECHANISMS, ContactForce, HeatSettings
from multicor_cli.engine.heat.walls import WallHeat
from multicor_cli.engine.motion.drives import Constant, Ramp, Shifted, Sine
from multicor_cli.engine.orders import Settings
from multicor_cli.packing import build
from multicor_cli.running.from_scenario import heat_laws_of, heat_settings, make_plan, wall_heat
from multicor_cli.scenario import ScenarioError, parse_scenario
from multicor_cli.scenario.heat import Heat, MechanismTable
from multicor_cli.scenario.settings import Solver

GLASS, STEEL, SPARE = range(3)
NAMES = ("glass", "steel", "spare")


@pytest.fixture(scope="module")
def heated():
    scenario = parse_scenario(HEATED, "heated.toml")
    return scenario, build(scenario)[0]


def laws_of(*overrides, names=NAMES):
    return heat_laws_of(parse_scenario(HEATED, "heated.toml", overrides), names)


def test_a_scenario_without_heat_has_no_settings():
    scenario = cold_scenario("particles.0.count=10")
    assert heat_settings(scenario, build(scenario)[0]) is None
    with pytest.raises(ValueError, match="no heat laws"):
        heat_laws_of(scenario, ("glass",))


def test_choices_are_handed_on(heated):
    settings = heat_settings(*heated)
    assert (settings.conduction, settings.friction) == ("hertz", "energy")
    assert settings.impact is settings.collisional is False
    assert settings.force == ContactForce("average", 0.01)
    gas, ambient, radiation = settings.mechanisms
    assert gas == Gas(0.026, "batchelor", 0.4)
    assert radiation == Radiation(293.15, 0.4)
    of_air = {"conductivity": 0.026, "viscosity": 1.5e-5, "prandtl": 0.7, "porosity": 0.4}
    assert ambient == Ambient(290.0, correlation="gunn", coefficient=0.0, **of_air)
    assert (settings.integrator, settings.sub_step, settings.tolerance) == ("auto", 1.0, 1e-4)


def test_other_choices(heated):
    table = (
        'conduction="rough", force={prescribed=2.0}, friction="sliding", impact=true, '
        'collisional=true, integrator="explicit", '
        "sub_step=0.5, tolerance=1e-6, ambient={temperature=280, coefficient=12}, "
        "radiation={surroundings=300}"
    )
    settings, plain = (
        heat_settings(parse_scenario(HEATED, "heated.toml", [f"heat={{{keys}}}"]), heated[1])
        for keys in (table, "")
    )
    assert (settings.conduction, settings.friction) == ("rough", "sliding")
    assert settings.impact is settings.collisional is True
    assert settings.force == ContactForce("prescribed", 2.0)
    assert settings.mechanisms == (Ambient(280.0, coefficient=12.0), Radiation(300.0))
    assert (settings.integrator, settings.sub_step, settings.tolerance) == ("explicit", 0.5, 1e-6)
    assert plain.force == ContactForce()
    assert plain.mechanisms == ()


def test_the_tables_of_mechanisms_are_the_records_of_the_engine():
    """A record is filled from the keys of its table by their names, so that every choice must be a
    key."""
    tables = {
        key: _tables(field.annotation)
        for key, field in Heat.model_fields.items()
        if _tables(field.annotation)
    }
    assert tables.keys() == MECHANISMS.keys()
    for key, record in MECHANISMS.items():
        keys = {name for table in tables[key] for name in table.model_fields}
        assert {field.name for field in fields(record)} <= keys, key


def test_defaults_of_keys_are_those_of_the_engine():
    assert Heat().as_record(HeatSettings, laws=None) == HeatSettings(None)
    assert Solver().as_record(Settings) == Settings()


def _tables(annotation):
    """Tables of mechanisms in a type."""
    if isinstance(annotation, type) and issubclass(annotation, MechanismTable):
        return [annotation]
    return [table for part in get_args(annotation) for table in _tables(part)]


def test_laws_of_materials_and_pairs():
    laws = laws_of()
    np.testing.assert_array_equal(laws.conductivity, [1.0, 15.0, 0.0])
    np.testing.assert_array_equal(laws.volumetric, [2500.0 * 800.0, 7800.0 * 500.0, 0.0])
    np.testing.assert_array_equal(laws.emissivity, [0.9, 0.3, 0.0])
    of_glass, of_steel = (1 - 0.2**2) / 70e9, (1 - 0.29**2) / 193e9
    for found, expected in (
        (laws.modulus[GLASS, STEEL], 1.0 / (of_glass + of_steel)),
        (laws.modulus[GLASS, GLASS], 0.5 / of_glass),
        (laws.harmonic[GLASS, STEEL], 2.0 * 15.0 / 16.0),
        (laws.harmonic[STEEL, STEEL], 15.0),
        (laws.roughness[GLASS, STEEL], 5e-7),
        (laws.roughness[GLASS, GLASS], 3e-7 * math.sqrt(2.0)),
        (laws.slope[GLASS, STEEL], math.sqrt(0.05)),
        (laws.microhardness[GLASS, STEEL], 4e9),
    ):
        assert found == pytest.approx(expected, rel=1e-14)
    for table in (laws.modulus, laws.harmonic, laws.roughness, laws.slope, laws.microhardness):
        np.testing.assert_array_equal(table, table.T)


def test_wear_belongs_to_pairs_and_what_is_not_given_does_no_harm():
    laws = laws_of()
    assert laws.modulus[SPARE, GLASS] == laws.microhardness[SPARE, SPARE] == 1.0
    assert laws.harmonic[SPARE, STEEL] == laws.roughness[GLASS, SPARE] == 0.0
    assert laws.wear[SPARE, GLASS] == 0.0
    assert laws.share[SPARE, GLASS] == 0.5
    wear = laws_of().wear
    assert wear[GLASS, STEEL] == 1e-4 / 5e9
    assert wear[STEEL, GLASS] == 1e-4 / 2e9
    assert wear[GLASS, GLASS] == wear[STEEL, STEEL] == 0.0


@pytest.mark.parametrize(("partition", "share"), [
    ("effusivity", 1.0 / (1.0 + math.sqrt(15.0 * 7800.0 * 500.0 / (2500.0 * 800.0)))),
    ("conductivity", 1.0 / 16.0),
    ("half", 0.5),
    ("electrothermal", 0.5 * (1e10 / (1e10 + 7e-7) + 1.0 / 16.0)),
])  # fmt: skip
def test_shares_of_the_first_body(partition, share):
    shares = laws_of(f"heat.partition={partition}").share
    assert shares[GLASS, STEEL] == pytest.approx(share, rel=1e-13)
    np.testing.assert_array_equal(shares + shares.T, np.ones((3, 3)))
    np.testing.assert_array_equal(np.diag(shares), [0.5] * 3)


def test_materials_come_in_the_order_asked_for():
    laws = laws_of(names=("steel", "glass"))
    np.testing.assert_array_equal(laws.conductivity, [15.0, 1.0])
    assert laws.wear[0, 1] == 1e-4 / 2e9


RAMP, WAVE = Ramp(300.0, 350.0, 2.0), Sine(1.0, 2.0, 60.0, 0.0)


def test_conditions_of_walls_are_kept_until_named_again(heated):
    """And signals go on."""
    fall, soak, stir = wall_heat(heated[0], ("floor", "lid"))
    ramp, wave = WallHeat("temperature", RAMP), WallHeat("flow", WAVE)
    assert [stage.walls for stage in (fall, soak, stir)] == [
        (ramp, WallHeat()), (ramp, wave), (WallHeat(), wave),
    ]  # fmt: skip
    assert (fall.named_by, soak.named_by, stir.named_by) == ((0, 0), (0, 1), (2, 1))
    starts = [0.0, 0.5, 1800.5]
    assert fall.started(starts[:1]) == list(fall.walls)
    floor, lid = soak.started(starts[:2])
    assert (floor, lid) == (WallHeat("temperature", Shifted(RAMP, 0.5)), wave)
    assert floor.signal.value(0.5) == RAMP.value(1.0) == 325.0
    assert stir.started(starts) == [WallHeat(), WallHeat("flow", Shifted(WAVE, 1800.0))]


def test_a_signal_named_again_starts_anew():
    floor = "{temperature={ramp=[300.0, 350.0], duration=2.0}}"
    again = [f"loading.2.thermal={{floor={floor}, lid={{flow=3}}}}"]
    stir = wall_heat(parse_scenario(HEATED, "heated.toml", again), ("floor", "lid"))[2]
    named = [WallHeat("temperature", RAMP), WallHeat("flow", Constant(3.0))]
    assert stir.started([0.0, 1.0, 1801.0]) == named


def test_walls_come_in_the_order_asked_for_and_are_insulated_at_first(heated):
    lid, floor = wall_heat(heated[0], ("lid", "floor"))[0].walls
    assert (lid.kind, floor.kind) == ("insulated", "temperature")
    cold = wall_heat(parse_scenario(SHEAR, "shear.toml"), ("bottom", "top", "paddle"))
    assert all(stage.walls == (WallHeat(),) * 3 for stage in cold)


def test_heat_that_oscillates_too_often_in_a_step_is_refused():
    """Each period is followed in 16 pieces: a list of 10¹⁰ of them would fill the memory."""
    scenario = parse_scenario(changed(WARM, ("period = 0.05", "period = 1e-12")), "warm.toml")
    with pytest.raises(
        ScenarioError,
        match=r"wall 'floor' oscillates 5e\+08 times within one step of 0.0005 s; use a shorter dt",
    ):
        make_plan(scenario, build(scenario)[0])
