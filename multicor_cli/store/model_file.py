"""`model.Model` to and from datasets: ``model.h5`` while a run goes on, ``/model`` in ``results.h5`` afterwards."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model import ContactLaws, Grains, Model, ShapeKind, State, Thermal, Walls, WallShapes
from multicor_cli.model.faults import LARGEST
from multicor_cli.store import schema
from multicor_cli.store.errors import DamagedRun
from multicor_cli.store.hdf5 import CheckedFile, Hdf5Writer, dtype_of, estimate_size, write_hdf5
from multicor_cli.store.segments import columns_of
from multicor_cli.store.snapshot import Snapshot

Arrays = dict[str, NDArray[Any]]

FILETYPE = "multicor-model"


def model_columns(model: Model) -> Arrays:
    """Arrays of a model by path of ``schema.MODEL``, in the order of that table, as far as the model has them."""
    table = schema.select(schema.MODEL, schema.features_of(model))
    columns = columns_of(table, Snapshot(State(), model))
    return {spec.path: _as_stored(spec, columns[spec.path]) for spec in table}


def _as_stored(spec: schema.Dataset, values: NDArray[Any]) -> NDArray[Any]:
    return values if spec.dtype == "str" else np.ascontiguousarray(values, dtype=dtype_of(spec, "double"))


_THERMAL = ("capacity", "start", "surface")


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
        write_model_into(writer, columns)

    attributes = {
        "filetype": FILETYPE,
        "run_id": run_id,
        "features": sorted(schema.features_of(model)),
        "model_digest": model_digest(model),
    }
    size = estimate_size(schema.MODEL, sum(values.nbytes for values in columns.values()))
    write_hdf5(path, "model", attributes, fill, size=size, verify=_verify)


def write_model_into(writer: Hdf5Writer, columns: Arrays) -> None:
    """Write the arrays of `model_columns` into an open file."""
    for spec in schema.MODEL:
        if spec.path in columns:
            writer.write(spec, columns[spec.path])


def _verify(path: Path, digests: dict[str, str]) -> None:
    with CheckedFile(path, FILETYPE) as file:
        file.check_written(filter(file.has, schema.MODEL), digests)


def load_model(path: Path, run_id: str | None = None) -> Model:
    """Read and check ``model.h5``; raises `DamagedRun` or `StorageError`."""
    with CheckedFile(path, FILETYPE, run_id=run_id) as file:
        model = read_model(file)
        if file.text("model_digest") != model_digest(model):
            raise DamagedRun(f"{path}: the model does not match its digest")
    return model


def read_model(file: CheckedFile) -> Model:
    """The model in an open ``model.h5`` or ``results.h5``, with its indices checked; raises `DamagedRun`."""
    specs = filter(file.has, schema.MODEL)
    data = {spec.path.removeprefix("model/"): _read(file, spec) for spec in specs}
    model = Model(
        grains=Grains(data["radius"], data["mass"], data["inertia"], data["material"], data["group"]),
        shapes=WallShapes(data["shapes/kind"], data["shapes/wall"], data["shapes/geometry"], data["shapes/material"]),
        walls=Walls(
            tuple(data["walls/names"]),
            data["walls/mass"],
            data["walls/inertia"],
            data["walls/has_gravity"].astype(np.bool_),
            data["walls/length"],
            **{name: data[f"walls/{name}"].astype(np.bool_) for name in ("runs", "meets") if f"walls/{name}" in data},
        ),
        laws=ContactLaws(**{name: data[f"laws/{name}"] for name in ContactLaws._fields if f"laws/{name}" in data}),
        materials=tuple(data["material_names"]),
        groups=tuple(data["group_names"]),
        period=float(data["period"][0]),
        gravity=data["gravity"],
        shape_factor=float(data["shape_factor"][0]),
        thermal=_thermal(data),
        outlets=tuple(data["outlets"]) if "outlets" in data else None,
        start_speed=float(data["start_speed"][0]) if "start_speed" in data else 0.0,
    )
    _check_model(model, file.path)
    return model


def _thermal(data: dict[str, Any]) -> Thermal | None:
    return Thermal(*(data[f"thermal/{name}"] for name in _THERMAL)) if "thermal/capacity" in data else None


def _read(file: CheckedFile, spec: schema.Dataset) -> Any:
    if spec.dtype == "str":
        return file.strings(spec)
    values = file.read(spec)
    if spec.finite and values.dtype.kind == "f" and not np.isfinite(values).all():
        raise DamagedRun(f"{file.path}: {spec.path} holds a value that is not finite")
    return values


def _check_model(model: Model, path: Path) -> None:
    kinds = len(ShapeKind)
    materials, start = len(model.materials), model.laws.table_start
    checks = {
        "model/material": _within(model.grains.material, materials),
        "model/group": _within(model.grains.group, len(model.groups)),
        "model/shapes/kind": _within(model.shapes.kind, kinds),
        "model/shapes/wall": _within(model.shapes.wall, model.wall_count),
        "model/shapes/material": _within(model.shapes.material, materials),
        "model/laws/table": _within(model.laws.table + 1, start.size),
        "model/laws/table_start": bool(start[0] == 0 and (np.diff(start) >= 0).all() and start[-1] == model.laws.table_speed.size),
        "model/radius": _between(model.grains.radius, 1.0 / LARGEST, LARGEST),
        "model/thermal/capacity": model.thermal is None or bool((model.thermal.capacity > 0.0).all()),
    }
    for name, is_right in checks.items():
        if not is_right:
            raise DamagedRun(f"{path}: {name} holds values out of range")


def _between(values: NDArray[Any], low: float, high: float) -> bool:
    return bool(((values >= low) & (values <= high)).all())


def _within(values: NDArray[Any], count: int) -> bool:
    return bool(((values >= 0) & (values < count)).all())
