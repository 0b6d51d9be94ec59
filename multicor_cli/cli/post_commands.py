"""Commands ``post …``: tables, figures, films of a run. Each loads what it needs when called."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from multicor_cli import store
from multicor_cli.cli import options
from multicor_cli.cli.console import say, show_progress
from multicor_cli.cli.contact_commands import (
    conductivity,
    forces,
    heat_network,
    hot_spots,
    rheology,
    wall_heat,
)
from multicor_cli.cli.grain_commands import (
    avalanches,
    chains,
    clusters,
    correlation,
    diffusion,
    fabric,
    lifetimes,
    mixing,
    residence,
    structure,
)
from multicor_cli.cli.options import RunPath, listed, option, output_option
from multicor_cli.cli.post_output import (
    Between,
    Bins,
    Chosen,
    End,
    Frames,
    OneFrame,
    SeriesStart,
    Shown,
    parse_frames,
    shows_table,
    span_of,
    span_of_frames,
)
from multicor_cli.text import count_noun

if TYPE_CHECKING:
    from multicor_cli.model.shapes import Area
    from multicor_cli.post import GrainMap
    from multicor_cli.store import Run

# ---- Commands `post profile`, `post theta-eta`, `post map`

_PROFILED = "What to average: {profiled}, or all components with {groups}."
ProfileOf = Annotated[
    str, option("--of FIELD", _PROFILED, autocompletion=listed("profiled", "groups"))
]
MapOf = Annotated[
    str, option("--of FIELD", "What to show: {mapped}.", autocompletion=listed("mapped"))
]
_NORMALIZED = (
    "y/H, and velocity or temperature from 0 at the lower to 1 at the upper wall; spin over the "
    "shear rate of the walls."
)
Normalized = Annotated[bool, option("--normalized", _NORMALIZED)]
BritishNormalized = Annotated[bool, typer.Option("--normalised", hidden=True)]
WallName = Annotated[
    str | None,
    option("--wall NAME", "Wall from which η counts.", "the only one with a temperature"),
]
Height = Annotated[
    float | None, option("--height H", "Height H of the bed (in m).", "how far the grains reach")
]
Reference = Annotated[
    float | None, option("--reference T0", "Temperature T₀ (in K).", "mean of the first frame")
]
_GRAINS = "Include every grain: in JSON besides the bins, in CSV instead of them."
Grains = Annotated[bool, option("--grains", _GRAINS)]
BinWidth = Annotated[
    float | None,
    option("--bin-width D", "Width of a bin in mean diameters, instead of --bins.", "1"),
]
ExcludeWalls = Annotated[
    float | None,
    option(
        "--exclude-walls D",
        "Leave out this many mean diameters at each wall.",
        "1, at most an eighth of the distance of the walls",
    ),
]
_GROUP = "Count the grains of this group only; several times for several."
Groups = Annotated[list[str] | None, option("--group NAME", _GROUP, "all")]
_STREAMLINES = (
    "Show a fluctuation or a heat flux as streamlines of its local mean, or as arrows of the "
    "grains."
)
Streamlines = Annotated[bool, option("--streamlines/--no-streamlines", _STREAMLINES)]

_SCALE = "Values (in the unit of the field) that the colors span: the same for several pictures."
Scale = Annotated[str | None, option("--scale MIN:MAX", _SCALE, "what the frame has")]


def profile(
    directory: RunPath,
    of: ProfileOf = "velocity",
    is_normalized: Normalized = False,
    is_normalised: BritishNormalized = False,
    *,
    selection: Chosen,
    bins: Bins = None,
    bin_width: BinWidth = None,
    exclude_walls: ExcludeWalls = None,
    between: Between = None,
    groups: Groups = None,
) -> Shown:
    """Average a field over horizontal bins and over frames, with standard errors and a word on
    drifts.

    Grains count in a bin with the area that lies in it. Heights are measured from the lower wall.
    "heat" is what friction and impacts generate in the grains per time and area of the plane, from
    the differences of consecutive frames. "stress" is the force on a grain times the branch towards
    it, spread along the branch, per area of the plane (force per length, compression positive);
    "kinetic-stress" is what fluctuations of the velocity add to it.
    """
    if bins is not None and bin_width is not None:
        raise typer.BadParameter("--bins and --bin-width exclude each other")
    from multicor_cli import post

    with store.open_run(directory) as run:
        found = post.profiles(
            run, of, selection, bins, bin_width=bin_width, exclude_walls=exclude_walls,
            between=between, groups=groups or ()
        )  # fmt: skip
    if is_normalized or is_normalised:
        found = found.normalized()
    table = found.first
    about = f"{span_of_frames(table)}, height {table.height:g} m"
    about += f", grains{table.about_groups}" if table.groups else ""
    notes = {table.field.name: table.note for table in found.tables if table.note}
    told = [note if len(found.tables) == 1 else f"{name}: {note}" for name, note in notes.items()]
    lines = "\n".join(filter(None, (about, table.about_walls, *told)))
    return Shown(found, lines, is_detailed=False)


def theta_eta(
    context: typer.Context,
    directory: RunPath,
    frame: OneFrame = -1,
    frames: Frames = None,
    bins: Bins = None,
    wall: WallName = None,
    height: Height = None,
    reference: Reference = None,
    has_grains: Grains = False,
) -> Shown:
    """Temperature θ = (T − T₀)/(T_wall − T₀) against the distance η = y/H from a heated wall, and
    its spread.

    y is measured from the surface of the wall, where the nearest grain touches it. With --frames:
    over the grains of several frames, and how the means of the bins scatter from frame to frame.
    """
    if has_grains and not (context.params["is_json"] or context.params["is_csv"]):
        raise typer.BadParameter("--grains needs --json or --csv", param_hint="--grains")
    if frames is not None and frame != -1:
        raise typer.BadParameter("give either --frame or --frames")
    wanted = parse_frames(frames)
    from multicor_cli import post

    with store.open_run(directory) as run:
        selection = None if wanted is None else post.Selection(frames=wanted)
        table = post.theta_eta(
            run, frame, selection=selection, bins=bins, wall=wall, height=height,
            reference=reference
        )  # fmt: skip
    about = f"frame {table.frame} at t = {table.time:g} s"
    if table.frames.size > 1:
        about = f"{table.frames.size} frames up to {about}"
    about += f", wall '{table.wall}' at {table.wall_temperature:g} K, T0 = {table.reference:g} K"
    about += f", H = {table.height:g} m"
    content = {"has_grains": has_grains}
    return Shown(table, about, is_detailed=has_grains, content=content)


def map_grains(
    directory: RunPath,
    of: MapOf = "temperature",
    frame: OneFrame = -1,
    has_streamlines: Streamlines = True,
    scale: Scale = None,
) -> Shown:
    """Show a quantity of every grain of one frame: a table of its distribution, the grains as data,
    a map as figure.

    "fluctuation" is the velocity relative to the mean horizontal flow at the height of the grain;
    "heat" is what friction and impacts have generated since the frame before; "heat-flux" what its
    contacts conduct; "stress" the mean pressure in a grain by its contact forces, their sum over
    the circumference.
    """
    ends = None if scale is None else parse_ends(scale, "--scale")
    from multicor_cli import post

    with store.open_run(directory) as run:
        table = post.grain_map(run, of, frame)
    if ends is not None and table.names:
        raise typer.BadParameter(f"a {table.field.label} has no scale", param_hint="--scale")
    if ends is not None and table.field.scale == "logarithmic" and not ends[0] > 0.0:
        raise typer.BadParameter("a logarithmic scale begins above 0", param_hint="--scale")
    about = f"{table.field.label} in frame {table.frame} at t = {table.time:g} s"
    drawing = {"has_streamlines": has_streamlines, "ends": ends}
    return Shown(table, about, drawing=drawing)


def parse_ends(text: str, option: str) -> tuple[float, float]:
    """Two numbers ``MIN:MAX``; refuses a text that is none, or whose numbers do not ascend."""
    try:
        low, high = (float(part) for part in text.split(":"))
        if not -math.inf < low < high < math.inf:
            raise ValueError
    except ValueError:
        raise typer.BadParameter(
            f"'{text}' is no range; write MIN:MAX, as 0:0.5", param_hint=option
        ) from None
    return low, high


# ---- Command `post region`: what is inside a part of the plane

EXAMPLE = '{ kind = "circle", center = [0.02, 0.01], radius = 0.005 }'
_PLACE = (
    f"The region, as in a scenario: {EXAMPLE}, an annulus, a polygon, or a rectangle "
    "{ min, max }."
)
Place = Annotated[str, option("--in REGION", _PLACE, False)]


def region(directory: RunPath, place: Place, *, selection: Chosen) -> Shown:
    """Measure what is inside a region: solid fraction, coordination number, velocity, temperature,
    contact stress and kinetic stress.

    The table holds means over the frames and their standard errors, CSV one row per frame, JSON and
    figure both. Grains count with the part of their area that lies inside, contacts with that of
    their branch.
    """
    area = _parse(place)
    from multicor_cli import post

    with store.open_run(directory) as run:
        table = post.in_region(run, area, selection)
    return Shown(table, span_of(table.time.size, "frame", table.time))


def _parse(text: str) -> Area:
    from pydantic import TypeAdapter, ValidationError

    from multicor_cli.scenario.region import AnyRegion, Region

    try:
        found: Region = TypeAdapter(AnyRegion).validate_python(
            tomllib.loads(f"region = {text}")["region"]
        )
    except tomllib.TOMLDecodeError:
        raise typer.BadParameter(
            f"'{text}' is not a region; write it as {EXAMPLE}", param_hint="--in"
        ) from None
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(key) for key in first["loc"] if not str(key).startswith("<"))
        raise typer.BadParameter(
            f"{where or 'region'}: {first['msg']}; write it as {EXAMPLE}", param_hint="--in"
        ) from None
    return found.area()


# ---- Command `post fields`: coarse-grained fields over the plane, along a line, or about a center

_FIELDS = (
    "Field of the figure, and of the table of a line or of rings; several times for several. The "
    "table of a grid lists what there is."
)
FieldNames = Annotated[
    list[str] | None,
    option(
        "--of FIELD",
        _FIELDS,
        "solid-fraction; velocities of a line or of rings",
        autocompletion=options.fields,
    ),
]
Spacing = Annotated[float, option("--spacing D", "Distance of the points in mean diameters.")]
Reach = Annotated[float, option("--reach D", "How far the kernel reaches, in mean diameters.")]
_CENTER = "Polar coordinates about this point (in m)."
CenterPoint = Annotated[str | None, option("--center X,Y", _CENTER, False)]
_ALONG = "Fields on the line between these points (in m)."
Along = Annotated[str | None, option("--line X0,Y0:X1,Y1", _ALONG, False)]
Radial = Annotated[bool, option("--radial", "Average over rings about --center.")]


def fields(
    directory: RunPath,
    of: FieldNames = None,
    center: CenterPoint = None,
    is_radial: Radial = False,
    along: Along = None,
    spacing: Spacing = 0.5,
    reach: Reach = 2.0,
    *,
    selection: Chosen,
) -> Shown:
    """Average fields over frames with a smooth kernel: solid fraction, velocity, strain rate,
    stress, temperature, heat flux, fluctuations, inertial number, friction, fluidity.

    On a grid over the grains, on a polar grid (--center), on a line (--line), or over rings
    (--center with --radial). CSV and JSON have every field at every point with its standard error,
    the table of a grid the median of these over the values.
    """
    if is_radial and center is None:
        raise typer.BadParameter("--radial needs --center", param_hint="--radial")
    if along is not None and center is not None:
        raise typer.BadParameter("--line and --center exclude each other")
    middle = None if center is None else parse_point(center, "--center")
    ends = None if along is None else parse_line(along, "--line")
    from multicor_cli import post

    with store.open_run(directory) as run:
        table = post.fields(
            run, of or (), selection, spacing=spacing, reach=reach, center=middle, along=ends,
            is_radial=is_radial
        )  # fmt: skip
    about = span_of_frames(table)
    return Shown(table, f"{about}; {table.note}" if table.note else about)


def parse_point(text: str, option: str) -> tuple[float, float]:
    """A point ``X,Y`` [m]; refuses a text that is none."""
    try:
        x, y = (float(part) for part in text.split(","))
        if not math.isfinite(x + y):
            raise ValueError
    except ValueError:
        raise typer.BadParameter(
            f"'{text}' is not a point; write X,Y in meters, as 0.02,0.01", param_hint=option
        ) from None
    return x, y


def parse_line(text: str, option: str) -> tuple[tuple[float, float], tuple[float, float]]:
    """A line ``X0,Y0:X1,Y1`` [m]; refuses a text that is none."""
    first, _, last = text.partition(":")
    if not last:
        raise typer.BadParameter(
            f"'{text}' is not a line; write X0,Y0:X1,Y1 in meters", param_hint=option
        )
    return parse_point(first, option), parse_point(last, option)


# ---- Commands `post energy`, `post compare`: whole runs

Earliest = Annotated[float | None, option("--from T", "Earliest time (in s).", "the start")]
OtherPath = Annotated[
    Path, typer.Argument(metavar="OTHER", help="Run to compare it with.", show_default=False)
]
_COMPARED = "Field whose profiles are compared, see `post profile`; may be given several times."
ComparedFields = Annotated[
    list[str] | None, option("--of FIELD", _COMPARED, "velocity", autocompletion=listed("profiled"))
]


def energy(directory: RunPath, start: Earliest = None, end: End = None) -> Shown:
    """Show the energy books, mechanical and of heat: at the end as a table; over time as CSV, JSON
    and figure.

    They count from the start of the run. The closure is the largest imbalance so far over the sum
    of all terms.
    """
    from multicor_cli import post

    with store.open_run(directory) as run:
        table = post.energy(run, start, end)
    about = f"energy books from the start of the run to t = {table.time[-1]:g} s"
    return Shown(table, about)


def compare(
    directory: RunPath,
    other: OtherPath,
    of: ComparedFields = None,
    *,
    selection: Chosen,
    bins: Bins = None,
) -> Shown:
    """Compare two runs: scenario keys that differ, books, rheology if both are sheared between two
    walls, profiles of fields.

    Differences are given over their standard errors where these are known: beyond 2 or 3 they are
    not chance. Profiles have the same number of bins in both runs and are matched by y/H; CSV and
    figure show them.
    """
    from multicor_cli import post

    with store.open_run(directory) as first, store.open_run(other) as second:
        table = post.compare(
            first, second, of or ["velocity"], selection, bins, names=_names(directory, other)
        )
    differ = "differs" if len(table.keys) == 1 else "differ"
    keys = count_noun(len(table.keys), "key")
    remarks = [f"{keys} of the scenarios {differ}{':' if table.keys else ''}"]
    remarks += [f"  {key}: {one} | {two}" for key, one, two in table.keys]
    about = f"{directory} and {other}"
    return Shown(table, about, is_of_one_run=False, remarks=remarks)


def _names(first: Path, second: Path) -> tuple[str, str]:
    """Names of two directories, with as much of the paths above them as tells them apart."""
    one, two = first.absolute().parts, second.absolute().parts
    for count in range(1, max(len(one), len(two))):
        names = "/".join(one[-count:]), "/".join(two[-count:])
        if names[0] != names[1]:
            return names
    return str(first), str(second)


# ---- Commands `post series` and `post flow`: columns over time, and what flows through a line

_COLUMNS = (
    "A column, as kinetic or 'top: force_x'; force_x alone means that of all walls. Several times "
    "for several."
)
ColumnNames = Annotated[
    list[str] | None,
    option(
        "--of COLUMN",
        _COLUMNS,
        "all; in a figure kinetic energy, forces on walls and number of contacts",
        autocompletion=options.columns,
    ),
]
_LINE = "The line (in m); what crosses to its left is positive."
Line = Annotated[str, option("--line X0,Y0:X1,Y1", _LINE)]


def series(
    directory: RunPath, of: ColumnNames = None, start: SeriesStart = None, end: End = None
) -> Shown:
    """Show columns of the time series: means, errors and drifts as a table; over time as CSV, JSON
    and figure.
    """
    from multicor_cli import post

    with store.open_run(directory) as run:
        table = post.series(run, of or (), start, end)
    about = span_of(table.time.size, "row", table.time)
    return Shown(table, about, figure=None if of else table.overview())


def flow(directory: RunPath, line: Line, *, selection: Chosen) -> Shown:
    """Measure the flow through a line: grains, mass and area per time, from the grains that cross
    it from frame to frame.
    """
    ends = parse_line(line, "--line")
    from multicor_cli import post

    with store.open_run(directory) as run:
        table = post.flow_through(run, ends, selection)
    about = span_of(
        table.time.size, "interval", (table.time[0] - table.duration[0], table.time[-1])
    )
    return Shown(table, f"{about}; {table.note}" if table.note else about)


# ---- Command `post animate`: a film of a map

FilmFile = Annotated[Path, output_option(metavar="FILE", help="File to write: FILE.mp4 or .gif.")]
Rate = Annotated[float, option("--fps N", "Pictures per second.", min=0.1, max=120.0)]
Overwrite = Annotated[bool, option("--overwrite", "Replace the file if it exists.")]


def animate(
    directory: RunPath,
    output: FilmFile,
    of: MapOf = "velocity",
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
    from multicor_cli import post

    with store.open_run(directory) as run, show_progress("frame") as progress:
        chosen = (
            post.Selection(frames=parse_frames(frames) or slice(None)).indices(run.frames).tolist()
        )
        film = write_film(
            lambda: _maps(run, of, chosen), len(chosen), output, rate=rate, progress=progress
        )
    skipped = f", without {film.skipped} that lack this quantity" if film.skipped else ""
    say(f"wrote {film.path}: {film.frames} frames{skipped}")


def _maps(run: Run, of: str, chosen: list[int]) -> Iterator[GrainMap | None]:
    """Maps of frames, None without the quantity; `PostError` if all lack it or have no grain."""
    from multicor_cli import post

    has_grains, trouble = False, None
    for frame in chosen:
        try:
            table = post.grain_map(run, of, frame, may_be_empty=True)
        except post.PostError as error:
            trouble = error
            yield None
            continue
        has_grains |= bool(table.value.size)
        yield table
    if not has_grains:
        raise trouble or post.PostError("no grain is there in any of the frames")


# ---- All of them

group = typer.Typer(no_args_is_help=True, help="Tables and figures from a run.")

_TABLES: dict[str, Callable[..., Shown]] = {
    "profile": profile, "theta-eta": theta_eta, "map": map_grains, "forces": forces,
    "rheology": rheology, "fabric": fabric, "lifetimes": lifetimes, "chains": chains,
    "clusters": clusters, "conductivity": conductivity, "heat-network": heat_network,
    "wall-heat": wall_heat, "hot-spots": hot_spots, "diffusion": diffusion, "structure": structure,
    "correlation": correlation, "mixing": mixing, "residence": residence, "avalanches": avalanches,
    "region": region, "fields": fields, "energy": energy, "compare": compare, "series": series,
    "flow": flow,
}  # fmt: skip

COMMANDS = {**{name: shows_table(command) for name, command in _TABLES.items()}, "animate": animate}
"""Commands by name."""
