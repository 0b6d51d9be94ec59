"""``/VTKHDF`` in ``results.h5``: a view of the frames for ParaView, made of links to the data.

Each step is one piece of PolyData: the grains are points, the contacts are lines. A contact with a
wall, or one across the period, has no second grain next to it; its line ends in a point of its own,
appended to the grains of the step. Where not all grains are discs, lines lead from center to center
through the point of contact, which is appended too. These points, and which points the lines join,
are all that is stored here. Everything else is a link, or a virtual dataset that maps the rows of
grains and contacts to where VTK expects them and gives the appended points a fill value. There is
equal room for the points of every step, of which a step uses as much as it needs: then one mapping
does for all steps.

A step without contacts gets one line from grain 0 to itself: several versions of VTK misread the
step after one without cells.
"""

from __future__ import annotations

import contextlib
import hashlib
import itertools
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np
from numpy.typing import NDArray

from multicor_cli.files import regular_path
from multicor_cli.model import Model, Presence
from multicor_cli.store import layout, schema
from multicor_cli.store.atomic import remove_own, require_own
from multicor_cli.store.errors import DamagedRun
from multicor_cli.store.hdf5 import Chunked, read_text, reading, write_text
from multicor_cli.store.schema import Dataset

# ---- Which points the lines join in the view: contacts as lines, a block of frames at a time

CHUNK_ROWS = 1 << 14

BLOCK_ROWS = 1 << 18
"""Rows of grains and contacts that are looked at together."""

Indices = NDArray[np.int64]


class Growing(Chunked):
    """A dataset whose length is known only in the end."""

    def __init__(self, file: h5py.Group, path: str, dtype: Any, *tail: int) -> None:
        super().__init__(CHUNK_ROWS)
        self._dataset = file.create_dataset(
            path, (0, *tail), dtype, maxshape=(None, *tail), chunks=(CHUNK_ROWS, *tail),
            shuffle=True, compression="gzip", compression_opts=1, fletcher32=True,
        )  # fmt: skip

    def close(self) -> None:
        self._write(self._count)

    def _store(self, rows: NDArray[Any]) -> None:
        start = len(self._dataset)
        self._dataset.resize(start + len(rows), axis=0)
        self._dataset[start:] = rows


def frame_blocks(sizes: Indices) -> Iterator[tuple[int, int]]:
    """Ranges of frames with about `BLOCK_ROWS` rows each."""
    start, total = 0, 0
    for frame, size in enumerate(sizes):
        if total and total + size > BLOCK_ROWS:
            yield start, frame
            start, total = frame, 0
        total += int(size)
    yield start, len(sizes)


def ranges(lengths: Indices) -> Indices:
    """``0 … length-1`` for each length, one after the other."""
    starts = np.repeat(_starts(lengths), lengths)
    return np.asarray(np.arange(int(lengths.sum())) - starts, np.int64)


def _starts(counts: Indices) -> Indices:
    return np.asarray(np.cumsum(counts) - counts, np.int64)


class LineBlock(NamedTuple):
    """The contacts of consecutive frames as lines.

    Attributes:
        joined: Points that every line joins, counted from 0 in each frame.
        end_counts: Appended points of each frame.
        ends: These points [m], in the order of the contacts.
    """

    joined: Indices
    end_counts: Indices
    ends: NDArray[np.float64]


def points_per_line(model: Model) -> int:
    """Points that every line joins."""
    return 2 if model.outlines is None else 3


def read_lines(
    file: h5py.File, model: Model, start: int, stop: int, offset: Indices, lines: Indices
) -> LineBlock:
    """The frames ``start:stop``, with so many ``lines`` each; contact rows begin at ``offset``."""
    n, first, last = model.grain_count, int(offset[start]), int(offset[stop])
    counts: Indices = np.diff(offset[start : stop + 1])
    frame = np.repeat(np.arange(stop - start), counts)
    i, j = (file[f"contacts/{name}"][first:last].astype(np.int64) for name in "ij")
    position = file["particles/position"][start * n : stop * n].astype(np.float64)
    row = _starts(lines)[frame] + ranges(counts)
    joined = np.zeros((int(lines.sum()), points_per_line(model)), np.int64)
    if model.outlines is not None:
        arm = file["contacts/arm"][first:last].astype(np.float64)
        sides = file["walls/position"][start:stop, 0][frame] if model.is_cell else None
        joined[row], found, ends = _bent_lines(model, i, j, frame, position, arm, sides)
        return LineBlock(
            joined.ravel(), np.bincount(frame, found, len(counts)).astype(np.int64), ends
        )
    is_wall = j >= n
    partner = np.where(is_wall, i, j)
    center = position[frame * n + i]
    radius = model.grains.radius
    # From the center of i against the normal to the other end
    length = radius[i] + np.where(is_wall, 0.0, radius[partner]) + file["contacts/gap"][first:last]
    away = center - position[frame * n + partner]
    if model.is_cell:  # its sides change, but images are much farther apart than grains in contact
        is_apart = away[:, 0] * away[:, 0] + away[:, 1] * away[:, 1] > 4.0 * length * length
    else:
        is_apart = np.abs(away[:, 0]) > 0.5 * (model.period or np.inf)
    is_open = is_wall | is_apart
    reach = length[:, None] * file["contacts/normal"][first:last]
    ends = center[is_open]
    ends[:, :2] -= reach[is_open]
    end_counts = np.bincount(frame[is_open], minlength=len(counts)).astype(np.int64)
    j[is_open] = n + ranges(end_counts)
    joined[row] = np.column_stack([i, j])
    return LineBlock(joined.ravel(), end_counts, ends)


def _bent_lines(
    model: Model,
    i: Indices,
    j: Indices,
    frame: Indices,
    position: NDArray[np.float64],
    arm: NDArray[np.float64],
    sides: NDArray[np.float64] | None,
) -> tuple[Indices, Indices, NDArray[np.float64]]:
    """Lines through points of contact: which three points each joins, how many are appended for it,
    and these.

    The second point is where grains touch, and the third the center of j, or that of its image.
    With a wall, they are half-way to where the grain touches it, and there.
    """
    n = model.grain_count
    is_wall = j >= n
    center, other = (position[frame * n + np.where(is_wall, i, k)] for k in (i, j))
    image = other.copy()
    if sides is not None:
        width, height, tilt = sides.T
        up = np.rint((other - center)[:, 1] / height)
        image[:, :2] -= np.column_stack([up * tilt, up * height])
        image[:, 0] -= width * np.rint((image - center)[:, 0] / width)
    elif model.period > 0.0:
        image[:, 0] -= model.period * np.rint((image - center)[:, 0] / model.period)
    touch = center.copy()
    touch[:, :2] += arm
    is_open = is_wall | (image != other).any(axis=1)
    count = 1 + is_open.astype(np.int64)
    first = _starts(count)
    ends = np.zeros((len(count) + int(np.count_nonzero(is_open)), position.shape[1]))
    ends[first] = np.where(is_wall[:, np.newaxis], 0.5 * (center + touch), touch)
    ends[first[is_open] + 1] = np.where(is_wall[:, np.newaxis], touch, image)[is_open]
    begins = np.flatnonzero(np.diff(frame, prepend=-1))  # of frames with contacts
    number = n + first - np.repeat(first[begins], np.diff(begins, append=len(frame)))
    return np.column_stack([i, number, np.where(is_open, number + 1, j)]), count, ends


# ---- The view

GROUP = "VTKHDF"
ENDS = "view/contact_ends"
"""Where the appended points are stored: not among the data, and outside of what VTK looks at."""

_PRESENCE, _RADIUS = "particles/presence", "particles/radius"

NO_CONTACT = 255
"""``kind`` of the line that stands for no contact at all."""

_VERSION = (2, 0)
_MAPPING_BYTES = 320
TOPOLOGIES = ("Vertices", "Lines", "Polygons", "Strips")
_LINES = TOPOLOGIES.index("Lines")

_POINT_FIELDS, _CONTACT_FIELDS, _STEP_FIELDS = (
    [row for row in table if "vtk" in row.exports]
    for table in (schema.PARTICLES, schema.CONTACTS, schema.STEPS)
)
"""Point, cell and field data where the run has it; of contacts, each column for itself."""

_CONSTANTS = ("radius", "group", "material", "is_grain")

_STORED = (
    "NumberOfPoints",
    "Lines/NumberOfCells", "Lines/NumberOfConnectivityIds", "Lines/Connectivity", "Lines/Offsets",
    "Vertices/NumberOfCells", "Vertices/Connectivity",
    "Steps/NumberOfParts", "Steps/PartOffsets", "Steps/PointOffsets", "Steps/CellOffsets",
    "Steps/ConnectivityIdOffsets", "Steps/CellDataOffsets/kind", "Steps/FieldDataSizes/step",
    *(f"PointData/{name}" for name in _CONSTANTS),
)  # fmt: skip
"""What the view itself stores: everything in it that is neither a link nor virtual."""


@dataclass(frozen=True)
class _Layout:
    """Grains n of any frame, contacts and appended points of each frame, shape ``(K,)``.

    Lines join ``per_line`` points each.
    """

    grains: int
    per_line: int
    contacts: Indices
    ends: Indices

    @property
    def room(self) -> int:
        """Rows for the points of each frame: with equal room one mapping does for all frames."""
        return self.grains + int(self.ends.max())

    @property
    def lines(self) -> Indices:
        return np.maximum(self.contacts, 1)


def estimate_view(frames: int, contact_rows: int, model: Model) -> int:
    """Upper bound of the size of the view [bytes]."""
    lines, cells = contact_rows + frames, sum(len(_cells(row)) for row in _CONTACT_FIELDS)
    per_line = points_per_line(model)
    joined = 8 * (per_line + 1) * lines + 24 * (per_line - 1) * contact_rows
    return joined + frames * (_MAPPING_BYTES * cells + 512) + (256 << 10)


def write_view(file: h5py.File, model: Model) -> None:
    """Add the view to an open ``results.h5`` whose datasets are complete, if it has frames."""
    if not len(file["steps/time"]):
        return
    root = begin_view(file)
    rows = _write_lines(file, root, model)
    write_no_cells(root, len(rows.ends), "Polygons")
    root["NumberOfPoints"] = rows.grains + rows.ends
    steps = _write_steps(file, root, rows)
    _write_points(file, root, steps, rows)
    _write_constants(root, steps, model, rows)
    if _PRESENCE in file or _RADIUS in file:
        _write_radii(file, root, steps, model, rows)
    _write_cell_data(file, root, steps, rows)
    # One value per step; the length of the last step turns impulses into forces.
    steps["FieldDataSizes/step"] = np.ones((len(rows.ends), 2), np.int64)
    for row in _STEP_FIELDS:
        root[f"FieldData/{row.name}"] = file[row.path]
        steps[f"FieldDataOffsets/{row.name}"] = steps["PartOffsets"]
        if row.name != "step":
            steps[f"FieldDataSizes/{row.name}"] = steps["FieldDataSizes/step"]
    write_text(root, "blake2b", _digest(file))


def begin_view(file: h5py.File) -> h5py.Group:
    """The group of a view that has nothing yet."""
    root = file.create_group(GROUP)
    root.attrs["Version"] = np.array(_VERSION, np.int64)
    root.attrs.create("Type", b"PolyData", dtype=h5py.string_dtype("ascii", len(b"PolyData")))
    return root


def write_no_cells(root: h5py.Group, parts: int, kind: str) -> None:
    """Vertices, strips and cells of another ``kind`` that are not used: VTK wants them there."""
    root["Vertices/NumberOfCells"] = np.zeros(parts, np.int64)
    root["Vertices/Connectivity"] = np.zeros(0, np.int64)
    for count in ("NumberOfConnectivityIds", "Offsets"):
        root[f"Vertices/{count}"] = root["Vertices/NumberOfCells"]
    root[kind] = root["Strips"] = root["Vertices"]


def check_view(path: Path) -> None:
    """Compare what the view itself stores with its digest; raises `DamagedRun` or `StorageError`.

    Virtual datasets are not opened: HDF5 may crash on a damaged one. What they show has digests
    where it is stored; how they show it is covered by the digest of the whole file in ``run.json``.
    Without frames there is no view.
    """
    with reading(path), regular_path(path) as opened, h5py.File(opened, "r", locking=False) as file:
        is_whole = not len(file["steps/time"]) or read_text(file[GROUP], "blake2b") == _digest(file)
    if not is_whole:
        raise DamagedRun(f"{path}: {GROUP}, the view for ParaView, does not match its digest")


def _digest(file: h5py.File) -> str:
    total = hashlib.blake2b(digest_size=16)
    for path in (ENDS, *(f"{GROUP}/{name}" for name in _STORED)):
        dataset = file[path]
        total.update(f"{path} {dataset.shape} {dataset.dtype.str}\n".encode())
        for start in range(0, len(dataset), BLOCK_ROWS):
            total.update(np.ascontiguousarray(dataset[start : start + BLOCK_ROWS]).tobytes())
    return total.hexdigest()


def link_view(directory: Path) -> None:
    """Give ``results.h5`` the name by which ParaView knows it, where the file system allows it.

    A symbolic link follows when ``results.h5`` is replaced; a hard link is the next best.
    """
    name, temporary = directory / layout.VTKHDF, directory / (layout.VTKHDF + ".tmp")
    with contextlib.suppress(OSError):
        remove_own(temporary)
        try:
            temporary.symlink_to(layout.RESULTS)
        except OSError:
            os.link(directory / layout.RESULTS, temporary)
        require_own(name)
        temporary.replace(name)


def _write_lines(file: h5py.File, root: h5py.Group, model: Model) -> _Layout:
    """Write which points the lines join and the appended points, a block of frames at a time."""
    offset, per_line = file["steps/contact_offset"][...], points_per_line(model)
    counts: Indices = np.diff(offset)
    connectivity = Growing(root, "Lines/Connectivity", np.int64)
    offsets = Growing(root, "Lines/Offsets", np.int64)
    points: list[NDArray[np.float64]] = []
    ends = np.zeros(len(counts), np.int64)
    for start, stop in frame_blocks(counts + model.grain_count):
        lines = np.maximum(counts[start:stop], 1)
        block = read_lines(file, model, start, stop, offset, lines)
        points.append(block.ends)
        ends[start:stop] = block.end_counts
        connectivity.append(block.joined)
        offsets.append(per_line * ranges(lines + 1))
    connectivity.close()
    offsets.close()
    rows = _Layout(model.grain_count, per_line, counts, ends)
    root["Lines/NumberOfCells"] = rows.lines
    root["Lines/NumberOfConnectivityIds"] = per_line * rows.lines
    _write_ends(file, np.concatenate(points), rows)
    return rows


def _write_ends(file: h5py.File, points: NDArray[np.float64], rows: _Layout) -> None:
    """The appended points, with equal room for every frame."""
    length = rows.room - rows.grains
    first = _starts(rows.ends)
    stream = Growing(file, ENDS, file["particles/position"].dtype, 3)
    for start, stop in frame_blocks(np.full(len(rows.ends), length)):
        padded = np.zeros((stop - start, length, 3))
        counts = rows.ends[start:stop]
        frame = np.repeat(np.arange(stop - start), counts)
        padded[frame, ranges(counts)] = points[first[start] : first[start] + counts.sum()]
        stream.append(padded.reshape(-1, 3))
    stream.close()
    file[ENDS].attrs["unit"] = "m"
    file[ENDS].attrs["long_name"] = (
        "points appended to the grains of a step: ends of contacts with walls and across the period"
    )


def _write_steps(file: h5py.File, root: h5py.Group, rows: _Layout) -> h5py.Group:
    count = len(rows.ends)
    steps = root.create_group("Steps")
    steps.attrs["NSteps"] = count
    steps["Values"] = file["steps/time"]
    steps["NumberOfParts"] = np.ones(count, np.int64)
    steps["PartOffsets"] = np.arange(count, dtype=np.int64)
    steps["PointOffsets"] = rows.room * np.arange(count, dtype=np.int64)
    for name, per_cell in (("CellOffsets", 1), ("ConnectivityIdOffsets", rows.per_line)):
        offsets = np.zeros((count, len(TOPOLOGIES)), np.int64)
        offsets[:, _LINES] = per_cell * _starts(rows.lines)
        steps[name] = offsets
    for name in ("PointData", "CellData", "FieldData"):
        root.create_group(name)
        steps.create_group(f"{name}Offsets")
    return steps


def _write_points(file: h5py.File, root: h5py.Group, steps: h5py.Group, rows: _Layout) -> None:
    """Positions and point data: rows of grains, and behind each frame's the appended points."""
    frames, room, grains = len(rows.ends), rows.room, rows.grains
    ends = room - grains
    # Blocks of rows, one every ``room`` rows: the grains of each frame, then its appended points.
    to_grains = [(h5py.MultiBlockSlice(0, room, frames, grains), slice(0, frames * grains))]
    to_ends = []
    if ends:
        to_ends = [(h5py.MultiBlockSlice(grains, room, frames, ends), slice(0, frames * ends))]
    total = frames * room
    position = [_Source(file["particles/position"], to_grains), _Source(file[ENDS], to_ends)]
    _write_virtual(root, "Points", total, position, np.nan)
    for row in _POINT_FIELDS:
        if row.path in file:
            _write_virtual(
                root, f"PointData/{row.name}", total, [_Source(file[row.path], to_grains)], np.nan
            )
            steps[f"PointDataOffsets/{row.name}"] = steps["PointOffsets"]


@dataclass(frozen=True)
class _Source:
    """Rows of a dataset that a virtual dataset shows: of one ``column``, or of all if None.

    ``pieces`` are rows in the virtual dataset, and as many here.
    """

    dataset: h5py.Dataset
    pieces: Sequence[tuple[Any, slice]]
    column: int | None = None


def _write_virtual(
    root: h5py.Group, path: str, rows: int, sources: Sequence[_Source], fill: float
) -> None:
    """A dataset that shows rows of others, and ``fill`` elsewhere."""
    first = sources[0]
    shape = (rows, *(first.dataset.shape[1:] if first.column is None else ()))
    if not any(source.pieces for source in sources):
        root.create_dataset(path, shape, first.dataset.dtype, fillvalue=fill)
        return
    virtual = h5py.VirtualLayout(shape, first.dataset.dtype)
    for source in sources:
        shown = h5py.VirtualSource(
            ".", source.dataset.name, source.dataset.shape, source.dataset.dtype
        )
        for target, chosen in source.pieces:
            virtual[target] = (
                shown[chosen] if source.column is None else shown[chosen, source.column]
            )
    root.create_virtual_dataset(path, virtual, fillvalue=fill)


def _write_constants(root: h5py.Group, steps: h5py.Group, model: Model, rows: _Layout) -> None:
    """Point data that do not change, once; appended points have no radius, group or material."""
    length, grains = rows.room, model.grains
    is_grain = np.ones(rows.grains, np.uint8)
    constants: list[NDArray[Any]] = [grains.radius, grains.group, grains.material, is_grain]
    for name, values, fill in zip(_CONSTANTS, constants, (0, -1, -1, 0), strict=True):
        whole = np.full(length, fill, values.dtype)
        whole[: rows.grains] = values
        root.create_dataset(
            f"PointData/{name}", data=whole, chunks=(min(length, CHUNK_ROWS),), fletcher32=True
        )
        steps[f"PointDataOffsets/{name}"] = root["Vertices/NumberOfCells"]  # zeros


def _write_radii(
    file: h5py.File, root: h5py.Group, steps: h5py.Group, model: Model, rows: _Layout
) -> None:
    """Radii step by step: 0 for grains that are not there, which are drawn as nothing."""
    del root["PointData/radius"], steps["PointDataOffsets/radius"]
    stream = Growing(root, "PointData/radius", np.float64)
    for frame in range(len(rows.ends)):
        radius, mine = np.zeros(rows.room), slice(frame * rows.grains, (frame + 1) * rows.grains)
        radius[: rows.grains] = file[_RADIUS][mine] if _RADIUS in file else model.grains.radius
        if _PRESENCE in file:
            radius[: rows.grains][file[_PRESENCE][mine] != Presence.THERE] = 0.0
        stream.append(radius)
    stream.close()
    steps["PointDataOffsets/radius"] = steps["PointOffsets"]


def _write_cell_data(file: h5py.File, root: h5py.Group, steps: h5py.Group, rows: _Layout) -> None:
    """What the contacts carry; the line that stands for no contact has a ``kind`` of its own."""
    starts, first, counts = _starts(rows.lines), _starts(rows.contacts), rows.contacts
    # Rows of contacts and of lines run in parallel, except before and after frames without any
    breaks = np.flatnonzero((counts[:-1] == 0) | (counts[1:] == 0)) + 1
    pieces = []
    for start, stop in itertools.pairwise([0, *breaks.tolist(), len(counts)]):
        if size := int(counts[start:stop].sum()):
            line, contact = int(starts[start]), int(first[start])
            pieces.append((slice(line, line + size), slice(contact, contact + size)))
    steps["CellDataOffsets/kind"] = starts
    total = int(rows.lines.sum())
    for row in _CONTACT_FIELDS:
        for name, column in _cells(row) if row.path in file else ():
            fill = NO_CONTACT if name == "kind" else 0
            _write_virtual(
                root, f"CellData/{name}", total, [_Source(file[row.path], pieces, column)], fill
            )
            if name != "kind":
                steps[f"CellDataOffsets/{name}"] = steps["CellDataOffsets/kind"]


def _cells(row: Dataset) -> list[tuple[str, int | None]]:
    """Names of the cell data of a dataset of contacts, and the column of each; None if only one."""
    return [(name, column) for column, name in enumerate(row.columns)] or [(row.name, None)]
