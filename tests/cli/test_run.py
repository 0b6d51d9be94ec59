"""The command `run` in processes of its own: signals, kills, resuming, refusals; and Ctrl-C in a
benchmark."""

import json
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from command_line import call, command, environment, read_info, start
from scenarios import digests
from scenes import LASTING, write_small

import multicor_cli as multicor

OFTEN = ("--set", "output.checkpoint_interval=0.05")


def wait_for_step(process, directory, step):
    """Wait until the run has a checkpoint at or after a step, or has ended."""
    deadline = time.monotonic() + 120
    while process.poll() is None and time.monotonic() < deadline:
        done = [int(path.name[5:16]) for path in (directory / "checkpoints").glob("step-*.json")]
        if max(done, default=-1) >= step:
            return
        time.sleep(0.02)


def start_changed(directory, change, said=""):
    """A run into ``here`` of a program in which ``change`` has been done; it is waited for until it
    has said something."""
    code = (
        "import sys, time; sys.argv = ['multicor', 'run', 'small.toml', '-o', 'here']\n"
        "import multicor_cli.running.session as s\n"
        f"{change}\n"
        "from multicor_cli.cli.app import main; main()"
    )
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    process = subprocess.Popen(
        [sys.executable, "-c", code], cwd=write_small(directory).parent, env=environment(), **pipes
    )
    assert not said or process.stdout.readline() == f"{said}\n"
    return process


def stop(process, number=signal.SIGTERM, *, within=60.0):
    """End a process as a signal does, within a time [s]; what it says."""
    process.send_signal(number)
    _, said = process.communicate(timeout=within)
    assert process.returncode == 128 + number
    return said


def test_finished_run_says_so_and_changes_nothing(typed, finished):
    before = (finished / "results.h5").stat()
    done = typed("run SMALL -o RUN")
    assert "already finished" in done.stderr
    after = (finished / "results.h5").stat()
    assert (before.st_ino, before.st_mtime_ns) == (after.st_ino, after.st_mtime_ns)


def test_number_of_threads_does_not_matter(typed, finished, tmp_path):
    """More than this machine may have cores."""
    done = typed("run SMALL -o other --threads 4 -q")
    assert done.stdout == ""
    # of checks: their time step is a long one
    assert all(line.startswith("warning: ") for line in done.stderr.splitlines())
    assert read_info(tmp_path / "other")["provenance"]["threads"] == 4
    assert digests(tmp_path / "other") == digests(finished)


def test_signals_stop_soon_after_a_checkpoint(tmp_path):
    write_small(tmp_path, LASTING)
    reached = 0
    for number in (signal.SIGINT, signal.SIGTERM):
        process = start("run", "small.toml", "-o", "long", *OFTEN, cwd=tmp_path)
        wait_for_step(process, tmp_path / "long", reached + 20)
        assert "the same command continues" in stop(process, number, within=10.0)
        info = read_info(tmp_path / "long")
        assert (info["status"], info["exit_code"]) == ("stopped", 128 + number)
        assert info["step"] >= reached + 20
        reached = info["step"]


CRAWL = """
step = s.Engine.step
def crawl(self, *a, **k):
    report = step(self, *a, **k)
    if self.state.step == 5:
        print('slow', flush=True)
        end = time.monotonic() + 30
        while time.monotonic() < end: time.sleep(0.05)
    return report
s.Engine.step = crawl
"""


def test_second_signal_ends_at_once(tmp_path):
    """With a step so slow that the first signal has not been looked at yet."""
    process = start_changed(tmp_path, CRAWL, "slow")
    process.send_signal(signal.SIGINT)
    time.sleep(0.3)
    assert process.poll() is None
    stop(process, signal.SIGINT, within=5.0)
    assert read_info(tmp_path / "here")["status"] == "interrupted"


def test_signal_while_nothing_has_to_be_saved_ends_the_process(typed, finished, tmp_path):
    """In a slow placement, or while kernels compile."""

    def stop_in(name):
        hang = (
            "def hang(*a, **k):\n    print('hanging', flush=True)\n"
            f"    while True: time.sleep(0.05)\ns.{name} = hang"
        )
        return stop(start_changed(tmp_path, hang, "hanging"), within=5.0)

    said = stop_in("place")
    assert "terminated (SIGTERM): nothing is written yet; the same command begins again" in said
    assert not (tmp_path / "here").exists()
    said = stop_in("Engine.step")
    assert "terminated (SIGTERM): step 0, t = 0 s, in here; the same command continues" in said
    info = read_info(tmp_path / "here")
    assert (info["status"], info["exit_code"]) == ("stopped", 143)
    assert (tmp_path / "here" / "lock").read_text() == ""
    for checkpoint in (tmp_path / "here" / "checkpoints").iterdir():
        # as if it had been killed before the first one: the grains are placed again
        checkpoint.unlink()
    stop_in("place")
    typed("run small.toml -o here")
    assert digests(tmp_path / "here") == digests(finished)


def test_usr1_writes_a_checkpoint_and_a_second_run_is_refused(tmp_path):
    write_small(tmp_path, LASTING)
    process = start("run", "small.toml", "-o", "long", cwd=tmp_path)
    wait_for_step(process, tmp_path / "long", 0)
    second = call("run", "small.toml", "-o", "long", cwd=tmp_path)
    assert (second.returncode, f"process {process.pid}" in second.stderr) == (6, True)
    for _ in range(100):
        if (tmp_path / "long" / "progress.json").exists():
            break
        time.sleep(0.05)
    process.send_signal(signal.SIGUSR1)
    wait_for_step(process, tmp_path / "long", 1)
    assert process.poll() is None
    assert "checkpoint written at step" in stop(process)
    progress = json.loads((tmp_path / "long" / "progress.json").read_text())
    assert progress["step"] > 0
    assert progress["stage_count"] == 3


def test_time_limit_is_code_75(typed, tmp_path):
    assert "time limit reached" in typed("run SMALL --max-hours 1e-6", 75).stderr
    assert read_info(tmp_path / "runs" / "small")["status"] == "stopped"


def test_keys_without_influence_may_change_and_others_are_named(typed, finished):
    done = typed(f"run SMALL -o RUN {shlex.join(OFTEN)} --set solver.threads=1")
    assert "already finished" in done.stderr
    done = typed("run SMALL -o RUN --set contacts.0.friction=0.5 --set solver.dt=1e-4", 3)
    assert re.search(
        r"contacts.0.friction: was 0.4 when the run in \S+ began, is 0.5 now", done.stderr
    )
    assert "solver.dt" in done.stderr
    assert read_info(finished)["status"] == "finished"


def test_another_scenario_than_that_of_the_run_is_told_once(typed, finished):
    changes = "contacts.0.friction=0.5 solver.dt=1e-4 scenario.seed=9 scenario.name=other"
    done = typed(f"run SMALL -o RUN --set {' --set '.join(changes.split())}", 3)
    assert 'holds the run "small" of another scenario: 4 keys differ, as scenario.name, ' in (
        done.stderr
    )
    assert done.stderr.count("--overwrite") == 1
    assert read_info(finished)["status"] == "finished"


def test_threads_are_told_as_used_and_as_allowed(typed, tmp_path):
    assert "1 thread of the 2 allowed\n" in typed("run SMALL -o other --threads 2").stderr
    assert read_info(tmp_path / "other")["provenance"]["threads"] == 2
    assert "1 thread\n" in typed("run SMALL -o single --threads 1").stderr


def test_a_finished_run_names_the_next_two_commands(typed):
    done = typed("run SMALL -o RUN")
    said = done.stderr[done.stderr.index("next:  ") + 7 :].splitlines()
    assert [line.split()[:3] for line in said] == [
        ["multicor", "post", "map"],
        ["multicor", "report", shlex.split(said[1])[2]],
    ]
    typed(said[0].removeprefix("multicor "))
    assert "next:" not in typed("run SMALL -o RUN -q").stderr


def test_foreign_directory_is_code_6_and_stays_as_it_is(typed, tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").write_text("precious")
    for more in ("", "--overwrite"):
        assert "mine" in typed(f"run SMALL -o mine {more}", 6).stderr
    assert [path.name for path in (tmp_path / "mine").iterdir()] == ["thesis.tex"]


def test_overwrite_begins_anew(typed, finished, tmp_path):
    shutil.copytree(finished, tmp_path / "again")
    typed("run SMALL -o again --overwrite")
    assert read_info(tmp_path / "again")["run_id"] != read_info(finished)["run_id"]
    assert digests(tmp_path / "again") == digests(finished)


def test_damaged_checkpoint_falls_back_with_a_warning(typed, finished, tmp_path):
    write_small(tmp_path)
    process = start("run", "small.toml", "-o", "cut", *OFTEN, cwd=tmp_path)
    wait_for_step(process, tmp_path / "cut", 30)
    process.kill()
    process.communicate()
    newest = max((tmp_path / "cut" / "checkpoints").glob("step-*.h5"))
    newest.chmod(0o644)
    newest.write_bytes(newest.read_bytes()[:-100])
    done = typed("run small.toml -o cut")
    assert "warning:" in done.stderr
    assert newest.name in done.stderr
    assert digests(tmp_path / "cut") == digests(finished)


def test_dry_run_writes_nothing(typed, tmp_path):
    assert "one step with compilation" in typed("run SMALL --dry-run").stderr
    assert list(tmp_path.iterdir()) == []


def test_bug_leaves_a_crash_file_and_one_line(tmp_path):
    process = start_changed(
        tmp_path,
        "def step(self, *a, **k): raise ZeroDivisionError('of all things')\ns.Engine.step = step",
    )
    _, said = process.communicate(timeout=60)
    assert process.returncode == 1
    assert "this is a bug" in said
    assert "Traceback" not in said
    assert "of all things" in (tmp_path / "here" / "crash.txt").read_text()
    assert str(Path("here") / "crash.txt") in said
    info = read_info(tmp_path / "here")
    assert (info["status"], info["exit_code"]) == ("failed", 1)


def test_python_users_get_the_same(finished, tmp_path):
    """And the package stays callable after its modules have been imported."""
    scenario = multicor.load_scenario(write_small(tmp_path))
    outcome = multicor.run(scenario, tmp_path / "here")
    assert outcome.is_finished
    assert multicor.run(scenario, tmp_path / "here").is_finished
    assert digests(tmp_path / "here") == digests(finished)
    with multicor.open_run(tmp_path / "here") as run:
        assert run.frames[-1].time == outcome.time


def test_frames_and_series_follow_their_cadences(finished):
    with multicor.open_run(finished) as run:
        steps, stages = run.frames.step, run.frames.stage
        assert steps[0] == 0
        assert sorted(set(stages.tolist())) == [0, 1, 2]
        for stage in (0, 1, 2):
            begin = 0 if stage == 0 else steps[stages == stage - 1][-1]
            inside = steps[stages == stage] - begin
            assert (inside[:-1] % 10 == 0).all()
        assert run.series["window_steps"].sum() == steps[-1]
        assert run.series["step"][-1] == steps[-1]
        assert run.series["strain"][run.series["stage"] == 1][-1] == pytest.approx(0.15, abs=0.01)


def test_a_benchmark_ends_with_its_processes(tmp_path):
    """What compiles and computes without a run: one line, exit code 130, nothing left behind."""
    words = command("bench", "bed", "--grains", "1000", "--threads", "1")
    pipes = {
        "stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True,
        "start_new_session": True,
    }  # fmt: skip
    process = subprocess.Popen(words, cwd=tmp_path, env=environment(), **pipes)
    next(line for line in process.stderr if line.startswith("bed, about"))
    os.killpg(process.pid, signal.SIGINT)
    # Its processes hold the pipes until they have ended, too
    _, said = process.communicate(timeout=60)
    assert process.returncode == 130
    assert said.splitlines()[-1] == "multicor: interrupted"
    assert "Traceback" not in said
