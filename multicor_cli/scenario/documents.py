"""Scenarios that no person has written: Python values as TOML, and what a steered run did."""

from __future__ import annotations

import datetime as dt
import json
import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import PurePath
from typing import Annotated, Any

import numpy as np
import tomli_w
from pydantic import Field, Strict, StrictBool

from multicor_cli.scenario.problems import OVERRIDE, KeyPath, Problem, ScenarioError, format_key
from multicor_cli.scenario.sources import MAX_NESTING

# ---- Values as TOML in one line, as `tomli_w` does not write them: for `--set`, and for pages

_BARE = re.compile(r"[A-Za-z0-9_-]+")


def in_line(value: Any) -> str:
    """A value of TOML's types in one line."""
    if isinstance(value, dict):
        entries = (
            f"{key if _BARE.fullmatch(key) else json.dumps(key)} = {in_line(entry)}"
            for key, entry in value.items()
        )
        return f"{{ {', '.join(entries)} }}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(in_line, value))}]"
    return tomli_w.dumps({"value": value}).removeprefix("value = ").strip()


# ---- A whole scenario

_SCALARS = (bool, int, float, str, dt.date, dt.time)  # a datetime is a date
_REMEDY = "give a number, text, true or false, a date, a list or a dict"


def to_document(data: Mapping[str, Any]) -> str:
    """The TOML of a document; raises `ScenarioError` about all that TOML has no value for."""
    import tomli_w

    problems: list[Problem] = []
    plain = _plain(data, (), problems)
    if problems:
        raise ScenarioError(problems)
    if not isinstance(plain, dict):
        raise ScenarioError(
            [
                Problem(
                    "",
                    0,
                    0,
                    "",
                    f"the scenario is of type {type(data).__name__}",
                    "give a dict of its tables",
                )
            ]
        )
    return tomli_w.dumps(plain)


def to_override(key: str, value: Any) -> str:
    """The argument of ``--set`` for a value; raises `ScenarioError` if TOML has none like it."""
    problems: list[Problem] = []
    plain = _plain(value, (), problems)
    if problems:
        raise ScenarioError(
            [Problem(OVERRIDE, 0, 0, key, problem.message, problem.remedy) for problem in problems]
        )
    return f"{key}={in_line(plain)}"


def _plain(value: Any, path: KeyPath, problems: list[Problem]) -> Any:
    """A value in the types that TOML has; what is wrong with it goes to ``problems``."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if len(path) > MAX_NESTING:
        problems.append(
            Problem(
                "",
                0,
                0,
                format_key(path),
                f"nested more than {MAX_NESTING} deep",
                "use fewer levels",
            )
        )
    elif isinstance(value, Mapping):
        return {
            _name(name, path, problems): _plain(item, (*path, str(name)), problems)
            for name, item in value.items()
        }
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
        problems.append(
            Problem(
                "",
                0,
                0,
                format_key((*path, str(name))),
                f"a key of type {type(name).__name__}",
                "give text",
            )
        )
    return str(name)


# ---- The scenario that a steered run has carried out: stages as a program ended and added them.
#      Run without the program it gives the same bits.

Count = Annotated[int, Strict(), Field(ge=0, lt=2**63)]
"""A number of something in a document, or of one among several."""


@dataclass(frozen=True)
class Decision:
    """A program has ended a stage.

    Attributes:
        stage: Index of the stage, those counted that were added before.
        step: Steps done since the start of the run.
        stage_steps: Steps done in the stage.
        dt: Time step of the stage [s].
        then: The stage added behind it, as a table of ``[[loading]]``; None: that of the scenario.
        ends_run: Whether no stage follows at all.
    """

    stage: Count
    step: Count
    stage_steps: Count
    dt: Annotated[float, Strict()]
    then: dict[str, Any] | None = None
    ends_run: StrictBool = False

    def as_document(self) -> dict[str, Any]:
        """As JSON types."""
        return asdict(self)


def steered_document(document: dict[str, Any], decisions: Sequence[Decision]) -> dict[str, Any]:
    """The document with its stages as they were carried out: ended ones last as many steps."""
    loading: list[dict[str, Any]] = list(document["loading"])
    for decision in decisions:
        ended = {
            **loading[decision.stage],
            "duration": decision.stage_steps * decision.dt,
            "dt": decision.dt,
        }
        ended.pop("on_timeout", None)
        if "strain" not in (
            ended.get("until") or {}
        ):  # a strain is recorded while it is waited for; else a condition leaves no trace
            ended.pop("until", None)
        then = [] if decision.then is None else [decision.then]
        rest = [] if decision.ends_run else loading[decision.stage + 1 :]
        loading = [*loading[: decision.stage], ended, *then, *rest]
    return {**document, "loading": loading}


def steered_text(resolved: str, decisions: Sequence[Decision]) -> str:
    """As `steered_document`, of the TOML of a scenario to TOML."""
    if not decisions:
        return resolved
    import tomli_w

    return tomli_w.dumps(steered_document(tomllib.loads(resolved), decisions))
