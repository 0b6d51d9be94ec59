"""Command ``post fields``: coarse-grained fields over the plane, along a line, or about a center."""

from __future__ import annotations

import math
from typing import Annotated, Optional

import typer

from multicor_cli.cli import completion
from multicor_cli.cli.options import RunPath
from multicor_cli.cli.post_options import AsCsv, AsJson, End, FigureFile, Frames, OverwriteFigure, Start, parse_frames
from multicor_cli.cli.post_output import TableOutput
from multicor_cli.text import count_noun

FieldNames = Annotated[
    Optional[list[str]],  # noqa: UP045  (evaluated by typer)
    typer.Option(
        "--of",
        metavar="FIELD",
        help="Field of the figure, and of the table of a line or of rings; several times for several. The table of a grid lists "
        "what there is.",
        show_default="solid-fraction; velocities of a line or of rings",
        autocompletion=completion.fields,
    ),
]
Spacing = Annotated[float, typer.Option("--spacing", metavar="D", help="Distance of the points in mean diameters.")]
Reach = Annotated[float, typer.Option("--reach", metavar="D", help="How far the kernel reaches, in mean diameters.")]
CenterPoint = Annotated[
    Optional[str],  # noqa: UP045
    typer.Option("--center", metavar="X,Y", help="Polar coordinates about this point (in m).", show_default=False),
]
Along = Annotated[
    Optional[str],  # noqa: UP045
    typer.Option("--line", metavar="X0,Y0:X1,Y1", help="Fields on the line between these points (in m).", show_default=False),
]
Radial = Annotated[bool, typer.Option("--radial", help="Average over rings about --center.")]


def fields(
    directory: RunPath,
    of: FieldNames = None,
    center: CenterPoint = None,
    is_radial: Radial = False,
    along: Along = None,
    spacing: Spacing = 0.5,
    reach: Reach = 2.0,
    start: Start = None,
    end: End = None,
    frames: Frames = None,
    is_json: AsJson = False,
    is_csv: AsCsv = False,
    plot: FigureFile = None,
    is_overwriting: OverwriteFigure = False,
) -> None:
    """Average fields over frames with a smooth kernel: solid fraction, velocity, strain rate, stress, temperature, fluctuations.

    On a grid over the grains, on a polar grid (--center), on a line (--line), or over rings (--center with --radial); these two
    have standard errors. CSV and JSON have every field at every point.
    """
    output = TableOutput(is_json, is_csv, plot, is_overwriting=is_overwriting)
    if is_radial and center is None:
        raise typer.BadParameter("--radial needs --center", param_hint="--radial")
    if along is not None and center is not None:
        raise typer.BadParameter("--line and --center exclude each other")
    middle = None if center is None else parse_point(center, "--center")
    ends = None if along is None else parse_line(along, "--line")
    from multicor_cli.post import Selection
    from multicor_cli.post import fields as make_table
    from multicor_cli.store import open_run

    selection = Selection(start, end, parse_frames(frames, start, end))
    with open_run(directory) as run:
        table = make_table(
            run, of or (), selection, spacing=spacing, reach=reach, center=middle, along=ends, is_radial=is_radial
        )  # fmt: skip
    output.draw(table)
    about = f"{count_noun(table.frames.size, 'frame')} from t = {table.times[0]:g} s to {table.times[1]:g} s"
    about += f"; {table.note}" if table.note else ""
    output.deliver(table, about, run=directory, is_detailed=True)


def parse_point(text: str, option: str) -> tuple[float, float]:
    """A point ``X,Y`` [m]; refuses a text that is none."""
    try:
        x, y = (float(part) for part in text.split(","))
        if not math.isfinite(x + y):
            raise ValueError
    except ValueError:
        raise typer.BadParameter(f"'{text}' is not a point; write X,Y in meters, as 0.02,0.01", param_hint=option) from None
    return x, y


def parse_line(text: str, option: str) -> tuple[tuple[float, float], tuple[float, float]]:
    """A line ``X0,Y0:X1,Y1`` [m]; refuses a text that is none."""
    first, _, last = text.partition(":")
    if not last:
        raise typer.BadParameter(f"'{text}' is not a line; write X0,Y0:X1,Y1 in meters", param_hint=option)
    return parse_point(first, option), parse_point(last, option)


COMMANDS = {"fields": fields}
"""Commands by name."""
