"""The run directory as a place: who may use it, what may be removed, and what happens when the disk
is full.
"""

from __future__ import annotations

import contextlib
import dataclasses
import errno
import json
import os
import shutil
import signal
import subprocess
import sys
import time
import traceback
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from places import ROOT
from store_support import (
    PROVENANCE,
    RESOLVED,
    SOURCE,
    continue_run,
    drive,
    ends_of,
    errors_of,
    file_size_limit,
    make_model,
    make_run,
    run_whole,
    start,
)
from system_calls import hooked

from multicor_cli.model import State
from multicor_cli.store import (
    DamagedRun,
    DirectoryRefused,
    RunDirectory,
    RunLocked,
    Snapshot,
    StorageError,
    StorageFull,
    collect_provenance,
    open_run,
    run_info,
    verify,
)
from multicor_cli.store.atomic import GuardedFile, append_line, commit_bytes
from multicor_cli.store.checkpoint import prune
from multicor_cli.store.documents import read_run_document
from multicor_cli.store.lock import RunLock, is_alive
from multicor_cli.store.rundir import check_usable
from multicor_cli.store.segments import keep_segments


def listing(path: Path) -> dict[str, bytes]:
    return {
        str(file.relative_to(path)): file.read_bytes() for file in path.rglob("*") if file.is_file()
    }


def in_child(action: Callable[[], object]) -> int:
    """Number of a child process that ends with 0, the exit code of a `StoreError`, or 99."""
    child = os.fork()
    if child == 0:
        code = 99
        try:
            action()
            code = 0
        except StorageError as error:
            code = error.exit_code
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(code)
    return child


# --- who may use it


@pytest.mark.parametrize("is_there", [False, True])
def test_new_directory_has_the_scenario_byte_by_byte(tmp_path: Path, is_there: bool) -> None:
    path = tmp_path / "with spaces" / "and ünïcode" / "run"
    if is_there:
        path.mkdir(parents=True)
    assert not RunDirectory.is_run(path)
    with make_run(path) as run:
        assert run.status == "running"
        document = read_run_document(path)
        assert document["stages"] == ["load", "shear"]
        assert document["provenance"] == PROVENANCE
        assert (run.source_text, run.resolved_text) == (SOURCE, RESOLVED)
    assert (path / "scenario.toml").read_bytes() == SOURCE.encode()
    assert RunDirectory.is_run(path)


@pytest.mark.parametrize("overwrite", [False, True])
def test_directory_that_is_no_run_is_refused_and_untouched(tmp_path: Path, overwrite: bool) -> None:
    (tmp_path / "scenario.toml").write_text("mine")
    with pytest.raises(DirectoryRefused, match="not a run directory"):
        make_run(tmp_path, overwrite=overwrite)
    assert listing(tmp_path) == {"scenario.toml": b"mine"}
    with pytest.raises(DirectoryRefused, match="not a directory"):
        make_run(tmp_path / "scenario.toml", overwrite=overwrite)
    with pytest.raises(DirectoryRefused, match="holds no run"):
        RunDirectory.resume(tmp_path)
    with pytest.raises(DirectoryRefused, match="holds no run"):
        open_run(tmp_path)


def test_runs_inside_a_directory_are_named(tmp_path: Path) -> None:
    for name in ("a", "b"):
        make_run(tmp_path / name)
    with pytest.raises(
        DirectoryRefused, match=r"holds no run; name one of those in it: .*/a, .*/b$"
    ):
        open_run(tmp_path)


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="no /proc")
def test_a_place_where_no_directory_can_be_made_is_refused_at_once() -> None:
    with pytest.raises(
        DirectoryRefused, match="no directory can be made in /proc; choose another place with -o"
    ):
        check_usable(Path("/proc/run"), overwrite=False)


def test_existing_run_is_refused_unless_overwritten(copy: Path) -> None:
    before = listing(copy)
    with pytest.raises(DirectoryRefused, match="--overwrite"):
        make_run(copy)
    assert listing(copy) == before
    with make_run(copy, overwrite=True) as run:
        assert run.load_checkpoint() is None
        files = ["lock", "run.json", "scenario.resolved.toml", "scenario.toml"]
        assert sorted(listing(copy)) == files
    run_whole(copy, overwrite=True)
    assert verify(copy) == []


@pytest.mark.parametrize(
    "name",
    ["figure.png", "segments/notes.txt", "checkpoints/step-1.h5", "results.h5.bak", "model.h5/"],
)
def test_overwriting_never_removes_foreign_files(tmp_path: Path, name: str) -> None:
    path = tmp_path / "run"
    with make_run(path) as run:
        run.writer(make_model(1))
    if name.endswith("/"):
        (path / name).unlink()
        (path / name).mkdir()
    else:
        (path / name).write_text("mine")
    before = listing(path)
    with pytest.raises(DirectoryRefused, match=name.rstrip("/")):
        make_run(path, overwrite=True)
    assert listing(path) == before


def test_overwriting_does_not_follow_links(tmp_path: Path) -> None:
    (tmp_path / "precious").mkdir()
    (tmp_path / "precious" / "000000.h5").write_text("mine")
    make_run(tmp_path / "run").close()
    (tmp_path / "run" / "segments").rmdir()
    (tmp_path / "run" / "segments").symlink_to(tmp_path / "precious")
    with pytest.raises(DirectoryRefused, match="segments"):
        make_run(tmp_path / "run", overwrite=True)
    assert (tmp_path / "precious" / "000000.h5").read_text() == "mine"


def test_damaged_run_can_be_overwritten(copy: Path) -> None:
    (copy / "run.json").write_text("nonsense")
    with pytest.raises(DirectoryRefused):
        make_run(copy)
    make_run(copy, overwrite=True).close()
    assert RunDirectory.is_run(copy)


def test_changed_scenario_and_another_model_are_noticed(open_copy: Path) -> None:
    (open_copy / "scenario.resolved.toml").write_text(RESOLVED + "# edited\n")
    with RunDirectory.resume(open_copy) as run:
        with pytest.raises(DamagedRun, match="was changed"):
            run.resolved_text  # noqa: B018
        with pytest.raises(DamagedRun, match="another model"):
            run.writer(make_model(4))


def test_stopped_and_failed_runs_can_be_continued(tmp_path: Path, finished: Path) -> None:
    path, model = tmp_path / "run", make_model()
    with make_run(path) as run:
        drive(run, model, steps=12, checkpoint_every=5, finish=False)
        run.finish("stopped", stop_reason="Ctrl-C", exit_code=130, timings={"solve": 1.5})
    info = run_info(path)
    said = [info[name] for name in ("status", "stop_reason", "exit_code", "timings")]
    assert said == ["stopped", "Ctrl-C", 130, {"solve": 1.5}]
    with RunDirectory.resume(path) as run:
        assert run.status == "running"
        state = drive(run, model, steps=18, checkpoint_every=5, finish=False)
        state.step += 2
        assert run._writer is not None
        run._writer.frame(Snapshot(state, run._writer.model))
        run.finish("failed", stop_reason="step 19: grain 3 is not finite", exit_code=4)
    with open_run(path) as reader:
        assert reader.status == "failed"
        # The last one is there to look at, and will be computed again
        assert reader.frames.step.tolist() == [0, 5, 10, 15, 20]
    continue_run(path)
    assert ends_of(path) == ends_of(finished)
    assert len(json.loads((path / "run.json").read_text())["sessions"]) == 3


def test_finished_run_is_left_alone(copy: Path) -> None:
    before = listing(copy)
    with RunDirectory.resume(copy) as run:
        assert run.is_finished
        assert run.consolidate() == copy / "results.h5"
    assert listing(copy) == before


def test_committed_files_are_read_only(unfinished: Path) -> None:
    patterns = ("segments/*.h5", "checkpoints/*.h5", "model.h5")
    files = [file for pattern in patterns for file in unfinished.glob(pattern)]
    assert len(files) == 6
    assert not any(file.stat().st_mode & 0o222 for file in files)


@pytest.mark.parametrize("name", ["mine.txt", "000000.h5.bak", "mine.tmp", "sub"])
@pytest.mark.parametrize("is_finished", [False, True])
def test_files_of_others_beside_the_segments_stay(
    tmp_path: Path, name: str, is_finished: bool
) -> None:
    path = tmp_path / "run"
    run_whole(path, make_model(), steps=20, checkpoint_every=15, finish=is_finished)
    (path / "segments").mkdir(exist_ok=True)
    for mine in (path / "segments" / name, path / "checkpoints" / name, path / "mine.tmp"):
        mine.mkdir() if name == "sub" and mine.name == "sub" else mine.write_text("precious")
    continue_run(path)
    assert run_info(path)["status"] == "finished"
    assert [entry.name for entry in (path / "segments").iterdir()] == [name]
    assert (path / "checkpoints" / name).exists()
    assert (path / "mine.tmp").read_text() == "precious"
    assert ["stays" in finding.message for finding in verify(path)] == [True]


def test_links_in_place_of_directories_are_not_followed_to_remove_anything(tmp_path: Path) -> None:
    """Somebody moved the segments to a larger disk, or points at something else."""
    path, elsewhere = tmp_path / "run", tmp_path / "elsewhere"
    run_whole(path, make_model(), steps=20, checkpoint_every=15, finish=False)
    (path / "segments").rename(elsewhere)
    (path / "segments").symlink_to(elsewhere)
    (elsewhere / "notes.tmp").write_text("precious")
    before = {entry.name for entry in elsewhere.iterdir()}
    for _ in range(2):
        continue_run(path)
        assert run_info(path)["status"] == "finished"
        assert {entry.name for entry in elsewhere.iterdir()} >= before
    assert not (path / "model.h5").exists()


def test_progress_never_fails(tmp_path: Path) -> None:
    with make_run(tmp_path / "run") as run:
        run.progress({"step": np.int64(3), "eta": float("inf")})
        assert json.loads((tmp_path / "run" / "progress.json").read_text())["eta"] is None
        (tmp_path / "run" / "progress.json").unlink()
        (tmp_path / "run" / "progress.json").mkdir()
        run.progress({"step": 4})


def test_provenance_names_versions_and_machine() -> None:
    found = collect_provenance(
        ["multicor", "run", "a b.toml"], seed=3, threads=2, threading_layer="omp"
    )
    assert found["command"] == "multicor run 'a b.toml'"
    assert (found["seed"], found["threads"], found["threading_layer"]) == (3, 2, "omp")
    assert {"python", "numpy", "numba", "llvmlite", "h5py", "hdf5"} <= found["versions"].keys()
    assert found["host"]
    assert found["cpu"]


# --- the lock


def test_second_run_is_refused_and_changes_nothing(tmp_path: Path) -> None:
    with make_run(tmp_path / "run"):
        before = listing(tmp_path / "run")
        for attempt in (
            lambda: RunDirectory.resume(tmp_path / "run"),
            lambda: make_run(tmp_path / "run", overwrite=True),
        ):
            with pytest.raises(RunLocked, match=f"process {os.getpid()} on ") as caught:
                attempt()
            assert caught.value.pid == os.getpid()
            assert caught.value.host
            assert caught.value.exit_code == 6
        assert listing(tmp_path / "run") == before
    RunDirectory.resume(tmp_path / "run").close()


def test_lock_of_a_dead_process_is_taken_over(tmp_path: Path) -> None:
    code = (
        "import sys, time, pathlib; from multicor_cli.store.lock import RunLock;"
        "lock = RunLock(pathlib.Path(sys.argv[1])); print(1, flush=True); time.sleep(60)"
    )
    holder = subprocess.Popen(
        [sys.executable, "-c", code, str(tmp_path / "lock")], stdout=subprocess.PIPE, cwd=ROOT
    )
    assert holder.stdout is not None
    holder.stdout.readline()
    try:
        assert is_alive(tmp_path / "lock")
        with pytest.raises(RunLocked, match=f"process {holder.pid} "):
            RunLock(tmp_path / "lock")
    finally:
        holder.send_signal(signal.SIGKILL)
        holder.wait()
        holder.stdout.close()
    assert not is_alive(tmp_path / "lock")
    lock = RunLock(tmp_path / "lock")
    assert is_alive(tmp_path / "lock")
    lock.release()
    lock.release()
    assert not is_alive(tmp_path / "lock")


def test_lock_of_another_host_is_respected_unless_forced(tmp_path: Path) -> None:
    make_run(tmp_path / "run").close()
    started = "2026-01-01T00:00:00+00:00"
    holder = {"pid": 17, "host": "elsewhere", "started": started, "start_ticks": 1}
    (tmp_path / "run" / "lock").write_text(json.dumps(holder))
    assert is_alive(tmp_path / "run" / "lock")
    with pytest.raises(
        RunLocked, match=r"process 17 on elsewhere; if it is no longer alive, delete .*lock"
    ):
        RunDirectory.resume(tmp_path / "run")
    RunDirectory.resume(tmp_path / "run", force_unlock=True).close()
    RunDirectory.resume(tmp_path / "run").close()


def test_recycled_process_number_does_not_count_as_alive(tmp_path: Path) -> None:
    lock = RunLock(tmp_path / "lock")
    holder = json.loads((tmp_path / "lock").read_text())
    lock.release()
    (tmp_path / "lock").write_text(json.dumps({**holder, "start_ticks": holder["start_ticks"] - 1}))
    assert not is_alive(tmp_path / "lock")


# --- no space, no permission


@pytest.mark.parametrize("limit_kb", [1, 60, 120, 180])
def test_file_size_limit_stops_with_code_5_and_the_run_goes_on_later(
    tmp_path: Path, limit_kb: int
) -> None:
    """`RLIMIT_FSIZE` fails the writes of a child in the same places as a full disk does."""
    path, model = tmp_path / "run", make_model(120)

    def limited() -> None:
        with file_size_limit(limit_kb << 10):
            run_whole(path, model)

    assert os.waitstatus_to_exitcode(os.waitpid(in_child(limited), 0)[1]) == 5
    if RunDirectory.is_run(path):
        assert errors_of(path) == []
    assert list(path.rglob("*.h5.tmp")) == []
    continue_run(path, model)
    run_whole(tmp_path / "whole", model)
    assert ends_of(path) == ends_of(tmp_path / "whole")


def test_full_disk_is_noticed_before_a_file_is_begun(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = make_model()
    with make_run(tmp_path / "run") as run:
        writer, state = run.writer(model), start(model)
        run.checkpoint(state, writer)
        state.step += 1
        writer.frame(Snapshot(state, model))
        monkeypatch.setattr(
            os, "statvfs", lambda _: SimpleNamespace(f_bavail=300, f_frsize=4096, f_blocks=1000)
        )
        before = listing(tmp_path / "run")
        with pytest.raises(StorageFull, match="no space left") as caught:
            run.checkpoint(state, writer)
        assert caught.value.exit_code == 5
        assert caught.value.free == 300 * 4096
        assert caught.value.needed > caught.value.free
        assert listing(tmp_path / "run") == before
        # run.json uses what is left in reserve
        run.finish("failed", stop_reason=str(caught.value), exit_code=5)
        monkeypatch.undo()
        run.checkpoint(state, writer)  # nothing was lost
        with open_run(tmp_path / "run") as reader:
            assert len(reader.frames) == 1
    assert verify(tmp_path / "run") == []


def test_guarded_file_keeps_the_first_error_and_swallows_the_rest(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import h5py

    def fail(*_: object) -> int:
        raise OSError(errno.EIO, "Input/output error")

    with (tmp_path / "file").open("w+b") as raw:
        guarded = GuardedFile(raw.fileno())
        with h5py.File(guarded, "w", libver=("v110", "v110")) as file:
            file["a"] = np.zeros(1000)
            monkeypatch.setattr(os, "pwrite", fail)
            file["b"] = np.zeros(100_000)
        with pytest.raises(OSError, match="Input/output") as caught:
            guarded.finish()
        assert caught.value.errno == errno.EIO


def test_short_write_of_the_manifest_leaves_no_half_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    append_line(tmp_path / "lines", "test", b"first\n")
    write = os.write
    monkeypatch.setattr(os, "write", lambda descriptor, data: write(descriptor, data[:3]))
    with pytest.raises(StorageFull):
        append_line(tmp_path / "lines", "test", b"second\n")
    monkeypatch.undo()
    append_line(tmp_path / "lines", "test", b"third\n")
    assert (tmp_path / "lines").read_bytes() == b"first\nthird\n"


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_directory_without_permission(tmp_path: Path) -> None:
    tmp_path.chmod(0o555)
    try:
        with pytest.raises(StorageError, match="Permission denied"):
            make_run(tmp_path / "run")
    finally:
        tmp_path.chmod(0o755)


@pytest.mark.parametrize("name", ["openat", "replace", "fsync"])
def test_errors_of_the_system_name_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    def fail(*_: object, **__: object) -> int:
        raise PermissionError(errno.EACCES, "Permission denied")

    with make_run(tmp_path / "run") as run:
        target = {"openat": (os, "open"), "replace": (Path, "replace"), "fsync": (os, "fsync")}[
            name
        ]
        monkeypatch.setattr(*target, fail)
        with pytest.raises(StorageError, match=r"model\.h5: Permission denied"):
            run.writer(make_model())
        monkeypatch.undo()
        assert list((tmp_path / "run").glob("*.tmp")) == []


def test_reading_while_running(tmp_path: Path) -> None:
    """Readers see whole frames only, at any moment, and the end of the run does not disturb
    them.
    """
    path, seen = tmp_path / "run", 0

    def go_on() -> None:
        with make_run(path) as run:
            drive(run, make_model(), steps=80, checkpoint_every=10)

    child = in_child(go_on)
    deadline = time.monotonic() + 50.0
    while not os.waitpid(child, os.WNOHANG)[0]:
        assert time.monotonic() < deadline
        if not RunDirectory.is_run(path):
            continue
        with open_run(path) as reader:
            steps = reader.frames.step
            assert steps.tolist() == list(range(0, 5 * len(steps), 5))
            assert len(reader.frames) >= seen
            assert len(reader.series["time"]) >= 2 * seen
            if len(steps):
                assert np.isfinite(reader.frames[-1].position).all()
            seen = len(steps)
            assert reader.status in ("running", "finished")
    with open_run(path) as reader:
        assert len(reader.frames) == 17


# --- the order of a commit


def test_commit_flushes_file_and_directory_around_the_rename(tmp_path: Path) -> None:
    """The order of the calls (`reliability/test_power_cut` tries what they survive)."""
    calls: list[str] = []

    def log(name: str, args: tuple[Any, ...], call: Callable[[], object]) -> object:
        if name == "fsync":
            calls.append("fsync " + Path(f"/proc/self/fd/{args[0]}").readlink().name)
        elif name in ("replace", "rename"):
            calls.append(f"replace {Path(args[0]).name} {Path(args[1]).name}")
        return call()

    with hooked(log):
        commit_bytes(tmp_path / "file", "test", b"content")
    assert calls == ["fsync file.tmp", "replace file.tmp file", f"fsync {tmp_path.name}"]


def test_what_reads_back_differently_is_not_committed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = make_model(50)
    with make_run(tmp_path / "run") as run:
        state = drive(run, model, steps=10, checkpoint_every=5, finish=False)
        before = listing(tmp_path / "run")
        write = GuardedFile.write

        def write_wrongly(self: GuardedFile, data: memoryview) -> int:
            changed = bytearray(data)
            if len(changed) > 300:
                changed[len(changed) // 2] ^= 4
            return write(self, memoryview(changed))

        monkeypatch.setattr(GuardedFile, "write", write_wrongly)
        state.step += 5
        assert run._writer is not None
        with pytest.raises(DamagedRun):
            run.checkpoint(state, run._writer)
        run._writer.frame(Snapshot(state, run._writer.model))
        with pytest.raises(DamagedRun):
            run._writer.flush()
        monkeypatch.undo()
        assert listing(tmp_path / "run") == before
        run.checkpoint(state, run._writer)
    assert verify(tmp_path / "run") == []


WRITING: dict[str, Callable[[RunDirectory, State], object]] = {
    "heartbeat": lambda run, state: run.progress({"step": state.step}),
    "checkpoint": lambda run, state: run.checkpoint(state, run._writer),  # type: ignore[arg-type]
    "segment": lambda run, state: run._writer.flush() if run._writer else None,
    "results": lambda run, state: run.consolidate(),
    "stop": lambda run, state: run.finish("stopped"),
    "end": lambda run, state: run.finish("finished"),
    "removal of segments": lambda run, state: run._remove_segments(),
    "removal of checkpoints": lambda run, state: prune(run.path / "checkpoints"),
    "orphans": lambda run, state: keep_segments(run.path / "segments", []),
}
"""Everything that changes a run directory."""


@pytest.mark.parametrize("act", list(WRITING.values()), ids=list(WRITING))
@pytest.mark.parametrize("other", ["run", "folder", "nothing", "copy"])
def test_nothing_is_changed_in_a_directory_that_has_taken_the_place_of_the_run(
    tmp_path: Path, act: Callable[[RunDirectory, State], object], other: str
) -> None:
    path, model = tmp_path / "run", make_model()
    with make_run(path) as run:
        state = drive(run, model, steps=22, checkpoint_every=10, finish=False)
        assert run._writer is not None
        run._writer.series_row(Snapshot(dataclasses.replace(state, step=state.step + 1), model))
        path.rename(tmp_path / "moved")
        if other == "run":
            run_whole(tmp_path / "other", steps=20)
            (tmp_path / "other").rename(path)
        elif other == "copy":
            shutil.copytree(tmp_path / "moved", path)
        elif other == "folder":
            path.mkdir()
            (path / "progress.json").write_text("mine")
        before = listing(path)
        with contextlib.suppress(RunLocked):
            act(run, dataclasses.replace(state, step=state.step + 1))
        assert listing(path) == before
