"""A domain that is periodic in both directions: what it may have, and each mistake that it refuses."""

import pytest
from cut_runs import CELL
from scenario_problems import check_one, problems_of
from scenes import SHEAR, WARM, changed

from multicor_cli.engine.motion.drives import Constant, DofDrive, Ramp, Shifted
from multicor_cli.scenario import Scenario, parse_scenario

PERIODIC = 'periodic = ["x", "y"]'
FIRST = "cell = { xx = { stress = 50.0 }, yy = { stress = 50.0 }, xy = { rate = 40.0 } }"
PACKING = 'packing = { kind = "random" }'
THERMAL = (
    "density = 2500.0",
    "density = 2500.0\nyoung = 7e10\npoisson = 0.2\nconductivity = 1.0\nheat_capacity = 800.0",
)
PLANE = 'geometry = { kind = "plane", point = [0.0, 0.0], normal = [0.0, 1.0] }'


def cell(text, more=""):
    """A change of what strains or loads the cell in the first stage, and of what else it says."""
    return FIRST, f"cell = {{ {text} }}{more}"


def stage(text):
    return FIRST, f"{FIRST}\n{text}"


@pytest.mark.parametrize(
    ("given", "kept", "is_periodic", "is_cell"),
    [
        ("false", False, False, False), ("[]", False, False, False),
        ("true", True, True, False), ('["x"]', True, True, False),
        ('["x", "y"]', ("x", "y"), True, True), ('["y", "x"]', ("x", "y"), True, True),
    ],
)  # fmt: skip
def test_directions_in_which_a_domain_repeats(given, kept, is_periodic, is_cell):
    """What older versions wrote, true and false, is written still: their runs go on."""
    text = CELL if is_cell else changed(SHEAR, ("periodic = true", f"periodic = {given}"))
    text = changed(text, (PERIODIC, f"periodic = {given}")) if is_cell else text
    if not is_periodic:  # walls at the sides of a period are not asked for here
        text = changed(CELL, (PERIODIC, f"periodic = {given}"), (FIRST, ""), (
            "cell = { xx = { rate = 0.0 }, yy = { stress = 40.0 }, xy = { rate = -20.0 } }", ""))  # fmt: skip
    domain = parse_scenario(text, "cell.toml").domain
    assert (domain.periodic, domain.is_periodic, domain.is_cell) == (kept, is_periodic, is_cell)
    assert len(domain.periods) == is_periodic + is_cell


def test_components_keep_their_drive_until_a_stage_names_them():
    text = changed(
        CELL,
        cell("yy = { stress = { ramp = [0.0, 50.0], duration = 0.1 } }, xy = { rate = 40.0 }"),
        ("cell = { xx = { rate = 0.0 }, yy = { stress = 40.0 }, xy = { rate = -20.0 } }",
            "cell = { xx = { stress = 1.0 } }"),
    )  # fmt: skip
    scenario = parse_scenario(text, "cell.toml")
    (first,), (second,) = (stage.started([0.0, 0.01]) for stage in scenario.drives(("cell",)))
    ramp = Ramp(0.0, 50.0, 0.1)
    assert first.x == DofDrive(velocity=Constant(0.0))
    assert first.y == DofDrive(stress=ramp)
    assert first.spin == second.spin == DofDrive(velocity=Constant(40.0))
    assert second.x == DofDrive(stress=Constant(1.0))
    assert second.y == DofDrive(stress=Shifted(ramp, 0.01))
    assert Scenario.from_dict(scenario.as_dict()) == scenario


RIGHT = {
    "nothing is driven": ((FIRST, ""),),
    "a sine": (cell("xy = { rate = { sine = { amplitude = 1.0, period = 0.1 } } }"),),
    "inertia": ((PERIODIC, f"{PERIODIC}\ncell_inertia = 0.1"),),
    "rates": ((PERIODIC, f"{PERIODIC}\ncell_rates = {{ xy = 40.0 }}"),),
    "until a strain": (stage('until = { strain = { cell = "xx", value = 0.1 } }'),),
    "until a strain without a duration": (
        ("duration = 0.01", ""), stage('until = { strain = { cell = "xy", value = 0.1 } }')),
    "until a stress": (
        stage('until = { stress = { cell = "yy", above = 20.0, window = 0.001 } }'),),
    "until steady": (
        stage('until = { steady = { of = "stress", cell = "xx", window = 0.001, tolerance = 0.1 } }'),),
    "until steady friction": (
        stage('until = { steady = { of = "friction", cell = "xy", window = 0.001, tolerance = 0.1 } }'),),
    "until steady energy": (
        stage('until = { steady = { of = "kinetic_energy", window = 0.001, tolerance = 0.1 } }'),),
    "until rest": (stage("until = { kinetic_energy_ratio = 1e-3 }"),),
    "weightless again": (stage("gravity = [0.0, 0.0]"),),
    "a lattice": ((PACKING, 'packing = { kind = "lattice", lattice = "square" }'),),
    "no stress": (cell("xx = { stress = 0.0 }, yy = { stress = 0.0 }"),),
    "tension of what adheres": (
        ("friction = 0.3", "friction = 0.3\nadhesion = 1e-4"), cell("yy = { stress = -1.0 }")),
}  # fmt: skip


@pytest.mark.parametrize("name", RIGHT)
def test_what_a_cell_may_have(name):
    assert problems_of(changed(CELL, *RIGHT[name])) == []


# changes, key, where the problem points, words that the message must have
MISTAKES = {
    "y alone": ([(PERIODIC, 'periodic = ["y"]'), (FIRST, ""), ("cell = { xx = { rate = 0.0 }, yy", "solver = {} #")], "domain.periodic", "periodic", '["y"]', "not in y alone", "90 degrees"),
    "a direction twice": ([(PERIODIC, 'periodic = ["x", "x"]')], "domain.periodic", "periodic", "named twice", "once"),
    "no direction": ([(PERIODIC, 'periodic = ["x", "z"]')], "domain.periodic.1", '"z"', "'x', 'y'"),
    "a word": ([(PERIODIC, 'periodic = "xy"')], "domain.periodic", "periodic", "true or false", '"xy"', '["x", "y"]'),
    "stress and rate": ([cell("xx = { stress = 1.0, rate = 0.0 }")], "loading.0.cell.xx", "xx = { stress = 1.0,", "'stress', 'rate'", "exactly one of rate, stress"),
    "neither": ([cell("xx = {}")], "loading.0.cell.xx", "xx = {}", "exactly one of rate, stress"),
    "a bare number": ([cell("xx = 100.0")], "loading.0.cell.xx", "xx = 100.0", "100.0", "exactly one of rate, stress"),
    "nothing": ([cell("")], "loading.0.cell", "cell = {  }", "empty", "xx, yy or xy"),
    "a component of a wall": ([cell("x = { rate = 1.0 }")], "loading.0.cell.x", "x = { rate = 1.0", "unknown key", "did you mean 'xy' or 'xx'?"),
    "the other shear": ([cell("yx = { rate = 1.0 }")], "loading.0.cell.yx", "yx = {", "unknown key", "'xx'"),
    "tension": ([cell("yy = { stress = -100.0 }")], "loading.0.cell.yy.stress", "stress = -100.0", "-100 N/m", "apart", "stress = 100"),
    "gravity": ([("gravity = [0.0, 0.0]", "gravity = [0.0, -9.81]")], "domain.gravity", "gravity", "-9.81", "gravity = [0.0, 0.0]"),
    "gravity by default": ([("gravity = [0.0, 0.0]\n", "")], "domain.gravity", None, "-9.81", "gravity = [0.0, 0.0]"),
    "gravity of a stage": ([stage("gravity = [0.0, -1.0]")], "loading.0.gravity", "gravity = [0.0, -1.0]", "weight", "remove gravity"),
    "tilted gravity": ([stage("gravity = { angle = 10.0 }")], "loading.0.gravity", "gravity = {", "weight", "remove gravity"),
    "walls": ([("[[loading]]\nname = \"shear\"", f'[[walls]]\nname = "floor"\nmaterial = "glass"\n{PLANE}\n[[loading]]\nname = "shear"')], "walls", "[[walls]]", "'floor'", "periodic = true"),
    "a wall across the period": ([("[[loading]]\nname = \"shear\"", '[[walls]]\nname = "box"\nmaterial = "glass"\ngeometry = { kind = "box", min = [0.0, 0.0], max = [0.01, 0.01] }\n[[loading]]\nname = "shear"')], "walls", "[[walls]]", "'box'", "periodic = true"),
    "drives": ([stage("drives.top = { x = { velocity = 1.0 } }")], "loading.0.drives", "drives.top", "'top'", "no walls", "cell = {"),
    "a wall's heat": ([stage("thermal.top = { insulated = true }")], "loading.0.thermal", "thermal.top", "'top'", "no walls"),
    "an end of walls": ([stage('until = { strain = { walls = ["a", "b"], value = 1.0 } }')], "loading.0.until.strain", "strain =", "'a', 'b'", 'cell = "xy"'),
    "a stress on a wall": ([stage('until = { stress = { wall = "a", axis = "y", above = 1.0, window = 0.001 } }')], "loading.0.until.stress", "stress = { wall", "'a'", 'cell = "yy"'),
    "a displacement": ([stage('until = { displacement = { wall = "a", axis = "y", above = 1.0 } }')], "loading.0.until.displacement", "displacement", "'a'", "with cell"),
    "walls and cell": ([stage('until = { strain = { walls = ["a", "b"], cell = "xy", value = 1.0 } }')], "loading.0.until.strain.walls", "walls = [", "both cell and walls", "remove"),
    "wall and cell": ([stage('until = { stress = { wall = "a", axis = "y", cell = "xy", above = 1.0, window = 0.001 } }')], "loading.0.until.stress.wall", "wall = ", "both cell and wall", "remove"),
    "no wall and no cell": ([stage('until = { steady = { of = "stress", window = 0.001, tolerance = 0.1 } }')], "loading.0.until.steady", "steady", "wall is missing", 'cell = "xy"'),
    "friction of a pressure": ([stage('until = { steady = { of = "friction", cell = "yy", window = 0.001, tolerance = 0.1 } }')], "loading.0.until.steady.cell", 'cell = "yy"', '"yy"', 'cell = "xy"'),
    "a strain that never comes": ([cell("xx = { stress = 50.0 }", '\nuntil = { strain = { cell = "xy", value = 1.0 } }')], "loading.0.until.strain", "strain = {", "rate of xy is 0", "xy = { rate"),
    "a strain that may never come": ([("duration = 0.01", ""), cell("xy = { rate = { ramp = [1.0, 0.0], duration = 1.0 } }", '\nuntil = { strain = { cell = "xy", value = 1.0 } }')], "loading.0.until.strain", "strain = {", "comes to 0", "duration"),
    "a way out": ([("gravity = [0.0, 0.0]", 'gravity = [0.0, 0.0]\nlost = "stop"')], "domain.lost", "lost", '"stop"', "remove"),
    "an outlet": ([("[solver]", '[[outlets]]\nname = "out"\nregion = { min = [0.0, 0.0], max = [0.01, 0.01] }\n[solver]')], "outlets", "[[outlets]]", "come nor go", "remove"),
    "a release": ([(PACKING, f"{PACKING}\nrelease = {{ rate = 1.0, region = {{ min = [0.0, 0.0], max = [0.01, 0.01] }} }}")], "particles.0.release", "release", "come nor go", "random"),
    "deposited": ([(PACKING, 'packing = { kind = "deposited" }')], "particles.0.packing", "packing", '"deposited"', "floor", "random"),
    "compacted": ([(PACKING, 'packing = { kind = "compacted", pressure = 1.0 }')], "particles.0.packing", "packing", '"compacted"', "floor", "random"),
    "deposited tiles": ([("count = 100\n", ""), (PACKING, 'packing = { kind = "tile", source = { kind = "deposited" }, tile = [0.006, 0.01], tile_count = 20, repeat = [2, 1] }')], "particles.0.packing.source", "source", '"deposited"', "floor", "random"),
    "too low": ([("size = [0.012, 0.01]", "size = [0.1, 0.0047]")], "particles.0.sizes", "sizes", "0.0047", "0.0012", "widen"),
    "too narrow": ([("size = [0.012, 0.01]", "size = [0.0047, 0.1]")], "particles.0.sizes", "sizes", "0.0047", "0.0012", "widen"),
    "a region beyond the cell": ([(PACKING, f"{PACKING}\nregion = {{ min = [0.0, 0.001], max = [0.012, 0.011] }}")], "particles.0.region", "region", "y = 0.001 to 0.011", "0 to 0.01"),
    "heavy": ([(PERIODIC, f"{PERIODIC}\ncell_inertia = 1e4")], "domain.cell_inertia", "cell_inertia", "1000", "10000.0"),
    "no gradient": ([("[[contacts]]", "[heat]\ngradient = [0.0, 0.0]\n[[contacts]]"), THERMAL], "heat.gradient", "gradient = [0.0, 0.0]", "gradient of zero", "remove"),
    "a gradient as a number": ([("[[contacts]]", "[heat]\ngradient = 100.0\n[[contacts]]"), THERMAL], "heat.gradient", "gradient = 100.0", "must be an array", "100.0"),
    "frozen": ([("duration = 0.005", "duration = 0.005\nfrozen = true"), ("[[contacts]]", "[heat]\ntemperature = 300.0\n[[contacts]]"), THERMAL], "loading.1.cell", "cell = { xx = { rate", "nothing moves", "remove cell or frozen"),
}  # fmt: skip


@pytest.mark.parametrize("name", MISTAKES)
def test_each_mistake_about_a_cell_is_one_clear_problem(name):
    changes, key, place, *words = MISTAKES[name]
    check_one(changed(CELL, *changes), key, place, *words)


def test_a_cell_that_goes_on_has_the_rates_of_its_run():
    head, tail = CELL.split("[[particles]]")
    loading = tail.split("[[loading]]", 1)[1]
    text = changed(head, (PERIODIC, f"{PERIODIC}\ncell_rates = {{ xy = 1.0 }}"))
    text = f'{text}[start]\nrun = "before"\n[[loading]]{loading}'
    check_one(text, "domain.cell_rates", "cell_rates = {", "goes on", "[start]")


ELSEWHERE = {
    "cell": (("duration = 0.5\n", "duration = 0.5\ncell = { xy = { rate = 1.0 } }\n"), "loading.2.cell", "cell = {", 'periodic = ["x", "y"]'),
    "inertia": (("periodic = true", "periodic = true\ncell_inertia = 1.0"), "domain.cell_inertia", "cell_inertia", 'periodic = ["x", "y"]'),
    "rates": (("periodic = true", "periodic = true\ncell_rates = { xy = 1.0 }"), "domain.cell_rates", "cell_rates", 'periodic = ["x", "y"]'),
    "until": (("until = { kinetic_energy_ratio = 1e-4 }", 'until = { strain = { cell = "xy", value = 1.0 } }'), "loading.0.until.strain.cell", 'cell = "xy"', "name walls"),
}  # fmt: skip


def test_between_walls_there_is_no_mean_gradient():
    text = changed(WARM, ("[heat]\n", "[heat]\ngradient = [0.0, 100.0]\n"))
    words = ("periodic in both directions", 'periodic = ["x", "y"]', "their temperatures")
    check_one(text, "heat.gradient", "gradient = [0.0, 100.0]", *words)


@pytest.mark.parametrize("name", ELSEWHERE)
def test_what_only_a_cell_can_do_is_refused_elsewhere(name):
    change, key, place, *words = ELSEWHERE[name]
    check_one(changed(SHEAR, change), key, place, "periodic in both directions", *words)
