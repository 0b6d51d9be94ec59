"""Materials have the properties that the chosen heat mechanisms and contact laws need, and are fit for them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from multicor_cli.scenario.checks.draft import Draft
from multicor_cli.scenario.checks.laws import touching_pairs
from multicor_cli.scenario.heat import Need
from multicor_cli.scenario.materials import ContactPair, Material
from multicor_cli.scenario.problems import Finding


def check(draft: Draft) -> Iterator[Finding]:
    """Findings about thermal properties of materials."""
    if draft.heat is None:
        return
    of_grains = {group.material for group in draft.particles if group}
    of_walls = {wall.material for wall in draft.walls if wall}
    laws = _laws(draft)
    for name, material in draft.materials.items():
        if material is None or name not in of_grains | of_walls:
            continue
        needs = list(draft.heat.needs(is_of_grains=name in of_grains))
        needs += [need for pair, law in laws.items() if name in pair for need in law.needs]
        yield from _missing(name, material, needs)
        for mechanism in draft.heat.mechanisms.values():
            yield from mechanism.check_material(name, material)


def _missing(name: str, material: Material, needs: Iterable[Need]) -> Iterator[Finding]:
    """One finding for all that a material lacks."""
    lacking = {key: {why for why, keys in needs if key in keys} for key, value in material if value is None}
    missing = [key for key, reasons in lacking.items() if reasons]
    if missing:
        reasons = sorted(set().union(*lacking.values()))
        what = f"'{name}' has no {', '.join(missing)}; needed by {', '.join(reasons)}"
        yield Finding(("materials", name), what, f"add {', '.join(map(Material.with_unit, missing))}")


def _laws(draft: Draft) -> dict[tuple[str, str], ContactPair]:
    """The laws of the pairs of materials that can touch, as far as they are known."""
    entries = [entry for entry in draft.contacts if entry]
    covering = {pair: [entry for entry in entries if entry.covers(*pair)] for pair in touching_pairs(draft)}
    return {pair: max(found, key=lambda entry: entry.specificity) for pair, found in covering.items() if found}
