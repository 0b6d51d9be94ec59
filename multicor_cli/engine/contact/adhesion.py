"""Adhesion: near bodies attract each other with a force of the gap between them (theory §3.1).

The force F is known before a step is solved. It is given to the free velocities, and the solver
looks for q_n = p_n + F Δt, for which the law is that of Signorini and Coulomb: no sweep knows of
it. In a contact `p_n` holds q_n and `attraction` F Δt; the impulse of one body on the other is
their difference.

A place has one force: of the pieces of walls that a grain has near it in one place
(`engine/geometry/places.py`) the nearest attracts, and equally near ones divide the force. Of
grains that are no discs each point has it: sides that lie on each other hold at both ends.
"""

from __future__ import annotations

from math import inf

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.contact.contacts import Contacts
from multicor_cli.engine.contact.faces import FacePairs, pieces_of_key, rows_of_faces
from multicor_cli.engine.geometry.outlines import LEAN, true_gap
from multicor_cli.engine.geometry.pieces import Pieces, are_faces
from multicor_cli.engine.geometry.places import RISE, find_places, met_before, totals_of_places
from multicor_cli.engine.geometry.scene import Scene, known_geometry
from multicor_cli.engine.jit.compile import kernel, subroutine
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.model.columns import INVERSE_MASS, NORMAL, SPIN, SURFACE, XX, XY, YY, X, Y
from multicor_cli.model.model import ContactLaws, Floats, Ints
from multicor_cli.model.outlines import Outlines

TOUCHING = 1e-9
"""Largest gap, over the radius, of bodies that touch as far as rounded positions tell."""

_STILL = 1e-6
"""Change of a gap in a step, over the range, below which it is not resolved by differences."""

# ---- The force of a pair


@formula
def work_of_parting(gap: float, reach: float, is_wet: bool) -> float:
    """What adhesion costs from contact to a gap, over F_a [m]; less than 0 for overlaps.

    Between grains and in bridges of liquid, theory §3.1. ``reach`` is the range ℓ [m].
    """
    way = gap if gap < reach else reach
    return way if is_wet or way <= 0.0 else way - 0.5 * way * way / reach


@formula
def share_of_force(first: float, last: float, reach: float, is_wet: bool) -> float:
    """Mean of F/F_a while a gap goes evenly from ``first`` to ``last`` [m].

    What the work of the force is over the way, so that a step that crosses the range, or the end
    of it, pays neither too much nor too little.
    """
    way = last - first
    if abs(way) > _STILL * reach:
        return (work_of_parting(last, reach, is_wet) - work_of_parting(first, reach, is_wet)) / way
    gap = 0.5 * (first + last)
    if gap >= reach:
        return 0.0
    return 1.0 if is_wet or gap <= 0.0 else 1.0 - gap / reach


# ---- The contacts of a step


@subroutine
def _share_points(
    scene: Scene, pieces: Pieces, contacts: Contacts, faces: FacePairs, share: Floats
) -> None:
    """Share of points of grains that are no discs, into how many pieces a wall may be cut.

    Where pieces of walls join they divide one, and where they join under a side there is none: it
    holds at its ends. **Modifies** ``share``.
    """
    first = 0
    for f in range(faces.first.size):
        if faces.i[first] != faces.i[f]:
            first = f
        last = f + 1
        while last < faces.i.size and faces.i[last] == faces.i[f]:
            last += 1
        for c in range(faces.first[f], faces.first[f] + faces.room[f]):
            share[c] = 1.0
            if faces.j[f] >= scene.radius.size and contacts[c].gap < inf:
                share[c] = _share_among(
                    c, faces.first[first], faces.first[last - 1] + faces.room[last - 1], scene,
                    pieces, contacts,
                )  # fmt: skip


@subroutine
def _share_among(
    c: int, start: int, end: int, scene: Scene, pieces: Pieces, contacts: Contacts
) -> float:
    """Share of a point of a wall among all points ``start … end-1`` of its grain."""
    one, there, is_before, is_after = contacts[c], 0, False, False
    near = TOUCHING * scene.radius[one.i]
    mine = pieces_of_key(pieces, scene, one.i, one.j, one.key)[0]
    for k in range(start, end):
        other = contacts[k]
        if other.j < scene.radius.size or other.gap == inf:
            continue
        x, y = other.own_x - one.own_x, other.own_y - one.own_y
        cosine = other.nx * one.nx + other.ny * one.ny
        along = y * one.nx - x * one.ny
        is_level = other.gap - one.gap <= near + LEAN * abs(along)  # not over a ledge behind it
        # Sides that meet at a corner are places of their own, as for discs
        there += is_level and abs(x) + abs(y) <= near and cosine >= 1.0 - RISE
        is_along = cosine > 0.0 and abs(other.nx * one.ny - other.ny * one.nx) < LEAN
        theirs = pieces_of_key(pieces, scene, other.i, other.j, other.key)[0]
        if is_along and is_level and theirs == mine:
            is_before, is_after = is_before or along < -near, is_after or along > near
    return 0.0 if is_before and is_after else 1.0 / there


@kernel
def _nearest_pieces(scene: Scene, contacts: Contacts, i: Ints, j: Ints) -> Floats:
    """Share of each contact in the force of its place: 0 where another piece is nearer."""
    place, _ = find_places(scene, i, j)
    least, is_nearest = np.full(i.size, inf), np.zeros(i.size)
    for c in range(i.size):
        least[place[c]] = min(least[place[c]], contacts[c].gap)
    for c in range(i.size):
        if contacts[c].gap <= least[place[c]] + TOUCHING * scene.radius[i[c]]:
            is_nearest[c] = 1.0
    among = totals_of_places(place, is_nearest)
    for c in range(i.size):
        is_nearest[c] /= max(1.0, among[c])
    return is_nearest


@kernel
def begin_attraction(
    scene: Scene, pieces: Pieces | None, laws: ContactLaws, contacts: Contacts, i: Ints, j: Ints,
    bodies: Floats, bridge_row: NDArray[np.int64], bridge_j: Ints, dt: float, faces: FacePairs,
    is_cold: bool,
) -> None:  # fmt: skip
    """F Δt into all contacts [N s], the mean over the way that a pair goes with u_n⁻ in the step.

    Dry pairs attract each other within the range, wet ones where they touch, now or at the start
    of the step, or have a bridge, ``bridge_j[bridge_row[i]:bridge_row[i + 1]]`` of grain i. What
    comes to touch, or touches where no impulses are known (``is_cold``), starts with p = 0; what
    touched before and carried q = 0 goes on with that, or nothing would ever rest.

    ``i`` and ``j`` are the shapes of ``contacts``, which are **modified**; ``bodies`` hold
    velocities and inverse masses, shape ``(bodies, 4)``.
    """
    count = scene.radius.size
    share = _nearest_pieces(scene, contacts, i, j)
    if pieces is not None:
        _share_points(scene, pieces, contacts, faces, share)
    has_bridge = met_before(scene, bridge_row, bridge_j, i, j)
    for c in range(contacts.size):
        contact = contacts[c]
        contact.attraction = 0.0
        a, b = scene.material[i[c]], scene.material[j[c]]
        gap, reach, is_wet = contact.gap, laws.adhesion_range[a, b], laws.is_wet[a, b] > 0
        if share[c] == 0.0 or laws.adhesion[a, b] == 0.0 or gap == inf:
            continue
        half = 0.5 * dt * contact.u_n
        if is_wet:
            touch = TOUCHING * scene.radius[i[c]]
            if not (has_bridge[c] or gap <= touch or gap - half <= touch):
                continue
        elif gap > reach:
            continue
        mean = share_of_force(gap - half, gap + half, reach, is_wet)
        contact.attraction = dt * laws.adhesion[a, b] * mean * share[c]
        w = bodies[i[c], INVERSE_MASS] + (bodies[j[c], INVERSE_MASS] if j[c] < count else 0.0)
        room = dt * contact.attraction * w
        if contact.p_n == 0.0 and gap <= room and (is_cold or gap - dt * contact.u_n > room):
            contact.p_n = contact.attraction


def longest_reach(laws: ContactLaws) -> float:
    """No pair attracts each other across a larger gap [m]; 0 if no materials have adhesion."""
    return float(laws.adhesion_range[laws.adhesion > 0.0].max()) if laws.adhesion.size else 0.0


@kernel
def attract(
    scene: Scene, contacts: Contacts, place: Ints, wall_inverse: Floats, spin_factor: float,
    velocity: Floats,
) -> None:  # fmt: skip
    """Let adhesion act on free velocities, rows as in `System`, **modified**."""
    count = scene.radius.size
    for c in range(contacts.size):
        contact = contacts[c]
        if contact.attraction == 0.0:
            continue
        i, j = place[contact.i], contact.j
        px, py = contact.attraction * contact.nx, contact.attraction * contact.ny
        velocity[i, X] -= velocity[i, INVERSE_MASS] * px
        velocity[i, Y] -= velocity[i, INVERSE_MASS] * py
        is_point = contact.key >= 0
        if is_point:
            couple = spin_factor * contact.attraction * contact.turn_in
            velocity[i, SURFACE] -= velocity[i, INVERSE_MASS] * couple
        if j < count:
            row = place[j]
            velocity[row, X] += velocity[row, INVERSE_MASS] * px
            velocity[row, Y] += velocity[row, INVERSE_MASS] * py
            if is_point:
                couple = spin_factor * contact.attraction * contact.turn_jn
                velocity[row, SURFACE] += velocity[row, INVERSE_MASS] * couple
            if scene.height > 0.0:
                velocity[count, XX] -= wall_inverse[0, XX] * px * contact.lever_x
                velocity[count, YY] -= wall_inverse[0, YY] * py * contact.lever_y
                velocity[count, XY] -= wall_inverse[0, XY] * px * contact.lever_y
        else:
            wall = scene.wall[j - count]
            velocity[count + wall, X] += wall_inverse[wall, X] * px
            velocity[count + wall, Y] += wall_inverse[wall, Y] * py
            torque = contact.lever_x * py - contact.lever_y * px
            velocity[count + wall, SURFACE] += wall_inverse[wall, SPIN] * torque


# ---- The bridges that a step leaves


@subroutine
def _gap_after(end: Scene, pieces: Pieces | None, i: int, j: int) -> float:
    """Gap of a pair that has met [m]."""
    if pieces is not None and are_faces(pieces, i, j):
        return true_gap(end, pieces, i, j)[0]
    return known_geometry(end, i, j)[0]


@kernel
def bridges_after(
    end: Scene, pieces: Pieces | None, laws: ContactLaws, contacts: Contacts
) -> tuple[Ints, Ints]:
    """Wet pairs with a bridge after a step, ascending: they touched in it or had one, and their
    gap in the scene at its end is within the range; ``pieces`` as they lie there.
    """
    first, second = np.empty(contacts.size, np.int32), np.empty(contacts.size, np.int32)
    found = 0
    for c in range(contacts.size):
        contact = contacts[c]
        a, b = end.material[contact.i], end.material[contact.j]
        if laws.is_wet[a, b] == 0 or not (contact.attraction > 0.0 or contact.p_n > 0.0):
            continue
        if found and first[found - 1] == contact.i and second[found - 1] == contact.j:
            continue  # by another of its points
        if _gap_after(end, pieces, contact.i, contact.j) <= laws.adhesion_range[a, b]:
            first[found], second[found] = contact.i, contact.j
            found += 1
    return first[:found].copy(), second[:found].copy()


# ---- What impulses are without it


def net_impulses(reaction: Floats, attraction: Floats) -> Floats:
    """p_n, p_t from q and F Δt, which may be of size 0 [N s], shape ``(c, 2)``."""
    if not attraction.size:
        return reaction
    net = reaction.copy()
    net[:, NORMAL] -= attraction
    return net


@kernel
def _shares_at_rest(
    scene: Scene, laws: ContactLaws, i: Ints, j: Ints, is_point: NDArray[np.bool_]
) -> Floats:
    found = np.empty(i.size)
    for c in range(i.size):
        a, b = scene.material[i[c]], scene.material[j[c]]
        gap = 0.0 if is_point[c] else known_geometry(scene, i[c], j[c])[0]
        is_wet = laws.is_wet[a, b] > 0
        found[c] = laws.adhesion[a, b] * share_of_force(gap, gap, laws.adhesion_range[a, b], is_wet)
    return found


def resting_attraction(
    laws: ContactLaws, scene: Scene, i: Ints, j: Ints, dt: float, outlines: Outlines | None
) -> Floats:
    """F Δt of contacts known to touch [N s], shape ``(c,)``; of size 0 without any adhesion."""
    if not laws.adhesion.size:
        return np.empty(0)
    sharing = totals_of_places(find_places(scene, i, j)[0], np.ones(i.size))
    is_point = np.zeros(i.size, np.bool_)
    if outlines is not None:
        is_point = rows_of_faces(~outlines.is_disc, i, j)
        sharing[is_point] = 1.0
    return dt * _shares_at_rest(scene, laws, i, j, is_point) / sharing
