"""Ratios of a benchmark beside recorded ones: what has become slower by more than the noise."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from multicor_cli.bench.measuring import Result
from multicor_cli.store.atomic import commit_result

MARGINS = {"sweeps": 1.25, "sweep_over_c": 1.4, "solve_over_c": 1.5, "other_over_c": 1.6}
"""By how much a ratio may exceed the recorded one: sweeps depend on roundings, times on a shared machine
scatter."""


class RecordError(Exception):
    """A file of recorded ratios cannot be used: one message for the user."""


def ratios(result: Result) -> dict[str, float]:
    """What of a result does not depend on how fast the machine is; only what could be measured.

    ``sweeps`` of a step; a sweep over that in C; the solve per contact and sweep-equivalent over the sweep in C; everything but the
    solve per grain over the time of a contact in the sweep in C.
    """
    found = {"sweeps": result.sweeps}
    sweep, each = result.sweep, result.per_contact
    if sweep is not None and each is not None and math.isfinite(sweep.in_c):
        found["sweep_over_c"] = sweep.ratio
        found["solve_over_c"] = each / sweep.in_c
        found["other_over_c"] = result.other / (result.grains * sweep.in_c)
    return found


def name_of(result: Result) -> str:
    """Name of a result in the file."""
    return f"{result.scene}-{result.grains}-threads-{result.threads}"


def write_record(path: Path, results: Iterable[Result]) -> None:
    """Record the ratios of results; those of others in the file are kept.

    Raises:
        RecordError: If the file holds something else.
        StorageError: If it cannot be written.
    """
    known = read_record(path) if path.exists() else {}
    known.update({name_of(result): ratios(result) for result in results if not result.faults})
    commit_result(path, "record", (json.dumps(dict(sorted(known.items())), indent=2) + "\n").encode())


def read_record(path: Path) -> dict[str, dict[str, float]]:
    """Recorded ratios by name of the result; raises `RecordError` if the file is no record, `OSError` if it cannot be read."""
    try:
        data: Any = json.loads(path.read_text(encoding="utf-8"))
        return {str(name): {str(key): float(value) for key, value in found.items()} for name, found in data.items()}
    except (ValueError, AttributeError, TypeError) as error:
        raise RecordError(f"{path}: is no record of a benchmark ({error}); write one with --record") from error


def find_slower(results: Iterable[Result], record: dict[str, dict[str, float]]) -> list[str]:
    """What exceeds the recorded ratios by more than its margin."""
    worse = []
    for result in results:
        before = record.get(name_of(result), {})
        for key, value in ratios(result).items():
            if key in before and value > MARGINS[key] * before[key]:
                worse.append(f"{name_of(result)}: {key.replace('_', ' ')} {value:.3g}, recorded {before[key]:.3g}")
    return worse
