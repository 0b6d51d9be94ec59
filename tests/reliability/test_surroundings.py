"""What surrounds a run does not change it: threads, threading layers, clocks, time zones, readers,
no home, a stale cache."""

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from command_line import call, environment, python, read_info, start
from places import ROOT
from scenes import SMALL, WARM, changed, write_small
from store_support import ends_of
from trials import thinned, trials

from multicor_cli.store import open_run

MANY = "--set particles.0.count=5000 --set loading.0.duration=0.004 --set solver.max_sweeps=60"
"""So many grains that several threads are used, few steps."""


@pytest.mark.reliability
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("count", [30])
def test_threads_and_layers(tmp_path, count):
    """1, 2, 3, 4, 7 threads with both threading layers, each three times: the same bits."""
    layers = ("workqueue", "omp")
    choices = [
        (threads, layer) for _ in range(3) for threads in (2, 1, 3, 4, 7) for layer in layers
    ]
    found = set()
    for number, (threads, layer) in enumerate(choices[:count]):
        run = tmp_path / str(number)
        words = ["run", ROOT / "configs" / "million.toml", "-o", run, "--threads", threads]
        done = call(*words, *MANY.split(), cwd=tmp_path, NUMBA_THREADING_LAYER=layer)
        assert done.returncode == 0, done.stderr
        assert read_info(run)["provenance"]["threads"] == threads
        found.add(ends_of(run))
    assert len(found) == 1


JUMPING = """
import random, sys, time
sys.argv = ["multicor", "run", "small.toml", "-o", "run", "--max-hours", "1"]
time.time = lambda: random.choice([0.0, 1e9, 4e9, -1e6])
from multicor_cli.cli.app import main; main()
"""


@pytest.mark.parametrize("zone", thinned(("nonsense/<>", "Pacific/Kiritimati"), 2))
def test_clocks_that_jump_and_time_zones(zone, finished, tmp_path):
    """The wall clock is for people: nothing that is computed, and no interval, hangs on it."""
    write_small(tmp_path)
    done = python("-c", JUMPING, cwd=tmp_path, TZ=zone)
    assert done.returncode == 0, done.stderr
    assert ends_of(tmp_path / "run") == ends_of(finished)


@trials(short=5, long=50)
def test_reading_while_it_runs(tmp_path, count):
    """Every reading is the beginning of what is there at the end, and no shorter than the one
    before."""
    longer = "duration = 0.4" if count < 10 else "duration = 4.0"
    write_small(tmp_path, changed(SMALL, ("duration = 0.004", longer)))
    words = "run small.toml -o run --set output.checkpoint_interval=0.01".split()  # noqa: SIM905
    process = start(*words, cwd=tmp_path)
    end = time.monotonic() + 120.0
    while not (tmp_path / "run" / "model.h5").exists() and time.monotonic() < end:
        time.sleep(0.01)

    def read():
        with open_run(tmp_path / "run") as run:
            heights = [float(frame.position[:, 1].mean()) for frame in run.frames]
            return run.frames.step.tolist(), heights, run.series["kinetic"].tolist()

    readings = []
    while len(readings) < count:
        readings.append(read())
        time.sleep(0.02 if count < 10 else 0.5)
    assert process.wait(300) == 0, process.communicate()[1]
    whole = read()
    for reading in readings:
        for shown, all_of_it in zip(reading, whole, strict=True):
            assert shown == all_of_it[: len(shown)]
    lengths = [len(steps) for steps, _, _ in readings]
    assert lengths == sorted(lengths)
    print(f"{count} readings of {lengths[0]} to {lengths[-1]} of {len(whole[0])} frames")


NAMES = {
    "unicode": "ünïcödé–漢字", "spaces": "with spaces", "dash": "-dash", "long": "x" * 200,
    "not UTF-8": os.fsdecode(b"\xe9t\xe9"), "quotes": "semi;colon'quote\"",
}  # fmt: skip


@pytest.mark.parametrize("name", thinned(NAMES, 4))
def test_directories_of_any_name(name, finished, tmp_path):
    write_small(tmp_path)
    done = call("run", "small.toml", "-o", tmp_path / name, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert ends_of(tmp_path / name) == ends_of(finished)


@pytest.mark.reliability
def test_results_may_be_written_under_any_name(finished, tmp_path):
    name = NAMES["not UTF-8"]
    run = tmp_path / name
    shutil.copytree(finished, run)
    done = {
        "report": call("report", run, "-o", f"{name}.html", cwd=tmp_path),
        "map": call("post", "map", run, "--of", "velocity", "--plot", f"{name}.png", cwd=tmp_path),
        "csv": call("export", "csv", run, "-o", f"{name}-csv", cwd=tmp_path),
        "fclib": call("export", "fclib", run, "-o", f"{name}.h5", cwd=tmp_path),
        "gsd": call("export", "gsd", run, "-o", f"{name}.gsd", cwd=tmp_path),
    }
    codes = {word: result.returncode for word, result in done.items()}
    said = {word: result.stderr for word, result in done.items()}
    assert codes == {"report": 0, "map": 0, "csv": 0, "fclib": 0, "gsd": 6}, said
    assert "not UTF-8" in said["gsd"]  # the library cannot
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(
        [name, *(f"{name}{end}" for end in (".html", ".png", "-csv", ".h5"))]
    )


def as_nobody(*words, cwd, **extra):
    """Run Python as a user for whom permissions count; root may do everything."""
    setpriv = ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups", sys.executable]
    return subprocess.run(
        [*setpriv, *words], cwd=cwd, env=environment(PYTHONDONTWRITEBYTECODE="1", **extra),
        capture_output=True, text=True, check=False,
    )  # fmt: skip


@pytest.fixture
def nobodys():
    """A directory in which that user may read but not write."""
    if os.getuid() != 0 or shutil.which("setpriv") is None:
        pytest.skip("only root can become somebody else, with setpriv")
    path = Path("/tmp") / f"multicor-nobody-{os.getpid()}"  # those of pytest are closed to others
    path.mkdir(mode=0o755)
    try:
        write_small(path)
        version = as_nobody("--version", cwd=path)
        if version.returncode != 0:
            pytest.skip(f"the interpreter is closed to other users: {version.stderr.strip()}")
        yield path
    finally:
        shutil.rmtree(path)


COMPILE = """
import os
import numpy
from multicor_cli.engine.jit import arrays
print(arrays.cos(numpy.zeros(1))[0], os.environ["NUMBA_CACHE_DIR"])
"""


def test_directories_that_may_not_be_written(nobodys):
    """A run says so; kernels find another place for their machine code."""
    (nobodys / "closed").mkdir(mode=0o555)
    words = ("-m", "multicor_cli", "run", "small.toml", "-o", "closed/run")
    refused = as_nobody(*words, cwd=nobodys, HOME="/nonexistent")
    assert refused.returncode == 5, refused.stderr
    assert "closed/run: Permission denied" in refused.stderr
    (nobodys / "home").mkdir(mode=0o555)
    for home in ("/nonexistent", str(nobodys / "home")):
        done = as_nobody("-c", COMPILE, cwd=nobodys, HOME=home)
        assert done.returncode == 0, done.stderr
        value, place = done.stdout.split()
        assert value == "1.0"
        assert next(Path(place).rglob("*.nbc"), None) is not None


KERNEL = """
from multicor_cli.engine.jit.compile import kernel
from multicor_cli.scenario.probe import answer
@kernel
def ask(x):
    return answer(x)
"""
FORMULA = """
from multicor_cli.engine.jit.formulas import formula
@formula
def answer(x):
    return {} * x
"""
ASK = (
    "from multicor_cli.packing.probe import ask; print(ask(1.0)); "
    "print(sum(ask.stats.cache_hits.values()))"
)


def test_stale_machine_code_is_never_used(tmp_path):
    """Numba does not notice that a function called by a cached one has changed: a copy of the
    program, edited between two runs."""
    package = tmp_path / "multicor_cli"
    shutil.copytree(ROOT / "multicor_cli", package, ignore=shutil.ignore_patterns("__pycache__"))
    (package / "packing" / "probe.py").write_text(KERNEL)
    seen = []
    for value in (1.0, 1.0, 2.0, 1.0):
        (package / "scenario" / "probe.py").write_text(FORMULA.format(value))
        # Python's own files of compiled code do not tell sources of one size, written within a
        # second, apart: without them.
        done = python(
            "-c", ASK, cwd=tmp_path, NUMBA_CACHE_DIR=str(tmp_path / "cache"),
            PYTHONDONTWRITEBYTECODE="1", PYTHONPATH=str(tmp_path),
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        seen.append(tuple(float(word) for word in done.stdout.split()))
    # The first sources come back, and with them their cache
    assert seen == [(1.0, 0.0), (1.0, 1.0), (2.0, 0.0), (1.0, 1.0)]


@pytest.mark.reliability
def test_heat_and_stages_too(tmp_path):
    """The scenario that uses every field of the state, on both threading layers."""
    (tmp_path / "warm.toml").write_text(WARM)
    for name, layer in (("a", "workqueue"), ("b", "omp")):
        done = call("run", "warm.toml", "-o", name, cwd=tmp_path, NUMBA_THREADING_LAYER=layer)
        assert done.returncode == 0, done.stderr
    assert ends_of(tmp_path / "a") == ends_of(tmp_path / "b")
    with open_run(tmp_path / "a") as run:
        assert np.isfinite(run.frames[-1].temperature).all()
