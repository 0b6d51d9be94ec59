"""Contact laws of all pairs of materials, as arrays."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np

from multicor_cli.model.model import ContactLaws, Floats, Grains, Model, Walls, WallShapes
from multicor_cli.scenario import Scenario
from multicor_cli.scenario.materials import ContactPair, FrictionTable, Softening

_UNSOFTENED = Softening(softening=0.0)
"""Leaves every coefficient that a scenario can have as it is, at any temperature."""

_SOFTENING = {"softening_rate": "softening", "softening_start": "reference", "softening_lowest": "min", "softening_highest": "max"}
"""Arrays of the laws about softening, and the keys that they are made of."""

_FRICTION = ("friction", "table", "table_start", "table_speed", "table_friction")
"""The other arrays of the laws about friction."""


def touching_pairs(grains: Grains, shapes: WallShapes, walls: Walls) -> list[tuple[int, int]]:
    """Pairs of materials that can meet, smaller index first: of grains with each other, and with those of the walls they meet."""
    of_groups = set(zip(grains.group.tolist(), grains.material.tolist(), strict=True))
    of_walls = set(zip(shapes.wall.tolist(), shapes.material.tolist(), strict=True))
    pairs = {(a, b) for _, a in of_groups for _, b in of_groups}
    pairs |= {(a, b) for g, a in of_groups for w, b in of_walls if not walls.meets.size or walls.meets[w, g]}
    return sorted({(min(pair), max(pair)) for pair in pairs})


def contact_laws(
    materials: Sequence[str], touching: Iterable[tuple[int, int]], law_of: Callable[[str, str], ContactPair]
) -> ContactLaws:
    """The laws of the pairs ``touching``; other pairs are left at zero and are never used.

    Args:
        materials: Names of the materials, by index.
        touching: Pairs of indices that need a law.
        law_of: The law between two materials.
    """
    k = len(materials)
    friction, restitution, table = np.zeros((k, k)), np.zeros((k, k)), np.full((k, k), -1, np.int32)
    number: dict[tuple[tuple[float, ...], tuple[float, ...]], int] = {}
    softening: dict[tuple[int, int], Softening] = {}
    given = {(a, b): law_of(materials[a], materials[b]) for a, b in touching}
    for (a, b), law in given.items():
        if law.softening is not None:
            softening[a, b] = softening[b, a] = law.softening
        restitution[a, b] = restitution[b, a] = law.restitution
        if isinstance(law.friction, FrictionTable):
            table[a, b] = table[b, a] = number.setdefault((law.friction.speed, law.friction.values), len(number))
        else:
            friction[a, b] = friction[b, a] = law.coefficient
    sizes = [len(speeds) for speeds, _ in number]
    return ContactLaws(
        friction=friction,
        restitution=restitution,
        table=table,
        table_start=np.cumsum([0, *sizes]).astype(np.int32),
        table_speed=np.array([speed for speeds, _ in number for speed in speeds], float),
        table_friction=np.array([value for _, values in number for value in values], float),
        **(_softening(k, softening) if softening else {}),
        **_of_pairs(k, "adhesion", {pair: law.adhesion for pair, law in given.items()}),
        **_of_pairs(k, "rolling", {pair: law.rolling_friction for pair, law in given.items()}),
    )


def stage_laws(scenario: Scenario, model: Model) -> list[ContactLaws | None]:
    """The laws of each stage; None as long as they are those of the model: until a stage names friction."""
    touching = touching_pairs(model.grains, model.shapes, model.walls)
    found: list[ContactLaws | None] = []
    for number, stage in enumerate(scenario.loading):
        laws = found[-1] if found else None
        if stage.contacts:
            named = contact_laws(model.materials, touching, functools.partial(scenario.law, stage=number))
            laws = model.laws._replace(**{key: getattr(named, key) for key in (*_FRICTION, *_SOFTENING)})
        found.append(laws)
    return found


def _of_pairs(k: int, name: str, values: Mapping[tuple[int, int], float | None]) -> dict[str, Floats]:
    """A symmetric table of what pairs have; nothing if none has it."""
    if not any(values.values()):
        return {}
    table = np.zeros((k, k))
    for (a, b), value in values.items():
        table[a, b] = table[b, a] = value or 0.0
    return {name: table}


def _softening(k: int, pairs: Mapping[tuple[int, int], Softening]) -> dict[str, Floats]:
    tables = [[pairs.get((a, b), _UNSOFTENED) for b in range(k)] for a in range(k)]
    return {name: np.array([[getattr(table, key) for table in row] for row in tables], float) for name, key in _SOFTENING.items()}
