"""CSV files: grains, contacts and walls of each frame, a table of the frames, the time series.

Columns follow the table of the datasets (`store.schema`); their headings carry the units. Numbers
are written so that reading them gives the same bits.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli.export.target import choose_frames, new_directory
from multicor_cli.model.outlines import Outlines
from multicor_cli.store import Frame, Run, schema
from multicor_cli.store.frames import (
    NamedColumn,
    grain_columns,
    split,
    stored_columns,
    wall_columns,
)
from multicor_cli.store.layout import Progress, no_progress

FILE_NAMES = re.compile(r"(grains|contacts|walls)-\d{6,}\.csv|(frames|series|outlines)\.csv")
"""What the files are called."""


def export_csv(
    run: Run,
    path: Path,
    frames: slice | None = None,
    *,
    is_overwriting: bool = False,
    progress: Progress = no_progress,
) -> int:
    """Write the tables of a run into a new directory.

    Files are named by the number of the frame: ``grains-000012.csv``, ``contacts-…`` (where they
    are recorded), ``walls-…`` (where there are walls); ``frames.csv`` holds step, time and stage of
    each, ``series.csv`` the whole time series, and where not all grains are discs ``outlines.csv``
    the corners of their pieces. Gives the number of ``frames``, which are all by
    default; an export that is there is replaced only if ``is_overwriting``.

    Raises:
        ExportError: If there are no such frames.
        ExportRefused: If the directory may not be used.
        StoreError: If the run cannot be read, or the files not be written.
    """
    chosen = choose_frames(run, frames)
    with new_directory(path, FILE_NAMES, is_overwriting=is_overwriting) as directory:
        _write(directory / "frames.csv", _frame_columns(run, chosen))
        _write(directory / "series.csv", run.series_columns)
        if run.model.outlines is not None:
            _write(directory / "outlines.csv", _outline_columns(run.model.outlines))
        for number, frame in enumerate(chosen):
            tables = {"grains": grain_columns(frame)}
            if frame.contacts.recorded:
                tables["contacts"] = stored_columns(frame, schema.CONTACTS)
            if run.wall_names:
                tables["walls"] = wall_columns(frame)
            for kind, columns in tables.items():
                _write(directory / f"{kind}-{frame.index:06d}.csv", columns)
            progress(number + 1, len(chosen))
    return len(chosen)


def _frame_columns(run: Run, frames: Sequence[Frame]) -> list[NamedColumn]:
    index = [frame.index for frame in frames]
    columns = [NamedColumn("frame", "1", index)]
    for spec in run.rows(schema.STEPS):
        columns += split(spec, run.frames.column(spec.path)[index])
    stages = [run.stages[k] if 0 <= k < len(run.stages) else "" for k in run.frames.stage[index]]
    return [*columns, NamedColumn("stage_name", "1", stages)]


def _outline_columns(outlines: Outlines) -> list[NamedColumn]:
    """A row for each corner, with its grain and piece."""
    piece = np.arange(outlines.rounding.size).repeat(np.diff(outlines.start))
    grain = np.arange(outlines.area.size).repeat(np.diff(outlines.piece))[piece]
    return [
        NamedColumn("grain", "1", grain),
        NamedColumn("piece", "1", piece - outlines.piece[grain]),
        *(NamedColumn(name, "m", outlines.corner[:, axis]) for axis, name in enumerate("xy")),
        NamedColumn("rounding", "m", outlines.rounding[piece]),
    ]


def _write(path: Path, columns: list[NamedColumn]) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([column.heading for column in columns])
        writer.writerows(zip(*(_cells(column.values) for column in columns), strict=True))


def _cells(values: Sequence[Any] | NDArray[Any]) -> list[Any]:
    """Python's own numbers, whose text gives the same bits when read; nothing for nan."""
    if not isinstance(values, np.ndarray):
        return list(values)
    if values.dtype.kind != "f":
        return list(values.tolist())
    # Single-precision numbers have their own shortest text; as doubles they get more digits.
    cells = values.tolist() if values.dtype == np.float64 else [str(value) for value in values]
    for row in np.flatnonzero(np.isnan(values)):
        cells[row] = ""
    return list(cells)
