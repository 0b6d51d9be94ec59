"""A row of the tables: one dataset, with where its values come from, and where they go."""

from __future__ import annotations

from collections.abc import Callable, Set
from dataclasses import dataclass
from typing import Any, Generic, NoReturn, Protocol, TypeVar, overload

from multicor_cli.model import Model
from multicor_cli.model.books import Dim, DType, Export, Feature, Shape, Version, entry_counts
from multicor_cli.store.moment import Moment

Value = Callable[[Moment], Any]
"""Where a value comes from: an array, or what belongs to one row."""

T = TypeVar("T")


@dataclass(frozen=True)
class Dataset:
    """One row of a table.

    Attributes:
        path: Name inside the file, without the leading slash.
        dtype: Stored type.
        dims: Shape: named lengths and numbers.
        unit: SI unit, one per column (separated by commas) where they differ; ``1`` if dimensionless.
        long_name: What it is, in a sentence.
        value: What is stored of a moment; None where the writer knows by itself, or a getter of its own does.
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
        """Last part of the path."""
        return self.path.rsplit("/", 1)[-1]

    @property
    def group(self) -> str:
        """Path without its last part."""
        return self.path.rsplit("/", 1)[0]

    @property
    def row(self) -> Dim | int:
        """What one row of the dataset stands for."""
        return self.dims[0]


class Reader(Protocol):
    """What has columns: a frame, and its contacts."""

    def read(self, column: Column[T]) -> T:
        """The rows of a dataset that belong to it."""


@dataclass(frozen=True)
class Column(Dataset, Generic[T]):
    """A row about frames, which is also the attribute by which a frame gives it: read when it is first used, and kept.

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
    return text + (f"; None in a run of an older format than {column.since[0]}.{column.since[1]}" if column.since > (1, 0) else "")


def select(table: tuple[Dataset, ...], features: Set[str], version: Version | None = None) -> tuple[Dataset, ...]:
    """The rows of a table that a run with these features has, in order; of an older version of the format if it is given."""
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
    """A table of the format documents: path, type, shape, unit, meaning, and since which version (in runs with which feature)."""
    symbols = _DIM_SYMBOL | {dim: str(count) for dim, count in entry_counts().items()}
    lines = ["| path | type | shape | unit | meaning | since |", "|---|---|---|---|---|---|"]
    for row in table:
        shape = ", ".join(symbols[d] if isinstance(d, str) else str(d) for d in row.dims)
        since = ".".join(map(str, row.since)) + (f", {row.only_with}" if row.only_with else "")
        meaning = row.long_name.replace("|", "\\|")
        lines.append(f"| `{row.path}` | {row.dtype} | ({shape}) | {row.unit} | {meaning} | {since} |")
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
