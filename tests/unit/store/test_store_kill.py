"""Kill the process at every named point of the commit protocol: nothing committed is lost, the end
is the same to the bit.
"""

from __future__ import annotations

import dataclasses
import random
from pathlib import Path

import pytest
from kill_points import POINTS
from store_support import continue_run, drive, errors_of, killed_at, make_model, make_run
from trials import thinned

from multicor_cli.store import RunDirectory, Snapshot, open_run, run_info, verify
from multicor_cli.store.segments import read_manifest


@pytest.fixture(scope="module")
def expected(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    path = tmp_path_factory.mktemp("whole") / "run"
    continue_run(path)
    return outcome(path)


def outcome(path: Path) -> dict[str, str]:
    info = run_info(path)
    assert info["status"] == "finished"
    files = sorted(str(file.relative_to(path)) for file in path.rglob("*"))
    return {"data": info["data_digest"], "state": info["state_digest"], "files": " ".join(files)}


def assert_nothing_lost(path: Path) -> None:
    if RunDirectory.is_run(path):
        assert errors_of(path) == []
        with open_run(path) as run:
            assert run.status in ("interrupted", "finished")
            for frame in run.frames:
                assert frame.step == 5 * frame.index
                assert frame.position.shape == (5, 2)


@pytest.mark.parametrize("point", thinned(POINTS, 4))
def test_killed_once(tmp_path: Path, expected: dict[str, str], point: str) -> None:
    path = tmp_path / "run"
    assert killed_at(path, point), f"the run never came to {point}"
    assert_nothing_lost(path)
    continue_run(path)
    assert outcome(path) == expected


@pytest.mark.parametrize(
    "seed",
    [
        0,
        pytest.param(1, marks=pytest.mark.reliability),
        pytest.param(2, marks=pytest.mark.reliability),
    ],
)
def test_killed_again_and_again(tmp_path: Path, expected: dict[str, str], seed: int) -> None:
    choose, path = random.Random(seed), tmp_path / "run"
    for _ in range(6):
        killed_at(path, f"{choose.choice(POINTS).partition(':')[0]}:{choose.randint(1, 4)}")
        assert_nothing_lost(path)
    continue_run(path)
    assert outcome(path) == expected


def test_segments_after_the_checkpoint_are_set_aside(
    tmp_path: Path, expected: dict[str, str]
) -> None:
    path = tmp_path / "run"
    # The third checkpoint (step 40) is not there, its segment is
    killed_at(path, "checkpoint.after_tmp:3")
    segments = path / "segments"
    committed = read_manifest(segments)
    assert len(committed) == 3
    before = (segments / "000000.h5").stat()
    with RunDirectory.resume(path) as run:
        found = run.load_checkpoint()
        assert found is not None
        assert (
            found.state.step,
            sum(segment.frames for segment in found.segments),
            found.last_steps,
        ) == (30, 7, (30, 30))
        assert (segments / "000002.h5.orphan").is_file()
        assert read_manifest(segments) == committed[:2]
        assert [finding.severity for finding in verify(path)] == ["warning"]
    after = (segments / "000000.h5").stat()
    assert (before.st_ino, before.st_mtime_ns) == (after.st_ino, after.st_mtime_ns)
    continue_run(path)
    assert outcome(path) == expected


def test_killed_while_setting_aside(tmp_path: Path, expected: dict[str, str]) -> None:
    path = tmp_path / "run"
    assert killed_at(path, "segment.after_rename:2")  # a file that the manifest does not list
    assert killed_at(path, "orphan.mid")
    assert_nothing_lost(path)
    continue_run(path)
    assert outcome(path) == expected


def test_two_orphans_of_the_same_name(tmp_path: Path, expected: dict[str, str]) -> None:
    path = tmp_path / "run"
    for _ in range(3):
        assert killed_at(
            path, "manifest.after_append:2" if not path.exists() else "manifest.after_append"
        )
    assert len(list((path / "segments").glob("000001.h5*.orphan"))) == 2
    continue_run(path)
    assert outcome(path) == expected


def test_second_checkpoint_at_the_same_step_does_not_harm_the_first(tmp_path: Path) -> None:
    model = make_model()
    with make_run(tmp_path / "run") as run:
        state = drive(run, model, steps=40, checkpoint_every=15, finish=False)
        assert run._writer is not None
        run.checkpoint(state, run._writer)  # nothing new: the older one, at step 30, stays
        assert names(tmp_path) == ["step-00000000030", "step-00000000040"]
        run._writer.series_row(Snapshot(dataclasses.replace(state, step=41), model))
        run.checkpoint(state, run._writer)
        assert names(tmp_path) == ["step-00000000040", "step-00000000040.1"]
    with RunDirectory.resume(tmp_path / "run") as again:
        found = again.load_checkpoint()
        assert found is not None
        assert found.name == "step-00000000040.1"
        assert (found.state.step, found.last_steps) == (40, (40, 41))


def names(path: Path) -> list[str]:
    return sorted(file.stem for file in (path / "run" / "checkpoints").glob("*.json"))
