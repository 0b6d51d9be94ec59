"""Kill the process at every named point of the commit protocol, in a run and while stages are added
to one: nothing committed is lost, the end is the same to the bit."""

import dataclasses
import random
import shutil
from functools import partial

import pytest
from kill_points import EXTENSION_POINTS, POINTS
from store_support import (
    LONGER,
    RESOLVED,
    continue_run,
    drive,
    errors_of,
    extend_run,
    killed_at,
    make_model,
    make_run,
)
from trials import thinned

from multicor_cli.store import RunDirectory, Snapshot, open_run, run_info, verify
from multicor_cli.store.segments import read_manifest

GO_ON = {"run": continue_run, "extension": partial(extend_run, model=make_model(heat=True))}
"""What is done, as often as it takes."""


@pytest.fixture(scope="module")
def begin(heated):
    """Makes what is there at the beginning: nothing, or a finished run."""
    return lambda kind, path: kind == "run" or shutil.copytree(heated, path, symlinks=True)


@pytest.fixture(scope="module")
def expected(begin, tmp_path_factory):
    """How each ends that is not killed."""
    ends = {}
    for kind, go_on in GO_ON.items():
        path = tmp_path_factory.mktemp("whole") / "run"
        begin(kind, path)
        go_on(path)
        ends[kind] = outcome(path)
    return ends


def outcome(path):
    info = run_info(path)
    assert info["status"] == "finished"
    files = sorted(str(file.relative_to(path)) for file in path.rglob("*"))
    return {"data": info["data_digest"], "state": info["state_digest"], "files": files}


def assert_nothing_lost(path, kind="run"):
    """A run that is extended is what it was, or the longer one; it has its first 40 steps."""
    if not RunDirectory.is_run(path):
        return
    assert errors_of(path) == []
    with open_run(path) as run:
        assert run.status in ("interrupted", "finished", "stopped")
        for frame in run.frames:
            assert frame.step == 5 * frame.index
            assert frame.position.shape == (5, 2)
        if kind == "extension":
            assert len(run.frames) >= 9
            assert len(run.series["step"]) >= 21
            assert run.scenario_resolved in (RESOLVED, LONGER.resolved)
            assert (run.scenario_resolved == RESOLVED) == (len(run.stages) == 2)
            assert run.state() is not None


@pytest.mark.parametrize("where", [
    *thinned([f"run {point}" for point in POINTS], 4),
    *thinned([f"extension {point}" for point in EXTENSION_POINTS], 5),
])  # fmt: skip
def test_killed_once(tmp_path, begin, expected, where):
    kind, point = where.split()
    path = tmp_path / "run"
    begin(kind, path)
    assert killed_at(path, point, GO_ON[kind]), f"the run never came to {point}"
    assert_nothing_lost(path, kind)
    GO_ON[kind](path)
    assert verify(path) == []
    assert outcome(path) == expected[kind]


@pytest.mark.parametrize(
    "seed", [0, *(pytest.param(seed, marks=pytest.mark.reliability) for seed in (1, 2))]
)
def test_killed_again_and_again(tmp_path, expected, seed):
    choose, path = random.Random(seed), tmp_path / "run"
    for _ in range(6):
        killed_at(path, f"{choose.choice(POINTS).partition(':')[0]}:{choose.randint(1, 4)}")
        assert_nothing_lost(path)
    continue_run(path)
    assert outcome(path) == expected["run"]


@pytest.mark.parametrize(("kind", "points"), [
    # A file that the manifest does not list, and its renaming
    ("run", ("segment.after_rename:2", "orphan.mid")),
    # Two orphans of the same name
    ("run", ("manifest.after_append:2", "manifest.after_append", "manifest.after_append")),
    # Checkpoints are pruned each time: the run must not lose the last that it can use
    ("extension", ("checkpointjson.after_rename", "extension.before", "scenario.after_rename:3")),
])  # fmt: skip
def test_killed_at_one_point_after_the_other(tmp_path, begin, expected, kind, points):
    path = tmp_path / "run"
    begin(kind, path)
    for point in points:
        assert killed_at(path, point, GO_ON[kind])
        assert_nothing_lost(path, kind)
    orphans = list((path / "segments").glob("000001.h5*.orphan"))
    assert len(orphans) == (2 if len(points) == 3 and kind == "run" else len(orphans))
    GO_ON[kind](path)
    assert outcome(path) == expected[kind]


def test_segments_after_the_checkpoint_are_set_aside(tmp_path, expected):
    path = tmp_path / "run"
    # The third checkpoint (step 40) is not there, its segment is
    killed_at(path, "checkpoint.after_tmp:3")
    segments = path / "segments"
    committed = read_manifest(segments)
    assert len(committed) == 3
    before = (segments / "000000.h5").stat()
    with RunDirectory.resume(path) as run:
        found = run.load_checkpoint()
        assert (found.state.step, found.last_steps) == (30, (30, 30))
        assert sum(segment.frames for segment in found.segments) == 7
        assert (segments / "000002.h5.orphan").is_file()
        assert read_manifest(segments) == committed[:2]
        assert [finding.severity for finding in verify(path)] == ["warning"]
    after = (segments / "000000.h5").stat()
    assert (before.st_ino, before.st_mtime_ns) == (after.st_ino, after.st_mtime_ns)
    continue_run(path)
    assert outcome(path) == expected["run"]


def test_second_checkpoint_at_the_same_step_does_not_harm_the_first(tmp_path):
    path, model = tmp_path / "run", make_model()

    def names():
        return sorted(file.stem for file in (path / "checkpoints").glob("*.json"))

    with make_run(path) as run:
        state = drive(run, model, steps=40, checkpoint_every=15, finish=False)
        run.checkpoint(state, run._writer)  # nothing new: the older one, at step 30, stays
        assert names() == ["step-00000000030", "step-00000000040"]
        run._writer.series_row(Snapshot(dataclasses.replace(state, step=41), model))
        run.checkpoint(state, run._writer)
        assert names() == ["step-00000000040", "step-00000000040.1"]
    with RunDirectory.resume(path) as again:
        found = again.load_checkpoint()
    assert found.name == "step-00000000040.1"
    assert (found.state.step, found.last_steps) == (40, (40, 41))
