"""Initial temperatures, heat capacities and surfaces of grains, and softening of friction."""

import math
from functools import partial

import numpy as np
import packing_support
import pytest
from packing_support import PERIODIC, SECOND, problems, wall
from scenes import PACKED, changed

from multicor_cli.packing.file import read_temperatures
from multicor_cli.packing.initial_grains import InitialGrains
from multicor_cli.scenario import Refused, ScenarioError

HEAT = ('heat={conduction="none", friction="none"}', "materials.glass.heat_capacity=800.0")
HOT = (*HEAT, "particles.0.count=50")
built = partial(packing_support.built, *HOT)


def refusal(*overrides, **given):
    (problem,) = problems(*HOT, *overrides, **given)
    return problem


def test_without_heat_there_are_no_temperatures():
    model, state = packing_support.built("particles.0.count=50")
    assert model.thermal is None
    assert not model.laws.depends_on_temperature
    assert state.heat.size == 0


def test_capacities_surfaces_and_states():
    steel = "materials.steel.heat_capacity=500.0"
    model, state = built(steel, "particles.1.temperature=400", extra=SECOND)
    thermal, grains = model.thermal, model.grains
    capacity = grains.mass * np.repeat([800.0, 500.0], [50, 100])
    np.testing.assert_allclose(thermal.capacity, capacity, rtol=1e-14)
    thickness = np.repeat([2e-3, 1e-3], [50, 100])
    np.testing.assert_allclose(thermal.surface, 2 * np.pi * grains.radius * thickness, rtol=1e-14)
    start = np.repeat([293.15, 400.0], [50, 100])
    np.testing.assert_array_equal(thermal.initial_temperature, start)
    np.testing.assert_array_equal(state.temperature(thermal), start)
    text = changed(PACKED, ("thickness = 2e-3\n", ""), ('"disc"', '"sphere"'))
    spheres, _ = built("heat.temperature=350.0", text=text)
    surface = 4 * np.pi * spheres.grains.radius**2
    np.testing.assert_allclose(spheres.thermal.surface, surface, rtol=1e-14)
    assert np.all(spheres.thermal.initial_temperature == 350.0)


def regions(x, y):
    expected = np.where(np.hypot(x, y) <= 0.03, 400.0, 300.0)
    expected[(y >= 0.02) & (np.abs(x) <= 1.5 * (0.04 - y))] = 450.0
    expected[np.hypot(x, y) <= 0.01] = 500.0
    return expected


LEFT = "{min=[0, 0], max=[0.03, 0.08], value=400}"
LOW = "{min=[0, 0], max=[0.06, 0.04], value=500}"
RING = '{kind="annulus", center=[0.03, 0.04], inner=0.01, outer=0.03, value=400}'
ROOF = '{kind="polygon", points=[[0.0, 0.06], [0.06, 0.06], [0.03, 0.08]], value=450}'
SPOT = '{kind="circle", center=[0.03, 0.04], radius=0.01, value=500}'
FULL = "particles.0.region={min=[0.0, 0.0], max=[0.06, 0.08]}"
# the temperature, other overrides, what it is at x, y from the middle, how many levels at least
FIELDS = {
    "gradient": (
        "{value=300, gradient=[100, -200], at=[0.03, 0.04]}",
        (),
        lambda x, y: 300 + 100 * x - 200 * y,
        50,
    ),
    "gradient at wrapped places": (
        "{value=300, gradient=[1000, 0]}",
        (PERIODIC, FULL),
        lambda x, y: 330 + 1000 * x,
        50,
    ),
    "later regions win": (
        f"{{value=300, regions=[{LEFT}, {LOW}]}}",
        (),
        lambda x, y: np.where(y <= 0, 500.0, np.where(x <= 0, 400.0, 300.0)),
        3,
    ),
    "regions of any kind": (f"{{value=300, regions=[{RING}, {ROOF}, {SPOT}]}}",
        ("particles.0.count=150",), regions, 4),
}  # fmt: skip


@pytest.mark.parametrize("name", FIELDS)
def test_temperatures_in_space(name):
    table, overrides, expected, levels = FIELDS[name]
    model, state = built(f"particles.0.temperature={table}", *overrides)
    x, y = state.position[:, 0] - 0.03, state.position[:, 1] - 0.04
    start = model.thermal.initial_temperature
    np.testing.assert_allclose(start, expected(x, y), rtol=1e-13)
    assert len(set(start)) >= levels


def test_gradient_to_below_absolute_zero_names_a_grain():
    problem = refusal("particles.0.temperature={value=300, gradient=[0, -1e6]}")
    assert problem.key == "particles.0.temperature.gradient"
    assert "the grain 0 of the group at (" in problem.message
    assert problem.remedy


def test_one_value_per_grain_given_or_from_a_file(tmp_path):
    values = [300.0 + 0.5 * k for k in range(50)]
    model, _ = built(f"particles.0.temperature={{values={values}}}")
    np.testing.assert_array_equal(model.thermal.initial_temperature, values)
    problem = refusal("particles.0.temperature={values=[300, 301]}")
    assert problem.key == "particles.0.temperature.values"
    assert "2 temperatures are given for 50 grains" in problem.message
    file, from_file = tmp_path / "T.csv", 'particles.0.temperature={file="T.csv"}'
    text = "\ufeff# temperatures\n\n" + "\n".join(f" {value} # K" for value in values)
    file.write_text(text, encoding="utf-8")
    model, _ = built(from_file, path=tmp_path / "test.toml")
    np.testing.assert_array_equal(model.thermal.initial_temperature, values)
    file.write_text("300\n301")
    problem = refusal(from_file, path=tmp_path / "test.toml")
    assert problem.key == "particles.0.temperature.file"
    assert f"2 temperatures are in '{file}' for 50 grains" in problem.message


BAD_FILES = {
    "word": ("300\n\nhot\n", "line 3: 'hot' is not a number"),
    "columns": ("300,301\n", "line 1: '300,301' is not a number"),
    "celsius": ("300\n20\n-5\n",
        "line 3: temperature = -5 K is not between 1 and 100000 K (from degrees Celsius: 268.15)"),
    "not finite": ("nan\n", "line 1: temperature = nan is not finite"),
    "too hot": ("1e6\n", "line 1: temperature = 1e+06 K is not between"),
    "long line": ("300" + " " * 5000 + "x\n300\n0.5\n", "line 3: temperature = 0.5 K is not"),
    "many": ("x\n" * 100, "line 5: 'x' is not a number; and more"),
    "no text": (b"300\n\xff\xfe", "cannot be read"),
    "no file": (None, "there is no file"),
    "directory": ("a directory", "it is a directory"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD_FILES)
def test_bad_files_are_refused_with_their_lines(tmp_path, case):
    text, words = BAD_FILES[case]
    path = tmp_path / "T.csv"
    if case == "directory":
        path.mkdir()
    elif text is not None:
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(Refused) as caught:
        read_temperatures(path)
    assert words in caught.value.what
    assert caught.value.where == ("temperature", "file")


def test_an_empty_file_has_no_temperatures(tmp_path):
    (tmp_path / "T.csv").write_text("\n# nothing\n")
    assert read_temperatures(tmp_path / "T.csv").size == 0


@pytest.fixture
def brought(monkeypatch):
    """Initial temperatures where the packing brings what it is given."""

    def bring(*overrides, temperature=None, radius=(1e-3, 1e-3)):
        grains = InitialGrains.at_rest(np.array(radius), np.array([[0.01, 0.01], [0.02, 0.01]]))
        given = InitialGrains(grains.radius, grains.position, grains.velocity, temperature)
        monkeypatch.setattr("multicor_cli.packing.groups.read_frame", lambda *_: given)
        sizes = 'sizes = { kind = "uniform", min = 0.8e-3, max = 1.2e-3 }\ncount = 200\n'
        run = 'particles.0.packing={kind="run", path="run"}'
        text = changed(PACKED, (sizes, ""))
        model, _ = packing_support.built(*HEAT, run, *overrides, text=text)
        return model.thermal.initial_temperature.tolist()

    return bring


def test_a_run_brings_its_temperatures(brought):
    given = np.array([310.0, 320.0])
    assert brought(temperature=given) == [310.0, 320.0]
    assert brought("particles.0.temperature=400", temperature=given) == [400.0, 400.0]
    assert brought() == [293.15, 293.15]


def test_gas_for_equal_grains_is_refused_for_unequal_ones_from_a_run(brought):
    glass = ("conductivity=1", "young=7e10", "poisson=0.2")
    gas = 'heat.gas={conductivity=0.026, model="vargas"}'
    overrides = (gas, *(f"materials.glass.{key}" for key in glass))
    assert len(brought(*overrides)) == 2
    with pytest.raises(ScenarioError, match=r"heat\.gas\.model.*0\.001 to 0\.0012 m"):
        brought(*overrides, radius=(1e-3, 1.2e-3))


def softening(laws, a, b):
    rows = laws.softening_rate, laws.softening_start, laws.softening_lowest, laws.softening_highest
    return tuple(table[a, b] for table in rows)


def test_softening_of_pairs():
    floor = wall("floor", 'kind = "plane", point = [0.0, 0.0], normal = [0.0, 1.0]')
    pair = '\n[[contacts]]\npair = ["glass", "steel"]\nfriction = { speed = [0, 1], values = [0.5, 0.1], '
    soft = "softening = 2e-3, reference = 300, min = 0.05, max = 0.6 }\n"
    laws = built(extra=floor + pair + soft)[0].laws
    assert laws.friction[0, 0] == 0.4
    assert laws.table.tolist() == [[-1, 0], [0, -1]]
    assert softening(laws, 0, 1) == softening(laws, 1, 0) == (2e-3, 300.0, 0.05, 0.6)
    assert softening(laws, 0, 0)[::2] == softening(laws, 1, 1)[::2] == (0.0, 0.0)
    assert softening(laws, 0, 0)[3] == 10.0
    number = built("contacts.0.friction={value=0.3, softening=1e-3}")[0].laws
    assert number.friction[0, 0] == 0.3
    assert softening(number, 0, 0)[:2] == (1e-3, 293.15)


def test_compaction_takes_the_friction_at_the_reference_temperature():
    compact = 'particles.0.packing={kind="compacted", pressure=50.0, kinetic_energy_ratio=1e-3}'
    small = (compact, PERIODIC, "particles.0.count=60", "domain.size=[0.02, 0.03]")
    plain, soft = (
        built(*small, f"contacts.0.friction={mu}")[1].position
        for mu in ("0.3", "{value=0.3, softening=1e-3}")
    )
    np.testing.assert_array_equal(plain, soft)
    assert math.isfinite(plain.sum())
