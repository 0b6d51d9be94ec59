"""Commands ``post profile``, ``post theta-eta``, ``post map``: what the grains do."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Optional

import typer

from multicor_cli.cli.completion import listed
from multicor_cli.cli.options import RunPath
from multicor_cli.cli.post_options import (
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
    parse_frames,
)
from multicor_cli.cli.post_output import TableOutput
from multicor_cli.text import count_noun

if TYPE_CHECKING:
    from multicor_cli.post import ThetaTable

ProfileOf = Annotated[
    str,
    typer.Option(
        "--of",
        metavar="FIELD",
        help="What to average: {profiled}, or all components with {groups}.",
        autocompletion=listed("profiled", "groups"),
    ),
]
MapOf = Annotated[
    str,
    typer.Option("--of", metavar="FIELD", help="What to show: {mapped}.", autocompletion=listed("mapped")),
]
Normalized = Annotated[
    bool,
    typer.Option(
        "--normalized",
        help="y/H, and velocity or temperature from 0 at the lower to 1 at the upper wall; spin over the shear rate of the walls.",
    ),
]
BritishNormalized = Annotated[bool, typer.Option("--normalised", hidden=True)]
WallName = Annotated[
    Optional[str],  # noqa: UP045  (evaluated by typer)
    typer.Option("--wall", metavar="NAME", help="Wall from which η counts.", show_default="the only one with a temperature"),
]
Height = Annotated[
    Optional[float],  # noqa: UP045
    typer.Option("--height", metavar="H", help="Height H of the bed (in m).", show_default="how far the grains reach"),
]
Reference = Annotated[
    Optional[float],  # noqa: UP045
    typer.Option("--reference", metavar="T0", help="Temperature T₀ (in K).", show_default="mean of the first frame"),
]
Grains = Annotated[bool, typer.Option("--grains", help="Include every grain: in JSON besides the bins, in CSV instead of them.")]
BinWidth = Annotated[
    Optional[float],  # noqa: UP045
    typer.Option("--bin-width", metavar="D", help="Width of a bin in mean diameters, instead of --bins.", show_default="1"),
]
ExcludeWalls = Annotated[
    Optional[float],  # noqa: UP045
    typer.Option(
        "--exclude-walls",
        metavar="D",
        help="Leave out this many mean diameters at each wall.",
        show_default="1, at most an eighth of the distance of the walls",
    ),
]
Groups = Annotated[
    Optional[list[str]],  # noqa: UP045
    typer.Option(
        "--group", metavar="NAME", help="Count the grains of this group only; several times for several.", show_default="all"
    ),
]
Streamlines = Annotated[
    bool,
    typer.Option(
        "--streamlines/--no-streamlines", help="Show a fluctuation as streamlines of its local mean, or as arrows of the grains."
    ),
]


def profile(
    directory: RunPath,
    of: ProfileOf = "velocity",
    is_normalized: Normalized = False,
    is_normalised: BritishNormalized = False,
    start: Start = None,
    end: End = None,
    frames: Frames = None,
    bins: Bins = None,
    bin_width: BinWidth = None,
    exclude_walls: ExcludeWalls = None,
    between: Between = None,
    groups: Groups = None,
    is_json: AsJson = False,
    is_csv: AsCsv = False,
    plot: FigureFile = None,
    is_overwriting: OverwriteFigure = False,
) -> None:
    """Average a field over horizontal bins and over frames, with standard errors and a word on drifts.

    Grains count in a bin with the area that lies in it. Heights are measured from the lower wall. "heat" is what friction and
    impacts generate in the grains per time and area of the plane, from the differences of consecutive frames. "stress" is the force
    on a grain times the branch towards it, spread along the branch, per area of the plane (force per length, compression positive);
    "kinetic-stress" is what fluctuations of the velocity add to it.
    """
    output = TableOutput(is_json, is_csv, plot, is_overwriting=is_overwriting)
    if bins is not None and bin_width is not None:
        raise typer.BadParameter("--bins and --bin-width exclude each other")
    from multicor_cli.post import Selection, profiles
    from multicor_cli.store import open_run

    selection = Selection(start, end, parse_frames(frames, start, end))
    with open_run(directory) as run:
        found = profiles(
            run, of, selection, bins, bin_width=bin_width, exclude_walls=exclude_walls, between=between, groups=groups or ()
        )
    if is_normalized or is_normalised:
        found = found.normalized()
    output.draw(found)
    table = found.first
    about = (
        f"{count_noun(table.frames.size, 'frame')} from t = {table.times[0]:g} s to {table.times[1]:g} s, height {table.height:g} m"
    )
    about += f", grains{table.about_groups}" if table.groups else ""
    notes = [table.note if len(found.tables) == 1 else f"{table.field.name}: {table.note}" for table in found.tables if table.note]
    output.deliver(found, "\n".join(line for line in (about, table.about_walls, *notes) if line), run=directory)


def theta_eta(
    directory: RunPath,
    frame: OneFrame = -1,
    frames: Frames = None,
    bins: Bins = None,
    wall: WallName = None,
    height: Height = None,
    reference: Reference = None,
    has_grains: Grains = False,
    is_json: AsJson = False,
    is_csv: AsCsv = False,
    plot: FigureFile = None,
    is_overwriting: OverwriteFigure = False,
) -> None:
    """Temperature θ = (T − T₀)/(T_wall − T₀) against the distance η = y/H from a heated wall, and its spread.

    y is measured from the surface of the wall, where the nearest grain touches it. With --frames: over the grains of several
    frames, and how the means of the bins scatter from frame to frame.
    """
    output = TableOutput(is_json, is_csv, plot, is_overwriting=is_overwriting)
    if has_grains and not (is_json or is_csv):
        raise typer.BadParameter("--grains needs --json or --csv", param_hint="--grains")
    if frames is not None and frame != -1:
        raise typer.BadParameter("give either --frame or --frames")
    wanted = parse_frames(frames, None, None)
    from multicor_cli.post import Selection
    from multicor_cli.post import theta_eta as make_table
    from multicor_cli.store import open_run

    with open_run(directory) as run:
        selection = None if wanted is None else Selection(frames=wanted)
        table = make_table(run, frame, selection=selection, bins=bins, wall=wall, height=height, reference=reference)
    output.draw(table)
    about = (
        f"{_frames_of(table)}, wall '{table.wall}' at {table.wall_temperature:g} K, "
        f"T0 = {table.reference:g} K, H = {table.height:g} m"
    )
    output.deliver(table, about, run=directory, is_detailed=has_grains, has_grains=has_grains)


def map_grains(
    directory: RunPath,
    of: MapOf = "temperature",
    frame: OneFrame = -1,
    has_streamlines: Streamlines = True,
    is_json: AsJson = False,
    is_csv: AsCsv = False,
    plot: FigureFile = None,
    is_overwriting: OverwriteFigure = False,
) -> None:
    """Show a quantity of every grain of one frame: a table of its distribution, the grains as data, a map as figure.

    "fluctuation" is the velocity relative to the mean horizontal flow at the height of the grain; "heat" is what friction and
    impacts have generated since the frame before; "stress" the mean pressure in a grain by its contact forces, their sum over the
    circumference.
    """
    output = TableOutput(is_json, is_csv, plot, is_overwriting=is_overwriting)
    from multicor_cli.post import grain_map
    from multicor_cli.store import open_run

    with open_run(directory) as run:
        table = grain_map(run, of, frame)
    output.draw(table, has_streamlines=has_streamlines)
    about = f"{table.field.label} in frame {table.frame} at t = {table.time:g} s"
    output.deliver(table, about, run=directory, is_detailed=True)


def _frames_of(table: ThetaTable) -> str:
    last = f"frame {table.frame} at t = {table.time:g} s"
    return last if table.frames.size == 1 else f"{table.frames.size} frames up to {last}"


COMMANDS = {"profile": profile, "theta-eta": theta_eta, "map": map_grains}
"""Commands by name."""
