"""Grains of any shape, and small scenes of them."""

from dataclasses import replace

import numpy as np
from scene_parts import FLOOR, make_model

from multicor_cli.engine import Engine, Orders, Settings
from multicor_cli.model import State
from multicor_cli.model.measures import measure
from multicor_cli.model.outlines import Outlines
from multicor_cli.model.shapes import ShapeKind, WallBody

POINT = np.zeros((1, 2))


def regular(sides, radius=1.0, turn=0.0):
    """Corners on a circle; with ``turn`` 0 the first one is on the right."""
    angle = turn + 2.0 * np.pi * np.arange(sides) / sides
    return radius * np.column_stack([np.cos(angle), np.sin(angle)])


def convex(rng, sides, radius=1.0):
    """Corners at random angles on a circle around the origin, none much closer than the others."""
    angle = 2.0 * np.pi * (np.arange(sides) + rng.uniform(-0.3, 0.3, sides)) / sides
    return radius * np.column_stack([np.cos(angle), np.sin(angle)])


def box(width, height):
    """Corners of a box around the origin."""
    x, y = 0.5 * width, 0.5 * height
    return np.array([[-x, -y], [x, -y], [x, y], [-x, y]])


def rod(length):
    """Both corners of a rod along x; ``length`` is that of its core."""
    return np.array([[-0.5 * length, 0.0], [0.5 * length, 0.0]])


def disc(radius):
    """A grain that is a disc."""
    return [(POINT, radius)]


def outlines_of(grains):
    """Outlines of grains of pieces (corners, rounding), centers that these had, their gyration.

    A disc stays where it is to the bit.
    """
    measures = measure(grains)
    centers = [
        np.zeros(2) if len(grain) == 1 and len(grain[0][0]) == 1 else center
        for grain, center in zip(grains, measures.center, strict=True)
    ]
    moved = [
        [(corners - center, rounding) for corners, rounding in grain]
        for grain, center in zip(grains, centers, strict=True)
    ]
    outlines = Outlines.of(moved, measures.area, measures.perimeter)
    return outlines, np.array(centers), measures.gyration


def shaped_model(grains, shapes=FLOOR, walls=("floor",), **keys):
    """Model of grains of pieces (corners, rounding), around their centers of mass, density 1."""
    outlines, _, gyration = outlines_of(grains)
    model = make_model(outlines.radius, shapes, walls, **keys)
    mass = outlines.area.copy()
    bodies = replace(model.grains, mass=mass, inertia=mass * gyration)
    return replace(model, grains=bodies, outlines=outlines)


def shaped_engine(model, places, velocities=None, *, settings=None, drives=None, threads=1):
    """Engine of grains at ``places``: x, y and maybe the angle."""
    places = np.asarray(places, float)
    state = State.at_rest(model, places[:, :2])
    state.position[:, : places.shape[1]] = places
    if velocities is not None:
        state.velocity[:] = velocities
    engine = Engine(model, state, threads=threads)
    engine.begin(Orders(drives, settings or Settings()))
    return engine


def wall_line(points, wall=0, period=0.0, **keys):
    """Shapes of a wall along a line, for `shaped_model`; more as for `WallBody.with_line`."""
    body = WallBody.empty((0.0, 0.0), 1.0).with_line(np.asarray(points, float), period, **keys)
    numbers = zip(body.kind, body.geometry, strict=True)
    return [(kind, wall, tuple(four)) for kind, four in numbers]


def wall_shapes(*parts):
    """Lists of shapes as one, in which the corners of each still know its own lines."""
    joined = []
    for part in parts:
        first = len(joined)
        for kind, wall, numbers in part:
            if kind == ShapeKind.VERTEX:
                lines = [line + first if line >= 0 else line for line in numbers[2:]]
                numbers = (*numbers[:2], *lines)
            joined.append((kind, wall, numbers))
    return joined


def scattered(rng, columns, rows, pitch, lowest):
    """Places of grains turned at random, in rows and columns about as far apart as ``pitch``."""
    k = np.arange(columns * rows)
    angle = rng.uniform(0.0, 7.0, k.size)
    places = np.column_stack([pitch * (k % columns + 0.5), lowest + pitch * (k // columns), angle])
    places[:, :2] += rng.uniform(-0.05, 0.05, (k.size, 2))
    return places


def on_slope(tangent, gravity=9.81):
    """Gravity along and across a slope of this steepness that is drawn level."""
    angle = np.arctan(tangent)
    return gravity * np.sin(angle), -gravity * np.cos(angle)
