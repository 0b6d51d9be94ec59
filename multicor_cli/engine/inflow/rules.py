"""How grains come and go in a run: what does not change of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.columns import X, Y
from multicor_cli.model.model import Floats


@dataclass(frozen=True)
class Rectangle:
    """A rectangle, sides included; sides may be infinite.

    Attributes:
        low: Lower left corner [m].
        high: Upper right corner [m].
    """

    low: tuple[float, float]
    high: tuple[float, float]

    def holds(self, position: Floats) -> NDArray[np.bool_]:
        """Which of the points, shape ``(k, ≥ 2)``, lie in it, shape ``(k,)``."""
        x, y = position[:, X], position[:, Y]
        return np.asarray(
            (x >= self.low[X]) & (x <= self.high[X]) & (y >= self.low[Y]) & (y <= self.high[Y])
        )


@dataclass(frozen=True)
class Release:
    """How the waiting grains of a group come: one after the other, in the order of their numbers.

    The k-th release (from 0) is due at ``start`` + k/rate, or, with a rate of mass, at ``start`` +
    the mass released before it over the rate. A grain takes the first of the places that
    ``draw(k)`` gives where it overlaps nothing; if there is none it waits, and the same places are
    tried before the next step.

    Attributes:
        group: The group.
        rate: Grains or mass per time [1/s, kg/s].
        is_mass: Whether it is a rate of mass.
        start: Time of the first release [s].
        region: Where; grains lie wholly in it.
        spans_period: Whether the region is the whole period wide: grains may then lie across its
            ends.
        velocity: Velocity [m/s] and spin [rad/s] that grains come with.
        draw: Numbers in [0, 1) for the places tried, shape ``(tries, 2)``, given the number of the
            release.
    """

    group: int
    rate: float
    is_mass: bool
    start: float
    region: Rectangle
    spans_period: bool
    velocity: tuple[float, float, float]
    draw: Callable[[int], Floats]

    def allowed(self, time: float) -> float:
        """What may have been released before the next one at a time [s]: grains, or mass [kg];
        negative before the start.
        """
        return self.rate * (time - self.start)


@dataclass(frozen=True)
class Outlet:
    """Where grains leave.

    Attributes:
        region: A grain whose center lies in it leaves.
        returns: Whether it goes back to wait, if its group has a release.
    """

    region: Rectangle
    returns: bool


@dataclass(frozen=True)
class InflowRules:
    """How grains come and go.

    Attributes:
        releases: One for each group that has one.
        outlets: The outlets, in the order of `Model.outlets`.
        limits: A grain whose center is beyond is lost; None: none is.
        stops: Whether a lost grain ends the run; otherwise it is removed.
    """

    releases: tuple[Release, ...] = ()
    outlets: tuple[Outlet, ...] = ()
    limits: Rectangle | None = None
    stops: bool = False
