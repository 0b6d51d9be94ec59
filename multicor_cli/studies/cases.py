"""The cases of a study: a name, values, and what is set in the scenario for each."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from multicor_cli.scenario.load import load_scenario
from multicor_cli.scenario.problems import Finding, ScenarioError
from multicor_cli.scenario.scenario import Scenario
from multicor_cli.studies.axes import BadAxes, Value, Values, combine, differing
from multicor_cli.studies.load import Study, arguments
from multicor_cli.studies.schema import MAX_CASES

SEED = "scenario.seed"
"""The key that ``seeds`` varies."""

_UNSAFE = re.compile(r"[^A-Za-z0-9.+-]+")
_LONGEST = 120
_DIGITS = 6, 12, 17


@dataclass(frozen=True)
class Case:
    """One run of a study.

    Attributes:
        name: Name of its directory: short names of the keys with their values.
        values: Values by key, the seed last.
    """

    name: str
    values: Values

    @property
    def overrides(self) -> list[str]:
        """Arguments of ``--set`` that make the case out of the scenario of the study, beside those of all cases."""
        return arguments(self.values)


def expand(study: Study) -> list[Case]:
    """All cases of a study, none of them looked at yet.

    Raises:
        ScenarioError: The scenario of the study is wrong by itself, or the values of the study are.
    """
    base = load_scenario(study.scenario, study.fixed)
    try:
        combinations = combine(study.model.vary, study.path.parent)
    except BadAxes as error:
        raise study.refuse(error.finding) from None
    seeds = _seeds(study, base)
    if SEED in study.model.vary.keys and study.model.study.seeds is not None:
        raise study.refuse(Finding(("study", "seeds"), f"{SEED} is varied as well", "leave one of them out"))
    if len(combinations) * len(seeds) > MAX_CASES:
        message = f"{len(combinations)} combinations with {len(seeds)} seeds each are more than {MAX_CASES} cases"
        raise study.refuse(Finding(("study", "seeds"), message, "vary less"))
    rows = [{**values, **({SEED: seed} if seed is not None else {})} for values in combinations for seed in seeds]
    return _named(study, rows)


def check_case(study: Study, case: Case) -> Scenario:
    """The scenario of a case.

    Raises:
        ScenarioError: It is wrong; problems about a varied key point into the study file.
    """
    try:
        return load_scenario(study.scenario, [*study.fixed, *case.overrides])
    except ScenarioError as error:
        raise _about(study, case, error) from None


def _seeds(study: Study, base: Scenario) -> list[int | None]:
    seeds = study.model.study.seeds
    if seeds is None:
        return [None]
    return list(seeds) if isinstance(seeds, tuple) else [base.seed + k for k in range(seeds)]


def _named(study: Study, rows: Sequence[Values]) -> list[Case]:
    """Cases with the shortest numbers that tell them apart."""
    if len({json.dumps(row) for row in rows}) < len(rows):
        raise study.refuse(Finding(("vary",), "a combination of values comes twice", "give each value once"))
    short = short_names(differing(rows))
    names: list[str] = []
    for digits in _DIGITS:
        names = [_name(row, short, digits) for row in rows]
        if len({name.casefold() for name in names}) == len(names):
            return [Case(name, row) for name, row in zip(names, rows, strict=True)]
    return [Case(f"{name}_{_digest(row)}", row) for name, row in zip(names, rows, strict=True)]


def short_names(keys: Iterable[str]) -> dict[str, str]:
    """Short names of keys: their last parts, as many as tell them apart."""
    parts = {key: key.split(".") for key in keys}
    found = {}
    for key, own in parts.items():
        for length in range(1, len(own) + 1):
            tail = own[-length:]
            if not tail[0].isdecimal() and sum(other[-length:] == tail for other in parts.values()) == 1:
                break
        found[key] = ".".join(own[-length:])
    return found


def shown(value: Value, digits: int = 6) -> str:
    """A value in a name or a table."""
    if isinstance(value, bool):
        return "true" if value else "false"
    return f"{value:.{digits}g}" if isinstance(value, float) else str(value)


def _name(row: Values, short: dict[str, str], digits: int) -> str:
    name = "_".join(f"{short[key]}={_UNSAFE.sub('-', shown(value, digits))}" for key, value in row.items()) or "only"
    return name if len(name) <= _LONGEST else f"{name[: _LONGEST - 9]}_{_digest(row)}"


def _digest(row: Values) -> str:
    return hashlib.sha256(json.dumps(row).encode()).hexdigest()[:8]


def _about(study: Study, case: Case, error: ScenarioError) -> ScenarioError:
    """The problems of a case: those of a varied key point to its values in the study file."""
    findings, others = [], []
    for problem in error.problems:
        key = next((key for key in case.values if problem.key == key or problem.key.startswith(f"{key}.")), None)
        if key is None or key == SEED:
            others.append(problem)
        else:
            findings.append(Finding(("vary", "keys", key), f"{problem.message} (case {case.name})", problem.remedy))
    return ScenarioError([*(study.refuse(*findings).problems if findings else []), *others])
