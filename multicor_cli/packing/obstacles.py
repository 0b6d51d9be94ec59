"""What a packing must stay clear of: wall shapes, solid matter, the boundary of its region, and the grains of earlier groups."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from multicor_cli.model.columns import TAIL_X, X
from multicor_cli.model.model import Floats, Ints
from multicor_cli.model.shapes import TAIL, Annulus, Area, Polygon, Room, ShapeKind, Tail, outlines
from multicor_cli.packing.region import PackingRegion

OPEN = Room()
"""All of the plane."""


@dataclass(frozen=True)
class Obstacles:
    """Shapes that do not move, in the world.

    Attributes:
        kind: `ShapeKind` of each shape, shape ``(m,)``.
        world: Geometry [m], as in `multicor_cli.model.WallShapes` but in the world, shape ``(m, 4)``.
        room: What solid bodies leave to the grains, and the region: outlines do not tell on which side of them to be.
        lids: Heights of the lowest points of rows of glued grains under which grains are to be [m].
    """

    kind: Ints
    world: Floats
    room: Room = OPEN
    lids: tuple[float, ...] = ()

    @classmethod
    def none(cls) -> Obstacles:
        """An empty set."""
        return cls(np.zeros(0, np.int32), np.zeros((0, 4)))

    @property
    def is_disc(self) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        """Which shapes are discs."""
        return np.asarray(self.kind == ShapeKind.DISC)

    def discs(self) -> Floats:
        """x, y and radius of the discs [m], shape ``(k, 3)``."""
        return self.world[self.is_disc, :3]

    def with_discs(self, discs: Floats) -> Obstacles:
        """Append discs given as x, y, radius [m], shape ``(k, 3)``. Numbers of the shapes before do not change."""
        rows = np.zeros((len(discs), 4))
        rows[:, :3] = discs
        return self._append(ShapeKind.DISC, rows)

    def with_sides(self, region: PackingRegion, bottom: bool = True, top: bool = True) -> Obstacles:
        """Append planes along the closed sides of ``region``; left and right unless it is periodic."""
        planes = []
        if not region.is_periodic:
            planes += [(region.left, region.bottom, 1.0, 0.0), (region.right, region.bottom, -1.0, 0.0)]
        if bottom:
            planes.append((region.left, region.bottom, 0.0, 1.0))
        if top:
            planes.append((region.left, region.top, 0.0, -1.0))
        return self._append(ShapeKind.PLANE, np.array(planes).reshape(-1, 4))

    def with_boundary(self, area: Area) -> Obstacles:
        """Append the outline of an area that is not a rectangle, inside which grains are to be."""
        added = replace(self, room=self.room.within(area))
        if isinstance(area, Annulus):
            added = added._append(ShapeKind.CIRCLE, np.array([[*area.center, area.outer, 0.0]]))
            return added.with_discs(np.array([[*area.center, area.inner]])) if area.inner > 0.0 else added
        if isinstance(area, Polygon):
            first, number = len(self.kind), np.arange(len(area.points))
            added = added._append(ShapeKind.SIDE, np.column_stack([area.points, np.roll(area.points, -1, axis=0)]))
            return added._append(ShapeKind.VERTEX, np.column_stack([area.points, first + np.roll(number, 1), first + number]))
        message = f"no outline of a {type(area).__name__}"
        raise TypeError(message)

    def around(self, region: PackingRegion, period: float) -> Obstacles:
        """Make the obstacles of a periodic domain fit for ``region``, which may cover only a part of the period.

        A region that spans the period is packed with its own periodicity and nothing changes. Any other is packed as if space
        were not periodic, so what reaches into it from neighboring periods is added.
        """
        if period <= 0.0 or region.is_periodic:
            return self
        ends = np.empty((2, self.kind.size))
        for which, outline in outlines(self.kind, self.world):
            ends[:, which] = outline.corners()[:, :, X]
        has_ends = self.kind != ShapeKind.PLANE  # planes are level
        nearby = self
        first = math.floor((region.left - float(ends[1, has_ends].max(initial=region.left))) / period)
        last = math.ceil((region.right - float(ends[0, has_ends].min(initial=region.right))) / period)
        for k in range(first, last + 1):
            near = has_ends & (ends[1] + k * period > region.left) & (ends[0] + k * period < region.right)
            refers = TAIL[self.kind] == Tail.SHAPES
            for end in self.world[near & refers, TAIL_X:].astype(np.int64).T:
                near[end[end >= 0]] = True  # a vertex asks its lines
            if k == 0 or not near.any():
                continue
            rows, refers = self.world[near].copy(), refers[near]
            rows[:, X] += k * period
            rows[TAIL[self.kind[near]] == Tail.POINT, TAIL_X] += k * period
            place = np.where(near, len(nearby.kind) + np.cumsum(near) - 1, -1)
            tail = rows[refers, TAIL_X:].astype(np.int64)
            rows[refers, TAIL_X:] = np.where(tail >= 0, place[tail], -1)
            nearby = nearby._with(self.kind[near], rows)
        return nearby

    def _append(self, kind: ShapeKind, rows: Floats) -> Obstacles:
        return self._with(np.full(len(rows), int(kind), np.int32), rows)

    def _with(self, kind: Ints, rows: Floats) -> Obstacles:
        return replace(self, kind=np.concatenate([self.kind, kind]), world=np.concatenate([self.world, rows]))
