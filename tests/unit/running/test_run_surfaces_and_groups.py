"""Runs with walls whose surface runs, and with walls that only some groups of grains meet."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest
from cut_runs import BELT, SIEVE, shortened, written
from run_fakes import in_pieces
from scenarios import digests
from scenes import changed

from multicor_cli import Scenario, open_run, run
from multicor_cli.engine import Engine
from multicor_cli.engine.inflow import find_room
from multicor_cli.export import frame_problem
from multicor_cli.model.state import find_misfit
from multicor_cli.packing import build, place
from multicor_cli.running.from_scenario import inflow_rules
from multicor_cli.scenario import ScenarioError, load_scenario, parse_scenario
from multicor_cli.store import run_info, verify

HEIGHT = 0.0075
"""Of the middle of the sieve [m]."""


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sieve")
    return run(written(folder / "sieve.toml", SIEVE), folder / "whole", threads=1).directory


def in_group(a_run, name):
    return np.array(a_run.model.grains.group == a_run.model.groups.index(name))


def test_the_surface_is_recorded_and_the_books_close(whole):
    assert verify(whole) == []
    assert run_info(whole)["energy_closure"] < 1e-12
    with open_run(whole) as found:
        assert {"surface", "groups"} <= set(found.features)
        assert found.model.walls.runs.tolist() == [True, False, False, False]
        floor = found.series["wall_surface"][:, 0]
        t = found.series["time"]
        expected = np.where(t <= 0.03 + 1e-9, 0.3 * np.sin(2.0 * np.pi * t / 0.02 + 1.0), -0.1)
        assert floor[1:] == pytest.approx(expected[1:], abs=1e-12)
        assert floor[0] == 0.0  # before the first step
        assert found.frames[-1].wall_surface.tolist() == [-0.1, 0.0, 0.0, 0.0]
        assert found.frames[-1].wall_position[0].tolist() == [0.0, 0.0, 0.0]


def test_only_the_named_group_is_held(whole):
    """Small grains start above and below the sieve and in it; large ones stay on their side."""
    with open_run(whole) as found:
        large, first, last = in_group(found, "large"), found.frames[0], found.frames[-1]
        above = first.position[:, 1] > HEIGHT
        assert (above[large] == (last.position[large, 1] > HEIGHT)).all()
        fell = above & ~large & (last.position[:, 1] < HEIGHT - 1e-3)
        assert fell.sum() >= 3
        wall = found.model.shapes.wall
        for frame in found.frames:
            at_wall = frame.contacts.j >= large.size
            of_sieve = wall[frame.contacts.j[at_wall] - large.size] == 3
            assert large[frame.contacts.i[at_wall][of_sieve]].all()
        start, radius = first.position[~large, 1], found.model.grains.radius[~large]
        assert (np.abs(start - HEIGHT) < radius).any()  # their packing lies across it


@pytest.mark.parametrize("step", [37, 60, 81])  # 60: between the stages
def test_stopped_runs_go_on_to_the_same_bits(whole, tmp_path, step):
    path = written(tmp_path / "sieve.toml", SIEVE)
    assert in_pieces(path, tmp_path / "run", step, threads=2) == digests(whole)


def test_the_exported_problem_is_the_one_that_the_engine_solves(whole):
    with open_run(whole) as found:
        problem = frame_problem(found, 8).problem
        state = found.frames[8]
        moving = problem.slide[problem.slide != 0.0]
        assert moving.size
        assert (moving == 0.1).all()  # V_s = -0.1
        n = found.model.grain_count
        i, j = problem.pair.T
        assert (found.model.grains.group[i[j == n + 3]] == 0).all()
        assert state.stage == 1


def test_a_program_lets_a_surface_run(tmp_path):
    """In a stage that it adds; what it reads, and the scenario with this stage, which gives the
    same bits."""
    read = []

    def steer(now):
        read.append(now.walls["floor"].surface)
        if now.step == 20:
            now.end_stage(
                then={"duration": 0.02, "drives": {"floor": {"surface": {"velocity": 0.05}}}}
            )
        if now.step == 40:
            now.end_run()

    scenario = Scenario.from_dict(tomllib.loads(BELT))
    run(scenario, tmp_path / "steered", steer=steer)
    assert read[19] == pytest.approx(0.3 * np.sin(2.0 * np.pi * 0.01 / 0.02 + 1.0))
    assert set(read[20:]) == {0.05}
    with open_run(tmp_path / "steered") as steered:
        again = parse_scenario(steered.scenario_resolved, "again.toml")
    run(again, tmp_path / "again")
    assert digests(tmp_path / "again")[0] == digests(tmp_path / "steered")[0]


def test_a_state_of_other_walls_does_not_fit():
    model, state = build(parse_scenario(BELT, "belt.toml"))
    assert find_misfit(state, model) is None
    state.wall_surface = np.zeros(2)
    assert "wall_surface has shape (2,)" in str(find_misfit(state, model))
    state.wall_surface = np.full(3, np.inf)
    assert find_misfit(state, model) == "the wall surface of wall floor is not finite"


def test_a_wall_cuts_those_alone_that_meet_it(tmp_path):
    """Grains from a file across a wall: refused if they meet it, by their names."""
    written(tmp_path / "grains.csv", "x,y,radius\n0.006,0.0075,0.0006\n")
    begin, end = SIEVE.index("[[particles]]"), SIEVE.index("[[walls]]")
    group = (
        '[[particles]]\nname = "{0}"\nmaterial = "glass"\nshape = "sphere"\n'
        'packing = {{ kind = "file", path = "{0}.csv" }}\n'
    )

    def placed(met, *names):
        groups = "".join(map(group.format, names))
        walls = changed(SIEVE[end:], ('groups = ["large"]', f'groups = ["{met}"]'))
        return place(load_scenario(written(tmp_path / "one.toml", SIEVE[:begin] + groups + walls)))

    for name, y in (("small", 0.0075), ("large", 0.0075), ("other", 0.012)):
        written(tmp_path / f"{name}.csv", f"x,y,radius\n0.006,{y},0.0006\n")
    with pytest.raises(ScenarioError, match="the wall 'sieve' cuts grains at the start"):
        placed("large", "large")
    meets = placed("other", "other", "small").model.walls.meets
    assert meets.tolist() == [[True, True]] * 3 + [[True, False]]


def test_no_law_is_needed_with_walls_that_nobody_of_a_group_meets():
    text = changed(
        SIEVE,
        ("[[contacts]]",
            "[materials.net]\ndensity = 1000.0\n[materials.sand]\ndensity = 1000.0\n[[contacts]]"),
        ('pair = ["*", "*"]', 'pair = ["glass", "*"]'),
        ('name = "small"\nmaterial = "glass"', 'name = "small"\nmaterial = "sand"'),
        ("[[particles]]", '[[contacts]]\npair = ["sand", "sand"]\nfriction = 0.1\n[[particles]]'),
        ('name = "sieve"\nmaterial = "glass"', 'name = "sieve"\nmaterial = "net"'),
    )  # fmt: skip
    model, _ = build(parse_scenario(text, "sieve.toml"))
    sand, net = model.materials.index("sand"), model.materials.index("net")
    assert model.laws.friction[0, net] == 0.3
    assert model.laws.friction[sand, net] == 0.0
    with pytest.raises(ScenarioError, match="net"):
        parse_scenario(changed(text, ('groups = ["large"]', 'groups = ["small"]')), "sieve.toml")


def test_going_on_leaves_out_contacts_with_walls_that_are_not_met_any_more(whole, tmp_path):
    begin, end = SIEVE.index("[[particles]]"), SIEVE.index("[[walls]]")
    found = {}
    for frame in range(-1, -20, -1):
        text = SIEVE[:begin] + f'[start]\nrun = "{whole}"\nframe = {frame}\n' + SIEVE[end:]
        try:
            for group in ("large", "small"):
                changes = ('groups = ["large"]', f'groups = ["{group}"]')
                path = written(tmp_path / f"{group}.toml", changed(text, changes))
                found[group] = build(load_scenario(path))
        except ScenarioError:  # a small grain is just passing
            continue
        break
    for group, is_met in (("large", True), ("small", False)):
        model, state = found[group]
        j = state.contact_j[state.contact_j >= model.grain_count] - model.grain_count
        assert (model.shapes.wall[j] == 3).any() == is_met
        assert state.wall_surface.tolist() == [-0.1, 0.0, 0.0, 0.0]


def test_grains_are_released_in_a_wall_that_they_do_not_meet():
    """The first place is taken by nobody: in a plane below which no other group finds room."""
    release = "release = { rate = 1e3, region = { min = [0.002, 0.001], max = [0.01, 0.006] } }"
    text = changed(
        SIEVE, ('count = 25\npacking = { kind = "random" }\nspin = 20.0', f"count = 25\n{release}")
    )
    text = text.replace(
        'kind = "polyline", points = [[0.0, 0.008], [0.012, 0.007]]',
        'kind = "plane", point = [0.0, 0.01], normal = [0.0, 1.0]',
    )
    scenario = parse_scenario(text, "sieve.toml")
    model, state = build(scenario)
    (release,) = inflow_rules(scenario, model).releases
    grain = int(np.flatnonzero(model.grains.group == 1)[0])
    assert find_room(release, 0, grain, model, state) is not None
    everybody = replace(model, walls=replace(model.walls, meets=np.zeros((0, 0), np.bool_)))
    assert find_room(release, 0, grain, everybody, state) is None


def test_heat_goes_to_those_alone_that_meet_a_hot_wall(tmp_path):
    """By contact, through gas and by radiation; while nothing moves too. A wall keeps the groups
    apart."""
    material = (
        "young = 70e9\npoisson = 0.22\nconductivity = 1.0\nheat_capacity = 800.0\nemissivity = 0.9"
    )
    heat = """\
[heat]
temperature = 300.0
friction = "none"
impact = false
gas = { conductivity = 0.03 }
radiation = { neighbors = true }
[[contacts]]"""
    between = """\
[[walls]]
name = "between"
material = "glass"
geometry = { kind = "polyline", points = [[0.006, 0.0], [0.006, 0.04]] }
[[loading]]"""
    apart = changed(
        shortened(SIEVE, 1),
        ("density = 2500.0", f"density = 2500.0\n{material}"),
        ("[[contacts]]", heat),
        ('kind = "polyline", points = [[0.0, 0.008], [0.012, 0.007]]',
            'kind = "plane", point = [0.0, 0.0], normal = [0.0, 1.0]'),
        ('groups = ["large"]', 'groups = ["large"]\nthermal = { temperature = 400.0 }'),
        ('name = "large"', 'name = "large"\nregion = { min = [0.0, 0.0], max = [0.005, 0.02] }'),
        ('name = "small"', 'name = "small"\nregion = { min = [0.007, 0.0], max = [0.012, 0.02] }'),
        ("[[loading]]", between),
        ("\n[solver]", "\n[[loading]]\nduration = 0.01\nfrozen = true\n[solver]"),
    )  # fmt: skip
    run(written(tmp_path / "hot.toml", apart), tmp_path / "run")
    with open_run(tmp_path / "run") as found:
        large = in_group(found, "large")
        temperature = found.frames[-1].temperature
        assert temperature[large].max() > 300.01
        assert temperature[~large].max() == 300.0
        assert found.info["summary"]["heat_closure"] < 1e-12


def test_nothing_changes_where_all_groups_are_named():
    """The list is the same, and so is the state."""
    ends = set()
    for named in ("", 'groups = ["large", "small"]\n'):
        text = changed(SIEVE, ('groups = ["large"]\n', named))
        model, state = build(parse_scenario(text, "sieve.toml"))
        engine = Engine(model, state, threads=1)
        for k in range(30):
            engine.step(5e-4, 5e-4 * k)
        ends.add(state.digest())
    assert len(ends) == 1
