"""From a ``sizes`` table of the scenario to a distribution."""

from __future__ import annotations

import numpy as np

from multicor_cli.packing.bodies import Shape
from multicor_cli.packing.sizes import MASS_POWER, SizeDistribution, list_sizes, lognormal_sizes, power_sizes, uniform_sizes
from multicor_cli.packing.tabulated_sizes import normal_sizes, table_sizes
from multicor_cli.scenario.models import AnySizes, ListSizes, LognormalSizes, NormalSizes, PowerSizes, TableSizes


def sizes_of(table: AnySizes, shape: Shape) -> SizeDistribution:
    """The distribution that a ``sizes`` table describes; ``shape`` tells how mass grows with the radius."""
    power = MASS_POWER[shape]
    if isinstance(table, ListSizes):
        fractions = None if table.fractions is None else np.array(table.fractions)
        return list_sizes(np.array(table.radii), fractions, table.by, power)
    if isinstance(table, LognormalSizes):
        return lognormal_sizes(table.median, table.sigma, table.min, table.max, table.by, power)
    if isinstance(table, NormalSizes):
        return normal_sizes(table.mean, table.sigma, table.min, table.max, table.by, power)
    if isinstance(table, TableSizes):
        return table_sizes(np.array(table.radii), np.array(table.passing), table.by, power)
    if isinstance(table, PowerSizes):
        return power_sizes(table.exponent, table.min, table.max, table.by, power)
    return uniform_sizes(table.min, table.max, table.by, power)
