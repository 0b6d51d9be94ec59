"""Options that the commands ``post …`` share, and how their tables leave the program."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any, Optional, Protocol

import typer

from multicor_cli.cli.console import emit, emit_json, emit_table, say

FigureFile = Annotated[
    Optional[Path],  # noqa: UP045  (evaluated by typer)
    typer.Option(
        "--plot",
        metavar="FILE",
        help="Draw a figure: FILE.png, .svg or .pdf; the word term draws profiles, theta-eta and energy in the terminal.",
        show_default=False,
    ),
]
Start = Annotated[
    Optional[float],  # noqa: UP045
    typer.Option("--from", metavar="T", help="Earliest time, in s.", show_default="the later half of the last stage"),
]
End = Annotated[
    Optional[float],  # noqa: UP045
    typer.Option("--to", metavar="T", help="Latest time, in s.", show_default="the end"),
]
Frames = Annotated[
    Optional[str],  # noqa: UP045
    typer.Option(
        "--frames",
        metavar="A:B[:STEP]",
        help="Frames instead of times, as in Python: -10: are the last ten.",
        show_default=False,
    ),
]
OneFrame = Annotated[int, typer.Option("--frame", metavar="K", help="Number of the frame; -1 is the last one.")]
Bins = Annotated[
    Optional[int],  # noqa: UP045
    typer.Option("--bins", min=1, help="Number of bins.", show_default="one per mean diameter"),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print the data as JSON.")]
AsCsv = Annotated[bool, typer.Option("--csv", help="Print the data as CSV.")]


class Table(Protocol):
    """What all tables of `post` have."""

    @property
    def headings(self) -> Sequence[str]:
        """Names of the columns."""

    @property
    def rows(self) -> Sequence[Sequence[Any]]:
        """The rows."""


TERMINAL = Path("term")
"""The name of a figure that means the terminal."""


def check_output(is_json: bool, is_csv: bool, plot: Path | None, *, has_text: bool = False) -> None:
    """Refuse options that exclude each other, and names of figures with an unknown ending, before anything is computed.

    Args:
        is_json: Whether ``--json`` was given.
        is_csv: Whether ``--csv`` was given.
        plot: What ``--plot`` was given.
        has_text: Whether the figure can be drawn in the terminal.
    """
    if is_json and is_csv:
        raise typer.BadParameter("--json and --csv exclude each other")
    if plot == TERMINAL and not has_text:
        raise typer.BadParameter("only profile, theta-eta and energy can be drawn in the terminal", param_hint="--plot")
    if plot is not None and plot != TERMINAL and plot.suffix.lower() not in (".png", ".svg", ".pdf"):
        raise typer.BadParameter(f"'{plot}' does not end in .png, .svg or .pdf", param_hint="--plot")


def parse_frames(text: str | None, start: float | None, end: float | None) -> slice | None:
    """The slice that ``--frames`` names; refuses a text that is none, and ``--from`` or ``--to`` beside it."""
    if text is None:
        return None
    if start is not None or end is not None:
        raise typer.BadParameter("give either --frames or --from and --to")
    parts = text.split(":")
    try:
        numbers = [int(part) if part.strip() else None for part in parts]
        if not 2 <= len(parts) <= 3 or (len(parts) == 3 and numbers[2] == 0):
            raise ValueError
    except ValueError:
        raise typer.BadParameter(f"'{text}' is no range of frames; write A:B or A:B:STEP", param_hint="--frames") from None
    return slice(*numbers)


def draw(plot: Path | None, make: Callable[[Path], None], text: Callable[[], str] | None = None) -> None:
    """Draw a figure if one was asked for, and say so; ``text`` makes the one for the terminal."""
    if plot == TERMINAL and text is not None:
        say(text())
    elif plot is not None:
        make(plot)
        say(f"wrote {plot}")


def deliver(
    table: Table,
    data: Callable[[], dict[str, Any]],
    *,
    is_json: bool,
    is_csv: bool,
    about: str,
    details: tuple[Sequence[str], Sequence[Sequence[Any]]] | None = None,
) -> None:
    """Print a table.

    Args:
        table: The table.
        data: Makes its content for JSON.
        is_json: Whether to print it as JSON.
        is_csv: Whether to print it as CSV.
        about: A line for people above the table.
        details: Headings and rows of the CSV if they are not those of the table.
    """
    if is_json:
        emit_json(data())
    elif is_csv:
        headings, rows = details or (table.headings, table.rows)
        emit(",".join(headings))
        for row in rows:
            emit(",".join(_csv_cell(value) for value in row))
    else:
        say(about)
        digits = [_digits(column) for column in zip(*table.rows, strict=True)]
        emit_table(table.headings, [[_cell(value, n) for value, n in zip(row, digits, strict=True)] for row in table.rows])


def _digits(column: Sequence[Any]) -> int:
    """Digits that tell the values of a column apart: five of their spread (temperatures near 300 K may differ by millikelvins)."""
    values = [value for value in column if isinstance(value, float) and math.isfinite(value)]
    spread = max(values, default=0.0) - min(values, default=0.0)
    if spread == 0.0:
        return 5
    largest = max(abs(value) for value in values)
    return min(15, 5 + max(0, math.ceil(math.log10(largest / spread))))


def _csv_cell(value: Any) -> str:
    if isinstance(value, str):
        return f'"{value}"' if "," in value else value
    return "" if isinstance(value, float) and math.isnan(value) else repr(value)


def _cell(value: Any, digits: int) -> str:
    if isinstance(value, float):
        return "–" if math.isnan(value) else f"{value:.{digits}g}"
    return str(value)
