"""What grains that are no discs cannot do yet."""

from __future__ import annotations

from collections.abc import Iterator

from multicor_cli.scenario.problems import Refused
from multicor_cli.scenario.tables import PartialScenario, given


def check(tables: PartialScenario) -> Iterator[Refused]:
    """Findings about laws and mechanisms that take grains for discs."""
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
