"""Of materials and groups: laws of all pairs of materials, heat capacities, temperatures."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from multicor_cli.model import Thermal
from multicor_cli.model.columns import X, Y
from multicor_cli.model.model import RANGE, ContactLaws, Floats, Grains, Model, Walls, WallShapes
from multicor_cli.packing.file import read_temperatures
from multicor_cli.packing.initial_grains import InitialGrains, masses
from multicor_cli.scenario import Scenario
from multicor_cli.scenario.base import KELVIN_BOUNDS
from multicor_cli.scenario.materials import ContactPair, FlashFriction, FrictionTable, Softening
from multicor_cli.scenario.particles import (
    FileTemperature,
    GradientTemperature,
    ParticleGroup,
    RegionsTemperature,
    ValuesTemperature,
)
from multicor_cli.scenario.problems import Refused

# ---- Contact laws

_UNSOFTENED = Softening(softening=0.0)
"""Leaves every coefficient that a scenario can have as it is, at any temperature."""

_SOFTENING = {
    "softening_rate": "softening",
    "softening_start": "reference",
    "softening_lowest": "min",
    "softening_highest": "max",
}
"""Arrays about softening, named as in the files of runs, and the keys that they are made of."""

_FLASH: dict[str, tuple[Callable[[FlashFriction], float], float]] = {
    "flash_speed": (lambda law: law.weakening_speed, math.inf),
    "flash_weakened": (lambda law: law.weakened, 0.0),
    "flash_limit": (lambda law: law.weakening_temperature or math.inf, math.inf),
    "flash_reference": (lambda law: law.reference, 0.0),
}
"""Arrays about flash heating, what they are made of, and their value for pairs without it."""

_FRICTION = ("friction", "table", "table_start", "table_speed", "table_friction")
"""The other arrays of the laws about friction."""


def touching_pairs(grains: Grains, shapes: WallShapes, walls: Walls) -> list[tuple[int, int]]:
    """Pairs of materials that can meet, smaller index first: of grains, and of walls they meet."""
    of_groups = set(zip(grains.group.tolist(), grains.material.tolist(), strict=True))
    of_walls = set(zip(shapes.wall.tolist(), shapes.material.tolist(), strict=True))
    pairs = {(a, b) for _, a in of_groups for _, b in of_groups}
    pairs |= {
        (a, b)
        for g, a in of_groups
        for w, b in of_walls
        if not walls.meets.size or walls.meets[w, g]
    }
    return sorted({(min(pair), max(pair)) for pair in pairs})


def contact_laws(
    materials: Sequence[str],
    touching: Iterable[tuple[int, int]],
    law_of: Callable[[str, str], ContactPair],
    mean_diameter: float,
) -> ContactLaws:
    """The laws of the pairs ``touching``, by indices; others are left at zero and never used.

    ``mean_diameter`` of the grains makes the range of adhesion where none is given [m].
    """
    k = len(materials)
    given = {(a, b): law_of(materials[a], materials[b]) for a, b in touching}
    table, friction = np.full((k, k), -1, np.int32), {}
    number: dict[tuple[tuple[float, ...], tuple[float, ...]], int] = {}
    for (a, b), law in given.items():
        if isinstance(law.friction, FrictionTable):
            rows = law.friction.speed, law.friction.values
            table[a, b] = table[b, a] = number.setdefault(rows, len(number))
        else:
            friction[a, b] = law.coefficient
    rolling = {pair: law.rolling_friction for pair, law in given.items() if law.rolling_friction}
    soft = {pair: law.softening for pair, law in given.items() if law.softening is not None}
    optional: dict[str, Any] = _adhesion(k, given, mean_diameter)
    optional |= {"rolling": _symmetric(k, rolling)} if rolling else {}
    for name, key in _SOFTENING.items() if soft else ():
        values = {pair: getattr(softening, key) for pair, softening in soft.items()}
        optional[name] = _symmetric(k, values, getattr(_UNSOFTENED, key))
    flash = {p: law.friction for p, law in given.items() if isinstance(law.friction, FlashFriction)}
    for name, (value_of, none) in _FLASH.items() if flash else ():
        optional[name] = _symmetric(k, {pair: value_of(law) for pair, law in flash.items()}, none)
    sizes = [len(speeds) for speeds, _ in number]
    return ContactLaws(
        friction=_symmetric(k, friction),
        restitution=_symmetric(k, {pair: law.restitution for pair, law in given.items()}),
        table=table,
        table_start=np.cumsum([0, *sizes]).astype(np.int32),
        table_speed=np.array([speed for speeds, _ in number for speed in speeds], float),
        table_friction=np.array([value for _, values in number for value in values], float),
        **optional,
    )


def _adhesion(
    k: int, given: Mapping[tuple[int, int], ContactPair], mean_diameter: float
) -> dict[str, Any]:
    """Force, range and kind of adhesion; nothing if no pair has it."""
    found = {pair: law.attraction for pair, law in given.items() if law.attraction.force}
    if not found:
        return {}
    ranges = {pair: each.range or RANGE * mean_diameter for pair, each in found.items()}
    wet = {pair: float(each.kind == "wet") for pair, each in found.items()}
    return {
        "adhesion": _symmetric(k, {pair: each.force for pair, each in found.items()}),
        "adhesion_range": _symmetric(k, ranges),
        "is_wet": _symmetric(k, wet).astype(np.uint8),
    }


def _symmetric(k: int, values: Mapping[tuple[int, int], float], others: float = 0.0) -> Floats:
    """What pairs of ``k`` materials have, and all others, shape ``(k, k)``."""
    table = np.full((k, k), others)
    for (a, b), value in values.items():
        table[a, b] = table[b, a] = value
    return table


def stage_laws(scenario: Scenario, model: Model) -> list[ContactLaws | None]:
    """The laws of each stage; None for those of the model, until a stage names friction."""
    touching = touching_pairs(model.grains, model.shapes, model.walls)
    found: list[ContactLaws | None] = []
    for number, stage in enumerate(scenario.loading):
        laws = found[-1] if found else None
        if stage.contacts:
            law_of = functools.partial(scenario.law, stage=number)
            named = contact_laws(model.materials, touching, law_of, model.mean_diameter)._asdict()
            laws = model.laws._replace(
                **{key: named[key] for key in (*_FRICTION, *_SOFTENING, *_FLASH)}
            )
        found.append(laws)
    return found


# ---- Heat

_KEY = ("temperature",)


def group_thermal(scenario: Scenario, index: int, grains: InitialGrains, center: Floats) -> Thermal:
    """Heat capacities, initial temperatures and surfaces of the grains of a group.

    Centers are wrapped into the period [m], shape ``(n, 2)``. Keys of `Refused`, if temperatures
    cannot be read or are not one per grain, are relative to the group.
    """
    group = scenario.particles[index]
    material, radius = scenario.materials[group.material], grains.radius
    assert material.heat_capacity is not None  # the scenario has been checked
    mass = masses(radius, group.solid * material.density, group.body, group.thickness, grains.forms)
    # 4π a² of a sphere, 2π a h of a disc, perimeter times h of other grains
    height = np.full(radius.size, group.thickness or math.nan)
    perimeter = 2.0 * math.pi * radius
    if grains.forms is not None:
        perimeter = grains.forms.outlines.perimeter
    return Thermal(
        capacity=mass * material.heat_capacity,
        initial_temperature=_initial_temperature(scenario, group, grains, center),
        surface=perimeter * (2.0 * radius if group.body == "sphere" else height),
    )


def _initial_temperature(
    scenario: Scenario, group: ParticleGroup, grains: InitialGrains, center: Floats
) -> Floats:
    """Initial temperatures [K], shape ``(n,)``: the group's, else the packing's, else heat's."""
    n, table = len(center), group.temperature
    if isinstance(table, GradientTemperature):
        return _gradient(table, center)
    if isinstance(table, RegionsTemperature):
        temperature = np.full(n, table.value)
        for region in table.regions:
            temperature[region.area().contains(center)] = region.value
        return temperature
    if isinstance(table, ValuesTemperature):
        return _one_per_grain(np.array(table.values, float), n, "values", "are given")
    if isinstance(table, FileTemperature):
        path = scenario.resolve_path(table.file)
        return _one_per_grain(read_temperatures(path), n, "file", f"are in '{path}'")
    if table is None and grains.temperature is not None:
        return grains.temperature
    assert scenario.heat is not None  # only then temperatures are asked for
    return np.full(n, scenario.heat.temperature if table is None else table)


def _gradient(table: GradientTemperature, center: Floats) -> Floats:
    x, y = (center - np.array(table.at)).T
    temperature = np.asarray(table.value + (x * table.gradient[0] + y * table.gradient[1]))
    low, high = KELVIN_BOUNDS
    wrong = np.flatnonzero(~((temperature >= low) & (temperature <= high)))
    if wrong.size:
        k = int(wrong[0])
        place = f"the grain {k} of the group at ({center[k, X]:g}, {center[k, Y]:g}) m"
        text = (
            f"the gradient gives {place} a temperature of {temperature[k]:g} K, outside {low:g} "
            f"to {high:g} K"
        )
        raise Refused(
            (*_KEY, "gradient"), text, "lower the gradient, or set at to a point among the grains"
        )
    return temperature


def _one_per_grain(temperature: Floats, n: int, key: str, where: str) -> Floats:
    if temperature.size != n:
        text = f"{temperature.size} temperatures {where} for {n} grains"
        raise Refused((*_KEY, key), text, "give one per grain of the group, in their order")
    return temperature


def sizes_problems(scenario: Scenario, groups: Sequence[InitialGrains]) -> list[Refused]:
    """What is wrong with sizes for the choices in ``[heat]``: a gas model may need equal grains."""
    gas = scenario.heat.gas if scenario.heat is not None else None
    if gas is None:
        return []
    smallest = min(float(group.radius.min()) for group in groups)
    largest = max(float(group.radius.max()) for group in groups)
    return gas.misfits(smallest, largest)
