"""Materials are defined, each touching pair has one contact law, and heat has what it needs."""

from __future__ import annotations

import operator
from collections.abc import Iterable, Iterator, Sequence
from itertools import combinations_with_replacement

from multicor_cli.scenario.drives import FlowCondition, TemperatureCondition, WallCondition
from multicor_cli.scenario.heat import Heat
from multicor_cli.scenario.materials import MAX_MATERIALS, Material, Need, PairFriction
from multicor_cli.scenario.problems import KeyPath, Refused, format_key, name_list, show
from multicor_cli.scenario.tables import PartialScenario, given
from multicor_cli.scenario.translate import did_you_mean

# ---- Materials and contact laws

_MAX_NAMED_PAIRS = 5

Entries = Sequence[PairFriction | None]


def check(tables: PartialScenario) -> Iterator[Refused]:
    """Findings about materials and contact laws."""
    if len(tables.material_names) > MAX_MATERIALS:
        return
    yield from _undefined_materials(tables)
    for path, entries in _lists(tables):
        first = _by_pair(entries)
        for k, entry in given(entries):
            if (before := first[_key(*entry.pair)]) != k:
                twice = f"the pair {_show_pair(entry.pair)} is given twice, first in"
                what = f"{twice} {format_key(path)}.{before}"
                yield Refused((*path, k, "pair"), what, "remove one of the two")
        yield from _ambiguous_pairs(path, entries, tables)
    yield from _uncovered_pairs(tables)


def _lists(tables: PartialScenario) -> Iterator[tuple[KeyPath, Entries]]:
    """``[[contacts]]``, and what stages say of friction."""
    yield ("contacts",), tables.contacts
    for k, stage in given(tables.loading):
        yield ("loading", k, "contacts"), stage.contacts


def _undefined_materials(tables: PartialScenario) -> Iterator[Refused]:
    used: list[tuple[KeyPath, str]] = []
    for path, entries in _lists(tables):
        for k, entry in given(entries):
            used += [((*path, k, "pair", e), name) for e, name in enumerate(entry.pair)]
    for table in ("particles", "walls"):
        owners = given(getattr(tables, table))
        used += [((table, k, "material"), owner.material) for k, owner in owners]
    known = tables.material_names
    for path, name in used:
        if known and name not in (*known, "*"):
            remedy = did_you_mean(name, known)
            remedy = remedy or f"add [materials.{name}], or use one of {name_list(known)}"
            yield Refused(path, f"there is no material {show(name)}", remedy)


def _key(a: str, b: str) -> tuple[str, str]:
    return (a, b) if a <= b else (b, a)


def _by_pair(entries: Entries) -> dict[tuple[str, str], int]:
    """Index of the first entry of each unordered pair."""
    first: dict[tuple[str, str], int] = {}
    for k, entry in given(entries):
        first.setdefault(_key(*entry.pair), k)
    return first


def touching_pairs(tables: PartialScenario) -> list[tuple[str, str]]:
    """Pairs of materials that can touch: grains with grains, and with walls that they meet."""
    known, groups = set(tables.material_names), [group for group in tables.particles if group]
    grains = sorted({group.material for group in groups} & known)
    pairs = set(combinations_with_replacement(grains, 2))
    for wall in tables.walls:
        if wall and wall.material in known:
            met = [each for each in groups if wall.groups is None or each.name in wall.groups]
            pairs |= {_key(each.material, wall.material) for each in met if each.material in known}
    return sorted(pairs)


def _show_pair(pair: tuple[str, str]) -> str:
    return f'["{pair[0]}", "{pair[1]}"]'


def _ambiguous_pairs(path: KeyPath, entries: Entries, tables: PartialScenario) -> Iterator[Refused]:
    """Pairs that two entries such as ["a", "*"] and ["b", "*"] cover, but none of their own."""
    first = _by_pair(entries)
    told: set[int] = set()
    for a, b in touching_pairs(tables):
        rivals = sorted(first[key] for key in {("*", a), ("*", b)} if key in first)
        if len(rivals) == 2 and (a, b) not in first and rivals[1] not in told:
            told.add(rivals[1])
            one, other = (f"{format_key(path)}.{rival}" for rival in rivals)
            what = f"{one} and {other} both apply to the pair {_show_pair((a, b))}"
            yield Refused(
                (*path, rivals[1], "pair"), what, f"add an entry with pair = {_show_pair((a, b))}"
            )


def _uncovered_pairs(tables: PartialScenario) -> Iterator[Refused]:
    """One finding for all pairs without a law, unless a wrong entry may be meant for them."""
    named = {name for _, entry in given(tables.contacts) for name in entry.pair if name != "*"}
    if None in tables.contacts or not named <= set(tables.material_names):
        return
    covered = _by_pair(tables.contacts).keys()
    uncovered = [
        (a, b)
        for a, b in touching_pairs(tables)
        if not covered & {_key(a, b), ("*", a), ("*", b), ("*", "*")}  # "*" sorts before all names
    ]
    if uncovered:
        pairs = ", ".join(_show_pair(pair) for pair in uncovered[:_MAX_NAMED_PAIRS])
        if len(uncovered) > _MAX_NAMED_PAIRS:
            pairs += f" and {len(uncovered) - _MAX_NAMED_PAIRS} more"
        example = _show_pair(uncovered[0])
        remedy = f'add [[contacts]] with pair = {example}, or ["*", "*"] for all others'
        yield Refused(("contacts",), f"no contact law for {pairs}", remedy)


def check_shapes(tables: PartialScenario) -> Iterator[Refused]:
    """Findings about laws and mechanisms that take grains for discs, if some are no discs."""
    shaped = [group for _, group in given(tables.particles) if group.outline is not None]
    if not shaped:
        return
    grains = f"the grains of '{shaped[0].name}', which are no discs"
    materials = {group.material for group in shaped}
    for k, entry in given(tables.contacts):
        if entry.rolling_friction and not materials.isdisjoint(entry.pair):
            what = f"rolling resistance of {entry.rolling_friction:g} is not known of {grains}"
            remedy = 'remove it, or use shape = "disc" in all groups'
            yield Refused(("contacts", k, "rolling_friction"), what, remedy)
    gas = tables.heat.gas if tables.heat is not None else None
    if gas is not None and gas.model != "parallel":
        what = f'"{gas.model}" is a formula for spheres, but there are {grains}'
        yield Refused(("heat", "gas", "model"), what, 'use "parallel"')


# ---- Thermal keys have an effect: `[heat]`, stages, walls and gas can do what is asked of them


def check_heat(tables: PartialScenario) -> Iterator[Refused]:
    """Findings about heat, but for the properties of materials."""
    if not tables.has_heat:
        for path in _thermal_keys(tables):
            what = f"there is no heat in this scenario, but {path[-1]} needs it"
            yield Refused(path, what, "add a table [heat], or remove the key")
        return
    if tables.loading and all(stage and stage.heat is False for stage in tables.loading):
        what = "all stages have heat = false: no temperature ever changes"
        yield Refused(("heat",), what, "remove [heat], or one heat = false")
    if tables.heat is not None:
        if tables.heat.wear_shrinks and not any(entry.wear for _, entry in given(tables.contacts)):
            remedy = "give a pair of materials wear, or remove wear_shrinks"
            yield Refused(("heat", "wear_shrinks"), "no pair of materials wears", remedy)
        yield from _check_frozen(tables, tables.heat)
        if not tables.heat.has_spots:
            yield from _check_conditions(tables, tables.heat)
        # Groups that bring their grains are checked later
        sizes = [group.sizes for group in tables.particles if group and group.sizes]
        if tables.heat.gas is not None and sizes:
            smallest, largest = min(s.smallest for s in sizes), max(s.largest for s in sizes)
            yield from tables.heat.gas.misfits(smallest, largest)


def _thermal_keys(tables: PartialScenario) -> Iterator[KeyPath]:
    """Keys that mean nothing without ``[heat]``."""
    for k, entry in given(tables.contacts):
        for keys in entry.thermal_keys:
            yield ("contacts", k, *keys)
    for name, material in tables.materials.items():
        if material is not None and material.expansion is not None:
            yield "materials", name, "expansion"
    for table, key in (("particles", "temperature"), ("walls", "thermal")):
        for k, owner in given(getattr(tables, table)):
            if getattr(owner, key):
                yield table, k, key
    for k, stage in given(tables.loading):
        for e, softer in enumerate(stage.contacts):
            for keys in softer.thermal_keys:
                yield ("loading", k, "contacts", e, *keys)
        said = {"thermal": stage.thermal, "frozen": stage.frozen, "heat": stage.heat is not None}
        yield from (("loading", k, key) for key, is_said in said.items() if is_said)


def _check_frozen(tables: PartialScenario, heat: Heat) -> Iterator[Refused]:
    """Contact spots need forces, which only a mechanical step finds, here or in ``[start]``."""
    for k, stage in enumerate(tables.loading):
        if stage is None or not stage.frozen:
            return
        if heat.needs_forces and not tables.has_start:
            what = (
                "the forces of the contacts are not known before the first step, and conduction "
                "needs them"
            )
            remedy = (
                "add a stage of at least one step before it, or give [heat] force = { prescribed "
                "= ... }"
            )
            yield Refused(("loading", k, "frozen"), what, remedy)
            return


def _check_conditions(tables: PartialScenario, heat: Heat) -> Iterator[Refused]:
    """What is prescribed at a wall reaches grains without contact spots somehow."""
    conditions: list[tuple[KeyPath, WallCondition]] = [
        (("walls", k, "thermal"), wall.thermal) for k, wall in given(tables.walls) if wall.thermal
    ]
    for k, stage in given(tables.loading):
        for name, condition in stage.thermal.items():
            conditions.append((("loading", k, "thermal", name), condition))
    crosses_gaps = any(getattr(table, "reach", None) for table in heat.mechanisms.values())
    has_effect = heat.has_sources or crosses_gaps
    for path, condition in conditions:
        if isinstance(condition, FlowCondition):
            what = (
                'no heat can flow from the wall into grains with conduction = "none" and without '
                "gas"
            )
            remedy = "let contacts conduct, or prescribe the temperature of the wall"
            yield Refused((*path, "flow"), what, remedy)
        elif isinstance(condition, TemperatureCondition) and not has_effect:
            what = (
                'the wall cannot heat grains with conduction = "none" and without gas, friction '
                "or radiation of neighbors"
            )
            yield Refused((*path, "temperature"), what, "let contacts conduct, or remove it")


# ---- Materials have the properties that the chosen mechanisms and laws need, and fit them


def check_thermal_materials(tables: PartialScenario) -> Iterator[Refused]:
    """Findings about thermal properties of materials."""
    if tables.heat is None:
        return
    of_grains = {group.material for group in tables.particles if group}
    of_walls = {wall.material for wall in tables.walls if wall}
    entries = [entry for entry in tables.contacts if entry]
    covering = {
        pair: [entry for entry in entries if entry.covers(*pair)] for pair in touching_pairs(tables)
    }
    specificity = operator.attrgetter("specificity")
    laws = {pair: max(found, key=specificity) for pair, found in covering.items() if found}
    for name, material in tables.materials.items():
        if material is None or name not in of_grains | of_walls:
            continue
        needs = list(tables.heat.needs(is_of_grains=name in of_grains))
        needs += [need for pair, law in laws.items() if name in pair for need in law.needs]
        yield from _missing(name, material, needs)
        for mechanism in tables.heat.mechanisms.values():
            yield from mechanism.check_material(name, material)


def _missing(name: str, material: Material, needs: Iterable[Need]) -> Iterator[Refused]:
    """One finding for all that a material lacks."""
    lacking = {
        key: {why for why, keys in needs if key in keys} for key, value in material if value is None
    }
    missing = [key for key, reasons in lacking.items() if reasons]
    if missing:
        reasons = sorted(set().union(*lacking.values()))
        what = f"'{name}' has no {', '.join(missing)}; needed by {', '.join(reasons)}"
        remedy = f"add {', '.join(map(Material.with_unit, missing))}"
        yield Refused(("materials", name), what, remedy)
