"""Groups of grains fit together, into the domain and into their regions."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from multicor_cli.model.model import LEAST_DIAMETERS
from multicor_cli.scenario.checks.draft import Draft
from multicor_cli.scenario.packings import CompactedPacking, DepositedPacking, StartPacking, TilePacking
from multicor_cli.scenario.particles import ParticleGroup
from multicor_cli.scenario.problems import Finding, KeyPath, show
from multicor_cli.scenario.region import RectangleRegion, Region
from multicor_cli.scenario.settings import Domain

MAX_GRAINS = 50_000_000
"""More grains than any machine can hold today; a file that claims more is refused before memory is taken."""
_SLACK = 1e-9


def check(draft: Draft) -> Iterator[Finding]:
    """Findings about the groups of grains."""
    yield from double_names(draft.group_names, "particles")
    yield from _unlike_shapes(draft)
    yield from _unlike_starts(draft)
    yield from _too_many(draft)
    for k, group in enumerate(draft.particles):
        if group and draft.domain:
            yield from _check_group(("particles", k), group, draft.domain)


def double_names(names: Sequence[str | None], table: str) -> Iterator[Finding]:
    """Findings about names that are given twice in an array of tables."""
    first: dict[str, int] = {}
    for k, name in enumerate(names):
        if name is not None and first.setdefault(name, k) != k:
            yield Finding((table, k, "name"), f"{show(name)} is also the name of {table}.{first[name]}", "give another name")


def _unlike_shapes(draft: Draft) -> Iterator[Finding]:
    groups = [(k, group) for k, group in enumerate(draft.particles) if group]
    for k, group in groups[1:]:
        first = groups[0][1]
        if group.shape != first.shape:
            what = f"{show(group.shape)}, but the group '{first.name}' has {show(first.shape)}"
            yield Finding(("particles", k, "shape"), what, "use the same shape for all groups")


def _unlike_starts(draft: Draft) -> Iterator[Finding]:
    """With ``[start]`` all grains come from its run, and without it none do."""
    for k, group in enumerate(draft.particles):
        if group is None or isinstance(group.packing, StartPacking) == draft.has_start:
            continue
        if draft.has_start:
            kind = "no packing" if group.packing is None else f'kind = "{group.packing.kind}"'
            what = f"{kind} beside a table [start], whose run has all the grains"
            remedy = 'remove [[particles]], or [start]; packing = { kind = "start" } names a group of the run'
        else:
            what, remedy = 'kind = "start" without a table [start]', 'add [start] with run = "...", or use another packing'
        yield Finding(("particles", k, "packing"), what, remedy)


def region_of(group: ParticleGroup, domain: Domain) -> Region:
    """Where a group is placed: its region, or the whole domain."""
    return group.region or RectangleRegion(min=(0.0, 0.0), max=domain.size)


def _check_group(path: KeyPath, group: ParticleGroup, domain: Domain) -> Iterator[Finding]:
    region = region_of(group, domain)
    if domain.periodic and not (region.left >= 0.0 and region.right <= domain.size[0]):
        what = f"reaches from x = {region.left:g} to {region.right:g}, beyond the period from 0 to {domain.size[0]:g}"
        yield Finding((*path, "region"), what, "keep it inside [domain] size")
    if isinstance(group.packing, CompactedPacking | TilePacking) and not isinstance(region, RectangleRegion):
        what = f'packing kind = "{group.packing.kind}" fills rectangles only, not the {region}'
        yield Finding((*path, "region"), what, 'use region = { min, max }, or packing kind = "lattice", "random" or "deposited"')
    if isinstance(group.packing, DepositedPacking) and domain.gravity[1] >= 0.0:
        yield _no_weight((*path, "packing"), domain)
    if group.sizes is not None:
        yield from _check_sizes(path, group, region, domain)
    if isinstance(group.packing, TilePacking):
        yield from _check_tile(path, group.packing, region, domain)


def _check_sizes(path: KeyPath, group: ParticleGroup, region: Region, domain: Domain) -> Iterator[Finding]:
    assert group.sizes is not None
    diameter = 2.0 * group.sizes.largest
    tile = group.packing.tile if isinstance(group.packing, TilePacking) else (math.inf, math.inf)
    room = min(region.room, *tile)
    if diameter > room * (1.0 + _SLACK):
        is_plain = isinstance(region, RectangleRegion)
        place = f"{min(region.width, tile[0]):g} × {min(region.height, tile[1]):g} m" if is_plain else f"the {region}"
        what = f"grains of diameter {diameter:g} m do not fit into {place}"
        yield Finding((*path, "sizes"), what, "give radii and lengths in meters")
    elif domain.periodic and domain.size[0] < LEAST_DIAMETERS * diameter:
        what = f"the period {domain.size[0]:g} m is less than four of the largest diameters, {diameter:g} m"
        yield Finding((*path, "sizes"), what, "widen the domain or use smaller grains")
    elif group.count is not None and _least_area(group, group.count) > region.area().size:
        what = f"{group.count} grains cover more than the {region}"
        yield Finding((*path, "count"), what, "lower count, or enlarge region")


def _least_area(group: ParticleGroup, count: int) -> float:
    assert group.sizes is not None
    return count * math.pi * group.sizes.smallest * group.sizes.smallest


def _check_tile(path: KeyPath, packing: TilePacking, region: Region, domain: Domain) -> Iterator[Finding]:
    width, height = (packing.tile[axis] * packing.repeat[axis] for axis in (0, 1))
    if width > region.width * (1.0 + _SLACK) or height > region.height * (1.0 + _SLACK):
        covered = f"{packing.repeat[0]} × {packing.repeat[1]} tiles cover {width:g} × {height:g} m"
        what = f"{covered}, more than the {region}"
        yield Finding((*path, "packing", "repeat"), what, "use fewer tiles")
    if isinstance(packing.source, DepositedPacking) and domain.gravity[1] >= 0.0:
        yield _no_weight((*path, "packing", "source"), domain)


def _no_weight(path: KeyPath, domain: Domain) -> Finding:
    what = f"grains cannot be deposited with gravity = {list(domain.gravity)}"
    return Finding(path, what, "use gravity that points down in [domain], or another packing")


def _too_many(draft: Draft) -> Iterator[Finding]:
    """The total number of grains is bounded; counted from below where it follows from an area fraction."""
    total = 0.0
    for k, group in enumerate(draft.particles):
        if group is None or draft.domain is None:
            continue
        total += _least_count(group, draft.domain)
        if total > MAX_GRAINS:
            what = f"there would be at least {total:.3g} grains, more than {MAX_GRAINS:.3g}"
            yield Finding(("particles", k), what, "use fewer or larger grains; radii and lengths are in meters")
            return


def _least_count(group: ParticleGroup, domain: Domain) -> float:
    packing, sizes = group.packing, group.sizes
    if sizes is None:
        return 0.0
    largest_area = math.pi * sizes.largest * sizes.largest
    if isinstance(packing, TilePacking):
        one = packing.tile_count or (packing.tile_fill or 0.0) * packing.tile[0] * packing.tile[1] / largest_area
        return one * packing.repeat[0] * packing.repeat[1]
    region = region_of(group, domain)
    return group.count or (group.fill or 0.0) * region.area().size / largest_area
