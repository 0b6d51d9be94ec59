"""Gaps of outlines by comparing all directions in which they can be apart."""

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model import Model, State

Floats = NDArray[np.float64]


def gap_of_cores(a: Floats, b: Floats) -> float:
    """Signed distance of two convex cores: the largest of the separations in all directions.

    Where it is largest a side, or the line between two corners, is perpendicular to the direction.
    """
    if len(a) == len(b) == 1:
        return float(np.hypot(*(b - a)[0]))
    sides = np.concatenate([np.roll(c, -1, axis=0) - c for c in (a, b) if len(c) > 1])
    across = (b[None] - a[:, None]).reshape(-1, 2)
    ways = np.concatenate([np.column_stack([sides[:, 1], -sides[:, 0]]), across])
    ways = np.concatenate([ways, -ways])
    ways = ways[np.hypot(*ways.T) > 0]
    ways /= np.hypot(*ways.T)[:, None]
    return float(((b @ ways.T).min(axis=0) - (a @ ways.T).max(axis=0)).max())


def pieces_at(model: Model, state: State, grain: int) -> list[tuple[Floats, float]]:
    """The pieces of a grain in the world."""
    x, y, angle = state.position[grain]
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    if model.outlines is None:
        return [(np.array([[x, y]]), float(model.grains.radius[grain]))]
    return [(corners @ turn + [x, y], r) for corners, r in model.outlines.pieces(grain)]


def smallest_outline_gap(model: Model, state: State, *, relative: bool = False) -> float:
    """Smallest gap of any two grains, and of images of them, by comparing all of them [m].

    With ``relative`` over the smaller radius of each two.
    """
    pieces = [pieces_at(model, state, k) for k in range(model.grain_count)]
    shifts = [np.zeros(2)]
    width, up = model.period, np.zeros(2)
    if model.is_cell:
        width, up[1], up[0] = state.wall_position[0]
    if width:
        x = np.array([width, 0.0])
        shifts += [x, -x]
    if up.any():
        shifts += [shift + up for shift in list(shifts) for y in (up, -up)]
    radius, center = model.grains.radius, state.position[:, :2]
    worst = np.inf
    for i in range(model.grain_count):
        for shift in shifts:
            near = np.hypot(*(center + shift - center[i]).T) < radius + radius[i]
            for j in np.flatnonzero(near).tolist():
                if j == i:
                    continue
                gaps = [
                    gap_of_cores(a, b + shift) - r - q for a, r in pieces[i] for b, q in pieces[j]
                ]
                worst = min(worst, min(gaps) / (min(radius[i], radius[j]) if relative else 1.0))
    return worst
