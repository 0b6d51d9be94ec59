"""What files say of the arrays that a run keeps: type, shape, unit and meaning, written beside the field that holds each."""

from __future__ import annotations

from dataclasses import MISSING, dataclass, field, fields
from typing import Any, Literal

Dim = Literal[
    "one",
    "frame",
    "frame_edge",
    "particle_row",
    "contact_row",
    "rolling_row",
    "series_row",
    "grain",
    "shape",
    "wall",
    "material",
    "group",
    "stage",
    "table_edge",
    "table_row",
    "heat_grain",
    "heat_wall",
    "heat_book",
    "mean_row",
    "stage_note",
    "origin_row",
    "surface_row",
    "before_row",
    "outlet",
    "exchange_grain",
    "exchange_group",
    "exchange_outlet",
    "exchange_book",
    "book",
    "tally",
    "window",
]
"""Named lengths. ``frame_edge`` is ``frame + 1``: row ``offset[k]:offset[k+1]`` belongs to frame ``k``. Those that begin with
``heat`` are 0 in states of runs without heat, those that begin with ``exchange`` where no grain comes or goes."""

Shape = tuple[Dim | int, ...]
"""Named lengths and numbers."""

Version = tuple[int, int]
"""Major and minor version of the file format."""

DType = Literal["f8", "float", "i8", "i4", "u1", "str"]
"""Stored types. ``float`` is f8 or f4 after ``output.precision``; ``str`` is UTF-8 of fixed length."""

Feature = Literal["heat", "softening", "adhesion", "rolling", "exchange", "surface", "groups", "motion"]
"""What only some runs have: temperatures, friction that depends on them, adhesion, rolling resistance, grains that come and go,
walls whose surface runs, walls that only some groups meet, motion at the start."""

Export = Literal["vtk", "gsd"]
"""What shows a dataset of the frames besides CSV, which shows all: the view for ParaView, and GSD files."""


@dataclass(frozen=True)
class Stored:
    """What files say of a field.

    Attributes:
        dtype: Stored type.
        dims: Shape; ``("one",)`` is a number.
        unit: SI unit, one per column (separated by commas) where they differ; ``1`` if dimensionless.
        meaning: What it is, in a sentence.
        columns: Names of its columns in tables, if it has several.
        exports: What shows it.
        only_with: Feature of the runs that have it, or None if all have it.
        since: Version of the file format in which it appeared.
    """

    dtype: DType
    dims: Shape
    unit: str
    meaning: str
    columns: tuple[str, ...] = ()
    exports: tuple[Export, ...] = ()
    only_with: Feature | None = None
    since: Version = (1, 0)


def stored(about: Stored, default: Any = MISSING, default_factory: Any = MISSING) -> Any:
    """A field of a dataclass with what files say of it."""
    return field(default=default, default_factory=default_factory, metadata={"stored": about})


def stored_fields(cls: type) -> dict[str, Stored]:
    """What files say of the fields of a dataclass, by name, in the order of the fields."""
    return {f.name: f.metadata["stored"] for f in fields(cls)}
