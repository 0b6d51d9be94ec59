"""What was run, how it ended, and how good it is, as rows of names and values."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import timedelta
from typing import Any

import numpy as np

from multicor_cli.checks import Check, Verdict
from multicor_cli.post import PostError, force_network, rheology
from multicor_cli.post.energy import BookLine, EnergyTable
from multicor_cli.store import Run
from multicor_cli.store.documents import StageEnd, record_of
from multicor_cli.text import unit_sign

_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True)
class ReportRow:
    """A row of a table; of a value with a limit, the verdict, and what to do if it is not ok."""

    name: str
    value: str
    limit: str = ""
    verdict: str = "ok"
    note: str = ""


def describe_run(info: dict[str, Any]) -> list[ReportRow]:
    """What was run and how it ended, from `multicor_cli.store.run_info`."""
    made, status, reason = info["provenance"], info["status"], info["stop_reason"]
    seconds = info["duration"]
    rows = {
        "status": status if not reason or reason == status else f"{status} ({reason})",
        "time": _number(info["time"], "s"),
        "steps": _number(info["step"]),
        "stages": ", ".join(info["stages"]),
        "grains": _number(info["grain_count"]),
        "walls": ", ".join(info["walls"]) or "none",
        "frames": f"{info['frame_count']:,}, and {info['series_count']:,} rows of the time series",
        "seed": made.get("seed", "–"),
        "started": _moment(info["started"]),
        "finished": _moment(info["finished"]),
        "wall time": "–" if seconds is None else timedelta(seconds=round(seconds)),
        "version": f"multicor {made['multicor_version']}" if "multicor_version" in made else "–",
        "command": made.get("command", "–"),
        "processor": made.get("cpu") or "–",
        "threads": made.get("threads") or "–",
        "state digest": info["state_digest"] or "–",
    }
    return [ReportRow(name, str(value)) for name, value in rows.items() if value != "–"]


def describe_stages(info: dict[str, Any]) -> list[ReportRow]:
    """Why and when each stage ended that is over, as far as the run has kept it."""
    ends = (record_of(StageEnd, end) for end in info["stage_ends"])
    return [ReportRow(end.name, end.text) for end in ends]


def describe_checks(checks: Sequence[Check]) -> list[ReportRow]:
    """What was checked of the run."""

    def note(check: Check) -> str:
        return "" if check.verdict is Verdict.OK else f"{check.meaning} {check.remedy}"

    return [ReportRow(c.name, c.text, c.limit, c.verdict.value, note(c)) for c in checks]


def describe_solver(info: dict[str, Any]) -> list[ReportRow]:
    """Residuals and counters of the solver, and the largest force."""
    solver, force = info["solver"], _number(info["max_contact_force"], "N")
    residual = _number(solver["residual_rms_max"])
    rows = [
        ReportRow("largest residual over the reference velocity (rms of a step)", residual),
        ReportRow("sweeps per step", _number(solver["sweeps_mean"])),
        ReportRow("largest contact force (mean of a step)", force),
    ]
    return [row for row in rows if row.value != "–"]


def describe_rheology(run: Run) -> list[ReportRow]:
    """Rheology of a layer that two walls shear or of a cell, with errors; nothing of other runs."""
    try:
        found = rheology(run)
    except PostError:
        return []
    rows = []
    for q in found.quantities:
        mean, error, note = found.mean[q.name], found.error[q.name], found.spread[q.name].note()
        if math.isfinite(mean):
            within = f" ± {pretty(error, 2)}" if math.isfinite(error) else ""
            unit = "" if q.unit == "1" else f" {unit_sign(q.unit)}"
            value = f"{pretty(mean)}{within}{unit}" + (f" ({note})" if note else "")
            rows.append(ReportRow(q.label.strip(), value))
    return rows


def describe_forces(run: Run) -> list[ReportRow]:
    """The contacts of the last frame with forces; nothing where there are none."""
    try:
        network = force_network(run)
    except PostError:
        return []
    if not network.i.size:
        return []
    return [
        ReportRow("at", f"t = {network.time:.6g} s"),
        *(ReportRow(name.strip(), pretty(value)) for name, value in network.rows),
    ]


def describe_books(table: EnergyTable, entries: Sequence[BookLine]) -> list[ReportRow]:
    """Some lines of the energy books at the end [J]; what never happened is left out."""
    return [
        ReportRow(entry.label, _number(float(table.books[entry.name][-1]), "J"))
        for entry in entries
        if entry.name in table.books
        and (np.any(table.books[entry.name]) or "imbalance" in entry.label)
    ]


def _number(value: Any, unit: str = "") -> str:
    return "–" if value is None else f"{pretty(value)} {unit}".strip()


def pretty(value: float, digits: int = 4) -> str:
    """A number with a real minus sign, and powers of ten as the scripts of the page write them."""
    if isinstance(value, int):
        return f"{value:,}".replace("-", "−")
    mantissa, _, exponent = f"{value:.{digits}g}".partition("e")
    power = f"·10{str(int(exponent)).translate(_SUPERSCRIPTS)}" if exponent else ""
    return mantissa.replace("-", "−") + power


def _moment(text: str | None) -> str:
    return "–" if not text else text.replace("T", " ").replace("+00:00", " UTC")
