"""Materials have the properties that the chosen heat mechanisms need."""

from __future__ import annotations

from collections.abc import Iterator

from multicor_cli.scenario.checks.draft import Draft
from multicor_cli.scenario.checks.laws import touching_pairs
from multicor_cli.scenario.heat import Heat
from multicor_cli.scenario.materials import ContactPair, Material
from multicor_cli.scenario.problems import Finding

LEAST_CONTRAST = 10.0
"""Smallest ratio of the conductivities of solid and gas for which the formula of Batchelor & O'Brien holds."""

UNITS = {
    "young": "Pa",
    "poisson": "",
    "conductivity": "W/(m K)",
    "heat_capacity": "J/(kg K)",
    "emissivity": "",
    "roughness": "m",
    "asperity_slope": "",
    "microhardness": "Pa",
    "hardness": "Pa",
    "resistivity": "Ω m",
}
"""Unit of each property, in the order in which they are named."""

_ROUGH = ("roughness", "asperity_slope", "microhardness")
_SPOT = ("conductivity", "young", "poisson")
_PARTITION = {
    "effusivity": ("conductivity", "heat_capacity"),
    "conductivity": ("conductivity",),
    "half": (),
    "electrothermal": ("conductivity", "resistivity"),
}

Needs = dict[str, set[str]]
"""For each property what needs it, in the words of the scenario."""


def check(draft: Draft) -> Iterator[Finding]:
    """Findings about thermal properties of materials."""
    if draft.heat is None:
        return
    of_grains = {group.material for group in draft.particles if group}
    of_walls = {wall.material for wall in draft.walls if wall}
    worn = _worn(draft)
    for name, material in draft.materials.items():
        if material is None or name not in of_grains | of_walls:
            continue
        needs = _needs(draft.heat, is_of_grains=name in of_grains, is_worn=name in worn)
        yield from _missing(name, material, needs)
        yield from _contrast(draft.heat, name, material)


def _needs(heat: Heat, *, is_of_grains: bool, is_worn: bool) -> Needs:
    """Properties that a material of grains or walls needs, and why."""
    needs: Needs = {key: set() for key in UNITS}

    def add(keys: tuple[str, ...], why: str) -> None:
        for key in keys:
            needs[key].add(why)

    if is_of_grains:
        add(("heat_capacity",), "[heat]")
    if heat.conduction != "none":
        add(_SPOT, f'conduction = "{heat.conduction}"')
    if heat.conduction == "rough":
        add(_ROUGH, 'conduction = "rough"')
    if heat.gas is not None:
        add(_SPOT, "gas")
    if heat.collisional:
        add((*_SPOT, "heat_capacity"), "collisional = true")
    if heat.has_sources:
        add(_PARTITION[heat.partition], f'partition = "{heat.partition}"')
    if heat.radiation is not None and (is_of_grains or heat.radiation.neighbors):
        add(("emissivity",), "radiation")
    if is_worn:
        add(("hardness",), "wear")
    return needs


def _missing(name: str, material: Material, needs: Needs) -> Iterator[Finding]:
    """One finding for all that a material lacks."""
    missing = [key for key, reasons in needs.items() if reasons and getattr(material, key) is None]
    if not missing:
        return
    reasons = sorted({reason for key in missing for reason in needs[key]})
    wanted = ", ".join(f"{key} [{UNITS[key]}]" if UNITS[key] else key for key in missing)
    what = f"'{name}' has no {', '.join(missing)}; needed by {', '.join(reasons)}"
    yield Finding(("materials", name), what, f"add {wanted}")


def _contrast(heat: Heat, name: str, material: Material) -> Iterator[Finding]:
    """The formula of Batchelor & O'Brien holds for solids that conduct much better than the gas."""
    gas = heat.gas
    if gas is None or gas.model != "batchelor" or material.conductivity is None:
        return
    if material.conductivity < LEAST_CONTRAST * gas.conductivity:
        ratio = material.conductivity / gas.conductivity
        what = (
            f"\"batchelor\" needs solids at least {LEAST_CONTRAST:g} times as conductive as the gas, '{name}' is {ratio:.3g} times"
        )
        yield Finding(("heat", "gas", "model"), what, 'use "parallel"')


def _worn(draft: Draft) -> set[str]:
    """Materials that wear: those of pairs that can touch and whose law has a coefficient of wear."""
    entries = [entry for entry in draft.contacts if entry]
    return {name for pair in touching_pairs(draft) if _law_wears(entries, *pair) for name in pair}


def _law_wears(entries: list[ContactPair], a: str, b: str) -> bool:
    covering = [entry for entry in entries if entry.covers(a, b)]
    return bool(covering) and max(covering, key=lambda entry: entry.specificity).wear is not None
