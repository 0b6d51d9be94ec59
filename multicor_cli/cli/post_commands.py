"""Commands ``post …``: tables and figures from a run."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Optional

import typer

from multicor_cli.cli.console import emit, emit_json, emit_table, say
from multicor_cli.cli.options import RunPath

if TYPE_CHECKING:
    from multicor_cli.post import ProfileTable

post = typer.Typer(no_args_is_help=True, help="Tables and figures from a run.")

FigureFile = Annotated[
    Optional[Path],  # noqa: UP045  (evaluated by typer)
    typer.Option("--plot", metavar="FILE", help="Draw a figure: FILE.png, .svg or .pdf.", show_default=False),
]
Start = Annotated[
    Optional[float],  # noqa: UP045
    typer.Option("--from", metavar="T", help="Earliest time [s].", show_default="the later half of the last stage"),
]
End = Annotated[
    Optional[float],  # noqa: UP045
    typer.Option("--to", metavar="T", help="Latest time [s].", show_default="the end"),
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
Bins = Annotated[
    Optional[int],  # noqa: UP045
    typer.Option("--bins", min=1, help="Number of bins.", show_default="one per mean diameter"),
]
Normalized = Annotated[
    bool, typer.Option("--normalised", "--normalized", help="y/H, and the field from 0 at the lower to 1 at the upper wall.")
]


def profile(
    directory: RunPath,
    of: Annotated[str, typer.Option("--of", metavar="FIELD", help="What to average: velocity.")] = "velocity",
    is_normalized: Normalized = False,
    start: Start = None,
    end: End = None,
    frames: Frames = None,
    bins: Bins = None,
    is_json: Annotated[bool, typer.Option("--json", help="Print the data as JSON.")] = False,
    is_csv: Annotated[bool, typer.Option("--csv", help="Print the data as CSV.")] = False,
    plot: FigureFile = None,
) -> None:
    """Average a field over horizontal bins and over frames, with standard errors from block averages.

    Grains count in a bin with the area that lies in it. Heights are measured from the lower wall.
    """
    if is_json and is_csv:
        raise typer.BadParameter("--json and --csv exclude each other")
    if plot is not None and plot.suffix.lower() not in (".png", ".svg", ".pdf"):
        raise typer.BadParameter(f"'{plot}' does not end in .png, .svg or .pdf", param_hint="--plot")
    from multicor_cli.post import Selection
    from multicor_cli.post import profile as make_profile
    from multicor_cli.store import open_run

    selection = Selection(start, end, _parse_frames(frames, start, end))
    with open_run(directory) as run:
        table = make_profile(run, of, selection, bins)
    if is_normalized:
        table = table.normalized()
    if plot is not None:
        from multicor_cli.plots import plot_profile

        plot_profile(table, plot)
        say(f"wrote {plot}")
    if is_json:
        emit_json({"run": str(directory), **table.as_dict()})
    elif is_csv:
        _emit_csv(table)
    else:
        _emit_table(table)


def _parse_frames(text: str | None, start: float | None, end: float | None) -> slice | None:
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


def _emit_csv(table: ProfileTable) -> None:
    emit(",".join(table.headings))
    for row in table.rows:
        emit(",".join("" if math.isnan(value) else repr(value) for value in row))


def _emit_table(table: ProfileTable) -> None:
    count = table.frames.size
    say(f"{count} frames from t = {table.times[0]:g} s to {table.times[1]:g} s, height {table.height:g} m")
    rows = [["–" if math.isnan(value) else f"{value:.5g}" for value in row] for row in table.rows]
    emit_table(table.headings, rows)


def register(app: typer.Typer, wrap: Any) -> None:
    """Add the commands."""
    post.command("profile")(wrap(profile))
    app.add_typer(post, name="post")
