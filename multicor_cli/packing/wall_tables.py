"""From ``[[walls]]`` tables to wall bodies and shapes."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from multicor_cli.model.model import Floats, Walls, WallShapes
from multicor_cli.packing.bodies import Shape
from multicor_cli.packing.chain import chain_in_circle, chain_on_line
from multicor_cli.packing.errors import PackingError
from multicor_cli.packing.region import spans_period
from multicor_cli.packing.size_tables import sizes_of
from multicor_cli.packing.streams import Purpose, Stream, Table, stream
from multicor_cli.packing.walls import (
    WallBody,
    box,
    circle,
    glued_inertia,
    join_shapes,
    join_walls,
    plane,
    polyline,
    rough_circle,
    rough_line,
)
from multicor_cli.scenario import Scenario
from multicor_cli.scenario.models import (
    BoxGeometry,
    CircleGeometry,
    ParticleGroup,
    PlaneGeometry,
    RoughGeometry,
    Wall,
)


class BuiltWalls(NamedTuple):
    """All walls of a scenario.

    Attributes:
        bodies: One for each wall.
        walls: Their inertia.
        shapes: Their shapes.
        origins: Their reference points in the world [m], shape ``(w, 2)``.
    """

    bodies: list[WallBody]
    walls: Walls
    shapes: WallShapes
    origins: Floats


def build_walls(scenario: Scenario) -> BuiltWalls:
    """The walls in the order of the file.

    Raises:
        PackingError: Glued grains cannot be made; its key begins at the wall.
    """
    materials = list(scenario.materials)
    bodies = [_body(scenario, k, wall) for k, wall in enumerate(scenario.walls)]
    inertia = [_inertia(scenario, wall, body) for wall, body in zip(scenario.walls, bodies, strict=True)]
    names = [wall.name for wall in scenario.walls]
    return BuiltWalls(
        bodies,
        join_walls(names, bodies, inertia, [wall.gravity for wall in scenario.walls]),
        join_shapes(bodies, [materials.index(wall.material) for wall in scenario.walls]),
        np.array([body.origin for body in bodies]).reshape(-1, 2),
    )


def _body(scenario: Scenario, index: int, wall: Wall) -> WallBody:
    geometry, domain = wall.geometry, scenario.domain
    if isinstance(geometry, PlaneGeometry):
        return plane(np.array(geometry.point), np.array(geometry.normal), domain.size)
    if isinstance(geometry, BoxGeometry):
        return box(np.array(geometry.min), np.array(geometry.max), geometry.open)
    if isinstance(geometry, CircleGeometry) and geometry.rough is None:
        return circle(np.array(geometry.center), geometry.radius)
    if isinstance(geometry, RoughGeometry | CircleGeometry):
        try:
            return _rough(scenario, index, wall, geometry)
        except PackingError as error:
            raise PackingError(error.message, error.remedy, ("walls", index, "geometry", *error.key)) from error
    return polyline(np.array(geometry.points), geometry.closed)


def _rough(scenario: Scenario, index: int, wall: Wall, geometry: RoughGeometry | CircleGeometry) -> WallBody:
    table = scenario.glued_sizes(wall)
    assert table is not None  # the scenario has been checked
    sizes = sizes_of(table, _shape(scenario))

    def restart() -> Stream:
        return stream(scenario.seed, Table.WALLS, index, Purpose.SIZES)

    if isinstance(geometry, CircleGeometry):
        return rough_circle(np.array(geometry.center), geometry.radius, chain_in_circle(geometry.radius, sizes, restart))
    start, end = np.array(geometry.start), np.array(geometry.end)
    period = scenario.domain.size[0] if scenario.domain.periodic else 0.0
    is_level = abs(end[1] - start[1]) <= 1e-9 * abs(end[0] - start[0])
    spans = is_level and spans_period(min(start[0], end[0]), max(start[0], end[0]), period)
    if spans:  # exactly, so that the last glued grain touches the first
        end = start + np.array([math.copysign(period, end[0] - start[0]), 0.0])
    return rough_line(start, end, geometry.side == "left", chain_on_line(start, end, sizes, restart), spans)


def _shape(scenario: Scenario) -> Shape:
    shape: Shape = scenario.particles[0].shape
    return shape


def _inertia(scenario: Scenario, wall: Wall, body: WallBody) -> tuple[float, float]:
    """Mass [kg] and moment of inertia [kg m²]: as given, else those of the glued grains, else nan.

    Where only the mass is given, the inertia of the glued grains is scaled with it: the same distribution of mass.
    """
    density = scenario.materials[wall.material].density
    mass, inertia = glued_inertia(body, density, _shape(scenario), _model_group(scenario, wall).thickness)
    if wall.mass is not None:
        inertia *= wall.mass / mass
        mass = wall.mass
    return mass, inertia if wall.inertia is None else wall.inertia


def _model_group(scenario: Scenario, wall: Wall) -> ParticleGroup:
    """The group whose thickness glued grains have: the one they take their sizes from, else the first of their material."""
    named = wall.glued_sizes
    if isinstance(named, str):
        return next(group for group in scenario.particles if group.name == named)
    if named is None:
        return scenario.particles[0]
    same = (group for group in scenario.particles if group.material == wall.material)
    return next(same, scenario.particles[0])
