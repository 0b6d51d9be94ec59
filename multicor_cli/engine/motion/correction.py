"""Position correction after a step: no overlap may exceed 5·10⁻⁴ of the smaller radius.

The correction is the smallest one in the metric of the masses, min ½ Σ m δq² with gap + n·δq ≥ −target for all near pairs. That is
a convex problem, a contact problem without friction whose velocities are displacements; it is solved by accelerated sweeps, with
the walls that a force drives taking part. (Pushing pairs apart one by one never ends under a heavy lid.)

In a flow a few contacts overlap a little in nearly every step. Every loaded contact around them can take a part of the correction
up to the target, so that it is enough to move the grains nearby, with all others and the walls held: the first rounds do that, and
the following ones move everything if need be.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from multicor_cli.arithmetic.sums import total
from multicor_cli.engine.contact.report import PhysicsError
from multicor_cli.engine.geometry.neighbors import NeighborList
from multicor_cli.engine.geometry.scene import Scene, pair_geometry, place_shapes
from multicor_cli.engine.jit.chunks import chunks_for
from multicor_cli.engine.motion.overlaps import measure_overlaps
from multicor_cli.engine.motion.separation import pairs_within, separate, surround
from multicor_cli.engine.motion.walls import WallMotion
from multicor_cli.model.columns import X, Y
from multicor_cli.model.model import Floats, Model

ALLOWED = 5e-4  # overlap over the smaller radius that is left alone
TARGET = 2.5e-4  # what the correction leaves, so that a loaded contact stays closed and the next correction is far
FORBIDDEN = 1e-3  # a run that cannot get below this stops
ROUNDS = 20  # of linearized corrections
LOCAL_ROUNDS = 3  # of them with only the grains nearby
RINGS = 4  # of neighbors that make up "nearby"
LOCAL_SHARE = 0.5  # of all grains; if more are nearby, all are moved at once
ENOUGH = 0.3 * ALLOWED  # largest displacement of a sweep, over the smallest radius, with which a round ends
ROUND_SWEEPS = 2_000  # cap of a round
LOCAL_SWEEPS = 200  # cap of a round with the grains nearby: some twenty do, unless what is held leaves no room


@dataclass(frozen=True)
class Correction:
    """What the correction of a step did.

    Attributes:
        overlap: Largest overlap over the smaller radius that is left.
        gravity_work: Work of gravity on the displacements ΣF·δq [J].
        load_work: Work of the loads on the walls' displacements ΣF·δq [J].
        rounds: Number of rounds; 0 if nothing had to be moved.
    """

    overlap: float
    gravity_work: float
    load_work: float
    rounds: int


def correct_positions(
    scene: Scene,
    model: Model,
    gravity: Floats,
    motion: WallMotion,
    lists: NeighborList,
    reach: float,
    flagged: NDArray[np.bool_],
    step: int,
) -> Correction:
    """Project positions, mass-weighted, until no overlap exceeds `ALLOWED`.

    Args:
        scene: Shapes at q⁺. **Positions, wall frames and wall shapes modified.**
        model: The model.
        gravity: Acceleration of gravity in the step [m/s²], shape ``(2,)``.
        motion: Drives; force-driven walls move according to their mass.
        lists: Neighbor list with the gaps at q_m.
        reach: Pairs farther apart than this at q_m cannot overlap now [m].
        flagged: Work space, shape ``(n,)``.
        step: For messages.

    Raises:
        PhysicsError: If overlaps above `FORBIDDEN` cannot be removed.
    """
    overlap, count = _overlaps(scene, lists, reach, flagged)
    if count == 0:
        return Correction(overlap, 0.0, 0.0, 0)
    before, wall_before = scene.position[:, :2].copy(), scene.wall_position.copy()
    inverse = np.ascontiguousarray(motion.mobility[:, :2])  # walls are not turned; kernels are compiled anew for another layout
    rounds = 0
    while count and rounds < ROUNDS:
        # Pairs that a chain of corrections may close: a few of the largest overlaps away.
        near = min(reach, 20.0 * overlap * float(model.grains.radius.max()))
        _correct_once(scene, model, lists, near, flagged, inverse, rounds < LOCAL_ROUNDS)
        rounds += 1
        # Grains pushed apart may have been pushed into others that were not near at q_m: look a little farther.
        overlap, count = _overlaps(scene, lists, reach + 0.1 * model.mean_diameter, flagged)
    if overlap > FORBIDDEN:
        raise PhysicsError(step, _name_overlap(scene, model, lists, flagged, overlap))
    moved = scene.position[:, :2] - before
    gravity_work = total(model.grains.mass * (moved[:, X] * gravity[X] + moved[:, Y] * gravity[Y]))
    shift = scene.wall_position - wall_before
    gravity_work += total(motion.weight * shift)
    return Correction(overlap, gravity_work, motion.shift_work(wall_before, shift), rounds)


def _correct_once(
    scene: Scene, model: Model, lists: NeighborList, near: float, flagged: NDArray[np.bool_], inverse: Floats, is_local: bool
) -> None:
    """One linearized correction: of the grains around the ``flagged`` ones (**modified**), or of everything.

    ``inverse`` are the inverse masses of the walls in x and y, shape ``(w, 2)``; they move with everything only.
    """
    i, j = pairs_within(lists.row, lists.partner, lists.gap_after, near)
    sweeps = LOCAL_SWEEPS
    if not is_local or surround(i, j, RINGS, flagged) > LOCAL_SHARE * model.grain_count:
        flagged[:], sweeps = True, ROUND_SWEEPS
    else:
        inverse = np.zeros_like(inverse)
    enough = ENOUGH * float(model.grains.radius.min())
    shift = separate(scene, i, j, flagged, model.grains.mass, inverse, TARGET, ALLOWED, enough, sweeps)
    scene.wall_position[:, :2] += shift
    place_shapes(scene.kind, scene.wall, model.shapes.geometry, scene.wall_position, scene.world)


def _overlaps(scene: Scene, lists: NeighborList, reach: float, flagged: NDArray[np.bool_]) -> tuple[float, int]:
    """Largest overlap over the smaller radius, and number of grains flagged for one above `ALLOWED`; gaps go into the list."""
    found = chunks_for(flagged.size, 2)
    measure_overlaps(scene, lists.row, lists.partner, lists.gap, reach, ALLOWED, lists.gap_after, flagged, found)
    return float(found[:, 0].max()), round(total(found[:, 1]))


def _name_overlap(scene: Scene, model: Model, lists: NeighborList, flagged: NDArray[np.bool_], overlap: float) -> str:
    """Name the pair that overlaps most."""
    worst, pair = -1.0, (0, 0)
    for i in np.flatnonzero(flagged).tolist():
        for j in lists.partner[lists.row[i] : lists.row[i + 1]].tolist():
            smaller = min(scene.radius[i], scene.radius[j]) if j < model.grain_count else scene.radius[i]
            depth = -pair_geometry(scene, i, j)[0] / smaller
            if depth > worst:
                worst, pair = depth, (i, j)
    i, j = pair
    n = model.grain_count
    other = model.name_of(j) if j < n else f"wall '{model.walls.names[model.shapes.wall[j - n]]}'"
    return (
        f"{model.name_of(i)} and {other} overlap by {overlap:.2e} of the smaller radius and no admissible positions were found "
        "(too many grains between prescribed walls?)"
    )
