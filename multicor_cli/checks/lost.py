"""Grains that have left everything and fall for ever."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from multicor_cli.checks.check import Measured, Rule
from multicor_cli.checks.recorded import Recorded
from multicor_cli.model import Model
from multicor_cli.model.model import Floats
from multicor_cli.post.scene import placed_walls


def lost_grains(model: Model, position: Floats, velocity: Floats, wall_position: Floats, gravity: Floats) -> int:
    """Number of grains below all grains' walls along gravity that go on falling; planes have no end, and nothing is below them.

    Args:
        model: Grains and walls.
        position: Centers of the grains, x and y first [m], shape ``(n, 2)`` or more columns.
        velocity: Their velocities likewise [m/s].
        wall_position: Poses of the walls, shape ``(w, 3)``.
        gravity: Acceleration of gravity [m/s²], shape ``(2,)``.
    """
    if not np.any(gravity):
        return 0
    down = gravity / np.hypot(*gravity)
    ends = [corners for _, o in placed_walls(model, wall_position) if o.normal is None for corners in o.corners()]
    depth = position[:, :2] @ down
    is_falling = velocity[:, :2] @ down > 0.0
    lowest = float((np.concatenate(ends) @ down).max()) if ends else -np.inf
    is_free = np.ones(len(position), np.bool_)
    for _, outline in placed_walls(model, wall_position):
        for k in range(len(outline.points) if outline.normal is not None else 0):
            assert outline.normal is not None
            if outline.normal[k] @ down < 0.0:  # a floor without ends
                is_free &= (position[:, :2] - outline.points[k, 0]) @ outline.normal[k] < 0.0
    return int(np.count_nonzero(is_free & is_falling & (depth > lowest + 2.0 * model.grains.radius)))


def _lost(run: Recorded) -> Iterator[Measured]:
    if not len(run.run.frames):
        return
    frame, model = run.run.frames[-1], run.run.model
    position, velocity = np.asarray(frame.position, float), np.asarray(frame.velocity, float)
    count = lost_grains(model, position, velocity, frame.wall_position, run.gravity)
    yield Measured(count / model.grain_count, f"{count} of {model.grain_count}")


RULES: tuple[Rule[Recorded], ...] = (
    Rule(
        "lost grains", _lost, unit="of the grains", warning=0.0, bad=0.1,
        meaning="Grains that lie below all walls and fall on for ever; they count in all means, with ever more kinetic energy.",
        remedy="Put a plane below, which has no ends; end the stage earlier; or leave them out of what is evaluated.",
    ),
)  # fmt: skip
"""What is checked of where the grains are."""
