"""Where a scenario comes from, and where in its text or the command line its keys are."""

from __future__ import annotations

import bisect
import re
import tomllib
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from itertools import accumulate

from multicor_cli.scenario.problems import OVERRIDE, KeyPath, Problem, Refused, format_key, show

# ---- Where the keys of a TOML document are: path of a key → line and column. `tomllib` tells
#      positions of syntax errors only; this walks over a document that it has accepted.

_BARE = re.compile(r"[A-Za-z0-9_-]++")
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
        """Number of lines."""
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
                parts.append(self._skip(_BARE))
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
