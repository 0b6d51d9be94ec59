"""Frames and rows of the time series, committed as immutable segments that a manifest lists."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from multicor_cli.files import Unfit, read_regular
from multicor_cli.model import Model
from multicor_cli.model.books import Version
from multicor_cli.scenario.documents import Count
from multicor_cli.store import schema
from multicor_cli.store.atomic import (
    append_line,
    commit_bytes,
    described,
    kill_point,
    require_described,
    require_own,
    storage_errors,
)
from multicor_cli.store.documents import SIZE_LIMIT, document_line, parse_document, record_of
from multicor_cli.store.hdf5 import (
    Hdf5Writer,
    Precision,
    dtype_of,
    encode_strings,
    estimate_size,
    write_hdf5,
)
from multicor_cli.store.schema import Dataset
from multicor_cli.store.snapshot import Snapshot

# ---- What is stored of a moment: arrays by path of the schema

Columns = dict[str, NDArray[Any]]


def columns_of(table: tuple[Dataset, ...], moment: Snapshot) -> Columns:
    """Arrays of a table at a moment; a single value per frame or row has the shape ``(1, …)``."""
    columns = {}
    for row in table:
        if row.value is None:
            continue
        value = row.value(moment)
        values = encode_strings(list(value)) if row.dtype == "str" else np.asarray(value)
        is_single = row.row in ("frame", "series_row", "one") and row.dtype != "str"
        columns[row.path] = values[np.newaxis] if is_single else values
    return columns


# ---- `segments/MANIFEST.jsonl`: the segments that count, one line each; no others exist

MANIFEST = "MANIFEST.jsonl"


@dataclass(frozen=True)
class Segment:
    """An immutable file with a short range of frames and rows of the time series.

    Rows of particles and contacts are those of all its frames; steps are the first and the last
    of a frame or a row of the series; ``size`` is in bytes.
    """

    name: Annotated[str, Field(pattern=r"^[^/\x00]+\.h5$")]
    frames: Count
    particle_rows: Count
    contact_rows: Count
    series_rows: Count
    first_step: Count
    last_step: Count
    size: Count
    blake2b: str


def read_manifest(directory: Path) -> list[Segment]:
    """Segments of the manifest; a torn last line is none. Raises `DamagedRun`, `StorageError`."""
    path = directory / MANIFEST
    if not path.exists():
        return []
    with storage_errors(path):
        lines = read_regular(path, SIZE_LIMIT).split(b"\n")[:-1]
    places = (f"{path}, line {number}" for number in range(1, len(lines) + 1))
    return [
        record_of(Segment, parse_document(line, where), where)
        for line, where in zip(lines, places, strict=True)
    ]


def keep_segments(directory: Path, segments: list[Segment]) -> None:
    """Make the manifest list ``segments``, rename others to ``*.orphan``; raises `StorageError`."""
    data = b"".join(document_line(asdict(segment)) for segment in segments)
    path = directory / MANIFEST
    with storage_errors(path):
        try:
            before = read_regular(path, SIZE_LIMIT)
        except (FileNotFoundError, Unfit):
            before = None
    if before != data:
        commit_bytes(path, "manifest", data)
    keep = {segment.name for segment in segments}
    for file in sorted(directory.glob("*.h5")):
        if file.name in keep:
            continue
        with storage_errors(file):
            require_own(file)
            orphan, count = file.with_name(f"{file.name}.orphan"), 0
            while orphan.exists():
                count += 1
                orphan = file.with_name(f"{file.name}.{count}.orphan")
            file.rename(orphan)
        kill_point("orphan.mid")


def check_segment(directory: Path, segment: Segment) -> None:
    """Compare a segment file with its line; raises `DamagedRun` or `StorageError`."""
    require_described(directory / segment.name, segment.size, segment.blake2b, MANIFEST)


def segment_dims(segment: Segment) -> dict[str, int]:
    """Named lengths of the datasets in a segment, as its line in the manifest tells them."""
    return {
        "frame": segment.frames,
        "particle_row": segment.particle_rows,
        "contact_row": segment.contact_rows,
        "series_row": segment.series_rows,
    }


def model_dims(model: Model) -> dict[str, int]:
    """Named lengths of the datasets about walls and outlets."""
    return {"wall": model.wall_count, "outlet": len(model.outlets or ())}


# ---- Writing segments

FILETYPE = "multicor-segment"
FRAME_LIMIT = 64
"""Most frames in a segment."""
BYTE_LIMIT = 64 << 20
"""A segment is committed as soon as it holds this much (one frame may be larger) [bytes]."""

_FRAME_ROWS = schema.STEPS + schema.PARTICLES + schema.CONTACTS + schema.WALLS


class FrameWriter:
    """Collects frames and rows of the time series of a run and commits them as segments.

    Args:
        precision: How datasets of type ``float`` are stored.
        version: Version of the file format in which the run was begun.
        committed: Segments committed before.
        last_steps: Steps of the last frame and the last row of the series in them; -1 if none.

    Attributes:
        segments: Committed segments.
        last_frame_step: Step of the last frame, -1 if there is none.
        last_series_step: Step of the last row of the series, -1 if there is none.
        frame_table: What is stored of a frame, its offsets apart.
        series_table: What is stored of a row of the time series.
    """

    def __init__(
        self,
        directory: Path,
        run_id: str,
        model: Model,
        *,
        precision: Precision = "double",
        version: Version = schema.FORMAT_VERSION,
        committed: Iterable[Segment] = (),
        last_steps: tuple[int, int] = (-1, -1),
    ) -> None:
        self._directory, self._run_id = directory, run_id
        self._precision, self._version = precision, version
        self.model = model
        self._dims = model_dims(model) | {
            "particle_row": model.grain_count, "frame": 1, "series_row": 1,
        }  # fmt: skip
        self._features = schema.features_of(model)
        self.frame_table = schema.select(_FRAME_ROWS, self._features, version)
        self.series_table = schema.select(schema.SERIES, self._features, version)
        self._table = schema.select(schema.SEGMENT_TABLE, self._features, version)
        self.segments = list(committed)
        self.last_frame_step, self.last_series_step = last_steps
        self._frames: list[Columns] = []
        self._rows: list[Columns] = []
        self._bytes = 0

    def frame(self, moment: Snapshot) -> None:
        """Add a frame of a moment (arrays are copied).

        Raises:
            ValueError: If a value is not finite, a shape wrong, or the step not after the last.
            StorageFull: If a segment is due and there is no space for it.
            StorageError: If it cannot be written.
        """
        step = moment.state.step
        if step <= self.last_frame_step:
            raise ValueError(f"frame at step {step} after one at step {self.last_frame_step}")
        columns = columns_of(self.frame_table, moment)
        self._check_contacts(columns, step)
        self.copy_frame(self._stored(self.frame_table, columns, f"frame at step {step}"))

    def series_row(self, moment: Snapshot) -> None:
        """Add the row that ends a window, which the caller then clears; raises as `frame` does.

        A window without steps (the row at the start of a run) has means, rates and forces of zero.
        """
        step = moment.state.step
        if step <= self.last_series_step:
            raise ValueError(
                f"row of the time series at step {step} after one at step {self.last_series_step}"
            )
        columns = columns_of(self.series_table, moment)
        self.copy_series(self._stored(self.series_table, columns, f"time series at step {step}"))

    def copy_frame(self, columns: Columns) -> None:
        """Add a frame as stored before, by path; raises `StorageFull` or `StorageError`."""
        self.last_frame_step = int(columns["steps/step"][0])
        self._frames.append(columns)
        self._grow(columns)

    def copy_series(self, columns: Columns) -> None:
        """Add rows of the time series as they were stored before; raises as `copy_frame`."""
        self.last_series_step = int(columns["series/step"][-1])
        self._rows.append(columns)
        self._grow(columns)

    def flush(self) -> None:
        """Commit what is pending, or keep it: raises `StorageFull`, `StorageError`, `RunLocked`."""
        if not self._frames and not self._rows:
            return
        path = self._directory / f"{len(self.segments):06d}.h5"
        features = sorted(self._features)
        attributes = {"filetype": FILETYPE, "run_id": self._run_id, "features": features}
        size = estimate_size(self._table, self._bytes)
        write_hdf5(
            path,
            "segment",
            attributes,
            self._fill,
            size=size,
            table=self._table,
            precision=self._precision,
            version=self._version,
        )
        segment = self._describe(path)
        append_line(self._directory / MANIFEST, "manifest", document_line(asdict(segment)))
        self.segments.append(segment)
        self._frames, self._rows, self._bytes = [], [], 0

    def _grow(self, columns: Columns) -> None:
        self._bytes += sum(values.nbytes for values in columns.values()) + 16
        if len(self._frames) >= FRAME_LIMIT or self._bytes >= BYTE_LIMIT:
            self.flush()

    def _stored(self, specs: tuple[Dataset, ...], columns: Columns, where: str) -> Columns:
        """Copies of columns, in the types in which they are stored."""
        dims, found = dict(self._dims), {}
        for spec in specs:
            values = columns[spec.path]
            dims.setdefault(str(spec.row), len(values))
            if values.shape != (expected := spec.shape(dims)):
                raise ValueError(
                    f"{where}: {spec.path} has shape {values.shape}, expected {expected}"
                )
            copy = np.array(values, dtype=dtype_of(spec, self._precision), order="C")
            if spec.finite and copy.dtype.kind == "f" and not np.isfinite(copy).all():
                row = int(np.argwhere(~np.isfinite(copy))[0][0])
                raise ValueError(f"{where}: {spec.path} is not finite in row {row}")
            found[spec.path] = copy
        return found

    def _check_contacts(self, columns: Columns, step: int) -> None:
        i, j = np.asarray(columns["contacts/i"]), np.asarray(columns["contacts/j"])
        n, shapes = self.model.grain_count, self.model.shape_count
        if (
            i.shape == j.shape
            and i.size
            and not ((i >= 0) & (i < n) & (j > i) & (j < n + shapes)).all()
        ):
            raise ValueError(f"frame at step {step}: a contact names a shape that does not exist")

    def _fill(self, writer: Hdf5Writer) -> None:
        for spec in self._table:
            if spec in schema.OFFSETS:
                counts = [len(frame[schema.COUNTED[spec.path]]) for frame in self._frames]
                writer.write(spec, np.concatenate([[0], np.cumsum(counts)]).astype(np.int64))
                continue
            pieces = self._rows if spec in self.series_table else self._frames
            none = np.empty((0, *spec.shape(self._dims)[1:]), dtype_of(spec, self._precision))
            writer.write(spec, np.concatenate([none, *(piece[spec.path] for piece in pieces)]))

    def _describe(self, path: Path) -> Segment:
        steps = [int(frame["steps/step"][0]) for frame in self._frames]
        steps += [step for rows in self._rows for step in rows["series/step"].tolist()]
        return Segment(
            name=path.name,
            frames=len(self._frames),
            particle_rows=sum(len(frame["particles/angle"]) for frame in self._frames),
            contact_rows=sum(len(frame["contacts/gap"]) for frame in self._frames),
            series_rows=sum(len(rows["series/step"]) for rows in self._rows),
            first_step=min(steps),
            last_step=max(steps),
            **described(path),
        )
