"""Thermal conditions of walls, and what they prescribe during a step."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from multicor_cli.arithmetic.sums import total
from multicor_cli.engine.motion.drives import Constant, Signal
from multicor_cli.model.model import Floats

_INSULATED = Constant(0.0)
PRESCRIBED = ("temperature", "flow")
"""Kinds of conditions with a value as a function of time."""


@dataclass(frozen=True)
class WallHeat:
    """Thermal condition of one wall during a stage.

    Attributes:
        kind: ``"insulated"``; ``"temperature"``: prescribed [K]; ``"flow"``: heat flow into the
            grains that touch it [W], shared in proportion to their conductances; ``"capacity"``: a
            body with one temperature, which changes.
        signal: The prescribed value as a function of the time since the start of the stage.
        capacity: Heat capacity of a body [J/K].
        initial: Its temperature when the condition begins [K]; nan: the one that it has.
        fallback: The same where it has none yet [K].
    """

    kind: Literal["insulated", "temperature", "flow", "capacity"] = "insulated"
    signal: Signal = _INSULATED
    capacity: float = 0.0
    initial: float = math.nan
    fallback: float = math.nan


def begin_bodies(
    conditions: Sequence[WallHeat], is_new: NDArray[np.bool_], temperature: Floats
) -> None:
    """Set the temperatures of walls whose heat capacity is new [K]; **modifies** that array."""
    for w, condition in enumerate(conditions):
        if condition.kind != "capacity" or not is_new[w]:
            continue
        if np.isfinite(condition.initial):
            temperature[w] = condition.initial
        elif not np.isfinite(temperature[w]):
            temperature[w] = condition.fallback


@dataclass(frozen=True)
class WallValues:
    """Temperatures [K] or flows [W] of walls in a step from ``start`` of the stage on [s]."""

    conditions: Sequence[WallHeat]
    start: float

    def pieces(self, dt: float) -> list[tuple[WallValues, float]]:
        """The step in pieces, cut where signals bend: values and length [s]; no pulse is missed."""
        corners = {
            time
            for wall in self.conditions
            if wall.kind in PRESCRIBED
            for time in wall.signal.corners(self.start, self.start + dt)
        }
        if not corners:
            return [(self, dt)]
        edges = [self.start, *sorted(corners), self.start + dt]
        return [
            (WallValues(self.conditions, a), b - a) for a, b in itertools.pairwise(edges) if b > a
        ]

    def temperatures(self, t: float, bodies: Floats) -> Floats:
        """Temperatures of the walls ``t`` seconds into the step [K], shape ``(w,)``; nan for none.

        ``bodies`` are those of the walls that have a heat capacity [K], shape ``(w,)``.
        """
        values = {"temperature": self(t), "capacity": bodies}
        return np.array(
            [
                values[wall.kind][w] if wall.kind in values else math.nan
                for w, wall in enumerate(self.conditions)
            ]
        )

    def lasting(self, dt: float) -> Floats:
        """Integral of the values over ``dt`` [K s] or [J], ``(w,)``: signals rise straight here."""
        found = np.zeros(len(self.conditions))
        for values, length in self.pieces(dt):
            found += length * values(0.5 * length)
        return found

    def undelivered(self, dt: float, reached: NDArray[Any]) -> float:
        """Heat that flow walls other than those ``reached`` could not pass on within ``dt`` [J]."""
        idle = np.array([c.kind == "flow" for c in self.conditions], np.bool_)
        if not idle.any():
            return 0.0
        idle[reached] = False
        return math.fsum(
            total(np.abs(values(0.5 * length)[idle])) * length for values, length in self.pieces(dt)
        )

    def __call__(self, t: float) -> Floats:
        """Values ``t`` seconds into the step, shape ``(w,)``; 0 where nothing is prescribed."""
        return np.array(
            [
                c.signal.value(self.start + t) if c.kind in PRESCRIBED else 0.0
                for c in self.conditions
            ]
        )
