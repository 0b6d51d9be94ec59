"""The process of a case: of those that start together one compiles, and a case whose machine is
gone is taken over."""

import json
import multiprocessing
import os
import threading
import time

import pytest
from scenes import SMALL

import multicor_cli as multicor
from multicor_cli.running.outcome import SilentObserver
from multicor_cli.store.errors import RunLocked
from multicor_cli.studies.child import CompilationTurn, Silence, run_task

# ---- Of processes that start together one compiles, the others wait


def compile_once(began, may_go_on):
    turn = CompilationTurn("a")
    began.set()
    may_go_on.wait()
    turn.done()


@pytest.mark.parametrize("is_killed", [False, True])
def test_the_second_waits_for_the_first(is_killed, tmp_path, monkeypatch):
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


def test_without_a_place_nobody_waits(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "none"))
    CompilationTurn("a").done()
    assert list(tmp_path.iterdir()) == []


# ---- A case whose lock names another machine: taken over once nothing moves there any more, and
#      then out of reach of the other


def task(tmp_path, **more):
    scenario = tmp_path / "small.toml"
    scenario.write_text(SMALL)
    return {
        "scenario": str(scenario), "overrides": [], "directory": str(tmp_path / "run"),
        "threads": 1, "turn": "test",
        "max_hours": None, **more,
    }  # fmt: skip


class _Stopping(SilentObserver):
    """Has another machine take the run at a step, or stops it there."""

    def __init__(self, step, act):
        self._step, self._act = step, act

    def stepped(self, status):
        if status.state.step == self._step:
            self._act()


def name_other_host(lock):
    lock.write_text(
        json.dumps({"pid": 4711, "host": "node-that-died", "started": "", "start_ticks": 1})
    )


def test_a_case_of_a_machine_that_died_goes_on(tmp_path):
    given = task(tmp_path, silence=1.0)
    multicor.run(given["scenario"], tmp_path / "whole", threads=1)
    with pytest.raises(ZeroDivisionError):
        multicor.run(
            given["scenario"], given["directory"], threads=1, observer=_Stopping(50, lambda: 1 // 0)
        )
    lock = tmp_path / "run" / "lock"
    name_other_host(lock)
    with pytest.raises(RunLocked, match="node-that-died"):
        multicor.run(given["scenario"], given["directory"], threads=1)
    started = time.monotonic()
    assert run_task(given)["status"] == "finished"
    assert time.monotonic() - started >= 1.0
    digests = [
        json.loads((tmp_path / name / "run.json").read_text())["summary"]["state_digest"]
        for name in ("whole", "run")
    ]
    assert digests[0] == digests[1]


def test_as_long_as_something_moves_nothing_is_taken(tmp_path):
    (tmp_path / "lock").write_text("{}")
    silence, ended = Silence(tmp_path, 0.4), threading.Event()

    def beat():
        for moment in range(20):
            os.utime(tmp_path / "lock", (moment, moment))
            time.sleep(0.1)
        ended.set()

    threading.Thread(target=beat).start()
    while not silence.is_over():
        time.sleep(0.05)
    assert ended.wait(0.0)


def test_a_process_that_was_taken_for_dead_writes_nothing_more(tmp_path):
    given = task(tmp_path)
    path = tmp_path / "run"
    kept = {}

    def take():
        (path / "lock").unlink()
        name_other_host(path / "lock")
        kept.update(
            {
                str(file): file.read_bytes()
                for file in path.rglob("*")
                if file.is_file() and file.name != "progress.json"
            }
        )

    with pytest.raises(RunLocked, match="process 4711 on node-that-died took over this run"):
        multicor.run(given["scenario"], path, threads=1, observer=_Stopping(50, take))
    now = {
        str(file): file.read_bytes()
        for file in path.rglob("*")
        if file.is_file() and file.name != "progress.json"
    }
    assert now == kept
