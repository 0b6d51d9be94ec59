"""Where the frames of a run lie, in one ``results.h5`` or in segments, alike for readers; and what its grains are."""

from __future__ import annotations

from bisect import bisect_right
from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model import Model
from multicor_cli.model.books import Version
from multicor_cli.model.model import Floats
from multicor_cli.store import layout, schema
from multicor_cli.store.checkpoint import START_AGAIN, Identity, load_newest, newest_first
from multicor_cli.store.documents import read_document
from multicor_cli.store.errors import DamagedRun, StorageError
from multicor_cli.store.hdf5 import CheckedFile
from multicor_cli.store.results import FILETYPE as RESULTS_FILETYPE
from multicor_cli.store.results import read_offsets, segment_dims
from multicor_cli.store.run_document import read_run_document
from multicor_cli.store.schema import Dataset
from multicor_cli.store.segments import FILETYPE as SEGMENT_FILETYPE
from multicor_cli.store.segments import NAME, Segment, read_manifest
from multicor_cli.text import count_noun

# ---- What the grains of a run or of a frame are: sizes, masses, and names where the model has numbers


@dataclass(frozen=True, repr=False)
class GrainFacts:
    """What grains are that does not change; every array has shape ``(n,)``.

    Attributes:
        radius: Radius a [m].
        mass: Mass m [kg].
        inertia: Moment of inertia about the center [kg m²].
        material: Name of the material.
        group: Name of the ``[[particles]]`` table that a grain comes from.
    """

    radius: Floats
    mass: Floats
    inertia: Floats
    material: NDArray[Any]
    group: NDArray[Any]

    @classmethod
    def of(cls, model: Model) -> GrainFacts:
        """Those of a model."""
        grains = model.grains
        material, group = np.array(model.materials)[grains.material], np.array(model.groups)[grains.group]
        return cls(grains.radius, grains.mass, grains.inertia, material, group)

    def __len__(self) -> int:
        return len(self.radius)

    def __repr__(self) -> str:
        sizes = f", radius {self.radius.min():.4g} to {self.radius.max():.4g} m" if len(self) else ""
        return f"<Grains: {count_noun(len(self), 'grain')}{sizes}>"


# ---- Which segments of an unfinished run count: those in the manifest, which must hold all that a checkpoint relies on


def committed_segments(run: Path) -> list[Segment]:
    """The segments of a run directory, in order.

    A manifest that lost lines at its end looks like a shorter one, so it is compared with the newest checkpoint. Checkpoints are
    read first: while a run goes on, its manifest only grows.

    Raises:
        DamagedRun: If a line is damaged, or lines are missing.
        StorageError: If a file cannot be read.
    """
    directory = run / layout.SEGMENTS
    sidecar, names = _listed_by_checkpoint(run / layout.CHECKPOINTS)
    segments = read_manifest(directory)
    if [segment.name for segment in segments[: len(names)]] != names:
        what = f"{directory / NAME}: damaged (segments listed in {sidecar} are missing)"
        raise DamagedRun(f"{what}; {_remedy(run)}")
    return segments


def _remedy(run: Path) -> str:
    """What helps if the manifest of a run is damaged: to continue from a checkpoint whose segments are whole, if there is one."""
    try:
        found = load_newest(run / layout.CHECKPOINTS, Identity.of(read_run_document(run)), run / layout.SEGMENTS)
    except (DamagedRun, StorageError):
        found = None
    if found is None:
        return f"no checkpoint has all its segments; {START_AGAIN}"
    return f"continue the run to repair it, from step {found.state.step}"


def _listed_by_checkpoint(directory: Path) -> tuple[str, list[str]]:
    """Name of the newest description of a checkpoint that can be read, and its segments."""
    for sidecar in newest_first(directory):
        try:
            listed = read_document(sidecar)["segments"]
            return sidecar.name, [str(segment["name"]) for segment in listed]
        except (DamagedRun, StorageError, KeyError, TypeError):
            continue
    return "", []


# ---- Frames, wherever they lie

_T = TypeVar("_T")

_OPEN_LIMIT = 8
"""Files kept open at a time."""


@dataclass(frozen=True)
class Part:
    """One file with a range of frames and rows of the time series.

    Attributes:
        path: The file.
        filetype: Its type.
        frames: Number of frames.
        series_rows: Rows of the time series.
        dims: Lengths that are known.
    """

    path: Path
    filetype: str
    frames: int
    series_rows: int
    dims: dict[str, int]


def segment_part(directory: Path, segment: Segment) -> Part:
    """The part that a line of the manifest describes."""
    dims = segment_dims(segment)
    return Part(directory / segment.name, SEGMENT_FILETYPE, segment.frames, segment.series_rows, dims)


def results_part(path: Path, run_id: str | None = None) -> Part:
    """The part that is a whole ``results.h5``; raises `DamagedRun` or `StorageError`."""
    with CheckedFile(path, RESULTS_FILETYPE, run_id=run_id) as file:
        for name in ("steps/step", "series/step", "particles/angle", "contacts/gap", "walls/position"):
            file.dataset(_SPECS[name])
        dims = dict(file.dims)
    return Part(path, RESULTS_FILETYPE, dims["frame"], dims["series_row"], dims)


_SPECS = {spec.path: spec for spec in schema.RESULTS_TABLE}


class OpenPart:
    """An open part: the file and the rows of each of its frames.

    Attributes:
        file: The open file.
        offsets: Row offsets of its frames by kind of row.
    """

    def __init__(self, part: Part, run_id: str | None) -> None:
        self.file = CheckedFile(part.path, part.filetype, run_id=run_id, dims=part.dims)
        try:
            self.offsets = {name: self._offsets(name) for name in ("particle_row", "contact_row")}
        except BaseException:
            self.file.close()
            raise

    def _offsets(self, name: str) -> NDArray[np.int64]:
        spec = _SPECS[f"steps/{name.removesuffix('_row')}_offset"]
        rows = _SPECS["particles/angle" if name == "particle_row" else "contacts/gap"]
        return read_offsets(self.file, spec, int(self.file.dataset(rows).shape[0]))


class Parts:
    """The files of a run as one sequence of frames and one of rows of the time series.

    Args:
        parts: The files in order.
        run_id: Identity of the run; any if ``None``.
        again: Called when a file has gone, because the run was finished in the meantime; returns the present files.
        lengths: Lengths of dimensions that no file tells while there is none: numbers of walls and outlets.
    """

    def __init__(
        self,
        parts: Sequence[Part],
        run_id: str | None,
        again: Callable[[], Sequence[Part]],
        lengths: Callable[[], Mapping[str, int]],
    ) -> None:
        self._run_id, self._again, self._lengths = run_id, again, lengths
        self._open: OrderedDict[Path, OpenPart] = OrderedDict()
        self._set(parts)

    def _set(self, parts: Sequence[Part]) -> None:
        self.close()
        self.parts = tuple(parts)
        self._ends = list(accumulate(part.frames for part in parts))

    @property
    def frame_count(self) -> int:
        """Number of frames."""
        return self._ends[-1] if self._ends else 0

    @property
    def series_count(self) -> int:
        """Rows of the time series."""
        return sum(part.series_rows for part in self.parts)

    @property
    def features(self) -> frozenset[str] | None:
        """Features of the run as its first file names them, or None if there is no file; raises `DamagedRun` or `StorageError`."""
        return self._retry(lambda: self._opened(self.parts[0]).file.features if self.parts else None)

    @property
    def version(self) -> Version | None:
        """Version of the file format in which the run was begun, or None if there is no file; raises as `features`."""
        return self._retry(lambda: self._opened(self.parts[0]).file.version if self.parts else None)

    def has(self, spec: Dataset, frame: int) -> bool:
        """Whether the file with a frame has a dataset; raises `DamagedRun` or `StorageError`."""
        return self._retry(lambda: self._opened_at(frame)[0].file.has(spec))

    def frame_rows(self, spec: Dataset, frame: int) -> NDArray[Any]:
        """Rows of a dataset that belong to a frame; raises `DamagedRun` or `StorageError`."""
        return self._retry(lambda: self._frame_rows(spec, frame))

    def column(self, spec: Dataset) -> NDArray[Any]:
        """A dataset with one row per frame or row of the series, over all files; raises `DamagedRun` or `StorageError`."""
        return self.columns((spec,))[spec.path]

    def columns(self, specs: Sequence[Dataset]) -> dict[str, NDArray[Any]]:
        """As `column` for several datasets, each file opened once."""
        return self._retry(lambda: self._columns(specs))

    def close(self) -> None:
        """Close all files; they are opened again when needed."""
        while self._open:
            self._open.popitem()[1].file.close()

    def _retry(self, read: Callable[[], _T]) -> _T:
        try:
            return read()
        except DamagedRun:
            if all(part.path.is_file() for part in self.parts):
                raise
        count = self.frame_count
        self._set(self._again())
        if self.frame_count < count:
            raise DamagedRun("frames of the run have gone while it was read; open it again")
        return read()

    def _frame_rows(self, spec: Dataset, frame: int) -> NDArray[Any]:
        opened, local = self._opened_at(frame)
        if spec.row in opened.offsets:
            start, stop = opened.offsets[str(spec.row)][local : local + 2]
        else:
            start, stop = local, local + 1
        return opened.file.read(spec, int(start), int(stop))

    def _opened_at(self, frame: int) -> tuple[OpenPart, int]:
        """The file with a frame, and the number of the frame in it."""
        index = bisect_right(self._ends, frame)
        return self._opened(self.parts[index]), frame - (self._ends[index - 1] if index else 0)

    def _columns(self, specs: Sequence[Dataset]) -> dict[str, NDArray[Any]]:
        pieces: dict[str, list[NDArray[Any]]] = {spec.path: [] for spec in specs}
        for part in self.parts:
            opened = self._opened(part)
            for spec in specs:
                pieces[spec.path].append(opened.file.read(spec))
        if not self.parts:
            lengths = self._lengths()
            return {spec.path: _nothing(spec, lengths) for spec in specs}
        return {spec.path: np.concatenate(pieces[spec.path]) for spec in specs}

    def _opened(self, part: Part) -> OpenPart:
        if part.path not in self._open:
            self._open[part.path] = OpenPart(part, self._run_id)
            if len(self._open) > _OPEN_LIMIT:
                self._open.popitem(last=False)[1].file.close()
        self._open.move_to_end(part.path)
        return self._open[part.path]


def _nothing(spec: Dataset, lengths: Mapping[str, int]) -> NDArray[Any]:
    dtype = {"f8": np.float64, "float": np.float64, "i8": np.int64, "i4": np.int32, "u1": np.uint8}[spec.dtype]
    return np.zeros(tuple(d if isinstance(d, int) else lengths.get(d, 0) for d in spec.dims), dtype)
