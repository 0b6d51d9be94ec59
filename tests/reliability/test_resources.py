"""Memory is bounded and predicted, and what runs for long leaks nothing: no memory, no open files,
no energy."""

import json
import resource
import subprocess

import numpy as np
import pytest
from command_line import call, command, environment, python, read_info
from places import ROOT
from scenes import WARM, changed
from store_support import errors_of
from trials import trials

from multicor_cli.store import open_run

CONFIGS = ROOT / "configs"
WITHIN = 0.25
"""Promised accuracy of the memory that ``validate`` predicts."""

SHORT = " --set loading.0.duration=0.001"
CASES = {
    "small": "shear-gravity-free.toml --set loading.0.until.strain.value=0.02",
    "10^5": "million.toml --set particles.0.count=100000" + SHORT,
    "10^5 with contacts": "million.toml --set particles.0.count=100000 --set output.contacts=true" + SHORT,
    "heat": "lattice14.toml",
    "3 10^5 with contacts": "million.toml --set particles.0.count=300000 --set output.contacts=true" + SHORT,
    "10^6": "million.toml" + SHORT,
}  # fmt: skip

MEASURE = (
    "import resource, subprocess, sys; subprocess.run(sys.argv[1:], check=True, "
    "stderr=subprocess.DEVNULL); print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)"
)
"""Prints the largest resident memory of a command; a small process starts it, for a new process
counts that of its parent."""


@trials(short=1, long=len(CASES))
def test_memory_is_as_predicted(tmp_path, count):
    wrong = []
    for name, case in list(CASES.items())[:count]:
        config, *options = case.split()
        words = CONFIGS / config, *options
        done = call("validate", *words, "--json", cwd=tmp_path)
        predicted = json.loads(done.stdout)["estimate"]["memory_bytes"]
        call("run", *words, "--dry-run", cwd=tmp_path)  # compilation has a memory of its own
        run = command("run", *words, "-o", tmp_path / name)
        used = int(python("-c", MEASURE, *run, cwd=tmp_path).stdout) * 1024
        print(f"{name}: {predicted / 1e6:.0f} MB predicted, {used / 1e6:.0f} MB used")
        if not abs(predicted - used) < WITHIN * used:
            wrong.append((name, predicted, used))
    assert not wrong


@pytest.mark.reliability
@pytest.mark.parametrize("count", [6])
def test_too_little_memory(tmp_path, count):
    """More grains than fit: one line, exit code 5, and nothing that is damaged."""
    codes = []
    # Kernels are compiled first: what LLVM does without memory is not what is looked at.
    words = ["run", CONFIGS / "million.toml", "-q", "--set"]
    first = call(*words, "particles.0.count=1000", "-o", "small", cwd=tmp_path)
    assert first.returncode == 0, first.stderr
    words += f"particles.0.count=1000000 --set output.contacts=true{SHORT} -o".split()
    for trial, memory in enumerate(np.linspace(0.9e9, 1.6e9, count).astype(int).tolist()):
        run = tmp_path / str(trial)
        done = subprocess.run(
            command(*words, run), cwd=tmp_path, env=environment(OPENBLAS_NUM_THREADS="1"),
            capture_output=True, text=True, check=False, timeout=300,
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (memory, memory)),  # noqa: B023
        )  # fmt: skip
        codes.append(done.returncode)
        assert done.returncode in (0, 5), done.stderr
        assert "Traceback" not in done.stderr
        assert done.returncode == 0 or "not enough memory" in done.stderr
        if (run / "run.json").exists():
            assert errors_of(run) == []
    assert codes[0] == 5


SOAK = changed(WARM, ("count = 150", "count = 12"), ('"deposited"', '"random"'))
SAMPLES = 80
WATCHED_RUN = f"""
import os, sys
from multicor_cli import run
from multicor_cli.running.outcome import QuietObserver

class Samples(QuietObserver):
    def stepped(self, status):
        if status.state.step % (int(sys.argv[1]) // {SAMPLES}) == 0:
            pages = int(open("/proc/self/statm").read().split()[1])
            print(pages * os.sysconf("SC_PAGE_SIZE"), len(os.listdir("/proc/self/fd")))

run("soak.toml", "run", overrides=["output.checkpoint_interval=1.0"], observer=Samples())
"""


@trials(short=1_000, long=1_000_000)
@pytest.mark.timeout(7200)
def test_soak(tmp_path, count):
    """A million steps of a shaken, heated layer: memory and open files as after a tenth of them,
    books closed to rounding."""
    intervals = f"frame_interval = {5e-4 * count / 100}\nseries_interval = {5e-4 * count / 1000}"
    duration = ("duration = 0.01", f"duration = {5e-4 * count}")
    (tmp_path / "soak.toml").write_text(
        changed(SOAK, duration, ("frame_interval = 2e-3\nseries_interval = 1e-3", intervals))
    )
    call("run", "soak.toml", "--dry-run", cwd=tmp_path)
    done = python("-c", WATCHED_RUN, count, cwd=tmp_path, timeout=7200)
    assert done.returncode == 0, done.stderr
    info = read_info(tmp_path / "run")
    assert info["step"] >= count
    assert info["energy_closure"] < 1e-9
    assert info["heat_closure"] < 1e-9
    with open_run(tmp_path / "run") as run:
        assert len(run.frames) >= 100
    samples = np.array([line.split() for line in done.stdout.splitlines()], int)
    assert len(samples) >= SAMPLES
    memory, files = samples[SAMPLES // 10 :].T
    eighths = [np.median(part) for part in np.array_split(memory, 8)]
    print(f"{info['step']} steps, memory in eighths of the run [MB]: {np.array(eighths) / 1e6}")
    growth = 1.02 if count >= 100_000 else 1.1  # machine code is loaded when it is first needed
    eighth = len(memory) // 8
    assert np.median(memory[-eighth:]) < growth * np.median(memory[:eighth])
    assert files[-eighth:].max() <= files[:eighth].max() + 1
