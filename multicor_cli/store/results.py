"""The model of a run in its file, and ``results.h5``: all segments of a finished run, verified."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence, Set
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model import (
    ContactLaws,
    Grains,
    Model,
    ShapeKind,
    State,
    Thermal,
    Walls,
    WallShapes,
)
from multicor_cli.model.books import Version
from multicor_cli.model.faults import LARGEST
from multicor_cli.store import schema
from multicor_cli.store.atomic import file_digest
from multicor_cli.store.documents import Document, ResultsDocument, record_of
from multicor_cli.store.errors import DamagedRun
from multicor_cli.store.hdf5 import (
    CheckedFile,
    DatasetStream,
    Hdf5Writer,
    Precision,
    data_digest,
    dtype_of,
    encode_strings,
    estimate_size,
    write_hdf5,
)
from multicor_cli.store.schema import Dataset
from multicor_cli.store.segments import FILETYPE as SEGMENT_FILETYPE
from multicor_cli.store.segments import Segment, check_segment, columns_of
from multicor_cli.store.snapshot import Snapshot
from multicor_cli.store.vtkhdf import check_view, estimate_view, link_view, write_view

# ---- The model: ``model.h5`` while a run goes on, ``/model`` in ``results.h5`` afterwards

Arrays = dict[str, NDArray[Any]]

MODEL_FILETYPE = "multicor-model"
_THERMAL = ("capacity", "start", "surface")


def model_columns(model: Model) -> Arrays:
    """Arrays of a model by path of ``schema.MODEL``, in the order of that table."""
    table = schema.select(schema.MODEL, schema.features_of(model))
    columns = columns_of(table, Snapshot(State(), model))
    return {
        s.path: columns[s.path]
        if s.dtype == "str"
        else np.ascontiguousarray(columns[s.path], dtype_of(s, "double"))
        for s in table
    }


def model_digest(model: Model) -> str:
    """BLAKE2b digest over all arrays of a model; equal models have equal digests."""
    total = hashlib.blake2b(digest_size=16)
    for path, values in model_columns(model).items():
        total.update(f"{path} {values.dtype.str} {values.shape}\n".encode())
        total.update(np.ascontiguousarray(values).tobytes())
    return total.hexdigest()


def write_model(path: Path, model: Model, run_id: str) -> None:
    """Commit ``model.h5``; raises `StorageFull` or `StorageError`."""
    columns = model_columns(model)

    def fill(writer: Hdf5Writer) -> None:
        for spec in schema.MODEL:
            if spec.path in columns:
                writer.write(spec, columns[spec.path])

    attributes = {
        "filetype": MODEL_FILETYPE,
        "run_id": run_id,
        "features": sorted(schema.features_of(model)),
        "model_digest": model_digest(model),
    }
    size = estimate_size(schema.MODEL, sum(values.nbytes for values in columns.values()))
    write_hdf5(path, "model", attributes, fill, size=size, verify=_verify_model)


def _verify_model(path: Path, digests: dict[str, str]) -> None:
    with CheckedFile(path, MODEL_FILETYPE) as file:
        file.check_written(filter(file.has, schema.MODEL), digests)


def load_model(path: Path, run_id: str | None = None) -> Model:
    """Read and check ``model.h5``; raises `DamagedRun` or `StorageError`."""
    with CheckedFile(path, MODEL_FILETYPE, run_id=run_id) as file:
        model = read_model(file)
        if file.text("model_digest") != model_digest(model):
            raise DamagedRun(f"{path}: the model does not match its digest")
    return model


def read_model(file: CheckedFile) -> Model:
    """The model in an open ``model.h5`` or ``results.h5``, indices checked; raises `DamagedRun`."""
    specs = filter(file.has, schema.MODEL)
    data = {spec.path.removeprefix("model/"): _read(file, spec) for spec in specs}
    model = Model(
        grains=Grains(
            data["radius"], data["mass"], data["inertia"], data["material"], data["group"]
        ),
        shapes=WallShapes(
            data["shapes/kind"],
            data["shapes/wall"],
            data["shapes/geometry"],
            data["shapes/material"],
        ),
        walls=Walls(
            tuple(data["walls/names"]),
            data["walls/mass"],
            data["walls/inertia"],
            data["walls/has_gravity"].astype(np.bool_),
            data["walls/length"],
            **{
                name: data[f"walls/{name}"].astype(np.bool_)
                for name in ("runs", "meets")
                if f"walls/{name}" in data
            },
        ),
        laws=ContactLaws(
            **{name: data[f"laws/{name}"] for name in ContactLaws._fields if f"laws/{name}" in data}
        ),
        materials=tuple(data["material_names"]),
        groups=tuple(data["group_names"]),
        period=float(data["period"][0]),
        gravity=data["gravity"],
        shape_factor=float(data["shape_factor"][0]),
        thermal=Thermal(*(data[f"thermal/{name}"] for name in _THERMAL))
        if "thermal/capacity" in data
        else None,
        outlets=tuple(data["outlets"]) if "outlets" in data else None,
        start_speed=float(data["start_speed"][0]) if "start_speed" in data else 0.0,
    )
    _check_model(model, file.path)
    return model


def _read(file: CheckedFile, spec: schema.Dataset) -> Any:
    if spec.dtype == "str":
        return file.strings(spec)
    values = file.read(spec)
    if spec.finite and values.dtype.kind == "f" and not np.isfinite(values).all():
        raise DamagedRun(f"{file.path}: {spec.path} holds a value that is not finite")
    return values


def _check_model(model: Model, path: Path) -> None:
    materials, start = len(model.materials), model.laws.table_start
    checks = {
        "model/material": _within(model.grains.material, materials),
        "model/group": _within(model.grains.group, len(model.groups)),
        "model/shapes/kind": _within(model.shapes.kind, len(ShapeKind)),
        "model/shapes/wall": _within(model.shapes.wall, model.wall_count),
        "model/shapes/material": _within(model.shapes.material, materials),
        "model/laws/table": _within(model.laws.table + 1, start.size),
        "model/laws/table_start": bool(
            start[0] == 0
            and (np.diff(start) >= 0).all()
            and start[-1] == model.laws.table_speed.size
        ),
        "model/radius": bool(
            ((model.grains.radius >= 1.0 / LARGEST) & (model.grains.radius <= LARGEST)).all()
        ),
        "model/thermal/capacity": model.thermal is None
        or bool((model.thermal.capacity > 0.0).all()),
    }
    for name, is_right in checks.items():
        if not is_right:
            raise DamagedRun(f"{path}: {name} holds values out of range")


def _within(values: NDArray[Any], count: int) -> bool:
    return bool(((values >= 0) & (values < count)).all())


# ---- All segments in one file

FILETYPE = "multicor-results"


def write_results(
    path: Path,
    directory: Path,
    segments: Sequence[Segment],
    model: Model,
    scenario: Mapping[str, Sequence[str]],
    *,
    run_id: str,
    attributes: Mapping[str, Any],
    precision: Precision,
    version: Version,
) -> Document:
    """Merge segments into one file, one in memory at a time; gives its size, digests and frames.

    ``scenario`` has texts by path of ``schema.SCENARIO``; ``attributes`` are more root attributes.
    Raises `DamagedRun` if a segment does not match its digest, or the file is not as it was
    written; `StorageFull` if there is no room for it beside the segments; `StorageError`.
    """
    merger = _Merger(directory, segments, model, scenario, run_id, precision, version)
    root = {
        "filetype": FILETYPE,
        "run_id": run_id,
        "features": sorted(merger.features),
        "precision": precision,
        "data_digest": "",
        **attributes,
    }
    digests = write_hdf5(
        path,
        "results",
        root,
        merger.fill,
        size=estimate_size(schema.RESULTS_TABLE, merger.bytes) + merger.view_bytes,
        precision=precision,
        version=version,
        compress_integers=True,
        verify=_verify_results,
        read_only=False,
    )
    link_view(path.parent)
    return {
        "size": path.stat().st_size,
        "data_digest": data_digest(digests),
        "blake2b": file_digest(path),
        "frames": merger.rows["frame"],
    }


def _verify_results(path: Path, digests: dict[str, str]) -> None:
    with CheckedFile(path, FILETYPE) as file:
        file.check_written(filter(file.has, schema.RESULTS_TABLE), digests)
    check_view(path)


class _Merger:
    def __init__(
        self,
        directory: Path,
        segments: Sequence[Segment],
        model: Model,
        scenario: Mapping[str, Sequence[str]],
        run_id: str,
        precision: Precision,
        version: Version,
    ) -> None:
        self._directory, self._segments, self._run_id = directory, segments, run_id
        self._scenario = {path: encode_strings(list(texts)) for path, texts in scenario.items()}
        self._full_model = model
        self._model = model_columns(model)
        self._lengths = {"wall": model.wall_count, "outlet": len(model.outlets or ())}
        self.features = schema.features_of(model)
        self._table = tuple(
            s
            for s in schema.select(schema.SEGMENT_TABLE, self.features, version)
            if s not in schema.OFFSETS
        )
        self.rows = {
            "frame": sum(s.frames for s in segments),
            "particle_row": sum(s.particle_rows for s in segments),
            "contact_row": sum(s.contact_rows for s in segments),
            "series_row": sum(s.series_rows for s in segments),
        }
        constant = sum(
            values.nbytes for values in [*self._scenario.values(), *self._model.values()]
        )
        rows = sum(
            int(np.prod(self._shape(s), dtype=np.int64)) * dtype_of(s, precision).itemsize
            for s in self._table
        )
        self.bytes = constant + rows + 16 * (self.rows["frame"] + 1)
        self.view_bytes = estimate_view(self.rows["frame"], self.rows["contact_row"])

    def fill(self, writer: Hdf5Writer) -> None:
        constant = self._scenario | self._model
        for spec in schema.SCENARIO + schema.MODEL:
            if spec.path in constant:
                writer.write(spec, constant[spec.path])
        streams = {spec: writer.stream(spec, self._shape(spec)) for spec in self._table}
        counts: dict[Dataset, list[NDArray[np.int64]]] = {
            spec: [np.zeros(1, np.int64)] for spec in schema.OFFSETS
        }
        for segment in self._segments:
            self._copy(segment, streams, counts)
        for spec, stream in streams.items():
            writer.finish(spec, stream)
        for spec, parts in counts.items():
            writer.write(spec, np.cumsum(np.concatenate(parts)))
        write_view(writer.file, self._full_model)

    def _copy(
        self,
        segment: Segment,
        streams: dict[Dataset, DatasetStream],
        counts: dict[Dataset, list[NDArray[np.int64]]],
    ) -> None:
        check_segment(self._directory, segment)
        dims = segment_dims(segment) | self._lengths
        with CheckedFile(
            self._directory / segment.name, SEGMENT_FILETYPE, run_id=self._run_id, dims=dims
        ) as file:
            check_features(file, self.features)
            for spec, stream in streams.items():
                for block in file.blocks(spec):
                    stream.append(block)
            for spec, parts in counts.items():
                rows = (
                    segment.particle_rows
                    if spec.name == "particle_offset"
                    else segment.contact_rows
                )
                parts.append(np.diff(read_offsets(file, spec, rows)))

    def _shape(self, spec: Dataset) -> tuple[int, ...]:
        lengths = {**self.rows, **self._lengths}
        return tuple(d if isinstance(d, int) else lengths[d] for d in spec.dims)


def read_description(file: CheckedFile) -> Document:
    """What ``results.h5`` says of its run beside the data, checked; raises `DamagedRun`."""
    later = filter(file.has_text, ("stage_ends", "origin", "steering"))
    found = {
        "status": file.text("status"),
        **{name: file.json(name) for name in ("provenance", "summary", *later)},
    }
    record_of(ResultsDocument, found, file.path)
    return found


def check_features(file: CheckedFile, features: Set[str]) -> None:
    """Refuse a file that has other features than its run; raises `DamagedRun`."""
    known = {spec.only_with for spec in schema.RESULTS_TABLE}
    if file.features & known != features & known:
        raise DamagedRun(
            f"{file.path}: has the features {sorted(file.features)}, its model {sorted(features)}"
        )


def segment_dims(segment: Segment) -> dict[str, int]:
    """Named lengths of the datasets in a segment, as its line in the manifest tells them."""
    return {
        "frame": segment.frames,
        "particle_row": segment.particle_rows,
        "contact_row": segment.contact_rows,
        "series_row": segment.series_rows,
    }


def read_offsets(file: CheckedFile, spec: Dataset, rows: int) -> NDArray[np.int64]:
    """Offsets of the frames, checked against the number of rows; raises `DamagedRun`."""
    values: NDArray[np.int64] = file.read(spec)
    if not values.size or values[0] != 0 or values[-1] != rows or (np.diff(values) < 0).any():
        raise DamagedRun(f"{file.path}: {spec.path} does not fit {rows} rows")
    return values
