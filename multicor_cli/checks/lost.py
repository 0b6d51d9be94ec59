"""Grains that have left everything and fall for ever."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from multicor_cli.checks.check import Measured, Rule
from multicor_cli.checks.recorded import Recorded
from multicor_cli.model import Model
from multicor_cli.model.model import Floats
from multicor_cli.model.shapes import Outline
from multicor_cli.post.scene import placed_walls


def lost_grains(model: Model, position: Floats, velocity: Floats, wall_position: Floats, gravity: Floats) -> int:
    """Number of grains below all walls that they meet along gravity that go on falling.

    Planes have no end, and nothing is below them.

    Args:
        model: Grains and walls.
        position: Centers of the grains, x and y first [m], shape ``(n, 2)`` or more columns.
        velocity: Their velocities likewise [m/s].
        wall_position: Poses of the walls, shape ``(w, 3)``.
        gravity: Acceleration of gravity [m/s²], shape ``(2,)``.
    """
    if not np.any(gravity):
        return 0
    down, count = gravity / np.hypot(*gravity), 0
    for which, is_met in model.meeting_alike():
        walls = [outline for _, outline in placed_walls(model, wall_position, is_met)]
        is_lost = _is_lost(position[which], velocity[which], model.grains.radius[which], walls, down)
        count += int(np.count_nonzero(is_lost))
    return count


def _is_lost(position: Floats, velocity: Floats, radius: Floats, walls: Sequence[Outline], down: Floats) -> NDArray[np.bool_]:
    """Which of some grains are lost; ``down`` is the unit vector along gravity."""
    ends = [corners for outline in walls if outline.normal is None for corners in outline.corners()]
    depth = position[:, :2] @ down
    is_falling = velocity[:, :2] @ down > 0.0
    lowest = float((np.concatenate(ends) @ down).max()) if ends else -np.inf
    is_free = np.ones(len(position), np.bool_)
    for outline in walls:
        for k in range(len(outline.points) if outline.normal is not None else 0):
            assert outline.normal is not None
            if outline.normal[k] @ down < 0.0:  # a floor without ends
                is_free &= (position[:, :2] - outline.points[k, 0]) @ outline.normal[k] < 0.0
    return np.asarray(is_free & is_falling & (depth > lowest + 2.0 * radius))


def _lost(run: Recorded) -> Iterator[Measured]:
    if not len(run.run.frames):
        return
    frame = run.run.frames[-1]
    model = frame.model
    position, velocity = np.asarray(frame.position, float), np.asarray(frame.velocity, float)
    count = lost_grains(model, position, velocity, frame.wall_position, run.gravity)
    if model.grain_count:
        yield Measured(count / model.grain_count, f"{count} of {model.grain_count}")


def _removed(run: Recorded) -> Iterator[Measured]:
    books = run.info["exchange"]
    if books is not None:
        yield Measured(books["lost"] / run.run.model.grain_count, f"{books['lost']} of {run.run.model.grain_count}")


def _late(run: Recorded) -> Iterator[Measured]:
    if run.info["exchange"] is not None:
        yield Measured(run.info["exchange"]["behind"])


RULES: tuple[Rule[Recorded], ...] = (
    Rule(
        "lost grains", _lost, unit="of the grains", warning=0.0, bad=0.1,
        meaning="Grains that lie below all walls and fall on for ever; they count in all means, with ever more kinetic energy.",
        remedy='Put a plane below, which has no ends; let them go, with [[outlets]] or [domain] lost = "remove"; or end the stage '
        "earlier.",
    ),
    Rule(
        "removed grains", _removed, unit="of the grains", warning=0.0, bad=0.1,
        meaning='Grains that left the domain elsewhere than through an outlet, and were removed as [domain] lost = "remove" asks.',
        remedy="Close the walls, or put an outlet where they leave.",
    ),
    Rule(
        "late releases", _late, unit="grains", warning=0.0,
        meaning="Grains that are due and have found no room in the region of their release: fewer come than the rate asks for.",
        remedy="Lower the rate, or enlarge the region of the release; if the container is to be full, nothing.",
    ),
)  # fmt: skip
"""What is checked of where the grains are."""
