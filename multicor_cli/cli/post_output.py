"""How the tables of the commands ``post …`` leave the program: for people, as JSON, as CSV, as a figure."""

from __future__ import annotations

import csv
import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import typer

from multicor_cli.cli.console import emit_json, emit_table, say
from multicor_cli.text import with_unit_signs

if TYPE_CHECKING:
    from multicor_cli.plots import Terminal

_TERMINAL = Path("term")  # the name of a figure that means the terminal


class ShownTable(Protocol):
    """What all tables of `post` have."""

    @property
    def headings(self) -> Sequence[str]:
        """Names of the columns."""

    @property
    def rows(self) -> Sequence[Sequence[Any]]:
        """The rows."""

    def as_dict(self) -> dict[str, Any]:
        """Everything, for JSON."""


@dataclass(frozen=True)
class TableOutput:
    """What was asked for. Options that exclude each other are refused before anything is computed.

    Attributes:
        is_json: Whether ``--json`` was given.
        is_csv: Whether ``--csv`` was given.
        plot: What ``--plot`` was given.
        is_overwriting: Whether a figure that is there may be replaced.

    Raises:
        ExportRefused: There is a figure already, or the place is none for a file.
    """

    is_json: bool
    is_csv: bool
    plot: Path | None
    is_overwriting: bool = False

    def __post_init__(self) -> None:
        if self.is_json and self.is_csv:
            raise typer.BadParameter("--json and --csv exclude each other")
        if self.plot == Path():
            raise typer.BadParameter("the name is empty", param_hint="--plot")
        if self.plot not in (None, _TERMINAL) and self.plot.suffix.lower() not in (".png", ".svg", ".pdf"):
            raise typer.BadParameter(f"'{self.plot}' does not end in .png, .svg or .pdf", param_hint="--plot")
        if self.plot not in (None, _TERMINAL):
            from multicor_cli.export.target import check_output

            check_output(self.plot, is_overwriting=self.is_overwriting)

    def draw(self, table: ShownTable, **options: Any) -> None:
        """Draw the figure of a table if one was asked for, and say so.

        Args:
            table: The table.
            options: Further options of the figure.
        """
        if self.plot is None:
            return
        from multicor_cli import plots

        if self.plot == _TERMINAL:
            say(plots.show(table, _terminal(), **options))
        else:
            plots.plot(table, self.plot, **options)
            say(f"wrote {self.plot}")

    def deliver(self, table: ShownTable, about: str, *, run: Path | None = None, is_detailed: bool = False, **content: Any) -> None:
        """Print a table.

        Args:
            table: The table.
            about: A line for people above the table.
            run: The run directory, which JSON names.
            is_detailed: Whether CSV holds the details (``detail_headings`` and ``detail_rows``) instead of the table.
            content: What decides on the content of JSON: options of ``table.as_dict``.
        """
        if self.is_json:
            emit_json({**({} if run is None else {"run": str(run)}), **table.as_dict(**content)})
        elif self.is_csv:
            detailed: Any = table
            _emit_csv(*((detailed.detail_headings, detailed.detail_rows) if is_detailed else (table.headings, table.rows)))
        else:
            say(about)
            digits = [_digits(column) for column in zip(*table.rows, strict=True)]
            emit_table(
                [with_unit_signs(name) for name in table.headings],
                [[_cell(value, n) for value, n in zip(row, digits, strict=True)] for row in table.rows],
            )


def _emit_csv(headings: Sequence[str], rows: Sequence[Sequence[Any]]) -> None:
    """Every digit of every number; nothing where there is no value."""
    writer = csv.writer(sys.stdout, lineterminator="\n")
    writer.writerow(headings)
    writer.writerows(["" if isinstance(value, float) and math.isnan(value) else value for value in row] for row in rows)


def _terminal() -> Terminal:
    """The terminal that people look at."""
    from rich.console import Console

    from multicor_cli.plots import Terminal

    console = Console(file=sys.stderr)
    return Terminal(console.width, max(console.height - 3, 10), console.color_system)


def _digits(column: Sequence[Any]) -> int:
    """Digits that tell the values of a column apart: five of their spread (temperatures near 300 K may differ by millikelvins)."""
    values = [value for value in column if isinstance(value, float) and math.isfinite(value)]
    spread = max(values, default=0.0) - min(values, default=0.0)
    if spread == 0.0:
        return 5
    largest = max(abs(value) for value in values)
    return min(15, 5 + max(0, math.ceil(math.log10(largest / spread))))


def _cell(value: Any, digits: int) -> str:
    if isinstance(value, float):
        return "–" if math.isnan(value) else f"{value:.{digits}g}"
    return with_unit_signs(str(value))
