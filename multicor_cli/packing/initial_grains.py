"""Grains that a packing brings with it: radii, places, motion and, from a run with heat, temperatures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from multicor_cli.model.model import Floats


@dataclass(frozen=True)
class InitialGrains:
    """Grains at rest or in motion.

    Attributes:
        radius: Radii [m], shape ``(n,)``.
        position: x, y [m] and angle [rad], shape ``(n, 3)``.
        velocity: Velocity [m/s] and spin [rad/s], shape ``(n, 3)``.
        temperature: Temperatures [K], shape ``(n,)``; None if the packing does not tell them.
    """

    radius: Floats
    position: Floats
    velocity: Floats
    temperature: Floats | None = None

    @classmethod
    def at_rest(cls, radius: Floats, position: Floats) -> InitialGrains:
        """Grains that do not move; ``position`` has shape ``(n, 2)``."""
        full = np.zeros((radius.size, 3))
        full[:, :2] = position
        return cls(radius, full, np.zeros((radius.size, 3)))
