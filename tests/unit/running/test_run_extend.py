"""Stages are added to the end of a run with ``--extend``: it becomes, to the bit, the run that had
them from the start.
"""

from __future__ import annotations

import shutil
import signal
from pathlib import Path

import pytest
from command_line import call
from cut_runs import shortened, written
from run_fakes import StopAt, digests
from scenes import SMALL, WARM, changed

from multicor_cli import run as run_scenario
from multicor_cli.engine.orders import Interrupted
from multicor_cli.running import session as session_module
from multicor_cli.running.outcome import StopReason
from multicor_cli.scenario.problems import ScenarioError
from multicor_cli.store import DirectoryRefused, run_info, verify


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The small run with all stages, and a finished one with the first of them."""
    path = tmp_path_factory.mktemp("extended")
    run_scenario(written(path / "whole.toml", SMALL), path / "whole")
    run_scenario(written(path / "first.toml", shortened(SMALL, 1)), path / "first")
    return path


def test_a_finished_run_is_extended_twice(folder: Path, tmp_path: Path) -> None:
    shutil.copytree(folder / "first", tmp_path / "run")
    two = written(tmp_path / "two.toml", shortened(SMALL, 2))
    assert run_scenario(two, tmp_path / "run", extend=True).is_finished
    assert verify(tmp_path / "run") == []
    assert run_scenario(folder / "whole.toml", tmp_path / "run", extend=True, threads=2).is_finished
    assert verify(tmp_path / "run") == []
    assert digests(tmp_path / "run") == digests(folder / "whole")
    assert [e["stages"] for e in run_info(tmp_path / "run")["extensions"]] == [2, 3]
    assert [end["name"] for end in run_info(tmp_path / "run")["stage_ends"]] == [
        "settle",
        "shear",
        "on",
    ]


def test_heat_and_a_frozen_stage_are_added(tmp_path: Path) -> None:
    whole, first = (
        written(tmp_path / "whole.toml", WARM),
        written(tmp_path / "first.toml", shortened(WARM, 1)),
    )
    run_scenario(whole, tmp_path / "whole")
    run_scenario(first, tmp_path / "run")
    assert run_scenario(whole, tmp_path / "run", extend=True).is_finished
    assert digests(tmp_path / "run") == digests(tmp_path / "whole")


@pytest.mark.parametrize("step", [0, 20])
def test_a_run_that_was_stopped_is_extended(step: int, folder: Path, tmp_path: Path) -> None:
    assert (
        run_scenario(folder / "first.toml", tmp_path / "run", observer=StopAt(step)).reason
        is StopReason.TERMINATED
    )
    assert run_scenario(folder / "whole.toml", tmp_path / "run", extend=True).is_finished
    assert digests(tmp_path / "run") == digests(folder / "whole")


def test_an_extended_run_is_continued_without_the_option(folder: Path, tmp_path: Path) -> None:
    """Stopped after the extension, it is a run of the longer scenario like any other; asking for it
    again adds nothing.
    """
    shutil.copytree(folder / "first", tmp_path / "run")
    steps = run_info(tmp_path / "run")["step"]
    stopped = run_scenario(
        folder / "whole.toml", tmp_path / "run", extend=True, observer=StopAt(steps + 5)
    )
    assert stopped.reason is StopReason.TERMINATED
    assert (
        run_scenario(folder / "whole.toml", tmp_path / "run", observer=StopAt(steps + 15)).reason
        is StopReason.TERMINATED
    )
    assert run_scenario(folder / "whole.toml", tmp_path / "run", extend=True).is_finished
    assert (
        run_scenario(folder / "whole.toml", tmp_path / "run", extend=True).reason
        is StopReason.ALREADY_FINISHED
    )
    assert digests(tmp_path / "run") == digests(folder / "whole")
    assert len(run_info(tmp_path / "run")["extensions"]) == 1


def test_stages_are_added_on_request_only(folder: Path) -> None:
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
def test_what_has_begun_stays_as_it_is(
    change: tuple[str, str], key: str, folder: Path, tmp_path: Path
) -> None:
    """More than stages at the end is a change like any other, with or without the option."""
    path = written(tmp_path / "changed.toml", changed(SMALL, change))
    shutil.copytree(folder / "first", tmp_path / "run")
    with pytest.raises(ScenarioError) as caught:
        run_scenario(path, tmp_path / "run", extend=True)
    assert key in [problem.key for problem in caught.value.problems]
    assert run_info(tmp_path / "run")["extensions"] == []


def test_a_stage_that_cannot_be_carried_out_does_not_become_part_of_the_run(
    folder: Path, tmp_path: Path
) -> None:
    still = 'gravity = [0.0, 0.0]\ndt = "auto"\n'
    text = changed(shortened(SMALL, 1), ("[domain]\n", "[domain]\ngravity = [0.0, 0.0]\n"))
    run_scenario(written(tmp_path / "first.toml", text), tmp_path / "run")
    longer = changed(
        text,
        (
            "[solver]",
            (
                f"[[loading]]\nduration = 0.01\ndrives.top = {{ y = {{ fixed = true }} }}\n"
                f"{still}\n[solver]"
            ),
        ),
    )
    with pytest.raises(ScenarioError, match="cannot choose a time step"):
        run_scenario(written(tmp_path / "longer.toml", longer), tmp_path / "run", extend=True)
    assert run_info(tmp_path / "run")["extensions"] == []
    assert (
        run_scenario(tmp_path / "first.toml", tmp_path / "run").reason
        is StopReason.ALREADY_FINISHED
    )


def test_there_must_be_a_run_to_extend(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(DirectoryRefused, match="holds no run that could be extended"):
        run_scenario(folder / "whole.toml", tmp_path / "run", extend=True)
    assert not (tmp_path / "run").exists()
    with pytest.raises(ValueError, match="either extended or overwritten"):
        run_scenario(folder / "whole.toml", tmp_path / "run", extend=True, overwrite=True)


def test_the_command(folder: Path, tmp_path: Path) -> None:
    shutil.copytree(folder / "first", tmp_path / "run")
    refused = call("run", folder / "whole.toml", "-o", "run", cwd=tmp_path)
    assert refused.returncode == 3
    assert "--extend" in refused.stderr
    assert (
        call(
            "run", folder / "whole.toml", "-o", "run", "--extend", "--overwrite", cwd=tmp_path
        ).returncode
        == 2
    )
    done = call("run", folder / "whole.toml", "-o", "run", "--extend", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "adding 2 stages to the run" in done.stderr
    assert "from 1 to 3 stages" in call("info", "run", cwd=tmp_path).stdout
    assert digests(tmp_path / "run") == digests(folder / "whole")


@pytest.mark.parametrize("name", ["settle", "shear"])
def test_a_run_stopped_between_two_stages_goes_on_with_its_books(
    name: str, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The lid moves under a load: its kinetic energy is in the books, and must not be booked as
    work once more.
    """
    (end,) = [end for end in run_info(folder / "whole")["stage_ends"] if end["name"] == name]
    original = session_module.Engine.step

    def interrupted(self: session_module.Engine, *arguments: object, **options: object) -> object:
        if self.state.step == end["step"]:
            signal.raise_signal(signal.SIGTERM)
            raise Interrupted
        return original(self, *arguments, **options)  # type: ignore[arg-type]

    with monkeypatch.context() as patch:
        patch.setattr(session_module.Engine, "step", interrupted)
        run_scenario(folder / "whole.toml", tmp_path / "run")
    stopped = run_info(tmp_path / "run")
    assert (stopped["step"], stopped["stage"]) == (end["step"], end["stage"] + 1)
    assert run_scenario(folder / "whole.toml", tmp_path / "run").is_finished
    assert digests(tmp_path / "run") == digests(folder / "whole")
