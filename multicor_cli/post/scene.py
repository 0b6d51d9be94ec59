"""The grains and walls of a frame as shapes that can be drawn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model import Model, ShapeKind
from multicor_cli.model.model import Floats
from multicor_cli.post.source import FrameSource, GrainFrame

_NEAR = 0.25  # walls count for the frame of a picture if they begin within this part of the grains' extent
_MARGIN = 0.02


@dataclass(frozen=True)
class GrainScene:
    """Where the grains and walls of a frame are.

    Attributes:
        center: Centers of the grains [m], shape ``(n, 2)``.
        radius: Radii of the grains [m], shape ``(n,)``.
        glued: x, y and radius of the grains glued to walls [m], shape ``(g, 3)``.
        segments: Ends of straight walls [m], shape ``(s, 2, 2)``.
        circles: x, y and radius of round walls [m], shape ``(c, 3)``.
        planes: x, y and unit normal of endless walls, shape ``(p, 4)``.
        period: Period in x [m]; 0 if there is none.
        box: Lower left and upper right corner of what is to be seen [m], shape ``(2, 2)``.
    """

    center: Floats
    radius: Floats
    glued: Floats
    segments: Floats
    circles: Floats
    planes: Floats
    period: float
    box: Floats


def make_scene(source: FrameSource, frame: GrainFrame) -> GrainScene:
    """The scene of a frame; x is wrapped into the period."""
    model = source.model
    center = np.array(np.asarray(frame.position, np.float64)[:, :2])
    shapes = {kind: _placed(model, np.asarray(frame.wall_position, np.float64), kind) for kind in ShapeKind}
    glued, circles = shapes[ShapeKind.DISC][:, :3], shapes[ShapeKind.CIRCLE][:, :3]
    if model.period > 0.0:
        center[:, 0] %= model.period
        glued[:, 0] %= model.period
    segments = shapes[ShapeKind.SEGMENT].reshape(-1, 2, 2)
    box = _find_box(center, model.grains.radius, [_corners(glued), _corners(circles), np.sort(segments, axis=1)])
    if model.period > 0.0:
        box[:, 0] = 0.0, model.period
    return GrainScene(center, model.grains.radius, glued, segments, circles, shapes[ShapeKind.PLANE], model.period, box)


def images(x: Floats, reach: Floats, period: float) -> tuple[NDArray[np.int64], Floats]:
    """What is to be drawn of things that cross the ends of the period.

    Args:
        x: Where they are, within the period [m], shape ``(n,)``.
        reach: How far they reach to both sides [m], shape ``(n,)``.
        period: The period [m]; 0 if there is none.

    Returns:
        Number of each thing to be drawn, and its shift in x [m]: all of them unshifted, then the images.
    """
    everything = np.arange(x.size)
    if period <= 0.0:
        return everything, np.zeros(x.size)
    left, right = np.flatnonzero(x + reach > period), np.flatnonzero(x - reach < 0.0)
    shift = np.concatenate([np.zeros(x.size), np.full(left.size, -period), np.full(right.size, period)])
    return np.concatenate([everything, left, right]), shift


def _placed(model: Model, pose: Floats, kind: ShapeKind) -> Floats:
    """The four numbers of all shapes of a kind, turned and moved with their walls; shape ``(k, 4)``."""
    of_kind = model.shapes.kind == kind
    geometry, wall = model.shapes.geometry[of_kind], model.shapes.wall[of_kind]
    c, s = np.cos(pose[wall, 2]), np.sin(pose[wall, 2])
    placed = np.array(geometry, np.float64)
    pairs = {ShapeKind.SEGMENT: (0, 2), ShapeKind.PLANE: (0, 2)}.get(kind, (0,))
    for k in pairs:
        x, y = geometry[:, k], geometry[:, k + 1]
        placed[:, k], placed[:, k + 1] = c * x - s * y, s * x + c * y
        if k == 0 or kind == ShapeKind.SEGMENT:
            placed[:, k : k + 2] += pose[wall, :2]
    return placed


def _corners(discs: Floats) -> Floats:
    """Lower left and upper right corner of discs (x, y, radius), shape ``(k, 2, 2)``."""
    return np.stack([discs[:, :2] - discs[:, 2:], discs[:, :2] + discs[:, 2:]], axis=1)


def _find_box(center: Floats, radius: Floats, walls: list[Floats]) -> Floats:
    """Around the grains and the walls that are near."""
    grains = np.array([(center - radius[:, np.newaxis]).min(axis=0), (center + radius[:, np.newaxis]).max(axis=0)])
    corners = np.concatenate(walls)
    room = _NEAR * (grains[1] - grains[0]).max()
    near = ((corners[:, 0] <= grains[1] + room) & (corners[:, 1] >= grains[0] - room)).all(axis=1)
    box = np.array([np.minimum(grains[0], corners[near, 0].min(axis=0, initial=np.inf)), grains[1]])
    box[1] = np.maximum(box[1], corners[near, 1].max(axis=0, initial=-np.inf))
    margin = _MARGIN * float((box[1] - box[0]).max())
    return np.asarray(box + np.array([[-margin], [margin]]))
