"""Heat capacities, surfaces and initial temperatures of grains."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from multicor_cli.model import Thermal
from multicor_cli.model.columns import X, Y
from multicor_cli.model.model import Floats
from multicor_cli.packing.file import read_temperatures
from multicor_cli.packing.initial_grains import InitialGrains, masses
from multicor_cli.scenario import Scenario
from multicor_cli.scenario.base import KELVIN_BOUNDS
from multicor_cli.scenario.particles import (
    AnyTemperature,
    FileTemperature,
    GradientTemperature,
    ParticleGroup,
    RegionsTemperature,
    ValuesTemperature,
)
from multicor_cli.scenario.problems import Refused

_KEY = ("temperature",)


def group_thermal(scenario: Scenario, index: int, grains: InitialGrains, center: Floats) -> Thermal:
    """Heat capacities, initial temperatures and surfaces of the grains of a group.

    Args:
        scenario: A scenario with heat.
        index: Index of the group.
        grains: Its grains.
        center: Their centers, wrapped into the period [m], shape ``(n, 2)``.

    Raises:
        Refused: The temperatures cannot be read, are not one per grain, or are none; its key is relative to the group.
    """
    group = scenario.particles[index]
    material, radius = scenario.materials[group.material], grains.radius
    if material.heat_capacity is None:
        message = "a material of grains without heat capacity"  # loading a scenario excludes it
        raise ValueError(message)
    mass = masses(radius, material.density, group.shape, group.thickness)
    # 4π a² of a sphere, 2π a h of a disc.
    around = 2.0 * radius if group.shape == "sphere" else np.full(radius.size, group.thickness or math.nan)
    return Thermal(
        capacity=mass * material.heat_capacity,
        start=_start(scenario, group, grains, center),
        surface=np.asarray(2.0 * math.pi * radius * around),
    )


def joined(parts: Sequence[Thermal]) -> Thermal:
    """All grains of all groups."""
    return Thermal(
        capacity=np.concatenate([part.capacity for part in parts]),
        start=np.concatenate([part.start for part in parts]),
        surface=np.concatenate([part.surface for part in parts]),
    )


def _start(scenario: Scenario, group: ParticleGroup, grains: InitialGrains, center: Floats) -> Floats:
    """Initial temperatures [K], shape ``(n,)``: as the group says, else as the packing brings them, else those of ``[heat]``."""
    n, table = grains.radius.size, group.temperature
    if table is not None:
        return _told(scenario, table, center)
    if grains.temperature is not None:
        return grains.temperature
    assert scenario.heat is not None  # only then temperatures are asked for
    return np.full(n, scenario.heat.temperature)


def _told(scenario: Scenario, table: AnyTemperature, center: Floats) -> Floats:
    n = len(center)
    if isinstance(table, GradientTemperature):
        return _gradient(table, center)
    if isinstance(table, RegionsTemperature):
        return _regions(table, center)
    if isinstance(table, ValuesTemperature):
        return _one_per_grain(np.array(table.values, float), n, "values", "are given")
    if isinstance(table, FileTemperature):
        path = scenario.resolve_path(table.file)
        return _one_per_grain(read_temperatures(path), n, "file", f"are in '{path}'")
    return np.full(n, table)


def _gradient(table: GradientTemperature, center: Floats) -> Floats:
    x, y = (center - np.array(table.at)).T
    temperature = np.asarray(table.value + (x * table.gradient[0] + y * table.gradient[1]))
    low, high = KELVIN_BOUNDS
    wrong = np.flatnonzero(~((temperature >= low) & (temperature <= high)))
    if wrong.size:
        k = int(wrong[0])
        place = f"the grain {k} of the group at ({center[k, X]:g}, {center[k, Y]:g}) m"
        text = f"the gradient gives {place} a temperature of {temperature[k]:g} K, outside {low:g} to {high:g} K"
        raise Refused((*_KEY, "gradient"), text, "lower the gradient, or set at to a point among the grains")
    return temperature


def _regions(table: RegionsTemperature, center: Floats) -> Floats:
    temperature = np.full(len(center), table.value)
    for region in table.regions:
        temperature[region.area().contains(center)] = region.value
    return temperature


def _one_per_grain(temperature: Floats, n: int, key: str, where: str) -> Floats:
    if temperature.size != n:
        text = f"{temperature.size} temperatures {where} for {n} grains"
        raise Refused((*_KEY, key), text, "give one per grain of the group, in their order")
    return temperature


def sizes_problems(scenario: Scenario, groups: Sequence[InitialGrains]) -> list[Refused]:
    """What is wrong with the grains' sizes for the choices in ``[heat]``: the gas model for equal grains needs such."""
    gas = scenario.heat.gas if scenario.heat is not None else None
    if gas is None:
        return []
    smallest = min(float(group.radius.min()) for group in groups)
    largest = max(float(group.radius.max()) for group in groups)
    return gas.misfits(smallest, largest)
