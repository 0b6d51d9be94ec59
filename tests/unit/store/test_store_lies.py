"""Files that come from elsewhere: foreign, hostile, or whole by their digests and wrong; refused
before memory is taken.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import h5py
import numpy as np
import pytest
from run_fakes import StopAt
from scenarios import scenario
from store_support import make_model, replace, run_whole, set_text, set_value

from multicor_cli import run
from multicor_cli.store import DamagedRun, open_run, schema, verify
from multicor_cli.store.atomic import file_digest
from multicor_cli.store.documents import document_line, parse_document
from multicor_cli.store.hdf5 import write_text

HEAT_DATASETS = [
    spec.path
    for spec in schema.RESULTS_TABLE
    if spec.only_with not in (None, "exchange", "surface", "groups", "motion")
]


@pytest.mark.parametrize("path", HEAT_DATASETS)
def test_run_with_heat_that_lacks_a_part_of_it_is_damaged(
    heated: Path, tmp_path: Path, path: str
) -> None:
    file = tmp_path / "results.h5"
    shutil.copy(heated / "results.h5", file)
    with h5py.File(file, "r+") as data:
        del data[path]
    findings = verify(file)
    assert len(findings) == 1
    assert path in findings[0].message


@pytest.mark.parametrize("features", ["[]", '["softening"]', "nonsense", "[1]"])
def test_features_that_lie_are_noticed(heated: Path, tmp_path: Path, features: str) -> None:
    file = tmp_path / "results.h5"
    shutil.copy(heated / "results.h5", file)
    with h5py.File(file, "r+") as data:
        set_text(data, "features", features)
    assert [finding.severity for finding in verify(file)] == ["error"]


def test_segment_with_other_features_than_the_model_is_damaged(tmp_path: Path) -> None:
    path = tmp_path / "run"
    run_whole(path, make_model(heat=True), steps=10, checkpoint_every=5, finish=False)
    assert verify(path) == []
    with lying(path) as data:
        set_text(data, "features", "[]")
    findings = [finding for finding in verify(path) if finding.file.endswith("000000.h5")]
    assert len(findings) == 1
    assert "features" in findings[0].message


@contextmanager
def lying(run: Path) -> Iterator[h5py.File]:
    """The first segment, to be changed; the manifest then says what it is."""
    file, manifest = (run / "segments" / name for name in ("000000.h5", "MANIFEST.jsonl"))
    replace(file, file.read_bytes())
    with h5py.File(file, "r+") as data:
        yield data
    lines = [parse_document(line, "test") for line in manifest.read_bytes().splitlines()]
    lines[0] |= {"size": file.stat().st_size, "blake2b": file_digest(file)}
    replace(manifest, b"".join(map(document_line, lines)))


def test_segment_with_more_outlets_than_the_model_is_damaged(tmp_path: Path) -> None:
    hole = {"name": "hole", "region": {"min": [0.0, 0.0], "max": [0.1, 0.01]}}
    assert not run(scenario(outlets=[hole]), tmp_path / "run", observer=StopAt(20)).is_finished
    assert verify(tmp_path / "run") == []
    with lying(tmp_path / "run") as data:
        flow = data["series/outlet_flow"]
        values, digest = np.repeat(flow[...], 2, axis=1), flow.attrs["blake2b"]
        del data["series/outlet_flow"]
        data["series/outlet_flow"] = values
        data["series/outlet_flow"].attrs["blake2b"] = digest
        set_value(data, "series/outlet_flow", 0, values[0])
    findings = [one for one in verify(tmp_path / "run") if one.file.endswith("000000.h5")]
    assert len(findings) == 1
    assert "outlet_flow" in findings[0].message


def test_temperature_that_is_not_finite_is_refused(heated: Path, tmp_path: Path) -> None:
    """Only the walls may have no temperature."""
    file = tmp_path / "results.h5"
    shutil.copy(heated / "results.h5", file)
    with h5py.File(file, "r+") as data:
        assert np.isnan(data["walls/temperature"][:, 1]).all()
        set_value(data, "particles/temperature", 3, np.nan)
    assert "not finite" in verify(file)[0].message


def test_foreign_files_are_refused(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "foreign.h5", "w") as file:
        file["x"] = 1
    (tmp_path / "text.h5").write_text("hello")
    for name in ("foreign.h5", "text.h5"):
        with pytest.raises(DamagedRun, match=name):
            open_run(tmp_path / name)
        assert [finding.severity for finding in verify(tmp_path / name)] == ["error"]


def as_variable_length(node: h5py.HLObject, name: str) -> None:
    node.attrs[name] = node.attrs[name].decode()


def lose_one_digest(file: h5py.File) -> None:
    digests = json.loads(file.attrs["attribute_digests"])
    del digests["summary"]
    write_text(file, "attribute_digests", json.dumps(digests))


UNPROTECTED: dict[str, tuple[Callable[[h5py.File], None], str]] = {
    "text of variable length": (lambda file: as_variable_length(file, "run_id"), "fixed length"),
    "digests of variable length": (
        lambda file: as_variable_length(file, "attribute_digests"),
        "fixed length",
    ),
    "digest of variable length": (
        lambda file: as_variable_length(file["model/radius"], "blake2b"),
        "fixed length",
    ),
    "digest of the view of variable length": (
        lambda file: as_variable_length(file["VTKHDF"], "blake2b"),
        "fixed length",
    ),
    "texts without digests": (
        lambda file: file.attrs.__delitem__("attribute_digests"),
        "attribute_digests",
    ),
    "text without digest": (lose_one_digest, "summary"),
    "dataset without digest": (
        lambda file: file["model/radius"].attrs.__delitem__("blake2b"),
        "blake2b",
    ),
    "no view": (lambda file: file.__delitem__("VTKHDF"), "VTKHDF"),
}
"""What has no digest, or lies where HDF5 has no checksum and may search forever; and what the
message names."""


@pytest.mark.parametrize("what", UNPROTECTED)
def test_what_is_not_protected_is_refused(copy: Path, tmp_path: Path, what: str) -> None:
    alone = Path(shutil.copy(copy / "results.h5", tmp_path / "alone.h5"))
    change, named = UNPROTECTED[what]
    with h5py.File(alone, "r+") as file:
        change(file)
    assert [named in finding.message for finding in verify(alone)] == [True]


def hostile(change: str, file: h5py.File, elsewhere: Path) -> None:
    old = file["particles/angle"]
    rows, attributes = len(old), dict(old.attrs)
    del file["particles/angle"]
    if change == "huge":
        file.create_dataset("particles/angle", shape=(10**12,), dtype="f8", chunks=(10**4,))
    elif change == "type":
        file["particles/angle"] = np.zeros(rows, "i8")
    elif change == "rows":
        file["particles/angle"] = np.zeros(rows - 1)
    elif change == "shape":
        file["particles/angle"] = np.zeros((rows, 1))
    elif change == "group":
        file.create_group("particles/angle")
    elif change == "external":
        file["particles/angle"] = h5py.ExternalLink(str(elsewhere), "x")
    elif change == "soft":
        file["particles/angle"] = h5py.SoftLink("/particles/spin")
    elif change == "raw":
        file.create_dataset(
            "particles/angle", shape=(rows,), dtype="f8", external=[(str(elsewhere), 0, 8 * rows)]
        )
    elif change == "virtual":
        layout = h5py.VirtualLayout(shape=(rows,), dtype="f8")
        layout[:] = h5py.VirtualSource(str(elsewhere), "x", shape=(rows,))
        file.create_virtual_dataset("particles/angle", layout)
    if isinstance(file.get("particles/angle", getlink=True), h5py.HardLink):
        file["particles/angle"].attrs.update(attributes)


@pytest.mark.parametrize(
    "change",
    ["huge", "type", "rows", "shape", "group", "external", "soft", "raw", "virtual", "missing"],
)
def test_hostile_datasets_are_refused_before_memory_is_taken(
    copy: Path, tmp_path: Path, change: str
) -> None:
    with h5py.File(tmp_path / "elsewhere.h5", "w") as file:
        file["x"] = np.zeros(45)
    with h5py.File(copy / "results.h5", "r+") as file:
        hostile(change, file, tmp_path / "elsewhere.h5")
    with (
        pytest.raises(DamagedRun, match=r"particles/angle|particle_offset"),
        open_run(copy / "results.h5") as run,
    ):
        run.frames[0].angle  # noqa: B018
    assert len(verify(copy / "results.h5")) == 1


@pytest.mark.parametrize(
    "values", [[0, 5, 3, 15], [1, 5, 10, 15], [0, 5, 10, 10**9], [0, -5, 10, 15]]
)
def test_offsets_that_lie_are_refused(copy: Path, values: list[int]) -> None:
    with h5py.File(copy / "results.h5", "r+") as file:
        offsets = file["steps/particle_offset"]
        offsets[: len(values) - 1] = values[:-1]
        if values[-1] > 100:
            offsets[-1] = values[-1]
    with pytest.raises(DamagedRun, match="particle_offset"), open_run(copy / "results.h5") as run:
        run.frames[0].position  # noqa: B018


@pytest.mark.parametrize(
    ("path", "row", "value", "message"),
    [
        ("particles/spin", 3, np.nan, "not finite"),
        ("contacts/j", 0, 99, "shape that does not exist"),
        ("contacts/kind", 0, 1, "does not fit"),
        ("contacts/sliding", 0, 2, "outside 0"),
        ("steps/step", 3, 0, "does not ascend"),
        ("steps/stage", 0, 2, "outside 0"),
        ("particles/spin", 3, 0.5, "do not match their digest"),
    ],
)
def test_verify_finds_wrong_values_with_right_digests(
    copy: Path, path: str, row: int, value: float, message: str
) -> None:
    with h5py.File(copy / "results.h5", "r+") as file:
        set_value(file, path, row, value)
    findings = verify(copy / "results.h5")
    assert len(findings) == 1
    assert message in findings[0].message


def test_model_with_indices_out_of_range_is_refused(copy: Path) -> None:
    with h5py.File(copy / "results.h5", "r+") as file:
        set_value(file, "model/shapes/wall", 0, 5)
    with open_run(copy / "results.h5") as run, pytest.raises(DamagedRun, match="model/shapes/wall"):
        run.model  # noqa: B018


@pytest.mark.parametrize(("name", "value"), [("i", -1), ("i", 10**6), ("j", -3), ("j", 10**6)])
def test_contacts_of_shapes_that_do_not_exist_are_refused(
    name: str, value: int, copy: Path, tmp_path: Path
) -> None:
    alone = tmp_path / "elsewhere.h5"
    shutil.copy(copy / "results.h5", alone)
    with h5py.File(alone, "r+") as file:
        file[f"contacts/{name}"][:] = value
    with open_run(alone) as run:
        frame = next(frame for frame in run.frames if len(frame.contacts))
        with pytest.raises(DamagedRun, match=f"contacts/{name}"):
            getattr(frame.contacts, name)
