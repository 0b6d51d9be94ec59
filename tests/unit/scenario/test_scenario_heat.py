"""Thermal keys of a scenario: what they may say, what is refused and how, and that nothing is
accepted and ignored."""

import pytest
from scenario_problems import check_one, problems_of
from scenes import HEATED, SHEAR, changed

from multicor_cli.scenario import parse_scenario
from multicor_cli.scenario.materials import FlashFriction, FrictionTable, SofteningFriction

GRAINS = "temperature = { value = 300.0, gradient = [0.0, 100.0], at = [0.0, 0.025] }"
FLOOR = "thermal = { temperature = { ramp = [300.0, 350.0], duration = 2.0 } }"
SOFT = "friction = { value = 0.5, softening = 1e-3, reference = 298.15, min = 0.1, max = 1.0 }"
FLOW = "thermal.lid = { flow = { sine = { mean = 1.0, amplitude = 2.0, period = 60.0 } } }"
GAS = 'gas = { conductivity = 0.026, model = "batchelor" }'
AIR = "conductivity = 0.026, viscosity = 1.5e-5, prandtl = 0.7"
AMBIENT = f'ambient = {{ temperature = 290.0, correlation = "gunn", {AIR}, porosity = 0.4 }}'
RADIATION = "radiation = { surroundings = 293.15, neighbors = true }"
FORCE = "force = { average = 0.01 }"


TABLE = HEATED[HEATED.index("[heat]") : HEATED.index("[solver]")]


def heat(*lines):
    """The text with another table [heat], and without a flow from a wall where none can go."""
    text = HEATED.replace(TABLE, "\n".join(["[heat]", *lines, "\n"]))
    is_closed = '"none"' in "".join(lines) and "gas" not in "".join(lines)
    return text.replace(FLOW, "") if is_closed else text


def without(text, *keys, material="glass"):
    """The text without some keys of a material."""
    start = text.index(f"[materials.{material}]")
    end = text.index("\n[", start)
    table = [line for line in text[start:end].splitlines() if line.split(" ")[0] not in keys]
    return text[:start] + "\n".join(table) + text[end:]


@pytest.mark.parametrize(
    "line",
    [
        "force = { prescribed = 1.0 }",
        'conduction = "rough"',
        'conduction = "none"\nfriction = "sliding"',
        'conduction = "none"\nambient = { temperature = 280, coefficient = 12 }\ngas = { conductivity = 0.026 }',
        'partition = "electrothermal"\nimpact = true',
        "collisional = true",
        'gas = { conductivity = 0.6, model = "parallel", reach = 2.0 }',
        f'ambient = {{ temperature = 290, correlation = "whitaker", {AIR}, velocity = [1, 0] }}',
        f'ambient = {{ temperature = 290, correlation = "li-mason", {AIR}, porosity = 0.2 }}',
        "radiation = { neighbors = true, reach = 0.2 }",
        'integrator = "implicit"\ntolerance = 1e-6\nsub_step = 0.5',
        None,
    ],
)  # fmt: skip
def test_right_forms_of_the_heat_table_load_back(line):
    scenario = parse_scenario(HEATED if line is None else heat(line), "heated.toml")
    assert parse_scenario(scenario.resolved_toml(), "resolved.toml") == scenario


@pytest.mark.parametrize("value", [
    "290", "{ value = 290, gradient = [1, 2] }",
    "{ value = 290, regions = [{ min = [0, 0], max = [1, 1], value = 400 }] }",
    "{ values = [300, 301.5] }", '{ file = "T.csv" }',
])  # fmt: skip
def test_right_forms_of_initial_temperatures_load_back(value):
    scenario = parse_scenario(changed(HEATED, (GRAINS, f"temperature = {value}")), "heated.toml")
    assert scenario.particles[0].temperature is not None
    assert parse_scenario(scenario.resolved_toml(), "resolved.toml") == scenario


def test_defaults_of_the_heat_table():
    assert parse_scenario(SHEAR, "shear.toml").heat is None
    assert parse_scenario(heat(), "heated.toml").heat.model_dump() == {
        "temperature": 293.15, "conduction": "hertz", "friction": "energy",
        "partition": "effusivity", "impact": False, "collisional": False, "force": None,
        "gas": None, "ambient": None, "radiation": None, "integrator": "auto", "sub_step": 1.0,
        "tolerance": 1e-4, "wear_shrinks": False, "gradient": None,
    }  # fmt: skip


def test_softening_of_numbers_and_tables():
    def keys_of(softening):
        return tuple(getattr(softening, key) for key in ("softening", "reference", "min", "max"))

    scenario = parse_scenario(HEATED, "heated.toml")
    number, table = scenario.law("glass", "glass"), scenario.law("glass", "steel")
    assert isinstance(number.friction, SofteningFriction)
    assert isinstance(table.friction, FrictionTable)
    assert (number.coefficient, table.coefficient) == (0.5, 0.3)
    assert keys_of(number.softening) == (1e-3, 298.15, 0.1, 1.0)
    assert keys_of(table.softening) == (2e-3, 293.15, 0.0, 10.0)
    plain = parse_scenario(SHEAR, "shear.toml").law("glass", "steel")
    assert plain.softening is None
    assert keys_of(plain.friction) == (None,) * 4


FLASH = "friction = { value = 0.7, weakened = 0.1, weakening_speed = 0.1, weakening_temperature = 1200.0 }"


def test_flash_heating_of_a_pair():
    law = parse_scenario(changed(HEATED, (SOFT, FLASH)), "heated.toml").law("glass", "glass")
    assert isinstance(law.friction, FlashFriction)
    assert (law.coefficient, law.softening) == (0.7, None)
    assert law.friction.reference == 293.15


def test_time_between_looks_in_a_frozen_stage():
    def dt(*overrides):
        scenario = parse_scenario(HEATED.replace("dt = 60.0\n", ""), "heated.toml", overrides)
        return scenario.stage_solver(1).dt

    assert dt("loading.1.dt=60.0") == 60.0
    assert dt("loading.1.dt=70.0") == 1800.0 / 26  # so that the duration is kept
    assert dt() == pytest.approx(0.001, rel=1e-12)
    assert dt("output.series_interval=0.003") == pytest.approx(0.003, rel=1e-12)
    assert dt("output.frame_interval=0.01", "output.series_interval=5.0") == pytest.approx(
        0.01, rel=1e-12
    )
    assert dt("loading.1.duration=4.0", "output.frame_interval=90.0") == 4.0


@pytest.mark.parametrize(("duration", "dt", "keys"), [
    ("1e9", "1e5", []), ("1e9", "1e-4", ["loading.1.duration"]),
    ("1e6", "1e-2", ["output.frame_interval"]),
])  # fmt: skip
def test_output_need_not_be_coarser_than_the_looks_of_a_frozen_stage(duration, dt, keys):
    overrides = [f"loading.1.duration={duration}", f"loading.1.dt={dt}"]
    assert [problem.key for problem in problems_of(HEATED, overrides)] == keys


# change, key, where the problem points (text at that place), words that the message must have
MISTAKES = {
    "celsius": (("temperature = 310.0", "temperature = -5"), "heat.temperature", "temperature = -5", "-5 K", "268.15"),
    "below zero": (("temperature = 310.0", "temperature = -500"), "heat.temperature", "temperature = -500", "kelvin"),
    "too hot": (("temperature = 310.0", "temperature = 2e5"), "heat.temperature", "temperature = 2e5", "1 to 100000 K"),
    "text": (("temperature = 310.0", 'temperature = "hot"'), "heat.temperature", 'temperature = "hot"', "number"),
    "misspelled heat key": (("force = {", "forse = {"), "heat.forse", "forse", "unknown key", "'force'"),
    "unit in key": (("heat_capacity = 800.0", "heat_capacity_k = 800.0"), "materials.glass.heat_capacity_k", "heat_capacity_k", "SI"),
    "J per gram": (("heat_capacity = 800.0", "heat_capacity = 0.8"), "materials.glass.heat_capacity", "heat_capacity = 0.8", "800"),
    "negative capacity": (("heat_capacity = 800.0", "heat_capacity = -8"), "materials.glass.heat_capacity", "heat_cap", "positive"),
    "GPa": (("microhardness = 6e9", "microhardness = 6"), "materials.glass.microhardness", "microhardness", "6 Pa", "6e9"),
    "no hardness": (("\nhardness = 5e9", "\nhardness = 0"), "materials.glass.hardness", "hardness = 0", "positive"),
    "emissivity": (("emissivity = 0.9", "emissivity = 1.1"), "materials.glass.emissivity", "emissivity", "at most 1"),
    "force word": ((FORCE, 'force = "step"'), "heat.force", 'force = "step"', "average, prescribed"),
    "two forces": ((FORCE, "force = { average = 1, prescribed = 1 }"), "heat.force", "force = {", "exactly one of"),
    "conduction": ((FORCE, 'conduction = "herz"'), "heat.conduction", 'conduction = "herz"', "'hertz'"),
    "gas model": (('"batchelor"', '"bachelor"'), "heat.gas.model", 'model = "bachelor"', "'batchelor'"),
    "gas reach": ((GAS, "gas = { conductivity = 0.026, reach = 3 }"), "heat.gas.reach", "reach", "at most 2", "is 3"),
    "gas without conductivity": ((GAS, 'gas = { model = "parallel" }'), "heat.gas.conductivity", "gas = {", "missing", "W/(m K)"),
    "batchelor": (("conductivity = 0.026, model", "conductivity = 0.2, model"), "heat.gas.model", 'model = "batchelor"', "'glass' is 5 times", '"parallel"'),
    "vargas": (('"batchelor"', '"vargas"'), "heat.gas.model", 'model = "vargas"', "0.0004 to 0.0006", '"parallel"'),
    "gunn without porosity": ((", porosity = 0.4", ""), "heat.ambient", "ambient", "needs the porosity", "add porosity"),
    "gunn too dense": (("porosity = 0.4", "porosity = 0.3"), "heat.ambient.porosity", "porosity", "0.35 to 1", "0.3"),
    "porosity unused": (('"gunn"', '"whitaker"'), "heat.ambient.porosity", "porosity", "no meaning"),
    "both kinds of convection": (("temperature = 290.0, ", "temperature = 290.0, coefficient = 5, "), "heat.ambient", "ambient", "exactly one of coefficient, correlation"),
    "no convection": ((AMBIENT, "ambient = { temperature = 290.0 }"), "heat.ambient", "ambient", "exactly one of"),
    "nothing to exchange radiation with": ((RADIATION, "radiation = {}"), "heat.radiation", "radiation = {}", "surroundings"),
    "reach unused": ((RADIATION, "radiation = { surroundings = 300, reach = 1 }"), "heat.radiation.reach", "reach = 1", "neighbors"),
    "softening missing": ((SOFT, "friction = { value = 0.5, min = 0.1 }"), "contacts.0.friction.min", "min = 0.1", "softening"),
    "number in a table": ((SOFT, "friction = { value = 0.5 }"), "contacts.0.friction", "friction = {", "add softening"),
    "weakened to more": ((SOFT, FLASH.replace("0.1, w", "0.8, w")), "contacts.0.friction.weakened", "weakened = 0.8", "swap"),
    "weak at room temperature": ((SOFT, FLASH.replace("1200.0", "290.0")), "contacts.0.friction.weakening_temperature", "weakening_temperature = 290", "not above reference"),
    "no weakening speed": ((SOFT, FLASH.replace("weakening_speed = 0.1, ", "")), "contacts.0.friction.weakening_speed", "friction = {", "missing"),
    "crossed limits": (("min = 0.1, max = 1.0", "min = 0.1, max = 0.05"), "contacts.0.friction.max", "max = 0.05", "swap"),
    "value and table": (("values = [0.3, 0.2], soft", "value = 0.3, values = [0.3, 0.2], soft"), "contacts.1.friction.value", "value = 0.3", "unknown key"),
    "reference in celsius": (("298.15", "-25"), "contacts.0.friction.reference", "reference", "248.15"),
    "no form of temperature": ((GRAINS, "temperature = { value = 300 }"), "particles.0.temperature", "temperature", "gradient, regions"),
    "region turned": ((GRAINS, "temperature = { value = 300, regions = [{ min = [1, 0], max = [0, 1], value = 400 }] }"), "particles.0.temperature.regions.0.max", "max = [0, 1]", "swap the corners"),
    "region in celsius": ((GRAINS, "temperature = { value = 300, regions = [{ min = [0, 0], max = [1, 1], value = -10 }] }"), "particles.0.temperature.regions.0.value", "value = -10", "263.15"),
    "value in celsius": ((GRAINS, "temperature = { values = [300, 0] }"), "particles.0.temperature.values.1", "0] }", "273.15"),
    "wall condition": ((FLOOR, "thermal = 1"), "walls.0.thermal", "thermal = 1", "exactly one of temperature, flow, capacity"),
    "two wall conditions": ((FLOOR, "thermal = { temperature = 300, flow = 1 }"), "walls.0.thermal", "thermal", "exactly one of"),
    "not insulated": ((FLOOR, "thermal = { insulated = false }"), "walls.0.thermal.insulated", "insulated = false", "temperature or flow"),
    "cold ramp": (("ramp = [300.0, 350.0]", "ramp = [300.0, -1]"), "walls.0.thermal.temperature", "temperature = { ramp", "-1 K"),
    "cold wave": ((FLOOR, "thermal = { temperature = { sine = { mean = 300, amplitude = 400, period = 1 } } }"), "walls.0.thermal.temperature", "temperature = { sine", "-100 K"),
    "cold table": ((FLOOR, "thermal = { temperature = { times = [0, 1], values = [300, 0.5] } }"), "walls.0.thermal.temperature", "temperature = { times", "0.5 K"),
    "wall in celsius": ((FLOOR, "thermal = { temperature = 0 }"), "walls.0.thermal.temperature", "temperature = 0", "273.15"),
    "unknown wall": (("thermal.lid", "thermal.led"), "loading.1.thermal.led", "thermal.led", "'lid'"),
    "frozen and until": (("frozen = true", "frozen = true\nuntil = { kinetic_energy_ratio = 1e-3 }"), "loading.1.until", "until", "nothing moves"),
    "frozen and drives": (("frozen = true", "frozen = true\ndrives.lid = { x = { velocity = 1 } }"), "loading.1.drives", "drives.lid", "nothing moves"),
    "frozen and solver": (("frozen = true", "frozen = true\nsolver = { max_sweeps = 10 }"), "loading.1.solver", "solver = {", "nothing moves"),
    "frozen without heat": (("frozen = true", "frozen = true\nheat = false"), "loading.1.heat", "heat = false\ndt", "nothing happens"),
    "frozen without end": (("duration = 1800.0\n", ""), "loading.1", '[[loading]]\nname = "soak"', "has no end"),
    "long look": (("dt = 60.0", "dt = 6000.0"), "loading.1.duration", "duration = 1800", "shorter than the time step"),
}  # fmt: skip


@pytest.mark.parametrize("name", MISTAKES)
def test_each_mistake_gives_one_problem_at_its_place(name):
    change, *expected = MISTAKES[name]
    check_one(changed(HEATED, change), *expected)


def test_grains_shrink_only_where_something_wears():
    shrinking = "[heat]\n", "[heat]\nwear_shrinks = true\n"
    assert parse_scenario(changed(HEATED, shrinking), "heated.toml").heat.wear_shrinks
    text = changed(HEATED, shrinking, ("wear = 1e-4\n", ""))
    check_one(text, "heat.wear_shrinks", "wear_shrinks = true", "no pair of materials wears")


OFF = {
    "materials.glass.expansion": ("[materials.glass]", "[materials.glass]\nexpansion = 1e-5"),
    "contacts.0.friction.weakening_temperature": ("friction = 0.4", FLASH),
    "particles.0.temperature": ("count = 100", "count = 100\ntemperature = 300"),
    "walls.2.thermal": ("mass = 1e-3", "mass = 1e-3\nthermal = { insulated = true }"),
    "loading.2.thermal": ("duration = 0.5", "duration = 0.5\nthermal.top = { flow = 1 }"),
    "loading.2.frozen": ("drives.bottom.x.velocity = { times = [0, 1], values = [0, 0.5] }", "frozen = true"),
    "loading.2.heat": ("duration = 0.5", "duration = 0.5\nheat = true"),
    "contacts.1.wear": ("restitution = 0.5", "restitution = 0.5\nwear = 1e-4"),
    "contacts.0.friction.softening": ("friction = 0.4", "friction = { value = 0.4, softening = 1e-3 }"),
}  # fmt: skip


@pytest.mark.parametrize("key", OFF)
def test_thermal_keys_need_the_table_heat(key):
    (problem,) = problems_of(changed(SHEAR, OFF[key]))
    assert problem.key == key
    assert problem.line > 1
    assert "[heat]" in problem.remedy


@pytest.mark.parametrize(
    ("line", "keys", "reason"),
    [
        ("", ("conductivity",), 'conduction = "hertz"'),
        ("", ("heat_capacity",), "[heat]"),
        ("", ("young", "poisson"), 'conduction = "hertz"'),
        ('conduction = "rough"', ("roughness", "asperity_slope", "microhardness"), 'conduction = "rough"'),
        ('conduction = "none"\ngas = { conductivity = 0.026 }', ("young", "poisson"), "gas"),
        ('conduction = "none"\nfriction = "none"\nimpact = true', ("conductivity",), 'partition = "effusivity"'),
        ('partition = "electrothermal"', ("resistivity",), 'partition = "electrothermal"'),
        ("radiation = { surroundings = 300 }", ("emissivity",), "radiation"),
        ("", ("hardness",), "wear"),
    ],
)  # fmt: skip
def test_properties_that_are_needed(line, keys, reason):
    text, lacking = without(heat(line), *keys), f"has no {', '.join(keys)}"
    check_one(text, "materials.glass", "[materials.glass]", lacking, reason, "add ")


def test_properties_that_nothing_needs_are_neither_asked_for_nor_refused():
    unused = changed(
        SHEAR, ("density = 2500", "density = 2500\nconductivity = 1\nemissivity = 0.9")
    )
    assert problems_of(unused) == []
    ambient = "ambient = { temperature = 290, coefficient = 5 }"
    text = heat('conduction = "none"', 'friction = "none"', ambient).replace(FLOOR, "")
    mechanical = ("young", "poisson", "roughness", "asperity_slope", "microhardness")
    assert (
        problems_of(without(text, "conductivity", "emissivity", "resistivity", *mechanical)) == []
    )


def test_walls_need_no_emissivity_unless_neighbors_radiate():
    text = without(HEATED, "emissivity", material="steel")
    assert [p.key for p in problems_of(text)] == ["materials.steel"]
    assert problems_of(changed(text, (", neighbors = true", ""))) == []


@pytest.mark.parametrize(("line", "is_known"), [
    ("", False), ("gas = { conductivity = 0.026 }", False), ("force = { prescribed = 0.1 }", True),
    ('conduction = "none"', True),
])  # fmt: skip
def test_contacts_are_known_only_after_a_step(line, is_known):
    fall = '[[loading]]\nname = "fall"\nduration = 1.0\nheat = false\n'
    text = changed(heat(line), (fall, ""))
    if is_known:
        assert problems_of(text) == []
    else:
        check_one(text, "loading.0.frozen", "frozen = true", "first step", "prescribed")


def test_heat_that_is_off_in_all_stages():
    off = (
        ("frozen = true\ndt = 60.0", "heat = false"),
        ("thermal.floor", "heat = false\nthermal.floor"),
    )
    check_one(changed(heat(), *off), "heat", "[heat]", "all stages")


def test_conditions_without_effect():
    text = changed(HEATED, (TABLE, '[heat]\nconduction = "none"\n\n'))
    flow = ("flow = { sine", "no heat can flow", "let contacts conduct")
    check_one(text, "loading.1.thermal.lid.flow", *flow)
    text = heat('conduction = "none"', 'friction = "none"')
    check_one(text, "walls.0.thermal.temperature", "temperature = { ramp", "cannot heat")
    assert problems_of(text.replace("[heat]", "[heat]\nradiation = { neighbors = true }")) == []
    for line, key in ((FORCE, "heat.force"), ("collisional = true", "heat.collisional")):
        check_one(heat('conduction = "none"', line), key, line, "no meaning")


def test_values_from_the_command_line():
    (problem,) = problems_of(HEATED, ["heat.gas.reach=5"])
    assert (problem.file, problem.key) == ("--set", "heat.gas.reach")
    assert problems_of(HEATED, ["heat.impact=true", "walls.1.thermal={temperature=300}"]) == []


def test_all_problems_are_told_at_once():
    slips = ("conductivity = 1.0\n", ""), ("thermal.lid", "thermal.led")
    keys = [problem.key for problem in problems_of(changed(HEATED, *slips))]
    assert keys == ["materials.glass", "loading.1.thermal.led"]
    slips = (
        *slips,
        ('model = "batchelor"', 'model = "air"'),
    )  # what a wrong [heat] needs is not known
    keys = [problem.key for problem in problems_of(changed(HEATED, *slips))]
    assert keys == ["loading.1.thermal.led", "heat.gas.model"]
