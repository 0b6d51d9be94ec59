"""The whole scenario file as one model, in part where some tables are wrong, and as a JSON Schema.

Attribute names are the TOML keys, except ``from`` and ``to`` of a rough wall, which are ``start``
and ``end``, and ``variables``.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any, Self, TypeVar

from pydantic import ValidationError, ValidationInfo, field_validator

from multicor_cli.scenario.base import CHANGEABLE, Array, Name, Table, optional, required
from multicor_cli.scenario.expressions import Variable, VariableName
from multicor_cli.scenario.heat import Heat
from multicor_cli.scenario.materials import MAX_MATERIALS, ContactPair, Material
from multicor_cli.scenario.particles import Outlet, ParticleGroup, Start
from multicor_cli.scenario.problems import Refused
from multicor_cli.scenario.settings import Domain, Header, Output, Solver
from multicor_cli.scenario.stages import Stage
from multicor_cli.scenario.translate import without_unknown_keys
from multicor_cli.scenario.walls import Wall
from multicor_cli.text import unwrapped


class ScenarioModel(Table):
    """A scenario file."""

    scenario: Header = required("name, description and seed")
    given_variables: Annotated[dict[VariableName, Variable] | None, CHANGEABLE] = optional(
        "a number by each name, as d = 1e-3; a string that begins with = is an expression and "
        'can stand in place of any number, as "= 2 * d"',
        alias="variables",
        max_length=1000,
    )
    domain: Domain = required("size, periodicity and gravity")
    materials: dict[Name, Material] = required(
        "materials by name", min_length=1, max_length=MAX_MATERIALS
    )
    contacts: Array[ContactPair] = optional(
        "contact laws of pairs of materials", (), max_length=1000
    )
    start: Start | None = optional(
        "run from which this one goes on; without it grains and walls start anew"
    )
    particles: Array[ParticleGroup] = required(
        "groups of grains; may be left out with [start]: those of its run", max_length=1000
    )
    walls: Array[Wall] = optional("walls", (), max_length=1000)
    outlets: Array[Outlet] = optional("where grains leave", (), max_length=1000)
    loading: Array[Stage] = required("loading stages in time order", min_length=1, max_length=1000)
    heat: Heat | None = optional("heat: its presence switches temperatures on")
    solver: Solver = optional(
        "time step and contact solver; default: all of its defaults", default_factory=Solver
    )
    output: Output = required("what is written, and how often")

    @field_validator("particles")
    @classmethod
    def _has_grains(
        cls, groups: tuple[ParticleGroup, ...], info: ValidationInfo
    ) -> tuple[ParticleGroup, ...]:
        """Only a run that cannot be read (yet) leaves a scenario without groups."""
        if not groups and info.data.get("start") is None:
            raise Refused((), "must have at least 1 elements, has 0", "expected: groups of grains")
        return groups


# ---- The tables that are valid on their own: a wrong one must not hide what is wrong elsewhere

Context = dict[str, Any]
Entry = TypeVar("Entry", bound=Table)

_TABLES: dict[str, type[Table]] = {
    "domain": Domain,
    "heat": Heat,
    "solver": Solver,
    "output": Output,
}
_ARRAYS: dict[str, type[Table]] = {
    "contacts": ContactPair,
    "particles": ParticleGroup,
    "walls": Wall,
    "outlets": Outlet,
    "loading": Stage,
}
_MAX_TABLES = 1000  # more are refused by the models


@dataclass(frozen=True)
class PartialScenario:
    """Tables of a scenario; ``None`` stands for one that is missing or invalid on its own.

    Attributes are named as the tables. Besides:

    Attributes:
        material_names: Names of all materials, right or wrong.
        has_start: Whether there is a table ``[start]``, right or wrong.
        group_names: Names of the groups; ``None`` where there is no name.
        wall_names: Names of the walls; ``None`` where there is no name.
        has_heat: Whether there is a table ``[heat]``, right or wrong.
    """

    material_names: list[str]
    group_names: list[str | None]
    wall_names: list[str | None]
    has_start: bool
    has_heat: bool
    materials: dict[str, Material | None]
    contacts: list[ContactPair | None]
    particles: list[ParticleGroup | None]
    walls: list[Wall | None]
    outlets: list[Outlet | None]
    loading: list[Stage | None]
    domain: Domain | None
    heat: Heat | None
    solver: Solver | None
    output: Output | None

    @property
    def is_cell(self) -> bool:
        """Whether the domain is known to be a cell."""
        return self.domain is not None and self.domain.is_cell

    @classmethod
    def of_model(cls, model: ScenarioModel) -> PartialScenario:
        """That of a scenario whose tables are all valid on their own."""
        return cls._of(dict(model), lambda _, table: table)

    @classmethod
    def of_document(cls, data: dict[str, Any], context: Context) -> PartialScenario:
        """That of a document of which some tables are wrong; ``context``: of the validation."""
        return cls._of({"solver": {}, **data}, partial(_valid, context=context))

    @classmethod
    def _of(cls, tables: dict[str, Any], valid: Callable[[type[Table], Any], Any]) -> Self:
        """That of tables, which ``valid`` checks by their models."""
        raw = tables.get("materials")
        materials = raw if isinstance(raw, dict) else {}
        arrays: dict[str, Any] = {
            key: [valid(model, table) for table in _elements(tables.get(key))]
            for key, model in _ARRAYS.items()
        }
        first = itertools.islice(materials.items(), _MAX_TABLES)
        return cls(
            list(materials),
            _names(tables.get("particles")),
            _names(tables.get("walls")),
            tables.get("start") is not None,
            tables.get("heat") is not None,
            {name: valid(Material, table) for name, table in first},
            **arrays,
            **{key: valid(model, tables.get(key)) for key, model in _TABLES.items()},
        )


def given(entries: Iterable[Entry | None]) -> Iterator[tuple[int, Entry]]:
    """Entries of an array of tables that are valid on their own, with their numbers."""
    return ((k, entry) for k, entry in enumerate(entries) if entry is not None)


def _valid(model: type[Table], raw: Any, context: Context) -> Any:
    """A table, as it is or without its unknown keys; None if it is invalid on its own."""
    try:
        return model.model_validate(raw, context=context)
    except ValidationError as error:
        known = without_unknown_keys(model, raw, error.errors(include_url=False))
    try:
        return None if known is None else model.model_validate(known, context=context)
    except ValidationError:
        return None


def _elements(raw: Any) -> Sequence[Any]:
    return raw[:_MAX_TABLES] if isinstance(raw, list | tuple) else []


def _names(raw: Any) -> list[str | None]:
    if isinstance(raw, list) and len(raw) > _MAX_TABLES:
        return [None]  # not all names are known
    names = [
        each.get("name") if isinstance(each, dict) else getattr(each, "name", None)
        for each in _elements(raw)
    ]
    return [name if isinstance(name, str) else None for name in names]


# ---- JSON Schema

SCHEMA_DIALECT = "https://json-schema.org/draft/2020-12/schema"


def scenario_schema() -> dict[str, Any]:
    """The JSON Schema of scenario files; conditions across tables are left to `load_scenario`."""
    schema: dict[str, Any] = _with_expressions(
        _plain(ScenarioModel.model_json_schema(by_alias=True))
    )
    schema.pop("description", None)
    schema["required"].remove("particles")
    return {
        "$schema": SCHEMA_DIALECT,
        "title": "multicor scenario",
        "description": "A multicor scenario file. SI units, radians; indices count from 0.",
        **{key: value for key, value in schema.items() if key != "title"},
        "anyOf": [{"required": ["particles"]}, {"required": ["start"]}],
    }


def _plain(node: Any) -> Any:
    """The schema, unwrapped, without null, which TOML lacks, and titles, which repeat the keys."""
    if isinstance(node, list):
        return [_plain(element) for element in node]
    if not isinstance(node, dict):
        return node
    noise: dict[str, type] = {"default": type(None), "title": str}
    cleaned = {
        key: _plain(value)
        for key, value in node.items()
        if key not in noise or not isinstance(value, noise[key])
    }
    if isinstance(text := cleaned.get("description"), str):
        cleaned["description"] = unwrapped(text)
    if isinstance(choices := cleaned.get("anyOf"), list):
        choices = [choice for choice in choices if choice != {"type": "null"}]
        if len(choices) == 1:
            del cleaned["anyOf"]
            return {**choices[0], **cleaned}
        cleaned["anyOf"] = choices
    return cleaned


def _with_expressions(node: Any) -> Any:
    """The schema with expressions where numbers stand: bounds bind numbers, patterns strings."""
    if isinstance(node, list):
        return [_with_expressions(element) for element in node]
    if not isinstance(node, dict):
        return node
    extended = {key: _with_expressions(value) for key, value in node.items()}
    if node.get("type") in ("number", "integer"):
        extended |= {"type": [node["type"], "string"], "pattern": "^="}
    return extended
