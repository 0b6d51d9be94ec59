"""What no table can tell by itself: whether the tables of a scenario fit together."""

from __future__ import annotations

from multicor_cli.scenario.checks import cell, grains, laws, stages
from multicor_cli.scenario.problems import Refused
from multicor_cli.scenario.tables import PartialScenario


def check_all(tables: PartialScenario) -> list[Refused]:
    """All findings about how tables fit together; tables invalid on their own are left out."""
    checks = (
        laws.check,
        grains.check,
        grains.check_inflow,
        grains.check_walls,
        laws.check_shapes,
        stages.check,
        stages.check_ends,
        stages.check_timing,
        cell.check,
        laws.check_heat,
        laws.check_thermal_materials,
    )
    return [finding for check in checks for finding in check(tables)]
