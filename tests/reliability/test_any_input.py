"""Any scenario, and any file that it names, is right or refused: exit code 0 or 3 with a position,
soon, never a traceback."""

import copy
import os
import random
import re
import resource
import time
import tomllib

import h5py
import numpy as np
import pytest
import tomli_w
from command_line import call
from damage_worker import BYTES
from places import ROOT
from scenario_problems import places
from scenarios import plane, toml
from scenes import SMALL, WARM
from trials import trials

from multicor_cli.engine import PhysicsError
from multicor_cli.packing import build
from multicor_cli.running.estimate import estimate
from multicor_cli.running.from_scenario import make_plan
from multicor_cli.running.plan import begin_stage
from multicor_cli.running.session import make_engine
from multicor_cli.scenario import load_scenario, parse_scenario
from multicor_cli.scenario.problems import ScenarioError
from multicor_cli.scenario.tables import scenario_schema

SOON = 1.0
"""Time in which a scenario is checked [s]."""

PLACED = 20.0
"""Time in which a few hundred grains are placed and moved by two steps [s]."""

TILTED = SMALL.replace("[domain]", '[variables]\nd = 1e-3\nx = "= 2 * d"\n[domain]').replace(
    "0.6e-3", '"= 0.3 * x"'
)
TEMPLATES = [path.read_text() for path in (ROOT / "multicor_cli").rglob("templates/*.toml")]
# Expressions are mutated as texts: here numbers are numbers.
DOCUMENTS = [
    tomllib.loads(text) for text in (SMALL, WARM, TILTED, *TEMPLATES) if "[variables]" not in text
]
NUMBERS = (
    0, 1, -1, 2, 1e-12, 1e-6, 1e-3, 0.5, 1.5, 10.0, 1e6, 1e12, 1e308, float("nan"), float("inf"),
    True, 10**400,
)  # fmt: skip
OTHERS = (
    "", "x", "*", "top", "a\nb\x1b[31m", "é" * 100, [], [[]], {}, [{}], {"kind": "random"},
    "../../etc/passwd", "<script>",
)  # fmt: skip
EXPRESSIONS = (
    "= 1", "= 1 / 3", "= -x", "= 2 * d", "= d - d", "= 10**6", "= 9**9**9", "=", "= (",
    "= 1e308 * 10", "= d.real",
)  # fmt: skip
ROOM = 1 << 30
"""Memory that a few hundred grains may take besides [bytes]."""

LARGEST = 400
"""Grains of a mutant that is placed at most."""


def mutate(document, choose):
    """One to three changes: a number scaled or replaced, a key removed, doubled or given another's
    value."""
    document = copy.deepcopy(document)
    for _ in range(choose.choice((1, 1, 1, 2, 3))):
        *way, last = choose.choice([*places(document)])
        node = document
        for part in way:
            node = node[part]
        value, action = node[last], choose.random()
        if action < 0.4 and isinstance(value, int | float) and not isinstance(value, bool):
            node[last] = type(value)(value * choose.choice((-1, 0, 0.1, 0.5, 2, 10, 1000)))
        elif action < 0.6:
            node[last] = choose.choice(NUMBERS)
        elif action < 0.75:
            node[last] = choose.choice(OTHERS + EXPRESSIONS)
        elif action < 0.9:
            del node[last]
        elif isinstance(node, list):
            node.insert(last, copy.deepcopy(value))
        else:
            *_, other = choose.choice([*places(document)])
            node[other if isinstance(other, str) else "x"] = copy.deepcopy(value)
    return document


def problems_of(text):
    """Messages about a scenario, each of which must have a position; ``None`` if it is right."""
    before = time.process_time()
    try:
        parse_scenario(text, "mutant.toml")
        problems = None
    except ScenarioError as error:
        problems = [str(problem) for problem in error.problems]
        lines = text.count("\n") + 1
        for problem in error.problems:
            assert 1 <= problem.line <= lines or "more problems" in problem.message, str(problem)
            assert problem.message
            assert problem.remedy
            assert not re.search(r"[\x00-\x08\x0b-\x1f\x7f]", str(problem)), (
                "control characters reach the terminal"
            )
    assert time.process_time() - before < SOON * 5, "the machine may be slow, but not that slow"
    return problems


def assert_helpful(error):
    assert [problem for problem in error.problems if not (problem.message and problem.remedy)] == []


@trials(short=300, long=20_000)
def test_mutants_are_right_or_refused(count):
    choose = random.Random(7)
    right = 0
    for _ in range(count):
        text = tomli_w.dumps(mutate(choose.choice(DOCUMENTS), choose))
        if problems_of(text) is None:
            right += 1
            scenario = parse_scenario(text, "mutant.toml")
            assert parse_scenario(scenario.resolved_toml(), "again.toml") == scenario
    print(f"{count} mutants, {right} right")
    assert 0.02 * count < right < 0.9 * count


@trials(short=300, long=20_000)
def test_any_text_is_right_or_refused(tmp_path, count):
    """Bytes of valid files changed, cut, inserted; and bytes of any kind."""
    choose = random.Random(8)
    path = tmp_path / "any.toml"
    for number in range(count):
        if number % 10 == 9:
            data = choose.randbytes(choose.randrange(200))
        else:
            data = (SMALL if number % 2 else WARM).encode()
            for _ in range(choose.randint(1, 3)):
                data = BYTES[choose.choice(sorted(BYTES))](data or b"x", choose)
        path.write_bytes(data)
        try:
            problems_of(data.decode())
        except UnicodeDecodeError:
            with pytest.raises(ScenarioError, match="UTF-8"):
                load_scenario(path)


HOSTILE = {
    "nesting": "x = " + "[" * 100_000 + "]" * 100_000,
    "tables": "\n".join(f"[a{k}]" for k in range(50_000)),
    "keys": ".".join("a" * 3 for _ in range(50_000)) + " = 1",
    "digits": "x = " + "9" * 900_000,
    "line": "# " + "x" * 990_000,
    "string": 'x = "' + "\\u0000" * 150_000 + '"',
    "errors": SMALL + "\n".join(f"[[walls]]\nname = {k}" for k in range(20_000)),
    "array": f"{SMALL}\n[[particles]]\nname = 'n'\nsizes = {{ kind = 'list', radii = [{'1,' * 200_000}] }}",
    "expressions": f"{SMALL}[variables]\n" + "\n".join(f'a{k} = "= {"1.1**90*" * 23}x"' for k in range(4_000)),
    "long expression": f'{SMALL}[variables]\na = "= {"(" * 990_000}"',
    "large": "x = 1\n" * 400_000,
    "bom": "\ufeff\ufeff" + SMALL,
    "nul": SMALL + "\0",
}  # fmt: skip


def time_of_children():
    """Processor time of the programs that were run and have ended [s]: that of others on the
    machine does not count."""
    used = os.times()
    return used.children_user + used.children_system


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_texts_are_refused_soon(name, tmp_path):
    """Through the command line: exit code 3, a position, no traceback; a second, and what it takes
    to start Python."""
    (tmp_path / "hostile.toml").write_text(HOSTILE[name])
    start = time_of_children()
    call("--version", cwd=tmp_path)
    startup = time_of_children() - start
    start = time_of_children()
    done = call("validate", "hostile.toml", cwd=tmp_path)
    took = time_of_children() - start
    assert done.returncode == 3, done.stderr
    assert "Traceback" not in done.stderr
    assert len(done.stderr) < 100_000
    assert re.match(r"hostile\.toml(:\d+:\d+)?: ", done.stderr), done.stderr[:200]
    assert took < startup + 5.0 * SOON  # five times as long, for machines that are slow


def is_large(document):
    """More grains than a test has time for, or as many as fit into a region that is not bounded by
    the test."""
    counts = [group.get("count", 0) for group in document["particles"]]
    return sum(counts) > LARGEST or document["solver"].get("max_sweeps", 0) > 10_000


def place_and_move(text):
    scenario = parse_scenario(text, ROOT / "configs" / "mutant.toml")
    model, state = build(scenario)
    plan = make_plan(scenario, model)
    estimate(scenario, plan, model, state, 1)
    engine = make_engine(scenario, model, state, 1)
    stage = plan.stages[0]
    begin_stage(engine, stage, [0.0])
    for _ in range(2):
        engine.step(stage.dt, state.stage_step * stage.dt)
    assert np.isfinite(state.position).all()


@trials(short=25, long=2_000)
def test_what_is_right_can_be_placed_and_moved(count):
    """Scenarios that pass the check: placed, planned, estimated and moved by two steps, or refused
    for what only placing shows."""
    for text in (SMALL, WARM):  # compiles the kernels, which takes longer
        place_and_move(text)
    room = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 + ROOM
    choose, outcomes = random.Random(9), {"moved": 0, "refused": 0, "physics": 0}
    while sum(outcomes.values()) < count:
        document = mutate(choose.choice(DOCUMENTS), choose)
        text = tomli_w.dumps(document)
        if problems_of(text) is not None or is_large(document):
            continue
        before = time.process_time()
        try:
            place_and_move(text)
            outcomes["moved"] += 1
        except ScenarioError as error:
            assert_helpful(error)
            outcomes["refused"] += 1
        except PhysicsError:
            outcomes["physics"] += 1
        except Exception as error:
            raise AssertionError(text) from error
        assert time.process_time() - before < PLACED, text
        assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 < room, text
    print(outcomes)
    assert outcomes["moved"] > count // 3


def with_file(name):
    """A scenario whose grains are in a file."""
    return toml(
        grains={"packing": {"kind": "file", "path": name}}, periodic=True, size=[0.02, 0.02],
        walls={"bottom": {"geometry": plane(), "mass": 1.0},
               "top": {"geometry": plane(0.01, -1), "mass": 1.0}},
    )  # fmt: skip


@trials(short=60, long=3_000)
def test_files_of_grains_are_right_or_refused(tmp_path, count):
    """CSV and HDF5 files with grains, damaged: exit code 0 or 3 in the terms of the command
    line."""
    choose, right = random.Random(10), 0
    rows = "\n".join(f"{0.001 + 0.001 * k:.4f},0.002,0.0004" for k in range(10))
    (tmp_path / "grains.csv").write_text(f"# made by hand\nx,y,radius\n{rows}\n")
    with h5py.File(tmp_path / "grains.h5", "w") as file:
        file["x"] = np.linspace(0.001, 0.01, 10)
        file["y"], file["radius"] = np.full(10, 2e-3), np.full(10, 4e-4)
    build(parse_scenario(with_file("grains.csv"), tmp_path / "a.toml"))
    build(parse_scenario(with_file("grains.h5"), tmp_path / "b.toml"))
    for number in range(count):
        kind = "csv" if number % 2 else "h5"
        data = (tmp_path / f"grains.{kind}").read_bytes()
        (tmp_path / f"bad.{kind}").write_bytes(BYTES[choose.choice(sorted(BYTES))](data, choose))
        try:
            build(parse_scenario(with_file(f"bad.{kind}"), tmp_path / "c.toml"))
            right += 1
        except ScenarioError as error:
            assert_helpful(error)
    print(f"{count} files, {right} right")
    assert 0 < right < count


def test_the_schema_bounds_every_number_and_array():
    """No number without a smallest and a largest value, no array without a largest length: no size
    is a surprise."""
    unbounded, numbers = [], 0

    def walk(node, path):
        nonlocal numbers
        if isinstance(node, list):
            node = dict(enumerate(node))
        elif isinstance(node, dict):
            kinds = np.atleast_1d(node.get("type", ())).tolist()
            if "number" in kinds or "integer" in kinds:
                numbers += 1
                has_low = "minimum" in node or "exclusiveMinimum" in node
                has_high = "maximum" in node or "exclusiveMaximum" in node
                is_one_of = "enum" in node or "const" in node
                if not is_one_of and not (has_low and has_high):
                    unbounded.append(path)
            if "array" in kinds and "maxItems" not in node:
                unbounded.append(path)
        if isinstance(node, dict):
            for key, value in node.items():
                walk(value, f"{path}.{key}")

    walk(scenario_schema(), "schema")
    assert unbounded == []
    assert numbers > 100
