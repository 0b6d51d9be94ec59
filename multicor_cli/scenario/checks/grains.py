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
from multicor_cli.scenario.tables import PartialScenario, given
from multicor_cli.scenario.translate import did_you_mean
from multicor_cli.scenario.walls import Glued

# ---- Groups of grains fit together, into the domain and into their regions

MAX_GRAINS = 50_000_000
"""More grains than any machine can hold today; they are refused before memory is taken."""
_SLACK = 1e-9


def check(tables: PartialScenario) -> Iterator[Refused]:
    """Findings about the groups of grains."""
    yield from double_names(tables.group_names, "particles")
    groups = list(given(tables.particles))
    for k, group in groups[1:]:
        first = groups[0][1]
        if group.body != first.body:
            one, other = (show(each.shape if each.outline is None else each.outline.kind)
                          for each in (group, first))  # fmt: skip
            what = f"{one}, but the group '{first.name}' has {other}"
            remedy = "use spheres in all groups or in none, where volumes are areas times thickness"
            yield Refused(("particles", k, "shape"), what, remedy)
    yield from _unlike_starts(tables)
    yield from _too_many(tables)
    for k, group in groups:
        if tables.domain:
            yield from _check_group(("particles", k), group, tables.domain)


def double_names(names: Sequence[str | None], table: str) -> Iterator[Refused]:
    """Findings about names that are given twice in an array of tables."""
    first: dict[str, int] = {}
    for k, name in enumerate(names):
        if name is not None and first.setdefault(name, k) != k:
            what = f"{show(name)} is also the name of {table}.{first[name]}"
            yield Refused((table, k, "name"), what, "give another name")


def _unlike_starts(tables: PartialScenario) -> Iterator[Refused]:
    """With ``[start]`` all grains come from its run, and without it none do."""
    for k, group in given(tables.particles):
        if isinstance(group.packing, StartPacking) == tables.has_start:
            continue
        if tables.has_start:
            kind = "no packing" if group.packing is None else f'kind = "{group.packing.kind}"'
            what = f"{kind} beside a table [start], whose run has all the grains"
            remedy = (
                'remove [[particles]], or [start]; packing = { kind = "start" } names a group of '
                "the run"
            )
        else:
            what = 'kind = "start" without a table [start]'
            remedy = 'add [start] with run = "...", or use another packing'
        yield Refused(("particles", k, "packing"), what, remedy)


def _beyond_period(path: KeyPath, region: Region, domain: Domain, remedy: str) -> Iterator[Refused]:
    low, high = region.area().corners().tolist()
    for axis, first, last, period in zip("xy", low, high, domain.periods, strict=False):
        if not (first >= 0.0 and last <= period):
            what = (
                f"reaches from {axis} = {first:g} to {last:g}, beyond the period from 0 to "
                f"{period:g}"
            )
            yield Refused(path, what, remedy)
            return


def _check_group(path: KeyPath, group: ParticleGroup, domain: Domain) -> Iterator[Refused]:
    region, packing = group.placed_in(domain), group.packing
    yield from _beyond_period((*path, "region"), region, domain, "keep it inside [domain] size")
    is_plain = isinstance(region, RectangleRegion)
    if isinstance(packing, CompactedPacking | TilePacking) and not is_plain:
        what = f'packing kind = "{packing.kind}" fills rectangles only, not the {region}'
        remedy = 'use region = { min, max }, or packing kind = "lattice", "random" or "deposited"'
        yield Refused((*path, "region"), what, remedy)
    if isinstance(packing, DepositedPacking) and domain.gravity[1] >= 0.0 and not domain.is_cell:
        yield _no_weight((*path, "packing"), domain)
    if group.sizes is not None:
        yield from _check_sizes(path, group, group.sizes, region, domain)
    if isinstance(packing, TilePacking):
        yield from _check_tile(path, packing, region, domain)


def _check_sizes(
    path: KeyPath, group: ParticleGroup, sizes: Sizes, region: Region, domain: Domain
) -> Iterator[Refused]:
    diameter = 2.0 * sizes.largest
    tile = group.packing.tile if isinstance(group.packing, TilePacking) else (math.inf, math.inf)
    if diameter > min(region.room, *tile) * (1.0 + _SLACK):
        place = f"the {region}"
        if isinstance(region, RectangleRegion):
            place = f"{min(region.width, tile[0]):g} × {min(region.height, tile[1]):g} m"
        what = f"grains of diameter {diameter:g} m do not fit into {place}"
        yield Refused((*path, "sizes"), what, "give radii and lengths in meters")
    elif fault := fault_of_period(domain, diameter):
        yield fault.within(*path, "sizes")
    elif group.count is not None:
        filled = 1.0 if group.outline is None else group.outline.filled
        least_area = group.count * filled * math.pi * sizes.smallest * sizes.smallest
        if least_area > region.area().size:
            what = f"{group.count} grains cover more than the {region}"
            yield Refused((*path, "count"), what, "lower count, or enlarge region")


def fault_of_period(domain: Domain, diameter: float) -> Refused | None:
    """What is wrong with a period for grains of this largest diameter [m]."""
    period = min(domain.periods, default=math.inf)
    if period >= LEAST_DIAMETERS * diameter:
        return None
    what = f"the period {period:g} m is less than four of the largest diameters, {diameter:g} m"
    return Refused((), what, "widen the domain or use smaller grains")


def _check_tile(
    path: KeyPath, packing: TilePacking, region: Region, domain: Domain
) -> Iterator[Refused]:
    width, height = (packing.tile[axis] * packing.repeat[axis] for axis in (0, 1))
    if width > region.width * (1.0 + _SLACK) or height > region.height * (1.0 + _SLACK):
        covered = f"{packing.repeat[0]} × {packing.repeat[1]} tiles cover {width:g} × {height:g} m"
        what = f"{covered}, more than the {region}"
        yield Refused((*path, "packing", "repeat"), what, "use fewer tiles")
    is_weightless = domain.gravity[1] >= 0.0 and not domain.is_cell
    if isinstance(packing.source, DepositedPacking) and is_weightless:
        yield _no_weight((*path, "packing", "source"), domain)


def _no_weight(path: KeyPath, domain: Domain) -> Refused:
    what = f"grains cannot be deposited with gravity = {list(domain.gravity)}"
    return Refused(path, what, "use gravity that points down in [domain], or another packing")


def _too_many(tables: PartialScenario) -> Iterator[Refused]:
    """The total number of grains is bounded; area fractions give a lower estimate."""
    total = 0.0
    for k, group in given(tables.particles):
        if group.sizes is None or tables.domain is None:
            continue
        packing, largest_area = group.packing, math.pi * group.sizes.largest * group.sizes.largest
        if isinstance(packing, TilePacking):
            area = (packing.tile_fill or 0.0) * packing.tile[0] * packing.tile[1]
            one = packing.tile_count or area / largest_area
            total += one * packing.repeat[0] * packing.repeat[1]
        else:
            area = (group.fill or 0.0) * group.placed_in(tables.domain).area().size
            total += group.count or area / largest_area
        if total > MAX_GRAINS:
            what = f"there would be at least {total:.3g} grains, more than {MAX_GRAINS:.3g}"
            remedy = "use fewer or larger grains; radii and lengths are in meters"
            yield Refused(("particles", k), what, remedy)
            return


# ---- Grains that come and go: releases and outlets fit into the domain, and to each other


def check_inflow(tables: PartialScenario) -> Iterator[Refused]:
    """Findings about releases and outlets."""
    names = [outlet.name if outlet else None for outlet in tables.outlets]
    yield from double_names(names, "outlets")
    for k, group in given(tables.particles):
        if group.release is not None and tables.domain is not None:
            yield from _check_release(("particles", k), group, group.release.region, tables.domain)
    for k, outlet in given(tables.outlets):
        yield from _check_outlet(("outlets", k), outlet, tables)


def _check_release(
    path: KeyPath, group: ParticleGroup, region: RectangleRegion, domain: Domain
) -> Iterator[Refused]:
    place, (width, height) = (*path, "release", "region"), domain.size
    if not (min(region.min) >= 0.0 and region.max[0] <= width and region.max[1] <= height):
        what = (
            f"reaches from {list(region.min)} to {list(region.max)} m, beyond the domain of "
            f"{width:g} × {height:g} m"
        )
        yield Refused(place, what, "keep it inside [domain] size, or enlarge that")
    diameter = 0.0 if group.sizes is None else 2.0 * group.sizes.largest
    if diameter > region.room * (1.0 + _SLACK):
        what = f"grains of diameter {diameter:g} m never fit into the {region}"
        yield Refused(place, what, "enlarge it: grains are released wholly inside")
    depends_on_place = isinstance(group.temperature, GradientTemperature | RegionsTemperature)
    if group.packing is None and depends_on_place:
        what = "the temperature depends on the place, but grains that wait have none"
        remedy = "give one temperature [K], or one for each grain"
        yield Refused((*path, "temperature"), what, remedy)


def _check_outlet(path: KeyPath, outlet: Outlet, tables: PartialScenario) -> Iterator[Refused]:
    low, high = outlet.region.min, outlet.region.max
    releases = [(k, group.release) for k, group in given(tables.particles)]
    for k, release in releases:
        if release is not None and all(
            low[axis] < release.region.max[axis] and release.region.min[axis] < high[axis]
            for axis in (0, 1)
        ):
            what = (
                f"overlaps the release region of particles.{k}: grains would leave where they come"
            )
            yield Refused((*path, "region"), what, "move one of the two")
    has_release = None in tables.particles or any(release for _, release in releases)
    if outlet.then == "release" and not has_release:
        what = "grains are to be released again, but no group has a release"
        remedy = 'give a group release = { rate = ..., region = ... }, or use then = "remove"'
        yield Refused((*path, "then"), what, remedy)
    if tables.domain is not None:
        remedy = "keep it within the period: x is counted there"
        yield from _beyond_period((*path, "region"), outlet.region, tables.domain, remedy)


# ---- Walls fit to the domain and know what they are made of

_MAX_GLUED = 10_000_000


def check_walls(tables: PartialScenario) -> Iterator[Refused]:
    """Findings about the walls."""
    yield from double_names(tables.wall_names, "walls")
    groups = [name for name in tables.group_names if name]
    are_known = bool(groups) and None not in tables.group_names  # else it may be one without a name
    for k, wall in given(tables.walls):
        for e, name in enumerate(wall.groups or ()):
            if are_known and name not in groups:
                remedy = did_you_mean(name, groups) or f"the groups are {name_list(groups)}"
                what = f"there is no group of particles {show(name)}"
                yield Refused(("walls", k, "groups", e), what, remedy)
        path, glued = ("walls", k, "geometry"), wall.geometry.glued()
        if glued is not None:
            place, sizes = (*path, glued.key), glued.sizes
            if isinstance(sizes, str) and sizes not in groups:
                remedy = did_you_mean(sizes, groups)
                remedy = remedy or f"use one of {name_list(groups)}, or a table of sizes"
                if groups and len(groups) == len(tables.group_names):
                    what = f"there is no group of particles {show(sizes)}"
                    yield Refused(place, what, remedy)
            elif sizes is not None and not isinstance(sizes, str):
                yield from _check_room(place, glued, sizes)
            elif tables.particles:
                number = 0 if sizes is None else tables.group_names.index(sizes)
                yield from _check_borrowed(place, glued, tables.particles[number], tables)
        if tables.domain and not tables.is_cell:
            for misfit in wall.geometry.misfits(tables.domain):
                yield misfit.within(*path)


def _check_borrowed(
    path: KeyPath, glued: Glued, group: ParticleGroup | None, tables: PartialScenario
) -> Iterator[Refused]:
    """Glued grains with the sizes of a group of free grains."""
    if group is not None and group.sizes is None:
        what = f"the group '{group.name}' has no sizes that the glued grains could have"
        remedy = 'give them here, as { kind = "uniform", min = 0.4e-3, max = 0.6e-3 }'
        yield Refused(path, what, remedy)
    # If they are larger, the group itself is told
    elif (
        group
        and group.sizes
        and tables.domain
        and 2.0 * group.sizes.largest <= min(tables.domain.size)
    ):
        yield from _check_room(path, glued, group.sizes)


def _check_room(path: KeyPath, glued: Glued, sizes: Sizes) -> Iterator[Refused]:
    """Glued grains fit on the wall, in a number that makes sense."""
    place, diameter = glued.place, 2.0 * sizes.largest
    remedy = "give radii and points in meters"
    if place.length < place.least * diameter:
        yield Refused(path, f"{place}, too little for grains of diameter {diameter:g} m", remedy)
    elif place.length > diameter * _MAX_GLUED:
        yield Refused(path, f"{place}: more than {_MAX_GLUED:.3g} glued grains", remedy)
