"""How fast shapes can come closer to each other: far slower than they move in a flow, where neighbors move alike.

The vectors of the grains (displacements, or velocities) are split into an affine field a + G x, fitted by least squares, and the
rest. Two discs at a distance D approach by |G| D and twice the largest rest at most. In a sheared layer this does not depend on its
height, which the largest speed does.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from multicor_cli.arithmetic import hypot
from multicor_cli.arithmetic.sums import total
from multicor_cli.engine.geometry.affine import fit_affine, shape_bounds
from multicor_cli.engine.jit.chunks import chunks_for
from multicor_cli.model.model import Floats, Ints


@dataclass(frozen=True)
class Drift:
    """Vectors of the grains as an affine field and a rest.

    Attributes:
        center: Where the field is ``fit[0]``, shape ``(2,)``.
        fit: a, and the changes per length in x and in y, shape ``(3, 2)``.
        gradient: Bound of |G x|/|x| (Frobenius norm).
        rest: Largest deviation from the field.
        largest: Largest components in x and in y, shape ``(2,)``.
    """

    center: Floats
    fit: Floats
    gradient: float
    rest: float
    largest: Floats


_NOTHING = np.empty((0, 2))


def fit_drift(vectors: Floats, position: Floats, period: float, origin: Floats = _NOTHING) -> Drift:
    """Split the vectors of the grains.

    Args:
        vectors: Vectors in the first two columns, shape ``(≥ n, ≥ 2)``.
        position: Grains, shape ``(n, ≥ 2)``.
        period: Period in x [m] or 0; the field does not depend on x if there is one.
        origin: What is taken from the vectors, nearest image: where the grains were, shape ``(n, 2)``. Nothing if empty.
    """
    fit, chunks = np.empty((3, 2)), chunks_for(len(position), 11)
    fit_affine(vectors, origin, position, period, fit, chunks)
    gradient = math.sqrt(total(fit[1:] * fit[1:]))
    return Drift(position[0, :2].copy(), fit, gradient, math.sqrt(chunks[0, 0]), chunks[0, 1:3].copy())


@dataclass(frozen=True)
class Closing:
    """Bounds on how fast shapes come closer.

    Attributes:
        rest: Of two discs, what does not depend on their distance.
        gradient: Of two discs, per distance of their centers.
        disc: Of two discs at any distance.
        wall: Of a grain and a wall shape that is not a disc.
    """

    rest: float
    gradient: float
    disc: float
    wall: float

    def over(self, distance: float) -> float:
        """Bound for discs whose centers are ``distance`` [m] apart, and for walls."""
        return max(min(self.rest + self.gradient * distance, self.disc), self.wall)

    def or_faster(self, other: Closing) -> Closing:
        """Bounds that hold for both."""
        return Closing(
            max(self.rest, other.rest), max(self.gradient, other.gradient), max(self.disc, other.disc), max(self.wall, other.wall)
        )

    def reach(self, dt: float, diameter: float) -> float:
        """Gap [m] that no pair closes in a time step, given velocities and the largest diameter of a disc [m]."""
        growth = dt * self.gradient
        reach = dt * self.disc
        if growth < 1.0:
            reach = min(reach, dt * (self.rest + self.gradient * diameter) / (1.0 - growth))
        return max(reach, dt * self.wall)


def bound_closing(kind: Ints, drift: Drift, world: Floats, vectors: Floats, turn: Floats) -> Closing:
    """Bounds of grains and wall shapes together.

    Args:
        kind: `ShapeKind` of the wall shapes, shape ``(m,)``.
        drift: Vectors of the grains.
        world: Wall shapes, shape ``(m, 4)``.
        vectors: Displacements or velocities of their reference points, shape ``(m, 2)``.
        turn: What turning adds to the motion of any of their points that a grain may meet, shape ``(m,)``; discs do without.
    """
    rest, fastest, wall = shape_bounds(kind, world, vectors, turn, drift.center, drift.fit, drift.largest)
    fastest = max(fastest, hypot(*drift.largest.tolist()))
    return Closing(2.0 * max(drift.rest, rest), drift.gradient, 2.0 * fastest, wall)
