"""Commands ``post forces`` to ``hot-spots``: what contacts carry, forces and heat."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any

import typer

from multicor_cli import store
from multicor_cli.cli.options import RunPath, option
from multicor_cli.cli.post_output import (
    Between,
    Chosen,
    Margin,
    OneFrame,
    Shown,
    parse_frames,
    span_of_frames,
)
from multicor_cli.text import with_error

if TYPE_CHECKING:
    from multicor_cli.post.source import Run, Selection


# ---- Commands `post forces`, `post rheology`: what the contacts carry

_DISTRIBUTION = "Show how many contacts carry which force instead."
Distribution = Annotated[bool, option("--distribution", _DISTRIBUTION)]
Angles = Annotated[bool, option("--angles", "Show contacts and forces by direction instead.")]
_MOBILIZATION = "Show how far contacts mobilize their friction instead."
HasMobilization = Annotated[bool, option("--mobilization", _MOBILIZATION)]
_MANY = "With --distribution, --angles or --mobilization: the frames to average over."
ManyFrames = Annotated[str | None, option("--frames A:B[:STEP]", _MANY, False)]
_UNIT = "Force (in N) of a line 0.15 mean diameters wide: the same for several pictures."
UnitForce = Annotated[float | None, option("--scale F", _UNIT, "the mean normal force")]


def forces(
    directory: RunPath,
    frame: OneFrame = -1,
    has_distribution: Distribution = False,
    has_angles: Angles = False,
    has_mobilization: HasMobilization = False,
    frames: ManyFrames = None,
    unit: UnitForce = None,
) -> Shown:
    """Show the contact forces of one frame: their numbers as a table, the single contacts as CSV,
    the network as figure.

    Forces are means of the step before the frame. With --distribution: the probability density of
    forces between grains over their mean. With --angles: the directions of contacts between grains,
    the mean forces along them, and their anisotropies. With --mobilization: tangential forces
    between grains over the largest that friction allows.
    """
    if has_distribution + has_angles + has_mobilization > 1:
        raise typer.BadParameter("--distribution, --angles and --mobilization exclude each other")
    is_network = not (has_distribution or has_angles or has_mobilization)
    if unit is not None and not (is_network and 0.0 < unit < math.inf):
        raise typer.BadParameter(
            "--scale is the positive force of a line in the figure of the network"
        )
    from multicor_cli import post

    if is_network:
        if frames is not None:
            raise typer.BadParameter(
                "--frames needs --distribution, --angles or --mobilization; choose one frame with "
                "--frame"
            )
        with store.open_run(directory) as run:
            network = post.force_network(run, frame)
        about = f"contact forces in frame {network.frame} at t = {network.time:g} s"
        return Shown(network, about, drawing={"unit": unit})
    wanted = parse_frames(frames)
    with store.open_run(directory) as run:
        index = post.frame_index(run.frames, frame)
        selection = post.Selection(frames=slice(index, index + 1) if wanted is None else wanted)
        measure: Any = post.force_distribution if has_distribution else post.angular_distribution
        table = (post.mobilization if has_mobilization else measure)(run, selection)
    span = span_of_frames(table)
    about = f"{table.contacts} contacts between grains in {span}"
    if has_mobilization:
        mean = with_error(table.mean, table.mean_error)
        slides = with_error(table.sliding, table.sliding_error)
        about += f"; mean mobilization {mean}, share of sliding contacts {slides}"
    if has_angles:
        moments = {name: f"{name} = {value:.4g}" for name, value in table.moments.items()}
        if table.frames.size > 1:
            for name, scatter in table.moments_scatter.items():
                moments[name] += f" (± {scatter:.2g} between frames)"
        about += "; " + ", ".join(moments.values())
    return Shown(table, about, is_detailed=False)


def rheology(
    directory: RunPath, *, selection: Chosen, margin: Margin = None, between: Between = None
) -> Shown:
    """Measure the rheology of a layer between two walls that shear it, or of a cell without walls:
    averages with errors; over time as CSV, JSON and figure.

    I = rate × √(m/P), with the mean mass m of a grain and the force P per length with which the
    walls press (in a cell the mean pressure); the other convention is rate × d/√(P/ρ), with the
    mass ρ of the grains per area they cover. Friction μ* is shear over normal stress. Rattlers are
    grains with fewer than two contacts that carry a force.
    """
    from multicor_cli import post

    with store.open_run(directory) as run:
        table = post.rheology(run, selection, margin=margin, between=between)
    about = span_of_frames(table)
    if isinstance(table, post.CellRheology):
        about += f", in a cell of {table.width:.4g} × {table.height:.4g} m on average"
    else:
        about += f", between '{table.walls[0]}' and '{table.walls[1]}', {table.height:g} m apart; "
        about += f"the bulk begins {table.margin:g} m from each"
    return Shown(table, about)


# ---- Command `post conductivity`: how a cell, or a layer between two walls, conducts

_NETWORK = "Solve the contacts of the frames, although the run says what has flowed."
OfNetwork = Annotated[bool, option("--network", _NETWORK)]


def conductivity(
    directory: RunPath,
    is_of_network: OfNetwork = False,
    *,
    selection: Chosen,
    margin: Margin = None,
    between: Between = None,
) -> Shown:
    """Measure how a cell, or a layer between two walls, conducts heat: means with errors; over time
    as CSV, JSON and figure.

    In a cell with heat.gradient, or between walls of different temperature (below and above, or on
    the left and on the right), that is what has flowed between frames, with the shares of contacts,
    gas, radiation and motion; a packing must be steady for it to be a conductivity. With --network,
    and in a cell without gradient, steady temperatures are found at once, in the contacts of each
    frame as they are: gas and radiation do not count then. That needs scipy. K is the conductance
    of a square, k is K over the thickness of discs.
    """
    from multicor_cli import post

    with store.open_run(directory) as run:
        if run.model.is_cell:
            if margin is not None or between is not None:
                raise post.PostError("a cell has no walls: leave out --margin and --between")
            return _of_cell(run, selection, is_of_network=is_of_network)
        if not is_of_network:
            if margin is not None:
                raise typer.BadParameter("--margin needs --network", param_hint="--margin")
            through = post.layer_flow(run, selection, between=between)
            about = span_of_frames(through)
            return Shown(through, f"{about}, {_about_layer(through)}")
        layer = post.layer_conductivity(run, selection, between=between, margin=margin)
    about = f"{span_of_frames(layer)}, {_about_layer(layer)}; "
    about += f"the bulk begins {layer.margin:.4g} m from each wall"
    return Shown(layer, about + _not_counted(layer))


def _of_cell(run: Run, selection: Selection, *, is_of_network: bool) -> Shown:
    from multicor_cli import post

    if any(run.model.heat_gradient) and not is_of_network:
        flux = post.mean_heat(run, selection)
        along = ", ".join(f"{value:g}" for value in flux.gradient)
        about = span_of_frames(flux)
        return Shown(flux, f"{about}, under a gradient of ({along}) K/m")
    table = post.conductivity(run, selection)
    about = span_of_frames(table)
    about += f", in a cell of {table.width:.4g} × {table.height:.4g} m on average"
    return Shown(table, about + _not_counted(table))


def _about_layer(table: Any) -> str:
    names = " and ".join(f"'{name}'" for name in table.walls)
    return f"between {names}, {table.height:.4g} m apart, {table.width:.4g} m wide"


# ---- Command `post heat-network`: where heat flows


def heat_network(directory: RunPath, frame: OneFrame = -1) -> Shown:
    """Show the heat that the contacts of one frame conduct: their numbers as a table, the single
    contacts as CSV, the network as figure.

    The flow of a contact is its conductance times the difference of temperatures; gas in the gaps,
    radiation, and what grains carry with them do not count. `post fields` and `post map` show the
    same as a heat flux.
    """
    from multicor_cli import post

    with store.open_run(directory) as run:
        table = post.heat_network(run, frame)
    about = f"heat flow through contacts in frame {table.frame} at t = {table.time:g} s"
    return Shown(table, about + _not_counted(table))


def _not_counted(table: Any) -> str:
    return f"; not counted: {table.left_out}" if table.left_out else ""


# ---- Command `post wall-heat`: between walls and a bed

_WALLS_ASKED = "Wall to look at; several times for several."
WallNames = Annotated[
    list[str] | None, option("--wall NAME", _WALLS_ASKED, "all with a temperature")
]
_NEAR = "Take grains within so many mean diameters of the wall for the bed, not all."
NearWall = Annotated[float | None, option("--near D", _NEAR, "all grains")]
_WETTED = "Wetted length of a wall (in m)."
WettedLength = Annotated[
    float | None, option("--length L", _WETTED, "the diameters of the grains that touch it")
]
_GAS = "Make the Nusselt number with the conductivity of the gas instead of the solid."
OfGas = Annotated[bool, option("--gas", _GAS)]


def wall_heat(
    directory: RunPath,
    walls: WallNames = None,
    near: NearWall = None,
    length: WettedLength = None,
    is_of_gas: OfGas = False,
    *,
    selection: Chosen,
) -> Shown:
    """Measure the heat transfer between walls and the bed: coefficient h and Nusselt number, means
    with errors; over time as CSV, JSON and figure.

    h is the heat flow from the wall into the grains over wetted area and difference of
    temperatures, T_bed is weighted by heat capacity. The area is wetted length times thickness of
    the discs; a layer of spheres is one mean diameter thick.
    """
    from multicor_cli import post

    with store.open_run(directory) as run:
        table = post.wall_heat(
            run, selection, walls or (), near=near, length=length,
            over="gas" if is_of_gas else "solid",
        )  # fmt: skip
    about = f"{span_of_frames(table)}, {table.thickness:.4g} m thick"
    k = f"k = {table.conductivity:g} W/(m K) of the {table.over}"
    if not math.isfinite(table.conductivity):
        k = f"no Nusselt number: the {table.over} has no conductivity, or several"
    dry = [wall for wall in table.walls if table.mean[f"{wall}: wetted"] == 0.0]
    remarks = []
    if dry:
        remarks.append(f"no grain touches {', '.join(dry)}: for h give the length with --length")
    if table.left_out:
        left_out = ", ".join(table.left_out)
        remarks.append(f"left out, without a temperature in some of these frames: {left_out}")
    return Shown(table, "\n".join((f"{about}; {k}", *remarks)))


# ---- Command `post hot-spots`: the spots of sliding contacts

_LIMIT = "Count the spots that are hotter (in K)."
Limit = Annotated[float | None, option("--limit T", _LIMIT, "the lowest ignition or melting")]


def hot_spots(directory: RunPath, limit: Limit = None, *, selection: Chosen) -> Shown:
    """Measure how hot the spots of sliding contacts are: quantiles with errors; over time as CSV,
    both and the distributions as JSON, the distributions as figure.

    A spot is hotter than the mean of its two bodies by the flash of friction, in its hottest point:
    that of a circular source of heat on two half-spaces (Tian & Kennedy 1994), with the spot of
    smooth elastic spheres, or as large as the area on which a side is pressed.
    """
    from multicor_cli import post

    with store.open_run(directory) as run:
        table = post.hot_spots(run, selection, limit)
    about = f"{table.contacts} sliding contacts in {span_of_frames(table)}"
    about += f", limit {table.limit:g} K" if math.isfinite(table.limit) else ""
    if table.sharp:
        about += f"; {table.sharp} more slide on sharp corners, which have no radius"
    return Shown(table, about)
