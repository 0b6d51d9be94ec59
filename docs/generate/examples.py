"""Where each key of a scenario is used: in scenarios that load, so that no example on a page is
wrong.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from multicor_cli.scenario.base import Table
from multicor_cli.scenario.documents import in_line
from multicor_cli.scenario.scenario import load_scenario
from multicor_cli.scenario.tables import ScenarioModel

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("configs", "docs/reference/examples")
_LONG = 160
_LEFT_OUT = "…"


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
    """For each model and key the first scenario that uses it in a line, shipped ones before those
    that only show keys.
    """
    found: dict[tuple[str, str], Example] = {}
    for folder in FOLDERS:
        for path in sorted((ROOT / folder).glob("*.toml")):
            file = path.relative_to(ROOT).as_posix()
            for model, key, value in _uses(
                load_scenario(path), tomllib.loads(path.read_text(encoding="utf-8"))
            ):
                example, known = Example(_written(key, value), file), found.get((model, key))
                if known is None or (
                    known.text.endswith(_LEFT_OUT) and not example.text.endswith(_LEFT_OUT)
                ):
                    found[model, key] = example
    return found


def _uses(node: Any, written: Any) -> Iterator[tuple[str, str, Any]]:
    """Model, key and value of all keys that a scenario gives.

    Args:
        node: What has been loaded.
        written: What the document says there: the value of keys that name files, of which loading
            leaves the contents only.
    """
    if isinstance(node, Table):
        model = ScenarioModel if isinstance(node, ScenarioModel) else type(node)
        for name in (name for name in model.model_fields if name in node.model_fields_set):
            key, value = model.model_fields[name].alias or name, getattr(node, name)
            said = written.get(key) if isinstance(written, dict) else None
            if value is not None or said is not None:
                yield model.__name__, key, said if value is None else value
                yield from _uses(value, said)
    elif isinstance(node, dict):
        for key, value in node.items():
            yield from _uses(value, written.get(key) if isinstance(written, dict) else None)
    elif isinstance(node, list | tuple):
        for place, value in enumerate(node):
            yield from _uses(
                value,
                written[place] if isinstance(written, list) and place < len(written) else None,
            )


def _written(key: str, value: Any) -> str:
    """A line of TOML; what is too long for one is left out."""
    text = f"{key} = {in_line(shortened(value))}"
    return text if len(text) <= _LONG else f"{key} = {_LEFT_OUT}"


def shortened(value: Any) -> Any:
    """A value with what the document gives of tables, and with six digits of numbers, which may
    come from expressions.
    """
    if isinstance(value, Table):
        value = {
            type(value).model_fields[name].alias or name: getattr(value, name)
            for name in _given(value)
        }
    if isinstance(value, dict):
        return {key: shortened(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [shortened(entry) for entry in value]
    return float(f"{value:.6g}") if isinstance(value, float) else value


def _given(table: Table) -> list[str]:
    """Keys that the document gives, in the order of the model, and that loading has kept."""
    return [
        name
        for name in type(table).model_fields
        if name in table.model_fields_set and getattr(table, name) is not None
    ]
