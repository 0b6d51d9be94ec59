"""Heat of contacts: what flows through those of a frame, and how hot sliding ones get."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from multicor_cli.model import Model
from multicor_cli.model.flash import flash_rise, spot_peclet, spot_temperature
from multicor_cli.model.model import Floats
from multicor_cli.post.contacts import (
    HeatFlows,
    heat_flows,
    loaded_contacts,
    shape_temperatures,
    with_conduction,
    with_forces,
)
from multicor_cli.post.forces import lines_of
from multicor_cli.post.grain_map import make_scene
from multicor_cli.post.source import (
    Frame,
    PostError,
    Run,
    Selection,
    chosen_frames,
    frame_index,
    frames_of,
    left_out,
    need_grains,
    need_heat,
    properties,
)
from multicor_cli.post.spots import spots_of
from multicor_cli.post.table import Column, Quantity, Table, TimeTable, values_of_quantities

# ---- The network of the heat that contacts conduct in one frame

_STRONGEST = 0.1  # part of the contacts whose share of the flow is told

_OF_NETWORK = {
    "contacts": "contacts that conduct",
    "wall_contacts": "  of these with walls",
    "coordination": "conducting contacts per grain",
    "idle_share": "share of grains without any",
    "flow_mean": "mean heat flow of a contact, without sign [W]",
    "flow_max": "largest heat flow of a contact [W]",
    "strongest_share": "share of the strongest 10 % in the sum of flows",
    "from_walls": "heat flow from walls into grains, net of each [W]",
    "to_walls": "heat flow from grains into walls, net of each [W]",
}
HEAT_SUMMARY = tuple(_OF_NETWORK)
"""Names of the numbers of a whole network."""


class HeatNetwork(Table):
    """The contacts of a frame that conduct heat; ``c`` of them.

    The flow of a contact is H (T_j − T_i), with the conductances H of the last step and the
    temperatures of the frame; see `multicor_cli.post.contacts.heat_flows`.

    Attributes:
        scene: Where the grains and walls are.
        i: First grain, shape ``(c,)``.
        j: Second grain, or wall shape (not below the number of grains), shape ``(c,)``.
        start: Center of the grain i [m], shape ``(c, 2)``.
        end: Center of grain j, free or glued, or where i touches a smooth wall [m], ``(c, 2)``.
        touch: Where i touches j [m], shape ``(c, 2)``.
        flow: Heat flow into i [W], shape ``(c,)``.
        conductance: H [W/K], shape ``(c,)``.
        is_wall: Whether a contact is one of a grain with a wall, shape ``(c,)``.
        temperature: Of the grains [K], shape ``(n,)``.
        frame: Index of the frame.
        time: Time of the frame [s].
        left_out: What else conducts in the run, and is not counted; empty if nothing does.
        summary: The numbers of `HEAT_SUMMARY`, by name; nan where there is no contact. Flows from
            walls are sums over the walls that give heat to the grains, flows to walls over those
            that take some.
    """


def heat_network(source: Run, frame: int = -1) -> HeatNetwork:
    """The network of the heat that contacts conduct in one frame.

    Args:
        source: The run, with heat.
        frame: Index of the frame; negative counts from the last one.

    Raises:
        PostError: If there is no such frame, or no grain in it, its contacts are not known, or the
            run has no heat.
        StoreError: If the run cannot be read.
    """
    index = frame_index(source.frames, frame)
    need_grains(source, np.array([index]))
    with_conduction(source, np.array([index]))
    chosen = source.frames[index]
    model, scene = chosen.model, make_scene(source, chosen)
    flows = heat_flows(chosen, model)
    contacts = flows.contacts
    columns, parts = lines_of(contacts, scene)
    columns += [Column("conductance", "W/K", flows.conductance), Column("flow", "W", flows.flow)]
    summary = _network_numbers(flows, model)
    parts |= {"temperature": need_heat(chosen.temperature), "summary": summary}
    facts = {
        "frame": index, "time": float(np.asarray(source.frames.time)[index]),
        "left_out": left_out(source), **summary,
    }  # fmt: skip
    lines = [(_OF_NETWORK[name], value) for name, value in summary.items()]
    return HeatNetwork(values_of_quantities(lines), facts, columns, **parts)


def _network_numbers(flows: HeatFlows, model: Model) -> dict[str, float]:
    contacts, size = flows.contacts, np.sort(np.abs(flows.flow))[::-1]
    count, n, with_walls = size.size, model.grain_count, int(contacts.is_wall.sum())
    total = float(size.sum())
    # a tenth of them, of the last only the part that is left of it
    strongest = float(
        np.interp(_STRONGEST * count, np.arange(count + 1), np.append(0.0, np.cumsum(size)))
    )
    of_shape = np.bincount(
        contacts.j[contacts.is_wall] - n, flows.flow[contacts.is_wall], model.shape_count
    )
    of_wall = np.bincount(model.shapes.wall, of_shape, model.wall_count)
    return {
        "contacts": count,
        "wall_contacts": with_walls,
        "coordination": (2 * count - with_walls) / n,
        "idle_share": float(np.count_nonzero(contacts.counts == 0)) / n,
        "flow_mean": total / count if count else np.nan,
        "flow_max": float(size[0]) if count else np.nan,
        "strongest_share": strongest / total if total > 0.0 else np.nan,
        "from_walls": float(np.maximum(of_wall, 0.0).sum()),
        "to_walls": float(np.maximum(-of_wall, 0.0).sum()),
    }


# ---- Spots of sliding contacts: temperatures of bodies plus flash of friction

SPOT_QUANTITIES = (
    Quantity("sliding", "share of the loaded contacts that slide"),
    Quantity("rise_mean", "flash, mean", r"\langle\Delta T\rangle", "K"),
    Quantity("rise_50", "flash, half of the spots below", unit="K"),
    Quantity("rise_95", "flash, 95 % below", unit="K"),
    Quantity("rise_99", "flash, 99 % below", unit="K"),
    Quantity("rise_max", "flash, largest", r"\Delta T_\mathrm{max}", "K"),
    Quantity("spot_mean", "temperature of a spot, mean", r"\langle T_\mathrm{spot}\rangle", "K"),
    Quantity("spot_95", "temperature of a spot, 95 % below", unit="K"),
    Quantity("spot_max", "temperature of a spot, largest", r"T_\mathrm{spot,max}", "K"),
    Quantity("above", "share of spots above the limit"),
    Quantity("radius", "radius of a spot, mean", "a", "m"),
    Quantity("peclet_50", "Péclet number of a spot, half below", r"\mathrm{Pe}"),
    Quantity("peclet_max", "Péclet number of a spot, largest"),
)
"""What `hot_spots` measures, in the order of the table; shares above a limit only with one."""

_BINS = 40
_DECADES = 6.0  # below the largest rise at which bins begin
_NARROWEST = 1e-3  # range of the bins of temperatures over the highest, where all are alike


class HotSpots(TimeTable):
    """Temperatures of the spots of sliding contacts; ``f`` frames, which count alike in means.

    A spot is hotter than its bodies by the flash of friction, ΔT = P/(G_i + G_j), in its hottest
    point; see `multicor_cli.model.flash` for formula, source and validity. P = |f_t v_t| is the
    power of friction in the last step, v_t the sliding speed after it. The spot is that of Hertz,
    a = (3 f_n a*/4E*)^⅓ (Johnson 1985, eq. 4.22), of the force of this step; discs count as spheres
    of their radius, corners and sides of other shapes have the radii of curvature there, and what
    lies on a side a spot of the area on which it is pressed, if that is larger. T_spot is
    (G_i T_i + G_j T_j)/(G_i + G_j) + ΔT: both bodies are equally hot in the contact. A wall without
    temperature takes no heat, and has no part in it.

    Attributes:
        values: Each of `SPOT_QUANTITIES` over time by name, over the contacts that slide; nan where
            none does, shape ``(f,)``.
        limit: Temperature above which ``above`` counts [K]; nan without one.
        contacts: Number of contacts that slide, in all frames; the points of a side count once.
        sharp: Number of those that slide on sharp corners, in all frames. No radius of their spots
            is known: they count in ``sliding`` alone.
        rise_edges, spot_edges: Edges of bins of ΔT, a constant ratio apart, and of T_spot, evenly
            spaced [K], shape ``(b + 1,)``.
        rise_density, spot_density: Probability densities in these bins over all contacts that slide
            in all frames [1/K], shape ``(b,)``.
    """

    KEYS = (
        "limit", "contacts", "sharp", "frame_count", "times",
        "units", "mean", "standard_error", "drift", "drift_error", "note",
        "rise_edges", "rise_density", "spot_edges", "spot_density", "time", "values",
    )  # fmt: skip


def hot_spots(
    source: Run, selection: Selection | None = None, limit: float | None = None
) -> HotSpots:
    """How hot the spots of sliding contacts are.

    Args:
        source: The run, with heat.
        selection: Which frames with forces; default: the later half of the last stage.
        limit: Temperature above which spots are counted [K]; default: the lowest ignition or
            melting of the materials, if one is given.

    Raises:
        PostError: If the run has no heat; a material no Young's modulus or no conductivity; no
            forces belong to these frames, or no contact slides in any of them with friction but on
            sharp corners.
        StoreError: If the run cannot be read.
    """
    if source.model.thermal is None:
        need_heat(None)
    chosen = chosen_frames(source, selection)
    need_grains(source, chosen)
    chosen = with_forces(source, chosen)
    if limit is not None and np.isnan(limit):
        raise PostError("the limit is no number; give a temperature [K]")
    limits = np.concatenate([properties(source, key) for key in ("ignition", "melting")])
    if limit is None and np.isfinite(limits).any():
        limit = float(np.nanmin(limits))
    materials = _Materials.of(source)
    spots = [_spots(f.model, f, materials) for f in frames_of(source, chosen)]
    rise, hot = (np.concatenate([getattr(one, of) for one in spots]) for of in ("rise", "hot"))
    sharp = sum(one.sharp for one in spots)
    if not rise.size and sharp:
        raise PostError(
            f"all that slides in these frames does so on sharp corners ({sharp}), of which no "
            "radius of a spot is known: give the shapes a rounding, or look at temperatures of "
            "grains, with post map"
        )
    if not rise.size:
        raise PostError("no contact slides in these frames: choose others")
    if not rise.any():
        raise PostError(
            "what slides in these frames does so without friction, which heats no spot: choose "
            "others"
        )
    rows = [_spot_numbers(one, limit) for one in spots]
    shown = [q for q in SPOT_QUANTITIES if limit is not None or q.name != "above"]
    values = {q.name: np.array([row[q.name] for row in rows]) for q in shown}
    top, low, high = float(rise.max()), float(hot.min()), float(hot.max())
    edges = np.geomspace(10.0**-_DECADES * top, top, _BINS + 1)
    room = 0.5 * max(_NARROWEST * high - (high - low), 0.0)
    even = np.linspace(low - room, high + room, _BINS + 1)
    return HotSpots.of_frames(
        source, chosen, shown, values,
        limit=np.nan if limit is None else limit, contacts=rise.size, sharp=sharp,
        rise_edges=edges, rise_density=_density(rise, edges),
        spot_edges=even, spot_density=_density(hot, even),
    )  # fmt: skip


class _Materials(NamedTuple):
    """Properties by material: E/(1 − ν²) [Pa], λ [W/(m K)], ρc [J/(m³ K)], each ``(k,)``."""

    stiffness: Floats
    conductivity: Floats
    volumetric: Floats

    @classmethod
    def of(cls, source: Run) -> _Materials:
        """Of those in use; raises `PostError` if one has no such property."""
        names = ("young", "poisson", "conductivity", "density", "heat_capacity")
        young, poisson, conductivity, density, capacity = (properties(source, k) for k in names)
        found = cls(young / (1.0 - poisson**2), conductivity, density * capacity)
        for k in np.unique(source.model.material).tolist():
            if not np.isfinite([values[k] for values in found]).all():
                raise PostError(
                    f"spots need young, poisson, conductivity and heat_capacity of the material "
                    f"'{source.model.materials[k]}': give them in the scenario and run it again"
                )
        return found


class _Spots(NamedTuple):
    """Spots of a frame that slide, ``(s,)``: ΔT [K], T [K], radius [m], Péclet; their share, and
    how many more slide on corners without a radius.
    """

    rise: Floats
    hot: Floats
    radius: Floats
    peclet: Floats
    share: float
    sharp: int


def _spots(model: Model, frame: Frame, materials: _Materials) -> _Spots:
    """Of the places that slide: all of their points count together (`post/spots.py`)."""
    contacts, pair = loaded_contacts(frame, model).points
    spots = spots_of(contacts, model, frame, pair)
    slip = np.abs(np.asarray(frame.contacts.slip, np.float64)[contacts.row])
    slides = contacts.sliding & (contacts.force[:, 0] > 0.0) & (slip > 0.0)
    is_hot = spots.total(slides.astype(np.float64)) > 0.0
    share = float(is_hot.mean()) if is_hot.size else np.nan
    force = spots.total(np.where(slides, contacts.force[:, 0], 0.0))
    power = spots.total(np.where(slides, np.abs(contacts.force[:, 1]) * slip, 0.0))
    part = np.where(slides, contacts.force[:, 0] / np.where(slides, force[spots.place], 1.0), 0.0)
    speed = spots.total(part * slip)
    ends = [end[spots.first] for end in (contacts.i, contacts.j)]
    material, stiff = model.material, materials.stiffness
    compliance = sum(1.0 / stiff[material[end]] for end in ends)
    # Of a side that is pressed the spot has its area, if that is the larger one
    radius = np.fmax(np.cbrt(0.75 * force * spots.radius * compliance), np.sqrt(spots.area / np.pi))
    rows = np.flatnonzero(is_hot & (radius > 0.0))
    sharp = int(is_hot.sum()) - rows.size
    radius, power, speed = radius[rows], power[rows], speed[rows]
    temperature = shape_temperatures(frame, model)
    first, second = (temperature[end[rows]] for end in ends)
    takes_heat = np.isfinite(second)
    bodies = [
        (materials.conductivity[material[end[rows]]], materials.volumetric[material[end[rows]]])
        for end in ends
    ]
    conductivity = np.where(takes_heat, bodies[1][0], 0.0)
    spot = power, radius, speed, *bodies[0], conductivity, bodies[1][1]
    rise = flash_rise(*spot)
    peclets = [spot_peclet(radius, 0.5 * speed, *body) for body in bodies]
    peclet = np.where(takes_heat, np.maximum(*peclets), peclets[0])
    hot = spot_temperature(first, np.where(takes_heat, second, first), *spot)
    return _Spots(rise, hot, radius, peclet, share, sharp)


def _spot_numbers(spots: _Spots, limit: float | None) -> dict[str, float]:
    """`SPOT_QUANTITIES` of a frame; nan where nothing slides."""
    if not spots.rise.size:
        return dict.fromkeys((q.name for q in SPOT_QUANTITIES), np.nan) | {"sliding": spots.share}
    rise = np.quantile(spots.rise, (0.5, 0.95, 0.99, 1.0)).tolist()
    return {
        "sliding": spots.share,
        "rise_mean": float(spots.rise.mean()),
        **dict(zip(("rise_50", "rise_95", "rise_99", "rise_max"), rise, strict=True)),
        "spot_mean": float(spots.hot.mean()),
        "spot_95": float(np.quantile(spots.hot, 0.95)),
        "spot_max": float(spots.hot.max()),
        "above": np.nan if limit is None else float((spots.hot > limit).mean()),
        "radius": float(spots.radius.mean()),
        "peclet_50": float(np.median(spots.peclet)),
        "peclet_max": float(spots.peclet.max()),
    }


def _density(values: Floats, edges: Floats) -> Floats:
    """Probability density in bins [1/K]; what lies outside counts for the normalization."""
    return np.asarray(np.histogram(values, edges)[0] / (values.size * np.diff(edges)))
