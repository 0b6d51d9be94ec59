"""Effective conductivity of a layer between two walls: of its contacts, and of what flows."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model import Model
from multicor_cli.model.columns import GIVEN
from multicor_cli.model.model import Floats
from multicor_cli.post.bins import Between, Extent, find_extent, heights, wall_spans
from multicor_cli.post.bulk import Band, find_band
from multicor_cli.post.conductivity import SHARES, WAYS, Network, thickness_of
from multicor_cli.post.contacts import (
    NOTHING_CONDUCTS,
    conducting_contacts,
    pressure_of,
    with_conduction,
)
from multicor_cli.post.source import (
    Frame,
    PostError,
    Run,
    Selection,
    chosen_frames,
    frames_of,
    left_out,
    need_grains,
    need_heat,
    need_two,
    solid_conductivity,
    times_of,
    turned,
    wall_temperatures,
)
from multicor_cli.post.sums import plane_width
from multicor_cli.post.table import Quantity, TimeTable, average_ratios, sums_between


class _Layer(NamedTuple):
    """A layer between two walls: the run (turned, if they stand upright), and which they are.

    ``axis`` is "y", or "x" of walls that stand upright.
    """

    source: Run
    axis: str
    extent: Extent
    walls: tuple[int, int]


def _find_layer(source: Run, chosen: NDArray[np.int64], between: Between | None) -> _Layer:
    """The layer between two walls, one below and one above it, or on its left and on its right.

    Walls that stand upright are taken if they are named, or if none bound the grains below and
    above. Raises `PostError` if there are no two.
    """
    if source.model.is_cell:
        raise PostError("a cell has no walls with a layer between them: use conductivity")
    if source.model.thermal is None:
        need_heat(None)
    need_grains(source, chosen)
    ways = {"y": source}
    if not source.model.period > 0.0:
        ways["x"] = turned(source)
        if between is not None and _are_upright(source.model, ways["x"].model, between):
            del ways["y"]
    for axis, each in ways.items():
        extent = find_extent(each, chosen, between)
        if extent.lower is not None and extent.upper is not None:
            return _Layer(each, axis, extent, (extent.lower, extent.upper))
    raise PostError(
        "conductivity needs a wall below and a wall above the grains, walls on their left and "
        "right, or a cell that is periodic in x and y: name the walls with --between"
    )


def _are_upright(model: Model, on_side: Model, between: Between) -> bool:
    """Whether two walls are there from which heights can be measured only ``on_side``."""
    names, low, beside = model.walls.names, wall_spans(model)[0], wall_spans(on_side)[0]
    stands = np.isfinite(beside) & ~np.isfinite(low)
    return all(name in names and stands[names.index(name)] for name in between)


def _scales(source: Run, prefix: str) -> dict[str, float]:
    """What K is divided by for the conductivity k of discs [m], and for k over that of the solid.

    nan of spheres, of discs of several thicknesses, and of grains of several conductivities.
    """
    thickness = thickness_of(source.model)
    solid = thickness * solid_conductivity(source)
    return {f"{prefix}conductivity": thickness, f"{prefix}over_solid": solid}


def _known(quantities: Sequence[Quantity], scales: dict[str, float]) -> list[Quantity]:
    return [q for q in quantities if np.isfinite(scales.get(q.name, 0.0))]


# ---- The contacts of a frame as they are

LAYER_QUANTITIES = (
    Quantity("solid_fraction", "solid fraction", r"\nu"),
    Quantity("coordination", "conducting contacts per grain", "Z"),
    Quantity("joined", "share of grains joined to the walls"),
    Quantity("pressure", "pressure of the contacts", "P", "N/m"),
    Quantity("conductance", "conductance from wall to wall", "G", "W/K"),
    Quantity("square", "conductance of a square K", "K", "W/K"),
    Quantity("square_bulk", "the same of the bulk", r"K_\mathrm{bulk}", "W/K"),
    Quantity("conductivity", "conductivity k", "k", "W/(m K)"),
    Quantity("over_solid", "k over that of the grains", r"k/k_\mathrm{s}"),
    Quantity("contact_conductance", "mean conductance of a contact H", "H", "W/K"),
    Quantity("over_contact", "K over H", "K/H"),
)
"""What `layer_conductivity` measures, in the order of the table."""


class LayerConductivity(TimeTable):
    """Conductance of a layer between two walls, of the contacts of its frames; ``f`` frames.

    Each wall is one node of the network, and all else stands still; other walls conduct nothing.
    With the walls at 1 and 0 the temperatures of the grains are those at which none keeps heat; see
    `multicor_cli.post.conductivity.Network.between`. G is the heat that flows then. The conductance
    of a square is K = G H/W, with the distance H of the walls and the width W of the layer, the
    period or how far the grains reach: the contacts with the walls count, as a part of the layer.
    That of the bulk is G/W over the slope of the temperatures (least squares over grains with their
    center in the bulk), which knows nothing of the walls' contacts. Discs of one thickness h have
    k = K/h. Only contacts conduct; see ``left_out``.

    Attributes:
        values: Each of `LAYER_QUANTITIES` by name, nan where not known, shape ``(f,)``.
        walls: Names of the lower and upper wall.
        height: Their mean distance H [m].
        width: Mean width W [m].
        margin: What is no bulk next to the surface of each wall [m].
        thickness: That of the discs [m]; nan of spheres, and of discs of several thicknesses.
        left_out: What else conducts in the run, and is not counted; empty if nothing does.
    """


def layer_conductivity(
    source: Run,
    selection: Selection | None = None,
    *,
    between: Between | None = None,
    margin: float | None = None,
) -> LayerConductivity:
    """The conductance of a layer between two walls, frame by frame, without a transient.

    Args:
        source: The run, with heat.
        selection: Which frames; default: the later half of the last stage.
        between: Names of the walls below and above; default: those that bound the grains.
        margin: Mean diameters next to the surface of each wall that are no bulk; default as in
            `multicor_cli.post.rheology.rheology`.

    Raises:
        PostError: If no frame is selected, there are no two walls, the run has no heat, or no
            contact conducts in these frames.
        MissingLibrary: If SciPy is not installed.
        StoreError: If the run cannot be read.
    """
    chosen = chosen_frames(source, selection)
    source, _, extent, walls = _find_layer(source, chosen, between)
    counted = with_conduction(source, chosen)
    band = find_band(source.model, extent, margin)
    rows = [
        _measure(frame.model, frame, band, walls, plane_width(source, frame))
        for frame in frames_of(source, counted)
    ]
    values = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    if not values["coordination"].any():
        raise PostError(NOTHING_CONDUCTS)
    scales = _scales(source, "")
    values |= {name: values["square"] / scale for name, scale in scales.items()}
    names = source.model.walls.names
    return LayerConductivity.of_frames(
        source, counted, _known(LAYER_QUANTITIES, scales), values,
        walls=(names[walls[0]], names[walls[1]]), height=float(values["height"].mean()),
        width=float(values["width"].mean()), margin=band.margin,
        thickness=thickness_of(source.model), left_out=left_out(source),
    )  # fmt: skip


def _measure(
    model: Model, frame: Frame, band: Band, walls: tuple[int, int], width: float
) -> dict[str, float]:
    """Height and width of a layer, and `LAYER_QUANTITIES` but for what needs a thickness."""
    n, height = model.grain_count, band.extent.span(frame)
    contacts, h = conducting_contacts(frame, model, has_walls=True)
    of_shape = np.select([model.shapes.wall == wall for wall in walls], [n, n + 1], n + 2)
    node = np.concatenate([np.arange(n), of_shape])[contacts.j]
    asked = np.flatnonzero(node < n + 2)
    contacts, h, node = contacts.only(asked), h[asked], node[asked]
    area = width * height
    network = Network(contacts.i, node, h, contacts.branch, n + 2, area)
    conductance, temperature = network.between(n, n + 1)
    inside = h[~contacts.is_wall]
    contact = float(inside.mean()) if inside.size else np.nan
    square = conductance * height / width
    return {
        "height": height, "width": width,
        "solid_fraction": np.pi * float((model.disc_radius**2).sum()) / area,
        "coordination": float(contacts.counts.sum()) / n,
        "joined": float(np.isfinite(temperature[:n]).mean()),
        "pressure": pressure_of(frame, model, area),
        "conductance": conductance,
        "square": square,
        "square_bulk": conductance / width / _slope(frame, band, temperature[:n]),
        "contact_conductance": contact,
        "over_contact": square / contact,
    }  # fmt: skip


def _slope(frame: Frame, band: Band, temperature: Floats) -> float:
    """How steeply temperatures fall from the lower wall to the upper [K/m]; nan if unknown."""
    y, (low, high) = heights(frame), band.edges(frame)
    inside = (y > low) & (y < high) & np.isfinite(temperature)
    if np.count_nonzero(inside) < 2:
        return np.nan
    away, rise = y[inside] - y[inside].mean(), temperature[inside]
    slope = -float(away @ rise) / float(away @ away or np.nan)
    return slope if slope > 0.0 else np.nan


# ---- What flows between frames

FLOW_QUANTITIES = (
    Quantity("flow", "heat flow through the layer, mean of both walls", "Q", "W"),
    Quantity("stored", "heat flow that stays in it", r"Q_\mathrm{hot} - Q_\mathrm{cold}", "W"),
    Quantity("unsteadiness", "the same over the flow through"),
    Quantity("difference", "difference of the walls' temperatures", r"\Delta T", "K"),
    Quantity("flow_conductance", "conductance from wall to wall", "G", "W/K"),
    Quantity("flow_square", "conductance of a square K", "K", "W/K"),
    Quantity("flow_conductivity", "conductivity k", "k", "W/(m K)"),
    Quantity("flow_over_solid", "k over that of the grains", r"k/k_\mathrm{s}"),
    *SHARES,
)
"""What `layer_flow` measures, in the order of the table."""

_SUMS = ("lapse", "given", "taken", "difference", "shape", *WAYS)


class LayerFlow(TimeTable):
    """Heat that flows through a layer between two walls; ``r`` intervals between frames.

    Q is the mean of what the hot wall gives to the grains and what the cold one takes from them, by
    contacts, gas and radiation alike; the heat of friction that goes into the walls is no part of
    it. What stays is their difference: heat that the grains store, or that comes from friction or
    goes elsewhere. Only where it is small against Q is G = Q/ΔT the conductance of a steady state.
    K = G H/W, k = K/h as in `LayerConductivity`. Shares are parts of the flux in the layer, from
    heat times its way from wall to wall, as in `multicor_cli.post.conductivity.MeanHeat`: of
    contacts, the gas in the gaps, radiation between neighbors and with walls, and grains that move.
    They are known from file format 1.11 on.

    Attributes:
        values: Each of `FLOW_QUANTITIES` by name, nan where not known, shape ``(r,)``.
        mean: Averages over the intervals: ratios of sums, not means of ratios.
        walls: Names of the hot and the cold wall.
        height, width: Mean distance of the walls and width of the layer [m].
        thickness: That of the discs [m]; nan of spheres, and of discs of several thicknesses.
    """


def layer_flow(
    source: Run, selection: Selection | None = None, *, between: Between | None = None
) -> LayerFlow:
    """The heat that flows through a layer between two walls of different temperature.

    Args:
        source: The run, with heat.
        selection: Which frames bound the intervals; default: the later half of the last stage.
        between: Names of the walls below and above; default: those that bound the grains.

    Raises:
        PostError: If fewer than two frames are selected, there are no two walls, they have no
            temperatures or the same one, or the run has no heat.
        StoreError: If the run cannot be read.
    """
    chosen = chosen_frames(source, selection)
    source, axis, extent, walls = _find_layer(source, chosen, between)
    names = source.model.walls.names
    or_else = ", or take the contacts of this one with --network"
    need_two(chosen, "what flows needs two frames", or_else)
    rows = []
    for frame in frames_of(source, chosen):
        given = need_heat(frame.wall_heat)[[*walls], GIVEN]
        rows.append([*given, extent.span(frame), plane_width(source, frame)])
    hot = np.column_stack([wall_temperatures(source, chosen)[:, [*walls]], np.array(rows)])
    warmth = hot[:, :2].mean(axis=0)
    if not np.isfinite(warmth).all() or warmth[0] == warmth[1]:
        raise PostError(
            f"the walls '{names[walls[0]]}' and '{names[walls[1]]}' have no different temperatures "
            "in these frames: choose others with --frames or --between, or take the contacts alone "
            "with --network"
        )
    if warmth[1] > warmth[0]:
        walls, hot = walls[::-1], hot[:, [1, 0, 3, 2, 4, 5]]
    times, scales = times_of(source, chosen), _scales(source, "flow_")
    lapses = np.diff(times).tolist()
    sums = np.column_stack([
        [_between(*pair, lapse) for pair, lapse in zip(pairwise(hot), lapses, strict=True)],
        _carried(source, times, axis),
    ])  # fmt: skip
    found = average_ratios(lambda rows: _derive(rows, scales), sums, times)
    shown = _known(FLOW_QUANTITIES, scales)
    if np.isnan(sums[:, -1]).all():
        shown = [q for q in shown if q not in SHARES]
    return LayerFlow.of_frames(
        source, chosen, shown, found, walls=(names[walls[0]], names[walls[1]]),
        height=float(hot[:, 4].mean()), width=float(hot[:, 5].mean()),
        thickness=thickness_of(source.model),
    )  # fmt: skip


def _between(first: Floats, second: Floats, lapse: float) -> tuple[float, ...]:
    """The sums `_SUMS` of an interval."""
    change, mean = second - first, 0.5 * (first + second)
    return lapse, change[2], -change[3], lapse * (mean[0] - mean[1]), lapse * mean[4] / mean[5]


def _carried(source: Run, times: Floats, axis: str) -> Floats:
    """Heat times its way along an axis, of each of `WAYS`, in each interval [J m], ``(r, 4)``.

    nan of a run of an older version, which does not know it.
    """
    names, series = [f"heat_way_by_{way}_{axis}" for way in WAYS], source.series
    if names[0] not in series:
        return np.full((times.size - 1, len(WAYS)), np.nan)
    books = np.column_stack([np.asarray(series[name], np.float64) for name in names])
    gained = np.diff(books, axis=0, prepend=np.zeros((1, len(WAYS))))
    return sums_between(np.asarray(series["time"], np.float64), times, gained)


def _derive(sums: Floats, scales: dict[str, float]) -> dict[str, Floats]:
    """Each of `FLOW_QUANTITIES` from rows of sums."""
    s = dict(zip(_SUMS, sums.T, strict=True))
    flow, stored = 0.5 * (s["given"] + s["taken"]) / s["lapse"], s["given"] - s["taken"]
    difference = s["difference"] / s["lapse"]
    square = flow / difference * s["shape"] / s["lapse"]
    all_ways = np.sum([s[way] for way in WAYS], axis=0)
    return {
        "flow": flow,
        "stored": stored / s["lapse"],
        "unsteadiness": stored / s["lapse"] / flow,
        "difference": difference,
        "flow_conductance": flow / difference,
        "flow_square": square,
        **{name: square / scale for name, scale in scales.items()},
        **{f"share_{way}": s[way] / all_ways for way in WAYS},
    }
