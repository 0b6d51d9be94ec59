"""Columns of numbers from a CSV file, in place of arrays in the scenario. They are read once, and kept in the resolved scenario."""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import ValidationInfo

from multicor_cli.files import open_regular
from multicor_cli.scenario.problems import Refused

DIRECTORY = "directory"
"""Key of the validation context: the directory of the scenario file, to which paths are relative."""

MAX_BYTES = 10_000_000
MAX_ROWS = 100_000


class Column(NamedTuple):
    """A column of numbers.

    Attributes:
        names: Names that it may have, each with the factor that its numbers are multiplied with.
        bounds: Smallest and largest value that they may then have.
    """

    names: dict[str, float]
    bounds: tuple[float, float]


def refuse_both(data: dict[str, Any], *arrays: str) -> None:
    """Refuse a table that names a file and also gives one of the ``arrays`` that come from it."""
    for key in arrays:
        if key in data:
            raise Refused((key,), f"both file and {key} are given", "give one of them")


def read_columns(name: str, info: ValidationInfo, *columns: Column) -> list[list[float]]:
    """The columns of a CSV file; its first line names them, others may stand between them.

    Args:
        name: Path of the file, relative to the scenario file.
        info: Of the validation, whose context knows the directory of the scenario file.
        columns: What is wanted.

    Raises:
        Refused: The file is missing or unreadable, a column is missing, or a value is not a number within bounds.
    """
    path = Path((info.context or {}).get(DIRECTORY, ".")) / name
    rows = _rows(path, name)
    if not rows:
        raise Refused(("file",), f"'{name}' is empty", _remedy(columns))
    header = [title.strip().lower() for title in rows[0][1]]
    values: list[list[float]] = []
    for names, bounds in columns:
        found = [title for title in names if title in header]
        if len(found) != 1:
            what = "no column" if not found else "several columns"
            raise Refused(("file",), f"'{name}' has {what} {' or '.join(names)}", _remedy(columns))
        title, factor = found[0], names[found[0]]
        place, least, most = header.index(title), bounds[0] / factor, bounds[1] / factor
        numbers: list[float] = []
        for line, row in rows[1:]:
            text = row[place].strip() if place < len(row) else ""
            fault = _fault(text, least, most)
            if fault:
                raise Refused(("file",), f"line {line} of '{name}': {title} = {text[:40]!r} {fault}", "correct it")
            numbers.append(factor * float(text))
        values.append(numbers)
    return values


def _remedy(columns: tuple[Column, ...]) -> str:
    example = ",".join(next(iter(column.names)) for column in columns)
    return f"let the first line name the columns, as {example}, and each further line give their numbers"


def _rows(path: Path, name: str) -> list[tuple[int, list[str]]]:
    """Rows that are neither empty nor comments, with the numbers of their lines."""
    try:
        with io.TextIOWrapper(open_regular(path, MAX_BYTES), encoding="utf-8-sig", newline="") as file:
            reader = csv.reader("\n" if line.lstrip().startswith("#") else line for line in file)
            rows = [(reader.line_num, row) for row in reader if row]
    except FileNotFoundError:
        raise Refused(("file",), f"there is no file '{name}'", "give its path relative to the scenario file") from None
    except (OSError, ValueError, csv.Error) as error:
        raise _unreadable(name, error) from None
    if len(rows) > MAX_ROWS + 1:
        raise Refused(("file",), f"'{name}' has more than {MAX_ROWS} rows", "give fewer")
    return rows


def _unreadable(name: str, error: Exception) -> Refused:
    reason = getattr(error, "strerror", None) or str(error)
    return Refused(("file",), f"'{name}' cannot be read: {reason}", "it must be a CSV file in UTF-8")


def _fault(text: str, least: float, most: float) -> str:
    """What is wrong with the text of a number; empty if nothing is."""
    try:
        value = float(text)
    except ValueError:
        return "is not a number"
    if not math.isfinite(value):
        return "is not finite"
    return "" if least <= value <= most else f"is not between {least:g} and {most:g}"
