"""Where each key of a scenario is used: in scenarios that load, so that no example on a page is wrong."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from multicor_cli.scenario.base import Table
from multicor_cli.scenario.load import load_scenario

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("configs", "docs/reference/examples")
_LONG = 100


@dataclass(frozen=True)
class Example:
    """A key in use.

    Attributes:
        text: Key and value, as TOML.
        file: The scenario, relative to the repository.
    """

    text: str
    file: str


@cache
def examples() -> dict[tuple[str, str], Example]:
    """For each model and key the first scenario that uses it, those that are shipped before those that only show keys."""
    found: dict[tuple[str, str], Example] = {}
    for folder in FOLDERS:
        for path in sorted((ROOT / folder).glob("*.toml")):
            file = path.relative_to(ROOT).as_posix()
            for model, key, value in _uses(load_scenario(path).model):
                found.setdefault((model, key), Example(_written(key, value), file))
    return found


def _uses(node: Any) -> Iterator[tuple[str, str, Any]]:
    """Model, key and value of all keys that a scenario gives."""
    if isinstance(node, Table):
        for name in _given(node):
            value = getattr(node, name)
            yield type(node).__name__, type(node).model_fields[name].alias or name, value
            yield from _uses(value)
    elif isinstance(node, dict):
        for value in node.values():
            yield from _uses(value)
    elif isinstance(node, list | tuple):
        for value in node:
            yield from _uses(value)


def _written(key: str, value: Any) -> str:
    """A line of TOML; what is too long for one is left out."""
    text = f"{key} = {in_line(value)}"
    return text if len(text) <= _LONG else f"{key} = …"


def in_line(value: Any) -> str:
    """A value as it stands in a line of TOML; numbers, which may come from expressions, with six digits."""
    if isinstance(value, Table):
        value = {type(value).model_fields[name].alias or name: getattr(value, name) for name in _given(value)}
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {in_line(entry)}" for key, entry in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(in_line, value)) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        text = f"{value:.6g}"
        return text if any(sign in text for sign in ".e") else f"{text}.0"
    return f'"{value}"' if isinstance(value, str) else str(value)


def _given(table: Table) -> list[str]:
    """Keys that the document gives, in the order of the model."""
    return [name for name in type(table).model_fields if name in table.model_fields_set]
