"""Scenario files, and values from the command line."""

import copy
import math
import tomllib

import pytest
import tomli_w
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scenario_problems import places, problems_of
from scenes import HEATED, SHEAR, changed

from multicor_cli.scenario import Refused, ScenarioError, load_scenario, parse_scenario

# ---- Files


@pytest.fixture
def write(tmp_path):
    def _write(content, name="shear.toml"):
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return _write


def test_the_tables_of_the_file_are_attributes(write):
    scenario = load_scenario(write(SHEAR))
    assert scenario.name == "shear"
    assert scenario.seed == 7
    assert scenario.domain.size == (0.03, 0.05)
    assert scenario.domain.gravity == (0.0, -9.81)
    assert scenario.particles[0].sizes.largest == 0.6e-3
    assert scenario.walls[0].geometry.start == (0.0, 0.0)
    assert scenario.walls[0].geometry.end == (0.03, 0.0)
    assert scenario.loading[0].drives["top"].y.force == -0.015
    assert scenario.solver.max_sweeps == 50_000
    assert scenario.output.series_interval == 0.01 / 10
    assert scenario.sources.text == SHEAR


def test_what_other_packages_ask(write):
    path = write(SHEAR)
    scenario = load_scenario(path)
    assert scenario.law("glass", "glass").friction == 0.4
    assert scenario.law("glass", "steel").restitution == 0.5
    assert scenario.law("steel", "glass") is scenario.law("glass", "steel")
    with pytest.raises(KeyError):
        load_scenario(path, ['contacts.0.pair=["glass","glass"]']).law("steel", "steel")
    assert scenario.glued_sizes(scenario.walls[0]) == scenario.particles[0].sizes
    assert scenario.glued_sizes(scenario.walls[1]) == scenario.particles[0].sizes
    assert scenario.glued_sizes(scenario.walls[2]) is None
    assert scenario.particles[0].placed_in(scenario.domain).height == pytest.approx(0.048)
    assert scenario.stage_solver(0) == scenario.solver
    assert scenario.stage_solver(1).dt == 1e-4
    assert scenario.stage_solver(1).tolerance_rms == 1e-4
    assert scenario.stage_solver(1).tolerance_max == scenario.solver.tolerance_max
    assert scenario.resolve_path("grains.csv") == path.parent / "grains.csv"


def test_a_problem_found_later_has_its_position(write):
    path = write(SHEAR)
    (problem,) = (
        load_scenario(path)
        .refuse(Refused(("walls", 2, "geometry", "points"), "it cuts a grain", "move it"))
        .problems
    )
    assert str(problem).startswith(f"{path}:")
    assert problem.source_line.startswith('geometry = { kind = "polyline"')
    assert problem.source_line[problem.column - 1 :].startswith("points")


@pytest.mark.parametrize(("mark", "end"), [(b"\xef\xbb\xbf", "\n"), (b"", "\r\n")])
def test_files_of_other_systems_are_read(write, mark, end):
    def load(text):
        return load_scenario(write(mark + text.replace("\n", end).encode()))

    assert load(SHEAR) == parse_scenario(SHEAR, "other.toml")
    wrong = changed(SHEAR, ("dt = 2e-4", "dt = 0"))
    with pytest.raises(ScenarioError) as error:
        load(wrong)
    (found,), (expected,) = error.value.problems, problems_of(wrong)
    assert (found.line, found.column) == (expected.line, expected.column)
    assert found.excerpt() == expected.excerpt()


@pytest.mark.parametrize(("content", "line", "column", "word"), [
    (b'[scenario]\nname = "\xe9"\n', 2, 9, "0xe9 is not UTF-8"),
    ("[scenario]".encode("utf-16"), 1, 1, "not UTF-8"),
    (b"[scenario]\n\x00", 2, 1, "not TOML"),
    (b"\x89PNG\r\n\x1a\n", 1, 1, "not UTF-8"),
    (b"name: shear\n", 1, 5, "not TOML"),
    (b"#" * 2_000_000, 0, 0, "larger than 1 MB"),
])  # fmt: skip
def test_what_is_no_toml_is_refused_at_its_place(write, content, line, column, word):
    with pytest.raises(ScenarioError) as error:
        load_scenario(write(content))
    (problem,) = error.value.problems
    assert (problem.line, problem.column) == (line, column)
    assert word in problem.message
    assert problem.remedy


def test_what_is_no_file_is_refused(tmp_path):
    for path, word in (
        (tmp_path, "directory"), (tmp_path / "none.toml", "no such file"), ("a\0b", ""),
    ):  # fmt: skip
        with pytest.raises(ScenarioError) as error:
            load_scenario(path)
        (problem,) = error.value.problems
        assert word in problem.message
        assert str(path).replace("\0", "\N{REPLACEMENT CHARACTER}") in str(problem)


def test_an_unreadable_file_is_refused(write, monkeypatch):
    path = write(SHEAR)

    def refuse(*_arguments):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("multicor_cli.files.os.open", refuse)
    with pytest.raises(ScenarioError, match="cannot be read: Permission denied"):
        load_scenario(path)


def test_tables_that_lack():
    assert [problem.key for problem in problems_of("")] == [
        "scenario", "domain", "materials", "particles", "loading", "output",
    ]  # fmt: skip
    without = parse_scenario(changed(SHEAR, ("[solver]\ndt = 2e-4\n", "")), "shear.toml")
    assert without.solver == parse_scenario(changed(SHEAR, ("dt = 2e-4", "")), "shear.toml").solver
    assert without.solver.dt == "auto"


def test_the_resolved_scenario_loads_back_to_the_same():
    scenario = parse_scenario(
        SHEAR, "shear.toml", ["loading.2.duration=0.25", "output.precision=single"]
    )
    again = parse_scenario(scenario.resolved_toml(), "resolved.toml")
    assert again == scenario
    assert again.resolved_toml() == scenario.resolved_toml()
    assert again.loading[2].duration == 0.25
    resolved = tomllib.loads(scenario.resolved_toml())
    assert resolved["solver"]["tolerance_rms"] == 2e-3
    assert resolved["walls"][0]["geometry"]["from"] == [0.0, 0.0]


def test_a_default_that_is_shorter_than_a_step_loads_back():
    scenario = parse_scenario(SHEAR, "shear.toml", ["output.frame_interval=4e-4"])
    assert scenario.output.series_interval < scenario.solver.dt
    assert parse_scenario(scenario.resolved_toml(), "resolved.toml") == scenario
    assert [p.key for p in problems_of(SHEAR, ["output.series_interval=1e-5"])] == [
        "output.series_interval"
    ]


def test_a_random_seed_is_drawn_once_and_recorded():
    text = changed(SHEAR, ("seed = 7", 'seed = "random"'))
    first, second = parse_scenario(text, "a.toml"), parse_scenario(text, "a.toml")
    assert first.seed != second.seed
    assert first.seed == first.seed >= 0
    assert parse_scenario(first.resolved_toml(), "b.toml").seed == first.seed


WITH_EXPRESSIONS = changed(
    SHEAR,
    ("[domain]", '[variables]\nwidth = 0.03\nhalf = "= width / 2"\n[domain]'),
    ("size = [0.03, ", 'size = ["= 2 * half", '),
)
DOCUMENTS = (tomllib.loads(SHEAR), tomllib.loads(HEATED), tomllib.loads(WITH_EXPRESSIONS))
HOSTILE = st.one_of(
    st.sampled_from([True, False, 0, -1, 1, 10**400, 0.0, -1.0, 1e-320, 1e308, math.nan, math.inf]),
    st.sampled_from(["", "x", "*", "top", "random", "= 1", "= 2 * width", "= 1 / 3"]),
    st.sampled_from(["= width - width", "= 9**9**9", "= (", "a\nb\x1b", "é" * 100]),
    st.sampled_from([[], [[]], {}, [{}], {"kind": "random"}, {"kind": []}, {"kind": {"kind": 1}}]),
    st.sampled_from([{"velocity": 1, "force": 1}, {"ramp": [1, 2]}, {"strain": 1}]),
    st.sampled_from([{"times": [], "values": []}, [0.0] * 500]),
    st.integers(-(10**9), 10**9),
    st.floats(allow_nan=False),
)


def check_mutant(document):
    """A mutant is right or refused with problems that have a position; nothing else."""
    text = tomli_w.dumps(document)
    problems = problems_of(text)
    for problem in problems:
        assert "\n" not in str(problem)
        assert 1 <= problem.line <= text.count("\n") + 1 or "more problems" in problem.message
        problem.excerpt()
    if not problems:
        scenario = parse_scenario(text, "mutant.toml")
        assert parse_scenario(scenario.resolved_toml(), "again.toml") == scenario
        scenario.drives()
        scenario.wall_conditions()


@settings(max_examples=600, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(
    st.sampled_from([(document, path) for document in DOCUMENTS for path in places(document)]),
    st.sampled_from(["replace", "remove", "rename", "double"]),
    HOSTILE,
    st.data(),
)
def test_single_mutations_are_right_or_refused(place, action, value, data):
    document, path = copy.deepcopy(place)
    node = document
    for part in path[:-1]:
        node = node[part]
    last = path[-1]
    if action == "replace":
        node[last] = value
    elif action == "remove":
        del node[last]
    elif isinstance(node, list):
        node.insert(last, copy.deepcopy(node[last]))
    else:
        new = data.draw(
            st.sampled_from(
                ["x", "kind", "", "a.b", last + "s", last[:-1], "temperature", "force", "min"]
            )
        )
        node[new] = node.pop(last) if action == "rename" else copy.deepcopy(node[last])
    check_mutant(document)


@settings(max_examples=200, deadline=None)
@given(
    st.integers(0, len(SHEAR)),
    st.integers(0, 5),
    st.text("[]{}=\"'#\\,.\n\r\0\ufeffa1é-", max_size=4),
)
def test_mutations_of_the_text_are_right_or_refused(at, cut, insert):
    problems_of(SHEAR[:at] + insert + SHEAR[at + cut :])


@settings(max_examples=100, deadline=None)
@given(st.binary(max_size=60))
def test_any_bytes_are_refused(tmp_path_factory, content):
    path = tmp_path_factory.getbasetemp() / "bytes.toml"
    path.write_bytes(content)
    with pytest.raises(ScenarioError):
        load_scenario(path)


# ---- `--set key=value`


@pytest.mark.parametrize(
    ("overrides", "key", "value"),
    [
        (["loading.2.duration=2.0"], "loading.2.duration", 2.0),
        (["domain.gravity = [1, 2.5]"], "domain.gravity", [1.0, 2.5]),
        (["output.contacts=false"], "output.contacts", False),
        (['scenario.description="a b"'], "scenario.description", "a b"),
        (["particles.0.sizes={kind='list', radii=[1e-3]}"], "particles.0.sizes.kind", "list"),
        (["domain.size.1=0.06"], "domain.size", [0.03, 0.06]),
        (["loading.1.drives.top.x.velocity.ramp.1=0.3"], "loading.1.drives.top.x.velocity.ramp", [0.0, 0.3]),
        # words are strings
        (["scenario.name=run-2.b"], "scenario.name", "run-2.b"),
        (["solver.method=gauss-seidel"], "solver.method", "gauss-seidel"),
        (["scenario.description=first try"], "scenario.description", "first try"),
        # later ones win
        (["solver.dt=1e-4", "solver.dt=1e-5"], "solver.dt", 1e-5),
        # keys and tables that are missing are added
        (["solver.threads=2"], "solver.threads", 2),
        (["loading.2.solver.max_sweeps=5"], "loading.2.solver.max_sweeps", 5),
        (["materials.wood.density=600"], "materials.wood.density", 600.0),
    ],
)  # fmt: skip
def test_values_are_set(overrides, key, value):
    scenario = parse_scenario(SHEAR, "shear.toml", overrides)
    node = tomllib.loads(scenario.resolved_toml())
    for part in key.split("."):
        node = node[int(part) if isinstance(node, list) else part]
    assert node == value
    assert type(node) is type(value)
    assert scenario.sources.text == SHEAR


@pytest.mark.parametrize(("override", "key", "word"), [
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
])  # fmt: skip
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
    text = changed(SHEAR, ("density = 2500", "density = -1"))
    problems = problems_of(text, ["solver.dt=0", "loading.9.dt=1"])
    assert {(problem.file, problem.key) for problem in problems} == {
        ("--set", "loading.9.dt"),
        ("--set", "solver.dt"),
        ("shear.toml", "materials.glass.density"),
    }
