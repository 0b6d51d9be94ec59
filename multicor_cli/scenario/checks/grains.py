"""Groups of grains and walls fit together and into the domain; grains that come and go do."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from multicor_cli.model.model import LEAST_DIAMETERS
from multicor_cli.scenario.particles import (
    CompactedPacking,
    DepositedPacking,
    GradientTemperature,
    Outlet,
    ParticleGroup,
    RegionsTemperature,
    StartPacking,
    TilePacking,
)
from multicor_cli.scenario.problems import KeyPath, Refused, name_list, show
from multicor_cli.scenario.region import RectangleRegion, Region
from multicor_cli.scenario.settings import Domain
from multicor_cli.scenario.sizes import Sizes
from multicor_cli.scenario.tables import PartialScenario
from multicor_cli.scenario.translate import did_you_mean
from multicor_cli.scenario.walls import Glued, Wall

# ---- Groups of grains fit together, into the domain and into their regions

MAX_GRAINS = 50_000_000
"""More grains than any machine can hold today; they are refused before memory is taken."""
_SLACK = 1e-9


def check(tables: PartialScenario) -> Iterator[Refused]:
    """Findings about the groups of grains."""
    yield from double_names(tables.group_names, "particles")
    yield from _unlike_shapes(tables)
    yield from _unlike_starts(tables)
    yield from _too_many(tables)
    for k, group in enumerate(tables.particles):
        if group and tables.domain:
            yield from _check_group(("particles", k), group, tables.domain)


def double_names(names: Sequence[str | None], table: str) -> Iterator[Refused]:
    """Findings about names that are given twice in an array of tables."""
    first: dict[str, int] = {}
    for k, name in enumerate(names):
        if name is not None and first.setdefault(name, k) != k:
            yield Refused(
                (table, k, "name"),
                f"{show(name)} is also the name of {table}.{first[name]}",
                "give another name",
            )


def _unlike_shapes(tables: PartialScenario) -> Iterator[Refused]:
    groups = [(k, group) for k, group in enumerate(tables.particles) if group]
    for k, group in groups[1:]:
        first = groups[0][1]
        if group.shape != first.shape:
            what = f"{show(group.shape)}, but the group '{first.name}' has {show(first.shape)}"
            yield Refused(("particles", k, "shape"), what, "use the same shape for all groups")


def _unlike_starts(tables: PartialScenario) -> Iterator[Refused]:
    """With ``[start]`` all grains come from its run, and without it none do."""
    for k, group in enumerate(tables.particles):
        if group is None or isinstance(group.packing, StartPacking) == tables.has_start:
            continue
        if tables.has_start:
            kind = "no packing" if group.packing is None else f'kind = "{group.packing.kind}"'
            what = f"{kind} beside a table [start], whose run has all the grains"
            remedy = (
                'remove [[particles]], or [start]; packing = { kind = "start" } names a group of '
                "the run"
            )
        else:
            what, remedy = (
                'kind = "start" without a table [start]',
                'add [start] with run = "...", or use another packing',
            )
        yield Refused(("particles", k, "packing"), what, remedy)


def _check_group(path: KeyPath, group: ParticleGroup, domain: Domain) -> Iterator[Refused]:
    region = group.placed_in(domain)
    if domain.periodic and not (region.left >= 0.0 and region.right <= domain.size[0]):
        what = (
            f"reaches from x = {region.left:g} to {region.right:g}, beyond the period from 0 to "
            f"{domain.size[0]:g}"
        )
        yield Refused((*path, "region"), what, "keep it inside [domain] size")
    if isinstance(group.packing, CompactedPacking | TilePacking) and not isinstance(
        region, RectangleRegion
    ):
        what = f'packing kind = "{group.packing.kind}" fills rectangles only, not the {region}'
        yield Refused(
            (*path, "region"),
            what,
            'use region = { min, max }, or packing kind = "lattice", "random" or "deposited"',
        )
    if isinstance(group.packing, DepositedPacking) and domain.gravity[1] >= 0.0:
        yield _no_weight((*path, "packing"), domain)
    if group.sizes is not None:
        yield from _check_sizes(path, group, region, domain)
    if isinstance(group.packing, TilePacking):
        yield from _check_tile(path, group.packing, region, domain)


def _check_sizes(
    path: KeyPath, group: ParticleGroup, region: Region, domain: Domain
) -> Iterator[Refused]:
    assert group.sizes is not None
    diameter = 2.0 * group.sizes.largest
    tile = group.packing.tile if isinstance(group.packing, TilePacking) else (math.inf, math.inf)
    room = min(region.room, *tile)
    if diameter > room * (1.0 + _SLACK):
        is_plain = isinstance(region, RectangleRegion)
        place = (
            f"{min(region.width, tile[0]):g} × {min(region.height, tile[1]):g} m"
            if is_plain
            else f"the {region}"
        )
        what = f"grains of diameter {diameter:g} m do not fit into {place}"
        yield Refused((*path, "sizes"), what, "give radii and lengths in meters")
    elif domain.periodic and domain.size[0] < LEAST_DIAMETERS * diameter:
        what = (
            f"the period {domain.size[0]:g} m is less than four of the largest diameters, "
            f"{diameter:g} m"
        )
        yield Refused((*path, "sizes"), what, "widen the domain or use smaller grains")
    elif group.count is not None and _least_area(group, group.count) > region.area().size:
        what = f"{group.count} grains cover more than the {region}"
        yield Refused((*path, "count"), what, "lower count, or enlarge region")


def _least_area(group: ParticleGroup, count: int) -> float:
    assert group.sizes is not None
    return count * math.pi * group.sizes.smallest * group.sizes.smallest


def _check_tile(
    path: KeyPath, packing: TilePacking, region: Region, domain: Domain
) -> Iterator[Refused]:
    width, height = (packing.tile[axis] * packing.repeat[axis] for axis in (0, 1))
    if width > region.width * (1.0 + _SLACK) or height > region.height * (1.0 + _SLACK):
        covered = f"{packing.repeat[0]} × {packing.repeat[1]} tiles cover {width:g} × {height:g} m"
        what = f"{covered}, more than the {region}"
        yield Refused((*path, "packing", "repeat"), what, "use fewer tiles")
    if isinstance(packing.source, DepositedPacking) and domain.gravity[1] >= 0.0:
        yield _no_weight((*path, "packing", "source"), domain)


def _no_weight(path: KeyPath, domain: Domain) -> Refused:
    what = f"grains cannot be deposited with gravity = {list(domain.gravity)}"
    return Refused(path, what, "use gravity that points down in [domain], or another packing")


def _too_many(tables: PartialScenario) -> Iterator[Refused]:
    """The total number of grains is bounded; area fractions give a lower estimate."""
    total = 0.0
    for k, group in enumerate(tables.particles):
        if group is None or tables.domain is None:
            continue
        total += _least_count(group, tables.domain)
        if total > MAX_GRAINS:
            what = f"there would be at least {total:.3g} grains, more than {MAX_GRAINS:.3g}"
            yield Refused(
                ("particles", k),
                what,
                "use fewer or larger grains; radii and lengths are in meters",
            )
            return


def _least_count(group: ParticleGroup, domain: Domain) -> float:
    packing, sizes = group.packing, group.sizes
    if sizes is None:
        return 0.0
    largest_area = math.pi * sizes.largest * sizes.largest
    if isinstance(packing, TilePacking):
        one = (
            packing.tile_count
            or (packing.tile_fill or 0.0) * packing.tile[0] * packing.tile[1] / largest_area
        )
        return one * packing.repeat[0] * packing.repeat[1]
    region = group.placed_in(domain)
    return group.count or (group.fill or 0.0) * region.area().size / largest_area


# ---- Grains that come and go: releases and outlets fit into the domain, and to each other


def check_exchange(tables: PartialScenario) -> Iterator[Refused]:
    """Findings about releases and outlets."""
    yield from double_names(
        [outlet.name if outlet else None for outlet in tables.outlets], "outlets"
    )
    for k, group in enumerate(tables.particles):
        if group is not None and group.release is not None and tables.domain is not None:
            yield from _check_release(("particles", k), group, tables.domain)
    for k, outlet in enumerate(tables.outlets):
        if outlet is not None:
            yield from _check_outlet(("outlets", k), outlet, tables)


def _check_release(path: KeyPath, group: ParticleGroup, domain: Domain) -> Iterator[Refused]:
    assert group.release is not None
    region, (width, height) = group.release.region, domain.size
    if not (
        region.min[0] >= 0.0
        and region.max[0] <= width
        and region.min[1] >= 0.0
        and region.max[1] <= height
    ):
        what = (
            f"reaches from {list(region.min)} to {list(region.max)} m, beyond the domain of "
            f"{width:g} × {height:g} m"
        )
        yield Refused(
            (*path, "release", "region"), what, "keep it inside [domain] size, or enlarge that"
        )
    if group.sizes is not None:
        diameter = 2.0 * group.sizes.largest
        if diameter > min(region.width, region.height) * (1.0 + _SLACK):
            what = (
                f"grains of diameter {diameter:g} m never fit into the region of {region.width:g} "
                f"× {region.height:g} m"
            )
            yield Refused(
                (*path, "release", "region"), what, "enlarge it: grains are released wholly inside"
            )
    if group.packing is None and isinstance(
        group.temperature, GradientTemperature | RegionsTemperature
    ):
        what = "the temperature depends on the place, but grains that wait have none"
        yield Refused(
            (*path, "temperature"), what, "give one temperature [K], or one for each grain"
        )


def _check_outlet(path: KeyPath, outlet: Outlet, tables: PartialScenario) -> Iterator[Refused]:
    groups = [(k, group) for k, group in enumerate(tables.particles) if group is not None]
    for k, group in groups:
        if group.release is not None and _overlap(outlet.region, group.release.region):
            what = (
                f"overlaps the release region of particles.{k}: grains would leave where they come"
            )
            yield Refused((*path, "region"), what, "move one of the two")
    if (
        outlet.then == "release"
        and len(groups) == len(tables.particles)
        and not any(group.release for _, group in groups)
    ):
        what = "grains are to be released again, but no group has a release"
        yield Refused(
            (*path, "then"),
            what,
            'give a group release = { rate = ..., region = ... }, or use then = "remove"',
        )
    domain = tables.domain
    if (
        domain is not None
        and domain.periodic
        and not (outlet.region.min[0] >= 0.0 and outlet.region.max[0] <= domain.size[0])
    ):
        what = (
            f"reaches from x = {outlet.region.min[0]:g} to {outlet.region.max[0]:g}, beyond the "
            f"period from 0 to {domain.size[0]:g}"
        )
        yield Refused((*path, "region"), what, "keep it within the period: x is counted there")


def _overlap(a: RectangleRegion, b: RectangleRegion) -> bool:
    return all(a.min[axis] < b.max[axis] and b.min[axis] < a.max[axis] for axis in (0, 1))


# ---- Walls fit to the domain and know what they are made of

_MAX_GLUED = 10_000_000


def check_walls(tables: PartialScenario) -> Iterator[Refused]:
    """Findings about the walls."""
    yield from double_names(tables.wall_names, "walls")
    for k, wall in enumerate(tables.walls):
        if wall is None:
            continue
        yield from _unknown_groups(("walls", k, "groups"), wall, tables)
        path, glued = ("walls", k, "geometry"), wall.geometry.glued()
        if glued is not None:
            yield from _check_glued((*path, glued.key), glued, tables)
        if tables.domain:
            for found in wall.geometry.misfits(tables.domain):
                yield found.within(*path)


def _unknown_groups(path: KeyPath, wall: Wall, tables: PartialScenario) -> Iterator[Refused]:
    """Groups that a wall is to meet."""
    if None in tables.group_names or not tables.group_names:
        return  # the group that is meant may be one without a name
    known = [name for name in tables.group_names if name]
    for e, name in enumerate(wall.groups or ()):
        if name not in known:
            remedy = did_you_mean(name, known) or f"the groups are {name_list(known)}"
            yield Refused((*path, e), f"there is no group of particles {show(name)}", remedy)


def _check_glued(path: KeyPath, glued: Glued, tables: PartialScenario) -> Iterator[Refused]:
    named = glued.sizes
    if named is not None and not isinstance(named, str):
        yield from _check_room(path, glued, named)
    elif named is not None and named not in tables.group_names:
        known = [name for name in tables.group_names if name]
        # The group that is meant may be one without a name
        if not known or len(known) < len(tables.group_names):
            return
        remedy = did_you_mean(named, known) or f"use one of {name_list(known)}, or a table of sizes"
        yield Refused(path, f"there is no group of particles {show(named)}", remedy)
    elif tables.particles:
        group = tables.particles[0 if named is None else tables.group_names.index(named)]
        yield from _check_borrowed(path, glued, group, tables)


def _check_borrowed(
    path: KeyPath, glued: Glued, group: ParticleGroup | None, tables: PartialScenario
) -> Iterator[Refused]:
    """Glued grains with the sizes of a group of free grains."""
    if group is None:
        return
    if group.sizes is None:
        what = f"the group '{group.name}' has no sizes that the glued grains could have"
        yield Refused(
            path, what, 'give them here, as { kind = "uniform", min = 0.4e-3, max = 0.6e-3 }'
        )
    # if larger, the group itself is told
    elif tables.domain and 2.0 * group.sizes.largest <= min(tables.domain.size):
        yield from _check_room(path, glued, group.sizes)


def _check_room(path: KeyPath, glued: Glued, sizes: Sizes) -> Iterator[Refused]:
    """Glued grains fit on the wall, in a number that makes sense."""
    place, diameter = glued.place, 2.0 * sizes.largest
    remedy = "give radii and points in meters"
    if place.length < place.least * diameter:
        yield Refused(path, f"{place}, too little for grains of diameter {diameter:g} m", remedy)
    elif place.length > diameter * _MAX_GLUED:
        yield Refused(path, f"{place}: more than {_MAX_GLUED:.3g} glued grains", remedy)
