"""The whole scenario file as one model, and its JSON Schema, for editors that complete and check TOML.

Attribute names are the TOML keys, except ``from`` and ``to`` of a rough wall, which are ``start`` and ``end``, and ``variables``.
"""

from __future__ import annotations

import json
from typing import Annotated, Any

from pydantic import Field, Strict, ValidationInfo, field_validator

from multicor_cli.scenario.base import CHANGEABLE, Name, Table
from multicor_cli.scenario.expressions import Variable, VariableName
from multicor_cli.scenario.loading import Stage
from multicor_cli.scenario.materials import MAX_MATERIALS, ContactPair, Heat, Material
from multicor_cli.scenario.particles import Outlet, ParticleGroup, Start
from multicor_cli.scenario.problems import Refused
from multicor_cli.scenario.settings import Domain, Header, Output, Solver
from multicor_cli.scenario.walls import Wall
from multicor_cli.text import unwrapped


class ScenarioModel(Table):
    """A scenario file."""

    scenario: Header = Field(description="name, description and seed")
    given_variables: Annotated[dict[VariableName, Variable] | None, CHANGEABLE] = Field(
        None,
        alias="variables",
        max_length=1000,
        description="a number by each name, as d = 1e-3; a string that begins with = is an expression and can stand in place of "
        'any number, as "= 2 * d"',
    )
    domain: Domain = Field(description="size, periodicity and gravity")
    materials: dict[Name, Material] = Field(min_length=1, max_length=MAX_MATERIALS, description="materials by name")
    contacts: Annotated[tuple[ContactPair, ...], Strict(False)] = Field(
        (), max_length=1000, description="contact laws of pairs of materials"
    )
    start: Start | None = Field(None, description="run from which this one goes on; without it grains and walls start anew")
    particles: Annotated[tuple[ParticleGroup, ...], Strict(False)] = Field(
        max_length=1000, description="groups of grains; may be left out with [start]: those of its run"
    )
    walls: Annotated[tuple[Wall, ...], Strict(False)] = Field((), max_length=1000, description="walls")
    outlets: Annotated[tuple[Outlet, ...], Strict(False)] = Field((), max_length=1000, description="where grains leave")
    loading: Annotated[tuple[Stage, ...], Strict(False)] = Field(
        min_length=1, max_length=1000, description="loading stages in time order"
    )
    heat: Heat | None = Field(None, description="heat: its presence switches temperatures on")
    solver: Solver = Field(default_factory=Solver, description="time step and contact solver; default: all of its defaults")
    output: Output = Field(description="what is written, and how often")

    @field_validator("particles")
    @classmethod
    def _has_grains(cls, groups: tuple[ParticleGroup, ...], info: ValidationInfo) -> tuple[ParticleGroup, ...]:
        """Only a run that cannot be read (yet) leaves a scenario without groups."""
        if not groups and info.data.get("start") is None:
            raise Refused((), "must have at least 1 elements, has 0", "expected: groups of grains")
        return groups


# ---- JSON Schema

SCHEMA_DIALECT = "https://json-schema.org/draft/2020-12/schema"


def scenario_schema() -> dict[str, Any]:
    """The JSON Schema of scenario files; what the tables must have in common is left to `load_scenario`."""
    schema: dict[str, Any] = _with_expressions(_plain(ScenarioModel.model_json_schema(by_alias=True)))
    schema.pop("description", None)
    schema["required"].remove("particles")
    return {
        "$schema": SCHEMA_DIALECT,
        "title": "multicor scenario",
        "description": "A multicor scenario file. SI units, radians; indices count from 0.",
        **{key: value for key, value in schema.items() if key != "title"},
        "anyOf": [{"required": ["particles"]}, {"required": ["start"]}],
    }


def schema_text() -> str:
    """The schema as the text of ``schema/multicor.schema.json``."""
    return json.dumps(scenario_schema(), indent=2, ensure_ascii=False) + "\n"


def _plain(node: Any) -> Any:
    """The schema without null, which TOML does not have, without titles, which only repeat the keys, and unwrapped."""
    if isinstance(node, list):
        return [_plain(element) for element in node]
    if not isinstance(node, dict):
        return node
    cleaned = {key: _plain(value) for key, value in node.items() if not _is_noise(key, value)}
    if isinstance(text := cleaned.get("description"), str):
        cleaned["description"] = unwrapped(text)
    choices = cleaned.get("anyOf")
    if isinstance(choices, list):
        choices = [choice for choice in choices if choice != {"type": "null"}]
        if len(choices) == 1:
            del cleaned["anyOf"]
            return {**choices[0], **cleaned}
        cleaned["anyOf"] = choices
    return cleaned


def _with_expressions(node: Any) -> Any:
    """The schema with expressions wherever numbers stand; bounds concern numbers only, patterns strings only."""
    if isinstance(node, list):
        return [_with_expressions(element) for element in node]
    if not isinstance(node, dict):
        return node
    extended = {key: _with_expressions(value) for key, value in node.items()}
    if node.get("type") in ("number", "integer"):
        extended |= {"type": [node["type"], "string"], "pattern": "^="}
    return extended


def _is_noise(key: str, value: Any) -> bool:
    return (key == "default" and value is None) or (key == "title" and isinstance(value, str))
