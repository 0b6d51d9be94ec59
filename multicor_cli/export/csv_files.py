"""CSV files: one table per frame of grains, contacts and walls, one of the frames, one of the time series.

Columns follow the table of the datasets (`store.schema`); their headings carry the units. Numbers are written so that reading
them gives the same bits.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli.export.selection import choose_frames
from multicor_cli.export.target import new_directory
from multicor_cli.store import Frame, Run, schema
from multicor_cli.store.progress import Progress, no_progress
from multicor_cli.store.schema import Dataset

FILE_NAMES = re.compile(r"(grains|contacts|walls)-\d{6,}\.csv|(frames|series)\.csv")
"""What the files are called."""

Column = tuple[str, Sequence[Any] | NDArray[Any]]


def export_csv(
    run: Run,
    path: Path,
    frames: slice | None = None,
    *,
    is_overwriting: bool = False,
    progress: Progress = no_progress,
) -> int:
    """Write the tables of a run into a new directory.

    Files are named by the number of the frame: ``grains-000012.csv``, ``contacts-…`` (where they are recorded), ``walls-…``
    (where there are walls); ``frames.csv`` holds step, time and stage of each, ``series.csv`` the whole time series.

    Args:
        run: The run.
        path: The directory.
        frames: Which frames; all by default.
        is_overwriting: Whether an export that is there may be replaced.
        progress: Is told how far it is.

    Returns:
        Number of frames.

    Raises:
        ExportError: If there are no such frames.
        ExportRefused: If the directory may not be used.
        StoreError: If the run cannot be read, or the files not be written.
    """
    chosen = choose_frames(run, frames)
    with new_directory(path, FILE_NAMES, is_overwriting=is_overwriting) as directory:
        _write(directory / "frames.csv", _frame_columns(run, chosen))
        _write(directory / "series.csv", _series_columns(run))
        for number, frame in enumerate(chosen):
            for kind, columns in _tables(run, frame):
                _write(directory / f"{kind}-{frame.index:06d}.csv", columns)
            progress(number + 1, len(chosen))
    return len(chosen)


def _tables(run: Run, frame: Frame) -> Iterable[tuple[str, list[Column]]]:
    """The tables of a frame."""
    yield "grains", _grain_columns(run, frame)
    if frame.contacts.recorded:
        yield "contacts", _columns_of(frame, run.rows(schema.CONTACTS))
    if run.wall_names:
        walls: list[Column] = [("wall", list(run.wall_names))]
        for spec in run.rows(schema.WALLS):
            walls += _split(spec, frame.column(spec.path)[0])
        yield "walls", walls


def _grain_columns(run: Run, frame: Frame) -> list[Column]:
    grains = frame.model.grains
    return [
        ("grain", frame.number),
        ("group", [run.model.groups[k] for k in grains.group]),
        ("material", [run.model.materials[k] for k in grains.material]),
        ("radius [m]", grains.radius),
        ("mass [kg]", grains.mass),
        *_columns_of(frame, run.rows(schema.PARTICLES), frame.number),
    ]


def _columns_of(frame: Frame, table: tuple[Dataset, ...], rows: NDArray[np.int64] | None = None) -> list[Column]:
    """The columns of a table as they are stored, or these rows of them."""
    found = ((spec, frame.column(spec.path)) for spec in table)
    return [column for spec, values in found for column in _split(spec, values if rows is None else values[rows])]


def _frame_columns(run: Run, frames: Sequence[Frame]) -> list[Column]:
    index = [frame.index for frame in frames]
    columns: list[Column] = [("frame", index)]
    for spec in run.rows(schema.STEPS):
        columns += _split(spec, run.frames.column(spec.path)[index])
    stages = [run.stages[k] if 0 <= k < len(run.stages) else "" for k in run.frames.stage[index]]
    return [*columns, ("stage_name", stages)]


def _series_columns(run: Run) -> list[Column]:
    columns: list[Column] = []
    for spec in run.rows(schema.SERIES):
        values = run.series[spec.name]
        if "outlet" in spec.dims:
            for number, outlet in enumerate(run.model.outlets or ()):
                columns += [(f"{outlet}: {heading}", column) for heading, column in _split(spec, values[:, number])]
            continue
        if "wall" not in spec.dims:
            columns += _split(spec, values)
            continue
        for number, wall in enumerate(run.wall_names):
            columns += [(f"{wall}: {heading}", column) for heading, column in _split(spec, values[:, number])]
    return columns


def _split(spec: Dataset, values: NDArray[Any]) -> list[Column]:
    """The columns of a dataset with their headings: name, and unit unless there is none."""
    names = spec.columns or (spec.name,)
    units = spec.unit.split(", ") * (1 if ", " in spec.unit else len(names))
    flat = values.reshape(len(values), int(np.prod(values.shape[1:])))
    return [
        (name if unit == "1" else f"{name} [{unit}]", flat[:, k]) for k, (name, unit) in enumerate(zip(names, units, strict=True))
    ]


def _write(path: Path, columns: list[Column]) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([heading for heading, _ in columns])
        writer.writerows(zip(*(_cells(values) for _, values in columns), strict=True))


def _cells(values: Sequence[Any] | NDArray[Any]) -> list[Any]:
    """Python's own numbers, whose text gives the same bits when read; nothing for nan."""
    if not isinstance(values, np.ndarray):
        return list(values)
    if values.dtype.kind != "f":
        return list(values.tolist())
    # A number of single precision has its own shortest text; as a double it would get digits that mean nothing.
    cells = values.tolist() if values.dtype == np.float64 else [str(value) for value in values]
    for row in np.flatnonzero(np.isnan(values)):
        cells[row] = ""
    return list(cells)
