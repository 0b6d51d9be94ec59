"""Commands ``post …``: tables and figures from a run."""

from __future__ import annotations

from typing import Annotated, Any, Optional

import typer

from multicor_cli.cli.options import RunPath
from multicor_cli.cli.post_options import (
    AsCsv,
    AsJson,
    Bins,
    End,
    FigureFile,
    Frames,
    OneFrame,
    Start,
    check_output,
    deliver,
    draw,
    parse_frames,
)

post = typer.Typer(no_args_is_help=True, help="Tables and figures from a run.")

ProfileOf = Annotated[
    str,
    typer.Option(
        "--of",
        metavar="FIELD",
        help="What to average: velocity, spin, temperature, heat, solid-fraction, granular-temperature.",
    ),
]
MapOf = Annotated[str, typer.Option("--of", metavar="FIELD", help="What to show: temperature, velocity, fluctuation, heat, spin.")]
Normalized = Annotated[
    bool,
    typer.Option(
        "--normalised",
        "--normalized",
        help="y/H, and velocity or temperature from 0 at the lower to 1 at the upper wall; spin over the shear rate of the walls.",
    ),
]
WallName = Annotated[
    Optional[str],  # noqa: UP045  (evaluated by typer)
    typer.Option("--wall", metavar="NAME", help="Wall from which η counts.", show_default="the only one with a temperature"),
]
Height = Annotated[
    Optional[float],  # noqa: UP045
    typer.Option("--height", metavar="H", help="Height H of the bed [m].", show_default="how far the grains reach"),
]
Reference = Annotated[
    Optional[float],  # noqa: UP045
    typer.Option("--reference", metavar="T0", help="Temperature T₀ [K].", show_default="mean of the first frame"),
]
Grains = Annotated[bool, typer.Option("--grains", help="The single grains too in JSON, and instead of the bins in CSV.")]


def profile(
    directory: RunPath,
    of: ProfileOf = "velocity",
    is_normalized: Normalized = False,
    start: Start = None,
    end: End = None,
    frames: Frames = None,
    bins: Bins = None,
    is_json: AsJson = False,
    is_csv: AsCsv = False,
    plot: FigureFile = None,
) -> None:
    """Average a field over horizontal bins and over frames, with standard errors from block averages.

    Grains count in a bin with the area that lies in it. Heights are measured from the lower wall. "heat" is what friction and
    impacts generate in the grains per time and area of the plane, from the differences of consecutive frames.
    """
    check_output(is_json, is_csv, plot)
    from multicor_cli.post import Selection
    from multicor_cli.post import profile as make_profile
    from multicor_cli.store import open_run

    selection = Selection(start, end, parse_frames(frames, start, end))
    with open_run(directory) as run:
        table = make_profile(run, of, selection, bins)
    if is_normalized:
        table = table.normalized()
    if plot is not None:
        from multicor_cli.plots import plot_profile

        draw(plot, lambda path: plot_profile(table, path))
    deliver(
        table,
        lambda: {"run": str(directory), **table.as_dict()},
        is_json=is_json,
        is_csv=is_csv,
        about=f"{table.frames.size} frames from t = {table.times[0]:g} s to {table.times[1]:g} s, height {table.height:g} m",
    )


def theta_eta(
    directory: RunPath,
    frame: OneFrame = -1,
    bins: Bins = None,
    wall: WallName = None,
    height: Height = None,
    reference: Reference = None,
    has_grains: Grains = False,
    is_json: AsJson = False,
    is_csv: AsCsv = False,
    plot: FigureFile = None,
) -> None:
    """Temperature θ = (T − T₀)/(T_wall − T₀) against the distance η = y/H from a heated wall, and its spread.

    y is measured from the surface of the wall, where the nearest grain touches it.
    """
    check_output(is_json, is_csv, plot)
    if has_grains and not (is_json or is_csv):
        raise typer.BadParameter("--grains needs --json or --csv", param_hint="--grains")
    from multicor_cli.post import theta_eta as make_table
    from multicor_cli.store import open_run

    with open_run(directory) as run:
        table = make_table(run, frame, bins=bins, wall=wall, height=height, reference=reference)
    if plot is not None:
        from multicor_cli.plots import plot_theta_eta

        draw(plot, lambda path: plot_theta_eta(table, path))
    deliver(
        table,
        lambda: {"run": str(directory), **table.as_dict(has_grains=has_grains)},
        is_json=is_json,
        is_csv=is_csv,
        about=f"frame {table.frame} at t = {table.time:g} s, wall '{table.wall}' at {table.wall_temperature:g} K, "
        f"T0 = {table.reference:g} K, H = {table.height:g} m",
        details=(table.detail_headings, table.detail_rows) if has_grains else None,
    )


def map_grains(
    directory: RunPath,
    of: MapOf = "temperature",
    frame: OneFrame = -1,
    is_json: AsJson = False,
    is_csv: AsCsv = False,
    plot: FigureFile = None,
) -> None:
    """Show a quantity of every grain of one frame: a table of its distribution, the grains as data, a map as figure.

    "fluctuation" is the velocity relative to the mean horizontal flow at the height of the grain; "heat" is what friction and
    impacts have generated since the frame before.
    """
    check_output(is_json, is_csv, plot)
    from multicor_cli.post import grain_map
    from multicor_cli.store import open_run

    with open_run(directory) as run:
        table = grain_map(run, of, frame)
    if plot is not None:
        from multicor_cli.plots import plot_map

        draw(plot, lambda path: plot_map(table, path))
    deliver(
        table,
        lambda: {"run": str(directory), **table.as_dict()},
        is_json=is_json,
        is_csv=is_csv,
        about=f"{table.field.label} in frame {table.frame} at t = {table.time:g} s",
        details=(table.detail_headings, table.detail_rows),
    )


def forces(
    directory: RunPath,
    frame: OneFrame = -1,
    is_json: AsJson = False,
    is_csv: AsCsv = False,
    plot: FigureFile = None,
) -> None:
    """Show the contact forces of one frame: their numbers as a table, the single contacts as CSV, the network as figure.

    Forces are means of the step before the frame.
    """
    check_output(is_json, is_csv, plot)
    from multicor_cli.post import force_network
    from multicor_cli.store import open_run

    with open_run(directory) as run:
        network = force_network(run, frame)
    if plot is not None:
        from multicor_cli.plots import plot_forces

        draw(plot, lambda path: plot_forces(network, path))
    deliver(
        network,
        lambda: {"run": str(directory), **network.as_dict()},
        is_json=is_json,
        is_csv=is_csv,
        about=f"contact forces in frame {network.frame} at t = {network.time:g} s",
        details=(network.detail_headings, network.detail_rows),
    )


def register(app: typer.Typer, wrap: Any) -> None:
    """Add the commands."""
    for name, command in {"profile": profile, "theta-eta": theta_eta, "map": map_grains, "forces": forces}.items():
        post.command(name)(wrap(command))
    app.add_typer(post, name="post")
