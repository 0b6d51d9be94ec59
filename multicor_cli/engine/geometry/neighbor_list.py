"""Keeps a neighbor list and rebuilds it only when something has moved too far for it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from multicor_cli import arithmetic
from multicor_cli.engine.geometry.drift import bound_closing, fit_drift
from multicor_cli.engine.geometry.grids import cell_count, cells_for, classify, make_grids
from multicor_cli.engine.geometry.neighbors import find_near, leave_out_unmet
from multicor_cli.engine.jit.elementwise import hypot
from multicor_cli.model.columns import RADIUS, TAIL_X, TAIL_Y, X, Y
from multicor_cli.model.model import Floats, Ints, Model
from multicor_cli.model.shapes import ShapeKind

OUTSIDE = 0.005  # share of the grains on each side that a grid may leave outside
SKIN = 0.3  # of the mean diameter: what is listed beyond the reach of a step


class NeighborList:
    """All pairs of shapes closer than a reach, with a skin that lets the list serve many steps.

    A grain and a wall that its group does not meet are never a pair: no contact, no heat and no correction joins them.

    The list is only a superset of the contacts of a step: results do not depend on its age.

    Attributes:
        row: Rows of the grains, shape ``(n + 1,)``.
        partner: Shapes near each grain, ascending within a row.
        gap: Work space for the gaps of the listed pairs at mid-step [m].
        normal: Work space for their normals, shape ``(pairs, 2)``.
        gap_after: The gaps at the end of the step [m].
        complete: Gap up to which all pairs are listed, at the positions of the last update [m].
        builds: How often the list was built.
        largest: Largest diameter of a disc [m].
    """

    def __init__(self, model: Model) -> None:
        self._model = model
        kind = model.shapes.kind
        self._disc_shapes = np.flatnonzero(kind == ShapeKind.DISC).astype(np.int32)
        self._others = np.flatnonzero(kind != ShapeKind.DISC).astype(np.int32)
        self._planes = np.flatnonzero(kind == ShapeKind.PLANE)
        self._shape_of = (model.grain_count + self._disc_shapes).astype(np.int32)
        self._radius = np.concatenate([model.grains.radius, model.shapes.geometry[self._disc_shapes, RADIUS]])
        self.largest = 2.0 * float(self._radius.max())
        self._classes = classify(self._radius)
        self._skin = SKIN * model.mean_diameter
        self._cutoff = -1.0
        self._reference = np.empty((0, 2))
        self._reference_world = np.empty((0, 4))
        self._extent = 0.0
        self.row: NDArray[np.int64] = np.zeros(model.grain_count + 1, np.int64)
        self.partner: Ints = np.empty(0, np.int32)
        self.gap: Floats = np.empty(0)
        self.normal: Floats = np.empty((0, 2))
        self.gap_after: Floats = np.empty(0)
        self.complete = -1.0
        self.builds = 0

    def update(self, position: Floats, world: Floats, reach: float) -> None:
        """Make sure that all pairs with a gap below ``reach`` [m] are listed.

        Args:
            position: Grains, shape ``(n, 3)``.
            world: Wall shapes in the world, shape ``(m, 4)``.
            reach: Largest gap of interest [m].
        """
        if self._cutoff >= 0.0:
            self.complete = self._cutoff - self._approach(position, world)
        if self.complete < reach:
            self.complete = reach + self._skin
            self._build(position, world, self.complete)

    def _approach(self, position: Floats, world: Floats) -> float:
        """How much closer than when the list was built any pair that is not listed may be [m]."""
        drift = fit_drift(position, self._reference, self._model.period, self._reference)
        change = world - self._reference_world
        turn = np.zeros(len(world))
        turn[self._others] = hypot(change[self._others, TAIL_X], change[self._others, TAIL_Y])  # see `Tail`
        if self._planes.size:  # a tilting plane moves in proportion to the distance from its point
            move = change[self._planes, :2]
            turn[self._planes] *= self._extent + hypot(move[:, X], move[:, Y]) + arithmetic.hypot(*drift.largest.tolist())
        kind = self._model.shapes.kind
        closing = bound_closing(kind, drift, self._reference_world, np.ascontiguousarray(change[:, :2]), turn)
        # Discs that are not listed are at least this far apart; for those farther apart there is more room than they can lose.
        return closing.over(self.largest + self._cutoff)

    def _build(self, position: Floats, world: Floats, cutoff: float) -> None:
        model = self._model
        centers = np.concatenate([position[:, :2], world[self._disc_shapes, :2]])
        if model.period > 0.0:
            centers[:, X] %= model.period
        low, high = self._box(centers, cutoff)
        grids = make_grids(self._classes, low, high, model.period, cutoff)
        shapes = model.shapes
        self.row, self.partner = find_near(
            grids, model.grain_count, centers, self._radius, self._shape_of, self._others, shapes.kind, world, cutoff, model.period
        )
        if model.walls.meets.size:
            self.row, self.partner = leave_out_unmet(self.row, self.partner, model.grains.group, shapes.wall, model.walls.meets)
        pairs = self.partner.size
        self.gap, self.normal, self.gap_after = np.empty(pairs), np.empty((pairs, 2)), np.empty(pairs)
        self._cutoff = cutoff
        self._reference = position[:, :2].copy()
        self._reference_world = world.copy()
        # Planes pass anywhere: their lever is the farthest grain from any of their points.
        self._extent = arithmetic.hypot(*np.ptp(centers, axis=0).tolist()) + float(np.abs(world[self._planes, :2]).max(initial=0.0))
        self.builds += 1

    def _box(self, centers: Floats, cutoff: float) -> tuple[Floats, Floats]:
        """Corners of what the grids cover. What lies beyond is found in the cells at the edge."""
        low, high = centers.min(axis=0), centers.max(axis=0)
        if cell_count(high - low, 2.0 * float(self._classes.radius.min()) + cutoff) > cells_for(len(centers)):
            # A few grains that have flown far away must not make all cells large, and all grains neighbors.
            few = int(OUTSIDE * len(centers))
            low, high = np.partition(centers, (few, len(centers) - 1 - few), axis=0)[[few, -1 - few]]
        return low, high
