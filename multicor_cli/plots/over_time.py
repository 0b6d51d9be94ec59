"""Figures over time: books, columns of the time series, and quantities with their averages."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
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
    use_powers,
)
from multicor_cli.post.conductivity import WAYS, Conductivity, MeanHeat
from multicor_cli.post.energy import HEAT, MECHANICAL, BookLine, EnergyTable, SeriesTable
from multicor_cli.post.fabric import Fabric
from multicor_cli.post.layer_conductivity import LayerConductivity, LayerFlow
from multicor_cli.post.region import RegionTable
from multicor_cli.post.rheology import CellRheology, Rheology
from multicor_cli.post.table import TimeTable
from multicor_cli.post.wall_heat import WallHeatTable
from multicor_cli.text import unit_sign

_ZERO = 1e-30  # what rounding leaves of velocities that are all the same, squared
_LOW = 8  # rows of a chart of letters, of which several are shown

# ---- The energy books: what came in and where it went, stacked, and how well the books close

# Lines that stay below this part of the largest one are left out of charts of letters
_VISIBLE = 0.02
_GAIN = BookLine("kinetic_gain", "kinetic energy", sign=-1)
_STORED = BookLine("heat_stored", "stored in the grains", sign=-1)
LOOKS = {
    "gravity_work": ("gravity", "0.5"), "wall_work": ("walls", COLORS[2]),
    "load_work": ("loads", COLORS[0]), "adhesion_work": ("adhesion", "#aa4499"),
    "expansion_work": ("expansion", "#661100"), "worn_energy": ("worn off", "#ddcc77"),
    "friction_loss": ("friction", COLORS[1]), "impact_loss": ("impacts", COLORS[5]),
    "damping_loss": ("damping", COLORS[3]), "correction_work": ("projection", "#f0e442"),
    "kinetic_gain": ("kinetic", COLORS[4]), "kinetic_in": ("grains in", "#117733"),
    "kinetic_out": ("grains out", "#999933"),
    "heat_friction": ("friction", COLORS[1]), "heat_impact": ("impacts", COLORS[5]),
    "heat_from_walls": ("from walls", COLORS[2]), "heat_from_ambient": ("from fluid", "#332288"),
    "heat_from_surroundings": ("surroundings", "#882255"),
    "heat_along_gradient": ("gradient", "#cc6677"), "heat_to_walls": ("into walls", "0.5"),
    "heat_stored": ("stored", COLORS[4]), "heat_ahead": ("ahead", "#44aa99"),
    "heat_out": ("grains out", "#999933"),
}  # fmt: skip
"""Short names and colors. One color for one thing: friction, impacts, walls, as work or heat; what
is kept, as either."""


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
        name, color = LOOKS[entry.name]
        style = {"color": color, "linewidth": 0.0}
        panel.fill_between(table.time, up, high, label=name, **style)
        panel.fill_between(table.time, low, down, **style)
        up, down = high, low
    panel.axhline(0.0, color="0.2", linewidth=0.6)
    use_powers(panel)
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
        use_powers(panel)
        if len(shown) > 1:
            legend_above(panel, 2)
    panels[-1].set_xlabel("time $t$ [s]")
    figure.align_ylabels()


def series_text(table: SeriesTable, _terminal: Terminal) -> str:
    """The columns as charts of letters, one below the other."""
    return _charts(
        table,
        ((f"{c.name} [{unit_sign(c.unit)}]", ((c.name, ""),)) for c in table.quantities),
    )


def _charts(table: TimeTable, charts: Iterable[Panel]) -> str:
    """Low charts of letters over time below each other."""
    return "\n\n".join(
        draw_text(
            [TextLine(text, table.time, table.values[name]) for name, text in lines],
            "time [s]", label, rows=_LOW,
        )
        for label, lines in charts
    )  # fmt: skip


# ---- Quantities over time, with averages and their errors as bands

Panel = tuple[str, Sequence[tuple[str, str]]]
"""Label of the axis, and the quantities of a panel with their names."""

Panels = Sequence[Panel]

_KNOWN: Any = "--"  # line of a mean with a standard error
_UNKNOWN: Any = ":"  # line of one without
_HEIGHTS = {2: 0.52, 3: 0.72, 4: 0.9, 5: 1.125, 6: 1.35}
"""Heights of figures of so many rows of panels, over the width of the page."""


def over_time(
    panels: Panels | Callable[[Any], Panels],
    charts: Panels | Callable[[Any], Panels],
    *,
    columns: int = 2,
    height: float | None = None,
    finish: Callable[[Any, Any], None] | None = None,
) -> Renderer:
    """Panels beside each other, and low charts of letters; ``finish`` is given axes and table.

    What is to be seen may depend on the table. The ``height`` is over the width of the page.
    """

    def shown(table: Any, of: Panels | Callable[[Any], Panels]) -> Panels:
        return of(table) if callable(of) else of

    def rows(table: Any) -> int:
        return -(-len(shown(table, panels)) // columns)

    def size(table: Any) -> tuple[float, float]:
        return PAGE, (height or _HEIGHTS[rows(table)]) * PAGE

    def draw(figure: Any, table: Any) -> None:
        found = shown(table, panels)
        grid = figure.subplots(rows(table), columns, sharex=True)
        _draw_panels(figure, grid, table, found)
        if finish is not None:
            finish(grid, table)

    return Renderer(size, draw, lambda table, _terminal: _charts(table, shown(table, charts)))


def by_name(panels: Panels) -> Panels:
    """Some panels as charts, whose lines have the names of the quantities."""
    return [(label.replace("$", ""), [(n, n) for n, _ in lines]) for label, lines in panels]


def _draw_panels(figure: Any, grid: Any, table: TimeTable, panels: Panels) -> None:
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
        use_powers(panel)
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


# ---- Which panels tables over time have

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


def _of_region(table: RegionTable) -> Panels:
    return _OF_REGION if "temperature" in table.values else (*_OF_REGION[:-1], _SPIN)


def _charts_of_region(table: RegionTable) -> Panels:
    charts = (
        ("solid fraction nu [–]", (("solid_fraction", ""),)),
        ("contact stress [N/m]", tuple((f"stress_{k}", k) for k in ("xx", "yy", "xy"))),
    )
    return [c for c in charts if any(np.isfinite(table.values[name]).any() for name, _ in c[1])]


def _count_rises(grid: Any, table: RegionTable) -> None:
    """Of temperatures that hardly differ."""
    values = table.values.get("temperature")
    if values is not None and count_small_rises(grid[-1, -1].yaxis, "temp.", "T", "K", values):
        low, high = float(np.nanmin(values)), float(np.nanmax(values))
        grid[-1, -1].set_ylim(low - 0.12 * (high - low), high + 0.12 * (high - low))


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
_CHARTS_OF_CONDUCTIVITY = (
    ("of a square [W/K]", tuple((f"square_{k}", k) for k in ("xx", "yy", "xy"))),
    ("K/H [–]", (("over_contact", ""),)),
    (_CONTACTS, (("coordination", ""),)),
)
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
_CHARTS_OF_LAYER = (
    ("of a square [W/K]", (("square", "square"), ("square_bulk", "square_bulk"))),
    (_CONTACTS, (("coordination", ""),)),
)
_CHARTS_OF_LAYER_FLOW = (
    ("heat flow [W]", (("flow", "flow"), ("stored", "stored"))),
    ("of a square [W/K]", (("flow_square", ""),)),
)
_SHARES = ("share [–]", tuple((f"share_{way}", way) for way in WAYS))
_OF_WAYS: Panels = (("from wall to wall $G$ [W/K]", (("flow_conductance", ""),)), _SHARES)


def _limit_shares(panel: Any) -> None:
    """Where next to nothing passes in an interval, its shares may have any size: cut these off."""
    low, high = panel.get_ylim()
    panel.set_ylim(max(low, -0.5), min(high, 1.5))


def _of_layer_flow(table: LayerFlow) -> Panels:
    return [*_OF_LAYER_FLOW, *(_OF_WAYS if "share_contacts" in table.values else ())]


_OF_WALLS = (
    ("heat flow $Q$ [W]", "flow"),
    (r"$T_\mathrm{wall} - T_\mathrm{bed}$ [K]", "difference"),
    ("$h$ [W/(m² K)]", "coefficient"),
    ("Nusselt number [–]", "nusselt"),
    ("wetted length $L$ [m]", "wetted"),
    (r"$T_\mathrm{bed}$ [K]", "bed"),
)


def _of_walls(table: WallHeatTable) -> Panels:
    """A panel for each quantity with a line for each wall; at most `COLORS` of them."""
    if len(table.walls) > len(COLORS):
        raise PlotError(
            f"the lines of {len(table.walls)} walls cannot be told apart: choose with --wall"
        )
    return [
        (label, [(f"{wall}: {name}", wall if table.walls[1:] else "") for wall in table.walls])
        for label, name in _OF_WALLS
        if f"{table.walls[0]}: {name}" in table.values
    ]


def _charts_of_walls(table: WallHeatTable) -> Panels:
    charts = (("h [W/(m² K)]", "coefficient"), ("wall less bed [K]", "difference"))
    return [(label, [(f"{wall}: {name}", wall) for wall in table.walls]) for label, name in charts]


_OF_FLUX: Panels = (
    ("of a square $K$ [W/K]", (("along", r"along $G$"), ("across", r"across $G$"))),
    _SHARES,
    (
        "diffusivity [m²/s]",
        (("diffusivity", r"$\alpha$"), ("mixing", r"$D_T$"), ("self_diffusion", "$D$")),
    ),
    (r"$T'/(|G| d)$ [–]", (("fluctuation", ""),)),
)
_CHARTS_OF_FLUX = (
    ("along G, of a square [W/K]", (("along", ""),)),
    ("share of motion [–]", (("share_motion", ""),)),
)
_A = ("a_c", "a_n", "a_t", "a_l")
_NETWORKS = ("strong", "weak")
_OF_FABRIC: Panels = (
    ("anisotropy [–]", tuple((name, f"${name}$") for name in _A)),
    (
        "stress ratio $q/p$ [–]",
        (("stress_ratio", "measured"), ("stress_fabric", "½ Σ$a$")),
    ),
    *(
        (f"{network} network [–]", tuple((f"{network}_{name}", f"${name}$") for name in _A[:3]))
        for network in _NETWORKS
    ),
    (
        "share of strong [–]",
        tuple((f"strong_{key}", text) for key, text in (
            ("share", "contacts"), ("pressure", "$p$"), ("deviator", "$q$"))),
    ),
    ("direction [°]", (("theta_s", r"stress, $\theta_\sigma$"), ("theta_c", r"$\theta_c$"))),
    ("share of sliding [–]", tuple((f"{name}_sliding", name) for name in _NETWORKS)),
    ("mobilization [–]", tuple((f"{name}_mobilization", name) for name in _NETWORKS)),
)  # fmt: skip
_TOUCHES = (
    ("edge_edge", "edges"), ("edge_corner", "edge, corner"), ("corner_corner", "corners"),
)  # fmt: skip
_OF_SHAPES: Panels = (
    ("share of contacts [–]", _TOUCHES),
    ("share of forces [–]", tuple((f"{name}_force", text) for name, text in _TOUCHES)),
    ("anisotropy $a_{lt}$ [–]", (("a_lt", ""),)),
    ("nematic order [–]", (("nematic_order", ""),)),
)


def _of_fabric(table: Fabric) -> Panels:
    return (*_OF_FABRIC, *(panel for panel in _OF_SHAPES if panel[1][0][0] in table.values))


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
    Rheology: over_time(_OF_RHEOLOGY, _CHARTS_OF_RHEOLOGY),
    CellRheology: over_time(_OF_CELL, _CHARTS_OF_CELL, height=1.1),
    RegionTable: over_time(
        _of_region, _charts_of_region, columns=3, height=0.62, finish=_count_rises
    ),
    Conductivity: over_time(_OF_CONDUCTIVITY, _CHARTS_OF_CONDUCTIVITY),
    LayerConductivity: over_time(_OF_LAYER, _CHARTS_OF_LAYER),
    LayerFlow: over_time(
        _of_layer_flow,
        _CHARTS_OF_LAYER_FLOW,
        finish=lambda grid, table: (
            _limit_shares(grid[-1, 1]) if "share_contacts" in table.values else None
        ),
    ),
    WallHeatTable: over_time(_of_walls, _charts_of_walls),
    MeanHeat: over_time(
        _OF_FLUX, _CHARTS_OF_FLUX, finish=lambda grid, _table: _limit_shares(grid[0, 1])
    ),
    Fabric: over_time(_of_fabric, by_name(_OF_FABRIC[:3])),
}
