"""Damaged files and those of other versions are detected, named and survived: never a wrong number, never a crash."""

from __future__ import annotations

import json
import random
import shutil
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
import store_support
from store_support import continue_run, drive, make_model, make_run, replace, run_whole, set_text

from multicor_cli.model import State
from multicor_cli.store import (
    DamagedRun,
    DirectoryRefused,
    RunDirectory,
    StoreError,
    UnsupportedVersion,
    open_run,
    run_info,
    schema,
    verify,
)
from multicor_cli.store.documents import document_line, parse_document, read_document, write_document
from multicor_cli.store.hdf5 import CheckedFile

FLIPS = 25


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("finished") / "run"
    run_whole(path)
    return path


@pytest.fixture(scope="module")
def unfinished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("unfinished") / "run"
    with make_run(path) as run:
        drive(run, make_model(), steps=40, checkpoint_every=15, finish=False)
    return path


@pytest.fixture
def copy(tmp_path: Path, finished: Path) -> Path:
    return Path(shutil.copytree(finished, tmp_path / "copy"))


@pytest.fixture
def open_copy(tmp_path: Path, unfinished: Path) -> Path:
    return Path(shutil.copytree(unfinished, tmp_path / "copy"))


def test_a_file_of_another_kind_is_no_run_and_results_by_another_name_are(copy: Path, tmp_path: Path) -> None:
    other = tmp_path / "shear.toml"
    other.write_text("[scenario]\n")
    with pytest.raises(DirectoryRefused, match="is no run; give the run directory, or its"):
        open_run(other)
    renamed = Path(shutil.copy(copy / "results.h5", tmp_path / "kept"))
    with open_run(renamed) as run:
        assert run.frames.time.size
    renamed.with_suffix(".h5").write_text("no HDF5")
    with pytest.raises(DamagedRun):
        open_run(renamed.with_suffix(".h5"))


def flips(data: bytes, seed: int) -> list[bytes]:
    choose = random.Random(seed)
    found = []
    for _ in range(FLIPS):
        changed = bytearray(data)
        changed[choose.randrange(len(data))] ^= 1 << choose.randrange(8)
        found.append(bytes(changed))
    return found


def everything(path: Path) -> dict[str, bytes]:
    """All that a reader can get out of a run."""
    with open_run(path) as run:
        data = {name: run.series[name].tobytes() for name in run.series}
        for frame in run.frames:
            for spec in schema.select(schema.FRAME_TABLE, run.features):
                if spec not in schema.OFFSETS:
                    data[f"{frame.index} {spec.path}"] = frame.column(spec.path).tobytes()
        model = run.model
        data["radius"], data["wall"] = model.grains.radius.tobytes(), repr(model.walls.names).encode()
        data["source"] = run.scenario_source.encode()
    return data


def everything_or_error(path: Path) -> dict[str, bytes] | StoreError:
    try:
        return everything(path)
    except StoreError as error:
        return error


def test_flipped_bits_in_results_are_noticed_or_harmless(copy: Path) -> None:
    expected, original = everything(copy), (copy / "results.h5").read_bytes()
    noticed = 0
    for data in flips(original, 1):
        replace(copy / "results.h5", data)
        findings = verify(copy)
        noticed += bool(findings)
        found = everything_or_error(copy)
        assert found == expected or (isinstance(found, StoreError) and findings)
    assert noticed > FLIPS // 2


@pytest.mark.parametrize("name", ["segments/000001.h5", "checkpoints/step-00000000040.h5", "model.h5"])
def test_flipped_bits_in_digested_files_are_always_noticed(open_copy: Path, name: str) -> None:
    expected, original = everything(open_copy), (open_copy / name).read_bytes()
    for data in flips(original, 2)[:6]:
        replace(open_copy / name, data)
        findings = verify(open_copy)
        assert any(name.partition(".")[0] in finding.file for finding in findings)
        found = everything_or_error(open_copy)
        assert found == expected or (isinstance(found, StoreError) and findings)


@pytest.mark.parametrize("name", ["results.h5", "run.json", "scenario.toml", "scenario.resolved.toml"])
def test_shortened_files_are_noticed(copy: Path, name: str) -> None:
    original = (copy / name).read_bytes()
    for length in [0, 1, len(original) // 3, len(original) - 2]:
        replace(copy / name, original[:length])
        assert [finding.severity for finding in verify(copy)] == ["error"]
        if name in ("results.h5", "run.json"):
            with pytest.raises(DamagedRun, match=name):
                open_run(copy)


@pytest.mark.parametrize("damage", [lambda data: data[:-1], lambda data: data[:100] + b"\0" * 4096 + data[4196:]])
def test_damaged_checkpoint_gives_way_to_the_older_one(open_copy: Path, finished: Path, damage: Callable[[bytes], bytes]) -> None:
    newest = open_copy / "checkpoints" / "step-00000000040.h5"
    replace(newest, damage(newest.read_bytes()))
    with open_run(open_copy) as reader:
        state = reader.state()
        assert state is not None
        assert state.step == 30
    with RunDirectory.resume(open_copy) as run:
        found = run.load_checkpoint()
        assert found is not None
        assert found.state.step == 30
        assert "step-00000000040.h5" in found.warnings[0]
        assert not newest.exists()
    continue_run(open_copy)
    assert run_info(open_copy)["data_digest"] == run_info(finished)["data_digest"]


@pytest.mark.parametrize("name", ["step-00000000040.json", "step-00000000040.h5"])
def test_missing_or_edited_part_of_a_checkpoint(open_copy: Path, name: str) -> None:
    path = open_copy / "checkpoints" / name
    if name.endswith("json"):
        replace(path, path.read_bytes().replace(b'"last_frame_step": 40', b'"last_frame_step": 35'))
    else:
        path.unlink()
    with RunDirectory.resume(open_copy) as run:
        found = run.load_checkpoint()
        assert found is not None
        assert found.state.step == 30
        assert len(found.warnings) == 1


def test_damaged_segment_makes_its_checkpoint_unusable(open_copy: Path, finished: Path) -> None:
    last = sorted((open_copy / "segments").glob("*.h5"))[-1]
    replace(last, last.read_bytes()[:-7])
    with RunDirectory.resume(open_copy) as run:
        found = run.load_checkpoint()
        assert found is not None
        assert found.state.step == 30
        assert last.name in found.warnings[0]
    continue_run(open_copy)
    assert run_info(open_copy)["data_digest"] == run_info(finished)["data_digest"]


def test_no_usable_checkpoint_is_refused_not_restarted(open_copy: Path) -> None:
    first = open_copy / "segments" / "000000.h5"
    replace(first, first.read_bytes()[::-1])
    with RunDirectory.resume(open_copy) as run, pytest.raises(DamagedRun, match="--overwrite"):
        run.load_checkpoint()
    assert len(list((open_copy / "checkpoints").glob("*.h5"))) == 2


def test_swapped_segments_are_noticed(open_copy: Path) -> None:
    directory = open_copy / "segments"
    (directory / "000000.h5").rename(directory / "x")
    (directory / "000001.h5").rename(directory / "000000.h5")
    (directory / "x").rename(directory / "000001.h5")
    assert len([finding for finding in verify(open_copy) if "00000" in finding.file]) == 2
    with pytest.raises(DamagedRun), open_run(open_copy) as run:
        run.frames.time  # noqa: B018


def test_manifest_damage(open_copy: Path) -> None:
    path = open_copy / "segments" / "MANIFEST.jsonl"
    original = path.read_bytes()
    replace(path, original + b'{"name": "0000')  # torn by a crash: does not count
    assert verify(open_copy) == []
    replace(path, original.replace(b'"frames": 4', b'"frames": 3', 1))
    with pytest.raises(DamagedRun, match="line 1"):
        open_run(open_copy)
    with RunDirectory.resume(open_copy) as run:  # the checkpoint knows the segments: the manifest is restored
        run.load_checkpoint()
    assert path.read_bytes() == original


def test_manifest_cannot_name_files_elsewhere(open_copy: Path) -> None:
    path = open_copy / "segments" / "MANIFEST.jsonl"
    line = parse_document(path.read_bytes().splitlines()[0], "test")
    replace(path, document_line({**line, "name": "../../outside.h5"}))
    with pytest.raises(DamagedRun, match="not the name of a segment"):
        open_run(open_copy)


def test_files_of_another_run_are_refused(open_copy: Path, tmp_path: Path) -> None:
    run_whole(tmp_path / "other")
    shutil.copy(tmp_path / "other" / "results.h5", open_copy / "results.h5")
    with make_run(tmp_path / "third") as run:
        drive(run, make_model(), steps=40, checkpoint_every=15, finish=False)
    replace(open_copy / "model.h5", (tmp_path / "third" / "model.h5").read_bytes())
    with open_run(open_copy) as run, pytest.raises(DamagedRun, match="belongs to another run"):
        run.model  # noqa: B018


def edit_document(path: Path, **changes: object) -> None:
    data = read_document(path)
    write_document(path, "test", {**data, **changes})


def test_other_versions_are_refused_by_name(copy: Path) -> None:
    with h5py.File(copy / "results.h5", "r+") as file:
        file.attrs["format_version"] = np.array([2, 0])
    with pytest.raises(UnsupportedVersion, match=r"format version 2\.0"):
        open_run(copy / "results.h5")
    edit_document(copy / "run.json", format_version=[2, 3])
    with pytest.raises(UnsupportedVersion, match=r"format version 2\.3") as caught:
        open_run(copy)
    assert caught.value.exit_code == 7


@pytest.mark.parametrize(("version", "named"), [([2, 0], "2.0"), (3, "3"), (None, "None")])
def test_checkpoints_of_other_versions_are_refused_by_name(open_copy: Path, version: object, named: str) -> None:
    edit_document(open_copy / "checkpoints" / "step-00000000040.json", format_version=version)
    with RunDirectory.resume(open_copy) as run, pytest.raises(UnsupportedVersion, match=f"format version {named}"):
        run.load_checkpoint()


def test_unknown_datasets_of_a_newer_minor_version_are_ignored(copy: Path, finished: Path) -> None:
    with h5py.File(copy / "results.h5", "r+") as file:
        file.attrs["format_version"] = np.array([1, 7])
        set_text(file, "features", '["charge"]')
        file["particles/charge"] = np.zeros(45)
    with CheckedFile(copy / "results.h5", "multicor-results") as checked:
        assert checked.version == (1, 7)
    assert everything(copy / "results.h5") == everything(finished)


def test_a_run_of_a_newer_minor_version_is_continued(open_copy: Path, finished: Path) -> None:
    for document in (open_copy / "run.json", *(open_copy / "checkpoints").glob("*.json")):
        edit_document(document, format_version=[1, 7])
    continue_run(open_copy)
    assert run_info(open_copy)["data_digest"] == run_info(finished)["data_digest"]


@pytest.mark.parametrize(
    "text", ["", "[]", "null", "{", '{"check": 1}', '{"status": "finished", "check": ""}', "[" * 10**5, "\x00", "9" * 5000]
)
def test_run_json_that_is_none(copy: Path, text: str) -> None:
    replace(copy / "run.json", text.encode())
    with pytest.raises(DamagedRun, match=r"run\.json"):
        open_run(copy)
    with pytest.raises(DamagedRun, match=r"run\.json"):
        RunDirectory.resume(copy)
    assert len(verify(copy)) == 1


@pytest.mark.parametrize(
    ("key", "value"),
    [("status", "done"), ("stages", "load"), ("results", {"size": "big"}), ("summary", {}), ("run_id", 3), ("provenance", {})],
)
def test_run_json_with_wrong_types(copy: Path, key: str, value: object) -> None:
    edit_document(copy / "run.json", **{key: value})
    with pytest.raises(DamagedRun, match=key):
        open_run(copy)


@pytest.mark.parametrize("value", [None, 10**320, "many", [1]])
@pytest.mark.parametrize("name", ["step", "time", "grain_count"])
def test_summary_with_absurd_numbers(copy: Path, name: str, value: object) -> None:
    summary = read_document(copy / "run.json")["summary"] | {name: value}
    edit_document(copy / "run.json", summary=summary)
    for action in (open_run, run_info, RunDirectory.resume, continue_run):
        with pytest.raises(DamagedRun, match="summary"):
            action(copy)


def test_missing_run_json_is_noticed_unless_results_lie_alone(copy: Path) -> None:
    (copy / "run.json").unlink()
    assert [finding.file for finding in verify(copy) if finding.severity == "error"] == [str(copy / "run.json")]
    for path in copy.iterdir():
        if path.name != "results.h5":
            shutil.rmtree(path) if path.is_dir() else path.unlink()
    assert verify(copy) == []


@pytest.fixture(scope="module")
def talkative(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A ``results.h5`` alone whose provenance is longer than 4 KiB: HDF5 has no checksum for it any more."""
    path = tmp_path_factory.mktemp("talkative") / "run"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(store_support, "PROVENANCE", {**store_support.PROVENANCE, "command": "x" * 10_000})
        run_whole(path)
    return path / "results.h5"


@pytest.mark.parametrize("name", ["summary", "provenance", "run_id", "data_digest", "attribute_digests"])
def test_changed_text_of_results_that_lie_alone_is_noticed(talkative: Path, tmp_path: Path, name: str) -> None:
    with h5py.File(talkative) as file:
        text = file.attrs[name]
    data = bytearray(talkative.read_bytes())
    assert data.count(text) == 1
    data[data.index(text) + len(text) // 2] ^= 1
    (tmp_path / "results.h5").write_bytes(data)
    assert [finding.severity for finding in verify(tmp_path / "results.h5")] == ["error"]
    with pytest.raises(DamagedRun, match="attribute"):
        run_info(tmp_path / "results.h5")


def test_edited_run_json_is_noticed(copy: Path) -> None:
    data = json.loads((copy / "run.json").read_text())
    data["summary"]["max_overlap"] = 0.0001
    replace(copy / "run.json", json.dumps(data).encode())
    with pytest.raises(DamagedRun, match="edited"):
        run_info(copy)


def test_every_field_of_the_state_is_in_a_checkpoint(open_copy: Path) -> None:
    with RunDirectory.resume(open_copy) as run:
        found = run.load_checkpoint()
    assert found is not None
    digest = found.state.digest()
    for name, value in found.state.as_dict().items():
        changed = found.state.as_dict() | {name: value + 1 if value.size else np.zeros((1, *value.shape[1:]), value.dtype)}
        assert State.from_dict(changed).digest() != digest, name


def test_damaged_segment_is_not_merged(tmp_path: Path) -> None:
    path = tmp_path / "run"
    with make_run(path) as run:
        drive(run, make_model(), steps=40, checkpoint_every=15, finish=False)
        segments = sorted((path / "segments").glob("*.h5"))
        (path / "segments" / "x").write_bytes(segments[0].read_bytes())
        replace(segments[0], segments[1].read_bytes())  # whole, of this run, but in the wrong place
        with pytest.raises(DamagedRun, match=r"000000\.h5: damaged .*MANIFEST"):
            run.finish("finished")
        assert run.status == "running"
    assert not (path / "results.h5").exists()
    assert sorted((path / "segments").glob("*.h5")) == segments


def test_newest_checkpoint_that_has_vanished_is_noticed(open_copy: Path) -> None:
    newest = max((open_copy / "checkpoints").glob("*.json"))
    newest.unlink()
    assert [finding.message for finding in verify(open_copy)] == [
        f"{open_copy / 'checkpoints'}: the checkpoint at step 40, of which run.json knows, is missing"
    ]
