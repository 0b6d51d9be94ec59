"""Contacts of grains that are no discs: a record for each point, with levers on both sides.

A pair that is a contact has room for the points that were near when contacts were last sought
(`engine/contact/selection.py`); a step fills as many as there are. A point is
known again by the corner at which it is and by the pieces, its `key`: so its impulse is where the
next solve begins, wherever the point stands in the table.

With σ by which spins are speeds (m σ²/I as for discs) a point of a grain moves with u_n = v·n + s
(l × n)/σ and u_t = v·t + s (l·n)/σ, s = σω, where l leads there from the center. What multiplies s
is the *turn* of a contact.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.contact.contacts import (
    Contacts,
    Speeds,
    contact_after,
    friction_between,
)
from multicor_cli.engine.contact.law import bias
from multicor_cli.engine.contact.vector_step import (
    FRICTION,
    IMPACT,
    LARGEST,
    LOADED,
    NEGATIVE,
    OVERLAP,
    SLIDING,
    VIRIAL,
)
from multicor_cli.engine.geometry.outlines import (
    Pieces,
    Point,
    pieces_met,
    touch_pieces,
    true_gap,
)
from multicor_cli.engine.geometry.radii import smaller_of
from multicor_cli.engine.geometry.scene import Scene
from multicor_cli.engine.jit.compile import kernel
from multicor_cli.model.columns import (
    BIAS,
    FIRST,
    MU,
    NORMAL,
    NX,
    NY,
    SECOND,
    SLIDE,
    SPIN,
    TANGENTIAL,
    W_NN,
    W_NT,
    W_TT,
    X,
    Y,
)
from multicor_cli.model.model import ContactLaws, Floats, Ints


class FacePairs(NamedTuple):
    """Pairs of which one is no disc, and the room that each has in the table of contacts.

    Attributes:
        first: First record of each pair, ascending, shape ``(f,)``.
        room: Number of its records, likewise.
    """

    first: Ints
    room: Ints

    @property
    def most(self) -> int:
        """Largest room of a pair."""
        return int(self.room.max(initial=0))


NO_FACES = FacePairs(np.empty(0, np.int32), np.empty(0, np.int32))


def make_room(pieces: Pieces, i: Ints, j: Ints, room: Ints) -> tuple[Ints, Ints, FacePairs]:
    """Pairs, sorted, with a row for each point that has room; and which of these rows are faces."""
    is_wall = j >= pieces.is_face.size
    is_face = pieces.is_face[i] | (~is_wall & pieces.is_face[np.where(is_wall, 0, j)])
    first = np.cumsum(room) - room
    faces = FacePairs(first[is_face].astype(np.int32), room[is_face].astype(np.int32))
    return np.repeat(i, room), np.repeat(j, room), faces


@kernel
def _key(pieces: Pieces, scene: Scene, i: int, a: int, j: int, b: int, corner: np.int64) -> int:
    """What tells a point from the others of its pair."""
    of_i = pieces.start[pieces.piece[i]]
    mine, met = pieces.piece[i + 1] - pieces.piece[i], 1
    is_wall, theirs = j >= scene.radius.size, 0
    if not is_wall:
        theirs, met = b - pieces.piece[j], pieces.piece[j + 1] - pieces.piece[j]
    if corner < pieces.start[pieces.piece[i + 1]] and corner >= of_i:
        return int(2 * ((corner - of_i) * met + theirs))
    local = corner - pieces.start[pieces.piece[j]]
    return int(2 * (local * mine + a - pieces.piece[i]) + 1)


# ---- The points of a step


@kernel
def _enter_point(
    c: int, point: Point, key: int, scene: Scene, pieces: Pieces, laws: ContactLaws,
    start: Floats, dt: float, contacts: Contacts,
) -> None:  # fmt: skip
    """Fill the record of a point but for its impulses."""
    contact = contacts[c]
    i, j, nx, ny, count = contact.i, contact.j, point.nx, point.ny, scene.radius.size
    over_i = 1.0 / pieces.spin[i]
    over_j = 1.0 / pieces.spin[j] if j < count else 1.0
    contact.nx, contact.ny, contact.gap, contact.key = nx, ny, point.gap, key
    contact.own_x, contact.own_y = point.i_x, point.i_y
    contact.lever_x, contact.lever_y = point.j_x, point.j_y
    contact.turn_in = (point.i_x * ny - point.i_y * nx) * over_i
    contact.turn_it = (point.i_x * nx + point.i_y * ny) * over_i
    contact.turn_jn = (point.j_x * ny - point.j_y * nx) * over_j
    contact.turn_jt = (point.j_x * nx + point.j_y * ny) * over_j
    if j < count:  # from center to center
        contact.lever_x += point.gap * nx - point.i_x
        contact.lever_y += point.gap * ny - point.i_y
    u_n, u_t = contact_after(c, scene, contacts, start)
    contact.u_n, contact.u_t = u_n, u_t
    contact.bias = bias(point.gap, u_n, laws.restitution[scene.material[i], scene.material[j]], dt)
    contact.mu = friction_between(scene, laws, i, j, abs(u_t))


@kernel
def begin_faces(
    scene: Scene, pieces: Pieces, laws: ContactLaws, start: Floats, dt: float, ratio: float,
    far: float, faces: FacePairs, most: int, contacts: Contacts,
) -> tuple[Speeds, bool]:  # fmt: skip
    """Find the points of pairs with a gap up to ``far`` [m], with impulses of those known before.

    Arguments as `begin_walls`; ``most`` is the largest room of a pair. A point that is new takes
    the impulse of one of its pair that is no more. **Modifies** ``contacts``. Also returns whether
    there was room for all.
    """
    known_key, known = np.empty(most, np.int64), np.empty((most, 2))
    squares, closing, slip, loaded, motion, met = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    has_room = True
    for f in range(faces.first.size):
        base, room = faces.first[f], faces.room[f]
        i, j = contacts[base].i, contacts[base].j
        for k in range(room):
            contact = contacts[base + k]
            known_key[k], known[k, NORMAL], known[k, TANGENTIAL] = (
                contact.key, ratio * contact.p_n, ratio * contact.p_t,
            )  # fmt: skip
            contact.p_n, contact.p_t, contact.gap, contact.key = 0.0, 0.0, inf, -1
        found = 0
        first, last = pieces_met(pieces, scene, j)
        for a in range(pieces.piece[i], pieces.piece[i + 1]):
            for b in range(first, last):
                for point in touch_pieces(pieces, scene, i, a, j, b):
                    if point.gap <= far and found == room:
                        has_room = False
                    elif point.gap <= far:
                        key = _key(pieces, scene, i, a, j, b, point.corner)
                        _enter_point(
                            base + found, point, key, scene, pieces, laws, start, dt, contacts
                        )
                        found += 1
        _hand_on(base, found, known_key[:room], known[:room], contacts)
        for k in range(found):
            contact = contacts[base + k]
            u_n, u_t = contact.u_n, contact.u_t
            if u_n < 0.0 and contact.gap + dt * u_n <= 0.0:
                squares += u_n * u_n
                closing += 1.0
            elif contact.p_n == 0.0:
                continue
            if contact.p_n > 0.0 and j < scene.radius.size:
                slip += abs(u_t)
                loaded += 1.0
            motion += sqrt(u_n * u_n + u_t * u_t)
            met += 1.0
    return Speeds(squares, closing, slip, loaded, motion, met), has_room


@kernel
def _hand_on(
    base: int, found: int, known_key: NDArray[np.int64], known: Floats, contacts: Contacts
) -> None:
    """Impulses to the points with the same keys; what is left over to the nearest that are new."""
    for k in range(known_key.size):
        if known[k, NORMAL] == 0.0:
            continue
        for c in range(base, base + found):
            if contacts[c].key == known_key[k]:
                contacts[c].p_n, contacts[c].p_t = known[k, NORMAL], known[k, TANGENTIAL] + 0.0
                known[k, NORMAL] = 0.0
    for k in range(known_key.size):
        if known[k, NORMAL] == 0.0:
            continue
        nearest = -1
        for c in range(base, base + found):
            if contacts[c].p_n == 0.0 and (nearest < 0 or contacts[c].gap < contacts[nearest].gap):
                nearest = c
        if nearest >= 0:
            contacts[nearest].p_n = known[k, NORMAL]
            contacts[nearest].p_t = known[k, TANGENTIAL] + 0.0


@kernel
def recall_points(
    known_i: Ints, known_j: Ints, known: Floats, key: Ints, faces: FacePairs, contacts: Contacts
) -> None:
    """Put the impulses that are known of faces, sorted, into any records of their pairs."""
    k = 0
    for f in range(faces.first.size):
        base, room = faces.first[f], faces.room[f]
        i, j = contacts[base].i, contacts[base].j
        while k < known_i.size and (known_i[k] < i or (known_i[k] == i and known_j[k] < j)):
            k += 1
        for c in range(base, base + room):
            contact = contacts[c]
            contact.p_n, contact.p_t, contact.key = 0.0, 0.0, -1
            if k < known_i.size and known_i[k] == i and known_j[k] == j:
                contact.p_n, contact.p_t = known[k, NORMAL], known[k, TANGENTIAL]
                contact.key = key[k]
                k += 1


# ---- To the arrays of the sweep and back


@kernel
def active_points(faces: FacePairs, contacts: Contacts) -> Ints:
    """Records of the points that there are."""
    found, which = 0, np.empty(contacts.size, np.int32)
    for f in range(faces.first.size):
        for c in range(faces.first[f], faces.first[f] + faces.room[f]):
            which[found] = c
            found += contacts[c].gap < inf
    return which[:found].copy()


@kernel
def pack_points(
    scene: Scene, contacts: Contacts, belt: Floats, place: Ints, points: Ints, inverse: Floats
) -> tuple[Ints, Floats, Floats, Floats]:
    """As `pack_general`, of the records ``points``."""
    n = scene.radius.size
    pair, impulse = np.empty((points.size, 2), np.int32), np.empty((points.size, 2))
    frame, lever = np.zeros((points.size, 8)), np.empty((points.size, 2, 2))
    for g in range(points.size):
        contact = contacts[points[g]]
        i, j, nx, ny = contact.i, contact.j, contact.nx, contact.ny
        pair[g, FIRST] = place[i]
        pair[g, SECOND] = place[j] if j < n else n + scene.wall[j - n]
        frame[g, NX], frame[g, NY] = nx, ny
        frame[g, BIAS], frame[g, MU] = contact.bias, contact.mu
        frame[g, SLIDE] = 0.0 if j < n else belt[scene.wall[j - n]]
        impulse[g, NORMAL], impulse[g, TANGENTIAL] = contact.p_n, contact.p_t
        lever[g, FIRST, NORMAL], lever[g, FIRST, TANGENTIAL] = contact.turn_in, contact.turn_it
        lever[g, SECOND, NORMAL], lever[g, SECOND, TANGENTIAL] = contact.turn_jn, contact.turn_jt
        for side in range(2):
            m, l_n, l_t = inverse[pair[g, side]], lever[g, side, NORMAL], lever[g, side, TANGENTIAL]
            frame[g, W_NN] += m[X] * (nx * nx) + m[Y] * (ny * ny) + m[SPIN] * (l_n * l_n)
            frame[g, W_NT] += (m[Y] - m[X]) * nx * ny + m[SPIN] * l_n * l_t
            frame[g, W_TT] += m[X] * (ny * ny) + m[Y] * (nx * nx) + m[SPIN] * (l_t * l_t)
    return pair, frame, lever, impulse


@kernel
def unpack_points(points: Ints, impulse: Floats, contacts: Contacts) -> None:
    """Impulses of the records ``points`` into the table, **modified**."""
    for g in range(points.size):
        contacts[points[g]].p_n = impulse[g, NORMAL]
        contacts[points[g]].p_t = impulse[g, TANGENTIAL]


# ---- What they lose and exert


@kernel
def account_faces(
    scene: Scene, end: Scene, pieces_end: Pieces, contacts: Contacts, after: Floats,
    faces: FacePairs, total: Floats, wall_impulse: Floats, belt_impulse: Floats,
) -> None:  # fmt: skip
    """As `account_contacts`, of faces; **modifies** what that returns."""
    for f in range(faces.first.size):
        base = faces.first[f]
        i, j = contacts[base].i, contacts[base].j
        gap = true_gap(end, pieces_end, i, j)[0]
        if gap < 0.0:
            total[OVERLAP] = max(total[OVERLAP], -gap / smaller_of(end, i, j))
        for c in range(base, base + faces.room[f]):
            contact = contacts[c]
            p_n, p_t = contact.p_n, contact.p_t
            if p_n == 0.0:
                continue
            nx, ny, lx, ly = contact.nx, contact.ny, contact.lever_x, contact.lever_y
            u_n, u_t = contact_after(c, scene, contacts, after)
            impact, friction = -p_n * 0.5 * (contact.u_n + u_n), -p_t * 0.5 * (contact.u_t + u_t)
            total[FRICTION] += friction
            total[IMPACT] += impact
            total[SLIDING] += contact.mu * abs(u_t) * p_n
            total[NEGATIVE] += min(0.0, friction + impact)
            total[LOADED] += 1.0
            total[LARGEST] = max(total[LARGEST], p_n)
            px, py = p_n * nx - p_t * ny, p_n * ny + p_t * nx
            if j < scene.radius.size:
                total[VIRIAL] += px * lx
                total[VIRIAL + 1] += px * ly
                total[VIRIAL + 2] += py * lx
                total[VIRIAL + 3] += py * ly
                continue
            wall = scene.wall[j - scene.radius.size]
            wall_impulse[wall, X] -= px
            wall_impulse[wall, Y] -= py
            wall_impulse[wall, SPIN] -= lx * py - ly * px
            belt_impulse[wall] -= p_t
