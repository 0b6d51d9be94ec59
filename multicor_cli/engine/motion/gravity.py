"""Gravity as a function of the time since the start of a stage."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from multicor_cli.arithmetic import cos, hypot, sin
from multicor_cli.engine.motion.drives import Constant, Signal
from multicor_cli.model.model import Floats

DEGREE = math.pi / 180.0


@dataclass(frozen=True)
class Gravity:
    """Gravity by its components [m/s²]."""

    x: Signal
    y: Signal

    @classmethod
    def constant(cls, value: Floats) -> Gravity:
        """The same vector at all times, shape ``(2,)``."""
        x, y = value.tolist()
        return cls(Constant(x), Constant(y))

    def value(self, t: float) -> Floats:
        """Acceleration at ``t`` seconds after the start of the stage [m/s²], shape ``(2,)``."""
        return np.array([self.x.value(t), self.y.value(t)])

    def largest(self) -> tuple[float, float, float]:
        """Bounds of the magnitudes of x, y and the whole at any time [m/s²]."""
        x, y = self.x.largest(), self.y.largest()
        return x, y, hypot(x, y)

    def shortest_period(self, start: float, end: float) -> float:
        """Shortest period of its components between ``start`` and ``end`` [s]; infinite if neither goes up and down."""
        return min(self.x.shortest_period(start, end), self.y.shortest_period(start, end))


@dataclass(frozen=True)
class TiltedGravity:
    """Gravity by its magnitude [m/s²] and the angle [degrees] by which it is turned, counter-clockwise, from −y towards +x.

    g = (g sin θ, −g cos θ): what a floor feels that is tilted by θ so that it descends towards +x.
    """

    angle: Signal
    magnitude: Signal

    def value(self, t: float) -> Floats:
        """Acceleration at ``t`` seconds after the start of the stage [m/s²], shape ``(2,)``."""
        angle, magnitude = DEGREE * self.angle.value(t), self.magnitude.value(t)
        return np.array([magnitude * sin(angle), -magnitude * cos(angle)])

    def largest(self) -> tuple[float, float, float]:
        """Bounds of the magnitudes of x, y and the whole at any time [m/s²]."""
        largest = self.magnitude.largest()
        return largest * sin(min(DEGREE * self.angle.largest(), 0.5 * math.pi)), largest, largest

    def shortest_period(self, start: float, end: float) -> float:
        """As `Gravity.shortest_period`.

        An angle that sweeps over half a turn or more goes round as fast as its steepest part would. The frequencies of angle and
        magnitude add up, as those of factors do.
        """
        turn = 360.0 / self.angle.steepest() if self.angle.swing() >= 180.0 else math.inf
        angle = min(turn, self.angle.shortest_period(start, end))
        frequency = 1.0 / angle + 1.0 / self.magnitude.shortest_period(start, end)
        return 1.0 / frequency if frequency else math.inf


AnyGravity = Gravity | TiltedGravity
