"""Cut the power after any call that changes a file: whatever the disk has kept is whole, and no
checkpoint that was made is lost.

The disk is a model (`disk_model`): what was not given to ``fsync`` may be there or not, names and
bytes apart. Every distinct directory that a cut can leave is checked, and the run is continued from
it to its end.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from disk_model import Content, Inspect, Left, PowerCuts
from store_support import continue_run, errors_of
from system_calls import hooked
from trials import trials

from multicor_cli.store import RunDirectory, run_info


class Promises:
    """What the program has said to have done: from then on a power cut must not undo it."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.reset()
        checkpoint, finish = RunDirectory.checkpoint, RunDirectory.finish

        def noting_checkpoint(run: RunDirectory, state, writer) -> None:
            checkpoint(run, state, writer)
            self.step = state.step

        def noting_finish(run: RunDirectory, *args, **kwargs) -> None:
            finish(run, *args, **kwargs)
            self.is_finished = True

        monkeypatch.setattr(RunDirectory, "checkpoint", noting_checkpoint)
        monkeypatch.setattr(RunDirectory, "finish", noting_finish)

    def reset(self) -> None:
        self.step, self.is_finished = -1, False

    def as_tuple(self) -> tuple[int, bool]:
        return self.step, self.is_finished

    @contextlib.contextmanager
    def frozen(self) -> Iterator[None]:
        """While runs that are left are continued, what they promise does not count."""
        kept = self.as_tuple()
        try:
            yield
        finally:
            self.step, self.is_finished = kept

    def assert_kept(self, run: Path) -> None:
        """Nothing that counts is damaged, and the newest checkpoint promised, or a later one, is
        there.
        """
        if not RunDirectory.is_run(run):
            assert self.step < 0, f"the run is gone, which had a checkpoint at step {self.step}"
            return
        assert errors_of(run) == []
        info = run_info(run)
        if self.is_finished:
            assert info["status"] == "finished"
        assert (info["step"] is None and self.step < 0) or info["step"] >= self.step


@trials(short=4, long=100_000)
def test_power_cut(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, count: int) -> None:
    """``count`` is the largest number of directories looked at; they are spread evenly over the
    run.
    """
    continue_run(tmp_path / "whole")
    expected = run_info(tmp_path / "whole")
    promises, total = Promises(monkeypatch), 0

    def number(_call: str, states: Iterator[Left]) -> None:
        nonlocal total
        total += sum(1 for _ in states)

    follow(tmp_path / "first", number, promises)
    assert total > 1000
    every, found = -(-total // count), 0

    def inspect(call: str, states: Iterator[Left]) -> None:
        nonlocal found
        for left in states:
            found += 1
            if found % every == 0:
                left.write(tmp_path / "left")
                with promises.frozen():
                    look(
                        tmp_path / "left" / "run",
                        promises,
                        expected,
                        f"power cut after {call}: {left.reason}",
                    )

    follow(tmp_path / "second", inspect, promises)
    assert found == pytest.approx(total, rel=0.05)  # times of day have more or fewer digits
    print(f"{found // every} of {found} directories looked at")


def look(run: Path, promises: Promises, expected: dict[str, Any], where: str) -> None:
    try:
        promises.assert_kept(run)
        continue_run(run)
        info = run_info(run)
        assert (info["data_digest"], info["state_digest"]) == (
            expected["data_digest"],
            expected["state_digest"],
        )
    except Exception as error:
        raise AssertionError(where) from error


def follow(disk: Path, inspect: Inspect, promises: Promises) -> None:
    """Carry out a run on a disk that `PowerCuts` follows."""
    disk.mkdir()
    promises.reset()
    cuts = PowerCuts(disk, inspect, promises.as_tuple)
    with hooked(cuts.hook):
        continue_run(disk / "run")
    assert cuts.as_seen() == as_is(disk), "a call was overlooked"


def as_is(disk: Path) -> Content:
    content: Content = {}
    for path in sorted(disk.rglob("*")):
        name = str(path.relative_to(disk))
        if path.is_symlink():
            content[name] = str(path.readlink())
        else:
            content[name] = None if path.is_dir() else path.read_bytes()
    return content
