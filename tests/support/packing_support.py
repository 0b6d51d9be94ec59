"""Small scenes and measures for the tests of packings."""

from pathlib import Path

import numpy as np
import pytest
from scenes import PACKED

from multicor_cli.model import Model, State
from multicor_cli.packing import build
from multicor_cli.packing.overlap import find_pairs
from multicor_cli.packing.sizes import ContinuousSizes, Stream, power_sizes
from multicor_cli.packing.walls import Obstacles
from multicor_cli.scenario import Scenario, ScenarioError, parse_scenario
from multicor_cli.scenario.problems import Problem

SECOND = """
[[particles]]
name = "second"
material = "steel"
shape = "disc"
thickness = 1e-3
sizes = { kind = "list", radii = [0.5e-3] }
count = 100
packing = { kind = "random" }
"""
"""A group of other grains."""

GRAVITY = "domain.gravity=[0.0,-9.81]"
PERIODIC = "domain.periodic=true"


def generator(seed: int = 3) -> Stream:
    return Stream(np.random.Philox(seed))


def uniform(low: float, high: float) -> ContinuousSizes:
    return power_sizes(0.0, low, high, 0)


def scenario(
    *overrides: str, text: str = PACKED, extra: str = "", path: str | Path = "test.toml"
) -> Scenario:
    return parse_scenario(text + extra, path, overrides)


def built(*overrides: str, **given: str) -> tuple[Model, State]:
    return build(scenario(*overrides, **given))


def problems(*overrides: str, **given: str) -> list[Problem]:
    """What is wrong when a scenario is built."""
    with pytest.raises(ScenarioError) as caught:
        built(*overrides, **given)
    return caught.value.problems


def wall(name: str, geometry: str, rest: str = "") -> str:
    return (
        f'\n[[walls]]\nname = "{name}"\nmaterial = "steel"\ngeometry = {{ {geometry} }}\n{rest}\n'
    )


def pair_gaps(
    position: np.ndarray, radius: np.ndarray, cutoff: float, period: float = 0.0
) -> tuple[np.ndarray, ...]:
    """Grains i, j and gaps of all pairs closer than ``cutoff``, however the packing was made."""
    pairs = find_pairs(position[:, :2].copy(), radius, Obstacles.none(), cutoff, period)
    i = np.repeat(np.arange(radius.size), np.diff(pairs.row))
    j = pairs.partner
    d = position[i, :2] - position[j, :2]
    if period:
        d[:, 0] -= period * np.round(d[:, 0] / period)
    return i, j, np.hypot(d[:, 0], d[:, 1]) - radius[i] - radius[j]


def smallest_gap(position: np.ndarray, radius: np.ndarray, period: float = 0.0) -> float:
    """Smallest gap of any two grains, by comparing all of them (few grains only) [m]."""
    d = position[:, None, :2] - position[None, :, :2]
    if period:
        d[..., 0] -= period * np.round(d[..., 0] / period)
    gap = np.hypot(d[..., 0], d[..., 1]) - radius[:, None] - radius[None, :]
    return float(gap[~np.eye(radius.size, dtype=bool)].min())
