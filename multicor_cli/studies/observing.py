"""Numbers taken from the runs of a study: each observable with its error, kept once the run is finished."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from multicor_cli.files import read_regular
from multicor_cli.post.source import Selection
from multicor_cli.post.sums import Sums, average
from multicor_cli.store.atomic import commit_bytes
from multicor_cli.store.documents import SIZE_LIMIT
from multicor_cli.studies.cases import Case
from multicor_cli.studies.directory import StudyDirectory
from multicor_cli.studies.schema import After, Observable
from multicor_cli.studies.tables import SOURCES, Number, Unobservable


def observe(directory: StudyDirectory, case: Case, observables: Sequence[Observable]) -> dict[str, Any]:
    """Numbers of a finished case, its digest and its worst verdict, from ``observed/NAME.json`` as far as they are there.

    Returns:
        ``values`` (name: ``[value, error]``), ``problems`` (name: why it could not be taken), ``verdict``, ``digest``, ``hours``.
    """
    file = directory.observed(case.name)
    try:
        kept = json.loads(read_regular(file, SIZE_LIMIT))
    except (OSError, ValueError, RecursionError):
        kept = {}
    kept = kept if isinstance(kept, dict) and isinstance(kept.get("numbers"), dict) else {}
    wanted = {row.name: _digest(row) for row in observables}
    new = [row for row in observables if wanted[row.name] not in kept.get("numbers", {})]
    if new or not kept:
        kept = _take(directory.case(case.name), new, kept)
        commit_bytes(file, "observed numbers", json.dumps(kept).encode())
    found = {name: kept["numbers"][digest] for name, digest in wanted.items()}
    return {
        **{name: kept[name] for name in ("verdict", "digest", "hours")},
        "values": {name: number for name, number in found.items() if not isinstance(number, str)},
        "problems": {name: number for name, number in found.items() if isinstance(number, str)},
    }


def _digest(row: Observable) -> str:
    """What is observed, whatever it is called."""
    text = json.dumps(row.model_dump(exclude={"name", "label"}), sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _take(path: Path, observables: Sequence[Observable], kept: dict[str, Any]) -> dict[str, Any]:
    """What is kept of a case, with these observables: ``[value, error]``, or in words why a number could not be taken."""
    import multicor_cli as multicor
    from multicor_cli.checks import worst_verdict
    from multicor_cli.store import run_info

    info = run_info(path)
    numbers = dict(kept.get("numbers", {}))
    for row in observables:
        try:
            numbers[_digest(row)] = list(take_one(path, row, info))
        except Exception as error:  # whatever a run lacks is told in the table; others are still taken
            numbers[_digest(row)] = str(error) or type(error).__name__
    if kept:
        return {**kept, "numbers": numbers}
    verdict = worst_verdict(multicor.check_run(path)).value
    hours = float((info["timings"] or {}).get("wall", math.nan)) / 3600.0
    return {"numbers": numbers, "verdict": verdict, "digest": info["state_digest"], "hours": hours}


def take_one(path: Path, row: Observable, info: dict[str, Any]) -> Number:
    """One observable of a run.

    Raises:
        Unobservable: The run does not have it.
        PostError: It has too few frames.
    """
    import multicor_cli as multicor

    if row.info is not None:
        return Number(_field(info, row.info))
    with multicor.open_run(path) as run:
        start = _start(run, row.after)
        if row.series is not None:
            return _mean_of_series(run, row.series, start)
        assert row.post is not None
        return SOURCES[row.post].take(run, row, Selection(start=start))


def _field(info: dict[str, Any], name: str) -> float:
    node: Any = info
    for part in name.split("."):
        if not isinstance(node, dict) or part not in node:
            known = ", ".join(sorted(node)) if isinstance(node, dict) else "nothing"
            raise Unobservable(f"info has no {name}; there is {known}")
        node = node[part]
    if isinstance(node, bool) or not isinstance(node, int | float):
        raise Unobservable(f"{name} of info is no number")
    return float(node)


def _start(run: Any, after: After | None) -> float | None:
    """Time from which on is averaged; None: the default of `multicor post`."""
    if after is None:
        return None
    if after.time is not None:
        return after.time
    stage, strain = np.asarray(run.series["stage"]), np.asarray(run.series["strain"])
    reached = np.flatnonzero((stage == stage.max()) & (strain >= float(after.strain or 0.0)))
    if not reached.size:
        raise Unobservable(
            f"the strain of the last stage ends at {strain[stage == stage.max()].max():.3g}, before {after.strain:g}"
        )
    return float(run.series["time"][reached[0]])


def _mean_of_series(run: Any, name: str, start: float | None) -> Number:
    """Mean of a column, weighted by the windows, with its standard error; see `multicor_cli.post.sums`."""
    if name not in run.series:
        raise Unobservable(f"the time series has no {name}; it has {', '.join(run.series)}")
    column = np.asarray(run.series[name], float)
    if column.ndim != 1:
        raise Unobservable(f"{name} of the time series has several columns for each row")
    time, stage = np.asarray(run.series["time"]), np.asarray(run.series["stage"])
    if start is None:
        own = time[stage == stage.max()]
        start = 0.5 * float(own[0] + own[-1])
    rows = np.flatnonzero((time >= start) & (np.asarray(run.series["window_duration"]) > 0.0))
    if not rows.size:
        raise Unobservable(f"the time series has no row after {start:g} s")
    weight = np.asarray(run.series["window_duration"])[rows]
    value, error = average(Sums((column[rows] * weight)[:, np.newaxis], weight[:, np.newaxis], weight))
    return Number(float(value[0]), float(error[0]))
