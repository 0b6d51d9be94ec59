"""The network of heat: links of contacts, gaps, walls and the outside, sorted by other end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.contact.contacts import warm_rows
from multicor_cli.engine.geometry.places import find_places, largest_of_places
from multicor_cli.engine.geometry.scene import Scene
from multicor_cli.engine.heat.conduction import largest_biot
from multicor_cli.engine.heat.mechanism import NearPairs
from multicor_cli.engine.heat.rates import OUTSIDE_BOOKS, Network
from multicor_cli.engine.heat.settings import HeatSettings
from multicor_cli.engine.heat.spots import Spots, look_up, resting_contacts
from multicor_cli.engine.heat.walls import WallHeat
from multicor_cli.engine.jit.compile import kernel
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.model.columns import RADIUS
from multicor_cli.model.model import Floats, Ints, Model
from multicor_cli.model.shapes import ShapeKind

# ---- Sorts links by their other end: a grain or body, a wall of known temperature or flow

INSULATED, KNOWN, FLOW, BODY = 0, 1, 2, 3
"""Kinds of walls."""


class Ends(NamedTuple):
    """Links by what is at their other end; attributes as in `engine.heat.rates.Network`."""

    i: Ints
    j: Ints
    conductance: Floats
    area: Floats
    wall_i: Ints
    wall: Ints
    wall_conductance: Floats
    wall_area: Floats
    flow_i: Ints
    flow_wall: Ints
    flow_share: Floats


@formula
def _end_of(
    k: int, grains: int, j: Ints, conductance: Floats, is_radiating: bool, wall: Ints, kind: Ints
) -> int:
    """Kind of what a link leads to: grains are bodies; `INSULATED` where nothing can flow."""
    if conductance[k] == 0.0 and not is_radiating:
        return INSULATED
    if j[k] < grains:
        return BODY
    what: int = kind[wall[j[k] - grains]]
    return INSULATED if what == FLOW and not conductance[k] > 0.0 else what


@kernel
def split_links(
    grains: int, i: Ints, j: Ints, conductance: Floats, area: Floats, wall: Ints, kind: Ints,
    node: Ints
) -> Ends:  # fmt: skip
    """Split links by their other end: H shares a prescribed flow out; bodies are like grains.

    Those through which nothing can flow are left out. ``area`` factors of radiation [m²] have shape
    ``(e,)`` or size 0; ``wall`` is that of each wall shape, shape ``(m,)``; ``kind`` and ``node``
    (of bodies) are those of the walls, shape ``(w,)``.
    """
    count, total = np.zeros(4, np.int64), np.zeros(kind.size)  # of links by kind; H by wall
    has_area = min(area.size, 1)
    for k in range(j.size):
        what = _end_of(k, grains, j, conductance, area.size > 0, wall, kind)
        count[what] += 1
        if what == FLOW:
            total[wall[j[k] - grains]] += conductance[k]
    between, known, flowing = count[BODY], count[KNOWN], count[FLOW]
    ends = Ends(
        np.empty(between, np.int32), np.empty(between, np.int32), np.empty(between),
        np.empty(has_area * between),
        np.empty(known, np.int32), np.empty(known, np.int32), np.empty(known),
        np.empty(has_area * known),
        np.empty(flowing, np.int32), np.empty(flowing, np.int32), np.empty(flowing),
    )  # fmt: skip
    count[:] = 0
    for k in range(j.size):
        what = _end_of(k, grains, j, conductance, area.size > 0, wall, kind)
        at, w = count[what], wall[j[k] - grains] if j[k] >= grains else -1
        count[what] += 1
        if what == BODY:
            other = j[k] if w < 0 else node[w]
            ends.i[at], ends.j[at], ends.conductance[at] = i[k], other, conductance[k]
            if has_area:
                ends.area[at] = area[k]
        elif what == KNOWN:
            ends.wall_i[at], ends.wall[at], ends.wall_conductance[at] = i[k], w, conductance[k]
            if has_area:
                ends.wall_area[at] = area[k]
        elif what == FLOW:
            share = conductance[k] / total[w]
            ends.flow_i[at], ends.flow_wall[at], ends.flow_share[at] = i[k], w, share
    return ends


# ---- From contacts, gaps, walls and surroundings to links between nodes

_KINDS = {"insulated": INSULATED, "temperature": KNOWN, "flow": FLOW, "capacity": BODY}


def kinds_of(conditions: Sequence[WallHeat], grains: int) -> tuple[Ints, Ints]:
    """Kinds of the walls, and the nodes of those that are bodies, both of shape ``(w,)``."""
    kind = np.array([_KINDS[c.kind] for c in conditions], np.int32)
    return kind, (grains - 1 + np.cumsum(kind == BODY)).astype(np.int32)


Pairs = tuple[Ints, Ints, Floats]
"""First and second shapes of pairs, sorted, and their gaps [m]."""


@dataclass(frozen=True)
class Links:
    """Pairs of bodies between which heat flows; ``e`` of them, a grain and a grain or wall shape.

    Attributes:
        conductance: H [W/K], shape ``(e,)``.
        area: Area factor of radiation [m²], shape ``(e,)`` or of size 0.
        biot: Largest Biot number H/(λ a), contact and gas together.
        gas_ratio: Smallest and largest λ_s s/(λ_f a) of a contact in a gas; 0 without.
    """

    i: Ints
    j: Ints
    conductance: Floats
    area: Floats
    biot: float
    gas_ratio: tuple[float, float]


def links_of(
    scene: Scene, spots: Spots, near: Pairs | None, settings: HeatSettings, model: Model
) -> Links:
    """Contacts, and the gaps that mechanisms cross: one for each place, from its nearest point.

    ``near`` are the pairs within the reach of mechanisms; None if none crosses gaps.
    """
    laws, area = settings.laws, np.empty(0)
    if near is None:
        i, j, conductance = spots.i, spots.j, spots.conductance
        biot = largest_biot(scene, i, j, spots.place, conductance, laws)
        return Links(i, j, conductance, area, biot, (0.0, 0.0))
    i, j, gap = _with_contacts(scene, near, spots)
    row = warm_rows(model.grain_count, spots.i)
    conductance, spot = np.empty(i.size), np.empty(i.size)
    look_up(row, spots.j, spots.conductance, i, j, conductance)
    look_up(row, spots.j, spots.radius, i, j, spot)
    place, share = find_places(scene, i, j)
    spot = np.where(share > 0.0, largest_of_places(place, spot), 0.0)
    ratio = (0.0, 0.0)
    for mechanism in settings.mechanisms:
        if mechanism.reach <= 0.0:
            continue
        carried = mechanism.between(NearPairs(i, j, gap, spot), scene, laws, model)
        is_within = _is_within(scene, i, j, gap, mechanism.reach)
        if carried.conductance is not None:
            conductance += np.where(is_within, share * carried.conductance, 0.0)
        if carried.area is not None:
            area = np.where(is_within, share * carried.area, 0.0) + (area if area.size else 0.0)
        ratio = carried.gas_ratio or ratio
    return Links(
        i, j, conductance, area, largest_biot(scene, i, j, place, conductance, laws), ratio
    )


def _with_contacts(scene: Scene, near: Pairs, spots: Spots) -> Pairs:
    """Near pairs, and contacts that conduct: a grain landing in the step may be far at q_m."""
    shapes = scene.radius.size + scene.kind.size
    key_near = near[0].astype(np.int64) * shapes + near[1]
    key_spot = spots.i.astype(np.int64) * shapes + spots.j
    far = (spots.conductance > 0.0) & ~np.isin(key_spot, key_near)
    if not far.any():
        return near
    i, j = spots.i[far], spots.j[far]
    gap = np.empty(i.size)
    resting_contacts(scene, i, j, gap, np.empty((i.size, 2)))
    order = np.argsort(np.concatenate([key_near, key_spot[far]]), kind="stable")
    return (
        np.concatenate([near[0], i])[order],
        np.concatenate([near[1], j])[order],
        np.concatenate([near[2], gap])[order],
    )


def _is_within(scene: Scene, i: Ints, j: Ints, gap: Floats, reach: float) -> NDArray[np.bool_]:
    """Whether the gaps of pairs are at most ``reach`` times the smaller radius, shape ``(e,)``."""
    shapes = np.where(scene.kind == ShapeKind.DISC, scene.world[:, RADIUS], np.inf)
    radius = np.concatenate([scene.radius, shapes])
    return np.asarray(gap <= reach * np.minimum(radius[i], radius[j]))


def network_of(
    links: Links,
    scene: Scene,
    kind: Ints,
    node: Ints,
    velocity: Floats,
    model: Model,
    settings: HeatSettings,
) -> Network:
    """The network of a step, of grains and then bodies: walls with a heat capacity.

    ``kind`` and ``node`` are those of `kinds_of`; velocities of the grains [m/s], ``(n, 2)``.
    """
    n = model.grain_count
    ends = split_links(n, links.i, links.j, links.conductance, links.area, scene.wall, kind, node)
    nodes = n + int(np.count_nonzero(kind == BODY))
    asked = (mechanism.outside(velocity, settings.laws, model) for mechanism in settings.mechanisms)
    outside = [one for one in asked if one is not None]
    return Network(
        *ends,
        outside_book=np.array([OUTSIDE_BOOKS.index(one.book) for one in outside], np.int32),
        outside_temperature=np.array([one.temperature for one in outside], float),
        outside_conductance=_rows([one.conductance for one in outside], n, nodes),
        outside_area=_rows([one.area for one in outside], n, nodes),
    )


def _rows(values: Sequence[Floats | float], n: int, nodes: int) -> Floats:
    """One row for each of ``values``; nothing outside reaches the bodies that follow the grains."""
    table = np.zeros((len(values), nodes))
    for row, value in zip(table, values, strict=True):
        row[:n] = value
    return table
