"""What the scenario of a run says of materials and of heat: models do not hold it."""

from __future__ import annotations

import tomllib
from typing import Any

import numpy as np

from multicor_cli.model.model import Floats
from multicor_cli.post.source import Run


def properties(source: Run, key: str) -> Floats:
    """A property of each material of the model; nan where it is not given, shape ``(k,)``."""
    said = tomllib.loads(source.scenario_resolved).get("materials", {})
    return np.array([said.get(name, {}).get(key, np.nan) for name in source.model.materials], float)


def solid_conductivity(source: Run) -> float:
    """The conductivity of the grains [W/(m K)]; nan if they have none, or several."""
    found = np.unique(properties(source, "conductivity")[np.unique(source.model.grains.material)])
    return float(found[0]) if found.size == 1 else np.nan


def gas_conductivity(source: Run) -> float:
    """The conductivity of the gas, in the gaps or around the grains [W/(m K)]; nan without one."""
    heat = heat_table(source)
    said = heat.get("gas", {}).get("conductivity", heat.get("ambient", {}).get("conductivity"))
    return np.nan if said is None else float(said)


def heat_table(source: Run) -> dict[str, Any]:
    """The table ``[heat]`` of the scenario, with all defaults; empty in a run without heat."""
    found: dict[str, Any] = tomllib.loads(source.scenario_resolved).get("heat", {})
    return found


def left_out(source: Run) -> str:
    """What conducts beside the contacts, in the scenario of the run; empty if nothing does."""
    heat = heat_table(source)
    ways = []
    if "gas" in heat:
        ways.append("the gas in the gaps")
    if heat.get("radiation", {}).get("neighbors"):
        ways.append("radiation between neighbors")
    return " and ".join(ways)
