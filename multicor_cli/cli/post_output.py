"""What the commands ``post …`` share: options, and how tables leave the program."""

from __future__ import annotations

import csv
import inspect
import math
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import update_wrapper
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from multicor_cli.cli.console import emit_json, emit_table, say
from multicor_cli.cli.options import option
from multicor_cli.text import count_noun, with_unit_signs

if TYPE_CHECKING:
    from multicor_cli.post import Selection, Table

    Chosen = Selection
    ChosenOfAll = Selection

# ---- Options that the commands `post …` share

Start = Annotated[
    float | None, option("--from T", "Earliest time, in s.", "the later half of the last stage")
]
End = Annotated[float | None, option("--to T", "Latest time, in s.", "the end")]
_FRAMES = "Frames instead of times, as in Python: -10: are the last ten."
Frames = Annotated[str | None, option("--frames A:B[:STEP]", _FRAMES, False)]
OneFrame = Annotated[int, option("--frame K", "Number of the frame; -1 is the last one.")]
Bins = Annotated[int | None, option("--bins", "Number of bins.", "one per mean diameter", min=1)]
_WALLS = "Names of the walls below and above; for conductivity also on the left and right."
Between = Annotated[
    tuple[str, str] | None, option("--between LOWER UPPER", _WALLS, "those that bound the grains")
]
SeriesStart = Annotated[float | None, option("--from T", "Earliest time, in s.", "the start")]
Margin = Annotated[
    float | None,
    option(
        "--margin D",
        "Thickness of the layer at each wall that is left out of the bulk, in mean diameters.",
        "8, or a quarter of the height or a third of the gap between the walls if less",
    ),
]
AsJson = Annotated[bool, option("--json", "Print the data as JSON.")]
AsCsv = Annotated[bool, option("--csv", "Print the data as CSV.")]
_FIGURE = "Draw a figure: FILE.png, .svg or .pdf; the word term draws it in the terminal."
FigureFile = Annotated[Path | None, option("--plot FILE", _FIGURE, False)]
OverwriteFigure = Annotated[bool, option("--overwrite", "Replace the figure if there is one.")]


def _chosen(start: Start = None, end: End = None, frames: Frames = None) -> Any:
    """The frames that ``--from``, ``--to`` and ``--frames`` choose."""
    from multicor_cli.post import Selection

    return Selection(start, end, parse_frames(frames, start, end))


def _chosen_of_all(start: SeriesStart = None, end: End = None, frames: Frames = None) -> Any:
    """The same; all frames without these options."""
    is_told = start is not None or end is not None or frames is not None
    return _chosen(start, end, frames if is_told else ":")


if not TYPE_CHECKING:  # `shows_table` makes options of the parameters, and a selection of these
    Chosen, ChosenOfAll = _chosen, _chosen_of_all


def parse_frames(
    text: str | None, start: float | None = None, end: float | None = None
) -> slice | None:
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


def span_of(count: int, noun: str, times: Any) -> str:
    """How many frames or the like a table is about, and from when to when [s]."""
    return f"{count_noun(count, noun)} from t = {times[0]:g} s to {times[-1]:g} s"


def span_of_frames(table: Any) -> str:
    """The same of a table of frames."""
    return span_of(table.frames.size, "frame", table.times)


class Shown(NamedTuple):
    """What a command shows.

    Attributes:
        table: The table.
        about: A line for people above the table.
        is_detailed: Whether CSV holds the details instead of the table.
        figure: What is drawn, where that is not the table.
        drawing: Further options of the figure.
        content: What decides on the content of JSON: options of ``table.as_dict``.
        remarks: Lines for people, also beside CSV.
        is_of_one_run: Whether JSON names the run directory.
    """

    table: Table
    about: str
    is_detailed: bool = True
    figure: Table | None = None
    drawing: Mapping[str, Any] = {}
    content: Mapping[str, Any] = {}
    remarks: Sequence[str] = ()
    is_of_one_run: bool = True


def shows_table(command: Callable[..., Shown]) -> Callable[..., None]:
    """Give a command the options of all tables; what it returns leaves the program by them.

    A parameter that is `Chosen` has the options of that function, and is what it makes of them.
    """
    options: list[inspect.Parameter] = []
    choices: dict[str, tuple[Callable[..., Any], list[str]]] = {}

    def show(
        is_json: AsJson = False,
        is_csv: AsCsv = False,
        plot: FigureFile = None,
        is_overwriting: OverwriteFigure = False,
        **own: Any,
    ) -> None:
        if is_json and is_csv:  # refused before anything is computed
            raise typer.BadParameter("--json and --csv exclude each other")
        if plot is not None:
            _check_figure(plot, is_overwriting=is_overwriting)
        for name, (choose, names) in choices.items():
            own[name] = choose(*map(own.pop, names))
        found = command(**own)
        if plot is not None:
            _draw(found, plot)
        if is_json:
            run = {"run": str(own["directory"])} if found.is_of_one_run else {}
            emit_json({**run, **found.table.as_dict(**found.content)})
        else:
            _emit(found, is_csv=is_csv)

    # Typer reads the options from signature and annotations: those of the command come first.
    *shared, _ = inspect.signature(show, eval_str=True).parameters.values()
    for parameter in inspect.signature(command, eval_str=True).parameters.values():
        if inspect.isfunction(choose := parameter.annotation):
            wanted = inspect.signature(choose, eval_str=True).parameters
            choices[parameter.name] = choose, list(wanted)
            options += wanted.values()
        else:
            options.append(parameter)
    options += shared
    update_wrapper(show, command)
    keywords = [option.replace(kind=inspect.Parameter.KEYWORD_ONLY) for option in options]
    show.__signature__ = inspect.Signature(keywords)  # type: ignore[attr-defined]
    show.__annotations__ = {option.name: option.annotation for option in options}
    return show


def _check_figure(plot: Path, *, is_overwriting: bool) -> None:
    """Raises `ExportRefused` if there is a figure already, or the place is none for a file."""
    if plot == Path():
        raise typer.BadParameter("the name is empty", param_hint="--plot")
    if plot == _TERMINAL:
        return
    if plot.suffix.lower() not in (".png", ".svg", ".pdf"):
        raise typer.BadParameter(
            f"'{plot}' does not end in .png, .svg or .pdf", param_hint="--plot"
        )
    from multicor_cli.export.target import check_output

    check_output(plot, is_overwriting=is_overwriting)


def _draw(found: Shown, plot: Path) -> None:
    """Draw the figure, and say so."""
    from multicor_cli import plots

    table = found.figure or found.table
    if plot != _TERMINAL:
        plots.plot(table, plot, **found.drawing)
        say(f"wrote {plot}")
        return
    from rich.console import Console

    console = Console(file=sys.stderr)  # the terminal that people look at
    terminal = plots.Terminal(console.width, max(console.height - 3, 10), console.color_system)
    say(plots.show(table, terminal, **found.drawing))


def _emit(found: Shown, *, is_csv: bool) -> None:
    """The table for people; or as CSV, every digit of every number, nothing where no value is."""
    table = found.table
    for line in found.remarks:
        say(line)
    if is_csv:
        writer = csv.writer(sys.stdout, lineterminator="\n")
        writer.writerow(table.detail_headings if found.is_detailed else table.headings)
        writer.writerows(
            ["" if isinstance(value, float) and math.isnan(value) else value for value in row]
            for row in (table.detail_rows if found.is_detailed else table.rows)
        )
        return
    say(found.about)
    rows = table.rows
    digits = [_digits(column) for column in zip(*rows, strict=True)]
    cells = [[_cell(value, n) for value, n in zip(row, digits, strict=True)] for row in rows]
    emit_table([with_unit_signs(name) for name in table.headings], cells)


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
