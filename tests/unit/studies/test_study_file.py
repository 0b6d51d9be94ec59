"""Study files: what is varied, how cases are named, and what is refused where."""

import math
from pathlib import Path

import pytest
from scenes import SMALL

from multicor_cli.scenario.problems import ScenarioError
from multicor_cli.studies.axes import Case, check_case, digits_of, expand, in_numbers, short_names
from multicor_cli.studies.directory import StudyDirectory
from multicor_cli.studies.observing import unknown
from multicor_cli.studies.session import check_cases, forecast
from multicor_cli.studies.study_file import load_study

HEAD = '[study]\nname = "s"\nscenario = "small.toml"\n'
FRICTION, RESTITUTION = "contacts.0.friction", "contacts.0.restitution"


@pytest.fixture
def read(tmp_path):
    (tmp_path / "small.toml").write_text(SMALL)

    def make(text, head=HEAD):
        (tmp_path / "s.toml").write_text(head + text)
        return load_study(tmp_path / "s.toml")

    return make


def values(study):
    return [tuple(case.values.values()) for case in expand(study)]


def problems(call):
    with pytest.raises(ScenarioError) as caught:
        call()
    return [str(problem) for problem in caught.value.problems]


def test_tables_tell_the_numbers_of_expressions(read):
    varied = f'[vary]\n"{FRICTION}" = ["= 0.1 * 4", 0.5, "= -2"]\n'
    study = read(varied)
    cases = expand(study)
    assert [in_numbers(study, case)[FRICTION] for case in cases] == [0.4, 0.5, "= -2"]


@pytest.mark.parametrize("seeds", ["", "seeds = 2\n", "seeds = [4, 5]\n"])
def test_a_seed_that_is_drawn_anew_at_each_look_is_refused(read, seeds):
    study = read(f'{seeds}[set]\n"scenario.seed" = "random"\n')
    (problem,) = problems(lambda: expand(study))
    assert "study.scenario" in problem
    assert "by chance" in problem
    assert '"scenario.seed" = 1' in problem


def test_cases_that_have_begun_keep_their_names(read, tmp_path):
    """Whatever values come later that six digits do not tell from theirs."""

    def named(*values):
        study = read(f'[vary]\n"{FRICTION}" = [{", ".join(map(str, values))}]\n')
        cases = StudyDirectory(tmp_path / "out").as_named(expand(study))
        StudyDirectory(tmp_path / "out").begin(study, cases, "")
        return [case.name for case in cases]

    first = named(0.333333333333)
    assert first == ["friction=0.333333"]
    both = named(0.333333333333, 0.33333333)
    assert both == [*first, "friction=0.33333333"]
    many = named(0.33333333, 0.25, 0.3333333)
    assert many[0] == both[1]
    assert len({*many, *both}) == 4
    alone = named(0.3333334)
    assert alone[0].startswith("friction=0.333333_")
    assert named(0.3333334) == alone


def test_tables_show_as_many_digits_as_tell_values_apart():
    assert digits_of([0.25, 0.5, 0.25]) == 6
    assert digits_of([0.333333333, 0.33333333]) == 12
    assert digits_of(["= 2 * d", 1, True]) == 6


def test_without_quotes_or_variation(read):
    (case,) = expand(read(""))
    assert case == Case("only", {})
    text = (
        f"[vary]\n{FRICTION} = [0.2, 0.4]\n{RESTITUTION} = {{ from = 0.0, to = 1.0, count = 3 }}\n"
    )
    assert expand(read(text)) == expand(
        read(text.replace(FRICTION, f'"{FRICTION}"').replace(RESTITUTION, f'"{RESTITUTION}"'))
    )


def test_all_combinations_are_counted_and_looked_at(read):
    study = read(f'[vary]\n"{FRICTION}" = [0.2, 0.4]\n"{RESTITUTION}" = [0.0, 0.5, 0.9]\n')
    assert values(study) == [(f, e) for f in (0.2, 0.4) for e in (0.0, 0.5, 0.9)]
    assert expand(study)[1].name == "friction=0.2_restitution=0.5"
    assert expand(study)[1].overrides == [f"{FRICTION}=0.2", f"{RESTITUTION}=0.5"]
    text = "".join(
        f'"loading.{k}.duration" = {{ from = 1, to = 2, count = 1000 }}\n' for k in range(3)
    )
    (problem,) = problems(lambda: expand(read("[vary]\n" + text)))
    assert "1e+09 combinations" in problem


def test_ranges(read):
    for keys, expected in (
        (f'"{FRICTION}" = {{ from = 0.1, to = 0.4, count = 4 }}', [0.1, 0.2, 0.3, 0.4]),
        (f'"{FRICTION}" = {{ from = 0.001, to = 1.0, count = 4, spacing = "log" }}',
            [0.001, 0.01, 0.1, 1.0]),
        ('"particles.0.count" = { from = 10, to = 30, count = 3 }', [10, 20, 30]),
    ):  # fmt: skip
        found = [value for (value,) in values(read(f"[vary]\n{keys}\n"))]
        assert found == expected
        assert [*map(type, found)] == [*map(type, expected)]


def test_values_that_go_together(read):
    text = (
        f'[vary]\nzip = [["{FRICTION}", "{RESTITUTION}"]]\n"{FRICTION}" = [0.2, 0.4]\n'
        f'"{RESTITUTION}" = [0.0, 0.5]\n'
    )
    assert values(read(text + '"solver.dt" = [1e-4, 2e-4]\n')) == [
        (0.2, 0.0, 1e-4), (0.2, 0.0, 2e-4), (0.4, 0.5, 1e-4), (0.4, 0.5, 2e-4)
    ]  # fmt: skip
    (problem,) = problems(lambda: expand(read(text.replace("[0.0, 0.5]", "[0.0]"))))
    assert "not as many" in problem
    assert problem.startswith(f"{read('').path}:5:")


def test_rows_of_a_file(read, tmp_path):
    (tmp_path / "cases.csv").write_text(
        f"# two of them\n{FRICTION},solver.dt\n0.2,1e-4\n0.4,auto\n"
    )
    assert values(read('[vary]\nfile = "cases.csv"\n')) == [(0.2, 1e-4), (0.4, "auto")]
    (tmp_path / "cases.csv").write_text(f"{FRICTION};solver.dt\n0,2;1e-4\n")
    assert "has semicolons" in problems(lambda: expand(read('[vary]\nfile = "cases.csv"\n')))[0]
    (tmp_path / "cases.csv").write_text(f"{FRICTION}\n0.2,3\n")
    assert "row 2" in problems(lambda: expand(read('[vary]\nfile = "cases.csv"\n')))[0]
    assert "there is no file" in problems(lambda: expand(read('[vary]\nfile = "none.csv"\n')))[0]
    (tmp_path / "cases.csv").write_text(f"{FRICTION}\n0.2\n-0.2\n")
    study = read('[vary]\nfile = "cases.csv"\n')
    (problem,) = problems(lambda: check_case(study, expand(study)[1]))
    assert problem.startswith(f"{study.path}:")
    assert f"vary.file: column {FRICTION} of 'cases.csv': must be at least 0, is -0.2" in problem


@pytest.mark.parametrize("kind", ["latin-hypercube", "sobol"])
def test_points_of_a_box(kind, read):
    """One in each sixteenth; their ranges need no count."""
    sample = f'sample = {{ kind = "{kind}", count = 16 }}\n'
    friction = f'"{FRICTION}" = {{ from = 0.1, to = 0.9 }}\n'
    dt = '"solver.dt" = { from = 1e-5, to = 1e-3, spacing = "log" }\n'
    text = f"[vary]\n{sample}{friction}{dt}"
    found = values(read(text))
    for same in (
        text, f"[vary]\n{friction}{dt}{sample}",
        text.replace("0.9 }", "0.9, count = 2 }").replace("1e-3,", "1e-3, count = 5,"),
    ):  # fmt: skip
        assert found == values(read(same))
    assert found != values(read(text.replace("count = 16", "count = 16, seed = 2")))
    if kind == "sobol":  # any number of them, without SciPy's warning
        assert found[:11] == values(read(text.replace("count = 16", "count = 11")))
    assert len(values(read(text + f'"{RESTITUTION}" = [0.1, 0.2]\n'))) == 32
    frictions, steps = zip(*found, strict=True)
    logs = [math.log10(step) for step in steps]
    for column, low, high in ((frictions, 0.1, 0.9), (logs, -5.0, -3.0)):
        strata = sorted(int(16 * (value - low) / (high - low)) for value in column)
        assert strata == list(range(16))


def test_seeds_come_last_and_what_is_set_is_in_all_cases(read):
    study = read(f'seeds = 2\n[vary]\n"{FRICTION}" = [0.2, 0.4]\n')
    assert values(study) == [(0.2, 3), (0.2, 4), (0.4, 3), (0.4, 4)]
    assert values(read("seeds = [7, 11]\n")) == [(7,), (11,)]
    study = read(f'[set]\nsolver.dt = 1e-4\n[vary]\n"{FRICTION}" = [0.2]\n')
    (case,) = expand(study)
    assert case.name == "friction=0.2"
    assert check_case(study, case).solver.dt == 1e-4
    assert (
        "set and varied"
        in problems(lambda: read(f'[set]\n"{FRICTION}" = 1.0\n[vary]\n"{FRICTION}" = [0.2]\n'))[0]
    )


def test_names_tell_close_values_apart(read):
    names = [case.name for case in expand(read(f'[vary]\n"{FRICTION}" = [0.2, 0.20000001]\n'))]
    assert names == ["friction=0.2", "friction=0.20000001"]
    for twice in ("[0.2, 0.2]", "[1, 1.0]"):
        study = read(f'[vary]\n"{FRICTION}" = {twice}\n')
        assert "comes twice" in problems(lambda study=study: expand(study))[0]
    for text, longest in (("x" * 200, 120), ("a/b ../c", 40)):
        (case,) = expand(read(f'[vary]\n"scenario.description" = ["{text}"]\n'))
        assert len(case.name) <= longest
        assert "/" not in case.name


def test_short_names():
    keys = ["variables.I", "contacts.0.friction", "loading.0.duration", "loading.1.duration"]
    found = short_names(keys)
    assert list(found.values()) == ["I", "friction", "loading.0.duration", "loading.1.duration"]
    assert list(found) == keys


SOBOL = '[vary]\nsample = { kind = "sobol", count = 4 }\n'
BAD = [
    ("colour = 3\n", 4, "unknown key"),
    ("seeds = 0\n", 4, "0 seeds"),
    ("seeds = [1, 1]\n", 4, "twice"),
    ('[vary]\n"a.b" = []\n', 5, "at least 1"),
    ('[vary]\n"a.b" = { from = 1, to = 2 }\n', 5, 'vary."a.b".count: is missing'),
    ('[vary]\n"a.b" = [[1, 2]]\n', 5, 'vary."a.b".0: is an array; give a number'),
    ("[vary]\na.b = { from = 1, to = 2 }\nc.d = { from = 1, to = 2 }\n", 6,
        "vary.c.d.count: is missing"),
    (SOBOL.replace("sobol", "dice") + '"a.b" = { from = 1, to = 2 }\n', 5, "sobol"),
    (SOBOL + '"a.b" = { from = 2, to = 2 }\n', 6, "no length"),
    (SOBOL + '"a.b" = { from = 1, to = 2, count = 0 }\n', 6, "at least 1"),
    ('[vary]\n"a.b" = { from = 0, to = 2, count = 3, spacing = "log" }\n', 5, "positive"),
    ('[vary]\n"a.b" = { from = 2, to = 2, count = 3 }\n', 5, "no length"),
    ("[vary]\na.b = { from = 0, to = 2, count = 0 }\n", 5, "at least 1"),
    ('[[observe]]\nname = "mu"\n', 4, "one of them"),
    ('[[observe]]\nname = "mu"\npost = "rheology"\n', 4, "both"),
    ('[[observe]]\nname = "a"\ninfo = "step"\n[[observe]]\nname = "a"\ninfo = "time"\n', 4,
        "same name"),
    ('[[observe]]\nname = "seed"\ninfo = "step"\n', 5, "another column 'seed'"),
    ('[[observe]]\nname = "a"\ninfo = "step"\n[[observe]]\nname = "a_error"\ninfo = "time"\n', 8,
        "another column 'a_error'"),
    ('[compute]\nworkers = 2\nscheduler = "tcp://a"\n', 6, "together"),
    ("[compute]\nworkers = 0\n", 5, "at least 1"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "line", "what"), BAD)
def test_bad_files_are_refused_at_the_line(text, line, what, read):
    found = problems(lambda: read(text))
    assert any(what in problem for problem in found), found
    assert any(f"s.toml:{line}:" in problem for problem in found), found


def test_a_value_that_can_be_none_is_refused_once(read):
    for value in ("[1, 2]", "nan", "inf"):
        text = f'[vary]\n"a.b" = [{value}, 3]\n'
        assert len(problems(lambda text=text: read(text))) == 1


def test_every_case_is_looked_at(read):
    study = read(f'[vary]\n"{FRICTION}" = [0.2, -1.0]\n"contacts.0.frict" = [1.0]\n')
    found = problems(lambda: check_cases(study, expand(study)))
    assert any(
        "s.toml:6:" in problem and "did you mean 'friction'?" in problem for problem in found
    )
    assert any("s.toml:5:" in problem and "must be at least 0" in problem for problem in found)


def test_what_a_case_breaks_elsewhere_names_the_case(read):
    """The key that is wrong with it is another than the one that is varied."""
    study = read('[vary]\n"solver.dt" = [1e-4, 1.0]\n')
    found = problems(lambda: check_cases(study, expand(study)))
    assert found
    assert all("(case dt=1)" in problem for problem in found), found


def test_observables_that_no_run_has(read):
    text = (
        '[[observe]]\nname = "a"\npost = "rheology"\nvalue = "frction_walls"\n[[observe]]\n'
        'name = "b"\nseries = "kinetik"\n'
    )
    study = read(text)
    found = [str(problem) for problem in study.refuse(*unknown(study.model.observe)).problems]
    assert "s.toml:7:" in found[0]
    assert "did you mean 'friction_walls'?" in found[0]
    assert "did you mean 'kinetic'?" in found[1]


def test_what_a_study_costs_is_the_sum_of_its_cases(read):
    text = (
        '[set]\n"loading.0.until.kinetic_energy_ratio" = 1e-3\n[vary]\n'
        '"loading.2.duration" = [0.004, 0.008]\n'
    )
    one, both = (
        forecast(study, expand(study), Path())
        for study in (read(text.replace(", 0.008", "")), read("seeds = 3\n" + text))
    )
    assert (one.cases, both.cases) == (1, 6)
    assert 6.0 * one.hours < both.hours < 8.0 * one.hours
    assert both.grains == one.grains == 60
    assert both.needs.threads == 1


def test_what_has_run_says_what_the_rest_takes(read):
    """Runs that took three times what was estimated: so will the others."""
    study = read('[vary]\n"loading.2.duration" = [0.004, 0.006, 0.008]\n')
    cases = expand(study)
    first, rest = cases[:2], cases[2:]
    took = [(case, 3.0 * 3600.0 * forecast(study, [case], Path()).hours) for case in first]
    before, after = forecast(study, rest, Path()), forecast(study, rest, Path(), took)
    assert (before.measured, after.measured) == (0, 2)
    assert after.hours == pytest.approx(3.0 * before.hours)
    assert after.disk == before.disk
