"""What was run, how it ended, and how good it is, as rows of names and values."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import timedelta
from typing import Any

import numpy as np

from multicor_cli.post.energy import BookLine, EnergyTable
from multicor_cli.store.stage_ends import StageEnd

CLOSURE_LIMIT = 1e-10
"""Books that close better than this hold rounding errors only."""

_OVERLAP = 1e-3
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True)
class ReportRow:
    """A line of a table.

    Attributes:
        name: What it is.
        value: Its value, as text.
        limit: Its limit, as text; empty if it has none.
        is_good: Whether it is within its limit.
    """

    name: str
    value: str
    limit: str = ""
    is_good: bool = True


def describe_run(info: dict[str, Any]) -> list[ReportRow]:
    """What was run and how it ended, from `multicor_cli.store.run_info`."""
    made = info["provenance"]
    reason = info["stop_reason"]
    status = info["status"] if not reason or reason == info["status"] else f"{info['status']} ({reason})"
    rows = [
        ("status", status),
        ("time", _number(info["time"], "s")),
        ("steps", _number(info["step"])),
        ("stages", ", ".join(info["stages"])),
        ("grains", _number(info["grain_count"])),
        ("walls", ", ".join(info["walls"]) or "none"),
        ("frames", f"{info['frame_count']:,}, and {info['series_count']:,} rows of the time series"),
        ("seed", str(made.get("seed", "–"))),
        ("started", _moment(info["started"])),
        ("finished", _moment(info["finished"])),
        ("wall time", "–" if info["duration"] is None else str(timedelta(seconds=round(info["duration"])))),
        ("version", f"multicor {made['multicor_version']}" if "multicor_version" in made else "–"),
        ("command", made.get("command", "–")),
        ("processor", str(made.get("cpu") or "–")),
        ("threads", str(made.get("threads") or "–")),
        ("state digest", str(info["state_digest"] or "–")),
    ]
    return [ReportRow(name, str(value)) for name, value in rows if value != "–"]


def describe_stages(info: dict[str, Any]) -> list[ReportRow]:
    """Why and when each stage ended that is over, as far as the run has kept it."""
    return [ReportRow(end.name, end.text) for end in map(StageEnd.of_document, info["stage_ends"])]


def describe_quality(info: dict[str, Any]) -> list[ReportRow]:
    """Closure of the books, overlap, residuals and counters of the solver."""
    solver, heat = info["solver"], info["heat"]
    rows = [
        _limited("energy closure", info["energy_closure"], CLOSURE_LIMIT),
        _limited("heat closure", info["heat_closure"], CLOSURE_LIMIT),
        _limited("largest overlap over the smaller radius", info["max_overlap"], _OVERLAP),
        _limited("steps that did not converge", solver["unconverged_steps"], 0, f" of {_number(info['step'])}"),
        ReportRow("largest residual over the reference velocity (rms of a step)", _number(solver["residual_rms_max"])),
        ReportRow("sweeps per step", _number(solver["sweeps_mean"])),
        ReportRow("largest contact force (mean of a step)", _number(info["max_contact_force"], "N")),
        ReportRow("Hertz deflection over the diameter at that force", _number(info["hertz_deflection"])),
        ReportRow("negative share of the losses at contacts", _number(info["negative_loss_share"])),
    ]
    if heat is not None:
        rows.append(ReportRow("largest Biot number", _number(heat["max_biot"])))
    return [row for row in rows if row.value != "–"]


def describe_books(table: EnergyTable, entries: Sequence[BookLine]) -> list[ReportRow]:
    """Some lines of the energy books at the end [J]; what never happened is left out."""
    lines = [(entry.label, table.books[entry.name]) for entry in entries if entry.name in table.books]
    return [ReportRow(label, _number(float(values[-1]), "J")) for label, values in lines if np.any(values) or "imbalance" in label]


def _limited(name: str, value: float | None, limit: float, more: str = "") -> ReportRow:
    if value is None:
        return ReportRow(name, "–")
    return ReportRow(name, _number(value) + more, _number(limit), value <= limit)


def _number(value: Any, unit: str = "") -> str:
    return "–" if value is None else f"{pretty(value)} {unit}".strip()


def pretty(value: float, digits: int = 4) -> str:
    """A number for people: with a real minus sign, and powers of ten as the scripts of the page write them."""
    if isinstance(value, int):
        return f"{value:,}".replace("-", "−")
    mantissa, _, exponent = f"{value:.{digits}g}".partition("e")
    power = f"·10{str(int(exponent)).translate(_SUPERSCRIPTS)}" if exponent else ""
    return mantissa.replace("-", "−") + power


def _moment(text: str | None) -> str:
    return "–" if not text else text.replace("T", " ").replace("+00:00", " UTC")
