"""Problems of a scenario: where they are in its text or the command line, what, and what to do."""

from __future__ import annotations

import bisect
import datetime as dt
import json
import re
import tomllib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import accumulate
from typing import Any

from multicor_cli.text import brief, one_line, shortened

# ---- What is wrong, and how a message says it

KeyPath = tuple[str | int, ...]
"""Path of a key in the document: names of tables and keys, 0-based indices of array elements."""

OVERRIDE = "--set"
"""Stands for the file in problems whose value comes from the command line."""

BARE_KEY = re.compile(r"[A-Za-z0-9_-]++")
"""Keys that need no quotes."""

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
        super().__init__(self.problems)

    def __str__(self) -> str:
        return "\n".join(str(problem) for problem in self.problems)


def format_key(path: KeyPath) -> str:
    """Dotted form of a path, as ``loading.1.drives.lid``; parts that need quotes get them."""
    return ".".join(
        str(part) if isinstance(part, int) or BARE_KEY.fullmatch(part) else _quote(part)
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


# ---- Where the keys of a TOML document are: path of a key → line and column. `tomllib` tells
#      positions of syntax errors only; this walks over a document that it has accepted.

_BLANKS = re.compile(r"[ \t]*+")
_FILLING = re.compile(r"(?:[ \t\r\n]++|#[^\n]*+)*+")
_SEPARATORS = re.compile(r"(?:[ \t\r\n,]++|#[^\n]*+)*+")
_SCALAR = re.compile(r"[^,\]}#\r\n]++")
# A multi-line string may end with up to five quotes, of which the first two belong to it.
_STRING_TEXT = "|".join(
    (
        r'"""(?:[^"\\]++|\\.|"(?!""))*+""""{0,2}',
        r"'''(?:[^']++|'(?!''))*+''''{0,2}",
        r'"(?:[^"\\]++|\\.)*+"',
        r"'[^']*+'",
    )
)
_STRING = re.compile(_STRING_TEXT, re.DOTALL)
_PART_TEXT = rf"(?:[A-Za-z0-9_-]++|{_STRING_TEXT})"
_DOTTED_KEY = re.compile(
    rf"[ \t]*+{_PART_TEXT}(?:[ \t]*+\.[ \t]*+{_PART_TEXT})*+[ \t]*+=", re.DOTALL
)

MAX_NESTING = 32
# The last two tokens: a string without end (what follows does not matter), and anything else.
_NESTING = re.compile(
    rf"(?P<chain>(?:{_PART_TEXT}[ \t]*+\.[ \t]*+){{{MAX_NESTING}}})"
    rf"|(?:{_STRING_TEXT})|#[^\n]*+|(?P<open>[\[{{])|(?P<close>[\]}}])|[\"'].*+|[^\s\"'#\[\]{{}}]++",
    re.DOTALL,
)


def find_deep_nesting(text: str) -> int | None:
    """Offset where nesting (arrays, tables, dotted keys) exceeds `MAX_NESTING`, or ``None``.

    Runs before the parser, which is recursive, and quadratic in the length of a dotted key.
    """
    depth = 0
    for token in _NESTING.finditer(text):
        if token["chain"]:
            return token.start()
        depth = max(0, depth + (token["open"] is not None) - (token["close"] is not None))
        if depth > MAX_NESTING:
            return token.start()
    return None


class Lines:
    """Lines of a text, by number and by offset."""

    def __init__(self, text: str) -> None:
        self._lines = text.split("\n")
        self._starts = [0, *accumulate(len(line) + 1 for line in self._lines)][:-1]

    @property
    def count(self) -> int:
        return len(self._lines)

    def position(self, offset: int) -> tuple[int, int]:
        """Line and column, both from 1, of the character at ``offset``."""
        line = bisect.bisect_right(self._starts, offset)
        return line, offset - self._starts[line - 1] + 1

    def line(self, number: int) -> str:
        """Text of line ``number`` (from 1), without its end; empty if there is no such line."""
        return self._lines[number - 1].rstrip("\r") if 1 <= number <= self.count else ""


def locate_keys(text: str) -> dict[KeyPath, int]:
    """Offset at which each key and array element of a TOML document begins.

    Tables have the offset of their header (elements of an array of tables that of theirs), or of
    the first key that brings them into being; keys that of the whole dotted key they are part of;
    array elements that of their value. `tomllib` must accept it, and its nesting be bounded.
    """
    scanner = _Scanner(text)
    scanner.scan()
    return scanner.offsets


class _Scanner:
    """Recursive descent over a valid document; each method starts where the last one stopped."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.at = 0
        self.offsets: dict[KeyPath, int] = {}
        self.last_element: dict[KeyPath, int] = {}

    def scan(self) -> None:
        """Note the offsets of all keys of the document."""
        table: KeyPath = ()
        self._skip(_FILLING)
        while self.at < len(self.text):
            if self.text[self.at] == "[":
                table = self._header()
            else:
                self._pair(table)
            self._skip(_FILLING)

    def _skip(self, pattern: re.Pattern[str]) -> str:
        match = pattern.match(self.text, self.at)
        assert match is not None
        self.at = match.end()
        return match.group()

    def _note(self, path: KeyPath, first: int, offset: int) -> None:
        """Note ``offset`` for ``path`` and its new parents of more than ``first`` parts."""
        for end in range(first + 1, len(path)):
            self.offsets.setdefault(path[:end], offset)
        self.offsets[path] = offset

    def _header(self) -> KeyPath:
        start, brackets = self.at, 2 if self.text.startswith("[[", self.at) else 1
        self.at += brackets
        key = self.read_key()
        self.at += brackets
        if brackets == 1:
            path = self._resolve(key)
        else:
            array = (*self._resolve(key[:-1]), key[-1])
            self.last_element[array] = self.last_element.get(array, -1) + 1
            path = (*array, self.last_element[array])
        self._note(path, 0, start)
        return path

    def _resolve(self, key: KeyPath) -> KeyPath:
        """The path that a header's key means: arrays of tables stand for their last element."""
        path: KeyPath = ()
        for part in key:
            path = (*path, part)
            if path in self.last_element:
                path = (*path, self.last_element[path])
        return path

    def read_key(self) -> KeyPath:
        """Parts of the dotted key that begins here."""
        parts: list[str] = []
        while True:
            self._skip(_BLANKS)
            if self.text[self.at] in "\"'":
                parts.append(str(tomllib.loads(f"key = {self._skip(_STRING)}")["key"]))
            else:
                parts.append(self._skip(BARE_KEY))
            self._skip(_BLANKS)
            if self.text[self.at] != ".":
                return tuple(parts)
            self.at += 1

    def _pair(self, table: KeyPath) -> None:
        start = self.at
        path = table + self.read_key()
        self._note(path, len(table), start)
        self.at += 1
        self._skip(_BLANKS)
        self._value(path)

    def _value(self, path: KeyPath) -> None:
        first = self.text[self.at]
        if first == "[":
            self.at += 1
            index = 0
            while not self._ends("]"):
                self.offsets[(*path, index)] = self.at
                self._value((*path, index))
                index += 1
        elif first == "{":
            self.at += 1
            while not self._ends("}"):
                self._pair(path)
        else:
            self._skip(_STRING if first in "\"'" else _SCALAR)

    def _ends(self, bracket: str) -> bool:
        """Skip what separates elements; whether ``bracket`` followed, which is stepped over."""
        self._skip(_SEPARATORS)
        if self.text[self.at] != bracket:
            return False
        self.at += 1
        return True


def parse_key(text: str) -> tuple[KeyPath, int]:
    """The dotted key at the beginning of ``text``, and the offset of the ``=`` behind it.

    Raises:
        ValueError: ``text`` does not begin with a dotted key and ``=``.
    """
    match = _DOTTED_KEY.match(text)
    if match is None:
        raise ValueError("no dotted key")
    scanner = _Scanner(text)
    return scanner.read_key(), scanner.at


# ---- Text and command line together

MAX_PROBLEMS = 100


def _column_inside(place: Problem, text: str, offset: int) -> int:
    """Column of a character of the string ``text``; of the place where it is written otherwise."""
    line, start = place.source_line, max(place.column - 1, 0)
    begin = max(line.find(quote + text, start) for quote in "\"'")
    if begin >= 0:
        return begin + offset + 2
    is_bare = place.file == OVERRIDE and line.endswith(text)
    return len(line) - len(text) + offset + 1 if is_bare else place.column


class Sources:
    """The text of a scenario, the values from the command line, and the expressions in both."""

    def __init__(
        self,
        file: str,
        text: str,
        applied: dict[KeyPath, str] | None = None,
        expressions: dict[KeyPath, tuple[str, str]] | None = None,
        overrides: Sequence[str] = (),
    ) -> None:
        """Keep what positions are found from; without a name of the file, none are in the text.

        ``applied`` is the argument of ``--set`` by path, ``expressions`` what is shown of them.
        """
        self.file = file
        self.text = text
        self.applied = applied or {}
        self.expressions = expressions or {}
        self.overrides = tuple(overrides)

    @cached_property
    def _lines(self) -> Lines:
        return Lines(self.text)

    @cached_property
    def _offsets(self) -> dict[KeyPath, int]:
        return locate_keys(self.text)

    def _place(self, path: KeyPath) -> Problem:
        """A problem at a path that does not say yet what is wrong."""
        key, ends = format_key(path), range(len(path), 0, -1)
        for end in ends:  # what the command line has set replaces all that the file says below it
            if (argument := self.applied.get(path[:end])) is not None:
                return Problem(OVERRIDE, 0, 0, key, "", source_line=argument)
        if not self.file:
            return Problem("", 0, 0, key, "")
        for end in ends:
            if (offset := self._offsets.get(path[:end])) is not None:
                line, column = self._lines.position(offset)
                source = self._lines.line(line)
                return Problem(self.file, line, column, key, "", source_line=source)
        return Problem(self.file, 1, 1, key, "")

    def problem(self, finding: Refused) -> Problem:
        """The finding with its position, and the expressions that it does not tell.

        Those at its key or in its array, with their values.
        """
        place, path = self._place(finding.where), finding.where
        column = place.column if finding.inside is None else _column_inside(place, *finding.inside)
        told = [
            show(text) if value in finding.what else f"{show(text)} = {value}"
            for at, (text, value) in self.expressions.items()
            if at == path or (at[:-1] == path and isinstance(at[-1], int))
        ]
        message = f"{finding.what} ({', '.join(told[:4])})" if told else finding.what
        return replace(place, column=column, message=message, remedy=finding.remedy)

    def problems(self, findings: list[Refused]) -> list[Problem]:
        """The first `MAX_PROBLEMS` findings with their positions, in the order of the file."""
        problems = [self.problem(finding) for finding in findings[: 2 * MAX_PROBLEMS]]
        problems.sort(key=lambda problem: (problem.line, problem.column))
        if (more := len(findings) - MAX_PROBLEMS) <= 0:
            return problems
        what = f"… and at least {more} more problems"
        last = Problem(self.file, 0, 0, "", what, "correct the first ones")
        return [*problems[:MAX_PROBLEMS], last]
