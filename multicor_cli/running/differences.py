"""Whether a run may be continued with a scenario: what differs from the scenario that it began with."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from typing import Any, NamedTuple

from multicor_cli.scenario.base import FREE
from multicor_cli.scenario.describe import find_field, find_spot
from multicor_cli.scenario.models import ScenarioModel
from multicor_cli.scenario.problems import KeyPath, show

_ABSENT = object()


class Difference(NamedTuple):
    """A key with another value than before, as texts for a message."""

    path: KeyPath
    before: str
    after: str


def find_differences(before: str, after: str) -> list[Difference]:
    """Keys that differ between two resolved scenarios, `FREE` ones left out.

    Args:
        before: TOML of the scenario with which the run began.
        after: TOML of the scenario with which it would continue.
    """
    found = _compare((), tomllib.loads(before), tomllib.loads(after))
    return [difference for difference in found if not _is_free(difference.path)]


def _is_free(path: KeyPath) -> bool:
    field = find_field(find_spot(ScenarioModel, path).table, str(path[-1]))
    return field is not None and FREE in field.metadata


def _compare(path: KeyPath, before: Any, after: Any) -> Iterator[Difference]:
    if isinstance(before, dict) and isinstance(after, dict):
        for name in [*before, *(name for name in after if name not in before)]:
            yield from _compare((*path, name), before.get(name, _ABSENT), after.get(name, _ABSENT))
    elif isinstance(before, list) and isinstance(after, list) and len(before) == len(after):
        for k, (old, new) in enumerate(zip(before, after, strict=True)):
            yield from _compare((*path, k), old, new)
    elif type(before) is not type(after) or before != after:
        yield Difference(path, _text(before), _text(after))


def _text(value: Any) -> str:
    return "not given" if value is _ABSENT else show(value)
