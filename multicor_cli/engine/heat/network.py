"""The network of heat: links of contacts, gaps, walls and the outside, sorted by other end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.contact.contacts import warm_rows
from multicor_cli.engine.contact.faces import rows_of_faces
from multicor_cli.engine.geometry.pieces import Pieces, turned
from multicor_cli.engine.geometry.places import find_places, largest_of_places, totals_of_places
from multicor_cli.engine.geometry.scene import Scene
from multicor_cli.engine.heat.faces import Corners, FacePoints
from multicor_cli.engine.heat.films import Film, film_conductances
from multicor_cli.engine.heat.hertz import biot_number
from multicor_cli.engine.heat.mechanism import HeatLaws, NearPairs, Rows
from multicor_cli.engine.heat.rates import OUTSIDE_BOOKS, Network
from multicor_cli.engine.heat.settings import HeatSettings
from multicor_cli.engine.heat.spots import Spots, look_up, resting_contacts
from multicor_cli.engine.heat.views import Hulls, gaps_of_outlines, views_of_outlines
from multicor_cli.engine.heat.walls import WallHeat
from multicor_cli.engine.jit.compile import kernel
from multicor_cli.model.columns import RADIUS
from multicor_cli.model.model import Floats, Ints, Model
from multicor_cli.model.shapes import ShapeKind

# ---- Where links lead: to a grain or body, to a wall of known temperature or flow

INSULATED, KNOWN, FLOW, BODY = 0, 1, 2, 3
"""Kinds of walls; grains are bodies."""

_KINDS = {"insulated": INSULATED, "temperature": KNOWN, "flow": FLOW, "capacity": BODY}


class Shapes(NamedTuple):
    """What grains and wall shapes are to heat in a stage.

    Attributes:
        kind: Their kinds, shape ``(n + m,)``.
        number: Nodes of grains and bodies, walls of all other shapes, likewise.
        inner: λ a of grains [W/K], infinite where there is none and of wall shapes, likewise; of
            one that is no disc a is the radius of a disc of its area.
    """

    kind: Ints
    number: Ints
    inner: Floats


def shapes_of(conditions: Sequence[WallHeat], model: Model, settings: HeatSettings) -> Shapes:
    """The shapes under these conditions of the walls."""
    n, grains, wall = model.grain_count, model.grains, model.shapes.wall
    kind = np.array([_KINDS[condition.kind] for condition in conditions], np.int32)
    is_body = kind == BODY
    inner = settings.laws.conductivity[grains.material] * model.disc_radius
    inner[inner == 0.0] = np.inf
    number = np.where(is_body, n - 1 + np.cumsum(is_body), np.arange(kind.size))
    return Shapes(
        np.concatenate([np.full(n, BODY), kind[wall]]).astype(np.int32),
        np.concatenate([np.arange(n), number[wall]]).astype(np.int32),
        np.concatenate([inner, np.full(wall.size, np.inf)]),
    )


class Ends(NamedTuple):
    """Where ``e`` links lead; it lasts as long as they do.

    Attributes:
        weakest: Smaller λ a of the grains at a link [W/K], shape ``(e,)``.
        between: Links between two nodes, whose ends are ``i`` and ``j``; bodies are like grains.
        known: Links from ``wall_i`` to ``wall``, of known temperature.
        flowing: Links from ``flow_i`` to ``flow_wall``, of known flow.
    """

    weakest: Floats
    between: Rows
    i: Ints
    j: Ints
    known: Rows
    wall_i: Ints
    wall: Ints
    flowing: Rows
    flow_i: Ints
    flow_wall: Ints


def ends_of(shapes: Shapes, i: Ints, j: Ints) -> Ends:
    """Sort links between ``i`` and ``j``, of shape ``(e,)``, by their other end."""
    weakest, *rows = _sort_links(shapes, i, j)
    between, known, flowing = ((row, i.take(row), shapes.number.take(j.take(row))) for row in rows)
    return Ends(weakest, *between, *known, *flowing)


@kernel
def _sort_links(shapes: Shapes, i: Ints, j: Ints) -> tuple[Floats, Rows, Rows, Rows]:
    """Smaller λ a of links; those to bodies, to walls of known temperature, and of known flow."""
    weakest, rows, start = np.empty(j.size), np.empty(j.size, np.int64), np.zeros(5, np.int64)
    for k in range(j.size):
        weakest[k] = min(shapes.inner[i[k]], shapes.inner[j[k]])
        start[shapes.kind[j[k]] + 1] += 1
    for kind in range(4):
        start[kind + 1] += start[kind]
    fill = start.copy()
    for k in range(j.size):
        kind = shapes.kind[j[k]]
        rows[fill[kind]] = k
        fill[kind] += 1
    return (
        weakest, rows[start[BODY] :], rows[start[KNOWN] : start[FLOW]],
        rows[start[FLOW] : start[BODY]],
    )  # fmt: skip


# ---- Near pairs in which a grain is no disc, as mechanisms see them: their gas, and their views


class Outlined(NamedTuple):
    """What lasts with grains that are no discs; pieces are at angle 0."""

    pieces: Pieces
    corners: Corners
    hulls: Hulls


@dataclass(frozen=True)
class NearOutlines:
    """Pairs of outlines near each other.

    Attributes:
        rows: Which of all near pairs they are, ascending.
        scene: The scene.
        outlined: Of all bodies, with the pieces as they lie there.
        normal: Normals at the nearest points of the rows, from j to i, shape ``(e, 2)``.
        of_sides: What sides that lie on each other conduct as a contact [W/K], shape ``(e,)``.
        is_rough: Whether sides are rough.
    """

    rows: Rows
    scene: Scene
    outlined: Outlined
    normal: Floats
    of_sides: Floats
    is_rough: bool

    @classmethod
    def of(
        cls, scene: Scene, known: Outlined, i: Ints, j: Ints, gap: Floats, of_sides: Floats, *,
        is_rough: bool,
    ) -> NearOutlines:  # fmt: skip
        """Those among near pairs; **modifies** their gaps [m], shape ``(e,)``: to the true ones."""
        pieces = turned(known.pieces, scene)
        rows: Rows = np.flatnonzero(rows_of_faces(pieces.is_face, i, j))
        normal = np.zeros((i.size, 2))
        gaps_of_outlines(scene, pieces, known.hulls, rows, i, j, gap, normal)
        return cls(rows, scene, known._replace(pieces=pieces), normal, of_sides, is_rough)

    def is_of_discs(self) -> NDArray[np.bool_]:
        """Which near pairs are not among these, shape ``(e,)``."""
        found = np.ones(self.of_sides.size, np.bool_)
        found[self.rows] = False
        return found

    def add_films(
        self, laws: HeatLaws, gas: float, reach: float, i: Ints, j: Ints, spot: Floats,
        conductance: Floats,
    ) -> None:  # fmt: skip
        """Add what a gas of conductivity λ_f [W/(m K)] conducts to ``conductance`` [W/K], ``(e,)``.

        It crosses gaps up to ``reach`` times the smaller radius; radii of spots are in [m].
        """
        pieces, corners, _ = self.outlined
        film_conductances(
            self.scene, pieces, corners, laws, Film(gas, reach), self.is_rough, self.rows, i, j,
            spot, self.of_sides, conductance,
        )  # fmt: skip

    def put_views(self, laws: HeatLaws, i: Ints, j: Ints, gap: Floats, area: Floats) -> None:
        """Put area factors of radiation into ``area`` [m²]; gaps [m]; shape ``(e,)``."""
        _, corners, hulls = self.outlined
        views_of_outlines(
            self.scene, hulls, laws, corners.thickness, self.rows, i, j, gap, self.normal, area
        )


# ---- From contacts, gaps, walls and surroundings to links between nodes

Pairs = tuple[Ints, Ints, Floats]
"""First and second shapes of pairs, sorted, and their gaps [m]."""


@dataclass(frozen=True)
class Links:
    """Pairs of bodies between which heat flows; ``e`` of them, a grain and a grain or wall shape.

    Attributes:
        i: First shapes, shape ``(e,)``.
        j: Second shapes, likewise.
        conductance: H [W/K], shape ``(e,)``.
        of_contacts: What contact spots have of it [W/K], shape ``(e,)``.
        area: Area factor of radiation [m²], shape ``(e,)`` or of size 0.
        biot: Largest Biot number H/(λ a), contact and gas together.
        gas_ratio: Smallest and largest λ_s s/(λ_f a) of a contact in a gas; 0 without.
        points: Where the links touch, if some of the grains are no discs.
    """

    i: Ints
    j: Ints
    ends: Ends
    conductance: Floats
    of_contacts: Floats
    area: Floats
    biot: float
    gas_ratio: tuple[float, float]
    points: FacePoints | None = None


@kernel
def largest_biot(conductance: Floats, weakest: Floats) -> float:
    """Largest Biot number H/(λ a) of the grains at some links; 0 without any.

    ``conductance`` is that of the place of each link, ``weakest`` the smaller λ a of its grains
    [W/K], both of shape ``(e,)``.
    """
    most = 0.0
    for k in range(conductance.size):
        most = max(most, biot_number(conductance[k], weakest[k]))
    return most


def contact_links(spots: Spots, ends: Ends) -> Links:
    """The contacts, with their ``ends``."""
    biot = largest_biot(spots.places.totals(spots.conductance), ends.weakest)
    touching, conductance = spots.touching, spots.conductance
    return Links(
        touching.i, touching.j, ends, conductance, conductance, np.empty(0), biot, (0.0, 0.0),
        touching.points,
    )  # fmt: skip


def near_links(
    scene: Scene, spots: Spots, near: Pairs, shapes: Shapes, settings: HeatSettings, model: Model,
    outlined: Outlined | None = None,
) -> Links:  # fmt: skip
    """Contacts, and the gaps that mechanisms cross: one for each place, from its nearest point.

    ``near`` are the pairs within the reach of mechanisms, of the circles around grains if some are
    ``outlined``.
    """
    laws, area, touching = settings.laws, np.empty(0), spots.touching
    i, j, gap = _with_contacts(scene, near, spots)
    row = warm_rows(model.grain_count, touching.i)
    conductance = look_up(row, touching.j, spots.conductance, i, j, False)
    spot = look_up(row, touching.j, spots.radius, i, j, True)
    place, share = find_places(scene, i, j)
    spot = np.where(share > 0.0, largest_of_places(place, spot), 0.0)
    outlines, of_gas = None, share
    if outlined is not None and touching.points is not None:
        sides = np.where(touching.points.is_side, spots.conductance, 0.0)
        of_sides = look_up(row, touching.j, sides, i, j, False)
        is_rough = settings.conduction == "rough"
        outlines = NearOutlines.of(scene, outlined, i, j, gap, of_sides, is_rough=is_rough)
        of_gas = np.where(outlines.is_of_discs(), share, 1.0)  # each piece of a wall has its own
    ratio, of_contacts = (0.0, 0.0), conductance.copy()
    for mechanism in settings.mechanisms:
        if mechanism.reach <= 0.0:
            continue
        carried = mechanism.between(NearPairs(i, j, gap, spot, outlines), scene, laws, model)
        is_within = _is_within(scene, i, j, gap, mechanism.reach)
        if carried.conductance is not None:
            conductance += np.where(is_within, of_gas * carried.conductance, 0.0)
        if carried.area is not None:
            area = np.where(is_within, share * carried.area, 0.0) + (area if area.size else 0.0)
        ratio = carried.gas_ratio or ratio
    ends = ends_of(shapes, i, j)
    biot = largest_biot(totals_of_places(place, conductance), ends.weakest)
    return Links(i, j, ends, conductance, of_contacts, area, biot, ratio)


def _with_contacts(scene: Scene, near: Pairs, spots: Spots) -> Pairs:
    """Near pairs, and contacts that conduct: a grain landing in the step may be far at q_m."""
    shapes = scene.radius.size + scene.kind.size
    key_near = near[0].astype(np.int64) * shapes + near[1]
    key_spot = spots.touching.i.astype(np.int64) * shapes + spots.touching.j
    far = (spots.conductance > 0.0) & ~np.isin(key_spot, key_near)
    if not far.any():
        return near
    _, first = np.unique(key_spot[far], return_index=True)  # pairs may have several points
    row = np.flatnonzero(far)[first]
    i, j = spots.touching.i[row], spots.touching.j[row]
    gap = np.empty(i.size)
    resting_contacts(scene, i, j, gap, np.empty((i.size, 2)))
    order = np.argsort(np.concatenate([key_near, key_spot[row]]), kind="stable")
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
    links: Links, nodes: int, velocity: Floats, model: Model, settings: HeatSettings, ahead: Floats
) -> Network:
    """The network of a step, of grains and then bodies: walls with a heat capacity.

    Walls of known flow share it out as conductances. Velocities of the grains [m/s], ``(n, 2)``;
    ``ahead`` as in the `Network`.
    """
    n, ends, h, area = model.grain_count, links.ends, links.conductance, links.area
    share = h[ends.flowing]
    if share.size:
        total = np.bincount(ends.flow_wall, share)
        share /= np.where(total > 0.0, total, 1.0)[ends.flow_wall]
    asked = (mechanism.outside(velocity, settings.laws, model) for mechanism in settings.mechanisms)
    outside = [one for one in asked if one is not None]
    return Network(
        ends.i, ends.j, h.take(ends.between), area[ends.between] if area.size else area,
        ahead, ends.wall_i, ends.wall, h.take(ends.known), area[ends.known] if area.size else area,
        ends.flow_i, ends.flow_wall, share,
        np.array([OUTSIDE_BOOKS.index(one.book) for one in outside], np.int32),
        np.array([one.temperature for one in outside], float),
        _rows([one.conductance for one in outside], n, nodes),
        _rows([one.area for one in outside], n, nodes),
    )  # fmt: skip


def _rows(values: Sequence[Floats | float], n: int, nodes: int) -> Floats:
    """One row for each of ``values``; nothing outside reaches the bodies that follow the grains."""
    table = np.zeros((len(values), nodes))
    for row, value in zip(table, values, strict=True):
        row[:n] = value
    return table
