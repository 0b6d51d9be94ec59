"""Memory is bounded and predicted, and what runs for long leaks nothing: no memory, no open files,
no energy.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from command_line import call, command, environment, read_info
from places import ROOT
from scenes import WARM, changed
from store_support import errors_of
from trials import trials

from multicor_cli.store import open_run

CONFIGS = ROOT / "configs"
WITHIN = 0.25
"""Promised accuracy of the memory that ``validate`` predicts."""

SHORT = ("loading.0.duration=0.001",)
CASES = {
    "small": ("shear-gravity-free.toml", ("loading.0.until.strain.value=0.02",)),
    "10^5": ("million.toml", ("particles.0.count=100000", *SHORT)),
    "10^5 with contacts": (
        "million.toml",
        ("particles.0.count=100000", "output.contacts=true", *SHORT),
    ),
    "heat": ("lattice14.toml", ()),
    "3 10^5 with contacts": (
        "million.toml",
        ("particles.0.count=300000", "output.contacts=true", *SHORT),
    ),
    "10^6": ("million.toml", SHORT),
}


def peak_memory(*arguments: object, cwd: Path) -> int:
    """Largest resident memory of a command [bytes]; a small process starts it, for a new process
    counts that of its parent.
    """
    measure = (
        "import resource, subprocess, sys; subprocess.run(sys.argv[1:], check=True, "
        "stderr=subprocess.DEVNULL); print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)"
    )
    done = subprocess.run(
        [sys.executable, "-c", measure, *command(*arguments)],
        cwd=cwd,
        env=environment(),
        capture_output=True,
        text=True,
        check=True,
    )
    return int(done.stdout) * 1024


@trials(short=1, long=len(CASES))
def test_memory_is_as_predicted(tmp_path: Path, count: int) -> None:
    wrong = []
    for name, (config, changes) in list(CASES.items())[:count]:
        options = [word for change in changes for word in ("--set", change)]
        done = call("validate", CONFIGS / config, *options, "--json", cwd=tmp_path)
        predicted = json.loads(done.stdout)["estimate"]["memory_bytes"]
        # Compilation has a memory of its own
        call("run", CONFIGS / config, "--dry-run", *options, cwd=tmp_path)
        used = peak_memory("run", CONFIGS / config, "-o", tmp_path / name, *options, cwd=tmp_path)
        print(f"{name}: {predicted / 1e6:.0f} MB predicted, {used / 1e6:.0f} MB used")
        if not abs(predicted - used) < WITHIN * used:
            wrong.append((name, predicted, used))
    assert not wrong


def limited(*arguments: object, cwd: Path, memory: int) -> subprocess.CompletedProcess[str]:
    """A command that may have no more than some bytes of memory."""
    return subprocess.run(
        command(*arguments),
        cwd=cwd,
        env=environment(OPENBLAS_NUM_THREADS="1"),
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (memory, memory)),
    )


@pytest.mark.reliability
@pytest.mark.parametrize("count", [6])
def test_too_little_memory(tmp_path: Path, count: int) -> None:
    """More grains than fit: one line, exit code 5, and nothing that is damaged."""
    codes = []
    # Kernels are compiled first: what LLVM does without memory is not what is looked at.
    assert (
        call(
            "run",
            CONFIGS / "million.toml",
            "-o",
            "small",
            "-q",
            "--set",
            "particles.0.count=1000",
            cwd=tmp_path,
        ).returncode
        == 0
    )
    for trial, memory in enumerate(np.linspace(0.9e9, 1.6e9, count).astype(int).tolist()):
        run = tmp_path / str(trial)
        options = (
            "--set",
            "particles.0.count=1000000",
            "--set",
            "output.contacts=true",
            "--set",
            "loading.0.duration=0.001",
        )
        done = limited(
            "run", CONFIGS / "million.toml", "-o", run, "-q", *options, cwd=tmp_path, memory=memory
        )
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
from multicor_cli.running.outcome import SilentObserver

class Samples(SilentObserver):
    def stepped(self, status):
        if status.state.step % (int(sys.argv[1]) // {SAMPLES}) == 0:
            pages = int(open("/proc/self/statm").read().split()[1])
            print(pages * os.sysconf("SC_PAGE_SIZE"), len(os.listdir("/proc/self/fd")))

run("soak.toml", "run", overrides=["output.checkpoint_interval=1.0"], observer=Samples())
"""


@trials(short=1_000, long=1_000_000)
@pytest.mark.timeout(7200)
def test_soak(tmp_path: Path, count: int) -> None:
    """A million steps of a shaken, heated layer: memory and open files as after a tenth of them,
    books closed to rounding.
    """
    intervals = f"frame_interval = {5e-4 * count / 100}\nseries_interval = {5e-4 * count / 1000}"
    duration = ("duration = 0.01", f"duration = {5e-4 * count}")
    (tmp_path / "soak.toml").write_text(
        changed(SOAK, duration, ("frame_interval = 2e-3\nseries_interval = 1e-3", intervals))
    )
    call("run", "soak.toml", "--dry-run", cwd=tmp_path)
    watched = [sys.executable, "-c", WATCHED_RUN, str(count)]
    done = subprocess.run(
        watched, cwd=tmp_path, env=environment(), capture_output=True, text=True, check=False
    )
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
    print(
        f"{info['step']} steps: closures {info['energy_closure']:.1e} and "
        f"{info['heat_closure']:.1e}"
    )
    print(
        "memory in eighths of the run [MB]:",
        *(f"{np.median(part) / 1e6:.1f}" for part in np.array_split(memory, 8)),
    )
    growth = 1.02 if count >= 100_000 else 1.1  # machine code is loaded when it is first needed
    eighth = len(memory) // 8
    assert np.median(memory[-eighth:]) < growth * np.median(memory[:eighth])
    assert files[-eighth:].max() <= files[:eighth].max() + 1
