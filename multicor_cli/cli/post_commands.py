"""Commands ``post …`` about contacts, whole runs, series and flows; those about grains are in `post_grain_commands`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Optional

import typer

from multicor_cli.cli import options, post_grain_commands
from multicor_cli.cli.console import say
from multicor_cli.cli.options import ListingCommand, RunPath, listed
from multicor_cli.cli.post_grain_commands import parse_line
from multicor_cli.cli.post_output import (
    AsCsv,
    AsJson,
    Between,
    Bins,
    End,
    FigureFile,
    Frames,
    OneFrame,
    OverwriteFigure,
    Start,
    TableOutput,
    parse_frames,
)
from multicor_cli.text import count_noun

# ---- Commands `post forces`, `post rheology`: what the contacts carry

Distribution = Annotated[bool, typer.Option("--distribution", help="Show how many contacts carry which force instead.")]
Angles = Annotated[bool, typer.Option("--angles", help="Show contacts and forces by direction instead.")]
Margin = Annotated[
    Optional[float],  # noqa: UP045  (evaluated by typer)
    typer.Option(
        "--margin",
        metavar="D",
        help="Thickness of the layer at each wall that is left out of the bulk, in mean diameters.",
        show_default="8, or a quarter of the height or a third of the gap between the walls if less",
    ),
]
ManyFrames = Annotated[
    Optional[str],  # noqa: UP045
    typer.Option(
        "--frames",
        metavar="A:B[:STEP]",
        help="With --distribution or --angles: the frames to average over.",
        show_default=False,
    ),
]


def forces(
    directory: RunPath,
    frame: OneFrame = -1,
    has_distribution: Distribution = False,
    has_angles: Angles = False,
    frames: ManyFrames = None,
    is_json: AsJson = False,
    is_csv: AsCsv = False,
    plot: FigureFile = None,
    is_overwriting: OverwriteFigure = False,
) -> None:
    """Show the contact forces of one frame: their numbers as a table, the single contacts as CSV, the network as figure.

    Forces are means of the step before the frame. With --distribution: the probability density of forces between grains over their
    mean. With --angles: the directions of contacts between grains, the mean forces along them, and their anisotropies.
    """
    output = TableOutput(is_json, is_csv, plot, is_overwriting=is_overwriting)
    if has_distribution and has_angles:
        raise typer.BadParameter("--distribution and --angles exclude each other")
    if not (has_distribution or has_angles):
        if frames is not None:
            raise typer.BadParameter("--frames needs --distribution or --angles; choose one frame with --frame")
        _network(directory, frame, output)
        return
    from multicor_cli.post import Selection, angular_distribution, force_distribution, frame_index
    from multicor_cli.store import open_run

    wanted = parse_frames(frames, None, None)
    with open_run(directory) as run:
        index = frame_index(run.frames, frame)
        selection = Selection(frames=slice(index, index + 1) if wanted is None else wanted)
        found: Any = (force_distribution if has_distribution else angular_distribution)(run, selection)
    output.draw(found)
    first, last = found.times
    about = (
        f"{found.contacts} contacts between grains in {count_noun(found.frames.size, 'frame')} from t = {first:g} s to {last:g} s"
    )
    if has_angles:
        about += "; " + ", ".join(
            f"{name} = {value:.4g}" + (f" (± {found.moments_scatter[name]:.2g} between frames)" if found.frames.size > 1 else "")
            for name, value in found.moments.items()
        )
    output.deliver(found, about, run=directory)


def _network(directory: Path, frame: int, output: TableOutput) -> None:
    from multicor_cli.post import force_network
    from multicor_cli.store import open_run

    with open_run(directory) as run:
        network = force_network(run, frame)
    output.draw(network)
    about = f"contact forces in frame {network.frame} at t = {network.time:g} s"
    output.deliver(network, about, run=directory, is_detailed=True)


def rheology(
    directory: RunPath,
    start: Start = None,
    end: End = None,
    frames: Frames = None,
    margin: Margin = None,
    between: Between = None,
    is_json: AsJson = False,
    is_csv: AsCsv = False,
    plot: FigureFile = None,
    is_overwriting: OverwriteFigure = False,
) -> None:
    """Measure the rheology of a layer between two walls that shear it: averages with errors; over time as CSV, JSON and figure.

    I = rate × √(m/P), with the mean mass m of a grain and the force P per length with which the walls press; the other convention
    is rate × d/√(P/ρ), with the mass ρ of the grains per area they cover. Friction μ* is shear over normal stress. Rattlers are
    grains with fewer than two contacts that carry a force.
    """
    output = TableOutput(is_json, is_csv, plot, is_overwriting=is_overwriting)
    from multicor_cli.post import Selection
    from multicor_cli.post import rheology as make_table
    from multicor_cli.store import open_run

    selection = Selection(start, end, parse_frames(frames, start, end))
    with open_run(directory) as run:
        table = make_table(run, selection, margin=margin, between=between)
    output.draw(table)
    about = (
        f"{count_noun(table.frames.size, 'frame')} from t = {table.times[0]:g} s to {table.times[1]:g} s, "
        f"between '{table.walls[0]}' and '{table.walls[1]}', {table.height:g} m apart; the bulk begins {table.margin:g} m from each"
    )
    output.deliver(table, about, run=directory, is_detailed=True)


CONTACT_COMMANDS = {"forces": forces, "rheology": rheology}
"""Commands by name."""


# ---- Commands `post energy`, `post compare`: whole runs

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


RUN_COMMANDS = {"energy": energy, "compare": compare}
"""Commands by name."""


# ---- Commands `post series` and `post flow`: columns over time, and what flows through a line

ColumnNames = Annotated[
    Optional[list[str]],  # noqa: UP045  (evaluated by typer)
    typer.Option(
        "--of",
        metavar="COLUMN",
        help="A column, as kinetic or 'top: force_x'; force_x alone means that of all walls. Several times for several.",
        show_default="all; in a figure kinetic energy, forces on walls and number of contacts",
        autocompletion=options.columns,
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


SERIES_COMMANDS = {"series": series, "flow": flow}
"""Commands by name."""


# ---- All of them

post = typer.Typer(no_args_is_help=True, help="Tables and figures from a run.")

COMMANDS = {
    **post_grain_commands.COMMANDS,
    **CONTACT_COMMANDS,
    **post_grain_commands.REGION_COMMANDS,
    **post_grain_commands.FIELD_COMMANDS,
    **RUN_COMMANDS,
    **SERIES_COMMANDS,
    **post_grain_commands.FILM_COMMANDS,
}
"""Commands by name."""


def register(app: typer.Typer, wrap: Any) -> None:
    """Add the commands."""
    for name, command in COMMANDS.items():
        post.command(name, cls=ListingCommand)(wrap(command))
    app.add_typer(post, name="post")
