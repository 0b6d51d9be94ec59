"""What grains that are no discs cannot do yet."""

from __future__ import annotations

from collections.abc import Iterator

from multicor_cli.scenario.heat import Heat
from multicor_cli.scenario.problems import KeyPath, Refused
from multicor_cli.scenario.tables import PartialScenario, given


def check(tables: PartialScenario) -> Iterator[Refused]:
    """Findings about laws and mechanisms that take grains for discs."""
    shaped = [group for _, group in given(tables.particles) if group.outline is not None]
    if not shaped:
        return
    grains = f"the grains of '{shaped[0].name}', which are no discs"
    for path, what in _of_discs(tables, {group.material for group in shaped}):
        remedy = 'remove it, or use shape = "disc" in all groups'
        yield Refused(path, f"{what} is not known of {grains}", remedy)


def _of_discs(tables: PartialScenario, materials: set[str]) -> Iterator[tuple[KeyPath, str]]:
    """Where the scenario asks for it, and what it is; ``materials`` are those of the grains."""
    for k, entry in given(tables.contacts):
        if entry.rolling_friction and not materials.isdisjoint(entry.pair):
            what = f"rolling resistance of {entry.rolling_friction:g}"
            yield ("contacts", k, "rolling_friction"), what
    for name in sorted(materials):
        material = tables.materials.get(name)
        if material is not None and material.expansion:
            what = f"thermal expansion of {material.expansion:g} 1/K"
            yield ("materials", name, "expansion"), what
    if tables.heat is not None:
        yield from _of_spheres(tables.heat)


def _of_spheres(heat: Heat) -> Iterator[tuple[KeyPath, str]]:
    """Mechanisms of heat whose formulas are those of spheres or discs."""
    if heat.wear_shrinks:
        yield ("heat", "wear_shrinks"), "how they shrink by wear"
    if heat.collisional:
        yield ("heat", "collisional"), "conduction in an impact"
    if heat.gas is not None:
        yield ("heat", "gas"), "conduction by gas in gaps"
    if heat.radiation is not None and heat.radiation.neighbors:
        yield ("heat", "radiation", "neighbors"), "radiation between neighbors"
