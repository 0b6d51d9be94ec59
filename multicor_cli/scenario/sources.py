"""Where a scenario comes from: its text and what the command line has set, to give problems their positions."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

from multicor_cli.scenario.locate import Lines, locate_keys
from multicor_cli.scenario.problems import OVERRIDE, Finding, KeyPath, Problem, format_key, show

MAX_PROBLEMS = 100


class _Place(NamedTuple):
    file: str
    line: int
    column: int
    source_line: str


def _column_inside(place: _Place, text: str, offset: int) -> int:
    """Column of a character of the string ``text`` at a place; that of the place if the string is written in another way there."""
    line, start = place.source_line, max(place.column - 1, 0)
    found = max(line.find(quote + text, start) for quote in "\"'")
    if found >= 0:
        return found + offset + 2
    is_bare = place.file == OVERRIDE and line.endswith(text)
    return len(line) - len(text) + offset + 1 if is_bare else place.column


class Sources:
    """The text of a scenario file, the values set from the command line, and the expressions in both."""

    def __init__(
        self,
        file: str,
        text: str,
        applied: dict[KeyPath, str] | None = None,
        expressions: dict[KeyPath, tuple[str, str]] | None = None,
        overrides: Sequence[str] = (),
    ) -> None:
        """Keep what positions are found from.

        Args:
            file: Name of the file in messages; empty if there is none: positions in the text are then left out.
            text: Its text, a document that `tomllib` accepts.
            applied: The argument of ``--set`` that has set each path.
            expressions: The expression and its value, as shown, of each path at which one stands.
            overrides: All arguments of ``--set`` in their order.
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

    def locate(self, path: KeyPath) -> tuple[str, int, int]:
        """File, line and column of a key; of the innermost table around it if the key itself is not in the document.

        Line and column are 0 for what the command line has set, and without a file.
        """
        return self._place(path)[:3]

    def _place(self, path: KeyPath) -> _Place:
        ends = range(len(path), 0, -1)
        for end in ends:  # what the command line has set replaces all that the file says below it
            if (argument := self.applied.get(path[:end])) is not None:
                return _Place(OVERRIDE, 0, 0, argument)
        if not self.file:
            return _Place("", 0, 0, "")
        for end in ends:
            if (offset := self._offsets.get(path[:end])) is not None:
                line, column = self._lines.position(offset)
                return _Place(self.file, line, column, self._lines.line(line))
        return _Place(self.file, 1, 1, "")

    def problem(self, finding: Finding) -> Problem:
        """The finding with its position."""
        place = self._place(finding.path)
        column = place.column if finding.inside is None else _column_inside(place, *finding.inside)
        message = f"{finding.message}{self._expressions_of(finding)}"
        return Problem(place.file, place.line, column, format_key(finding.path), message, finding.remedy, place.source_line)

    def _expressions_of(self, finding: Finding) -> str:
        """The expressions at the key of a finding, or in the array there, with their values unless the message says them."""
        shown = [
            show(text) if value in finding.message else f"{show(text)} = {value}"
            for path, (text, value) in self.expressions.items()
            if path == finding.path or (path[:-1] == finding.path and isinstance(path[-1], int))
        ]
        return f" ({', '.join(shown[:4])})" if shown else ""

    def problems(self, findings: list[Finding]) -> list[Problem]:
        """The findings with their positions, in the order of the file; the first `MAX_PROBLEMS` of very many."""
        found = sorted((self.problem(f) for f in findings[: 2 * MAX_PROBLEMS]), key=lambda p: (p.line, p.column))
        if len(findings) <= MAX_PROBLEMS:
            return found
        more = len(findings) - MAX_PROBLEMS
        return [
            *found[:MAX_PROBLEMS],
            Problem(self.file, 0, 0, "", f"… and at least {more} more problems", "correct the first ones"),
        ]
