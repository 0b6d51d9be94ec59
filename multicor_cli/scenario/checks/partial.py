"""The tables of a scenario that are valid on their own: one invalid table must not hide what is wrong with the others."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any, TypeVar

from pydantic import ValidationError

from multicor_cli.scenario.base import Table
from multicor_cli.scenario.loading import Stage
from multicor_cli.scenario.materials import ContactPair, Heat, Material
from multicor_cli.scenario.model import ScenarioModel
from multicor_cli.scenario.particles import Outlet, ParticleGroup
from multicor_cli.scenario.settings import Domain, Output, Solver
from multicor_cli.scenario.translate import without_unknown_keys
from multicor_cli.scenario.walls import Wall

T = TypeVar("T", bound=Table)
Context = dict[str, Any]


@dataclass(frozen=True)
class PartialScenario:
    """Tables of a scenario; ``None`` stands for a table that is missing or invalid on its own.

    Attributes are named as the tables. Besides:

    Attributes:
        material_names: Names of all materials, right or wrong.
        has_start: Whether there is a table ``[start]``, right or wrong.
        group_names: Names of the groups; ``None`` where there is no name.
        wall_names: Names of the walls; ``None`` where there is no name.
        has_heat: Whether there is a table ``[heat]``, right or wrong.
    """

    domain: Domain | None
    material_names: list[str]
    materials: dict[str, Material | None]
    contacts: list[ContactPair | None]
    has_start: bool
    particles: list[ParticleGroup | None]
    group_names: list[str | None]
    walls: list[Wall | None]
    wall_names: list[str | None]
    outlets: list[Outlet | None]
    loading: list[Stage | None]
    has_heat: bool
    heat: Heat | None
    solver: Solver | None
    output: Output | None

    @classmethod
    def of_model(cls, model: ScenarioModel) -> PartialScenario:
        """That of a scenario whose tables are all valid on their own."""
        return cls(
            model.domain,
            list(model.materials),
            dict(model.materials),
            list(model.contacts),
            model.start is not None,
            list(model.particles),
            [group.name for group in model.particles],
            list(model.walls),
            [wall.name for wall in model.walls],
            list(model.outlets),
            list(model.loading),
            model.heat is not None,
            model.heat,
            model.solver,
            model.output,
        )

    @classmethod
    def of_document(cls, data: dict[str, Any], context: Context) -> PartialScenario:
        """That of a parsed document of which some tables are wrong; ``context`` is that of the validation."""
        raw = data.get("materials")
        materials = dict(itertools.islice(raw.items(), _MAX_TABLES)) if isinstance(raw, dict) else {}
        return cls(
            _table(Domain, data.get("domain"), context),
            list(raw) if isinstance(raw, dict) else [],
            {name: _table(Material, table, context) for name, table in materials.items()},
            _tables(ContactPair, data.get("contacts"), context),
            "start" in data,
            _tables(ParticleGroup, data.get("particles"), context),
            _names(data.get("particles")),
            _tables(Wall, data.get("walls"), context),
            _names(data.get("walls")),
            _tables(Outlet, data.get("outlets"), context),
            _tables(Stage, data.get("loading"), context),
            "heat" in data,
            _table(Heat, data.get("heat"), context),
            _table(Solver, data.get("solver", {}), context),
            _table(Output, data.get("output"), context),
        )


_MAX_TABLES = 1000  # more are refused by the models


def _table(model: type[T], raw: Any, context: Context) -> T | None:
    try:
        return model.model_validate(raw, context=context)
    except ValidationError as error:
        known = without_unknown_keys(model, raw, error.errors(include_url=False))
    try:
        return None if known is None else model.model_validate(known, context=context)
    except ValidationError:
        return None


def _elements(raw: Any) -> list[Any]:
    return raw[:_MAX_TABLES] if isinstance(raw, list) else []


def _tables(model: type[T], raw: Any, context: Context) -> list[T | None]:
    return [_table(model, element, context) for element in _elements(raw)]


def _names(raw: Any) -> list[str | None]:
    if len(raw if isinstance(raw, list) else ()) > _MAX_TABLES:
        return [None]  # not all names are known
    names = [element.get("name") if isinstance(element, dict) else None for element in _elements(raw)]
    return [name if isinstance(name, str) else None for name in names]
