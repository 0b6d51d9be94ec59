"""Stages are added to a run: its files are those of a longer run, and nothing of it is lost
(`test_store_kill` kills the process meanwhile)."""

import shutil

import pytest
from store_support import (
    LONGER,
    PROVENANCE,
    RESOLVED,
    SOURCE,
    drive,
    extend_run,
    make_model,
    replace,
    run_whole,
)

from multicor_cli import store
from multicor_cli.store import atomic as atomic_module
from multicor_cli.store import extension as extension_module
from multicor_cli.store import segments as segments_module
from multicor_cli.store.extension import Extension
from multicor_cli.store.segments import read_manifest

LONGEST = Extension(
    SOURCE + "# and on and on\n", RESOLVED + "[more]\n[most]\n", ("load", "shear", "on", "further")
)


@pytest.fixture(scope="module")
def model():
    """With all that only some runs have."""
    return make_model(heat=True)


@pytest.fixture(scope="module")
def expected(model, tmp_path_factory):
    """Digest of the run that had all stages from the start."""
    path = tmp_path_factory.mktemp("whole") / "run"
    with store.RunDirectory.create(
        path, LONGER.source, LONGER.resolved, PROVENANCE, stages=LONGER.stages
    ) as run:
        drive(run, model, steps=60, checkpoint_every=15)
    return str(store.run_info(path)["data_digest"])


@pytest.mark.parametrize("finish", [True, False], ids=["finished", "stopped"])
def test_an_extended_run_is_the_run_that_had_all_stages_from_the_start(
    tmp_path, heated, model, expected, finish
):
    path = tmp_path / "run"
    shutil.copytree(heated, path) if finish else run_whole(path, model, finish=False)
    extend_run(path, model)
    assert store.verify(path) == []
    info = store.run_info(path)
    assert (info["status"], info["data_digest"]) == ("finished", expected)
    (extension,) = info["extensions"]
    assert (extension["stages_before"], extension["stages"], extension["step"]) == (2, 3, 40)


def test_the_former_scenarios_are_kept(tmp_path):
    path, model = tmp_path / "run", make_model(1)
    run_whole(path, model)
    extend_run(path, model)
    with store.RunDirectory.resume(path, extension=LONGEST) as run:
        drive(run, model, steps=70, checkpoint_every=15)
    numbers = (".1", ".2", "")
    ends = [(path / f"scenario{n}.toml").read_text().splitlines()[-1] for n in numbers]
    assert ends == ["name = 'tiny'", "# and on", "# and on and on"]
    texts = [(path / f"scenario.resolved{n}.toml").read_text() for n in numbers]
    assert texts == [RESOLVED, LONGER.resolved, LONGEST.resolved]
    assert [step["stages"] for step in store.run_info(path)["extensions"]] == [3, 4]
    assert store.verify(path) == []
    run_whole(path, model, overwrite=True)  # all of these are files of the run
    assert store.verify(path) == []


def test_a_long_run_is_copied_in_pieces(tmp_path, heated, model, expected, monkeypatch):
    path = shutil.copytree(heated, tmp_path / "run")
    monkeypatch.setattr(extension_module, "SERIES_ROWS", 4)
    monkeypatch.setattr(segments_module, "FRAME_LIMIT", 2)
    with store.RunDirectory.resume(path, extension=LONGER) as run:
        assert len(read_manifest(path / "segments")) > 4
        drive(run, model, steps=60, checkpoint_every=15)
    assert store.verify(path) == []
    assert store.run_info(path)["data_digest"] == expected


def damage_results(run, _):
    data = (run / "results.h5").read_bytes()
    replace(run / "results.h5", data[:3000] + bytes([data[3000] ^ 1]) + data[3001:])


def fill_the_disk(run, patch):
    def refuse(path, size):
        raise store.StorageFull(path, size, 0)

    patch.setattr(atomic_module, "require_space", refuse)


def be_in_the_way(run, _):
    (run / "scenario.1.toml").write_text("mine")


@pytest.mark.parametrize(("obstacle", "error", "named"), [
    (damage_results, store.DamagedRun, r"results\.h5"),
    (fill_the_disk, store.StorageFull, "no space"),
    (be_in_the_way, store.DirectoryRefused, r"scenario\.1\.toml"),
])  # fmt: skip
def test_a_run_that_cannot_be_extended_stays_as_it_is(copy, monkeypatch, obstacle, error, named):
    with monkeypatch.context() as patch:
        obstacle(copy, patch)
        before = {name: (copy / name).read_bytes() for name in ("run.json", "results.h5")}
        with pytest.raises(error, match=named):
            store.RunDirectory.resume(copy, extension=LONGER)
    assert {name: (copy / name).read_bytes() for name in before} == before
    assert store.run_info(copy)["status"] == "finished"
    if obstacle is be_in_the_way:
        assert (copy / "scenario.1.toml").read_text() == "mine"
    if obstacle is fill_the_disk:
        store.RunDirectory.resume(copy).close()
        assert store.verify(copy) == []
