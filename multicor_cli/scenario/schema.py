"""The JSON Schema of scenario files, for editors that complete and check TOML."""

from __future__ import annotations

import json
from typing import Any

from multicor_cli.scenario.models import ScenarioModel
from multicor_cli.text import unwrapped

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
