"""Stages are added to the end of a run with ``--extend``: it becomes, to the bit, the run that had
them from the start."""

import shutil
import signal

import pytest
from cut_runs import shortened, written
from run_fakes import StopAt
from scenarios import digests
from scenes import SMALL, WARM, changed

from multicor_cli import run as run_scenario
from multicor_cli.engine.orders import Interrupted
from multicor_cli.running import session as session_module
from multicor_cli.running.outcome import StopReason
from multicor_cli.scenario.problems import ScenarioError
from multicor_cli.store import DirectoryRefused, run_info, verify


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The small run with all stages, and a finished one with the first of them."""
    path = tmp_path_factory.mktemp("extended")
    run_scenario(written(path / "whole.toml", SMALL), path / "whole")
    run_scenario(written(path / "first.toml", shortened(SMALL, 1)), path / "first")
    return path


@pytest.fixture
def first(folder, tmp_path):
    """A copy of the finished run."""
    return shutil.copytree(folder / "first", tmp_path / "run")


def extended(path, directory, **options):
    return run_scenario(path, directory, extend=True, **options)


def test_a_finished_run_is_extended_twice(folder, first, tmp_path):
    two = written(tmp_path / "two.toml", shortened(SMALL, 2))
    for path, options in ((two, {}), (folder / "whole.toml", {"threads": 2})):
        assert extended(path, first, **options).is_finished
        assert verify(first) == []
    assert digests(first) == digests(folder / "whole")
    info = run_info(first)
    assert [each["stages"] for each in info["extensions"]] == [2, 3]
    assert [end["name"] for end in info["stage_ends"]] == ["settle", "shear", "on"]


def test_heat_and_a_frozen_stage_are_added(tmp_path):
    whole = written(tmp_path / "whole.toml", WARM)
    run_scenario(whole, tmp_path / "whole")
    run_scenario(written(tmp_path / "first.toml", shortened(WARM, 1)), tmp_path / "run")
    assert extended(whole, tmp_path / "run").is_finished
    assert digests(tmp_path / "run") == digests(tmp_path / "whole")


@pytest.mark.parametrize("step", [0, 20])
def test_a_run_that_was_stopped_is_extended(step, folder, tmp_path):
    stopped = run_scenario(folder / "first.toml", tmp_path / "run", observer=StopAt(step))
    assert stopped.reason is StopReason.TERMINATED
    assert extended(folder / "whole.toml", tmp_path / "run").is_finished
    assert digests(tmp_path / "run") == digests(folder / "whole")


def test_an_extended_run_is_continued_without_the_option(folder, first):
    """Stopped after the extension, it is a run of the longer scenario like any other; asking for it
    again adds nothing."""
    whole, steps = folder / "whole.toml", run_info(first)["step"]
    reasons = [
        extended(whole, first, observer=StopAt(steps + 5)).reason,
        run_scenario(whole, first, observer=StopAt(steps + 15)).reason,
        extended(whole, first).reason,
        extended(whole, first).reason,
    ]
    ended = [StopReason.FINISHED, StopReason.ALREADY_FINISHED]
    assert reasons == [StopReason.TERMINATED, StopReason.TERMINATED, *ended]
    assert digests(first) == digests(folder / "whole")
    assert len(run_info(first)["extensions"]) == 1


def test_stages_are_added_on_request_only(folder):
    before = (folder / "first" / "run.json").read_bytes()
    with pytest.raises(ScenarioError, match="2 stages more than when the run in") as caught:
        run_scenario(folder / "whole.toml", folder / "first")
    (problem,) = caught.value.problems
    assert problem.key == "loading.1"
    assert "--extend" in problem.remedy
    assert (folder / "first" / "run.json").read_bytes() == before


@pytest.mark.parametrize(
    ("change", "key"),
    [
        (("friction = 0.4", "friction = 0.5"), "contacts.0.friction"),
        (("duration = 0.03", "duration = 0.02"), "loading"),
        (("frame_interval = 0.002", "frame_interval = 0.001"), "output.frame_interval"),
    ],
)  # fmt: skip
def test_what_has_begun_stays_as_it_is(change, key, first, tmp_path):
    """More than stages at the end is a change like any other, with or without the option."""
    with pytest.raises(ScenarioError) as caught:
        extended(written(tmp_path / "changed.toml", changed(SMALL, change)), first)
    assert key in [problem.key for problem in caught.value.problems]
    assert run_info(first)["extensions"] == []


def test_a_stage_that_cannot_be_carried_out_does_not_become_part_of_the_run(tmp_path):
    text = changed(shortened(SMALL, 1), ("[domain]\n", "[domain]\ngravity = [0.0, 0.0]\n"))
    path = written(tmp_path / "first.toml", text)
    run_scenario(path, tmp_path / "run")
    still = 'drives.top = { y = { fixed = true } }\ngravity = [0.0, 0.0]\ndt = "auto"\n'
    longer = changed(text, ("[solver]", f"[[loading]]\nduration = 0.01\n{still}\n[solver]"))
    with pytest.raises(ScenarioError, match="cannot choose a time step"):
        extended(written(tmp_path / "longer.toml", longer), tmp_path / "run")
    assert run_info(tmp_path / "run")["extensions"] == []
    assert run_scenario(path, tmp_path / "run").reason is StopReason.ALREADY_FINISHED


def test_there_must_be_a_run_to_extend(folder, tmp_path):
    with pytest.raises(DirectoryRefused, match="holds no run that could be extended"):
        extended(folder / "whole.toml", tmp_path / "run")
    assert not (tmp_path / "run").exists()
    with pytest.raises(ValueError, match="either extended or overwritten"):
        extended(folder / "whole.toml", tmp_path / "run", overwrite=True)


def test_the_command(folder, first, typed):
    line = f"run {folder / 'whole.toml'} -o run"
    assert "--extend" in typed(line, 3).stderr
    typed(f"{line} --extend --overwrite", 2)
    assert "adding 2 stages to the run" in typed(f"{line} --extend").stderr
    assert "from 1 to 3 stages" in typed("info run").stdout
    assert digests(first) == digests(folder / "whole")


@pytest.mark.parametrize("name", ["settle", "shear"])
def test_a_run_stopped_between_two_stages_goes_on_with_its_books(
    name, folder, tmp_path, monkeypatch
):
    """The lid moves under a load: its kinetic energy is in the books, and must not be booked as
    work once more."""
    (end,) = [end for end in run_info(folder / "whole")["stage_ends"] if end["name"] == name]
    original = session_module.Engine.step

    def interrupted(self, *arguments, **options):
        if self.state.step == end["step"]:
            signal.raise_signal(signal.SIGTERM)
            raise Interrupted
        return original(self, *arguments, **options)

    with monkeypatch.context() as patch:
        patch.setattr(session_module.Engine, "step", interrupted)
        run_scenario(folder / "whole.toml", tmp_path / "run")
    stopped = run_info(tmp_path / "run")
    assert (stopped["step"], stopped["stage"]) == (end["step"], end["stage"] + 1)
    assert run_scenario(folder / "whole.toml", tmp_path / "run").is_finished
    assert digests(tmp_path / "run") == digests(folder / "whole")
