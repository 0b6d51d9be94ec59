"""A run is killed at any moment, again and again: the same command goes on, and the end is the same
to the bit.

After every kill: nothing committed is damaged, files once committed are never touched again, and no
step is lost that a checkpoint had saved.
"""

import json
import random
import signal
import subprocess
import time

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


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    """An uninterrupted run: its digests, and how long it takes."""
    directory = tmp_path_factory.mktemp("reference")
    (directory / "warm.toml").write_text(WARM)
    done = call("run", "warm.toml", "-o", "first", cwd=directory)  # kernels may be compiled now
    assert done.returncode == 0, done.stderr
    before = time.monotonic()
    done = call(*RUN, cwd=directory)
    seconds = time.monotonic() - before
    assert done.returncode == 0, done.stderr
    assert ends_of(directory / "cut") == ends_of(directory / "first")
    return ends_of(directory / "cut"), seconds


class Watch:
    """What a run directory has promised, looked at after every kill."""

    def __init__(self, folder):
        folder.mkdir()
        (folder / "warm.toml").write_text(WARM)
        self.folder, self.run = folder, folder / "cut"
        self.step, self.files = -1, {}

    def look(self):
        if not RunDirectory.is_run(self.run):
            assert self.step < 0, "the run is gone"
            return
        assert errors_of(self.run) == []
        sidecars = sorted(self.run.glob("checkpoints/step-*.json"))
        step = int(sidecars[-1].name[5:16]) if sidecars else -1
        assert step >= self.step, f"step {self.step} had been saved, {step} is left"
        for file, identity in self.files.items():
            assert not file.exists() or stamp(file) == identity, f"{file} was touched"
        # Files that belong to the newest checkpoint: what was written after it is set aside and
        # written anew
        segments = json.loads(sidecars[-1].read_text())["segments"] if sidecars else []
        files = [self.run / "segments" / segment["name"] for segment in segments]
        if sidecars:
            files += [*self.run.glob("checkpoints/*.h5"), self.run / "model.h5"]
        self.step, self.files = step, {file: stamp(file) for file in files if file.exists()}

    def finish_and_compare(self, digests):
        self.look()
        done = call(*RUN, cwd=self.folder)
        assert done.returncode == 0, done.stderr
        assert ends_of(self.run) == digests
        assert errors_of(self.run) == []


def stamp(file):
    status = file.stat()
    return status.st_ino, status.st_mtime_ns, status.st_size


@pytest.mark.reliability
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("count", [100])
def test_killed_at_any_moment(tmp_path, reference, count):
    """Up to three kills a run, each at a random time after its start."""
    rng, killed, (digests, seconds) = random.Random(1), 0, reference
    for trial in range(count):
        watch = Watch(tmp_path / str(trial))
        for _ in range(rng.randint(1, KILLS)):
            process = start(*RUN, cwd=watch.folder)
            try:
                process.wait(rng.uniform(0.2, 1.0) * seconds)
            except subprocess.TimeoutExpired:
                process.kill()
            process.communicate(timeout=60)
            assert process.returncode in (0, -signal.SIGKILL)
            killed += process.returncode != 0
            watch.look()
        watch.finish_and_compare(digests)
    print(f"{count} runs, {killed} kills")
    assert killed >= count // 2


@trials(short=1, long=len(FIRST_TIMES))
def test_killed_at_named_points(tmp_path, reference, count):
    """Every window of the commit protocol, in the program as a whole."""
    for index in range(count):
        point, watch = FIRST_TIMES[index * len(FIRST_TIMES) // count], Watch(tmp_path / str(index))
        done = call(*RUN, cwd=watch.folder, MULTICOR_KILL_AT=point)
        assert done.returncode == -signal.SIGKILL, f"{point}: the run never came there"
        watch.finish_and_compare(reference[0])
