"""The results as tables for people."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from comparison import Curve
from sequences import NEAR, Cost
from study import DISTANCES, HIGH, LEVELS, Results, Series, Single

_HEAD = """\
Time, sweep-equivalents and distance where rms, and with it maximum and energy in proportion, is
first below the residual (r); time [ms] from which the distance stays below a bound (d). Residuals
and distances over u_ref, "-": not reached."""


def as_text(results: Results) -> str:
    """All tables."""
    parts = [_HEAD, *(_single(single, LEVELS) for single in results.singles)]
    if results.high:
        parts.append("High accuracy: to rms 1e-8.")
        parts += [_single(single, (*LEVELS, HIGH)) for single in results.high]
    if results.sequences:
        parts.append(
            "Steps in sequence, warm, to the default tolerances: means of a step (d: medians)."
        )
        parts += [_series(series) for series in results.sequences]
        parts.append(
            "All scenes: time [ms] and distance of a step, steps that failed if any.\n\n"
            f"{_overview(results.sequences)}"
        )
    return "\n\n".join(parts)


def _single(single: Single, levels: Sequence[float]) -> str:
    bounds = [f"d {bound:g}" for bound in DISTANCES]
    rows = [
        [
            "method",
            *(f"r {level:g}" for level in levels),
            *bounds,
            *(["error of p"] if single.exact else []),
        ]
    ]
    for curve in single.curves:
        cells = [_cell(curve, level) for level in levels] + [
            _time(curve.near(bound)) for bound in DISTANCES
        ]
        rows.append(
            [curve.method, *cells, *([f"{single.exact[curve.method]:.1e}"] if single.exact else [])]
        )
    apart = (
        "" if single.apart is None else f"; from the other start one at distance {single.apart:.1e}"
    )
    return (
        f"{single.name} ({single.contacts} contacts; reference: a solution at rms "
        f"{single.reference:.1e}{apart})\n\n{table(rows)}"
    )


def _cell(curve: Curve, level: float) -> str:
    cost = curve.first(level)
    return "-" if cost is None else f"{_time(cost[1])} ms, {cost[0]:.0f}, {cost[2]:.1e}"


def _time(seconds: float | None) -> str:
    return (
        "-"
        if seconds is None
        else f"{1e3 * seconds:.3g}"
        if seconds < 1.0
        else f"{1e3 * seconds:.0f}"
    )


def _series(series: Series) -> str:
    text = (
        f"{series.name} ({series.contacts:.0f} contacts; references at rms {series.reference:.1e} "
        "or below)\n\n"
    )
    text += table(_cost_rows("method", series.costs))
    return text + (
        f"\n\n{table(_cost_rows('engine, started from', series.starts))}" if series.starts else ""
    )


def _cost_rows(title: str, costs: list[Cost]) -> list[list[str]]:
    rows = [
        [
            title,
            "sweeps",
            "median",
            "90 %",
            "time [ms]",
            "distance",
            "failed",
            *(f"d {bound:g} [ms]" for bound in NEAR),
        ]
    ]
    for cost in costs:
        numbers = [
            f"{cost.mean:.0f}",
            f"{cost.median:.0f}",
            f"{cost.ninety:.0f}",
            _time(cost.seconds),
            f"{cost.distance:.1e}",
        ]
        near = [_time(None if np.isinf(moment) else moment) for moment in cost.near] or [""] * len(
            NEAR
        )
        rows.append([cost.method, *numbers, f"{cost.failures} of {cost.steps}", *near])
    return rows


def _overview(sequences: Sequence[Series]) -> str:
    rows = [["method", *(series.name for series in sequences)]]
    for position, first in enumerate(sequences[0].costs):
        costs = [series.costs[position] for series in sequences]
        failed = [f", {cost.failures} failed" if cost.failures else "" for cost in costs]
        rows.append(
            [
                first.method,
                *(
                    f"{_time(c.seconds)}, {c.distance:.1e}{f}"
                    for c, f in zip(costs, failed, strict=True)
                ),
            ]
        )
    return table(rows)


def table(rows: list[list[str]]) -> str:
    """Rows as a Markdown table with aligned columns; the first row holds the headings."""
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    lines = [
        "| " + " | ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) + " |"
        for row in rows
    ]
    return "\n".join(
        [lines[0], "|" + "|".join("-" * (width + 2) for width in widths) + "|", *lines[1:]]
    )
