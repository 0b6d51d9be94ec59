"""How grains come and go in a run: what does not change of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from multicor_cli.model.model import Floats
from multicor_cli.model.shapes import Rectangle


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
        spans_period: Whether it is the whole period wide: grains may then lie across its ends.
        velocity: Velocity [m/s] and spin [rad/s] that grains come with.
        angles: At which each grain of the group comes [rad], of size 0 if all are discs.
        draw: For the k-th release, numbers in [0, 1) for the places tried, shape ``(tries, 2)``.
    """

    group: int
    rate: float
    is_mass: bool
    start: float
    region: Rectangle
    spans_period: bool
    velocity: tuple[float, float, float]
    angles: Floats
    draw: Callable[[int], Floats]

    def allowed(self, time: float) -> float:
        """Grains or mass [kg] that may have come by a time [s]; negative before the start."""
        return self.rate * (time - self.start)


@dataclass(frozen=True)
class Outlet:
    """Where grains leave whose center lies in it.

    With ``returns`` they go back to wait, if their group has a release.
    """

    region: Rectangle
    returns: bool


@dataclass(frozen=True)
class InflowRules:
    """How grains come and go: releases of groups, and outlets in the order of `Model.outlets`.

    A grain whose center is beyond ``limits``, if there are any, is lost: that ends the run if it
    ``stops``, else the grain is removed.
    """

    releases: tuple[Release, ...] = ()
    outlets: tuple[Outlet, ...] = ()
    limits: Rectangle | None = None
    stops: bool = False
