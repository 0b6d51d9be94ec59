"""Position correction after a step: no overlap may exceed 5·10⁻⁴ of the smaller radius.

The correction is the smallest one in the metric of the masses, min ½ Σ m δq² with gap + n·δq ≥ −target for all near pairs. That is
a contact problem without friction whose velocities are displacements, so the contact solver solves it, accelerated, with the
walls that a force drives taking part. (Pushing pairs apart one by one never ends under a heavy lid.)

In a flow a few contacts overlap a little in nearly every step. Every loaded contact around them can take a part of the correction
up to the target, so that it is enough to move the grains nearby, with all others and the walls held: the first rounds do that, with
plain sweeps, and the following ones move everything if need be.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from multicor_cli.kernels.contacts import Scene, pair_geometry
from multicor_cli.kernels.jit import chunks_for
from multicor_cli.kernels.neighbours import place_shapes
from multicor_cli.kernels.overlaps import measure_overlaps
from multicor_cli.kernels.separation import near_pairs, separate, surround
from multicor_cli.solver.gather import gather_still_contacts
from multicor_cli.solver.neighbour_list import NeighbourList
from multicor_cli.solver.pace import Pace
from multicor_cli.solver.settings import PhysicsError, Settings
from multicor_cli.solver.solve import Scale, solve_system
from multicor_cli.solver.system import assemble
from multicor_cli.solver.walls import WallMotion
from multicor_cli.state.model import Floats, Model

ALLOWED = 5e-4  # overlap over the smaller radius that is left alone
TARGET = 2.5e-4  # what the correction leaves, so that a loaded contact stays closed and the next correction is far
FORBIDDEN = 1e-3  # a run that cannot get below this stops
ROUNDS = 20  # of linearized corrections
LOCAL_ROUNDS = 3  # of them with only the grains nearby
RINGS = 4  # of neighbors that make up "nearby"
LOCAL_SHARE = 0.5  # of all grains; if more are nearby, all are moved at once
LOCAL_SWEEPS = 200
LOCAL_CHANGE = 0.05 * ALLOWED  # displacement of a sweep, over the smallest radius, with which a local correction ends
_SETTINGS = Settings(tolerance_rms=0.05, tolerance_max=0.25, tolerance_energy=np.inf, max_sweeps=2_000)


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
    motion: WallMotion,
    lists: NeighbourList,
    reach: float,
    flagged: NDArray[np.bool_],
    step: int,
    pace: Pace,
) -> Correction:
    """Project positions, mass-weighted, until no overlap exceeds `ALLOWED`.

    Args:
        scene: Shapes at q⁺. **Positions, wall frames and wall shapes modified.**
        model: The model.
        motion: Drives; force-driven walls move according to their mass.
        lists: Neighbour list with the gaps at q_m.
        reach: Pairs farther apart than this at q_m cannot overlap now [m].
        flagged: Work space, shape ``(n,)``.
        step: For messages.
        pace: Decides between one thread and several.

    Raises:
        PhysicsError: If overlaps above `FORBIDDEN` cannot be removed.
    """
    overlap, count = _overlaps(scene, lists, reach, flagged)
    if count == 0:
        return Correction(overlap, 0.0, 0.0, 0)
    before, wall_before = scene.position[:, :2].copy(), scene.wall_position.copy()
    # Grains pushed apart may be pushed into others that were not near at q_m: look a little farther.
    reach += 0.1 * model.mean_diameter
    overlap, count = _overlaps(scene, lists, reach, flagged)
    rounds = 0
    while count and rounds < ROUNDS:
        # Pairs that a chain of corrections may close: a few of the largest overlaps away.
        near = min(reach, 20.0 * overlap * float(model.grains.radius.max()))
        if rounds >= LOCAL_ROUNDS or not _correct_nearby(scene, model, lists, near, flagged):
            _correct_everything(scene, model, motion, lists, near, pace)
        rounds += 1
        overlap, count = _overlaps(scene, lists, reach, flagged)
    if overlap > FORBIDDEN:
        raise PhysicsError(step, _name_overlap(scene, model, lists, flagged, overlap))
    moved = scene.position[:, :2] - before
    gravity_work = float((model.grains.mass * (moved @ model.gravity)).sum())
    shift = scene.wall_position - wall_before
    gravity_work += float((motion.weight * shift).sum())
    return Correction(overlap, gravity_work, float((motion.load * shift).sum()), rounds)


def _correct_nearby(scene: Scene, model: Model, lists: NeighbourList, near: float, flagged: NDArray[np.bool_]) -> bool:
    """One linearized correction of the grains around the ``flagged`` ones (**modified**); False if that is nearly all of them."""
    i, j = near_pairs(lists.row, lists.partner, lists.gap_after, near)
    if surround(i, j, RINGS, flagged) > LOCAL_SHARE * model.grain_count:
        return False
    separate(scene, i, j, flagged, model.grains.mass, TARGET, LOCAL_CHANGE * float(model.grains.radius.min()), LOCAL_SWEEPS)
    return True


def _correct_everything(scene: Scene, model: Model, motion: WallMotion, lists: NeighbourList, near: float, pace: Pace) -> None:
    """One linearized correction of all grains, and of the walls that a force drives."""
    n = model.grain_count
    still = np.zeros((n + model.wall_count, 4))
    still[:n, 3] = 1.0 / model.grains.mass
    with np.errstate(divide="ignore"):
        inverse = np.where(motion.driven, 1.0 / motion.mass, 0.0)
    inverse[:, 2] = 0.0  # walls are not turned
    contacts = gather_still_contacts(scene, lists, lists.gap_after, near, still)
    smaller = scene.radius[contacts.i]
    grains = contacts.j < n
    smaller[grains] = np.minimum(smaller[grains], scene.radius[contacts.j[grains]])
    contacts.frame[:, 3] = contacts.frame[:, 2] + TARGET * smaller
    ordered = assemble(scene, contacts, still, inverse, motion.is_free, model.mean_diameter, model.shape_factor)
    solve_system(ordered.system, Scale(ALLOWED * float(model.grains.radius.min()), 1.0), _SETTINGS, pace)
    displacement: Floats = ordered.system.velocity
    scene.position[:, :2] += displacement[:n, :2]
    scene.wall_position[:] += np.where(inverse > 0.0, displacement[n : n + model.wall_count, :3], 0.0)
    place_shapes(scene.kind, scene.wall, model.shapes.geometry, scene.wall_position, scene.world)


def _overlaps(scene: Scene, lists: NeighbourList, reach: float, flagged: NDArray[np.bool_]) -> tuple[float, int]:
    """Largest overlap over the smaller radius, and number of grains flagged for one above `ALLOWED`; gaps go into the list."""
    found = chunks_for(flagged.size, 2)
    measure_overlaps(scene, lists.row, lists.partner, lists.gap, reach, ALLOWED, lists.gap_after, flagged, found)
    return float(found[:, 0].max()), int(found[:, 1].sum())


def _name_overlap(scene: Scene, model: Model, lists: NeighbourList, flagged: NDArray[np.bool_], overlap: float) -> str:
    """Name the pair that overlaps most."""
    worst, pair = -1.0, (0, 0)
    for i in np.flatnonzero(flagged).tolist():
        for j in lists.partner[lists.row[i] : lists.row[i + 1]].tolist():
            smaller = min(scene.radius[i], scene.radius[j]) if j < model.grain_count else scene.radius[i]
            depth = -pair_geometry(scene, i, j)[0] / smaller
            if depth > worst:
                worst, pair = depth, (i, j)
    i, j = pair
    other = f"grain {j}"
    if j >= model.grain_count:
        other = f"wall '{model.walls.names[model.shapes.wall[j - model.grain_count]]}'"
    return (
        f"grain {i} and {other} overlap by {overlap:.2e} of the smaller radius and no admissible positions were found "
        "(too many grains between prescribed walls?)"
    )
