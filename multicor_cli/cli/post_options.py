"""Options that the commands ``post …`` share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Optional

import typer

FigureFile = Annotated[
    Optional[Path],  # noqa: UP045  (evaluated by typer)
    typer.Option(
        "--plot",
        metavar="FILE",
        help="Draw a figure: FILE.png, .svg or .pdf; the word term draws it in the terminal.",
        show_default=False,
    ),
]
OverwriteFigure = Annotated[bool, typer.Option("--overwrite", help="Replace the figure if there is one.")]
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
Between = Annotated[
    Optional[tuple[str, str]],  # noqa: UP045
    typer.Option(
        "--between", metavar="LOWER UPPER", help="Names of the walls below and above.", show_default="those that bound the grains"
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print the data as JSON.")]
AsCsv = Annotated[bool, typer.Option("--csv", help="Print the data as CSV.")]


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
        raise typer.BadParameter(f"'{text}' is not a range of frames; write A:B or A:B:STEP", param_hint="--frames") from None
    return slice(*numbers)
