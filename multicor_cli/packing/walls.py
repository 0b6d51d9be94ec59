"""From ``[[walls]]`` to wall bodies and shapes, with glued grains; what packings stay clear of."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import NamedTuple

import numpy as np

from multicor_cli.arithmetic import hypot
from multicor_cli.arithmetic.sums import column_totals, mean, total
from multicor_cli.engine.geometry.scene import place_shapes
from multicor_cli.engine.jit import arrays
from multicor_cli.model import WallBody
from multicor_cli.model.columns import RADIUS, TAIL_X, X, Y
from multicor_cli.model.model import Floats, Ints, Walls, WallShapes
from multicor_cli.model.outlines import Outlines
from multicor_cli.model.shapes import TAIL, Annulus, Area, Polygon, Room, ShapeKind, Tail, outlines
from multicor_cli.packing.initial_grains import PackingRegion, Shape, inertias, masses
from multicor_cli.packing.sizes import (
    Purpose,
    SizeDistribution,
    Stream,
    TableKind,
    diameter,
    draw_to_total,
    sizes_of,
    stream,
)
from multicor_cli.scenario import Scenario
from multicor_cli.scenario.particles import ParticleGroup
from multicor_cli.scenario.problems import Refused
from multicor_cli.scenario.walls import (
    ClusterGeometry,
    PolygonGeometry,
    Ring,
    Row,
    Sides,
    Wall,
    prism_height,
)

# ---- Rows of touching glued grains: along a line, and inside or around a circle

_ROUNDS = 20
_BISECTIONS = 200


def chain_on_line(
    start: Floats, end: Floats, sizes: SizeDistribution, restart: Callable[[], Stream]
) -> Floats:
    """Discs with centers on a line, each touching the next: x, y, radius [m], shape ``(k, 3)``.

    The number of discs is the one whose diameters add up best to the length of the line; the radii
    are then scaled by one factor close to 1, so that the chain begins and ends exactly at the ends
    of the line (the first and last disc touch them from inside). If the line spans a period, the
    last disc therefore touches the first. ``restart`` gives the random stream at its beginning.
    `Refused` if the line is shorter than one grain.
    """
    length = hypot(*(end - start).tolist())
    _check_length(length, 2.0 * sizes.largest, "line")
    radii = draw_to_total(sizes, diameter, length, restart)
    radii = radii * (length / total(diameter(radii)))
    along = np.cumsum(diameter(radii)) - radii
    return np.column_stack([start + along[:, None] * ((end - start) / length), radii])


def chain_on_circle(
    radius: float,
    sizes: SizeDistribution,
    restart: Callable[[], Stream],
    *,
    is_outside: bool = False,
) -> Floats:
    """Discs along a circle around the origin, each touching the next: x, y, radius [m], ``(k, 3)``.

    As with `chain_on_line`, the radii are scaled by one factor so that the chain closes.
    ``is_outside``: they touch the circle, of ``radius`` [m], from outside. `Refused` unless that is
    four times as large as the grains, or twice from outside.
    """
    side = 1.0 if is_outside else -1.0
    _check_length(radius, (2.0 if is_outside else 4.0) * sizes.largest, "radius of the circle")

    def angles(radii: Floats) -> Floats:
        # What each grain takes of the full circle; exact for equal grains.
        return np.asarray(2.0 * arrays.asin(radii / (radius + side * radii)))

    radii = draw_to_total(sizes, angles, 2.0 * math.pi, restart)
    found = {}
    for _ in range(_ROUNDS):  # unequal neighbors take a little less: a few grains more are needed
        factor = _closing_factor(radii, radius, side)
        found[radii.size] = abs(factor - 1.0), factor * radii
        after = round(radii.size * factor)
        if after in found:
            break
        radii = sizes.draw(after, restart())
    radii = min(found.values(), key=lambda pair: pair[0])[1]
    steps = _turns(radii, radius, side)
    bearing = np.concatenate([[0.0], np.cumsum(steps[:-1])])
    away = radius + side * radii
    return np.column_stack([away * arrays.cos(bearing), away * arrays.sin(bearing), radii])


def _turns(radii: Floats, radius: float, side: float) -> Floats:
    """Angle at the circle's center from each disc to the next [rad]; side 1 outside, −1 inside."""
    after = np.roll(radii, -1)
    a, b, c = radius + side * radii, radius + side * after, radii + after
    return np.asarray(arrays.acos(np.clip((a * a + b * b - c * c) / (2.0 * a * b), -1.0, 1.0)))


def _closing_factor(radii: Floats, radius: float, side: float) -> float:
    """Factor on the radii that makes the turns a full circle (bisection to the last bit)."""
    low, high = 0.5, 2.0 if side > 0.0 else min(2.0, 0.49 * radius / float(radii.max()))
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        if total(_turns(middle * radii, radius, side)) < 2.0 * math.pi:
            low = middle
        else:
            high = middle
    return low


def _check_length(length: float, needed: float, what: str) -> None:
    if length < needed:
        fault = f"the {what}, {length:g} m, is too short for glued grains: at least {needed:g} m"
        raise Refused((), fault, "make it longer or the grains smaller")


# ---- What packings stay clear of: walls, solid matter, the region's boundary, earlier grains

OPEN = Room()
"""All of the plane."""

GRAIN = 3
"""Column of discs among obstacles: 1 + the number of the grain around which it is drawn, or 0."""


@dataclass(frozen=True)
class Obstacles:
    """Shapes that do not move, in the world [m], else as `multicor_cli.model.WallShapes`.

    ``room`` is what solid bodies and the region leave: outlines do not tell on which side to be.
    ``lids`` are heights of the lowest points of rows of glued grains under which grains are to be
    [m]. Of grains that are no discs, ``grains``, with their angles, there are the circles around
    them, which know their number.
    """

    kind: Ints
    world: Floats
    room: Room = OPEN
    lids: tuple[float, ...] = ()
    grains: Outlines | None = None
    angle: Floats = field(default_factory=lambda: np.zeros(0))

    @classmethod
    def none(cls) -> Obstacles:
        return cls(np.zeros(0, np.int32), np.zeros((0, 4)))

    @property
    def is_disc(self) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        return np.asarray(self.kind == ShapeKind.DISC)

    def discs(self) -> Floats:
        """x, y and radius of the discs [m], shape ``(k, 3)``."""
        return self.world[self.is_disc, :3]

    def with_discs(self, discs: Floats) -> Obstacles:
        """Append discs x, y, radius [m], shape ``(k, 3)``; shapes before keep their numbers."""
        rows = np.zeros((len(discs), 4))
        rows[:, :3] = discs
        return self._append(ShapeKind.DISC, rows)

    def with_grains(self, discs: Floats, outlines: Outlines, angle: Floats) -> Obstacles:
        """Append grains that are no discs: x, y, reach [m], shape ``(k, 3)``, angles [rad]."""
        rows = np.column_stack([discs, 1.0 + self.angle.size + np.arange(len(discs))])
        parts = [outlines] if self.grains is None else [self.grains, outlines]
        added = replace(
            self, grains=Outlines.joined(parts), angle=np.concatenate([self.angle, angle])
        )
        return added._append(ShapeKind.DISC, rows)

    @property
    def is_grain(self) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        """Which shapes stand for grains that are no discs."""
        return np.asarray(self.is_disc & (self.world[:, GRAIN] > 0.0))

    def parted(self) -> tuple[Obstacles, Obstacles]:
        """All but the grains that are no discs, which go to infinity, and these alone."""
        is_grain, world = self.is_grain, self.world.copy()
        world[is_grain, Y] = math.inf  # vertices know lines by their numbers
        alone = replace(self, kind=self.kind[is_grain], world=self.world[is_grain])
        return replace(self, world=world), alone

    def with_sides(self, region: PackingRegion) -> Obstacles:
        """Append planes along those sides of ``region`` that are closed."""
        left, bottom, planes = region.left, region.bottom, []
        if not region.is_periodic:
            planes += [(left, bottom, 1.0, 0.0), (region.right, bottom, -1.0, 0.0)]
        if not region.is_periodic_in_y:
            planes += [(left, bottom, 0.0, 1.0), (left, region.top, 0.0, -1.0)]
        return self._append(ShapeKind.PLANE, np.array(planes).reshape(-1, 4))

    def with_boundary(self, area: Area) -> Obstacles:
        """Append the outline of an area that is not a rectangle, inside which grains are to be."""
        added = replace(self, room=self.room.within(area))
        if isinstance(area, Annulus):
            added = added._append(ShapeKind.CIRCLE, np.array([[*area.center, area.outer, 0.0]]))
            inner = np.array([[*area.center, area.inner]])
            return added.with_discs(inner) if area.inner > 0.0 else added
        assert isinstance(area, Polygon)  # rectangles have none
        points, first, number = area.points, len(self.kind), np.arange(len(area.points))
        sides = np.column_stack([points, np.roll(points, -1, axis=0)])
        corners = np.column_stack([points, first + np.roll(number, 1), first + number])
        return added._append(ShapeKind.SIDE, sides)._append(ShapeKind.VERTEX, corners)

    def around(self, region: PackingRegion, period: float) -> Obstacles:
        """Make the obstacles of a periodic domain fit for ``region``, maybe a part of the period.

        A region that spans the period is packed with its own periodicity and nothing changes. Any
        other is packed as if space were not periodic, so what reaches into it from neighboring
        periods is added.
        """
        if period <= 0.0 or region.is_periodic:
            return self
        ends = np.empty((2, self.kind.size))
        for which, outline in outlines(self.kind, self.world):
            ends[:, which] = outline.corners()[:, :, X]
        has_ends = self.kind != ShapeKind.PLANE  # planes are level
        nearby = self
        left = float(ends[0, has_ends].min(initial=region.right))
        right = float(ends[1, has_ends].max(initial=region.left))
        first = math.floor((region.left - right) / period)
        for k in range(first, math.ceil((region.right - left) / period) + 1):
            moved = ends + k * period
            near = has_ends & (moved[1] > region.left) & (moved[0] < region.right)
            refers = TAIL[self.kind] == Tail.SHAPES
            for end in self.world[near & refers, TAIL_X:].astype(np.int64).T:
                near[end[end >= 0]] = True  # a vertex asks its lines
            if k == 0 or not near.any():
                continue
            rows, refers = self.world[near].copy(), refers[near]
            rows[:, X] += k * period
            rows[TAIL[self.kind[near]] == Tail.POINT, TAIL_X] += k * period
            place = np.where(near, len(nearby.kind) + np.cumsum(near) - 1, -1)
            tail = rows[refers, TAIL_X:].astype(np.int64)
            rows[refers, TAIL_X:] = np.where(tail >= 0, place[tail], -1)
            nearby = nearby._append(self.kind[near], rows)
        return nearby

    def _append(self, kind: ShapeKind | Ints, rows: Floats) -> Obstacles:
        kinds = np.full(len(rows), kind, np.int32)
        return replace(
            self, kind=np.concatenate([self.kind, kinds]), world=np.concatenate([self.world, rows])
        )


# ---- Walls together: shapes in one table, inertia, and where the flow is before glued grains

_LEVEL = math.sqrt(0.5)  # a row is a lid if its flow lies within 45 degrees below it


@dataclass(frozen=True)
class Front:
    """Where the flow is beside a row of glued grains, by unit vectors along and normal to it.

    The line begins at ``start``, of this ``length`` [m]; the normal points to the flow. Up to
    ``depth`` [m] behind it no center may be; infinite if it spans the period.
    """

    start: Floats
    along: Floats
    normal: Floats
    length: float
    depth: float

    @classmethod
    def of(cls, row: Row, glued: Floats) -> Front:
        """The front of a row; x, y and radius of its grains [m], shape ``(k, 3)``."""
        start = np.array(row.start)
        along = (np.array(row.end) - start) / row.length
        normal = np.array([-along[1], along[0]]) * (1.0 if row.is_left else -1.0)
        return cls(
            start, along, normal, row.length, math.inf if row.is_closed else mean(glued[:, RADIUS])
        )


def about_center_of_mass(body: WallBody, shape: Shape) -> WallBody:
    """A wall of discs with its center of mass as reference point, about which it turns freely."""
    discs = body.glued
    mass = masses(discs[:, RADIUS], 1.0, shape, 1.0)
    center = column_totals(discs[:, :2] * mass[:, np.newaxis]) / total(mass)
    geometry = body.geometry.copy()
    geometry[:, :2] -= center
    return WallBody(body.origin + center, body.kind, geometry, body.length)


def join_shapes(bodies: list[WallBody], materials: list[int]) -> WallShapes:
    """Shapes of all walls in one table, whose rows number them; ``materials`` are by wall."""
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


def join_walls(
    names: list[str],
    bodies: list[WallBody],
    inertia: list[tuple[float, float]],
    has_gravity: list[bool],
) -> Walls:
    """All walls; ``inertia``: mass [kg] and moment of inertia [kg m²] of each, nan if unknown."""
    table = np.array(inertia, float).reshape(-1, 2)
    return Walls(
        names=tuple(names),
        mass=table[:, 0].copy(),
        inertia=table[:, 1].copy(),
        has_gravity=np.array(has_gravity, bool),
        length=np.array([body.length for body in bodies], float),
    )


# ---- From `[[walls]]` tables to wall bodies and shapes


class BuiltWalls(NamedTuple):
    """All walls of a scenario, with a body for each.

    Attributes:
        fronts: Where the flow is, for each wall that is a row of glued grains; else None.
        walls: Their inertia.
        shapes: Their shapes.
        position: Reference points in the world [m] and angles, which are 0, shape ``(w, 3)``.
        rooms: What each leaves to the grains that packings place.
    """

    bodies: list[WallBody]
    fronts: list[Front | None]
    walls: Walls
    shapes: WallShapes
    position: Floats
    rooms: list[Room]

    def obstacles(self, group: int | None = None) -> Obstacles:
        """Shapes in the world, and room left to grains; of the walls alone that ``group`` meets."""
        is_met = np.ones(len(self.bodies), np.bool_)
        if group is not None and self.walls.meets.size:
            is_met = self.walls.meets[:, group]
        met = np.flatnonzero(is_met).tolist()
        shapes = self.shapes
        if not is_met.all():
            shapes = join_shapes([self.bodies[w] for w in met], [0] * len(met))
        world = np.empty(shapes.geometry.shape)
        place_shapes(shapes.kind, shapes.wall, shapes.geometry, self.position[met], world)
        rooms = [self.rooms[w] for w in met]
        room = Room(
            tuple(area for room in rooms for area in room.inside),
            tuple(area for room in rooms for area in room.outside),
            max((room.period for room in rooms), default=0.0),
        )
        lids = []
        for body, front in ((self.bodies[w], self.fronts[w]) for w in met):
            if front is not None and front.normal[1] <= -_LEVEL:
                lids.append(float((body.origin[1] + body.glued[:, 1] - body.glued[:, 2]).min()))
        return Obstacles(shapes.kind, world, room, tuple(lids))


def build_walls(scenario: Scenario, known: Mapping[str, WallBody] | None = None) -> BuiltWalls:
    """The walls in the order of the file; no front is known of those that are there (``known``).

    `Refused` if glued grains cannot be made; its key begins at the wall.
    """
    materials, period = list(scenario.materials), scenario.domain.period
    there = known or {}
    made = [
        (there[wall.name], None) if wall.name in there else _make(scenario, k, wall)
        for k, wall in enumerate(scenario.walls)
    ]
    bodies = [body for body, _ in made]
    each = list(zip(scenario.walls, bodies, strict=True))
    names = [wall.name for wall in scenario.walls]
    inertia = [_inertia(scenario, wall, body) for wall, body in each]
    walls = join_walls(names, bodies, inertia, [wall.gravity for wall in scenario.walls])
    drives = [drive for stage in scenario.loading for drive in stage.drives.items()]
    running = {name for name, drive in drives if drive.surface is not None}
    meets = [
        [wall.groups is None or group.name in wall.groups for group in scenario.particles]
        for wall in scenario.walls
    ]
    is_met_by_all = all(wall.groups is None for wall in scenario.walls)
    rooms = [wall.geometry.room(body.glued + np.append(body.origin, 0.0)) for wall, body in each]
    return BuiltWalls(
        bodies,
        [front for _, front in made],
        replace(
            walls,
            runs=np.array([name in running for name in names] if running else [], np.bool_),
            meets=np.zeros((0, 0), np.bool_) if is_met_by_all else np.array(meets),
        ),
        join_shapes(bodies, [materials.index(wall.material) for wall in scenario.walls]),
        np.array([[*body.origin, 0.0] for body in bodies]).reshape(-1, 3),
        [replace(room, period=period) for room in rooms],
    )


def _make(scenario: Scenario, index: int, wall: Wall) -> tuple[WallBody, Front | None]:
    body, glued = wall.geometry.body(scenario.domain), wall.geometry.glued(scenario.domain)
    if isinstance(wall.geometry, ClusterGeometry):
        body = about_center_of_mass(body, scenario.particles[0].body)
    if glued is None:
        return body, None
    table, place = scenario.glued_sizes(wall), glued.place
    assert table is not None  # the scenario has been checked
    sizes = sizes_of(table, scenario.particles[0].body)

    def restart(*side: int) -> Stream:
        return stream(scenario.seed, TableKind.WALLS, index, Purpose.SIZES, *side)

    front = None
    try:
        if isinstance(place, Ring):
            discs = chain_on_circle(place.radius, sizes, restart, is_outside=place.is_outside)
        elif isinstance(place, Sides):
            corners = place.polygon.points - body.origin
            ends = enumerate(zip(corners, np.roll(corners, -1, axis=0), strict=True))
            discs = np.concatenate(
                [chain_on_line(*pair, sizes, partial(restart, k)) for k, pair in ends]
            )
        else:
            chain = chain_on_line(np.array(place.start), np.array(place.end), sizes, restart)
            discs, front = chain - np.append(body.origin, 0.0), Front.of(place, chain)
    except Refused as error:
        raise error.within("walls", index, "geometry") from error
    return body.with_shapes(ShapeKind.DISC, np.column_stack([discs, np.zeros(len(discs))])), front


def _inertia(scenario: Scenario, wall: Wall, body: WallBody) -> tuple[float, float]:
    """Mass [kg], moment of inertia [kg m²]: as given, else of its discs or its material, else nan.

    Where only the mass is given, the inertia that follows from the geometry is scaled with it: the
    same distribution of mass.
    """
    density, geometry = scenario.materials[wall.material].density, wall.geometry
    first, discs = scenario.particles[0], body.glued
    mass = inertia = math.nan
    if isinstance(geometry, PolygonGeometry) and geometry.substance == "prism":
        # ρ h A, and about the centroid ρ h ∫ r² dA
        polygon, height = geometry.area(), prism_height(first)
        height = math.nan if height is None else height
        mass, inertia = density * height * polygon.size, density * height * polygon.polar_moment
    elif geometry.substance is not None and len(discs):
        thickness = _model_group(scenario, wall).thickness
        each = masses(discs[:, RADIUS], density, first.body, thickness)
        square = discs[:, X] * discs[:, X] + discs[:, Y] * discs[:, Y]
        about = inertias(discs[:, RADIUS], each, first.body) + each * square
        mass, inertia = total(each), total(about)
    if wall.mass is not None:
        mass, inertia = wall.mass, inertia * (wall.mass / mass)
    return mass, inertia if wall.inertia is None else wall.inertia


def _model_group(scenario: Scenario, wall: Wall) -> ParticleGroup:
    """The group whose thickness glued grains have: of their sizes, else first of their material."""
    glued = wall.geometry.glued()
    named = None if glued is None else glued.sizes
    if isinstance(named, str):
        return next(group for group in scenario.particles if group.name == named)
    if named is None:
        return scenario.particles[0]
    same = (group for group in scenario.particles if group.material == wall.material)
    return next(same, scenario.particles[0])
