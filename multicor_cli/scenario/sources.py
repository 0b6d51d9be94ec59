"""Where a scenario comes from: its text and what the command line has set, to give problems their positions."""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

from multicor_cli.scenario.locate import Lines, locate_keys
from multicor_cli.scenario.problems import OVERRIDE, Finding, KeyPath, Problem, format_key

MAX_PROBLEMS = 100


class _Place(NamedTuple):
    file: str
    line: int
    column: int
    source_line: str


class Sources:
    """The text of a scenario file and the values set from the command line."""

    def __init__(self, file: str, text: str, applied: dict[KeyPath, str] | None = None) -> None:
        """Keep what positions are found from.

        Args:
            file: Name of the file in messages.
            text: Its text, a document that `tomllib` accepts.
            applied: The argument of ``--set`` that has set each path.
        """
        self.file = file
        self.text = text
        self.applied = applied or {}

    @cached_property
    def _lines(self) -> Lines:
        return Lines(self.text)

    @cached_property
    def _offsets(self) -> dict[KeyPath, int]:
        return locate_keys(self.text)

    def locate(self, path: KeyPath) -> tuple[str, int, int]:
        """File, line and column of a key; of the innermost table around it if the key itself is not in the document.

        Line and column are 0 for what the command line has set.
        """
        return self._place(path)[:3]

    def _place(self, path: KeyPath) -> _Place:
        for end in range(len(path), 0, -1):
            if (argument := self.applied.get(path[:end])) is not None:
                return _Place(OVERRIDE, 0, 0, argument)
            if (offset := self._offsets.get(path[:end])) is not None:
                line, column = self._lines.position(offset)
                return _Place(self.file, line, column, self._lines.line(line))
        return _Place(self.file, 1, 1, "")

    def problem(self, finding: Finding) -> Problem:
        """The finding with its position."""
        place = self._place(finding.path)
        key = format_key(finding.path)
        return Problem(place.file, place.line, place.column, key, finding.message, finding.remedy, place.source_line)

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
