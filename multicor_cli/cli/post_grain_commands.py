"""Commands ``post …`` about what the grains do: profiles, θ–η, maps, fields, regions, and films of maps."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Optional

import typer

from multicor_cli.cli import options
from multicor_cli.cli.console import say, show_progress
from multicor_cli.cli.options import RunPath, listed, output_option
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

if TYPE_CHECKING:
    from multicor_cli.model.shapes import Area
    from multicor_cli.post import GrainMap, ThetaTable
    from multicor_cli.store import Run

# ---- Commands `post profile`, `post theta-eta`, `post map`

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


# ---- Command `post fields`: coarse-grained fields over the plane, along a line, or about a center

FieldNames = Annotated[
    Optional[list[str]],  # noqa: UP045  (evaluated by typer)
    typer.Option(
        "--of",
        metavar="FIELD",
        help="Field of the figure, and of the table of a line or of rings; several times for several. The table of a grid lists "
        "what there is.",
        show_default="solid-fraction; velocities of a line or of rings",
        autocompletion=options.fields,
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


FIELD_COMMANDS = {"fields": fields}
"""Commands by name."""


# ---- Command `post region`: what is inside a part of the plane

EXAMPLE = '{ kind = "circle", center = [0.02, 0.01], radius = 0.005 }'
Place = Annotated[
    str,
    typer.Option(
        "--in",
        metavar="REGION",
        help=f"The region, as in a scenario: {EXAMPLE}, an annulus, a polygon, or a rectangle {{ min, max }}.",
        show_default=False,
    ),
]


def region(
    directory: RunPath,
    place: Place,
    start: Start = None,
    end: End = None,
    frames: Frames = None,
    is_json: AsJson = False,
    is_csv: AsCsv = False,
    plot: FigureFile = None,
    is_overwriting: OverwriteFigure = False,
) -> None:
    """Measure what is inside a region: solid fraction, coordination, velocity, temperature, stress of contacts and of fluctuations.

    The table holds means over the frames and their standard errors, CSV one row per frame, JSON and figure both. Grains count with
    the part of their area that lies inside, contacts with that of their branch.
    """
    output = TableOutput(is_json, is_csv, plot, is_overwriting=is_overwriting)
    area = _parse(place)
    from multicor_cli.post import Selection, in_region
    from multicor_cli.store import open_run

    with open_run(directory) as run:
        table = in_region(run, area, Selection(start, end, parse_frames(frames, start, end)))
    output.draw(table)
    about = f"{count_noun(len(table.time), 'frame')} from t = {table.time[0]:g} s to {table.time[-1]:g} s"
    output.deliver(table, about, run=directory, is_detailed=True)


def _parse(text: str) -> Area:
    from pydantic import TypeAdapter, ValidationError

    from multicor_cli.scenario.region import AnyRegion, Region

    try:
        found: Region = TypeAdapter(AnyRegion).validate_python(tomllib.loads(f"region = {text}")["region"])
    except tomllib.TOMLDecodeError:
        raise typer.BadParameter(f"'{text}' is not a region; write it as {EXAMPLE}", param_hint="--in") from None
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(key) for key in first["loc"] if not str(key).startswith("<"))
        raise typer.BadParameter(f"{where or 'region'}: {first['msg']}; write it as {EXAMPLE}", param_hint="--in") from None
    return found.area()


REGION_COMMANDS = {"region": region}
"""Commands by name."""


# ---- Command `post animate`: a film of a map

FilmOf = Annotated[str, typer.Option("--of", metavar="FIELD", help="What to show: {mapped}.", autocompletion=listed("mapped"))]
FilmFile = Annotated[Path, output_option(metavar="FILE", help="File to write: FILE.mp4 or .gif.")]
Rate = Annotated[float, typer.Option("--fps", metavar="N", min=0.1, max=120.0, help="Pictures per second.")]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace the file if it exists.")]


def animate(
    directory: RunPath,
    output: FilmFile,
    of: FilmOf = "velocity",
    frames: Frames = None,
    rate: Rate = 20.0,
    is_overwriting: Overwrite = False,
) -> None:
    """Draw a map of every frame into a film, with one color scale for all.

    An .mp4 needs ffmpeg; where it is missing a .gif is written instead.
    """
    from multicor_cli.export.target import check_output
    from multicor_cli.plots.animate import SUFFIXES, film_path, write_film

    if output.suffix.lower() not in SUFFIXES:
        raise typer.BadParameter(f"'{output}' does not end in .mp4 or .gif", param_hint="-o")
    target = film_path(output)
    if target != output:
        say(f"ffmpeg is not installed: writing {target} instead of {output}")
    check_output(target, is_overwriting=is_overwriting)
    from multicor_cli.post import Selection
    from multicor_cli.store import open_run

    with open_run(directory) as run, show_progress("frame") as progress:
        chosen = Selection(frames=parse_frames(frames, None, None) or slice(None)).indices(run.frames).tolist()
        film = write_film(lambda: _maps(run, of, chosen), len(chosen), output, rate=rate, progress=progress)
    skipped = f", without {film.skipped} that lack this quantity" if film.skipped else ""
    say(f"wrote {film.path}: {film.frames} frames{skipped}")


def _maps(run: Run, of: str, chosen: list[int]) -> Iterator[GrainMap | None]:
    """Maps of frames; None for those that lack the quantity. Not all may lack it, and there must be a grain in some."""
    from multicor_cli.post import PostError, grain_map

    found, trouble = False, None
    for frame in chosen:
        try:
            table = grain_map(run, of, frame, may_be_empty=True)
        except PostError as error:
            trouble = error
            yield None
            continue
        found |= bool(table.value.size)
        yield table
    if not found:
        raise trouble or PostError("no grain is there in any of the frames")


FILM_COMMANDS = {"animate": animate}
"""Commands by name."""
