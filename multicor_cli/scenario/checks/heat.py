"""Thermal keys have an effect: ``[heat]`` is there where it is needed, and stages, walls and gas can do what is asked of them."""

from __future__ import annotations

from collections.abc import Iterator

from multicor_cli.scenario.checks.draft import Draft
from multicor_cli.scenario.heat import Heat
from multicor_cli.scenario.problems import Finding, KeyPath
from multicor_cli.scenario.wall_heat import AnyCondition, FlowCondition, TemperatureCondition


def check(draft: Draft) -> Iterator[Finding]:
    """Findings about heat, but for the properties of materials."""
    if not draft.has_heat:
        yield from _without_heat(draft)
        return
    yield from _never_on(draft)
    if draft.heat is not None:
        yield from _check_frozen(draft, draft.heat)
        yield from _check_conditions(draft, draft.heat)
        yield from _check_sizes(draft, draft.heat)


def _without_heat(draft: Draft) -> Iterator[Finding]:
    """Keys that mean nothing without ``[heat]``."""
    for path in _thermal_keys(draft):
        yield Finding(path, f"there is no heat in this scenario, but {path[-1]} needs it", "add a table [heat], or remove the key")


def _thermal_keys(draft: Draft) -> Iterator[KeyPath]:
    for k, entry in enumerate(draft.contacts):
        for keys in entry.thermal_keys if entry else ():
            yield ("contacts", k, *keys)
    yield from (("particles", k, "temperature") for k, group in enumerate(draft.particles) if group and group.temperature)
    yield from (("walls", k, "thermal") for k, wall in enumerate(draft.walls) if wall and wall.thermal)
    for k, stage in enumerate(draft.loading):
        if stage is None:
            continue
        for e, softer in enumerate(stage.contacts):
            for keys in softer.thermal_keys:
                yield ("loading", k, "contacts", e, *keys)
        given = {"thermal": bool(stage.thermal), "frozen": stage.frozen, "heat": stage.heat is not None}
        yield from (("loading", k, key) for key, is_given in given.items() if is_given)


def _never_on(draft: Draft) -> Iterator[Finding]:
    """A table ``[heat]`` that no stage uses."""
    if draft.loading and all(stage is not None and stage.heat is False for stage in draft.loading):
        yield Finding(("heat",), "all stages have heat = false: no temperature ever changes", "remove [heat], or one heat = false")


def _check_frozen(draft: Draft, heat: Heat) -> Iterator[Finding]:
    """Contact spots need forces, which only a step of the mechanics finds out, here or in the run of ``[start]``."""
    knows_spots = draft.has_start or not heat.needs_forces
    for k, stage in enumerate(draft.loading):
        if stage is None or not stage.frozen:
            return
        if not knows_spots:
            what = "the forces of the contacts are not known before the first step, and conduction needs them"
            remedy = "add a stage of at least one step before it, or give [heat] force = { prescribed = ... }"
            yield Finding(("loading", k, "frozen"), what, remedy)
            return


def _check_conditions(draft: Draft, heat: Heat) -> Iterator[Finding]:
    """What is prescribed at a wall reaches the grains somehow."""
    if heat.has_spots:
        return
    has_effect = heat.has_sources or heat.crosses_gaps
    for path, condition in _conditions(draft):
        if isinstance(condition, FlowCondition):
            what = 'no heat can flow from the wall into grains with conduction = "none" and without gas'
            yield Finding((*path, "flow"), what, "let contacts conduct, or prescribe the temperature of the wall")
        elif isinstance(condition, TemperatureCondition) and not has_effect:
            what = 'the wall cannot heat grains with conduction = "none" and without gas, friction or radiation of neighbors'
            yield Finding((*path, "temperature"), what, "let contacts conduct, or remove it")


def _conditions(draft: Draft) -> Iterator[tuple[KeyPath, AnyCondition]]:
    for k, wall in enumerate(draft.walls):
        if wall and wall.thermal:
            yield ("walls", k, "thermal"), wall.thermal
    for k, stage in enumerate(draft.loading):
        for name, condition in stage.thermal.items() if stage else ():
            yield ("loading", k, "thermal", name), condition


def _check_sizes(draft: Draft, heat: Heat) -> Iterator[Finding]:
    """The gas model for equal grains; groups that bring their grains are checked when they are made."""
    sizes = [group.sizes for group in draft.particles if group and group.sizes]
    if heat.gas is None or not sizes:
        return
    yield from heat.gas.misfits(min(table.smallest for table in sizes), max(table.largest for table in sizes))
