"""From ``[[walls]]`` tables to wall bodies and shapes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.geometry.scene import place_shapes
from multicor_cli.model import WallBody
from multicor_cli.model.model import Floats, Walls, WallShapes
from multicor_cli.model.shapes import Room
from multicor_cli.packing.bodies import Shape, prism_inertia
from multicor_cli.packing.chain import chain_on_circle, chain_on_line
from multicor_cli.packing.errors import PackingError
from multicor_cli.packing.obstacles import Obstacles
from multicor_cli.packing.size_tables import sizes_of
from multicor_cli.packing.streams import Purpose, Stream, TableKind, stream
from multicor_cli.packing.walls import Front, about_center_of_mass, glued_inertia, join_shapes, join_walls, with_glued
from multicor_cli.scenario import Scenario
from multicor_cli.scenario.bodies import ClusterGeometry, PolygonGeometry, prism_height
from multicor_cli.scenario.gluing import Glued, Ring, Sides
from multicor_cli.scenario.models import ParticleGroup, Wall


class BuiltWalls(NamedTuple):
    """All walls of a scenario.

    Attributes:
        bodies: One for each wall.
        fronts: Where the flow is, for each wall that is a row of glued grains; None for the others.
        walls: Their inertia.
        shapes: Their shapes.
        position: Their reference points in the world [m] and angles, which are 0, shape ``(w, 3)``.
        rooms: What each leaves to the grains that packings place.
    """

    bodies: list[WallBody]
    fronts: list[Front | None]
    walls: Walls
    shapes: WallShapes
    position: Floats
    rooms: list[Room]

    def obstacles(self, group: int | None = None) -> Obstacles:
        """The shapes in the world, and what is left for grains; of the walls alone that a group meets, if one is given."""
        is_met = np.ones(len(self.bodies), np.bool_)
        if group is not None and self.walls.meets.size:
            is_met = self.walls.meets[:, group]
        met = np.flatnonzero(is_met).tolist()
        shapes = self.shapes if is_met.all() else join_shapes([self.bodies[w] for w in met], [0] * len(met))
        world = np.empty(shapes.geometry.shape)
        place_shapes(shapes.kind, shapes.wall, shapes.geometry, self.position[met], world)
        rooms = [self.rooms[w] for w in met]
        room = Room(
            tuple(area for room in rooms for area in room.inside),
            tuple(area for room in rooms for area in room.outside),
            max((room.period for room in rooms), default=0.0),
        )
        lids = [self.bodies[w] for w, front in enumerate(self.fronts) if front is not None and front.is_lid and is_met[w]]
        lowest = [float((body.origin[1] + body.glued[:, 1] - body.glued[:, 2]).min()) for body in lids]
        return Obstacles(shapes.kind, world, room, tuple(lowest))


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
    walls = join_walls(names, bodies, inertia, [wall.gravity for wall in scenario.walls])
    return BuiltWalls(
        bodies,
        [front for _, front in made],
        replace(walls, runs=_running(scenario), meets=_meetings(scenario)),
        join_shapes(bodies, [materials.index(wall.material) for wall in scenario.walls]),
        np.array([[*body.origin, 0.0] for body in bodies]).reshape(-1, 3),
        [_room(scenario, wall, body) for wall, body in zip(scenario.walls, bodies, strict=True)],
    )


def _running(scenario: Scenario) -> NDArray[np.bool_]:
    """`Walls.runs`."""
    named = [drives for stage in scenario.loading for drives in stage.drives.items()]
    names = {name for name, drive in named if drive.surface is not None}
    return np.array([wall.name in names for wall in scenario.walls] if names else [], np.bool_)


def _meetings(scenario: Scenario) -> NDArray[np.bool_]:
    """`Walls.meets`."""
    if all(wall.groups is None for wall in scenario.walls):
        return np.zeros((0, 0), np.bool_)
    return np.array([[wall.groups is None or g.name in wall.groups for g in scenario.particles] for wall in scenario.walls])


def _room(scenario: Scenario, wall: Wall, body: WallBody) -> Room:
    room = wall.geometry.room(body.glued + np.append(body.origin, 0.0))
    return replace(room, period=scenario.domain.period)


def _make(scenario: Scenario, index: int, wall: Wall) -> tuple[WallBody, Front | None]:
    body, glued = wall.geometry.body(scenario.domain), wall.geometry.glued(scenario.domain)
    if isinstance(wall.geometry, ClusterGeometry):
        body = about_center_of_mass(body, _shape(scenario))
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

    def restart(*side: int) -> Stream:
        return stream(scenario.seed, TableKind.WALLS, index, Purpose.SIZES, *side)

    if isinstance(place, Ring):
        return with_glued(body, chain_on_circle(place.radius, sizes, restart, is_outside=place.is_outside)), None
    if isinstance(place, Sides):
        corners = place.polygon.points - body.origin
        ends = zip(corners, np.roll(corners, -1, axis=0), strict=True)
        sides = [chain_on_line(start, end, sizes, partial(restart, k)) for k, (start, end) in enumerate(ends)]
        return with_glued(body, np.concatenate(sides)), None
    chain = chain_on_line(np.array(place.start), np.array(place.end), sizes, restart)
    return with_glued(body, chain - np.append(body.origin, 0.0)), Front.of(place, chain)


def _shape(scenario: Scenario) -> Shape:
    shape: Shape = scenario.particles[0].shape
    return shape


def _inertia(scenario: Scenario, wall: Wall, body: WallBody) -> tuple[float, float]:
    """Mass [kg] and moment of inertia [kg m²]: as given, else those of its discs or of its material, else nan.

    Where only the mass is given, the inertia that follows from the geometry is scaled with it: the same distribution of mass.
    """
    mass, inertia = _default_inertia(scenario, wall, body)
    if wall.mass is not None:
        inertia *= wall.mass / mass
        mass = wall.mass
    return mass, inertia if wall.inertia is None else wall.inertia


def _default_inertia(scenario: Scenario, wall: Wall, body: WallBody) -> tuple[float, float]:
    density, geometry = scenario.materials[wall.material].density, wall.geometry
    if geometry.substance is None:
        return math.nan, math.nan
    if isinstance(geometry, PolygonGeometry) and geometry.substance == "prism":
        height = prism_height(scenario.particles[0])
        return prism_inertia(geometry.area(), density, math.nan if height is None else height)
    return glued_inertia(body, density, _shape(scenario), _model_group(scenario, wall).thickness)


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
