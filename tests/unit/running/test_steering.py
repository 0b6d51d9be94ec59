"""A program steers a run: it ends stages, adds others, ends the run; what it did is kept, and can
be done again without it."""

import math
import re
import signal
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from places import ROOT
from run_fakes import StopAt
from scenarios import digests
from scenes import SMALL, WARM, write_small

from multicor_cli import LiveRun, Scenario, ScenarioError, open_run, run
from multicor_cli.running.outcome import StopReason
from multicor_cli.scenario import parse_scenario
from multicor_cli.store import DirectoryRefused, run_info, verify

SHORT = """
[[loading]]
name = "settle"
duration = 0.004
drives.top = { y = { force = -0.1, damping = 0.1 } }

[[loading]]
name = "shear"
duration = 0.01
drives.top = { x = { velocity = { ramp = [0.0, 0.1], duration = 0.008 } } }

[[loading]]
name = "on"
duration = 0.002
"""
SLOWER = {"name": "slower", "duration": 0.004, "drives": {"top": {"x": {"velocity": 0.02}}}}
DT = 2e-4
MIDDLE = 0.01
"""Where the top wall is at first, in x [m]."""


def scenario(loading=SHORT):
    return Scenario.from_dict(tomllib.loads(SMALL) | tomllib.loads(loading))


def same(folder, *names):
    """Whether two runs have the same bits, and the same things were decided."""
    first, second = (folder / name for name in names)
    assert digests(first) == digests(second)
    for key in ("steering", "stages"):
        assert run_info(first)[key] == run_info(second)[key]


def at(step, do):
    def steer(now):
        if now.step == step:
            do(now)

    return steer


def when_pushed(now):
    """Count calls; slow down once when the top wall has been pushed for a while, then stop when it
    has gone far enough."""
    notes, top = now.notes, now.walls["top"]
    notes["calls"] = notes.get("calls", 0) + 1
    notes["work"] = notes.get("work", 0.0) + float(top.force[0] * top.velocity[0]) * now.dt
    if now.stage == "shear" and now.stage_time > 0.005:
        now.end_stage(then=SLOWER)
    elif now.stage == "slower" and top.position[0] > MIDDLE + 1.9e-4:
        now.end_run()


def test_ending_a_stage_is_a_shorter_stage(tmp_path):
    run(scenario(), tmp_path / "steered", steer=at(35, LiveRun.end_stage))
    run(scenario().with_({"loading.1.duration": 15 * DT}), tmp_path / "short")
    assert digests(tmp_path / "steered") == digests(tmp_path / "short")
    ends = run_info(tmp_path / "steered")["stage_ends"]
    assert [(end["name"], end["reason"], end["step"]) for end in ends] == [
        ("settle", "duration", 20), ("shear", "steered", 35), ("on", "duration", 45),
    ]  # fmt: skip
    assert verify(tmp_path / "steered") == []


def test_a_condition_in_the_program_is_one_in_the_file(tmp_path):
    until = 'until = { displacement = { wall = "top", axis = "x", above = 1.05e-4 } }\n'

    def steer(now):
        if now.stage == "shear" and now.walls["top"].position[0] - MIDDLE >= 1.05e-4:
            now.end_stage()

    run(scenario(), tmp_path / "steered", steer=steer)
    named = SHORT.replace('name = "shear"\n', f'name = "shear"\n{until}')
    run(scenario(named), tmp_path / "file")
    assert run_info(tmp_path / "file")["stage_ends"][1]["reason"] == "condition"
    assert digests(tmp_path / "steered") == digests(tmp_path / "file")


def test_another_drive_is_another_stage(tmp_path):
    run(scenario(), tmp_path / "steered", steer=at(35, lambda now: now.end_stage(then=SLOWER)))
    first, second, third = tomllib.loads(SHORT)["loading"]
    loading = [first, {**second, "duration": 15 * DT}, SLOWER, third]
    run(Scenario.from_dict(tomllib.loads(SMALL) | {"loading": loading}), tmp_path / "file")
    assert digests(tmp_path / "steered") == digests(tmp_path / "file")
    with open_run(tmp_path / "steered") as steered:
        assert steered.stages == ("settle", "shear", "slower", "on")
        assert abs(steered.info["summary"]["energy_closure"]) < 1e-12


def test_heat_and_gravity_are_changed_too(tmp_path):
    then = {"duration": 0.002, "gravity": [0.0, -1.62], "heat": False}
    warm = parse_scenario(WARM, "warm.toml").with_({"loading.0.duration": 0.01})
    dt = warm.stage_solver(0).dt
    run(warm, tmp_path / "steered", steer=at(5, lambda now: now.end_stage(then=then)))
    first, *rest = warm.as_dict()["loading"]
    loading = [{**first, "duration": 5 * dt}, then, *rest]
    run(Scenario.from_dict(warm.as_dict() | {"loading": loading}), tmp_path / "file")
    assert digests(tmp_path / "steered") == digests(tmp_path / "file")


def test_without_the_program_the_bits_are_the_same(tmp_path):
    """What was carried out is a scenario, kept in the run and in results.h5 alone."""
    run(scenario(), tmp_path / "steered", steer=when_pushed)
    for place in ("steered", "steered/results.h5"):
        with open_run(tmp_path / place) as steered:
            assert len(steered.info["steering"]["decisions"]) == 2
            assert steered.stages == ("settle", "shear", "slower")
            again = parse_scenario(steered.scenario_resolved, "again.toml")
        run(again, tmp_path / "again", overwrite=True)
        assert digests(tmp_path / "again") == digests(tmp_path / "steered")


def test_a_run_that_is_stopped_goes_on_as_it_would_have(tmp_path):
    """Stopped before, at and after decisions, with notes that must come back."""
    steered = {"steer": when_pushed, "steer_every": 2}
    run(scenario(), tmp_path / "whole", **steered)
    assert run_info(tmp_path / "whole")["stage_ends"][1]["step"] == 46
    for step in (1, 7, 20, 33, 45, 46, 47, 50):
        stopped = run(scenario(), tmp_path / "run", observer=StopAt(step), **steered)
        assert (stopped.reason, stopped.step) == (StopReason.TERMINATED, step)
        assert verify(tmp_path / "run") == []
    assert run(scenario(), tmp_path / "run", threads=2, **steered).is_finished
    same(tmp_path, "run", "whole")


def test_decisions_after_the_last_checkpoint_are_made_again(tmp_path, monkeypatch):
    """The process dies after a decision that no checkpoint has: run.json, which may know it
    already, is put right."""
    run(scenario(), tmp_path / "whole", steer=when_pushed)
    run(scenario(), tmp_path / "run", steer=when_pushed, observer=StopAt(40))
    script = tmp_path / "die.py"
    script.write_text(
        f"import os, sys\nsys.path[:0] = {[str(Path(__file__).parent), *sys.path]!r}\n"
        "os.environ['MULTICOR_KILL_AT'] = 'checkpointjson.after_tmp'\n"
        "from test_steering import *\n"
        f"run(scenario(), {str(tmp_path / 'run')!r}, steer=when_pushed, observer=StopAt(48))\n"
    )
    assert subprocess.run([sys.executable, script], check=False).returncode == -signal.SIGKILL
    assert run(scenario(), tmp_path / "run", steer=when_pushed).is_finished
    same(tmp_path, "run", "whole")


def test_a_program_that_fails_loses_nothing(tmp_path):
    run(scenario(), tmp_path / "whole", steer=when_pushed)

    def failing(now):
        when_pushed(now)
        if now.step == 33:
            raise ZeroDivisionError("no idea")

    with pytest.raises(ZeroDivisionError, match="no idea"):
        run(scenario(), tmp_path / "run", steer=failing)
    info = run_info(tmp_path / "run")
    assert (info["status"], info["step"]) == ("failed", 32)
    assert info["stop_reason"] == "the program that steers the run: ZeroDivisionError: no idea"
    assert verify(tmp_path / "run") == []
    assert run(scenario(), tmp_path / "run", steer=when_pushed).is_finished
    assert digests(tmp_path / "run") == digests(tmp_path / "whole")


def test_a_wrong_stage_is_refused_as_in_a_file(tmp_path):
    then = {"duration": 1.0, "drives": {"lid": {"x": {"velocity": 0.1}}}}
    with pytest.raises(ScenarioError) as caught:
        run(scenario(), tmp_path / "run", steer=at(30, lambda now: now.end_stage(then=then)))
    assert [problem.key for problem in caught.value.problems] == ["loading.2.drives.lid"]
    assert run_info(tmp_path / "run")["step"] == 29
    assert run_info(tmp_path / "run")["steering"]["decisions"] == []


@pytest.mark.parametrize("value", [(1, 2), {3: 4}, float("nan"), object()])
def test_notes_must_come_back_as_they_are(value, tmp_path):
    with pytest.raises(ValueError, match="the notes of the program"):
        run(scenario(), tmp_path / "run", steer=lambda now: now.notes.update(of=value))


SHOWN = ("position", "velocity", "spin", "angle", "temperature")


def test_what_is_read_is_right_and_cannot_be_changed(tmp_path):
    warm = parse_scenario(WARM, "warm.toml").with_(
        {"loading.0.duration": 0.004, "output.frame_interval": 5e-4, "output.series_interval": 5e-4}
    )
    seen = {}

    def steer(now):
        arrays = {name: getattr(now, name) for name in (*SHOWN, "number")}
        walls = [(wall.position, wall.velocity, wall.force) for wall in now.walls.values()]
        for array in [*arrays.values(), *sum(walls, ()), now.contacts.impulse, now.contacts.gap]:
            with pytest.raises(ValueError, match="read-only"):
                array[...] = 0
        seen[now.step] = {
            **{name: array.copy() for name, array in arrays.items()},
            "books": now.books,
            "gap": now.contacts.gap,
            "force": [wall.force for wall in now.walls.values()],
            "time": now.time,
        }

    run(warm, tmp_path / "run", steer=steer)
    run(warm, tmp_path / "free")
    assert digests(tmp_path / "run") == digests(tmp_path / "free")
    with open_run(tmp_path / "run") as found:
        steps = {int(frame.step): frame for frame in found.frames}
        rows = {int(step): row for row, step in enumerate(found.series["step"])}
        assert len(seen) > 5
        for step, values in seen.items():
            frame, row = steps[step], rows[step]
            for name in SHOWN:
                np.testing.assert_array_equal(values[name], getattr(frame, name))
            np.testing.assert_array_equal(values["gap"], frame.contacts.gap)
            assert values["time"] == frame.time
            assert values["books"]["friction_loss"] == found.series["friction_loss"][row]
            force = found.series["wall_force"][row]
            np.testing.assert_allclose(values["force"], force, rtol=1e-12, atol=1e-15)


def test_frozen_stages_are_not_steered(tmp_path):
    warm, seen = parse_scenario(WARM, "warm.toml"), set()
    frozen = {stage.name for stage in warm.loading if stage.frozen}
    run(warm, tmp_path / "run", steer=lambda now: seen.add(now.stage))
    assert frozen
    assert seen
    assert not seen & frozen


def with_stages(stages):
    return SMALL[: SMALL.index("[[loading]]")] + stages + SMALL[SMALL.index("[solver]") :]


def test_a_steered_run_goes_on_with_its_program_only(tmp_path, typed):
    path = write_small(tmp_path, with_stages(SHORT))
    run(path, tmp_path / "run", steer=when_pushed, observer=StopAt(10))
    by = "by the Python program test_steering.when_pushed"
    said = typed("run small.toml -o run", 6).stderr.replace("\n", " ")
    assert f"run: is steered {by}; go on with it" in said
    with pytest.raises(DirectoryRefused, match="no stages can be added"):
        run(path, tmp_path / "run", extend=True)
    with pytest.raises(DirectoryRefused, match="began with steer_every=1"):
        run(path, tmp_path / "run", steer=when_pushed, steer_every=3)
    assert run(path, tmp_path / "run", steer=when_pushed).is_finished
    assert run(path, tmp_path / "run").reason is StopReason.ALREADY_FINISHED
    shown = typed("info run").stdout
    assert f"{by}, asked every 1 step: 2 decisions" in shown
    assert "ended by the program that steers the run" in shown
    run(path, tmp_path / "free", observer=StopAt(10))
    with pytest.raises(DirectoryRefused, match="began without steer"):
        run(path, tmp_path / "free", steer=when_pushed)


def test_the_example_of_the_page_runs(tmp_path, monkeypatch):
    (code,) = re.findall(
        r"```python\n(.*?)```",
        (ROOT / "docs" / "how-to" / "steering.md").read_text(encoding="utf-8"),
        re.DOTALL,
    )
    loading = (
        '[[loading]]\nname = "compress"\nduration = 0.1\ndrives.top = { y = { velocity = -0.1 } }\n'
    )
    (tmp_path / "configs").mkdir()
    (tmp_path / "configs" / "biaxial.toml").write_text(with_stages(loading))
    monkeypatch.chdir(tmp_path)
    exec(code.replace("LOW, HIGH, CYCLES = 4.0, 6.0, 3", "LOW, HIGH, CYCLES = 0.1, 1.0, 3"), {})
    info = run_info("runs/cycles")
    names = ["compress", "unload-0", "load-0", "unload-1", "load-1", "unload-2", "load-2"]
    assert [(end["name"], end["reason"]) for end in info["stage_ends"]] == [
        (name, "steered") for name in names
    ]
    assert info["steering"]["notes"]["cycles"] == 3


def test_there_is_no_time_between_calls_below_a_step():
    with pytest.raises(ValueError, match="at least 1, is 0"):
        run(scenario(), steer=when_pushed, steer_every=0)


class Watch:
    """Counts what it is told."""

    steps = ended = 0

    def message(self, text):
        pass

    def warning(self, text):
        pass

    def stepped(self, status):
        self.steps += 1

    def closed(self):
        self.ended += 1


def test_an_observer_hears_of_every_step_and_what_is_none_is_refused(tmp_path):
    scene, watch = write_small(tmp_path), Watch()
    shorter = ["loading.1.until.strain.value=0.01"]
    outcome = run(scene, tmp_path / "run", overrides=shorter, observer=watch, threads=1)
    assert (watch.steps, watch.ended) == (outcome.step, 1)
    with pytest.raises(ValueError, match="name of the run directory is empty"):
        run(scene, "")


@pytest.mark.parametrize(("wrong", "message"), [
    ({"observer": print}, "lacks message, warning, stepped, closed"),
    ({"observer": Watch}, r"give Watch\(\), not the class"),
    ({"steer": 5}, "steer is a function of a LiveRun, is 5"),
    ({"scenario": {"domain": {}}}, "as of load_scenario or Scenario.from_dict.*; is dict"),
    ({"max_hours": math.nan}, "max_hours must not be negative, is nan"),
    ({"max_hours": -1.0}, "max_hours must not be negative, is -1"),
])  # fmt: skip
def test_what_is_wrong_is_said_before_anything_begins(wrong, message, tmp_path):
    given = {"scenario": write_small(tmp_path), **wrong}
    with pytest.raises((TypeError, ValueError), match=message):
        run(**given, directory=tmp_path / "other")
    assert not (tmp_path / "other").exists()


@pytest.mark.parametrize("step", [1, 20, 53])
def test_an_observer_that_fails_loses_nothing(step, tmp_path):
    run(scenario(), tmp_path / "whole", steer=when_pushed)

    class Failing(Watch):
        def stepped(self, status):
            if status.state.step == step:
                raise ZeroDivisionError("no idea")

    with pytest.raises(ZeroDivisionError, match="no idea"):
        run(scenario(), tmp_path / "run", steer=when_pushed, observer=Failing())
    info = run_info(tmp_path / "run")
    assert (info["status"], info["step"]) == ("failed", step)
    assert info["stop_reason"] == "the observer: ZeroDivisionError: no idea"
    assert run(scenario(), tmp_path / "run", steer=when_pushed).is_finished
    same(tmp_path, "run", "whole")
