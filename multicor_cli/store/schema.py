"""The tables of every dataset in the files of a run, one row each.

A row says what a dataset is, where its values come from, and what shows it; writers, readers and
exports follow the tables. Rows that only some runs have name the feature of the run that they
belong to; a run with that feature has all of them, a run without it none (`select`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Set
from dataclasses import dataclass, fields
from operator import attrgetter
from typing import Any, Generic, NoReturn, Protocol, Self, TypeVar, cast, overload

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model import Model
from multicor_cli.model.books import (
    ADHESION_BOOKS,
    BOOKS,
    COUNTS_LAST,
    EXCHANGE_BOOKS,
    FLUX_BOOKS,
    GRADIENT_BOOKS,
    GROWTH_BOOKS,
    HEAT_BOOKS,
    WINDOW,
    Dim,
    DType,
    Entry,
    Export,
    Feature,
    Shape,
    Stored,
    Version,
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


@dataclass(frozen=True, kw_only=True)
class Dataset(Stored):
    """One row of a table.

    Attributes:
        path: Name inside the file, without the leading slash.
        value: What is stored of a moment; None where the writer or a getter of its own knows.
        finite: Whether every value must be finite.
    """

    path: str
    value: Value | None = None
    finite: bool = True

    @classmethod
    def of(cls, about: Stored, path: str, **changes: Any) -> Self:
        """The row of a field that says itself what it is, but for ``changes``."""
        said = {field.name: getattr(about, field.name) for field in fields(Stored)}
        return cls(**{**said, "path": path, **changes})

    @property
    def name(self) -> str:
        return self.path.rsplit("/", 1)[-1]

    @property
    def row(self) -> Dim | int:
        return self.dims[0]

    def shape(self, lengths: Mapping[str, int]) -> tuple[int, ...]:
        """The shape, where dimensions have these lengths; others are 0."""
        return tuple(dim if isinstance(dim, int) else lengths.get(dim, 0) for dim in self.dims)


def read_only(value: T) -> T:
    """A view of an array that cannot be written to; anything else as it is."""
    if isinstance(value, np.ndarray):
        value = cast("T", value.view())
        cast("NDArray[Any]", value).flags.writeable = False
    return value


class Reader(Protocol):
    """What has columns: a frame, and its contacts."""

    def read(self, column: Column[T]) -> T:
        """The rows of a dataset that belong to it."""


@dataclass(frozen=True, kw_only=True)
class Column(Dataset, Generic[T]):
    """A row about frames, which is also a frame's attribute: read when it is first used, and kept.

    Arrays are read-only: who changed one would change what others find there later.

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
            kept[self.path] = read_only(reader.read(self))
        return kept[self.path]

    def __set__(self, reader: Reader, value: object) -> NoReturn:
        raise AttributeError(f"{self.path} is read from a file")


_SYMBOLS = {"particle_row": "n", "contact_row": "c", "wall": "w"}


def _describe(column: Column[Any]) -> str:
    name = column.about or column.meaning
    dims = [_SYMBOLS.get(str(d), str(d)) for d in column.dims if d != "frame"]
    if column.columns:
        dims[-1] = str(len(column.columns))
    text = name[0].upper() + name[1:]
    text += f" [{column.unit}]" if column.unit != "1" else ""
    text += f", shape ``({', '.join(dims)}{',' * (len(dims) == 1)})``" if dims else ""
    text += f"; None in a run without {column.only_with}" if column.only_with else ""
    if column.since > (1, 0):
        text += f"; None in a run of an older format than {column.since[0]}.{column.since[1]}"
    return text


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
        "softening": laws.softening_rate.size > 0,
        "adhesion": laws.adhesion.size > 0,
        "rolling": laws.rolling.size > 0,
        "exchange": model.outlets is not None,
        "surface": model.walls.runs.size > 0,
        "groups": model.walls.meets.size > 0,
        "motion": model.start_speed > 0.0,
        "range": laws.adhesion_range.size > 0,
        "cell": model.is_cell,
        "gradient": any(model.heat_gradient),
        "flux": model.thermal is not None and not model.is_cell,
        "flash": laws.flash_speed.size > 0,
        "expansion": model.expansion.size > 0,
        "outlines": model.outlines is not None,
    }
    return frozenset(feature for feature, is_there in found.items() if is_there)


# ---- What is written once: the model and the scenario of a run


def _of_model(
    name: str, dtype: DType, dims: Shape, unit: str, meaning: str, where: str = "", **more: Any
) -> Dataset:
    """A row of the model; ``where`` it is there, if not in the part, or under the name, of here."""
    value = attrgetter(f"model.{where or name.replace('/', '.')}")
    return Dataset(
        dtype=dtype,
        dims=dims,
        unit=unit,
        meaning=meaning,
        path=f"model/{name}",
        value=value,
        **more,
    )


def _law(name: str, unit: str, meaning: str, dtype: DType = "f8", **more: Any) -> Dataset:
    return _of_model(f"laws/{name}", dtype, ("material", "material"), unit, meaning, **more)


def _outline(name: str, dims: Shape, unit: str, meaning: str, dtype: DType = "f8") -> Dataset:
    return _of_model(
        f"outlines/{name}", dtype, dims, unit, meaning, only_with="outlines", since=(1, 12)
    )


def _thermal(name: str, unit: str, meaning: str, where: str = "") -> Dataset:
    return _of_model(f"thermal/{name}", "f8", ("grain",), unit, meaning, where, only_with="heat")


MODEL: tuple[Dataset, ...] = (
    _of_model("radius", "f8", ("grain",), "m", "radius of each grain", "grains.radius"),
    _of_model("mass", "f8", ("grain",), "kg", "mass of each grain", "grains.mass"),
    _of_model("inertia", "f8", ("grain",), "kg m2",
        "moment of inertia of each grain about its center", "grains.inertia"),
    _of_model("material", "i4", ("grain",), "1",
        "material of each grain, a row of model/material_names", "grains.material"),
    _of_model("group", "i4", ("grain",), "1",
        "particle group of each grain, a row of model/group_names", "grains.group"),
    _of_model("material_names", "str", ("material",), "1", "names of the materials", "materials"),
    _of_model("group_names", "str", ("group",), "1", "names of the particle groups", "groups"),
    _of_model("walls/names", "str", ("wall",), "1", "names of the walls"),
    _of_model("walls/mass", "f8", ("wall",), "kg",
        "mass that a load moves; nan if none was given", finite=False),
    _of_model("walls/inertia", "f8", ("wall",), "kg m2",
        "moment of inertia of a wall; nan if none", finite=False),
    _of_model("walls/has_gravity", "u1", ("wall",), "1",
        "whether gravity acts on the wall: 0 or 1"),
    _of_model("walls/length", "f8", ("wall",), "m",
        "length over which a load on the wall spreads"),
    _of_model("walls/runs", "u1", ("wall",), "1",
        "whether a drive lets the surface of the wall run along it: 0 or 1",
        only_with="surface", since=(1, 3)),
    _of_model("walls/meets", "u1", ("wall", "group"), "1",
        "whether grains of the group meet the wall: 0 (they pass through) or 1",
        only_with="groups", since=(1, 3)),
    _of_model("shapes/kind", "i4", ("shape",), "1",
        ", ".join(f"{kind:d} {shape.name}" for kind, shape in SHAPES.items())),
    _of_model("shapes/wall", "i4", ("shape",), "1",
        "wall that carries the shape, a row of model/walls/names"),
    _of_model("shapes/geometry", "f8", ("shape", 4), "m",
        "four numbers in the frame of the wall; see the table of kinds"),
    _of_model("shapes/material", "i4", ("shape",), "1",
        "material of the shape, a row of model/material_names"),
    _law("friction", "1", "coefficient of friction where laws/table is -1"),
    _law("restitution", "1", "coefficient of normal restitution"),
    _law("table", "1", "table of friction against sliding speed, or -1", "i4"),
    _of_model("laws/table_start", "i4", ("table_edge",), "1",
        "first row of each table in the two below"),
    _of_model("laws/table_speed", "f8", ("table_row",), "m/s",
        "sliding speeds, ascending within a table"),
    _of_model("laws/table_friction", "f8", ("table_row",), "1",
        "coefficient of friction at these speeds"),
    _law("softening_rate", "1/K", "c of mu = mu0 (1 - c (T - T_r)); 0 for pairs without it",
        only_with="softening"),
    _law("softening_start", "K", "temperature T_r at which mu = mu0", only_with="softening"),
    _law("softening_lowest", "1", "smallest coefficient of friction", only_with="softening"),
    _law("softening_highest", "1", "largest coefficient of friction", only_with="softening"),
    _law("flash_speed", "m/s",
        "V_w of friction that weakens by flash heating, at flash_reference; inf without",
        only_with="flash", since=(1, 10), finite=False),
    _law("flash_weakened", "1", "coefficient of friction f_w to which it falls",
        only_with="flash", since=(1, 10)),
    _law("flash_limit", "K", "temperature T_w at which V_w is 0; inf where it is constant",
        only_with="flash", since=(1, 10), finite=False),
    _law("flash_reference", "K", "temperature T_r to which flash_speed belongs",
        only_with="flash", since=(1, 10)),
    _law("adhesion", "N", "tension that a contact bears", only_with="adhesion", since=(1, 1)),
    _law("rolling", "1", "coefficient of rolling resistance", only_with="rolling", since=(1, 1)),
    _law("adhesion_range", "m", "gap across which adhesion ends", only_with="range", since=(1, 7)),
    _law("is_wet", "1",
        "1 where adhesion is that of bridges of liquid, which begin when bodies touch", "u1",
        only_with="range", since=(1, 7)),
    _thermal("capacity", "J/K", "heat capacity of each grain"),
    _thermal("start", "K", "temperature of each grain at the start of the run",
        "thermal.initial_temperature"),
    _thermal("surface", "m2", "area through which each grain meets fluid and surroundings"),
    _of_model("outlets", "str", ("outlet",), "1", "names of the outlets",
        only_with="exchange", since=(1, 2)),
    _of_model("start_speed", "f8", ("one",), "m/s",
        "speed of the fastest grain, surface of a grain or wall at the start, but for the shear "
        "that walls impose", only_with="motion", since=(1, 3)),
    _of_model("period", "f8", ("one",), "m", "period in x; 0 if the domain is not periodic"),
    _of_model("height", "f8", ("one",), "m",
        "period in y at the start of a cell that is periodic in both directions, and whose period "
        "in x is also that at the start; the one wall of its model, without shapes, is the cell: "
        "its position are width, height and tilt [m], its velocity is the velocity gradient (xx, "
        "yy, xy) [1/s], its force the stress times the area (xx, yy, xy) [N m]",
        only_with="cell", since=(1, 8)),
    _of_model("heat_gradient", "f8", (2,), "K/m",
        "mean gradient of temperature in a cell (x, y); temperatures are those beside it, T - G.r",
        only_with="gradient", since=(1, 9)),
    _of_model("expansion", "f8", ("material",), "1/K",
        "coefficient of linear thermal expansion of each material; radii are those at the start",
        only_with="expansion", since=(1, 10)),
    _of_model("sheds", "u1", ("one",), "1",
        "whether grains lose the volume that they wear off, and its mass: 0 or 1",
        only_with="expansion", since=(1, 10)),
    _outline("piece", ("grain_edge",), "1", "first piece of each grain, in the four below", "i4"),
    _outline("start", ("piece_edge",), "1", "first corner of each piece", "i4"),
    _outline("corner", ("corner", 2), "m",
        "corners of the cores, counter-clockwise, from the center of mass at angle 0"),
    _outline("rounding", ("piece",), "m", "how far a piece reaches beyond its core"),
    _outline("area", ("grain",), "m2", "area of each grain"),
    _outline("perimeter", ("grain",), "m", "length of the outline of each grain"),
    _of_model("gravity", "f8", (2,), "m/s2", "acceleration of gravity (x, y)"),
    _of_model("shape_factor", "f8", ("one",), "1",
        "m a2/I of every grain: 2 for discs, 5/2 for spheres"),
)  # fmt: skip
"""Written once (`model.Model`)."""


def _text(name: str, dim: Dim, meaning: str) -> Dataset:
    return Dataset(dtype="str", dims=(dim,), unit="1", meaning=meaning, path=f"scenario/{name}")


SCENARIO = (
    _text("source", "one", "the scenario file as given"),
    _text("resolved", "one", "the scenario with all defaults and overrides"),
    _text("stages", "stage", "names of the loading stages"),
)
"""Only in ``results.h5``; a running run has the same texts as files beside it."""


# ---- What a frame holds: a row for every dataset, which is also an attribute of `Frame`.
#
# A value of the moment is one more row in a class here. What the engine keeps from step to step, or
# makes in every contact, says itself what it is (`model.state.FrameFields`,
# `model.contacts.ContactTable`); its rows follow from that.

Array = NDArray[Any]

_FIRST_DIMS: dict[str, Shape] = {
    "steps": ("frame",),
    "particles": ("particle_row",),
    "contacts": ("contact_row",),
    "walls": ("frame", "wall"),
}
_CONVERT: dict[str, Callable[[Array], Any]] = {
    "steps": lambda rows: rows[0].item(),
    "particles": lambda rows: rows,
    "contacts": lambda rows: rows,
    "walls": lambda rows: rows[0],
}
"""What an attribute is made of the rows of a frame, by the group of the dataset."""


def _column(
    path: str,
    dtype: DType,
    unit: str,
    meaning: str,
    value: str | Value,
    dims: Shape = (),
    **more: Any,
) -> Column[Any]:
    """A row about frames; ``value``: a getter, or its place in a moment; ``dims``: further ones."""
    group = path.partition("/")[0]
    return Column(
        dtype=dtype,
        dims=(*_FIRST_DIMS[group], *dims),
        unit=unit,
        meaning=meaning,
        path=path,
        value=attrgetter(value) if isinstance(value, str) else value,
        **{"convert": _CONVERT[group], **more},
    )


class StepColumns:
    """One row per frame."""

    step: Column[int] = _column("steps/step", "i8", "1",
        "steps done since the start of the run", "state.step", exports=("vtk",))  # fmt: skip
    time: Column[float] = _column("steps/time", "f8", "s",
        "time since the start of the run", "state.time", exports=("gsd",))  # fmt: skip
    dt: Column[float] = _column("steps/dt", "f8", "s",
        "length of the last step; impulse/dt is its mean contact force; 0 before it",
        "state.last_dt", exports=("vtk", "gsd"))  # fmt: skip
    stage: Column[int] = _column("steps/stage", "i4", "1",
        "loading stage, a row of scenario/stages", "state.stage",
        exports=("vtk", "gsd"))  # fmt: skip
    contacts_recorded: Column[bool] = _column("steps/contacts_recorded", "u1", "1",
        "1 if the contacts of the frame are in the file, 0 if not",
        lambda m: m.contacts is not None, convert=lambda rows: bool(rows[0]))  # fmt: skip


class GrainColumns:
    """One row per grain and frame, in the order of the grains."""

    position: Column[Array] = _column("particles/position", "float", "m",
        "centers x, y, z; x wrapped into the period, z = 0", lambda m: in_plane(m.state.position),
        (3,), columns=("x", "y"), convert=lambda rows: rows[:, :2],
        about="centers, x wrapped into the period")  # fmt: skip
    angle: Column[Array] = _column("particles/angle", "float", "rad",
        "rotation since the start of the run; of grains that are no discs, that of their outlines",
        lambda m: m.state.position[:, ANGLE],
        exports=("vtk",))  # fmt: skip
    image: Column[Array] = _column("particles/image", "i8", "1",
        "periods by which x was wrapped: x + image*period is unwrapped", "state.image")  # fmt: skip
    velocity: Column[Array] = _column("particles/velocity", "float", "m/s",
        "velocities x, y, z of the centers; z = 0", lambda m: in_plane(m.velocity), (3,),
        columns=("velocity_x", "velocity_y"), convert=lambda rows: rows[:, :2], exports=("vtk",),
        about="velocities of the centers")  # fmt: skip
    spin: Column[Array] = _column("particles/spin", "float", "rad/s",
        "angular velocity, counter-clockwise positive", lambda m: m.state.velocity[:, SPIN],
        exports=("vtk",))  # fmt: skip
    temperature: Column[Array | None] = _column("particles/temperature", "f8", "K",
        "temperature; beside the mean gradient where a cell has one, T - G.r",
        "temperature", only_with="heat", exports=("vtk", "gsd"))  # fmt: skip


class WallColumns:
    """One row per frame and wall."""

    wall_position: Column[Array] = _column("walls/position", "f8", "m, m, rad",
        "reference point and angle of the wall", "state.wall_position", (3,),
        columns=("x", "y", "angle"),
        about="displacement and angle of the walls since the start")  # fmt: skip
    wall_velocity: Column[Array] = _column("walls/velocity", "f8", "m/s, m/s, rad/s",
        "velocity and spin of the wall", "state.wall_velocity", (3,),
        columns=("velocity_x", "velocity_y", "spin"))  # fmt: skip
    wall_surface: Column[Array | None] = _column("walls/surface", "f8", "m/s",
        "velocity of the surface of the wall along it", "wall_surface",
        only_with="surface", since=(1, 3))  # fmt: skip
    wall_temperature: Column[Array | None] = _column("walls/temperature", "f8", "K",
        "temperature of the wall; nan where none is prescribed", "state.wall_temperature",
        finite=False, only_with="heat")  # fmt: skip


class KeptColumns(FrameFields):
    """What frames keep of a state as it is."""


class ContactColumns(ContactTable):
    """One row per contact of the last step and frame, ordered by (i, j)."""

    kind: Column[Array] = _column("contacts/kind", "u1", "1", "0 grain-grain, 1 grain-wall",
        lambda m: m.table.j >= m.model.grain_count, exports=("vtk",))  # fmt: skip


def _kept(name: str) -> Column[Any]:
    """The row of a field of `State` for each grain or wall."""
    about = stored_fields(State)[name]
    group = "walls" if name.startswith("wall_") else "particles"
    # GSD has those alone that are there
    shown: tuple[Export, ...] = ("vtk",) if about.only_with == "exchange" else ("vtk", "gsd")
    shown = () if name == "radius" else shown  # which they show of all runs
    return Column.of(
        about,
        f"{group}/{name.removeprefix('wall_')}",
        dims=(*_FIRST_DIMS[group], *about.dims[1:]),
        value=attrgetter(f"state.{name}"),
        exports=shown if group == "particles" else (),
        convert=_CONVERT[group],
    )


def _of_contacts(name: str, about: Stored) -> Column[Any]:
    columns = (len(about.columns),) if about.columns else ()
    as_flags = (lambda rows: rows.astype(np.bool_)) if about.dtype == "u1" else _CONVERT["contacts"]
    return Column.of(
        about,
        f"contacts/{name}",
        value=lambda m: m.of_contacts(getattr(m.table, name), columns),
        convert=as_flags,
    )


def _attach(owner: type, columns: dict[str, Column[Any]]) -> tuple[Column[Any], ...]:
    for name, column in columns.items():
        setattr(owner, name, column)
    return tuple(columns.values())


def _rows(owner: type) -> tuple[Column[Any], ...]:
    return tuple(row for row in vars(owner).values() if isinstance(row, Column))


_KEPT = {name: _kept(name) for name in FrameFields.__annotations__}
_I, _J, *_MORE_OF_CONTACTS = _attach(
    ContactColumns,
    {name: _of_contacts(name, about) for name, about in stored_fields(ContactTable).items()},
)

STEPS = _rows(StepColumns)

OFFSETS = tuple(
    Dataset(
        dtype="i8",
        dims=("frame_edge",),
        unit="1",
        meaning=f"rows offset[k]:offset[k+1] of {kind}s/* are frame k",
        path=f"steps/{kind}_offset",
    )
    for kind in ("particle", "contact")
)
"""Where the rows of each frame lie."""

OFFSET_OF = dict(zip(("particle_row", "contact_row"), OFFSETS, strict=True))
"""By the rows that it counts."""

COUNTED = {"steps/particle_offset": "particles/angle", "steps/contact_offset": "contacts/gap"}
"""A dataset with the rows that each of them counts."""

PARTICLES = _rows(GrainColumns) + _attach(
    KeptColumns, {name: row for name, row in _KEPT.items() if row.row == "particle_row"}
)

CONTACTS = (_I, _J, ContactColumns.kind, *_MORE_OF_CONTACTS)

WALLS = _rows(WallColumns) + _attach(
    KeptColumns, {name: row for name, row in _KEPT.items() if row.row == "frame"}
)

FRAME_TABLE = STEPS + OFFSETS + PARTICLES + CONTACTS + WALLS
"""Everything that a frame consists of."""


# ---- The time series: a row for every dataset.
#
# A value of the moment is one more row here. The numbers that the engine keeps say themselves what
# they are (`model.books`).


def _series(
    name: str,
    unit: str,
    meaning: str,
    value: str | Value,
    dims: Shape = (),
    columns: tuple[str, ...] = (),
    *,
    dtype: DType = "f8",
    **more: Any,
) -> Dataset:
    """A row of the series; ``value``: a getter, or its place in a moment; ``dims``: per point."""
    return Dataset(
        dtype=dtype,
        dims=("series_row", *dims),
        unit=unit,
        meaning=meaning,
        columns=columns,
        path=f"series/{name}",
        value=attrgetter(value) if isinstance(value, str) else value,
        **more,
    )


def _kept_numbers(
    entries: tuple[Entry, ...], where: str, only_with: Feature | None = None
) -> tuple[Dataset, ...]:
    """Rows of the numbers that the engine keeps, as far as they are in the time series."""

    def row(entry: Entry) -> Dataset:
        def value(moment: Snapshot) -> float:
            name = entry.name
            return moment.per_step(name) if entry.per_step else moment.numbers[where][name]

        return Dataset.of(
            entry, f"series/{entry.series}", dims=("series_row",), value=value, only_with=only_with
        )

    return tuple(row(entry) for entry in entries if entry.series is not None)


SERIES: tuple[Dataset, ...] = (
    _series("step", "1", "steps done since the start of the run", "state.step", dtype="i8"),
    _series("time", "s", "time since the start of the run, the end of the window", "state.time"),
    _series("stage", "1", "loading stage, a row of scenario/stages", "state.stage", dtype="i4"),
    _series("strain", "1", "shear strain accumulated in this stage", "state.stage_strain"),
    *_kept_numbers(BOOKS, "books"),
    *_kept_numbers(COUNTS_LAST, "tallies"),
    *_kept_numbers(WINDOW, "window"),
    _series("virial_rate", "N m",
        "window mean of sum f_a l_b over grain-grain contacts, l from j to i; over an area: mean "
        "stress, compression positive",
        lambda m: m.rate(m.virial), (2, 2), ("virial_xx", "virial_xy", "virial_yx", "virial_yy")),
    _series("wall_force", "N, N, N m",
        "window mean of the force and torque exerted by the grains on each wall",
        lambda m: m.rate(m.state.window_wall_impulse), ("wall", 3),
        ("force_x", "force_y", "torque")),
    _series("wall_position", "m, m, rad", "reference point and angle of the wall",
        "state.wall_position", ("wall", 3), ("x", "y", "angle")),
    _series("wall_velocity", "m/s, m/s, rad/s", "velocity and spin of the wall",
        "state.wall_velocity", ("wall", 3), ("velocity_x", "velocity_y", "spin")),
    _series("wall_surface", "m/s", "velocity of the surface of the wall along it",
        "wall_surface", ("wall",), only_with="surface", since=(1, 3)),
    *_kept_numbers(HEAT_BOOKS, "heat_books", "heat"),
    _series("temperature_mean", "K",
        "mean temperature of the grains, weighted by heat capacity; 0 if none is there",
        lambda m: m.temperatures_here[0], only_with="heat"),
    _series("temperature_min", "K", "lowest temperature of a grain; 0 if none is there",
        lambda m: m.temperatures_here[1], only_with="heat"),
    _series("temperature_max", "K", "highest temperature of a grain; 0 if none is there",
        lambda m: m.temperatures_here[2], only_with="heat"),
    _series("wall_heat", "J", "heat given to the grains; heat of friction and impacts received",
        "state.wall_heat", ("wall", 2), ("heat_given", "heat_received"), only_with="heat"),
    *_kept_numbers(EXCHANGE_BOOKS, "exchange", "exchange"),
    *_kept_numbers(ADHESION_BOOKS, "adhesion_books", "range"),
    *_kept_numbers(GROWTH_BOOKS, "growth_books", "expansion"),
    *_kept_numbers(GRADIENT_BOOKS, "gradient_books", "gradient"),
    *_kept_numbers(FLUX_BOOKS, "flux_books", "flux"),
    _series("outlet_flow", "1, kg",
        "grains and mass that left through each outlet since the start", "state.outlet_flow",
        ("outlet", 2), ("grains", "mass"), only_with="exchange", since=(1, 2)),
)  # fmt: skip
"""One row per point of the time series, which has its own, denser cadence than the frames."""

# ---- Tables of whole files

SEGMENT_TABLE = FRAME_TABLE + SERIES

RESULTS_TABLE = SCENARIO + MODEL + FRAME_TABLE + SERIES

DATASETS = {row.path: row for row in RESULTS_TABLE}
"""By path."""

CHECKPOINT = tuple(
    Dataset.of(about, f"state/{name}", finite=False, only_with=None)
    for name, about in stored_fields(State).items()
)
"""Everything in a checkpoint: the fields of `State`; those of heat are empty in runs without."""

FORMAT_VERSION = max(row.since for row in RESULTS_TABLE + CHECKPOINT)
"""Major and minor version of the file format, in which the newest dataset appeared. A reader
refuses another major version and ignores unknown datasets."""
