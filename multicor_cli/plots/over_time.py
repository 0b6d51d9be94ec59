"""Figures over time: books, columns of the time series, flow, rheology, conductivity, a region."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from multicor_cli.plots.style import (
    COLORS,
    COLUMN,
    PAGE,
    PlotError,
    Renderer,
    Terminal,
    TextLine,
    count_small_rises,
    draw_text,
    legend_above,
    show_decades,
)
from multicor_cli.post.conductivity import Conductivity
from multicor_cli.post.crossings import FlowTable
from multicor_cli.post.energy import HEAT, MECHANICAL, BookLine, EnergyTable, SeriesTable
from multicor_cli.post.layer_conductivity import LayerConductivity, LayerFlow
from multicor_cli.post.mean_heat import WAYS, MeanHeat
from multicor_cli.post.region import RegionTable
from multicor_cli.post.rheology import CellRheology, Rheology
from multicor_cli.post.table import TimeTable
from multicor_cli.post.wall_heat import WallHeatTable
from multicor_cli.text import unit_sign, with_error

_ZERO = 1e-30  # what rounding leaves of velocities that are all the same, squared
_LOW = 8  # rows of a chart of letters, of which several are shown

# ---- The energy books: what came in and where it went, stacked, and how well the books close

# Lines that stay below this part of the largest one are left out of charts of letters
_VISIBLE = 0.02
_GAIN = BookLine("kinetic_gain", "kinetic energy", sign=-1)
_STORED = BookLine("heat_stored", "stored in the grains", sign=-1)
_SHORT = {
    "gravity_work": "gravity", "wall_work": "walls", "load_work": "loads",
    "adhesion_work": "adhesion", "expansion_work": "expansion", "worn_energy": "worn off",
    "friction_loss": "friction", "impact_loss": "impacts",
    "damping_loss": "damping", "correction_work": "projection", "kinetic_gain": "kinetic",
    "heat_friction": "friction",
    "heat_impact": "impacts", "heat_from_walls": "from walls", "heat_from_ambient": "from fluid",
    "heat_from_surroundings": "surroundings", "heat_along_gradient": "gradient",
    "heat_to_walls": "into walls",
    "heat_stored": "stored", "heat_ahead": "ahead",
    "kinetic_in": "grains in", "kinetic_out": "grains out", "heat_out": "grains out",
}  # fmt: skip
COLOR_OF = {
    "gravity_work": "0.5", "wall_work": COLORS[2], "load_work": COLORS[0],
    "adhesion_work": "#aa4499", "expansion_work": "#661100", "worn_energy": "#ddcc77",
    "friction_loss": COLORS[1], "impact_loss": COLORS[5],
    "damping_loss": COLORS[3], "correction_work": "#f0e442", "kinetic_gain": COLORS[4],
    "heat_friction": COLORS[1],
    "heat_impact": COLORS[5], "heat_from_walls": COLORS[2], "heat_from_ambient": "#332288",
    "heat_from_surroundings": "#882255", "heat_along_gradient": "#cc6677", "heat_to_walls": "0.5",
    "heat_stored": COLORS[4],
    "heat_ahead": "#44aa99",
    "kinetic_in": "#117733", "kinetic_out": "#999933", "heat_out": "#999933",
}  # fmt: skip
"""One color for one thing: friction, impacts, walls, as work or heat; what is kept, as either."""


def draw_energy(figure: Any, table: EnergyTable) -> None:
    """Draw the books into a figure: mechanics, beside it heat if any, the closures below."""
    books = [("energy", MECHANICAL, _GAIN, table.closure)]
    if table.heat_closure is not None:
        books.append(("heat", HEAT, _STORED, table.heat_closure))
    grid = figure.subplots(2, len(books), sharex=True, squeeze=False, height_ratios=(3.0, 1.0))
    for (above, below), (name, entries, kept, closure) in zip(grid.T, books, strict=True):
        flows = [entry for entry in entries if entry.sign and entry.name in table.books]
        _draw_stack(above, table, [*flows, kept])
        above.set_ylabel(f"{name} since the start [J]")
        known = closure > 0.0
        below.semilogy(table.time[known], closure[known], color=COLORS[0])
        below.set_xlabel("time $t$ [s]")
        below.set_ylabel("closure [–]")
        show_decades(below.yaxis, closure[known])


def _draw_stack(panel: Any, table: EnergyTable, entries: Sequence[BookLine]) -> None:
    """What came in upwards, what went out downwards; entries that never matter are left out."""
    values = {e: table.books[e.name] * (1.0 if e.sign > 0 else -1.0) for e in entries}
    largest = max(float(np.abs(v).max()) for v in values.values())
    shown = [e for e in entries if float(np.abs(values[e]).max()) > 1e-3 * largest]
    up, down = np.zeros_like(table.time), np.zeros_like(table.time)
    for entry in shown:
        high, low = up + np.maximum(values[entry], 0.0), down + np.minimum(values[entry], 0.0)
        style = {"color": COLOR_OF[entry.name], "linewidth": 0.0}
        panel.fill_between(table.time, up, high, label=_SHORT[entry.name], **style)
        panel.fill_between(table.time, low, down, **style)
        up, down = high, low
    panel.axhline(0.0, color="0.2", linewidth=0.6)
    panel.ticklabel_format(axis="y", scilimits=(-3, 4), useMathText=True)
    panel.margins(x=0.0)
    if shown:
        place: dict[str, Any] = {"loc": "lower center", "bbox_to_anchor": (0.5, 1.03)}
        panel.legend(ncols=3, columnspacing=1.0, handlelength=1.0, **place)


def energy_text(table: EnergyTable, _terminal: Terminal) -> str:
    """The energy books over time, mechanical ones and those of heat in one chart."""
    lines = [TextLine(f"{e.label} [J]", table.time, table.books[e.name]) for e in table.entries]
    largest = max((float(np.abs(line.y).max()) for line in lines), default=0.0)
    shown = [line for line in lines if np.abs(line.y).max() > _VISIBLE * largest]
    return draw_text(shown, "time [s]", "energy [J]")


# ---- Figure of columns of the time series: a panel for each unit


def _units(table: SeriesTable) -> list[str]:
    counts = Counter(column.unit for column in table.quantities)
    for unit, count in counts.items():
        if count > len(COLORS):
            lines = f"{count} lines {'without unit' if unit == '1' else f'in {unit}'}"
            raise PlotError(
                f"{lines} cannot be told apart in one panel: choose columns, as --of kinetic or "
                "--of force_x"
            )
    return list(counts)


def draw_series(figure: Any, table: SeriesTable) -> None:
    """Draw the panels into a matplotlib figure."""
    units = _units(table)
    panels = figure.subplots(len(units), 1, sharex=True, squeeze=False)[:, 0]
    for panel, unit in zip(panels, units, strict=True):
        shown = [column for column in table.quantities if column.unit == unit]
        for color, column in zip(COLORS, shown, strict=False):
            style = {"linewidth": 0.9, "marker": "o" if table.time.size == 1 else ""}
            label = column.name.replace("_", " ")
            panel.plot(table.time, column.values, color=color, label=label, **style)
        names = {column.name.rpartition(": ")[2].replace("_", " ") for column in shown}
        words = zip(*(name.split() for name in names), strict=False)
        common = " ".join(word for word, *others in words if set(others) <= {word})
        panel.set_ylabel(f"{common} [{unit_sign(unit)}]".strip())
        panel.ticklabel_format(axis="y", scilimits=(-3, 4), useMathText=True)
        if len(shown) > 1:
            legend_above(panel, 2)
    panels[-1].set_xlabel("time $t$ [s]")
    figure.align_ylabels()


def series_text(table: SeriesTable, _terminal: Terminal) -> str:
    """The columns as charts of letters, one below the other."""
    return draw_charts(
        (f"{column.name} [{unit_sign(column.unit)}]", [TextLine("", table.time, column.values)])
        for column in table.quantities
    )


def draw_charts(charts: Iterable[tuple[str, list[TextLine]]]) -> str:
    """Low charts of letters over time below each other: labels, and the lines in each."""
    drawn = [draw_text(lines, "time [s]", label, rows=_LOW) for label, lines in charts]
    return "\n\n".join(drawn)


def _charts_of(table: TimeTable, charts: Iterable[tuple[str, Iterable[tuple[str, str]]]]) -> str:
    """As `draw_charts`, of values of a table: their names, and what the lines are called."""
    return draw_charts(
        (label, [TextLine(text, table.time, table.values[name]) for name, text in lines])
        for label, lines in charts
    )


def _by_end(names: Sequence[str]) -> list[tuple[str, str]]:
    """Values called by the ends of their names, xx or yy, if there are several."""
    return [(name, name[-2:] if names[1:] else "") for name in names]


# ---- What has flowed through a line, summed over time


def draw_flow(figure: Any, table: FlowTable) -> None:
    """Draw the mass that has crossed, and the line of the mean rate, into a matplotlib figure."""
    axes = figure.add_subplot()
    start = table.time[0] - table.duration[0]
    time, mass = np.append(start, table.time), np.append(0.0, np.cumsum(table.crossed["mass"]))
    axes.plot(time, mass, color=COLORS[0], label="crossed")
    mean, error = table.mean["mass"], float(table.spread["mass"].error)
    rate = with_error(mean, error)
    if "±" in rate and not rate.startswith("("):
        rate = f"({rate})"
    text = f"mean, {rate} kg/s"
    axes.plot(time, mean * (time - start), color="0.3", linewidth=0.8, linestyle="--", label=text)
    axes.set_xlabel("time $t$ [s]")
    axes.set_ylabel("mass through the line [kg]")
    axes.ticklabel_format(axis="y", scilimits=(-3, 4), useMathText=True)
    figure.legend(loc="outside upper center", ncols=2)


def flow_text(table: FlowTable, _terminal: Terminal) -> str:
    """The mass that has crossed as a chart of letters."""
    line = TextLine("", table.time, np.cumsum(table.crossed["mass"]))
    return draw_text([line], "time [s]", "mass through the line [kg]")


# ---- Rheology over time, with averages and their errors as bands

Panels = Sequence[tuple[str, Sequence[tuple[str, str]]]]
"""Label of the axis, and the quantities of each panel with their names."""

_CONTACTS = "coordination number [–]"
_OF_RHEOLOGY: Panels = (
    ("inertial number $I$ [–]", (("inertial_number", ""),)),
    ("pressure [N/m]", (("pressure", "walls, $P$"), ("bulk_stress_yy", r"bulk, $\sigma_{yy}$"))),
    (r"friction $\mu^*$ [–]", (("friction_walls", "walls"), ("friction_bulk", "bulk"))),
    (r"solid fraction $\nu$ [–]", (("solid_fraction", ""),)),
    (_CONTACTS, (("coordination", "$Z$, all"), ("coordination_loaded", "Z′, no rattlers"))),
    ("anisotropy $a_c$ [–]", (("fabric_anisotropy", ""),)),
    (r"spin $\langle\omega\rangle/\dot\gamma$ [–]", (("spin_ratio", ""),)),
    (r"granular temp. $T_g$ [m²/s²]", (("granular_temperature", ""),)),
)
_OF_CELL: Panels = (
    (r"shear rate $\dot\gamma$ [1/s]", (("shear_rate", ""),)),
    ("inertial number $I$ [–]", (("inertial_number", ""),)),
    ("stress [N/m]", tuple((f"stress_{k}", rf"$\sigma_{{{k}}}$") for k in ("xx", "yy", "xy"))),
    (r"friction $\mu$ [–]", (("friction", ""),)),
    (r"$(\sigma_{xx} - \sigma_{yy})/P$ [–]", (("normal_difference", ""),)),
    (r"solid fraction $\nu$ [–]", (("solid_fraction", ""),)),
    (_CONTACTS, (("coordination", "$Z$, all"), ("coordination_loaded", "Z′, no rattlers"))),
    ("anisotropy $a_c$ [–]", (("fabric_anisotropy", ""),)),
    (r"spin $-2\langle\omega\rangle/\dot\gamma$ [–]", (("spin_over_flow", ""),)),
    (r"granular temp. $T_g$ [m²/s²]", (("granular_temperature", ""),)),
)
_KNOWN: Any = "--"  # line of a mean with a standard error
_UNKNOWN: Any = ":"  # line of one without
_CHARTS_OF_RHEOLOGY = (
    ("inertial number I [–]", (("inertial_number", ""),)),
    ("friction mu* [–]", (("friction_walls", "walls"), ("friction_bulk", "bulk"))),
    ("solid fraction nu [–]", (("solid_fraction", ""),)),
    (_CONTACTS, (("coordination", "all"), ("coordination_loaded", "without rattlers"))),
)
"""The same for charts of letters."""
_CHARTS_OF_CELL = (
    ("shear rate [1/s]", (("shear_rate", ""),)),
    ("stress [N/m]", tuple((f"stress_{k}", k) for k in ("xx", "yy", "xy"))),
    ("friction mu [–]", (("friction", ""),)),
    ("solid fraction nu [–]", (("solid_fraction", ""),)),
)


def draw_rheology(figure: Any, table: Rheology) -> None:
    """Draw the panels of a rheology into a matplotlib figure."""
    draw_panels(figure, figure.subplots(4, 2, sharex=True), table, _OF_RHEOLOGY)


def draw_cell(figure: Any, table: CellRheology) -> None:
    """Draw the panels of the rheology of a cell into a matplotlib figure."""
    draw_panels(figure, figure.subplots(5, 2, sharex=True), table, _OF_CELL)


def draw_panels(figure: Any, grid: Any, table: TimeTable, panels: Panels) -> None:
    """Draw quantities over time with means and errors; say below what lines and bands are."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    grid.flat[0].locator_params(axis="x", nbins=4)  # shared; times may have many digits
    for panel, (label, quantities) in zip(grid.flat, panels, strict=False):
        for color, (name, text) in zip(COLORS, quantities, strict=False):
            _draw_quantity(panel, table, name, text, color)
        panel.set_ylabel(label)
        panel.margins(y=0.12)
        # At least a thousandth of the largest mean: what is constant must not seem to vary.
        (low, high), means = panel.get_ylim(), [table.mean[name] for name, _ in quantities]
        room = 5e-4 * float(np.nanmax(np.abs(means), initial=0.0))
        if not np.isfinite(means).any():
            panel.set_yticks([])
            panel.text(0.5, 0.5, "no value", ha="center", va="center", transform=panel.transAxes)
        elif room < _ZERO:
            panel.set_ylim(-1.0, 1.0)
        elif high - low < 2.0 * room:
            panel.set_ylim(0.5 * (low + high) - room, 0.5 * (low + high) + room)
        panel.ticklabel_format(axis="y", scilimits=(-3, 4), useMathText=True)
        if len(quantities) > 1:
            legend_above(panel, len(quantities), handlelength=1.4)
    for panel in grid.flat[len(panels) :]:
        panel.set_axis_off()
    for panel in grid.flat[: len(panels)][-grid.shape[1] :]:  # the lowest of each column
        panel.set_xlabel("time $t$ [s]")
        panel.tick_params(labelbottom=True)
    names = [name for _, quantities in panels for name, _ in quantities]
    known = [bool(np.isfinite(table.error[n])) for n in names if np.isfinite(table.mean[n])]
    line: dict[str, Any] = {"color": "0.3", "linewidth": 0.7}
    entries = [
        (any(known), Line2D([], [], linestyle=_KNOWN, **line), "mean"),
        (any(known), Patch(color="0.3", alpha=0.2, linewidth=0.0), "± standard error"),
        (not all(known), Line2D([], [], linestyle=_UNKNOWN, **line), "mean, error not known"),
    ]
    shown = [(handle, text) for is_shown, handle, text in entries if is_shown]
    figure.legend(*zip(*shown, strict=True), loc="outside lower center", ncols=len(shown))


def _draw_quantity(panel: Any, table: TimeTable, name: str, text: str, color: str) -> None:
    known = np.isfinite(table.values[name])
    style: dict[str, Any] = {"color": color, "linewidth": 0.8, "label": text or None}
    if known.sum() < 60:
        style |= {"marker": "o", "markersize": 2.0, "markeredgewidth": 0.0}
    panel.plot(table.time[known], table.values[name][known], **style)
    mean, error = table.mean[name], table.error[name]
    if np.isfinite(mean):
        line = _KNOWN if np.isfinite(error) else _UNKNOWN
        panel.axhline(mean, color=color, linewidth=0.7, linestyle=line)
    if np.isfinite(mean) and np.isfinite(error):
        panel.axhspan(mean - error, mean + error, color=color, alpha=0.2, linewidth=0.0)


def rheology_text(table: Rheology | CellRheology, _terminal: Terminal) -> str:
    """A rheology over time, one low chart for each kind of quantity."""
    charts = _CHARTS_OF_CELL if isinstance(table, CellRheology) else _CHARTS_OF_RHEOLOGY
    return _charts_of(table, charts)


# ---- What is in a region over time, in the same way

_STRESS = tuple((f"stress_{axes}", f"${axes}$") for axes in ("xx", "yy", "xy"))
_OF_REGION: Panels = (
    (r"solid fraction $\nu$ [–]", (("solid_fraction", ""),)),
    ("coordination number $Z$ [–]", (("coordination", ""),)),
    ("velocity [m/s]", (("velocity_x", "$v_x$"), ("velocity_y", "$v_y$"))),
    ("contact stress [N/m]", _STRESS),
    ("kinetic stress [N/m]", tuple((f"kinetic_{name}", text) for name, text in _STRESS)),
    ("temperature $T$ [K]", (("temperature", ""),)),
)
_SPIN = (r"spin $\omega$ [rad/s]", (("spin", ""),))  # instead of the last one without heat


def draw_region(figure: Any, table: RegionTable) -> None:
    """Draw the panels into a matplotlib figure."""
    grid, values = figure.subplots(2, 3, sharex=True), table.values.get("temperature")
    panels = _OF_REGION if values is not None else (*_OF_REGION[:-1], _SPIN)
    draw_panels(figure, grid, table, panels)
    if values is not None and count_small_rises(grid[-1, -1].yaxis, "temp.", "T", "K", values):
        low, high = float(np.nanmin(values)), float(np.nanmax(values))
        grid[-1, -1].set_ylim(low - 0.12 * (high - low), high + 0.12 * (high - low))


def region_text(table: RegionTable, _terminal: Terminal) -> str:
    """Solid fraction and stresses over time, in low charts."""
    charts = (
        ("solid fraction nu [–]", ("solid_fraction",)),
        ("contact stress [N/m]", ("stress_xx", "stress_yy", "stress_xy")),
    )
    shown = (
        (label, _by_end(names))
        for label, names in charts
        if any(np.isfinite(table.values[name]).any() for name in names)
    )
    return _charts_of(table, shown)


# ---- How a packing conducts over time, in the same way

_OF_CONDUCTIVITY: Panels = (
    ("of a square $K$ [W/K]", tuple((f"square_{k}", f"$K_{{{k}}}$") for k in ("xx", "yy", "xy"))),
    ("of a contact $H$ [W/K]", (("contact_conductance", ""),)),
    ("$K/H$ [–]", (("over_contact", ""),)),
    (r"$K/K_\mathrm{lin}$ [–]", (("over_linear", ""),)),
    ("contact pressure $p$ [N/m]", (("pressure", ""),)),
    (r"solid fraction $\nu$ [–]", (("solid_fraction", ""),)),
    ("coordination number $Z$ [–]", (("coordination", ""),)),
    ("anisotropy [–]", (("anisotropy", ""),)),
)


def draw_conductivity(figure: Any, table: Conductivity) -> None:
    """Draw the panels into a matplotlib figure."""
    draw_panels(figure, figure.subplots(4, 2, sharex=True), table, _OF_CONDUCTIVITY)


def conductivity_text(table: Conductivity, _terminal: Terminal) -> str:
    """Conductances and what they depend on over time, in low charts."""
    charts = (
        ("of a square [W/K]", ("square_xx", "square_yy", "square_xy")),
        ("K/H [–]", ("over_contact",)),
        (_CONTACTS, ("coordination",)),
    )
    return _charts_of(table, ((label, _by_end(names)) for label, names in charts))


_OF_LAYER: Panels = (
    ("of a square $K$ [W/K]", (("square", "all"), ("square_bulk", "bulk"))),
    ("of a contact $H$ [W/K]", (("contact_conductance", ""),)),
    ("from wall to wall $G$ [W/K]", (("conductance", ""),)),
    ("$K/H$ [–]", (("over_contact", ""),)),
    ("pressure $P$ [N/m]", (("pressure", ""),)),
    (r"solid fraction $\nu$ [–]", (("solid_fraction", ""),)),
    ("contacts per grain $Z$ [–]", (("coordination", ""),)),
    ("joined to the walls [–]", (("joined", ""),)),
)
_OF_LAYER_FLOW: Panels = (
    ("heat flow [W]", (("flow", "through"), ("stored", "stored"))),
    (r"$\Delta T$ [K]", (("difference", ""),)),
    ("of a square $K$ [W/K]", (("flow_square", ""),)),
    ("stored over through [–]", (("unsteadiness", ""),)),
)
_SHARES = ("share [–]", tuple((f"share_{way}", way) for way in WAYS))
_OF_WAYS: Panels = (("from wall to wall $G$ [W/K]", (("flow_conductance", ""),)), _SHARES)


def draw_layer(figure: Any, table: LayerConductivity) -> None:
    """Draw the panels of the contacts of a layer into a matplotlib figure."""
    draw_panels(figure, figure.subplots(4, 2, sharex=True), table, _OF_LAYER)


def layer_text(table: LayerConductivity, _terminal: Terminal) -> str:
    """Conductance of a layer and its contacts over time, in low charts."""
    charts = (("of a square [W/K]", ("square", "square_bulk")), (_CONTACTS, ("coordination",)))
    return _charts_of(table, ((label, [(n, n) for n in names]) for label, names in charts))


def _limit_shares(panel: Any) -> None:
    """Where next to nothing passes in an interval, its shares may have any size: cut these off."""
    low, high = panel.get_ylim()
    panel.set_ylim(max(low, -0.5), min(high, 1.5))


def draw_layer_flow(figure: Any, table: LayerFlow) -> None:
    """Draw the panels of what flows through a layer into a matplotlib figure."""
    panels = [*_OF_LAYER_FLOW, *(_OF_WAYS if "share_contacts" in table.values else ())]
    grid = figure.subplots(len(panels) // 2, 2, sharex=True)
    draw_panels(figure, grid, table, panels)
    if _SHARES in panels:
        _limit_shares(grid[-1, 1])


def layer_flow_text(table: LayerFlow, _terminal: Terminal) -> str:
    """Flows and conductance over time, in low charts."""
    charts = (("heat flow [W]", ("flow", "stored")), ("of a square [W/K]", ("flow_square",)))
    return _charts_of(table, ((label, [(n, n) for n in names]) for label, names in charts))


# ---- Heat transfer between walls and a bed over time, in the same way

_OF_WALLS = (
    ("heat flow $Q$ [W]", "flow"),
    (r"$T_\mathrm{wall} - T_\mathrm{bed}$ [K]", "difference"),
    ("$h$ [W/(m² K)]", "coefficient"),
    ("Nusselt number [–]", "nusselt"),
    ("wetted length $L$ [m]", "wetted"),
    (r"$T_\mathrm{bed}$ [K]", "bed"),
)


def draw_wall_heat(figure: Any, table: WallHeatTable) -> None:
    """Draw a panel for each quantity with a line for each wall; at most `COLORS` of them."""
    if len(table.walls) > len(COLORS):
        raise PlotError(
            f"the lines of {len(table.walls)} walls cannot be told apart: choose with --wall"
        )
    panels = [
        (label, [(f"{wall}: {name}", wall if table.walls[1:] else "") for wall in table.walls])
        for label, name in _OF_WALLS
        if f"{table.walls[0]}: {name}" in table.values
    ]
    grid = figure.subplots(3, 2, sharex=True)
    draw_panels(figure, grid, table, panels)


def wall_heat_text(table: WallHeatTable, _terminal: Terminal) -> str:
    """Coefficients and temperature differences over time, in low charts."""
    charts = (("h [W/(m² K)]", "coefficient"), ("wall less bed [K]", "difference"))
    return _charts_of(
        table,
        ((label, [(f"{wall}: {name}", wall) for wall in table.walls]) for label, name in charts),
    )


# ---- Mean heat flux over time, in the same way

_OF_FLUX: Panels = (
    ("of a square $K$ [W/K]", (("along", r"along $G$"), ("across", r"across $G$"))),
    _SHARES,
    (
        "diffusivity [m²/s]",
        (("diffusivity", r"$\alpha$"), ("mixing", r"$D_T$"), ("self_diffusion", "$D$")),
    ),
    (r"$T'/(|G| d)$ [–]", (("fluctuation", ""),)),
)


def draw_mean_heat(figure: Any, table: MeanHeat) -> None:
    """Draw the panels into a matplotlib figure."""
    grid = figure.subplots(2, 2, sharex=True)
    draw_panels(figure, grid, table, _OF_FLUX)
    _limit_shares(grid[0, 1])


def mean_heat_text(table: MeanHeat, _terminal: Terminal) -> str:
    """Conductance and its share of motion over time, in low charts."""
    charts = (("along G, of a square [W/K]", "along"), ("share of motion [–]", "share_motion"))
    return _charts_of(table, ((label, [(name, "")]) for label, name in charts))


FIGURES = {
    EnergyTable: Renderer(
        lambda table: (COLUMN if table.heat_closure is None else PAGE, 1.15 * COLUMN),
        draw_energy,
        energy_text,
    ),
    SeriesTable: Renderer(
        lambda table: (1.3 * COLUMN, COLUMN * (0.3 + 0.45 * len(_units(table)))),
        draw_series,
        series_text,
    ),
    FlowTable: Renderer(lambda _: (COLUMN, 0.75 * COLUMN), draw_flow, flow_text),
    Rheology: Renderer(lambda _: (PAGE, 0.9 * PAGE), draw_rheology, rheology_text),
    CellRheology: Renderer(lambda _: (PAGE, 1.1 * PAGE), draw_cell, rheology_text),
    Conductivity: Renderer(lambda _: (PAGE, 0.9 * PAGE), draw_conductivity, conductivity_text),
    LayerConductivity: Renderer(lambda _: (PAGE, 0.9 * PAGE), draw_layer, layer_text),
    LayerFlow: Renderer(
        lambda table: (PAGE, PAGE * (0.72 if "share_contacts" in table.values else 0.52)),
        draw_layer_flow,
        layer_flow_text,
    ),
    WallHeatTable: Renderer(lambda _: (PAGE, 0.72 * PAGE), draw_wall_heat, wall_heat_text),
    MeanHeat: Renderer(lambda _: (PAGE, 0.52 * PAGE), draw_mean_heat, mean_heat_text),
    RegionTable: Renderer(lambda _: (PAGE, 0.62 * PAGE), draw_region, region_text),
}
