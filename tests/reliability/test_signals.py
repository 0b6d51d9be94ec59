"""Ctrl-C, SIGTERM and SIGHUP at any moment end the program within two seconds; one run at a time in
a directory."""

import json
import os
import pty
import random
import signal
import sys
import time

import pytest
from command_line import call, command, environment, read_info, start
from places import ROOT
from scenes import LASTING, write_small
from store_support import errors_of
from trials import trials

from multicor_cli.store import verify

PROMISED = 2.0
"""Time from the signal to the end [s]."""

CODES = {signal.SIGINT: 130, signal.SIGTERM: 143, signal.SIGHUP: 129}
if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:  # these tests run under nohup
    del CODES[signal.SIGHUP]
RUN = ("run", "small.toml", "-o", "run")


def wait_until(is_reached, process, seconds=300.0):
    end = time.monotonic() + seconds
    while not is_reached() and process.poll() is None and time.monotonic() < end:
        time.sleep(0.01)


@trials(short=2, long=30)
def test_signals_end_the_program_soon(tmp_path, count):
    """Thousands of grains dropped at once: placing them, compiling, a first step of thousands of
    sweeps, checkpoints, frames."""
    rng, waited = random.Random(5), []
    words = ["run", ROOT / "configs" / "million.toml", "--set", "loading.0.duration=100.0"]
    words += ["--set", f"particles.0.count={8_000 if count < 10 else 200_000}"]
    words += ["--set", "output.checkpoint_interval=0.5", "-o"]
    before = time.monotonic()
    process = start(*words, "first", cwd=tmp_path)
    wait_until((tmp_path / "first" / "checkpoints").exists, process)
    began = time.monotonic() - before
    process.kill()
    process.communicate()
    for trial in range(count):
        number = rng.choice(list(CODES))
        process = start(*words, str(trial), cwd=tmp_path)
        # Python itself needs some tenths before it can listen
        time.sleep(rng.uniform(0.7, began + 3.0 if count < 10 else min(30.0, 2.0 * began + 5.0)))
        sent = time.monotonic()
        process.send_signal(number)
        process.communicate(timeout=60)
        waited.append(time.monotonic() - sent)
        assert process.returncode == CODES[number]
        if (tmp_path / str(trial) / "run.json").exists():
            assert errors_of(tmp_path / str(trial)) == []
    print(f"{count} signals, {max(waited):.2f} s at most, {sorted(waited)[count // 2]:.2f} median")
    assert max(waited) < (PROMISED if count >= 10 else 3.0 * PROMISED)  # machines of CI are busy


@trials(short=1, long=20)
def test_of_two_runs_that_start_together_one_goes_on(tmp_path, count):
    write_small(tmp_path, LASTING)
    for trial in range(count):
        both = [start("run", "small.toml", "-o", str(trial), cwd=tmp_path) for _ in range(2)]
        wait_until(lambda both=both: both[1].poll() is not None, both[0], 60.0)
        ended, running = sorted(both, key=lambda process: process.poll() is None)
        assert ended.returncode == 6
        assert running.poll() is None
        message = ended.communicate()[1]
        # it came before the lock, or after
        assert f"process {running.pid}" in message or "holds a run" in message
        running.send_signal(signal.SIGTERM)
        running.communicate(timeout=30)
        assert running.returncode == 143
        assert verify(tmp_path / str(trial)) == []


def kill_a_run(directory):
    """Start a run and kill it once it has stored something; its process number and its lock."""
    write_small(directory)
    process = start(*RUN, cwd=directory)
    wait_until((directory / "run" / "model.h5").exists, process)
    process.kill()
    process.communicate()
    return process.pid, directory / "run" / "lock"


def test_lock_of_a_dead_process_is_taken_over_and_that_of_another_host_is_not(tmp_path):
    number, lock = kill_a_run(tmp_path)

    def times():
        files = (path for path in (tmp_path / "run").rglob("*") if path != lock)
        return {path: path.stat().st_mtime_ns for path in files}

    holder = json.loads(lock.read_text())
    assert holder["pid"] == number
    lock.write_text(json.dumps({**holder, "host": "elsewhere"}))
    before = times()
    refused = call(*RUN, cwd=tmp_path)
    assert refused.returncode == 6
    assert "on elsewhere" in refused.stderr
    assert str(lock.relative_to(tmp_path)) in refused.stderr  # what to delete if nobody runs there
    assert times() == before
    lock.write_text(json.dumps(holder))
    assert call(*RUN, cwd=tmp_path).returncode == 0
    assert read_info(tmp_path / "run")["status"] == "finished"
    assert lock.read_text() == ""


def test_process_number_that_was_given_to_another_program_is_dead(tmp_path):
    _, lock = kill_a_run(tmp_path)
    lock.write_text(json.dumps({**json.loads(lock.read_text()), "pid": os.getpid()}))
    assert read_info(tmp_path / "run")["status"] == "interrupted"
    assert call(*RUN, cwd=tmp_path).returncode == 0


def test_usr1_goes_on(tmp_path):
    write_small(tmp_path, LASTING)
    process = start(*RUN, cwd=tmp_path)
    wait_until((tmp_path / "run" / "model.h5").exists, process)
    process.send_signal(signal.SIGUSR1)
    time.sleep(0.5)
    assert process.poll() is None
    process.send_signal(signal.SIGTERM)
    process.communicate(timeout=30)
    assert errors_of(tmp_path / "run") == []


@pytest.mark.skipif(signal.SIGHUP not in CODES, reason="these tests run under nohup")
def test_terminal_that_closes_stops_the_run_after_a_checkpoint(tmp_path):
    """Where nothing can be written to it any more, not even why the run stopped."""
    write_small(tmp_path, LASTING)
    child, terminal = pty.fork()
    if child == 0:
        os.chdir(tmp_path)
        os.execve(sys.executable, command(*RUN), environment())
    while b"steps/s" not in os.read(terminal, 10_000):  # the progress bar
        pass
    os.close(terminal)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 129
    info = read_info(tmp_path / "run")
    assert (info["status"], info["exit_code"]) == ("stopped", 129)
    assert info["step"] > 0
    assert verify(tmp_path / "run") == []
