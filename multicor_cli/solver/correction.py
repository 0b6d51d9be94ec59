"""Position correction after a step: no overlap may exceed 5·10⁻⁴ of the smaller radius."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from multicor_cli.kernels.contacts import Scene, pair_geometry
from multicor_cli.kernels.jit import chunks_for
from multicor_cli.kernels.projection import measure_overlaps, project_flagged
from multicor_cli.solver.neighbour_list import NeighbourList
from multicor_cli.solver.settings import PhysicsError
from multicor_cli.solver.walls import WallMotion
from multicor_cli.state.model import Model

ALLOWED = 5e-4  # overlap over the smaller radius that is left alone
TARGET = 4e-4  # what the projection leaves, so that it ends after a few rounds
FORBIDDEN = 1e-3  # a run that cannot get below this stops
ROUNDS = 2_000


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
    scene: Scene, model: Model, motion: WallMotion, lists: NeighbourList, reach: float, flagged: NDArray[np.bool_], step: int
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

    Raises:
        PhysicsError: If overlaps above `FORBIDDEN` cannot be removed.
    """
    overlap, count = _overlaps(scene, lists, reach, flagged)
    if count == 0:
        return Correction(overlap, 0.0, 0.0, 0)
    before, wall_before = scene.position[:, :2].copy(), scene.wall_position.copy()
    inverse = 1.0 / model.grains.mass
    with np.errstate(divide="ignore"):
        wall_inverse = np.where(motion.driven, 1.0 / motion.mass, 0.0)
    rounds = 0
    # Grains pushed apart may be pushed into others that were not near at q_m: look a little farther.
    reach += 0.1 * model.mean_diameter
    while count and rounds < ROUNDS:
        project_flagged(
            scene, lists.row, lists.partner, lists.gap, reach, flagged, ALLOWED, TARGET, inverse, wall_inverse,
            model.shapes.geometry,
        )  # fmt: skip
        rounds += 1
        overlap, count = _overlaps(scene, lists, reach, flagged)
    if overlap > FORBIDDEN:
        raise PhysicsError(step, _name_overlap(scene, model, lists, flagged, overlap))
    moved = scene.position[:, :2] - before
    gravity_work = float((model.grains.mass * (moved @ model.gravity)).sum())
    shift = scene.wall_position - wall_before
    gravity_work += float((motion.weight * shift).sum())
    return Correction(overlap, gravity_work, float((motion.load * shift).sum()), rounds)


def _overlaps(scene: Scene, lists: NeighbourList, reach: float, flagged: NDArray[np.bool_]) -> tuple[float, int]:
    """Largest overlap over the smaller radius, and the number of grains flagged for having one above `ALLOWED`."""
    found = chunks_for(flagged.size, 2)
    measure_overlaps(scene, lists.row, lists.partner, lists.gap, reach, ALLOWED, flagged, found)
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
