"""VTKHDF files of outlines: grains that are no discs as polygons, which ParaView colors.

``results.vtkhdf`` of a run has grains as points. Here each is a polygon, whose points are stored
step by step, and which they join once for all steps with the same grains.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from multicor_cli.export.target import ExportError, check_output, choose_frames, commit_hdf5
from multicor_cli.post.rings import Rings, rings_of
from multicor_cli.store import Frame, Run, schema
from multicor_cli.store.atomic import GuardedFile
from multicor_cli.store.layout import Progress, no_progress
from multicor_cli.store.vtkhdf import TOPOLOGIES, Growing, begin_view, write_no_cells

FINE = 5e-3
"""Height of arcs over their chords at most, over the radius of the grain: 32 points on a disc."""

_BYTES_OF_POINT, _BYTES_OF_GRAIN = 20, 160
"""Of a step, at most, unless it is compressed: a place and a number, and values of each grain."""

_STEP = 1e-4  # places are rounded to this part of the smallest radius, so that files are smaller
_POLYGONS = TOPOLOGIES.index("Polygons")
_CELLS = {"CellOffsets": "CellData/grain", "ConnectivityIdOffsets": "Polygons/Connectivity"}
"""Where the cells of a step begin: as an array with a row for each."""

_CHANGING = [
    row for row in schema.PARTICLES if "vtk" in row.exports and row.only_with != "exchange"
]
"""What polygons are colored by, step by step, where the run has it."""


def export_vtkhdf(
    run: Run,
    path: Path,
    frames: slice | None = None,
    *,
    is_overwriting: bool = False,
    progress: Progress = no_progress,
) -> int:
    """Write the outlines of the grains in ``frames`` of a run, all by default; gives their number.

    Frames without grains are left out.

    Raises:
        ExportError: If there are no such frames, no grain in them, or all grains are discs.
        ExportRefused: If the file may not be written.
        StoreError: If the run cannot be read, or the file not be written.
    """
    check_output(path, is_overwriting=is_overwriting)
    chosen, outlines = choose_frames(run, frames), run.model.outlines
    if outlines is None:
        raise ExportError(
            f"{run.path}: all grains are discs, which results.vtkhdf in the run directory shows"
        )
    # VTK 9.4 to 9.7 misread the step after one without cells
    chosen = [frame for frame in chosen if frame.number.size]
    if not chosen:
        raise ExportError(f"{run.path}: no grain is there in these frames")
    rings = rings_of(outlines, FINE).single()

    def write(guarded: GuardedFile) -> None:
        with h5py.File(guarded, "w") as file:
            view = _View(file, float(run.model.grains.radius.min()))
            for number, frame in enumerate(chosen):
                view.append(frame, rings)
                progress(number + 1, len(chosen))
            view.finish()

    size = len(chosen) * (_BYTES_OF_POINT * len(rings.point) + _BYTES_OF_GRAIN * outlines.area.size)
    commit_hdf5(path, "vtkhdf", write, size)
    return len(chosen)


@dataclass
class _Array:
    """A dataset, its rows so far, and where the values of each step begin."""

    stream: Growing
    rows: int = 0
    begins: list[int] = field(default_factory=list)

    def append(self, values: NDArray[Any]) -> None:
        """Values of another step."""
        self.begins.append(self.rows)
        self.stream.append(values)
        self.rows += len(values)

    def again(self) -> None:
        """The same values for another step."""
        self.begins.append(self.begins[-1])


class _View:
    """Polygons of frames, one after the other.

    Which points they join, and what does not change, is stored again only when other grains are
    there.
    """

    def __init__(self, file: h5py.File, smallest: float) -> None:
        self._root, self._grid = begin_view(file), _STEP * smallest
        self._arrays: dict[str, _Array] = {}
        self._number = np.zeros(0, np.int64)  # of the grains in the last frame
        self._parts: list[tuple[int, int]] = []  # points and polygons, each time that they changed
        self._steps: list[tuple[float, int]] = []  # time and part of each frame

    def append(self, frame: Frame, rings: Rings) -> None:
        """The polygons of a frame; ``rings`` are those of all grains of the run."""
        rings, model = rings.of_grains(frame.number), frame.model
        is_new = not self._parts or not np.array_equal(frame.number, self._number)
        if is_new:
            self._number = frame.number
            self._parts.append((len(rings.point), len(frame.number)))
        grains = model.grains
        sizes = {"CellData/radius": grains.radius, "CellData/area": model.area}
        constant: dict[str, NDArray[Any]] = {
            "Polygons/Connectivity": np.arange(len(rings.point)), "Polygons/Offsets": rings.start,
            "CellData/grain": frame.number, "CellData/group": grains.group,
            "CellData/material": grains.material, **(sizes if frame.radius is None else {}),
        }  # fmt: skip
        for path, values in constant.items():
            if is_new:
                self._array(path, values).append(values)
            else:
                self._arrays[path].again()
        if frame.radius is not None:
            rings = rings.sized(frame.radius / frame.run_model.grains.radius[frame.number])
        placed = rings.placed(frame.position.astype(np.float64), frame.angle.astype(np.float64))
        place = self._grid * np.rint(placed.point / self._grid)
        changing: dict[str, NDArray[Any]] = {"Points": _spatial(place).astype(np.float32)}
        changing |= {} if frame.radius is None else sizes
        for row in _CHANGING:
            values = frame.read(row)
            if values is not None:
                changing[f"CellData/{row.name}"] = _spatial(values) if values.ndim == 2 else values
        for path, values in changing.items():
            self._array(path, values).append(values)
        self._steps.append((frame.time, len(self._parts) - 1))

    def _array(self, path: str, values: NDArray[Any]) -> _Array:
        if path not in self._arrays:
            stream = Growing(self._root, path, values.dtype, *values.shape[1:])
            self._arrays[path] = _Array(stream)
        return self._arrays[path]

    def finish(self) -> None:
        """Write what is known in the end: how much of everything belongs to which step."""
        root, parts, count = self._root, np.array(self._parts, np.int64), len(self._steps)
        for array in self._arrays.values():
            array.stream.close()
        root["NumberOfPoints"] = root["Polygons/NumberOfConnectivityIds"] = parts[:, 0]
        root["Polygons/NumberOfCells"] = parts[:, 1]
        write_no_cells(root, len(parts), "Lines")
        time, part = zip(*self._steps, strict=True)
        steps = root.create_group("Steps")
        steps.attrs["NSteps"] = count
        steps["Values"] = np.array(time)
        steps["NumberOfParts"] = np.ones(count, np.int64)
        steps["PartOffsets"] = np.array(part, np.int64)
        steps["PointOffsets"] = np.array(self._arrays["Points"].begins, np.int64)
        for name, path in _CELLS.items():
            offsets = np.zeros((count, len(TOPOLOGIES)), np.int64)
            offsets[:, _POLYGONS] = self._arrays[path].begins
            steps[name] = offsets
        for path, array in self._arrays.items():
            if path.startswith("CellData/"):
                steps[path.replace("/", "Offsets/")] = np.array(array.begins, np.int64)


def _spatial(values: NDArray[Any]) -> NDArray[Any]:
    return np.column_stack([values, np.zeros(len(values), values.dtype)])
