"""What the rest of the program asks of the geometry of a wall, whatever its kind."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator
from typing import Literal

from multicor_cli.arithmetic import hypot
from multicor_cli.model import WallBody
from multicor_cli.model.model import Floats
from multicor_cli.model.shapes import Room, outlines
from multicor_cli.scenario.base import Table
from multicor_cli.scenario.gluing import Glued
from multicor_cli.scenario.problems import Finding
from multicor_cli.scenario.settings import Domain

Substance = Literal["discs", "prism"]
"""What a wall weighs: its discs, glued or solid, or the polygon that it fills times a thickness."""


class WallGeometry(Table):
    """What the rest of the program asks of every geometry."""

    @abstractmethod
    def body(self, domain: Domain) -> WallBody:
        """Its shapes without glued grains."""

    def glued(self, domain: Domain | None = None) -> Glued | None:
        """Its glued grains; None if it has none. Without a domain, nothing is fitted to the period."""
        return None

    def misfits(self, domain: Domain) -> Iterator[Finding]:
        """What does not fit to the domain; keys count from the table of the geometry."""
        yield from ()

    def room(self, discs: Floats) -> Room:
        """What it leaves to grains: where packings place none in its solid matter. Walls without an inside leave everything.

        Args:
            discs: x, y and radius of its discs in the world [m], shape ``(k, 3)``.
        """
        return Room()

    @property
    def substance(self) -> Substance | None:
        """What its mass follows from if none is given; None if it has to be given."""
        return None if self.glued() is None else "discs"

    def spans_period(self, domain: Domain) -> bool:
        """Whether it reaches farther than half a period from its reference point, so that it cannot turn: images would meet."""
        if not domain.periodic:
            return False
        body, half = self.body(domain), 0.5 * domain.period
        for _, outline in outlines(body.kind, body.geometry):
            reach = max(hypot(*point) for point in outline.points.reshape(-1, 2).tolist())
            # A line of one period is joined to its image; a circle of that width is not.
            if outline.radius is None:
                spans = reach >= half * (1.0 - 1e-9)
            else:
                spans = reach + float(outline.radius.max()) > half * (1.0 + 1e-9)
            if spans:
                return True
        return False

    @property
    def height(self) -> float | None:
        """Height y at which it bounds a layer [m]; None if it has no definite one."""
        return None
