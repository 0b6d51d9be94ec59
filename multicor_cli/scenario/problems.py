"""Problems of a scenario: where, what, and what to do about it."""

from __future__ import annotations

import datetime as dt
import json
import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from multicor_cli.text import brief, one_line, shortened

KeyPath = tuple[str | int, ...]
"""Path of a key in the document: names of tables and keys, 0-based indices of array elements."""

OVERRIDE = "--set"
"""Stands for the file in problems whose value comes from the command line."""

_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
_MAX_SHOWN = 60
_MAX_NAME = 80  # more than a name of a scenario may have
_MAX_LINE = 120


class Refused(ValueError):
    """Something is wrong at a key, whose position in a file is not known yet.

    It is raised where nothing can go on (validators of tables, packings), and collected where all
    that is wrong is told at once.

    Attributes:
        where: Path of the key, beginning at the table that is looked at; empty: that table itself.
        what: What is wrong, with the value.
        remedy: What to do about it; may be empty.
        inside: Where it is in the string at the key: the string, and an offset in it.
    """

    def __init__(
        self, where: KeyPath, what: str, remedy: str = "", inside: tuple[str, int] | None = None
    ) -> None:
        super().__init__(where, what, remedy, inside)
        self.where, self.what, self.remedy, self.inside = where, what, remedy, inside

    def __str__(self) -> str:
        return f"{self.what}; {self.remedy}" if self.remedy else self.what

    def within(self, *path: str | int) -> Refused:
        """The same of a table that is itself at a path."""
        return Refused((*path, *self.where), self.what, self.remedy, self.inside)


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong with a scenario.

    Attributes:
        file: Name of the file, or ``--set``; empty for a scenario that comes from none.
        line: Line, from 1; 0 without a position (a file that cannot be read, the command line).
        column: Column, from 1; 0 also there, except inside an expression from the command line.
        key: Dotted path of the key, as ``--set`` takes it; empty for the whole file.
        message: What is wrong, with the value.
        remedy: What to do about it; may be empty.
        source_line: The line of the file (or the argument of ``--set``); empty if there is none.
    """

    file: str
    line: int
    column: int
    key: str
    message: str
    remedy: str = ""
    source_line: str = ""

    def __str__(self) -> str:
        """``file:line:column: key: what is wrong; remedy``, always one line."""
        where = f"{self.file}:{self.line}:{self.column}" if self.line else self.file
        what = f"{self.message}; {self.remedy}" if self.remedy else self.message
        return brief(one_line(": ".join(part for part in (where, self.key, what) if part)))

    def excerpt(self) -> str:
        """The quoted source line with a caret under the column, in two lines; empty if none."""
        if not self.source_line:
            return ""
        column = max(self.column, 1) - 1
        start = max(0, column - _MAX_LINE * 2 // 3) if len(self.source_line) > _MAX_LINE else 0
        quoted = one_line(self.source_line[start : start + _MAX_LINE].replace("\t", " "))
        return f"    {quoted}\n    {' ' * (column - start)}^"


class ScenarioError(Exception):
    """A scenario is wrong.

    Attributes:
        problems: All problems found, in the order of the file.
    """

    exit_code = 3

    def __init__(self, problems: Iterable[Problem]) -> None:
        self.problems = list(problems)
        super().__init__("\n".join(str(problem) for problem in self.problems))


def format_key(path: KeyPath) -> str:
    """Dotted form of a path, as ``loading.1.drives.lid``; parts that need quotes get them."""
    return ".".join(
        str(part) if isinstance(part, int) or _BARE_KEY.fullmatch(part) else _quote(part)
        for part in path
    )


def _quote(text: str) -> str:
    return one_line(json.dumps(shortened(text, _MAX_SHOWN), ensure_ascii=False))


def show(value: Any) -> str:
    """A TOML value in a message: short, on one line, whatever it is."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _quote(value)
    if isinstance(value, int):
        return str(value) if value.bit_length() < 100 else "an integer of more than 30 digits"
    if isinstance(value, float):
        return repr(value)
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, list | tuple):
        return f"an array of {len(value)}"
    if isinstance(value, dt.date | dt.time):
        return f"the date or time {value.isoformat()}"
    return "something else"


def name_list(names: Iterable[str]) -> str:
    """Names for a message, as ``'a', 'b'``; many are cut short."""
    shown = [f"'{shortened(name, _MAX_NAME)}'" for name in names]
    return ", ".join(shown if len(shown) <= 20 else [*shown[:20], f"… ({len(shown) - 20} more)"])
