"""Polygons of any shape, and which points lie in them."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def star(rng: np.random.Generator, count: int, least: float, most: float) -> Floats:
    """Corners of a simple polygon around the origin, at these distances from it."""
    angle = 2.0 * np.pi * (np.arange(count) + rng.uniform(0.0, 0.9, count)) / count
    radius = rng.uniform(least, most, (count, 1))
    return np.asarray(radius * np.column_stack([np.cos(angle), np.sin(angle)]))


def winding(corners: Floats, points: Floats) -> Floats:
    """How often corners run around points, by adding up angles."""
    way = corners[np.newaxis] - points[:, np.newaxis]
    angle = np.arctan2(way[..., 1], way[..., 0])
    turn = np.diff(np.concatenate([angle, angle[:, :1]], axis=1), axis=1)
    return np.asarray(np.rint(((turn + np.pi) % (2.0 * np.pi) - np.pi).sum(axis=1) / (2.0 * np.pi)))
