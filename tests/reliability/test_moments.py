"""Every command that reads a run has an answer at every moment of its life; the run then goes on to
the same end."""

import shutil
import signal

import pytest
from command_line import call, call_outside
from scenes import SMALL, changed
from store_support import ends_of
from trials import thinned

from multicor_cli.running.outcome import ExitCode

SCENARIO = changed(
    SMALL,
    ('name = "settle"\nduration = 0.03\nuntil = { kinetic_energy_ratio = 1e-2 }',
        'name = "settle"\nduration = 0.004'),
    ('until = { strain = { walls = ["bottom", "top"], value = 0.15 } }', "duration = 0.02"),
)  # fmt: skip
RUN = ("run", "small.toml", "-o", "run", "-q", "--set", "output.checkpoint_interval=1e-3")
"""With a checkpoint after every step."""

KILLED = (
    "runjson.mid_tmp", "runjson.after_rename", "scenario.after_rename", "runjson.after_rename:2",
    "model.mid_tmp", "model.after_rename", "segment.mid_tmp", "segment.after_rename",
    "manifest.torn", "manifest.after_append", "checkpoint.after_rename",
    "checkpointjson.after_rename", "checkpoint.before_prune:2", "segment.after_rename:2",
    "results.mid_tmp", "results.after_rename", "cleanup.before", "cleanup.mid",
)  # fmt: skip
"""Where a run is killed: the first file, no scenario yet, nothing but scenarios, the model and no
segment, a segment that is not listed, one without a checkpoint, checkpoints half there and whole,
results beside segments, segments half removed."""

READERS = """\
info run
info run --json
verify run
verify run --json
post profile run
post theta-eta run
post map run --of speed
post forces run
post rheology run
post conductivity run
post fabric run
post lifetimes run
post chains run
post clusters run
post heat-network run
post wall-heat run
post hot-spots run
post diffusion run --margin 1
post structure run
post mixing run
post mixing run --profile size
post residence run
post avalanches run --of kinetic
post structure run --voronoi
post correlation run
post fields run
post energy run
post region run --in {min=[0.0,0.0],max=[0.02,0.01]}
post series run
post series run --json
post flow run --line 0.01,0:0.01,0.01
post animate run --of speed -o film.gif
post compare run run
post compare run finished
export csv run -o out/csv
export gsd run -o out/a.gsd
export fclib run -o out/a.hdf5
report run -o out/a.html"""
"""Commands that read a run."""

ANSWERS = set(ExitCode) - {ExitCode.BUG}


def killed_at(directory, point):
    """A run that a kill has ended at a point of the commit protocol."""
    done = call_outside(*RUN, cwd=directory, MULTICOR_KILL_AT=point)
    assert done.returncode == -signal.SIGKILL, f"{point}: the run never came there: {done.stderr}"


ENDED = {
    "stopped": (("--max-hours", "0"), ExitCode.STOPPED),
    "failed": (
        ("--set", "solver.max_sweeps=1", "--set", "solver.on_failure=error"), ExitCode.PHYSICS,
    ),
    "finished": ((), ExitCode.DONE),
}  # fmt: skip
"""Options with which a run ends otherwise (the solver fails in its second stage), and how."""


def end(directory, how):
    options, code = ENDED[how]
    done = call(*RUN, *options, cwd=directory)
    assert done.returncode == code, done.stderr


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The run that nothing interrupts."""
    directory = tmp_path_factory.mktemp("whole")
    (directory / "small.toml").write_text(SCENARIO)
    end(directory, "finished")
    return directory / "run"


def fault(done):
    """What is wrong with how a command ended; empty if it has given what was asked for, or one
    message."""
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


def stamps(run):
    return {
        str(file): (file.lstat().st_ino, file.lstat().st_mtime_ns)
        for file in sorted(run.rglob("*"))
    }


@pytest.mark.parametrize("moment", thinned([*KILLED, *ENDED], 7))
def test_every_command_answers_at_every_moment(tmp_path, whole, moment):
    (tmp_path / "small.toml").write_text(SCENARIO)
    shutil.copytree(whole, tmp_path / "finished", symlinks=True)
    (end if moment in ENDED else killed_at)(tmp_path, moment)
    wrong = {}
    for line in READERS.splitlines():
        before = stamps(tmp_path / "run")
        found = fault(call(*line.split(), cwd=tmp_path))
        found = found or ("" if stamps(tmp_path / "run") == before else "the run was changed")
        if found:
            wrong[line] = found
    assert wrong == {}
    if moment != "failed":
        done = call(*RUN, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        assert ends_of(tmp_path / "run") == ends_of(whole)
