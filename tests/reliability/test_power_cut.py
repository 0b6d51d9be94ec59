"""Cut the power after any call that changes a file: whatever the disk has kept is whole, and no
checkpoint that was made is lost.

The disk is a model (`disk_model`): what was not given to ``fsync`` may be there or not, names and
bytes apart. Every distinct directory that a cut can leave is checked, and the run is continued from
it to its end.
"""

import contextlib

import pytest
from disk_model import PowerCuts
from store_support import continue_run, ends_of, errors_of
from system_calls import hooked
from trials import trials

from multicor_cli.store import RunDirectory, run_info


class Promises:
    """What the program has said to have done: from then on a power cut must not undo it."""

    def __init__(self, monkeypatch):
        self.kept = (-1, False)
        checkpoint, finish = RunDirectory.checkpoint, RunDirectory.finish

        def noting_checkpoint(run, state, writer):
            checkpoint(run, state, writer)
            self.kept = (state.step, self.kept[1])

        def noting_finish(run, *args, **kwargs):
            finish(run, *args, **kwargs)
            self.kept = (self.kept[0], True)

        monkeypatch.setattr(RunDirectory, "checkpoint", noting_checkpoint)
        monkeypatch.setattr(RunDirectory, "finish", noting_finish)

    @contextlib.contextmanager
    def frozen(self):
        """While runs that are left are continued, what they promise does not count."""
        kept = self.kept
        try:
            yield
        finally:
            self.kept = kept

    def assert_kept(self, run):
        """Nothing that counts is damaged, and the newest checkpoint promised, or a later one, is
        there."""
        step, is_finished = self.kept
        if not RunDirectory.is_run(run):
            assert step < 0, f"the run is gone, which had a checkpoint at step {step}"
            return
        assert errors_of(run) == []
        info = run_info(run)
        if is_finished:
            assert info["status"] == "finished"
        assert (info["step"] is None and step < 0) or info["step"] >= step


@trials(short=4, long=100_000)
def test_power_cut(tmp_path, monkeypatch, count):
    """``count`` is the largest number of directories looked at; they are spread evenly over the
    run."""
    continue_run(tmp_path / "whole")
    expected = ends_of(tmp_path / "whole")
    promises, total = Promises(monkeypatch), 0

    def number(_call, states):
        nonlocal total
        total += sum(1 for _ in states)

    follow(tmp_path / "first", number, promises)
    assert total > 1000
    every, found = -(-total // count), 0

    def inspect(call, states):
        nonlocal found
        for left in states:
            found += 1
            if found % every == 0:
                left.write(tmp_path / "left")
                with promises.frozen():
                    look(tmp_path / "left" / "run", promises, expected, f"{call}: {left.reason}")

    follow(tmp_path / "second", inspect, promises)
    assert found == pytest.approx(total, rel=0.05)  # times of day have more or fewer digits
    print(f"{found // every} of {found} directories looked at")


def look(run, promises, expected, where):
    try:
        promises.assert_kept(run)
        continue_run(run)
        assert ends_of(run) == expected
    except Exception as error:
        raise AssertionError(f"power cut after {where}") from error


def follow(disk, inspect, promises):
    """Carry out a run on a disk that `PowerCuts` follows."""
    disk.mkdir()
    promises.kept = (-1, False)
    cuts = PowerCuts(disk, inspect, lambda: promises.kept)
    with hooked(cuts.hook):
        continue_run(disk / "run")
    assert cuts.as_seen() == as_is(disk), "a call was overlooked"


def as_is(disk):
    content = {}
    for path in sorted(disk.rglob("*")):
        name = str(path.relative_to(disk))
        if path.is_symlink():
            content[name] = str(path.readlink())
        else:
            content[name] = None if path.is_dir() else path.read_bytes()
    return content
