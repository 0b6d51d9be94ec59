"""Variables and expressions in scenario files."""

import math

import pytest
from scenario_problems import place_of, problems_of
from scenes import SHEAR, WARM, changed

from multicor_cli import arithmetic
from multicor_cli.scenario import load_scenario, parse_scenario
from multicor_cli.scenario.expressions import MAX_EXPRESSIONS

VARIABLES = """
[variables]
tilt = "= radians(angle)"
angle = 24
g = 9.81
d = 1e-3
rows = 5
"""


def with_variables(*changes, variables=VARIABLES):
    return changed(SHEAR, ("[domain]", f"{variables}\n[domain]"), *changes)


TILTED = with_variables(
    ("gravity = [0, -9.81]", 'gravity = ["= g * sin(tilt)", "= -g * cos(tilt)"]'),
    ("min = 0.4e-3, max = 0.6e-3", 'min = "= 0.4 * d", max = "=0.6*d"'),
    ("count = 100", 'count = "= 20 * rows"'),
    ("dt = 2e-4", 'dt = "= d / rows"'),
    ("ramp = [0.0, 0.1]", 'ramp = [0.0, "= 100 * d"]'),
)


def parsed(text, *overrides):
    return parse_scenario(text, "shear.toml", overrides)


def test_numbers_stand_where_expressions_stood():
    scenario = parsed(TILTED)
    tilt = 24 * math.pi / 180.0
    assert scenario.domain.gravity == (9.81 * arithmetic.sin(tilt), -9.81 * arithmetic.cos(tilt))
    assert (scenario.particles[0].sizes.min, scenario.particles[0].sizes.max) == (
        0.4e-3,
        0.6 * 1e-3,
    )
    assert scenario.particles[0].count == 100
    assert type(scenario.particles[0].count) is int
    assert scenario.solver.dt == 1e-3 / 5
    assert scenario.loading[1].drives["top"].x.velocity.ramp == (0.0, 0.1)
    assert scenario.variables == {"tilt": tilt, "angle": 24.0, "g": 9.81, "d": 1e-3, "rows": 5.0}
    assert parsed(SHEAR).variables == {}


def test_the_resolved_scenario_holds_numbers_and_loads_back():
    scenario = parsed(TILTED, "variables.angle=10")
    resolved = scenario.resolved_toml()
    assert '"=' not in resolved
    assert "angle = 10.0" in resolved
    assert parsed(resolved) == scenario
    assert "variables" not in parsed(SHEAR).resolved_toml()


def test_any_number_may_be_an_expression():
    """Strings that are words, tables in tables, signals, temperatures, and a seed."""
    text = changed(
        WARM,
        ("seed = 4", 'seed = "= 2 + 2"'),
        ("emissivity = 0.3", 'emissivity = "= 3 / 10"'),
        ("gradient = [0.0, 2000.0]", 'gradient = [0.0, "= 2e3"]'),
        ("amplitude = 10.0", 'amplitude = "= 100 / 10"'),
        ("softening = 1e-3", 'softening = "= 1 / 1000"'),
        ("average = 2e-3", 'average = "= 2 / 1000"'),
        ("temperature = 330.0", 'temperature = "= 300 + 30"'),
        ("dt = 20.0", 'dt = "= 40 / 2"'),
    )
    assert parse_scenario(text, "warm.toml") == parse_scenario(WARM, "warm.toml")


def test_a_file_with_expressions_is_loaded(tmp_path):
    path = tmp_path / "tilted.toml"
    path.write_bytes(b"\xef\xbb\xbf" + TILTED.replace("\n", "\r\n").encode())
    assert load_scenario(path) == parsed(TILTED)


@pytest.mark.parametrize(("overrides", "count", "dt"), [
    (["variables.rows=3"], 60, 1e-3 / 3),
    (["variables.rows== 2 + 2"], 80, 1e-3 / 4),
    (['variables.rows="= 2 + 2"'], 80, 1e-3 / 4),
    (["particles.0.count== 10 * rows"], 50, 1e-3 / 5),
    (["particles.0.count=9", "variables.d=2e-4", "variables.rows== floor(d * 1e4)"], 9, 1e-4),
    (['variables={g = 1, d = 1e-3, rows = "= 2", tilt = 0}'], 40, 1e-3 / 2),
])  # fmt: skip
def test_the_command_line_sets_variables_and_expressions(overrides, count, dt):
    scenario = parsed(TILTED, *overrides)
    assert (scenario.particles[0].count, scenario.solver.dt) == (count, dt)


def test_strings_stay_strings_where_strings_stand():
    text = with_variables(("seed = 7", 'seed = 7\ndescription = "= 2 * d"'))
    assert parsed(text).description == "= 2 * d"
    path = "packing = { kind = 'file', path = '=grains.csv' }"
    assert (
        parsed(changed(with_variables(), ("count = 100\n", "")), *_file(path))
        .particles[0]
        .packing.path
        == "=grains.csv"
    )


def _file(packing):
    sizes = "{ kind = 'uniform', min = 0.4e-3, max = 0.6e-3 }"
    group = f"name = 'grains', material = 'glass', shape = 'disc', thickness = 1e-3, {packing}"
    return (
        f"particles=[{{ {group} }}]",
        f"walls.0.geometry.sizes={sizes}",
        f"walls.1.geometry.sizes={sizes}",
    )


@pytest.mark.parametrize(("old", "new", "key", "word"), [
    ('name = "shear"\n', 'name = "=x"\n', "scenario.name", "not allowed here"),
    ('material = "steel"', 'material = "= d"', "walls.2.material", "not allowed here"),
    ("periodic = true", 'periodic = "= 1"', "domain.periodic", "must be true or false"),
    ('kind = "random"', 'kind = "= 1"', "particles.0.packing.kind", "is not one of"),
    ("dt = 2e-4", 'dt = " = 2e-4"', "solver.dt", '" = 2e-4"'),
])  # fmt: skip
def test_where_no_number_stands_it_is_refused_as_the_string_that_it_is(old, new, key, word):
    (problem,) = problems_of(with_variables((old, new)))
    assert problem.key == key
    assert word in problem.message


WRONG = {
    "nothing": ("=", "=", "nothing follows", "2 * d"),
    "open parenthesis": ("= 2 * (d", "(d", "never closed", "= 2 * d"),
    "closed too often": ("= 2 * d)", ")", "unmatched", "= 2 * d"),
    "two numbers": ("= 2 d", "d", '"d" cannot follow', "= 2 * d"),
    "end": ("= 2 *", " ", "something is missing", "= 2 * d"),
    "unknown name": ("= 2 * angel", "angel", "unknown name 'angel'", "'angle'"),
    "undefined name": ("= 2 * zeta", "zeta", "unknown name 'zeta'", "[variables] zeta"),
    "unknown function": ("= sine(d)", "sine", "unknown function 'sine'", "'sin'"),
    "no function at all": ("= whatever(d)", "whatever", "unknown function 'whatever'", "sqrt"),
    "variable called": ("= d(2)", "d(", '"d" is no function', "d * (...)"),
    "number called": ("= 2(d)", "2(", '"2" cannot be called', "write *"),
    "function as a value": ("= 2 * sin", "sin", '"sin" is a function', "sin(...)"),
    "arguments": ("= 2 * sin(d, d)", "sin(", "has 2 arguments", "sin takes 1 argument"),
    "no arguments": ("= max()", "max(", "has no arguments", "2 or more"),
    "keyword": ("= sin(x=1)", "x=1", "is not arithmetic", "= 2 * d"),
    "unpacking": ("= max(*d)", "*d", "is not arithmetic", "= 2 * d"),
    "power": ("= 2 * d^2", "2 * d^2", "is no power", "**"),
    "division by zero": ("= 1 + d / (2 - 2)", "d / (2", "divides by zero", "divisor"),
    "zero to a negative power": ("= 0**-1", "0**", "divides by zero", "divisor"),
    "root of a negative number": ("= 2 * sqrt(-d)", "sqrt", '"sqrt(-d)" is not a real number', "domain"),
    "logarithm of zero": ("= log(0)", "log", '"log(0)" is not finite', "1e308"),
    "power of a negative number": ("= (-d)**0.5", "(-d", "is not a real number", "domain"),
    "huge power": ("= 9**9**9", "9**9**9", "is not finite", "1e308"),
    "huge powers in turn": ("= ((9**300)**300)", "(9**300)**", "is not finite", "1e308"),
    "huge product": ("= 1e300 * 1e300", "1e300 *", "is not finite", "1e308"),
    "huge integer": ("= 10**180 * 10**180", "10**180 *", "is larger than any number", "1e308"),
    "huge number": ("= 1e999", "1e999", "is not finite", "1e308"),
    "attribute": ("= d.real", "d.real", "is not arithmetic", "= 2 * d"),
    "subscript": ("= d[0]", "d[0]", "is not arithmetic", "= 2 * d"),
    "list": ("= [1, 2]", "[1", "is not arithmetic", "= 2 * d"),
    "tuple": ("= 1, 2", "1, 2", "is not arithmetic", "= 2 * d"),
    "comparison": ("= 1 < d", "1 < d", "is not arithmetic", "= 2 * d"),
    "condition": ("= 1 if d else 2", "1 if", "is not arithmetic", "= 2 * d"),
    "lambda": ("= (lambda: 1)()", "lambda", "cannot be called", "write *"),
    "comprehension": ("= max(i for i in d)", "(i for", "is not arithmetic", "= 2 * d"),
    "assignment": ("= (d := 2)", "d :=", "is not arithmetic", "= 2 * d"),
    "true": ("= True", "True", "is not arithmetic", "= 2 * d"),
    "imaginary": ("= 1j", "1j", "is not arithmetic", "= 2 * d"),
    "string": ("= 'a' * 9", "'a'", "cannot stand", "= 2 * d"),
    "import": ("= __import__('os')", "'os'", "cannot stand", "= 2 * d"),
    "dunder": ("= __class__", "__class__", "unknown name", "[variables]"),
    "comment": ("= d # meters", "#", "cannot stand", "= 2 * d"),
    "other signs": ("= 2·d", "·d", '"·" cannot stand', "= 2 * d"),
    "other minus": ("= −d", "−d", '"−" cannot stand', "= 2 * d"),
    "statements": ("= d; 2", "; 2", "cannot follow", "= 2 * d"),
    "too long": ("= " + "+".join(["d"] * 200), "= d+", "401 characters", "split it"),
    "too deep": ("= " + "-" * 150 + "d", "-" * 150, "too many parentheses", "split it"),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_each_mistake_in_an_expression_gives_one_problem_at_its_place(name):
    expression, place, *words = WRONG[name]
    text = with_variables(("dt = 2e-4", f'dt = "{expression}"'))
    (problem,) = problems_of(text)
    assert problem.key == "solver.dt"
    line, column = place_of(text, f'dt = "{expression}"')
    inside = f"{expression} ".rindex(place)
    assert (problem.line, problem.column) == (line, column + len('dt = "') + inside)
    for word in words:
        assert word in str(problem)
    assert problem.remedy
    assert str(problem).isprintable()


def pointed_at(problem):
    quoted, caret = problem.excerpt().splitlines()
    return quoted[caret.index("^") :]


def test_the_excerpt_points_into_the_expression():
    (problem,) = problems_of(with_variables(("dt = 2e-4", 'dt = "= d / rws"')))
    assert pointed_at(problem) == 'rws"'
    (problem,) = problems_of(
        with_variables(("size = [0.03, 0.05]", "size = ['= 30 * d', '= 50 * e']"))
    )
    assert pointed_at(problem) == "e']"
    (problem,) = problems_of(with_variables(("dt = 2e-4", r'dt = "\u003d d / rws"')))
    # The string is written in another way there
    assert pointed_at(problem) == r'dt = "\u003d d / rws"'


@pytest.mark.parametrize(
    "override", ["solver.dt== d / rws", 'solver.dt="= d / rws"', "domain.size=['= d', '= d * rws']"]
)
def test_the_excerpt_points_into_the_command_line(override):
    (problem,) = problems_of(with_variables(), [override])
    assert (problem.file, problem.line, problem.source_line) == ("--set", 0, override)
    assert pointed_at(problem) == override[override.index("rws") :]
    assert str(problem).startswith("--set: ")


@pytest.mark.parametrize(
    ("change", "key", "message"),
    [
        (("dt = 2e-4", 'dt = "= -d"'), "solver.dt", 'must be positive, is -0.001 ("= -d")'),
        (("size = [0.03, 0.05]", 'size = [0.03, "= -50 * d"]'), "domain.size.1", 'must be positive, is -0.05 ("= -50 * d")'),
        (("young = 70e9", 'young = "= 193 * rows / 5"'), "materials.glass.young", '("= 193 * rows / 5" = 193.0)'),
        (("min = 0.4e-3", 'min = "= 0.8*d"'), "particles.0.sizes.max", "0.0008"),
        (("max = [0.03, 0.049]", 'max = ["= -d", "= -d"]'), "particles.0.region.max", '("= -d", "= -d")'),
        (("count = 100", 'count = "= rows / 2"'), "particles.0.count", 'must be a whole number, is 2.5 ("= rows / 2")'),
        (("count = 100", 'count = "= -rows"'), "particles.0.count", 'is -5 ("= -rows")'),
        (("count = 100", 'count = "= 0.3 / 0.1"'), "particles.0.count", "is 2.9999999999999996"),
    ],
)  # fmt: skip
def test_values_are_checked_as_numbers_and_shown_with_their_expression(change, key, message):
    (problem,) = problems_of(with_variables(change))
    assert problem.key == key
    assert message in problem.message
    assert problem.remedy


VARIABLES_WRONG = {
    "circle": ('a = "= b"\nb = "= 2 * c"\nc = "= a + d"', "a", "a -> b -> c -> a", "a number"),
    "itself": ('a = "= a + 1"', "a", "a -> a", "a number"),
    "behind a circle": ('b = "= a"\na = "= a + 1"\nc = "= b"', "a", "a -> a", "a number"),
    "unknown": ('a = "= dd"\nb = "= a"', "a", "unknown name 'dd'", "'d'"),
    "function": ("sin = 1", "sin", "'sin' is a function", "another name"),
    "constant": ("pi = 3", "pi", "'pi' is a constant", "another name"),
    "word": ("lambda = 1", "lambda", "cannot stand in an expression", "lambda_"),
    "hyphen": ("a-b = 1", "a-b", "not allowed here", "letters, digits and _ only"),
    "letter": ('"φ" = 1', "φ", "not allowed here", "letters"),
    "text": ('a = "2 * d"\nb = "= a"', "a", "must be a number", '"= 2 * d"'),
    "truth": ('a = true\nb = "= a"', "a", "must be a number, is true", "a number"),
    "table": ('a = { b = "= 1" }', "a", "must be a number, is a table", "a number"),
    "infinite": ('a = inf\nb = "= a"', "a", "finite", "a number"),
    "huge": ('a = "= 1e200"', "a", 'is 1e+200 ("= 1e200")', "a number"),
}


@pytest.mark.parametrize("name", VARIABLES_WRONG)
def test_each_wrong_variable_gives_one_problem_at_its_place(name):
    """What refers to a wrong variable is not a problem of its own."""
    table, variable, *words = VARIABLES_WRONG[name]
    text = with_variables(variables=f"{VARIABLES}{table}\n")
    (problem,) = problems_of(text)
    assert problem.key in (f"variables.{variable}", f'variables."{variable}"')
    assert (
        problem.line == place_of(text, f"\n{variable} =" if variable.isascii() else '\n"φ"')[0] + 1
    )
    for word in words:
        assert word in str(problem)


def test_a_wrong_variable_is_one_problem_beside_others():
    (problem,) = problems_of(TILTED, ["variables.d=true"])
    assert (problem.file, problem.key) == ("--set", "variables.d")
    (problem,) = problems_of(TILTED, ["variables=3"])
    assert problem.key == "variables"
    assert "must be a table" in problem.message
    problems = problems_of(
        changed(TILTED, ("d = 1e-3", 'd = "= 1e-3 +"'), ("density = 2500", "densty = 2500"))
    )
    assert [problem.key for problem in problems] == ["variables.d", "materials.glass.densty"]


@pytest.mark.parametrize(("override", "remedy"), [
    ("variables.angel=3", "'angle'"),
    ("variables.zzz=3", "expressions refer to 'angle'"),
    ("variables.zzz== 2 * d", "expressions refer to 'angle'"),
])  # fmt: skip
def test_a_variable_from_the_command_line_that_nothing_refers_to_is_refused(override, remedy):
    (problem,) = problems_of(TILTED, [override])
    assert problem.file == "--set"
    assert "no expression refers to this variable" in problem.message
    assert remedy in problem.remedy


def test_chains_of_variables_may_be_long_and_are_resolved():
    resolved = parsed(TILTED).resolved_toml()
    (problem,) = problems_of(resolved, ["variables.angle=30"])
    assert "no variable" in problem.remedy
    assert problems_of(changed(resolved, ("angle = 24.0", "angle = 30.0"))) == []
    count = MAX_EXPRESSIONS - 1
    chain = "".join(f'a{k} = "= a{k + 1} + 1"\n' for k in range(count)) + f"a{count} = 0\n"
    text = with_variables(("count = 100", 'count = "= a0"'), variables=f"[variables]\n{chain}")
    assert parsed(text).particles[0].count == count


def test_very_many_expressions_are_refused_once():
    many = '"= d", ' * 2 * MAX_EXPRESSIONS
    text = with_variables(("values = [0, 0.5]", f"values = [{many}]"))
    (problem,) = problems_of(text)
    assert f"more than {MAX_EXPRESSIONS} expressions" in problem.message
    # One is a variable
    assert problem.key == f"loading.2.drives.bottom.x.velocity.values.{MAX_EXPRESSIONS - 1}"
