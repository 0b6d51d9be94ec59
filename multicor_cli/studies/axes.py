"""The values that each key of a study takes, how they combine, and the cases that come of it."""

from __future__ import annotations

import csv
import hashlib
import itertools
import json
import math
import re
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from multicor_cli.files import read_regular
from multicor_cli.optional import library
from multicor_cli.scenario.base import MAX_BYTES, reading_input, refuse_semicolons
from multicor_cli.scenario.problems import Problem, Refused, ScenarioError, parse_key
from multicor_cli.scenario.scenario import Scenario, load_scenario
from multicor_cli.studies.study_file import (
    MAX_CASES,
    OPTIONS,
    Range,
    Sampled,
    Study,
    Vary,
    arguments,
)

# ---- Values and their combinations

Value = bool | int | float | str
Values = Mapping[str, Value]
"""Values of keys of the scenario, by dotted key."""

_DIGITS = 12
"""Significant digits of numbers in ranges: the same on every machine."""


def combine(vary: Vary, directory: Path) -> list[Values]:
    """All combinations in file order, the last key changing fastest; paths begin at ``directory``.

    Raises:
        Refused: Keys in ``zip`` have no values or not as many, the CSV file cannot be used, or
            there are too many combinations.
        MissingLibrary: Points are to be drawn, and scipy is not installed.
    """
    axes: list[Sequence[Values]] = []
    ranges = {key: axis for key, axis in vary.keys.items() if isinstance(axis, Range)}
    groups = _groups(vary, set(ranges) if vary.sample is not None else set())
    for group in groups:
        columns = [numbers(vary.keys[key]) for key in group]
        axes.append([dict(zip(group, row, strict=True)) for row in zip(*columns, strict=True)])
    if vary.sample is not None:
        if not ranges:
            what = "there is no range to draw points from"
            raise Refused(("vary", "sample"), what, "give a key { from = …, to = … }")
        axes.append(_drawn(vary.sample, ranges))
    if vary.file is not None:
        axes.append(_rows(directory / vary.file, vary.file, set(vary.keys)))
    if (count := math.prod(len(axis) for axis in axes)) > MAX_CASES:
        raise Refused(("vary",), f"{count:.6g} combinations are more than {MAX_CASES}", "vary less")
    return [
        dict(itertools.chain.from_iterable(part.items() for part in parts))
        for parts in itertools.product(*axes)
    ]


def numbers(axis: Range | tuple[Value, ...]) -> tuple[Value, ...]:
    """The values of a key, those of a range rounded to twelve digits; whole numbers stay whole."""
    if not isinstance(axis, Range):
        return axis
    assert axis.count is not None  # only ranges between which points are drawn have none
    low, high, last = axis.from_, axis.to, max(axis.count - 1, 1)
    values = [
        low if k == 0 else high if k == last else _between(axis, k / last)
        for k in range(axis.count)
    ]
    is_whole = (
        isinstance(low, int)
        and isinstance(high, int)
        and all(float(value).is_integer() for value in values)
    )
    return tuple(int(value) if is_whole else float(value) for value in values)


def _groups(vary: Vary, left_out: set[str]) -> list[tuple[str, ...]]:
    """Keys whose values go together, in the order of the file."""
    partner: dict[str, tuple[str, ...]] = {}
    for number, group in enumerate(vary.zip):
        place, lengths = ("vary", "zip", number), {}
        for key in group:
            why = (
                "is in two groups" if key in partner
                else "is drawn" if key in left_out
                else "has no values" if key not in vary.keys
                else ""
            )  # fmt: skip
            if why:
                raise Refused(place, f"{key} {why}", "name keys of [vary], each once")
            partner[key] = group
            lengths[key] = len(numbers(vary.keys[key]))
        if len({*lengths.values()}) > 1:
            counts = ", ".join(f"{key}: {length}" for key, length in lengths.items())
            what = f"values that go together are not as many ({counts})"
            raise Refused(place, what, "give as many of each")
    kept = [key for key in vary.keys if key not in left_out]
    return list(dict.fromkeys(partner.get(key, (key,)) for key in kept))


def _drawn(sample: Sampled, ranges: Mapping[str, Range]) -> list[Values]:
    """Points of the box that the ranges span; on a logarithmic range logarithms are drawn."""
    qmc = library("scipy.stats").qmc
    if sample.kind == "latin-hypercube":
        points = qmc.LatinHypercube(d=len(ranges), rng=sample.seed).random(sample.count)
    else:  # the first of as many as SciPy asks for, a power of two: it warns of other numbers
        drawn = qmc.Sobol(d=len(ranges), rng=sample.seed)
        points = drawn.random_base2((sample.count - 1).bit_length())[: sample.count]
    return [
        {key: _between(ranges[key], share) for key, share in zip(ranges, point, strict=True)}
        for point in points.tolist()
    ]


def _between(axis: Range, share: float) -> float:
    low, high = float(axis.from_), float(axis.to)
    is_log = axis.spacing == "log"
    value = low * (high / low) ** share if is_log else low + (high - low) * share
    return float(f"{value:.{_DIGITS}g}")


def _rows(path: Path, name: str, taken: set[str]) -> list[Values]:
    """Rows of a CSV file whose header names keys; values as in TOML, words as they are."""
    place = ("vary", "file")
    bad = partial(Refused, place)
    with reading_input(name, "a CSV file in UTF-8", place, named_in="study"):
        text = read_regular(path, MAX_BYTES).decode("utf-8-sig")
        lines = [row for row in csv.reader(text.splitlines()) if row and not row[0].startswith("#")]
    if len(lines) < 2:
        remedy = "let the first line name the keys, and each further one give their values"
        raise bad(f"'{name}' has no rows", remedy)
    refuse_semicolons(lines[0], name, place)
    keys = [title.strip() for title in lines[0]]
    for key in keys:
        if not key or key in OPTIONS or key in taken or keys.count(key) > 1:
            what = f"'{name}' has a column '{key}' that is empty, comes twice or is varied already"
            raise bad(what, "name each key once")
    for number, row in enumerate(lines[1:], 2):
        if len(row) != len(keys):
            what = f"row {number} of '{name}' has {len(row)} values for {len(keys)} keys"
            raise bad(what, "give a value for each key")
    return [dict(zip(keys, map(_parsed, row), strict=True)) for row in lines[1:]]


def _parsed(text: str) -> Value:
    text = text.strip()
    try:
        value = tomllib.loads(f"v = {text}")["v"]
    except ValueError:
        return text
    return value if isinstance(value, bool | int | float | str) else text


# ---- The cases of a study: a name, values, and what is set in the scenario for each

SEED = "scenario.seed"
"""The key that ``seeds`` varies."""

_UNSAFE = re.compile(r"[^A-Za-z0-9.+-]+")
_LONGEST = 120
_DIGITS_OF_NAMES = 6, 12, 17


@dataclass(frozen=True)
class Case:
    """One run of a study, named after its directory: short keys with values, the seed last."""

    name: str
    values: Values

    @property
    def overrides(self) -> list[str]:
        """Arguments of ``--set`` that make it out of the scenario, beside those of all cases."""
        return arguments(self.values)


def expand(study: Study) -> list[Case]:
    """All cases, none looked at yet; raises `ScenarioError` if scenario or values are wrong."""
    base = load_scenario(study.scenario, study.fixed)
    if base.given["scenario"]["seed"] == "random":
        what = "the scenario draws its seed by chance: every look at the study would be at another"
        remedy = 'give it a number, as [set] "scenario.seed" = 1'
        raise study.refuse(Refused(("study", "scenario"), what, remedy))
    try:
        combinations = combine(study.model.vary, study.path.parent)
    except Refused as error:
        raise study.refuse(error) from None
    given = study.model.study.seeds
    seeds: list[int | None] = [None]
    if given is not None:
        seeds = [*given] if isinstance(given, tuple) else [base.seed + k for k in range(given)]
    place = ("study", "seeds")
    if SEED in study.model.vary.keys and given is not None:
        raise study.refuse(Refused(place, f"{SEED} is varied as well", "leave one of them out"))
    if len(combinations) * len(seeds) > MAX_CASES:
        message = (
            f"{len(combinations)} combinations with {len(seeds)} seeds each are more than "
            f"{MAX_CASES} cases"
        )
        raise study.refuse(Refused(place, message, "vary less"))
    rows = [
        {**values, **({SEED: seed} if seed is not None else {})}
        for values in combinations
        for seed in seeds
    ]
    # 1 and 1.0 are one value, 1 and true are two
    if len({tuple((isinstance(v, bool), v) for v in row.values()) for row in rows}) < len(rows):
        what = "a combination of values comes twice"
        raise study.refuse(Refused(("vary",), what, "give each value once"))
    return _named(rows)


def check_case(study: Study, case: Case) -> Scenario:
    """The scenario of a case; a `ScenarioError` about a varied key points into the study file."""
    try:
        return load_scenario(study.scenario, [*study.fixed, *case.overrides])
    except ScenarioError as error:
        problems = error.problems
    findings, others = [], list[Problem]()
    alone = {(problem.key, problem.message) for problem in _problems_without_case(study)}
    for problem in problems:
        of_case = f"{problem.message} (case {case.name})"
        keys = (key for key in case.values if f"{problem.key}.".startswith(f"{key}."))
        key = next(keys, SEED)
        if key in study.model.vary.keys:
            findings.append(Refused(("vary", "keys", key), of_case, problem.remedy))
        elif key != SEED:
            of_column = f"column {key} of '{study.model.vary.file}': {of_case}"
            findings.append(Refused(("vary", "file"), of_column, problem.remedy))
        elif (problem.key, problem.message) in alone:
            others.append(problem)
        else:
            others.append(replace(problem, message=of_case))
    raise ScenarioError([*(study.refuse(*findings).problems if findings else []), *others])


def in_numbers(study: Study, case: Case) -> Values:
    """Values of a case; instead of expressions their numbers, unless its scenario is wrong."""
    expressions = [key for key, value in case.values.items() if str(value).startswith("=")]
    if not expressions:
        return case.values
    try:
        tables = check_case(study, case).as_dict()
    except ScenarioError:
        return case.values
    values = dict(case.values)
    for key in expressions:
        found: Any = tables
        for part in parse_key(f"{key}=")[0]:
            found = found[part if isinstance(found, dict) else int(part)]
        values[key] = found
    return values


def _problems_without_case(study: Study) -> Sequence[Problem]:
    """What is wrong with the scenario before anything is varied."""
    try:
        load_scenario(study.scenario, study.fixed)
    except ScenarioError as error:
        return error.problems
    return ()


def _named(rows: Sequence[Values]) -> list[Case]:
    """Cases with the shortest numbers that tell them apart."""
    short = short_names(dict.fromkeys(key for row in rows for key in row))
    names: list[str] = []
    for digits in _DIGITS_OF_NAMES:
        names = [_name(row, short, digits) for row in rows]
        if len({name.casefold() for name in names}) == len(names):
            return [Case(name, row) for name, row in zip(names, rows, strict=True)]
    return [Case(f"{name}_{digest_of(row)}", row) for name, row in zip(names, rows, strict=True)]


def short_names(keys: Iterable[str]) -> dict[str, str]:
    """Short names of keys: their last parts, as many as tell them apart."""
    parts = {key: key.split(".") for key in keys}
    found = {}
    for key, own in parts.items():
        for length in range(1, len(own) + 1):
            tail = own[-length:]
            is_alone = sum(other[-length:] == tail for other in parts.values()) == 1
            if is_alone and not tail[0].isdecimal():
                break
        found[key] = ".".join(own[-length:])
    return found


def digits_of(values: Iterable[Value]) -> int:
    """The fewest significant digits with which different values look different."""
    different = set(values)
    for digits in _DIGITS_OF_NAMES:
        if len({shown(value, digits) for value in different}) == len(different):
            return digits
    return _DIGITS_OF_NAMES[-1]


def shown(value: Value, digits: int = 6) -> str:
    """A value in a name or a table."""
    if isinstance(value, bool):
        return "true" if value else "false"
    return f"{value:.{digits}g}" if isinstance(value, float) else str(value)


def _name(row: Values, short: dict[str, str], digits: int) -> str:
    values = {key: _UNSAFE.sub("-", shown(value, digits)) for key, value in row.items()}
    name = "_".join(f"{short[key]}={value}" for key, value in values.items()) or "only"
    return name if len(name) <= _LONGEST else f"{name[: _LONGEST - 9]}_{digest_of(row)}"


def digest_of(row: Values) -> str:
    """Eight letters that tell combinations of values apart."""
    return hashlib.sha256(json.dumps(row).encode()).hexdigest()[:8]
