"""Walls under a load that pulls them off the grains."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from multicor_cli.checks.check import Measured, Rule
from multicor_cli.checks.prepared import Prepared
from multicor_cli.model.model import Floats
from multicor_cli.post.scene import placed_walls

_STRAY = 0.1
"""A wall lies beyond the grains if no more than this part of their centers lies beyond it."""

_SAMPLES = 32


def _wall_spans(run: Prepared) -> tuple[Floats, Floats]:
    """Lowest and highest point of each wall in x and y [m], shapes ``(w, 2)``; of endless planes the point they are given by."""
    low, high = np.full((run.model.wall_count, 2), np.inf), np.full((run.model.wall_count, 2), -np.inf)
    for which, outline in placed_walls(run.model, run.state.wall_position):
        wall, corners = run.model.shapes.wall[which], outline.corners()
        if outline.normal is not None:  # a plane has a side in the direction of its normal only
            corners = np.where(np.abs(outline.normal) > math.sqrt(0.5), corners, np.array([[[-np.inf]], [[np.inf]]]))
        np.minimum.at(low, wall, corners[0])
        np.maximum.at(high, wall, corners[1])
    return low, high


def _outward(run: Prepared) -> Floats:
    """Direction away from the grains of each wall in x and y: 1, -1, or 0 if it does not lie beyond them, shape ``(w, 2)``."""
    low, high = _wall_spans(run)
    meets, center = run.model.walls.meets, run.state.position[:, :2]
    if not meets.size:
        meets = np.ones((1, len(run.model.groups)), np.bool_)
    spans = np.array([_span(center[is_met[run.model.grains.group]]) for is_met in meets])
    return np.where(low >= spans[:, 1], 1.0, np.where(high <= spans[:, 0], -1.0, 0.0))


def _span(center: Floats) -> Floats:
    """Where grains are, but for a few: lowest and highest x and y [m], shape ``(2, 2)``; everywhere if there are none."""
    if not len(center):
        return np.array([[-np.inf, -np.inf], [np.inf, np.inf]])
    return np.asarray(np.quantile(center, (_STRAY, 1.0 - _STRAY), axis=0))


def _pulls(run: Prepared) -> Iterator[Measured]:
    walls, outward = run.model.walls, _outward(run)
    for stage, drives, gravity in zip(run.plan.stages, run.drives, run.gravity, strict=True):
        length = 1.0 if stage.length is None else stage.length
        times = [length * (k + 0.5) / _SAMPLES for k in range(_SAMPLES)]
        for w, drive in enumerate(drives):
            for axis, dof in enumerate((drive.x, drive.y)):
                load = dof.stress if dof.force is None else dof.force
                if load is None or dof.spring is not None or outward[w, axis] == 0.0:
                    continue
                force = math.fsum(map(load.value, times)) / _SAMPLES
                force *= float(walls.length[w]) if dof.force is None else 1.0  # `between` two walls is a length like this one
                force += float(walls.mass[w] * gravity[axis]) if walls.has_gravity[w] else 0.0
                yield Measured(max(0.0, force * float(outward[w, axis])), f"wall {walls.names[w]} in stage {stage.name}")


RULES: tuple[Rule[Prepared], ...] = (
    Rule(
        "load off the grains", _pulls, unit="N", warning=0.0,
        meaning="The mean load of the wall, its weight included, pulls it away from the grains, and nothing holds it.",
        remedy="Turn the sign of the force: a lid above the grains presses with a negative force in y.",
    ),
)  # fmt: skip
"""What is checked of loads."""
