"""A run is killed at any moment, again and again: the same command goes on, and the end is the same
to the bit.

After every kill: nothing committed is damaged, files once committed are never touched again, and no
step is lost that a checkpoint had saved.
"""

from __future__ import annotations

import json
import random
import signal
import subprocess
import time
from pathlib import Path

import pytest
from command_line import call, start
from kill_points import POINTS
from scenes import WARM
from store_support import ends_of, errors_of
from trials import trials

from multicor_cli.store import RunDirectory

RUN = ("run", "warm.toml", "-o", "cut", "--set", "output.checkpoint_interval=0.02")
KILLS = 3
"""Kills of one run at most."""

FIRST_TIMES = sorted({point.partition(":")[0] for point in POINTS})
"""A run this short does not pass all of them twice."""


class Reference:
    """An uninterrupted run: its digests, and how long it takes."""

    def __init__(self, directory: Path) -> None:
        (directory / "warm.toml").write_text(WARM)
        done = call("run", "warm.toml", "-o", "first", cwd=directory)  # kernels may be compiled now
        assert done.returncode == 0, done.stderr
        before = time.monotonic()
        done = call(*RUN, cwd=directory)
        self.seconds = time.monotonic() - before
        assert done.returncode == 0, done.stderr
        self.digests = ends_of(directory / "cut")
        assert self.digests == ends_of(directory / "first")


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> Reference:
    return Reference(tmp_path_factory.mktemp("reference"))


class Watch:
    """What a run directory has promised, looked at after every kill."""

    def __init__(self, run: Path) -> None:
        self._run = run
        self._step = -1
        self._files: dict[str, tuple[int, int, int]] = {}

    def look(self) -> None:
        if not RunDirectory.is_run(self._run):
            assert self._step < 0, "the run is gone"
            return
        assert errors_of(self._run) == []
        step = newest_checkpoint(self._run)
        assert step >= self._step, f"step {self._step} had been saved, {step} is left"
        for name, identity in self._files.items():
            file = self._run / name
            assert not file.exists() or stamp(file) == identity, f"{name} was touched"
        self._step = step
        self._files = {str(file.relative_to(self._run)): stamp(file) for file in self._committed()}

    def _committed(self) -> list[Path]:
        """Files that belong to the newest checkpoint; what was written after it is set aside and
        written anew.
        """
        sidecars = sorted(self._run.glob("checkpoints/step-*.json"))
        if not sidecars:
            return []
        segments = [
            self._run / "segments" / segment["name"]
            for segment in json.loads(sidecars[-1].read_text())["segments"]
        ]
        files = [*segments, *self._run.glob("checkpoints/*.h5"), self._run / "model.h5"]
        return [file for file in files if file.exists()]


def newest_checkpoint(run: Path) -> int:
    return max((int(path.name[5:16]) for path in run.glob("checkpoints/step-*.json")), default=-1)


def stamp(file: Path) -> tuple[int, int, int]:
    status = file.stat()
    return status.st_ino, status.st_mtime_ns, status.st_size


def finish_and_compare(tmp_path: Path, reference: Reference, watch: Watch) -> None:
    watch.look()
    done = call(*RUN, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert ends_of(tmp_path / "cut") == reference.digests
    assert errors_of(tmp_path / "cut") == []


@pytest.mark.reliability
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("count", [100])
def test_killed_at_any_moment(tmp_path: Path, reference: Reference, count: int) -> None:
    """Up to three kills a run, each at a random time after its start."""
    rng, killed = random.Random(1), 0
    for trial in range(count):
        directory = tmp_path / str(trial)
        directory.mkdir()
        (directory / "warm.toml").write_text(WARM)
        watch = Watch(directory / "cut")
        for _ in range(rng.randint(1, KILLS)):
            process = start(*RUN, cwd=directory)
            try:
                process.wait(rng.uniform(0.2, 1.0) * reference.seconds)
            except subprocess.TimeoutExpired:
                process.kill()
            process.communicate(timeout=60)
            assert process.returncode in (0, -signal.SIGKILL)
            killed += process.returncode != 0
            watch.look()
        finish_and_compare(directory, reference, watch)
    print(f"{count} runs, {killed} kills")
    assert killed >= count // 2


@trials(short=1, long=len(FIRST_TIMES))
def test_killed_at_named_points(tmp_path: Path, reference: Reference, count: int) -> None:
    """Every window of the commit protocol, in the program as a whole."""
    for index in range(count):
        point = FIRST_TIMES[index * len(FIRST_TIMES) // count]
        directory = tmp_path / str(index)
        directory.mkdir()
        (directory / "warm.toml").write_text(WARM)
        done = call(*RUN, cwd=directory, MULTICOR_KILL_AT=point)
        assert done.returncode == -signal.SIGKILL, f"{point}: the run never came there"
        finish_and_compare(directory, reference, Watch(directory / "cut"))
