"""Columns of numbers from a CSV file, in place of arrays in the scenario. They are read once, and kept in the resolved scenario."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import Any

from pydantic import ValidationInfo
from pydantic_core import PydanticCustomError

from multicor_cli.files import open_regular
from multicor_cli.scenario.base import refuse

DIRECTORY = "directory"
"""Key of the validation context: the directory of the scenario file, to which paths are relative."""

MAX_BYTES = 10_000_000
MAX_ROWS = 100_000

Names = dict[str, float]
"""Names that a column may have, each with the factor that its numbers are multiplied with."""


def refuse_both(data: dict[str, Any], *arrays: str) -> None:
    """Refuse a table that names a file and also gives one of the ``arrays`` that come from it."""
    for key in arrays:
        if key in data:
            raise refuse(f"both file and {key} are given", "give one of them", key)


def read_columns(name: str, info: ValidationInfo, *columns: Names) -> list[list[float]]:
    """The columns of a CSV file; its first line names them, others may stand between them.

    Args:
        name: Path of the file, relative to the scenario file.
        info: Of the validation, whose context knows the directory of the scenario file.
        columns: For each column the names that it may have.

    Raises:
        PydanticCustomError: The file is missing or unreadable, a column is missing, or a value is not a number.
    """
    path = Path((info.context or {}).get(DIRECTORY, ".")) / name
    rows = _rows(path, name)
    if not rows:
        raise refuse(f"'{name}' is empty", _remedy(columns), "file")
    header = [title.strip().lower() for title in rows[0]]
    values: list[list[float]] = []
    for names in columns:
        found = [title for title in names if title in header]
        if len(found) != 1:
            what = "no column" if not found else "several columns"
            raise refuse(f"'{name}' has {what} {' or '.join(names)}", _remedy(columns), "file")
        place, factor = header.index(found[0]), names[found[0]]
        values.append([factor * _number(row, place, name, line) for line, row in enumerate(rows[1:], 2) if row])
    return values


def _remedy(columns: tuple[Names, ...]) -> str:
    example = ",".join(next(iter(names)) for names in columns)
    return f"let the first line name the columns, as {example}, and each further line give their numbers"


def _rows(path: Path, name: str) -> list[list[str]]:
    try:
        with io.TextIOWrapper(open_regular(path, MAX_BYTES), encoding="utf-8-sig", newline="") as file:
            rows = list(csv.reader(line for line in file if not line.lstrip().startswith("#")))
    except FileNotFoundError:
        raise refuse(f"there is no file '{name}'", "give its path relative to the scenario file", "file") from None
    except (OSError, ValueError, csv.Error) as error:
        raise _unreadable(name, error) from None
    if len(rows) > MAX_ROWS + 1:
        raise refuse(f"'{name}' has more than {MAX_ROWS} rows", "give fewer", "file")
    return rows


def _unreadable(name: str, error: Exception) -> PydanticCustomError:
    reason = getattr(error, "strerror", None) or str(error)
    return refuse(f"'{name}' cannot be read: {reason}", "it must be a CSV file in UTF-8", "file")


def _number(row: list[str], place: int, name: str, line: int) -> float:
    text = row[place].strip() if place < len(row) else ""
    try:
        return float(text)
    except ValueError:
        raise refuse(f"row {line} of '{name}': {text[:40]!r} is not a number", "correct it", "file") from None
