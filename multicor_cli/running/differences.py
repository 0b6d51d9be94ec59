"""Whether a run may be continued with a scenario: what differs from the one that it began with."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from typing import Any, NamedTuple

from multicor_cli.scenario.base import CHANGEABLE, Formerly
from multicor_cli.scenario.particles import MOTION
from multicor_cli.scenario.problems import KeyPath, show
from multicor_cli.scenario.tables import ScenarioModel
from multicor_cli.scenario.translate import find_field, find_location

_ABSENT = object()


class Difference(NamedTuple):
    """A key with another value than before, as texts for a message."""

    path: KeyPath
    before: str
    after: str


def find_differences(before: str, after: str) -> list[Difference]:
    """Keys that differ between two resolved scenarios (TOML), `CHANGEABLE` ones left out."""
    return _find(tomllib.loads(before), tomllib.loads(after))


def _find(before: dict[str, Any], after: dict[str, Any]) -> list[Difference]:
    return [
        difference
        for difference in _compare((), before, after)
        if not (
            any(
                CHANGEABLE in _marks(difference.path[:end])
                for end in range(1, len(difference.path) + 1)
            )
            or _is_said_no_more(difference)
        )
    ]


def _is_said_no_more(difference: Difference) -> bool:
    """Whether it is the default that an older version wrote of grains that move with a cell."""
    has_default = difference.before in (show([0.0, 0.0]), show(0.0))
    return has_default and difference.after == _told(_ABSENT) and difference.path[-1] in MOTION


def added_stages(before: str, after: str) -> int:
    """Number of stages added at the end of a resolved scenario, if that is all; else 0."""
    old, new = tomllib.loads(before), tomllib.loads(after)
    count = len(old["loading"])
    shortened = {**new, "loading": new["loading"][:count]}
    return 0 if _find(old, shortened) else len(new["loading"]) - count


def former_defaults(before: str, after: str, given: dict[str, Any]) -> list[str]:
    """Overrides (``key=value``) that give a scenario the defaults of the version of its run.

    Both are resolved TOML; keys that the latter has ``given`` itself have no defaults.
    """
    return [
        f"{'.'.join(map(str, difference.path))}={difference.before}"
        for difference in find_differences(before, after)
        if not _is_given(difference.path, given)
        and any(
            isinstance(mark, Formerly) and show(mark.default) == difference.before
            for mark in _marks(difference.path)
        )
    ]


def _is_given(path: KeyPath, document: Any) -> bool:
    for key in path:
        if isinstance(document, list) or key not in document:
            return isinstance(document, list)  # elements of arrays are given as a whole
        document = document[key]
    return True


def _marks(path: KeyPath) -> list[Any]:
    field = find_field(find_location(ScenarioModel, path).table, str(path[-1]))
    return [] if field is None else field.metadata


def _compare(path: KeyPath, before: Any, after: Any) -> Iterator[Difference]:
    if isinstance(before, dict) and isinstance(after, dict):
        for name in [*before, *(name for name in after if name not in before)]:
            yield from _compare((*path, name), before.get(name, _ABSENT), after.get(name, _ABSENT))
    elif isinstance(before, list) and isinstance(after, list) and len(before) == len(after):
        for k, (old, new) in enumerate(zip(before, after, strict=True)):
            yield from _compare((*path, k), old, new)
    elif type(before) is not type(after) or before != after:
        yield Difference(path, _told(before), _told(after))


def _told(value: Any) -> str:
    """A value as text: of a table at least which kind it is of."""
    if value is _ABSENT:
        return "not given"
    if isinstance(value, dict) and "kind" in value:
        return f"{{ kind = {show(value['kind'])}, … }}"
    return show(value)
