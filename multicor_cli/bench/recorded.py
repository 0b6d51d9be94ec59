"""Ratios of a benchmark beside recorded ones: what has become slower by more than the noise."""

from __future__ import annotations

import json
import math
import statistics
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from multicor_cli.bench.measuring import Result
from multicor_cli.files import read_regular
from multicor_cli.store.atomic import commit_result

MARGINS = {
    "sweeps": 1.25,
    "cold_sweeps": 1.9,
    "sweep_over_c": 1.8,
    "solve_over_c": 1.8,
    "other_over_reference": 2.5,
}
"""By how much a number may exceed the recorded one. For sweeps that is three times the scatter
between seeds (cold ones: what is left below a factor of two), for times what processors may differ
by; `benchmarks/README.md` has all."""

LOOK = 3.0
"""Sweep-equivalents between two looks at the residual: counts no farther apart are the same."""

_ENOUGH = 30.0
"""Sweeps of a step from which on the solve is mostly sweeps, and its time comparable with them."""

RECORD_LIMIT = 1 << 20
"""Larger files are not read as records [bytes]."""


class RecordError(Exception):
    """A file of recorded ratios cannot be used: one message for the user."""

    exit_code = 2


def ratios(result: Result) -> dict[str, float]:
    """What of a result depends neither on the machine's speed nor on one trajectory's bits.

    Median ``sweeps`` of a step, and ``cold_sweeps`` without a warm start; a sweep over that in C;
    the solve per contact and sweep-equivalent over the sweep in C; everything but the solve over
    its yardstick. Only what could be measured.
    """
    measured = {"other_over_reference": result.other_ratio}
    sweep, each, cold = result.sweep, result.per_contact, result.cold_sweeps
    if each is not None:
        measured["sweeps"] = result.median_sweeps
    if cold is not None:
        measured["cold_sweeps"] = cold
    if sweep is not None and math.isfinite(sweep.in_c):
        measured["sweep_over_c"] = sweep.ratio
        if each is not None and (cold or result.median_sweeps) >= _ENOUGH:
            measured["solve_over_c"] = each / sweep.in_c
    return measured


def _name_of(result: Result) -> str:
    return f"{result.scene}-{result.grains}-threads-{result.threads}"


def write_record(path: Path, results: Iterable[Result]) -> None:
    """Record ratios, medians over seeds of a scene; those of others in the file are kept.

    Raises `RecordError` if it holds something else, `StorageError` if it cannot be written.
    """
    known = read_record(path) if path.exists() else {}
    by_seed: dict[str, list[dict[str, float]]] = {}
    for result in results:
        if not result.faults:
            by_seed.setdefault(_name_of(result), []).append(ratios(result))
    for name, several in by_seed.items():
        values = {key: [each[key] for each in several if key in each] for key in several[0]}
        known[name] = {key: statistics.median(each) for key, each in values.items()}
    text = json.dumps(dict(sorted(known.items())), indent=2) + "\n"
    commit_result(path, "record", text.encode())


def read_record(path: Path) -> dict[str, dict[str, float]]:
    """Recorded ratios by name; raises `RecordError` if it is no record, `OSError` if unreadable."""
    try:
        data: Any = json.loads(read_regular(path, RECORD_LIMIT))
        return {
            str(name): {str(key): float(value) for key, value in known.items()}
            for name, known in data.items()
        }
    except (ValueError, AttributeError, TypeError) as error:
        raise RecordError(
            f"{path} is not a record of a benchmark ({error}); write one with --record"
        ) from error


def find_slower(results: Iterable[Result], record: dict[str, dict[str, float]]) -> list[str]:
    """What exceeds the recorded ratios by more than its margin."""
    return [line for result in results for line in _exceeding(result, record).values()]


def slower_twice(
    results: Iterable[Result], again: Iterable[Result], record: dict[str, dict[str, float]]
) -> list[str]:
    """What exceeds recorded ratios in both of two measurements; the second says by how much."""
    first = {_name_of(result): _exceeding(result, record) for result in results}
    return [
        line
        for result in again
        for key, line in _exceeding(result, record).items()
        if key in first.get(_name_of(result), {})
    ]


def _exceeding(result: Result, record: dict[str, dict[str, float]]) -> dict[str, str]:
    name, found = _name_of(result), {}
    before = record.get(name, {})
    for key, value in ratios(result).items():
        look = LOOK if key.endswith("sweeps") else 0.0
        if key in before and value > max(MARGINS[key] * before[key], before[key] + look):
            text = f"{key.replace('_', ' ')} {value:.3g}, recorded {before[key]:.3g}"
            found[key] = f"{name}: {text}"
    return found
