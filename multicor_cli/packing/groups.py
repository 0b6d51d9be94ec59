"""From a ``[[particles]]`` table to grains: their radii, places and motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from multicor_cli.arithmetic.sums import total
from multicor_cli.model.columns import SPIN, X, Y
from multicor_cli.model.model import Floats
from multicor_cli.model.shapes import Area
from multicor_cli.packing.compacted import compact
from multicor_cli.packing.deposited import deposit
from multicor_cli.packing.file import read_grains
from multicor_cli.packing.initial_grains import InitialGrains, PackingRegion, Shape
from multicor_cli.packing.lattice import lattice, lattice_capacity, repeat_tile
from multicor_cli.packing.other_run import read_frame
from multicor_cli.packing.random import DEFAULT_ATTEMPTS, random_packing
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
    CompactedPacking,
    DepositedPacking,
    FilePacking,
    LatticePacking,
    ParticleGroup,
    RandomPacking,
    RunPacking,
    StartPacking,
    TilePacking,
)
from multicor_cli.scenario.problems import Refused
from multicor_cli.scenario.region import RectangleRegion
from multicor_cli.text import count_noun

_MOST_FILLED = 1.5
"""Most that grains fill over what is asked for: whole grains meet it to within half of one."""

Source = LatticePacking | RandomPacking | DepositedPacking | CompactedPacking


@dataclass(frozen=True)
class _Task:
    """One packing to make, of a group or its tile, by ``count`` or area fraction ``fill``.

    Grains go into ``area``, in the rectangle ``region``, or all of that; ``random`` gives the
    stream for a purpose at its beginning. ``is_periodic_in_y``: bottom and top of the region are
    one and the same.
    """

    sizes: SizeDistribution
    count: int | None
    fill: float | None
    region: PackingRegion
    obstacles: Obstacles
    random: Callable[[Purpose], Stream]
    is_periodic_in_y: bool = False
    area: Area | None = None

    def radii(self) -> Floats:
        if self.count is not None:
            return self.sizes.draw(self.count, self.random(Purpose.SIZES))
        if self.fill is None:
            message = "neither a count nor a fill"
            raise ValueError(message)
        room = self.region.area if self.area is None else self.area.size
        radii = draw_to_total(
            self.sizes, disc_area, self.fill * room, lambda: self.random(Purpose.SIZES)
        )
        reached = total(disc_area(radii)) / room
        if reached > _MOST_FILLED * self.fill:
            grains = count_noun(radii.size, "grain")
            what = (
                f"a fill of {self.fill:g} is too small for grains of these sizes: {grains} fill "
                f"{reached:.3g}"
            )
            larger = f"give a fill of {reached:.2g} or more, " if reached < MAX_FILL else ""
            raise Refused((), what, f"{larger}enlarge the region, or use smaller grains")
        return radii


def make_group(scenario: Scenario, index: int, obstacles: Obstacles) -> InitialGrains:
    """The grains of a group as they start, moving as the scenario says; x is not wrapped yet.

    Obstacles are walls, and grains of earlier groups. Keys of `Refused` are relative to the group.
    """
    group = scenario.particles[index]
    if group.packing is None:
        return _waiting(scenario, group, index)
    region = region_of_group(scenario, group)
    return with_motion(scenario, group, _place(scenario, group, index, region, obstacles))


def with_motion(scenario: Scenario, group: ParticleGroup, grains: InitialGrains) -> InitialGrains:
    """The grains of a group with the velocities that its table adds."""
    region = region_of_group(scenario, group)
    velocity = grains.velocity + np.array([*group.velocity, group.spin])
    if group.shear_rate:
        middle = 0.5 * (region.bottom + region.top)
        velocity[:, X] += group.shear_rate * (grains.position[:, Y] - middle)
        velocity[:, SPIN] -= 0.5 * group.shear_rate
    return replace(grains, velocity=velocity)


def _waiting(scenario: Scenario, group: ParticleGroup, index: int) -> InitialGrains:
    """Grains that wait: in the middle of the region of their release, if anywhere."""
    assert group.sizes is not None
    assert group.release is not None
    assert group.count is not None  # the scenario has been checked
    sizes = sizes_of(group.sizes, group.shape)
    radius = sizes.draw(
        group.count, stream(scenario.seed, TableKind.PARTICLES, index, Purpose.SIZES)
    )
    region = group.release.region
    return InitialGrains.at_rest(radius, 0.5 * (np.array(region.min) + np.array(region.max)))


def region_of_group(scenario: Scenario, group: ParticleGroup) -> PackingRegion:
    """The rectangle of a group, or around its region; periodic if it spans the domain's period."""
    table, domain = group.placed_in(scenario.domain), scenario.domain
    if not isinstance(table, RectangleRegion):
        (left, bottom), (right, top) = table.area().corners().tolist()
        return PackingRegion(left, bottom, right, top)
    # exactly, so that nothing is lost between the two ends
    if domain.is_spanned(table.min[0], table.max[0]):
        return PackingRegion(
            table.min[0], table.min[1], table.min[0] + domain.period, table.max[1], True
        )
    return PackingRegion(*table.min, *table.max)


def _place(
    scenario: Scenario,
    group: ParticleGroup,
    index: int,
    region: PackingRegion,
    obstacles: Obstacles,
) -> InitialGrains:
    packing = group.packing
    if isinstance(packing, FilePacking):
        return read_grains(scenario.resolve_path(packing.path), packing.shift)
    if isinstance(packing, StartPacking):
        message = "grains of [start] are not placed here"
        raise TypeError(message)
    if isinstance(packing, RunPacking):
        return read_frame(scenario.resolve_path(packing.path), packing.frame)
    assert packing is not None
    assert group.sizes is not None  # the scenario has been checked

    def random(purpose: Purpose) -> Stream:
        return stream(scenario.seed, TableKind.PARTICLES, index, purpose)

    sizes = sizes_of(group.sizes, group.shape)
    if isinstance(packing, TilePacking):
        return _tile(scenario, group, packing, sizes, region, random)
    table, solid = (
        group.placed_in(scenario.domain),
        obstacles.around(region, scenario.domain.period),
    )
    area = None if isinstance(table, RectangleRegion) else table.area()
    if area is not None:
        solid = solid.with_boundary(area)
    return _make(
        scenario,
        group,
        packing,
        _Task(sizes, group.count, group.fill, region, solid, random, area=area),
    )


def _tile(
    scenario: Scenario,
    group: ParticleGroup,
    packing: TilePacking,
    sizes: SizeDistribution,
    region: PackingRegion,
    random: Callable[[Purpose], Stream],
) -> InitialGrains:
    """One tile, periodic in x (a random one in y too), and its copies."""
    source = packing.source
    if packing.repeat[1] > 1 and isinstance(source, DepositedPacking | CompactedPacking):
        text = (
            f"a {source.kind} tile lies between a floor and a free surface or lid: it cannot be "
            "repeated in y"
        )
        raise Refused(
            ("packing", "repeat"), text, f"use repeat = [{packing.repeat[0]}, 1] and a higher tile"
        )
    width, height = packing.tile
    if width < 8.0 * sizes.largest:
        text = (
            f"a tile of width {width:g} m is too narrow for grains of diameter "
            f"{2.0 * sizes.largest:g} m"
        )
        raise Refused(
            ("packing", "tile"), text, "make it at least four of the largest diameters wide"
        )
    one = PackingRegion(0.0, 0.0, width, height, True)
    is_random = isinstance(source, RandomPacking)
    if is_random and height < 8.0 * sizes.largest and packing.repeat[1] > 1:
        text = (
            f"a tile of height {height:g} m is too low for grains of diameter "
            f"{2.0 * sizes.largest:g} m"
        )
        raise Refused(
            ("packing", "tile"), text, "make it at least four of the largest diameters high"
        )
    task = _Task(
        sizes,
        packing.tile_count,
        packing.tile_fill,
        one,
        Obstacles.none(),
        random,
        is_random and packing.repeat[1] > 1,
    )
    return repeat_tile(_make(scenario, group, source, task), packing.tile, packing.repeat, region)


def _make(scenario: Scenario, group: ParticleGroup, packing: Source, task: _Task) -> InitialGrains:
    if isinstance(packing, LatticePacking):
        return _lattice(packing, task)
    radius = task.radii()
    places = task.random(Purpose.PLACES)
    if isinstance(packing, DepositedPacking):
        return InitialGrains.at_rest(radius, deposit(radius, task.region, task.obstacles, places))
    if isinstance(packing, RandomPacking):
        centers = random_packing(
            radius, task.region, task.obstacles, packing.separation, packing.attempts, places,
            is_periodic_in_y=task.is_periodic_in_y,
        )  # fmt: skip
        return InitialGrains.at_rest(radius, centers)
    loose = random_packing(radius, task.region, task.obstacles, 0.0, DEFAULT_ATTEMPTS, places)
    return InitialGrains.at_rest(
        radius, _compacted(scenario, group, packing, task.region, radius, loose)
    )


def _lattice(packing: LatticePacking, task: _Task) -> InitialGrains:
    layout, room = (
        (task.sizes.largest, task.region, packing.lattice, packing.spacing, packing.jitter),
        task.obstacles.room,
    )
    if task.count is None and task.fill is None:
        radius = task.sizes.draw(lattice_capacity(*layout, room), task.random(Purpose.SIZES))
    else:
        radius = task.radii()
    return InitialGrains.at_rest(
        radius, lattice(radius.size, *layout, task.random(Purpose.JITTER), room)
    )


def _compacted(
    scenario: Scenario,
    group: ParticleGroup,
    packing: CompactedPacking,
    region: PackingRegion,
    radius: Floats,
    loose: Floats,
) -> Floats:
    friction = packing.friction
    if friction is None:
        # at rest, as a compaction ends
        friction = scenario.law(group.material, group.material).coefficient
    shape: Shape = group.shape
    return compact(
        loose,
        radius,
        region,
        density=scenario.materials[group.material].density,
        shape=shape,
        thickness=group.thickness,
        pressure=packing.pressure,
        friction=friction,
        kinetic_energy_ratio=packing.kinetic_energy_ratio,
    )
