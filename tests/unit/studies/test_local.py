"""Cases on this machine are given to threads: each in its turn, cancelled if none has begun it,
stopped if nobody waits."""

import os
import signal
import threading

import pytest

from multicor_cli.studies import clusters
from multicor_cli.studies.clusters import LocalClient
from multicor_cli.studies.session import _stop_signals


def task(name):
    return {"client": "me", "name": name}


def test_as_many_at_a_time_as_there_are_workers():
    together = threading.Barrier(2, timeout=30.0)

    def meet(given):
        together.wait()
        return {"status": "finished", "name": given["name"]}

    with LocalClient(2) as client:
        assert client.nthreads() == {"here": 2}
        futures = [
            client.submit(meet, task(str(k)), key=str(k), resources=None, retries=0, pure=False)
            for k in range(4)
        ]
        assert [future.result(30.0)["name"] for future in futures] == ["0", "1", "2", "3"]
        assert {future.status for future in futures} == {"finished"}
    assert client.processing() == {"here": []}


def test_what_waits_can_be_cancelled_and_what_fails_says_so():
    began, go_on, ended = threading.Event(), threading.Event(), []

    def wait(_given):
        began.set()
        assert go_on.wait(30.0)
        raise OSError("no more processes")

    with LocalClient(1) as client:
        first, second = (client.submit(wait, task(name), key=name) for name in ("first", "second"))
        for future in (first, second):
            future.add_done_callback(ended.append)
        assert began.wait(30.0)
        assert client.processing() == {"here": ["first"]}
        assert first.status == "pending"
        client.cancel([first, second])
        assert ended == [second]  # the first has begun
        assert second.status == "cancelled"
        go_on.set()
        assert str(first.exception(30.0)) == "no more processes"
        assert first.status == "error"
        assert client.run(len, "abc", on_error="ignore") == {"here": 3}


def test_who_leaves_stops_what_runs_and_begins_nothing_more(monkeypatch):
    began, go_on, stopped, done = threading.Event(), threading.Event(), [], []

    def wait(given):
        began.set()
        assert go_on.wait(30.0)
        done.append(given["name"])
        return {"status": "stopped"}

    monkeypatch.setattr(clusters, "stop_cases", stopped.append)
    with LocalClient(1) as client:
        first, second = (client.submit(wait, task(name), key=name) for name in ("first", "second"))
        assert began.wait(30.0)
    assert stopped == ["me"]
    go_on.set()
    assert first.result(30.0) == {"status": "stopped"}
    with pytest.raises(TimeoutError):
        second.result(0.2)
    assert done == ["first"]


def test_a_study_goes_on_where_closed_terminals_are_ignored():
    """As ``nohup`` does."""
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with _stop_signals() as asked:
            os.kill(os.getpid(), signal.SIGHUP)
            assert asked() is None
    finally:
        signal.signal(signal.SIGHUP, before)
