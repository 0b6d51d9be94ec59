"""Wall bodies together: their shapes in one table, their inertia, and where the flow is before a row of glued grains."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from multicor_cli.arithmetic.sums import column_totals, mean, total
from multicor_cli.model import ShapeKind, WallBody
from multicor_cli.model.columns import RADIUS, X, Y
from multicor_cli.model.model import Floats, Walls, WallShapes
from multicor_cli.model.shapes import TAIL, Tail
from multicor_cli.packing.bodies import Shape, inertias, masses
from multicor_cli.scenario.gluing import Row

_LEVEL = math.sqrt(0.5)  # a row is a lid if its flow lies within 45 degrees below it


@dataclass(frozen=True)
class Front:
    """The side of a row of glued grains on which the flow is.

    Attributes:
        start: Where the line begins [m], shape ``(2,)``.
        along: Unit vector along it, shape ``(2,)``.
        normal: Unit vector towards the flow, shape ``(2,)``.
        length: Length of the line [m].
        depth: Grains whose center lies up to this far behind the line are refused [m]; infinite if it spans the period.
    """

    start: Floats
    along: Floats
    normal: Floats
    length: float
    depth: float

    @property
    def is_lid(self) -> bool:
        """Whether the flow is below the row."""
        return bool(self.normal[1] <= -_LEVEL)

    @classmethod
    def of(cls, row: Row, glued: Floats) -> Front:
        """The front of a row; x, y and radius of its grains [m], shape ``(k, 3)``."""
        start = np.array(row.start)
        along = (np.array(row.end) - start) / row.length
        normal = np.array([-along[1], along[0]]) * (1.0 if row.is_left else -1.0)
        return cls(start, along, normal, row.length, math.inf if row.is_closed else mean(glued[:, RADIUS]))


def with_glued(body: WallBody, glued: Floats) -> WallBody:
    """A wall with grains glued to it: x, y and radius in its frame [m], shape ``(k, 3)``."""
    return body.with_shapes(ShapeKind.DISC, np.column_stack([glued, np.zeros(len(glued))]))


def about_center_of_mass(body: WallBody, shape: Shape) -> WallBody:
    """A wall of discs with the center of their masses as its reference point, about which it turns freely."""
    discs = body.glued
    mass = masses(discs[:, RADIUS], 1.0, shape, 1.0)
    center = column_totals(discs[:, :2] * mass[:, np.newaxis]) / total(mass)
    geometry = body.geometry.copy()
    geometry[:, :2] -= center
    return WallBody(body.origin + center, body.kind, geometry, body.length)


def glued_inertia(body: WallBody, density: float, shape: Shape, thickness: float | None) -> tuple[float, float]:
    """Mass [kg] and moment of inertia about the reference point [kg m²] of the discs of a wall; nan if it has none."""
    glued = body.glued
    if not len(glued):
        return math.nan, math.nan
    mass = masses(glued[:, RADIUS], density, shape, thickness)
    about = inertias(glued[:, RADIUS], mass, shape) + mass * (glued[:, X] * glued[:, X] + glued[:, Y] * glued[:, Y])
    return total(mass), total(about)


def join_shapes(bodies: list[WallBody], materials: list[int]) -> WallShapes:
    """All shapes of all walls in one table; numbers of shapes then are rows of this table.

    Args:
        bodies: The walls in their order.
        materials: Index of the material of each wall.
    """
    counts = [len(body.kind) for body in bodies]
    geometry = [body.geometry.copy() for body in bodies]
    first = 0
    for body, rows in zip(bodies, geometry, strict=True):
        refers = (TAIL[body.kind] == Tail.SHAPES)[:, None] & (rows[:, 2:] >= 0.0)
        rows[:, 2:] += np.where(refers, first, 0)
        first += len(rows)
    return WallShapes(
        kind=np.concatenate([np.zeros(0, np.int32), *(body.kind for body in bodies)]),
        wall=np.repeat(np.arange(len(bodies), dtype=np.int32), counts),
        geometry=np.concatenate([np.zeros((0, 4)), *geometry]),
        material=np.repeat(np.array(materials, np.int32), counts),
    )


def join_walls(names: list[str], bodies: list[WallBody], inertia: list[tuple[float, float]], has_gravity: list[bool]) -> Walls:
    """The bodies of all walls; ``inertia`` holds mass [kg] and moment of inertia [kg m²] of each, nan where unknown."""
    table = np.array(inertia, float).reshape(-1, 2)
    return Walls(
        names=tuple(names),
        mass=table[:, 0].copy(),
        inertia=table[:, 1].copy(),
        has_gravity=np.array(has_gravity, bool),
        length=np.array([body.length for body in bodies], float),
    )
