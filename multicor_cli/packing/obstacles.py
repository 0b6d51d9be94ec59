"""What a packing must stay clear of: wall shapes, the sides of its region, and the grains of earlier groups."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from multicor_cli.model.columns import RADIUS, X
from multicor_cli.model.model import Floats, Ints
from multicor_cli.model.shapes import ShapeKind
from multicor_cli.packing.region import PackingRegion


@dataclass(frozen=True)
class Obstacles:
    """Shapes that do not move, in the world.

    Attributes:
        kind: `ShapeKind` of each shape, shape ``(m,)``.
        world: Geometry [m], as in `multicor_cli.model.WallShapes` but in the world, shape ``(m, 4)``.
    """

    kind: Ints
    world: Floats

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

    def around(self, region: PackingRegion, period: float) -> Obstacles:
        """Make the obstacles of a periodic domain fit for ``region``, which may cover only a part of the period.

        A region that spans the period is packed with its own periodicity and nothing changes. Any other is packed as if space
        were not periodic, so the discs that reach into it from a neighboring period are added.
        """
        if period <= 0.0 or region.is_periodic:
            return self
        discs = self.discs()
        first = int(np.floor(region.left / period)) - 1
        last = int(np.floor(region.right / period)) + 1
        images = [discs + np.array([k * period, 0.0, 0.0]) for k in range(first, last + 1) if k]
        moved = np.concatenate(images) if images else np.zeros((0, 3))
        near = (moved[:, X] + moved[:, RADIUS] > region.left) & (moved[:, X] - moved[:, RADIUS] < region.right)
        return self.with_discs(moved[near])

    def _append(self, kind: ShapeKind, rows: Floats) -> Obstacles:
        added = np.full(len(rows), int(kind), np.int32)
        return Obstacles(np.concatenate([self.kind, added]), np.concatenate([self.world, rows]))
