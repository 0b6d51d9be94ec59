"""Of processes that start together one compiles, the others wait."""

from __future__ import annotations

import multiprocessing
import time
from multiprocessing.synchronize import Event
from pathlib import Path

import pytest

from multicor_cli.studies.turns import CompilationTurn


def compile_once(began: Event, may_go_on: Event) -> None:
    turn = CompilationTurn("a")
    began.set()
    may_go_on.wait()
    turn.done()


@pytest.mark.parametrize("is_killed", [False, True])
def test_the_second_waits_for_the_first(is_killed: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    context = multiprocessing.get_context("fork")
    events = [(context.Event(), context.Event()) for _ in range(2)]
    first, second = (context.Process(target=compile_once, args=pair) for pair in events)
    first.start()
    assert events[0][0].wait(20.0)
    second.start()
    time.sleep(0.3)
    assert not events[1][0].is_set()
    if is_killed:
        first.kill()
    else:
        events[0][1].set()
    assert events[1][0].wait(20.0)
    assert (tmp_path / "turn-a.done").exists() is not is_killed
    events[1][1].set()
    for process in (first, second):
        process.join(20.0)
    assert (tmp_path / "turn-a.done").exists()
    CompilationTurn("a").done()  # nobody waits any more


def test_without_a_place_nobody_waits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "none"))
    CompilationTurn("a").done()
    assert list(tmp_path.iterdir()) == []
