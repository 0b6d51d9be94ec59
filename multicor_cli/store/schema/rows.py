"""Every dataset in one row: where its values come from, and where they go."""

from __future__ import annotations

from collections.abc import Callable, Set
from dataclasses import dataclass, replace
from typing import Any, Generic, NoReturn, Protocol, TypeVar, overload

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model import Model
from multicor_cli.model.books import (
    BOOKS,
    EXCHANGE_BOOKS,
    HEAT_BOOKS,
    TALLIES,
    WINDOW,
    Dim,
    DType,
    Entry,
    Export,
    Feature,
    Shape,
    Stored,
    Version,
    entry_counts,
    measures_first,
    stored_fields,
)
from multicor_cli.model.columns import ANGLE, SPIN
from multicor_cli.model.contacts import ContactTable
from multicor_cli.model.shapes import SHAPES
from multicor_cli.model.state import FrameFields, State
from multicor_cli.store.snapshot import Snapshot, in_plane

# ---- A row of the tables

Value = Callable[[Snapshot], Any]
"""Where a value comes from: an array, or what belongs to one row."""

T = TypeVar("T")


@dataclass(frozen=True)
class Dataset:
    """One row of a table.

    Attributes:
        path: Name inside the file, without the leading slash.
        dtype: Stored type.
        dims: Shape: named lengths and numbers.
        unit: SI unit, one per column (with commas) where they differ; ``1`` if dimensionless.
        long_name: What it is, in a sentence.
        value: What is stored of a moment; None where the writer or a getter of its own knows.
        finite: Whether every value must be finite.
        since: Format version in which the dataset appeared.
        only_with: Feature of the runs that have it, or None if all have it.
        columns: Names of its columns in tables, if it has several; further columns are not shown.
        exports: What shows it, besides CSV.
    """

    path: str
    dtype: DType
    dims: Shape
    unit: str
    long_name: str
    value: Value | None = None
    finite: bool = True
    since: Version = (1, 0)
    only_with: Feature | None = None
    columns: tuple[str, ...] = ()
    exports: tuple[Export, ...] = ()

    @property
    def name(self) -> str:
        return self.path.rsplit("/", 1)[-1]

    @property
    def group(self) -> str:
        return self.path.rsplit("/", 1)[0]

    @property
    def row(self) -> Dim | int:
        return self.dims[0]


class Reader(Protocol):
    """What has columns: a frame, and its contacts."""

    def read(self, column: Column[T]) -> T:
        """The rows of a dataset that belong to it."""


@dataclass(frozen=True)
class Column(Dataset, Generic[T]):
    """A row about frames, which is also a frame's attribute: read when it is first used, and kept.

    Attributes:
        convert: Makes the value of the attribute of what is stored.
        about: What the attribute is, where it is not quite what is stored.
    """

    convert: Callable[[Any], Any] = lambda rows: rows
    about: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "__doc__", _describe(self))  # what help() says of the attribute

    @overload
    def __get__(self, reader: None, owner: type) -> Column[T]: ...
    @overload
    def __get__(self, reader: Reader, owner: type) -> T: ...
    def __get__(self, reader: Reader | None, owner: type) -> Column[T] | T:
        if reader is None:
            return self
        kept: dict[str, T] = vars(reader)
        if self.path not in kept:
            kept[self.path] = reader.read(self)
        return kept[self.path]

    def __set__(self, reader: Reader, value: object) -> NoReturn:
        raise AttributeError(f"{self.path} is read from a file")


_SYMBOLS = {"particle_row": "n", "contact_row": "c", "wall": "w"}


def _describe(column: Column[Any]) -> str:
    name = column.about or column.long_name
    dims = [_SYMBOLS.get(str(d), str(d)) for d in column.dims if d != "frame"]
    if column.columns:
        dims[-1] = str(len(column.columns))
    text = name[0].upper() + name[1:]
    text += f" [{column.unit}]" if column.unit != "1" else ""
    text += f", shape ``({', '.join(dims)}{',' * (len(dims) == 1)})``" if dims else ""
    text += f"; None in a run without {column.only_with}" if column.only_with else ""
    return text + (
        f"; None in a run of an older format than {column.since[0]}.{column.since[1]}"
        if column.since > (1, 0)
        else ""
    )


def select(
    table: tuple[Dataset, ...], features: Set[str], version: Version | None = None
) -> tuple[Dataset, ...]:
    """The rows of a table that a run with these features (and of this version) has, in order."""
    known = (row for row in table if version is None or row.since <= version)
    return tuple(row for row in known if row.only_with is None or row.only_with in features)


def features_of(model: Model) -> frozenset[Feature]:
    """What a run of this model has beyond what every run has."""
    laws = model.laws
    found: dict[Feature, bool] = {
        "heat": model.thermal is not None,
        "softening": laws.depends_on_temperature,
        "adhesion": laws.adhesion.size > 0,
        "rolling": laws.rolling.size > 0,
        "exchange": model.outlets is not None,
        "surface": model.walls.runs.size > 0,
        "groups": model.walls.meets.size > 0,
        "motion": model.start_speed > 0.0,
    }
    return frozenset(feature for feature, is_there in found.items() if is_there)


def names(table: tuple[Dataset, ...]) -> tuple[str, ...]:
    """Last parts of the paths of a table, in order."""
    return tuple(row.name for row in table)


def markdown(table: tuple[Dataset, ...]) -> str:
    """A table of the format documents: path, type, shape, unit, meaning, since (and feature)."""
    symbols = _DIM_SYMBOL | {dim: str(count) for dim, count in entry_counts().items()}
    lines = ["| path | type | shape | unit | meaning | since |", "|---|---|---|---|---|---|"]
    for row in table:
        shape = ", ".join(symbols[d] if isinstance(d, str) else str(d) for d in row.dims)
        since = ".".join(map(str, row.since)) + (f", {row.only_with}" if row.only_with else "")
        meaning = row.long_name.replace("|", "\\|")
        lines.append(
            f"| `{row.path}` | {row.dtype} | ({shape}) | {row.unit} | {meaning} | {since} |"
        )
    return "\n".join(lines)


_DIM_SYMBOL: dict[str, str] = {
    "one": "1",
    "frame": "K",
    "frame_edge": "K+1",
    "particle_row": "P",
    "contact_row": "C",
    "rolling_row": "C°",
    "series_row": "S",
    "grain": "n",
    "shape": "m",
    "wall": "w",
    "material": "k",
    "group": "g",
    "stage": "L",
    "table_edge": "T+1",
    "table_row": "R",
    "heat_grain": "n*",
    "heat_wall": "w*",
    "heat_book": "b*",
    "mean_row": "A",
    "stage_note": "N",
    "origin_row": "w°",
    "surface_row": "w°",
    "before_row": "B",
    "outlet": "o",
    "exchange_grain": "n°",
    "exchange_group": "g°",
    "exchange_outlet": "o°",
    "exchange_book": "x°",
}


# ---- What is written once: the model and the scenario of a run


def _thermal(name: str, unit: str, long_name: str, attribute: str = "") -> Dataset:
    return Dataset(
        f"model/thermal/{name}",
        "f8",
        ("grain",),
        unit,
        long_name,
        lambda m: getattr(m.thermal, attribute or name),
        only_with="heat",
    )


def _law(name: str, dtype: DType, dims: Shape, unit: str, long_name: str) -> Dataset:
    return Dataset(
        f"model/laws/{name}", dtype, dims, unit, long_name, lambda m: getattr(m.model.laws, name)
    )


def _softening(name: str, unit: str, long_name: str) -> Dataset:
    return replace(
        _law(f"softening_{name}", "f8", ("material", "material"), unit, long_name),
        only_with="softening",
    )


def _pair(name: str, unit: str, long_name: str, feature: Feature) -> Dataset:
    return replace(
        _law(name, "f8", ("material", "material"), unit, long_name), only_with=feature, since=(1, 1)
    )


MODEL: tuple[Dataset, ...] = (
    Dataset("model/radius", "f8", ("grain",), "m", "radius of each grain",
        lambda m: m.model.grains.radius),
    Dataset("model/mass", "f8", ("grain",), "kg", "mass of each grain",
        lambda m: m.model.grains.mass),
    Dataset(
        "model/inertia", "f8", ("grain",), "kg m2",
        "moment of inertia of each grain about its center",
        lambda m: m.model.grains.inertia,
    ),
    Dataset(
        "model/material", "i4", ("grain",), "1", ("material of each grain, a row of "
            "model/material_names"),
        lambda m: m.model.grains.material,
    ),
    Dataset(
        "model/group", "i4", ("grain",), "1", ("particle group of each grain, a row of "
            "model/group_names"),
        lambda m: m.model.grains.group,
    ),
    Dataset("model/material_names", "str", ("material",), "1", "names of the materials",
        lambda m: m.model.materials),
    Dataset("model/group_names", "str", ("group",), "1", "names of the particle groups",
        lambda m: m.model.groups),
    Dataset("model/walls/names", "str", ("wall",), "1", "names of the walls",
        lambda m: m.model.walls.names),
    Dataset(
        "model/walls/mass", "f8", ("wall",), "kg", "mass that a load moves; nan if none was given",
        lambda m: m.model.walls.mass, finite=False,
    ),
    Dataset(
        "model/walls/inertia", "f8", ("wall",), "kg m2", "moment of inertia of a wall; nan if none",
        lambda m: m.model.walls.inertia, finite=False,
    ),
    Dataset(
        "model/walls/has_gravity", "u1", ("wall",), "1", "whether gravity acts on the wall: 0 or 1",
        lambda m: m.model.walls.has_gravity,
    ),
    Dataset(
        "model/walls/length", "f8", ("wall",), "m", "length over which a load on the wall spreads",
        lambda m: m.model.walls.length,
    ),
    Dataset(
        "model/walls/runs", "u1", ("wall",), "1",
        "whether a drive lets the surface of the wall run along it: 0 or 1",
        lambda m: m.model.walls.runs, only_with="surface", since=(1, 3),
    ),
    Dataset(
        "model/walls/meets", "u1", ("wall", "group"), "1",
        "whether grains of the group meet the wall: 0 (they pass through) or 1",
        lambda m: m.model.walls.meets, only_with="groups", since=(1, 3),
    ),
    Dataset(
        "model/shapes/kind", "i4", ("shape",), "1",
        ", ".join(f"{kind:d} {shape.name}" for kind, shape in SHAPES.items()),
        lambda m: m.model.shapes.kind,
    ),
    Dataset(
        "model/shapes/wall", "i4", ("shape",), "1",
        "wall that carries the shape, a row of model/walls/names",
        lambda m: m.model.shapes.wall,
    ),
    Dataset(
        "model/shapes/geometry", "f8", ("shape", 4), "m",
        "four numbers in the frame of the wall; see the table of kinds",
        lambda m: m.model.shapes.geometry,
    ),
    Dataset(
        "model/shapes/material", "i4", ("shape",), "1",
        "material of the shape, a row of model/material_names",
        lambda m: m.model.shapes.material,
    ),
    _law("friction", "f8", ("material", "material"), "1",
        "coefficient of friction where laws/table is -1"),
    _law("restitution", "f8", ("material", "material"), "1", "coefficient of normal restitution"),
    _law("table", "i4", ("material", "material"), "1",
        "table of friction against sliding speed, or -1"),
    _law("table_start", "i4", ("table_edge",), "1", "first row of each table in the two below"),
    _law("table_speed", "f8", ("table_row",), "m/s", "sliding speeds, ascending within a table"),
    _law("table_friction", "f8", ("table_row",), "1", "coefficient of friction at these speeds"),
    _softening("rate", "1/K", "c of mu = mu0 (1 - c (T - T_r)); 0 for pairs without it"),
    _softening("start", "K", "temperature T_r at which mu = mu0"),
    _softening("lowest", "1", "smallest coefficient of friction"),
    _softening("highest", "1", "largest coefficient of friction"),
    _pair("adhesion", "N", "tension that a contact bears", "adhesion"),
    _pair("rolling", "1", "coefficient of rolling resistance", "rolling"),
    _thermal("capacity", "J/K", "heat capacity of each grain"),
    _thermal("start", "K", "temperature of each grain at the start of the run",
        "initial_temperature"),
    _thermal("surface", "m2", "area through which each grain meets fluid and surroundings"),
    Dataset(
        "model/outlets", "str", ("outlet",), "1", "names of the outlets",
        lambda m: m.model.outlets, only_with="exchange", since=(1, 2),
    ),
    Dataset(
        "model/start_speed", "f8", ("one",), "m/s",
        ("speed of the fastest grain, surface of a grain or wall at the start, but for the shear "
            "that walls impose"),
        lambda m: m.model.start_speed, only_with="motion", since=(1, 3),
    ),
    Dataset("model/period", "f8", ("one",), "m", "period in x; 0 if the domain is not periodic",
        lambda m: m.model.period),
    Dataset("model/gravity", "f8", (2,), "m/s2", "acceleration of gravity (x, y)",
        lambda m: m.model.gravity),
    Dataset(
        "model/shape_factor", "f8", ("one",), "1",
        "m a2/I of every grain: 2 for discs, 5/2 for spheres",
        lambda m: m.model.shape_factor,
    ),
)  # fmt: skip
"""Written once (`model.Model`)."""

SCENARIO: tuple[Dataset, ...] = (
    Dataset("scenario/source", "str", ("one",), "1", "the scenario file as given"),
    Dataset(
        "scenario/resolved", "str", ("one",), "1", "the scenario with all defaults and overrides"
    ),
    Dataset("scenario/stages", "str", ("stage",), "1", "names of the loading stages"),
)
"""Only in ``results.h5``; a running run has the same texts as files beside it."""


# ---- What a frame holds: a row for every dataset, which is also an attribute of `Frame`.
#
# A value of the moment is one more row in a class here. What the engine keeps from step to step, or
# makes in every contact, says itself what it is (`model.state.FrameFields`,
# `model.contacts.ContactTable`); its rows follow from that.

Array = NDArray[Any]


def _all(rows: Array) -> Array:
    return rows


def _in_plane(rows: Array) -> Array:
    return rows[:, :2]


def _first(rows: Array) -> Any:
    return rows[0]


def _flags(rows: Array) -> NDArray[np.bool_]:
    return rows.astype(np.bool_)


def _of_frame(
    name: str,
    kind: Callable[[Any], T],
    dtype: DType,
    unit: str,
    meaning: str,
    value: Value,
    exports: tuple[Export, ...] = (),
) -> Column[T]:
    path = f"steps/{name}"
    return Column(
        path,
        dtype,
        ("frame",),
        unit,
        meaning,
        value,
        exports=exports,
        convert=lambda rows: kind(rows[0]),
    )


def _of_grains(
    name: str,
    unit: str,
    meaning: str,
    value: Value,
    dtype: DType = "float",
    exports: tuple[Export, ...] = ("vtk",),
) -> Column[Array]:
    return Column(
        f"particles/{name}", dtype, ("particle_row",), unit, meaning, value, exports=exports
    )


class StepColumns:
    """One row per frame."""

    step = _of_frame(
        "step",
        int,
        "i8",
        "1",
        "steps done since the start of the run",
        lambda m: m.state.step,
        ("vtk",),
    )
    time = _of_frame(
        "time",
        float,
        "f8",
        "s",
        "time since the start of the run",
        lambda m: m.state.time,
        ("gsd",),
    )
    dt = _of_frame(
        "dt", float, "f8", "s", ("length of the last step; impulse/dt is its mean contact force; "
            "0 before it"),
        lambda m: m.state.last_dt, ("vtk", "gsd"),
    )  # fmt: skip
    stage = _of_frame(
        "stage",
        int,
        "i4",
        "1",
        "loading stage, a row of scenario/stages",
        lambda m: m.state.stage,
        ("vtk", "gsd"),
    )
    contacts_recorded = _of_frame(
        "contacts_recorded", bool, "u1", "1",
        "1 if the contacts of the frame are in the file, 0 if not",
        lambda m: m.contacts is not None,
    )  # fmt: skip


class GrainColumns:
    """One row per grain and frame, in the order of the grains."""

    position = Column[Array](
        "particles/position", "float", ("particle_row", 3), "m",
        "centers x, y, z; x wrapped into the period, z = 0",
        lambda m: in_plane(m.state.position), columns=("x", "y"),
        convert=_in_plane, about="centers, x wrapped into the period",
    )  # fmt: skip
    angle = _of_grains(
        "angle", "rad", "rotation since the start of the run", lambda m: m.state.position[:, ANGLE]
    )
    image = _of_grains(
        "image",
        "1",
        "periods by which x was wrapped: x + image*period is unwrapped",
        lambda m: m.state.image,
        "i8",
        (),
    )
    velocity = Column[Array](
        "particles/velocity", "float", ("particle_row", 3), "m/s",
        "velocities x, y, z of the centers; z = 0",
        lambda m: in_plane(m.state.velocity), columns=("velocity_x", "velocity_y"),
        exports=("vtk",),
        convert=_in_plane, about="velocities of the centers",
    )  # fmt: skip
    spin = _of_grains(
        "spin",
        "rad/s",
        "angular velocity, counter-clockwise positive",
        lambda m: m.state.velocity[:, SPIN],
    )
    temperature = Column[Array | None](
        "particles/temperature", "f8", ("particle_row",), "K", "temperature",
        lambda m: m.temperature,
        only_with="heat", exports=("vtk", "gsd"),
    )  # fmt: skip


class WallColumns:
    """One row per frame and wall."""

    wall_position = Column[Array](
        "walls/position", "f8", ("frame", "wall", 3), "m, m, rad",
        "reference point and angle of the wall",
        lambda m: m.state.wall_position, columns=("x", "y", "angle"),
        convert=_first, about="displacement and angle of the walls since the start",
    )  # fmt: skip
    wall_velocity = Column[Array](
        "walls/velocity", "f8", ("frame", "wall", 3), "m/s, m/s, rad/s",
        "velocity and spin of the wall",
        lambda m: m.state.wall_velocity, columns=("velocity_x", "velocity_y", "spin"),
        convert=_first,
    )  # fmt: skip
    wall_surface = Column[Array | None](
        "walls/surface", "f8", ("frame", "wall"), "m/s",
        "velocity of the surface of the wall along it", lambda m: m.wall_surface,
        only_with="surface", since=(1, 3), convert=_first,
    )  # fmt: skip
    wall_temperature = Column[Array | None](
        "walls/temperature", "f8", ("frame", "wall"), "K",
        "temperature of the wall; nan where none is prescribed",
        lambda m: m.state.wall_temperature, finite=False, only_with="heat", convert=_first,
    )  # fmt: skip


class KeptColumns(FrameFields):
    """What frames keep of a state as it is."""


class ContactColumns(ContactTable):
    """One row per contact of the last step and frame, ordered by (i, j)."""

    kind = Column[Array](
        "contacts/kind", "u1", ("contact_row",), "1", "0 grain-grain, 1 grain-wall",
        lambda m: m.table.j >= m.model.grain_count, exports=("vtk",),
    )  # fmt: skip


def _kept_of_grains(name: str, about: Stored) -> Column[Any]:
    exports: tuple[Export, ...] = (
        ("vtk",) if about.only_with == "exchange" else ("vtk", "gsd")
    )  # GSD has those alone that are there
    return Column(
        f"particles/{name}", about.dtype, ("particle_row", *about.dims[1:]), about.unit,
        about.meaning,
        lambda m: getattr(m.state, name), since=about.since, only_with=about.only_with,
        columns=about.columns,
        exports=exports,
    )  # fmt: skip


def _kept_of_walls(name: str, about: Stored) -> Column[Any]:
    return Column(
        f"walls/{name.removeprefix('wall_')}", about.dtype, ("frame", "wall", *about.dims[1:]),
        about.unit, about.meaning,
        lambda m: getattr(m.state, name), since=about.since, only_with=about.only_with,
        columns=about.columns, convert=_first,
    )  # fmt: skip


def _of_contacts(name: str, about: Stored) -> Column[Any]:
    return Column(
        f"contacts/{name}", about.dtype, about.dims, about.unit, about.meaning,
        lambda m: m.of_contacts(getattr(m.table, name)), since=about.since,
        only_with=about.only_with, columns=about.columns,
        exports=about.exports, convert=_flags if about.dtype == "u1" else _all,
    )  # fmt: skip


def _attach(owner: type, columns: dict[str, Column[Any]]) -> tuple[Column[Any], ...]:
    for name, column in columns.items():
        setattr(owner, name, column)
    return tuple(columns.values())


def _rows(owner: type) -> tuple[Column[Any], ...]:
    return tuple(row for row in vars(owner).values() if isinstance(row, Column))


_KEPT = {name: stored_fields(State)[name] for name in FrameFields.__annotations__}
_KEPT_OF_WALLS = {
    name: _kept_of_walls(name, about) for name, about in _KEPT.items() if name.startswith("wall_")
}
_KEPT_OF_GRAINS = {
    name: _kept_of_grains(name, about)
    for name, about in _KEPT.items()
    if name not in _KEPT_OF_WALLS
}
_TABLE = {name: _of_contacts(name, about) for name, about in stored_fields(ContactTable).items()}
_I, _J, *_MORE_OF_CONTACTS = _attach(ContactColumns, _TABLE)

STEPS = _rows(StepColumns)

OFFSETS: tuple[Dataset, ...] = (
    Dataset(
        "steps/particle_offset",
        "i8",
        ("frame_edge",),
        "1",
        "rows offset[k]:offset[k+1] of particles/* are frame k",
    ),
    Dataset(
        "steps/contact_offset",
        "i8",
        ("frame_edge",),
        "1",
        "rows offset[k]:offset[k+1] of contacts/* are frame k",
    ),
)
"""Where the rows of each frame lie."""

PARTICLES = _rows(GrainColumns) + _attach(KeptColumns, _KEPT_OF_GRAINS)

CONTACTS = (_I, _J, ContactColumns.kind, *_MORE_OF_CONTACTS)

WALLS = _rows(WallColumns) + _attach(KeptColumns, _KEPT_OF_WALLS)

FRAME_TABLE = STEPS + OFFSETS + PARTICLES + CONTACTS + WALLS
"""Everything that a frame consists of."""


# ---- The time series: a row for every dataset.
#
# A value of the moment is one more row here. The numbers that the engine keeps say themselves what
# they are (`model.books`).


def _scalar(
    name: str,
    unit: str,
    long_name: str,
    value: Value,
    dtype: DType = "f8",
    *,
    only_with: Feature | None = None,
    since: Version = (1, 0),
) -> Dataset:
    return Dataset(
        f"series/{name}",
        dtype,
        ("series_row",),
        unit,
        long_name,
        value,
        only_with=only_with,
        since=since,
    )


def _array(
    name: str,
    dims: Shape,
    unit: str,
    long_name: str,
    value: Value,
    columns: tuple[str, ...],
    *,
    only_with: Feature | None = None,
    since: Version = (1, 0),
) -> Dataset:
    path, shape = f"series/{name}", ("series_row", *dims)
    return Dataset(
        path, "f8", shape, unit, long_name, value, only_with=only_with, since=since, columns=columns
    )


def _kept(
    entries: tuple[Entry, ...],
    values: Callable[[Snapshot], dict[str, float]],
    only_with: Feature | None = None,
) -> tuple[Dataset, ...]:
    """Rows of the numbers that the engine keeps, as far as they are in the time series."""

    def row(entry: Entry, series: str) -> Dataset:
        def value(moment: Snapshot) -> float:
            return moment.per_step(entry.name) if entry.per_step else values(moment)[entry.name]

        return _scalar(
            series,
            entry.unit,
            entry.meaning,
            value,
            entry.dtype,
            only_with=only_with,
            since=entry.since,
        )

    return tuple(row(entry, entry.series) for entry in entries if entry.series is not None)


SERIES: tuple[Dataset, ...] = (
    _scalar("step", "1", "steps done since the start of the run", lambda m: m.state.step, "i8"),
    _scalar("time", "s", "time since the start of the run, the end of the window",
        lambda m: m.state.time),
    _scalar("stage", "1", "loading stage, a row of scenario/stages", lambda m: m.state.stage, "i4"),
    _scalar("strain", "1", "shear strain accumulated in this stage",
        lambda m: m.state.stage_strain),
    *_kept(BOOKS, lambda m: m.books),
    *_kept(measures_first(TALLIES), lambda m: m.tallies),
    *_kept(WINDOW, lambda m: m.window),
    _array(
        "virial_rate", (2, 2), "N m",
        ("window mean of sum f_a l_b over grain-grain contacts, l from j to i; over an area: mean "
            "stress, compression positive"),
        lambda m: m.rate(m.virial), ("virial_xx", "virial_xy", "virial_yx", "virial_yy"),
    ),
    _array(
        "wall_force", ("wall", 3), "N, N, N m", ("window mean of the force and torque exerted by "
            "the grains on each wall"),
        lambda m: m.rate(m.state.window_wall_impulse), ("force_x", "force_y", "torque"),
    ),
    _array(
        "wall_position", ("wall", 3), "m, m, rad", "reference point and angle of the wall",
        lambda m: m.state.wall_position, ("x", "y", "angle"),
    ),
    _array(
        "wall_velocity", ("wall", 3), "m/s, m/s, rad/s", "velocity and spin of the wall",
        lambda m: m.state.wall_velocity, ("velocity_x", "velocity_y", "spin"),
    ),
    _array(
        "wall_surface", ("wall",), "m/s", "velocity of the surface of the wall along it",
        lambda m: m.wall_surface, (), only_with="surface", since=(1, 3),
    ),
    *_kept(HEAT_BOOKS, lambda m: m.heat_books, "heat"),
    _scalar(
        "temperature_mean", "K", "mean temperature of the grains, weighted by heat capacity",
        lambda m: m.temperatures_here[0], only_with="heat",
    ),
    _scalar("temperature_min", "K", "lowest temperature of a grain",
        lambda m: m.temperatures_here[1], only_with="heat"),
    _scalar("temperature_max", "K", "highest temperature of a grain",
        lambda m: m.temperatures_here[2], only_with="heat"),
    _array(
        "wall_heat", ("wall", 2), "J",
        "heat given to the grains; heat of friction and impacts received",
        lambda m: m.state.wall_heat, ("heat_given", "heat_received"), only_with="heat",
    ),
    *_kept(EXCHANGE_BOOKS, lambda m: m.exchange, "exchange"),
    _array(
        "outlet_flow", ("outlet", 2), "1, kg",
        "grains and mass that left through each outlet since the start",
        lambda m: m.state.outlet_flow, ("grains", "mass"), only_with="exchange", since=(1, 2),
    ),
)  # fmt: skip
"""One row per point of the time series, which has its own, denser cadence than the frames."""
