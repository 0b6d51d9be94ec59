"""Processes of cases are forked from one that has loaded the program; nobody is missed, whoever
dies."""

import json
import os
import signal
import socket
import time

import pytest
from scenes import SMALL

from multicor_cli.studies import forking
from multicor_cli.studies.forking import ForkServer, run_case, stop_cases


@pytest.fixture(scope="module")
def server():
    server = ForkServer(1)
    yield server
    os.kill(server._process.pid, signal.SIGKILL)


def task(folder, name="run"):
    if not (folder / "small.toml").exists():  # a process that has been started may be reading it
        (folder / "small.toml").write_text(SMALL)
    given = {
        "scenario": str(folder / "small.toml"), "overrides": [], "directory": str(folder / name),
        "threads": 1, "turn": "test",
    }  # fmt: skip
    return json.dumps(given).encode() + b"\n"


def said(process):
    """All that it says until it ends."""
    with process.stream.makefile("rb") as stream:
        return stream.read()


def test_several_at_a_time_each_with_streams_of_its_own(server, tmp_path):
    processes = [server.start() for _ in range(3)]
    for number, process in enumerate(processes):
        process.stream.sendall(task(tmp_path, f"run-{number}"))
    for process in reversed(processes):
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
    process.stream.sendall(
        task(tmp_path).replace(
            b'"overrides": []', b'"overrides": ["loading.1.until.strain.value=1e3"]'
        )
    )
    while not (tmp_path / "run" / "progress.json").exists():
        time.sleep(0.05)
    process.stream.shutdown(socket.SHUT_WR)
    assert json.loads(said(process))["status"] == "stopped"


def test_a_fork_server_that_dies_leaves_its_cases_alone(tmp_path):
    server = ForkServer(1)
    process = server.start()
    os.kill(server._process.pid, signal.SIGKILL)
    process.stream.sendall(task(tmp_path))
    assert json.loads(said(process))["status"] == "finished"
    assert process.wait() == -signal.SIGKILL  # nobody knows
    assert not server.is_alive
    with pytest.raises(OSError, match="no process could be started"):
        server.start()


def test_a_worker_starts_another_fork_server_if_its_own_has_died(tmp_path):
    given = {**json.loads(task(tmp_path)), "client": "a", "name": "run"}
    assert run_case(given)["status"] == "finished"
    (server,) = forking._fork_servers
    os.kill(server._process.pid, signal.SIGKILL)
    assert run_case({**given, "directory": str(tmp_path / "again")})["status"] == "finished"
    assert forking._fork_servers != [server]


def test_a_worker_that_was_asked_to_stop_works_for_the_next_client(tmp_path):
    given = {**json.loads(task(tmp_path)), "client": "first", "name": "run"}
    assert stop_cases("first") == 0
    assert run_case(given)["reason"] == "not begun"
    assert run_case({**given, "client": "second"})["status"] == "finished"
