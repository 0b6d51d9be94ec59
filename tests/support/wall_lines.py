"""Walls that are lines of any number of pieces."""

import numpy as np

from multicor_cli.model import ShapeKind


def level(*x):
    return [(value, 0.0) for value in x]


def outline(points, wall, first, *, closed=False):
    """Shapes of a polyline; ``first`` is the number of its first shape."""
    points = np.asarray(points, float)
    count = len(points) if closed else len(points) - 1
    segments = [
        (ShapeKind.SEGMENT, wall, (*points[k], *points[(k + 1) % len(points)]))
        for k in range(count)
    ]
    before = [first + (k - 1) % count if closed or k > 0 else -1 for k in range(len(points))]
    after = [first + k if k < count else -1 for k in range(len(points))]
    return segments + [
        (ShapeKind.VERTEX, wall, (*p, b, a)) for p, b, a in zip(points, before, after, strict=True)
    ]


def walls_of(lines, *, closed=False):
    """Shapes of walls from the points of each, and their names."""
    shapes = []
    for wall, points in enumerate(lines):
        shapes += outline(points, wall, len(shapes), closed=closed)
    return shapes, tuple(f"wall {wall}" for wall in range(len(lines)))
