"""Frames of a run as lazy numpy arrays, wherever they lie, and as columns with names and units."""

from __future__ import annotations

from bisect import bisect_right
from collections import OrderedDict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, wraps
from itertools import accumulate
from pathlib import Path
from typing import Any, Concatenate, NamedTuple, ParamSpec, TypeVar, cast, overload

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model import Model, Presence
from multicor_cli.model.books import Version
from multicor_cli.model.cell import COLUMNS
from multicor_cli.model.model import Floats
from multicor_cli.optional import library
from multicor_cli.store import schema
from multicor_cli.store.errors import DamagedRun, frame_number
from multicor_cli.store.hdf5 import CheckedFile, dtype_of
from multicor_cli.store.results import FILETYPE as RESULTS_FILETYPE
from multicor_cli.store.results import read_offsets
from multicor_cli.store.schema import (
    Column,
    ContactColumns,
    Dataset,
    GrainColumns,
    KeptColumns,
    StepColumns,
    WallColumns,
    read_only,
)
from multicor_cli.text import count_noun

# ---- Files of a run, one `results.h5` or segments, as one sequence of frames

Array = NDArray[Any]
P = ParamSpec("P")
T = TypeVar("T")

_OPEN_LIMIT = 8


class Part(NamedTuple):
    """One file with a range of frames and rows of the time series; ``dims``: the lengths known."""

    path: Path
    filetype: str
    dims: dict[str, int]


def results_part(path: Path, run_id: str) -> Part:
    """The part that is a whole ``results.h5``; raises `DamagedRun` or `StorageError`."""
    with CheckedFile(path, RESULTS_FILETYPE, run_id=run_id) as file:
        for name in ("steps/step", "series/step", *schema.COUNTED.values(), "walls/position"):
            file.dataset(schema.DATASETS[name])
        return Part(path, RESULTS_FILETYPE, dict(file.dims))


class OpenPart(NamedTuple):
    """An open file, with the row offsets of its frames by kind of row."""

    file: CheckedFile
    offsets: dict[str, NDArray[np.int64]]


def _retried(read: Callable[Concatenate[Parts, P], T]) -> Callable[Concatenate[Parts, P], T]:
    """Read once more if a file has gone, because the run was finished meanwhile."""

    @wraps(read)
    def retry(parts: Parts, /, *args: P.args, **kwargs: P.kwargs) -> T:
        try:
            return read(parts, *args, **kwargs)
        except DamagedRun:
            if all(part.path.is_file() for part in parts.parts):
                raise
        parts.renew()
        return read(parts, *args, **kwargs)

    return retry


class Parts:
    """The files of a run as one sequence of frames and one of rows of the time series.

    ``again`` is called when a file has gone, and gives the present files. ``lengths`` are the
    numbers of walls and outlets, by dimension, which no file tells while there is none. Methods
    that read raise `DamagedRun` or `StorageError`.
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
        self._ends = list(accumulate(part.dims["frame"] for part in parts))

    def renew(self) -> None:
        """Take up the present files; raises `DamagedRun` if they hold fewer frames."""
        count = self.frame_count
        self._set(self._again())
        if self.frame_count < count:
            raise DamagedRun("frames of the run have gone while it was read; open it again")

    @property
    def frame_count(self) -> int:
        return self._ends[-1] if self._ends else 0

    @property
    def series_count(self) -> int:
        return sum(part.dims["series_row"] for part in self.parts)

    @property
    @_retried
    def features(self) -> frozenset[str] | None:
        """Features of the run as its first file names them, or None if there is no file."""
        return self._opened(self.parts[0]).file.features if self.parts else None

    @property
    @_retried
    def version(self) -> Version | None:
        """Version of the file format in which the run was begun, or None if there is no file."""
        return self._opened(self.parts[0]).file.version if self.parts else None

    @_retried
    def has(self, spec: Dataset, frame: int) -> bool:
        """Whether the file with a frame has a dataset."""
        return self._opened_at(frame)[0].file.has(spec)

    @_retried
    def frame_rows(self, spec: Dataset, frame: int) -> NDArray[Any]:
        """The rows of a dataset that belong to a frame."""
        opened, local = self._opened_at(frame)
        if spec.row in opened.offsets:
            start, stop = opened.offsets[str(spec.row)][local : local + 2]
        else:
            start, stop = local, local + 1
        return opened.file.read(spec, int(start), int(stop))

    def column(self, spec: Dataset) -> NDArray[Any]:
        """A dataset with one row per frame or row of the series, over all files."""
        return self.columns((spec,))[spec.path]

    @_retried
    def columns(self, specs: Sequence[Dataset]) -> dict[str, NDArray[Any]]:
        """As `column` for several datasets, each file opened once."""
        if not self.parts:
            lengths = self._lengths()
            return {
                spec.path: np.zeros(spec.shape(lengths), dtype_of(spec, "double")) for spec in specs
            }
        pieces: dict[str, list[NDArray[Any]]] = {spec.path: [] for spec in specs}
        for part in self.parts:
            opened = self._opened(part)
            for spec in specs:
                pieces[spec.path].append(opened.file.read(spec))
        return {path: np.concatenate(found) for path, found in pieces.items()}

    def close(self) -> None:
        """Close all files; they are opened again when needed."""
        while self._open:
            self._open.popitem()[1].file.close()

    def _opened_at(self, frame: int) -> tuple[OpenPart, int]:
        """The file with a frame, and the number of the frame in it."""
        index = bisect_right(self._ends, frame)
        return self._opened(self.parts[index]), frame - (self._ends[index - 1] if index else 0)

    def _opened(self, part: Part) -> OpenPart:
        if part.path not in self._open:
            file = CheckedFile(part.path, part.filetype, run_id=self._run_id, dims=part.dims)
            try:
                offsets = {row: read_offsets(file, spec) for row, spec in schema.OFFSET_OF.items()}
            except BaseException:
                file.close()
                raise
            self._open[part.path] = OpenPart(file, offsets)
            if len(self._open) > _OPEN_LIMIT:
                self._open.popitem(last=False)[1].file.close()
        self._open.move_to_end(part.path)
        return self._open[part.path]


# ---- What grains are: sizes, masses, and names where the model has numbers


@dataclass(frozen=True, repr=False)
class GrainFacts:
    """What grains are that does not change; every array has shape ``(n,)`` and is read-only.

    Attributes:
        radius: Radius a [m]; of a grain that is no disc, how far it reaches from its center.
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
        grains = model.grains
        material = np.array(model.materials)[grains.material]
        group = np.array(model.groups)[grains.group]
        columns = grains.radius, grains.mass, grains.inertia, material, group
        return cls(*map(read_only, columns))

    def __len__(self) -> int:
        return len(self.radius)

    def __repr__(self) -> str:
        sizes = (
            f", radius {self.radius.min():.4g} to {self.radius.max():.4g} m" if len(self) else ""
        )
        return f"<Grains: {count_noun(len(self), 'grain')}{sizes}>"


# ---- What a run holds as columns with names and units: of CSV files, and of DataFrames of pandas


class NamedColumn(NamedTuple):
    """A column of a table: name, SI unit (``1`` if it has none) and values, one per row."""

    name: str
    unit: str
    values: Sequence[Any] | NDArray[Any]

    @property
    def heading(self) -> str:
        return self.name if self.unit == "1" else f"{self.name} [{self.unit}]"


def data_frame(columns: Sequence[NamedColumn], index: str | None = None) -> Any:
    """Columns as a DataFrame, indexed by one; units in ``attrs["units"]``; or `MissingLibrary`."""
    table = library("pandas").DataFrame({column.name: column.values for column in columns})
    table.attrs["units"] = {column.name: column.unit for column in columns if column.unit != "1"}
    return table if index is None else table.set_index(index)


def grain_columns(frame: Frame) -> list[NamedColumn]:
    """The present grains: number, group, material, radius (area if not all are discs), mass, and
    what the frame holds.
    """
    grains, model = frame.model.grains, frame.run_model
    return [
        NamedColumn("grain", "1", frame.number),
        NamedColumn("group", "1", [model.groups[k] for k in grains.group]),
        NamedColumn("material", "1", [model.materials[k] for k in grains.material]),
        NamedColumn("radius", "m", grains.radius),
        *([] if model.outlines is None else [NamedColumn("area", "m2", frame.model.area)]),
        NamedColumn("mass", "kg", grains.mass),
        *(c for c in stored_columns(frame, schema.PARTICLES, frame.number) if c.name != "radius"),
    ]


def stored_columns(
    frame: Frame, table: tuple[Dataset, ...], rows: NDArray[np.int64] | None = None
) -> list[NamedColumn]:
    """A table of ``schema`` as it is stored, or ``rows`` of it; grains are numbers in the run."""
    columns: list[NamedColumn] = []
    for spec in frame.rows(table):
        values = frame.column(spec.path)
        columns += split(spec, values if rows is None else values[rows])
    return columns


def wall_columns(frame: Frame) -> list[NamedColumn]:
    """The walls of a frame: name, and what the frame holds of each."""
    columns = [NamedColumn("wall", "1", list(frame.run_model.walls.names))]
    for spec in frame.rows(schema.WALLS):
        values = frame.column(spec.path)[0]
        columns += (split_cell if frame.run_model.is_cell else split)(spec, values)
    return columns


def split(spec: Dataset, values: NDArray[Any]) -> list[NamedColumn]:
    """The columns of a dataset."""
    names = spec.columns or (spec.name,)
    units = spec.unit.split(", ") * (1 if ", " in spec.unit else len(names))
    flat = values.reshape(len(values), int(np.prod(values.shape[1:], dtype=np.int64)))
    return [
        NamedColumn(name, unit, flat[:, k])
        for k, (name, unit) in enumerate(zip(names, units, strict=True))
    ]


def split_cell(spec: Dataset, values: NDArray[Any]) -> list[NamedColumn]:
    """The same of a dataset of walls where the wall is a cell; forces have to be stresses."""
    names, unit = COLUMNS.get(spec.name.removeprefix("wall_"), ((), ""))
    if not names:
        return split(spec, values)
    return [NamedColumn(name, unit, values[:, k]) for k, name in enumerate(names)]


# ---- Lazy arrays

_PRESENCE = "particles/presence"
_OF_SHAPES = ("contacts/i", "contacts/j")


class Contacts(ContactColumns):
    """The ``c`` contacts of a frame, by ``(i, j)``; arrays are read when first used, and kept."""

    def __init__(self, frame: Frame) -> None:
        self._frame = frame

    def __len__(self) -> int:
        return len(self.gap)

    @property
    def count(self) -> int:
        """Number of contacts."""
        return len(self)

    @property
    def recorded(self) -> bool:
        """Whether the contacts of this frame are in the file; if not, all arrays are empty."""
        return self._frame.contacts_recorded

    def to_pandas(self) -> Any:
        """The contacts as a DataFrame, one row for each; its ``attrs["units"]`` has the units.

        Shapes ``i`` and ``j`` are counted among all grains of the run, as the index of
        `Frame.to_pandas` is, also where grains come and go.

        Raises:
            MissingLibrary: If pandas is not installed.
            DamagedRun: If the file is damaged.
        """
        columns = stored_columns(self._frame, schema.CONTACTS)
        return data_frame(
            [c._replace(values=self.sliding) if c.name == "sliding" else c for c in columns]
        )

    def __repr__(self) -> str:
        return (
            f"<Contacts of frame {self._frame.index}: "
            f"{count_noun(len(self), 'contact') if self.recorded else 'not recorded'}>"
        )

    @property
    def force(self) -> Array:
        """Normal and tangential force on i, mean of the step [N], shape ``(c, 2)``; 0 at first."""
        dt = self._frame.dt
        return self.impulse / dt if dt > 0.0 else np.zeros_like(self.impulse)

    def read(self, column: Column[T]) -> T:
        """An attribute's value; raises as `Frame.column`, and `DamagedRun` for unknown shapes."""
        found = self._frame.read(column)
        if column.name in ("i", "j"):  # files that come from elsewhere may hold anything
            frame, model = self._frame, self._frame.run_model
            grains = frame.number.size if frame.is_open else model.grain_count
            count = grains + (0 if column.name == "i" else model.shape_count)
            if not _are_within(np.asarray(found), count):
                raise DamagedRun(
                    f"frame {frame.index}: damaged ({column.path} names shapes that do not exist)"
                )
        return found


def _are_within(numbers: Array, count: int) -> bool:
    return not numbers.size or bool(0 <= numbers.min() <= numbers.max() < count)


class Frame(StepColumns, GrainColumns, WallColumns, KeptColumns):
    """One frame; ``n`` grains, ``w`` walls. Every array is read when it is first used, and kept.
    Arrays are read-only: copy what is to be changed.

    Where grains come and go, the attributes are those of the ``n`` present grains, and contacts
    count shapes among these; `number` says which grains they are, and `model` is made of them.

    Attributes:
        index: Number of the frame in the run.
    """

    def __init__(self, parts: Parts, index: int, run_model: Callable[[], Model]) -> None:
        self._parts, self.index, self._run_model = parts, index, run_model

    @property
    def run_model(self) -> Model:
        """The model with all grains that ever are in the run; read when it is first needed."""
        return self._run_model()

    def column(self, path: str) -> Array:
        """The rows of any dataset of ``schema.FRAME_TABLE`` that belong to this frame, as stored.

        Raises:
            KeyError: If there is no such dataset.
            DamagedRun: If the file is damaged, or the run has no such quantity.
            StorageError: If it cannot be read.
        """
        spec = schema.DATASETS[path]
        rows = self._parts.frame_rows(spec, self.index)
        if spec.row == "particle_row" and len(rows) != self.run_model.grain_count:
            raise DamagedRun(
                f"frame {self.index} has {len(rows)} grains and its run "
                f"{self.run_model.grain_count}; check it with multicor verify"
            )
        return rows

    def rows(self, table: tuple[Dataset, ...]) -> tuple[Dataset, ...]:
        """The rows of a table of ``schema`` that the run has."""
        return schema.select(table, self._parts.features or frozenset(), self._parts.version)

    @cached_property
    def grains(self) -> GrainFacts:
        """What the ``n`` grains are: radius, mass, material, group."""
        return GrainFacts.of(self.model)

    def to_pandas(self) -> Any:
        """The grains as a DataFrame indexed by their numbers; ``attrs["units"]`` has the units.

        Raises:
            MissingLibrary: If pandas is not installed.
            DamagedRun: If the file is damaged.
        """
        return data_frame(grain_columns(self), "grain")

    def __repr__(self) -> str:
        count = len(self.number)
        return (
            f"<Frame {self.index}: {count_noun(count, 'grain')}, t = {self.time:.6g} s, step "
            f"{self.step}, stage {self.stage}>"
        )

    def read(self, column: Column[T]) -> T:
        """An attribute's value, None where the run does not have it; raises as `column`."""
        if not self._parts.has(column, self.index):
            return cast("T", None)
        rows = self.column(column.path)
        if self.is_open:
            rows = self._of_those_here(column, rows)
        return cast("T", column.convert(rows))

    @property
    def is_open(self) -> bool:
        """Whether grains may come and go in the run."""
        return "exchange" in (self._parts.features or ())

    @cached_property
    def number(self) -> NDArray[np.int64]:
        """Numbers in the run of the present grains, shape ``(n,)``; see `presence` for others."""
        if not self.is_open:
            return np.arange(self.run_model.grain_count)
        return np.flatnonzero(self.column(_PRESENCE) == Presence.THERE)

    @cached_property
    def model(self) -> Model:
        """The model with the present grains alone, as large as they are."""
        model = self.run_model.with_grains(self.number) if self.is_open else self.run_model
        if self.radius is None:
            return model
        share = model.worn_share(np.asarray(self.wear, float))
        return model.with_radius(np.asarray(self.radius, float), share)

    def _of_those_here(self, column: Column[Any], rows: Array) -> Array:
        """The rows of the present grains; shapes of contacts are counted among these too."""
        if column.path in _OF_SHAPES:
            n, shapes = self.run_model.grain_count, self.run_model.shape_count
            here = self.number.size
            number = np.zeros(n + shapes, rows.dtype)
            number[self.number], number[n:] = np.arange(here), np.arange(here, here + shapes)
            return number[rows] if _are_within(rows, n + shapes) else rows
        is_of_grains = column.row == "particle_row" and column.path != _PRESENCE
        return rows[self.number] if is_of_grains else rows

    @property
    def has_heat(self) -> bool:
        """Whether the run has heat."""
        return "heat" in (self._parts.features or ())

    @property
    def unwrapped(self) -> Array:
        """Centers, with the periods added by which x was wrapped [m], shape ``(n, 2)``.

        Raises:
            ValueError: In a cell, where nobody counts how often grains cross its sides; see
                ``nonaffine``.
        """
        if self.run_model.is_cell:
            raise ValueError(
                "in a cell it is not known how often grains have crossed its sides; how far they "
                "are from where its mean flow would have taken them is nonaffine"
            )
        position = np.array(self.position, np.float64)
        position[:, 0] += self.image * self.run_model.period
        return position

    @cached_property
    def contacts(self) -> Contacts:
        """Contacts of the last step."""
        # Through a frame of their own: a cycle would keep the arrays until garbage collection.
        return Contacts(Frame(self._parts, self.index, self._run_model))


class Frames(Sequence[Frame]):
    """All frames of a run, as a sequence; slices are lists of lazy frames; may raise `NoFrame`."""

    def __init__(self, parts: Parts, run_model: Callable[[], Model]) -> None:
        self._parts, self._run_model = parts, run_model

    def __len__(self) -> int:
        return self._parts.frame_count

    @overload
    def __getitem__(self, index: int) -> Frame: ...
    @overload
    def __getitem__(self, index: slice) -> list[Frame]: ...
    def __getitem__(self, index: int | slice) -> Frame | list[Frame]:
        if isinstance(index, slice):
            return [self[k] for k in range(*index.indices(len(self)))]
        return Frame(self._parts, frame_number(len(self), index), self._run_model)

    def __iter__(self) -> Iterator[Frame]:
        return (self[k] for k in range(len(self)))

    def __repr__(self) -> str:
        span = f", t = {self.time[0]:.6g} to {self.time[-1]:.6g} s" if len(self) else ""
        return f"<{count_noun(len(self), 'frame')}{span}>"

    @cached_property
    def step(self) -> Array:
        """Step of every frame, shape ``(K,)``."""
        return read_only(self.column("steps/step"))

    @cached_property
    def time(self) -> Array:
        """Time of every frame [s], shape ``(K,)``."""
        return read_only(self.column("steps/time"))

    @cached_property
    def stage(self) -> Array:
        """Loading stage of every frame, shape ``(K,)``."""
        return read_only(self.column("steps/stage"))

    def column(self, path: str) -> Array:
        """A dataset of ``schema`` with one row per frame (``steps/*``, ``walls/*``): all rows."""
        return self._parts.column(schema.DATASETS[path])
