"""Many overlaps at once: the smallest displacements, in the metric of the masses, that end them.

min ½ Σ m δq² with gap + n·δq ≥ −target for all near pairs is a convex problem, a contact problem
without friction whose velocities are displacements; it is solved by accelerated sweeps, with the
walls that a force drives taking part. Grains that are no discs turn as well, ½ Σ I δθ² is added:
what is caught in a notch can only turn out of it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.contact.acceleration import choose_factor, extrapolate, start_loop
from multicor_cli.engine.geometry.outlines import Point, points_within, touch_pieces
from multicor_cli.engine.geometry.pieces import Pieces, are_faces, pieces_met, turn_by
from multicor_cli.engine.geometry.radii import smaller_of
from multicor_cli.engine.geometry.scene import Scene, pair_geometry, shortest
from multicor_cli.engine.jit.compile import kernel, subroutine
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.engine.motion.cell import carry
from multicor_cli.model.columns import ANGLE, FIRST, GAP, NX, NY, SECOND, XX, XY, YY, X, Y
from multicor_cli.model.model import Floats, Ints


@subroutine
def levers_of(point: Point) -> tuple[float, float]:
    """Levers of a normal force at a point about the centers of i and j [m]."""
    return (
        point.i_x * point.ny - point.i_y * point.nx,
        point.j_x * point.ny - point.j_y * point.nx,
    )


@subroutine
def displace(scene: Scene, pieces: Pieces | None, k: int, x: float, y: float, angle: float) -> None:
    """Move a grain by (x, y) [m] and turn it."""
    scene.position[k, X] += x
    scene.position[k, Y] += y
    if pieces is not None:
        turn_by(pieces, scene, k, angle)


_MASS = 3  # column of the frames of pairs: 1/W
_LX, _LY = 4, 5  # columns in a cell: the branch vector [m]
RESTART_GROWTH = 1.5  # of the change per sweep, at which the momentum restarts


class _Bodies(NamedTuple):
    """Movable bodies, numbered anew; row ``held`` stands for all that are held.

    The row after it is the strain of a cell: its components xx, yy and xy.

    Attributes:
        number: Row of each grain and wall, shape ``(n + w,)``.
        mobility: Inverse masses in x and y [1/kg] and moment of inertia [1/(kg·m²)], 0 where none
            turns, and an unused column, shape ``(held + 2, 4)``.
        held: Number of movable bodies.
        strains: Whether a cell is strained.
    """

    number: Ints
    mobility: Floats
    held: int
    strains: bool


@kernel
def _bodies(
    marked: NDArray[np.bool_], mass: Floats, inertia: Floats | None, wall_inverse: Floats,
    is_cell: bool,
) -> _Bodies:  # fmt: skip
    """``wall_inverse`` are inverse masses of walls, of a cell those of its strain, ``(w, 3)``.

    Without ``inertia`` no grain turns.
    """
    n, w = marked.size, 0 if is_cell else wall_inverse.shape[0]
    count = 0
    number = np.full(n + w, -1, np.int32)
    for k in range(n + w):
        if marked[k] if k < n else wall_inverse[k - n, X] > 0.0 or wall_inverse[k - n, Y] > 0.0:
            number[k] = count
            count += 1
    mobility = np.zeros((count + 2, 4))
    strains = False
    for d in range(3 if is_cell else 0):
        mobility[count + 1, d] = wall_inverse[0, d]
        strains = strains or wall_inverse[0, d] > 0.0
    for k in range(n + w):
        if number[k] < 0:
            number[k] = count
            continue
        for d in range(2):
            mobility[number[k], d] = 1.0 / mass[k] if k < n else wall_inverse[k - n, d]
        if inertia is not None and k < n:
            mobility[number[k], ANGLE] = 1.0 / inertia[k]
    return _Bodies(number, mobility, count, strains)


@kernel
def _measure(
    scene: Scene, pieces: Pieces | None, bodies: _Bodies, i: Ints, j: Ints, near: float,
    target: float, allowed: float,
) -> tuple[Ints, Floats, Floats]:  # fmt: skip
    """Pairs that can be moved: bodies; normal, how far they may still close [m] and 1/W [kg].

    Each point of grains that are no discs is one: what moves one may undo another. Levers are the
    third array [m], shape ``(p, 2)``, or ``(0, 2)`` if all grains are discs. In any list that is
    complete up to ``near`` [m] the same. A pair with a held body keeps an overlap between
    ``target`` and ``allowed``: a grain between two held ones could not be freed of both.
    """
    n, held, room, turning = scene.radius.size, bodies.held, i.size, 0
    if pieces is not None:
        room = 0
        for c in range(i.size):
            is_face = are_faces(pieces, i[c], j[c])
            room += points_within(scene, pieces, i[c], j[c], near) if is_face else 1
        turning = room
    pair, frame = np.empty((room, 2), np.int32), np.empty((room, 6 if bodies.strains else 4))
    lever, found = np.empty((turning, 2)), 0
    for c in range(i.size):
        a = bodies.number[i[c]]
        b = bodies.number[j[c] if j[c] < n else n + scene.wall[j[c] - n]]
        if a == held and b == held:
            continue
        if pieces is not None and are_faces(pieces, i[c], j[c]):
            first, last = pieces_met(pieces, scene, j[c])
            for k in range(pieces.piece[i[c]], pieces.piece[i[c] + 1]):
                for m in range(first, last):
                    for point in touch_pieces(pieces, scene, i[c], k, j[c], m):
                        if point.gap <= near:
                            lever[found, FIRST], lever[found, SECOND] = levers_of(point)
                            found += _enter_row(
                                scene, bodies, i[c], j[c], a, b, point.gap, point.nx, point.ny,
                                lever[found], target, allowed, pair[found], frame[found],
                            )  # fmt: skip
            continue
        gap, nx, ny = pair_geometry(scene, i[c], j[c])
        if gap <= near:
            if pieces is not None:
                lever[found, FIRST], lever[found, SECOND] = 0.0, 0.0
            found += _enter_row(
                scene, bodies, i[c], j[c], a, b, gap, nx, ny, None, target, allowed, pair[found],
                frame[found],
            )  # fmt: skip
    return pair[:found], frame[:found], lever[:found]


@subroutine
def _enter_row(
    scene: Scene, bodies: _Bodies, i: int, j: int, a: int, b: int, gap: float, nx: float, ny: float,
    lever: Floats | None, target: float, allowed: float, pair: Ints, frame: Floats,
) -> bool:  # fmt: skip
    """Enter a point of a pair, the bodies a and b; not if neither can move along its normal.

    ``lever``, shape ``(2,)`` [m], is none for discs.
    """
    held = bodies.held
    give = (bodies.mobility[a, X] + bodies.mobility[b, X]) * nx * nx + (
        bodies.mobility[a, Y] + bodies.mobility[b, Y]
    ) * ny * ny
    if lever is not None:
        give += bodies.mobility[a, ANGLE] * lever[FIRST] * lever[FIRST]
        give += bodies.mobility[b, ANGLE] * lever[SECOND] * lever[SECOND]
    if bodies.strains:
        length, cell = scene.radius[i] + scene.radius[j] + gap, bodies.mobility[held + 1]
        lx, ly = length * nx, length * ny
        if lever is not None:
            lx, ly = shortest(
                scene.position[i, X] - scene.position[j, X],
                scene.position[i, Y] - scene.position[j, Y],
                scene.period, scene.height, scene.tilt,
            )  # fmt: skip
        give += cell[XX] * (nx * lx) * (nx * lx) + cell[YY] * (ny * ly) * (ny * ly)
        give += cell[XY] * (nx * ly) * (nx * ly)
        frame[_LX], frame[_LY] = lx, ly
    if not give > 0.0:
        return False
    smaller = smaller_of(scene, i, j)
    left = target * smaller
    if (a == held or b == held) and left < -gap <= allowed * smaller:
        left = -gap
    pair[FIRST], pair[SECOND] = a, b
    frame[NX], frame[NY], frame[GAP], frame[_MASS] = nx, ny, gap + left, 1.0 / give
    return True


@formula
def _relax(
    c: int, pair: Ints, frame: Floats, lever: Floats, push: Floats, mobility: Floats, shift: Floats
) -> float:
    """Relax a pair; returns by how much it opens, or closes if that is negative [m]."""
    a, b = pair[c, FIRST], pair[c, SECOND]
    nx, ny = frame[c, NX], frame[c, NY]
    gap = frame[c, GAP] + nx * (shift[a, X] - shift[b, X]) + ny * (shift[a, Y] - shift[b, Y])
    turns, strains, strain = lever.shape[0] > 0, frame.shape[1] > _LX, shift.shape[0] - 1
    if turns:
        gap += lever[c, FIRST] * shift[a, ANGLE] - lever[c, SECOND] * shift[b, ANGLE]
    if strains:
        lx, ly = frame[c, _LX], frame[c, _LY]
        gap += nx * (shift[strain, XX] * lx + shift[strain, XY] * ly) + ny * shift[strain, YY] * ly
    change = max(-gap * frame[c, _MASS], -push[c])
    if change == 0.0:
        return 0.0
    push[c] += change
    shift[a, X] += mobility[a, X] * change * nx
    shift[a, Y] += mobility[a, Y] * change * ny
    shift[b, X] -= mobility[b, X] * change * nx
    shift[b, Y] -= mobility[b, Y] * change * ny
    if turns:
        shift[a, ANGLE] += mobility[a, ANGLE] * change * lever[c, FIRST]
        shift[b, ANGLE] -= mobility[b, ANGLE] * change * lever[c, SECOND]
    if strains:
        shift[strain, XX] += mobility[strain, XX] * change * nx * frame[c, _LX]
        shift[strain, YY] += mobility[strain, YY] * change * ny * frame[c, _LY]
        shift[strain, XY] += mobility[strain, XY] * change * nx * frame[c, _LY]
    return change / frame[c, _MASS]


@kernel
def _solve(
    pair: Ints, frame: Floats, lever: Floats, bodies: _Bodies, enough: float, sweeps: int,
    memory: NDArray[np.void],
) -> Floats:  # fmt: skip
    """Displacements and turns of the bodies [m, rad] and the strain, rows of `_Bodies`.

    By accelerated sweeps. ``memory`` is that of `start_loop`. It belongs to the caller: Numba frees
    an array after its last use, while a record of it is still in use.
    """
    shift, push = np.zeros_like(bodies.mobility), np.zeros(frame.shape[0])
    now, last_push = shift.reshape(-1), np.zeros_like(push)
    last = np.zeros_like(now)
    loop = memory[0]
    for _ in range(sweeps):
        largest, squares, onward = 0.0, 0.0, 0.0
        for c in range(push.size):
            moved = _relax(c, pair, frame, lever, push, bodies.mobility, shift)
            largest = max(largest, abs(moved))
            squares += moved * moved
            onward += moved * (push[c] - last_push[c])
        if largest <= enough:
            break
        factor = choose_factor(np.sqrt(squares), onward, RESTART_GROWTH, loop)
        extrapolate(0, now.size, now, last, factor)
        extrapolate(0, push.size, push, last_push, factor)
    return shift


@kernel
def separate(
    scene: Scene, pieces: Pieces | None, i: Ints, j: Ints, marked: NDArray[np.bool_], mass: Floats,
    inertia: Floats, wall_inverse: Floats, near: float, target: float, allowed: float,
    enough: float, sweeps: int,
) -> tuple[Floats, float, float]:  # fmt: skip
    """Move the marked grains as little as leaves no more than a target of overlap.

    Solves min ½ Σ m δq² + ½ Σ I δθ² with gap + n·δq ≥ −target, δq where they touch, for the pairs
    (i, j) with a gap up to ``near`` [m] that can be moved, linearized at the present positions.
    These and ``pieces`` are **modified**; neither discs nor walls are turned. Inverse masses of
    walls are of shape ``(w, 3)``, 0 if held [1/kg]. Overlaps are over the smaller radius: a
    ``target`` is left, and up to ``allowed`` a pair with a held body is left alone. Sweeps end with
    one whose largest displacement is ``enough`` [m] or less. Returns the displacements of the walls
    [m], shape ``(w, 2)``, or in a cell its strain, ``(1, 3)``: they are to follow; and Σ m δx and
    Σ m δy of the grains [kg m].
    """
    is_cell = scene.height > 0.0
    bodies = _bodies(marked, mass, None if pieces is None else inertia, wall_inverse, is_cell)
    pair, frame, lever = _measure(scene, pieces, bodies, i, j, near, target, allowed)
    memory = start_loop(pair.shape[0])
    shift = _solve(pair, frame, lever, bodies, enough, sweeps, memory)
    n, pull_x, pull_y = marked.size, 0.0, 0.0
    if bodies.strains:
        carry(scene.position, shift[bodies.held + 1], 1.0, scene.position)
    for k in range(n):
        if marked[k]:
            dx, dy = shift[bodies.number[k], X], shift[bodies.number[k], Y]
            displace(scene, pieces, k, dx, dy, shift[bodies.number[k], ANGLE])
            pull_x += mass[k] * dx
            pull_y += mass[k] * dy
    if is_cell:
        return shift[bodies.held + 1 :, :3].copy(), pull_x, pull_y
    walls = np.empty((bodies.number.size - n, 2))
    for k in range(walls.shape[0]):
        walls[k, X], walls[k, Y] = shift[bodies.number[n + k], X], shift[bodies.number[n + k], Y]
    return walls, pull_x, pull_y
