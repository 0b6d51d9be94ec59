"""Grains that come and go find their places: releases and outlets fit into the domain, and to each other."""

from __future__ import annotations

from collections.abc import Iterator

from multicor_cli.scenario.checks.draft import Draft
from multicor_cli.scenario.checks.grains import double_names
from multicor_cli.scenario.exchange import Outlet
from multicor_cli.scenario.models import GradientTemperature, RegionsTemperature
from multicor_cli.scenario.particles import ParticleGroup
from multicor_cli.scenario.problems import Finding, KeyPath
from multicor_cli.scenario.region import RectangleRegion
from multicor_cli.scenario.settings import Domain

_SLACK = 1e-9


def check(draft: Draft) -> Iterator[Finding]:
    """Findings about releases and outlets."""
    yield from double_names([outlet.name if outlet else None for outlet in draft.outlets], "outlets")
    for k, group in enumerate(draft.particles):
        if group is not None and group.release is not None and draft.domain is not None:
            yield from _check_release(("particles", k), group, draft.domain)
    for k, outlet in enumerate(draft.outlets):
        if outlet is not None:
            yield from _check_outlet(("outlets", k), outlet, draft)


def _check_release(path: KeyPath, group: ParticleGroup, domain: Domain) -> Iterator[Finding]:
    assert group.release is not None
    region, (width, height) = group.release.region, domain.size
    if not (region.min[0] >= 0.0 and region.max[0] <= width and region.min[1] >= 0.0 and region.max[1] <= height):
        what = f"reaches from {list(region.min)} to {list(region.max)} m, beyond the domain of {width:g} × {height:g} m"
        yield Finding((*path, "release", "region"), what, "keep it inside [domain] size, or enlarge that")
    if group.sizes is not None:
        diameter = 2.0 * group.sizes.largest
        if diameter > min(region.width, region.height) * (1.0 + _SLACK):
            what = f"grains of diameter {diameter:g} m never fit into the region of {region.width:g} × {region.height:g} m"
            yield Finding((*path, "release", "region"), what, "enlarge it: grains are released wholly inside")
    if group.packing is None and isinstance(group.temperature, GradientTemperature | RegionsTemperature):
        what = "the temperature depends on the place, but grains that wait have none"
        yield Finding((*path, "temperature"), what, "give one temperature [K], or one for each grain")


def _check_outlet(path: KeyPath, outlet: Outlet, draft: Draft) -> Iterator[Finding]:
    groups = [(k, group) for k, group in enumerate(draft.particles) if group is not None]
    for k, group in groups:
        if group.release is not None and _overlap(outlet.region, group.release.region):
            what = f"overlaps the release region of particles.{k}: grains would leave where they come"
            yield Finding((*path, "region"), what, "move one of the two")
    if outlet.then == "release" and len(groups) == len(draft.particles) and not any(group.release for _, group in groups):
        what = "grains are to be released again, but no group has a release"
        yield Finding((*path, "then"), what, 'give a group release = { rate = ..., region = ... }, or use then = "remove"')
    domain = draft.domain
    if domain is not None and domain.periodic and not (outlet.region.min[0] >= 0.0 and outlet.region.max[0] <= domain.size[0]):
        what = (
            f"reaches from x = {outlet.region.min[0]:g} to {outlet.region.max[0]:g}, beyond the period from 0 to {domain.size[0]:g}"
        )
        yield Finding((*path, "region"), what, "keep it within the period: x is counted there")


def _overlap(a: RectangleRegion, b: RectangleRegion) -> bool:
    return all(a.min[axis] < b.max[axis] and b.min[axis] < a.max[axis] for axis in (0, 1))
