"""What all tables of a scenario share: strictness, bounded numbers, columns of CSV files."""

from __future__ import annotations

import contextlib
import csv
import io
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, Self, TypeVar

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Discriminator,
    Field,
    Strict,
    ValidationInfo,
    WithJsonSchema,
    model_validator,
)

from multicor_cli.files import open_regular
from multicor_cli.scenario.problems import KeyPath, Refused

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

    Record = TypeVar("Record", bound=DataclassInstance)


class Table(BaseModel):
    """A TOML table: unknown keys, booleans as numbers, NaN and infinity are refused; values never
    change.
    """

    # validators are built for the whole file at once, not for each of its tables as well
    model_config = ConfigDict(
        extra="forbid", strict=True, frozen=True, allow_inf_nan=False, defer_build=True
    )

    def faults(self) -> Iterator[Refused]:
        """What is wrong with keys that are right one by one; the first is told."""
        yield from ()

    @model_validator(mode="after")
    def _has_no_fault(self) -> Self:
        for fault in self.faults():
            raise fault
        return self

    def as_record(self, kind: type[Record], **more: object) -> Record:
        """The record with attributes named as keys that are given; ``more`` are other values."""
        names = {field.name for field in fields(kind)}
        return kind(
            **{key: value for key, value in self if key in names and value is not None} | more
        )


def required(description: str, **rules: Any) -> Any:
    """A key that has to be given; ``description`` is what schema and messages say of it."""
    return Field(description=description, **rules)


def optional(description: str, default: Any = None, **rules: Any) -> Any:
    """A key that may be left out, with the value that it has then; else as `required`."""
    if "default_factory" not in rules:
        rules["default"] = default
    return Field(description=description, **rules)


CHANGEABLE = "free"
"""Marks a key that may change between two sessions of a run: no result depends on it."""


@dataclass(frozen=True)
class Formerly:
    """Marks a key whose default was another one: older runs go on with that."""

    default: object


Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]+$", max_length=64)]
"""A name that can be a bare TOML key."""

NUMBER_BOUNDS = (-1e12, 1e12)
COORDINATE_BOUNDS = (-1e6, 1e6)
RADIUS_BOUNDS = (1e-9, 1e4)
TIME_BOUNDS = (0.0, 1e12)
FRACTION_BOUNDS = (0.0, 1.0)

Number = Annotated[float, Field(ge=NUMBER_BOUNDS[0], le=NUMBER_BOUNDS[1])]
Time = Annotated[float, Field(ge=1e-12, le=1e12)]
Length = Annotated[float, Field(ge=1e-9, le=1e6)]
Coordinate = Annotated[float, Field(ge=COORDINATE_BOUNDS[0], le=COORDINATE_BOUNDS[1])]
Radius = Annotated[float, Field(ge=RADIUS_BOUNDS[0], le=RADIUS_BOUNDS[1])]
Fraction = Annotated[float, Field(ge=FRACTION_BOUNDS[0], le=FRACTION_BOUNDS[1])]
Ratio = Annotated[float, Field(gt=0.0, lt=1.0)]
Tolerance = Annotated[float, Field(ge=1e-15, le=1.0)]
Friction = Annotated[float, Field(ge=0.0, le=10.0)]
GrainCount = Annotated[int, Field(ge=1, le=50_000_000)]

# A TOML array is a list: strictness is lifted for the array, not its elements.
Element = TypeVar("Element")
Array = Annotated[tuple[Element, ...], Strict(False)]
Pair = Annotated[tuple[Element, Element], Strict(False)]

Point = Pair[Coordinate]
Vector = Pair[Number]
LengthPair = Pair[Length]
TwoWalls = Pair[Name]


def true_only(key: str, remedy: str) -> AfterValidator:
    """Validator of a key that can only be true; ``remedy``: what to give instead of false."""

    def check(value: bool) -> bool:
        if not value:
            raise Refused((), f"{key} = false has no effect", remedy)
        return value

    return AfterValidator(check)


KELVIN_BOUNDS = (1.0, 1e5)
ROOM_TEMPERATURE = 293.15


def check_kelvin(value: float) -> float:
    """The value; raises `Refused` if it is no temperature in kelvin, perhaps one in °C."""
    (low, high), remedy = KELVIN_BOUNDS, "give it in kelvin"
    if value <= 0.0:
        if value > -273.0:
            remedy = f"did you mean {value + 273.15:g} (from degrees Celsius)?"
        what = f"{value:g} K is not above absolute zero: temperatures are in kelvin"
        raise Refused((), what, remedy)
    if not low <= value <= high:
        raise Refused((), f"{value:g} K is outside {low:g} to {high:g} K", remedy)
    return value


Kelvin = Annotated[
    float,
    AfterValidator(check_kelvin),
    WithJsonSchema({"type": "number", "minimum": KELVIN_BOUNDS[0], "maximum": KELVIN_BOUNDS[1]}),
]
"""A temperature [K]."""


def ascending(what: str) -> Callable[[Sequence[float]], Sequence[float]]:
    """Validator of numbers that ascend strictly; ``what`` names them."""

    def check(values: Sequence[float]) -> Sequence[float]:
        for k in range(1, len(values)):
            if not values[k] > values[k - 1]:
                fault = f"{what} must ascend, {values[k]!r} follows {values[k - 1]!r}"
                raise Refused((k,), fault, "sort the rows and remove duplicates")
        return values

    return check


def one_of(
    what: str, keys: str, *, more: str = "", tags: Mapping[str, str] = MappingProxyType({})
) -> Discriminator:
    """Discriminator of a union whose tables differ by which of some keys, ``"a, b"``, is present.

    The tags are ``<key>``, or ``<name>`` with the name that ``tags`` gives to a key; anything but a
    table gets ``<plain>``. Not exactly one of the keys: no tag, hence an error, which begins with
    ``what`` and ends with ``more``.
    """

    def tag(value: Any) -> str | None:
        if not isinstance(value, dict | BaseModel):
            return "<plain>"
        present = value if isinstance(value, dict) else type(value).model_fields
        names = {tags.get(key, key) for key in keys.split(", ") if key in present}
        return f"<{names.pop()}>" if len(names) == 1 else None

    message = f"{what} exactly one of {keys}{more}"
    return Discriminator(tag, custom_error_type="one_of", custom_error_message=message)


def tag_table(value: Any) -> str:
    """Discriminator of a union of one table and something plain: ``<table>`` or ``<plain>``."""
    return "<table>" if isinstance(value, dict | BaseModel) else "<plain>"


def tag_word(value: Any) -> str:
    """Discriminator of a union of a string and something else: ``<word>`` or ``<plain>``."""
    return "<word>" if isinstance(value, str) else "<plain>"


@contextlib.contextmanager
def reading_input(
    name: str | Path, what: str, key: KeyPath, *, named_in: str = "scenario"
) -> Iterator[None]:
    """Tell what goes wrong while a file that must be ``what`` is opened and read as `Refused`."""
    try:
        yield
    except FileNotFoundError:
        remedy = f"give its path relative to the {named_in} file"
        raise Refused(key, f"there is no file '{name}'", remedy) from None
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise Refused(key, f"'{name}' cannot be read: {reason}", f"it must be {what}") from None


def exactly_one(table: Table, first: str, second: str, remedy: str) -> Iterator[Refused]:
    """What is wrong with a table that has both of two keys, or neither."""
    has_first, has_second = (getattr(table, key) is not None for key in (first, second))
    if has_first == has_second:
        both = f"both {first} and {second} are" if has_first else f"neither {first} nor {second} is"
        yield Refused((), f"{both} given", remedy)


# ---- Columns of numbers from a CSV file: read once, kept in the resolved scenario

DIRECTORY = "directory"
"""Key of the validation context: the directory of the scenario file, where paths begin."""

MAX_BYTES = 10_000_000
MAX_ROWS = 100_000
_refused = partial(Refused, ("file",))


class Column(NamedTuple):
    """Names that a column may have, each with a factor, and the bounds of values times that.

    ``is_optional``: the file may lack it.
    """

    names: dict[str, float]
    bounds: tuple[float, float]
    is_optional: bool = False


def refuse_semicolons(titles: Sequence[str], name: object, key: KeyPath) -> None:
    """Raises `Refused` at ``key`` if the titles of a CSV file have semicolons between them."""
    if len(titles) == 1 and ";" in titles[0]:
        what = f"'{name}' has semicolons between its columns"
        remedy = "put commas between them and between values, and points in numbers"
        raise Refused(key, what, remedy)


ColumnReader = Callable[[str], list[list[float]]]
"""What reads the columns from a text; raises `Refused`, without a key, if it cannot."""


def columns_of_file(
    others: Mapping[str, ColumnReader] = MappingProxyType({}),
    check: Callable[[list[list[float]]], Iterator[Refused]] = lambda values: iter(()),
    **columns: Column,
) -> Any:
    """Validator of a table that may name a CSV ``file`` in place of arrays, by their keys.

    Files whose names end as ``others`` say are read by these; what ``check`` finds wrong with the
    columns is told of the file.
    """

    def read(data: Any, info: ValidationInfo) -> Any:
        if not (isinstance(data, dict) and isinstance(data.get("file"), str)):
            return data
        for key in columns:
            if key in data:
                raise Refused((key,), f"both file and {key} are given", "give one of them")
        name = data["file"]
        path = Path((info.context or {}).get(DIRECTORY, ".")) / name
        if (reader := others.get(path.suffix.lower())) is not None:
            values = _read_other(path, name, reader)
        else:
            values = _read_columns(path, name, list(columns.values()))
        for fault in check(values):
            raise _refused(f"'{name}': {fault.what}", fault.remedy)
        return data | {"file": None} | dict(zip(columns, values, strict=True))

    return model_validator(mode="before")(staticmethod(read))


def _read_other(path: Path, name: str, reader: ColumnReader) -> list[list[float]]:
    """The columns of a text file of another kind; `Refused` if it cannot be read."""
    with (
        reading_input(name, "text in UTF-8", ("file",)),
        io.TextIOWrapper(open_regular(path, MAX_BYTES), "utf-8-sig") as file,
    ):
        text = file.read()
    try:
        return reader(text)
    except Refused as fault:
        raise _refused(f"'{name}': {fault.what}", fault.remedy) from None


def _read_columns(path: Path, name: str, columns: list[Column]) -> list[list[float]]:
    """The columns of a CSV file; its first line names them, others may stand between them.

    Raises:
        Refused: The file cannot be read, lacks a column, or has a value out of bounds.
    """
    rows = _rows(path, name)
    example = ",".join(next(iter(column.names)) for column in columns if not column.is_optional)
    remedy = (
        f"let the first line name the columns, as {example}, and each further line give their "
        "numbers"
    )
    if not rows:
        raise _refused(f"'{name}' is empty", remedy)
    refuse_semicolons(rows[0][1], name, ("file",))
    header = [title.strip().lower() for title in rows[0][1]]
    values: list[list[float]] = []
    for names, bounds, is_optional in columns:
        given = [title for title in header if title in names]
        if is_optional and not given:
            values.append([])
            continue
        if len(given) != 1:
            what = "several columns" if given else "no column"
            raise _refused(f"'{name}' has {what} {' or '.join(names)}", remedy)
        title, factor = given[0], names[given[0]]
        place, least, most = header.index(title), bounds[0] / factor, bounds[1] / factor
        numbers: list[float] = []
        for line, row in rows[1:]:
            text = row[place].strip() if place < len(row) else ""
            if fault := _fault(text, least, most):
                what = f"line {line} of '{name}': {title} = {text[:40]!r} {fault}"
                raise _refused(what, "correct it")
            numbers.append(factor * float(text))
        values.append(numbers)
    if not rows[1:]:
        raise _refused(f"'{name}' has no rows below its header", remedy)
    return values


def _rows(path: Path, name: str) -> list[tuple[int, list[str]]]:
    """Rows that are neither empty nor comments, with the numbers of their lines."""
    with (
        reading_input(name, "a CSV file in UTF-8", ("file",)),
        io.TextIOWrapper(open_regular(path, MAX_BYTES), "utf-8-sig", newline="") as file,
    ):
        reader = csv.reader("\n" if line.lstrip().startswith("#") else line for line in file)
        rows = [(reader.line_num, row) for row in reader if row]
    if len(rows) > MAX_ROWS + 1:
        raise _refused(f"'{name}' has more than {MAX_ROWS} rows", "give fewer")
    return rows


def _fault(text: str, least: float, most: float) -> str:
    """What is wrong with the text of a number; empty if nothing is."""
    try:
        value = float(text)
    except ValueError:
        return "is not a number"
    if not math.isfinite(value):
        return "is not finite"
    return "" if least <= value <= most else f"is not between {least:g} and {most:g}"
