"""Pairs between which heat may flow, and the contacts of a step, or at rest, as heat sees them."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import NDArray

from multicor_cli.arithmetic import expm1
from multicor_cli.engine.contact.contacts import Contacts, warm_rows
from multicor_cli.engine.geometry.outlines import circle_gap
from multicor_cli.engine.geometry.pieces import Pieces
from multicor_cli.engine.geometry.places import Places, rows_in_corners, share_place
from multicor_cli.engine.geometry.radii import hertz_radius, smaller_radius
from multicor_cli.engine.geometry.scene import Scene, known_geometry, pair_geometry
from multicor_cli.engine.heat.faces import FacePoints, corners_of_discs
from multicor_cli.engine.heat.hertz import (
    contact_radius,
    contact_volume,
    hertz_conductance,
    rough_conductance,
)
from multicor_cli.engine.heat.mechanism import HeatLaws
from multicor_cli.engine.heat.settings import HeatSettings
from multicor_cli.engine.jit.arrays import CHUNK, cube_roots
from multicor_cli.engine.jit.compile import kernel, parallel_kernel, prange
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.model.columns import NORMAL, X, Y
from multicor_cli.model.flash import spot_conductance, spot_temperature
from multicor_cli.model.model import Floats, Ints
from multicor_cli.model.state import State

# ---- Pairs between which heat may flow: which are near, and values kept for them


@kernel
def near_pairs(
    scene: Scene, is_whole: bool, row: NDArray[np.int64], partner: Ints, reach: float
) -> tuple[Ints, Ints, Floats]:
    """Pairs with gaps up to ``reach`` times the smaller radius: i, j, gap [m], sorted by (i, j).

    ``row``, shape ``(n + 1,)``, and ``partner``, ascending in a row, are those of a neighbor list.
    Walls count with their ends, even if another piece is closer, where it ``is_whole``: of circles
    around grains that are no discs.
    """
    room = partner.size
    i_of, j_of, gap_of = np.empty(room, np.int32), np.empty(room, np.int32), np.empty(room)
    found = 0
    for i in range(row.size - 1):
        for p in range(row[i], row[i + 1]):
            gap = pair_geometry(scene, i, partner[p])[0]
            if is_whole:
                gap = circle_gap(scene, i, partner[p])
            if gap <= reach * smaller_radius(scene, i, partner[p]):
                i_of[found], j_of[found], gap_of[found] = i, partner[p], gap
                found += 1
    return i_of[:found].copy(), j_of[:found].copy(), gap_of[:found].copy()


@kernel
def resting_contacts(scene: Scene, i: Ints, j: Ints, gap: Floats, normal: Floats) -> None:
    """Gaps [m] and normals of pairs at rest, ``(c,)`` and ``(c, 2)``; **modifies** both."""
    for k in range(i.size):
        gap[k], normal[k, X], normal[k, Y] = known_geometry(scene, i[k], j[k])


@kernel
def look_up(
    row: NDArray[np.int64], known_j: Ints, values: Floats, i: Ints, j: Ints, is_largest: bool
) -> Floats:
    """Sums of values of pairs in a table sorted by (i, j), or their largest; 0 without any.

    ``row`` is the first row of each grain in the table, shape ``(n + 1,)``.
    """
    found = np.zeros(i.size)
    for c in range(i.size):
        for k in range(row[i[c]], row[i[c] + 1]):
            if known_j[k] == j[c]:
                found[c] = max(found[c], values[k]) if is_largest else found[c] + values[k]
    return found


@kernel
def hand_on(
    scene: Scene, row: NDArray[np.int64], j: Ints, known_i: Ints, known_j: Ints, values: Floats
) -> Floats:
    """Values known of some pairs, for others; that of a pair gone goes to another of its place.

    A grain that rolls over a wall of many pieces leaves one behind and meets the next: in the same
    place. ``row`` is the first row of each grain among the pairs asked for, shape ``(n + 1,)``.
    Values are 0 where nothing is known, shape ``(c,)``.
    """
    found = np.zeros(j.size)
    for k in range(known_i.size):
        heir = -1
        for c in range(row[known_i[k]], row[known_i[k] + 1]):
            if j[c] == known_j[k]:
                heir = c
                break
            if heir < 0 and share_place(scene, known_i[k], j[c], known_j[k]):
                heir = c
        if heir >= 0:
            found[heir] += values[k]
    return found


# ---- Contacts: forces, spots and conductances

TOUCHING = 1e-4
"""Largest gap, over the smaller radius, of pairs that touch before any step has said which do."""


@dataclass(frozen=True)
class Touching:
    """What lasts with ``c`` contacts, sorted by (i, j): a grain and a grain or wall shape.

    Attributes:
        radius: a* [m], shape ``(c,)``.
        modulus: E* [Pa], likewise.
        harmonic: λ_h [W/(m K)], likewise.
        share: Share of the first body in the heat of friction, likewise.
        rough: Roughness [m], slope and microhardness [Pa] as in `HeatLaws`, likewise; or none.
        in_corners: Those of discs that may share a place, see `rows_in_corners`.
        points: Of this moment, where grains are no discs; None if all are discs.
    """

    i: Ints
    j: Ints
    radius: Floats
    modulus: Floats
    harmonic: Floats
    share: Floats
    rough: tuple[()] | tuple[Floats, Floats, Floats]
    in_corners: NDArray[np.int64]
    points: FacePoints | None = None

    @classmethod
    def of(
        cls, scene: Scene, i: Ints, j: Ints, settings: HeatSettings, pieces: Pieces | None = None
    ) -> Touching:
        """Contacts of discs, or with ``pieces`` of some that are none, without their points."""
        laws = settings.laws
        rough: tuple[()] | tuple[Floats, Floats, Floats] = ()
        if settings.conduction == "rough":
            pair = scene.material[i], scene.material[j]
            rough = laws.roughness[pair], laws.slope[pair], laws.microhardness[pair]
        corners = (
            rows_in_corners(scene, i, j)
            if pieces is None
            else corners_of_discs(scene, pieces, i, j)
        )
        return cls(i, j, *laws_of_pairs(scene, i, j, laws), rough, corners)

    def places(self, scene: Scene) -> Places:
        """Places of the contacts at a moment."""
        found = Places.of(scene, self.i, self.j, self.in_corners)
        return found if self.points is None else self.points.join(found)


@kernel
def laws_of_pairs(
    scene: Scene, i: Ints, j: Ints, laws: HeatLaws
) -> tuple[Floats, Floats, Floats, Floats]:
    """a* [m], E* [Pa], λ_h [W/(m K)] and β of pairs, all of shape ``(c,)``."""
    count = i.size
    radius, modulus, harmonic, share = (
        np.empty(count), np.empty(count), np.empty(count), np.empty(count)
    )  # fmt: skip
    for c in range(count):
        a, b = scene.material[i[c]], scene.material[j[c]]
        radius[c], modulus[c] = hertz_radius(scene, i[c], j[c]), laws.modulus[a, b]
        harmonic[c], share[c] = laws.harmonic[a, b], laws.share[a, b]
    return radius, modulus, harmonic, share


@dataclass(frozen=True)
class Spots:
    """Contacts that conduct.

    ``radius`` is a_c of the spot of the place [m], 0 where it bears no force; ``conductance`` is
    H_c [W/K]; both of shape ``(c,)``.
    """

    touching: Touching
    places: Places
    radius: Floats
    conductance: Floats


def forces_of_step(
    state: State, scene: Scene, carried: Floats, contacts: Contacts, touching: Touching,
    settings: HeatSettings, dt: float,
) -> Floats:  # fmt: skip
    """Normal forces that make the spots [N], shape ``(c,)``; keeps averages of ``state``, if used.

    An average counts the time without force, and ends when the pair leaves the reach of the contact
    solver, unless the grain has only rolled on to another piece of the same place. It is divided by
    1 − exp(−age/τ), the weight of the time that it knows. What is apart conducts nothing, whatever
    its average; where another piece of its place is touched, that has it. ``carried`` are the
    normal impulses of the contacts [N s].
    """
    i, j, points = touching.i, touching.j, touching.points
    if settings.force.kind == "prescribed":
        return settings.force.value * _shares(scene, touching, carried)
    if settings.force.kind == "step":
        return carried / dt
    of_pairs, touches = carried, (carried > 0.0) | (contacts["gap"] <= 0.0)
    if points is not None:  # averages are those of pairs, whichever points bear
        of_pairs = points.per_pair(carried)
        touches = points.per_pair(touches.astype(float)) > 0.0
    before = _averages(state, scene, i, j)
    mean: Floats = before + (of_pairs / dt - before) * -expm1(-dt / settings.force.value)
    kept = mean != 0.0  # nan stays, to be noticed
    state.mean_i, state.mean_j, state.mean_force = i[kept], j[kept], mean[kept]
    state.mean_age += dt
    places = Places.of(scene, i, j, touching.in_corners)
    apart = places.totals(np.where(touches, 0.0, mean)) / np.maximum(
        places.totals(touches.astype(float)), 1.0
    )
    force = np.where(touches, (mean + apart) / _known_weight(state, settings), 0.0)
    return force if points is None else points.shared(force, carried)


def _shares(scene: Scene, touching: Touching, carried: Floats) -> Floats:
    """Share of each contact in what its place carries, shape ``(c,)``; 0 where that is nothing."""
    total = touching.places(scene).totals(carried)
    return np.where(total > 0.0, carried / np.where(total > 0.0, total, 1.0), 0.0)


def _averages(state: State, scene: Scene, i: Ints, j: Ints) -> Floats:
    """Running averages of the forces of some pairs [N]; 0 for pairs without.

    Of pairs with several points the first has it.
    """
    return hand_on(
        scene, warm_rows(len(state.position), i), j, state.mean_i, state.mean_j, state.mean_force
    )


def _known_weight(state: State, settings: HeatSettings) -> float:
    """Weight of the time since the start of the averages: 1 − exp(−age/τ)."""
    return -expm1(-state.mean_age / settings.force.value)


def forces_at_rest(
    state: State, scene: Scene, touching: Touching, settings: HeatSettings
) -> Floats:
    """Forces (where kept, averaged) of the contacts that carried one in the last step [N].

    Where no step has been taken, the prescribed one of all that touch; without one, 0.
    """
    force, carried = settings.force, state.contact_impulse[:, NORMAL]
    if state.last_dt <= 0.0:
        value = force.value if force.kind == "prescribed" else 0.0
        return value * _shares(scene, touching, np.ones(touching.i.size))
    if force.kind == "average" and state.mean_age > 0.0:
        mean = _averages(state, scene, touching.i, touching.j) / _known_weight(state, settings)
        return mean if touching.points is None else touching.points.shared(mean, carried)
    if force.kind == "prescribed":
        return force.value * _shares(scene, touching, carried)
    return carried / state.last_dt


_SURELY = 1.0 - 1e-12

for _needed in (spot_conductance, spot_temperature):
    formula(_needed)


@kernel
def hottest_spot(
    scene: Scene, i: Ints, j: Ints, radius: Floats, modulus: Floats, force: Floats, power: Floats,
    rubbing: Floats, normal: Floats, temperature: Floats, laws: HeatLaws, hottest: float,
) -> float:  # fmt: skip
    """Temperature of the hottest spot [K], in which both bodies are alike; at least ``hottest``.

    Contacts (i, j) have a* and E* (`Touching`), ``force`` and ``power`` of friction in the place of
    each in this step [N, W]; the spot is that of Hertz, as `post hot-spots` has it, whatever force
    conduction takes. The sliding speed is ``rubbing`` [N m] over the impulse ``normal`` [N s].
    ``temperature`` is that of grains and wall shapes [K], ``(n + m,)``; nan of a wall that takes no
    heat, whose grain then counts alone.
    """
    for c in range(i.size):
        if power[c] <= 0.0 or normal[c] <= 0.0:
            continue
        first, second = temperature[i[c]], temperature[j[c]]
        a, b = scene.material[i[c]], scene.material[j[c]]
        takes_heat = not np.isnan(second)
        if not takes_heat:
            second = first
        conducts = laws.conductivity[b] if takes_heat else 0.0
        # A flash is largest at rest, P/(π a (λ_i + λ_j)), above the warmer body at most: without a
        # root most spots are known to be cooler
        least = pi * (laws.conductivity[a] + conducts) * (hottest - max(first, second))
        volume = contact_volume(force[c], radius[c], modulus[c])
        if (
            least > 0.0
            and power[c] * power[c] * power[c] < _SURELY * (least * least * least) * volume
        ):
            continue
        spot = spot_temperature(
            first, second, power[c], contact_radius(force[c], radius[c], modulus[c]),
            rubbing[c] / normal[c], laws.conductivity[a], laws.volumetric[a],
            conducts, laws.volumetric[b],
        )  # fmt: skip
        hottest = max(hottest, spot)
    return hottest


@parallel_kernel
def hertz_spots(
    force: Floats, radius: Floats, modulus: Floats, harmonic: Floats, spot: Floats,
    conductance: Floats,
) -> None:  # fmt: skip
    """Spots of smooth contacts under given normal forces [N], and their conductances.

    a*, E* and λ_h of the contacts as in `Touching`. **Modifies** ``spot``, radii a_c [m], and
    ``conductance`` H_c [W/K]; all of shape ``(c,)``.
    """
    count = force.size
    for chunk in prange((count + CHUNK - 1) // CHUNK):
        first, last = chunk * CHUNK, min(count, (chunk + 1) * CHUNK)
        for c in range(first, last):
            spot[c] = contact_volume(force[c], radius[c], modulus[c])
        cube_roots(spot[first:last])
        for c in range(first, last):
            conductance[c] = hertz_conductance(harmonic[c], spot[c])


@kernel
def roughen(
    force: Floats, radius: Floats, modulus: Floats, harmonic: Floats, roughness: Floats,
    slope: Floats, microhardness: Floats, spot: Floats, conductance: Floats,
) -> None:  # fmt: skip
    """Conductances of rough contacts with these spots; arguments as `hertz_spots`, `HeatLaws`."""
    for c in range(force.size):
        conductance[c] = rough_conductance(
            force[c], spot[c], modulus[c], radius[c], harmonic[c], roughness[c], slope[c],
            microhardness[c],
        )  # fmt: skip


def conducting_spots(
    scene: Scene, touching: Touching, force: Floats, settings: HeatSettings
) -> Spots:
    """Spots of contacts under given normal forces [N]; the contacts of a place have one spot."""
    radius, conductance = np.empty(force.size), np.empty(force.size)
    places, points = touching.places(scene), touching.points
    total, effective = places.totals(force), touching.radius
    if points is not None:
        effective = points.spot_radii(force, total)
    law = effective, touching.modulus, touching.harmonic
    hertz_spots(total, *law, radius, conductance)
    if touching.rough:
        roughen(total, *law, *touching.rough, radius, conductance)
    if points is not None and settings.conduction != "none":
        points.conduct_sides(force, total, touching.harmonic, touching.rough, radius, conductance)
    if settings.conduction == "none":
        conductance[:] = 0.0
    one = places.rows
    if one.size:  # a place has one spot, and its contacts share the conductance as the forces
        bears = force[one] > 0.0
        radius[one] = np.where(bears, radius[one], 0.0)
        conductance[one] *= np.where(bears, force[one] / np.where(bears, total[one], 1.0), 0.0)
    return Spots(touching, places, radius, conductance)
