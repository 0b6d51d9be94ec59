"""Scenarios that no person has written: Python values as TOML, and what a steered run did."""

from __future__ import annotations

import datetime as dt
import json
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import PurePath
from typing import Annotated, Any

import numpy as np
import tomli_w
from pydantic import Field, Strict, StrictBool

from multicor_cli.scenario.problems import (
    BARE_KEY,
    MAX_NESTING,
    OVERRIDE,
    KeyPath,
    Problem,
    Refused,
    ScenarioError,
    format_key,
)

# ---- Values as TOML in one line, as `tomli_w` does not write them: for `--set`, and for pages


def in_line(value: Any) -> str:
    """A value of TOML's types in one line."""
    if isinstance(value, dict):
        entries = (
            f"{key if BARE_KEY.fullmatch(key) else json.dumps(key)} = {in_line(entry)}"
            for key, entry in value.items()
        )
        return f"{{ {', '.join(entries)} }}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(in_line, value))}]"
    return tomli_w.dumps({"value": value}).removeprefix("value = ").strip()


# ---- A whole scenario

_SCALARS = (bool, int, float, str, dt.date, dt.time)  # a datetime is a date


def to_document(data: Mapping[str, Any]) -> str:
    """The TOML of a document; raises `ScenarioError` about all that TOML has no value for."""
    faults: list[Refused] = []
    plain = _plain(data, (), faults)
    if not faults and not isinstance(plain, dict):
        what = f"the scenario is of type {type(data).__name__}"
        faults = [Refused((), what, "give a dict of its tables")]
    if faults:
        raise ScenarioError(
            Problem("", 0, 0, format_key(fault.where), fault.what, fault.remedy) for fault in faults
        )
    return tomli_w.dumps(plain)


def to_override(key: str, value: Any) -> str:
    """The argument of ``--set`` for a value; raises `ScenarioError` if TOML has none like it."""
    faults: list[Refused] = []
    plain = _plain(value, (), faults)
    if faults:
        raise ScenarioError(
            Problem(OVERRIDE, 0, 0, key, fault.what, fault.remedy) for fault in faults
        )
    return f"{key}={in_line(plain)}"


def _plain(value: Any, path: KeyPath, faults: list[Refused]) -> Any:
    """A value in the types that TOML has; what is wrong with it goes to ``faults``."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if len(path) > MAX_NESTING:
        faults.append(Refused(path, f"nested more than {MAX_NESTING} deep", "use fewer levels"))
    elif isinstance(value, Mapping):
        table = {}
        for name, item in value.items():
            inside = (*path, str(name))
            if not isinstance(name, str):
                what = f"a key of type {type(name).__name__}"
                faults.append(Refused(inside, what, "give text"))
            table[str(name)] = _plain(item, inside, faults)
        return table
    elif isinstance(value, list | tuple):
        return [_plain(item, (*path, k), faults) for k, item in enumerate(value)]
    elif isinstance(value, PurePath):
        return str(value)
    elif isinstance(value, _SCALARS):
        return value
    elif value is None:
        faults.append(Refused(path, "None is no value", "leave the key out"))
    else:
        remedy = "give a number, text, true or false, a date, a list or a dict"
        faults.append(Refused(path, f"a value of type {type(value).__name__}", remedy))
    return None


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
        duration = decision.stage_steps * decision.dt
        ended = {**loading[decision.stage], "duration": duration, "dt": decision.dt}
        ended.pop("on_timeout", None)
        # A strain is recorded while it is waited for; else a condition leaves no trace
        if "strain" not in (ended.get("until") or {}):
            ended.pop("until", None)
        then = [] if decision.then is None else [decision.then]
        rest = [] if decision.ends_run else loading[decision.stage + 1 :]
        loading = [*loading[: decision.stage], ended, *then, *rest]
    return {**document, "loading": loading}


def steered_text(resolved: str, decisions: Sequence[Decision]) -> str:
    """As `steered_document`, of the TOML of a scenario to TOML."""
    if not decisions:
        return resolved
    return tomli_w.dumps(steered_document(tomllib.loads(resolved), decisions))
