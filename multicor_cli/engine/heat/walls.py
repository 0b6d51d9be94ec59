"""Thermal conditions of walls, and what they prescribe during a step."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from multicor_cli.arithmetic.sums import total
from multicor_cli.engine.motion.drives import Constant, Signal
from multicor_cli.model.model import Floats, Ints

_INSULATED = Constant(0.0)


@dataclass(frozen=True)
class WallHeat:
    """Thermal condition of one wall during a stage.

    Attributes:
        kind: ``"insulated"``; ``"temperature"``: prescribed [K]; ``"flow"``: heat flow into the grains that touch it [W], shared
            in proportion to their conductances.
        signal: The prescribed value as a function of the time since the start of the stage.
    """

    kind: Literal["insulated", "temperature", "flow"] = "insulated"
    signal: Signal = _INSULATED


@dataclass(frozen=True)
class WallValues:
    """Temperatures [K] or heat flows [W] of the walls, by the time since the start of a step.

    Attributes:
        conditions: Conditions of the walls.
        start: Time since the start of the stage at which the step begins [s].
    """

    conditions: Sequence[WallHeat]
    start: float

    @property
    def count(self) -> int:
        """Number of walls."""
        return len(self.conditions)

    def pieces(self, dt: float) -> list[tuple[WallValues, float]]:
        """The step, cut where signals bend: for each piece the values and its length [s]. No pulse falls between two steps."""
        corners = {
            time
            for wall in self.conditions
            if wall.kind != "insulated"
            for time in wall.signal.corners(self.start, self.start + dt)
        }
        if not corners:
            return [(self, dt)]
        edges = [self.start, *sorted(corners), self.start + dt]
        return [(WallValues(self.conditions, a), b - a) for a, b in itertools.pairwise(edges) if b > a]

    def temperatures(self, t: float) -> Floats:
        """Temperatures of the walls ``t`` seconds after the start of the step [K]; nan where none is prescribed, shape ``(w,)``."""
        known = np.array([c.kind == "temperature" for c in self.conditions], np.bool_)
        return np.where(known, self(t), np.nan)

    def undelivered(self, dt: float, reached: Ints) -> float:
        """Heat that walls of prescribed flow could not pass on within ``dt`` [J]: all but those ``reached`` touch nothing."""
        idle = np.array([c.kind == "flow" for c in self.conditions], np.bool_)
        idle[reached] = False
        return total(np.abs(self(0.5 * dt)[idle])) * dt

    def __call__(self, t: float) -> Floats:
        """Values ``t`` seconds after the start of the step; 0 for insulated walls, shape ``(w,)``."""
        return np.array([0.0 if c.kind == "insulated" else c.signal.value(self.start + t) for c in self.conditions])
