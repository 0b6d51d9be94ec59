"""What a frame holds: a row for every dataset, which is also the attribute by which `Frame` gives it.

A value of the moment is one more row in a class here. What the engine keeps from step to step, or makes in every contact, says
itself what it is (`model.state.FrameFields`, `model.contacts.ContactTable`); its rows follow from that.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.books import DType, Export, Stored, stored_fields
from multicor_cli.model.columns import ANGLE, SPIN
from multicor_cli.model.contacts import ContactTable
from multicor_cli.model.state import FrameFields, State
from multicor_cli.store.moment import in_plane
from multicor_cli.store.schema.rows import Column, Dataset, Value

Array = NDArray[Any]
T = TypeVar("T")


def _all(rows: Array) -> Array:
    return rows


def _in_plane(rows: Array) -> Array:
    return rows[:, :2]


def _first(rows: Array) -> Any:
    return rows[0]


def _flags(rows: Array) -> NDArray[np.bool_]:
    return rows.astype(np.bool_)


def _of_frame(
    name: str, kind: Callable[[Any], T], dtype: DType, unit: str, meaning: str, value: Value, exports: tuple[Export, ...] = ()
) -> Column[T]:
    path = f"steps/{name}"
    return Column(path, dtype, ("frame",), unit, meaning, value, exports=exports, convert=lambda rows: kind(rows[0]))


def _of_grains(
    name: str, unit: str, meaning: str, value: Value, dtype: DType = "float", exports: tuple[Export, ...] = ("vtk",)
) -> Column[Array]:
    return Column(f"particles/{name}", dtype, ("particle_row",), unit, meaning, value, exports=exports)


class StepColumns:
    """One row per frame."""

    step = _of_frame("step", int, "i8", "1", "steps done since the start of the run", lambda m: m.state.step, ("vtk",))
    time = _of_frame("time", float, "f8", "s", "time since the start of the run", lambda m: m.state.time, ("gsd",))
    dt = _of_frame(
        "dt", float, "f8", "s", "length of the last step; impulse/dt is its mean contact force; 0 before it",
        lambda m: m.state.last_dt, ("vtk", "gsd"),
    )  # fmt: skip
    stage = _of_frame("stage", int, "i4", "1", "loading stage, a row of scenario/stages", lambda m: m.state.stage, ("vtk", "gsd"))
    contacts_recorded = _of_frame(
        "contacts_recorded", bool, "u1", "1", "1 if the contacts of the frame are in the file, 0 if not",
        lambda m: m.contacts is not None,
    )  # fmt: skip


class GrainColumns:
    """One row per grain and frame, in the order of the grains."""

    position = Column[Array](
        "particles/position", "float", ("particle_row", 3), "m", "centers x, y, z; x wrapped into the period, z = 0",
        lambda m: in_plane(m.state.position), columns=("x", "y"),
        convert=_in_plane, about="centers, x wrapped into the period",
    )  # fmt: skip
    angle = _of_grains("angle", "rad", "rotation since the start of the run", lambda m: m.state.position[:, ANGLE])
    image = _of_grains(
        "image", "1", "periods by which x was wrapped: x + image*period is unwrapped", lambda m: m.state.image, "i8", ()
    )
    velocity = Column[Array](
        "particles/velocity", "float", ("particle_row", 3), "m/s", "velocities x, y, z of the centers; z = 0",
        lambda m: in_plane(m.state.velocity), columns=("velocity_x", "velocity_y"), exports=("vtk",),
        convert=_in_plane, about="velocities of the centers",
    )  # fmt: skip
    spin = _of_grains("spin", "rad/s", "angular velocity, counter-clockwise positive", lambda m: m.state.velocity[:, SPIN])
    temperature = Column[Array | None](
        "particles/temperature", "f8", ("particle_row",), "K", "temperature", lambda m: m.temperature,
        only_with="heat", exports=("vtk", "gsd"),
    )  # fmt: skip


class WallColumns:
    """One row per frame and wall."""

    wall_position = Column[Array](
        "walls/position", "f8", ("frame", "wall", 3), "m, m, rad", "reference point and angle of the wall",
        lambda m: m.state.wall_position, columns=("x", "y", "angle"),
        convert=_first, about="displacement and angle of the walls since the start",
    )  # fmt: skip
    wall_velocity = Column[Array](
        "walls/velocity", "f8", ("frame", "wall", 3), "m/s, m/s, rad/s", "velocity and spin of the wall",
        lambda m: m.state.wall_velocity, columns=("velocity_x", "velocity_y", "spin"), convert=_first,
    )  # fmt: skip
    wall_surface = Column[Array | None](
        "walls/surface", "f8", ("frame", "wall"), "m/s", "velocity of the surface of the wall along it", lambda m: m.wall_surface,
        only_with="surface", since=(1, 3), convert=_first,
    )  # fmt: skip
    wall_temperature = Column[Array | None](
        "walls/temperature", "f8", ("frame", "wall"), "K", "temperature of the wall; nan where none is prescribed",
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
    """The row of what a state has for each grain."""
    exports: tuple[Export, ...] = (
        ("vtk",) if about.only_with == "exchange" else ("vtk", "gsd")
    )  # GSD has those alone that are there
    return Column(
        f"particles/{name}", about.dtype, ("particle_row", *about.dims[1:]), about.unit, about.meaning,
        lambda m: getattr(m.state, name), since=about.since, only_with=about.only_with, columns=about.columns,
        exports=exports,
    )  # fmt: skip


def _kept_of_walls(name: str, about: Stored) -> Column[Any]:
    """The row of what a state has for each wall."""
    return Column(
        f"walls/{name.removeprefix('wall_')}", about.dtype, ("frame", "wall", *about.dims[1:]), about.unit, about.meaning,
        lambda m: getattr(m.state, name), since=about.since, only_with=about.only_with, columns=about.columns, convert=_first,
    )  # fmt: skip


def _of_contacts(name: str, about: Stored) -> Column[Any]:
    """The row of what a table of contacts has."""
    return Column(
        f"contacts/{name}", about.dtype, about.dims, about.unit, about.meaning,
        lambda m: m.of_contacts(getattr(m.table, name)), since=about.since, only_with=about.only_with, columns=about.columns,
        exports=about.exports, convert=_flags if about.dtype == "u1" else _all,
    )  # fmt: skip


def _attach(owner: type, columns: dict[str, Column[Any]]) -> tuple[Column[Any], ...]:
    """Make columns attributes of a class, by their names."""
    for name, column in columns.items():
        setattr(owner, name, column)
    return tuple(columns.values())


def _rows(owner: type) -> tuple[Column[Any], ...]:
    """The columns that a class has of its own, in order."""
    return tuple(row for row in vars(owner).values() if isinstance(row, Column))


_KEPT = {name: stored_fields(State)[name] for name in FrameFields.__annotations__}
_KEPT_OF_WALLS = {name: _kept_of_walls(name, about) for name, about in _KEPT.items() if name.startswith("wall_")}
_KEPT_OF_GRAINS = {name: _kept_of_grains(name, about) for name, about in _KEPT.items() if name not in _KEPT_OF_WALLS}
_TABLE = {name: _of_contacts(name, about) for name, about in stored_fields(ContactTable).items()}
_I, _J, *_MORE_OF_CONTACTS = _attach(ContactColumns, _TABLE)

STEPS = _rows(StepColumns)
"""One row per frame."""

OFFSETS: tuple[Dataset, ...] = (
    Dataset("steps/particle_offset", "i8", ("frame_edge",), "1", "rows offset[k]:offset[k+1] of particles/* are frame k"),
    Dataset("steps/contact_offset", "i8", ("frame_edge",), "1", "rows offset[k]:offset[k+1] of contacts/* are frame k"),
)
"""Where the rows of each frame lie."""

PARTICLES = _rows(GrainColumns) + _attach(KeptColumns, _KEPT_OF_GRAINS)
"""One row per grain and frame, in the order of the grains."""

CONTACTS = (_I, _J, ContactColumns.kind, *_MORE_OF_CONTACTS)
"""One row per contact of the last step and frame, ordered by (i, j)."""

WALLS = _rows(WallColumns) + _attach(KeptColumns, _KEPT_OF_WALLS)
"""One row per frame and wall."""

FRAME_TABLE = STEPS + OFFSETS + PARTICLES + CONTACTS + WALLS
"""Everything that a frame consists of."""
