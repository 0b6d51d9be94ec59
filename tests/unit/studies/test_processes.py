"""Processes of cases are forked from one that has loaded the program; nobody is missed, whoever
dies. Of those that start together one compiles, and a case whose machine is gone is taken over."""

import json
import multiprocessing
import os
import signal
import socket
import threading
import time

import pytest
from scenes import SMALL

import multicor_cli as multicor
from multicor_cli.running.outcome import QuietObserver
from multicor_cli.store.errors import RunLocked
from multicor_cli.studies import processes
from multicor_cli.studies.processes import (
    CompilationTurn,
    ForkServer,
    Silence,
    run_case,
    run_task,
    stop_cases,
)


def task(folder, name="run", **more):
    scenario = folder / "small.toml"
    if not scenario.exists():  # a process that has been started may be reading it
        scenario.write_text(SMALL)
    return {
        "scenario": str(scenario), "overrides": [], "directory": str(folder / name), "threads": 1,
        "turn": "test", **more,
    }  # fmt: skip


# ---- Processes are forked, and tell how they have ended


def line_of(given):
    return json.dumps(given).encode() + b"\n"


@pytest.fixture(scope="module")
def server():
    server = ForkServer(1)
    yield server
    os.kill(server._process.pid, signal.SIGKILL)


def said(process):
    """All that it says until it ends."""
    with process.stream.makefile("rb") as stream:
        return stream.read()


def test_several_at_a_time_each_with_streams_of_its_own(server, tmp_path):
    started = [server.start() for _ in range(3)]
    for number, process in enumerate(started):
        process.stream.sendall(line_of(task(tmp_path, f"run-{number}")))
    for process in reversed(started):
        assert json.loads(said(process))["status"] == "finished"
        assert process.wait() == 0
    ids = {
        json.loads((tmp_path / f"run-{number}" / "run.json").read_text())["run_id"]
        for number in range(3)
    }
    assert len(ids) == 3


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_how_a_process_ended(number, server):
    process = server.start()
    process.send_signal(number)
    assert said(process) == b""
    assert process.wait() == -number
    process.send_signal(number)  # nobody is there any more


def test_whoever_waits_for_a_case_dies(server, tmp_path):
    process = server.start()
    given = task(tmp_path, overrides=["loading.1.until.strain.value=1e3"])
    process.stream.sendall(line_of(given))
    while not (tmp_path / "run" / "progress.json").exists():
        time.sleep(0.05)
    process.stream.shutdown(socket.SHUT_WR)
    assert json.loads(said(process))["status"] == "stopped"


def test_a_fork_server_that_dies_leaves_its_cases_alone(tmp_path):
    server = ForkServer(1)
    process = server.start()
    os.kill(server._process.pid, signal.SIGKILL)
    process.stream.sendall(line_of(task(tmp_path)))
    assert json.loads(said(process))["status"] == "finished"
    assert process.wait() == -signal.SIGKILL  # nobody knows
    assert not server.is_alive
    with pytest.raises(OSError, match="no process could be started"):
        server.start()


def test_a_worker_starts_another_fork_server_if_its_own_has_died(tmp_path):
    given = task(tmp_path) | {"client": "a", "name": "run"}
    assert run_case(given)["status"] == "finished"
    (server,) = processes._fork_servers
    os.kill(server._process.pid, signal.SIGKILL)
    assert run_case({**given, "directory": str(tmp_path / "again")})["status"] == "finished"
    assert processes._fork_servers != [server]


def test_a_worker_that_was_asked_to_stop_works_for_the_next_client(tmp_path):
    given = task(tmp_path) | {"client": "first", "name": "run"}
    assert stop_cases("first") == 0
    assert run_case(given)["reason"] == "not begun"
    assert run_case({**given, "client": "second"})["status"] == "finished"


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


class _Stopping(QuietObserver):
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

    def files_of_run():
        return {
            str(file): file.read_bytes()
            for file in path.rglob("*")
            if file.is_file() and file.name != "progress.json"
        }

    def take():
        (path / "lock").unlink()
        name_other_host(path / "lock")
        kept.update(files_of_run())

    with pytest.raises(RunLocked, match="process 4711 on node-that-died took over this run"):
        multicor.run(given["scenario"], path, threads=1, observer=_Stopping(50, take))
    assert files_of_run() == kept
