"""Commands ``post diffusion`` to ``clusters``: where grains are, where they go, what they form."""

from __future__ import annotations

import math
from typing import Annotated, Any

import typer

from multicor_cli import store
from multicor_cli.cli import options
from multicor_cli.cli.options import RunPath, option
from multicor_cli.cli.post_output import (
    Between,
    Bins,
    Chosen,
    ChosenOfAll,
    End,
    Margin,
    SeriesStart,
    Shown,
    span_of_frames,
)
from multicor_cli.text import count_noun, unit_sign, with_error

# ---- Command `post diffusion`: how far grains stray from the mean flow


def diffusion(
    directory: RunPath, *, selection: Chosen, margin: Margin = None, between: Between = None
) -> Shown:
    """Mean square displacements beside the mean flow against the time lag, in a cell or in the bulk
    of a layer, and the self-diffusion.

    D is half of what a mean square grows by, from lags on in which the flow is strained by 1.
    Errors are those over lags that begin at different frames.
    """
    from multicor_cli import post
    from multicor_cli.post.conductivity import FORGOTTEN

    with store.open_run(directory) as run:
        table = post.diffusion(run, selection, margin=margin, between=between)
    about = span_of_frames(table)
    sheared = table.shear_rate * table.diameter**2
    units = {"m²/s": 1.0, "γ̇d²": sheared} if sheared > 0.0 else {"m²/s": 1.0}
    for axis, value, error in zip("xy", table.diffusion, table.diffusion_error, strict=True):
        about += f"\nD_{axis}"
        for name, unit in units.items():
            known = f"{error / unit:.2g}" if error >= 0.0 else "–"
            about += f" = {value / unit:.4g} ± {known} {name}"
    strain = float(table.counted_from * table.strain[0])
    if table.shear_rate > 0.0 and strain < FORGOTTEN * (1.0 - 1e-9):
        about += (
            f"\ncounted from a strain of {strain:.2g}, not of {FORGOTTEN:g}, in which grains "
            "forget how they moved: choose more frames"
        )
    return Shown(table, about, is_detailed=False)


# ---- Command `post structure`: how the grains are arranged

_FACTOR = "Show the structure factor S(k) instead, which needs a cell; in the figure, beside g."
HasFactor = Annotated[bool, option("--factor", _FACTOR)]
_CELLS = "Show the radical cells instead: local solid fraction, neighbors, hexatic order."
OfCells = Annotated[bool, option("--voronoi", _CELLS)]
Farthest = Annotated[
    float | None,
    option("--reach D", "Largest distance in mean diameters.", "10, or what the region allows"),
]
_EVEN = "Number of bins of g, of shells of S, or of local solid fractions from 0 to 1."
EvenBins = Annotated[
    int | None,
    option("--bins", _EVEN, "20 per mean diameter; shells of 0.2/d; 50 of fractions", min=1),
]
_SIDES = "Leave out this many mean diameters at sides that are not periodic."
SideMargin = Annotated[float | None, option("--margin D", _SIDES, "1")]


def structure(
    context: typer.Context,
    directory: RunPath,
    has_factor: HasFactor = False,
    is_of_cells: OfCells = False,
    *,
    selection: Chosen,
    reach: Farthest = None,
    bins: EvenBins = None,
    margin: SideMargin = None,
) -> Shown:
    """Measure how the grains are arranged: the pair correlation function g(r), averaged over frames
    with standard errors; with --factor the structure factor S(k) of a cell, with --voronoi the
    radical cells of the grains.

    g is the number of pairs at the distance r over that of an ideal gas in the same region: a cell,
    or the rectangle of the centers of the grains. Edges of the region are accounted for, but the
    grains have to fill it evenly. S(k) is averaged over all waves that fit into the cell. The table
    of radical cells holds means over grains and frames, CSV the distribution of the local solid
    fraction, JSON and figure both.
    """
    if is_of_cells and (has_factor or reach is not None):
        raise typer.BadParameter(f"--voronoi excludes {'--factor' if has_factor else '--reach'}")
    if has_factor and margin is not None:
        raise typer.BadParameter("--factor excludes --margin: all grains of the cell count")
    from multicor_cli import post

    drawn = None
    with store.open_run(directory) as run:
        if is_of_cells:
            cells = post.voronoi(run, selection, bins, margin=margin)
            about = _counted(cells)
            if cells.open_share:
                about += f"; {100.0 * cells.open_share:.3g} % of all have open cells"
            return Shown(cells, about)
        if not has_factor:
            pairs = post.pair_correlation(run, selection, reach, bins, margin=margin)
            peak = f"largest g = {pairs.first_peak:.4g}"
            if math.isfinite(pairs.first_peak_error):
                peak += f" ± {pairs.first_peak_error:.2g}"
            peak += f" at r = {pairs.first_peak_distance:.4g} d"
            return Shown(pairs, _about_grains(pairs, peak), is_detailed=False)
        factor = post.structure_factor(run, selection, bins)
        if context.params["plot"] is not None:
            drawn = post.pair_correlation(run, selection, reach).with_(factor=factor)
    return Shown(factor, _about_grains(factor), is_detailed=False, figure=drawn)


def _about_grains(table: Any, more: str = "") -> str:
    return "\n".join(filter(None, (_counted(table), more, table.note)))


def _counted(table: Any) -> str:
    span = span_of_frames(table)
    return (
        f"{span}, {table.grain_count:.6g} grains of mean diameter d = {table.mean_diameter:.4g} m"
    )


# ---- Command `post correlation`: over which distances grains move together

_WIDE = "Number of bins of the distance."
WideBins = Annotated[int | None, option("--bins", _WIDE, "5 per mean diameter", min=1)]


def correlation(
    directory: RunPath,
    *,
    selection: Chosen,
    reach: Farthest = None,
    bins: WideBins = None,
    margin: SideMargin = None,
) -> Shown:
    """Measure over which distances grains move together: the correlation C(r) of their velocities
    beside the mean flow, of their components along x and across it, and of their spins.

    C is the mean product of two grains at the distance r over the mean square of all, averaged over
    frames with standard errors. The correlation length is where C falls below 1/e.
    """
    from multicor_cli import post

    with store.open_run(directory) as run:
        found = post.correlation(run, selection, reach, bins, margin=margin)
    lengths = [
        f"{with_error(getattr(found, name), getattr(found, f'error_{name}'))} d{of}"
        for name, of in zip(
            post.LENGTHS, ("", " along the flow", " across", " of spins"), strict=True
        )
        if math.isfinite(getattr(found, name))
    ]
    told = f"correlation length {', '.join(lengths)}" if lengths else "C stays above 1/e"
    about = f"velocities beside the mean flow {found.fluctuation:.4g} m/s; {told}"
    return Shown(found, _about_grains(found, about), is_detailed=False)


# ---- Commands `post mixing`, `post residence`, `post avalanches`: groups, stays, sudden drops

_IN_CELL = "Grains in a cell; the index depends on it."
CellGrains = Annotated[float | None, option("--cell N", _IN_CELL, "10")]
_MIXED = "Groups that count, in this order; several times for several."
MixedGroups = Annotated[list[str] | None, option("--group NAME", _MIXED, "all")]


_OVER_HEIGHT = (
    "Show profiles over the height against time instead: share of the first group, or mean size."
)
OverHeight = Annotated[str | None, option("--profile share|size", _OVER_HEIGHT)]
_TIMES = "Number of times of the profiles: frames are averaged in as many parts."
Times = Annotated[int | None, option("--times N", _TIMES, "one per four frames, at most 40", min=1)]


def mixing(
    directory: RunPath,
    cell: CellGrains = None,
    groups: MixedGroups = None,
    over_height: OverHeight = None,
    times: Times = None,
    bins: Bins = None,
    between: Between = None,
    *,
    selection: ChosenOfAll,
) -> Shown:
    """Measure over time how well groups of grains are mixed: Lacey's index, 0 where they are apart
    and 1 where chance places them; and how far their mean heights are apart. With --profile where
    they lie: the share of the first group, or the mean size, over the height and time.

    Cells hold equal numbers of grains. The separation is 1 with the first group on top, -1 below.
    """
    from multicor_cli import post

    if over_height is None:
        given = {"--times": times, "--bins": bins, "--between": between}
        for name, value in given.items():
            if value is not None:
                raise typer.BadParameter(f"{name} needs --profile", param_hint=name)
    elif cell is not None:
        raise typer.BadParameter("--cell excludes --profile", param_hint="--cell")
    with store.open_run(directory) as run:
        if over_height is not None:
            of: Any = over_height
            found = post.segregation(
                run, selection, of, groups=groups or (), bins=bins, between=between, times=times
            )
            told = f"{found.time.size} times, {found.y.size} bins of {found.bin_width:.4g} m"
            about = f"{span_of_frames(found)}, in {told}"
            return Shown(found, about)
        size = {} if cell is None else {"cell": cell}
        table = post.mixing(run, selection, groups=groups or (), **size)
    about = span_of_frames(table)
    about += f", {table.cells:.4g} cells of {table.cell_grains:.3g} grains; by chance M is 1 ± "
    return Shown(table, f"{about}{table.random_scatter:.2g} in a frame")


def residence(directory: RunPath, *, selection: ChosenOfAll) -> Shown:
    """Measure how long grains stay between where they are released and an outlet: means with
    errors and medians of all and of each group; the survival as JSON and figure, stays as CSV.

    Stays of grains that are still inside count as longer than that (Kaplan and Meier). Grains that
    are there in the first frame do not count. That needs scipy.
    """
    from multicor_cli import post

    with store.open_run(directory) as run:
        table = post.residence(run, selection)
    about = f"{span_of_frames(table)}; not counted: "
    about += f"{count_noun(table.first, 'grain')} of the first frame"
    if table.lost:
        about += f"; {count_noun(table.lost, 'stay')} ended beside the outlets"
    return Shown(table, about)


_COLUMN = "The column, as kinetic or 'top: force_x'."
OneColumn = Annotated[str, option("--of COLUMN", _COLUMN, False, autocompletion=options.columns)]
_DROP = "Smallest drop that counts, in the unit of the column."
Threshold = Annotated[float | None, option("--threshold X", _DROP, "its standard deviation")]


def avalanches(
    directory: RunPath,
    of: OneColumn,
    threshold: Threshold = None,
    start: SeriesStart = None,
    end: End = None,
) -> Shown:
    """Find sudden drops of a column of the time series, as of a force in stick and slip: numbers,
    sizes, durations and waiting times with errors; the single drops as CSV.

    A drop goes from a local maximum to the minimum that follows. An exponent of their sizes is
    given where they are compatible with a power law, else why not.
    """
    from multicor_cli import post

    with store.open_run(directory) as run:
        table = post.avalanches(run, of, start, end, threshold=threshold)
    about = f"{table.of} from t = {table.times[0]:g} s to {table.times[1]:g} s, drops of at least "
    about += f"{table.threshold:.4g} {unit_sign(table.unit)}"
    return Shown(table, "\n".join(filter(None, (about, table.note))))


# ---- Commands `post fabric`, `lifetimes`, `chains`, `clusters`: the texture of a packing


def fabric(
    directory: RunPath, *, selection: Chosen, margin: Margin = None, between: Between = None
) -> Shown:
    """Measure the fabric of the contacts between grains and of their strong and weak networks:
    means with errors; over time as CSV, JSON and figure.

    Anisotropies of contacts, forces and branch lengths are those along the major principal stress;
    half of their sum is about q/p. Strong contacts carry more than the mean normal force. In a
    layer between two walls contacts of the bulk count, elsewhere all. Of grains that are no discs
    also contacts by kind, with their share of the forces, and the order of long axes.
    """
    from multicor_cli import post

    with store.open_run(directory) as run:
        table = post.fabric(run, selection, margin=margin, between=between)
    about = _about_bulk(table)
    if "edge_edge" in table.values and "nematic_order" not in table.values:
        about += "; no grain has a long axis, so there is no nematic order"
    return Shown(table, about)


def _about_bulk(table: Any) -> str:
    about = span_of_frames(table)
    return f"{about}; the bulk begins {table.margin:g} m from each wall" if table.margin else about


def lifetimes(
    directory: RunPath, *, selection: Chosen, margin: Margin = None, between: Between = None
) -> Shown:
    """Measure how long contacts live: the share of them that are still there after a time lag, and
    mean lifetimes, of all, of strong and of sliding contacts.

    A contact that opens and closes again between two frames has lived on: take frames so close
    together that few end between two.
    """
    from multicor_cli import post

    with store.open_run(directory) as run:
        table = post.lifetimes(run, selection, margin=margin, between=between)
    about = _about_bulk(table)
    for kind, name in zip(("all", "strong", "sliding"), post.LIFETIMES, strict=True):
        value, error = getattr(table, name), getattr(table, f"{name}_error")
        about += f"\nmean lifetime, {kind} contacts: "
        if not math.isfinite(value):
            about += "– (none ends, or none lives from one frame to the next)"
            continue
        about += f"{with_error(value, error)} s"
        if table.shear_rate > 0.0:
            about += f", {value * table.shear_rate:.3g} in strain"
    return Shown(table, about, is_detailed=False)


_CHAIN_ANGLE = "Largest angle (in °) between a link and the major principal stress of its grains."
ChainAngle = Annotated[float, option("--angle A", _CHAIN_ANGLE)]
HasLengths = Annotated[bool, option("--lengths", "Show how long chains are instead.")]
_CHAIN_FRAME = (
    "Show the chains of this frame instead: their grains as CSV, the chains in the force network "
    "as figure; -1 is the last one."
)
ChainFrame = Annotated[int | None, option("--frame K", _CHAIN_FRAME, False)]


def chains(
    directory: RunPath,
    angle: ChainAngle = 45.0,
    has_lengths: HasLengths = False,
    frame: ChainFrame = None,
    *,
    selection: Chosen,
) -> Shown:
    """Find force chains: how many there are, how long, in which direction; means with errors; over
    time as CSV, JSON and figure.

    Chains are three or more grains whose major principal stress is above the mean, linked by
    contacts along it (Peters et al. 2005). That needs scipy.
    """
    from multicor_cli import post

    if has_lengths and frame is not None:
        raise typer.BadParameter("--lengths and --frame exclude each other")
    if frame is not None and selection != post.Selection():
        raise typer.BadParameter("--frame is about one frame: leave out --frames, --from and --to")
    with store.open_run(directory) as run:
        if frame is not None:
            shown = post.chain_map(run, frame, angle=angle)
            about = f"force chains in frame {shown.frame} at t = {shown.time:g} s"
            return Shown(shown, about)
        if has_lengths:
            lengths = post.chain_lengths(run, selection, angle=angle)
            about = span_of_frames(lengths)
            decay = with_error(lengths.decay_length, lengths.decay_length_error)
            about += f"; decay length of P: {decay} grains"
            return Shown(lengths, about, is_detailed=False)
        table = post.chains(run, selection, angle=angle)
    return Shown(table, span_of_frames(table))


def clusters(directory: RunPath, *, selection: Chosen) -> Shown:
    """Find clusters of sliding contacts, which have grains in common: how many, how large; means
    with errors; over time as CSV, JSON and figure.

    That needs scipy.
    """
    from multicor_cli import post

    with store.open_run(directory) as run:
        table = post.clusters(run, selection)
    return Shown(table, span_of_frames(table))
