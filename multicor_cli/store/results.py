"""The model of a run in its file, and ``results.h5``: all segments of a finished run, verified."""

from __future__ import annotations

import hashlib
import math
from collections import Counter
from collections.abc import Mapping, Sequence, Set
from dataclasses import fields
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
from multicor_cli.model.outlines import Outlines
from multicor_cli.model.state import LARGEST
from multicor_cli.store import schema
from multicor_cli.store.atomic import described
from multicor_cli.store.documents import Document, ResultsDocument, record_of
from multicor_cli.store.errors import DamagedRun
from multicor_cli.store.hdf5 import (
    CheckedFile,
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
from multicor_cli.store.segments import Segment, check_segment, columns_of, model_dims, segment_dims
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
    attributes = {
        "filetype": MODEL_FILETYPE,
        "run_id": run_id,
        "features": sorted(schema.features_of(model)),
        "model_digest": model_digest(model),
    }
    size = estimate_size(schema.MODEL, sum(values.nbytes for values in columns.values()))
    write_hdf5(
        path,
        "model",
        attributes,
        lambda writer: writer.write_table(schema.MODEL, columns),
        size=size,
        table=schema.MODEL,
    )


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
    flags = {
        name: data[f"walls/{name}"].astype(np.bool_)
        for name in ("has_gravity", "runs", "meets")
        if f"walls/{name}" in data
    }
    model = Model(
        grains=Grains(*(data[field.name] for field in fields(Grains))),
        shapes=WallShapes(*(data[f"shapes/{field.name}"] for field in fields(WallShapes))),
        walls=Walls(
            names=tuple(data["walls/names"]),
            **{name: data[f"walls/{name}"] for name in ("mass", "inertia", "length")},
            **flags,
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
        height=float(data["height"][0]) if "height" in data else 0.0,
        expansion=data.get("expansion", np.zeros(0)),
        sheds=bool(data.get("sheds", np.zeros(1))[0]),
        outlines=Outlines(*(data[f"outlines/{name}"] for name in Outlines._fields))
        if "outlines/piece" in data
        else None,
        heat_gradient=tuple(data.get("heat_gradient", np.zeros(2)).tolist()),
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


_SLACK = 1e-9  # of the radius of a grain, by which its outline may reach beyond it


def _check_model(model: Model, path: Path) -> None:
    grains, shapes, laws = model.grains, model.shapes, model.laws
    materials, start = len(model.materials), laws.table_start
    indices = {
        "model/material": (grains.material, materials),
        "model/group": (grains.group, len(model.groups)),
        "model/shapes/kind": (shapes.kind, len(ShapeKind)),
        "model/shapes/wall": (shapes.wall, model.wall_count),
        "model/shapes/material": (shapes.material, materials),
        "model/laws/table": (laws.table + 1, start.size),
    }
    is_right = {
        **{name: (values >= 0) & (values < count) for name, (values, count) in indices.items()},
        "model/laws/table_start": np.diff(start, prepend=0, append=laws.table_speed.size) >= 0,
        "model/radius": (grains.radius >= 1.0 / LARGEST) & (grains.radius <= LARGEST),
        "model/thermal/capacity": np.ones(1)
        if model.thermal is None
        else model.thermal.capacity > 0.0,
        "model/height": np.array(
            [not model.is_cell or (model.wall_count, model.shape_count) == (1, 0)]
        ),
        "model/heat_gradient": np.array(
            [not any(model.heat_gradient) or (model.is_cell and model.thermal is not None)]
        ),
    }
    if model.outlines is not None:
        fits = model.outlines.fit(model.grain_count)
        # Neighbors are sought within radii
        reach = model.outlines.radius if fits else grains.radius
        is_right["model/outlines"] = np.array([fits])
        is_right["model/outlines/corner"] = np.abs(reach - grains.radius) <= _SLACK * grains.radius
    for name, found in is_right.items():
        if not found.all():
            raise DamagedRun(f"{path}: {name} holds values out of range")


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
    constant = {path: encode_strings(list(texts)) for path, texts in scenario.items()}
    constant |= model_columns(model)
    features = schema.features_of(model)
    table = schema.select(schema.SEGMENT_TABLE, features, version)
    rows = Counter[str]()
    for segment in segments:
        rows.update(segment_dims(segment))
    lengths = rows | model_dims(model)  # none of the rows where there is no segment
    shapes = {spec: spec.shape(lengths) for spec in table if spec not in schema.OFFSETS}

    def fill(writer: Hdf5Writer) -> None:
        writer.write_table(schema.SCENARIO + schema.MODEL, constant)
        streams = {spec: writer.stream(spec, shape) for spec, shape in shapes.items()}
        counts = {spec: [np.zeros(1, np.int64)] for spec in schema.OFFSETS}
        for segment in segments:
            check_segment(directory, segment)
            dims = segment_dims(segment) | model_dims(model)
            file_path = directory / segment.name
            with CheckedFile(file_path, SEGMENT_FILETYPE, run_id=run_id, dims=dims) as file:
                check_features(file, features)
                for spec, stream in streams.items():
                    for block in file.blocks(spec):
                        stream.append(block)
                for spec, parts in counts.items():
                    parts.append(np.diff(read_offsets(file, spec)))
        for spec, stream in streams.items():
            writer.finish(spec, stream)
        for spec, parts in counts.items():
            writer.write(spec, np.cumsum(np.concatenate(parts)))
        write_view(writer.file, model)

    size = sum(values.nbytes for values in constant.values()) + 16 * (rows["frame"] + 1)
    size += sum(math.prod(shapes[s]) * dtype_of(s, precision).itemsize for s in shapes)
    view = estimate_view(rows["frame"], rows["contact_row"], model)
    digests = write_hdf5(
        path,
        "results",
        {
            "filetype": FILETYPE,
            "run_id": run_id,
            "features": sorted(features),
            "precision": precision,
            "data_digest": "",
            **attributes,
        },
        fill,
        size=estimate_size(schema.RESULTS_TABLE, size) + view,
        table=schema.RESULTS_TABLE,
        precision=precision,
        version=version,
        compress_integers=True,
        verify=check_view,
        read_only=False,
    )
    link_view(path.parent)
    return {**described(path), "data_digest": data_digest(digests), "frames": rows["frame"]}


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
    """Refuse a file that has other features than its run; raises `DamagedRun`.

    Those of which its version knows nothing do not count.
    """
    known = {spec.only_with for spec in schema.RESULTS_TABLE if spec.since <= file.version}
    if file.features & known != features & known:
        raise DamagedRun(
            f"{file.path}: has the features {sorted(file.features)}, its model {sorted(features)}"
        )


def read_offsets(file: CheckedFile, spec: Dataset) -> NDArray[np.int64]:
    """Offsets of the frames, checked against the number of rows; raises `DamagedRun`."""
    rows = file.dataset(schema.DATASETS[schema.COUNTED[spec.path]]).shape[0]
    values: NDArray[np.int64] = file.read(spec)
    if not values.size or values[0] != 0 or values[-1] != rows or (np.diff(values) < 0).any():
        raise DamagedRun(f"{file.path}: {spec.path} does not fit {rows} rows")
    return values
