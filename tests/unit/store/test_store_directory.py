"""The run directory as a place: who may use it, what may be removed, and what happens when the disk
is full."""

import contextlib
import dataclasses
import errno
import json
import os
import shutil
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from store_support import (
    PROVENANCE,
    RESOLVED,
    SOURCE,
    continue_run,
    drive,
    ends_of,
    make_model,
    make_run,
    run_whole,
    start,
)

from multicor_cli import store
from multicor_cli.store.atomic import append_line
from multicor_cli.store.checkpoint import prune
from multicor_cli.store.documents import read_run_document
from multicor_cli.store.lock import is_alive
from multicor_cli.store.rundir import check_usable
from multicor_cli.store.segments import keep_segments


def listing(path):
    return {
        str(file.relative_to(path)): file.read_bytes() for file in path.rglob("*") if file.is_file()
    }


# --- who may use it


@pytest.mark.parametrize("is_there", [False, True])
def test_new_directory_has_the_scenario_byte_by_byte(tmp_path, is_there):
    path = tmp_path / "with spaces" / "and ünïcode" / "run"
    if is_there:
        path.mkdir(parents=True)
    assert not store.RunDirectory.is_run(path)
    with make_run(path) as run:
        assert run.status == "running"
        document = read_run_document(path)
        assert document["stages"] == ["load", "shear"]
        assert document["provenance"] == PROVENANCE
        assert (run.source_text, run.resolved_text) == (SOURCE, RESOLVED)
    assert (path / "scenario.toml").read_bytes() == SOURCE.encode()
    assert store.RunDirectory.is_run(path)


@pytest.mark.parametrize("overwrite", [False, True])
def test_directory_that_is_no_run_is_refused_and_untouched(tmp_path, overwrite):
    (tmp_path / "scenario.toml").write_text("mine")
    with pytest.raises(store.DirectoryRefused, match="not a run directory"):
        make_run(tmp_path, overwrite=overwrite)
    assert listing(tmp_path) == {"scenario.toml": b"mine"}
    with pytest.raises(store.DirectoryRefused, match="not a directory"):
        make_run(tmp_path / "scenario.toml", overwrite=overwrite)
    with pytest.raises(store.DirectoryRefused, match="holds no run"):
        store.RunDirectory.resume(tmp_path)
    with pytest.raises(store.DirectoryRefused, match="holds no run"):
        store.open_run(tmp_path)


def test_runs_inside_a_directory_are_named(tmp_path):
    for name in ("a", "b"):
        make_run(tmp_path / name)
    with pytest.raises(
        store.DirectoryRefused, match=r"holds no run; name one of those in it: .*/a, .*/b$"
    ):
        store.open_run(tmp_path)


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="no /proc")
def test_a_place_where_no_directory_can_be_made_is_refused_at_once():
    with pytest.raises(
        store.DirectoryRefused,
        match="no directory can be made in /proc; choose another place with -o",
    ):
        check_usable(Path("/proc/run"), overwrite=False)


def test_existing_run_is_refused_unless_overwritten(copy):
    before = listing(copy)
    with pytest.raises(store.DirectoryRefused, match="--overwrite"):
        make_run(copy)
    assert listing(copy) == before
    with make_run(copy, overwrite=True) as run:
        assert run.load_checkpoint() is None
        files = ["lock", "run.json", "scenario.resolved.toml", "scenario.toml"]
        assert sorted(listing(copy)) == files
    run_whole(copy, overwrite=True)
    assert store.verify(copy) == []


@pytest.mark.parametrize(
    "name",
    ["figure.png", "segments/notes.txt", "checkpoints/step-1.h5", "results.h5.bak", "model.h5/"],
)
def test_overwriting_never_removes_foreign_files(tmp_path, name):
    path = tmp_path / "run"
    with make_run(path) as run:
        run.writer(make_model(1))
    if name.endswith("/"):
        (path / name).unlink()
        (path / name).mkdir()
    else:
        (path / name).write_text("mine")
    before = listing(path)
    with pytest.raises(store.DirectoryRefused, match=name.rstrip("/")):
        make_run(path, overwrite=True)
    assert listing(path) == before


def test_overwriting_does_not_follow_links(tmp_path):
    (tmp_path / "precious").mkdir()
    (tmp_path / "precious" / "000000.h5").write_text("mine")
    make_run(tmp_path / "run").close()
    (tmp_path / "run" / "segments").rmdir()
    (tmp_path / "run" / "segments").symlink_to(tmp_path / "precious")
    with pytest.raises(store.DirectoryRefused, match="segments"):
        make_run(tmp_path / "run", overwrite=True)
    assert (tmp_path / "precious" / "000000.h5").read_text() == "mine"


def test_damaged_run_can_be_overwritten(copy):
    (copy / "run.json").write_text("nonsense")
    with pytest.raises(store.DirectoryRefused):
        make_run(copy)
    make_run(copy, overwrite=True).close()
    assert store.RunDirectory.is_run(copy)


def test_changed_scenario_and_another_model_are_noticed(open_copy):
    (open_copy / "scenario.resolved.toml").write_text(RESOLVED + "# edited\n")
    with store.RunDirectory.resume(open_copy) as run:
        with pytest.raises(store.DamagedRun, match="was changed"):
            run.resolved_text  # noqa: B018
        with pytest.raises(store.DamagedRun, match="another model"):
            run.writer(make_model(4))


def test_stopped_and_failed_runs_can_be_continued(tmp_path, finished):
    path, model = tmp_path / "run", make_model()
    with make_run(path) as run:
        drive(run, model, steps=12, checkpoint_every=5, finish=False)
        run.finish("stopped", stop_reason="Ctrl-C", exit_code=130, timings={"solve": 1.5})
    info = store.run_info(path)
    said = [info[name] for name in ("status", "stop_reason", "exit_code", "timings")]
    assert said == ["stopped", "Ctrl-C", 130, {"solve": 1.5}]
    with store.RunDirectory.resume(path) as run:
        assert run.status == "running"
        state = drive(run, model, steps=18, checkpoint_every=5, finish=False)
        state.step += 2
        run._writer.frame(store.Snapshot(state, run._writer.model))
        run.finish("failed", stop_reason="step 19: grain 3 is not finite", exit_code=4)
    with store.open_run(path) as reader:
        assert reader.status == "failed"
        # The last one is there to look at, and will be computed again
        assert reader.frames.step.tolist() == [0, 5, 10, 15, 20]
    continue_run(path)
    assert ends_of(path) == ends_of(finished)
    assert len(json.loads((path / "run.json").read_text())["sessions"]) == 3


def test_finished_run_is_left_alone(copy):
    before = listing(copy)
    with store.RunDirectory.resume(copy) as run:
        assert run.is_finished
        assert run.consolidate() == copy / "results.h5"
    assert listing(copy) == before


def test_committed_files_are_read_only(unfinished):
    patterns = ("segments/*.h5", "checkpoints/*.h5", "model.h5")
    files = [file for pattern in patterns for file in unfinished.glob(pattern)]
    assert len(files) == 6
    assert not any(file.stat().st_mode & 0o222 for file in files)


@pytest.mark.parametrize("is_finished", [False, True])
def test_files_of_others_beside_the_segments_stay(tmp_path, is_finished):
    path, names = tmp_path / "run", ("mine.txt", "000000.h5.bak", "mine.tmp", "sub")
    run_whole(path, make_model(), steps=20, checkpoint_every=15, finish=is_finished)
    (path / "segments").mkdir(exist_ok=True)
    places = [path / folder / name for folder in ("segments", "checkpoints") for name in names]
    for mine in (*places, path / "mine.tmp"):
        mine.mkdir() if mine.name == "sub" else mine.write_text("precious")
    continue_run(path)
    assert store.run_info(path)["status"] == "finished"
    assert sorted(entry.name for entry in (path / "segments").iterdir()) == sorted(names)
    assert all(mine.exists() for mine in places)
    assert (path / "mine.tmp").read_text() == "precious"
    assert {"stays" in finding.message for finding in store.verify(path)} == {True}


def test_links_in_place_of_directories_are_not_followed_to_remove_anything(tmp_path):
    """Somebody moved the segments to a larger disk, or points at something else."""
    path, elsewhere = tmp_path / "run", tmp_path / "elsewhere"
    run_whole(path, make_model(), steps=20, checkpoint_every=15, finish=False)
    (path / "segments").rename(elsewhere)
    (path / "segments").symlink_to(elsewhere)
    (elsewhere / "notes.tmp").write_text("precious")
    before = {entry.name for entry in elsewhere.iterdir()}
    for _ in range(2):
        continue_run(path)
        assert store.run_info(path)["status"] == "finished"
        assert {entry.name for entry in elsewhere.iterdir()} >= before
    assert not (path / "model.h5").exists()


def test_progress_never_fails(tmp_path):
    with make_run(tmp_path / "run") as run:
        run.progress({"step": np.int64(3), "eta": float("inf")})
        assert json.loads((tmp_path / "run" / "progress.json").read_text())["eta"] is None
        (tmp_path / "run" / "progress.json").unlink()
        (tmp_path / "run" / "progress.json").mkdir()
        run.progress({"step": 4})


def test_provenance_names_versions_and_machine():
    found = store.collect_provenance(["multicor", "run", "a b.toml"], seed=3, threads=2)
    assert found["command"] == "multicor run 'a b.toml'"
    assert (found["seed"], found["threads"], found["threading_layer"]) == (3, 2, "")
    assert {"python", "numpy", "numba", "llvmlite", "h5py", "hdf5"} <= found["versions"].keys()
    assert found["host"]
    assert found["cpu"]


# --- the lock


def test_second_run_is_refused_and_changes_nothing(tmp_path):
    with make_run(tmp_path / "run"):
        before = listing(tmp_path / "run")
        for attempt in (
            lambda: store.RunDirectory.resume(tmp_path / "run"),
            lambda: make_run(tmp_path / "run", overwrite=True),
        ):
            with pytest.raises(store.RunLocked, match=f"process {os.getpid()} on ") as caught:
                attempt()
            assert caught.value.pid == os.getpid()
            assert caught.value.host
            assert caught.value.exit_code == 6
        assert listing(tmp_path / "run") == before
    store.RunDirectory.resume(tmp_path / "run").close()


def test_lock_of_another_host_is_respected_until_it_is_deleted(tmp_path):
    make_run(tmp_path / "run").close()
    started = "2026-01-01T00:00:00+00:00"
    holder = {"pid": 17, "host": "elsewhere", "started": started, "start_ticks": 1}
    (tmp_path / "run" / "lock").write_text(json.dumps(holder))
    assert is_alive(tmp_path / "run" / "lock")
    with pytest.raises(
        store.RunLocked, match=r"process 17 on elsewhere; if it is no longer alive, delete .*lock"
    ):
        store.RunDirectory.resume(tmp_path / "run")
    (tmp_path / "run" / "lock").unlink()
    store.RunDirectory.resume(tmp_path / "run").close()
    store.RunDirectory.resume(tmp_path / "run").close()


# --- no space, no permission


def test_full_disk_is_noticed_before_a_file_is_begun(tmp_path, monkeypatch):
    model = make_model()
    with make_run(tmp_path / "run") as run:
        writer, state = run.writer(model), start(model)
        run.checkpoint(state, writer)
        state.step += 1
        writer.frame(store.Snapshot(state, model))
        monkeypatch.setattr(
            os, "statvfs", lambda _: SimpleNamespace(f_bavail=300, f_frsize=4096, f_blocks=1000)
        )
        before = listing(tmp_path / "run")
        with pytest.raises(store.StorageFull, match="no space left") as caught:
            run.checkpoint(state, writer)
        assert caught.value.exit_code == 5
        assert caught.value.free == 300 * 4096
        assert caught.value.needed > caught.value.free
        assert listing(tmp_path / "run") == before
        # run.json uses what is left in reserve
        run.finish("failed", stop_reason=str(caught.value), exit_code=5)
        monkeypatch.undo()
        run.checkpoint(state, writer)  # nothing was lost
        with store.open_run(tmp_path / "run") as reader:
            assert len(reader.frames) == 1
    assert store.verify(tmp_path / "run") == []


def test_short_write_of_the_manifest_leaves_no_half_line(tmp_path, monkeypatch):
    append_line(tmp_path / "lines", "test", b"first\n")
    write = os.write
    monkeypatch.setattr(os, "write", lambda descriptor, data: write(descriptor, data[:3]))
    with pytest.raises(store.StorageFull):
        append_line(tmp_path / "lines", "test", b"second\n")
    monkeypatch.undo()
    append_line(tmp_path / "lines", "test", b"third\n")
    assert (tmp_path / "lines").read_bytes() == b"first\nthird\n"


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_directory_without_permission(tmp_path):
    tmp_path.chmod(0o555)
    try:
        with pytest.raises(store.StorageError, match="Permission denied"):
            make_run(tmp_path / "run")
    finally:
        tmp_path.chmod(0o755)


@pytest.mark.parametrize("name", ["openat", "replace", "fsync"])
def test_errors_of_the_system_name_the_file(tmp_path, monkeypatch, name):
    def fail(*_, **__):
        raise PermissionError(errno.EACCES, "Permission denied")

    with make_run(tmp_path / "run") as run:
        target = {"openat": (os, "open"), "replace": (Path, "replace"), "fsync": (os, "fsync")}[
            name
        ]
        monkeypatch.setattr(*target, fail)
        with pytest.raises(store.StorageError, match=r"model\.h5: Permission denied"):
            run.writer(make_model())
        monkeypatch.undo()
        assert list((tmp_path / "run").glob("*.tmp")) == []


# --- the order of a commit


WRITING = {
    "heartbeat": lambda run, state: run.progress({"step": state.step}),
    "checkpoint": lambda run, state: run.checkpoint(state, run._writer),
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
    tmp_path, finished, act, other
):
    path, model = tmp_path / "run", make_model()
    with make_run(path) as run:
        state = drive(run, model, steps=22, checkpoint_every=10, finish=False)
        run._writer.series_row(
            store.Snapshot(dataclasses.replace(state, step=state.step + 1), model)
        )
        path.rename(tmp_path / "moved")
        if other == "run":
            shutil.copytree(finished, path)
        elif other == "copy":
            shutil.copytree(tmp_path / "moved", path)
        elif other == "folder":
            path.mkdir()
            (path / "progress.json").write_text("mine")
        before = listing(path)
        with contextlib.suppress(store.RunLocked):
            act(run, dataclasses.replace(state, step=state.step + 1))
        assert listing(path) == before
