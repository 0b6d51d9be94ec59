"""What goes wrong while the initial bodies are made, before it is tied to a place in the scenario file."""

from __future__ import annotations

import contextlib
import csv
import io
from collections.abc import Iterator
from pathlib import Path

from multicor_cli.files import open_regular

Key = tuple[str | int, ...]

NAMED = 5
"""So many faulty lines, rows or grains are named."""

LINE_LIMIT = 10_000
"""So much of a line is read at a time [characters]: a file may be one line as long as itself."""


class PackingError(ValueError):
    """A packing or a wall cannot be made as asked.

    Attributes:
        message: What is wrong, with the value.
        remedy: What to do about it.
        key: Path of the key at fault, relative to the table that is being built; empty: the table itself.
    """

    def __init__(self, message: str, remedy: str, key: Key = ()) -> None:
        super().__init__(f"{message}; {remedy}")
        self.message = message
        self.remedy = remedy
        self.key = key


@contextlib.contextmanager
def reading_input(path: Path, what: str, key: Key) -> Iterator[None]:
    """Tell what goes wrong while a file from elsewhere is opened and read as `PackingError`.

    Args:
        path: The file.
        what: What it must be, for the remedy.
        key: That of the error.
    """
    try:
        yield
    except FileNotFoundError:
        raise PackingError(f"there is no file '{path}'", "give its path relative to the scenario file", key) from None
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise PackingError(f"'{path}' cannot be read: {reason}", f"it must be {what}", key) from None


def text_lines(path: Path, most: int) -> Iterator[str]:
    """Lines of a text file in UTF-8 with at most ``most`` bytes; pieces of those longer than `LINE_LIMIT`, without line breaks.

    Raises:
        OSError: As `multicor_cli.files.open_regular`.
        UnicodeDecodeError: It is not UTF-8.
    """
    with io.TextIOWrapper(open_regular(path, most), encoding="utf-8-sig", newline="") as file:
        yield from iter(lambda: file.readline(LINE_LIMIT), "")
