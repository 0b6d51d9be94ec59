"""Grains that have fallen below all walls, and will fall for ever."""

from __future__ import annotations

import math

import numpy as np

from multicor_cli.arithmetic import cos, hypot, sin
from multicor_cli.model.columns import ANGLE, X, Y
from multicor_cli.model.model import Floats, Model
from multicor_cli.model.shapes import outlines
from multicor_cli.model.state import State


def count_fallen(state: State, model: Model) -> int:
    """Number of grains that lie wholly below the lowest point of all walls, in the direction of the gravity of the domain.

    0 without gravity or walls, and if there is an endless floor: a plane that faces up. Where grains come and go this is not asked:
    they may well be on their way to an outlet.
    """
    if model.outlets is not None:
        return 0
    gx, gy = model.gravity.tolist()
    size = hypot(gx, gy)
    floor = _lowest_wall(state, model, gx / size, gy / size) if size > 0.0 else math.inf
    position, radius = state.position, model.grains.radius
    return int(np.count_nonzero((position[:, X] * gx + position[:, Y] * gy) - radius * size > floor * size))


def _lowest_wall(state: State, model: Model, right: float, up: float) -> float:
    """How far the walls reach along a unit vector [m]; infinite without walls, or if a plane faces against the vector."""
    turn = np.array([[cos(angle), sin(angle)] for angle in state.wall_position[:, ANGLE].tolist()]).reshape(-1, 2)
    found = -math.inf
    for which, outline in outlines(model.shapes.kind, model.shapes.geometry):
        wall = model.shapes.wall[which]
        if outline.normal is not None:
            normal = _turned(outline.normal, turn[wall])
            if (normal[:, X] * right + normal[:, Y] * up < 0.0).any():
                return math.inf
            continue
        points = _turned(outline.points, turn[wall][:, np.newaxis]) + state.wall_position[wall][:, np.newaxis, :2]
        reach = np.zeros(which.size) if outline.radius is None else outline.radius
        found = max(found, float((points[..., X] * right + points[..., Y] * up + reach[:, np.newaxis]).max()))
    return found if found > -math.inf else math.inf


def _turned(vectors: Floats, turn: Floats) -> Floats:
    c, s, x, y = turn[..., 0], turn[..., 1], vectors[..., X], vectors[..., Y]
    return np.stack([c * x - s * y, s * x + c * y], axis=-1)
