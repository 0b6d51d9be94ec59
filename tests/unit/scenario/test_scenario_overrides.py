"""``--set key=value``."""

import pytest
from scenario_problems import problems_of
from scenes import SHEAR, changed

from multicor_cli.scenario import parse_scenario


def with_set(*overrides):
    return parse_scenario(SHEAR, "shear.toml", overrides)


def test_values_are_toml():
    scenario = with_set(
        "loading.2.duration=2.0",
        "domain.gravity = [1, 2.5]",
        "output.contacts=false",
        'scenario.description="a b"',
        "particles.0.sizes={kind='list', radii=[1e-3]}",
        "domain.size.1=0.06",
        "loading.1.drives.top.x.velocity.ramp.1=0.3",
    )
    assert scenario.loading[2].duration == 2.0
    assert scenario.domain.gravity == (1.0, 2.5)
    assert scenario.output.contacts is False
    assert scenario.description == "a b"
    assert scenario.particles[0].sizes.kind == "list"
    assert scenario.domain.size == (0.03, 0.06)
    assert scenario.loading[1].drives["top"].x.velocity.ramp == (0.0, 0.3)


def test_words_are_strings():
    scenario = with_set("scenario.name=run-2.b", "solver.method=gauss-seidel", "scenario.description=first try")
    assert (scenario.name, scenario.solver.method, scenario.description) == ("run-2.b", "gauss-seidel", "first try")


def test_later_ones_win():
    assert with_set("solver.dt=1e-4", "solver.dt=1e-5").solver.dt == 1e-5


def test_keys_and_tables_that_are_missing_are_added():
    scenario = with_set("solver.threads=2", "loading.2.solver.max_sweeps=5", "materials.wood.density=600")
    assert scenario.solver.threads == 2
    assert scenario.loading[2].solver.max_sweeps == 5
    assert scenario.materials["wood"].density == 600.0


def test_the_text_of_the_file_is_not_changed():
    assert with_set("solver.dt=1e-4").source == SHEAR


@pytest.mark.parametrize(
    ("override", "key", "word"),
    [
        ("loading.3.duration=1", "loading.3.duration", "use 0 to 2"),
        ("loading.-1.duration=1", "loading.-1.duration", "no index"),
        ("loading.first.duration=1", "loading.first.duration", "no index"),
        ("lading.1.duration=1", "lading.1.duration", "'loading'"),
        ("loading.1.durtion=1", "loading.1.durtion", "'duration'"),
        ("solver.dt.x=1", "solver.dt.x", "shorten"),
        ("domain.0=1", "domain.0", "not an array"),
        ("domain.size.2=1", "domain.size.2", "use 0 to 1"),
        ("solver.dt=-1", "solver.dt", "positive"),
        ("solver.dt=nan", "solver.dt", "finite"),
        ("solver.dt=true", "solver.dt", "number"),
        ("solver.dt=small", "solver.dt", '"small"'),
        ("solver.dt=1.2.3", "solver.dt", "not a valid TOML value"),
        ("solver.dt=[1", "solver.dt", "not a valid TOML value"),
        ("solver.dt=1\nmethod='x'", "solver.dt", "not a valid TOML value"),
        ("solver.dt=", "solver.dt", "not a valid TOML value"),
        ("solver.dt=" + "[" * 100, "", "deep"),
        ("a" + ".a" * 100 + "=1", "", "deep"),
        ("solver.dt", "", "no key"),
        ("=1", "", "no key"),
        ("", "", "no key"),
        ("particles.0.packing={kind='compacted'}", "particles.0.packing.pressure", "missing"),
        ("loading.0.drives.lid.x.velocity=1", "loading.0.drives.lid", "'top'"),
    ],
)
def test_a_bad_one_is_one_problem_of_the_command_line(override, key, word):
    (problem,) = problems_of(SHEAR, [override])
    assert problem.file == "--set"
    assert problem.line == problem.column == 0
    assert problem.key == key
    assert word in str(problem)
    assert problem.remedy
    assert str(problem).startswith(f"--set: {key}")
    assert problem.source_line == override


def test_problems_of_the_file_and_of_the_command_line_come_together():
    problems = problems_of(changed(SHEAR, ("density = 2500", "density = -1")), ["solver.dt=0", "loading.9.dt=1"])
    assert {problem.key for problem in problems} == {"loading.9.dt", "solver.dt", "materials.glass.density"}
    assert {problem.file for problem in problems} == {"--set", "shear.toml"}
