"""Commands ``post energy``, ``post compare``: whole runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Optional

import typer

from multicor_cli.cli.completion import listed
from multicor_cli.cli.console import say
from multicor_cli.cli.options import RunPath
from multicor_cli.cli.post_options import AsCsv, AsJson, Bins, End, FigureFile, Frames, OverwriteFigure, Start, parse_frames
from multicor_cli.cli.post_output import TableOutput
from multicor_cli.text import count_noun

Earliest = Annotated[
    Optional[float],  # noqa: UP045  (evaluated by typer)
    typer.Option("--from", metavar="T", help="Earliest time (in s).", show_default="the start"),
]
OtherPath = Annotated[Path, typer.Argument(metavar="OTHER", help="Run to compare it with.", show_default=False)]
ComparedFields = Annotated[
    Optional[list[str]],  # noqa: UP045
    typer.Option(
        "--of",
        metavar="FIELD",
        help="Field whose profiles are compared, see `post profile`; may be given several times.",
        show_default="velocity",
        autocompletion=listed("profiled"),
    ),
]


def energy(
    directory: RunPath,
    start: Earliest = None,
    end: End = None,
    is_json: AsJson = False,
    is_csv: AsCsv = False,
    plot: FigureFile = None,
    is_overwriting: OverwriteFigure = False,
) -> None:
    """Show the energy books, mechanical and of heat: at the end as a table; over time as CSV, JSON and figure.

    They count from the start of the run. The closure is the largest imbalance so far over the sum of all terms.
    """
    output = TableOutput(is_json, is_csv, plot, is_overwriting=is_overwriting)
    from multicor_cli.post import energy as make_table
    from multicor_cli.store import open_run

    with open_run(directory) as run:
        table = make_table(run, start, end)
    output.draw(table)
    about = f"energy books from the start of the run to t = {table.time[-1]:g} s"
    output.deliver(table, about, run=directory, is_detailed=True)


def compare(
    directory: RunPath,
    other: OtherPath,
    of: ComparedFields = None,
    start: Start = None,
    end: End = None,
    frames: Frames = None,
    bins: Bins = None,
    is_json: AsJson = False,
    is_csv: AsCsv = False,
    plot: FigureFile = None,
    is_overwriting: OverwriteFigure = False,
) -> None:
    """Compare two runs: scenario keys that differ, books, rheology if both are sheared between two walls, profiles of fields.

    Differences are given over their standard errors where these are known: beyond 2 or 3 they are not chance. Profiles have the
    same number of bins in both runs and are matched by y/H; CSV and figure show them.
    """
    output = TableOutput(is_json, is_csv, plot, is_overwriting=is_overwriting)
    from multicor_cli.post import Selection
    from multicor_cli.post import compare as make_comparison
    from multicor_cli.store import open_run

    selection = Selection(start, end, parse_frames(frames, start, end))
    with open_run(directory) as first, open_run(other) as second:
        found = make_comparison(first, second, of or ["velocity"], selection, bins, names=_names(directory, other))
    output.draw(found)
    if not is_json:
        differ = "differs" if len(found.keys) == 1 else "differ"
        say(f"{count_noun(len(found.keys), 'key')} of the scenarios {differ}" + (":" if found.keys else ""))
        for key, one, two in found.keys:
            say(f"  {key}: {one} | {two}")
    output.deliver(found, f"{directory} and {other}", is_detailed=True)


def _names(first: Path, second: Path) -> tuple[str, str]:
    """Names of two directories, with as much of the paths above them as tells them apart."""
    one, two = first.absolute().parts, second.absolute().parts
    for count in range(1, max(len(one), len(two))):
        names = "/".join(one[-count:]), "/".join(two[-count:])
        if names[0] != names[1]:
            return names
    return str(first), str(second)


COMMANDS = {"energy": energy, "compare": compare}
"""Commands by name."""
