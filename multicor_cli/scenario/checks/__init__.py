"""What no table can tell by itself: whether the tables of a scenario fit together."""

from __future__ import annotations

from multicor_cli.scenario.checks import ends, exchange, grains, heat, laws, stages, thermal_materials, timing, walls
from multicor_cli.scenario.checks.draft import Draft
from multicor_cli.scenario.problems import Finding

__all__ = ["Draft", "check_all"]


def check_all(draft: Draft) -> list[Finding]:
    """All findings about how the tables fit together; tables that are invalid on their own are passed over."""
    checks = (
        laws.check,
        grains.check,
        exchange.check,
        walls.check,
        stages.check,
        ends.check,
        timing.check,
        heat.check,
        thermal_materials.check,
    )
    return [finding for check in checks for finding in check(draft)]
