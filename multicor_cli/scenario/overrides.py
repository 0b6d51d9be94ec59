"""Values from the command line: ``--set loading.1.duration=2.0``."""

from __future__ import annotations

import difflib
import re
import tomllib
from collections.abc import Sequence
from typing import Any

from multicor_cli.scenario.locate import MAX_NESTING, find_deep_nesting, parse_key
from multicor_cli.scenario.problems import OVERRIDE, KeyPath, Problem, format_key, name_list, show

_WORD = re.compile(r"[^\W\d][\w ./:~+-]*|[./~][\w ./:~+-]*")


def apply_overrides(data: dict[str, Any], overrides: Sequence[str]) -> tuple[dict[KeyPath, str], list[Problem]]:
    """Set values in a parsed document.

    Each override is ``key=value``: a dotted key with 0-based indices for elements of arrays, and a value in TOML syntax; words
    that are no TOML values, and expressions (``key== 2*d``), are taken as strings. Tables that are missing on the way are added,
    elements of arrays are not.

    Args:
        data: The document. **Modified.**
        overrides: The arguments of ``--set``, applied in this order.

    Returns:
        The argument that has set each path, and the problems of the arguments that could not be applied.
    """
    applied: dict[KeyPath, str] = {}
    problems = []
    for argument in overrides:
        try:
            key, value = _parse(argument)
            path = _assign(data, key, value)
        except _BadOverrideError as error:
            problems.append(Problem(OVERRIDE, 0, 0, error.key, error.message, error.remedy, argument))
            continue
        applied.pop(path, None)  # what is set again is set last: overrides are kept in the order in which they hold
        applied[path] = argument
    return applied, problems


class _BadOverrideError(Exception):
    def __init__(self, key: str, message: str, remedy: str) -> None:
        super().__init__(message)
        self.key, self.message, self.remedy = key, message, remedy


def _parse(argument: str) -> tuple[KeyPath, Any]:
    remedy = "write key=value, as loading.1.duration=2.0"
    if find_deep_nesting(argument) is not None:
        raise _BadOverrideError("", f"nested more than {MAX_NESTING} deep", remedy)
    try:
        key, end = parse_key(argument)
    except ValueError:
        raise _BadOverrideError("", f"{show(argument)} has no key", remedy) from None
    return key, _parse_value(format_key(key), argument[end + 1 :].strip())


def _parse_value(key: str, text: str) -> Any:
    try:
        table = tomllib.loads(f"value = {text}")
    except ValueError:
        table = {}
    if len(table) == 1:
        return table["value"]
    if _WORD.fullmatch(text) or text.startswith("="):
        return text
    raise _BadOverrideError(
        key, f"{show(text)} is not a valid TOML value", 'write it as in the file, strings in quotes: name="a b"'
    )


def _assign(data: dict[str, Any], key: KeyPath, value: Any) -> KeyPath:
    """Set ``value`` in the document; returns the path, with indices as numbers, of the outermost key that is new or changed."""
    node: Any = data
    path: KeyPath = ()
    for depth, part in enumerate(key[:-1]):
        place = _place(node, part, key, path)
        path = (*path, place)
        if isinstance(node, dict) and place not in node:
            node[place] = _nested(key, depth, value, _closest_key(part, node))
            return path
        node = node[place]
    place = _place(node, key[-1], key, path)
    node[place] = value
    return (*path, place)


def _nested(key: KeyPath, depth: int, value: Any, remedy: str) -> Any:
    """New tables for the parts of ``key`` that follow part number ``depth``, with ``value`` in the innermost."""
    rest = key[depth + 1 :]
    if any(str(part).isdecimal() for part in rest):
        raise _BadOverrideError(format_key(key), f"there is no {format_key(key[: depth + 1])}", remedy)
    for part in reversed(rest):
        value = {part: value}
    return value


def _closest_key(part: str | int, node: dict[str, Any]) -> str:
    matches = difflib.get_close_matches(str(part)[:100], list(node)[:200], n=1)
    return f"did you mean '{matches[0]}'?" if matches else f"there is {name_list(node) or 'nothing'}"


def _place(node: Any, part: str | int, key: KeyPath, path: KeyPath) -> str | int:
    """Key or index at which ``part`` is found in ``node``."""
    name = format_key(path) or "the scenario"
    if isinstance(node, dict):
        if str(part).isdecimal() and part not in node:
            known = name_list(node) or "nothing"
            raise _BadOverrideError(format_key(key), f"{name} is not an array: it has no index {part}", f"it has {known}")
        return part
    if not isinstance(node, list):
        raise _BadOverrideError(format_key(key), f"{name} is {show(node)}: it has no key {show(part)}", "shorten the key")
    text = str(part)
    if not (text.isdecimal() and text.isascii()) or len(text) > 9 or int(text) >= len(node):
        limits = f"use 0 to {len(node) - 1}" if node else "it is empty"
        raise _BadOverrideError(format_key(key), f"{name} is an array of {len(node)}: it has no index {show(part)}", limits)
    return int(text)
