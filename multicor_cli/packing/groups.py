"""From a ``[[particles]]`` table to grains: their radii, places and motion."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from multicor_cli.arithmetic.sums import total
from multicor_cli.model.cell import mean_flow
from multicor_cli.model.columns import SPIN, X, Y
from multicor_cli.model.model import Floats
from multicor_cli.model.outlines import Outlines
from multicor_cli.model.shapes import Area
from multicor_cli.packing.compacted import compact
from multicor_cli.packing.file import read_frame, read_grains
from multicor_cli.packing.initial_grains import Forms, InitialGrains, PackingRegion, masses
from multicor_cli.packing.lattice import lay_out, repeat_tile
from multicor_cli.packing.placing import deposit
from multicor_cli.packing.random import DEFAULT_ATTEMPTS, pack_outlines, random_packing
from multicor_cli.packing.sizes import (
    Purpose,
    SizeDistribution,
    Stream,
    TableKind,
    disc_area,
    draw_to_total,
    sizes_of,
    stream,
)
from multicor_cli.packing.walls import Obstacles
from multicor_cli.scenario import Scenario
from multicor_cli.scenario.particles import (
    MAX_FILL,
    MOTION,
    CompactedPacking,
    DepositedPacking,
    FilePacking,
    LatticePacking,
    OutlinesPacking,
    ParticleGroup,
    RandomPacking,
    RunPacking,
    StartPacking,
    TilePacking,
)
from multicor_cli.scenario.problems import Refused
from multicor_cli.scenario.region import RectangleRegion
from multicor_cli.scenario.shapes import FixedOrientation, GrainShape, ListOrientation
from multicor_cli.text import count_noun

# ---- From `shape` and `orientation` to outlines and angles of grains

MakeForms = Callable[[int], Forms]
"""The forms of so many grains, of size 1: of the first ones, whatever their number."""

_DEGREE = math.pi / 180.0


def forms_of(shape: GrainShape | None, random: Callable[[Purpose], Stream]) -> MakeForms | None:
    """What makes the grains of a group; None if they are discs. ``random`` as in `make_group`."""
    if shape is None:
        return None
    if not shape.draws:
        family = _of_size_one(shape, np.zeros((1, 0)))
        return lambda count: family.of_grains(np.arange(count) % family.gyration.size)
    return lambda count: _of_size_one(shape, random(Purpose.SHAPES).random((count, shape.draws)))


def _of_size_one(shape: GrainShape, uniform: Floats) -> Forms:
    forms, _ = _around_centers(shape, uniform)
    if shape.size == "area":
        return forms.scaled(1.0 / np.sqrt(forms.outlines.area / math.pi))
    return forms.scaled(1.0 / forms.outlines.radius)


def _around_centers(shape: GrainShape, uniform: Floats) -> tuple[Forms, Floats]:
    """Grains around their centers of mass, and where these are [m], shape ``(n, 2)``."""
    grains = shape.forms(uniform)
    found = shape.measures(grains)
    local = [
        [(corners - center, rounding) for corners, rounding in grain]
        for grain, center in zip(grains, found.center, strict=True)
    ]
    outlines = Outlines.of(local, found.area, found.perimeter)
    return Forms(outlines, found.gyration), found.center


def angles_of(group: ParticleGroup, count: int, random: Callable[[Purpose], Stream]) -> Floats:
    """Angles of the grains at the start [rad], shape ``(n,)``; `Refused` if not one is for each."""
    table = group.orientation
    if isinstance(table, FixedOrientation):
        return np.full(count, table.angle * _DEGREE)
    if isinstance(table, ListOrientation):
        if len(table.angles) != count:
            what = f"{len(table.angles)} angles are given for {count} grains"
            raise Refused(("orientation", "angles"), what, "give one per grain of the group")
        return np.array(table.angles) * _DEGREE
    return 2.0 * math.pi * random(Purpose.ANGLES).random(count)


def turned(
    group: ParticleGroup,
    sizes: Floats,
    center: Floats,
    make: MakeForms | None,
    random: Callable[[Purpose], Stream],
) -> InitialGrains:
    """Grains of these sizes at rest at their centers [m], turned as the group says."""
    if make is None:
        return InitialGrains.at_rest(sizes, center)
    forms, angle = make(sizes.size).scaled(sizes), angles_of(group, sizes.size, random)
    full = np.column_stack([np.zeros((sizes.size, 2)) + center, angle])
    return InitialGrains.at_rest(forms.outlines.radius, full, forms)


def outlined_as_drawn(shape: GrainShape, packing: OutlinesPacking) -> InitialGrains:
    """Grains where the file of their shape draws them."""
    forms, center = _around_centers(shape, np.zeros((1, 0)))
    forms = forms.scaled(np.full(len(center), packing.scale))
    place = packing.scale * center + np.array(packing.shift)
    return InitialGrains.at_rest(forms.outlines.radius, place, forms)


# ---- From packings to places

_MOST_FILLED = 1.5
"""Most that grains fill over what is asked for: whole grains meet it to within half of one."""

Packing = LatticePacking | RandomPacking | DepositedPacking | CompactedPacking


@dataclass(frozen=True)
class _Task:
    """One packing to make, of a group or its tile, by ``count`` or area fraction ``fill``.

    Grains go into ``area``, in the rectangle ``region``, or all of that; ``random`` gives the
    stream for a purpose at its beginning, ``forms`` the outlines of grains that are no discs.
    """

    sizes: SizeDistribution
    count: int | None
    fill: float | None
    region: PackingRegion
    obstacles: Obstacles
    random: Callable[[Purpose], Stream]
    forms: MakeForms | None = None
    area: Area | None = None

    def radii(self) -> Floats:
        if self.count is not None:
            return self.sizes.draw(self.count, self.random(Purpose.SIZES))
        assert self.fill is not None  # the scenario has been checked
        room = self.region.area if self.area is None else self.area.size
        radii = draw_to_total(
            self.sizes, self._area, self.fill * room, lambda: self.random(Purpose.SIZES)
        )
        reached = total(self._area(radii)) / room
        if reached > _MOST_FILLED * self.fill:
            what = (
                f"a fill of {self.fill:g} is too small for grains of these sizes: "
                f"{count_noun(radii.size, 'grain')} fill {reached:.3g}"
            )
            larger = f"give a fill of {reached:.2g} or more, " if reached < MAX_FILL else ""
            raise Refused((), what, f"{larger}enlarge the region, or use smaller grains")
        return radii

    def _area(self, radii: Floats) -> Floats:
        """Areas of the first grains [m²], of these sizes [m]."""
        if self.forms is None:
            return disc_area(radii)
        return self.forms(radii.size).outlines.area * (radii * radii)

    def reach(self, count: int) -> float:
        """How far the largest may reach from its center, of so many grains [m]."""
        largest = self.sizes.largest
        if self.forms is None:
            return largest
        return largest * float(self.forms(max(count, 1)).outlines.radius.max())


def make_group(scenario: Scenario, index: int, obstacles: Obstacles) -> InitialGrains:
    """The grains of a group as they start, moving as the scenario says; x is not wrapped yet.

    Obstacles are walls, and grains of earlier groups. Keys of `Refused` are relative to the group.
    """
    group, packing = scenario.particles[index], scenario.particles[index].packing

    def random(purpose: Purpose) -> Stream:
        return stream(scenario.seed, TableKind.PARTICLES, index, purpose)

    if packing is None:  # they wait in the middle of the region of their release
        assert group.sizes is not None
        assert group.release is not None
        assert group.count is not None  # the scenario has been checked
        radius = sizes_of(group.sizes, group.body).draw(group.count, random(Purpose.SIZES))
        place = group.release.region
        middle = 0.5 * (np.array(place.min) + np.array(place.max))
        return turned(group, radius, middle, forms_of(group.outline, random), random)
    assert not isinstance(packing, StartPacking)  # those are not placed here
    if isinstance(packing, FilePacking):
        path, is_cell = scenario.resolve_path(packing.path), scenario.domain.is_cell
        grains = read_grains(path, packing.shift, has_mean_flow=is_cell)
        if (make := forms_of(group.outline, random)) is not None:
            forms = make(grains.radius.size).scaled(grains.radius)
            grains = replace(grains, radius=forms.outlines.radius, forms=forms)
    elif isinstance(packing, OutlinesPacking):
        assert group.outline is not None  # the scenario has been checked
        grains = outlined_as_drawn(group.outline, packing)
    elif isinstance(packing, RunPacking):
        grains = read_frame(scenario.resolve_path(packing.path), packing.frame)
        refuse_other_shapes(group, grains, f"the run '{packing.path}'")
    else:
        grains = _place(scenario, group, packing, obstacles, random)
    return with_motion(scenario, group, grains)


def with_motion(scenario: Scenario, group: ParticleGroup, grains: InitialGrains) -> InitialGrains:
    """The grains of a group with the velocities that its table adds.

    In a cell they are from now on those beside the mean flow with which it begins.
    """
    region = region_of_group(scenario, group)
    velocity = grains.velocity + np.array([*group.velocity, group.spin])
    if group.shear_rate:
        middle = 0.5 * (region.bottom + region.top)
        velocity[:, X] += group.shear_rate * (grains.position[:, Y] - middle)
        velocity[:, SPIN] -= 0.5 * group.shear_rate
    rates = scenario.domain.cell_rates
    is_real = grains.is_velocity_real
    if is_real is None:
        is_real = not group.model_fields_set.isdisjoint(MOTION)
    if rates is not None and is_real:
        gradient = np.array([rates.xx, rates.yy, rates.xy])
        velocity[:, :2] -= mean_flow(grains.position, gradient)
    return replace(grains, velocity=velocity)


def refuse_other_shapes(group: ParticleGroup, grains: InitialGrains, run: str) -> None:
    """Refuse discs in a run where the group has another shape, and the other way round."""
    if (grains.forms is None) != (group.outline is None):
        are, says = ("discs", "other outlines") if grains.forms is None else ("no discs", "discs")
        what = f"the grains that come from {run} are {are}, but the shape says {says}"
        raise Refused(("shape",), what, "give the shape that they have there")


def region_of_group(scenario: Scenario, group: ParticleGroup) -> PackingRegion:
    """The rectangle of a group, or around its region; periodic if it spans the domain's period.

    In a cell one that spans both periods is periodic in both directions.
    """
    table, domain = group.placed_in(scenario.domain), scenario.domain
    if not isinstance(table, RectangleRegion):
        (left, bottom), (right, top) = table.area().corners().tolist()
        return PackingRegion(left, bottom, right, top)
    if not domain.is_spanned(table.min[0], table.max[0]):
        return PackingRegion(*table.min, *table.max)
    # exactly, so that nothing is lost between the two ends
    right, top = table.min[0] + domain.period, table.max[1]
    closes = domain.is_spanned(table.min[1], top, axis=1)
    if closes:
        top = table.min[1] + domain.size[1]
    return PackingRegion(*table.min, right, top, True, closes)


def _place(
    scenario: Scenario,
    group: ParticleGroup,
    packing: Packing | TilePacking,
    obstacles: Obstacles,
    random: Callable[[Purpose], Stream],
) -> InitialGrains:
    assert group.sizes is not None  # the scenario has been checked
    region, sizes = region_of_group(scenario, group), sizes_of(group.sizes, group.body)
    forms = forms_of(group.outline, random)
    if not isinstance(packing, TilePacking):
        table = group.placed_in(scenario.domain)
        solid = obstacles.around(region, scenario.domain.period)
        area = None if isinstance(table, RectangleRegion) else table.area()
        if area is not None:
            solid = solid.with_boundary(area)
        task = _Task(sizes, group.count, group.fill, region, solid, random, forms, area)
        return _make(scenario, group, packing, task)
    # One tile, periodic in x (a random one in y too), and its copies
    source, (columns, rows), (width, height) = packing.source, packing.repeat, packing.tile
    if rows > 1 and isinstance(source, DepositedPacking | CompactedPacking):
        text = (
            f"a {source.kind} tile lies between a floor and a free surface or lid: it cannot be "
            "repeated in y"
        )
        remedy = f"use repeat = [{columns}, 1] and a higher tile"
        raise Refused(("packing", "repeat"), text, remedy)
    closes = isinstance(source, RandomPacking) and (rows > 1 or region.is_periodic_in_y)
    sides = [(width, "width", "narrow", "wide"), (height, "height", "low", "high")]
    one = PackingRegion(0.0, 0.0, width, height, True, closes)
    counts = packing.tile_count, packing.tile_fill
    task = _Task(sizes, *counts, one, Obstacles.none(), random, forms)
    reach = task.reach(packing.tile_count or 1)
    for length, name, small, large in sides if closes else sides[:1]:
        if length < 8.0 * reach:
            diameter = f"grains of diameter {2.0 * reach:g} m"
            text = f"a tile of {name} {length:g} m is too {small} for {diameter}"
            remedy = f"make it at least four of the largest diameters {large}"
            raise Refused(("packing", "tile"), text, remedy)
    tile = _make(scenario, group, source, task)
    return repeat_tile(tile, packing.tile, packing.repeat, region)


def _make(scenario: Scenario, group: ParticleGroup, packing: Packing, task: _Task) -> InitialGrains:
    region, obstacles = task.region, task.obstacles
    if isinstance(packing, LatticePacking):
        return _on_lattice(group, packing, task)
    radius, places = task.radii(), task.random(Purpose.PLACES)
    settles, knows_discs = isinstance(packing, DepositedPacking), obstacles.grains is None
    separation, attempts = 0.0, DEFAULT_ATTEMPTS
    if isinstance(packing, RandomPacking):
        separation, attempts = packing.separation, packing.attempts
    forms = None if task.forms is None else task.forms(radius.size).scaled(radius)
    if forms is None and settles and knows_discs:
        center = deposit(radius, region, obstacles, places)
    elif forms is None and knows_discs:
        center = random_packing(radius, region, obstacles, separation, attempts, places)
    else:
        angle, outlines = np.zeros(radius.size), Outlines.of_discs(radius)
        if forms is not None:
            angle, outlines = angles_of(group, radius.size, task.random), forms.outlines
        radius = outlines.radius
        turns = not isinstance(group.orientation, FixedOrientation | ListOrientation)
        center = pack_outlines(
            outlines, angle, region, obstacles, separation, attempts, places,
            turns=turns and forms is not None, settles=settles,
        )  # fmt: skip
    if isinstance(packing, CompactedPacking):
        friction = packing.friction
        density = group.solid * scenario.materials[group.material].density
        if friction is None:  # at rest, as a compaction ends
            friction = scenario.law(group.material, group.material).coefficient
        center = compact(
            InitialGrains.at_rest(radius, center, forms),
            region,
            mass=masses(radius, density, group.body, group.thickness, forms),
            shape=group.body,
            pressure=packing.pressure,
            friction=friction,
            kinetic_energy_ratio=packing.kinetic_energy_ratio,
        )
    return InitialGrains.at_rest(radius, center, forms)


def _on_lattice(group: ParticleGroup, packing: LatticePacking, task: _Task) -> InitialGrains:
    """Grains on sites so far apart that the circles around them do not overlap."""
    layout = (packing.lattice, packing.spacing, packing.jitter, task.obstacles.room)
    if task.count is not None or task.fill is not None:
        radius = task.radii()
        lattice = lay_out(task.reach(radius.size), task.region, *layout)
    else:
        lattice = lay_out(task.sizes.largest, task.region, *layout)
        if task.forms is not None:  # of no fewer grains than there are sites
            lattice = lay_out(task.reach(lattice.capacity()), task.region, *layout)
        radius = task.sizes.draw(lattice.capacity(), task.random(Purpose.SIZES))
    sites = lattice.sites(radius.size, task.random(Purpose.JITTER))
    return turned(group, radius, sites, task.forms, task.random)
