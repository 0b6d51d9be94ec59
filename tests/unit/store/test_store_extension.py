"""Stages are added to a run: its files are those of a longer run, whenever the process dies, and
nothing of it is lost.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from store_support import (
    PROVENANCE,
    RESOLVED,
    SOURCE,
    drive,
    errors_of,
    killed_at,
    make_model,
    replace,
    run_whole,
)
from trials import thinned

from multicor_cli.model import Model
from multicor_cli.store import (
    DamagedRun,
    DirectoryRefused,
    RunDirectory,
    StorageFull,
    open_run,
    run_info,
    verify,
)
from multicor_cli.store import atomic as atomic_module
from multicor_cli.store import extension as extension_module
from multicor_cli.store import segments as segments_module
from multicor_cli.store.documents import read_run_document
from multicor_cli.store.extension import Extension
from multicor_cli.store.segments import read_manifest

LONGER = Extension(SOURCE + "# and on\n", RESOLVED + "[more]\n", ("load", "shear", "on"))
LONGEST = Extension(
    SOURCE + "# and on and on\n", RESOLVED + "[more]\n[most]\n", ("load", "shear", "on", "further")
)
COMMIT = ("mid_tmp", "before_rename", "after_rename")
POINTS = (
    *(
        "model.before_rename",
        "segment.mid_tmp",
        "segment.after_rename",
        "manifest.torn",
        "manifest.after_append",
    ),
    *(f"{label}.{point}" for label in ("checkpoint", "checkpointjson") for point in COMMIT),
    "checkpoint.before_prune",
    *(f"scenario.{point}:{number}" for number in (1, 2, 3, 4) for point in COMMIT),
    *(
        "extension.before",
        "runjson.mid_tmp",
        "runjson.before_rename",
        "runjson.after_rename",
        "extension.after",
    ),
    *(
        "runjson.before_rename:2",
        "segment.after_rename:3",
        "results.before_rename",
        "results.after_rename",
        "cleanup.mid",
    ),
)


def go_on(path: Path, model: Model, steps: int = 60) -> None:
    """What ``multicor run --extend`` does: add the stages unless the run has them, and carry them
    out.
    """
    has_them = run_info(path)["stages"] == list(LONGER.stages)
    with RunDirectory.resume(path, extension=None if has_them else LONGER) as run:
        if not run.is_finished:
            drive(run, model, steps=steps, checkpoint_every=15)


@pytest.fixture(scope="module")
def model() -> Model:
    """With all that only some runs have."""
    return make_model(heat=True)


@pytest.fixture(scope="module")
def expected(model: Model, tmp_path_factory: pytest.TempPathFactory) -> str:
    """Digest of the run that had all stages from the start."""
    path = tmp_path_factory.mktemp("whole") / "run"
    with RunDirectory.create(
        path, LONGER.source, LONGER.resolved, PROVENANCE, stages=LONGER.stages
    ) as run:
        drive(run, model, steps=60, checkpoint_every=15)
    return str(run_info(path)["data_digest"])


def assert_nothing_lost(path: Path) -> None:
    """The run is what it was, or the longer one; its first 40 steps are there in any case."""
    assert errors_of(path) == []
    with open_run(path) as run:
        assert run.frames.step.tolist()[:9] == list(range(0, 41, 5))
        assert len(run.series["step"]) >= 21
        assert run.scenario_resolved in (RESOLVED, LONGER.resolved)
        assert (run.scenario_resolved == RESOLVED) == (len(run.stages) == 2)
        assert run.state() is not None


@pytest.mark.parametrize("finish", [True, False], ids=["finished", "stopped"])
def test_an_extended_run_is_the_run_that_had_all_stages_from_the_start(
    tmp_path: Path, model: Model, expected: str, finish: bool
) -> None:
    path = tmp_path / "run"
    run_whole(path, model, steps=40, checkpoint_every=15, finish=finish)
    go_on(path, model)
    assert verify(path) == []
    info = run_info(path)
    assert (info["status"], info["data_digest"]) == ("finished", expected)
    (extension,) = info["extensions"]
    assert (extension["stages_before"], extension["stages"], extension["step"]) == (2, 3, 40)


def test_the_former_scenarios_are_kept(tmp_path: Path) -> None:
    path, model = tmp_path / "run", make_model(1)
    run_whole(path, model)
    go_on(path, model)
    with RunDirectory.resume(path, extension=LONGEST) as run:
        drive(run, model, steps=70, checkpoint_every=15)
    files = ("scenario.1.toml", "scenario.2.toml", "scenario.toml")
    assert [(path / name).read_text().splitlines()[-1] for name in files] == [
        "name = 'tiny'",
        "# and on",
        "# and on and on",
    ]
    resolved = ("scenario.resolved.1.toml", "scenario.resolved.2.toml", "scenario.resolved.toml")
    assert [(path / name).read_text() for name in resolved] == [
        RESOLVED,
        LONGER.resolved,
        LONGEST.resolved,
    ]
    assert [step["stages"] for step in run_info(path)["extensions"]] == [3, 4]
    assert verify(path) == []
    run_whole(path, model, overwrite=True)  # all of these are files of the run
    assert verify(path) == []


@pytest.mark.parametrize("point", thinned(POINTS, 5))
def test_killed_while_it_is_extended(
    tmp_path: Path, model: Model, expected: str, point: str
) -> None:
    path = tmp_path / "run"
    run_whole(path, model)
    assert killed_at(path, point, lambda path: go_on(path, model)), f"the run never came to {point}"
    assert_nothing_lost(path)
    go_on(path, model)
    assert verify(path) == []
    assert run_info(path)["data_digest"] == expected


def test_killed_again_and_again(tmp_path: Path, model: Model, expected: str) -> None:
    """Checkpoints are pruned each time: the run must not lose the last that it can use."""
    path = tmp_path / "run"
    run_whole(path, model)
    for point in ("checkpointjson.after_rename", "extension.before", "scenario.after_rename:3"):
        assert killed_at(path, point, lambda path: go_on(path, model))
        assert_nothing_lost(path)
    go_on(path, model)
    assert run_info(path)["data_digest"] == expected


def test_a_long_run_is_copied_in_pieces(
    tmp_path: Path, model: Model, expected: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "run"
    run_whole(path, model)
    monkeypatch.setattr(extension_module, "SERIES_ROWS", 4)
    monkeypatch.setattr(segments_module, "FRAME_LIMIT", 2)
    with RunDirectory.resume(path, extension=LONGER) as run:
        assert len(read_manifest(path / "segments")) > 4
        drive(run, model, steps=60, checkpoint_every=15)
    assert verify(path) == []
    assert run_info(path)["data_digest"] == expected


def test_damaged_results_are_not_made_into_segments(tmp_path: Path) -> None:
    path = tmp_path / "run"
    run_whole(path)
    data = (path / "results.h5").read_bytes()
    replace(path / "results.h5", data[:3000] + bytes([data[3000] ^ 1]) + data[3001:])
    document = read_run_document(path)
    with pytest.raises(DamagedRun, match=r"results\.h5"):
        RunDirectory.resume(path, extension=LONGER)
    assert read_run_document(path) == document


def test_a_full_disk_leaves_the_run_as_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "run"
    run_whole(path)

    def refuse(path: Path, size: int) -> None:
        raise StorageFull(path, size, 0)

    with monkeypatch.context() as patch:
        patch.setattr(atomic_module, "require_space", refuse)
        with pytest.raises(StorageFull):
            RunDirectory.resume(path, extension=LONGER)
    assert run_info(path)["status"] == "finished"
    RunDirectory.resume(path).close()
    assert verify(path) == []


def test_a_file_in_the_way_of_a_former_scenario_is_not_replaced(tmp_path: Path) -> None:
    path = tmp_path / "run"
    run_whole(path)
    (path / "scenario.1.toml").write_text("mine")
    with pytest.raises(DirectoryRefused, match=r"scenario\.1\.toml"):
        RunDirectory.resume(path, extension=LONGER)
    assert (path / "scenario.1.toml").read_text() == "mine"
    assert run_info(path)["status"] == "finished"
