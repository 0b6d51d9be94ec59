"""Commands ``post forces``, ``post rheology``: what the contacts carry."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Optional

import typer

from multicor_cli.cli.options import RunPath
from multicor_cli.cli.post_options import (
    AsCsv,
    AsJson,
    Between,
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


COMMANDS = {"forces": forces, "rheology": rheology}
"""Commands by name."""
