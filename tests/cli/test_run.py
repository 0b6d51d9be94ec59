"""The command `run` in processes of its own: signals, kills, resuming, refusals."""

from __future__ import annotations

import json
import random
import shlex
import shutil
import signal
import subprocess
import time
from pathlib import Path

import pytest
from command_line import call, command, environment, read_info, start
from scenes import LASTING, write_small

from multicor_cli.store import open_run

OFTEN = ("--set", "output.checkpoint_interval=0.05")


def wait_for_step(process: subprocess.Popen[str], directory: Path, step: int) -> None:
    """Wait until the run has a checkpoint at or after a step, or has ended."""
    deadline = time.monotonic() + 120
    while process.poll() is None and time.monotonic() < deadline:
        done = [int(path.name[5:16]) for path in (directory / "checkpoints").glob("step-*.json")]
        if max(done, default=-1) >= step:
            return
        time.sleep(0.02)


def test_finished_run_says_so_and_changes_nothing(finished: Path) -> None:
    before = (finished / "results.h5").stat()
    done = call("run", "small.toml", "-o", "full", cwd=finished.parent)
    assert done.returncode == 0
    assert "already finished" in done.stderr
    after = (finished / "results.h5").stat()
    assert (before.st_ino, before.st_mtime_ns) == (after.st_ino, after.st_mtime_ns)


@pytest.mark.parametrize("threads", [4])
def test_number_of_threads_does_not_matter(threads: int, finished: Path, tmp_path: Path) -> None:
    """More than this machine may have cores."""
    write_small(tmp_path)
    done = call("run", "small.toml", "-o", "other", "--threads", threads, "-q", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (0, "")
    assert all(line.startswith("warning: ") for line in done.stderr.splitlines())  # of checks: their time step is a long one
    expected, found = read_info(finished), read_info(tmp_path / "other")
    assert found["provenance"]["threads"] == threads
    assert found["state_digest"] == expected["state_digest"]
    assert found["data_digest"] == expected["data_digest"]


@pytest.mark.reliability
def test_kills_and_signals_leave_no_trace(finished: Path, tmp_path: Path) -> None:
    """Stopped at random moments in three ways, the same command goes on; at the end every dataset is the same to the bit."""
    write_small(tmp_path)
    rng = random.Random(20261121)
    codes = []
    for number in [signal.SIGKILL, signal.SIGTERM, signal.SIGINT]:
        process = start("run", "small.toml", "-o", "cut", *OFTEN, cwd=tmp_path)
        wait_for_step(process, tmp_path / "cut", 0)
        time.sleep(rng.uniform(0.0, 0.8))
        process.send_signal(number)
        process.communicate(timeout=60)
        codes.append(process.returncode)
    done = call("run", "small.toml", "-o", "cut", "--overwrite" if 0 in codes else "-q", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    expected, found = read_info(finished), read_info(tmp_path / "cut")
    assert found["state_digest"] == expected["state_digest"]
    assert found["data_digest"] == expected["data_digest"]
    assert call("verify", "cut", cwd=tmp_path).returncode == 0


def test_signals_stop_soon_after_a_checkpoint(tmp_path: Path) -> None:
    write_small(tmp_path, LASTING)
    reached = 0
    for number, code in [(signal.SIGINT, 130), (signal.SIGTERM, 143)]:
        process = start("run", "small.toml", "-o", "long", *OFTEN, cwd=tmp_path)
        wait_for_step(process, tmp_path / "long", reached + 20)
        process.send_signal(number)
        _, errors = process.communicate(timeout=10)
        assert process.returncode == code
        assert "the same command continues" in errors
        info = read_info(tmp_path / "long")
        assert (info["status"], info["exit_code"]) == ("stopped", code)
        assert info["step"] >= reached + 20
        reached = info["step"]


def test_second_signal_ends_at_once(tmp_path: Path) -> None:
    """With a step so slow that the first signal has not been looked at yet."""
    write_small(tmp_path)
    slow = (
        "import sys, time; sys.argv = ['multicor', 'run', 'small.toml', '-o', 'slow']\n"
        "import multicor_cli.running.session as s\n"
        "step = s.Engine.step\n"
        "def crawl(self, *a, **k):\n"
        "    report = step(self, *a, **k)\n"
        "    if self.state.step == 5:\n"
        "        print('slow', flush=True)\n"
        "        end = time.monotonic() + 30\n"
        "        while time.monotonic() < end: time.sleep(0.05)\n"
        "    return report\n"
        "s.Engine.step = crawl\n"
        "from multicor_cli.cli.app import main; main()"
    )
    process = subprocess.Popen(
        [*command()[:1], "-c", slow], cwd=tmp_path, env=environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "slow\n"
    process.send_signal(signal.SIGINT)
    time.sleep(0.3)
    assert process.poll() is None
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=5)
    assert process.returncode == 130
    assert read_info(tmp_path / "slow")["status"] == "interrupted"


def run_that_hangs(directory: Path, name: str) -> subprocess.Popen[str]:
    """A run in whose session the function ``name`` says so and never ends: a slow placement, or kernels that compile."""
    hanging = (
        "import sys, time; sys.argv = ['multicor', 'run', 'small.toml', '-o', 'early']\n"
        "import multicor_cli.running.session as s\n"
        "def hang(*a, **k):\n"
        "    print('hanging', flush=True)\n"
        "    while True: time.sleep(0.05)\n"
        f"s.{name} = hang\n"
        "from multicor_cli.cli.app import main; main()"
    )
    process = subprocess.Popen(
        [*command()[:1], "-c", hanging], cwd=directory, env=environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "hanging\n"
    return process


def stop_early(process: subprocess.Popen[str]) -> None:
    process.send_signal(signal.SIGTERM)
    _, errors = process.communicate(timeout=5)
    assert process.returncode == 143
    assert "terminated (SIGTERM): step 0, t = 0 s, in early; the same command continues" in errors


def test_signal_while_nothing_has_to_be_saved_ends_the_process(finished: Path, tmp_path: Path) -> None:
    write_small(tmp_path)
    stop_early(run_that_hangs(tmp_path, "place"))
    assert not (tmp_path / "early").exists()
    stop_early(run_that_hangs(tmp_path, "Engine.step"))
    info = read_info(tmp_path / "early")
    assert (info["status"], info["exit_code"]) == ("stopped", 143)
    assert (tmp_path / "early" / "lock").read_text() == ""
    for checkpoint in (tmp_path / "early" / "checkpoints").iterdir():
        checkpoint.unlink()  # as if it had been killed before the first one: the grains are placed again
    stop_early(run_that_hangs(tmp_path, "place"))
    assert call("run", "small.toml", "-o", "early", cwd=tmp_path).returncode == 0
    assert read_info(tmp_path / "early")["data_digest"] == read_info(finished)["data_digest"]


def test_usr1_writes_a_checkpoint_and_goes_on(tmp_path: Path) -> None:
    write_small(tmp_path, LASTING)
    process = start("run", "small.toml", "-o", "long", cwd=tmp_path)
    wait_for_step(process, tmp_path / "long", 0)
    for _ in range(100):
        if (tmp_path / "long" / "progress.json").exists():
            break
        time.sleep(0.05)
    process.send_signal(signal.SIGUSR1)
    wait_for_step(process, tmp_path / "long", 1)
    assert process.poll() is None
    process.send_signal(signal.SIGTERM)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 143
    assert "checkpoint written at step" in errors
    progress = json.loads((tmp_path / "long" / "progress.json").read_text())
    assert progress["step"] > 0
    assert progress["stage_count"] == 3


def test_time_limit_is_code_75(tmp_path: Path) -> None:
    write_small(tmp_path)
    done = call("run", "small.toml", "--max-hours", "1e-6", cwd=tmp_path)
    assert done.returncode == 75
    assert "time limit reached" in done.stderr
    assert read_info(tmp_path / "runs" / "small")["status"] == "stopped"


def test_changed_scenario_is_code_3_and_names_the_keys(finished: Path) -> None:
    done = call(
        "run", "small.toml", "-o", "full", "--set", "contacts.0.friction=0.5", "--set", "solver.dt=1e-4", cwd=finished.parent
    )
    assert done.returncode == 3
    assert "contacts.0.friction: was 0.4 when the run in full began, is 0.5 now" in done.stderr
    assert "solver.dt" in done.stderr
    assert read_info(finished)["status"] == "finished"


def test_keys_without_influence_may_change(finished: Path) -> None:
    done = call("run", "small.toml", "-o", "full", *OFTEN, "--set", "solver.threads=1", cwd=finished.parent)
    assert done.returncode == 0
    assert "already finished" in done.stderr


def test_two_runs_on_one_directory(tmp_path: Path) -> None:
    write_small(tmp_path, LASTING)
    process = start("run", "small.toml", "-o", "long", cwd=tmp_path)
    wait_for_step(process, tmp_path / "long", 0)
    second = call("run", "small.toml", "-o", "long", cwd=tmp_path)
    process.send_signal(signal.SIGTERM)
    process.communicate(timeout=60)
    assert process.returncode == 143
    assert second.returncode == 6
    assert f"process {process.pid}" in second.stderr


def test_an_output_without_a_name_is_refused(tmp_path: Path) -> None:
    done = call("run", "small.toml", "-o", "", cwd=tmp_path)
    assert done.returncode == 2
    assert "the name is empty" in " ".join(done.stderr.replace("│", " ").split())
    assert list(tmp_path.iterdir()) == []


def test_a_directory_below_a_file_is_refused(finished: Path) -> None:
    done = call("run", "small.toml", "-o", "small.toml/run", cwd=finished.parent)
    assert done.returncode == 6
    assert "small.toml is not a directory; choose another with -o" in done.stderr


def test_a_finished_run_names_the_next_two_commands(finished: Path) -> None:
    done = call("run", "small.toml", "-o", "full", cwd=finished.parent)
    said = done.stderr[done.stderr.index("next:  ") + 7 :].splitlines()
    assert [line.split()[:3] for line in said] == [["multicor", "post", "map"], ["multicor", "report", "full"]]
    assert call(*shlex.split(said[0])[1:], cwd=finished.parent).returncode == 0
    (finished.parent / "map.png").unlink()
    assert "next:" not in call("run", "small.toml", "-o", "full", "-q", cwd=finished.parent).stderr


def test_foreign_directory_is_code_6_and_stays_as_it_is(tmp_path: Path) -> None:
    write_small(tmp_path)
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").write_text("precious")
    for more in ([], ["--overwrite"]):
        done = call("run", "small.toml", "-o", "mine", *more, cwd=tmp_path)
        assert done.returncode == 6
        assert "mine" in done.stderr
    assert [path.name for path in (tmp_path / "mine").iterdir()] == ["thesis.tex"]


def test_overwrite_begins_anew(finished: Path, tmp_path: Path) -> None:
    shutil.copytree(finished, tmp_path / "again")
    write_small(tmp_path)
    before = read_info(finished)
    done = call("run", "small.toml", "-o", "again", "--overwrite", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    after = read_info(tmp_path / "again")
    assert after["run_id"] != before["run_id"]
    assert after["data_digest"] == before["data_digest"]


def test_damaged_checkpoint_falls_back_with_a_warning(finished: Path, tmp_path: Path) -> None:
    write_small(tmp_path)
    process = start("run", "small.toml", "-o", "cut", *OFTEN, cwd=tmp_path)
    wait_for_step(process, tmp_path / "cut", 30)
    process.kill()
    process.communicate()
    newest = max((tmp_path / "cut" / "checkpoints").glob("step-*.h5"))
    newest.chmod(0o644)
    newest.write_bytes(newest.read_bytes()[:-100])
    done = call("run", "small.toml", "-o", "cut", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "warning:" in done.stderr
    assert newest.name in done.stderr
    assert read_info(tmp_path / "cut")["data_digest"] == read_info(finished)["data_digest"]


def test_dry_run_writes_nothing(tmp_path: Path) -> None:
    write_small(tmp_path)
    done = call("run", "small.toml", "--dry-run", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "one step with compilation" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["small.toml"]


@pytest.mark.reliability
def test_full_disk_is_code_5_and_can_be_continued(finished: Path, tmp_path: Path) -> None:
    """A limit on the size of files stands for a full disk."""
    write_small(tmp_path)
    limited = (
        "import resource, signal, sys; sys.argv = ['multicor', 'run', 'small.toml', '-o', 'full']\n"
        "import multicor_cli.running.session\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))\n"
        "from multicor_cli.cli.app import main; main()"
    )
    done = subprocess.run(
        [*command()[:1], "-c", limited], cwd=tmp_path, env=environment(), capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 5, done.stderr
    assert "no space left" in done.stderr
    assert "Traceback" not in done.stderr
    assert call("run", "small.toml", "-o", "full", cwd=tmp_path).returncode == 0
    assert read_info(tmp_path / "full")["data_digest"] == read_info(finished)["data_digest"]


def test_bug_leaves_a_crash_file_and_one_line(tmp_path: Path) -> None:
    write_small(tmp_path)
    broken = (
        "import sys; sys.argv = ['multicor', 'run', 'small.toml', '-o', 'broken']\n"
        "import multicor_cli.running.session as s\n"
        "def step(self, *a, **k): raise ZeroDivisionError('of all things')\n"
        "s.Engine.step = step\n"
        "from multicor_cli.cli.app import main; main()"
    )
    done = subprocess.run(
        [*command()[:1], "-c", broken], cwd=tmp_path, env=environment(), capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 1
    assert "this is a bug" in done.stderr
    assert "Traceback" not in done.stderr
    crash = (tmp_path / "broken" / "crash.txt").read_text()
    assert "of all things" in crash
    assert str(Path("broken") / "crash.txt") in done.stderr
    info = read_info(tmp_path / "broken")
    assert (info["status"], info["exit_code"]) == ("failed", 1)


def test_python_users_get_the_same(finished: Path, tmp_path: Path) -> None:
    """And the package stays callable after its modules have been imported."""
    import multicor_cli

    scenario = multicor_cli.load_scenario(write_small(tmp_path))
    outcome = multicor_cli.run(scenario, tmp_path / "here")
    assert outcome.is_finished
    assert multicor_cli.run(scenario, tmp_path / "here").is_finished
    with multicor_cli.open_run(tmp_path / "here") as run:
        assert run.info["results"]["data_digest"] == read_info(finished)["data_digest"]
        assert run.frames[-1].time == outcome.time


def test_frames_and_series_follow_their_cadences(finished: Path) -> None:
    with open_run(finished) as run:
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
