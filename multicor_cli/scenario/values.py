"""Python values as TOML: a scenario that is written in Python, before it is read like a file, and single values in one line."""

from __future__ import annotations

import datetime as dt
import json
import re
from collections.abc import Mapping
from pathlib import PurePath
from typing import Any

import numpy as np
import tomli_w

from multicor_cli.scenario.problems import OVERRIDE, KeyPath, Problem, ScenarioError, format_key
from multicor_cli.scenario.sources import MAX_NESTING

# ---- Values as TOML in one line, which the library that writes TOML does not do: for `--set`, and for examples on pages

_BARE = re.compile(r"[A-Za-z0-9_-]+")


def in_line(value: Any) -> str:
    """A value of TOML's types in one line."""
    if isinstance(value, dict):
        entries = (f"{key if _BARE.fullmatch(key) else json.dumps(key)} = {in_line(entry)}" for key, entry in value.items())
        return f"{{ {', '.join(entries)} }}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(in_line, value))}]"
    return tomli_w.dumps({"value": value}).removeprefix("value = ").strip()


# ---- A whole scenario

_SCALARS = (bool, int, float, str, dt.date, dt.time)  # a datetime is a date
_REMEDY = "give a number, text, true or false, a date, a list or a dict"


def to_document(data: Mapping[str, Any]) -> str:
    """The TOML of a document; raises `ScenarioError` about everything in it that TOML has no value for."""
    import tomli_w

    problems: list[Problem] = []
    plain = _plain(data, (), problems)
    if problems:
        raise ScenarioError(problems)
    if not isinstance(plain, dict):
        raise ScenarioError([Problem("", 0, 0, "", f"the scenario is of type {type(data).__name__}", "give a dict of its tables")])
    return tomli_w.dumps(plain)


def to_override(key: str, value: Any) -> str:
    """The argument of ``--set`` that gives a key a value; raises `ScenarioError` if TOML has none like it."""
    problems: list[Problem] = []
    plain = _plain(value, (), problems)
    if problems:
        raise ScenarioError([Problem(OVERRIDE, 0, 0, key, problem.message, problem.remedy) for problem in problems])
    return f"{key}={in_line(plain)}"


def _plain(value: Any, path: KeyPath, problems: list[Problem]) -> Any:
    """A value in the types that TOML has; what is wrong with it goes to ``problems``."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if len(path) > MAX_NESTING:
        problems.append(Problem("", 0, 0, format_key(path), f"nested more than {MAX_NESTING} deep", "use fewer levels"))
    elif isinstance(value, Mapping):
        return {_name(name, path, problems): _plain(item, (*path, str(name)), problems) for name, item in value.items()}
    elif isinstance(value, list | tuple):
        return [_plain(item, (*path, k), problems) for k, item in enumerate(value)]
    elif isinstance(value, PurePath):
        return str(value)
    elif isinstance(value, _SCALARS):
        return value
    else:
        what = "None is no value" if value is None else f"a value of type {type(value).__name__}"
        remedy = "leave the key out" if value is None else _REMEDY
        problems.append(Problem("", 0, 0, format_key(path), what, remedy))
    return None


def _name(name: Any, path: KeyPath, problems: list[Problem]) -> str:
    if not isinstance(name, str):
        problems.append(Problem("", 0, 0, format_key((*path, str(name))), f"a key of type {type(name).__name__}", "give text"))
    return str(name)
