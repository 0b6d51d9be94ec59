"""Commands ``post series`` and ``post flow``: columns over time, and what flows through a line."""

from __future__ import annotations

from typing import Annotated, Optional

import typer

from multicor_cli.cli import completion
from multicor_cli.cli.options import RunPath
from multicor_cli.cli.post_fields_command import parse_line
from multicor_cli.cli.post_options import AsCsv, AsJson, End, FigureFile, Frames, OverwriteFigure, Start, parse_frames
from multicor_cli.cli.post_output import TableOutput
from multicor_cli.text import count_noun

ColumnNames = Annotated[
    Optional[list[str]],  # noqa: UP045  (evaluated by typer)
    typer.Option(
        "--of",
        metavar="COLUMN",
        help="A column, as kinetic or 'top: force_x'; force_x alone means that of all walls. Several times for several.",
        show_default="all; in a figure kinetic energy, forces on walls and number of contacts",
        autocompletion=completion.columns,
    ),
]
SeriesStart = Annotated[
    Optional[float],  # noqa: UP045
    typer.Option("--from", metavar="T", help="Earliest time, in s.", show_default="the start"),
]
Line = Annotated[str, typer.Option("--line", metavar="X0,Y0:X1,Y1", help="The line (in m); what crosses to its left is positive.")]


def series(
    directory: RunPath,
    of: ColumnNames = None,
    start: SeriesStart = None,
    end: End = None,
    is_json: AsJson = False,
    is_csv: AsCsv = False,
    plot: FigureFile = None,
    is_overwriting: OverwriteFigure = False,
) -> None:
    """Show columns of the time series: means, errors and drifts as a table; over time as CSV, JSON and figure."""
    output = TableOutput(is_json, is_csv, plot, is_overwriting=is_overwriting)
    from multicor_cli.post import series as make_table
    from multicor_cli.store import open_run

    with open_run(directory) as run:
        table = make_table(run, of or (), start, end)
    output.draw(table if of else table.overview())
    about = f"{count_noun(table.time.size, 'row')} from t = {table.time[0]:g} s to {table.time[-1]:g} s"
    output.deliver(table, about, run=directory, is_detailed=True)


def flow(
    directory: RunPath,
    line: Line,
    start: Start = None,
    end: End = None,
    frames: Frames = None,
    is_json: AsJson = False,
    is_csv: AsCsv = False,
    plot: FigureFile = None,
    is_overwriting: OverwriteFigure = False,
) -> None:
    """Measure the flow through a line: grains, mass and area per time, from the grains that cross it from frame to frame."""
    output = TableOutput(is_json, is_csv, plot, is_overwriting=is_overwriting)
    ends = parse_line(line, "--line")
    from multicor_cli.post import Selection, flow_through
    from multicor_cli.store import open_run

    with open_run(directory) as run:
        table = flow_through(run, ends, Selection(start, end, parse_frames(frames, start, end)))
    output.draw(table)
    about = f"{count_noun(table.time.size, 'interval')} from t = {table.time[0] - table.duration[0]:g} s to {table.time[-1]:g} s"
    output.deliver(table, f"{about}; {table.note}" if table.note else about, run=directory, is_detailed=True)


COMMANDS = {"series": series, "flow": flow}
"""Commands by name."""
