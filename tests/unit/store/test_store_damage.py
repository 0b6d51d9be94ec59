"""Damaged files and those of other versions are detected, named and survived: never a wrong number,
never a crash."""

import random
import re
import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
import store_support
from store_support import (
    continue_run,
    drive,
    errors_of,
    make_model,
    make_run,
    replace,
    run_whole,
    set_text,
)

from multicor_cli import store
from multicor_cli.model import State
from multicor_cli.store.documents import (
    document_line,
    parse_document,
    read_document,
    write_document,
)
from multicor_cli.store.hdf5 import CheckedFile

FLIPS = 25
MANIFEST, NEWEST, LAST = (
    "segments/MANIFEST.jsonl", "checkpoints/step-00000000040", "segments/000002.h5",
)  # fmt: skip


def test_a_file_of_another_kind_is_no_run_and_results_by_another_name_are(copy, tmp_path):
    other = tmp_path / "shear.toml"
    other.write_text("[scenario]\n")
    with pytest.raises(store.DirectoryRefused, match="is no run; give the run directory, or its"):
        store.open_run(other)
    renamed = Path(shutil.copy(copy / "results.h5", tmp_path / "kept"))
    with store.open_run(renamed) as run:
        assert run.frames.time.size
    renamed.with_suffix(".h5").write_text("no HDF5")
    with pytest.raises(store.DamagedRun):
        store.open_run(renamed.with_suffix(".h5"))


def flips(data, seed):
    choose = random.Random(seed)
    found = []
    for _ in range(FLIPS):
        changed = bytearray(data)
        changed[choose.randrange(len(data))] ^= 1 << choose.randrange(8)
        found.append(bytes(changed))
    return found


def everything(path):
    """All that a reader can get out of a run."""
    with store.open_run(path) as run:
        data = {name: run.series[name].tobytes() for name in run.series}
        for frame in run.frames:
            for spec in store.schema.select(store.schema.FRAME_TABLE, run.features):
                if spec not in store.schema.OFFSETS:
                    data[f"{frame.index} {spec.path}"] = frame.column(spec.path).tobytes()
        model = run.model
        data["radius"], data["wall"] = (
            model.grains.radius.tobytes(),
            repr(model.walls.names).encode(),
        )
        data["source"] = run.scenario_source.encode()
    return data


def everything_or_error(path):
    try:
        return everything(path)
    except store.StoreError as error:
        return error


def test_flipped_bits_in_results_are_noticed_or_harmless(copy):
    expected, original = everything(copy), (copy / "results.h5").read_bytes()
    noticed = 0
    for data in flips(original, 1):
        replace(copy / "results.h5", data)
        findings = store.verify(copy)
        noticed += bool(findings)
        found = everything_or_error(copy)
        assert found == expected or (isinstance(found, store.StoreError) and findings)
    assert noticed > FLIPS // 2


@pytest.mark.parametrize(
    "name", ["segments/000001.h5", "checkpoints/step-00000000040.h5", "model.h5"]
)
def test_flipped_bits_in_digested_files_are_always_noticed(open_copy, name):
    expected, original = everything(open_copy), (open_copy / name).read_bytes()
    for data in flips(original, 2)[:6]:
        replace(open_copy / name, data)
        findings = store.verify(open_copy)
        assert any(name.partition(".")[0] in finding.file for finding in findings)
        found = everything_or_error(open_copy)
        assert found == expected or (isinstance(found, store.StoreError) and findings)


@pytest.mark.parametrize(
    "name", ["results.h5", "run.json", "scenario.toml", "scenario.resolved.toml"]
)
def test_shortened_files_are_noticed(copy, name):
    original = (copy / name).read_bytes()
    for length in [0, 1, len(original) // 3, len(original) - 2]:
        replace(copy / name, original[:length])
        assert [finding.severity for finding in store.verify(copy)] == ["error"]
        if name in ("results.h5", "run.json"):
            with pytest.raises(store.DamagedRun, match=name):
                store.open_run(copy)


# --- what is done to a run that was interrupted, and what reading, going on and verifying then say


def edit(name, change):
    """Other bytes for a file of the run."""
    return lambda run: replace(run / name, change((run / name).read_bytes()))


def edit_document(path, **changes):
    """Other values in a document, with a digest that is right."""
    write_document(path, "test", {**read_document(path), **changes})


def of_version(version):
    return lambda run: edit_document(run / f"{NEWEST}.json", format_version=version)


def as_newer_minor_version(run):
    for document in (run / "run.json", *(run / "checkpoints").glob("*.json")):
        edit_document(document, format_version=[1, 7], charge=1.0)


def name_a_file_elsewhere(data):
    first, *others = data.splitlines(keepends=True)
    return document_line(
        {**parse_document(first.strip(), "test"), "name": "../../outside.h5"}
    ) + b"".join(others)


def swap_segments(run):
    first, second = ((run / "segments" / name).read_bytes() for name in ("000000.h5", "000001.h5"))
    replace(run / "segments" / "000000.h5", second)
    replace(run / "segments" / "000001.h5", first)


def take_files_of_another_run(run):
    run_whole(run.parent / "other", finish=False)
    replace(run / "model.h5", (run.parent / "other" / "model.h5").read_bytes())


DAMAGED = {
    "checkpoint cut": (edit(f"{NEWEST}.h5", lambda data: data[:-1]), "", 30, "040.h5: damaged"),
    "page zeroed": (edit(f"{NEWEST}.h5", lambda data: data[:100] + b"\0" * 4096 + data[4196:]), "",
        30, "040.h5: damaged"),
    "state gone": (lambda run: (run / f"{NEWEST}.h5").unlink(), "", 30, "040.h5: missing"),
    "description gone": (lambda run: (run / f"{NEWEST}.json").unlink(), "", 30,
        "the checkpoint at step 40, of which"),
    "description edited": (
        edit(f"{NEWEST}.json",
            lambda data: data.replace(b'"last_frame_step": 40', b'"last_frame_step": 35')), "", 30,
            "edited",
    ),
    "last segment cut": (edit(LAST, lambda data: data[:-7]), "000002.h5", 30, "000002.h5: damaged"),
    "first segment turned round": (edit("segments/000000.h5", lambda data: data[::-1]), "000000.h5",
        "--overwrite", "000000.h5"),
    "segments swapped": (swap_segments, "00000", "--overwrite", r"00000\d.h5: damaged"),
    "manifest torn": (edit(MANIFEST, lambda data: data + b'{"name": "0000'), "", 40, ""),
    "manifest edited": (edit(MANIFEST,
        lambda data: data.replace(b'"frames": 4', b'"frames": 3', 1)), "line 1", 40, "line 1"),
    "manifest leads elsewhere": (edit(MANIFEST, name_a_file_elsewhere),
        "line 1: .*name is ../../outside.h5", 40, "line 1"),
    "model of another run": (take_files_of_another_run, "another run", "belongs to another run",
        "belongs to another run"),
    "version 2.0": (of_version([2, 0]), "", r"format version 2\.0", r"format version 2\.0"),
    "version 3": (of_version(3), "", "format version 3", "format version 3"),
    "no version": (of_version(None), "", "format version None", "format version None"),
    "newer minor version": (as_newer_minor_version, "", 40, ""),
}  # fmt: skip
"""What is done; what reading then says, or nothing: it reads what is there; the step from which the
run goes on, or why it does not; what `verify` finds, or nothing."""


@pytest.mark.parametrize("damage", DAMAGED)
def test_an_interrupted_run_that_was_damaged(open_copy, unfinished, finished, damage):
    act, reading, going_on, finding = DAMAGED[damage]
    act(open_copy)
    errors = errors_of(open_copy)
    assert all(re.search(finding, message) for message in errors) if finding else errors == []
    assert bool(errors) == bool(finding)
    found = everything_or_error(open_copy)
    assert re.search(reading, str(found)) if reading else found == everything(unfinished)
    with store.RunDirectory.resume(open_copy) as run:
        if isinstance(going_on, str):
            kind = store.UnsupportedVersion if "version" in damage else store.DamagedRun
            with pytest.raises(kind, match=going_on):
                run.load_checkpoint()
            # Nothing is begun again
            assert len(list((open_copy / "checkpoints").glob("*.h5"))) == 2
            return
        checkpoint = run.load_checkpoint()
        assert checkpoint.state.step == going_on
        is_said = going_on < 40 and damage != "description gone"
        assert [bool(re.search(finding, warning)) for warning in checkpoint.warnings] == [
            True
        ] * is_said
    continue_run(open_copy)
    assert store.verify(open_copy) == [] or [
        found.severity for found in store.verify(open_copy)
    ] == ["warning"]
    assert store.run_info(open_copy)["data_digest"] == store.run_info(finished)["data_digest"]


# --- what ``run.json`` may not say


def changed_summary(**changes):
    return lambda file: edit_document(file, summary=read_document(file)["summary"] | changes)


def value(**changes):
    return lambda file: edit_document(file, **changes)


END = {"stage": 0, "name": "load", "reason": "duration", "step": 5, "time": 1.0, "duration": 1.0}
DOCUMENTS = {
    **{
        f"text {number}": (lambda file, text=text: replace(file, text.encode()), r"run\.json")
        for number, text in enumerate(
            (
                "",
                "[]",
                "null",
                "{",
                '{"check": 1}',
                '{"status": "finished", "check": ""}',
                "[" * 10**5,
                "\x00",
                "9" * 5000,
            )
        )
    },
    "edited": (
        lambda file: replace(
            file, file.read_bytes().replace(b'"max_overlap": 0.0', b'"max_overlap": 0.1')
        ),
        "edited",
    ),
    "version 2.3": (value(format_version=[2, 3]), r"format version 2\.3"),
    "version 3": (value(format_version=3), "format version 3"),
    "sessions": (value(sessions=[1]), r"sessions\.0 is 1"),
    "model": (value(model=3), "model is 3"),
    "size of results": (value(results={"size": 1, "frames": 1}), r"results\.blake2b"),
    "status": (value(status="done"), "status is done"),
    "stages": (value(stages="load"), "stages is load"),
    "name of a stage": (value(stages=["load", 3]), r"stages\.1 is 3"),
    "results": (value(results={"size": "big"}), "results"),
    "empty summary": (value(summary={}), "summary"),
    "run_id": (value(run_id=3), "run_id is 3"),
    "provenance": (value(provenance={}), r"provenance\.seed"),
    "timings": (value(timings={"solve": "long"}), r"timings\.solve is long"),
    "reason of an end": (value(stage_ends=[END | {"reason": "bored"}]),
        r"stage_ends\.0\.reason is bored"),
    "step of an end": (value(stage_ends=[END | {"step": True}]), r"stage_ends\.0\.step is True"),
    "origin": (value(origin={"run": "elsewhere"}), r"origin\.run_id"),
    "steering": (value(steering={"by": "me", "every": 1, "decisions": [{}], "notes": {}}),
        r"steering\.decisions\.0\.stage"),
    "extensions": (value(extensions=[{}]), r"extensions\.0\.started"),
    "books": (changed_summary(books={}), "summary"),
    "solver": (changed_summary(solver={"unconverged_steps": 0}), r"summary\.solver"),
    **{
        f"{name} {number!s:.5}": (changed_summary(**{name: number}), "summary")
        for name in ("step", "time", "grain_count", "max_overlap")
        for number in (None, 10**320, "many", [1])
        if name != "max_overlap" or number in (10**320, [1])
    },
}  # fmt: skip
"""What is done to ``run.json``, and what is then said of it by whatever reads it."""


@pytest.mark.parametrize("change", DOCUMENTS)
def test_run_json_that_no_run_writes(copy, change):
    act, named = DOCUMENTS[change]
    act(copy / "run.json")
    for action in (store.open_run, store.run_info, store.RunDirectory.resume, continue_run):
        with pytest.raises(store.DamagedRun, match=named) as caught:
            action(copy)
        assert caught.value.exit_code == 7
        assert "run.json" in str(caught.value)
    assert len(store.verify(copy)) == 1


def test_results_of_another_version_are_refused_by_name(copy):
    with h5py.File(copy / "results.h5", "r+") as file:
        file.attrs["format_version"] = np.array([2, 0])
    with pytest.raises(store.UnsupportedVersion, match=r"format version 2\.0"):
        store.open_run(copy / "results.h5")


def test_unknown_datasets_of_a_newer_minor_version_are_ignored(copy, finished):
    with h5py.File(copy / "results.h5", "r+") as file:
        file.attrs["format_version"] = np.array([1, 7])
        set_text(file, "features", '["charge"]')
        file["particles/charge"] = np.zeros(45)
    with CheckedFile(copy / "results.h5", "multicor-results") as checked:
        assert checked.version == (1, 7)
    assert everything(copy / "results.h5") == everything(finished)


def test_missing_run_json_is_noticed_unless_results_lie_alone(copy):
    (copy / "run.json").unlink()
    assert [finding.file for finding in store.verify(copy) if finding.severity == "error"] == [
        str(copy / "run.json")
    ]
    for path in copy.iterdir():
        if path.name != "results.h5":
            shutil.rmtree(path) if path.is_dir() else path.unlink()
    assert store.verify(copy) == []


@pytest.fixture(scope="module")
def talkative(tmp_path_factory):
    """A ``results.h5`` alone whose provenance is longer than 4 KiB: HDF5 has no checksum for it any
    more."""
    path = tmp_path_factory.mktemp("talkative") / "run"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            store_support, "PROVENANCE", {**store_support.PROVENANCE, "command": "x" * 10_000}
        )
        run_whole(path)
    return path / "results.h5"


@pytest.mark.parametrize(
    "name", ["summary", "provenance", "run_id", "data_digest", "attribute_digests"]
)
def test_changed_text_of_results_that_lie_alone_is_noticed(talkative, tmp_path, name):
    with h5py.File(talkative) as file:
        text = file.attrs[name]
    data = bytearray(talkative.read_bytes())
    assert data.count(text) == 1
    data[data.index(text) + len(text) // 2] ^= 1
    (tmp_path / "results.h5").write_bytes(data)
    assert [finding.severity for finding in store.verify(tmp_path / "results.h5")] == ["error"]
    with pytest.raises(store.DamagedRun, match="attribute"):
        store.run_info(tmp_path / "results.h5")


def test_every_field_of_the_state_is_in_a_checkpoint(open_copy):
    with store.RunDirectory.resume(open_copy) as run:
        found = run.load_checkpoint()
    digest = found.state.digest()
    for name, value in found.state.as_dict().items():
        changed = found.state.as_dict() | {
            name: value + 1 if value.size else np.zeros((1, *value.shape[1:]), value.dtype)
        }
        assert State.from_dict(changed).digest() != digest, name


def test_damaged_segment_is_not_merged(tmp_path):
    path = tmp_path / "run"
    with make_run(path) as run:
        drive(run, make_model(), steps=40, checkpoint_every=15, finish=False)
        segments = sorted((path / "segments").glob("*.h5"))
        (path / "segments" / "x").write_bytes(segments[0].read_bytes())
        replace(segments[0], segments[1].read_bytes())  # whole, of this run, but in the wrong place
        with pytest.raises(store.DamagedRun, match=r"000000\.h5: damaged .*MANIFEST"):
            run.finish("finished")
        assert run.status == "running"
    assert not (path / "results.h5").exists()
    assert sorted((path / "segments").glob("*.h5")) == segments
