"""Walls fit to the domain and know what they are made of."""

from __future__ import annotations

import math
from collections.abc import Iterator

from multicor_cli.scenario.checks.draft import Draft
from multicor_cli.scenario.checks.grains import double_names
from multicor_cli.scenario.particles import ParticleGroup
from multicor_cli.scenario.problems import Finding, KeyPath, name_list, show
from multicor_cli.scenario.settings import Domain
from multicor_cli.scenario.sizes import AnySizes
from multicor_cli.scenario.translate import did_you_mean
from multicor_cli.scenario.walls import BoxGeometry, CircleGeometry, PlaneGeometry, RoughGeometry, Wall

_MAX_GLUED = 10_000_000
_UPRIGHT = 1e-9


def check(draft: Draft) -> Iterator[Finding]:
    """Findings about the walls."""
    yield from double_names(draft.wall_names, "walls")
    for k, wall in enumerate(draft.walls):
        if wall is None:
            continue
        if wall.has_glued_grains:
            yield from _check_glued(("walls", k, "geometry"), wall, draft)
        if draft.domain and draft.domain.periodic:
            yield from _check_periodic(("walls", k, "geometry"), wall, draft.domain)


def _check_glued(path: KeyPath, wall: Wall, draft: Draft) -> Iterator[Finding]:
    path = (*path, "sizes" if isinstance(wall.geometry, RoughGeometry) else "rough")
    named = wall.glued_sizes
    if named is not None and not isinstance(named, str):
        yield from _check_room(path, wall, named)
    elif named is not None and named not in draft.group_names:
        known = [name for name in draft.group_names if name]
        if not known or len(known) < len(draft.group_names):  # the group that is meant may be one without a name
            return
        remedy = did_you_mean(named, known) or f"use one of {name_list(known)}, or a table of sizes"
        yield Finding(path, f"there is no group of particles {show(named)}", remedy)
    elif draft.particles:
        group = draft.particles[0 if named is None else draft.group_names.index(named)]
        yield from _check_borrowed(path, wall, group, draft)


def _check_borrowed(path: KeyPath, wall: Wall, group: ParticleGroup | None, draft: Draft) -> Iterator[Finding]:
    """Glued grains with the sizes of a group of free grains."""
    if group is None:
        return
    if group.sizes is None:
        what = f"the group '{group.name}' has no sizes that the glued grains could have"
        yield Finding(path, what, 'give them here, as { kind = "uniform", min = 0.4e-3, max = 0.6e-3 }')
    elif draft.domain and 2.0 * group.sizes.largest <= min(draft.domain.size):  # if larger, the group itself is told
        yield from _check_room(path, wall, group.sizes)


def _check_room(path: KeyPath, wall: Wall, sizes: AnySizes) -> Iterator[Finding]:
    """Glued grains fit on the wall, in a number that makes sense."""
    geometry, diameter = wall.geometry, 2.0 * sizes.largest
    if isinstance(geometry, RoughGeometry):
        length, least, what = geometry.length, diameter, f"the line is {geometry.length:g} m long"
    elif isinstance(geometry, CircleGeometry):
        length, least = 2.0 * math.pi * geometry.radius, 4.0 * math.pi * diameter
        what = f"the circle has a radius of {geometry.radius:g} m"
    else:
        return
    remedy = "give radii and points in meters"
    if length < least:
        yield Finding(path, f"{what}, too little for grains of diameter {diameter:g} m", remedy)
    elif length > diameter * _MAX_GLUED:
        yield Finding(path, f"{what}: more than {_MAX_GLUED:.3g} glued grains", remedy)


def _check_periodic(path: KeyPath, wall: Wall, domain: Domain) -> Iterator[Finding]:
    geometry = wall.geometry
    if isinstance(geometry, PlaneGeometry) and abs(geometry.normal[0]) > _UPRIGHT * abs(geometry.normal[1]):
        what = f"a plane with normal {list(geometry.normal)} crosses the periodic domain"
        yield Finding((*path, "normal"), what, "use [0, 1] or [0, -1], or periodic = false")
    if isinstance(geometry, BoxGeometry) and not {"left", "right"} <= set(geometry.open):
        what = f"the box has sides at left or right of a periodic domain: open = {list(geometry.open)}"
        yield Finding((*path, "open"), what, 'add "left" and "right", or use periodic = false')
    if isinstance(geometry, CircleGeometry) and 2.0 * geometry.radius > domain.size[0]:
        what = f"the circle of radius {geometry.radius:g} m is wider than the period of {domain.size[0]:g} m"
        yield Finding((*path, "radius"), what, "use periodic = false")
