"""From ``[[walls]]`` tables to wall bodies and shapes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from multicor_cli.engine.geometry.scene import place_shapes
from multicor_cli.model import WallBody
from multicor_cli.model.model import Floats, Walls, WallShapes
from multicor_cli.packing.bodies import Shape
from multicor_cli.packing.chain import chain_in_circle, chain_on_line
from multicor_cli.packing.errors import PackingError
from multicor_cli.packing.obstacles import Obstacles
from multicor_cli.packing.size_tables import sizes_of
from multicor_cli.packing.streams import Purpose, Stream, TableKind, stream
from multicor_cli.packing.walls import Front, glued_inertia, join_shapes, join_walls, with_glued
from multicor_cli.scenario import Scenario
from multicor_cli.scenario.gluing import Glued, Ring
from multicor_cli.scenario.models import ParticleGroup, Wall


class BuiltWalls(NamedTuple):
    """All walls of a scenario.

    Attributes:
        bodies: One for each wall.
        fronts: Where the flow is, for each wall that is a row of glued grains; None for the others.
        walls: Their inertia.
        shapes: Their shapes.
        position: Their reference points in the world [m] and angles, which are 0, shape ``(w, 3)``.
    """

    bodies: list[WallBody]
    fronts: list[Front | None]
    walls: Walls
    shapes: WallShapes
    position: Floats

    def obstacles(self) -> Obstacles:
        """The shapes in the world."""
        world = np.empty(self.shapes.geometry.shape)
        place_shapes(self.shapes.kind, self.shapes.wall, self.shapes.geometry, self.position, world)
        return Obstacles(self.shapes.kind, world)


def build_walls(scenario: Scenario, known: Mapping[str, WallBody] | None = None) -> BuiltWalls:
    """The walls in the order of the file.

    Args:
        scenario: The scenario.
        known: Walls that are there already, by their names; no front is known of them.

    Raises:
        PackingError: Glued grains cannot be made; its key begins at the wall.
    """
    materials = list(scenario.materials)
    there = known or {}
    made = [(there[wall.name], None) if wall.name in there else _make(scenario, k, wall) for k, wall in enumerate(scenario.walls)]
    bodies = [body for body, _ in made]
    inertia = [_inertia(scenario, wall, body) for wall, body in zip(scenario.walls, bodies, strict=True)]
    names = [wall.name for wall in scenario.walls]
    return BuiltWalls(
        bodies,
        [front for _, front in made],
        join_walls(names, bodies, inertia, [wall.gravity for wall in scenario.walls]),
        join_shapes(bodies, [materials.index(wall.material) for wall in scenario.walls]),
        np.array([[*body.origin, 0.0] for body in bodies]).reshape(-1, 3),
    )


def _make(scenario: Scenario, index: int, wall: Wall) -> tuple[WallBody, Front | None]:
    body, glued = wall.geometry.body(scenario.domain), wall.geometry.glued(scenario.domain)
    if glued is None:
        return body, None
    try:
        return _glue(scenario, index, wall, body, glued)
    except PackingError as error:
        raise PackingError(error.message, error.remedy, ("walls", index, "geometry", *error.key)) from error


def _glue(scenario: Scenario, index: int, wall: Wall, body: WallBody, glued: Glued) -> tuple[WallBody, Front | None]:
    table = scenario.glued_sizes(wall)
    assert table is not None  # the scenario has been checked
    sizes, place = sizes_of(table, _shape(scenario)), glued.place

    def restart() -> Stream:
        return stream(scenario.seed, TableKind.WALLS, index, Purpose.SIZES)

    if isinstance(place, Ring):
        return with_glued(body, chain_in_circle(place.radius, sizes, restart)), None
    chain = chain_on_line(np.array(place.start), np.array(place.end), sizes, restart)
    return with_glued(body, chain - np.append(body.origin, 0.0)), Front.of(place, chain)


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
    glued = wall.geometry.glued()
    named = None if glued is None else glued.sizes
    if isinstance(named, str):
        return next(group for group in scenario.particles if group.name == named)
    if named is None:
        return scenario.particles[0]
    same = (group for group in scenario.particles if group.material == wall.material)
    return next(same, scenario.particles[0])
