"""Walls fit to the domain and know what they are made of."""

from __future__ import annotations

from collections.abc import Iterator

from multicor_cli.scenario.checks.draft import Draft
from multicor_cli.scenario.checks.grains import double_names
from multicor_cli.scenario.gluing import Glued
from multicor_cli.scenario.particles import ParticleGroup
from multicor_cli.scenario.problems import Finding, KeyPath, name_list, show
from multicor_cli.scenario.sizes import AnySizes
from multicor_cli.scenario.translate import did_you_mean
from multicor_cli.scenario.walls import Wall

_MAX_GLUED = 10_000_000


def check(draft: Draft) -> Iterator[Finding]:
    """Findings about the walls."""
    yield from double_names(draft.wall_names, "walls")
    for k, wall in enumerate(draft.walls):
        if wall is None:
            continue
        yield from _unknown_groups(("walls", k, "groups"), wall, draft)
        path, glued = ("walls", k, "geometry"), wall.geometry.glued()
        if glued is not None:
            yield from _check_glued((*path, glued.key), glued, draft)
        if draft.domain:
            for found in wall.geometry.misfits(draft.domain):
                yield found._replace(path=(*path, *found.path))


def _unknown_groups(path: KeyPath, wall: Wall, draft: Draft) -> Iterator[Finding]:
    """Groups that a wall is to meet."""
    if None in draft.group_names or not draft.group_names:
        return  # the group that is meant may be one without a name
    known = [name for name in draft.group_names if name]
    for e, name in enumerate(wall.groups or ()):
        if name not in known:
            remedy = did_you_mean(name, known) or f"the groups are {name_list(known)}"
            yield Finding((*path, e), f"there is no group of particles {show(name)}", remedy)


def _check_glued(path: KeyPath, glued: Glued, draft: Draft) -> Iterator[Finding]:
    named = glued.sizes
    if named is not None and not isinstance(named, str):
        yield from _check_room(path, glued, named)
    elif named is not None and named not in draft.group_names:
        known = [name for name in draft.group_names if name]
        if not known or len(known) < len(draft.group_names):  # the group that is meant may be one without a name
            return
        remedy = did_you_mean(named, known) or f"use one of {name_list(known)}, or a table of sizes"
        yield Finding(path, f"there is no group of particles {show(named)}", remedy)
    elif draft.particles:
        group = draft.particles[0 if named is None else draft.group_names.index(named)]
        yield from _check_borrowed(path, glued, group, draft)


def _check_borrowed(path: KeyPath, glued: Glued, group: ParticleGroup | None, draft: Draft) -> Iterator[Finding]:
    """Glued grains with the sizes of a group of free grains."""
    if group is None:
        return
    if group.sizes is None:
        what = f"the group '{group.name}' has no sizes that the glued grains could have"
        yield Finding(path, what, 'give them here, as { kind = "uniform", min = 0.4e-3, max = 0.6e-3 }')
    elif draft.domain and 2.0 * group.sizes.largest <= min(draft.domain.size):  # if larger, the group itself is told
        yield from _check_room(path, glued, group.sizes)


def _check_room(path: KeyPath, glued: Glued, sizes: AnySizes) -> Iterator[Finding]:
    """Glued grains fit on the wall, in a number that makes sense."""
    place, diameter = glued.place, 2.0 * sizes.largest
    remedy = "give radii and points in meters"
    if place.length < place.least * diameter:
        yield Finding(path, f"{place}, too little for grains of diameter {diameter:g} m", remedy)
    elif place.length > diameter * _MAX_GLUED:
        yield Finding(path, f"{place}: more than {_MAX_GLUED:.3g} glued grains", remedy)
