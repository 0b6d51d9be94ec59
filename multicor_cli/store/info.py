"""What ``multicor info`` reports about a run."""

from __future__ import annotations

import json
import socket
import tomllib
from datetime import datetime
from pathlib import Path
from typing import Any

from multicor_cli.engine.heat.hertz import largest_deflection
from multicor_cli.files import read_regular
from multicor_cli.store import layout
from multicor_cli.store.errors import DamagedRun, StoreError
from multicor_cli.store.lock import read_holder
from multicor_cli.store.reader import Run, open_run
from multicor_cli.store.summary import empty_summary

_HEARTBEAT_LIMIT = 1 << 20
"""A longer ``progress.json`` is not read [bytes]."""


def run_info(path: Path | str) -> dict[str, Any]:
    """Status, size and quality of a run as JSON types.

    ``step, time, state_digest``, the books, the counters and the ends of stages are those of the newest checkpoint (the last state
    of a finished run); ``frame_count`` is what has been committed. Values that do not exist yet are ``None``.

    Returns:
        ``path, run_id, status, stop_reason, exit_code, grain_count, frame_count, series_count, step, time, stage, stages,
        stage_ends`` (how each stage ended that is over, see `multicor_cli.store.stage_ends.StageEnd`), ``origin`` (the moment of
        another run from which it goes on, see `multicor_cli.store.stage_ends.Origin`, or null), ``extensions`` (when stages were
        added to the run, see docs/reference/formats/run-directory.md), ``steering`` (the program that steers the run and what it
        decided, likewise, or null), ``walls, state_digest, energy_closure, heat_closure, max_overlap,
        solver.{sweeps_mean, residual_rms_max, residual_max_max, unconverged_steps}, books, heat, negative_loss_share,
        corrected_steps, max_contact_force, progress`` (``progress.json`` of a run that goes on: step, time, speed, seconds left …),
        ``pid`` (of its process, if that is on this host), ``worst_step.{step, time}`` (end of the row of the time series with the
        largest rms residual), ``hertz_deflection, started, finished, duration`` (from the first start to the last sign of life, s),
        ``timings, data_digest, provenance``.

    Raises:
        DirectoryRefused: If there is no run.
        DamagedRun: If a file that is needed is damaged.
        StorageError: If a file cannot be read.
    """
    with open_run(path) as run:
        info = run.info
        summary = {**empty_summary(), **(info["summary"] or {})}
        results = info["results"] or {}
        return {
            "path": str(run.path),
            "run_id": run.run_id,
            "status": run.status,
            "stop_reason": info["stop_reason"],
            "exit_code": info["exit_code"],
            **{name: summary[name] for name in ("grain_count", "step", "time", "stage", "state_digest")},
            "frame_count": len(run.frames),
            "series_count": run.series.row_count,
            "stages": list(run.stages),
            "stage_ends": _kept(info.get("stage_ends", []), summary["step"]),
            "origin": info.get("origin"),
            "extensions": info.get("extensions", []),
            "steering": _steering(info.get("steering"), summary["step"]),
            "walls": _walls(run),
            **{name: value for name, value in summary.items() if name not in ("grain_count", "step", "time", "stage")},
            **_heartbeat(run),
            "worst_step": _worst_step(run),
            "hertz_deflection": hertz_deflection(run, summary["max_contact_force"]),
            "started": info["started"],
            "finished": info["finished"],
            "duration": _seconds(info["started"], info["finished"] or info.get("updated", "")),
            "timings": info["timings"],
            "data_digest": results.get("data_digest"),
            "provenance": info["provenance"],
        }


def _kept(events: list[dict[str, Any]], step: int | None) -> list[dict[str, Any]]:
    """What had happened by the newest checkpoint: ``run.json`` tells it before, and what was lost since then happens once more."""
    return [event for event in events if event["step"] <= (step or 0)]


def _steering(steering: dict[str, Any] | None, step: int | None) -> dict[str, Any] | None:
    return None if steering is None else {**steering, "decisions": _kept(steering["decisions"], step)}


def _heartbeat(run: Run) -> dict[str, Any]:
    """What ``progress.json`` says, and which process to send signals to, if the run goes on."""
    if run.status != "running":
        return {"progress": None, "pid": None}
    holder = read_holder(run.path / layout.LOCK)
    pid = holder.get("pid") if holder.get("host") == socket.gethostname() else None
    try:
        beat = json.loads(read_regular(run.path / layout.PROGRESS, _HEARTBEAT_LIMIT))
    except (OSError, ValueError, RecursionError):  # not protected: it may be missing or torn
        beat = None
    is_whole = isinstance(beat, dict) and all(isinstance(beat.get(name), int | float) for name in ("step", "time", "progress"))
    return {"progress": beat if is_whole else None, "pid": pid}


def _worst_step(run: Run) -> dict[str, float] | None:
    """Where the contact solver was farthest from a solution; ``None`` if no step has been recorded."""
    residual = run.series["residual_rms"]
    if not residual.size or not residual.max() > 0.0:
        return None
    worst = int(residual.argmax())
    return {"step": int(run.series["step"][worst]), "time": float(run.series["time"][worst])}


def hertz_deflection(run: Run, force: float | None) -> float | None:
    """Elastic deflection that rigid grains neglect, over the diameter: δ/(2a) of the largest mean contact force of a step.

    Two equal elastic spheres, δ = (3F/(4E* √a*))^⅔ with a* = a/2 and E* = E/(2(1−ν²)); the smallest grain of each material that
    has ``young`` and ``poisson``, and of these the largest value. Discs are treated as spheres of their radius.

    Args:
        run: The run.
        force: Largest mean contact force of a step [N].

    Returns:
        The ratio, or ``None`` if no grain has an elastic material or no force is known.
    """
    if force is None:
        return None
    try:
        materials = tomllib.loads(run.scenario_resolved)["materials"]
        elastic = {name: pair for name, material in materials.items() if (pair := _elastic(material)) is not None}
        return largest_deflection(run.model, force, elastic)
    except (StoreError, ValueError, RecursionError, KeyError, AttributeError):  # a file from elsewhere holds anything
        return None


def _elastic(material: Any) -> tuple[float, float] | None:
    if not isinstance(material, dict):
        return None
    young, poisson = material.get("young"), material.get("poisson")
    if not isinstance(young, int | float) or not isinstance(poisson, int | float) or not young > 0.0 or not -1.0 < poisson <= 0.5:
        return None
    return float(young), float(poisson)


def _walls(run: Run) -> list[str]:
    try:
        return list(run.wall_names)
    except DamagedRun:
        if run.info["summary"] is None:
            return []
        raise


def _seconds(start: str, end: str) -> float | None:
    try:
        return (datetime.fromisoformat(end) - datetime.fromisoformat(start)).total_seconds()
    except (ValueError, TypeError):
        return None
