"""What surrounds a run does not change it: threads, threading layers, clocks, time zones, readers,
no home, a stale cache.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from command_line import call, environment, read_info, start
from places import ROOT
from scenes import SMALL, WARM, changed, write_small
from store_support import ends_of
from trials import thinned, trials

from multicor_cli.store import open_run

CONFIGS = ROOT / "configs"
MANY = (
    "--set",
    "particles.0.count=5000",
    "--set",
    "loading.0.duration=0.004",
    "--set",
    "solver.max_sweeps=60",
)
"""So many grains that several threads are used, few steps."""


@pytest.mark.reliability
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("count", [30])
def test_threads_and_layers(tmp_path: Path, count: int) -> None:
    """1, 2, 3, 4, 7 threads with both threading layers, each three times: the same bits."""
    choices = [
        (threads, layer)
        for _ in range(3)
        for threads in (2, 1, 3, 4, 7)
        for layer in ("workqueue", "omp")
    ][:count]
    found = set()
    for number, (threads, layer) in enumerate(choices):
        run = tmp_path / str(number)
        done = call(
            "run",
            CONFIGS / "million.toml",
            "-o",
            run,
            "--threads",
            threads,
            *MANY,
            cwd=tmp_path,
            NUMBA_THREADING_LAYER=layer,
        )
        assert done.returncode == 0, done.stderr
        assert read_info(run)["provenance"]["threads"] == threads
        found.add(ends_of(run))
    assert len(found) == 1


@pytest.mark.parametrize("zone", thinned(("nonsense/<>", "Pacific/Kiritimati"), 2))
def test_clocks_that_jump_and_time_zones(zone: str, finished: Path, tmp_path: Path) -> None:
    """The wall clock is for people: nothing that is computed, and no interval, hangs on it."""
    write_small(tmp_path)
    jumping = (
        "import random, sys, time; sys.argv = ['multicor', 'run', 'small.toml', '-o', 'run', "
        "'--max-hours', '1']\ntime.time = lambda: random.choice([0.0, 1e9, 4e9, -1e6])\n"
        "from multicor_cli.cli.app import main; main()"
    )
    done = subprocess.run(
        [sys.executable, "-c", jumping],
        cwd=tmp_path,
        env=environment(TZ=zone),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert ends_of(tmp_path / "run") == ends_of(finished)


@trials(short=5, long=50)
def test_reading_while_it_runs(tmp_path: Path, count: int) -> None:
    """Every reading is the beginning of what is there at the end, and no shorter than the one
    before.
    """
    text = changed(
        SMALL, ("duration = 0.004", "duration = 0.4" if count < 10 else "duration = 4.0")
    )
    write_small(tmp_path, text)
    process = start(
        "run", "small.toml", "-o", "run", "--set", "output.checkpoint_interval=0.01", cwd=tmp_path
    )
    end = time.monotonic() + 120.0
    while not (tmp_path / "run" / "model.h5").exists() and time.monotonic() < end:
        time.sleep(0.01)
    readings = []
    while len(readings) < count:
        with open_run(tmp_path / "run") as run:
            heights = [float(frame.position[:, 1].mean()) for frame in run.frames]
            readings.append((run.frames.step.tolist(), heights, run.series["kinetic"].tolist()))
        time.sleep(0.02 if count < 10 else 0.5)
    assert process.wait(300) == 0, process.communicate()[1]
    with open_run(tmp_path / "run") as run:
        steps = run.frames.step.tolist()
        heights = [float(frame.position[:, 1].mean()) for frame in run.frames]
        kinetic = run.series["kinetic"].tolist()
    for shown, means, energies in readings:
        assert shown == steps[: len(shown)]
        assert means == heights[: len(means)]
        assert energies == kinetic[: len(energies)]
    lengths = [len(reading[0]) for reading in readings]
    assert lengths == sorted(lengths)
    print(f"{count} readings of {lengths[0]} to {lengths[-1]} of {len(steps)} frames")


NAMES = {
    "unicode": "ünïcödé–漢字",
    "spaces": "with spaces",
    "dash": "-dash",
    "long": "x" * 200,
    "not UTF-8": os.fsdecode(b"\xe9t\xe9"),
    "quotes": "semi;colon'quote\"",
}


@pytest.mark.parametrize("name", thinned(NAMES, 4))
def test_directories_of_any_name(name: str, finished: Path, tmp_path: Path) -> None:
    write_small(tmp_path)
    done = call("run", "small.toml", "-o", tmp_path / name, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert ends_of(tmp_path / name) == ends_of(finished)


@pytest.mark.reliability
def test_results_may_be_written_under_any_name(finished: Path, tmp_path: Path) -> None:
    name = NAMES["not UTF-8"]
    run = tmp_path / name
    shutil.copytree(finished, run)
    commands = {
        "report": ("report", run, "-o", f"{name}.html"),
        "map": ("post", "map", run, "--of", "velocity", "--plot", f"{name}.png"),
        "csv": ("export", "csv", run, "-o", f"{name}-csv"),
        "fclib": ("export", "fclib", run, "-o", f"{name}.h5"),
        "gsd": ("export", "gsd", run, "-o", f"{name}.gsd"),
    }
    done = {word: call(*arguments, cwd=tmp_path) for word, arguments in commands.items()}
    codes = {word: result.returncode for word, result in done.items()}
    assert codes == {"report": 0, "map": 0, "csv": 0, "fclib": 0, "gsd": 6}, {
        word: r.stderr for word, r in done.items()
    }
    assert "not UTF-8" in done["gsd"].stderr  # the library cannot
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(
        [name, *(f"{name}{end}" for end in (".html", ".png", "-csv", ".h5"))]
    )


def as_nobody(arguments: list[object], cwd: Path, **extra: str) -> subprocess.CompletedProcess[str]:
    """Run Python as a user for whom permissions count; root may do everything."""
    setpriv = ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups"]
    return subprocess.run(
        [*setpriv, sys.executable, *map(str, arguments)],
        cwd=cwd,
        env={**environment(**extra), "PYTHONDONTWRITEBYTECODE": "1"},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.fixture
def nobodys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A directory in which that user may read but not write."""
    if os.getuid() != 0 or shutil.which("setpriv") is None:
        pytest.skip("only root can become somebody else, with setpriv")
    path = Path("/tmp") / f"multicor-nobody-{os.getpid()}"  # those of pytest are closed to others
    path.mkdir(mode=0o755)
    write_small(path)
    version = as_nobody(["--version"], path)
    if version.returncode != 0:
        shutil.rmtree(path)
        pytest.skip(f"the interpreter is closed to other users: {version.stderr.strip()}")
    return path


COMPILE = """
import os
import numpy
from multicor_cli.engine.jit import elementwise
print(elementwise.cos(numpy.zeros(1))[0], os.environ["NUMBA_CACHE_DIR"])
"""


def test_directories_that_may_not_be_written(nobodys: Path) -> None:
    """A run says so; kernels find another place for their machine code."""
    try:
        (nobodys / "closed").mkdir(mode=0o555)
        refused = as_nobody(
            ["-m", "multicor_cli", "run", "small.toml", "-o", "closed/run"],
            nobodys,
            HOME="/nonexistent",
        )
        assert refused.returncode == 5, refused.stderr
        assert "closed/run: Permission denied" in refused.stderr
        (nobodys / "home").mkdir(mode=0o555)
        for home in ("/nonexistent", str(nobodys / "home")):
            done = as_nobody(["-c", COMPILE], nobodys, HOME=home)
            assert done.returncode == 0, done.stderr
            value, place = done.stdout.split()
            assert value == "1.0"
            assert next(Path(place).rglob("*.nbc"), None) is not None
    finally:
        shutil.rmtree(nobodys)


def test_stale_machine_code_is_never_used(tmp_path: Path) -> None:
    """Numba does not notice that a function called by a cached one has changed: a copy of the
    program, edited between two runs.
    """
    shutil.copytree(
        ROOT / "multicor_cli",
        tmp_path / "multicor_cli",
        ignore=shutil.ignore_patterns("__pycache__"),
    )
    kernel = tmp_path / "multicor_cli" / "packing" / "probe.py"
    formula = tmp_path / "multicor_cli" / "scenario" / "probe.py"
    kernel.write_text(
        "from multicor_cli.engine.jit.compile import kernel\n"
        "from multicor_cli.scenario.probe import answer\n"
        "@kernel\n"
        "def ask(x):\n"
        "    return answer(x)\n"
    )
    script = (
        "from multicor_cli.packing.probe import ask; print(ask(1.0)); "
        "print(sum(ask.stats.cache_hits.values()))"
    )
    seen = []
    for value in (1.0, 1.0, 2.0, 1.0):
        formula.write_text(
            "from multicor_cli.engine.jit.formulas import formula\n@formula\ndef answer(x):\n"
            f"    return {value} * x\n"
        )
        # Python's own files of compiled code do not tell sources of one size, written within a
        # second, apart: without them.
        env = {
            **environment(NUMBA_CACHE_DIR=str(tmp_path / "cache"), PYTHONDONTWRITEBYTECODE="1"),
            "PYTHONPATH": str(tmp_path),
        }
        done = subprocess.run(
            [sys.executable, "-c", script],
            cwd=tmp_path,
            env=env,
            capture_output=True,
            text=True,
            check=True,
        )
        seen.append(tuple(float(word) for word in done.stdout.split()))
    # The first sources come back, and with them their cache
    assert seen == [(1.0, 0.0), (1.0, 1.0), (2.0, 0.0), (1.0, 1.0)]


@pytest.mark.reliability
def test_heat_and_stages_too(tmp_path: Path) -> None:
    """The scenario that uses every field of the state, on both threading layers and in pieces of a
    second.
    """
    (tmp_path / "warm.toml").write_text(WARM)
    found = set()
    for name, layer in (("a", "workqueue"), ("b", "omp")):
        done = call("run", "warm.toml", "-o", name, cwd=tmp_path, NUMBA_THREADING_LAYER=layer)
        assert done.returncode == 0, done.stderr
        found.add(ends_of(tmp_path / name))
    assert len(found) == 1
    with open_run(tmp_path / "a") as run:
        assert np.isfinite(run.frames[-1].temperature).all()
