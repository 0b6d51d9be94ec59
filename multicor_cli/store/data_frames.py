"""What a run holds as columns with names and units: of CSV files, and of DataFrames of pandas."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.optional import library
from multicor_cli.store import schema
from multicor_cli.store.schema import Dataset

if TYPE_CHECKING:
    from multicor_cli.store.frame_view import Frame
    from multicor_cli.store.reader import Run


class NamedColumn(NamedTuple):
    """A column of a table.

    Attributes:
        name: Its name.
        unit: SI unit; ``1`` if it has none.
        values: The values, one per row.
    """

    name: str
    unit: str
    values: Sequence[Any] | NDArray[Any]

    @property
    def heading(self) -> str:
        """Name, and unit unless there is none."""
        return self.name if self.unit == "1" else f"{self.name} [{self.unit}]"


def data_frame(columns: Sequence[NamedColumn], index: str | None = None) -> Any:
    """Columns as a DataFrame, indexed by one of them; units are in its ``attrs["units"]``. Raises `MissingLibrary`."""
    table = library("pandas").DataFrame({column.name: column.values for column in columns})
    table.attrs["units"] = {column.name: column.unit for column in columns if column.unit != "1"}
    return table if index is None else table.set_index(index)


def grain_columns(frame: Frame) -> list[NamedColumn]:
    """The grains of a frame, those that are there: number, group, material, radius, mass, and what the frame holds of each."""
    grains, model = frame.model.grains, frame.facts.model
    return [
        NamedColumn("grain", "1", frame.number),
        NamedColumn("group", "1", [model.groups[k] for k in grains.group]),
        NamedColumn("material", "1", [model.materials[k] for k in grains.material]),
        NamedColumn("radius", "m", grains.radius),
        NamedColumn("mass", "kg", grains.mass),
        *_columns_of(frame, schema.PARTICLES, frame.number),
    ]


def contact_columns(frame: Frame) -> list[NamedColumn]:
    """The contacts of a frame as they are stored: grains by their numbers in the run."""
    return _columns_of(frame, schema.CONTACTS)


def wall_columns(frame: Frame) -> list[NamedColumn]:
    """The walls of a frame: name, and what the frame holds of each."""
    columns = [NamedColumn("wall", "1", list(frame.facts.model.walls.names))]
    for spec in frame.rows(schema.WALLS):
        columns += split(spec, frame.column(spec.path)[0])
    return columns


def series_columns(run: Run) -> list[NamedColumn]:
    """The time series; columns of walls and outlets have their names before them."""
    columns: list[NamedColumn] = []
    for spec in run.rows(schema.SERIES):
        values = run.series[spec.name]
        owners: Sequence[str] | None = run.wall_names if "wall" in spec.dims else None
        if "outlet" in spec.dims:
            owners = run.model.outlets or ()
        if owners is None:
            columns += split(spec, values)
            continue
        for number, owner in enumerate(owners):
            columns += [column._replace(name=f"{owner}: {column.name}") for column in split(spec, values[:, number])]
    return columns


def split(spec: Dataset, values: NDArray[Any]) -> list[NamedColumn]:
    """The columns of a dataset."""
    names = spec.columns or (spec.name,)
    units = spec.unit.split(", ") * (1 if ", " in spec.unit else len(names))
    flat = values.reshape(len(values), int(np.prod(values.shape[1:], dtype=np.int64)))
    return [NamedColumn(name, unit, flat[:, k]) for k, (name, unit) in enumerate(zip(names, units, strict=True))]


def _columns_of(frame: Frame, table: tuple[Dataset, ...], rows: NDArray[np.int64] | None = None) -> list[NamedColumn]:
    """The columns of a table as they are stored, or these rows of them."""
    found = ((spec, frame.column(spec.path)) for spec in frame.rows(table))
    return [column for spec, values in found for column in split(spec, values if rows is None else values[rows])]
