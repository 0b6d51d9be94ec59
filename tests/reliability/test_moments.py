"""Every command that reads a run has an answer at every moment of its life; the run then goes on to
the same end.
"""

from __future__ import annotations

import shutil
import signal
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
from command_line import call, call_outside, read_info
from scenes import SMALL, changed
from trials import thinned

from multicor_cli.running.outcome import ExitCode

SCENARIO = changed(
    SMALL,
    (
        'name = "settle"\nduration = 0.03\nuntil = { kinetic_energy_ratio = 1e-2 }',
        'name = "settle"\nduration = 0.004',
    ),
    ('until = { strain = { walls = ["bottom", "top"], value = 0.15 } }', "duration = 0.02"),
)
INTERVAL = "output.checkpoint_interval=1e-3"
"""A checkpoint after every step."""

RUN = ("run", "small.toml", "-o", "run", "-q", "--set", INTERVAL)

KILLED = (
    "runjson.mid_tmp", "runjson.after_rename", "scenario.after_rename", "runjson.after_rename:2",
    "model.mid_tmp",
    "model.after_rename", "segment.mid_tmp", "segment.after_rename", "manifest.torn",
    "manifest.after_append",
    "checkpoint.after_rename", "checkpointjson.after_rename", "checkpoint.before_prune:2",
    "segment.after_rename:2",
    "results.mid_tmp", "results.after_rename", "cleanup.before", "cleanup.mid",
)  # fmt: skip
"""Where a run is killed: the first file, no scenario yet, nothing but scenarios, the model and no
segment, a segment that is not listed, one without a checkpoint, checkpoints half there and whole,
results beside segments, segments half removed."""


def readers(run: str) -> dict[str, tuple[str, ...]]:
    """Commands that read a run, by name."""
    tables = {
        "profile": (), "theta-eta": (), "map": ("--of", "speed"), "forces": (), "rheology": (),
        "fields": (), "energy": (),
        "region": ("--in", "{ min = [0.0, 0.0], max = [0.02, 0.01] }"), "series": (),
        "flow": ("--line", "0.01,0:0.01,0.01"),
        "animate": ("--of", "speed", "-o", "film.gif"),
    }  # fmt: skip
    return {
        "info": ("info", run), "info --json": ("info", run, "--json"),
        "verify": ("verify", run), "verify --json": ("verify", run, "--json"),
        **{f"post {name}": ("post", name, run, *more) for name, more in tables.items()},
        "post series --json": ("post", "series", run, "--json"),
        "post compare": ("post", "compare", run, run),
        "post compare other": ("post", "compare", run, "finished"),
        "export csv": ("export", "csv", run, "-o", "out/csv"),
        "export gsd": ("export", "gsd", run, "-o", "out/a.gsd"),
        "export fclib": ("export", "fclib", run, "-o", "out/a.hdf5"),
        "report": ("report", run, "-o", "out/a.html"),
    }  # fmt: skip


ANSWERS = set(ExitCode) - {ExitCode.BUG}


def killed_at(directory: Path, point: str) -> None:
    """A run that a kill has ended at a point of the commit protocol."""
    done = call_outside(*RUN, cwd=directory, MULTICOR_KILL_AT=point)
    assert done.returncode == -signal.SIGKILL, f"{point}: the run never came there: {done.stderr}"


def stopped(directory: Path, _: str) -> None:
    assert call(*RUN, "--max-hours", "0", cwd=directory).returncode == ExitCode.STOPPED


def failed(directory: Path, _: str) -> None:
    """A run whose solver fails in its second stage, by request."""
    done = call(
        *RUN, "--set", "solver.max_sweeps=1", "--set", "solver.on_failure=error", cwd=directory
    )
    assert done.returncode == ExitCode.PHYSICS, done.stderr


def finished_run(directory: Path, _: str) -> None:
    assert call(*RUN, cwd=directory).returncode == ExitCode.DONE


MOMENTS: dict[str, Callable[[Path, str], None]] = {
    **dict.fromkeys(KILLED, killed_at), "stopped": stopped, "failed": failed,
    "finished": finished_run
}  # fmt: skip


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The run that nothing interrupts."""
    directory = tmp_path_factory.mktemp("whole")
    (directory / "small.toml").write_text(SCENARIO)
    finished_run(directory, "")
    return directory / "run"


def is_an_answer(done: subprocess.CompletedProcess[str]) -> str:
    """What is wrong with how a command ended; empty if it has given what was asked for, or one
    message.
    """
    if done.returncode not in ANSWERS:
        return f"exit code {done.returncode}: {done.stderr}"
    if "Traceback" in done.stderr or "internal error" in done.stderr:
        return done.stderr
    if done.returncode == 0:
        return ""
    if not done.stderr.strip() and not done.stdout.strip():
        return f"exit code {done.returncode} and not a word"
    if done.returncode != ExitCode.USAGE and not done.stdout and done.stderr.count("\n") != 1:
        return f"several messages: {done.stderr}"
    return ""


@pytest.mark.parametrize("moment", thinned(list(MOMENTS), 5))
def test_every_command_answers_at_every_moment(tmp_path: Path, whole: Path, moment: str) -> None:
    (tmp_path / "small.toml").write_text(SCENARIO)
    shutil.copytree(whole, tmp_path / "finished", symlinks=True)
    MOMENTS[moment](tmp_path, moment)
    wrong = {}
    for name, words in readers("run").items():
        before = stamps(tmp_path / "run")
        fault = is_an_answer(call(*words, cwd=tmp_path))
        fault = fault or ("" if stamps(tmp_path / "run") == before else "the run was changed")
        if fault:
            wrong[name] = fault
    assert wrong == {}
    if moment != "failed":
        done = call(*RUN, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        digests = [
            (info["data_digest"], info["state_digest"])
            for info in map(read_info, (tmp_path / "run", whole))
        ]
        assert digests[0] == digests[1]


def stamps(run: Path) -> dict[str, tuple[int, int]]:
    return {
        str(file): (file.lstat().st_ino, file.lstat().st_mtime_ns)
        for file in sorted(run.rglob("*"))
    }
