"""The values that each key of a study takes, and how they are combined."""

from __future__ import annotations

import csv
import itertools
import math
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from multicor_cli.files import read_regular
from multicor_cli.optional import library
from multicor_cli.scenario.csv_columns import MAX_BYTES
from multicor_cli.scenario.problems import Finding
from multicor_cli.studies.schema import MAX_CASES, OPTIONS, Range, Sampled, Vary

Value = bool | int | float | str
Values = Mapping[str, Value]
"""Values of keys of the scenario, by dotted key."""

_DIGITS = 12
"""Significant digits of numbers in ranges: the same on every machine."""


class BadAxes(Exception):
    """Something is wrong with the values of a study."""

    def __init__(self, finding: Finding) -> None:
        super().__init__(finding.message)
        self.finding = finding


def combine(vary: Vary, directory: Path) -> list[Values]:
    """All combinations, in the order of the file, the last key changing fastest.

    Args:
        vary: The table of the study.
        directory: That of the study file, to which paths are relative.

    Raises:
        BadAxes: Keys in ``zip`` have no values or not as many, the CSV file cannot be used, or there are too many combinations.
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
            raise BadAxes(Finding(("vary", "sample"), "there is no range to draw points from", "give a key { from = …, to = … }"))
        axes.append(_drawn(vary.sample, ranges))
    if vary.file is not None:
        axes.append(_rows(directory / vary.file, vary.file, set(vary.keys)))
    if (count := math.prod(len(axis) for axis in axes)) > MAX_CASES:
        raise BadAxes(Finding(("vary",), f"{count:.6g} combinations are more than {MAX_CASES}", "vary less"))
    return [dict(itertools.chain.from_iterable(part.items() for part in parts)) for parts in itertools.product(*axes)]


def numbers(axis: Range | tuple[Value, ...]) -> tuple[Value, ...]:
    """The values of a key, those of a range rounded to twelve digits; whole numbers stay whole."""
    if not isinstance(axis, Range):
        return axis
    assert axis.count is not None  # only ranges between which points are drawn have none
    low, high, last = axis.from_, axis.to, max(axis.count - 1, 1)
    found: list[float] = []
    for k in range(axis.count):
        share = k / last
        between = low * (high / low) ** share if axis.spacing == "log" else low + (high - low) * share
        found.append(low if k == 0 else high if k == last else _rounded(between))
    is_whole = isinstance(low, int) and isinstance(high, int) and all(float(value).is_integer() for value in found)
    return tuple(int(value) for value in found) if is_whole else tuple(float(value) for value in found)


def _rounded(value: float) -> float:
    return float(f"{value:.{_DIGITS}g}")


def _groups(vary: Vary, left_out: set[str]) -> list[tuple[str, ...]]:
    """Keys whose values go together, in the order of the file."""
    partner: dict[str, tuple[str, ...]] = {}
    for number, group in enumerate(vary.zip):
        lengths = set()
        for key in group:
            if key not in vary.keys or key in partner or key in left_out:
                why = "is in two groups" if key in partner else "is drawn" if key in left_out else "has no values"
                raise BadAxes(Finding(("vary", "zip", number), f"{key} {why}", "name keys of [vary], each once"))
            partner[key] = group
            lengths.add(len(numbers(vary.keys[key])))
        if len(lengths) > 1:
            counts = ", ".join(f"{key}: {len(numbers(vary.keys[key]))}" for key in group)
            raise BadAxes(
                Finding(("vary", "zip", number), f"values that go together are not as many ({counts})", "give as many of each")
            )
    groups: list[tuple[str, ...]] = []
    for key in vary.keys:
        group = partner.get(key, (key,))
        if key not in left_out and group not in groups:
            groups.append(group)
    return groups


def _drawn(sample: Sampled, ranges: Mapping[str, Range]) -> list[Values]:
    """Points of the box that the ranges span; on a logarithmic range their logarithms are drawn."""
    qmc = library("scipy.stats").qmc
    kind = qmc.LatinHypercube if sample.kind == "latin-hypercube" else qmc.Sobol
    points = kind(d=len(ranges), rng=sample.seed).random(sample.count)
    return [
        {key: _rounded(_between(axis, float(share))) for (key, axis), share in zip(ranges.items(), point, strict=True)}
        for point in points
    ]


def _between(axis: Range, share: float) -> float:
    low, high = float(axis.from_), float(axis.to)
    return low * (high / low) ** share if axis.spacing == "log" else low + (high - low) * share


def _rows(path: Path, name: str, taken: set[str]) -> list[Values]:
    """Rows of a CSV file whose header names keys; values are written as in TOML, words as they are."""

    def bad(message: str, remedy: str) -> BadAxes:
        return BadAxes(Finding(("vary", "file"), message, remedy))

    try:
        text = read_regular(path, MAX_BYTES).decode("utf-8-sig")
        lines = [row for row in csv.reader(text.splitlines()) if row and not row[0].startswith("#")]
    except FileNotFoundError:
        raise bad(f"there is no file '{name}'", "give its path relative to the study file") from None
    except (OSError, ValueError, csv.Error) as error:
        raise bad(
            f"'{name}' cannot be read: {getattr(error, 'strerror', None) or error}", "it must be a CSV file in UTF-8"
        ) from None
    if len(lines) < 2:
        raise bad(f"'{name}' has no rows", "let the first line name the keys, and each further one give their values")
    keys = [title.strip() for title in lines[0]]
    for key in keys:
        if not key or key in OPTIONS or key in taken or keys.count(key) > 1:
            raise bad(f"'{name}' has a column '{key}' that is empty, comes twice or is varied already", "name each key once")
    for number, row in enumerate(lines[1:], 2):
        if len(row) != len(keys):
            raise bad(f"row {number} of '{name}' has {len(row)} values for {len(keys)} keys", "give a value for each key")
    return [dict(zip(keys, map(_parsed, row), strict=True)) for row in lines[1:]]


def _parsed(text: str) -> Value:
    text = text.strip()
    try:
        value = tomllib.loads(f"v = {text}")["v"]
    except ValueError:
        return text
    return value if isinstance(value, bool | int | float | str) else text


def differing(rows: Sequence[Values]) -> Iterator[str]:
    """Keys in the order in which they come up."""
    return iter(dict.fromkeys(key for row in rows for key in row))
