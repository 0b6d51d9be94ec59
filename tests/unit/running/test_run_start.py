"""A run goes on from another: a run cut in two is the run that was not cut, and what does not fit
is refused."""

import json
import shutil
import signal

import numpy as np
import pytest
from command_line import call
from cut_runs import (
    BELT,
    BODY,
    BOX,
    CELL,
    HOT,
    INELASTIC,
    NAMED,
    SHAPED,
    STICKY,
    WET,
    going_on,
    shortened,
    unlike,
    written,
)
from run_fakes import StopAt
from scenes import changed

from multicor_cli import run as run_scenario
from multicor_cli.packing import place
from multicor_cli.running import session as session_module
from multicor_cli.running.outcome import StopReason
from multicor_cli.scenario import load_scenario, parse_scenario
from multicor_cli.scenario.problems import ScenarioError
from multicor_cli.store import open_run, run_info, verify

CASES = {
    "box": (BOX, 1), "small": (NAMED, 1), "sticky": (STICKY, 1), "wet": (WET, 1),
    "before frozen": (HOT, 1), "after frozen": (HOT, 2), "body": (BODY, 1), "belt": (BELT, 1),
    "cell": (CELL, 1), "shapes": (SHAPED, 1), "inelastic": (INELASTIC, 1),
}  # fmt: skip
"""Scenarios, and after how many stages they are cut."""


LID = (
    '[[walls]]\nname = "lid"\nmaterial = "glass"\n'
    'geometry = { kind = "plane", point = [0.0, 0.02], normal = [0.0, -1.0] }\n'
)


def group_of(name, more="", shape="sphere", kind="start"):
    head = f'[[particles]]\nname = "{name}"\nmaterial = "glass"\nshape = "{shape}"\n'
    return f'{head}packing = {{ kind = "{kind}" }}\n{more}'


def state_of(directory):
    with open_run(directory) as run:
        return run.state()


def placed_at(folder, text):
    return place(load_scenario(written(folder / "placed.toml", text)))


@pytest.fixture(scope="module")
def place_of(tmp_path_factory):
    """Makes the folder of a case, once: the whole run, and its first stages."""
    made = {}

    def make(case):
        if case not in made:
            text, stages = CASES[case]
            folder = tmp_path_factory.mktemp("cut")
            run_scenario(written(folder / "whole.toml", text), folder / "whole", threads=1)
            run_scenario(written(folder / "first.toml", shortened(text, stages)), folder / "first")
            made[case] = folder
        return made[case]

    return make


@pytest.mark.parametrize("case", CASES)
def test_a_run_cut_in_two_is_the_run_that_was_not_cut(case, place_of):
    """In all that the next step depends on; in the box the grains outnumber nothing that runs on
    more than one thread."""
    folder, (text, stages) = place_of(case), CASES[case]
    scenario = load_scenario(written(folder / "second.toml", going_on(text, stages, "first")))
    assert run_scenario(scenario, folder / "second", threads=2).is_finished
    whole, second = state_of(folder / "whole"), state_of(folder / "second")
    assert unlike(whole, second) == []
    with (
        open_run(folder / "whole") as a,
        open_run(folder / "first") as b,
        open_run(folder / "second") as c,
    ):
        assert len(b.frames) + len(c.frames) - 1 == len(a.frames)
        assert np.array_equal(a.frames[-2].position, c.frames[-2].position)
        if a.model.thermal is not None and c.model.thermal is not None:
            assert np.array_equal(
                whole.temperature(a.model.thermal), second.temperature(c.model.thermal)
            )
            assert c.info["summary"]["heat_closure"] < 1e-13
        assert c.info["summary"]["energy_closure"] < 1e-13
        assert (second.stage, c.frames.time[0], c.frames.step[0]) == (len(c.stages), 0.0, 0)
        assert parse_scenario(c.scenario_resolved, folder / "second.toml") == scenario
    assert verify(folder / "second") == []


def test_a_run_that_goes_on_can_be_stopped_and_gone_on_from(place_of, tmp_path):
    """Stopped in its last stage, where a signal is kept; the run that it came from is gone by then.
    A third part follows."""
    folder = place_of("after frozen")
    shutil.copytree(folder / "first", tmp_path / "first")
    second = written(tmp_path / "second.toml", going_on(HOT, 2, "first"))
    outcome = run_scenario(second, tmp_path / "second", observer=StopAt(12))
    assert (outcome.reason, run_info(tmp_path / "second")["stage"]) == (StopReason.TERMINATED, 1)
    shutil.rmtree(tmp_path / "first")
    assert run_scenario(second, tmp_path / "second").is_finished
    assert unlike(state_of(folder / "whole"), state_of(tmp_path / "second")) == []
    assert run_scenario(
        written(tmp_path / "third.toml", going_on(HOT, 2, "second")), tmp_path / "third"
    ).is_finished
    info = run_info(tmp_path / "third")
    assert info["origin"]["run"] == str(tmp_path / "second")
    assert max(info["energy_closure"], info["heat_closure"]) < 1e-12


def test_the_last_frame_is_the_end_where_frames_hold_all(place_of):
    """Without heat, adhesion and rebounds, in double precision: positions are those of the state,
    and impulses are recorded (those of impacts do not last). Contacts are sought anew, so that
    steps differ in their last bits."""
    folder = place_of("inelastic")
    starts = [
        placed_at(folder, going_on(INELASTIC, 1, "first", *frame)).state
        for frame in ((), ("frame = -1",))
    ]
    assert set(unlike(*starts)) <= {"near_i", "near_j", "tile"}
    with open_run(folder / "first") as first:
        text = going_on(INELASTIC, 1, "first", "frame = -1")
        assert placed_at(folder, text).origin.frame == len(first.frames) - 1


def test_a_frame_gives_its_temperatures(place_of):
    folder = place_of("after frozen")
    placed = placed_at(folder, going_on(HOT, 2, "first", "frame = 3"))
    with open_run(folder / "first") as run:
        frame = run.frames[3]
        assert np.array_equal(placed.state.temperature(placed.model.thermal), frame.temperature)
        assert np.array_equal(placed.state.velocity[:, :2], frame.velocity)
        loaded = frame.contacts.impulse[:, 0] > 0.0
        assert np.array_equal(placed.state.contact_impulse, frame.contacts.impulse[loaded])
        assert placed.state.last_dt == frame.dt
    assert (placed.origin.frame, placed.origin.step) == (3, frame.step)


def contacts_by_wall(model, state):
    """Impulses of the contacts with walls that have one shape, by grain and wall."""
    n, names = len(state.position), [model.walls.names[w] for w in model.shapes.wall]
    rows = zip(state.contact_i, state.contact_j, state.contact_impulse.tolist(), strict=True)
    return {(int(i), names[j - n]): tuple(p) for i, j, p in rows if j >= n}


def test_walls_are_known_by_their_names(place_of):
    """In another order, one of them gone, one new, one that the file has elsewhere: where the run
    has moved it counts."""
    folder = place_of("box")
    text = going_on(BOX, 1, "first")
    begin, end = text.index('[[walls]]\nname = "floor"'), text.index('[[walls]]\nname = "right"')
    floor, left = (f"[[walls]]{part}" for part in text[begin:end].split("[[walls]]")[1:])
    text = changed(text, (floor + left, ""), ("[[loading]]", floor + LID + "[[loading]]"))
    placed = placed_at(folder, text)
    with open_run(folder / "first") as run:
        before, state = run.model, run.state()
    assert placed.model.walls.names == ("right", "floor", "lid")
    assert (placed.origin.walls, placed.origin.new_walls, placed.origin.lost_walls) == (
        ("right", "floor"), ("lid",), ("left",),
    )  # fmt: skip
    assert (
        placed.state.wall_position[0].tolist()
        == state.wall_position[2].tolist()
        != [0.012, 0.0, 0.0]
    )
    assert placed.state.wall_velocity[0].tolist() == [-0.02, 0.0, 0.0]
    assert placed.state.wall_position[2].tolist() == [0.0, 0.02, 0.0]
    kept = {key: p for key, p in contacts_by_wall(before, state).items() if key[1] != "left"}
    assert contacts_by_wall(placed.model, placed.state) == kept
    assert kept
    key = placed.state.contact_i.astype(np.int64) * 1000 + placed.state.contact_j
    assert (np.diff(key) > 0).all()


def test_rough_walls_are_those_of_the_run_whatever_the_seed(place_of):
    folder = place_of("small")
    text = changed(going_on(NAMED, 1, "first"), ("seed = 3", 'seed = "random"'))
    run_scenario(written(folder / "seed.toml", text), folder / "seed")
    assert unlike(state_of(folder / "whole"), state_of(folder / "seed")) == []


def test_a_wall_of_another_shape_stands_where_the_run_has_it_and_carries_nothing(place_of):
    folder = place_of("small")
    text = changed(going_on(NAMED, 1, "first"), (
        '{ kind = "rough", from = [0.0, 0.01], to = [0.02, 0.01], side = "right" }',
        '{ kind = "plane", point = [0.0, 0.03], normal = [0.0, -1.0] }\nmass = 1e-3',
    ))  # fmt: skip
    state = state_of(folder / "first")
    placed = placed_at(folder, text)
    assert placed.state.wall_position[1].tolist() == state.wall_position[1].tolist()
    n, bottom = placed.model.grain_count, int((placed.model.shapes.wall == 0).sum())
    assert placed.state.contact_j.max() < n + bottom < state.contact_j.max()
    assert placed.state.contact_i.size == int((state.contact_j < n + bottom).sum())


def test_materials_are_those_of_the_new_file(place_of):
    """Grains whose heat capacity changes keep their temperature; their heat counts from there."""
    folder = place_of("after frozen")
    state = state_of(folder / "first")
    placed = placed_at(folder, changed(going_on(HOT, 2, "first"), ("7500.0", "5000.0")))
    with open_run(folder / "first") as run:
        mass, temperature = run.model.grains.mass, state.temperature(run.model.thermal)
    assert np.allclose(placed.model.grains.mass, mass * (5000.0 / 7500.0), rtol=1e-15, atol=0.0)
    assert np.array_equal(placed.model.thermal.initial_temperature, temperature)
    assert not placed.state.heat.any()
    assert placed.state.heat_before.size == 0
    assert np.array_equal(placed.state.velocity, state.velocity)


def test_another_adhesion_leaves_the_impulses_as_they_are(place_of):
    """q = p + F Δt: what the contacts carry, p, does not depend on the new file."""
    folder = place_of("sticky")
    text = going_on(STICKY, 1, "first")
    same = placed_at(folder, text).state
    more = placed_at(folder, changed(text, ("adhesion = 1e-3", "adhesion = 3e-3"))).state
    none = placed_at(folder, changed(text, ("adhesion = 1e-3\nrolling_friction = 0.05", ""))).state
    carried = same.contact_impulse[:, 0]
    attraction = 0.5 * (more.contact_impulse[:, 0] - carried)  # of 1 mN across the gaps
    assert (attraction >= 0.0).all()
    assert attraction.max() <= 1e-3 * same.last_dt * (1.0 + 1e-9)
    less = np.maximum(carried - attraction, 0.0)
    assert np.allclose(none.contact_impulse[:, 0], less, atol=1e-20)
    assert none.contact_couple.size == 0
    assert same.contact_couple.size == same.contact_i.size


def test_groups_may_be_named_to_change_them(place_of):
    folder = place_of("box")
    groups = group_of("large", "velocity = [0.5, 0.0]\n") + group_of("small")
    text = changed(going_on(BOX, 1, "first"), ("[[walls]]", groups + "[[walls]]"))
    placed, state = placed_at(folder, text), state_of(folder / "first")
    assert np.array_equal(placed.state.velocity[:25, 0], state.velocity[:25, 0] + 0.5)
    assert np.array_equal(placed.state.velocity[25:], state.velocity[25:])


SIZES = 'count = 5\nsizes = { kind = "uniform", min = 1e-4, max = 2e-4 }\n'
DISCS = "".join(group_of(name, "thickness = 1e-3\n", "disc") for name in ("large", "small"))
RUN, WALLS = 'run = "first"\n', "[[walls]]"
LAW = '[[contacts]]\npair = ["*", "*"]\nfriction = 0.3\nrestitution = 0.5'

REFUSED = {
    "no run": ('"first"', '"nowhere"', "start.run", "not a run directory", "give the directory"),
    "no frame": (RUN, RUN + "frame = 99", "start.frame", "no frame 99", "choose another frame"),
    "both": (RUN, RUN + 'at = "end"\nframe = 1', "start.frame", "both", "one of them"),
    "unknown": (RUN, RUN + 'at = "now"', "start.at", "'end'", "or give frame"),
    "small domain": ("size = [0.012", "size = [0.006", "domain.size", "grains of the run",
        "enlarge"),
    "no material": ("materials.glass", "materials.sand", "start.run", 'no material "glass"',
        "add [materials.glass]"),
    "no law": (LAW, "", "contacts", "no contact law", "add"),
    "grains": (WALLS, group_of("more", SIZES, kind="random") + WALLS, "particles.0.packing",
        "beside a table [start]", "remove [[particles]]"),
    "other groups": (WALLS, group_of("more") + WALLS, "particles", "has the groups large, small",
        "in their order"),
    "other shape": (WALLS, DISCS + WALLS, "particles.0.shape", "other grains than discs",
        "shape that they have"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_does_not_fit_is_refused(case, place_of):
    folder = place_of("box")
    old, new, key, message, remedy = REFUSED[case]
    with pytest.raises(ScenarioError) as caught:
        placed_at(folder, changed(going_on(BOX, 1, "first"), (old, new)))
    found = [problem for problem in caught.value.problems if problem.key == key]
    assert found, str(caught.value)
    assert message in found[0].message
    assert remedy in found[0].remedy
    assert found[0].line > 0


def test_another_period_is_refused(place_of):
    folder = place_of("small")
    text = changed(going_on(NAMED, 1, "first"), ("periodic = true", "periodic = false"))
    with pytest.raises(
        ScenarioError, match=r"the period is 0 m, that of the run '.*' 0\.02 m"
    ) as caught:
        placed_at(folder, text)
    assert caught.value.problems[0].key == "domain.size"


def test_start_groups_need_a_start():
    text = changed(BOX, ('packing = { kind = "random" }', 'packing = { kind = "start" }'))
    text = changed(
        text, ('sizes = { kind = "uniform", min = 0.5e-3, max = 0.7e-3 }\ncount = 25\n', "")
    )
    with pytest.raises(ScenarioError, match=r"without a table \[start\]"):
        parse_scenario(text, "box.toml")


def test_a_run_without_checkpoint_or_with_damage_is_refused(place_of, tmp_path):
    shutil.copytree(place_of("box") / "first", tmp_path / "first")
    path = written(tmp_path / "second.toml", going_on(BOX, 1, "first"))
    for file in (tmp_path / "first" / "checkpoints").glob("*.h5"):
        file.chmod(0o644)
        file.write_bytes(b"nothing")
    with pytest.raises(ScenarioError, match="damaged"):
        place(load_scenario(path))
    shutil.rmtree(tmp_path / "first" / "checkpoints")
    with pytest.raises(ScenarioError, match="has no checkpoint"):
        place(load_scenario(path))
    (tmp_path / "first" / "scenario.resolved.toml").unlink()
    with pytest.raises(ScenarioError, match=r"cannot go on from the run"):
        place(load_scenario(path))


def test_forces_are_needed_where_only_heat_flows(place_of):
    folder = place_of("before frozen")
    path = written(folder / "forces.toml", going_on(HOT, 1, "first", "frame = 0"))
    with pytest.raises(ScenarioError, match="forces of the contacts are not known") as caught:
        place(load_scenario(path))
    assert caught.value.problems[0].key == "loading.0.frozen"


def test_a_run_does_not_replace_the_one_that_it_goes_on_from(place_of):
    folder = place_of("box")
    path = written(folder / "same.toml", going_on(BOX, 1, "first"))
    before = (folder / "first" / "run.json").read_bytes()
    with pytest.raises(ScenarioError, match="would replace"):
        run_scenario(path, folder / "first", overwrite=True)
    assert (folder / "first" / "run.json").read_bytes() == before


def test_a_run_begins_once_more_from_the_same_moment_only(place_of, tmp_path, monkeypatch):
    """It was killed before its first checkpoint, and the other run has become another one since."""
    shutil.copytree(place_of("box") / "first", tmp_path / "first")
    path = written(tmp_path / "second.toml", going_on(BOX, 1, "first"))
    with monkeypatch.context() as patch:
        patch.setattr(
            session_module, "make_engine", lambda *_: signal.raise_signal(signal.SIGTERM) or exit(1)
        )
        with pytest.raises(SystemExit):
            run_scenario(path, tmp_path / "second")
    assert run_info(tmp_path / "second")["step"] is None
    run_scenario(
        written(tmp_path / "other.toml", changed(shortened(BOX, 1), ("seed = 11", "seed = 12"))),
        tmp_path / "first",
        overwrite=True,
    )
    with pytest.raises(ScenarioError, match="began from digest"):
        run_scenario(path, tmp_path / "second")
    shutil.rmtree(tmp_path / "first")
    shutil.copytree(place_of("box") / "first", tmp_path / "first")
    assert run_scenario(path, tmp_path / "second").is_finished


def test_commands_say_where_a_run_goes_on_from(place_of):
    folder = place_of("box")
    digest = run_info(folder / "first")["state_digest"]
    written(
        folder / "said.toml",
        changed(going_on(BOX, 1, "first"), ("[[loading]]", LID + "[[loading]]")),
    )
    done = call("validate", "said.toml", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert digest in done.stdout
    assert "new, not in that run: lid" in done.stdout
    as_json = json.loads(call("validate", "said.toml", "--json", cwd=folder).stdout)
    assert as_json["origin"]["digest"] == digest
    assert as_json["estimate"]["steps"] == 40
    assert call("run", "said.toml", "--dry-run", cwd=folder).returncode == 0
    assert call("run", "said.toml", "-o", "said", cwd=folder).returncode == 0
    assert digest in call("info", "said", cwd=folder).stdout
    with open_run(folder / "said" / "results.h5") as alone:
        assert alone.info["origin"]["digest"] == digest
