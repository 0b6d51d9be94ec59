"""Where grains are glued to walls: in a row on a line, in a ring inside or around a circle, or along the sides of a polygon."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from pydantic import Discriminator, Tag

from multicor_cli.arithmetic import hypot
from multicor_cli.model.shapes import Polygon
from multicor_cli.scenario.base import Name, tag_table
from multicor_cli.scenario.sizes import Sizes

Pair = tuple[float, float]
SizesOrGroup = Annotated[Annotated[Name, Tag("<plain>")] | Annotated[Sizes, Tag("<table>")], Discriminator(tag_table)]


class Row(NamedTuple):
    """Touching grains with their centers on a line.

    Attributes:
        start: Where the line begins [m].
        end: Where it ends [m].
        is_left: Whether the flow is on the left, looking from start to end.
        is_closed: Whether the line spans the period, so that the last grain touches the first.
    """

    start: Pair
    end: Pair
    is_left: bool
    is_closed: bool

    @property
    def length(self) -> float:
        """Length of the line [m]."""
        return hypot(self.end[0] - self.start[0], self.end[1] - self.start[1])

    @property
    def middle(self) -> Pair:
        """Middle of the line [m]."""
        return 0.5 * (self.start[0] + self.end[0]), 0.5 * (self.start[1] + self.end[1])

    @property
    def least(self) -> float:
        """Smallest length, over the diameter of the largest grain."""
        return 1.0

    def __str__(self) -> str:
        """What it is, for messages."""
        return f"the line is {self.length:g} m long"


class Ring(NamedTuple):
    """Touching grains that touch a circle from inside or outside.

    Attributes:
        center: Center of the circle [m], the reference point of the wall.
        radius: Its radius [m].
        is_outside: Whether they lie around it.
    """

    center: Pair
    radius: float
    is_outside: bool = False

    @property
    def length(self) -> float:
        """Circumference of the circle [m]."""
        return 2.0 * math.pi * self.radius

    @property
    def least(self) -> float:
        """Smallest circumference, over the diameter of the largest grain."""
        return 2.0 * math.pi if self.is_outside else 4.0 * math.pi

    def __str__(self) -> str:
        """What it is, for messages."""
        return f"the circle has a radius of {self.radius:g} m"


class Sides(NamedTuple):
    """Touching grains along each side of a polygon, with their centers on it."""

    polygon: Polygon

    @property
    def length(self) -> float:
        """Length of all sides [m]."""
        return self.polygon.perimeter

    @property
    def least(self) -> float:
        """Smallest length of all sides, over the diameter of the largest grain: the shortest side takes one."""
        return self.length / float(self.polygon.side_lengths().min())

    def __str__(self) -> str:
        """What it is, for messages."""
        return f"the shortest side is {float(self.polygon.side_lengths().min()):g} m long"


class Glued(NamedTuple):
    """The grains glued to a wall.

    Attributes:
        place: Where they are.
        sizes: What the scenario says about their sizes: name of a group of particles, or a table; None: as the first group.
        key: Under which key of the geometry it says so.
    """

    place: Row | Ring | Sides
    sizes: SizesOrGroup | None
    key: str
