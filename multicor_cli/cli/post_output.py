"""What the commands ``post …`` share: options, and how tables leave the program."""

from __future__ import annotations

import csv
import inspect
import math
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import update_wrapper
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, Optional

import typer

from multicor_cli.cli.console import emit_json, emit_table, say
from multicor_cli.text import with_unit_signs

if TYPE_CHECKING:
    from multicor_cli.plots import Terminal
    from multicor_cli.post import Selection, Table

# ---- Options that the commands `post …` share

FigureFile = Annotated[
    Optional[Path],  # noqa: UP045  (evaluated by typer)
    typer.Option(
        "--plot",
        metavar="FILE",
        help="Draw a figure: FILE.png, .svg or .pdf; the word term draws it in the terminal.",
        show_default=False,
    ),
]
OverwriteFigure = Annotated[
    bool, typer.Option("--overwrite", help="Replace the figure if there is one.")
]
Start = Annotated[
    Optional[float],  # noqa: UP045
    typer.Option(
        "--from",
        metavar="T",
        help="Earliest time, in s.",
        show_default="the later half of the last stage",
    ),
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
OneFrame = Annotated[
    int, typer.Option("--frame", metavar="K", help="Number of the frame; -1 is the last one.")
]
Bins = Annotated[
    Optional[int],  # noqa: UP045
    typer.Option("--bins", min=1, help="Number of bins.", show_default="one per mean diameter"),
]
Between = Annotated[
    Optional[tuple[str, str]],  # noqa: UP045
    typer.Option(
        "--between",
        metavar="LOWER UPPER",
        help="Names of the walls below and above.",
        show_default="those that bound the grains",
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print the data as JSON.")]
AsCsv = Annotated[bool, typer.Option("--csv", help="Print the data as CSV.")]


def selected(start: float | None, end: float | None, frames: str | None) -> Selection:
    """The frames that ``--from``, ``--to`` and ``--frames`` choose."""
    from multicor_cli.post import Selection

    return Selection(start, end, parse_frames(frames, start, end))


def parse_frames(text: str | None, start: float | None, end: float | None) -> slice | None:
    """The slice that ``--frames`` names; refuses other texts, and ``--from`` or ``--to`` beside."""
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
        raise typer.BadParameter(
            f"'{text}' is not a range of frames; write A:B or A:B:STEP", param_hint="--frames"
        ) from None
    return slice(*numbers)


# ---- How the tables of the commands `post …` leave the program: as text, JSON, CSV or a figure

_TERMINAL = Path("term")  # the name of a figure that means the terminal


@dataclass(frozen=True)
class TableOutput:
    """What was asked for. Options that exclude each other are refused before anything is computed.

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
        if self.plot not in (None, _TERMINAL) and self.plot.suffix.lower() not in (
            ".png",
            ".svg",
            ".pdf",
        ):
            raise typer.BadParameter(
                f"'{self.plot}' does not end in .png, .svg or .pdf", param_hint="--plot"
            )
        if self.plot not in (None, _TERMINAL):
            from multicor_cli.export.target import check_output

            check_output(self.plot, is_overwriting=self.is_overwriting)

    def draw(self, found: Shown) -> None:
        """Draw the figure if one was asked for, and say so."""
        if self.plot is None:
            return
        from multicor_cli import plots

        table = found.figure or found.table
        if self.plot == _TERMINAL:
            say(plots.show(table, _terminal(), **found.drawing))
        else:
            plots.plot(table, self.plot, **found.drawing)
            say(f"wrote {self.plot}")

    def deliver(self, found: Shown) -> None:
        table = found.table
        if self.is_json:
            emit_json(
                {
                    **({} if found.run is None else {"run": str(found.run)}),
                    **table.as_dict(**found.content),
                }
            )
            return
        for line in found.remarks:
            say(line)
        if self.is_csv:
            _emit_csv(
                *(
                    (table.detail_headings, table.detail_rows)
                    if found.is_detailed
                    else (table.headings, table.rows)
                )
            )
            return
        say(found.about)
        rows = table.rows
        digits = [_digits(column) for column in zip(*rows, strict=True)]
        emit_table(
            [with_unit_signs(name) for name in table.headings],
            [[_cell(value, n) for value, n in zip(row, digits, strict=True)] for row in rows],
        )


class Shown(NamedTuple):
    """What a command shows.

    Attributes:
        table: The table.
        about: A line for people above the table.
        run: The run directory, which JSON names.
        is_detailed: Whether CSV holds the details instead of the table.
        figure: What is drawn, where that is not the table.
        drawing: Further options of the figure.
        content: What decides on the content of JSON: options of ``table.as_dict``.
        remarks: Lines for people, also beside CSV.
    """

    table: Table
    about: str
    run: Path | None
    is_detailed: bool = True
    figure: Table | None = None
    drawing: Mapping[str, Any] = {}
    content: Mapping[str, Any] = {}
    remarks: Sequence[str] = ()


def shows_table(command: Callable[..., Shown]) -> Callable[..., None]:
    """Give a command the options of all tables; what it returns leaves the program by them."""

    def show(
        is_json: AsJson = False,
        is_csv: AsCsv = False,
        plot: FigureFile = None,
        is_overwriting: OverwriteFigure = False,
        **own: Any,
    ) -> None:
        output = TableOutput(is_json, is_csv, plot, is_overwriting=is_overwriting)
        found = command(**own)
        output.draw(found)
        output.deliver(found)

    # Typer reads the options from signature and annotations: those of the command come first.
    *shared, _ = inspect.signature(show, eval_str=True).parameters.values()
    signature = inspect.signature(command, eval_str=True)
    options = [*signature.parameters.values(), *shared]
    update_wrapper(show, command)
    show.__signature__ = signature.replace(parameters=options, return_annotation=None)  # type: ignore[attr-defined]
    show.__annotations__ = {option.name: option.annotation for option in options}
    return show


def _emit_csv(headings: Sequence[str], rows: Sequence[Sequence[Any]]) -> None:
    """Every digit of every number; nothing where there is no value."""
    writer = csv.writer(sys.stdout, lineterminator="\n")
    writer.writerow(headings)
    writer.writerows(
        ["" if isinstance(value, float) and math.isnan(value) else value for value in row]
        for row in rows
    )


def _terminal() -> Terminal:
    """The terminal that people look at."""
    from rich.console import Console

    from multicor_cli.plots import Terminal

    console = Console(file=sys.stderr)
    return Terminal(console.width, max(console.height - 3, 10), console.color_system)


def _digits(column: Sequence[Any]) -> int:
    """Digits that tell a column's values apart: five of their spread (300 K may vary by mK)."""
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
