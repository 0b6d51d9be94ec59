"""Initial temperatures, heat capacities and surfaces of grains, and softening of friction."""

import math

import numpy as np
import pytest
from packing_support import SECOND, scenario, wall
from scenes import PACKED, changed

from multicor_cli.packing import build
from multicor_cli.packing.file import read_temperatures
from multicor_cli.packing.initial_grains import InitialGrains
from multicor_cli.scenario import Refused, ScenarioError

HOT = (
    'heat={conduction="none", friction="none"}',
    "materials.glass.heat_capacity=800.0",
    "particles.0.count=50",
)


def built(*overrides, extra="", path="test.toml"):
    return build(scenario(*HOT, *overrides, extra=extra, path=path))


def refusal(*overrides, extra="", path="test.toml"):
    with pytest.raises(ScenarioError) as caught:
        built(*overrides, extra=extra, path=path)
    (problem,) = caught.value.problems
    return problem


def test_without_heat_there_are_no_temperatures():
    model, state = build(scenario("particles.0.count=50"))
    assert model.thermal is None
    assert not model.laws.depends_on_temperature
    assert state.heat.size == 0


def test_capacities_surfaces_and_states_of_discs():
    model, state = built(
        "materials.steel.heat_capacity=500.0", "particles.1.temperature=400", extra=SECOND
    )
    thermal, grains = model.thermal, model.grains
    np.testing.assert_allclose(
        thermal.capacity, grains.mass * np.repeat([800.0, 500.0], [50, 100]), rtol=1e-14
    )
    thickness = np.repeat([2e-3, 1e-3], [50, 100])
    np.testing.assert_allclose(thermal.surface, 2 * np.pi * grains.radius * thickness, rtol=1e-14)
    np.testing.assert_array_equal(
        thermal.initial_temperature, np.repeat([293.15, 400.0], [50, 100])
    )
    np.testing.assert_array_equal(state.temperature(thermal), thermal.initial_temperature)


def test_surfaces_of_spheres():
    text = changed(PACKED, ("thickness = 2e-3\n", ""), ('"disc"', '"sphere"'))
    model, _ = build(scenario(*HOT, text=text))
    np.testing.assert_allclose(
        model.thermal.surface, 4 * np.pi * model.grains.radius**2, rtol=1e-14
    )


def test_the_temperature_of_the_heat_table_is_the_default():
    model, _ = built("heat.temperature=350.0")
    assert np.all(model.thermal.initial_temperature == 350.0)


def test_gradient():
    model, state = built(
        "particles.0.temperature={value=300, gradient=[100, -200], at=[0.03, 0.04]}"
    )
    x, y = state.position[:, 0], state.position[:, 1]
    np.testing.assert_allclose(
        model.thermal.initial_temperature, 300 + 100 * (x - 0.03) - 200 * (y - 0.04), rtol=1e-13
    )


def test_gradient_over_a_period_takes_the_wrapped_place():
    packing = "particles.0.region={min=[0.0, 0.0], max=[0.06, 0.08]}"
    model, state = built(
        "domain.periodic=true", packing, "particles.0.temperature={value=300, gradient=[1000, 0]}"
    )
    np.testing.assert_allclose(
        model.thermal.initial_temperature, 300 + 1000 * state.position[:, 0], rtol=1e-13
    )


def test_gradient_to_below_absolute_zero_names_a_grain():
    problem = refusal("particles.0.temperature={value=300, gradient=[0, -1e6]}")
    assert problem.key == "particles.0.temperature.gradient"
    assert "the grain 0 of the group at (" in problem.message
    assert problem.remedy


def test_later_regions_win():
    left, low = (
        "{min=[0, 0], max=[0.03, 0.08], value=400}",
        "{min=[0, 0], max=[0.06, 0.04], value=500}",
    )
    model, state = built(f"particles.0.temperature={{value=300, regions=[{left}, {low}]}}")
    x, y = state.position[:, 0], state.position[:, 1]
    np.testing.assert_array_equal(
        model.thermal.initial_temperature,
        np.where(y <= 0.04, 500.0, np.where(x <= 0.03, 400.0, 300.0)),
    )
    assert len(set(model.thermal.initial_temperature)) == 3


def test_regions_of_any_kind_have_temperatures():
    ring = '{kind="annulus", center=[0.03, 0.04], inner=0.01, outer=0.03, value=400}'
    roof = '{kind="polygon", points=[[0.0, 0.06], [0.06, 0.06], [0.03, 0.08]], value=450}'
    spot = '{kind="circle", center=[0.03, 0.04], radius=0.01, value=500}'
    model, state = built(
        f"particles.0.temperature={{value=300, regions=[{ring}, {roof}, {spot}]}}",
        "particles.0.count=150",
    )
    x, y = state.position[:, 0] - 0.03, state.position[:, 1] - 0.04
    away = np.hypot(x, y)
    expected = np.where(away <= 0.03, 400.0, 300.0)
    expected[(y >= 0.02) & (np.abs(x) <= 1.5 * (0.04 - y))] = 450.0
    expected[away <= 0.01] = 500.0
    np.testing.assert_array_equal(model.thermal.initial_temperature, expected)
    assert len(set(expected)) == 4


def test_one_value_per_grain():
    values = [300.0 + k for k in range(50)]
    model, _ = built(f"particles.0.temperature={{values={values}}}")
    np.testing.assert_array_equal(model.thermal.initial_temperature, values)
    problem = refusal("particles.0.temperature={values=[300, 301]}")
    assert problem.key == "particles.0.temperature.values"
    assert "2 temperatures are given for 50 grains" in problem.message


def test_values_from_a_file(tmp_path):
    values = [300.0 + 0.5 * k for k in range(50)]
    file = tmp_path / "T.csv"
    file.write_text(
        "\ufeff# temperatures\n\n" + "\n".join(f" {value} # K" for value in values),
        encoding="utf-8",
    )
    where = str(tmp_path / "test.toml")
    model, _ = built('particles.0.temperature={file="T.csv"}', path=where)
    np.testing.assert_array_equal(model.thermal.initial_temperature, values)
    file.write_text("300\n301")
    problem = refusal('particles.0.temperature={file="T.csv"}', path=where)
    assert problem.key == "particles.0.temperature.file"
    assert "2 temperatures are in" in problem.message
    assert "for 50 grains" in problem.message


BAD_FILES = {
    "word": ("300\n\nhot\n", "line 3: 'hot' is not a number"),
    "columns": ("300,301\n", "line 1: '300,301' is not a number"),
    "celsius": (
        "300\n20\n-5\n",
        "line 3: temperature = -5 K is not between 1 and 100000 K (from degrees Celsius: 268.15)",
    ),
    "not finite": ("nan\n", "line 1: temperature = nan is not finite"),
    "too hot": ("1e6\n", "line 1: temperature = 1e+06 K is not between"),
    "long line": ("300" + " " * 5000 + "x\n300\n0.5\n", "line 3: temperature = 0.5 K is not"),
    "many": ("x\n" * 100, "line 5: 'x' is not a number; and more"),
}


@pytest.mark.parametrize("case", BAD_FILES)
def test_bad_files_are_refused_with_their_lines(tmp_path, case):
    text, words = BAD_FILES[case]
    (tmp_path / "T.csv").write_text(text)
    with pytest.raises(Refused) as caught:
        read_temperatures(tmp_path / "T.csv")
    assert words in caught.value.what
    assert caught.value.where == ("temperature", "file")


def test_unreadable_files(tmp_path):
    with pytest.raises(Refused, match="there is no file"):
        read_temperatures(tmp_path / "T.csv")
    with pytest.raises(Refused, match="it is a directory"):
        read_temperatures(tmp_path)
    (tmp_path / "T.csv").write_bytes(b"300\n\xff\xfe")
    with pytest.raises(Refused, match="cannot be read"):
        read_temperatures(tmp_path / "T.csv")


def test_an_empty_file_has_no_temperatures(tmp_path):
    (tmp_path / "T.csv").write_text("\n# nothing\n")
    assert read_temperatures(tmp_path / "T.csv").size == 0


@pytest.fixture
def brought(monkeypatch):
    """Makes the packing bring what it is given."""

    def bring(temperature):
        radius = np.array([1e-3, 1e-3])
        grains = InitialGrains.at_rest(radius, np.array([[0.01, 0.01], [0.02, 0.01]]))
        given = InitialGrains(radius, grains.position, grains.velocity, temperature)
        monkeypatch.setattr("multicor_cli.packing.groups.read_frame", lambda *_: given)
        text = changed(
            PACKED, ('sizes = { kind = "uniform", min = 0.8e-3, max = 1.2e-3 }\ncount = 200\n', "")
        )
        heat = [override for override in HOT if "count" not in override]
        run = 'particles.0.packing={kind="run", path="run"}'
        return lambda *overrides: (
            build(scenario(*heat, run, *overrides, text=text))[0].thermal.initial_temperature
        )

    return bring


def test_a_run_brings_its_temperatures(brought):
    start = brought(np.array([310.0, 320.0]))
    assert start().tolist() == [310.0, 320.0]
    assert start("particles.0.temperature=400").tolist() == [400.0, 400.0]
    assert brought(None)().tolist() == [293.15, 293.15]


def test_gas_for_equal_grains_is_refused_for_unequal_ones_from_a_run(monkeypatch, brought):
    start = brought(None)
    gas = (
        'heat.gas={conductivity=0.026, model="vargas"}',
        "materials.glass.conductivity=1",
        "materials.glass.young=7e10",
    )
    assert start(*gas, "materials.glass.poisson=0.2").size == 2
    grains = InitialGrains.at_rest(np.array([1e-3, 1.2e-3]), np.array([[0.01, 0.01], [0.02, 0.01]]))
    monkeypatch.setattr("multicor_cli.packing.groups.read_frame", lambda *_: grains)
    with pytest.raises(ScenarioError, match=r"heat\.gas\.model.*0\.001 to 0\.0012 m"):
        start(*gas, "materials.glass.poisson=0.2")


def test_softening_of_pairs():
    floor = wall("floor", 'kind = "plane", point = [0.0, 0.0], normal = [0.0, 1.0]')
    pair = (
        '\n[[contacts]]\npair = ["glass", "steel"]\n'
        "friction = { speed = [0, 1], values = [0.5, 0.1], "
    )
    soft = "softening = 2e-3, reference = 300, min = 0.05, max = 0.6 }\n"
    laws = built(extra=floor + pair + soft)[0].laws
    assert laws.friction[0, 0] == 0.4
    assert laws.table.tolist() == [[-1, 0], [0, -1]]
    assert laws.softening_rate.tolist() == [[0.0, 2e-3], [2e-3, 0.0]]
    assert (
        laws.softening_start[0, 1],
        laws.softening_lowest[1, 0],
        laws.softening_highest[0, 1],
    ) == (300.0, 0.05, 0.6)
    assert (laws.softening_lowest[0, 0], laws.softening_highest[0, 0]) == (0.0, 10.0)
    number = built("contacts.0.friction={value=0.3, softening=1e-3}")[0].laws
    assert (number.friction[0, 0], number.softening_rate[0, 0], number.softening_start[0, 0]) == (
        0.3,
        1e-3,
        293.15,
    )


def test_compaction_takes_the_friction_at_the_reference_temperature():
    compact = 'particles.0.packing={kind="compacted", pressure=50.0, kinetic_energy_ratio=1e-3}'
    small = (compact, "domain.periodic=true", "particles.0.count=60", "domain.size=[0.02, 0.03]")
    plain, soft = (
        built(*small, f"contacts.0.friction={mu}")[1]
        for mu in ("0.3", "{value=0.3, softening=1e-3}")
    )
    np.testing.assert_array_equal(plain.position, soft.position)
    assert math.isfinite(plain.position.sum())
