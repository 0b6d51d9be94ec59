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
    stretch_along,
)
from multicor_cli.engine.contact.face_sweep import (
    A_N,
    A_T,
    B_N,
    B_T,
    MINUS,
    PLUS,
    ROWS,
    Q,
    fill_inverse,
)
from multicor_cli.engine.contact.law import GRAZE, bias
from multicor_cli.engine.contact.ordering import make_batches
from multicor_cli.engine.contact.vector_sweep import PAIR_ROWS
from multicor_cli.engine.geometry.outlines import Point
from multicor_cli.engine.geometry.passing import fastest_points, touch_passing
from multicor_cli.engine.geometry.pieces import Pieces, pieces_met
from multicor_cli.engine.geometry.radii import smaller_of
from multicor_cli.engine.geometry.scene import Scene
from multicor_cli.engine.jit.arrays import aligned, copy_into
from multicor_cli.engine.jit.compile import inlined, kernel, subroutine
from multicor_cli.engine.jit.vectors import LANES
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
    SURFACE,
    TANGENTIAL,
    W_NN,
    W_NT,
    W_TT,
    X,
    Y,
)
from multicor_cli.model.model import ContactLaws, Floats, Ints

General = tuple[Ints, Floats, Floats, Floats]
"""Rows of contacts as `pack_general` fills them: bodies, frames, levers and impulses."""


class FacePairs(NamedTuple):
    """Pairs of which one is no disc, and the room that each has in the table of contacts.

    Attributes:
        first: First record of each pair, ascending, shape ``(f,)``.
        room: Number of its records, likewise.
        pair: Which of all pairs it is, likewise.
        i: Grain of each, likewise.
        j: Its other grain, or the wall shape.
    """

    first: Ints
    room: Ints
    pair: Ints
    i: Ints
    j: Ints

    @property
    def rows(self) -> NDArray[np.int64]:
        """All their records, ascending."""
        ends = np.cumsum(self.room)
        count = int(ends[-1]) if ends.size else 0
        return np.repeat(self.first - ends + self.room, self.room) + np.arange(count)


STEEP = 0.95
"""μ |W_nt|/W_nn from which on a point is relaxed by itself (`engine/contact/face_sweep.py`)."""

SUNK = 2.0 * GRAZE
"""Overlap over the smaller size, of two contacts one on the other, with which a corner ahead is
passed and not hit: what stands on a floor and what slides over it have each sunk a little."""

OPEN = 1e300
"""Bias of rows without a point: none ever closes [m/s]."""

_NONE = np.empty(0, np.int32)
STRUCK = 1.5
"""Speed up to which a pair may close once it is struck, over the rms of all pairs: in large flows
some do in every third step, in which all are solved once more if their points did not count."""

NO_FACES = FacePairs(_NONE, _NONE, _NONE, _NONE, _NONE)


def rows_of_faces(is_face: NDArray[np.bool_], i: Ints, j: Ints) -> NDArray[np.bool_]:
    """Which pairs have a grain that is no disc, shape ``(c,)``; ``is_face`` of all grains."""
    is_grain = j < is_face.size
    return np.asarray(is_face[i] | (is_grain & is_face[np.where(is_grain, j, 0)]))


def make_room(pieces: Pieces, i: Ints, j: Ints, room: Ints) -> tuple[Ints, Ints, FacePairs]:
    """Pairs, sorted, with a row for each point that has room; and which of these rows are faces."""
    is_face = rows_of_faces(pieces.is_face, i, j)
    first = np.cumsum(room) - room
    faces = FacePairs(
        first[is_face].astype(np.int32), room[is_face].astype(np.int32),
        np.flatnonzero(is_face).astype(np.int32), i[is_face], j[is_face],
    )  # fmt: skip
    return np.repeat(i, room), np.repeat(j, room), faces


@inlined
def point_key(
    pieces: Pieces, scene: Scene, i: int, a: int, j: int, b: int, corner: np.int64
) -> int:
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


@subroutine
def pieces_of_key(pieces: Pieces, scene: Scene, i: int, j: int, key: int) -> tuple[int, int, int]:
    """The pieces of i and j that a point is of, and its corner: what `point_key` was made of."""
    mine, is_wall = pieces.piece[i + 1] - pieces.piece[i], j >= scene.radius.size
    met = 1 if is_wall else pieces.piece[j + 1] - pieces.piece[j]
    if key % 2 == 0:
        corner = pieces.start[pieces.piece[i]] + key // 2 // met
        return _piece_with(pieces, i, corner), pieces.piece[j] + key // 2 % met, corner
    corner = pieces.start[pieces.piece[j]] + key // 2 // mine
    return pieces.piece[i] + key // 2 % mine, _piece_with(pieces, j, corner), corner


@subroutine
def _piece_with(pieces: Pieces, body: int, corner: int) -> int:
    """The piece of a grain or wall shape that has this corner."""
    p = pieces.piece[body]
    while pieces.start[p + 1] <= corner:
        p += 1
    return int(p)


# ---- The points of a step


@inlined
def _enter_point(
    c: int, point: Point, key: int, scene: Scene, pieces: Pieces, laws: ContactLaws,
    start: Floats, dt: float, stopped: NDArray[np.bool_], contacts: Contacts,
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
    restitution = laws.restitution[scene.material[i], scene.material[j]]
    if stopped[i] and (j >= count or stopped[j]):
        restitution = 0.0
    contact.bias = bias(point.gap, u_n, restitution, dt)
    contact.mu = friction_between(scene, laws, i, j, abs(u_t))


@kernel
def _fastest_of(
    scene: Scene, pieces: Pieces, start: Floats, free: Floats, faces: FacePairs
) -> tuple[Floats, float]:
    """No points of a pair approach faster with either velocities [m/s], ``(f,)``; and the rms."""
    speed, squares = np.empty(faces.first.size), 0.0
    for f in range(faces.first.size):
        i, j = faces.i[f], faces.j[f]
        speed[f] = max(
            fastest_points(scene, pieces, start, i, j), fastest_points(scene, pieces, free, i, j)
        )
        squares += speed[f] * speed[f]
    return speed, sqrt(squares / speed.size)


@kernel
def begin_faces(
    scene: Scene, pieces: Pieces, laws: ContactLaws, start: Floats, free: Floats, dt: float,
    ratio: float, least: float, ahead: float, faces: FacePairs, stopped: NDArray[np.bool_],
    contacts: Contacts,
) -> tuple[Speeds, float, Floats]:  # fmt: skip
    """Find the points of pairs that may close, with impulses of those known before.

    Arguments as `begin_walls`. Points count up to a gap of ``least`` [m], up to what the pair
    closes within the time ``ahead`` [s] with its velocities ``start`` or ``free``, and up to what
    it may close once it is struck. A point that is new takes the impulse of one of its pair that is
    no more. Points of grains that are ``stopped``, shape ``(n,)``, do not rebound
    (`stop_rebounds`). **Modifies** ``contacts``. Also returns the gap up to which there should have
    been room [m], 0 if there was room for all, and the smallest gap of each pair that did not
    count, shape ``(f,)``.
    """
    most = 0
    for room in faces.room:
        most = max(most, room)
    known_key, known = np.empty(most, np.int64), np.empty((most, 2))
    squares, closing, shear, loaded, motion, met = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    lacking, beyond = 0.0, np.empty(faces.first.size)
    speed, rms = _fastest_of(scene, pieces, start, free, faces)
    least = max(least, STRUCK * dt * rms)
    for f in range(faces.first.size):
        base, far = faces.first[f], max(least, ahead * speed[f])
        found, beyond[f], is_full = _fill_pair(
            f, far, scene, pieces, laws, start, dt, ratio, faces, stopped, known_key, known,
            contacts,
        )  # fmt: skip
        lacking = max(lacking, far) if is_full else lacking
        for k in range(found):
            contact = contacts[base + k]
            u_n, u_t = contact.u_n, contact.u_t
            if u_n < 0.0 and contact.gap + dt * u_n <= 0.0:
                squares += u_n * u_n
                closing += 1.0
            elif contact.p_n == 0.0:
                continue
            if contact.p_n > 0.0 and contact.j < scene.radius.size:
                shear += abs(u_t)
                loaded += 1.0
            motion += sqrt(u_n * u_n + u_t * u_t)
            met += 1.0
    return Speeds(squares, closing, shear, loaded, motion, met), lacking, beyond


@inlined
def _fill_pair(
    f: int, far: float, scene: Scene, pieces: Pieces, laws: ContactLaws, start: Floats, dt: float,
    ratio: float, faces: FacePairs, stopped: NDArray[np.bool_], known_key: NDArray[np.int64],
    known: Floats, contacts: Contacts,
) -> tuple[int, float, bool]:  # fmt: skip
    """Fill the records of a pair with its points up to a gap of ``far`` [m].

    Returns how many there are, the gap of the nearest one that did not count [m], and whether room
    was lacking. ``known_key`` and ``known`` are work space for the room of a pair.
    """
    base, room, i, j = faces.first[f], faces.room[f], faces.i[f], faces.j[f]
    for k in range(room):
        contact = contacts[base + k]
        known_key[k], known[k, NORMAL] = contact.key, ratio * contact.p_n
        known[k, TANGENTIAL] = ratio * contact.p_t
        contact.p_n, contact.p_t, contact.gap, contact.key = 0.0, 0.0, inf, -1
    found, beyond, is_full = 0, inf, False
    first, last = pieces_met(pieces, scene, j)
    graze = SUNK * smaller_of(scene, i, j)
    for a in range(pieces.piece[i], pieces.piece[i + 1]):
        for b in range(first, last):
            for point in touch_passing(pieces, scene, i, a, j, b, start, dt, graze):
                if point.gap > far:
                    beyond = min(beyond, point.gap)
                elif found == room:
                    is_full = True
                else:
                    key = point_key(pieces, scene, i, a, j, b, point.corner)
                    _enter_point(
                        base + found, point, key, scene, pieces, laws, start, dt, stopped, contacts
                    )
                    found += 1
    _hand_on(base, found, room, known_key, known, contacts)
    return found, beyond, is_full


@kernel
def stop_rebounds(
    scene: Scene, pieces: Pieces, start: Floats, free: Floats, after: Floats, mass: Floats,
    faces: FacePairs, contacts: Contacts, stopped: NDArray[np.bool_],
) -> bool:  # fmt: skip
    """Mark the grains of pairs whose points made more energy than any pair has that meets.

    Newton's law makes energy where friction wedges what rebounds (theory §3.4), without bounds
    where it nearly locks. Solved with ``start`` velocities v⁻ to v⁺ ``after``; ``mass`` are those
    of the grains [kg]. Returns whether there are such grains among those that were not marked in
    ``stopped``, **modified**, shape ``(n,)``.
    """
    count, most, made = scene.radius.size, 0.0, np.zeros(faces.first.size)
    speed, _ = _fastest_of(scene, pieces, start, free, faces)
    for f in range(faces.first.size):
        i, j = faces.i[f], faces.j[f]
        reduced = mass[i] * mass[j] / (mass[i] + mass[j]) if j < count else mass[i]
        most = max(most, 0.5 * reduced * speed[f] * speed[f])
        for c in range(faces.first[f], faces.first[f] + faces.room[f]):
            contact = contacts[c]
            if contact.gap < inf and contact.p_n > 0.0:
                u_n, u_t = contact_after(c, scene, contacts, after)
                made[f] += 0.5 * contact.p_n * (contact.u_n + u_n)
                made[f] += 0.5 * contact.p_t * (contact.u_t + u_t)
    is_new = False
    for f in range(faces.first.size):
        i, j = faces.i[f], faces.j[f]
        if made[f] > most and not (stopped[i] and (j >= count or stopped[j])):
            is_new = stopped[i] = True
            if j < count:
                stopped[j] = True
    return is_new


@kernel
def closed_beyond(
    scene: Scene, pieces: Pieces, start: Floats, after: Floats, dt: float, faces: FacePairs,
    beyond: Floats,
) -> float:  # fmt: skip
    """Largest gap of a point that did not count and closes in a step with v⁺ [m]; 0 if none does.

    ``start`` are velocities v⁻, ``beyond`` is as from `begin_faces`.
    """
    largest = 0.0
    for f in range(beyond.size):
        i, j = faces.i[f], faces.j[f]
        if beyond[f] == inf or beyond[f] > dt * fastest_points(scene, pieces, after, i, j):
            continue
        first, last = pieces_met(pieces, scene, j)
        graze = SUNK * smaller_of(scene, i, j)
        for a in range(pieces.piece[i], pieces.piece[i + 1]):
            for b in range(first, last):
                for point in touch_passing(pieces, scene, i, a, j, b, start, dt, graze):
                    if beyond[f] <= point.gap < inf and point.gap > largest:
                        u_n = _fastest_approach(point, scene, pieces, after, i, j)
                        largest = point.gap if point.gap + dt * u_n <= 0.0 else largest
    return largest


@subroutine
def _fastest_approach(
    point: Point, scene: Scene, pieces: Pieces, velocity: Floats, i: int, j: int
) -> float:
    """A bound on u_n of two convex pieces [m/s]: their gap falls no faster than this says.

    On a straight way their gap is convex; what turns brings them nearer by no more than its way.
    """
    count, nx, ny = scene.radius.size, point.nx, point.ny
    if j >= count:
        return -fastest_points(scene, pieces, velocity, i, j)
    u_n = (velocity[i, X] - velocity[j, X]) * nx + (velocity[i, Y] - velocity[j, Y]) * ny
    if scene.height > 0.0:
        lx = point.j_x + point.gap * nx - point.i_x
        ly = point.j_y + point.gap * ny - point.i_y
        u_n += stretch_along(velocity, count, lx, ly, nx, ny)[0]
    u_n -= abs(velocity[i, SURFACE] / pieces.spin[i]) * scene.radius[i]
    return float(u_n - abs(velocity[j, SURFACE] / pieces.spin[j]) * scene.radius[j])


@inlined
def _hand_on(
    base: int, found: int, room: int, known_key: NDArray[np.int64], known: Floats,
    contacts: Contacts,
) -> None:  # fmt: skip
    """Impulses to the points with the same keys; what is left over to the nearest that are new."""
    for k in range(room):
        if known[k, NORMAL] == 0.0:
            continue
        for c in range(base, base + found):
            if contacts[c].key == known_key[k]:
                contacts[c].p_n, contacts[c].p_t = known[k, NORMAL], known[k, TANGENTIAL] + 0.0
                known[k, NORMAL] = 0.0
    for k in range(room):
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
        base, room, i, j = faces.first[f], faces.room[f], faces.i[f], faces.j[f]
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


@inlined
def pack_row(
    g: int, c: int, scene: Scene, contacts: Contacts, belt: Floats, place: Ints, inverse: Floats,
    pair: Ints, frame: Floats, lever: Floats, impulse: Floats,
) -> None:  # fmt: skip
    """The record c of a contact, with its turns, into the row g; as `pack_general`."""
    n, contact = scene.radius.size, contacts[c]
    i, j, nx, ny = contact.i, contact.j, contact.nx, contact.ny
    pair[g, FIRST] = place[i]
    pair[g, SECOND] = place[j] if j < n else n + scene.wall[j - n]
    frame[g, NX], frame[g, NY] = nx, ny
    frame[g, BIAS], frame[g, MU] = contact.bias, contact.mu
    frame[g, SLIDE] = 0.0 if j < n else belt[scene.wall[j - n]]
    impulse[g, NORMAL], impulse[g, TANGENTIAL] = contact.p_n, contact.p_t
    lever[g, FIRST, NORMAL], lever[g, FIRST, TANGENTIAL] = contact.turn_in, contact.turn_it
    lever[g, SECOND, NORMAL], lever[g, SECOND, TANGENTIAL] = contact.turn_jn, contact.turn_jt
    frame[g, W_NN] = frame[g, W_NT] = frame[g, W_TT] = 0.0
    for side in range(2):
        body, l_n, l_t = pair[g, side], lever[g, side, NORMAL], lever[g, side, TANGENTIAL]
        m_x, m_y, m_s = inverse[body, X], inverse[body, Y], inverse[body, SPIN]
        frame[g, W_NN] += m_x * (nx * nx) + m_y * (ny * ny) + m_s * (l_n * l_n)
        frame[g, W_NT] += (m_y - m_x) * nx * ny + m_s * l_n * l_t
        frame[g, W_TT] += m_x * (ny * ny) + m_y * (nx * nx) + m_s * (l_t * l_t)


@kernel
def batch_points(
    contacts: Contacts, order: Ints, bodies: Ints, tile_start: NDArray[np.int64], rows: int
) -> tuple[Ints, NDArray[np.int64]]:
    """As `make_batches`, of those records ``order`` that have a point; slots hold records.

    ``bodies`` are rows of the bodies of ``order``, of which there are ``rows``.
    """
    record, start = np.empty(order.size, np.int32), np.zeros(tile_start.size, np.int64)
    pair, found = np.empty((order.size, 2), np.int32), 0
    for t in range(tile_start.size - 1):
        for k in range(tile_start[t], tile_start[t + 1]):
            if contacts[order[k]].gap < inf:
                record[found] = order[k]
                pair[found, FIRST], pair[found, SECOND] = bodies[k, FIRST], bodies[k, SECOND]
                found += 1
        start[t + 1] = found
    slot, batch_start = make_batches(pair[:found], start, rows)
    for q in range(slot.shape[0]):
        for lane in range(LANES):
            if slot[q, lane] >= 0:
                slot[q, lane] = record[slot[q, lane]]
    return slot, batch_start


@kernel
def pack_faces(
    scene: Scene, contacts: Contacts, belt: Floats, place: Ints, slot: Ints, rest: Ints,
    tile_start: NDArray[np.int64], inverse: Floats, others: General, block_pair: Ints,
    block: Floats,
) -> tuple[Ints, General]:  # fmt: skip
    """Points behind the ``others``: those that go one by one, and then the lanes of ``slot``.

    One by one go the points among the records ``rest``, and steep ones. Returns the records, -1
    where there is no point, and all rows as `pack_general`. **Modifies** ``block_pair`` and
    ``block``, ``slot`` has the shape ``(q, 4)``.
    """
    # How many are steep is known at the end: their rows are put in front of the lanes then.
    rows, front = slot.size, others[0].shape[0] + rest.size + slot.size
    pair, impulse = np.empty((front + rows, 2), np.int32), np.empty((front + rows, 2))
    frame, lever = np.empty((front + rows, 8)), np.empty((front + rows, 2, 2))
    record, alone = np.full(rows, -1, np.int32), np.empty(rows + rest.size, np.int32)
    found = 0
    for c in rest:
        alone[found] = c
        found += contacts[c].gap < inf
    for t in range(tile_start.size - 1):
        first, second = 0, 0  # bodies of the tile, for lanes without a contact
        for lane in range(LANES * tile_start[t], LANES * tile_start[t + 1]):
            c, g = slot[lane // LANES, lane % LANES], front + lane
            if c >= 0:
                pack_row(g, c, scene, contacts, belt, place, inverse, pair, frame, lever, impulse)
                first, second = pair[g, FIRST], pair[g, SECOND]
                if frame[g, MU] * abs(frame[g, W_NT]) >= STEEP * frame[g, W_NN]:
                    alone[found] = c
                    found += 1
                else:
                    record[lane] = c
            if record[lane] < 0:
                pair[g, FIRST], pair[g, SECOND] = first, second
                frame[g], lever[g], impulse[g] = 0.0, 0.0, 0.0
                frame[g, BIAS], frame[g, W_NN], frame[g, W_TT] = OPEN, 1.0, 1.0
            _fill_block(lane, g, pair, frame, lever, record[lane] >= 0, block_pair, block)
    begin = front - found
    for k in range(found):
        pack_row(
            begin + k, alone[k], scene, contacts, belt, place, inverse, pair, frame, lever, impulse
        )
    begin -= others[0].shape[0]
    copy_into(pair[begin:].reshape(-1), others[0].reshape(-1))
    copy_into(frame[begin:].reshape(-1), others[1].reshape(-1))
    copy_into(lever[begin:].reshape(-1), others[2].reshape(-1))
    copy_into(impulse[begin:].reshape(-1), others[3].reshape(-1))
    points = np.concatenate((alone[:found], record))
    return points, (pair[begin:], frame[begin:], lever[begin:], impulse[begin:])


@inlined
def _fill_block(
    place: int, g: int, pair: Ints, frame: Floats, lever: Floats, is_there: bool, block_pair: Ints,
    block: Floats,
) -> None:  # fmt: skip
    q, lane = place // LANES, place % LANES
    for side in range(2):
        block_pair[q, side, lane] = 4 * pair[g, side]
    for row in range(8):
        block[q, row, lane] = frame[g, row]
    block[q, A_N, lane], block[q, A_T, lane] = lever[g, FIRST, NORMAL], lever[g, FIRST, TANGENTIAL]
    block[q, B_N, lane], block[q, B_T, lane] = (
        lever[g, SECOND, NORMAL], lever[g, SECOND, TANGENTIAL],
    )  # fmt: skip
    fill_inverse(q, lane, g, frame, is_there, block)
    steep = frame[g, W_NT] / frame[g, W_NN]
    block[q, Q, lane] = steep
    block[q, PLUS, lane] = 1.0 / (1.0 + frame[g, MU] * steep)
    block[q, MINUS, lane] = 1.0 / (1.0 - frame[g, MU] * steep)


@kernel
def carried_points(
    i: Ints, j: Ints, lane: Ints, impulse: Floats, contacts: Contacts
) -> tuple[Ints, Ints, Floats, Ints]:
    """As `carried`, with the keys of the points."""
    found = 0
    first, second = np.empty(i.size, np.int32), np.empty(i.size, np.int32)
    known, key = np.empty((i.size, 2)), np.empty(i.size, np.int32)
    for c in range(i.size):
        p_n, p_t = contacts[c].p_n, contacts[c].p_t
        if lane[c] >= 0:
            q, column = lane[c] // LANES, lane[c] % LANES
            p_n, p_t = impulse[q, NORMAL, column], impulse[q, TANGENTIAL, column]
        first[found], second[found], key[found] = i[c], j[c], contacts[c].key
        known[found, NORMAL], known[found, TANGENTIAL] = p_n, p_t
        found += p_n > 0.0
    return first[:found].copy(), second[:found].copy(), known[:found].copy(), key[:found].copy()


@kernel
def unpack_points(points: Ints, impulse: Floats, contacts: Contacts) -> None:
    """Impulses of the records ``points`` into the table, **modified**; -1: of none."""
    for g in range(points.size):
        if points[g] < 0:
            continue
        contacts[points[g]].p_n = impulse[g, NORMAL]
        contacts[points[g]].p_t = impulse[g, TANGENTIAL]


def blocks_for(batches: int) -> tuple[Ints, Floats]:
    """Room for the pairs and blocks of so many batches, at cache lines."""
    pair = aligned((batches, PAIR_ROWS, LANES), np.int32)
    return pair, aligned((batches, ROWS, LANES))
